/* surface.cl: points of spheres that rays have met, and whether a sphere stands between a point and a light. */

/* Whether a sphere stands between a point of a surface and a light. */

/* |f|^2 - r^2, the power of P, given f = B.center - P. With D = B.center - C it is also D.(D - 2p) + (R - r)(R + r), as
 * |p| = R: exact for concentric spheres, even one ulp apart. The errors go with the size of the terms. */
static REAL power_of(const Start P, const Sphere B, const Real3 f) {
    const Real3 D = difference(B.center, P.own.center), g = difference(f, P.p);
    const REAL ff = DOT(f, f), rr = B.r * B.r;
    const REAL shift = DOT(D, g), step = (P.own.r - B.r) * (P.own.r + B.r);
    const REAL size = (shift < 0 ? -shift : shift) + (step < 0 ? -step : step);
    REAL_MASK by_centres = size < ff + rr;
    if (HAS(WITH_SHAPES)) by_centres = by_centres & !P.stretched;
    const REAL c = by_centres ? shift + step : ff - rr;
    if (REAL_BYTES == 8) return c;
    /* |B.center|^2 - r^2 comes from the host: what is added to it is small where P is near the eye. */
    const Real3 h = difference(P.from_eye, scaled(B.center, 2));
    return P.near_eye ? B.c + DOT(P.from_eye, h) : c;
}

/* Whether a sphere B, not the own one, stands between P and a light, and so stops the light.
 *
 * f: from P to the centre of B; w: from P to the light; c: the power of P; r: the radius of B; far: 0 for a parallel
 * light, where w has length 1 and every t > 0 counts; else 1, and t in (0, 1) counts. outside: the sign of |L - C_B|^2
 * - r_B^2, computed exactly by the host; 1 for a parallel light. The equation is a t^2 - 2 b t + c = 0, a = w.w, b =
 * f.w, c = |f|^2 - r_B^2. No root is computed, only signs: of the product c of the roots, of their sum 2b, and of a -
 * 2b + c = |L - C_B|^2 - r_B^2, the value at t = 1. c > 0, P outside: two roots of one sign if the discriminant is >=
 * 0; positive if b > 0; the first is below 1 if the light is inside, or if their mean b/a is below 1. c < 0, P inside:
 * one positive root, below 1 if the light is strictly outside. c = 0, P on B: the root 0 does not count, the other one
 * is 2b/a.
 */
static REAL_MASK stands_between(const Real3 f, const Real3 w, const REAL c, const REAL r, const int far,
                                const int light_side) {
    const REAL a = DOT(w, w), b = DOT(f, w);
    const Real3 cross = cross_of(f, w);
    const REAL bb = b * b, arr = a * (r * r);
    const REAL_MASK meets = (bb < arr ? bb - a * c : arr - DOT(cross, cross)) >= 0;
    const REAL_MASK ahead = b > 0;
    const REAL_MASK enters = (c > 0) & meets & ahead;
    const REAL_MASK leaves = (c < 0) | ((c == 0) & ahead);
    if (light_side < 0) return c > 0; /* P outside and the light inside: surely one root between */
    if (light_side == 0) return enters & (b < a);
    return far ? (enters & (b < a)) | leaves : enters | leaves;
}

static REAL_MASK sphere_stops(const Start P, const Sphere B, const Real3 w, const int far, const int light_side) {
    const Real3 f = towards(P, B.center);
    return stands_between(f, w, power_of(P, B, f), B.r, far, light_side);
}

/* What sphere_stops() tells of a sphere. The ellipsoid is decided in its own axes, where it is one. */
static REAL_MASK ellipsoid_stops(const Geometry geometry, const Start P, const Sphere B, const int map, const Real3 w,
                                 const int far, const int light_side) {
    __global const Map *K = geometry.map + map;
    const Real3 f = towards(P, B.center);
    const Real3 F = {DOT(K->camera_x, f), DOT(K->camera_y, f), DOT(K->camera_z, f)};
    const Real3 G = {DOT(K->camera_x, w), DOT(K->camera_y, w), DOT(K->camera_z, w)};
    return stands_between(F, G, DOT(F, F) - B.r * B.r, B.r, far, light_side);
}

/* Spheres and ellipsoids between a point and a light. */

/* Where small_sphere_may_meet() is asked, too. */
#define SMALL_SPHERES (HAS(WITH_PREFETCH) && REAL_BYTES == 8 && !HAS(WITH_ELLIPSOIDS))

/* Whether the float32 filter leaves it open, for any lane of `may`, that the sphere stops the ray.
 *
 * A light at a point L: the filter constant is (L - C, c'), with c' made from |L - C|^2 - r^2 as for rays from the eye.
 * The line from the light to the point is a ray from a fixed point, too, so the proof of sphere_may_meet holds with
 * d = -w. There L - C is rounded from the exact difference, and turning it into camera space adds an error of 2^-50 of
 * it, for which 5.01 u has room. The proof needs a >= 1 against underflow alone, and |w|^2 >= 2^-40 does as well;
 * shorter rays are left to sphere_stops().
 *
 * A parallel light: the filter constant is (U, V, r'^2), with (U, V) the centre's coordinates across the light. A ray
 * from P, which is at (u, v), that meets the sphere passes its centre within r: sqrt((U - u)^2 + (V - v)^2) <= r. Let
 * e = 2^-24. Rounding the coordinates moves each difference by at most e (|U| + |u|) <= 2.01 e (|U| + r), or the same
 * of V, and the sum of squares is off by 3 e of itself: both together are less than what r' has more than r,
 * r' = r + 8 e (|U| + |V| + r) + 2^-60 [DISC_ROUNDINGS = 8]. See disc_filter in cltrace/plan/shapes/sphere.py.
 */
static int sphere_filter_leaves(const Scene *scene, const ShadowRay ray, const int index, const MASK may) {
    if (!HAS(WITH_FILTER)) return 1;
    const float4 s = scene->light_filter[(long)ray.number * scene->count + index];
    if (!ray.at_point) {
        const FLOAT du = s.x - ray.u, dv = s.y - ray.v;
        return ANY(may & (FMA(du, du, dv * dv) <= s.z));
    }
    if (ray.touches) return 1;
    const MASK open = may & sphere_may_meet(dot_float(ray.w32, s), ray.a, s);
    if (!SMALL_SPHERES || !ANY(open)) return ANY(open);
    const float r = (float)(scene->geometry.center_radius[index].w * scene->unit);
    return ANY(open & small_sphere_may_meet(ray.w32, ray.a, s, r));
}

/* On which side of a sphere a light is: of abi.py's light_side. Where c' > 0 (see sphere_filter_leaves()), |L - C|^2 -
 * r^2 is greater still, so it is outside: of many spheres, that waits for no further array. */
static int side_of_light(const Scene *scene, const ShadowRay ray, const int index) {
    const long seen = (long)ray.number * scene->count + index;
    if (SMALL_SPHERES && ray.at_point && scene->light_filter[seen].w > 0) return 1;
    return scene->light_side[seen];
}

/* Whether a sphere or an ellipsoid that is not the own surface stops the rays. */
static REAL_MASK stands_in_the_way(const Scene *scene, const ShadowRay ray, const Start start, const int index,
                                   const int side) {
    const Sphere sphere = sphere_at(scene->geometry, index);
    const int map = MAP_OF(scene->geometry, index);
    return map ? ellipsoid_stops(scene->geometry, start, sphere, map, ray.w, ray.at_point, side)
               : sphere_stops(start, sphere, ray.w, ray.at_point, side);
}

/* The lanes of `may` that a sphere stops. */
static MASK sphere_shadow(const Scene *scene, const ShadowRay ray, const Start start, const int index, MASK may,
                          Work *work) {
    if (!HAS(WITH_INSIDE)) may = may & (ray.own != index);
    if (!sphere_filter_leaves(scene, ray, index, may)) {
        COUNT(FILTERED, may);
        return 0;
    }
    COUNT(DECIDED, may);
    const int side = side_of_light(scene, ray, index);
    const REAL_MASK stops = stands_in_the_way(scene, ray, start, index, side);
    if (!HAS(WITH_INSIDE)) return may & TO_MASK(stops);
    const REAL_MASK self = TO_REAL_MASK(ray.own == index);
    return may & TO_MASK((self & (start.side < 0) & ((REAL)side > 0)) | (!self & stops));
}

/* Points of spheres and ellipsoids that rays have met: their normals, and what starts there. */
#ifdef WITH_ELLIPSOIDS
/* Puts the spots that are on ellipsoids into an intersection. inside: whether the ray came from there. */
static void stretch(Intersection *at, const Spot spot, const REAL_MASK inside) {
    const REAL_MASK here = spot.stretched;
    PUT3(PUT_WHERE, here, at->normal, spot.n);
    PUT3(PUT_WHERE, here, at->q, spot.q);
    PUT_WHERE(here, at->spread, spot.spread);
    PUT3(PUT_WHERE, here, at->start.p, spot.p);
    PUT_WHERE(here, at->start.support, spot.support);
    PUT_WHERE(here, at->start.side, inside ? (REAL)-1 : (REAL)1);
    at->start.stretched = here;
    if (REAL_BYTES == 8) return;
    at->start.from_eye = chosen(here, sum3(at->start.own.center, spot.p), at->start.from_eye);
    PUT_WHERE(here, at->start.near_eye, 0);
}

/* The same of what a ray from the eye has met. */
static __attribute__((always_inline)) void stretch_at(const Frame frame, const Scene *scene, const Ray ray,
                                                      const Hit hit, const INT round, Intersection *at) {
    const Ball ball = balls_of(scene->geometry, round);
    if (ANY((round >= 0) & (ball.map != 0)))
        stretch(at, spot_at(frame, scene->geometry, from_eye(scene->geometry, eye_ray(ray)), ball, hit.t), hit.inside);
}
#else
#define stretch(at, spot, inside)
#define stretch_at(frame, scene, ray, hit, round, at)
#endif

#ifdef WITH_LEAVING
/* The same start in the world, of points of spheres. */
static void start_in_world(const Frame frame, const Scene *scene, const INT id, Intersection *at) {
    const Ball ball = balls_of(scene->geometry, SPHERE_OR_NONE(scene->geometry, id));
    Start *start = &at->start;
    start->anchor = ball.center;
    start->step = turned_to_world(frame, start->p);
    start->reach = size_of(start->p);
    start->index = id;
    start->q = at->q;
}
#else
#define start_in_world(frame, scene, id, at)
#endif

/* Where points of spheres are on a texture: by their longitude about the y axis, 1/2 where z is largest, and by the
 * angle from the y axis, which near the poles keeps its digits as the arc cosine would not. It is the unit normal's
 * before any transform that counts: an ellipsoid's in its own axes, and a sphere's in the world. */
static void map_spheres(const Frame frame, Intersection *at) {
    Real3 q = turned_to_world(frame, at->normal);
    if (HAS(WITH_ELLIPSOIDS)) q = chosen(at->start.stretched, at->q, q);
    at->u = (REAL)0.5f + turns_of(q.x, q.z);
    at->v = 2 * turns_of(sqrt(q.x * q.x + q.z * q.z), q.y);
}

/* Puts what a ray from the eye has met into an intersection. */
static __attribute__((always_inline)) void sphere_put(const Frame frame, const Scene *scene, const Ray ray,
                                                      const Hit hit, Intersection *at) {
    const INT round = SPHERE_OR_NONE(scene->geometry, hit.id);
    const Sphere sphere = spheres_of(scene->geometry, round);
    at->normal = sphere_surface(sphere, hit.from_center);
    at->start = start_at(ray, sphere, at->normal, hit.t);
    if (HAS(WITH_SHAPES)) {
        at->q = at->normal;
        at->spread = 1;
    }
    stretch_at(frame, scene, ray, hit, round, at);
    if (MAPPED(scene)) map_spheres(frame, at);
    if (HAS(WITH_PLACED)) start_in_world(frame, scene, hit.id, at);
}

#ifdef WITH_BOUNCES
/* The same of a ray that left a surface. */
static __attribute__((always_inline)) void sphere_put_from(const Frame frame, const Scene *scene, const Leaving ray,
                                                           const Met met, Intersection *at) {
    const INT round = SPHERE_OR_NONE(scene->geometry, met.id);
    const Spot spot = spot_at(frame, scene->geometry, ray, balls_of(scene->geometry, round), met.at.t);
    at->normal = spot.n;
    const Sphere sphere = spheres_of(scene->geometry, round);
    const Real3 point = sum3(sphere.center, scaled(at->normal, sphere.r));
    at->start = start_of(sphere, at->normal, met.at.inside ? (REAL)-1 : (REAL)1, point);
    if (HAS(WITH_SHAPES)) {
        at->q = spot.q;
        at->spread = 1;
    }
    stretch(at, spot, met.at.inside);
    if (MAPPED(scene)) map_spheres(frame, at);
    if (HAS(WITH_PLACED)) start_in_world(frame, scene, met.id, at);
}
#endif

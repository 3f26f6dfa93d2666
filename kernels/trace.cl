/* trace.cl: from a ray to its colour, as in the course's tutorial and in cltrace/reference/trace.py.
 *
 * Functions of a packet get what they need as it is, scene and ray and counters apart, although it is up to nine
 * arguments: a struct around them all is copied by compilers where the parts are not.
 */

#ifdef WITH_TRIANGLES
/* The number that an array has for each lane's index, -1 for none. */
static __attribute__((noinline)) INT numbers_at(__global const int *array, const INT index) {
    const int one = common_of(index);
    if (one >= 0) return index < 0 ? (INT)-1 : (INT)array[one];
    int each[W], number[W];
    STORE_LANES(index, each);
#pragma unroll
    for (int lane = 0; lane < W; lane++) number[lane] = array[max(each[lane], 0)];
    return index < 0 ? (INT)-1 : (INT)EACH_LANE(number, );
}

/* The index of the material of each lane's surface, -1 for none. */
static __attribute__((always_inline)) INT materials_of(const Scene scene, const INT id) {
    return scene.materials == 1 ? (id < 0 ? (INT)-1 : (INT)0) : numbers_at(scene.material_of, id);
}

/* As a function of its own it would keep intersections in memory, as flatten() would: frames with mirrors take 0.9 of the time. */
static __attribute__((always_inline)) Intersection material_at(const Scene scene, const INT id);
#endif

/* Material of each lane's hit. Lanes without a hit keep harmless values. */
static Intersection material_at(const Scene scene, const INT id) {
    Intersection at;
    at.hit = id >= 0;
    at.ambient.x = at.ambient.y = at.ambient.z = at.diffuse.x = at.diffuse.y = at.diffuse.z = at.ks = at.exponent = 0;
#ifdef WITH_SHADING
#ifdef WITH_TRIANGLES
    /* Neighbours are on different triangles, but mostly of one material. */
    INT left = materials_of(scene, id);
    do {
        const int one = LARGEST(left);
        const SHADE_MASK here = TO_SHADE_MASK(left == one);
        const shade8 m = scene.material[max(one, 0)];
        left = left == one ? (INT)-1 : left;
#else
    FOR_EACH_INDEX(one, id) {
        const SHADE_MASK here = TO_SHADE_MASK(id == one);
        const shade8 m = scene.material[scene.material_of[one]];
#endif
        PUT_WHERE(here, at.ambient.x, (SHADE)m.s0);
        PUT_WHERE(here, at.ambient.y, (SHADE)m.s1);
        PUT_WHERE(here, at.ambient.z, (SHADE)m.s2);
        PUT_WHERE(here, at.diffuse.x, (SHADE)m.s3);
        PUT_WHERE(here, at.diffuse.y, (SHADE)m.s4);
        PUT_WHERE(here, at.diffuse.z, (SHADE)m.s5);
        PUT_WHERE(here, at.ks, (SHADE)m.s6);
        PUT_WHERE(here, at.exponent, (SHADE)m.s7);
    }
#ifdef WITH_TRIANGLES
    while (RARELY(ANY(left >= 0)));
#endif
#endif
#ifdef WITH_BLACK
    at.black = TO_MASK((at.diffuse.x <= 0) & (at.diffuse.y <= 0) & (at.diffuse.z <= 0) & (at.ks <= 0));
#endif
    return at;
}

#ifdef WITH_ELLIPSOIDS
/* Puts the spots that are on ellipsoids into an intersection. inside: whether the ray came from there. */
static void stretch(Intersection *at, const Spot spot, const REAL_MASK inside) {
    const REAL_MASK here = spot.stretched;
    PUT_WHERE(here, at->normal.x, spot.n.x);
    PUT_WHERE(here, at->normal.y, spot.n.y);
    PUT_WHERE(here, at->normal.z, spot.n.z);
    PUT_WHERE(here, at->q.x, spot.q.x);
    PUT_WHERE(here, at->q.y, spot.q.y);
    PUT_WHERE(here, at->q.z, spot.q.z);
    PUT_WHERE(here, at->spread, spot.spread);
    PUT_WHERE(here, at->start.p.x, spot.p.x);
    PUT_WHERE(here, at->start.p.y, spot.p.y);
    PUT_WHERE(here, at->start.p.z, spot.p.z);
    PUT_WHERE(here, at->start.support, spot.support);
    PUT_WHERE(here, at->start.side, inside ? (REAL)-1 : (REAL)1);
    at->start.stretched = here;
#if REAL_BYTES == 4
    PUT_WHERE(here, at->start.from_eye.x, at->start.own.center.x + spot.p.x);
    PUT_WHERE(here, at->start.from_eye.y, at->start.own.center.y + spot.p.y);
    PUT_WHERE(here, at->start.from_eye.z, at->start.own.center.z + spot.p.z);
    PUT_WHERE(here, at->start.near_eye, 0);
#endif
}
#endif

#if defined(WITH_TRIANGLES) && defined(WITH_NORMAL)
/* Where there are no spheres, all that was hit are triangles. */
#ifdef ONLY_TRIANGLES
#define PUT_ON_FACES(mask, variable, value) variable = (value)
#else
#define PUT_ON_FACES(mask, variable, value) PUT_WHERE(mask, variable, value)
#endif

#if REAL_BYTES == 4
/* n, in camera space, but for the lanes of `lost`: of what is too short or too long to be squared in float, another unit is
 * taken; and where float has nothing of N, since the corners are as one in it, the normal is the way back along the ray d. */
static __attribute__((noinline)) Real3 rescued_normals(const Frame frame, const Real3 N, const Real3 d, const REAL_MASK lost,
                                                       const Real3 n) {
    const REAL size = larger_of(fabs(N.x), larger_of(fabs(N.y), fabs(N.z)));
    const REAL_MASK known = (size > 0) & (N.x - N.x == 0) & (N.y - N.y == 0) & (N.z - N.z == 0);
    const Real3 m = {N.x / size, N.y / size, N.z / size}, turned = turned_to_camera(frame, m);
    const REAL over = 1 / sqrt(DOT(m, m)), back = -1 / sqrt(DOT(d, d));
    const Real3 own = {known ? turned.x * over : d.x * back, known ? turned.y * over : d.y * back,
                       known ? turned.z * over : d.z * back};
    const Real3 normal = {lost ? own.x : n.x, lost ? own.y : n.y, lost ? own.z : n.z};
    return normal;
}
#endif

/* Puts the points that are on triangles into an intersection. id: what the rays met, along d; shares: where on it; P: the
 * point, rounded, in camera space.
 *
 * As a function of its own it would keep all intersections in memory, with a copy for each one that calls: frames with
 * mirrors take 0.85 of the time. */
static __attribute__((always_inline)) void flatten(const Frame frame, const Scene scene, const INT id, const Shares shares,
                                                   const Real3 d, const Real3 P, Intersection *at) {
    const REAL_MASK here = TO_REAL_MASK(id >= scene.spheres.first);
    const INT number = TO_MASK(here) ? id - scene.spheres.first : (INT)-1;
    const FacePoint point = face_point(shares);
    const Real3 N = shading_normals(scene, number, point.weights);
    const REAL square = DOT(N, N), over = 1 / sqrt(square);
    const Real3 m = {N.x * over, N.y * over, N.z * over};
    Real3 n = turned_to_camera(frame, m);
#if REAL_BYTES == 4
    const REAL_MASK lost = here & !((square > 0x1p-100f) & (square < INFINITY));
    if (RARELY(ANY(TO_MASK(lost)))) n = rescued_normals(frame, N, d, lost, n);
#endif
    /* The shading normal faces the ray; the side from which that came is the one of the triangle's own plane. Only rays that
     * go on ask for it. */
#ifdef WITH_BOUNCES
    const REAL_MASK back = TO_REAL_MASK((fourths_of(scene.spheres.face, number) & 1) != 0);
    const REAL side = (shares.all < 0) == back ? (REAL)-1 : (REAL)1;
#else
    const REAL side = 1;
#endif
    const REAL turn = DOT(n, d) > 0 ? -side : side;
    PUT_ON_FACES(here, at->normal.x, turn * n.x);
    PUT_ON_FACES(here, at->normal.y, turn * n.y);
    PUT_ON_FACES(here, at->normal.z, turn * n.z);
    PUT_ON_FACES(here, at->q.x, point.q.x);
    PUT_ON_FACES(here, at->q.y, point.q.y);
    PUT_ON_FACES(here, at->q.z, point.q.z);
    PUT_ON_FACES(here, at->spread, (REAL)1);
    Start *start = &at->start;
    PUT_ON_FACES(here, start->own.center.x, P.x);
    PUT_ON_FACES(here, start->own.center.y, P.y);
    PUT_ON_FACES(here, start->own.center.z, P.z);
    PUT_ON_FACES(here, start->own.r, (REAL)0);
    PUT_ON_FACES(here, start->p.x, (REAL)0);
    PUT_ON_FACES(here, start->p.y, (REAL)0);
    PUT_ON_FACES(here, start->p.z, (REAL)0);
    PUT_ON_FACES(here, start->support, (REAL)0);
    PUT_ON_FACES(here, start->side, side);
    PUT_ON_FACES(here, start->stretched, here);
    start->index = id;
    start->q = at->q;
#if REAL_BYTES == 4
    PUT_ON_FACES(here, start->from_eye.x, P.x);
    PUT_ON_FACES(here, start->from_eye.y, P.y);
    PUT_ON_FACES(here, start->from_eye.z, P.z);
    PUT_ON_FACES(here, start->near_eye, 0);
#endif
#ifdef WITH_UV
    map_triangles(scene, number, point.weights, at);
#endif
}

#ifndef ONLY_TRIANGLES
/* The same start in the world, of points of spheres. */
static void start_in_world(const Frame frame, const Scene scene, const INT id, Intersection *at) {
    const Ball ball = balls_of(scene.spheres, SPHERE_OR_NONE(scene.spheres, id));
    Start *start = &at->start;
    start->anchor = ball.center;
    start->step = turned_to_world(frame, start->p);
    start->reach = size_of(start->p);
    start->index = id;
    start->q = at->q;
}
#endif
#endif

/* Normal and material of each lane's hit. */
static Intersection intersection_at(const Frame frame, const Scene scene, const Ray ray, const Hit hit) {
    Intersection at = material_at(scene, hit.id);
#ifdef WITH_NORMAL
#ifdef ONLY_TRIANGLES
    const Real3 P = POINT_OF(ray, hit.t);
    flatten(frame, scene, hit.id, hit.shares, ray.d, P, &at);
#else
    const INT round = SPHERE_OR_NONE(scene.spheres, hit.id);
    const Sphere sphere = spheres_of(scene.spheres, round);
    at.normal = sphere_surface(sphere, hit.from_center);
    at.start = start_at(ray, sphere, at.normal, hit.t);
#ifdef WITH_SHAPES
    at.q = at.normal;
    at.spread = 1;
#endif
#ifdef WITH_ELLIPSOIDS
    const Ball ball = balls_of(scene.spheres, round);
    if (ANY((round >= 0) & (ball.map != 0)))
        stretch(&at, spot_at(frame, scene.spheres, ray.leaving, ball, hit.t), hit.inside);
#endif
#ifdef WITH_UV
    map_spheres(frame, &at);
#endif
#ifdef WITH_TRIANGLES
    start_in_world(frame, scene, hit.id, &at);
    const Real3 P = POINT_OF(ray, hit.t);
    if (ANY(hit.id >= scene.spheres.first)) flatten(frame, scene, hit.id, hit.shares, ray.d, P, &at);
#endif
#endif
#ifdef WITH_TEXTURES
    paint(scene, hit.id, &at);
#endif
#endif
    return at;
}

/* The colour of each ray that hit. d: the rays' directions, a: d.d; own: index of the sphere that was hit; rays: each
 * lane's shadow rays, counted up. */
static Shade3 shade(const Scene scene, const Real3 d, const REAL a, const Intersection at, const INT own, INT *rays,
                    Work *work) {
    Shade3 color = at.ambient;
#ifdef WITH_LIGHTS
    const SHADE over = 1 / sqrt(TO_SHADE(a));
    const Shade3 view = {TO_SHADE(d.x) * over, TO_SHADE(d.y) * over, TO_SHADE(d.z) * over};
    for (int number = 0; number < scene.lights.w; number++)
        color = illuminate(scene, number, kind_of(scene.lights, number), at, own, view, color, rays, work);
#endif
    return color;
}

#ifdef WITH_BOUNCES
#ifdef WITH_TRIANGLES
/* flatten() for rays that left a surface. */
static void flatten_from(const Frame frame, const Scene scene, const Leaving ray, const Met met, Intersection *at) {
    const Real3 C = ray.center, p = ray.p, w = ray.w;
    const real4 eye = scene.spheres.eye;
    const Real3 way = {(C.x - eye.x) + (p.x + met.t * w.x), (C.y - eye.y) + (p.y + met.t * w.y),
                       (C.z - eye.z) + (p.z + met.t * w.z)};
    flatten(frame, scene, met.id, met.shares, ray.d, turned_to_camera(frame, way), at);
}
#endif

/* The same for rays that left a surface. */
static Intersection intersection_from(const Frame frame, const Scene scene, const Leaving ray, const Met met) {
    Intersection at = material_at(scene, met.id);
#ifdef ONLY_TRIANGLES
    flatten_from(frame, scene, ray, met, &at);
#else
    const INT round = SPHERE_OR_NONE(scene.spheres, met.id);
    const Spot spot = spot_at(frame, scene.spheres, ray, balls_of(scene.spheres, round), met.t);
    at.normal = spot.n;
    const Sphere sphere = spheres_of(scene.spheres, round);
    const Real3 C = sphere.center, n = at.normal;
    const Real3 point = {C.x + sphere.r * n.x, C.y + sphere.r * n.y, C.z + sphere.r * n.z};
    at.start = start_of(sphere, n, met.inside ? (REAL)-1 : (REAL)1, point);
#ifdef WITH_SHAPES
    at.q = spot.q;
    at.spread = 1;
#endif
#ifdef WITH_ELLIPSOIDS
    stretch(&at, spot, met.inside);
#endif
#ifdef WITH_TEXTURES
    map_spheres(frame, &at);
#endif
#ifdef WITH_TRIANGLES
    start_in_world(frame, scene, met.id, &at);
    if (ANY(met.id >= scene.spheres.first)) flatten_from(frame, scene, ray, met, &at);
#endif
#endif
#ifdef WITH_TEXTURES
    paint(scene, met.id, &at);
#endif
    return at;
}
#endif

/* What a packet of rays sees; lanes that hit nothing keep what they have in `pixels`. tile: the packet's place in the
 * picture, in units of TILE x TILE pixels. */
static Pixels trace(const Frame frame, const Scene scene, const Ray ray, const int2 tile, Pixels pixels, Work *work) {
    const Hit hit = pixels.hit = closest_hit(scene, ray, tile, work);
#ifdef WITH_INTERSECTION
    if (!ANY(hit.id >= 0)) return pixels;
    const Intersection at = intersection_at(frame, scene, ray, hit);
#ifdef WITH_SHADING
#ifdef WITH_BOUNCES
    const Shade3 color = follow(frame, scene, ray, at, hit.id, &pixels, work);
#else
    const Shade3 color = shade(scene, ray.d, ray.a, at, hit.id, &pixels.rays, work);
#endif
    const SHADE_MASK any_hit = TO_SHADE_MASK(at.hit);
    PUT_WHERE(any_hit, pixels.color.x, color.x);
    PUT_WHERE(any_hit, pixels.color.y, color.y);
    PUT_WHERE(any_hit, pixels.color.z, color.z);
#endif
#ifdef OUT_NORMAL
    const Real3 n = at.normal;
    const Real3 facing = {at.start.side * n.x, at.start.side * n.y, at.start.side * n.z};
    const Float3 world = to_world(frame, facing);
    pixels.normal.x = at.hit ? world.x : (FLOAT)0;
    pixels.normal.y = at.hit ? world.y : (FLOAT)0;
    pixels.normal.z = at.hit ? world.z : (FLOAT)0;
#endif
#ifdef OUT_UV
    pixels.u = at.hit ? TO_FLOAT(at.u) : (FLOAT)0;
    pixels.v = at.hit ? TO_FLOAT(at.v) : (FLOAT)0;
#endif
#endif
    return pixels;
}

/* A ray of the camera with all that ellipsoids and triangles need of it. */
static inline __attribute__((always_inline)) Ray for_shapes(const Frame frame, const Scene scene, Ray ray) {
#if defined(WITH_ELLIPSOIDS) && defined(WITH_PARALLEL_RAYS)
    ray.leaving = from_eye(scene.spheres, ray.o, turned_to_world(frame, ray.o));
#elif defined(WITH_ELLIPSOIDS)
    ray.leaving = leaving_eye(frame, scene.spheres, ray.d);
#endif
#ifdef WITH_TRIANGLES
    ray.w = turned_to_world(frame, OWN(ray));
#endif
    return ray;
}

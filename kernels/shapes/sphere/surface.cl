/* surface.cl: points of spheres and ellipsoids that rays have met: their normals, and what starts there. */
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
    PUT_WHERE(here, at->start.from_eye.x, at->start.own.center.x + spot.p.x);
    PUT_WHERE(here, at->start.from_eye.y, at->start.own.center.y + spot.p.y);
    PUT_WHERE(here, at->start.from_eye.z, at->start.own.center.z + spot.p.z);
    PUT_WHERE(here, at->start.near_eye, 0);
}

/* The same of what a ray from the eye has met. */
static __attribute__((always_inline)) void stretch_at(const Frame frame, const Scene *scene, const Ray ray,
                                                      const Hit hit, const INT round, Intersection *at) {
    const Ball ball = balls_of(scene->spheres, round);
    if (ANY((round >= 0) & (ball.map != 0)))
        stretch(at, spot_at(frame, scene->spheres, from_eye(scene->spheres, eye_ray(ray)), ball, hit.t), hit.inside);
}
#else
#define stretch(at, spot, inside)
#define stretch_at(frame, scene, ray, hit, round, at)
#endif

#ifdef WITH_LEAVING
/* The same start in the world, of points of spheres. */
static void start_in_world(const Frame frame, const Scene *scene, const INT id, Intersection *at) {
    const Ball ball = balls_of(scene->spheres, SPHERE_OR_NONE(scene->spheres, id));
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

#ifdef WITH_UV
/* Where points of spheres are on a texture: by their longitude about the y axis, 1/2 where z is largest, and by the
 * angle from the y axis, which near the poles keeps its digits as the arc cosine would not. It is the unit normal's
 * before any transform that counts: an ellipsoid's in its own axes, and a sphere's in the world. */
static void map_spheres(const Frame frame, Intersection *at) {
    Real3 q = turned_to_world(frame, at->normal);
    if (HAS(WITH_ELLIPSOIDS)) {
        const REAL_MASK here = at->start.stretched;
        PUT3(PUT_WHERE, here, q, at->q);
    }
    at->u = (REAL)0.5f + turns_of(q.x, q.z);
    at->v = 2 * turns_of(sqrt(q.x * q.x + q.z * q.z), q.y);
}
#else
#define map_spheres(frame, at)
#endif

/* Puts what a ray from the eye has met into an intersection. */
static __attribute__((always_inline)) void sphere_put(const Frame frame, const Scene *scene, const Ray ray,
                                                      const Hit hit, Intersection *at) {
    const INT round = SPHERE_OR_NONE(scene->spheres, hit.id);
    const Sphere sphere = spheres_of(scene->spheres, round);
    at->normal = sphere_surface(sphere, hit.from_center);
    at->start = start_at(ray, sphere, at->normal, hit.t);
    if (HAS(WITH_SHAPES)) {
        at->q = at->normal;
        at->spread = 1;
    }
    stretch_at(frame, scene, ray, hit, round, at);
    if (HAS(WITH_UV)) map_spheres(frame, at);
    if (ANY_PLACED || HAS(WITH_PLANES)) start_in_world(frame, scene, hit.id, at);
}

#ifdef WITH_BOUNCES
/* The same of a ray that left a surface. */
static __attribute__((always_inline)) void sphere_put_from(const Frame frame, const Scene *scene, const Leaving ray,
                                                           const Met met, Intersection *at) {
    const INT round = SPHERE_OR_NONE(scene->spheres, met.id);
    const Spot spot = spot_at(frame, scene->spheres, ray, balls_of(scene->spheres, round), met.at.t);
    at->normal = spot.n;
    const Sphere sphere = spheres_of(scene->spheres, round);
    const Real3 C = sphere.center, n = at->normal;
    const Real3 point = {C.x + sphere.r * n.x, C.y + sphere.r * n.y, C.z + sphere.r * n.z};
    at->start = start_of(sphere, n, met.at.inside ? (REAL)-1 : (REAL)1, point);
    if (HAS(WITH_SHAPES)) {
        at->q = spot.q;
        at->spread = 1;
    }
    stretch(at, spot, met.at.inside);
    if (HAS(WITH_TEXTURES)) map_spheres(frame, at);
    if (ANY_PLACED || HAS(WITH_PLANES)) start_in_world(frame, scene, met.id, at);
}
#endif

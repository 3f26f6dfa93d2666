/* surface.cl: points of cylinders that rays have met: their normals, and what starts there. */
/* A point: from S, or E on the disc there; what names it; and the outward unit normal in the world. */
typedef struct {
    Real3 q, n;
} RodPoint;

/* That of lanes whose rays meet their cylinders at t, by the part of the verdict. */
static RodPoint rod_point(const Leaving ray, const Rod rod, const REAL t, const RodVerdict is) {
    const REAL_MASK on_end = is.flat & is.last,
                    by_end = on_end & (REAL_BYTES == 8 ? TO_REAL_MASK(ALL_LANES) : (REAL_MASK)0);
    const Real3 A = {by_end ? rod.end.x : rod.start.x, by_end ? rod.end.y : rod.start.y,
                     by_end ? rod.end.z : rod.start.z};
    const Real3 u = rod.u,
                p = {t * ray.w.x - ((A.x - ray.center.x) - ray.p.x), t * ray.w.y - ((A.y - ray.center.y) - ray.p.y),
                     t * ray.w.z - ((A.z - ray.center.z) - ray.p.z)};
    const REAL k = DOT(p, u) / DOT(u, u);
    Real3 m = {p.x - k * u.x, p.y - k * u.y, p.z - k * u.z};
    const REAL over = 1 / sqrt(DOT(m, m)), by = is.flat ? (REAL)1 : over;
    m.x *= by;
    m.y *= by;
    m.z *= by;
    const Across e = across_of(rod);
    const REAL share = REAL_BYTES == 4 ? k / rod.span : k, along = share < 0 ? (REAL)0 : share > 1 ? (REAL)1 : share;
    RodPoint at;
    at.q.x = is.flat ? (is.last ? (REAL)2 : (REAL)-1) : along;
    at.q.y = DOT(m, e.first) / DOT(e.first, e.first);
    at.q.z = DOT(m, e.second) / DOT(e.second, e.second);
    const Real3 out = {at.q.y * e.first.x + at.q.z * e.second.x, at.q.y * e.first.y + at.q.z * e.second.y,
                 at.q.y * e.first.z + at.q.z * e.second.z};
    const REAL way = is.last ? (REAL)1 : (REAL)-1;
    Real3 n = {is.flat ? way * u.x : out.x, is.flat ? way * u.y : out.y, is.flat ? way * u.z : out.z};
    const REAL shorter = 1 / sqrt(DOT(n, n));
    at.n.x = n.x * shorter;
    at.n.y = n.y * shorter;
    at.n.z = n.z * shorter;
    return at;
}

#ifdef WITH_UV
/* Where points are on a texture: u goes round the axis, v along it from E to S. */
static void map_rods(const REAL_MASK here, const Rod rod, const Real3 q, Intersection *at) {
    const Across e = across_of(rod);
    const REAL x = q.y * sqrt(DOT(e.first, e.first)), y = q.z * sqrt(DOT(e.second, e.second));
    const REAL along = ON_START(q) ? (REAL)0 : ON_END(q) ? (REAL)1 : q.x;
    PUT_OF_SHAPE(here, at->u, (REAL)0.5f + turns_of(y, x));
    PUT_OF_SHAPE(here, at->v, 1 - along);
}
#else
#define map_rods(here, rod, q, at)
#endif

/* Puts the points of cylinders into an intersection. id: what the rays met, at t; P: the point, rounded, in camera
 * space.
 */
static __attribute__((always_inline)) void round_off(const Frame frame, const Scene *scene, const Leaving ray,
                                                     const INT id, const REAL t, const Real3 P, Intersection *at) {
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(scene->spheres, id));
    const Rod rod = rods_of(scene->spheres, CYLINDER_OR_NONE(scene->spheres, id));
    const RodVerdict is = rod_encounter(scene->spheres, ray, id, here).is;
    const RodPoint point = rod_point(ray, rod, t, is);
    const Real3 n = turned_to_camera(frame, point.n);
    PUT3(PUT_OF_SHAPE, here, at->normal, n);
    PUT3(PUT_OF_SHAPE, here, at->q, point.q);
    PUT_OF_SHAPE(here, at->spread, (REAL)1);
    start_at_place(here, P, is.out ? (REAL)1 : (REAL)-1, &at->start);
    at->start.index = id;
    at->start.q = at->q;
    const Place3 place = rod_place(rod, point.q);
    PUT3(PUT_OF_SHAPE, here, at->start.anchor, place.anchor);
    PUT3(PUT_OF_SHAPE, here, at->start.step, place.step);
    PUT_OF_SHAPE(here, at->start.reach, place.reach);
    map_rods(here, rod, point.q, at);
}

/* Puts what a ray from the eye has met into an intersection. */
static __attribute__((always_inline)) void cylinder_put(const Frame frame, const Scene *scene, const Ray ray,
                                                        const Hit hit, Intersection *at) {
    round_off(frame, scene, from_eye(scene->spheres, eye_ray(ray)), hit.id, hit.t, point_at(ray, hit.t), at);
}

#ifdef WITH_BOUNCES
/* The same of a ray that left a surface. */
static void cylinder_put_from(const Frame frame, const Scene *scene, const Leaving ray, const Met met,
                              Intersection *at) {
    round_off(frame, scene, ray, met.id, met.at.t, point_from(frame, scene, ray, met), at);
}
#endif

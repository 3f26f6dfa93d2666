/* surface.cl: points of cylinders that rays have met, and cylinders between a point and a light. */

/* Cylinders between a point and a light. */

/* The way from a start to a light, which is at a point, or in the direction `to`. */
static RodRay rod_ray_to(const real4 lamp, const int at_point, const Start P) {
    const Real3 L = {lamp.x, lamp.y, lamp.z}, A = P.anchor, none = {0, 0, 0};
    const Real3 way = {L.x - A.x, L.y - A.y, L.z - A.z};
    const Real3 w = {way.x - P.step.x, way.y - P.step.y, way.z - P.step.z};
    const RodRay ray = {A, P.step, at_point ? w : L, P.reach, at_point ? ROD_SIZE(way) + P.reach : (REAL)ROD_SIZE(L), 0,
                        0, none};
    return ray;
}

#if REAL_BYTES == 8
/* As decide_rod(), in pairs. */
static __attribute__((noinline)) REAL_MASK rod_stops_finely(const Geometry geometry, const real4 lamp,
                                                            const int at_point, const Start *P, const Rod rod) {
    const Real3 to = {lamp.x, lamp.y, lamp.z};
    const Leaving point = leaving_to(*P, to);
    const Pair3 step = fine_start(geometry, point);
    const Pair3 whole = {pair(to.x, 0), pair(to.y, 0), pair(to.z, 0)};
    const Pair3 way = {minus(two_sum(to.x, -P->anchor.x), step.x), minus(two_sum(to.y, -P->anchor.y), step.y),
                       minus(two_sum(to.z, -P->anchor.z), step.z)};
    RodFineRay fine = {step, whole};
    if (at_point) fine.w = way;
    const FineRod found = fine_rod(rod_ray_to(lamp, at_point, *P), fine, rod, 1);
    const REAL gap = (found.t.t.hi - 1) + found.t.t.lo;
    const REAL_MASK before = at_point ? gap < -found.t.error : TO_REAL_MASK(ALL_LANES);
    return found.is.hit & (found.t.t.hi > 0) & before;
}
#endif

/* The lanes of `wanted` in which a cylinder, which is not the own surface, stands between P and the light. */
static __attribute__((noinline)) MASK decide_rod(const Geometry geometry, const real4 lamp, const int at_point,
                                                 const Start *from, const int number, const MASK wanted) {
    Start P = *from;
    place_start(geometry, &P);
    const Rod rod = rod_at(geometry, number);
    const RodMeeting at = rod_meet(rod_ray_to(lamp, at_point, P), rod, TO_REAL_MASK(wanted));
    REAL_MASK stops = at.t < (at_point ? (REAL)1 : (REAL)INFINITY);
#if REAL_BYTES == 8
    REAL_MASK unsure = at.unsure;
    /* t is right to 2^-24 of itself, see rod_is_sure(). */
    if (at_point) unsure = unsure | (fabs(at.t - 1) < 0x1p-20);
    if (UNDECIDED(geometry, ANY(TO_MASK(unsure)))) {
        const REAL_MASK fine = rod_stops_finely(geometry, lamp, at_point, &P, rod);
        stops = unsure ? fine : stops;
    }
#endif
    return wanted & TO_MASK(stops);
}

/* Whether a light is outside of a cylinder. */
static int is_outside_of(const Scene *scene, const ShadowRay ray, const int number) {
    return scene->rod_side[(long)ray.number * scene->rods + number] > 0;
}

/* What float32 is sure of: the lanes of a mask that a cylinder may stop, and those that it does. */
typedef struct {
    MASK open, stopped;
} RodGuess;

/* The line through a light at a point leads from there, at t = 0, to P at t = -1; through a parallel one it begins at
 * P. If a point between the two is within the cylinder and the light is not, the way from one to the other leaves it: a
 * point where the line enters it, leaves it or is closest to its axis. Nothing of it is between the two if it begins
 * beyond the one or ends before the other. */
static RodGuess guess_rod(const Scene *scene, const ShadowRay ray, const int number, const MASK asked) {
    RodGuess is = {asked, 0};
    if (!HAS(WITH_FILTER) || (ray.at_point && ray.touches)) return is;
    const real4 L = scene->light[ray.number].position * scene->unit;
    const Float3 light = {TO_FLOAT((REAL)L.x), TO_FLOAT((REAL)L.y), TO_FLOAT((REAL)L.z)};
    const Float3 P = {TO_FLOAT(ray.from.x), TO_FLOAT(ray.from.y), TO_FLOAT(ray.from.z)};
    const RodLine line = rod_line(scene->rod_seen + 2 * number, ray.at_point ? light : P, ray.w32, ray.a);
    is.open = asked & line.may;
    if (!ANY(is.open)) return is;
    const FLOAT size = (magnitude(ray.w32.x) + magnitude(ray.w32.y)) + magnitude(ray.w32.z), off = line.error * size;
    const FLOAT a = ray.at_point ? line.a : (FLOAT)0, most_off = ray.at_point ? off + 0x1p-20f * ray.a : off;
    for (int end = -1; end <= 1 && is_outside_of(scene, ray, number); end++) {
        const FLOAT one = line.b + end * line.least, other = line.b + end * line.most;
        const FLOAT low = end < 0 ? other : one, high = end < 0 ? one : other;
        const MASK before = ray.at_point ? high < -off : ALL_LANES;
        is.stopped = is.stopped | (asked & before & (low + a > most_off) & is_between_discs(line, end));
    }
    const MASK beyond = ray.at_point ? line.b - line.most > off : (MASK)0;
    is.open = is.open & !is.stopped & !beyond & !(line.b + line.most + a < -most_off);
    return is;
}

/* The lanes of `may` that a cylinder stops. It is convex, so from outside the own one never does, and from inside it
 * does if and only if the light is outside of it. */
static MASK cylinder_shadow(const Scene *scene, const ShadowRay ray, const Start start, const int index, MASK may,
                            Work *work) {
    const int number = index - FIRST_CYLINDER(scene->geometry);
    const MASK own = may & (ray.own == index);
    const RodGuess guess = guess_rod(scene, ray, number, may & !own);
    MASK stops = own & TO_MASK(start.side < 0);
    if (ANY(stops) && !is_outside_of(scene, ray, number)) stops = 0;
    stops = stops | guess.stopped;
    const MASK open = guess.open;
    COUNT(FILTERED, may & !open);
    if (!ANY(open)) return stops;
    COUNT(DECIDED, open);
    if (is_over(scene)) return stops;
    return stops | decide_rod(scene->geometry, scene->lamp[ray.number], ray.at_point, &start, number, open);
}

/* Points of cylinders that rays have met: their normals, and what starts there. */
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
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(scene->geometry, id));
    const Rod rod = rods_of(scene->geometry, CYLINDER_OR_NONE(scene->geometry, id));
    const RodVerdict is = rod_encounter(scene->geometry, ray, id, here).is;
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
    round_off(frame, scene, from_eye(scene->geometry, eye_ray(ray)), hit.id, hit.t, point_at(ray, hit.t), at);
}

#ifdef WITH_BOUNCES
/* The same of a ray that left a surface. */
static void cylinder_put_from(const Frame frame, const Scene *scene, const Leaving ray, const Met met,
                              Intersection *at) {
    round_off(frame, scene, ray, met.id, met.at.t, point_from(frame, scene, ray, met), at);
}
#endif

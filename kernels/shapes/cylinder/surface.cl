/* surface.cl: points of cylinders that rays have met, and cylinders between a point and a light. */

/* Cylinders between a point and a light. */

#if REAL_BYTES == 8
/* As decide_cylinder(), in pairs. */
static __attribute__((noinline)) REAL_MASK cylinder_stops_finely(const Geometry geometry, const real4 lamp,
                                                                 const int at_point, const Leaving ray,
                                                                 const Cylinder cylinder) {
    const Real3 to = {lamp.x, lamp.y, lamp.z};
    const Pair3 step = fine_start(geometry, ray);
    PairRay fine = {step, pairs_of(to)};
    if (at_point) fine.w = minus3(pairs_between(ray.center, to), step);
    const FineCylinder found = fine_cylinder(ray, fine, cylinder, 1);
    const REAL gap = (found.t.t.hi - 1) + found.t.t.lo;
    const REAL_MASK before = at_point ? gap < -found.t.error : TO_REAL_MASK(ALL_LANES);
    return found.is.hit & (found.t.t.hi > 0) & before;
}
#endif

/* The lanes of `wanted` in which a cylinder, which is not the own surface, stands between P and the light. */
static __attribute__((noinline)) MASK decide_cylinder(const Geometry geometry, const real4 lamp, const int at_point,
                                                      const Start *from, const int index, const MASK wanted) {
    Start P = *from;
    place_start(geometry, &P);
    const Cylinder cylinder = cylinders_of(geometry, (INT)index);
    const Leaving ray = way_to_lamp(lamp, at_point, P);
    const CylinderMeeting at = cylinder_meet(ray, cylinder, TO_REAL_MASK(wanted));
    REAL_MASK stops = at.t < (at_point ? (REAL)1 : (REAL)INFINITY);
#if REAL_BYTES == 8
    REAL_MASK unsure = at.unsure;
    /* t is right to 2^-24 of itself, see is_sure(). */
    if (at_point) unsure = unsure | (fabs(at.t - 1) < 0x1p-20);
    if (UNDECIDED(geometry, ANY(TO_MASK(unsure)))) {
        const REAL_MASK fine = cylinder_stops_finely(geometry, lamp, at_point, ray, cylinder);
        stops = unsure ? fine : stops;
    }
#endif
    return wanted & TO_MASK(stops);
}

/* Whether a light is outside of a cylinder. */
static int is_outside_of(const Scene *scene, const ShadowRay ray, const int number) {
    return scene->cylinder_side[(long)ray.number * scene->cylinders + number] > 0;
}

/* What float32 is sure of: the lanes of a mask that a cylinder may stop, and those that it does. */
typedef struct {
    MASK open, stopped;
} Guess;

/* The line through a light at a point leads from there, at t = 0, to P at t = -1; through a parallel one it begins at
 * P. If a point between the two is within the cylinder and the light is not, the way from one to the other leaves it: a
 * point where the line enters it, leaves it or is closest to its axis. Nothing of it is between the two if it begins
 * beyond the one or ends before the other. */
static Guess guess_cylinder(const Scene *scene, const ShadowRay ray, const int number, const MASK asked) {
    Guess is = {asked, 0};
    if (!HAS(WITH_FILTER) || (ray.at_point && ray.touches)) return is;
    const real4 L = scene->light[ray.number].position * scene->unit;
    const Float3 light = {TO_FLOAT((REAL)L.x), TO_FLOAT((REAL)L.y), TO_FLOAT((REAL)L.z)};
    const Float3 P = {TO_FLOAT(ray.from.x), TO_FLOAT(ray.from.y), TO_FLOAT(ray.from.z)};
    const CylinderLine line = cylinder_line(scene->cylinder_seen + 2 * number, ray.at_point ? light : P, ray.w32,
                                            ray.a);
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
    const Guess guess = guess_cylinder(scene, ray, number, may & !own);
    MASK stops = own & TO_MASK(start.side < 0);
    if (ANY(stops) && !is_outside_of(scene, ray, number)) stops = 0;
    stops = stops | guess.stopped;
    const MASK open = guess.open;
    COUNT(FILTERED, may & !open);
    if (!ANY(open)) return stops;
    COUNT(DECIDED, open);
    if (is_over(scene)) return stops;
    return stops | decide_cylinder(scene->geometry, scene->lamp[ray.number], ray.at_point, &start, index, open);
}

/* Points of cylinders that rays have met: their normals, and what starts there. */
/* A point of a cylinder: what names it; and the outward unit normal in the world. */
typedef struct {
    Real3 q, n;
} CylinderPoint;

/* That of lanes whose rays meet their cylinders at t, by the part of the verdict. */
static CylinderPoint cylinder_point(const Leaving ray, const Cylinder cylinder, const REAL t, const Verdict is) {
    const Real3 A = REAL_BYTES == 8 ? chosen(is.flat & is.last, cylinder.end, cylinder.start) : cylinder.start,
                u = cylinder.u;
    const Real3 p = difference(scaled(ray.w, t), difference(difference(A, ray.center), ray.p));
    const REAL k = DOT(p, u) / DOT(u, u);
    Real3 m = difference(p, scaled(u, k));
    m = scaled(m, is.flat ? (REAL)1 : 1 / sqrt(DOT(m, m)));
    const Across e = across_of(cylinder);
    const REAL share = REAL_BYTES == 4 ? k / cylinder.span : k, along = share < 0   ? (REAL)0
                                                                        : share > 1 ? (REAL)1
                                                                                    : share;
    CylinderPoint at;
    at.q.x = is.flat ? (is.last ? (REAL)2 : (REAL)-1) : along;
    at.q.y = DOT(m, e.first) / DOT(e.first, e.first);
    at.q.z = DOT(m, e.second) / DOT(e.second, e.second);
    const Real3 out = sum3(scaled(e.first, at.q.y), scaled(e.second, at.q.z));
    const Real3 n = chosen(is.flat, scaled(u, is.last ? (REAL)1 : (REAL)-1), out);
    at.n = scaled(n, 1 / sqrt(DOT(n, n)));
    return at;
}

/* Where points are on a texture: u goes round the axis, v along it from E to S. */
static void map_cylinders(const REAL_MASK here, const Cylinder cylinder, const Real3 q, Intersection *at) {
    const Across e = across_of(cylinder);
    const REAL x = q.y * sqrt(DOT(e.first, e.first)), y = q.z * sqrt(DOT(e.second, e.second));
    const REAL along = ON_START(q) ? (REAL)0 : ON_END(q) ? (REAL)1 : q.x;
    PUT_OF_SHAPE(here, at->u, (REAL)0.5f + turns_of(y, x));
    PUT_OF_SHAPE(here, at->v, 1 - along);
}

/* Puts the points of cylinders into an intersection. id: what the rays met, at t; P: the point, rounded, in camera
 * space.
 */
static __attribute__((always_inline)) void put_cylinders(const Frame frame, const Scene *scene, const Leaving ray,
                                                         const INT id, const REAL t, const Real3 P, Intersection *at) {
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(scene->geometry, id));
    const Cylinder cylinder = cylinders_of(scene->geometry, id);
    const Verdict is = cylinder_meet_from(scene->geometry, ray, id, here).is;
    const CylinderPoint point = cylinder_point(ray, cylinder, t, is);
    const Real3 n = turned_to_camera(frame, point.n);
    PUT3(PUT_OF_SHAPE, here, at->normal, n);
    PUT3(PUT_OF_SHAPE, here, at->q, point.q);
    PUT_OF_SHAPE(here, at->spread, (REAL)1);
    start_at_place(here, P, is.out ? (REAL)1 : (REAL)-1, &at->start);
    at->start.index = id;
    at->start.q = at->q;
    start_from_place(here, place_on_cylinder(cylinder, point.q), &at->start);
    if (MAPPED(scene)) map_cylinders(here, cylinder, point.q, at);
}

/* Puts what a ray from the eye has met into an intersection. */
static __attribute__((always_inline)) void cylinder_put(const Frame frame, const Scene *scene, const Ray ray,
                                                        const Hit hit, Intersection *at) {
    put_cylinders(frame, scene, from_eye(scene->geometry, eye_ray(ray)), hit.id, hit.t, point_at(ray, hit.t), at);
}

#ifdef WITH_BOUNCES
/* The same of a ray that left a surface. */
static void cylinder_put_from(const Frame frame, const Scene *scene, const Leaving ray, const Met met,
                              Intersection *at) {
    put_cylinders(frame, scene, ray, met.id, met.at.t, point_from(frame, scene, ray, met), at);
}
#endif

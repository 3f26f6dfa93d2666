/* eye.cl: cylinders along rays from the eye, and along rays that start on surfaces. */

/* Cylinders along rays from the eye. */

/* Puts t of the lanes that have hit cylinders so far into theirs. */
static __attribute__((noinline)) void cylinder_settle_t(const Scene *scene, const EyeRay ray, const Rival hit,
                                                        REAL *t) {
    const MASK here = IS_CYLINDER(scene->geometry, hit.id);
    if (!ANY(here)) return;
    const CylinderMeeting at = cylinder_meet_from(scene->geometry, from_eye(scene->geometry, ray), hit.id,
                                                  TO_REAL_MASK(here));
    PUT_WHERE(TO_REAL_MASK(here), *t, at.t);
}

/* What float32 knows of a cylinder: the lanes that may meet it, those that surely enter it by its side, and bounds of
 * 1/t, or of parallel rays -t: the lower one is that of these lanes. */
typedef struct {
    MASK may, sure;
    Bounds near;
} CylinderSight;

/* t a is b - sqrt(D). a is off by 14 u A, A = |w|^2, see cylinder.cl, and a quotient by 3 u. */
static __attribute__((always_inline)) CylinderSight cylinder_sight(const Scene *scene, const EyeLine eye,
                                                                   const int number) {
    const int along = HAS(WITH_PARALLEL_RAYS);
    const Float3 start = {along ? eye.x : (FLOAT)0, along ? eye.y : (FLOAT)0, 0};
    const Float3 w = {along ? (FLOAT)0 : eye.x, along ? (FLOAT)0 : eye.y, -1};
    const CylinderLine line = cylinder_line(scene->cylinder_seen + 2 * number, start, w, eye.a);
    CylinderSight is;
    is.may = line.may;
    if (!ANY(is.may)) return is;
    const FLOAT b_off = line.error * ((magnitude(w.x) + magnitude(w.y)) + 1), a_off = 0x1p-20f * eye.a;
    const FLOAT first = line.b - line.most - b_off, last = line.b - line.least + b_off;
    const FLOAT soon = first / (line.a + a_off) * (1 - 0x1p-20f), late = last / (line.a - a_off) * (1 + 0x1p-20f);
    is.sure = is.may & (first > 0) & (line.a > a_off) & is_between_discs(line, -1);
    is.near.low = along ? -late : (1 - 0x1p-20f) / late;
    is.near.high = !(first > 0) ? (FLOAT)INFINITY : along ? -soon : (1 + 0x1p-20f) / soon;
    return is;
}

/* Takes a cylinder into account, and tells whether any lane hits it. */
static __attribute__((always_inline)) int cylinder_take(const Scene *scene, const Ray ray, EyeLine *line,
                                                        const int index, Hit *hit, Work *work) {
    MASK open = ALL_LANES, first = 0;
    if (HAS(WITH_FILTER)) {
        const CylinderSight sight = cylinder_sight(scene, *line, index - FIRST_CYLINDER(scene->geometry));
        if (!ANY(sight.may)) {
            COUNT(FILTERED, ALL_LANES);
            return 0;
        }
        first = sight.sure & (sight.near.low > hit->near.high);
        open = sight.may & !first & !(sight.near.high < hit->near.low);
        put_late(first, sight.near, index, hit);
        COUNT(FILTERED, !open);
        if (!ANY(open)) return ANY(first);
    }
    COUNT(DECIDED, open);
    const EyeRay own = eye_ray(ray);
    const REAL t =
        cylinder_meet_from(scene->geometry, from_eye(scene->geometry, own), (INT)index, TO_REAL_MASK(open)).t;
    const MASK met = open & TO_MASK(t < INFINITY);
    if (!ANY(met)) return ANY(first);
    const Bounds near = near_of(t, scene->unit);
    MASK nearer = met & (near.low > hit->near.high);
    const MASK close = met & !nearer & !(near.high < hit->near.low);
    if (RARELY(ANY(close))) {
        const Scene all = *scene; /* copied here, lest compilers keep it in memory all the time */
        const Rival rival = {hit->t, hit->id, hit->sure};
        nearer = nearer | (close & TO_MASK(comes_before(&all, &own, t, (INT)index, &rival)));
    }
    put_late(nearer, near, index, hit);
    return ANY(first | nearer);
}

/* Puts into a hit where the rays meet cylinders. Float may lose what its filter is sure of. */
static __attribute__((always_inline)) void cylinder_settle(const Scene *scene, const Ray ray, Hit *hit) {
    const Rival rival = {hit->t, hit->id, hit->sure};
    cylinder_settle_t(scene, eye_ray(ray), rival, &hit->t);
    if (REAL_BYTES == 8) return;
    const MASK lost = IS_CYLINDER(scene->geometry, hit->id) & TO_MASK(!(hit->t < INFINITY));
    PUT_WHERE(TO_REAL_MASK(lost), hit->t, TO_REAL(far_of(hit->near.low)));
}

/* Cylinders and rays that start on surfaces.
 *
 * A point of a cylinder is named by q: q.x is how far along the axis it is, 0 .. 1 of the side, -1 of the disc at S and
 * 2 of that at E. With m = q.y e1 + q.z e2 (see across_of()), it is exactly S + q.x u + r m / |m| on the side, and S +
 * m or E + m on a disc.
 */

/* From S, or from E on the disc there, to the point q. */
static Place3 place_on_cylinder(const Cylinder cylinder, const Real3 q) {
    const Across e = across_of(cylinder);
    const REAL_MASK on_end = ON_END(q), side = !on_end & !ON_START(q);
    const Real3 m = sum3(scaled(e.first, q.y), scaled(e.second, q.z));
    const REAL over = cylinder.r * (1 / sqrt(DOT(m, m))), size = REAL_BYTES == 4 ? cylinder.span : (REAL)1;
    const REAL by_m = side ? over : (REAL)1, by_u = side ? q.x * size : (REAL)0;
    const Real3 end = REAL_BYTES == 8 ? cylinder.end : sum3(cylinder.start, scaled(cylinder.u, size));
    return (Place3){chosen(on_end, end, cylinder.start), sum3(scaled(cylinder.u, by_u), scaled(m, by_m)),
                    size * size_of(cylinder.u) + cylinder.r};
}

/* Puts where rays leave cylinders into their lanes. */
static void cylinder_leave(const Frame frame, const Geometry geometry, Leaving *ray) {
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(geometry, ray->own));
    leave_place(here, place_on_cylinder(cylinders_of(geometry, ray->own), ray->q), ray);
}

#ifdef WITH_PLANES
/* Where points that are `step` from A are strictly inside of a cylinder. error: of the step. */
static MASK cylinder_contains(const Scene *scene, const Real3 A, const Pair3 step, const REAL error, const int index) {
    const Cylinder cylinder = cylinders_of(scene->geometry, (INT)index);
    const Pair3 p = plus3(pairs_between(cylinder.start, A), step);
    const Pair3 u = REAL_BYTES == 8 ? pairs_between(cylinder.start, cylinder.end) : pairs_of(cylinder.u);
    const Pair uu = REAL_BYTES == 8 ? dot_pairs(u, u) : pair(1, 0),
               span = REAL_BYTES == 8 ? uu : pair(cylinder.span, 0);
    const Pair3 X = cross_pairs(p, u);
    const Pair along = dot_pairs(p, u), rim = times(two_product(cylinder.r, cylinder.r), uu);
    const REAL off = (error + PAIR_ERROR * size_of_pairs(p)) * size_of_pairs(u), X1 = size_of_pairs(X);
    const REAL excess = minus(dot_pairs(X, X), rim).hi;
    const REAL_MASK within = (along.hi > off) & (minus(along, span).hi < -(off + PAIR_ERROR * span.hi));
    return TO_MASK(within & (excess < -(2 * X1 * off + off * off + PAIR_ERROR * (X1 * X1 + rim.hi))));
}
#endif

/* Puts where the lanes' rays meet the cylinders that `index` names into their lanes. */
static void cylinder_encounter(const Scene *scene, const Leaving ray, const INT index, Encounter *at) {
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(scene->geometry, index));
    const CylinderMeeting met = cylinder_meet_from(scene->geometry, ray, index, here);
    PUT_OF_SHAPE(here, at->t, met.t);
    PUT_OF_SHAPE(here, at->inside, !met.is.out);
}

#if REAL_BYTES == 8
/* Puts the way from the anchor to the point that rays leave into their lanes, in pairs. With v = 2^-53, u is exact, e1
 * and e2 are off by 10 v^2 of their sizes, m by 30 v^2 and m / |m| by 60 v^2. */
static void cylinder_fine_start(const Geometry geometry, const Leaving ray, Pair3 *step) {
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(geometry, ray.own));
    const Cylinder cylinder = cylinders_of(geometry, ray.own);
    const Pair3 u = pairs_between(cylinder.start, cylinder.end);
    const REAL x = fabs(cylinder.u.x), y = fabs(cylinder.u.y), z = fabs(cylinder.u.z);
    const REAL_MASK by_x = (x <= y) & (x <= z), by_y = !by_x & (y <= z);
    const Pair one = pair(1, 0), none = pair(0, 0), a = pair(ray.q.y, 0), b = pair(ray.q.z, 0);
    const Pair3 axis = {choose_pair(by_x, one, none), choose_pair(by_y, one, none),
                        choose_pair(by_x | by_y, none, one)};
    const Pair3 e1 = cross_pairs(axis, u), e2 = cross_pairs(u, e1);
    const Pair3 m = plus3(times3(a, e1), times3(b, e2));
    const REAL_MASK side = !ON_START(ray.q) & !ON_END(ray.q);
    const Pair by_u = choose_pair(side, pair(ray.q.x, 0), none);
    const Pair3 own = plus3(times3(by_u, u), scaled_to(m, dot_pairs(m, m), cylinder.r, side));
    *step = KINDS_OF_SHAPES == 1 ? own : choose_pairs(here, own, *step);
}

/* Puts t of rays that meet cylinders into their lanes, in pairs, and a bound of what it is off by. */
static void cylinder_fine_t(const Geometry geometry, const Leaving ray, const INT index, FineT *t) {
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(geometry, index));
    const FineCylinder fine = fine_cylinder(ray, pair_ray(geometry, ray), cylinders_of(geometry, index), 0);
    t->t = choose_pair(here, fine.t.t, t->t);
    t->error = here ? fine.t.error : t->error;
}
#endif

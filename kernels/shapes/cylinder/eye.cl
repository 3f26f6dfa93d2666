/* eye.cl: cylinders along rays from the eye, and along rays that start on surfaces. */

/* Cylinders along rays from the eye. */

/* Puts t of the lanes that have hit cylinders so far into theirs. */
static __attribute__((noinline)) void cylinder_settle_t(const Scene *scene, const EyeRay ray, const Rival hit,
                                                        REAL *t) {
    const MASK here = IS_CYLINDER(scene->geometry, hit.id);
    if (!ANY(here)) return;
    const RodMeeting at = rod_encounter(scene->geometry, from_eye(scene->geometry, ray), hit.id, TO_REAL_MASK(here));
    PUT_WHERE(TO_REAL_MASK(here), *t, at.t);
}

/* What float32 knows of a cylinder: the lanes that may meet it, those that surely enter it by its side, and bounds of
 * 1/t, or of parallel rays -t: the lower one is that of these lanes. */
typedef struct {
    MASK may, sure;
    Bounds near;
} RodSight;

/* t a is b - sqrt(D). a is off by 14 u A, A = |w|^2, see cylinder.cl, and a quotient by 3 u. */
static __attribute__((always_inline)) RodSight rod_sight(const Scene *scene, const EyeLine eye, const int number) {
    const int along = HAS(WITH_PARALLEL_RAYS);
    const Float3 start = {along ? eye.x : (FLOAT)0, along ? eye.y : (FLOAT)0, 0};
    const Float3 w = {along ? (FLOAT)0 : eye.x, along ? (FLOAT)0 : eye.y, -1};
    const RodLine line = rod_line(scene->rod_seen + 2 * number, start, w, eye.a);
    RodSight is;
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
        const RodSight sight = rod_sight(scene, *line, index - FIRST_CYLINDER(scene->geometry));
        if (!ANY(sight.may)) {
            COUNT(FILTERED, ALL_LANES);
            return 0;
        }
        first = sight.sure & (sight.near.low > hit->near.high);
        open = sight.may & !first & !(sight.near.high < hit->near.low);
        PUT_WHERE(first, hit->near.low, sight.near.low);
        PUT_WHERE(first, hit->near.high, sight.near.high);
        PUT_WHERE(first, hit->id, (INT)index);
        COUNT(FILTERED, !open);
        if (!ANY(open)) return ANY(first);
    }
    COUNT(DECIDED, open);
    const EyeRay own = eye_ray(ray);
    const REAL t = rod_encounter(scene->geometry, from_eye(scene->geometry, own), (INT)index, TO_REAL_MASK(open)).t;
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
    PUT_WHERE(nearer, hit->near.low, near.low);
    PUT_WHERE(nearer, hit->near.high, near.high);
    PUT_WHERE(nearer, hit->id, (INT)index);
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
static Place3 rod_place(const Rod rod, const Real3 q) {
    const Across e = across_of(rod);
    const REAL_MASK on_end = ON_END(q), side = !on_end & !ON_START(q);
    const Real3 m = {q.y * e.first.x + q.z * e.second.x, q.y * e.first.y + q.z * e.second.y,
                     q.y * e.first.z + q.z * e.second.z};
    const REAL over = rod.r * (1 / sqrt(DOT(m, m))), size = REAL_BYTES == 4 ? rod.span : (REAL)1;
    const REAL by_m = side ? over : (REAL)1, by_u = side ? q.x * size : (REAL)0;
    const Real3 u = rod.u;
    Place3 place;
    place.anchor.x = on_end ? (REAL_BYTES == 8 ? rod.end.x : rod.start.x + size * u.x) : rod.start.x;
    place.anchor.y = on_end ? (REAL_BYTES == 8 ? rod.end.y : rod.start.y + size * u.y) : rod.start.y;
    place.anchor.z = on_end ? (REAL_BYTES == 8 ? rod.end.z : rod.start.z + size * u.z) : rod.start.z;
    place.step.x = by_u * u.x + by_m * m.x;
    place.step.y = by_u * u.y + by_m * m.y;
    place.step.z = by_u * u.z + by_m * m.z;
    place.reach = size * ROD_SIZE(u) + rod.r;
    return place;
}

/* Puts where rays leave cylinders into their lanes. */
static void cylinder_leave(const Frame frame, const Geometry geometry, Leaving *ray) {
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(geometry, ray->own));
    const Place3 place = rod_place(rods_of(geometry, CYLINDER_OR_NONE(geometry, ray->own)), ray->q);
    leave_place(here, place, ray);
}

#ifdef WITH_PLANES
/* Where points that are `step` from A are strictly inside of a cylinder. error: of the step. */
static MASK cylinder_contains(const Scene *scene, const Real3 A, const Pair3 step, const REAL error, const int index) {
    const Rod rod = rod_at(scene->geometry, index - FIRST_CYLINDER(scene->geometry));
    const Pair3 p = {plus(two_sum(A.x, -rod.start.x), step.x), plus(two_sum(A.y, -rod.start.y), step.y),
                     plus(two_sum(A.z, -rod.start.z), step.z)};
#if REAL_BYTES == 8
    const Pair3 u = {two_sum(rod.end.x, -rod.start.x), two_sum(rod.end.y, -rod.start.y),
                     two_sum(rod.end.z, -rod.start.z)};
    const Pair uu = dot_pairs(u, u), span = uu;
#else
    const Pair3 u = {pair(rod.u.x, 0), pair(rod.u.y, 0), pair(rod.u.z, 0)};
    const Pair uu = pair(1, 0), span = pair(rod.span, 0);
#endif
    const Pair3 X = cross_pairs(p, u);
    const Pair along = dot_pairs(p, u), rim = times(two_product(rod.r, rod.r), uu);
    const REAL off = (error + PAIR_ERROR * size_of_pairs(p)) * size_of_pairs(u), X1 = size_of_pairs(X);
    const REAL excess = minus(dot_pairs(X, X), rim).hi;
    const REAL_MASK within = (along.hi > off) & (minus(along, span).hi < -(off + PAIR_ERROR * span.hi));
    return TO_MASK(within & (excess < -(2 * X1 * off + off * off + PAIR_ERROR * (X1 * X1 + rim.hi))));
}
#endif

/* What shadow rays start with is known since the point was met. */
static void cylinder_place(const Geometry geometry, Start *start) {
}

/* Puts where the lanes' rays meet the cylinders that `index` names into their lanes. */
static void cylinder_encounter(const Scene *scene, const Leaving ray, const INT index, Encounter *at) {
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(scene->geometry, index));
    const RodMeeting met = rod_encounter(scene->geometry, ray, index, here);
    PUT_OF_SHAPE(here, at->t, met.t);
    PUT_OF_SHAPE(here, at->inside, !met.is.out);
}

/* A cylinder is no part of anything. */
static int cylinder_primitive(const Scene *scene, const int index) {
    return -1;
}

#if REAL_BYTES == 8
/* Puts the way from the anchor to the point that rays leave into their lanes, in pairs. With v = 2^-53, u is exact, e1
 * and e2 are off by 10 v^2 of their sizes, m by 30 v^2 and m / |m| by 60 v^2. */
static void cylinder_fine_start(const Geometry geometry, const Leaving ray, Pair3 *step) {
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(geometry, ray.own));
    const Rod rod = rods_of(geometry, CYLINDER_OR_NONE(geometry, ray.own));
    const Pair3 u = {two_sum(rod.end.x, -rod.start.x), two_sum(rod.end.y, -rod.start.y),
                     two_sum(rod.end.z, -rod.start.z)};
    const REAL x = fabs(rod.u.x), y = fabs(rod.u.y), z = fabs(rod.u.z);
    const REAL_MASK by_x = (x <= y) & (x <= z), by_y = !by_x & (y <= z);
    const Pair one = pair(1, 0), none = pair(0, 0), a = pair(ray.q.y, 0), b = pair(ray.q.z, 0);
    const Pair3 axis = {choose_pair(by_x, one, none), choose_pair(by_y, one, none),
                        choose_pair(by_x | by_y, none, one)};
    const Pair3 e1 = cross_pairs(axis, u), e2 = cross_pairs(u, e1);
    const Pair3 m = {plus(times(a, e1.x), times(b, e2.x)), plus(times(a, e1.y), times(b, e2.y)),
                     plus(times(a, e1.z), times(b, e2.z))};
    const REAL_MASK side = !ON_START(ray.q) & !ON_END(ray.q);
    const Pair mm = dot_pairs(m, m);
    const REAL guess = 1 / sqrt(mm.hi);
    const Pair rest = minus(one, times(mm, two_product(guess, guess)));
    const Pair r = times(pair(rod.r, 0), two_sum(guess, 0.5 * guess * (rest.hi + rest.lo)));
    const Pair by_m = choose_pair(side, r, one), by_u = choose_pair(side, pair(ray.q.x, 0), none);
    const Pair3 own = {plus(times(by_u, u.x), times(by_m, m.x)), plus(times(by_u, u.y), times(by_m, m.y)),
                       plus(times(by_u, u.z), times(by_m, m.z))};
    *step = KINDS_OF_SHAPES == 1 ? own : choose_pairs(here, own, *step);
}

/* Puts t of rays that meet cylinders into their lanes, in pairs, and a bound of what it is off by. */
static void cylinder_fine_t(const Geometry geometry, const Leaving ray, const INT index, FineT *t) {
    const REAL_MASK here = TO_REAL_MASK(IS_CYLINDER(geometry, index));
    const RodFineRay way = {fine_start(geometry, ray), pairs_in_world(geometry, ray.d)};
    const Rod rod = rods_of(geometry, CYLINDER_OR_NONE(geometry, index));
    const FineRod fine = fine_rod(rod_ray_of(ray, index), way, rod, 0);
    t->t = choose_pair(here, fine.t.t, t->t);
    t->error = here ? fine.t.error : t->error;
}

/* Of cylinders no such thing is known, and they break no tie by themselves. */
#define cylinder_leave_out_tied(geometry, A, B, open)
#define cylinder_break_tie(geometry, ray, A, B, close, first)
#endif

/* eye.cl: cylinders along rays from the eye. */

/* Puts t of the lanes that have hit cylinders so far into theirs. */
static __attribute__((noinline)) void cylinder_settle_t(const Scene *scene, const EyeRay ray, const Rival hit,
                                                        REAL *t) {
    const MASK here = IS_CYLINDER(scene->spheres, hit.id);
    if (!ANY(here)) return;
    const RodMeeting at = rod_encounter(scene->spheres, from_eye(scene->spheres, ray), hit.id, TO_REAL_MASK(here));
    PUT_WHERE(TO_REAL_MASK(here), *t, at.t);
}

/* What float32 knows of a cylinder: the lanes that may meet it, those that surely enter it by its side, and bounds of
 * 1/t, or of parallel rays -t: the lower one is that of these lanes. */
typedef struct {
    MASK may, sure;
    Bounds near;
} RodSight;

/* t a is b - sqrt(D). a is off by 14 u A, A = |w|^2, see filter.cl, and a quotient by 3 u. */
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
        const RodSight sight = rod_sight(scene, *line, index - FIRST_CYLINDER(scene->spheres));
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
    const REAL t = rod_encounter(scene->spheres, from_eye(scene->spheres, own), (INT)index, TO_REAL_MASK(open)).t;
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
    const MASK lost = IS_CYLINDER(scene->spheres, hit->id) & TO_MASK(!(hit->t < INFINITY));
    PUT_WHERE(TO_REAL_MASK(lost), hit->t, TO_REAL(far_of(hit->near.low)));
}

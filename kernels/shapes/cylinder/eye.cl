/* eye.cl: cylinders along rays from the eye. */

/* Puts t of the lanes that have hit cylinders so far into theirs. */
static __attribute__((noinline)) void cylinder_settle_t(const Scene *scene, const EyeRay ray, const Rival hit,
                                                        REAL *t) {
    const MASK here = IS_CYLINDER(scene->spheres, hit.id);
    if (!ANY(here)) return;
    const RodMeeting at = rod_encounter(scene->spheres, from_eye(scene->spheres, ray), hit.id, TO_REAL_MASK(here));
    PUT_WHERE(TO_REAL_MASK(here), *t, at.t);
}

/* Which lanes may meet a cylinder, as far as float32 knows. */
static __attribute__((always_inline)) MASK rod_may_be_seen(const Scene *scene, const EyeLine line, const int index) {
    const int along = HAS(WITH_PARALLEL_RAYS);
    const Float3 start = {along ? line.x : (FLOAT)0, along ? line.y : (FLOAT)0, 0};
    const Float3 w = {along ? (FLOAT)0 : line.x, along ? (FLOAT)0 : line.y, -1};
    return rod_line(scene->rod_seen + 2 * (index - FIRST_CYLINDER(scene->spheres)), start, w, line.a).may;
}

/* Takes a cylinder into account, and tells whether any lane hits it. */
static __attribute__((always_inline)) int cylinder_take(const Scene *scene, const Ray ray, EyeLine *line,
                                                        const int index, Hit *hit, Work *work) {
    if (HAS(WITH_FILTER) && !ANY(rod_may_be_seen(scene, *line, index))) {
        COUNT(FILTERED, ALL_LANES);
        return 0;
    }
    COUNT(DECIDED, ALL_LANES);
    const EyeRay own = eye_ray(ray);
    const REAL t = rod_encounter(scene->spheres, from_eye(scene->spheres, own), (INT)index, TO_REAL_MASK(ALL_LANES)).t;
    const MASK met = TO_MASK(t < INFINITY);
    if (!ANY(met)) return 0;
    const Bounds near = near_of(t, scene->unit);
    MASK nearer = met & (near.low > hit->near.high);
    const MASK open = met & !nearer & !(near.high < hit->near.low);
    if (RARELY(ANY(open))) {
        const Scene all = *scene; /* copied here, lest compilers keep it in memory all the time */
        const Rival rival = {hit->t, hit->id, hit->sure};
        nearer = nearer | (open & TO_MASK(comes_before(&all, &own, t, (INT)index, &rival)));
    }
    PUT_WHERE(nearer, hit->near.low, near.low);
    PUT_WHERE(nearer, hit->near.high, near.high);
    PUT_WHERE(nearer, hit->id, (INT)index);
    return ANY(nearer);
}

/* Puts into a hit where the rays meet cylinders. */
static __attribute__((always_inline)) void cylinder_settle(const Scene *scene, const Ray ray, Hit *hit) {
    const Rival rival = {hit->t, hit->id, hit->sure};
    cylinder_settle_t(scene, eye_ray(ray), rival, &hit->t);
}

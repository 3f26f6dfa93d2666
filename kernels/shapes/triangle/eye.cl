/* eye.cl: triangles along rays from the eye. */

/* Where each of the lanes' rays meets its triangle. */
typedef struct {
    REAL t; /* INFINITY if it does not */
    Shares shares;
    REAL_MASK unsure; /* whether double cannot tell t; always false in single */
} Crossing;

/* The crossings of the lanes of `wanted`, as far as `real` tells. inside: lanes of which it is known that all three
 * volumes have the sign of D. */
#if REAL_BYTES == 8
static __attribute__((always_inline)) Crossing triangle_meet(const Path path, const Triangle T, const REAL_MASK wanted,
                                                             const REAL_MASK inside) {
    const Volumes v = volumes_of(path, T);
    const REAL D = v.D, t = D / v.den;
    Crossing at = {(REAL)INFINITY, {v.EB, v.EC, v.den}, 0};
    REAL_MASK meets = inside, misses = 0;
    if (ANY(TO_MASK(wanted & !inside))) {
        const REAL least = smaller_of(v.EA, smaller_of(v.EB, v.EC)), most = larger_of(v.EA, larger_of(v.EB, v.EC));
        const REAL_MASK split = (least < -v.E_error) & (most > v.E_error);
        const REAL_MASK before = (D > v.D_error) & (least < -v.E_error), behind = (D < -v.D_error) & (most > v.E_error);
        misses = !inside & (split | before | behind);
        meets = inside | ((D > 0) & (least > v.E_error)) | ((D < 0) & (most < -v.E_error));
    }
    const REAL_MASK sure_t = (fabs(D) > 0x1p26 * v.D_error) & (fabs(v.den) > 0x1p26 * v.den_error);
    at.unsure = wanted & !misses & !(meets & sure_t);
    at.t = (wanted & meets & sure_t) ? t : at.t;
    /* Along parallel rays it is known that the volumes have one sign, and so that of N.w, not which: the triangle may
     * be behind the plane where they start. */
    if (HAS(WITH_PARALLEL_RAYS)) at.t = t > 0 ? at.t : (REAL)INFINITY;
    return at;
}

/* Puts what pairs say into the lanes that are unsure. Scene and rays are copied there: else compilers keep them in
 * memory all the time. */
static __attribute__((always_inline)) void decide_crossing(const Spheres spheres, const EyeRay ray, const INT number,
                                                           Crossing *at) {
    if (!UNDECIDED(spheres, ANY(TO_MASK(at->unsure)))) return;
    const Spheres all = spheres;
    const EyeRay own = ray;
    const FineTriangle fine = fine_meeting_from_eye(&all, &own, number, at->unsure);
    at->t = (at->unsure & fine.hit) ? fine.t.hi : at->t;
}

static __attribute__((always_inline)) void decide_encounter(const Spheres spheres, const Leaving ray, const INT index,
                                                            Crossing *at) {
    if (!UNDECIDED(spheres, ANY(TO_MASK(at->unsure)))) return;
    at->unsure = at->unsure & !TO_REAL_MASK(known_in_one_plane(spheres, index, ray.own));
    if (!ANY(TO_MASK(at->unsure))) return;
    const INT number = TRIANGLE_OR_NONE(spheres, index);
    const FineTriangle fine = fine_meeting_of(spheres, ray, number, at->unsure);
    at->t = (at->unsure & fine.hit) ? fine.t.hi : at->t;
}
#else
/* Float tells no ties apart: both triangles at an edge are met, and none is missed. */
static __attribute__((always_inline)) Crossing triangle_meet(const Path path, const Triangle T, const REAL_MASK wanted,
                                                             const REAL_MASK inside) {
    const Volumes v = volumes_of(path, T);
    const REAL D = v.D, t = D / v.den;
    const REAL least = smaller_of(v.EA, smaller_of(v.EB, v.EC)), most = larger_of(v.EA, larger_of(v.EB, v.EC));
    const REAL_MASK meets = inside | ((D > 0) & (least >= 0)) | ((D < 0) & (most <= 0));
    const Crossing at = {(wanted & meets & (t > 0)) ? t : (REAL)INFINITY, {v.EB, v.EC, v.den}, 0};
    return at;
}
#define decide_crossing(spheres, ray, number, at)
#define decide_encounter(spheres, ray, index, at)
#endif

/* The crossings of rays from the eye. number: of the triangles T. */
static __attribute__((always_inline)) Crossing triangle_meet_from_eye(const Spheres spheres, const EyeRay ray,
                                                                      const Triangle T, const INT number,
                                                                      const REAL_MASK wanted, const REAL_MASK inside) {
    Crossing at = triangle_meet(path_of(from_eye(spheres, ray)), T, wanted, inside);
    decide_crossing(spheres, ray, number, &at);
    return at;
}

/* Bounds of 1/t, or of parallel rays -t, where rays meet a triangle's plane. That of parallel rays is known as along a
 * parallel light, to 2^-27 beside the roundings. */
static Bounds near_plane(const FLOAT x, const FLOAT y, __global const float4 *facet) {
    const Bounds plane = plane_at(x, y, (FLOAT)(HAS(WITH_PARALLEL_RAYS) ? 1 : -1), facet);
    if (!HAS(WITH_PARALLEL_RAYS)) return plane;
    const Bounds bounds = {-plane.high - 0x1p-26f, -plane.low + 0x1p-26f};
    return bounds;
}

/* Where the lanes of a hit meet its triangles; others get any crossing. */
static __attribute__((always_inline)) Crossing crossing_of(const Spheres spheres, const EyeRay ray, const INT id,
                                                           const MASK sure) {
    const MASK here = IS_TRIANGLE(spheres, id);
    const INT number = here ? id - FIRST_TRIANGLE(spheres) : (INT)-1;
    return triangle_meet_from_eye(spheres, ray, triangles_of(spheres, number), number, TO_REAL_MASK(here),
                                  TO_REAL_MASK(here & sure));
}

/* Puts t of the lanes that have hit triangles so far into theirs. */
static __attribute__((noinline)) void triangle_settle_t(const Scene *scene, const EyeRay ray, const Rival hit,
                                                        REAL *t) {
    const MASK here = IS_TRIANGLE(scene->spheres, hit.id);
    if (!ANY(here)) return;
    const Crossing at = crossing_of(scene->spheres, ray, hit.id, hit.sure);
    PUT_WHERE(TO_REAL_MASK(here), *t, at.t);
}

/* What is decided of a triangle: in which lanes it is hit, first, and bounds of 1/t there. */
typedef struct {
    MASK nearer;
    Bounds near;
} Decision;

/* That of the lanes of `open`, where float32 cannot tell. inside: as in triangle_meet(); hit: what they have hit so
 * far. */
static __attribute__((noinline)) Decision decide_triangle(const Scene *scene, const EyeRay *ray, const int index,
                                                          const MASK open, const MASK inside, const Rival *hit) {
    const int number = index - FIRST_TRIANGLE(scene->spheres);
    const REAL t = triangle_meet_from_eye(scene->spheres, *ray, triangle_at(scene->spheres, number), (INT)number,
                                          TO_REAL_MASK(open), TO_REAL_MASK(inside))
                       .t;
    const REAL_MASK nearer = comes_before(scene, ray, t, (INT)index, hit) & (t < INFINITY);
    const Decision decision = {TO_MASK(nearer), near_of(t, scene->unit)};
    return decision;
}

/* Takes a triangle into account, and tells whether any lane hits it. Of an orthographic camera, the facets are lines on
 * the image plane, as those of a parallel light are. */
static __attribute__((always_inline)) int triangle_take(const Scene *scene, const Ray ray, EyeLine *line,
                                                        const int index, Hit *hit, Work *work) {
    const FLOAT x = line->x, y = line->y;
    MASK open = ALL_LANES, inside = 0;
    if (HAS(WITH_FILTER)) {
        __global const float4 *facet = scene->facet + 3 * (long)(index - FIRST_TRIANGLE(scene->spheres));
        const Sides sides = sides_of(x, y, (FLOAT)(HAS(WITH_PARALLEL_RAYS) ? 1 : -1), 1, facet);
        if (!ANY(sides.open)) {
            COUNT(FILTERED, ALL_LANES);
            return 0;
        }
        const Bounds near = near_plane(x, y, facet);
        MASK nearer = sides.inside & (near.low > hit->near.high);
        /* Of parallel rays, it may be behind the plane where they start. */
        if (HAS(WITH_PARALLEL_RAYS)) nearer = nearer & (near.high < 0);
        open = sides.open & !nearer & !(near.high < hit->near.low);
        if (HAS(WITH_PARALLEL_RAYS)) open = open & !(near.low > 0);
        inside = sides.inside;
        PUT_WHERE(nearer, hit->near.low, near.low);
        PUT_WHERE(nearer, hit->near.high, near.high);
        PUT_WHERE(nearer, hit->id, (INT)index);
        hit->sure = hit->sure | nearer;
        if (!RARELY(ANY(open))) return ANY(nearer);
    }
    COUNT(DECIDED, open);
    if (is_over(scene)) return 0;
    /* Lanes that surely meet it, and have met another one in its plane: so at the same t. */
    const MASK level = open & inside & known_in_one_plane(scene->spheres, (INT)index, hit->id);
    const MASK lower = level & first_in_file(scene, (INT)index, hit->id);
    PUT_WHERE(lower, hit->id, (INT)index);
    hit->sure = hit->sure | lower;
    open = open & !level;
    if (!ANY(open)) return 1;
    const Scene all = *scene;
    const EyeRay own = eye_ray(ray);
    const Rival rival = {hit->t, hit->id, hit->sure};
    const Decision is = decide_triangle(&all, &own, index, open, inside, &rival);
    PUT_WHERE(is.nearer, hit->near.low, is.near.low);
    PUT_WHERE(is.nearer, hit->near.high, is.near.high);
    PUT_WHERE(is.nearer, hit->id, (INT)index);
    PUT_WHERE(is.nearer, hit->sure, inside);
    return 1;
}

/* Puts into a hit where the rays meet triangles. */
static __attribute__((always_inline)) void triangle_settle(const Scene *scene, const Ray ray, Hit *hit) {
    const MASK face = IS_TRIANGLE(scene->spheres, hit->id);
    if (!ANY(face)) return;
    const REAL_MASK here = TO_REAL_MASK(face);
    const Crossing at = crossing_of(scene->spheres, eye_ray(ray), hit->id, hit->sure);
    hit->shares = at.shares;
    /* Where a triangle is seen all but from its edge, rounding to float may lose it. */
    const REAL t = REAL_BYTES == 8 ? at.t : at.t < INFINITY ? at.t : TO_REAL(far_of(hit->near.low));
    PUT_WHERE(here, hit->t, t);
}

/* closest.cl: the nearest surface along a ray from the eye. */

/* What was hit: the sphere's place in the buffers, -1 = nothing, the distance in units of the ray's direction, and
 * where on it. */
typedef struct {
    REAL t;
    INT id;
    Real3 from_center; /* not of an ellipsoid */
#ifdef WITH_ELLIPSOIDS
    REAL_MASK inside; /* of an ellipsoid, whether the eye is */
#endif
#ifdef WITH_TRIANGLES
    Shares shares; /* of a triangle */
    /* While triangles are looked for: bounds of 1/t, of an orthographic camera of -t, in the float buffers' unit, 0 where nothing was hit. Neither t nor shares
     * of a triangle are known then; `sure` as in triangle_meet(). */
    Bounds near;
    MASK sure;
#endif
} Hit;

/* A list ends for a ray where it has found something nearer, squared. With doubles that is known to 2^-25. */
#if REAL_BYTES == 8
#define REACH_SLACK (1.0f + 0x1p-20f)
#else
#define REACH_SLACK (1.0f + 0x1p-8f)
#endif

/* What lists are sorted by, at t = far: the squared distance from the eye; of an orthographic camera, the distance. */
#ifdef WITH_PARALLEL_RAYS
#define DEPTH_AT(far, a) far
#define IMAGE_PLANE 1
#else
#define DEPTH_AT(far, a) far * far * a
#define IMAGE_PLANE -1
#endif

/* What tells in float32 which triangle is nearer: 1/t, of which a triangle's plane is a linear function, or, of an
 * orthographic camera, -t. t of the furthest end of such bounds. */
#ifdef WITH_PARALLEL_RAYS
#define FAR_OF(low) (low < 0 ? -low : (FLOAT)0.0f)
#else
#define FAR_OF(low) 1 / low
#endif

/* Where t is so close to the nearest one so far that they are to be compared exactly. */
static REAL_MASK too_close(const REAL t, const REAL best) {
#if REAL_BYTES == 8
    /* Both are off by at most 2^-24 (see sphere_meet and sphere_meet_from). */
    const REAL margin = best * 0x1p-22;
    return (t - best <= margin) & (best - t <= margin) & (best < INFINITY);
#else
    return (t == best) & (t < INFINITY);
#endif
}

#ifdef WITH_TRIANGLES
/* Bounds of 1/t from t, which is right to 2^-24. */
static Bounds near_of(const REAL t, const real unit) {
#ifdef WITH_PARALLEL_RAYS
    const FLOAT far = TO_FLOAT(t * unit);
    const Bounds bounds = {-far * (1 + 0x1p-20f), -far * (1 - 0x1p-20f)};
    return bounds;
}

/* The same where rays meet a triangle's plane. That is known as along a parallel light, to 2^-27 beside the roundings. */
static Bounds near_plane(const FLOAT x, const FLOAT y, __global const float4 *facet) {
    const Bounds plane = plane_at(x, y, (FLOAT)1, facet), bounds = {-plane.high - 0x1p-26f, -plane.low + 0x1p-26f};
    return bounds;
#else
    const FLOAT near = 1 / TO_FLOAT(t * unit);
    const Bounds bounds = {near * (1 - 0x1p-20f), near * (1 + 0x1p-20f)};
    return bounds;
#endif
}

/* t of the lanes that hit triangles. d, w: the direction in camera space and in the world; sure: as in Hit. */
static __attribute__((noinline)) REAL t_of_triangles(const Spheres spheres, const Real3 d, const Real3 w, const INT id,
                                                     const MASK sure) {
    const MASK here = id >= spheres.first;
    const INT number = here ? id - spheres.first : (INT)-1;
    return triangle_meet_from_eye(spheres, d, w, triangles_of(spheres, number), number, TO_REAL_MASK(here),
                                  TO_REAL_MASK(here & sure)).t;
}

/* Which lanes meet what is at t before the triangle or sphere that they have hit so far, where float32 cannot tell. t, index:
 * of what is met; best, id: of that one, best is known of spheres only. */
static __attribute__((noinline)) REAL_MASK comes_before(const Scene *all, const Real3 *d, const Real3 *w, const REAL t,
                                                        const INT index, const REAL best, const INT id, const MASK sure) {
    const Scene scene = *all;
    REAL rival = best;
    const REAL_MASK face = TO_REAL_MASK(id >= scene.spheres.first);
    if (ANY(TO_MASK(face))) rival = face ? t_of_triangles(scene.spheres, *d, *w, id, sure) : best;
    const REAL_MASK close = too_close(t, rival);
    if (!ANY(TO_MASK(close))) return t < rival;
    return close ? comes_first_of(scene, from_eye(scene.spheres, *d, *w), index, id) : t < rival;
}
#endif

#ifndef ONLY_TRIANGLES
/* Which lanes' rays meet a sphere, at `at`, before what they have hit so far. Of equally near ones, the sphere that comes
 * first in the scene file is hit. */
static REAL_MASK closer(const Scene scene, const Ray ray, const Sphere sphere, const int index, const Meeting at,
                        const Hit hit) {
    const REAL t = at.t;
    const REAL_MASK nearer = t < hit.t;
    const REAL_MASK close = too_close(t, hit.t);
    if (!RARELY(ANY(TO_MASK(close)))) return nearer;
    REAL_MASK first = TO_REAL_MASK(scene.id_of[index] < ids_of(scene, hit.id));
    const INT rival = SPHERE_OR_NONE(scene.spheres, hit.id);
#if REAL_BYTES == 8
#ifdef WITH_ELLIPSOIDS
    const Ball ball = balls_of(scene.spheres, (INT)index), other = balls_of(scene.spheres, rival);
    const REAL_MASK stretched = close & TO_REAL_MASK((ball.map != 0) | (other.map != 0));
    const REAL_MASK mixed = comes_first_from(scene.spheres, ray.leaving, ball, index, other, rival, first);
    const REAL_MASK round = sphere_comes_first(scene.spheres, ray, sphere, spheres_of(scene.spheres, rival), first, close & !stretched);
    first = stretched ? mixed : round;
#else
    first = sphere_comes_first(scene.spheres, ray, sphere, spheres_of(scene.spheres, rival), first, close);
#endif
#endif
    return close ? first : nearer;
}

#ifdef WITH_TRIANGLES
/* The same where some lanes may have hit triangles. */
static REAL_MASK closer_than_any(const Scene scene, const Ray ray, const Sphere sphere, const int index, const Meeting at,
                                 const Hit hit) {
    const REAL_MASK round = closer(scene, ray, sphere, index, at, hit);
    const MASK face = hit.id >= scene.spheres.first;
    if (!ANY(face)) return round;
    const Bounds near = near_of(at.t, scene.unit);
    const MASK nearer = near.low > hit.near.high, open = face & !nearer & !(near.high < hit.near.low);
    const REAL_MASK sure = TO_REAL_MASK(face) ? TO_REAL_MASK(nearer) : round;
    if (!RARELY(ANY(open))) return sure;
    const Scene all = scene;
    const Real3 d = OWN(ray), w = ray.w;
    return TO_REAL_MASK(open) ? comes_before(&all, &d, &w, at.t, (INT)index, hit.t, hit.id, hit.sure) : sure;
}
#endif
#endif

#ifdef WITH_TRIANGLES
/* What is decided of a triangle: in which lanes it is hit, first, and bounds of 1/t there. */
typedef struct {
    MASK nearer;
    Bounds near;
} Decision;

/* That of the lanes of `open`, where float32 cannot tell. inside: as in triangle_meet(); best, id, sure: of the hit so far. */
static __attribute__((noinline)) Decision decide_triangle(const Scene *all, const Real3 *d, const Real3 *w, const int index,
                                                          const MASK open, const MASK inside, const REAL best, const INT id,
                                                          const MASK sure) {
    const Scene scene = *all;
    const int number = index - scene.spheres.first;
    const REAL t = triangle_meet_from_eye(scene.spheres, *d, *w, triangle_at(scene.spheres, number), (INT)number,
                                          TO_REAL_MASK(open), TO_REAL_MASK(inside)).t;
    const REAL_MASK nearer = comes_before(all, d, w, t, (INT)index, best, id, sure) & (t < INFINITY);
    const Decision decision = {TO_MASK(nearer), near_of(t, scene.unit)};
    return decision;
}

/* Takes a triangle into account, and tells whether any lane hits it. x, y: where the rays cross the image plane, in float;
 * of an orthographic camera, the facets are lines there, as those of a parallel light are. */
static __attribute__((always_inline)) int meet_triangle(const Scene scene, const Ray ray, const FLOAT x, const FLOAT y, const int index, Hit *hit,
                          Work *work) {
    MASK open = ALL_LANES, inside = 0;
#ifdef WITH_FILTER
    __global const float4 *facet = scene.facet + 3 * (long)(index - scene.spheres.first);
    const Sides sides = sides_of(x, y, (FLOAT)IMAGE_PLANE, 1, facet);
    if (!ANY(sides.open)) {
        COUNT(FILTERED, ALL_LANES);
        return 0;
    }
#ifdef WITH_PARALLEL_RAYS
    /* It may be behind the plane where the rays start. */
    const Bounds near = near_plane(x, y, facet);
    const MASK nearer = sides.inside & (near.low > hit->near.high) & (near.high < 0);
    open = sides.open & !nearer & !(near.high < hit->near.low) & !(near.low > 0);
#else
    const Bounds near = plane_at(x, y, (FLOAT)-1, facet);
    const MASK nearer = sides.inside & (near.low > hit->near.high);
    open = sides.open & !nearer & !(near.high < hit->near.low);
#endif
    inside = sides.inside;
    PUT_WHERE(nearer, hit->near.low, near.low);
    PUT_WHERE(nearer, hit->near.high, near.high);
    PUT_WHERE(nearer, hit->id, (INT)index);
    hit->sure = hit->sure | nearer;
    if (!RARELY(ANY(open))) return ANY(nearer);
#endif
    COUNT(DECIDED, open);
    const Scene all = scene;
    const Real3 d = OWN(ray), w = ray.w;
    const Decision is = decide_triangle(&all, &d, &w, index, open, inside, hit->t, hit->id, hit->sure);
    PUT_WHERE(is.nearer, hit->near.low, is.near.low);
    PUT_WHERE(is.nearer, hit->near.high, is.near.high);
    PUT_WHERE(is.nearer, hit->id, (INT)index);
    PUT_WHERE(is.nearer, hit->sure, inside);
    return 1;
}

/* Puts into a hit where the rays meet triangles. */
static __attribute__((always_inline)) void settle(const Scene scene, const Ray ray, Hit *hit) {
    const MASK face = hit->id >= scene.spheres.first;
    const INT number = face ? hit->id - scene.spheres.first : (INT)-1;
    const REAL_MASK here = TO_REAL_MASK(face);
    const Crossing at = triangle_meet_from_eye(scene.spheres, OWN(ray), ray.w, triangles_of(scene.spheres, number), number, here,
                                               TO_REAL_MASK(face & hit->sure));
    hit->shares = at.shares;
#if REAL_BYTES == 8
    PUT_WHERE(here, hit->t, at.t);
#else
    /* Where a triangle is seen all but from its edge, rounding may lose it. */
    PUT_WHERE(here, hit->t, at.t < INFINITY ? at.t : FAR_OF(hit->near.low));
#endif
}
#endif

/* The nearest surface along the ray; of equally near ones, that which comes first in the scene file.
 * tile: the packet's place in the picture, in units of TILE x TILE pixels.
 */
static Hit closest_hit(const Scene scene, const Ray ray, const int2 tile, Work *work) {
    Hit hit = {INFINITY, -1, {0, 0, 1}};
#if defined(WITH_PARALLEL_RAYS) && defined(WITH_TRIANGLES)
    hit.near.low = hit.near.high = -INFINITY;
#endif
#ifdef WITH_PARALLEL_RAYS
    const FLOAT dx = TO_FLOAT(ray.o.x * scene.unit), dy = TO_FLOAT(ray.o.y * scene.unit);
#else
    const FLOAT dx = TO_FLOAT(ray.d.x), dy = TO_FLOAT(ray.d.y);
    const FLOAT a = FMA(dx, dx, FMA(dy, dy, (FLOAT)1.0f));
#endif
    int found = 0;          /* whether any lane may have a hit */
    float reach = INFINITY; /* no lane has a use for anything of which the nearest point is beyond, squared */
    const Grid grid = scene.lists.grid[0];
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile);
        const int end = scene.lists.start[cell + 1];
        /* Of the next tile: its list is the next one. */
        FETCH_AHEAD(scene, scene.eye_filter, -1, end);
        for (int k = scene.lists.start[cell]; k < end; k++) {
            const int2 entry = scene.lists.entry[k];
            if (as_float(entry.y) > reach) break;
            FETCH_ENTRY(scene, scene.eye_filter, -1, k + AHEAD);
            FETCH_MATERIAL_OF(scene, k + AHEAD);
            const int index = entry.x;
#ifdef WITH_TRIANGLES
            if (index >= scene.spheres.first) {
                if (!meet_triangle(scene, ray, dx, dy, index, &hit, work)) continue;
                const FLOAT far = FAR_OF(hit.near.low);
                reach = LARGEST_FLOAT(DEPTH_AT(far, a) * REACH_SLACK);
                continue;
            }
#endif
#ifndef ONLY_TRIANGLES
#ifdef WITH_FILTER
            const float4 s = scene.eye_filter[index];
#ifdef WITH_PARALLEL_RAYS
            /* The test of a parallel light, see filter_leaves(). The host has made the disc larger by what the axes of the
             * camera are not orthonormal by. */
            const FLOAT du = s.x - dx, dv = s.y - dy;
            const MASK may_meet = FMA(du, du, dv * dv) <= s.z;
            if (!ANY(may_meet)) {
#else
            const FLOAT b = FMA(dx, (FLOAT)s.x, FMA(dy, (FLOAT)s.y, (FLOAT)-s.z));
            if (!ANY(sphere_may_meet(b, a, s))) {
#endif
                COUNT(FILTERED, ALL_LANES);
                continue;
            }
#endif
            COUNT(DECIDED, ALL_LANES);
            const Sphere sphere = sphere_at(scene.spheres, index);
#ifdef WITH_ELLIPSOIDS
            Meeting at;
            REAL_MASK inside = 0;
            if (scene.spheres.map_of[index]) {
                const Ball ball = balls_of(scene.spheres, (INT)index);
                const Encounter met = sphere_meet_from(scene.spheres, ray.leaving, ball, (INT)index, TO_REAL_MASK(ALL_LANES));
                at.t = met.t;
                at.from_center = ray.d;
                inside = met.inside;
            } else {
                at = sphere_meet(scene.spheres, ray, sphere);
            }
#else
            const Meeting at = sphere_meet(scene.spheres, ray, sphere);
#endif
#ifdef WITH_TRIANGLES
            const REAL_MASK nearer = closer_than_any(scene, ray, sphere, index, at, hit);
#else
            const REAL_MASK nearer = found ? closer(scene, ray, sphere, index, at, hit) : at.t < hit.t;
#endif
            found = 1;
            FETCH_MATERIAL(scene, index, nearer);
            hit.t = nearer ? at.t : hit.t;
            hit.id = TO_MASK(nearer) ? (INT)index : hit.id;
            PUT_WHERE(nearer, hit.from_center.x, at.from_center.x);
            PUT_WHERE(nearer, hit.from_center.y, at.from_center.y);
            PUT_WHERE(nearer, hit.from_center.z, at.from_center.z);
#ifdef WITH_ELLIPSOIDS
            PUT_WHERE(nearer, hit.inside, inside);
#endif
#ifdef WITH_TRIANGLES
            const Bounds near = near_of(at.t, scene.unit);
            PUT_WHERE(TO_MASK(nearer), hit.near.low, near.low);
            PUT_WHERE(TO_MASK(nearer), hit.near.high, near.high);
            const FLOAT far = FAR_OF(hit.near.low);
#else
            const FLOAT far = TO_FLOAT(hit.t * scene.unit);
#endif
            reach = LARGEST_FLOAT(DEPTH_AT(far, a) * REACH_SLACK);
#endif
        }
    }
#ifdef WITH_TRIANGLES
    if (ANY(hit.id >= scene.spheres.first)) settle(scene, ray, &hit);
#endif
    return hit;
}

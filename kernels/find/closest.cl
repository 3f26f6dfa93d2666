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
#endif
} Hit;

/* A list ends for a ray where it has found something nearer, squared. With doubles that is known to 2^-25. */
#if REAL_BYTES == 8
#define REACH_SLACK (1.0f + 0x1p-20f)
#else
#define REACH_SLACK (1.0f + 0x1p-8f)
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
#ifdef WITH_TRIANGLES
    const REAL_MASK face = TO_REAL_MASK(hit.id >= scene.spheres.first);
    if (ANY(TO_MASK(close & face))) first = face ? comes_first_of(scene, ray.leaving, (INT)index, hit.id) : first;
#endif
    return close ? first : nearer;
}
#endif

#ifdef WITH_TRIANGLES
/* Takes a triangle into account. x, y: where the rays cross the image plane, in float. */
static void meet_triangle(const Scene scene, const Ray ray, const FLOAT x, const FLOAT y, const int index, Hit *hit,
                          Work *work) {
    const int number = index - scene.spheres.first;
    REAL_MASK wanted = TO_REAL_MASK(ALL_LANES), inside = 0;
#ifdef WITH_FILTER
    const Sides sides = sides_of(x, y, (FLOAT)-1, scene.facet + 3 * (long)number);
    const MASK open = sides.least >= -1.0f;
    if (!ANY(open)) {
        COUNT(FILTERED, ALL_LANES);
        return;
    }
    wanted = TO_REAL_MASK(open);
#if REAL_BYTES == 4
    wanted = inside = sides.within;
#else
    inside = TO_REAL_MASK(sides.least > 1.0f);
#endif
#endif
    COUNT(DECIDED, TO_MASK(wanted));
    Shares shares;
    const REAL t = triangle_meet(scene.spheres, ray.leaving, triangle_at(scene.spheres, number), (INT)number, wanted, inside, &shares);
    const REAL_MASK close = too_close(t, hit->t);
    REAL_MASK nearer = t < hit->t;
    if (RARELY(ANY(TO_MASK(close)))) nearer = close ? comes_first_of(scene, ray.leaving, (INT)index, hit->id) : nearer;
    PUT_WHERE(nearer, hit->t, t);
    PUT_WHERE(TO_MASK(nearer), hit->id, (INT)index);
    PUT_WHERE(nearer, hit->shares.EB, shares.EB);
    PUT_WHERE(nearer, hit->shares.EC, shares.EC);
    PUT_WHERE(nearer, hit->shares.all, shares.all);
}
#endif

/* The nearest surface along the ray; of equally near ones, that which comes first in the scene file.
 * tile: the packet's place in the picture, in units of TILE x TILE pixels.
 */
static Hit closest_hit(const Scene scene, const Ray ray, const int2 tile, Work *work) {
    Hit hit = {INFINITY, -1, {0, 0, 1}};
    const FLOAT dx = TO_FLOAT(ray.d.x), dy = TO_FLOAT(ray.d.y);
    const FLOAT a = FMA(dx, dx, FMA(dy, dy, (FLOAT)1.0f));
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
            const int index = entry.x;
#ifdef WITH_TRIANGLES
            if (index >= scene.spheres.first) {
                meet_triangle(scene, ray, dx, dy, index, &hit, work);
                found = 1;
                const FLOAT far = TO_FLOAT(hit.t * scene.unit);
                reach = LARGEST_FLOAT(far * far * a * REACH_SLACK);
                continue;
            }
#endif
#ifndef ONLY_TRIANGLES
#ifdef WITH_FILTER
            const float4 s = scene.eye_filter[index];
            const FLOAT b = FMA(dx, (FLOAT)s.x, FMA(dy, (FLOAT)s.y, (FLOAT)-s.z));
            if (!ANY(sphere_may_meet(b, a, s))) {
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
            const REAL_MASK nearer = found ? closer(scene, ray, sphere, index, at, hit) : at.t < hit.t;
            found = 1;
            hit.t = nearer ? at.t : hit.t;
            hit.id = TO_MASK(nearer) ? (INT)index : hit.id;
            PUT_WHERE(nearer, hit.from_center.x, at.from_center.x);
            PUT_WHERE(nearer, hit.from_center.y, at.from_center.y);
            PUT_WHERE(nearer, hit.from_center.z, at.from_center.z);
#ifdef WITH_ELLIPSOIDS
            PUT_WHERE(nearer, hit.inside, inside);
#endif
            const FLOAT far = TO_FLOAT(hit.t * scene.unit);
            reach = LARGEST_FLOAT(far * far * a * REACH_SLACK);
#endif
        }
    }
    return hit;
}

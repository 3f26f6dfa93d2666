/* closest.cl: the nearest surface along a ray from the eye, by the lists of the picture's tiles, and what fetches
 * surfaces ahead. */

/* Surfaces are fetched before they are asked. With many of them, what is read of neighbours in a list is
 * far apart in memory, and most of the time went into waiting for it.
 */
#define FETCHES (HAS(WITH_PREFETCH) && CAN_FETCH)

/* Fetches what an entry of a list will ask for. light: whose list it is, -1: of the eye. */
static void fetch_entry(const Scene *scene, const int light, const int k) {
    if (!FETCHES) return;
    const int index = scene->lists.entry[k].x;
    ASK_SHAPE(scene->geometry, index, fetch(scene, light, index));
}

/* The same for the first entries of a list. */
static void fetch_ahead(const Scene *scene, const int light, const int first) {
    for (int k = first; FETCHES && k < first + AHEAD; k++) fetch_entry(scene, light, k);
}

/* The same for the lists of all lanes' cells in a light's buffer. Points of different surfaces have lists that are far
 * apart, and what has to be waited for is there in three steps: where a list begins, its first entry, that surface's
 * filter. Few of the cells are different ones. */
static void fetch_lists(const Scene *scene, const int light, INT cell) {
    const int pays = FETCHES & (ANY_FETCHED | HAS(WITH_BOUNCES));
    if (!pays) return;
    int each[W], count = 0;
    for (int c = LARGEST(cell); c >= 0; c = LARGEST(cell)) {
        FETCH(scene->lists.start, c);
        each[count++] = c;
        cell = cell == c ? (INT)-1 : cell;
    }
    for (int k = 0; k < count; k++) FETCH(scene->lists.entry, scene->lists.start[each[k]]);
    for (int k = 0; k < count; k++) {
        const int index = scene->lists.entry[scene->lists.start[each[k]]].x;
        ASK_SHAPE(scene->geometry, index, fetch(scene, light, index));
    }
}

/* The nearest surface along a ray from the eye. Each shape's own part is in eye.cl of its folder. */

/* A list ends for a ray where it has found something nearer, squared. With doubles that is known to 2^-25. */
#define REACH_SLACK (1.0f + (REAL_BYTES == 8 ? 0x1p-20f : 0x1p-8f))

/* What lists are sorted by, at t = far: the squared distance from the eye; of an orthographic camera, the distance. */
#define DEPTH_AT(far, a) (HAS(WITH_PARALLEL_RAYS) ? (far) : (far) * (far) * (a))

/* What tells in float32 which of two late surfaces is nearer: 1/t, of which a plane is a linear function, or, of an
 * orthographic camera, -t. t of the furthest end of such bounds. */
static FLOAT far_of(const FLOAT low) {
    return HAS(WITH_PARALLEL_RAYS) ? (low < 0 ? -low : (FLOAT)0.0f) : 1 / low;
}

/* Bounds of 1/t, or of parallel rays -t, from t, which is right to 2^-24. */
static Bounds near_of(const REAL t, const real unit) {
    if (HAS(WITH_PARALLEL_RAYS)) {
        const FLOAT far = TO_FLOAT(t * unit);
        return (Bounds){-far * (1 + 0x1p-20f), -far * (1 - 0x1p-20f)};
    }
    const FLOAT near = 1 / TO_FLOAT(t * unit);
    return (Bounds){near * (1 - 0x1p-20f), near * (1 + 0x1p-20f)};
}

/* What float32 knows of the rays: x, y: their directions, or where parallel ones start; a: the square of the direction.
 */
typedef struct {
    FLOAT x, y, a;
    int found; /* whether any lane may have met a sphere */
} EyeLine;

static EyeLine eye_line(const Scene *scene, const Ray ray) {
    if (HAS(WITH_PARALLEL_RAYS))
        return (EyeLine){TO_FLOAT(ray.o.x * scene->unit), TO_FLOAT(ray.o.y * scene->unit), 1, 0};
    const FLOAT dx = TO_FLOAT(ray.d.x), dy = TO_FLOAT(ray.d.y);
    return (EyeLine){dx, dy, FMA(dx, dx, FMA(dy, dy, (FLOAT)1.0f)), 0};
}

static Hit no_hit(void) {
    Hit hit = {INFINITY, -1, {0, 0, 1}};
    if (HAS(WITH_PLANES)) hit.plane = -1;
    if (HAS(WITH_PARALLEL_RAYS) && ANY_LATE) hit.near.low = hit.near.high = -INFINITY;
    return hit;
}

/* No lane has a use for anything of which the nearest point is beyond, squared. */
static float end_of_lists(const Scene *scene, const EyeLine line, const Hit hit) {
    const FLOAT far = ANY_LATE && !HAS(WITH_PLANES) ? far_of(hit.near.low) : TO_FLOAT(hit.t * scene->unit);
    return LARGEST_FLOAT(DEPTH_AT(far, line.a) * REACH_SLACK);
}

#ifdef WITH_LEAVING
/* Which of the lanes' rays, which meet both surfaces, meet A before B: dispatch.cl asks all shapes. */
static REAL_MASK comes_first_of(const Scene *scene, const Leaving ray, const INT A, const INT B);
#endif

#if ANY_LATE
/* Which lanes meet what is at t before what they have hit so far, where float32 cannot tell: dispatch.cl asks all
 * shapes. index: of what is met. */
static REAL_MASK comes_before(const Scene *scene, const EyeRay *ray, const REAL t, const INT index, const Rival *hit);

/* In which lanes A comes before B in the scene file. */
static MASK first_in_file(const Scene *scene, const INT A, const INT B);

/* Which lanes' rays meet something at t before what they have hit so far, where that may be a late surface: `nearer`
 * tells of all others. */
static REAL_MASK nearer_than_any(const Scene *scene, const Ray ray, const int index, const REAL t, const Hit hit,
                                 const REAL_MASK nearer) {
    const MASK late = IS_LATE(scene->geometry, hit.id);
    if (!ANY(late)) return nearer;
    const Bounds near = near_of(t, scene->unit);
    const MASK before = near.low > hit.near.high, open = late & !before & !(near.high < hit.near.low);
    const REAL_MASK sure = TO_REAL_MASK(late) ? TO_REAL_MASK(before) : nearer;
    if (!RARELY(ANY(open))) return sure;
    const Scene all = *scene;
    const EyeRay own = eye_ray(ray);
    const Rival rival = {hit.t, hit.id, hit.sure};
    return TO_REAL_MASK(open) ? comes_before(&all, &own, t, (INT)index, &rival) : sure;
}
#else
#define nearer_than_any(scene, ray, index, t, hit, nearer) nearer
#endif

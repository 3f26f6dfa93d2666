/* hit.cl: what rays have met. */

/* A number that is surely above `low` and below `high`; what is unknown about is a NaN. */
typedef struct {
    FLOAT low, high;
} Bounds;

/* What tells where on a triangle a ray meets it: the volumes opposite B and C, and all three together. */
typedef struct {
    REAL EB, EC, all;
} Shares;

/* What a ray from the eye has hit: the surface's index, -1 = nothing, the distance in units of the ray's direction, and
 * where on it. */
typedef struct {
    REAL t;
    INT id;
    Real3 from_center; /* of a sphere */
    REAL_MASK inside;  /* of an ellipsoid, whether the eye is */
    Shares shares;     /* of a triangle */
    /* Of late shapes, while surfaces are looked for: bounds of 1/t, of an orthographic camera of -t, in the float
     * buffers' unit, 0 where nothing was hit. Neither t nor shares are known then; `sure`: where it is known that the
     * ray meets the surface's plane within it. */
    Bounds near;
    MASK sure;
    INT plane; /* WITH_PLANES, of a cap, of which `id` is the surface that it closes; -1 of all else */
} Hit;

/* Of a hit so far, what something else is compared with where float32 cannot tell: as in Hit. */
typedef struct {
    REAL t;
    INT id;
    MASK sure;
} Rival;

/* Where a ray that starts on a surface meets another one: the smallest t > 0, INFINITY if it does not. */
typedef struct {
    REAL t;
    REAL_MASK inside; /* whether it comes from the inside of what it meets */
    Shares shares;    /* of late shapes: where on a triangle */
} Encounter;

/* What such rays have met: the nearest encounter, and with which surface; -1 = none. */
typedef struct {
    Encounter at;
    INT id;
    INT plane; /* WITH_PLANES, as in Hit */
} Met;

/* Where t is so close to the nearest one so far that they are to be compared exactly. With doubles, both are off by at
 * most 2^-24 (see sphere_meet and sphere_meet_from). */
static REAL_MASK too_close(const REAL t, const REAL best) {
    if (REAL_BYTES == 4) return (t == best) & (t < INFINITY);
    const REAL margin = best * (real)0x1p-22f;
    return (t - best <= margin) & (best - t <= margin) & (best < INFINITY);
}

/* The number in the scene file of each lane's surface; -1 for none. */
static INT ids_of(const Scene *scene, const INT index) {
    int each[W];
    STORE_LANES(index, each);
    for (int lane = 0; lane < W; lane++) each[lane] = each[lane] < 0 ? -1 : scene->id_of[each[lane]];
    return LOAD_LANES(each);
}

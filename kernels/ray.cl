/* ray.cl: what is counted, rays, and what they have met. */

/* What was done and what was skipped, counted in each lane for --stats: COUNTERS of cltrace/plan/abi.py;
 * and marks, which tell samples apart that met different surfaces. */
typedef struct {
    INT count[HAS(OUT_WORK) ? COUNTERS : 1];
    LANES(uint) mark, texels;
    MASK uneven; /* which have met uneven squares of texels, see shade/materials.cl */
} Work;

/* Nothing counted so far. */
static Work no_work(void) {
    Work work;
    for (int k = 0; HAS(OUT_WORK) && k < COUNTERS; k++) work.count[k] = 0;
    return work;
}

/* Counts the lanes of a mask. */
#define COUNT(kind, mask)                                                                     \
    do {                                                                                      \
        if (HAS(OUT_WORK)) work->count[HAS(OUT_WORK) ? kind : 0] += (mask) ? (INT)1 : (INT)0; \
    } while (0)

/* Rare features share the flag WITH_EXTRAS, and fields of the scene say which of them a picture has. Programs without
 * the flag write nothing but bytes, and are faster. */
#define EXTRA(scene, field) (HAS(WITH_EXTRAS) && (scene)->field)
#define TEXTURED(scene) (HAS(WITH_TEXTURES) || EXTRA(scene, textures))
#define MAPPED(scene) (HAS(WITH_TEXTURES) || EXTRA(scene, mapped))
#define HAS_COLORS(scene) (!HAS(WITH_EXTRAS) || (scene)->shading)

/* Whether the host wants nothing more. What long loops leave then is no picture: the host has it drawn again. */
static int is_over(const Scene *scene) {
    return *scene->last < 0;
}

/* Where a work-item's mark is in `undecided`, behind that of all. */
static int number_of_item(void) {
    return 1 + (int)(get_global_id(1) * get_global_size(0) + get_global_id(0));
}

/* The first program IN_STAGES leaves a work-item's pixel to the second one. */
static int mark_undecided(const Geometry geometry) {
    geometry.undecided[0] = geometry.undecided[number_of_item()] = 1;
    return 0;
}

/* A sum of such numbers says what all rays of a sample have met, in whatever order: surfaces at each depth, and lights
 * that reach these; and, as another sum, between which texels. Equal numbers of two different sums are a matter of
 * chance, one in 2^31. */
static LANES(uint) mark_of(const INT surface, const int what) {
    LANES(uint) h = AS(uint, surface) * 0x9e3779b1u + (uint)what * 0x85ebca6bu;
    h = (h ^ (h >> 15)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12)) * 0x297a2d39u;
    return h ^ (h >> 15);
}
#define MARK(where, mask, surface, what)                                                        \
    do {                                                                                        \
        if (HAS(WITH_SAMPLES)) work->where += (mask) ? mark_of(surface, what) : (LANES(uint))0; \
    } while (0)

/* The rays from the eye, and those that leave surfaces.
 *
 * Everything is in camera space: the eye is the origin and looks along -z, x is right, y is up. The host has moved the
 * scene there in more than double precision. Lengths are in scene units. Where `real` is float, and in all float
 * buffers, they are multiplied by a power of two that makes the largest coordinate about 1.
 *
 * A primary ray is the points t d, t > 0, with d = (x, y, -1). d is not normalised, which would be one rounding more,
 * so t is in units of |d|. Of an orthographic camera, it is the points o + t d with o = (x, y, 0) and d = (0, 0, -1).
 */

/* A vector of camera space in the world: B^T v. */
static Real3 turned_to_world(const Frame frame, const Real3 v) {
    return (Real3){(frame.right.x * v.x + frame.up.x * v.y) + frame.back.x * v.z,
                   (frame.right.y * v.x + frame.up.y * v.y) + frame.back.y * v.z,
                   (frame.right.z * v.x + frame.up.z * v.y) + frame.back.z * v.z};
}

/* Rays leave a cap from the point q of the world, rounded, which need not be in its plane: nothing is met there. */
#define CAP (-2)

/* Rays that leave surfaces.
 *
 * They start at center + p exactly: the center is that of a sphere, a corner of a triangle, the eye or a light. What p
 * is off by is below 2^-49 of `reach`, and what w is off by below 2^-49 of w1. */
typedef struct {
    INT own;         /* index of the surface; -1: none, it comes from the eye */
    REAL_MASK inner; /* whether the ray leaves it on its inside */
    Real3 n, d;      /* the outward unit normal there, and the direction, in camera space */
    /* What follows from these, in the world and rounded. */
    Real3 center;  /* of the own sphere */
    REAL r, reach; /* its radius; no less than |p|, but for rounding */
    Real3 p, w;    /* from that centre to P; the direction */
    REAL w1;       /* no less than |w.x| + |w.y| + |w.z| */
    /* WITH_SHAPES, of an ellipsoid: see shapes/sphere/leaving.cl; of a triangle: the point's u, v and corner, see
     * triangle_leave(); of a ray from an orthographic camera: its place on the plane. */
    Real3 q;
} Leaving;

static Real3 turned_to_camera(const Frame frame, const Real3 v) {
    return (Real3){DOT(frame.right, v), DOT(frame.up, v), DOT(frame.back, v)};
}

typedef struct {
    REAL a, over_a; /* d.d, 1 / d.d */
    Real3 d;
    /* Of parallel rays only: */
    Real3 o;
    REAL reach; /* |o.x| + |o.y| */
    Real3 w;    /* WITH_SHAPES, the direction in the world; of an orthographic camera, the way from the eye to o */
} Ray;

/* What tells a ray from the others of its camera, in camera space. */
#define OWN(ray) (HAS(WITH_PARALLEL_RAYS) ? (ray).o : (ray).d)

/* That, and the same in the world: all that is passed on of a ray of the camera. */
typedef struct {
    Real3 own, w;
} EyeRay;

static EyeRay eye_ray(const Ray ray) {
    return (EyeRay){OWN(ray), ray.w};
}

/* A ray of the camera as one that leaves a point. The ray of an orthographic camera leaves exactly the eye plus x and y
 * times two axes of the camera. */
static Leaving from_eye(const Geometry geometry, const EyeRay from) {
    const Real3 own = from.own, w = from.w;
    const Real3 eye = {geometry.eye.x, geometry.eye.y, geometry.eye.z}, none = {0, 0, 0};
    if (HAS(WITH_PARALLEL_RAYS)) {
        const Real3 d = {0, 0, -1}, ahead = {geometry.ahead.x, geometry.ahead.y, geometry.ahead.z};
        return (Leaving){-1, 0, {1, 0, 0}, d, eye, 0, size_of(own), w, ahead, size_of(ahead), own};
    }
    return (Leaving){-1, 0, {1, 0, 0}, own, eye, 0, 0, none, w, size_of(w), none};
}

/* The point of a ray at t. */
static Real3 point_at(const Ray ray, const REAL t) {
    const Real3 seen = {t * ray.d.x, t * ray.d.y, -t}, ahead = {ray.o.x, ray.o.y, -t};
    return HAS(WITH_PARALLEL_RAYS) ? ahead : seen;
}

/* A ray of the camera with all that ellipsoids and triangles need of it. */
static Ray for_shapes(const Frame frame, Ray ray) {
    if (HAS(WITH_SHAPES)) ray.w = turned_to_world(frame, OWN(ray));
    return ray;
}

/* What rays have met. */

/* A number that is surely above `low` and below `high`; what is unknown about is a NaN. */
typedef struct {
    FLOAT low, high;
} Bounds;

/* What tells where on a triangle a ray meets it: the volumes opposite B and C, and all three together. */
typedef struct {
    REAL EB, EC, all;
} Shares;

static void put_shares(const REAL_MASK here, const Shares from, Shares *shares) {
    PUT_WHERE(here, shares->EB, from.EB);
    PUT_WHERE(here, shares->EC, from.EC);
    PUT_WHERE(here, shares->all, from.all);
}

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

/* Puts a late surface, of which that is known, into a hit. */
static __attribute__((always_inline)) void put_late(const MASK here, const Bounds near, const int index, Hit *hit) {
    PUT_WHERE(here, hit->near.low, near.low);
    PUT_WHERE(here, hit->near.high, near.high);
    PUT_WHERE(here, hit->id, (INT)index);
}

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

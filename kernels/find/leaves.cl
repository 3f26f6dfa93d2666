/* leaves.cl: rays that leave surfaces against the shapes in the leaves of a tree, in float32.
 *
 * Either one ray is tested against 8 shapes at once, or all rays of a packet against one. That yields the few shapes
 * that a ray may meet first, with a proof that it is none of the others. Lengths are in the tree's unit, in which the
 * scene's size S is 1 at most: nothing is further than that from the scene's middle, from which places count. In
 * proofs, u is 2^-24.
 */
#ifdef WITH_BOUNCES

/* Bit k: whether comparison k of 8 holds. */
#if defined(__AVX__) && __has_builtin(__builtin_ia32_movmskps256)
#define BITS_OF(mask) __builtin_ia32_movmskps256(as_float8(mask))
#else
static int bits_of(const int8 mask) {
    const int8 bits = mask & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    const int4 four = bits.lo | bits.hi;
    const int2 two = four.lo | four.hi;
    return two.x | two.y;
}
#define BITS_OF(mask) bits_of(mask)
#endif

/* The number of the lowest bit that is set. */
static int lowest_of(const int bits) {
    return 31 - (int)clz(bits & -bits);
}

/* Of numbers none of which is a NaN. fmax() and fmin() are three instructions for what is one here. */
static float8 larger(const float8 a, const float8 b) {
    return a > b ? a : b;
}

static float8 smaller(const float8 a, const float8 b) {
    return a < b ? a : b;
}

/* The surfaces that a packet's rays may meet first, with lower bounds of the distance. There is room for two leaves' of
 * each ray, and for more where the host may want to know all of them. They are apart from all else that is known of a
 * search: what is beside an array stays in memory with it. */
#define CANDIDATES (HAS(WITH_RAYS) ? 64 : 16)
typedef struct {
    int index[CANDIDATES][W];
    float near[CANDIDATES][W];
} Reached;

/* What a packet's rays look for. */
typedef struct {
    const Scene *scene;
    const Leaving *ray;
    Met *met; /* what they have met for certain so far */
    Work *work;
    REAL scale;             /* the length of the rays' directions in the tree's unit */
    float o[3][W], w[3][W]; /* the rays' starts and unit directions */
    float over[3][W];       /* 1 / w */
    float reach[W];         /* nothing beyond this distance matters any more */
    int shorter;            /* whether some reach has become shorter since somebody asked */
    int decided;            /* whether candidates have been decided, and forgotten */
    int own[W];             /* the surface that a ray leaves */
    int count[W];
    Reached *found;
} Search;

/* One of the rays. */
typedef struct {
    float3 o, w, over;
    float3 from,
        to; /* a plane at x is no nearer than over.x x + from.x, and no further than over.x x + to.x, and so on */
    float reach;
    int own, lane;
} Walker;

static void add_candidate(Search *search, const int lane, const int index, const float near) {
    const int n = search->count[lane]++;
    search->found->index[n][lane] = index;
    search->found->near[n][lane] = near;
}

/* Makes room for a leaf: forgets the candidates that lie too far. Returns whether there is room. */
static int make_room(Search *search, const int lane, const float reach) {
    const int count = search->count[lane];
    if (count <= CANDIDATES - 8) return 1;
    search->count[lane] = 0;
    for (int k = 0; k < count; k++)
        if (search->found->near[k][lane] <= reach)
            add_candidate(search, lane, search->found->index[k][lane], search->found->near[k][lane]);
    return search->count[lane] <= CANDIDATES - 8;
}

/* How far rays may have to go to a shape, for 8 shapes and for W rays: not before `near`, and no further than `far`,
 * which is INFINITY where it is not certain that they meet it at all. */
typedef struct {
    float8 near, far;
} Range8;
typedef struct {
    FLOAT near, far;
} RangeW;

/* Whether rays may pass through what they surely meet: where planes clip some surfaces, but not all. */
#define MAY_PASS(scene) (HAS(WITH_PLANES) && (scene)->unclipped)

/* Adds those of 8 shapes that a ray may meet within its reach. */
static void add_eight(Search *search, Walker *walker, const int8 may, const Range8 range, const int8 index) {
    int bits = BITS_OF(may & (range.near <= walker->reach) & (index != walker->own));
    if (!bits) return;
    float near[8], far[8];
    int each[8];
    vstore8(range.near, 0, near);
    vstore8(range.far, 0, far);
    vstore8(index, 0, each);
    for (; bits; bits &= bits - 1) {
        const int i = lowest_of(bits);
        add_candidate(search, walker->lane, each[i], near[i]);
        if (!MAY_PASS(search->scene)) walker->reach = fmin(walker->reach, far[i]);
    }
}
#endif

/* A packet's rays that leave surfaces, together as long as they go the same way. */
#if defined(WITH_BOUNCES) && W > 1

/* Bit k: whether lane k is set. */
#define lane_bits(mask) PASTE(bits_of_, W)(mask)
static int bits_of_4(const int4 mask) {
    const int4 bits = mask & (int4)(1, 2, 4, 8);
    return (bits.x | bits.y) | (bits.z | bits.w);
}
#define bits_of_8(mask) BITS_OF(mask)
#if defined(__AVX512DQ__) && __has_builtin(__builtin_ia32_cvtd2mask512)
#define bits_of_16(mask) ((int)__builtin_ia32_cvtd2mask512(mask))
#else
#define bits_of_16(mask) (BITS_OF((mask).lo) | BITS_OF((mask).hi) << 8)
#endif

/* Rays whose directions have the same signs, and bounds of where they go.
 *
 * over, from, to: as in Walker. near, far: of each coordinate of their starts, with what these are off by, the extreme
 * ones, such that the planes of a box are entered later than from `near`, and left earlier than from `far`. least,
 * most: 1 / w, by size. */
typedef struct {
    MASK live;
    int own; /* the surface that all of them leave; -1 if it is not the same one */
    Float3 over, from, to;
    float near[3], far[3], least[3], most[3];
    int back[3]; /* whether they go against an axis */
} Bundle;

/* The largest lane. */
#define largest_of(x) PASTE(furthest_of_, W)(x)

static void bundle_rays(const Search *search, const MASK live, Bundle *bundle) {
    const int first = search->own[lowest_of(lane_bits(live))];
    bundle->live = live;
    bundle->own = ANY(live & (LOAD_LANES(search->own) != first)) ? -1 : first;
    FLOAT over[3], from[3], to[3];
    for (int j = 0; j < 3; j++) {
        const FLOAT o = LOAD_LANES(search->o[j]), pad = FMA((FLOAT)0x1p-22f, fabs(o), (FLOAT)0x1p-50f);
        over[j] = LOAD_LANES(search->over[j]);
        const int back = bundle->back[j] = ANY(live & (over[j] < 0));
        const FLOAT low = o - pad, high = o + pad, size = fabs(over[j]);
        from[j] = -(back ? low : high) * over[j];
        to[j] = -(back ? high : low) * over[j];
        const float highest = largest_of(live ? high : (FLOAT)-INFINITY),
                    lowest = -largest_of(live ? -low : (FLOAT)-INFINITY);
        const float most = largest_of(live ? size : (FLOAT)0.0f), least = -largest_of(live ? -size : (FLOAT)-INFINITY);
        bundle->near[j] = back ? lowest : highest;
        bundle->far[j] = back ? highest : lowest;
        bundle->least[j] = back ? -least : least;
        bundle->most[j] = back ? -most : most;
    }
    bundle->over = (Float3){over[0], over[1], over[2]};
    bundle->from = (Float3){from[0], from[1], from[2]};
    bundle->to = (Float3){to[0], to[1], to[2]};
}

/* Which of 8 boxes any of the rays may meet within a distance; near: not before that. in, out: the planes by which the
 * rays enter the boxes, and those by which they leave. */
static int boxes_met(const Bundle *bundle, const float8 *in, const float8 *out, const float furthest, float8 *near) {
    float8 first = 0, last = INFINITY;
    for (int j = 0; j < 3; j++) {
        const float8 a = in[j] - bundle->near[j], b = out[j] - bundle->far[j];
        first = larger(first, smaller(a * bundle->least[j], a * bundle->most[j]));
        last = smaller(last, larger(b * bundle->least[j], b * bundle->most[j]));
    }
    *near = first;
    return BITS_OF((first <= last * (1 + 0x1p-20f)) & (first <= furthest));
}

/* Makes room for a leaf in the lists of some rays, as make_room(). */
static int make_room_for_packet(Search *search, const MASK here) {
    int room = 1;
    for (int left = lane_bits(here & (LOAD_LANES(search->count) > CANDIDATES - 8)); left; left &= left - 1) {
        const int lane = lowest_of(left);
        room &= make_room(search, lane, search->reach[lane]);
    }
    return room;
}

/* Adds a shape for those rays that may meet it within their reach. */
static void add_for_packet(Search *search, const MASK may, const RangeW range, const int index, FLOAT *reach) {
    const MASK here = may & (range.near <= *reach) & (LOAD_LANES(search->own) != index);
    int bits = lane_bits(here);
    if (!bits) return;
    const MASK shorter = MAY_PASS(search->scene) ? (MASK)0 : here & (range.far < *reach);
    *reach = shorter ? range.far : *reach;
    search->shorter |= ANY(shorter);
    float near[W];
    STORE_LANES(range.near, near);
    for (; bits; bits &= bits - 1) {
        const int lane = lowest_of(bits);
        add_candidate(search, lane, index, near[lane]);
    }
}

/* Number i of 8 that are in memory side by side. */
static float one_of(__global const float8 *eight, const int i) {
    return ((__global const float *)eight)[i];
}
#endif

/* Rays that leave surfaces against the balls in a leaf of the tree, in float32: see find/leaves.cl. A ball is
 * a sphere, or what of another shape lies between two spheres with one centre. */
#ifdef WITH_BOUNCES
static void ball_fetch_leaf(const Scene *scene, const int leaf) {
    __global const uchar *lines = (__global const uchar *)(scene->tree.block + leaf);
    for (int line = 0; line < 4; line++) FETCH(lines, 64 * line);
}

/* How a ray stands to a sphere, for 8 spheres and for W rays. may: whether it may meet it. x, y, z: from P to the
 * centre; wx, wy, wz: the unit direction.
 *
 * Spheres: the centres and P are off by u S each, so F = C - P is by 4.1 u S, w by 1.01 u, and X = F x w by 14.2 u S; b
 * = F.w is by 12.2 u S. outer is the radius and e = 24 u S more, inner as much less [WIDEN = 24]. So |X| > outer is a
 * miss for certain. And as (R + e)^2 - R^2 exceeds what X^2 is off by, the ray enters the sphere beyond b -
 * sqrt(outer^2 - X^2) - e, and, if it does so from outside, before b - sqrt(inner^2 - X^2) + e; if it starts inside, it
 * leaves before b + sqrt(outer^2 - X^2) + e. The second needs 2 R e - e^2 above 36 u S R, so R > 2 e. */
#define CHORDS(FLOATS, INTS, Chord, chord_of, range_of_chord, Range)                                               \
    typedef struct {                                                                                               \
        INTS may;                                                                                                  \
        FLOATS b, XX, FF, outer;                                                                                   \
    } Chord;                                                                                                       \
    static Chord chord_of(const FLOATS x, const FLOATS y, const FLOATS z, const FLOATS wx, const FLOATS wy,        \
                          const FLOATS wz, const FLOATS outer) {                                                   \
        const FLOATS X = FMA(y, wz, -(z * wy)), Y = FMA(z, wx, -(x * wz)), Z = FMA(x, wy, -(y * wx));              \
        const FLOATS XX = FMA(X, X, FMA(Y, Y, Z * Z)), RR = outer * fabs(outer);                                   \
        const Chord chord = {XX <= RR, FMA(x, wx, FMA(y, wy, z * wz)), XX, FMA(x, x, FMA(y, y, z * z)), RR};       \
        return chord;                                                                                              \
    }                                                                                                              \
    static Range range_of_chord(Chord *chord, const FLOATS inner, const float e) {                                 \
        const FLOATS rest = chord->outer - chord->XX, RR = inner * inner, left = RR - chord->XX;                   \
        const FLOATS way = sqrt(rest > 0 ? rest : 0.0f), first = chord->b - way - e, last = chord->b + way + e;    \
        const FLOATS enters = chord->b - sqrt(left > 0 ? left : 0.0f) + e;                                         \
        const INTS sure = inner > e, inside = sure & (chord->FF < RR), outside = sure & (left >= 0) & (first > 0); \
        const Range range = {first, inside ? last : outside ? enters : (FLOATS)INFINITY};                          \
        chord->may &= last >= 0;                                                                                   \
        return range;                                                                                              \
    }

CHORDS(float8, int8, Chord8, chord_of_8, range_of_chord_8, Range8)

/* Adds those spheres of a leaf that one ray may meet within its reach. */
static void ball_add_leaf(const Scene *scene, const int leaf, Walker *walker, Search *search) {
    __global const Block *block = scene->tree.block + leaf;
    const float8 x = block->x - walker->o.x, y = block->y - walker->o.y, z = block->z - walker->o.z;
    Chord8 chord = chord_of_8(x, y, z, walker->w.x, walker->w.y, walker->w.z, block->outer);
    if (!BITS_OF(chord.may)) return;
    const Range8 range = range_of_chord_8(&chord, block->inner, scene->tree.widen);
    add_eight(search, walker, chord.may, range, block->index);
}

#if W > 1
CHORDS(LANES(float), LANES(int), ChordW, chord_of_W, range_of_chord_W, RangeW)

/* Which of a block's spheres any of the rays may meet within a distance, by their boxes: `outer` is 24 u S too
 * large, and the centres are off by u S, the sides by u S once more. */
static int spheres_met(__global const Block *block, const Bundle *bundle, const float furthest) {
    __global const float8 *center = &block->x;
    const float8 r = block->outer;
    float8 in[3], out[3], near;
    for (int j = 0; j < 3; j++) {
        in[j] = center[j] - (bundle->back[j] ? -r : r);
        out[j] = center[j] + (bundle->back[j] ? -r : r);
    }
    return boxes_met(bundle, in, out, furthest, &near) & BITS_OF(r >= 0);
}

/* The same for rays of a packet. */
static void ball_add_leaf_for_packet(const Scene *scene, const int leaf, const MASK live, const Bundle *bundle,
                                     const float furthest, Search *search) {
    __global const Block *block = scene->tree.block + leaf;
    const FLOAT ox = LOAD_LANES(search->o[0]), oy = LOAD_LANES(search->o[1]), oz = LOAD_LANES(search->o[2]);
    const FLOAT wx = LOAD_LANES(search->w[0]), wy = LOAD_LANES(search->w[1]), wz = LOAD_LANES(search->w[2]);
    FLOAT reach = LOAD_LANES(search->reach);
    for (int bits = spheres_met(block, bundle, furthest); bits; bits &= bits - 1) {
        const int i = lowest_of(bits), index = ((__global const int *)&block->index)[i];
        if (index == bundle->own) continue;
        const FLOAT x = one_of(&block->x, i) - ox, y = one_of(&block->y, i) - oy, z = one_of(&block->z, i) - oz;
        ChordW chord = chord_of_W(x, y, z, wx, wy, wz, one_of(&block->outer, i));
        if (!ANY(chord.may & live)) continue;
        const RangeW range = range_of_chord_W(&chord, one_of(&block->inner, i), scene->tree.widen);
        add_for_packet(search, chord.may & live, range, index, &reach);
    }
    if (search->shorter) STORE_LANES(reach, search->reach);
}
#endif
#endif

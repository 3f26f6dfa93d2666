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

/* leaves.cl: rays that leave surfaces against the shapes in the leaves of a tree, in float32.
 *
 * Either one ray is tested against 8 shapes at once, or all rays of a packet against one. That yields the few shapes that a
 * ray may meet first, with a proof that it is none of the others. Lengths are in the tree's unit, in which the scene's size S
 * is 1 at most: nothing is further than that from the scene's middle, from which places count. In proofs, u is 2^-24.
 */
#ifdef WITH_BOUNCES

/* Bit k: whether comparison k of 8 holds. */
#if defined(__AVX__) && defined(__has_builtin)
#if __has_builtin(__builtin_ia32_movmskps256)
#define BITS_OF(mask) __builtin_ia32_movmskps256(as_float8(mask))
#endif
#endif
#ifndef BITS_OF
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

/* What a packet's rays look for, and the shapes that they may meet first, with lower bounds of the distance. There is room
 * for two leaves' of each ray. */
#define CANDIDATES 16
typedef struct {
    float o[3][W], w[3][W]; /* the rays' starts and unit directions */
    float over[3][W];       /* 1 / w */
    float reach[W];         /* nothing beyond this distance matters any more */
    int own[W];             /* the surface that a ray leaves */
    int count[W], index[CANDIDATES][W];
    float near[CANDIDATES][W];
} Search;

/* One of the rays. */
typedef struct {
    float3 o, w, over;
    float3 from, to; /* a plane at x is no nearer than over.x x + from.x, and no further than over.x x + to.x, and so on */
    float reach;
    int own, lane;
} Walker;

static void add_candidate(Search *search, const int lane, const int index, const float near) {
    const int n = search->count[lane]++;
    search->index[n][lane] = index;
    search->near[n][lane] = near;
}

/* Makes room for a leaf: forgets the candidates that lie too far. Returns whether there is room. */
static int make_room(Search *search, const int lane, const float reach) {
    const int count = search->count[lane];
    if (count <= CANDIDATES - 8) return 1;
    search->count[lane] = 0;
    for (int k = 0; k < count; k++)
        if (search->near[k][lane] <= reach) add_candidate(search, lane, search->index[k][lane], search->near[k][lane]);
    return search->count[lane] <= CANDIDATES - 8;
}

/* Two tests, each for 8 shapes and for W rays: whether a ray may meet a shape; a bound of how near that is, and one of how
 * far, INFINITY where it is not certain that it meets the shape at all. x, y, z: from P to the shape; wx, wy, wz: the unit
 * direction.
 *
 * Spheres: the centres and P are off by u S each, so F = C - P is by 4.1 u S, w by 1.01 u, and X = F x w by 14.2 u S; b = F.w
 * is by 12.2 u S. outer is the radius and e = 24 u S more, inner as much less [WIDEN = 24]. So |X| > outer is a miss for
 * certain. And as (R + e)^2 - R^2 exceeds what X^2 is off by, the ray enters the sphere beyond b - sqrt(outer^2 - X^2) - e,
 * and, if it does so from outside, before b - sqrt(inner^2 - X^2) + e; if it starts inside, it leaves before
 * b + sqrt(outer^2 - X^2) + e. The second needs 2 R e - e^2 above 36 u S R, so R > 2 e.
 *
 * Triangles: with F = A - P, R = F x w and N = e x f, U = f.R, V = -e.R and L = N.w - U - V have the sign of N.w where the
 * ray's line passes inside; it does so at t = N.F / N.w. As for spheres, F is off by 4.1 u S and at most 2 S long, and R is
 * off by 14.2 u S. e and f are off by 1.01 u of themselves. So U is off by (14.2 + 2 * 1.01 + 2 * 3.03) u |f|, less than
 * 23 u |f|; V likewise; N by 4.9 u |e||f|; N.w by 9 u |e||f|, and N.F by (4.1 + 2 * 4.9 + 2 * 3.03) u |e||f|, less than
 * 20 u |e||f|; and |e||f| is at most |e| + |f|, as both are at most 2. So L is off by (23 + 9) u (|e| + |f|) and by two
 * roundings, which are 6 u (|e| + |f|) at most as U, V and N.w are below 2 |f|, 2 |e| and |e||f|. All that is less than
 * slack = 40 u (|e| + |f|) + 2^-100 [EDGE_ROUNDINGS = 40]; the last term is for what is below float's range.
 * The signs are turned with that of N.w. Where that is not sure, and the ray passes inside, they sum up to 18 u |e||f| at
 * most, and with the wrong sign none of them is below -slack either. */
#define SHAPE_TESTS(of, FLOATS, INTS)                                                                                  \
    typedef struct {                                                                                                   \
        INTS may;                                                                                                      \
        FLOATS near, far;                                                                                              \
    } of##Range;                                                                                                       \
    static of##Range of##_ball(const FLOATS x, const FLOATS y, const FLOATS z, const FLOATS wx, const FLOATS wy,       \
                               const FLOATS wz, const FLOATS out, const FLOATS in, const float e) {                    \
        const FLOATS b = FMA(x, wx, FMA(y, wy, z * wz)), outer = out * fabs(out), inner = in * in;                     \
        const FLOATS X = FMA(y, wz, -(z * wy)), Y = FMA(z, wx, -(x * wz)), Z = FMA(x, wy, -(y * wx));                  \
        const FLOATS XX = FMA(X, X, FMA(Y, Y, Z * Z)), rest = outer - XX, left = inner - XX;                           \
        const FLOATS way = sqrt(rest > 0 ? rest : 0.0f), first = b - way - e, last = b + way + e;                      \
        const FLOATS enters = b - sqrt(left > 0 ? left : 0.0f) + e;                                                    \
        const INTS sure = in > e, inside = sure & (FMA(x, x, FMA(y, y, z * z)) < inner);                               \
        const INTS outside = sure & (left >= 0) & (first > 0);                                                         \
        const of##Range range = {(rest >= 0) & (last >= 0), first,                                                     \
                                 inside ? last : outside ? enters : (FLOATS)INFINITY};                                 \
        return range;                                                                                                  \
    }                                                                                                                  \
    static of##Range of##_triangle(const FLOATS x, const FLOATS y, const FLOATS z, const FLOATS wx, const FLOATS wy,   \
                                   const FLOATS wz, const FLOATS ex, const FLOATS ey, const FLOATS ez, const FLOATS fx, \
                                   const FLOATS fy, const FLOATS fz, const FLOATS nx, const FLOATS ny,                 \
                                   const FLOATS nz, const FLOATS slack) {                                              \
        const FLOATS X = FMA(y, wz, -(z * wy)), Y = FMA(z, wx, -(x * wz)), Z = FMA(x, wy, -(y * wx));                  \
        const FLOATS den = FMA(nx, wx, FMA(ny, wy, nz * wz));                                                          \
        const INTS sign = PASTE(as_, INTS)(den) & (int)0x80000000;                                                     \
        const FLOATS size = PASTE(as_, FLOATS)(PASTE(as_, INTS)(den) ^ sign);                                          \
        const FLOATS U = PASTE(as_, FLOATS)(PASTE(as_, INTS)(FMA(fx, X, FMA(fy, Y, fz * Z))) ^ sign);                  \
        const FLOATS V = PASTE(as_, FLOATS)(PASTE(as_, INTS)(-FMA(ex, X, FMA(ey, Y, ez * Z))) ^ sign);                 \
        const FLOATS D = PASTE(as_, FLOATS)(PASTE(as_, INTS)(FMA(nx, x, FMA(ny, y, nz * z))) ^ sign);                  \
        const FLOATS L = size - U - V, UV = U < V ? U : V, least = L < UV ? L : UV;                                    \
        const INTS steep = size > slack, sure = steep & (least > slack) & (D > slack);                                 \
        const FLOATS low = D > slack ? (D - slack) * (1 - 0x1p-20f) : 0.0f, high = (D + slack) * (1 + 0x1p-20f);       \
        const of##Range range = {(least >= -slack) & (!steep | (D >= -slack)),                                         \
                                 steep ? low / (size + slack) : 0.0f,                                                  \
                                 sure ? high / (size - slack) : (FLOATS)INFINITY};                                     \
        return range;                                                                                                  \
    }

SHAPE_TESTS(eight, float8, int8)

/* Adds those of 8 shapes that a ray may meet within its reach. */
static void add_eight(Search *search, Walker *walker, const eightRange range, const int8 index) {
    int bits = BITS_OF(range.may & (range.near <= walker->reach) & (index != walker->own));
    if (!bits) return;
    float near[8], far[8];
    int each[8];
    vstore8(range.near, 0, near);
    vstore8(range.far, 0, far);
    vstore8(index, 0, each);
    for (; bits; bits &= bits - 1) {
        const int i = lowest_of(bits);
        add_candidate(search, walker->lane, each[i], near[i]);
        walker->reach = fmin(walker->reach, far[i]);
    }
}

/* Adds those shapes of a leaf that one ray may meet within its reach. */
static void add_leaf(const Scene scene, const int leaf, Walker *walker, Search *search) {
    const float8 wx = walker->w.x, wy = walker->w.y, wz = walker->w.z;
#ifdef WITH_PATCHES
#ifndef ONLY_TRIANGLES
    if (leaf >= scene.tree.blocks)
#endif
    {
        __global const Patch *patch = scene.patch + (leaf - scene.tree.blocks);
        const float8 x = patch->ax - walker->o.x, y = patch->ay - walker->o.y, z = patch->az - walker->o.z;
        const float8 ex = patch->ex, ey = patch->ey, ez = patch->ez, fx = patch->fx, fy = patch->fy, fz = patch->fz;
        const float8 nx = FMA(ey, fz, -(ez * fy)), ny = FMA(ez, fx, -(ex * fz)), nz = FMA(ex, fy, -(ey * fx));
        eightRange range = eight_triangle(x, y, z, wx, wy, wz, ex, ey, ez, fx, fy, fz, nx, ny, nz, patch->slack);
        range.may &= patch->slack > 0;
        add_eight(search, walker, range, patch->index);
        return;
    }
#endif
#ifndef ONLY_TRIANGLES
    __global const Block *block = scene.tree.block + leaf;
    const float8 x = block->x - walker->o.x, y = block->y - walker->o.y, z = block->z - walker->o.z;
    add_eight(search, walker, eight_ball(x, y, z, wx, wy, wz, block->outer, block->inner, scene.tree.widen), block->index);
#endif
}

#if W > 1
SHAPE_TESTS(packet, LANES(float), LANES(int))

/* Bit k: whether lane k is set. */
#if W == 4
static int lane_bits(const MASK mask) {
    const int4 bits = mask & (int4)(1, 2, 4, 8);
    return (bits.x | bits.y) | (bits.z | bits.w);
}
#elif W == 8
#define lane_bits(mask) BITS_OF(mask)
#else
#define lane_bits(mask) (BITS_OF((mask).lo) | BITS_OF((mask).hi) << 8)
#endif

/* Adds a shape for those rays that may meet it within their reach. */
static void add_for_packet(Search *search, const MASK live, const packetRange range, const int index) {
    const FLOAT reach = LOAD_LANES(search->reach);
    int bits = lane_bits(live & range.may & (range.near <= reach) & (LOAD_LANES(search->own) != index));
    if (!bits) return;
    float near[W], far[W];
    STORE_LANES(range.near, near);
    STORE_LANES(range.far, far);
    for (; bits; bits &= bits - 1) {
        const int lane = lowest_of(bits);
        add_candidate(search, lane, index, near[lane]);
        search->reach[lane] = fmin(search->reach[lane], far[lane]);
    }
}

/* Number i of 8 that are in memory side by side. */
static float one_of(__global const float8 *eight, const int i) {
    return ((__global const float *)eight)[i];
}

/* Adds those shapes of a leaf that rays of a packet may meet within their reach. */
static void add_leaf_for_packet(const Scene scene, const int leaf, const MASK live, Search *search) {
    const FLOAT ox = LOAD_LANES(search->o[0]), oy = LOAD_LANES(search->o[1]), oz = LOAD_LANES(search->o[2]);
    const FLOAT wx = LOAD_LANES(search->w[0]), wy = LOAD_LANES(search->w[1]), wz = LOAD_LANES(search->w[2]);
#ifdef WITH_PATCHES
#ifndef ONLY_TRIANGLES
    if (leaf >= scene.tree.blocks)
#endif
    {
        __global const Patch *patch = scene.patch + (leaf - scene.tree.blocks);
        for (int i = 0; i < 8; i++) {
            const int index = ((__global const int *)&patch->index)[i];
            if (index < 0) break;
            const FLOAT x = one_of(&patch->ax, i) - ox, y = one_of(&patch->ay, i) - oy, z = one_of(&patch->az, i) - oz;
            const float ex = one_of(&patch->ex, i), ey = one_of(&patch->ey, i), ez = one_of(&patch->ez, i);
            const float fx = one_of(&patch->fx, i), fy = one_of(&patch->fy, i), fz = one_of(&patch->fz, i);
            const float nx = FMA(ey, fz, -(ez * fy)), ny = FMA(ez, fx, -(ex * fz)), nz = FMA(ex, fy, -(ey * fx));
            const packetRange range =
                packet_triangle(x, y, z, wx, wy, wz, (FLOAT)ex, (FLOAT)ey, (FLOAT)ez, (FLOAT)fx, (FLOAT)fy, (FLOAT)fz,
                                (FLOAT)nx, (FLOAT)ny, (FLOAT)nz, (FLOAT)one_of(&patch->slack, i));
            add_for_packet(search, live, range, index);
        }
        return;
    }
#endif
#ifndef ONLY_TRIANGLES
    __global const Block *block = scene.tree.block + leaf;
    for (int i = 0; i < 8; i++) {
        const int index = ((__global const int *)&block->index)[i];
        if (index < 0) break;
        const FLOAT x = one_of(&block->x, i) - ox, y = one_of(&block->y, i) - oy, z = one_of(&block->z, i) - oz;
        const FLOAT outer = one_of(&block->outer, i), inner = one_of(&block->inner, i);
        add_for_packet(search, live, packet_ball(x, y, z, wx, wy, wz, outer, inner, scene.tree.widen), index);
    }
#endif
}
#endif
#endif

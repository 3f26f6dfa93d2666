/* leaves.cl: rays that leave surfaces against the shapes in the leaves of a tree, in float32.
 *
 * Either one ray is tested against 8 shapes at once, or all rays of a packet against one. That yields the few shapes
 * that a ray may meet first, with a proof that it is none of the others. Lengths are in the tree's unit, in which the
 * scene's size S is 1 at most: nothing is further than that from the scene's middle, from which places count. In
 * proofs, u is 2^-24.
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

/* Of numbers none of which is a NaN. fmax() and fmin() are three instructions for what is one here. */
static float8 larger(const float8 a, const float8 b) {
    return a > b ? a : b;
}

static float8 smaller(const float8 a, const float8 b) {
    return a < b ? a : b;
}

/* What a packet's rays look for, and the shapes that they may meet first, with lower bounds of the distance. There
 * is room for two leaves' of each ray. */
#define CANDIDATES 16
typedef struct {
    float o[3][W], w[3][W]; /* the rays' starts and unit directions */
    float over[3][W];       /* 1 / w */
    float reach[W];         /* nothing beyond this distance matters any more */
    int shorter;            /* whether some reach has become shorter since somebody asked */
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

/* How a ray stands to a shape, for 8 shapes and for W rays. may: whether it may meet it; near, far: bounds of how
 * far it is then; far is INFINITY where it is not certain that the ray meets the shape at all. x, y, z: from P to
 * the shape; wx, wy, wz: the unit direction.
 *
 * Spheres: the centres and P are off by u S each, so F = C - P is by 4.1 u S, w by 1.01 u, and X = F x w by 14.2 u S; b
 * = F.w is by 12.2 u S. outer is the radius and e = 24 u S more, inner as much less [WIDEN = 24]. So |X| > outer is a
 * miss for certain. And as (R + e)^2 - R^2 exceeds what X^2 is off by, the ray enters the sphere beyond b -
 * sqrt(outer^2 - X^2) - e, and, if it does so from outside, before b - sqrt(inner^2 - X^2) + e; if it starts inside, it
 * leaves before b + sqrt(outer^2 - X^2) + e. The second needs 2 R e - e^2 above 36 u S R, so R > 2 e.
 *
 * Triangles: with F = A - P, R = F x w and N = e x f, U = f.R, V = -e.R and L = N.w - U - V have the sign of N.w where
 * the ray's line passes inside; it does so at t = N.F / N.w. As for spheres, F is off by 4.1 u S and at most 2 S long,
 * and R is off by 14.2 u S. e and f are off by 1.01 u of themselves. So U is off by (14.2 + 2 * 1.01 + 2 * 3.03) u |f|,
 * less than 23 u |f|; V likewise; N by 4.9 u |e||f|; N.w by 9 u |e||f|, and N.F by (4.1 + 2 * 4.9 + 2 * 3.03) u |e||f|,
 * less than 20 u |e||f|; and |e||f| is at most |e| + |f|, as both are at most 2. So L is off by (23 + 9) u (|e| + |f|)
 * and by two roundings, which are 6 u (|e| + |f|) at most as U, V and N.w are below 2 |f|, 2 |e| and |e||f|. All that
 * is less than slack = 40 u (|e| + |f|) + 2^-48 [EDGE_ROUNDINGS = 40]. The last term is for edges so short that their
 * corners, which are rounded to double, may have become one: they are off by up to 2^-51, and all that is made of them by
 * less than 2^-49. The signs are turned with that of N.w. Where that is not sure, and the ray passes inside, they sum up to 18 u
 * |e||f| at most, and with the wrong sign none of them is below -slack either. */
#define SHAPE_TESTS(FLOATS, INTS, Chord, chord_of, range_of_chord, Passage, passage_of, range_of_passage, Range)       \
    typedef struct {                                                                                                   \
        FLOATS near, far;                                                                                              \
    } Range;                                                                                                           \
    typedef struct {                                                                                                   \
        INTS may;                                                                                                      \
        FLOATS b, XX, FF, outer;                                                                                       \
    } Chord;                                                                                                           \
    static Chord chord_of(const FLOATS x, const FLOATS y, const FLOATS z, const FLOATS wx, const FLOATS wy,            \
                          const FLOATS wz, const FLOATS outer) {                                                       \
        const FLOATS X = FMA(y, wz, -(z * wy)), Y = FMA(z, wx, -(x * wz)), Z = FMA(x, wy, -(y * wx));                  \
        const FLOATS XX = FMA(X, X, FMA(Y, Y, Z * Z)), RR = outer * fabs(outer);                                       \
        const Chord chord = {XX <= RR, FMA(x, wx, FMA(y, wy, z * wz)), XX, FMA(x, x, FMA(y, y, z * z)), RR};           \
        return chord;                                                                                                  \
    }                                                                                                                  \
    static Range range_of_chord(Chord *chord, const FLOATS inner, const float e) {                                     \
        const FLOATS rest = chord->outer - chord->XX, RR = inner * inner, left = RR - chord->XX;                       \
        const FLOATS way = sqrt(rest > 0 ? rest : 0.0f), first = chord->b - way - e, last = chord->b + way + e;        \
        const FLOATS enters = chord->b - sqrt(left > 0 ? left : 0.0f) + e;                                             \
        const INTS sure = inner > e, inside = sure & (chord->FF < RR), outside = sure & (left >= 0) & (first > 0);     \
        const Range range = {first, inside ? last : outside ? enters : (FLOATS)INFINITY};                              \
        chord->may &= last >= 0;                                                                                       \
        return range;                                                                                                  \
    }                                                                                                                  \
    typedef struct {                                                                                                   \
        INTS may;                                                                                                      \
        FLOATS least, size, D;                                                                                         \
    } Passage;                                                                                                         \
    static Passage passage_of(const FLOATS x, const FLOATS y, const FLOATS z, const FLOATS wx, const FLOATS wy,        \
                              const FLOATS wz, const FLOATS ex, const FLOATS ey, const FLOATS ez, const FLOATS fx,     \
                              const FLOATS fy, const FLOATS fz, const FLOATS nx, const FLOATS ny, const FLOATS nz,     \
                              const FLOATS slack) {                                                                    \
        const FLOATS X = FMA(y, wz, -(z * wy)), Y = FMA(z, wx, -(x * wz)), Z = FMA(x, wy, -(y * wx));                  \
        const FLOATS den = FMA(nx, wx, FMA(ny, wy, nz * wz)), D = FMA(nx, x, FMA(ny, y, nz * z));                      \
        const FLOATS U = FMA(fx, X, FMA(fy, Y, fz * Z)), V = -FMA(ex, X, FMA(ey, Y, ez * Z));                          \
        const INTS sign = PASTE(as_, INTS)(den) & (int)0x80000000;                                                     \
        const FLOATS size = PASTE(as_, FLOATS)(PASTE(as_, INTS)(den) ^ sign);                                          \
        const FLOATS u = PASTE(as_, FLOATS)(PASTE(as_, INTS)(U) ^ sign);                                               \
        const FLOATS v = PASTE(as_, FLOATS)(PASTE(as_, INTS)(V) ^ sign);                                               \
        const FLOATS l = size - u - v, uv = u < v ? u : v, least = l < uv ? l : uv;                                    \
        const Passage passage = {least >= -slack, least, size, PASTE(as_, FLOATS)(PASTE(as_, INTS)(D) ^ sign)};        \
        return passage;                                                                                                \
    }                                                                                                                  \
    static Range range_of_passage(Passage *passage, const FLOATS slack) {                                              \
        const FLOATS D = passage->D, size = passage->size, less = D > slack ? D - slack : 0.0f;                        \
        const INTS steep = size > slack, sure = steep & (passage->least > slack) & (D > slack);                        \
        const Range range = {steep ? less * (1 - 0x1p-20f) / (size + slack) : 0.0f,                                    \
                             sure ? (D + slack) * (1 + 0x1p-20f) / (size - slack) : (FLOATS)INFINITY};                 \
        passage->may &= !steep | (D >= -slack);                                                                        \
        return range;                                                                                                  \
    }

SHAPE_TESTS(float8, int8, Chord8, chord_of_8, range_of_chord_8, Passage8, passage_of_8, range_of_passage_8, Range8)

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
        walker->reach = fmin(walker->reach, far[i]);
    }
}

#ifndef ONLY_TRIANGLES
static void add_block(const Scene scene, __global const Block *block, Walker *walker, Search *search) {
    const float8 x = block->x - walker->o.x, y = block->y - walker->o.y, z = block->z - walker->o.z;
    Chord8 chord = chord_of_8(x, y, z, walker->w.x, walker->w.y, walker->w.z, block->outer);
    if (!BITS_OF(chord.may)) return;
    const Range8 range = range_of_chord_8(&chord, block->inner, scene.tree.widen);
    add_eight(search, walker, chord.may, range, block->index);
}
#endif

#ifdef WITH_PATCHES
static void add_patch(__global const Patch *patch, Walker *walker, Search *search) {
    const float8 x = patch->ax - walker->o.x, y = patch->ay - walker->o.y, z = patch->az - walker->o.z;
    const float8 ex = patch->ex, ey = patch->ey, ez = patch->ez, fx = patch->fx, fy = patch->fy, fz = patch->fz;
    const float8 nx = FMA(ey, fz, -(ez * fy)), ny = FMA(ez, fx, -(ex * fz)), nz = FMA(ex, fy, -(ey * fx));
    const float8 slack = patch->slack;
    Passage8 passage = passage_of_8(x, y, z, walker->w.x, walker->w.y, walker->w.z, ex, ey, ez, fx, fy, fz, nx, ny, nz, slack);
    if (!BITS_OF(passage.may)) return;
    const Range8 range = range_of_passage_8(&passage, slack);
    add_eight(search, walker, passage.may & (slack > 0), range, patch->index);
}
#endif

/* Adds those shapes of a leaf that one ray may meet within its reach. */
static void add_leaf(const Scene scene, const int leaf, Walker *walker, Search *search) {
#ifdef ONLY_TRIANGLES
    add_patch(scene.patch + leaf, walker, search);
#else
#ifdef WITH_PATCHES
    if (leaf >= scene.tree.blocks) {
        add_patch(scene.patch + (leaf - scene.tree.blocks), walker, search);
        return;
    }
#endif
    add_block(scene, scene.tree.block + leaf, walker, search);
#endif
}

#if W > 1 && defined(WITH_TREE)
#if W == 8
typedef Range8 RangeW;
typedef Chord8 ChordW;
typedef Passage8 PassageW;
#define chord_of_W chord_of_8
#define range_of_chord_W range_of_chord_8
#define passage_of_W passage_of_8
#define range_of_passage_W range_of_passage_8
#else
SHAPE_TESTS(LANES(float), LANES(int), ChordW, chord_of_W, range_of_chord_W, PassageW, passage_of_W, range_of_passage_W, RangeW)
#endif

/* Bit k: whether lane k is set. */
#if W == 4
static int lane_bits(const MASK mask) {
    const int4 bits = mask & (int4)(1, 2, 4, 8);
    return (bits.x | bits.y) | (bits.z | bits.w);
}
#elif W == 8
#define lane_bits(mask) BITS_OF(mask)
#else
#if defined(__AVX512DQ__) && defined(__has_builtin)
#if __has_builtin(__builtin_ia32_cvtd2mask512)
#define lane_bits(mask) ((int)__builtin_ia32_cvtd2mask512(mask))
#endif
#endif
#ifndef lane_bits
#define lane_bits(mask) (BITS_OF((mask).lo) | BITS_OF((mask).hi) << 8)
#endif
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

static float largest_of(const FLOAT x) {
#if W == 4
    const float4 four = x;
#else
#if W == 16
    const float8 eight = larger(x.lo, x.hi);
#else
    const float8 eight = x;
#endif
    const float4 four = eight.lo > eight.hi ? eight.lo : eight.hi;
#endif
    const float2 two = four.lo > four.hi ? four.lo : four.hi;
    return two.x > two.y ? two.x : two.y;
}

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
        const float highest = largest_of(live ? high : (FLOAT)-INFINITY), lowest = -largest_of(live ? -low : (FLOAT)-INFINITY);
        const float most = largest_of(live ? size : (FLOAT)0.0f), least = -largest_of(live ? -size : (FLOAT)-INFINITY);
        bundle->near[j] = back ? lowest : highest;
        bundle->far[j] = back ? highest : lowest;
        bundle->least[j] = back ? -least : least;
        bundle->most[j] = back ? -most : most;
    }
    const Float3 all_over = {over[0], over[1], over[2]}, all_from = {from[0], from[1], from[2]}, all_to = {to[0], to[1], to[2]};
    bundle->over = all_over;
    bundle->from = all_from;
    bundle->to = all_to;
}

/* Which of 8 boxes any of the rays may meet within a distance; near: not before that. The planes by which the rays
 * enter the boxes, and those by which they leave. */
static int boxes_met(const Bundle *bundle, const float8 in_x, const float8 out_x, const float8 in_y, const float8 out_y,
                     const float8 in_z, const float8 out_z, const float furthest, float8 *near) {
    const float8 in[3] = {in_x, in_y, in_z}, out[3] = {out_x, out_y, out_z};
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
    const MASK shorter = here & (range.far < *reach);
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

#ifndef ONLY_TRIANGLES
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
    return boxes_met(bundle, in[0], out[0], in[1], out[1], in[2], out[2], furthest, &near) & BITS_OF(r >= 0);
}

static void add_block_for_packet(const Scene scene, __global const Block *block, const MASK live, const Bundle *bundle,
                                 const float furthest, Search *search) {
    const FLOAT ox = LOAD_LANES(search->o[0]), oy = LOAD_LANES(search->o[1]), oz = LOAD_LANES(search->o[2]);
    const FLOAT wx = LOAD_LANES(search->w[0]), wy = LOAD_LANES(search->w[1]), wz = LOAD_LANES(search->w[2]);
    FLOAT reach = LOAD_LANES(search->reach);
    for (int bits = spheres_met(block, bundle, furthest); bits; bits &= bits - 1) {
        const int i = lowest_of(bits), index = ((__global const int *)&block->index)[i];
        if (index == bundle->own) continue;
        const FLOAT x = one_of(&block->x, i) - ox, y = one_of(&block->y, i) - oy, z = one_of(&block->z, i) - oz;
        ChordW chord = chord_of_W(x, y, z, wx, wy, wz, one_of(&block->outer, i));
        if (!ANY(chord.may & live)) continue;
        const RangeW range = range_of_chord_W(&chord, one_of(&block->inner, i), scene.tree.widen);
        add_for_packet(search, chord.may & live, range, index, &reach);
    }
    if (search->shorter) STORE_LANES(reach, search->reach);
}
#endif

#ifdef WITH_PATCHES
/* Which of a patch's triangles any of the rays may meet within a distance, by their boxes. These are off by less
 * than 2^-22: A by u S, e and f by u of themselves, and A + e by u S. */
static int triangles_met(__global const Patch *patch, const Bundle *bundle, const float furthest) {
    __global const float8 *a = &patch->ax, *e = &patch->ex, *f = &patch->fx;
    float8 in[3], out[3], near;
    for (int j = 0; j < 3; j++) {
        const float8 low = a[j] + smaller(smaller(e[j], f[j]), 0.0f) - 0x1p-22f;
        const float8 high = a[j] + larger(larger(e[j], f[j]), 0.0f) + 0x1p-22f;
        in[j] = bundle->back[j] ? high : low;
        out[j] = bundle->back[j] ? low : high;
    }
    return boxes_met(bundle, in[0], out[0], in[1], out[1], in[2], out[2], furthest, &near);
}

static void add_patch_for_packet(__global const Patch *patch, const MASK live, const Bundle *bundle, const float furthest,
                                 Search *search) {
    const FLOAT ox = LOAD_LANES(search->o[0]), oy = LOAD_LANES(search->o[1]), oz = LOAD_LANES(search->o[2]);
    const FLOAT wx = LOAD_LANES(search->w[0]), wy = LOAD_LANES(search->w[1]), wz = LOAD_LANES(search->w[2]);
    FLOAT reach = LOAD_LANES(search->reach);
    for (int bits = triangles_met(patch, bundle, furthest) & BITS_OF(patch->slack > 0); bits; bits &= bits - 1) {
        const int i = lowest_of(bits), index = ((__global const int *)&patch->index)[i];
        if (index == bundle->own) continue;
        const FLOAT x = one_of(&patch->ax, i) - ox, y = one_of(&patch->ay, i) - oy, z = one_of(&patch->az, i) - oz;
        const float ex = one_of(&patch->ex, i), ey = one_of(&patch->ey, i), ez = one_of(&patch->ez, i);
        const float fx = one_of(&patch->fx, i), fy = one_of(&patch->fy, i), fz = one_of(&patch->fz, i);
        const float nx = FMA(ey, fz, -(ez * fy)), ny = FMA(ez, fx, -(ex * fz)), nz = FMA(ex, fy, -(ey * fx));
        const FLOAT slack = one_of(&patch->slack, i);
        PassageW passage = passage_of_W(x, y, z, wx, wy, wz, ex, ey, ez, fx, fy, fz, nx, ny, nz, slack);
        if (!ANY(passage.may & live)) continue;
        const RangeW range = range_of_passage_W(&passage, slack);
        add_for_packet(search, passage.may & live, range, index, &reach);
    }
    if (search->shorter) STORE_LANES(reach, search->reach);
}
#endif

/* Adds those shapes of a leaf that rays of a packet may meet within their reach. */
static void add_leaf_for_packet(const Scene scene, const int leaf, const MASK live, const Bundle *bundle,
                                const float furthest, Search *search) {
#ifdef ONLY_TRIANGLES
    add_patch_for_packet(scene.patch + leaf, live, bundle, furthest, search);
#else
#ifdef WITH_PATCHES
    if (leaf >= scene.tree.blocks) {
        add_patch_for_packet(scene.patch + (leaf - scene.tree.blocks), live, bundle, furthest, search);
        return;
    }
#endif
    add_block_for_packet(scene, scene.tree.block + leaf, live, bundle, furthest, search);
#endif
}
#endif
#endif

/* balls.cl: rays that leave surfaces against the balls in a leaf of the tree, in float32: see find/leaves.cl. A ball is
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

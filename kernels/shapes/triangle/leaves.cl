/* leaves.cl: rays that leave surfaces against the triangles in a leaf of the tree, in float32: see find/leaves.cl. */
#ifdef WITH_PATCHES

/* How a ray stands to a triangle, for 8 triangles and for W rays. may: whether it may meet it. x, y, z: from P to A;
 * wx, wy, wz: the unit direction.
 *
 * Triangles: with F = A - P, R = F x w and N = e x f, U = f.R, V = -e.R and L = N.w - U - V have the sign of N.w where
 * the ray's line passes inside; it does so at t = N.F / N.w. As for spheres, F is off by 4.1 u S and at most 2 S long,
 * and R is off by 14.2 u S. e and f are off by 1.01 u of themselves. So U is off by (14.2 + 2 * 1.01 + 2 * 3.03) u |f|,
 * less than 23 u |f|; V likewise; N by 4.9 u |e||f|; N.w by 9 u |e||f|, and N.F by (4.1 + 2 * 4.9 + 2 * 3.03) u |e||f|,
 * less than 20 u |e||f|; and |e||f| is at most |e| + |f|, as both are at most 2. So L is off by (23 + 9) u (|e| + |f|)
 * and by two roundings, which are 6 u (|e| + |f|) at most as U, V and N.w are below 2 |f|, 2 |e| and |e||f|. All that
 * is less than slack = 40 u (|e| + |f|) + 2^-48 [EDGE_ROUNDINGS = 40]. The last term is for edges so short that their
 * corners, which are rounded to double, may have become one: they are off by up to 2^-51, and all that is made of them
 * by less than 2^-49. The signs are turned with that of N.w. Where that is not sure, and the ray passes inside, they
 * sum up to 18 u |e||f| at most, and with the wrong sign none of them is below -slack either. */
#define PASSAGES(FLOATS, INTS, Passage, passage_of, range_of_passage, Range)                                       \
    typedef struct {                                                                                               \
        INTS may;                                                                                                  \
        FLOATS least, size, D;                                                                                     \
    } Passage;                                                                                                     \
    static Passage passage_of(const FLOATS x, const FLOATS y, const FLOATS z, const FLOATS wx, const FLOATS wy,    \
                              const FLOATS wz, const FLOATS ex, const FLOATS ey, const FLOATS ez, const FLOATS fx, \
                              const FLOATS fy, const FLOATS fz, const FLOATS nx, const FLOATS ny, const FLOATS nz, \
                              const FLOATS slack) {                                                                \
        const FLOATS X = FMA(y, wz, -(z * wy)), Y = FMA(z, wx, -(x * wz)), Z = FMA(x, wy, -(y * wx));              \
        const FLOATS den = FMA(nx, wx, FMA(ny, wy, nz * wz)), D = FMA(nx, x, FMA(ny, y, nz * z));                  \
        const FLOATS U = FMA(fx, X, FMA(fy, Y, fz * Z)), V = -FMA(ex, X, FMA(ey, Y, ez * Z));                      \
        const INTS sign = PASTE(as_, INTS)(den) & (int)0x80000000;                                                 \
        const FLOATS size = PASTE(as_, FLOATS)(PASTE(as_, INTS)(den) ^ sign);                                      \
        const FLOATS u = PASTE(as_, FLOATS)(PASTE(as_, INTS)(U) ^ sign);                                           \
        const FLOATS v = PASTE(as_, FLOATS)(PASTE(as_, INTS)(V) ^ sign);                                           \
        const FLOATS l = size - u - v, uv = u < v ? u : v, least = l < uv ? l : uv;                                \
        const Passage passage = {least >= -slack, least, size, PASTE(as_, FLOATS)(PASTE(as_, INTS)(D) ^ sign)};    \
        return passage;                                                                                            \
    }                                                                                                              \
    static Range range_of_passage(Passage *passage, const FLOATS slack) {                                          \
        const FLOATS D = passage->D, size = passage->size, less = D > slack ? D - slack : 0.0f;                    \
        const INTS steep = size > slack, sure = steep & (passage->least > slack) & (D > slack);                    \
        const Range range = {steep ? less * (1 - 0x1p-20f) / (size + slack) : 0.0f,                                \
                             sure ? (D + slack) * (1 + 0x1p-20f) / (size - slack) : (FLOATS)INFINITY};             \
        passage->may &= !steep | (D >= -slack);                                                                    \
        return range;                                                                                              \
    }

PASSAGES(float8, int8, Passage8, passage_of_8, range_of_passage_8, Range8)

/* Adds those triangles of a leaf that one ray may meet within its reach. */
static void triangle_add_leaf(const Scene *scene, const int leaf, Walker *walker, Search *search) {
    __global const Patch *patch = scene->patch + (leaf - scene->tree.blocks);
    const float8 x = patch->ax - walker->o.x, y = patch->ay - walker->o.y, z = patch->az - walker->o.z;
    const float8 ex = patch->ex, ey = patch->ey, ez = patch->ez, fx = patch->fx, fy = patch->fy, fz = patch->fz;
    const float8 nx = FMA(ey, fz, -(ez * fy)), ny = FMA(ez, fx, -(ex * fz)), nz = FMA(ex, fy, -(ey * fx));
    const float8 slack = patch->slack;
    Passage8 passage = passage_of_8(x, y, z, walker->w.x, walker->w.y, walker->w.z, ex, ey, ez, fx, fy, fz, nx, ny, nz,
                                    slack);
    if (!BITS_OF(passage.may)) return;
    const Range8 range = range_of_passage_8(&passage, slack);
    add_eight(search, walker, passage.may & (slack > 0), range, patch->index);
}

#if W > 1
PASSAGES(LANES(float), LANES(int), PassageW, passage_of_W, range_of_passage_W, RangeW)

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
    return boxes_met(bundle, in, out, furthest, &near);
}

/* The same for rays of a packet. */
static void triangle_add_leaf_for_packet(const Scene *scene, const int leaf, const MASK live, const Bundle *bundle,
                                         const float furthest, Search *search) {
    __global const Patch *patch = scene->patch + (leaf - scene->tree.blocks);
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
#endif

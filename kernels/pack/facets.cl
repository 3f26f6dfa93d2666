/* facets.cl: the planes of triangles' edges, and their own, as the eye or a light at a point sees them: _facets() of
 * cltrace/plan/shapes/triangle.py, where they are derived, with the same arithmetic in the same order.
 */

/* What a corner in camera space is off by, and the planes with it. */
#define TURNED 0x1p-46

INLINE Real3 cross_product(const Real3 a, const Real3 b) {
    const Real3 n = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return n;
}

/* The sum of the coordinates' magnitudes. */
INLINE REAL size_of(const Real3 a) {
    return (fabs(a.x) + fabs(a.y)) + fabs(a.z);
}

INLINE Real3 difference(const Real3 a, const Real3 b) {
    const Real3 d = {a.x - b.x, a.y - b.y, a.z - b.z};
    return d;
}

/* The corners `member` of W triangles, `three` vertices each. */
#define PUT_VERTEX(corner, member)                                          \
    do {                                                                    \
        double3 p[W];                                                       \
        for (int k = 0; k < W; k++) p[k] = vload3(three[k] member, vertex); \
        (corner).x = (REAL)EACH_LANE(p, .x);                                \
        (corner).y = (REAL)EACH_LANE(p, .y);                                \
        (corner).z = (REAL)EACH_LANE(p, .z);                                \
    } while (0)

/* Three rows for each of `count` triangles, from row 3 first on. known: 0: all of them, and those are noted in `unsure`
 * whose side rounding leaves open; 1: those of `which`, whose sides are known. pane: the largest |x| and |y| of a ray
 * (x, y, -1) from the eye; x < 0: of a light at a point. met: whether a ray from there can meet the triangle. */
__kernel void facets(const int count, const int known, const double2 pane, const long first,
                     __global const double *restrict vertex, __global const int *restrict face,
                     __global const int *restrict which, __global const char *restrict side_of,
                     __global float4 *restrict facet, __global char *restrict met, __global int *restrict unsure) {
    const double turn = pane.x < 0 ? -1 : 1, reach = pane.x < 0 ? 1 : 1 + pane.x + pane.y;
    FOR_EACH_PACKET(i, count) {
        double sign[W];
        int at[W];
        int4 three[W];
        for (int k = 0; k < W; k++) {
            const int j = min(i + k, count - 1);
            at[k] = known ? which[j] : j;
            sign[k] = known ? side_of[j] : 0;
            three[k] = vload4(at[k], face);
        }
        Real3 corner[3];
        PUT_VERTEX(corner[0], .x);
        PUT_VERTEX(corner[1], .y);
        PUT_VERTEX(corner[2], .z);
        const REAL size[3] = {size_of(corner[0]), size_of(corner[1]), size_of(corner[2])};
        const Real3 e = difference(corner[1], corner[0]), f = difference(corner[2], corner[0]), N = cross_product(e, f);
        const REAL D = DOT(corner[0], N), most = LARGER(LARGER(size[0], size[1]), size[2]), total = size_of(N),
                   N_off = (TURNED * most) * (size_of(e) + size_of(f)), D_off = size[0] * (N_off + TURNED * total),
                   size_of_D = fabs(D);
        REAL side = LOAD_LANES(sign);
        if (!known) {
            side = D > 0 ? (REAL)1 : D < 0 ? (REAL)-1 : (REAL)0;
            note_unsure(unsure, i, count, size_of_D > D_off ? side : (REAL)NAN);
        }
        STORE_LANES(side, sign);
        side *= turn;
        const MASK clear = TO_MASK((most * N_off <= 0x1p-27 * size_of_D) &
                                   (most * total * D_off <= 0x1p-27 * size_of_D * size_of_D) &
                                   (D_off <= 0x1p-26 * size_of_D));
        const REAL over = turn / D, own[3] = {N.x * over, N.y * over, N.z * over};
        for (int c = 0; c < 3; c++) {
            const Real3 n = cross_product(corner[c], corner[(c + 1) % 3]);
            const REAL rounding = pane.x < 0 ? sqrt((n.x * n.x + n.y * n.y) + n.z * n.z)
                                             : (pane.x * fabs(n.x) + pane.y * fabs(n.y)) + fabs(n.z);
            const REAL bound = (FACET_ROUNDINGS * ROUNDING) * rounding +
                               (TURNED * reach) * (size[c] * size[(c + 1) % 3]) + 0x1p-300;
            const REAL factor = side / bound;
            float x[W], y[W], z[W], w[W];
            STORE_LANES(TO_FLOAT(n.x * factor), x);
            STORE_LANES(TO_FLOAT(n.y * factor), y);
            STORE_LANES(TO_FLOAT(n.z * factor), z);
            STORE_LANES(clear ? TO_FLOAT(own[c]) : AS(float, (INT)0x7fc00000), w);
            for (int k = 0; k < W; k++) facet[3 * (first + at[k]) + c] = (float4)(x[k], y[k], z[k], w[k]);
        }
        for (int k = 0; k < W; k++) met[at[k]] = sign[k] != 0;
    }
}

/* facets.cl: the planes of triangles' edges, and their own, as the eye or a light sees them: from_point() and
 * along_light() of cltrace/plan/shapes/mesh.py, where they are derived, with the same arithmetic in the same order.
 */

/* What a corner in camera space is off by, and the planes with it. */
#define TURNED 0x1p-46
/* No point on a surface is further from the eye. */
#define FAR 4.0

/* The corners of W triangles, `three` vertices each. */
#define PUT_VERTEX(corner, three, member)                                     \
    do {                                                                      \
        double3 p[W];                                                         \
        for (int k = 0; k < W; k++) p[k] = vload3((three)[k] member, vertex); \
        (corner).x = (REAL)EACH_LANE(p, .x);                                  \
        (corner).y = (REAL)EACH_LANE(p, .y);                                  \
        (corner).z = (REAL)EACH_LANE(p, .z);                                  \
    } while (0)
#define PUT_CORNERS(corner, three)          \
    do {                                    \
        PUT_VERTEX((corner)[0], three, .x); \
        PUT_VERTEX((corner)[1], three, .y); \
        PUT_VERTEX((corner)[2], three, .z); \
    } while (0)

/* `count` triangles: all, or where that is known those of `which`, whose corners turn as `side_of` says. */
typedef struct {
    int count, known;
    __global const int *which;
    __global const char *side_of;
} Asked;

/* W of them, and how their corners turn as far as that is known. */
typedef struct {
    double sign[W];
    int at[W];
    int4 three[W];
} Faces;

INLINE Faces faces_from(const int i, const Asked of, __global const int *face) {
    Faces f;
    for (int k = 0; k < W; k++) {
        const int j = min(i + k, of.count - 1);
        f.at[k] = of.known ? of.which[j] : j;
        f.sign[k] = of.known ? of.side_of[j] : 0;
        f.three[k] = vload4(f.at[k], face);
    }
    return f;
}

/* Row c of W triangles: n times a factor, and one number more. */
INLINE void store_facet(const int *at, const int c, const Real3 n, const REAL factor, const FLOAT more,
                        __global float4 *facet) {
    float x[W], y[W], z[W], w[W];
    STORE_LANES(TO_FLOAT(n.x * factor), x);
    STORE_LANES(TO_FLOAT(n.y * factor), y);
    STORE_LANES(TO_FLOAT(n.z * factor), z);
    STORE_LANES(more, w);
    for (int k = 0; k < W; k++) facet[3L * at[k] + c] = (float4)(x[k], y[k], z[k], w[k]);
}

/* Three rows for each of `count` triangles, from row 3 first on. known: 0: all of them, and those are noted in `unsure`
 * whose side rounding leaves open; 1: those of `which`, whose sides are known. pane: the largest |x| and |y| of a ray
 * (x, y, -1) from the eye; x < 0: of a light at a point. met: whether a ray from there can meet the triangle. */
__kernel void facets(const int count, const int known, const double2 pane, const long first,
                     __global const double *restrict vertex, __global const int *restrict face,
                     __global const int *restrict which, __global const char *restrict side_of,
                     __global float4 *restrict facet, __global char *restrict met, __global int *restrict unsure) {
    const double turn = pane.x < 0 ? -1 : 1, reach = pane.x < 0 ? 1 : 1 + pane.x + pane.y;
    const Asked asked = {count, known, which, side_of};
    FOR_EACH_PACKET(i, count) {
        Faces these = faces_from(i, asked, face);
        Real3 corner[3];
        PUT_CORNERS(corner, these.three);
        const REAL size[3] = {size_of(corner[0]), size_of(corner[1]), size_of(corner[2])};
        const Real3 e = difference(corner[1], corner[0]), f = difference(corner[2], corner[0]), N = cross_of(e, f);
        const REAL D = DOT(corner[0], N), most = LARGER(LARGER(size[0], size[1]), size[2]), total = size_of(N),
                   N_off = (TURNED * most) * (size_of(e) + size_of(f)), D_off = size[0] * (N_off + TURNED * total),
                   size_of_D = fabs(D);
        REAL side = LOAD_LANES(these.sign);
        if (!known) {
            side = D > 0 ? (REAL)1 : D < 0 ? (REAL)-1 : (REAL)0;
            note_unsure(unsure, i, count, size_of_D > D_off ? side : (REAL)NAN);
        }
        STORE_LANES(side, these.sign);
        side *= turn;
        const MASK clear = TO_MASK((most * N_off <= 0x1p-27 * size_of_D) &
                                   (most * total * D_off <= 0x1p-27 * size_of_D * size_of_D) &
                                   (D_off <= 0x1p-26 * size_of_D));
        const REAL over = turn / D, own[3] = {N.x * over, N.y * over, N.z * over};
        for (int c = 0; c < 3; c++) {
            const Real3 n = cross_of(corner[c], corner[(c + 1) % 3]);
            const REAL rounding = pane.x < 0 ? sqrt((n.x * n.x + n.y * n.y) + n.z * n.z)
                                             : (pane.x * fabs(n.x) + pane.y * fabs(n.y)) + fabs(n.z);
            const REAL bound = (FACET_ROUNDINGS * ROUNDING) * rounding +
                               (TURNED * reach) * (size[c] * size[(c + 1) % 3]) + 0x1p-300;
            const REAL factor = side / bound;
            const FLOAT more = clear ? TO_FLOAT(own[c]) : AS(float, (INT)0x7fc00000);
            store_facet(these.at, c, n, factor, more, facet + 3 * first);
        }
        for (int k = 0; k < W; k++) met[these.at[k]] = these.sign[k] != 0;
    }
}

/* The same as a parallel light sees them: c is the axis that leads there, and a and b are those across. */
__kernel void facets_along(const int count, const int known, const double4 a, const double4 b, const double4 c,
                           const long first, __global const double *restrict vertex, __global const int *restrict face,
                           __global const int *restrict which, __global const char *restrict side_of,
                           __global float4 *restrict facet, __global char *restrict met,
                           __global int *restrict unsure) {
    const Asked asked = {count, known, which, side_of};
    FOR_EACH_PACKET(i, count) {
        Faces these = faces_from(i, asked, face);
        Real3 place[3];
        PUT_CORNERS(place, these.three);
        for (int k = 0; k < 3; k++) {
            const Real3 p = place[k];
            place[k].x = turned_along(a, p);
            place[k].y = turned_along(b, p);
            place[k].z = turned_along(c, p);
        }
        Real3 line[3];
        for (int k = 0; k < 3; k++) {
            const Real3 from = place[k], to = place[(k + 1) % 3],
                        n = {-(to.y - from.y), to.x - from.x, from.x * to.y - to.x * from.y};
            line[k] = n;
        }
        const Real3 e = difference(place[1], place[0]), f = difference(place[2], place[0]), N = cross_of(e, f);
        const REAL spread = (fabs(line[0].x) + fabs(line[0].y)) + (fabs(line[2].x) + fabs(line[2].y)),
                   size_of_area = fabs(N.z);
        REAL side = LOAD_LANES(these.sign);
        if (!known) {
            side = N.z > 0 ? (REAL)1 : N.z < 0 ? (REAL)-1 : (REAL)0;
            note_unsure(unsure, i, count, size_of_area > 4 * TURNED * FAR * (spread + FAR * TURNED) ? side : (REAL)NAN);
        }
        STORE_LANES(side, these.sign);
        const REAL reach = size_of(e) + size_of(f), slope[2] = {N.x / N.z, N.y / N.z};
        const REAL off = (reach * ((1 + fabs(slope[0])) + fabs(slope[1]))) * (4 * TURNED * FAR * reach);
        const REAL depth = -(place[0].z + (slope[0] * place[0].x + slope[1] * place[0].y));
        const FLOAT more[3] = {TO_FLOAT(slope[0]), TO_FLOAT(slope[1]),
                               TO_MASK(off <= 0x1p-28 * size_of_area) ? TO_FLOAT(depth) : AS(float, (INT)0x7fc00000)};
        for (int k = 0; k < 3; k++) {
            const REAL across = fabs(line[k].x), up = fabs(line[k].y), length = across + up;
            const REAL bound = ((FACET_ROUNDINGS * ROUNDING) * ((FAR * across + FAR * up) + fabs(line[k].z)) +
                                8 * TURNED * FAR * (length + FAR * TURNED)) +
                               0x1p-300;
            store_facet(these.at, k, line[k], side / bound, more[k], facet + 3 * first);
        }
        for (int k = 0; k < W; k++) met[these.at[k]] = these.sign[k] != 0;
    }
}

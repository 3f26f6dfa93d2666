/* polygons.cl: triangles as the eye or a light sees them: the planes of their edges, and the cells that they cover. */

/* The planes of triangles' edges, and their own, as the eye or a light sees them: from_point() and
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

/* Triangles as polygons on a plane, as the eye or a light sees them, and the cells that they cover:
 * as run/pack/polygons.py says.
 *
 * A point is four ints: the bits of a vertex's coordinates along three axes, as floats, and five bits for each side of
 * the cube that the axes are those of, 2 * axis + (1 where it is looked along minus the axis): the sides of the window
 * that a vertex is beyond, and BEYOND. A picture is side AHEAD. Triangles with a corner beyond the pyramid, or too
 * large, are left to the host.
 */
#define SIDE_BITS 5
#define BEYOND 16
#define OUTSIDE 15

/* What is seen through. middle, halves: of Pane; loose: SLACK (|middle| + half), size: 1 + |middle| + half; scale,
 * shift: of Pane; over: 1 / scale; along: 0, or what depths are off by that are seen along a direction. */
typedef struct {
    float middle[2], halves[2], loose[2], size[2], scale[2], shift[2], over[2];
    float along;
} Pane;

/* Every vertex as points of the sides whose bits are set. a, b, c: the axes. */
__kernel void look_at_vertices(const int n, const int sides, const double4 a, const double4 b, const double4 c,
                               __constant Pane *pane, __global const double *restrict vertex,
                               __global int *restrict point) {
    FOR_EACH_PACKET(i, n) {
        const Real3 p = point_of(vertex, n, i);
        const FLOAT place[3] = {TO_FLOAT(turned_along(a, p)), TO_FLOAT(turned_along(b, p)),
                                TO_FLOAT(turned_along(c, p))};
        INT code = 0;
        for (int side = 0; side < 6; side++) {
            if (!(sides >> side & 1) || pane->along > 0) continue;
            const FLOAT ahead = place[side / 2], d = side % 2 ? -ahead : ahead, depth = fabs(d);
            const FLOAT across[2] = {place[(side / 2 + 1) % 3], place[(side / 2 + 2) % 3]};
            const FLOAT size = ((fabs(across[0]) + fabs(across[1])) + depth) * 0x1p-46f;
            MASK beyond = !(d > 0x1p-40f);
            for (int k = 0; k < 2; k++) {
                const FLOAT loose = depth * pane->loose[k] + size * pane->size[k];
                const FLOAT aside = across[k] - d * pane->middle[k], reach = d * pane->halves[k];
                code |= (aside > reach + loose) ? (INT)(1 << (SIDE_BITS * side + 2 * k)) : (INT)0;
                code |= (-aside > reach + loose) ? (INT)(2 << (SIDE_BITS * side + 2 * k)) : (INT)0;
                beyond |= !(fabs(aside) <= reach * 2);
            }
            code |= beyond ? (INT)(BEYOND << (SIDE_BITS * side)) : (INT)0;
        }
        int lane[4][W];
        for (int k = 0; k < 3; k++) STORE_LANES(AS(int, place[k]), lane[k]);
        STORE_LANES(code, lane[3]);
        for (int k = 0; k < W; k++) vstore4((int4)(lane[0][k], lane[1][k], lane[2][k], lane[3][k]), i + k, point);
    }
}

/* The corners of W triangles: the axes of each, and the bits. */
typedef struct {
    FLOAT place[3][3];
    INT code[3];
} SeenCorners;

#define PUT_CORNER(at, c, member)                                          \
    do {                                                                   \
        int4 p[W];                                                         \
        for (int k = 0; k < W; k++) p[k] = vload4(three[k] member, point); \
        (at).place[c][0] = AS(float, (INT)EACH_LANE(p, .x));               \
        (at).place[c][1] = AS(float, (INT)EACH_LANE(p, .y));               \
        (at).place[c][2] = AS(float, (INT)EACH_LANE(p, .z));               \
        (at).code[c] = (INT)EACH_LANE(p, .w);                              \
    } while (0)

/* `count` triangles, from the first one on, one in `stride`. */
typedef struct {
    int first, stride, count;
} Some;

INLINE SeenCorners corners_of(__global const int *restrict point, __global const int *restrict face, const Some some,
                              const int i) {
    int4 three[W];
    for (int k = 0; k < W; k++) three[k] = vload4(some.first + (long)some.stride * min(i + k, some.count - 1), face);
    SeenCorners at;
    PUT_CORNER(at, 0, .x);
    PUT_CORNER(at, 1, .y);
    PUT_CORNER(at, 2, .z);
    return at;
}

/* Which of W triangles a mask has. */
INLINE MASK those_of(__global const char *restrict mask, const Some some, const int i) {
    int lane[W];
    for (int k = 0; k < W; k++) lane[k] = i + k < some.count ? mask[some.first + (long)some.stride * (i + k)] : 0;
    return LOAD_LANES(lane) != 0;
}

/* Which of W triangles a side may show. */
INLINE MASK may_be_seen(const SeenCorners at, const int side) {
    return ((at.code[0] & at.code[1] & at.code[2]) >> (SIDE_BITS * side) & OUTSIDE) == 0;
}

INLINE MASK is_inside(const SeenCorners at, const int side) {
    return ((at.code[0] | at.code[1] | at.code[2]) >> (SIDE_BITS * side) & BEYOND) == 0;
}

/* Polygons with all corners within the pyramid: across and up, left, right, low and high, the squared distance of the
 * nearest and of the furthest point, or along a direction their depths, and whether the host is to find the former. */
typedef struct {
    FLOAT corner[2][3], edge[4], near, far;
    MASK large;
} Polygon;

#define LESS(a, b) ((a) < (b) ? (a) : (b))

INLINE Polygon polygon_of(const SeenCorners at, const int side, __constant Pane *pane) {
    Polygon p;
    FLOAT square[3];
    const int right = (side / 2 + 1) % 3, up = (side / 2 + 2) % 3;
    for (int c = 0; c < 3; c++) {
        const FLOAT x = at.place[c][right], y = at.place[c][up],
                    d = side % 2 ? -at.place[c][side / 2] : at.place[c][side / 2];
        const FLOAT over = pane->along > 0 ? (FLOAT)1 : 1 / d;
        p.corner[0][c] = (x * over) * pane->scale[0] + pane->shift[0];
        p.corner[1][c] = (y * over) * pane->scale[1] + pane->shift[1];
        square[c] = pane->along > 0 ? -d : (x * x + y * y) + d * d;
    }
    for (int k = 0; k < 2; k++) {
        p.edge[2 * k] = LESS(LESS(p.corner[k][0], p.corner[k][1]), p.corner[k][2]);
        p.edge[2 * k + 1] = LARGER(LARGER(p.corner[k][0], p.corner[k][1]), p.corner[k][2]);
    }
    const FLOAT least = LESS(LESS(square[0], square[1]), square[2]),
                most = LARGER(LARGER(square[0], square[1]), square[2]);
    if (pane->along > 0) {
        p.near = least - pane->along;
        p.far = most + 0x1p-10f;
        p.large = 0;
        return p;
    }
    /* A point of a triangle has the weighted mean of the corners' squared distances, less a variance of at most the
     * squared radius of the circle around it, which is at most a third of the longest side's square (Jung 1901). Of two
     * corners at distances p <= q, this square is (q - p)^2 and p q times that of the chord of their angle, which is
     * less than between their slopes. Each of these terms is right to 2^-20 of the smallest square, as long as they are
     * less than that. */
    const FLOAT wide = (p.edge[1] - p.edge[0]) * pane->over[0], high = (p.edge[3] - p.edge[2]) * pane->over[1];
    const FLOAT apart = most - least,
                spread = ((apart * apart) / (4 * least) + most * (wide * wide + high * high)) * (float)(1.0 / 3);
    p.near = least * (float)(1 - 0x1p-16) - spread;
    p.far = most * (float)(1 + 0x1p-10);
    p.large = spread > least * 0.0625f;
    return p;
}

/* What is noted of a side: the outermost edges of all polygons, left and low ones negative, the same of those where
 * shadow rays may end, minus the nearest depth of these, the furthest one, and how many polygons there are. */
#define EXTENTS_OF_SIDE 11

/* What the sides show whose bits are set. rest: for each of six sides, how many triangles are left to the host, then m
 * for each side, which these are; part: for each work-item EXTENTS_OF_SIDE numbers for each of six sides. */
__kernel void see_polygons(const int m, const int sides, __constant Pane *pane, __global const int *restrict point,
                           __global const int *restrict face, __global const char *restrict among,
                           __global const char *restrict receiver, __global int *restrict rest,
                           __global float *restrict part) {
    const Some all = {0, 1, m};
    FLOAT most[6][EXTENTS_OF_SIDE - 1];
    INT members[6];
    for (int side = 0; side < 6; side++) {
        members[side] = 0;
        for (int k = 0; k < EXTENTS_OF_SIDE - 1; k++) most[side][k] = -INFINITY;
    }
    FOR_EACH_PACKET(i, m) {
        const SeenCorners at = corners_of(point, face, all, i);
        const MASK asked = those_of(among, all, i), end = those_of(receiver, all, i);
        for (int side = 0; side < 6; side++) {
            if (!(sides >> side & 1)) continue;
            const MASK wanted = asked & may_be_seen(at, side);
            if (!ANY(wanted)) continue;
            const Polygon p = polygon_of(at, side, pane);
            const MASK done = wanted & is_inside(at, side) & !p.large;
            if (RARELY(ANY(wanted & !done))) {
                int lane[W];
                STORE_LANES((wanted & !done) ? (INT)1 : (INT)0, lane);
                for (int k = 0; k < W; k++)
                    if (lane[k]) rest[6 + (long)m * side + atomic_inc(rest + side)] = i + k;
            }
            members[side] += done ? (INT)1 : (INT)0;
            for (int k = 0; k < 4; k++) {
                const FLOAT outer = k % 2 ? p.edge[k] : -p.edge[k];
                most[side][k] = (done & (outer > most[side][k])) ? outer : most[side][k];
                most[side][4 + k] = (done & end & (outer > most[side][4 + k])) ? outer : most[side][4 + k];
            }
            most[side][8] = (done & end & (-p.near > most[side][8])) ? -p.near : most[side][8];
            most[side][9] = (done & end & (p.far > most[side][9])) ? p.far : most[side][9];
        }
    }
    for (int side = 0; side < 6; side++) {
        __global float *note = part + EXTENTS_OF_SIDE * (6 * get_global_id(0) + side);
        for (int k = 0; k < EXTENTS_OF_SIDE - 1; k++) note[k] = largest_lane(TO_REAL(most[side][k]));
        note[EXTENTS_OF_SIDE - 1] = sum_of_lanes(TO_LONG(members[side]));
    }
}

INLINE FLOAT area_of(const FLOAT *x, const FLOAT *y) {
    return fabs((x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0])) / 2;
}

/* Where polygons are entered. pixels: in the side of a cell of the picture, 0 for a light's window; level: of cells,
 * less than 0 where nothing is to be entered.
 * A light's: axis: for each axis where the window begins, where it ends, what leads to cells, and the last cell; slack:
 * relative to an edge; loose: what edges are off by beside that; furthest: where the last ray ends; low, scale: lead
 * from the plane to cells; off: what cells are off by. A picture's: axis: the first pixel of each axis, and the one
 * after the last; loose: what edges are off by, and off. */
typedef struct {
    double axis[2][4], slack, loose, low[2], scale[2], off;
    float furthest;
    int pixels, level;
} Place;

/* Which cells polygons cover, across and down; those that do; those of more than one row and column; area, width plus
 * height, in cells. */
typedef struct {
    Run run[2];
    MASK within, sprawls;
    FLOAT area, sides;
    REAL corner[2][3];
} Covered;

/* The cells between two edges. */
INLINE Run cells_between(const FLOAT *edge, const double4 axis, __constant Place *place) {
    if (!place->pixels)
        return cells_of(TO_REAL(edge[0]) - place->loose, TO_REAL(edge[1]) + place->loose, axis, place->slack);
    const float off = place->loose;
    return run_between(ceil(edge[0] - off), floor(edge[1] + off), (int2)((int)axis.x, (int)axis.y),
                       31 - clz(place->pixels));
}

INLINE Covered cells_under(const Polygon p, const MASK seen, __constant Place *place) {
    Covered c;
    c.within = seen;
    for (int k = 0; k < 2; k++) {
        c.run[k] = cells_between(p.edge + 2 * k, vload4(0, place->axis[k]), place);
        c.within &= c.run[k].any;
    }
    if (!place->pixels) c.within &= p.near < place->furthest;
    const FLOAT wide = TO_FLOAT(c.run[0].more), high = TO_FLOAT(c.run[1].more);
    c.sprawls = c.within & (c.run[0].more > 0) & (c.run[1].more > 0);
    FLOAT x[3], y[3];
    for (int j = 0; j < 3; j++) {
        for (int k = 0; k < 2; k++) c.corner[k][j] = (TO_REAL(p.corner[k][j]) - place->low[k]) * place->scale[k];
        x[j] = TO_FLOAT(c.corner[0][j]), y[j] = TO_FLOAT(c.corner[1][j]);
    }
    const float pixels = max(1, place->pixels);
    const FLOAT exact = area_of(x, y) / (pixels * pixels), area = wide * high;
    c.area = (c.sprawls & (exact < area)) ? exact : area;
    c.sides = wide + high;
    return c;
}

/* The sizes of some triangles, from the first one on, one in `stride`: two numbers each, -1 where it is not entered.
 * With a level: area, width plus height in cells of level 0; else: the area on the plane. */
__kernel void sample_polygons(const int count, const int first, const int stride, const int side, __constant Pane *pane,
                              __constant Place *place, __global const int *restrict point,
                              __global const int *restrict face, __global const char *restrict among,
                              __global float *restrict size) {
    const Some some = {first, stride, count};
    FOR_EACH_PACKET(i, count) {
        const SeenCorners at = corners_of(point, face, some, i);
        const Polygon p = polygon_of(at, side, pane);
        MASK seen = those_of(among, some, i) & may_be_seen(at, side) & is_inside(at, side) & !p.large;
        FLOAT area = area_of(p.corner[0], p.corner[1]), sides = 0;
        if (place->level >= 0) {
            const Covered c = cells_under(p, seen, place);
            seen = c.within, area = c.area, sides = c.sides;
        }
        WRITE_ROWS_2(float, ((__global float2 *)size), i, seen ? area : (FLOAT)-1, sides);
    }
}

/* An outline is sixteen numbers: three corners in cells, across and up each, what they are off by, and the bits of the
 * triangle's index, of its depth, of its level, and of the first and the last column and row there. */
#define OUTLINE 16

/* Adds the outlines of those polygons that sprawl. i: the first triangle's index; off: of Place. */
INLINE void add_outlines(const Covered c, const FLOAT near, const int level, const int i, const double off,
                         __global int *outlines, __global float *outline) {
    REAL most = 0;
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 2; k++) most = fabs(c.corner[k][j]) > most ? fabs(c.corner[k][j]) : most;
    float number[7][W];
    int whole[6][W], sprawls[W];
    STORE_LANES(AS(int, near), whole[0]);
    STORE_LANES((INT)level, whole[1]);
    for (int k = 0; k < 2; k++) {
        STORE_LANES(c.run[k].begin >> level, whole[2 + 2 * k]);
        STORE_LANES((c.run[k].begin + c.run[k].more) >> level, whole[3 + 2 * k]);
    }
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 2; k++) STORE_LANES(TO_FLOAT(c.corner[k][j]), number[2 * j + k]);
    STORE_LANES(-rounded_down(-(off + SLACK * most)), number[6]);
    STORE_LANES(c.sprawls ? (INT)1 : (INT)0, sprawls);
    for (int k = 0; k < W; k++) {
        if (!sprawls[k]) continue;
        __global float *out = outline + (long)OUTLINE * atomic_inc(outlines);
        for (int j = 0; j < 7; j++) out[j] = number[j][k];
        out[7] = as_float(i + k);
        for (int j = 0; j < 6; j++) out[8 + j] = as_float(whole[j][k]);
    }
}

/* Enters triangles. near: of those without outlines; nan where there is an outline, infinite where a triangle is not
 * entered. outlines: how many there are. For each work-item: how many are entered. */
__kernel void place_polygons(const int m, const int pitch, const int side, __constant Pane *pane,
                             __constant Place *place, __global const int *restrict point,
                             __global const int *restrict face, __global const char *restrict among,
                             __global short *restrict covers, __global float *restrict near,
                             __global int *restrict outlines, __global float *restrict outline,
                             __global long *restrict part) {
    const Some all = {0, 1, m};
    LONG members = 0;
    FOR_EACH_PACKET(i, m) {
        const SeenCorners at = corners_of(point, face, all, i);
        const MASK wanted = those_of(among, all, i) & may_be_seen(at, side) & is_inside(at, side);
        Polygon p;
        Covered c;
        if (ANY(wanted)) {
            p = polygon_of(at, side, pane);
            c = cells_under(p, wanted & !p.large, place);
        }
        if (!ANY(wanted) || !ANY(c.within)) {
            STORE_LANES((FLOAT)INFINITY, near + i);
            continue;
        }
        store_covers(c.run[0], c.run[1], covers + i, pitch);
        const FLOAT depth = c.sprawls ? (FLOAT)NAN : p.near;
        STORE_LANES(c.within ? depth : (FLOAT)INFINITY, near + i);
        members += TO_LONG(c.within ? (INT)1 : (INT)0);
        if (ANY(c.sprawls)) add_outlines(c, p.near, place->level, i, place->off, outlines, outline);
    }
    part[get_global_id(0)] = sum_of_lanes(members);
}

/* W polygons' cells in rows of them. x, y: where their sides begin, lower end first, end_y, slope: where they end;
 * over: 1 by the side of a cell, which is a power of two; there: which polygons there are. */
typedef struct {
    FLOAT x[3], y[3], end_y[3], slope[3], loose, side, over;
    INT left, right, top, bottom, first, pitch, index, near;
    MASK there;
    float gap;
} Outlines;

/* The first W of n outlines. */
INLINE Outlines outlines_of(__global const float *restrict outline, const int n, __constant Levels *levels,
                            const int pixels) {
    float8 number[W];
    int8 whole[W];
    int first[W], pitch[W], size[W];
    for (int k = 0; k < W; k++) {
        __global const float *at = outline + OUTLINE * min(k, n - 1);
        number[k] = vload8(0, at), whole[k] = as_int8(vload8(1, at));
        const int level = whole[k].s1;
        first[k] = levels->base[level], pitch[k] = levels->pitch[level], size[k] = max(1, pixels) << level;
    }
    Outlines o;
    const FLOAT x[3] = {(FLOAT)EACH_LANE(number, .s0), (FLOAT)EACH_LANE(number, .s2), (FLOAT)EACH_LANE(number, .s4)};
    const FLOAT y[3] = {(FLOAT)EACH_LANE(number, .s1), (FLOAT)EACH_LANE(number, .s3), (FLOAT)EACH_LANE(number, .s5)};
    o.loose = (FLOAT)EACH_LANE(number, .s6), o.index = AS(int, (FLOAT)EACH_LANE(number, .s7));
    o.near = (INT)EACH_LANE(whole, .s0), o.left = (INT)EACH_LANE(whole, .s2), o.right = (INT)EACH_LANE(whole, .s3);
    o.top = (INT)EACH_LANE(whole, .s4), o.bottom = (INT)EACH_LANE(whole, .s5);
    o.first = LOAD_LANES(first), o.pitch = LOAD_LANES(pitch), o.side = TO_FLOAT(LOAD_LANES(size)), o.over = 1 / o.side;
    o.there = LANE < n, o.gap = pixels > 0;
    for (int k = 0; k < 3; k++) {
        const int next = (k + 1) % 3;
        const MASK falls = y[k] > y[next];
        const FLOAT end = falls ? x[k] : x[next];
        o.x[k] = falls ? x[next] : x[k], o.y[k] = falls ? y[next] : y[k], o.end_y[k] = falls ? y[k] : y[next];
        const MASK flat = o.end_y[k] - o.y[k] < 0x1p-10f; /* a strip that needs it has both its ends */
        o.slope[k] = flat ? (FLOAT)0 : (end - o.x[k]) / (o.end_y[k] - o.y[k]);
    }
    return o;
}

/* The cells of a row of each polygon: the first one, and the one after the last. */
typedef struct {
    int begin[W], end[W];
} Runs;

INLINE Runs runs_of(const Outlines *o, const INT row) {
    const FLOAT low = TO_FLOAT(row) * o->side - o->loose, up = low + ((o->side + 2 * o->loose) - o->gap);
    FLOAT least = INFINITY, most = -INFINITY;
    for (int k = 0; k < 3; k++) {
        const FLOAT begin = LARGER(low, o->y[k]), stop = LESS(up, o->end_y[k]);
        const FLOAT x = o->x[k] + (begin - o->y[k]) * o->slope[k], end = x + (stop - begin) * o->slope[k];
        const MASK meets = begin <= stop;
        least = meets ? LESS(LESS(least, x), end) : least;
        most = meets ? LARGER(LARGER(most, x), end) : most;
    }
    least -= o->loose;
    most += o->loose;
    least = o->gap > 0 ? ceil(least) : least;
    const MASK some = o->there & (row <= o->bottom) & (least <= most);
    const FLOAT first = least * o->over, last = most * o->over;
    const FLOAT left = TO_FLOAT(o->left), right = TO_FLOAT(o->right);
    const FLOAT begin = first < left        ? left
                        : first > right + 1 ? right + 1
                                            : first,
                end = last < left - 1 ? left - 1
                      : last > right  ? right
                                      : last;
    const INT cell = o->first + row * o->pitch;
    Runs runs;
    STORE_LANES(some ? cell + TO_INT(begin) : (INT)0, runs.begin);
    STORE_LANES(some ? cell + TO_INT(end) + 1 : (INT)0, runs.end);
    return runs;
}

/* How many entries each cell has of polygons with outlines. */
__kernel void count_outlines(const int n, const int pixels, __constant Levels *levels,
                             __global const float *restrict outline, volatile __global int *count) {
    FOR_EACH_PACKET(i, n) {
        const Outlines o = outlines_of(outline + (long)OUTLINE * i, n - i, levels, pixels);
        for (INT row = o.top; ANY(row <= o.bottom); row++) {
            const Runs runs = runs_of(&o, row);
            for (int k = 0; k < W; k++)
                for (int cell = runs.begin[k]; cell < runs.end[k]; cell++) atomic_inc(count + cell);
        }
    }
}

/* The entries of polygons with outlines. first: the first triangle's index. The rest: see scatter_entries(). */
__kernel void scatter_outlines(const int n, const int pixels, const int first, __constant Levels *levels,
                               __global const float *restrict outline, volatile __global int *next,
                               __global ulong *restrict entry) {
    FOR_EACH_PACKET(i, n) {
        const Outlines o = outlines_of(outline + (long)OUTLINE * i, n - i, levels, pixels);
        int triangle[W];
        float near[W];
        ulong key[W];
        STORE_LANES(o.index, triangle);
        STORE_LANES(AS(float, o.near), near);
        for (int k = 0; k < W; k++) key[k] = key_of(near[k], first + triangle[k]);
        for (INT row = o.top; ANY(row <= o.bottom); row++) {
            const Runs runs = runs_of(&o, row);
            for (int k = 0; k < W; k++)
                for (int cell = runs.begin[k]; cell < runs.end[k]; cell++) entry[atomic_inc(next + cell)] = key[k];
        }
    }
}

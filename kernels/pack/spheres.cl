/* spheres.cl: spheres as the eye and the lights see them, and which cells of a light's grids they cover. */

/* Spheres as the eye and the lights at points see them: cltrace/plan/shapes/sphere.py.
 *
 * unit: leads from scene units to the float buffers' unit; lamp: a light at a point of the world, in that unit; power:
 * |centre|^2 - radius^2 of each sphere as seen from there. out2 and out4, of the host, are the types of the buffers
 * that are packed: floats or doubles.
 */
#define ROUNDING 0x1p-24

INLINE FLOAT rounded_down(const REAL value) {
    const FLOAT near = TO_FLOAT(value);
    const INT bits = AS(int, near);
    const INT below = near > 0 ? bits - 1 : near == 0 ? (INT)0x80000001 : bits + 1;
    return TO_MASK(TO_REAL(near) > value) ? AS(float, below) : near;
}

/* The rows that the host has to mend: index[0] of them, in any order. */
INLINE void note_unsure(__global int *index, const int i, const int n, const REAL rest) {
    if (!RARELY(ANY(TO_MASK(rest != rest)))) return;
    double lane[W];
    STORE_LANES(rest, lane);
    for (int k = 0; k < W; k++)
        if (i + k < n && lane[k] != lane[k]) index[1 + atomic_inc(index)] = i + k;
}

/* Puts numbers where they belong in a column. */
__kernel void mend(const int count, __global const int *restrict index, __global const double *restrict value,
                   __global double *restrict column) {
    FOR_EACH_SPHERE(i, count)
    column[index[i]] = value[i];
}

/* See filter_constant() of cltrace/plan/shapes/sphere.py: v, c: the centre, and |centre|^2 - radius^2. */
INLINE FLOAT filter_constant(const Real3 v, const REAL c) {
    const REAL wide = (FILTER_ROUNDINGS * ROUNDING) * (DOT(v, v) + fabs(c)), bound = c - wide - 0x1p-100;
    return rounded_down(bound > 0 ? bound : (REAL)-INFINITY);
}

/* r'^2, see sphere_filter_leaves() in kernels/shapes/sphere/surface.cl, of spheres with these places across rays.
 * loose: what is to be added to radii. */
INLINE FLOAT disc_filter(const REAL u, const REAL v, const REAL r, const double loose) {
    const REAL reach = (r + (DISC_ROUNDINGS * ROUNDING) * ((fabs(u) + fabs(v)) + r)) + loose;
    return -rounded_down(-(reach * reach));
}

/* Makes `power`. */
__kernel void see_from_light(const int n, const double unit, const double4 lamp, __global const double *restrict center,
                             __global const double *restrict radius, __global double *restrict power,
                             __global int *restrict unsure) {
    FOR_EACH_PACKET(i, n) {
        const Real3 p = point_of(center, n, i);
        const Pair3 v = {two_sum(p.x * unit, -lamp.x), two_sum(p.y * unit, -lamp.y), two_sum(p.z * unit, -lamp.z)};
        const Pair c = square_excess(v, column(radius, n, i) * unit);
        STORE_LANES(c.hi, power + i);
        note_unsure(unsure, i, n, c.lo);
    }
}

/* The centres from sphere i on as a light at a point sees them, along the world's axes. */
INLINE Real3 from_light(__global const double *center, const int n, const int i, const double unit,
                        const double4 lamp) {
    const Real3 p = point_of(center, n, i), v = {p.x * unit - lamp.x, p.y * unit - lamp.y, p.z * unit - lamp.z};
    return v;
}

INLINE REAL turned_along(const double4 axis, const Real3 v) {
    return (axis.x * v.x + axis.y * v.y) + axis.z * v.z;
}

/* The buffers of spheres as a light at a point sees them. */
__kernel void pack_light(const int n, const double unit, const double4 lamp, const double4 right, const double4 up,
                         const double4 back, const long first, __global const double *restrict center,
                         __global const double *restrict power, __global float4 *restrict light_filter,
                         __global char *restrict light_side) {
    FOR_EACH_PACKET(i, n) {
        const Real3 v = from_light(center, n, i, unit, lamp);
        const REAL c = LOAD_LANES(power + i);
        const INT side = TO_MASK(c > 0) ? (INT)1 : TO_MASK(c < 0) ? (INT)-1 : (INT)0;
        WRITE_ROWS_4(float, light_filter, first + i, TO_FLOAT(-turned_along(right, v)), TO_FLOAT(-turned_along(up, v)),
                     TO_FLOAT(-turned_along(back, v)), filter_constant(v, c));
        int lane[W];
        STORE_LANES(side, lane);
        for (int k = 0; k < W; k++) light_side[first + i + k] = lane[k];
    }
}

/* Turns the directions of light_filter, which another camera's axes made. */
__kernel void turn_light(const int n, const double unit, const double4 lamp, const double4 right, const double4 up,
                         const double4 back, const long first, __global const double *restrict center,
                         __global float4 *restrict light_filter) {
    FOR_EACH_PACKET(i, n) {
        const Real3 v = from_light(center, n, i, unit, lamp);
        float lane[W];
        for (int k = 0; k < W; k++) lane[k] = light_filter[first + i + k].w;
        WRITE_ROWS_4(float, light_filter, first + i, TO_FLOAT(-turned_along(right, v)), TO_FLOAT(-turned_along(up, v)),
                     TO_FLOAT(-turned_along(back, v)), LOAD_LANES(lane));
    }
}

/* Bits of `flags`: what may be seen at all, and what is in a grid of a light. */
#define VISIBLE 1
#define ENTERED 2

/* Which cells spheres cover: of the picture, and of the grids of a light at a point. The bounds are
 * those of accel/silhouettes.py and accel/grids.py of cltrace/plan.
 *
 * `covers` holds four columns of `pitch` shorts each: the first column and row of cells and how many more of each.
 * near: the depth of the nearest point; infinite where a sphere is not to be entered.
 */
#define SLACK 0x1p-20

typedef struct {
    REAL low, high;
} Slopes;

/* Circles of radius r at depth d, as seen from the origin. clear: whether they have tangents; gap: d^2 - r^2; forward,
 * around: d and r over it. */
typedef struct {
    REAL gap, forward, around;
    MASK clear;
} Circles;

INLINE Circles circles(const REAL d, const REAL r, const REAL gap) {
    Circles c = {gap};
    c.clear = TO_MASK((d > 0) & (gap >= d * d * 0.0625) & (gap > 0x1p-100));
    const REAL over = 1 / (TO_REAL_MASK(c.clear) ? gap : (REAL)1);
    c.forward = d * over, c.around = r * over;
    return c;
}

/* The slopes of the tangents to circles with these places across. */
INLINE Slopes slopes(const REAL across, const Circles c) {
    const REAL middle = across * c.forward, square = across * across + c.gap,
               reach = c.around * sqrt(square > 0 ? square : (REAL)0), low = middle - reach, high = middle + reach;
    const Slopes found = {TO_REAL_MASK(c.clear) ? low : (REAL)-INFINITY, TO_REAL_MASK(c.clear) ? high : (REAL)INFINITY};
    return found;
}

INLINE REAL length_of(const REAL x, const REAL y, const REAL z) {
    return sqrt(((x * x + y * y) + z * z) + 0x1p-120);
}

/* The squared distance of the nearest point, at least; -1 on the sphere, or all but. */
INLINE FLOAT nearest(const REAL distance, const REAL r, const REAL power) {
    const REAL gap = TO_REAL(fabs(TO_FLOAT(power))) / (distance + r);
    const REAL near = gap * gap * (1 - 0x1p-19);
    return TO_MASK(gap > 0x1p-50) ? TO_FLOAT(near) : (FLOAT)-1;
}

INLINE void store_short(const INT value, __global short *at) {
    STORE_LANES(TO(short, value), at);
}

INLINE INT load_flags(__global const char *flags) {
    int lane[W];
    for (int k = 0; k < W; k++) lane[k] = flags[k];
    return LOAD_LANES(lane);
}

INLINE void store_flags(const INT value, __global char *flags) {
    STORE_LANES(TO(char, value), flags);
}

INLINE FLOAT clipped(const FLOAT x, const int low, const int high) {
    const FLOAT above = x < (FLOAT)low ? (FLOAT)low : x;
    return above > (FLOAT)high ? (FLOAT)high : above;
}

/* The cells that a disc covers along one axis: the first one, and how many more. */
typedef struct {
    INT begin, more;
    MASK any;
} Run;

/* From one pixel to another within a range, with cells of 2^shift pixels. */
INLINE Run run_between(const FLOAT begin, const FLOAT end, const int2 range, const int shift) {
    const FLOAT first = clipped(begin, range.x, range.y), last = clipped(end, range.x - 1, range.y - 1);
    const INT cell = TO_INT(first) >> shift;
    const Run run = {cell, (TO_INT(last) >> shift) - cell, first <= last};
    return run;
}

INLINE void store_covers(const Run across, const Run down, __global short *covers, const int pitch) {
    store_short(across.begin, covers);
    store_short(down.begin, covers + pitch);
    store_short(across.more, covers + 2L * pitch);
    store_short(down.more, covers + 3L * pitch);
}

/* A sphere as a light at a point sees it, along the axes of the cube around the light: its centre, and the radius.
 * size: how far from the light along each axis. */
typedef struct {
    REAL c[3], size[3], r, distance;
} OnCube;

INLINE OnCube on_cube(const Real3 place, const REAL r, const double4 *axis) {
    OnCube at;
    for (int k = 0; k < 3; k++) {
        at.c[k] = turned_along(axis[k], place);
        at.size[k] = fabs(at.c[k]);
    }
    at.r = r;
    at.distance = length_of(at.c[0], at.c[1], at.c[2]);
    return at;
}

/* How far beyond the face of a pyramid a centre may be if its sphere still reaches into the pyramid. */
INLINE REAL reach_of(const OnCube at) {
    const REAL most = LARGER(LARGER(at.size[0], at.size[1]), at.size[2]);
    return at.r * (M_SQRT2 * (1 + SLACK)) + most * SLACK;
}

/* side: of cube_sides(). */
INLINE MASK is_on_side(const OnCube at, const REAL reach, const int side) {
    const REAL across = LARGER(at.size[(side / 2 + 1) % 3], at.size[(side / 2 + 2) % 3]), ahead = at.c[side / 2];
    return TO_MASK(across <= (side % 2 ? reach - ahead : reach + ahead));
}

/* On which sides of the cube any sphere is seen: for each work-item, a bit for each of +x, -x, +y, -y, +z, -z. */
__kernel void cube_sides(const int n, const double unit, const double4 lamp, const double4 a, const double4 b,
                         const double4 c, __global const double *restrict center,
                         __global const double *restrict radius, __global char *restrict flags,
                         __global int *restrict part) {
    const double4 cube[3] = {a, b, c};
    int sides = 0;
    FOR_EACH_PACKET(i, n) {
        const INT flag = load_flags(flags + i);
        const OnCube at = on_cube(from_light(center, n, i, unit, lamp), column(radius, n, i) * unit, cube);
        const REAL reach = reach_of(at);
        for (int side = 0; side < 6; side++)
            if (ANY(is_on_side(at, reach, side) & ((flag & VISIBLE) != 0))) sides |= 1 << side;
        store_flags(flag & VISIBLE, flags + i);
    }
    part[get_global_id(0)] = sides;
}

/* What is known of a disc: its edges, left, right, low and high, its nearest depth and the furthest one. */
#define EXTENTS 6

/* The outermost of what is known of discs, lower bounds negative, and how many there are. */
typedef struct {
    REAL most[EXTENTS];
    LONG members;
} Extent;

INLINE Extent no_discs(void) {
    Extent e;
    for (int k = 0; k < EXTENTS; k++) e.most[k] = -INFINITY;
    e.members = 0;
    return e;
}

/* Writes the edges of discs, four columns of `pitch` numbers each, and makes the extent hold those that are members. */
INLINE void store_discs(const REAL *disc, const MASK member, Extent *e, __global double *edges, const int pitch) {
    for (int k = 0; k < EXTENTS; k++) {
        const REAL outer = k % 2 ? disc[k] : -disc[k];
        e->most[k] = TO_REAL_MASK(member & TO_MASK(outer > e->most[k])) ? outer : e->most[k];
        if (k < 4) STORE_LANES(disc[k], edges + (long)k * pitch);
    }
    e->members += TO_LONG(member ? (INT)1 : (INT)0);
}

/* Notes it: EXTENTS + 1 numbers for each work-item. */
INLINE void note_discs(const Extent e, __global double *part) {
    __global double *note = part + (EXTENTS + 1) * get_global_id(0);
    for (int k = 0; k < EXTENTS; k++) note[k] = largest_lane(e.most[k]);
    note[EXTENTS] = sum_of_lanes(e.members);
}

/* The spheres that are seen through one side of the cube, as discs. part: see note_discs(). */
__kernel void cube_discs(const int n, const int pitch, const double unit, const double4 lamp, const double4 a,
                         const double4 b, const double4 c, const int side, __global const double *restrict center,
                         __global const double *restrict radius, __global const double *restrict power,
                         __global const char *restrict flags, __global double *restrict edges,
                         __global float *restrict near, __global double *restrict part) {
    const int axis = side / 2, right = (axis + 1) % 3, up = (axis + 2) % 3;
    const double4 cube[3] = {a, b, c};
    Extent extent = no_discs();
    FOR_EACH_PACKET(i, n) {
        const INT flag = load_flags(flags + i);
        const OnCube at = on_cube(from_light(center, n, i, unit, lamp), column(radius, n, i) * unit, cube);
        const MASK member = is_on_side(at, reach_of(at), side) & ((flag & VISIBLE) != 0);
        if (!ANY(member)) {
            STORE_LANES((FLOAT)INFINITY, near + i);
            continue;
        }
        const REAL d = side % 2 ? -at.c[axis] : at.c[axis];
        const Circles circle = circles(d, at.r, (d - at.r) * (d + at.r));
        const Slopes x = slopes(at.c[right], circle), y = slopes(at.c[up], circle);
        const FLOAT depth = nearest(at.distance, at.r, LOAD_LANES(power + i));
        const REAL span = at.distance + at.r, far = span * span * (1 + 0x1p-10);
        const REAL disc[EXTENTS] = {x.low, x.high, y.low, y.high, TO_REAL(depth), far};
        store_discs(disc, member, &extent, edges + i, pitch);
        STORE_LANES(member ? depth : (FLOAT)INFINITY, near + i);
    }
    note_discs(extent, part);
}

/* The edges of every stride-th sphere's disc, nan where there is none. */
__kernel void sample_edges(const int n, const int pitch, const int stride, __global const double *restrict edges,
                           __global const float *restrict near, __global double *restrict sample) {
    FOR_EACH_SPHERE(k, (n - 1) / stride + 1) {
        const int i = k * stride, there = near[i] < INFINITY;
        for (int edge = 0; edge < 4; edge++) sample[4 * k + edge] = there ? edges[(long)edge * pitch + i] : (double)NAN;
    }
}

/* axis: x: where the window begins, y: where it ends, z: what leads to cells, w: the last cell. */
INLINE Run cells_of(const REAL low, const REAL high, const double4 axis, const double slack) {
    const REAL loose = slack * ((1 + fabs(low)) + fabs(high)), begin = low - loose, end = high + loose;
    const REAL first = (begin - axis.x) * axis.z - 0.015625, last = (end - axis.x) * axis.z + 0.015625;
    const REAL from = first < 0 ? (REAL)0 : first > axis.w ? (REAL)axis.w : first;
    const REAL to = last < 0 ? (REAL)0 : last > axis.w ? (REAL)axis.w : last;
    const INT cell = TO_INT(from);
    const Run run = {cell, TO_INT(to) - cell, TO_MASK((end >= axis.x) & (begin <= axis.y))};
    return run;
}

/* The cells of a window that discs cover. x_axis, y_axis: see cells_of(); furthest: a depth beyond which nothing
 * matters. For each work-item, three numbers: how many spheres are entered, how many cells of level 0 they cover, and
 * how many of them are in no grid of this light before. */
__kernel void place(const int n, const int pitch, const double4 x_axis, const double4 y_axis, const double slack,
                    const float furthest, __global const double *restrict edges, __global char *restrict flags,
                    __global short *restrict covers, __global float *restrict near, __global long *restrict part) {
    LONG members = 0, entries = 0, more = 0;
    FOR_EACH_PACKET(i, n) {
        const FLOAT depth = LOAD_LANES(near + i);
        MASK within = depth < furthest;
        if (!ANY(within)) {
            STORE_LANES((FLOAT)INFINITY, near + i);
            continue;
        }
        REAL disc[4];
        for (int k = 0; k < 4; k++) disc[k] = LOAD_LANES(edges + (long)k * pitch + i);
        const Run row = cells_of(disc[0], disc[1], x_axis, slack), rows = cells_of(disc[2], disc[3], y_axis, slack);
        within &= row.any & rows.any;
        store_covers(row, rows, covers + i, pitch);
        STORE_LANES(within ? depth : (FLOAT)INFINITY, near + i);
        const INT flag = load_flags(flags + i);
        store_flags(within ? flag | ENTERED : flag, flags + i);
        members += TO_LONG(within ? (INT)1 : (INT)0);
        entries += TO_LONG(within ? (row.more + 1) * (rows.more + 1) : (INT)0);
        more += TO_LONG((within & ((flag & ENTERED) == 0)) ? (INT)1 : (INT)0);
    }
    part[3 * get_global_id(0)] = sum_of_lanes(members);
    part[3 * get_global_id(0) + 1] = sum_of_lanes(entries);
    part[3 * get_global_id(0) + 2] = sum_of_lanes(more);
}

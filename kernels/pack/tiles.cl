/* tiles.cl: which cells spheres cover: of the picture, and of the grids of a light at a point. These are the kernels of
 * accel/tiles.py and accel/light_buffer.py of cltrace/plan, with the same arithmetic in the same order.
 *
 * EDGE is the type of a disc's edges: float, or double where cells are too fine for that. `covers` holds four columns of
 * `pitch` shorts each: the first column and row of cells and how many more of each. near: the depth of the nearest
 * point; infinite where a sphere is not to be entered.
 */
#if EDGE_BYTES == 4
typedef float edge_t;
typedef float4 edge4;
typedef FLOAT EDGE;
#define TO_EDGE(x) TO_FLOAT(x)
#define EDGE_TO_FLOAT(x) (x)
#define EDGE_TO_REAL(x) TO_REAL(x)
#define EDGE_MASK(m) (m)
#define FROM_MASK(m) (m)
#else
typedef double edge_t;
typedef double4 edge4;
typedef REAL EDGE;
#define TO_EDGE(x) (x)
#define EDGE_TO_FLOAT(x) TO_FLOAT(x)
#define EDGE_TO_REAL(x) (x)
#define EDGE_MASK(m) TO_MASK(m)
#define FROM_MASK(m) TO_REAL_MASK(m)
#endif
#define SLACK 0x1p-20

typedef struct {
    EDGE low, high;
} Slopes;

/* The slopes of the tangents from the origin to circles with centre (c, d) and radius r. clear: whether there are any;
 * forward, around: d and r over the gap, d^2 - r^2. */
INLINE Slopes slopes(const EDGE c, const EDGE gap, const EDGE forward, const EDGE around, const MASK clear) {
    const EDGE middle = c * forward, square = c * c + gap,
               reach = around * sqrt(square > 0 ? square : (EDGE)0), low = middle - reach, high = middle + reach;
    const Slopes found = {FROM_MASK(clear) ? low : (EDGE)-INFINITY, FROM_MASK(clear) ? high : (EDGE)INFINITY};
    return found;
}

INLINE MASK is_clear(const EDGE d, const EDGE gap) {
    return EDGE_MASK((d > 0) & (gap >= d * d * (edge_t)0.0625) & (gap > (edge_t)0x1p-100));
}

INLINE EDGE length_of(const EDGE x, const EDGE y, const EDGE z) {
    return sqrt(((x * x + y * y) + z * z) + (edge_t)0x1p-120);
}

/* The squared distance of the nearest point, at least; -1 on the sphere, or all but. */
INLINE FLOAT nearest(const EDGE distance, const EDGE r, const REAL power) {
    const EDGE gap = TO_EDGE(TO_REAL(fabs(TO_FLOAT(power)))) / (distance + r);
    const EDGE near = gap * gap * (edge_t)(1 - 0x1p-19);
    return EDGE_MASK(gap > (edge_t)0x1p-50) ? EDGE_TO_FLOAT(near) : (FLOAT)-1;
}

INLINE void store_short(const INT value, __global short *at) {
    STORE_LANES(TO(short, value), at);
}

INLINE INT load_flags(__global const char *flags) {
    int lane[W];
    for (int k = 0; k < W; k++)
        lane[k] = flags[k];
    return LOAD_LANES(lane);
}

INLINE void store_flags(const INT value, __global char *flags) {
    STORE_LANES(TO(char, value), flags);
}

/* The cells that a disc covers along one axis: the first one, and how many more. */
typedef struct {
    INT begin, more;
    MASK any;
} Run;

#if EDGE_BYTES == 4
INLINE FLOAT clipped(const FLOAT x, const int low, const int high) {
    const FLOAT above = x < (FLOAT)low ? (FLOAT)low : x;
    return above > (FLOAT)high ? (FLOAT)high : above;
}

/* loose: by how much slopes are off, beside a share of themselves; axis: x: leads from slopes to pixels, y, z: what is added
 * to begin and end; range: the first pixel, and the one after the last. */
INLINE Run pixels_of(const Slopes s, const float loose, const float4 axis, const int2 range, const int shift) {
    const FLOAT slack = (fabs(s.low) + fabs(s.high)) * (float)SLACK + loose;
    const FLOAT first = clipped(ceil((s.low - slack) * axis.x + axis.y), range.x, range.y);
    const FLOAT last = clipped(floor((s.high + slack) * axis.x + axis.z), range.x - 1, range.y - 1);
    const INT begin = TO_INT(first) >> shift;
    const Run run = {begin, (TO_INT(last) >> shift) - begin, first <= last};
    return run;
}
#endif

/* A sphere as a light at a point sees it, in the directions of the cube around the light: c its axes, with the one that
 * it is looked along last, and the same rounded. */
typedef struct {
    REAL c[3];
    EDGE e[3];
    EDGE r, distance;
} OnCube;

INLINE OnCube on_cube(
    __global const double *seen, const int pitch, const int i, const REAL r, const double4 a, const double4 b, const double4 c
) {
    const REAL x = LOAD_LANES(seen + i), y = LOAD_LANES(seen + pitch + i), z = LOAD_LANES(seen + 2L * pitch + i);
    OnCube at;
    at.c[0] = (a.x * x + a.y * y) + a.z * z;
    at.c[1] = (b.x * x + b.y * y) + b.z * z;
    at.c[2] = (c.x * x + c.y * y) + c.z * z;
    for (int k = 0; k < 3; k++)
        at.e[k] = TO_EDGE(at.c[k]);
    at.r = TO_EDGE(r);
    at.distance = length_of(at.e[0], at.e[1], at.e[2]);
    return at;
}

/* How far beyond the face of a pyramid a centre may be if its sphere still reaches into the pyramid. */
INLINE EDGE reach_of(const OnCube at, const EDGE *size) {
    const EDGE most = LARGER(LARGER(size[0], size[1]), size[2]);
    return at.r * (edge_t)(M_SQRT2 * (1 + SLACK)) + most * (edge_t)SLACK;
}

INLINE MASK is_on_side(const OnCube at, const EDGE *size, const EDGE reach, const int axis, const int negative) {
    const EDGE across = LARGER(size[(axis + 1) % 3], size[(axis + 2) % 3]);
    return EDGE_MASK(across <= (negative ? reach - at.e[axis] : reach + at.e[axis]));
}

/* On which sides of the cube any sphere is seen: for each work-item, a bit for each of +x, -x, +y, -y, +z, -z. */
__kernel void cube_sides(
    const int n,
    const int pitch,
    const double unit,
    const double4 a,
    const double4 b,
    const double4 c,
    __global const double *restrict seen,
    __global const double *restrict radius,
    __global char *restrict flags,
    __global int *restrict part
) {
    int sides = 0;
    FOR_EACH_PACKET(i, n) {
        const INT flag = load_flags(flags + i);
        const OnCube at = on_cube(seen, pitch, i, column(radius, n, i) * unit, a, b, c);
        const EDGE size[3] = {fabs(at.e[0]), fabs(at.e[1]), fabs(at.e[2])}, reach = reach_of(at, size);
        for (int side = 0; side < 6; side++)
            if (ANY(is_on_side(at, size, reach, side / 2, side % 2) & ((flag & VISIBLE) != 0)))
                sides |= 1 << side;
        store_flags(flag & VISIBLE, flags + i);
    }
    part[get_global_id(0)] = sides;
}

#define EXTENTS 6

/* The edges of the spheres that are seen through one side of the cube: four columns of `pitch` numbers each, left, right,
 * low and high. For each work-item, EXTENTS numbers: the outermost edges of all discs, lower bounds negative; minus their
 * nearest depth and the furthest one; after these, how many discs there are. */
__kernel void cube_discs(
    const int n,
    const int pitch,
    const double unit,
    const double4 a,
    const double4 b,
    const double4 c,
    const int side,
    __global const double *restrict seen,
    __global const double *restrict radius,
    __global const char *restrict flags,
    __global edge_t *restrict edges,
    __global float *restrict near,
    __global double *restrict part
) {
    const int axis = side / 2, right = (axis + 1) % 3, up = (axis + 2) % 3;
    EDGE extent[EXTENTS];
    LONG members = 0;
    for (int k = 0; k < EXTENTS; k++)
        extent[k] = -INFINITY;
    FOR_EACH_PACKET(i, n) {
        const INT flag = load_flags(flags + i);
        const REAL exact_r = column(radius, n, i) * unit;
        const OnCube at = on_cube(seen, pitch, i, exact_r, a, b, c);
        const EDGE size[3] = {fabs(at.e[0]), fabs(at.e[1]), fabs(at.e[2])};
        const MASK member = is_on_side(at, size, reach_of(at, size), axis, side % 2) & ((flag & VISIBLE) != 0);
        members += TO_LONG(member ? (INT)1 : (INT)0);
        if (!ANY(member)) {
            STORE_LANES((FLOAT)INFINITY, near + i);
            continue;
        }
        const REAL exact_d = side % 2 ? -at.c[axis] : at.c[axis];
        const EDGE d = TO_EDGE(exact_d), gap = TO_EDGE((exact_d - exact_r) * (exact_d + exact_r));
        const MASK clear = is_clear(d, gap);
        const EDGE over = 1 / (FROM_MASK(clear) ? gap : (EDGE)1), forward = d * over, around = at.r * over;
        const Slopes x = slopes(at.e[right], gap, forward, around, clear), y = slopes(at.e[up], gap, forward, around, clear);
        const EDGE edge[4] = {x.low, x.high, y.low, y.high};
        const FLOAT depth = nearest(at.distance, at.r, LOAD_LANES(seen + 3L * pitch + i));
        for (int k = 0; k < 4; k++) {
            const EDGE outer = k % 2 ? edge[k] : -edge[k];
            STORE_LANES(edge[k], edges + (long)k * pitch + i);
            extent[k] = FROM_MASK(member & EDGE_MASK(outer > extent[k])) ? outer : extent[k];
        }
        const EDGE span = at.distance + at.r, far = span * span * (edge_t)(1 + 0x1p-10), nearer = -TO_EDGE(TO_REAL(depth));
        extent[4] = FROM_MASK(member & EDGE_MASK(nearer > extent[4])) ? nearer : extent[4];
        extent[5] = FROM_MASK(member & EDGE_MASK(far > extent[5])) ? far : extent[5];
        STORE_LANES(member ? depth : (FLOAT)INFINITY, near + i);
    }
    for (int k = 0; k < EXTENTS; k++)
        part[(EXTENTS + 1) * get_global_id(0) + k] = largest_lane(EDGE_TO_REAL(extent[k]));
    part[(EXTENTS + 1) * get_global_id(0) + EXTENTS] = sum_of_lanes(members);
}

#if EDGE_BYTES == 8
/* The same for all spheres, as a parallel light sees them: c is the axis that leads there. */
__kernel void discs_along(
    const int n,
    const int pitch,
    const double unit,
    const double4 a,
    const double4 b,
    const double4 c,
    __global const double *restrict seen,
    __global const double *restrict radius,
    __global char *restrict flags,
    __global double *restrict edges,
    __global float *restrict near,
    __global double *restrict part
) {
    REAL extent[EXTENTS];
    LONG members = 0;
    for (int k = 0; k < EXTENTS; k++)
        extent[k] = -INFINITY;
    FOR_EACH_PACKET(i, n) {
        const INT flag = load_flags(flags + i);
        const MASK member = (flag & VISIBLE) != 0;
        const REAL x = LOAD_LANES(seen + i), y = LOAD_LANES(seen + pitch + i), z = LOAD_LANES(seen + 2L * pitch + i),
                   r = column(radius, n, i) * unit, u = (x * a.x + y * a.y) + z * a.z, v = (x * b.x + y * b.y) + z * b.z,
                   s = (x * c.x + y * c.y) + z * c.z;
        const REAL edge[4] = {u - r, u + r, v - r, v + r};
        const FLOAT depth = rounded_down(-(s + r) - SLACK * (fabs(s) + r) - 0x1p-100);
        const REAL far = r - s + 0x1p-10, nearer = -TO_REAL(depth);
        for (int k = 0; k < 4; k++) {
            const REAL outer = k % 2 ? edge[k] : -edge[k];
            STORE_LANES(edge[k], edges + (long)k * pitch + i);
            extent[k] = (TO_REAL_MASK(member) & (outer > extent[k])) ? outer : extent[k];
        }
        extent[4] = (TO_REAL_MASK(member) & (nearer > extent[4])) ? nearer : extent[4];
        extent[5] = (TO_REAL_MASK(member) & (far > extent[5])) ? far : extent[5];
        members += TO_LONG(member ? (INT)1 : (INT)0);
        STORE_LANES(member ? depth : (FLOAT)INFINITY, near + i);
        store_flags(flag & VISIBLE, flags + i);
    }
    for (int k = 0; k < EXTENTS; k++)
        part[(EXTENTS + 1) * get_global_id(0) + k] = largest_lane(extent[k]);
    part[(EXTENTS + 1) * get_global_id(0) + EXTENTS] = sum_of_lanes(members);
}
#endif

/* The widths and heights of every stride-th sphere's disc, nan where there is none. */
__kernel void sizes(
    const int n,
    const int pitch,
    const int stride,
    __global const edge_t *restrict edges,
    __global const float *restrict near,
    __global edge_t *restrict size
) {
    FOR_EACH_SPHERE(k, (n - 1) / stride + 1) {
        const int i = k * stride, there = near[i] < INFINITY;
        size[2 * k] = there ? edges[pitch + i] - edges[i] : (edge_t)NAN;
        size[2 * k + 1] = there ? edges[3L * pitch + i] - edges[2L * pitch + i] : (edge_t)NAN;
    }
}

/* axis: x: where the window begins, y: where it ends, z: what leads to cells, w: the last cell. */
INLINE Run cells_of(const EDGE low, const EDGE high, const edge4 axis, const edge_t slack) {
    const EDGE loose = slack * ((1 + fabs(low)) + fabs(high)), begin = low - loose, end = high + loose;
    const EDGE first = (begin - axis.x) * axis.z - (edge_t)0.015625, last = (end - axis.x) * axis.z + (edge_t)0.015625;
    const EDGE from = first < 0 ? (EDGE)0 : first > axis.w ? (EDGE)axis.w : first;
    const EDGE to = last < 0 ? (EDGE)0 : last > axis.w ? (EDGE)axis.w : last;
    const INT cell = TO_INT(from);
    const Run run = {cell, TO_INT(to) - cell, EDGE_MASK((end >= axis.x) & (begin <= axis.y))};
    return run;
}

/* The cells of a window that discs cover. x_axis, y_axis: see cells_of(); furthest: a depth beyond which nothing
 * matters. For each work-item, four numbers: how many spheres are entered, how many cells of level 0 they cover, the last
 * one of them, and how many of them are in no grid of this light before. */
__kernel void place(
    const int n,
    const int pitch,
    const edge4 x_axis,
    const edge4 y_axis,
    const edge_t slack,
    const float furthest,
    __global const edge_t *restrict edges,
    __global char *restrict flags,
    __global short *restrict covers,
    __global float *restrict near,
    __global long *restrict part
) {
    LONG members = 0, entries = 0, more = 0;
    INT last = -1;
    FOR_EACH_PACKET(i, n) {
        const FLOAT depth = LOAD_LANES(near + i);
        MASK within = depth < furthest;
        if (!ANY(within)) {
            STORE_LANES((FLOAT)INFINITY, near + i);
            continue;
        }
        const Run row = cells_of(LOAD_LANES(edges + i), LOAD_LANES(edges + pitch + i), x_axis, slack);
        const Run rows = cells_of(LOAD_LANES(edges + 2L * pitch + i), LOAD_LANES(edges + 3L * pitch + i), y_axis, slack);
        within &= row.any & rows.any;
        store_short(row.begin, covers + i);
        store_short(rows.begin, covers + pitch + i);
        store_short(row.more, covers + 2L * pitch + i);
        store_short(rows.more, covers + 3L * pitch + i);
        STORE_LANES(within ? depth : (FLOAT)INFINITY, near + i);
        const INT flag = load_flags(flags + i);
        store_flags(within ? flag | ENTERED : flag, flags + i);
        members += TO_LONG(within ? (INT)1 : (INT)0);
        last = within ? i + LANE : last;
        entries += TO_LONG(within ? (row.more + 1) * (rows.more + 1) : (INT)0);
        more += TO_LONG((within & ((flag & ENTERED) == 0)) ? (INT)1 : (INT)0);
    }
    part[4 * get_global_id(0)] = sum_of_lanes(members);
    part[4 * get_global_id(0) + 1] = sum_of_lanes(entries);
    part[4 * get_global_id(0) + 2] = LARGEST(last);
    part[4 * get_global_id(0) + 3] = sum_of_lanes(more);
}

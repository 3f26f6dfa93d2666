/* space.cl: spheres as the eye and the lights at points see them: cltrace/plan/shapes/sphere.py.
 *
 * `seen` holds four columns of `pitch` doubles each: the centre as seen from the eye or from a light, along the
 * camera's axes, and |centre|^2 - radius^2; in the float buffers' unit. out2 and out4, of the host, are the types of
 * the buffers that are packed: floats or doubles.
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

/* Puts numbers where they belong in a column that begins at `first`. */
__kernel void mend(const int count, const int first, __global const int *restrict index,
                   __global const double *restrict value, __global double *restrict column) {
    FOR_EACH_SPHERE(i, count)
    column[first + index[i]] = value[i];
}

/* See filter_constant() of cltrace/plan/shapes/sphere.py: v, c: the centre, and |centre|^2 - radius^2. */
INLINE FLOAT filter_constant(const Real3 v, const REAL c) {
    const REAL wide = (FILTER_ROUNDINGS * ROUNDING) * (DOT(v, v) + fabs(c)), bound = c - wide - 0x1p-100;
    return rounded_down(bound > 0 ? bound : (REAL)-INFINITY);
}

/* r'^2, see sphere_filter_leaves() in kernels/shapes/sphere/stops.cl, of spheres with these places across rays. loose:
 * what is to be added to radii. */
INLINE FLOAT disc_filter(const REAL u, const REAL v, const REAL r, const double loose) {
    const REAL reach = (r + (DISC_ROUNDINGS * ROUNDING) * ((fabs(u) + fabs(v)) + r)) + loose;
    return -rounded_down(-(reach * reach));
}

/* Spheres as a light at a point sees them, along the world's axes. lamp: the light in the world, in the float
 * buffers' unit. */
__kernel void see_from_light(const int n, const int pitch, const double unit, __global const double *restrict center,
                             __global const double *restrict radius, const double4 lamp, __global double *restrict seen,
                             __global int *restrict unsure) {
    FOR_EACH_PACKET(i, n) {
        const Real3 p = point_of(center, n, i);
        const Pair3 v = {two_sum(p.x * unit, -lamp.x), two_sum(p.y * unit, -lamp.y), two_sum(p.z * unit, -lamp.z)};
        const Pair c = square_excess(v, column(radius, n, i) * unit);
        STORE_LANES(v.x.hi, seen + i);
        STORE_LANES(v.y.hi, seen + pitch + i);
        STORE_LANES(v.z.hi, seen + 2L * pitch + i);
        STORE_LANES(c.hi, seen + 3L * pitch + i);
        note_unsure(unsure, i, n, c.lo);
    }
}

/* What is in the first three columns of `seen` from row i on. */
INLINE Real3 place_of(__global const double *seen, const int pitch, const int i) {
    const Real3 p = {LOAD_LANES(seen + i), LOAD_LANES(seen + pitch + i), LOAD_LANES(seen + 2L * pitch + i)};
    return p;
}

INLINE REAL turned_along(const double4 axis, const Real3 v) {
    return (axis.x * v.x + axis.y * v.y) + axis.z * v.z;
}

/* The buffers of spheres as a light at a point sees them. */
__kernel void pack_light(const int n, const int pitch, const double4 right, const double4 up, const double4 back,
                         const long first, __global const double *restrict seen, __global float4 *restrict light_filter,
                         __global char *restrict light_side) {
    FOR_EACH_PACKET(i, n) {
        const Real3 v = place_of(seen, pitch, i);
        const REAL c = LOAD_LANES(seen + 3L * pitch + i);
        const INT side = TO_MASK(c > 0) ? (INT)1 : TO_MASK(c < 0) ? (INT)-1 : (INT)0;
        WRITE_ROWS_4(float, light_filter, first + i, TO_FLOAT(-turned_along(right, v)), TO_FLOAT(-turned_along(up, v)),
                     TO_FLOAT(-turned_along(back, v)), filter_constant(v, c));
        int lane[W];
        STORE_LANES(side, lane);
        for (int k = 0; k < W; k++) light_side[first + i + k] = lane[k];
    }
}

/* The same for another camera: light_filter, of which only the directions are others than those of `before`. unit,
 * lamp: see see_from_light(). */
__kernel void turn_light(const int n, const double unit, __global const double *restrict center, const double4 lamp,
                         const double4 right, const double4 up, const double4 back, const long first,
                         __global const float4 *restrict before, __global float4 *restrict light_filter) {
    FOR_EACH_PACKET(i, n) {
        const Real3 p = point_of(center, n, i);
        const Real3 v = {p.x * unit - lamp.x, p.y * unit - lamp.y, p.z * unit - lamp.z};
        float lane[W];
        for (int k = 0; k < W; k++) lane[k] = before[first + i + k].w;
        WRITE_ROWS_4(float, light_filter, first + i, TO_FLOAT(-turned_along(right, v)), TO_FLOAT(-turned_along(up, v)),
                     TO_FLOAT(-turned_along(back, v)), LOAD_LANES(lane));
    }
}

/* The buffers of spheres as a parallel light sees them; a, b: the axes across it. */
__kernel void pack_along(const int n, const int pitch, const double unit, const double4 a, const double4 b,
                         const long first, __global const double *restrict seen, __global const double *restrict radius,
                         __global float4 *restrict light_filter, __global char *restrict light_side) {
    FOR_EACH_PACKET(i, n) {
        const Real3 place = place_of(seen, pitch, i);
        const REAL r = column(radius, n, i) * unit, u = turned_along(a, place), v = turned_along(b, place);
        WRITE_ROWS_4(float, light_filter, first + i, TO_FLOAT(u), TO_FLOAT(v), disc_filter(u, v, r, 0x1p-60), (FLOAT)0);
        for (int k = 0; k < W; k++) light_side[first + i + k] = 1;
    }
}

/* Bits of `flags`: what may be seen at all, and what is in a grid of a light. */
#define VISIBLE 1
#define ENTERED 2

/* space.cl: spheres as the eye and the lights at points see them: cltrace/plan/space.py, shapes/sphere.py, culling.py.
 *
 * `seen` holds four columns of `pitch` doubles each: the centre as seen from the eye or from a light, along the camera's
 * axes, and |centre|^2 - radius^2; in the float buffers' unit.
 */
#if OUT_BYTES == 4
typedef float4 out4;
typedef float2 out2;
#else
typedef double4 out4;
typedef double2 out2;
#endif
#define ROUNDING 0x1p-24

INLINE FLOAT rounded_down(const REAL value) {
    const FLOAT near = TO_FLOAT(value);
    const INT bits = AS(int, near);
    const INT below = near > 0 ? bits - 1 : near == 0 ? (INT)0x80000001 : bits + 1;
    return TO_MASK(TO_REAL(near) > value) ? AS(float, below) : near;
}

/* The rows that the host has to mend: index[0] of them, in any order. */
INLINE void note_unsure(__global int *index, const int i, const int n, const REAL rest) {
    if (!RARELY(ANY(TO_MASK(rest != rest))))
        return;
    double lane[W];
    STORE_LANES(rest, lane);
    for (int k = 0; k < W; k++)
        if (i + k < n && lane[k] != lane[k])
            index[1 + atomic_inc(index)] = i + k;
}

/* Puts numbers where they belong in a column that begins at `first`. */
__kernel void mend(
    const int count,
    const int first,
    __global const int *restrict index,
    __global const double *restrict value,
    __global double *restrict column
) {
    FOR_EACH_SPHERE(i, count)
        column[first + index[i]] = value[i];
}

INLINE FLOAT filter_constant(const REAL x, const REAL y, const REAL z, const REAL c) {
    const REAL wide = (FILTER_ROUNDINGS * ROUNDING) * (((x * x + y * y) + z * z) + fabs(c)), bound = c - wide - 0x1p-100;
    return rounded_down(bound > 0 ? bound : (REAL)-INFINITY);
}

/* r'^2, see filter_leaves() in kernels/find/stopped.cl, of spheres with these places across rays. loose: what is to be added
 * to radii. */
INLINE FLOAT disc_filter(const REAL u, const REAL v, const REAL r, const double loose) {
    const REAL reach = (r + (DISC_ROUNDINGS * ROUNDING) * ((fabs(u) + fabs(v)) + r)) + loose;
    return -rounded_down(-(reach * reach));
}

/* Spheres as a light at a point sees them, along the world's axes. lamp: the light in the world, in the float
 * buffers' unit. */
__kernel void see_from_light(
    const int n,
    const int pitch,
    const double unit,
    __global const double *restrict center,
    __global const double *restrict radius,
    const double4 lamp,
    __global double *restrict seen,
    __global int *restrict unsure
) {
    FOR_EACH_PACKET(i, n) {
        FETCH_ROWS(center, 3, i);
        FETCH_ROWS(radius, 1, i);
        const Point p = point_of(center, n, i);
        const Pair x = two_sum(p.x * unit, -lamp.x), y = two_sum(p.y * unit, -lamp.y), z = two_sum(p.z * unit, -lamp.z),
                   c = square_excess(x, y, z, column(radius, n, i) * unit);
        STORE_LANES(x.hi, seen + i);
        STORE_LANES(y.hi, seen + pitch + i);
        STORE_LANES(z.hi, seen + 2L * pitch + i);
        STORE_LANES(c.hi, seen + 3L * pitch + i);
        note_unsure(unsure, i, n, c.lo);
    }
}

INLINE REAL turned_along(const double4 axis, const REAL x, const REAL y, const REAL z) {
    return (axis.x * x + axis.y * y) + axis.z * z;
}

/* The buffers of spheres as a light at a point sees them. */
__kernel void pack_light(
    const int n,
    const int pitch,
    const double4 right,
    const double4 up,
    const double4 back,
    const long first,
    __global const double *restrict seen,
    __global float4 *restrict light_filter,
    __global char *restrict light_side
) {
    FOR_EACH_PACKET(i, n) {
        const REAL x = LOAD_LANES(seen + i), y = LOAD_LANES(seen + pitch + i), z = LOAD_LANES(seen + 2L * pitch + i),
                   c = LOAD_LANES(seen + 3L * pitch + i);
        const INT side = TO_MASK(c > 0) ? (INT)1 : TO_MASK(c < 0) ? (INT)-1 : (INT)0;
        const FLOAT X = TO_FLOAT(-turned_along(right, x, y, z)), Y = TO_FLOAT(-turned_along(up, x, y, z)),
                    Z = TO_FLOAT(-turned_along(back, x, y, z));
        WRITE_ROWS_4(float, light_filter, first + i, X, Y, Z, filter_constant(x, y, z, c));
        int lane[W];
        STORE_LANES(side, lane);
        for (int k = 0; k < W; k++)
            light_side[first + i + k] = lane[k];
    }
}

/* The same for another camera: light_filter, of which only the directions are others than those of `before`. unit, lamp:
 * see see_from_light(). */
__kernel void turn_light(
    const int n,
    const double unit,
    __global const double *restrict center,
    const double4 lamp,
    const double4 right,
    const double4 up,
    const double4 back,
    const long first,
    __global const float4 *restrict before,
    __global float4 *restrict light_filter
) {
    FOR_EACH_PACKET(i, n) {
        FETCH_ROWS(center, 3, i);
        FETCH_ROWS(before + first, 1, i);
        const Point p = point_of(center, n, i);
        const REAL x = p.x * unit - lamp.x, y = p.y * unit - lamp.y, z = p.z * unit - lamp.z;
        const FLOAT X = TO_FLOAT(-turned_along(right, x, y, z)), Y = TO_FLOAT(-turned_along(up, x, y, z)),
                    Z = TO_FLOAT(-turned_along(back, x, y, z));
        float lane[W];
        for (int k = 0; k < W; k++)
            lane[k] = before[first + i + k].w;
        WRITE_ROWS_4(float, light_filter, first + i, X, Y, Z, LOAD_LANES(lane));
    }
}

/* The buffers of spheres as a parallel light sees them; a, b: the axes across it. */
__kernel void pack_along(
    const int n,
    const int pitch,
    const double unit,
    const double4 a,
    const double4 b,
    const long first,
    __global const double *restrict seen,
    __global const double *restrict radius,
    __global float4 *restrict light_filter,
    __global char *restrict light_side
) {
    FOR_EACH_PACKET(i, n) {
        const REAL x = LOAD_LANES(seen + i), y = LOAD_LANES(seen + pitch + i), z = LOAD_LANES(seen + 2L * pitch + i),
                   r = column(radius, n, i) * unit, u = (x * a.x + y * a.y) + z * a.z, v = (x * b.x + y * b.y) + z * b.z;
        WRITE_ROWS_4(float, light_filter, first + i, TO_FLOAT(u), TO_FLOAT(v), disc_filter(u, v, r, 0x1p-60), (FLOAT)0);
        for (int k = 0; k < W; k++)
            light_side[first + i + k] = 1;
    }
}

/* Bits of `flags`: what may be seen at all, and what is in a grid of a light. */
#define VISIBLE 1
#define ENTERED 2

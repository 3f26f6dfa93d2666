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

/* The eye, and the camera's axes in the world. */
typedef struct {
    double4 eye, right, up, back;
} Camera;

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

/* In scene units: centres and radii, powers, the last column of `seen`, and what their roundings cut off. For each
 * work-item: the largest coordinate or radius, and the least power of those that are sure. */
__kernel void see_from_eye(
    const int n,
    const int pitch,
    __global const double *restrict center,
    __global const double *restrict radius,
    const double4 eye,
    const double4 right,
    const double4 up,
    const double4 back,
    __global double4 *restrict turned,
    __global double *restrict seen,
    __global double *restrict rest,
    __global int *restrict unsure,
    __global double2 *restrict part
) {
    REAL most = 0, least = 1;
    FOR_EACH_PACKET(i, n) {
        const Pair x = two_sum(column(center, 3, n, i), -eye.x), y = two_sum(column(center + 1, 3, n, i), -eye.y),
                   z = two_sum(column(center + 2, 3, n, i), -eye.z);
        const REAL r = column(radius, 1, n, i), X = dot_product(right, x, y, z), Y = dot_product(up, x, y, z),
                   Z = dot_product(back, x, y, z);
        const Pair c = square_excess(x, y, z, r);
        WRITE_ROWS_4(double, turned, i, X, Y, Z, r);
        STORE_LANES(c.hi, seen + 3L * pitch + i);
        STORE_LANES(c.lo, rest + i);
        note_unsure(unsure, i, n, c.lo);
        most = LARGER(LARGER(LARGER(most, r), fabs(X)), LARGER(fabs(Y), fabs(Z)));
        least = ((c.lo == c.lo) & (c.hi < least)) ? c.hi : least;
    }
    part[get_global_id(0)] = (double2)(largest_lane(most), -largest_lane(-least));
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

/* The buffers of spheres as the eye sees them, and the columns of `seen`, of which the last one was in scene units. unit:
 * leads from scene units to the float buffers' unit. */
__kernel void pack_eye(
    const int n,
    const int pitch,
    const double unit,
    __global const double *restrict center,
    __global const double4 *restrict turned,
    __global const double *restrict rest,
    __global double *restrict seen,
    __global out4 *restrict center_radius,
    __global out2 *restrict power,
    __global double4 *restrict world,
    __global float4 *restrict eye_filter
) {
    FOR_EACH_PACKET(i, n) {
        double x_[W], y_[W], z_[W], r_[W];
        for (int k = 0; k < W; k++) {
            const double4 row = turned[i + k];
            x_[k] = row.x, y_[k] = row.y, z_[k] = row.z, r_[k] = row.w;
        }
        const REAL x = LOAD_LANES(x_) * unit, y = LOAD_LANES(y_) * unit, z = LOAD_LANES(z_) * unit,
                   r = LOAD_LANES(r_), whole = LOAD_LANES(seen + 3L * pitch + i), c = whole * (unit * unit);
        STORE_LANES(x, seen + i);
        STORE_LANES(y, seen + pitch + i);
        STORE_LANES(z, seen + 2L * pitch + i);
        STORE_LANES(c, seen + 3L * pitch + i);
        WRITE_ROWS_4(float, eye_filter, i, TO_FLOAT(x), TO_FLOAT(y), TO_FLOAT(z), filter_constant(x, y, z, c));
#if OUT_BYTES == 4
        const REAL small = r * unit, over = 1 / small;
        WRITE_ROWS_4(float, center_radius, i, TO_FLOAT(x), TO_FLOAT(y), TO_FLOAT(z), TO_FLOAT(small));
        const REAL bounded = over < (REAL)FLT_MAX ? over : (REAL)FLT_MAX;
        float a_[W], b_[W];
        STORE_LANES(TO_FLOAT(c), a_);
        STORE_LANES(TO_FLOAT(bounded), b_);
        for (int k = 0; k < W; k++)
            power[i + k].x = a_[k], power[i + k].y = b_[k];
#else
        const REAL over = 1 / r;
        WRITE_ROWS_2(power, i, whole, over);
        const REAL X = column(center, 3, n, i), Y = column(center + 1, 3, n, i), Z = column(center + 2, 3, n, i),
                   cut = LOAD_LANES(rest + i);
        WRITE_ROWS_4(double, world, i, X, Y, Z, cut);
#endif
    }
}

/* The same spheres as a light at a point sees them, along the world's axes. lamp: the light in the world, in the float
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
        const Pair x = two_sum(column(center, 3, n, i) * unit, -lamp.x),
                   y = two_sum(column(center + 1, 3, n, i) * unit, -lamp.y),
                   z = two_sum(column(center + 2, 3, n, i) * unit, -lamp.z),
                   c = square_excess(x, y, z, column(radius, 1, n, i) * unit);
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
        const REAL x = column(center, 3, n, i) * unit - lamp.x, y = column(center + 1, 3, n, i) * unit - lamp.y,
                   z = column(center + 2, 3, n, i) * unit - lamp.z;
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
                   r = column(radius, 1, n, i) * unit, u = (x * a.x + y * a.y) + z * a.z, v = (x * b.x + y * b.y) + z * b.z,
                   reach = (r + (DISC_ROUNDINGS * ROUNDING) * ((fabs(u) + fabs(v)) + r)) + 0x1p-60;
        WRITE_ROWS_4(float, light_filter, first + i, TO_FLOAT(u), TO_FLOAT(v), -rounded_down(-(reach * reach)), (FLOAT)0);
        for (int k = 0; k < W; k++)
            light_side[first + i + k] = 1;
    }
}

/* What the lists are made of: bits of `flags`. */
#define VISIBLE 1
#define ENTERED 2

/* Which spheres may be seen at all: those that are equal to none before them, and not inside of another one. again:
 * whether a sphere is equal to one before it; shell: centres of large spheres, and by how much others must be inside. For
 * each work-item: how many may be seen. */
__kernel void hide(
    const int n,
    const double unit,
    const double slack,
    const int shells,
    const int some_again,
    __global const double4 *restrict shell,
    __global const char *restrict again,
    __global const double *restrict center,
    __global const double *restrict radius,
    __global char *restrict flags,
    __global long *restrict part
) {
    LONG count = 0;
    FOR_EACH_PACKET(i, n) {
        MASK visible = LANE < n - i;
        if (some_again) {
            int lane[W];
            for (int k = 0; k < W; k++)
                lane[k] = again[min(i + k, n - 1)];
            visible &= LOAD_LANES(lane) == 0;
        }
        if (shells) {
            const REAL r = column(radius, 1, n, i) * unit, roomy = r + (16 * slack) * (1 + 1 / r),
                       x = column(center, 3, n, i) * unit, y = column(center + 1, 3, n, i) * unit,
                       z = column(center + 2, 3, n, i) * unit;
            for (int k = 0; k < shells; k++) {
                const double4 outer = shell[k];
                const REAL X = x - outer.x, Y = y - outer.y, Z = z - outer.z;
                visible &= TO_MASK(sqrt((X * X + Y * Y) + Z * Z) + roomy >= outer.w);
            }
        }
        int lane[W];
        STORE_LANES(visible, lane);
        for (int k = 0; k < W; k++)
            flags[i + k] = lane[k] ? VISIBLE : 0;
        count += TO_LONG(visible ? (INT)1 : (INT)0);
    }
    part[get_global_id(0)] = sum_of_lanes(count);
}

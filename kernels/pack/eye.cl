/* eye.cl: spheres as the eye sees them: the kernel's buffers, and which tiles they cover, in one pass over memory. This is
 * what cltrace/plan/space.py, shapes/sphere.py, culling.py and accel/tiles.py make, with the same arithmetic.
 */
#if EDGE_BYTES == 4
/* See accel/tiles.py. */
#define LOOSE 0x1p-44

/* A sphere as the eye sees it. X, Y, Z, r, whole + cut: in scene units, along the camera's axes, with |centre|^2 - r^2;
 * x, y, z: in the float buffers' unit. */
typedef struct {
    REAL X, Y, Z, r, x, y, z;
    Pair excess;
} FromEye;

INLINE FromEye from_eye(
    const REAL X, const REAL Y, const REAL Z, const REAL r, const double unit, const double4 eye, const double4 right,
    const double4 up, const double4 back
) {
    const Pair a = two_sum(X, -eye.x), b = two_sum(Y, -eye.y), c = two_sum(Z, -eye.z);
    FromEye s;
    const REAL off = doubt(a, b, c);
    REAL_INT unsure = 0;
    s.X = quick_product(right, a, b, c, off, &unsure);
    s.Y = quick_product(up, a, b, c, off, &unsure);
    s.Z = quick_product(back, a, b, c, off, &unsure);
    if (RARELY(ANY(TO_MASK(unsure != 0))))
        s.X = dot_product(right, a, b, c), s.Y = dot_product(up, a, b, c), s.Z = dot_product(back, a, b, c);
    s.x = s.X * unit, s.y = s.Y * unit, s.z = s.Z * unit, s.r = r;
    s.excess = square_excess(a, b, c, r);
    return s;
}

/* Which spheres may be seen at all: those that are not inside of another one. shell: centres of large spheres, and by how
 * much others must be inside; x, y, z: a sphere's place in the world, in the float buffers' unit. */
INLINE MASK is_outside(
    const REAL x, const REAL y, const REAL z, const REAL r, const double slack, const int shells,
    __global const double4 *restrict shell
) {
    MASK outside = TO_MASK(r == r);
    const REAL roomy = r + (16 * slack) * (1 + 1 / r);
    for (int k = 0; k < shells; k++) {
        const double4 outer = shell[k];
        const REAL X = x - outer.x;
        /* The root below is no less than this but for a rounding, and `roomy` is more than that. */
        if (!ANY(TO_MASK(fabs(X) < outer.w)))
            continue;
        const REAL Y = y - outer.y, Z = z - outer.z;
        outside &= TO_MASK(sqrt((X * X + Y * Y) + Z * Z) + roomy >= outer.w);
    }
    return outside;
}

/* A sphere in the picture. across, down: its edges; loose: see pixels_of(); ahead: whether any of it may be before the rays'
 * starts; near: the depth of its nearest point, at least. */
typedef struct {
    Slopes across, down;
    float loose;
    MASK ahead;
    FLOAT near;
} Disc;

/* As slopes; depths are squared distances. r, c: the radius, and |centre|^2 - radius^2, in the float buffers' unit. */
INLINE Disc disc_from_eye(const FromEye s, const REAL r, const REAL c) {
    const FLOAT x = TO_FLOAT(s.x), y = TO_FLOAT(s.y), z = TO_FLOAT(s.z), small = TO_FLOAT(r);
    const FLOAT gap = TO_FLOAT((s.z - r) * (s.z + r)), d = -z;
    const MASK clear = is_clear(d, gap);
    const FLOAT over = 1 / (clear ? gap : (FLOAT)1), forward = d * over, around = small * over;
    const Disc disc = {
        slopes(x, gap, forward, around, clear), slopes(-y, gap, forward, around, clear), 0,
        TO_MASK(s.z < r * (1 + SLACK)), nearest(length_of(x, y, z), small, c)
    };
    return disc;
}

/* Of parallel rays: as places on the plane where they start; depths are distances from there. */
INLINE Disc disc_along_view(const FromEye s, const REAL r) {
    const FLOAT x = TO_FLOAT(s.x), y = TO_FLOAT(s.y), small = TO_FLOAT(r);
    const REAL depth = -(s.z + r), size = fabs(s.z) + r;
    const Disc disc = {
        {x - small, x + small}, {-y - small, small - y}, (float)LOOSE,
        TO_MASK(s.z - r < SLACK * r + LOOSE), rounded_down(depth - SLACK * size - LOOSE)
    };
    return disc;
}

/* What is on which work-item's spheres: the largest coordinate or radius, in scene units; minus the least power of those that
 * are sure, in scene units, or, along the view, minus 0 if the plane where rays start may cut any, else minus 1; how many may be seen; how many of them are in the picture, how many cells of level 0 these
 * cover, and the last one of them. */
#define NOTES 6

/* unit: leads from scene units to the float buffers' unit; some_again, again: whether spheres are equal to one before
 * them, which is not seen; shells, shell, slack: see is_outside(); x_axis, y_axis, x_range, y_range: see pixels_of();
 * shift: a cell has 2^shift pixels a side; along: whether rays are parallel; keep_seen: whether to write the first three
 * columns of `seen`. */
__kernel void see_from_eye(
    const int n,
    const int pitch,
    const double unit,
    const double4 eye,
    const double4 right,
    const double4 up,
    const double4 back,
    const double slack,
    const int shells,
    const int some_again,
    const float4 x_axis,
    const float4 y_axis,
    const int2 x_range,
    const int2 y_range,
    const int shift,
    const int along,
    const int keep_seen,
    __global const double *restrict center,
    __global const double *restrict radius,
    __global const double4 *restrict shell,
    __global const char *restrict again,
    __global out4 *restrict center_radius,
    __global out2 *restrict power,
    __global double4 *restrict world,
    __global float4 *restrict eye_filter,
    __global double *restrict seen,
    __global char *restrict flags,
    __global short *restrict covers,
    __global float *restrict near,
    __global int *restrict unsure,
    __global double *restrict part
) {
    REAL most = 0, least = 1;
    LONG there = 0, members = 0, entries = 0;
    INT last = -1;
    FOR_EACH_PACKET(i, n) {
        FETCH_ROWS(center, 3, i);
        FETCH_ROWS(radius, 1, i);
        const Point place = point_of(center, n, i);
        const FromEye s = from_eye(place.x, place.y, place.z, column(radius, n, i), unit, eye, right, up, back);
        const REAL c = s.excess.hi * (unit * unit), small = s.r * unit;
        note_unsure(unsure, i, n, s.excess.lo);
        most = LARGER(LARGER(LARGER(most, s.r), fabs(s.X)), LARGER(fabs(s.Y), fabs(s.Z)));
        if (along)
            least = fabs(s.z) - small > SLACK * (fabs(s.z) + small) + LOOSE ? least : (REAL)0;
        else
            least = ((s.excess.lo == s.excess.lo) & (s.excess.hi < least)) ? s.excess.hi : least;
        if (keep_seen) {
            STORE_LANES(s.x, seen + i);
            STORE_LANES(s.y, seen + pitch + i);
            STORE_LANES(s.z, seen + 2L * pitch + i);
        }

        const FLOAT x = TO_FLOAT(s.x), y = TO_FLOAT(s.y), z = TO_FLOAT(s.z), r = TO_FLOAT(small);
        if (along)
            WRITE_ROWS_4(float, eye_filter, i, x, y, disc_filter(s.x, s.y, small, LOOSE), (FLOAT)0);
        else
            WRITE_ROWS_4(float, eye_filter, i, x, y, z, filter_constant(s.x, s.y, s.z, c));
#if OUT_BYTES == 4
        const REAL over_r = 1 / small, bounded = over_r < (REAL)FLT_MAX ? over_r : (REAL)FLT_MAX;
        WRITE_ROWS_4(float, center_radius, i, x, y, z, r);
        WRITE_ROWS_2(float, power, i, TO_FLOAT(c), TO_FLOAT(bounded));
#else
        WRITE_ROWS_4(double, center_radius, i, s.X, s.Y, s.Z, s.r);
        WRITE_ROWS_2(double, power, i, s.excess.hi, 1 / s.r);
        WRITE_ROWS_4(double, world, i, place.x, place.y, place.z, s.excess.lo);
#endif

        MASK visible = LANE < n - i;
        if (some_again) {
            int lane[W];
            for (int k = 0; k < W; k++)
                lane[k] = again[min(i + k, n - 1)];
            visible &= LOAD_LANES(lane) == 0;
        }
        if (shells)
            visible &= is_outside(place.x * unit, place.y * unit, place.z * unit, small, slack, shells, shell);
        store_flags(visible ? (INT)VISIBLE : (INT)0, flags + i);
        there += TO_LONG(visible ? (INT)1 : (INT)0);

        const Disc disc = along ? disc_along_view(s, small) : disc_from_eye(s, small, c);
        const Run row = pixels_of(disc.across, disc.loose, x_axis, x_range, shift);
        const Run rows = pixels_of(disc.down, disc.loose, y_axis, y_range, shift);
        visible &= disc.ahead & row.any & rows.any;
        store_short(row.begin, covers + i);
        store_short(rows.begin, covers + pitch + i);
        store_short(row.more, covers + 2L * pitch + i);
        store_short(rows.more, covers + 3L * pitch + i);
        STORE_LANES(visible ? disc.near : (FLOAT)INFINITY, near + i);
        members += TO_LONG(visible ? (INT)1 : (INT)0);
        last = visible ? i + LANE : last;
        entries += TO_LONG(visible ? (row.more + 1) * (rows.more + 1) : (INT)0);
    }
    __global double *note = part + NOTES * get_global_id(0);
    note[0] = largest_lane(most), note[1] = largest_lane(-least), note[2] = sum_of_lanes(there);
    note[3] = sum_of_lanes(members), note[4] = sum_of_lanes(entries), note[5] = LARGEST(last);
}

/* What follows from |centre|^2 - radius^2 = hi + lo, in scene units, of `count` spheres of these indices. along: see
 * see_from_eye(). */
__kernel void mend_eye(
    const int count,
    const int along,
    const double unit,
    const double4 eye,
    const double4 right,
    const double4 up,
    const double4 back,
    __global const int *restrict index,
    __global const double *restrict hi,
    __global const double *restrict lo,
    __global const double *restrict center,
    __global const double *restrict radius,
    __global out2 *restrict power,
    __global double4 *restrict world,
    __global float4 *restrict eye_filter,
    __global float *restrict near
) {
    FOR_EACH_PACKET(i, count) {
        double place[4][W], value[W];
        for (int k = 0; k < W; k++) {
            const int j = min(i + k, count - 1);
            for (int x = 0; x < 3; x++)
                place[x][k] = center[3L * index[j] + x];
            place[3][k] = radius[index[j]], value[k] = hi[j];
        }
        const FromEye s = from_eye(
            LOAD_LANES(place[0]), LOAD_LANES(place[1]), LOAD_LANES(place[2]), LOAD_LANES(place[3]), unit, eye, right, up,
            back
        );
        const REAL c = LOAD_LANES(value) * (unit * unit);
        const FLOAT x = TO_FLOAT(s.x), y = TO_FLOAT(s.y), z = TO_FLOAT(s.z);
        float filter[W], depth[W];
        double small[W];
        STORE_LANES(filter_constant(s.x, s.y, s.z, c), filter);
        STORE_LANES(nearest(length_of(x, y, z), TO_FLOAT(s.r * unit), c), depth);
        STORE_LANES(c, small);
        for (int k = 0; k < W && i + k < count; k++) {
            const int at = index[i + k];
            if (!along) {
                eye_filter[at].w = filter[k];
                near[at] = near[at] < INFINITY ? depth[k] : near[at];
            }
#if OUT_BYTES == 4
            power[at].x = (float)small[k];
#else
            power[at].x = value[k], world[at].w = lo[i + k];
#endif
        }
    }
}

/* Of every stride-th sphere, the depth, and how many tiles it covers beside one, across and down. */
__kernel void sample_covers(
    const int n,
    const int pitch,
    const int stride,
    __global const short *restrict covers,
    __global const float *restrict near,
    __global float *restrict sample
) {
    FOR_EACH_SPHERE(k, (n - 1) / stride + 1) {
        const int i = k * stride;
        sample[3 * k] = near[i], sample[3 * k + 1] = covers[2L * pitch + i], sample[3 * k + 2] = covers[3L * pitch + i];
    }
}

#if OUT_BYTES == 8
/* The first and the last tile that the square in a sphere's disc covers along one axis, at most so many. place, reach: its
 * middle and half of its side, in pixels; cells: how many tiles there are. */
INLINE int2 covered_tiles(const double place, const double reach, const int cells, const int shift, const int most) {
    const int begin = (int)clamp(ceil(place - reach), 0.0, (double)(cells << shift));
    const int end = (int)clamp(floor(place + reach), -1.0, (double)((cells << shift) - 1));
    const int first = (begin + (1 << shift) - 1) >> shift;
    return (int2)(first, min(((end + 1) >> shift) - 1, first + most - 1));
}

/* Squared distances within which each ray of a tile has met a sphere: behind() of tiles.py. x_axis, y_axis: what leads from
 * slopes to pixels, and the middle of the picture, in pixels; square, most: SQUARE and MOST there; front: how deep the
 * nearest points of those spheres are, at most, that are looked at. */
__kernel void cover_tiles(
    const int n,
    const int pitch,
    const double unit,
    const double2 x_axis,
    const double2 y_axis,
    const int2 cells,
    const int shift,
    const double square,
    const int most,
    const float front,
    __global const double4 *restrict center_radius,
    __global const double2 *restrict power,
    __global const short *restrict covers,
    __global const float *restrict near,
    volatile __global int *behind
) {
    FOR_EACH_SPHERE(i, n) {
        if (!(near[i] <= front && near[i] < INFINITY) || min(covers[2L * pitch + i], covers[3L * pitch + i]) < 1)
            continue;
        const double4 s = center_radius[i];
        const double x = s.x * unit, y = -(s.y * unit), d = -(s.z * unit), r = s.w * unit, p = power[i].x * (unit * unit);
        if (!(d > r && p > 0))
            continue;
        const double reach = r * square / d;
        const int2 across = covered_tiles(x / d * x_axis.x + x_axis.y, reach * x_axis.x, cells.x, shift, most);
        const int2 down = covered_tiles(y / d * y_axis.x + y_axis.y, reach * y_axis.x, cells.y, shift, most);
        const float near_p = (float)p, far = near_p < p ? as_float(as_int(near_p) + 1) : near_p;
        for (int row = down.x; row <= down.y; row++)
            for (int cell = row * cells.x + across.x; cell <= row * cells.x + across.y; cell++)
                if (far < as_float(behind[cell]))
                    atomic_min(behind + cell, as_int(far));
    }
}
#endif
#endif

/* behind.cl: how deep tiles are that a sphere covers, of which lists lack what is behind it: accel/discs.py of
 * cltrace/plan, with the same arithmetic; and which spheres the few pixels of a coarse picture may show. The buffers
 * that are packed are doubles.
 */

/* Of every stride-th sphere, the depth, and how many tiles it covers beside one, across and down. */
__kernel void sample_covers(const int n, const int pitch, const int stride, __global const short *restrict covers,
                            __global const float *restrict near, __global float *restrict sample) {
    FOR_EACH_SPHERE(k, (n - 1) / stride + 1) {
        const int i = k * stride;
        sample[3 * k] = near[i], sample[3 * k + 1] = covers[2L * pitch + i], sample[3 * k + 2] = covers[3L * pitch + i];
    }
}

/* The first and the last tile that the square in a sphere's disc covers along one axis, at most so many. ends: of the
 * square, in pixels; cells: how many tiles there are. */
INLINE int2 covered_tiles(const double2 ends, const int cells, const int shift, const int most) {
    const int begin = (int)clamp(ceil(ends.x), 0.0, (double)(cells << shift));
    const int end = (int)clamp(floor(ends.y), -1.0, (double)((cells << shift) - 1));
    const int first = (begin + (1 << shift) - 1) >> shift;
    return (int2)(first, min(((end + 1) >> shift) - 1, first + most - 1));
}

/* Squared distances within which each ray of a tile has met a sphere: behind() of discs.py. x_axis, y_axis: what leads
 * from slopes to pixels, and the middle of the picture, in pixels; square, most: SQUARE and MOST there; front: how deep
 * the nearest points of those spheres are, at most, that are looked at. */
__kernel void cover_tiles(const int n, const int pitch, const double unit, const double2 x_axis, const double2 y_axis,
                          const int2 cells, const int shift, const double square, const int most, const float front,
                          __global const double4 *restrict center_radius, __global const double2 *restrict power,
                          __global const short *restrict covers, __global const float *restrict near,
                          volatile __global int *behind) {
    FOR_EACH_MEMBER(i, n) {
        if (near[i] > front || min(covers[2L * pitch + i], covers[3L * pitch + i]) < 1) continue;
        const double4 s = center_radius[i];
        const double x = s.x * unit, y = -(s.y * unit), d = -(s.z * unit), r = s.w * unit,
                     p = power[i].x * (unit * unit);
        if (!(d > r && p > 0)) continue;
        const double2 scale = (double2)(x_axis.x, y_axis.x), reach = r * square / d * scale,
                      middle = (double2)(x, y) / d * scale + (double2)(x_axis.y, y_axis.y), low = middle - reach,
                      high = middle + reach;
        const int2 across = covered_tiles((double2)(low.x, high.x), cells.x, shift, most),
                   down = covered_tiles((double2)(low.y, high.y), cells.y, shift, most);
        const float near_p = (float)p, far = near_p < p ? as_float(as_int(near_p) + 1) : near_p;
        for (int row = down.x; row <= down.y; row++)
            for (int cell = row * cells.x + across.x; cell <= row * cells.x + across.y; cell++)
                if (far < as_float(behind[cell])) atomic_min(behind + cell, as_int(far));
    }
}

/* Squared distances between which the ray of a pixel meets a sphere first, in the float buffers' unit: NaN if it misses
 * it, 0 and infinity if that is not known. s: centre and radius, c: |centre|^2 - radius^2, in scene units; slope: of
 * the ray, across and down.
 *
 * With u = 2^-53 and a = d.d, b and the discriminant D = b^2 - a c are off by a few u of sqrt(a) |C| and of a |C|^2:
 * `off` is 2^10 times more. Where c is above 2^-20 of |C|^2, b is at least 2^-10 sqrt(a) |C| where D may be positive,
 * so its sign is right, and c / (b + root) is off by no more than its root is, for which both ends have D moved by
 * `off`, and by 2^-38 of itself: 2^-36 of its square is more. */
INLINE double2 met_between(const double4 s, const double c, const double2 slope, const double unit) {
    const double a = 1 + (slope.x * slope.x + slope.y * slope.y), b = (s.x * slope.x - s.y * slope.y) - s.z,
                 size = a * (c + 2 * (s.w * s.w)), off = 0x1p-40 * size, D = b * b - a * c;
    if (!(a * c > 0x1p-20 * size)) return (double2)(0, INFINITY);
    if (b < 0 || D < -off) return (double2)(NAN, NAN);
    const double near = c / (b + sqrt(D + off)) * unit, far = c / (b + sqrt(fmax(D - off, 0.0))) * unit;
    return (double2)(near * near * (a * (1 - 0x1p-36)), D > off ? far * far * (a * (1 + 0x1p-36)) : INFINITY);
}

/* The ray of a pixel, across and down. x_axis, y_axis: how wide a pixel is, and the middle of the picture, in pixels.
 */
INLINE double2 slope_of(const int column, const int row, const double2 x_axis, const double2 y_axis) {
    return (double2)((column - x_axis.y) * x_axis.x, (row - y_axis.y) * y_axis.x);
}

/* The pixels that a sphere covers, where `covers` counts these: the first column and row, and the last ones. */
INLINE int4 box_of(__global const short *covers, const int pitch, const int i) {
    const int left = covers[i], top = covers[pitch + i];
    return (int4)(left, top, left + covers[2L * pitch + i], top + covers[3L * pitch + i]);
}

INLINE int pixels_in(const int4 box) {
    return (box.z - box.x + 1) * (box.w - box.y + 1);
}

/* Squared distances within which the ray of each pixel has met a sphere, of those that cover `most` pixels or fewer and
 * whose indices `stride` divides. region: what `behind` has of the picture: x, y, width, height. */
__kernel void cover_pixels(const int n, const int pitch, const double unit, const double2 x_axis, const double2 y_axis,
                           const int4 region, const int most, const int stride,
                           __global const double4 *restrict center_radius, __global const double2 *restrict power,
                           __global const short *restrict covers, __global const float *restrict near,
                           volatile __global int *behind) {
    FOR_EACH_MEMBER(i, n) {
        if (i % stride) continue;
        const float depth = near[i];
        const int4 box = box_of(covers, pitch, i);
        if (pixels_in(box) > most) continue;
        for (int row = box.y; row <= box.w; row++)
            for (int column = box.x; column <= box.z; column++) {
                volatile __global int *pixel = behind + (row - region.y) * region.z + column - region.x;
                if (depth > as_float(*pixel)) continue;
                const double2 slope = slope_of(column, row, x_axis, y_axis);
                const float far = (float)met_between(center_radius[i], power[i].x, slope, unit).y;
                if (far < as_float(*pixel)) atomic_min(pixel, as_int(far));
            }
    }
}

/* Leaves spheres out that no pixel shows, and has `covers` count cells of 2^shift pixels a side. For each work-item,
 * three numbers: how many spheres are left, how many cells these cover, and the last one of them. */
__kernel void sift(const int n, const int pitch, const double unit, const double2 x_axis, const double2 y_axis,
                   const int4 region, const int most, const int shift, __global const double4 *restrict center_radius,
                   __global const double2 *restrict power, __global const float *restrict behind,
                   __global short *restrict covers, __global float *restrict near, __global long *restrict part) {
    long members = 0, entries = 0, last = -1;
    FOR_EACH_MEMBER(i, n) {
        const float depth = near[i];
        const int4 box = box_of(covers, pitch, i);
        int seen = pixels_in(box) > most;
        for (int row = box.y; row <= box.w && !seen; row++)
            for (int column = box.x; column <= box.z && !seen; column++) {
                const float within = behind[(row - region.y) * region.z + column - region.x];
                const double2 slope = slope_of(column, row, x_axis, y_axis);
                seen = depth <= within && (float)met_between(center_radius[i], power[i].x, slope, unit).x <= within;
            }
        near[i] = seen ? depth : INFINITY;
        if (!seen) continue;
        const int4 cells = box >> shift;
        covers[i] = cells.x, covers[pitch + i] = cells.y;
        covers[2L * pitch + i] = cells.z - cells.x, covers[3L * pitch + i] = cells.w - cells.y;
        members++, entries += pixels_in(cells), last = i;
    }
    part[3 * get_global_id(0)] = members, part[3 * get_global_id(0) + 1] = entries;
    part[3 * get_global_id(0) + 2] = last;
}

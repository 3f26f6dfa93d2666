/* behind.cl: how deep tiles are that a sphere covers, of which lists lack what is behind it: accel/discs.py of
 * cltrace/plan, with the same arithmetic. The buffers that are packed are doubles.
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
    FOR_EACH_SPHERE(i, n) {
        if (!(near[i] <= front && near[i] < INFINITY) || min(covers[2L * pitch + i], covers[3L * pitch + i]) < 1)
            continue;
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

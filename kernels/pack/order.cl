/* order.cl: the order of spheres in memory, as cltrace/plan/order.py makes it: each one's key has the bits of its
 * coordinates in turn, then its index. Keys are sorted digit by digit, from the lowest one that is no part of an index:
 * each work-item counts the digits of one part of the keys, and moves these to where its own ones of that digit belong.
 */
#define DIGIT_BITS 11
#define DIGIT_VALUES (1 << DIGIT_BITS)

/* A coordinate of centres that are floats or, if `wide`, doubles. */
INLINE double coordinate(__global const char *center, const int wide, const long k) {
    return wide ? ((__global const double *)center)[k] : ((__global const float *)center)[k];
}

/* For each work-item, six numbers: minus the least and the largest of each coordinate. */
__kernel void ends(const int n, const int wide, __global const char *restrict center, __global double *restrict part) {
    double most[6];
    for (int k = 0; k < 6; k++) most[k] = -INFINITY;
    FOR_EACH_SPHERE(i, n)
    for (int k = 0; k < 3; k++) {
        const double x = coordinate(center, wide, 3L * i + k);
        most[2 * k] = fmax(most[2 * k], -x), most[2 * k + 1] = fmax(most[2 * k + 1], x);
    }
    for (int k = 0; k < 6; k++) part[6 * get_global_id(0) + k] = most[k];
}

/* The lowest 21 bits of x, each three places above the one before it. */
INLINE ulong spread(ulong x) {
    x = (x | x << 32) & 0x001f00000000ffffUL;
    x = (x | x << 16) & 0x001f0000ff0000ffUL;
    x = (x | x << 8) & 0x100f00f00f00f00fUL;
    x = (x | x << 4) & 0x10c30c30c30c30c3UL;
    return (x | x << 2) & 0x1249249249249249UL;
}

/* half_low: half of the least coordinates; scale: leads from half a distance from there to a whole number. */
__kernel void order_keys(const int n, const int wide, const int index_bits, const double4 half_low, const double scale,
                         __global const char *restrict center, __global ulong *restrict key) {
    const double low[3] = {half_low.x, half_low.y, half_low.z};
    FOR_EACH_SPHERE(i, n) {
        ulong bits = 0;
        for (int k = 0; k < 3; k++)
            bits |= spread((ulong)(int)((coordinate(center, wide, 3L * i + k) * 0.5 - low[k]) * scale)) << k;
        key[i] = bits << index_bits | i;
    }
}

/* How many keys of each work-item have each digit. */
__kernel void count_digits(const int n, const int shift, __global const ulong *restrict key,
                           __global int *restrict count) {
    __global int *own = count + get_global_id(0) * DIGIT_VALUES;
    for (int digit = 0; digit < DIGIT_VALUES; digit++) own[digit] = 0;
    FOR_EACH_SPHERE(i, n)
    own[key[i] >> shift & (DIGIT_VALUES - 1)]++;
}

/* Of some rows of counts: where each one's first key of each digit belongs. For one work-item. */
__kernel void start_digits(const int rows, __global int *restrict count) {
    if (get_global_id(0)) return;
    int total = 0;
    for (int digit = 0; digit < DIGIT_VALUES; digit++)
        for (int row = 0; row < rows; row++) {
            const int more = count[row * DIGIT_VALUES + digit];
            count[row * DIGIT_VALUES + digit] = total;
            total += more;
        }
}

/* Moves each key to its place. */
__kernel void move_keys(const int n, const int shift, __global const ulong *restrict key, __global int *restrict next,
                        __global ulong *restrict moved) {
    __global int *own = next + get_global_id(0) * DIGIT_VALUES;
    FOR_EACH_SPHERE(i, n)
    moved[own[key[i] >> shift & (DIGIT_VALUES - 1)]++] = key[i];
}

__kernel void indices(const int n, const ulong mask, __global const ulong *restrict key, __global int *restrict index) {
    FOR_EACH_SPHERE(i, n)
    index[i] = key[i] & mask;
}

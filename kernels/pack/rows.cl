/* rows.cl: how the kernels that pack go through n spheres: a work-item takes one packet of W of them after the other.
 *
 * Arrays that kernels write have room for whole packets. The lanes of the last packet that are beyond n do the last
 * sphere again, and count in no statistics.
 */

/* Where the part of n rows begins that a work-item has if these are dealt out in a row, `step` of them together. */
INLINE int part_of(const int n, const int step, const ulong item) {
    return step * (int)(item * ((n + step - 1L) / step) / get_global_size(0));
}
#define FOR_EACH_OF_PART(i, n, step)                                                                            \
    for (int i = part_of(n, step, get_global_id(0)), stop_ = part_of(n, step, get_global_id(0) + 1); i < stop_; \
         i += step)

/* Packets that are read one after the other come from memory faster on a CPU; on a GPU neighbouring work-items should
 * read what is side by side. */
#if W == 1
#define FOR_EACH_PACKET(i, n) for (int i = get_global_id(0); i < n; i += get_global_size(0))
#define FOR_EACH_SPHERE FOR_EACH_PACKET
#else
#define FOR_EACH_PACKET(i, n) FOR_EACH_OF_PART(i, n, W)
#define FOR_EACH_SPHERE(i, n) FOR_EACH_OF_PART(i, n, 1)
#endif

/* Those of n spheres whose depth, in `near`, is not infinite. Where they are few, most packets have none. */
#define FOR_EACH_MEMBER(i, n)                               \
    FOR_EACH_PACKET(packet_, n)                             \
    if (ANY(LOAD_LANES(near + packet_) < INFINITY))         \
        for (int i = packet_; i < min(packet_ + W, n); i++) \
            if (near[i] < INFINITY)

#define LANE (LANE_COLUMN + 4 * LANE_ROW)
#define LARGER(a, b) ((a) > (b) ? (a) : (b))

/* What is in a column of n numbers from row i on; beyond the last one, that again. */
INLINE REAL column(__global const double *table, const int n, const int i) {
    if (i + W <= n) return LOAD_LANES(table + i);
    double lane[W];
    for (int k = 0; k < W; k++) lane[k] = table[min(i + k, n - 1)];
    return LOAD_LANES(lane);
}

/* The same of three columns, side by side. */
INLINE Real3 point_of(__global const double *table, const int n, const int i) {
    double lane[3][W];
    for (int k = 0; k < W; k++)
        for (int column = 0; column < 3; column++) lane[column][k] = table[3L * min(i + k, n - 1) + column];
    const Real3 p = {LOAD_LANES(lane[0]), LOAD_LANES(lane[1]), LOAD_LANES(lane[2])};
    return p;
}

/* WRITE_ROWS: rows of two or four numbers, of which each vector has one. */
#define WRITE_ROWS_2(type, table, i, a, b) \
    do {                                   \
        type a_[W], b_[W];                 \
        STORE_LANES(a, a_);                \
        STORE_LANES(b, b_);                \
        for (int k = 0; k < W; k++) {      \
            (table)[(i) + k].x = a_[k];    \
            (table)[(i) + k].y = b_[k];    \
        }                                  \
    } while (0)
#define WRITE_ROWS_4(type, table, i, a, b, c, d) \
    do {                                         \
        type a_[W], b_[W], c_[W], d_[W];         \
        STORE_LANES(a, a_);                      \
        STORE_LANES(b, b_);                      \
        STORE_LANES(c, c_);                      \
        STORE_LANES(d, d_);                      \
        for (int k = 0; k < W; k++) {            \
            (table)[(i) + k].x = a_[k];          \
            (table)[(i) + k].y = b_[k];          \
            (table)[(i) + k].z = c_[k];          \
            (table)[(i) + k].w = d_[k];          \
        }                                        \
    } while (0)

/* The largest lane, and the sum of all. */
INLINE double largest_lane(const REAL x) {
    double lane[W], most = -INFINITY;
    STORE_LANES(x, lane);
    for (int k = 0; k < W; k++) most = lane[k] > most ? lane[k] : most;
    return most;
}

INLINE long sum_of_lanes(const LONG x) {
    long lane[W], sum = 0;
    STORE_LANES(x, lane);
    for (int k = 0; k < W; k++) sum += lane[k];
    return sum;
}

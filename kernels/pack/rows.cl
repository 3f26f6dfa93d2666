/* rows.cl: how the kernels that pack go through n spheres: a work-item takes one packet of W of them after the other.
 *
 * Arrays that kernels write have room for whole packets. The lanes of the last packet that are beyond n do the last
 * sphere again, and count in no statistics.
 */

/* Packets that are read one after the other come from memory faster on a CPU; on a GPU neighbouring work-items should
 * read what is side by side. */
#if W == 1
#define FOR_EACH_PACKET(i, n) for (int i = get_global_id(0); i < n; i += get_global_size(0))
#else
#define FOR_EACH_PACKET(i, n)                                                                              \
    for (int i = W * (int)(get_global_id(0) * (((n) + W - 1L) / W) / get_global_size(0)),                  \
             stop_ = W * (int)((get_global_id(0) + 1) * (((n) + W - 1L) / W) / get_global_size(0));        \
         i < stop_; i += W)
#endif

#if W == 1
#define FOR_EACH_SPHERE(i, n) for (int i = get_global_id(0); i < n; i += get_global_size(0))
#else
#define FOR_EACH_SPHERE(i, n)                                                       \
    for (int i = (long)(n) * get_global_id(0) / get_global_size(0),                 \
             stop_ = (long)(n) * (get_global_id(0) + 1) / get_global_size(0);       \
         i < stop_; i++)
#endif

#define LANE (LANE_COLUMN + 4 * LANE_ROW)
#define LARGER(a, b) ((a) > (b) ? (a) : (b))

/* One column of rows of `width` numbers, from row i on. */
INLINE REAL column(__global const double *table, const int width, const int n, const int i) {
    double lane[W];
    for (int k = 0; k < W; k++)
        lane[k] = table[width * (long)min(i + k, n - 1)];
    return LOAD_LANES(lane);
}

/* The largest and the smallest lane, and the sum of all. */
INLINE double largest_lane(const REAL x) {
    double lane[W], most = -INFINITY;
    STORE_LANES(x, lane);
    for (int k = 0; k < W; k++)
        most = lane[k] > most ? lane[k] : most;
    return most;
}

INLINE long sum_of_lanes(const LONG x) {
    long lane[W], sum = 0;
    STORE_LANES(x, lane);
    for (int k = 0; k < W; k++)
        sum += lane[k];
    return sum;
}

/* Rows are written one number after the other. */
#define WRITE_ROWS_2(type, table, i, a, b)            \
    do {                                              \
        type a_[W], b_[W];                            \
        STORE_LANES(a, a_);                           \
        STORE_LANES(b, b_);                           \
        for (int k = 0; k < W; k++) {                 \
            (table)[(i) + k].x = a_[k];               \
            (table)[(i) + k].y = b_[k];               \
        }                                             \
    } while (0)
#define WRITE_ROWS_4(type, table, i, a, b, c, d)      \
    do {                                              \
        type a_[W], b_[W], c_[W], d_[W];              \
        STORE_LANES(a, a_);                           \
        STORE_LANES(b, b_);                           \
        STORE_LANES(c, c_);                           \
        STORE_LANES(d, d_);                           \
        for (int k = 0; k < W; k++) {                 \
            (table)[(i) + k].x = a_[k];               \
            (table)[(i) + k].y = b_[k];               \
            (table)[(i) + k].z = c_[k];               \
            (table)[(i) + k].w = d_[k];               \
        }                                             \
    } while (0)

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

/* What is in a column of n numbers from row i on; beyond the last one, that again. */
INLINE REAL column(__global const double *table, const int n, const int i) {
    if (i + W <= n)
        return LOAD_LANES(table + i);
    double lane[W];
    for (int k = 0; k < W; k++)
        lane[k] = table[min(i + k, n - 1)];
    return LOAD_LANES(lane);
}

/* The same of three columns, side by side. */
typedef struct {
    REAL x, y, z;
} Point;

INLINE Point point_of(__global const double *table, const int n, const int i) {
    Point p;
#if W == 8
    if (i + W <= n) {
        __global const double *row = table + 3L * i;
        const double8 a = vload8(0, row), b = vload8(1, row), c = vload8(2, row);
        p.x = (double8)(a.s036, b.s147, c.s25);
        p.y = (double8)(a.s147, b.s25, c.s036);
        p.z = (double8)(a.s25, b.s036, c.s147);
        return p;
    }
#endif
    double lane[3][W];
    for (int k = 0; k < W; k++)
        for (int column = 0; column < 3; column++)
            lane[column][k] = table[3L * min(i + k, n - 1) + column];
    p.x = LOAD_LANES(lane[0]), p.y = LOAD_LANES(lane[1]), p.z = LOAD_LANES(lane[2]);
    return p;
}

/* Fetches the rows, of `width` numbers, that will be read some packets after row i: by itself, a CPU does not look into
 * the next page of memory. */
#ifdef FETCH
#define FAR (8L * W)
#define FETCH_ROWS(table, width, i)                                       \
    for (int k_ = 0; k_ < (width) * W; k_ += 64 / (int)sizeof(*(table)))  \
        FETCH(table, (width) * ((i) + FAR) + k_)
#else
#define FETCH_ROWS(table, width, i)
#endif

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

/* Rows of two or four numbers, of which each vector has one. */
#if W == 8 && defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define ZIPPED(type, a, b, half)                                                                                   \
    __builtin_shufflevector((PASTE(type, 8))(a), (PASTE(type, 8))(b), half, 8 + half, half + 1, 9 + half,          \
                            half + 2, 10 + half, half + 3, 11 + half)
#define JOINED(a, b, half) \
    __builtin_shufflevector(a, b, half, half + 1, half + 8, half + 9, half + 2, half + 3, half + 10, half + 11)
#define WRITE_ROWS_2(type, table, i, a, b)                                                                         \
    do {                                                                                                           \
        __global type *row_ = (__global type *)((table) + (i));                                                    \
        vstore8(ZIPPED(type, a, b, 0), 0, row_);                                                                   \
        vstore8(ZIPPED(type, a, b, 4), 1, row_);                                                                   \
    } while (0)
#define WRITE_ROWS_4(type, table, i, a, b, c, d)                                                                   \
    do {                                                                                                           \
        __global type *row_ = (__global type *)((table) + (i));                                                    \
        const PASTE(type, 8) a_ = ZIPPED(type, a, b, 0), b_ = ZIPPED(type, c, d, 0);                               \
        const PASTE(type, 8) c_ = ZIPPED(type, a, b, 4), d_ = ZIPPED(type, c, d, 4);                               \
        vstore8(JOINED(a_, b_, 0), 0, row_);                                                                       \
        vstore8(JOINED(a_, b_, 4), 1, row_);                                                                       \
        vstore8(JOINED(c_, d_, 0), 2, row_);                                                                       \
        vstore8(JOINED(c_, d_, 4), 3, row_);                                                                       \
    } while (0)
#endif
#endif
#ifndef WRITE_ROWS_2
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
#endif

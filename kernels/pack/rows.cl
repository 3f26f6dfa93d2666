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
INLINE Real3 any_point_of(__global const double *table, const int n, const int i) {
    double lane[3][W];
    for (int k = 0; k < W; k++)
        for (int column = 0; column < 3; column++) lane[column][k] = table[3L * min(i + k, n - 1) + column];
    const Real3 p = {LOAD_LANES(lane[0]), LOAD_LANES(lane[1]), LOAD_LANES(lane[2])};
    return p;
}

/* WRITE_ROWS: rows of two or four numbers, of which each vector has one. */
#if W == 8
INLINE Real3 point_of(__global const double *table, const int n, const int i) {
    if (i + W > n) return any_point_of(table, n, i);
    __global const double *row = table + 3L * i;
    const double8 a = vload8(0, row), b = vload8(1, row), c = vload8(2, row);
    const Real3 p = {(double8)(a.s036, b.s147, c.s25), (double8)(a.s147, b.s25, c.s036),
                     (double8)(a.s25, b.s036, c.s147)};
    return p;
}
#define LOW_PAIRS(a, b) (a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3)
#define HIGH_PAIRS(a, b) (a.s4, b.s4, a.s5, b.s5, a.s6, b.s6, a.s7, b.s7)
#define WRITE_ROWS_2(type, table, i, a, b)                      \
    do {                                                        \
        const PASTE(type, 8) a_ = a, b_ = b;                    \
        __global type *row_ = (__global type *)((table) + (i)); \
        vstore8((PASTE(type, 8))LOW_PAIRS(a_, b_), 0, row_);    \
        vstore8((PASTE(type, 8))HIGH_PAIRS(a_, b_), 1, row_);   \
    } while (0)
#define WRITE_ROWS_4(type, table, i, a, b, c, d)                                                               \
    do {                                                                                                       \
        const PASTE(type, 8) a_ = a, b_ = b, c_ = c, d_ = d;                                                   \
        __global type *row_ = (__global type *)((table) + (i));                                                \
        const PASTE(type, 8) p_ = (PASTE(type, 8))LOW_PAIRS(a_, b_), q_ = (PASTE(type, 8))LOW_PAIRS(c_, d_);   \
        const PASTE(type, 8) r_ = (PASTE(type, 8))HIGH_PAIRS(a_, b_), s_ = (PASTE(type, 8))HIGH_PAIRS(c_, d_); \
        vstore8((PASTE(type, 8))(p_.s01, q_.s01, p_.s23, q_.s23), 0, row_);                                    \
        vstore8((PASTE(type, 8))(p_.s45, q_.s45, p_.s67, q_.s67), 1, row_);                                    \
        vstore8((PASTE(type, 8))(r_.s01, s_.s01, r_.s23, s_.s23), 2, row_);                                    \
        vstore8((PASTE(type, 8))(r_.s45, s_.s45, r_.s67, s_.s67), 3, row_);                                    \
    } while (0)
#else
#define point_of any_point_of
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
#endif

/* Fetches the rows, of `width` numbers, that will be read some packets after row i: by itself, a CPU does not look into
 * the next page of memory. */
#ifdef FETCH
#define FAR (8L * W)
#define FETCH_ROWS(table, width, i) \
    for (int k_ = 0; k_ < (width) * W; k_ += 64 / (int)sizeof(*(table))) FETCH(table, (width) * ((i) + FAR) + k_)
#else
#define FETCH_ROWS(table, width, i)
#endif

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

/* rows.cl: sums that must not cancel, and how the kernels that pack go through n spheres. */

/* Sums that must not cancel, as cltrace/plan/rounding.py makes them: the same terms in the same order. */

/* Functions that compilers find too long to inline would have their vectors passed through memory. */
#define INLINE static inline __attribute__((always_inline))

/* A sum of terms so far: hi + low + lower. */
typedef struct {
    REAL hi, low, lower;
} Sum;

/* Of a product, hi is hi + lo rounded, so that to add one to the other changes neither. */
INLINE Sum sum_of(const Pair product) {
    const Sum sum = {product.hi, product.lo, 0};
    return sum;
}

INLINE Sum with_term(const Sum s, const REAL term) {
    const Pair hi = two_sum(s.hi, term), low = two_sum(s.low, hi.lo);
    const Sum sum = {hi.hi, low.hi, s.lower + low.lo};
    return sum;
}

INLINE Sum with_pair(const Sum s, const Pair a) {
    return with_term(with_term(s, a.hi), a.lo);
}

INLINE Pair total(const Sum s) {
    const Pair hi = two_sum(s.hi, s.low);
    return two_sum(hi.hi, hi.lo + s.lower);
}

/* v along an axis. A zero of the axis adds zeros, which numpy leaves out: they change no bit. */
INLINE REAL dot_product(const double4 axis, const Pair3 v) {
    const Sum a = with_term(sum_of(two_product(axis.x, v.x.hi)), axis.x * v.x.lo);
    const Sum b = with_term(with_pair(a, two_product(axis.y, v.y.hi)), axis.y * v.y.lo);
    const Sum c = with_term(with_pair(b, two_product(axis.z, v.z.hi)), axis.z * v.z.lo);
    return total(c).hi;
}

/* |v|^2 - r^2, a pair. Where its terms cancel too far, `lo` is nan: the host sums those again. */
INLINE Pair square_excess(const Pair3 v, const REAL r) {
    const Pair x = v.x, y = v.y, z = v.z, square = two_product(r, r);
    const Sum a = with_term(sum_of(two_product(x.hi, x.hi)), 2 * x.hi * x.lo);
    const Sum b = with_term(with_pair(a, two_product(y.hi, y.hi)), 2 * y.hi * y.lo);
    const Sum c = with_term(with_pair(b, two_product(z.hi, z.hi)), 2 * z.hi * z.lo);
    Pair excess = total(with_term(with_term(c, -square.hi), -square.lo));
    const REAL share = ((x.lo == 0) & (y.lo == 0) & (z.lo == 0)) ? (REAL)0x1p-44 : (REAL)0x1p-2;
    const REAL least = share * (((x.hi * x.hi + y.hi * y.hi) + z.hi * z.hi) + square.hi);
    excess.lo = fabs(excess.hi) < least ? (REAL)NAN : excess.lo;
    return excess;
}

/* How the kernels that pack go through n spheres: a work-item takes one packet of W of them after the other.
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

/* sums.cl: sums that must not cancel, as cltrace/plan/rounding.py makes them: the same terms in the same order. */

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

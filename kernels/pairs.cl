/* pairs.cl: double-double arithmetic, for the few decisions of which even double is unsure.
 *
 * A pair is the unevaluated sum hi + lo with |lo| <= 2^-53 |hi|, about 106 bits. The operations are those of Dekker
 * 1971 and of Ogita, Rump and Oishi 2005. Their errors are a few 2^-104 of the result.
 */
#if REAL_BYTES == 8 || defined(WITH_PLANES)
typedef struct {
    REAL hi, lo;
} Pair;
typedef struct {
    Pair x, y, z;
} Pair3;

static Pair two_sum(const REAL a, const REAL b) {
    const REAL s = a + b, t = s - a;
    const Pair sum = {s, (a - (s - t)) + (b - t)};
    return sum;
}

static Pair two_product(const REAL a, const REAL b) {
    const REAL p = a * b;
    const Pair product = {p, fma(a, b, -p)};
    return product;
}

static Pair plus(const Pair a, const Pair b) {
    const Pair s = two_sum(a.hi, b.hi), e = two_sum(a.lo, b.lo), sum = two_sum(s.hi, s.lo + e.hi);
    return two_sum(sum.hi, sum.lo + e.lo);
}

static Pair minus(const Pair a, const Pair b) {
    const Pair negative = {-b.hi, -b.lo};
    return plus(a, negative);
}

static Pair times(const Pair a, const Pair b) {
    const Pair p = two_product(a.hi, b.hi);
    return two_sum(p.hi, p.lo + (a.hi * b.lo + a.lo * b.hi));
}

static Pair over(const Pair a, const Pair b) {
    const Pair q = {a.hi / b.hi, 0};
    const Pair rest = minus(a, times(q, b));
    return two_sum(q.hi, (rest.hi + rest.lo) / b.hi);
}

static Pair pair(const REAL hi, const REAL lo) {
    const Pair p = {hi, lo};
    return p;
}

/* The sign in each lane, -1, 0 or 1; 0 of what is within its error. */
static REAL sign_from(const REAL value, const REAL error) {
    return value > error ? (REAL)1 : value < -error ? (REAL)-1 : (REAL)0;
}

static Pair dot_pairs(const Pair3 u, const Pair3 v) {
    return plus(plus(times(u.x, v.x), times(u.y, v.y)), times(u.z, v.z));
}

static Pair3 cross_pairs(const Pair3 u, const Pair3 v) {
    const Pair3 cross = {minus(times(u.y, v.z), times(u.z, v.y)), minus(times(u.z, v.x), times(u.x, v.z)),
                         minus(times(u.x, v.y), times(u.y, v.x))};
    return cross;
}

static Pair choose_pair(const REAL_MASK first, const Pair a, const Pair b) {
    const Pair c = {first ? a.hi : b.hi, first ? a.lo : b.lo};
    return c;
}

static Pair3 choose_pairs(const REAL_MASK first, const Pair3 a, const Pair3 b) {
    const Pair3 c = {{first ? a.x.hi : b.x.hi, first ? a.x.lo : b.x.lo},
                     {first ? a.y.hi : b.y.hi, first ? a.y.lo : b.y.lo},
                     {first ? a.z.hi : b.z.hi, first ? a.z.lo : b.z.lo}};
    return c;
}

/* Of numbers of which two are no pairs. */
static Pair dot_axis(const real4 axis, const Pair3 v) {
    const Pair x = pair(axis.x, 0), y = pair(axis.y, 0), z = pair(axis.z, 0);
    return plus(plus(times(x, v.x), times(y, v.y)), times(z, v.z));
}

/* |x| + |y| + |z|. */
static REAL size_of_pairs(const Pair3 v) {
    return (fabs(v.x.hi) + fabs(v.y.hi)) + fabs(v.z.hi);
}

/* What such numbers are off by at most, as a share of the sizes that they are made from: what is closer to 0 counts as
 * 0. In single the numbers of the scene are rounded to float. */
#define PAIR_ERROR ((real)(REAL_BYTES == 8 ? 0x1p-95f : 0x1p-18f))
#endif

/* pairs.cl: double-double arithmetic, for the few decisions of which even double is unsure.
 *
 * A pair is the unevaluated sum hi + lo with |lo| <= 2^-53 |hi|, about 106 bits. The operations are those of Dekker
 * 1971 and of Ogita, Rump and Oishi 2005. Their errors are a few 2^-104 of the result.
 */
#if REAL_BYTES == 8
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
#endif

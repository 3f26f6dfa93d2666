/* numbers.cl: numbers of more digits than double has: pairs of doubles, and whole numbers. */

/* The sign in each lane, -1, 0 or 1; 0 of what is within its error. */
static REAL sign_from(const REAL value, const REAL error) {
    return value > error ? (REAL)1 : value < -error ? (REAL)-1 : (REAL)0;
}

/* Double-double arithmetic, for the few decisions of which even double is unsure.
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
    return (Pair){s, (a - (s - t)) + (b - t)};
}

static Pair two_product(const REAL a, const REAL b) {
    const REAL p = a * b;
    return (Pair){p, fma(a, b, -p)};
}

static Pair plus(const Pair a, const Pair b) {
    const Pair s = two_sum(a.hi, b.hi), e = two_sum(a.lo, b.lo), sum = two_sum(s.hi, s.lo + e.hi);
    return two_sum(sum.hi, sum.lo + e.lo);
}

static Pair minus(const Pair a, const Pair b) {
    return plus(a, (Pair){-b.hi, -b.lo});
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
    return (Pair){hi, lo};
}

static Pair dot_pairs(const Pair3 u, const Pair3 v) {
    return plus(plus(times(u.x, v.x), times(u.y, v.y)), times(u.z, v.z));
}

static Pair3 cross_pairs(const Pair3 u, const Pair3 v) {
    return (Pair3){minus(times(u.y, v.z), times(u.z, v.y)), minus(times(u.z, v.x), times(u.x, v.z)),
                   minus(times(u.x, v.y), times(u.y, v.x))};
}

static Pair choose_pair(const REAL_MASK first, const Pair a, const Pair b) {
    return (Pair){first ? a.hi : b.hi, first ? a.lo : b.lo};
}

static Pair3 choose_pairs(const REAL_MASK first, const Pair3 a, const Pair3 b) {
    return (Pair3){choose_pair(first, a.x, b.x), choose_pair(first, a.y, b.y), choose_pair(first, a.z, b.z)};
}

static Pair3 plus3(const Pair3 a, const Pair3 b) {
    return (Pair3){plus(a.x, b.x), plus(a.y, b.y), plus(a.z, b.z)};
}

static Pair3 minus3(const Pair3 a, const Pair3 b) {
    return (Pair3){minus(a.x, b.x), minus(a.y, b.y), minus(a.z, b.z)};
}

static Pair3 times3(const Pair s, const Pair3 v) {
    return (Pair3){times(s, v.x), times(s, v.y), times(s, v.z)};
}

/* The differences and the coordinates of doubles. */
static Pair3 pairs_between(const Real3 from, const Real3 to) {
    return (Pair3){two_sum(to.x, -from.x), two_sum(to.y, -from.y), two_sum(to.z, -from.z)};
}

static Pair3 pairs_of(const Real3 v) {
    return (Pair3){pair(v.x, 0), pair(v.y, 0), pair(v.z, 0)};
}

static Pair dot_axis(const real4 axis, const Pair3 v) {
    return dot_pairs(pairs_of((Real3){axis.x, axis.y, axis.z}), v);
}

/* |x| + |y| + |z|. */
static REAL size_of_pairs(const Pair3 v) {
    return (fabs(v.x.hi) + fabs(v.y.hi)) + fabs(v.z.hi);
}

/* What such numbers are off by at most, as a share of the sizes that they are made from: what is closer to 0 counts as
 * 0. In single the numbers of the scene are rounded to float. */
#define PAIR_ERROR ((real)(REAL_BYTES == 8 ? 0x1p-95f : 0x1p-18f))
#endif

/* Whole numbers of many digits, for the decisions of which even pairs are unsure.
 *
 * A double is a whole number times a power of two, so sums and products of doubles are, too. An Integer is such a whole
 * number; how much one of it is, its unit, is known to whoever computes with it. It is a row of digits of 32 bits, the
 * least one first, and a negative number is 2^(32 n) less its magnitude, n being the number of digits in use. Sums and
 * products that leave out what is beyond n digits are right for both signs, if the result has room in n digits; what is
 * computed on the way need not have.
 *
 * The functions take one number each, not a packet's, and are kept out of line: rays that need them are rare.
 */
#if REAL_BYTES == 8
/* Room for what the last stage of shapes/sphere/exact.cl computes at most: see there. */
#define DIGITS (HAS(WITH_PARALLEL_RAYS) ? 124 : 108)

typedef struct {
    uint digit[DIGITS];
} Integer;

/* The exponents of a number's first and last bit that are not zero: it is a multiple of 2^low, and below 2^high. */
typedef struct {
    int low, high;
} Span;

static Span span_of(const double x) {
    const ulong bits = as_ulong(x) & 0x7fffffffffffffffUL;
    Span span = {INT_MAX, INT_MIN};
    if (bits == 0) return span;
    const int exponent = (int)(bits >> 52);
    const ulong fraction = bits & 0xfffffffffffffUL;
    const ulong whole = exponent ? fraction | 0x10000000000000UL : fraction;
    /* whole & -whole is the last bit. */
    span.low = (exponent ? exponent : 1) - 1075 + 63 - (int)clz(whole & (~whole + 1));
    span.high = exponent ? exponent - 1022 : -1022;
    return span;
}

static Span span_of_both(const Span a, const Span b) {
    const Span span = {a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
    return span;
}

/* x, a multiple of 2^unit, in that unit. */
static __attribute__((noinline)) void set_to(Integer *out, const double x, const int unit, const int n) {
    const ulong bits = as_ulong(x);
    const int exponent = (int)(bits >> 52) & 0x7ff;
    long whole = (long)(exponent ? (bits & 0xfffffffffffffUL) | 0x10000000000000UL : bits & 0xfffffffffffffUL);
    int shift = (exponent ? exponent : 1) - 1075 - unit;
    if (whole == 0) shift = 0; /* it has no exponent of its own */
    if (bits >> 63) whole = -whole;
    if (shift < 0) { /* that many of its last bits are zero */
        whole >>= -shift;
        shift = 0;
    }
    for (int i = 0; i < n; i++) {
        const int from = 32 * i - shift;
        out->digit[i] = from <= -32 ? 0 : from < 0 ? (uint)((ulong)whole << -from) : (uint)(whole >> min(from, 63));
    }
}

static __attribute__((noinline)) void negate(Integer *x, const int n) {
    ulong carry = 1;
    for (int i = 0; i < n; i++) {
        carry += ~x->digit[i];
        x->digit[i] = (uint)carry;
        carry >>= 32;
    }
}

/* sum += x, or sum -= x where sign is -1. */
static __attribute__((noinline)) void add(Integer *sum, const int sign, const Integer *x, const int n) {
    const uint flip = sign < 0 ? 0xffffffff : 0;
    ulong carry = sign < 0;
    for (int i = 0; i < n; i++) {
        carry += (ulong)sum->digit[i] + (x->digit[i] ^ flip);
        sum->digit[i] = (uint)carry;
        carry >>= 32;
    }
}

/* sum += x y; the sum is neither of them. */
static __attribute__((noinline)) void add_product(Integer *sum, const Integer *x, const Integer *y, const int n) {
    for (int i = 0; i < n; i++) {
        const ulong one = x->digit[i];
        ulong carry = 0;
        for (int j = 0; one && i + j < n; j++) {
            carry += one * y->digit[j] + sum->digit[i + j]; /* at most 2^64 - 1 in all */
            sum->digit[i + j] = (uint)carry;
            carry >>= 32;
        }
    }
}

/* product = x y. */
static void multiply(Integer *product, const Integer *x, const Integer *y, const int n) {
    set_to(product, 0, 0, n);
    add_product(product, x, y, n);
}

static int sign_of(const Integer *x, const int n) {
    if (x->digit[n - 1] >> 31) return -1;
    uint any = 0;
    for (int i = 0; i < n; i++) any |= x->digit[i];
    return any != 0;
}

/* The double that is nearest to x 2^unit; of two equally near ones the even one. What is not 0, but below all normal
 * numbers, becomes the smallest of those, so that its sign stays. Changes x. */
static __attribute__((noinline)) double nearest_double(Integer *x, const int unit, const int n) {
    const int sign = sign_of(x, n);
    if (sign == 0) return 0;
    if (sign < 0) negate(x, n);
    int top = n - 1;
    while (x->digit[top] == 0) top--;
    /* The first 64 bits from the first one that is not zero. Whether any other is not goes into the last of them. */
    const int shift = (int)clz(x->digit[top]);
    const ulong first = x->digit[top], second = top > 0 ? x->digit[top - 1] : 0,
                third = top > 1 ? x->digit[top - 2] : 0;
    ulong head = (first << 32 | second) << shift | (third << shift) >> 32;
    uint rest = (uint)(third << shift);
    for (int i = 0; i < top - 2; i++) rest |= x->digit[i];
    head |= rest != 0;
    const uint cut = (uint)head & 0x7ff;
    const ulong kept = head >> 11;
    const ulong whole = kept + (cut > 0x400 || (cut == 0x400 && (kept & 1)));
    const int exponent = 32 * (top + 1) - shift + unit + 1022; /* x is within 2^(exponent - 1023) and twice that */
    const ulong bits = exponent < 1 ? 1UL << 52 : ((ulong)(exponent - 1) << 52) + whole; /* whole has the bit 52 */
    return as_double(bits | (sign < 0 ? 1UL << 63 : 0));
}
#endif

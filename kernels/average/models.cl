/* models.cl: numbers over all points of a cell of the picture at once.
 *
 * A cell is a rectangle of the picture, and (s, t) a place in it: each of s and t is within -1 .. 1. A Taylor model
 * (Berz and Makino) of a quantity is what it is at all places but for a bound:
 *
 *     |quantity(s, t) - (v + x s + y t + z w)| <= r
 *
 * where w is within -1 .. 1, too: what is seen near a surface's outline goes with a root, which no plane is near to,
 * and w stands for that (see Limb in windows.cl). Elsewhere z is 0, and the mean over the cell is v, but for r, which
 * is of second order in the cell's size: this is the midpoint rule with its error. Each operation bounds what it leaves
 * out, and what its own numbers are off by. With u = 2^-24: v, x and y are sums of two numbers, off by u of |v| + |x| +
 * |y|, so that 2 u of that are enough; products and functions add more where they are more. The bound itself is made of
 * fewer than 16 roundings of numbers of one sign, so that 2^-19 of it, with those that follow, covers them; and
 * VANISHING what underflows. A quotient may be off by 5 u and a root by 6 u, as the standard has it. Where no bound is
 * known, r is infinite or no number; is_known() tells, and what is made of it must not be known either. Lengths are in
 * the float buffers' unit.
 */
#ifdef WITH_AVERAGE
#define ROUNDING 0x1p-20f
#define VANISHING 0x1p-120f
/* Surfaces over cells are those of spheres.cl, or else of quadrics.cl. */
#define WITH_QUADRICS (HAS(WITH_ELLIPSOIDS) || HAS(WITH_PARALLEL_RAYS))

typedef struct {
    FLOAT v, x, y, r, z;
} Model;

typedef struct {
    Model x, y, z;
} Model3;

static Model constant_model(const FLOAT v) {
    const Model m = {v, 0, 0, 0, 0};
    return m;
}

static FLOAT gradient(const Model m) {
    return fabs(m.x) + fabs(m.y) + fabs(m.z);
}

/* No less than the largest distance from v. */
static FLOAT radius_of(const Model m) {
    return (gradient(m) + m.r) * (1 + ROUNDING);
}

static FLOAT least_of(const Model m) {
    return m.v - radius_of(m) - ROUNDING * fabs(m.v);
}

static FLOAT most_of(const Model m) {
    return m.v + radius_of(m) + ROUNDING * fabs(m.v);
}

static MASK is_known(const Model m) {
    return m.r < INFINITY;
}

static Model with_rounding(Model m) {
    m.r += 0x1p-23f * (fabs(m.v) + gradient(m)) + 0x1p-19f * m.r + VANISHING;
    return m;
}

static Model plus_model(const Model a, const Model b) {
    const Model sum = {a.v + b.v, a.x + b.x, a.y + b.y, a.r + b.r, a.z + b.z};
    return with_rounding(sum);
}

static Model minus_model(const Model a, const Model b) {
    const Model difference = {a.v - b.v, a.x - b.x, a.y - b.y, a.r + b.r, a.z - b.z};
    return with_rounding(difference);
}

static Model scaled(const Model a, const FLOAT by) {
    const Model m = {by * a.v, by * a.x, by * a.y, fabs(by) * a.r, by * a.z};
    return with_rounding(m);
}

static Model choose_model(const MASK first, const Model a, const Model b) {
    const Model m = {first ? a.v : b.v, first ? a.x : b.x, first ? a.y : b.y, first ? a.r : b.r, first ? a.z : b.z};
    return m;
}

/* What lies between two bounds. */
static Model between_bounds(const FLOAT low, const FLOAT high) {
    const Model m = {(FLOAT)0.5f * (low + high), 0, 0, (FLOAT)0.5f * (high - low), 0};
    return with_rounding(m);
}

/* a b. Of the product of the gradients, x x' s^2 is within 0 and x x', as y y' t^2 and z z' w^2 are; in the middle of
 * that it is off by half. */
static Model times_model(const Model a, const Model b) {
    const FLOAT xx = (FLOAT)0.5f * a.x * b.x, yy = (FLOAT)0.5f * a.y * b.y, zz = (FLOAT)0.5f * a.z * b.z,
                ga = gradient(a), gb = gradient(b);
    const FLOAT mixed = fabs(a.x * b.y + a.y * b.x) + fabs(a.x * b.z + a.z * b.x) + fabs(a.y * b.z + a.z * b.y);
    const Model m = {a.v * b.v + (xx + yy + zz), a.v * b.x + b.v * a.x, a.v * b.y + b.v * a.y,
                     fabs(a.v) * b.r + fabs(b.v) * a.r + (fabs(xx) + fabs(yy) + fabs(zz)) + mixed +
                         (ga * b.r + gb * a.r + a.r * b.r) + 0x1p-22f * ((fabs(a.v) + ga) * (fabs(b.v) + gb)),
                     a.v * b.z + b.v * a.z};
    return with_rounding(m);
}

/* a^2. The square of the gradient's part is within 0 and (|x| + |y| + |z|)^2. */
static Model square_of(const Model a) {
    const FLOAT g = gradient(a), halved = (FLOAT)0.5f * g * g;
    const Model m = {a.v * a.v + halved, 2 * a.v * a.x, 2 * a.v * a.y,
                     halved + (2 * (fabs(a.v) + g) + a.r) * a.r + 0x1p-22f * halved, 2 * a.v * a.z};
    return with_rounding(m);
}

/* f(a) for a function whose value and slope at v are given, and whose distance from that tangent is within 0 and
 * `rest`, or of a negative `rest` within that and 0. */
static Model on_tangent(const Model a, const FLOAT value, const FLOAT slope, const FLOAT rest) {
    const FLOAT halved = (FLOAT)0.5f * rest;
    const Model m = {value + halved, slope * a.x, slope * a.y,
                     fabs(slope) * a.r + fabs(halved) + 0x1p-20f * (fabs(value) + fabs(slope) * gradient(a)),
                     slope * a.z};
    return with_rounding(m);
}

/* 1/a for a > 0. With d = a - v: 1/a = 1/v - d/v^2 + d^2/(v^2 a). */
static Model reciprocal_of(const Model a) {
    const FLOAT low = least_of(a), over = 1 / a.v, d = radius_of(a) * over;
    Model m = on_tangent(a, over, -over * over, d * d / low * (1 + ROUNDING));
    m.r = low > 0 ? m.r : (FLOAT)INFINITY;
    return m;
}

/* sqrt(max(0, a)). With d = a - v: sqrt(a) = sqrt(v) + d/(2 sqrt(v)) - d^2/(2 sqrt(v) (sqrt(a) + sqrt(v))^2). Where a
 * may be negative, it is what lies between 0 and the largest root. */
static Model root_of(const Model a) {
    const FLOAT low = least_of(a), high = most_of(a), rad = radius_of(a);
    const MASK positive = low > 0;
    const FLOAT v = positive ? a.v : (FLOAT)1, root = sqrt(v), over = 1 / root,
                sum = root + sqrt(positive ? low : (FLOAT)0);
    const Model tangent = on_tangent(a, root, (FLOAT)0.5f * over,
                                     (FLOAT)-0.5f * (rad * rad) * over / (sum * sum) * (1 + 2 * ROUNDING));
    const Model range = between_bounds(0, sqrt(high <= 0 ? (FLOAT)0 : high));
    return choose_model(positive, tangent, range);
}

/* 1/sqrt(a) for a > 0: convex, with the second derivative 3/4 a^(-5/2). */
static Model over_root_of(const Model a) {
    const FLOAT low = least_of(a), over = 1 / sqrt(a.v), most = 1 / sqrt(low), rad = radius_of(a), square = most * most;
    Model m = on_tangent(a, over, (FLOAT)-0.5f * over * over * over,
                         (FLOAT)0.375f * (rad * rad) * (square * square * most) * (1 + 4 * ROUNDING));
    m.r = low > 0 ? m.r : (FLOAT)INFINITY;
    return m;
}

/* max(0, a). Where a is hardly ever negative, it is a and what is within 0 and -least more. */
static Model positive_part(const Model a) {
    const FLOAT low = least_of(a), high = most_of(a), more = low < 0 ? (FLOAT)-0.5f * low : (FLOAT)0;
    const Model range = between_bounds(0, high <= 0 ? (FLOAT)0 : high),
                shifted = {a.v + more, a.x, a.y, a.r + more, a.z};
    return choose_model(shifted.r < range.r, with_rounding(shifted), range);
}

static Model dot_models(const Model3 a, const Model3 b) {
    return plus_model(plus_model(times_model(a.x, b.x), times_model(a.y, b.y)), times_model(a.z, b.z));
}

static Model square_of_vector(const Model3 a) {
    return plus_model(plus_model(square_of(a.x), square_of(a.y)), square_of(a.z));
}

/* a c, where c is the same in all of the cell but for its r. */
static Model times_constant(const Model a, const Model c) {
    const Model m = {c.v * a.v, c.v * a.x, c.v * a.y, fabs(c.v) * a.r + c.r * (fabs(a.v) + gradient(a) + a.r),
                     c.v * a.z};
    return with_rounding(m);
}

static Model dot_constant(const Model3 a, const Model3 c) {
    return plus_model(plus_model(times_constant(a.x, c.x), times_constant(a.y, c.y)), times_constant(a.z, c.z));
}

static Model3 minus_vectors(const Model3 a, const Model3 b) {
    const Model3 m = {minus_model(a.x, b.x), minus_model(a.y, b.y), minus_model(a.z, b.z)};
    return m;
}

static Model3 times_vector(const Model a, const Model3 b) {
    const Model3 m = {times_model(a, b.x), times_model(a, b.y), times_model(a, b.z)};
    return m;
}

static Model3 plus_vectors(const Model3 a, const Model3 b) {
    const Model3 m = {plus_model(a.x, b.x), plus_model(a.y, b.y), plus_model(a.z, b.z)};
    return m;
}

static Model3 cross_models(const Model3 a, const Model3 b) {
    const Model3 m = {minus_model(times_model(a.y, b.z), times_model(a.z, b.y)),
                      minus_model(times_model(a.z, b.x), times_model(a.x, b.z)),
                      minus_model(times_model(a.x, b.y), times_model(a.y, b.x))};
    return m;
}

/* How much of a cell is on the side of a straight line where v + x s + y t > 0, 0 .. 1. X >= Y being |x| and |y|: up to
 * |v| = X - Y the line cuts off a trapezium, and beyond that a triangle, up to |v| = X + Y. */
static FLOAT share_of(const FLOAT v, const FLOAT x, const FLOAT y) {
    const FLOAT h = fabs(x), k = fabs(y), X = h > k ? h : k, Y = h > k ? k : h, far = fabs(v);
    const FLOAT left = X + Y - far;
    const FLOAT triangle = left * left / (8 * X * Y), trapezium = (FLOAT)0.5f - far / (2 * X);
    const FLOAT small = left <= 0 ? (FLOAT)0 : (far >= X - Y ? triangle : trapezium);
    return v > 0 ? 1 - small : small;
}

/* Bounds of what share of a cell, or of any mean over it, something has. */
typedef struct {
    FLOAT least, most;
} Share;

/* The share of a cell where a model is positive. The curve where it is 0 lies between two straight lines. */
static Share share_where_positive(const Model m) {
    const Share share = {share_of(m.v - m.r, m.x, m.y), share_of(m.v + m.r, m.x, m.y)};
    const MASK known = is_known(m);
    const FLOAT more = 16 * ROUNDING;
    const FLOAT least = share.least - more, most = share.most + more;
    const Share safe = {(known & (least > 0)) ? least : (FLOAT)0, (known & (most < 1)) ? most : (FLOAT)1};
    return safe;
}
#endif

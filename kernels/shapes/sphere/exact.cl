/* exact.cl: the last word on a ray from the eye and a sphere, where doubles are unsure: first in pairs, then in whole
 * numbers. Only `real` as a double has it; float stands by what it says.
 *
 * What is decided about is the scene as its file has it, in the world: the sphere |p - C| = r around f = C - eye, and
 * the ray along w = B^T d, where the rows of B are the camera's axes and d is the ray's direction in camera space, all
 * of them exactly the doubles that they are (see cltrace/exact/lines.py). With
 *
 *     a = w.w,   b = f.w,   c = f.f - r^2,   X = f x w,   D = b^2 - a c = a r^2 - X.X
 *
 * the ray hits if D >= 0 and, unless c < 0, b > 0; it does so at t = (b - sqrt(D)) / a, or with a plus if c <= 0.
 */
#if REAL_BYTES == 8
/* B^T v. */
static Pair3 pairs_in_world(const Geometry geometry, const Real3 v) {
    const real4 right = geometry.camera[1], up = geometry.camera[2], back = geometry.camera[3];
    return (Pair3){plus(plus(two_product(right.x, v.x), two_product(up.x, v.y)), two_product(back.x, v.z)),
                   plus(plus(two_product(right.y, v.x), two_product(up.y, v.y)), two_product(back.y, v.z)),
                   plus(plus(two_product(right.z, v.x), two_product(up.z, v.y)), two_product(back.z, v.z))};
}

/* The numbers above in pairs, and bounds of what b and D are off by. */
typedef struct {
    Pair3 w, X;
    Pair a, b, c, D;
    REAL a_error, b_error, c_error,
        D_error; /* c_error only of parallel rays: else the host knows c; a_error: of ellipsoids */
} Fine;

/* c and D of rays that start at o, from the plane of an orthographic camera; f: from there to the centre. */
static void fine_from_plane(const Ray ray, const Sphere sphere, const Pair3 f, Fine *e) {
    const REAL F = size_of_pairs(f), s = F + ray.reach, e1 = e->b_error = 0x1p-100 * s;
    const Pair rr = two_product(sphere.r, sphere.r), arr = times(e->a, rr), XX = dot_pairs(e->X, e->X);
    e->c = minus(dot_pairs(f, f), rr);
    e->c_error = 0x1p-99 * (F * s + rr.hi);
    e->D = minus(arr, XX);
    e->D_error = (2 * size_of_pairs(e->X) + 3 * e1) * e1 + 0x1p-99 * (arr.hi + XX.hi);
}

/* The same of rays that start at the eye. rest: what was cut off of the host's c. D is made in two ways, of which the
 * better one counts. */
static void fine_from_eye(const Ray ray, const Sphere sphere, const Pair3 f, const REAL rest, Fine *e) {
    e->c = pair(sphere.c, rest);
    e->b_error = 0x1p-101 * size_of_pairs(f) * ((fabs(ray.d.x) + fabs(ray.d.y)) + 1);
    e->c_error = 0;
    const Pair bb = times(e->b, e->b), ac = times(e->a, e->c), XX = dot_pairs(e->X, e->X);
    const Pair arr = times(e->a, two_product(sphere.r, sphere.r)), by_b = minus(bb, ac), by_X = minus(arr, XX);
    const REAL size = size_of_pairs(e->X);
    const REAL error_b = (2 * fabs(e->b.hi) + e->b_error) * e->b_error + 0x1p-98 * (bb.hi + fabs(ac.hi));
    const REAL error_X = (2 * size + 3 * e->b_error) * e->b_error + 0x1p-99 * (arr.hi + XX.hi);
    const REAL_MASK better = error_b < error_X;
    e->D = choose_pair(better, by_b, by_X);
    e->D_error = better ? error_b : error_X;
}

/* The bounds. With u = 2^-53, a sum of pairs is off by 3 u^2 of itself and a product by 7 u^2, products of two doubles
 * by nothing (Joldes, Muller and Popescu 2017). f is exact, as two_sum() is. No entry of B is above 1 but for rounding,
 * so with s = |d.x| + |d.y| + 1 each coordinate of w is off by 6 u^2 s. Let F = |f.x| + |f.y| + |f.z|.
 *   - b, and each coordinate of X: (7 + 6) u^2 of each product's F s, and 6 u^2 for the sums: below e = 2^-101 F s.
 *   - a: as s <= 1.74 |w|, it is 2 * 6 u^2 s (|w.x| + |w.y| + |w.z|) + 13 u^2 a < 50 u^2 a.
 *   - c comes from the host, to 2^-99 of itself: square_excess() in cltrace/plan/rounding.py.
 *   - D from b: (2 |b| + e) e + 7 u^2 b^2 + (57 u^2 + 2^-99) a |c|, and 3 u^2 D: the bound below has 2^-98 for these.
 *   - D from X: (2 (|X.x| + |X.y| + |X.z|) + 3 e) e + 13 u^2 X.X + 57 u^2 a r^2, and 3 u^2 D: likewise 2^-99.
 * The constants have room for the rounding of the bounds themselves. Nothing underflows that matters: f is a multiple
 * of 2^-201 and w of 2^-523 (see below), so products of two doubles lose nothing up to b and X; and what vanishes below
 * 2^-1074 in D is nothing beside a bound of 2^-98 a r^2 or a |c|, which are 0 or at least 2^-404.
 *
 * Of an orthographic camera, f = C - eye - B^T o, and w is the third axis but for its sign: exact, and not above 1 in
 * any coordinate but for rounding. B^T o is off by 6 u^2 |o|_1 in each coordinate, and f, by that and 3 u^2 F, where F
 * is |f|_1: below 2^-102 s with s = F + |o|_1. So b, and each coordinate of X, are off by that for each of up to two
 * coordinates of f, and by 13 u^2 F: below e = 2^-100 s. D comes from X, as above. c is off by 2 F 2^-102 s, 13 u^2 F^2
 * and 3 u^2 (F^2 + r^2).
 */
static __attribute__((noinline)) Fine fine_quadratic(const Geometry geometry, const Ray ray, const Sphere sphere) {
    Fine e;
    const real4 eye = geometry.camera[0];
    const Real4 s = rows_at(geometry.world, sphere.index);
    Pair3 f = pairs_between((Real3){eye.x, eye.y, eye.z}, xyz_of(s));
    if (HAS(WITH_PARALLEL_RAYS)) f = minus3(f, pairs_in_world(geometry, ray.o));
    e.w = pairs_in_world(geometry, ray.d);
    e.a = dot_pairs(e.w, e.w);
    e.b = dot_pairs(f, e.w);
    e.X = cross_pairs(f, e.w);
    if (HAS(WITH_PARALLEL_RAYS)) fine_from_plane(ray, sphere, f, &e);
    else fine_from_eye(ray, sphere, f, s.w, &e);
    return e;
}

/* The same in whole numbers, for one ray and one or two spheres.
 *
 * unit: the exponent of the unit of lengths, and of b; a has twice the exponent of w's, which nobody needs.
 *
 * How many digits it takes. A coordinate and a radius are 0 or within 2^-149 .. 2^128 in magnitude
 * (cltrace/scene/rules.py) and have 53 bits: multiples of 2^-201. The axes are multiples of 2^-300 and not above 1
 * (cltrace/scene/camera.py). An opening angle of 2^-149 degrees on 2^16 pixels is the least that makes d.x or d.y, a
 * multiple of 2^-223; larger angles have the larger d, up to 2^53 from multiples of 2^-83 on. So with F and G bits for
 * the coordinates of f and w, F <= 129 + 201 = 330 and G <= 4 + 523. Then |b| < 2^(F + G + 2), |D| < 2^(2 (F + G) + 5),
 * and what comes_first() compares is below 2^(4 (F + G) + 15): with the sign at most 3444 bits: DIGITS.
 *
 * Of an orthographic camera, o is a multiple of half of a pixel's size, and that is 2^-219 at least by the same rules,
 * o itself 2^144 at most. So f is a multiple of 2^-519, F <= 146 + 519 and G <= 2 + 300: at most 3,884 bits.
 */
typedef struct {
    Integer w[3], a;
    int unit, unit_f, digits;
    Integer o[3]; /* of parallel rays: B^T o, in the unit of f */
} WholeRay;

static Span span_of_xyz(const real4 v) {
    return span_of_both(span_of(v.x), span_of_both(span_of(v.y), span_of(v.z)));
}

static double coordinate(const real4 v, const int i) {
    return i == 0 ? v.x : i == 1 ? v.y : v.z;
}

static Span span_of_axes(const Geometry geometry) {
    return span_of_both(span_of_xyz(geometry.camera[1]),
                        span_of_both(span_of_xyz(geometry.camera[2]), span_of_xyz(geometry.camera[3])));
}

/* Puts coordinate i of B^T v into w. unit_B, unit_v: of the axes and of v. */
static __attribute__((noinline)) void whole_turned(Integer *w, const Geometry geometry, const real4 v, const int i,
                                                   const int unit_B, const int unit_v, const int n) {
    Integer B, own;
    set_to(w, 0, 0, n);
    for (int k = 0; k < 3; k++) {
        set_to(&B, coordinate(geometry.camera[k + 1], i), unit_B, n);
        set_to(&own, coordinate(v, k), unit_v, n);
        add_product(w, &B, &own, n);
    }
}

/* The ray (x, y, -1) from the eye; of parallel rays, (0, 0, -1) from (x, y, 0). squares: whether order_of() asks. */
static __attribute__((noinline)) WholeRay whole_ray(const Geometry geometry, const double x, const double y,
                                                    const int first, const int second, const int squares) {
    const int moved = HAS(WITH_PARALLEL_RAYS) && (x != 0 || y != 0);
    const real4 at = (real4)(x, y, 0, 0), way = HAS(WITH_PARALLEL_RAYS) ? (real4)(0, 0, -1, 0) : (real4)(x, y, -1, 0);
    const Span d = span_of_xyz(way), o = span_of_both(span_of(x), span_of(y)), B = span_of_axes(geometry);
    Span f = span_of_both(span_of(geometry.center_radius[first].w), span_of(geometry.center_radius[second].w));
    f = span_of_both(f, span_of_xyz(geometry.camera[0]));
    f = span_of_both(f, span_of_both(span_of_xyz(geometry.world[first]), span_of_xyz(geometry.world[second])));
    if (moved) {
        const Span turned = {B.low + o.low, B.high + o.high + 1};
        f = span_of_both(f, turned);
    }
    WholeRay ray;
    ray.unit_f = f.low;
    ray.unit = f.low + B.low + d.low;
    const int bits = f.high - f.low + 1 + HAS(WITH_PARALLEL_RAYS) + B.high - B.low + d.high - d.low + 2;
    const int n = ray.digits = min(DIGITS, ((squares ? 4 * bits + 16 : 2 * bits + 6) + 31) / 32);
    set_to(&ray.a, 0, 0, n);
    for (int i = 0; i < 3; i++) {
        whole_turned(&ray.w[i], geometry, way, i, B.low, d.low, n);
        if (HAS(WITH_PARALLEL_RAYS)) whole_turned(&ray.o[i], geometry, at, i, B.low, f.low - B.low, n);
        add_product(&ray.a, &ray.w[i], &ray.w[i], n);
    }
    return ray;
}

/* b, D and c of one sphere. */
static __attribute__((noinline)) void whole_quadratic(Integer *b, Integer *D, Integer *c, const Geometry geometry,
                                                      const int index, const WholeRay *ray) {
    const real4 eye = geometry.camera[0], center = geometry.world[index];
    const int n = ray->digits;
    Integer f, other;
    set_to(b, 0, 0, n);
    set_to(c, 0, 0, n);
    for (int i = 0; i < 3; i++) {
        set_to(&f, coordinate(center, i), ray->unit_f, n);
        set_to(&other, coordinate(eye, i), ray->unit_f, n);
        add(&f, -1, &other, n);
        if (HAS(WITH_PARALLEL_RAYS)) add(&f, -1, &ray->o[i], n);
        add_product(b, &f, &ray->w[i], n);
        add_product(c, &f, &f, n);
    }
    set_to(&f, geometry.center_radius[index].w, ray->unit_f, n);
    multiply(&other, &f, &f, n);
    add(c, -1, &other, n);
    multiply(D, b, b, n);
    multiply(&other, &ray->a, c, n);
    add(D, -1, &other, n);
}

/* D, b and c, correctly rounded, of the sphere `index` and the ray of x and y, as in whole_ray(). */
static __attribute__((noinline)) double3 rounded_quadratic(const Geometry geometry, const int index, const double x,
                                                           const double y) {
    const WholeRay ray = whole_ray(geometry, x, y, index, index, 0);
    Integer b, D, c;
    whole_quadratic(&b, &D, &c, geometry, index, &ray);
    return (double3)(nearest_double(&D, 2 * ray.unit, ray.digits), nearest_double(&b, ray.unit, ray.digits),
                     nearest_double(&c, 2 * ray.unit_f, ray.digits));
}

/* -1 where the ray meets a sphere from outside, else 1. c: that of whole_quadratic(); of rays from the eye the host has
 * it. */
static int side_of_ray(const Geometry geometry, const int index, const Integer *c, const int n) {
    return (HAS(WITH_PARALLEL_RAYS) ? sign_of(c, n) > 0 : geometry.power[index].x > 0) ? -1 : 1;
}

/* -1, 0, 1: whether the ray of x and y, as in whole_ray(), which meets both spheres, meets the first one before the
 * second, at the same point, or after it.
 *
 * a (t - t') is p + v with p = b - b' and v = s sqrt(D) - s' sqrt(D'), where s = -1 from outside and else 1. Where p
 * and v differ in sign, the larger square decides: p^2 - v^2 = P + 2 s s' sqrt(D D') with P = p^2 - D - D'. Where these
 * two differ in sign, the larger square does: P^2 - 4 D D'.
 */
static __attribute__((noinline)) int order_of(const Geometry geometry, const int first, const int second,
                                              const double x, const double y) {
    const WholeRay ray = whole_ray(geometry, x, y, first, second, 1);
    const int n = ray.digits;
    Integer p, b, D, E, P;
    whole_quadratic(&p, &D, &P, geometry, first, &ray);
    const int s = side_of_ray(geometry, first, &P, n);
    whole_quadratic(&b, &E, &P, geometry, second, &ray);
    const int t = side_of_ray(geometry, second, &P, n);
    add(&p, -1, &b, n);
    const int sign_D = sign_of(&D, n), sign_E = sign_of(&E, n), sign_p = sign_of(&p, n);
    /* v has the sign of s D - s' E. */
    P = D;
    add(&P, -1, &E, n);
    const int sign_v = s != t ? (s * sign_D != 0 ? s * sign_D : -t * sign_E) : s * sign_of(&P, n);
    if (sign_p * sign_v >= 0) return sign_p != 0 ? sign_p : sign_v;
    /* p^2 - D - E. */
    multiply(&P, &p, &p, n);
    add(&P, -1, &D, n);
    add(&P, -1, &E, n);
    const int sign_P = sign_of(&P, n), sign_root = s * t * sign_D * sign_E;
    if (sign_P * sign_root >= 0) return sign_p * (sign_P != 0 ? sign_P : sign_root);
    multiply(&b, &P, &P, n);
    multiply(&p, &D, &E, n);
    for (int k = 0; k < 4; k++) add(&b, -1, &p, n);
    return sign_p * sign_P * sign_of(&b, n);
}

/* Which lanes' pairs, off by this error at most, surely round to their hi. As hi + lo +/- error may be rounded down to
 * the middle between two doubles, it is twice the error; all that is below u of lo is below that. */
static REAL_MASK rounds_to_hi(const Pair x, const REAL error) {
    return (x.hi + (x.lo + 2 * error) == x.hi) & (x.hi + (x.lo - 2 * error) == x.hi);
}

/* D, b, c and v; the first three correctly rounded. */
typedef struct {
    REAL discriminant, b, c;
    Real3 v;
} Decided;

/* Puts whole numbers in place of D, b and c, in the lanes of `unsure`. */
static void decide_in_whole_numbers(const Geometry geometry, const Ray ray, const Sphere sphere, const MASK unsure,
                                    Decided *decided) {
    int index[W], left[W];
    double x[W], y[W], D[W], b[W], c[W];
    STORE_LANES(sphere.index, index);
    STORE_LANES(unsure, left);
    STORE_LANES(OWN(ray).x, x);
    STORE_LANES(OWN(ray).y, y);
    STORE_LANES(decided->discriminant, D);
    STORE_LANES(decided->b, b);
    STORE_LANES(decided->c, c);
    for (int lane = 0; lane < W; lane++) {
        if (!left[lane] || index[lane] < 0) continue;
        const double3 whole = rounded_quadratic(geometry, index[lane], x[lane], y[lane]);
        D[lane] = whole.x;
        b[lane] = whole.y;
        c[lane] = whole.z;
    }
    decided->discriminant = LOAD_LANES(D);
    decided->b = LOAD_LANES(b);
    decided->c = LOAD_LANES(c);
}

/* For the lanes of `wanted`; b and c only for those of `with_b`. v = (w x X) / a, as w x (f x w) is a f - b w. */
static __attribute__((noinline)) Decided decide(const Geometry geometry, const Ray ray, const Sphere sphere,
                                                const REAL_MASK wanted, const REAL_MASK with_b) {
    const Fine e = fine_quadratic(geometry, ray, sphere);
    const Pair3 across = cross_pairs(e.w, e.X), v = {over(across.x, e.a), over(across.y, e.a), over(across.z, e.a)};
    Decided decided = {
        e.D.hi,
        e.b.hi,
        e.c.hi,
        {dot_axis(geometry.camera[1], v).hi, dot_axis(geometry.camera[2], v).hi, dot_axis(geometry.camera[3], v).hi}};
    REAL_MASK known = rounds_to_hi(e.b, e.b_error);
    if (HAS(WITH_PARALLEL_RAYS)) known = known & rounds_to_hi(e.c, e.c_error);
    const MASK unsure = TO_MASK((wanted & !rounds_to_hi(e.D, e.D_error)) | (with_b & !known));
    if (ANY(unsure)) decide_in_whole_numbers(geometry, ray, sphere, unsure, &decided);
    return decided;
}

/* The square root of x, whose hi is positive where `some`; else 0. */
static Pair root_of(const Pair x, const REAL_MASK some) {
    const REAL near = some ? sqrt(x.hi) : (REAL)0;
    const Pair rest = minus(x, two_product(near, near));
    return two_sum(near, some ? (rest.hi + rest.lo) / (2 * near) : (REAL)0);
}

/* What the root of x is off by: the lesser of error / sqrt(x) and sqrt(error). */
static REAL root_error(const REAL x, const REAL error, const REAL_MASK some) {
    const REAL least = sqrt(error), by_root = some ? error / sqrt(x) : least;
    return by_root < least ? by_root : least;
}

static Pair negative_where(const REAL_MASK mask, const Pair x) {
    return (Pair){mask ? -x.hi : x.hi, mask ? -x.lo : x.lo};
}

/* t of a ray that is known to hit, in pairs, and a bound of its error. */
typedef struct {
    Pair t;
    REAL error;
} FineT;

/* D is off by D_error, its root as root_error() says, and q = |b| + sqrt(D) by that and b_error. What a, c and the
 * division add is below 2^-97 of t: see fine_quadratic(). Twice the sum of the shares is a bound as long as it is below
 * 1/2, and beyond that it is so large that it decides nothing. */
static __attribute__((noinline)) FineT fine_t(const Geometry geometry, const Ray ray, const Sphere sphere) {
    const Fine e = fine_quadratic(geometry, ray, sphere);
    const REAL_MASK some = e.D.hi > 0, behind = e.b.hi < 0, first = (e.c.hi > 0) | behind;
    const Pair q = plus(e.b, negative_where(behind, root_of(e.D, some)));
    FineT t = {over(choose_pair(first, e.c, q), choose_pair(first, q, e.a)), 0};
    t.error = 2 * fabs(t.t.hi) * ((e.b_error + root_error(e.D.hi, e.D_error, some)) / fabs(q.hi) + 0x1p-97);
    if (HAS(WITH_PARALLEL_RAYS)) { /* the host knows no c of such a ray */
        t.error += first ? 2 * fabs(t.t.hi) * (e.c_error / fabs(e.c.hi)) : (REAL)0;
        t.error = fabs(e.c.hi) > e.c_error ? t.error : (REAL)INFINITY;
    }
    return t;
}

/* Which of the lanes of `wanted`, whose rays hit both spheres, hit A before B; where they are hit at once, `tie` says.
 */
static REAL_MASK sphere_comes_first(const Geometry geometry, const Ray ray, const Sphere A, const Sphere B,
                                    const REAL_MASK tie, const REAL_MASK wanted) {
    const FineT a = fine_t(geometry, ray, A), b = fine_t(geometry, ray, B);
    const REAL gap = (a.t.hi - b.t.hi) + (a.t.lo - b.t.lo), error = a.error + b.error;
    const MASK unsure = TO_MASK(wanted & !((gap > error) | (gap < -error)));
    if (!ANY(unsure)) return gap < 0;
    int first[W], second[W], left[W];
    double x[W], y[W], order[W];
    STORE_LANES(A.index, first);
    STORE_LANES(B.index, second);
    STORE_LANES(unsure, left);
    STORE_LANES(OWN(ray).x, x);
    STORE_LANES(OWN(ray).y, y);
    STORE_LANES(gap, order);
    for (int lane = 0; lane < W; lane++)
        if (left[lane] && second[lane] >= 0)
            order[lane] = order_of(geometry, first[lane], second[lane], x[lane], y[lane]);
    const REAL exact = LOAD_LANES(order);
    return (exact < 0) | ((exact == 0) & tie);
}
#endif

/* sphere.cl: the sphere, decided in `real`.
 *
 * A shape has five functions: X_may_meet is a float32 filter with a proof, X_meet finds where a ray meets it,
 * X_comes_first tells which of two is met first, X_surface gives the point's normal, and X_stops tells whether it stands
 * between a point and a light. cltrace/reference has the same, without the filter.
 */

/* One sphere in all lanes, or each lane's own one. */
typedef struct {
    INT index;
    Real3 center;
    REAL r, over_r;
    REAL c; /* |center|^2 - r^2, the power of the eye */
} Sphere;

/* Each lane's surface where it is a sphere, else -1. */
#ifdef WITH_TRIANGLES
#define SPHERE_OR_NONE(spheres, index) ((index) < (spheres).first ? (index) : (INT)-1)
#else
#define SPHERE_OR_NONE(spheres, index) (index)
#endif

static Sphere sphere_at(const Spheres spheres, const int index) {
    const real4 s = spheres.center_radius[index];
    const real2 power = spheres.power[index];
    const Sphere sphere = {index, {s.x, s.y, s.z}, s.w, power.y, power.x};
    return sphere;
}

/* Each lane's sphere. Lanes with a negative index get a harmless one ahead. */
static Sphere spheres_of(const Spheres spheres, const INT index) {
    Sphere own = {index, {0, 0, -2}, 1, 1, 3};
    int each[W];
    STORE_LANES(index, each);
    if (each[0] >= 0 && !ANY(index != each[0])) return sphere_at(spheres, each[0]);
    FOR_EACH_INDEX(one, index) {
        const REAL_MASK here = TO_REAL_MASK(index == one);
        const Sphere sphere = sphere_at(spheres, one);
        PUT_WHERE(here, own.center.x, sphere.center.x);
        PUT_WHERE(here, own.center.y, sphere.center.y);
        PUT_WHERE(here, own.center.z, sphere.center.z);
        PUT_WHERE(here, own.r, sphere.r);
        PUT_WHERE(here, own.over_r, sphere.over_r);
        PUT_WHERE(here, own.c, sphere.c);
    }
    return own;
}

/* Which lanes' rays from a fixed point may meet a sphere, by a test in float32 that costs no more than a float tracer's
 * own.
 *
 * s: the sphere's filter constant (C, c'), where C is its centre seen from that point. b: C.d in float, by two fused
 * operations or by more roundings; a: d.d in float. With c = |C|^2 - r^2 and u = 2^-24, the host has rounded C to float
 * and made c' = c - 11 u (|C|^2 + |c|) - 2^-100 [FILTER_ROUNDINGS = 11], rounded down, or -inf where that is <= 0: see
 * filter_constant in cltrace/plan/shapes/sphere.py.
 *
 * Claim: if the ray hits, then b |b| >= a c' in float.
 * Proof. Let b = C.d and a = d.d without rounding and b~, a~ as computed here. C and d are rounded once and at most
 * three roundings follow, so |b~ - b| <= 5.01 u sum |C_i d_i| <= 5.01 u |C||d|, and a~ <= (1 + 5.01 u) a. A hit from
 * outside has b > 0 and b^2 >= a c. With s = b/|d| <= |C|:
 *   - if s >= 5.01 u |C|:  b~^2 (1 - u) >= a (s - 5.01 u |C|)^2 (1 - u) >= a (c - 10.02 u |C|^2)(1 - u), and
 *     a~ c' (1 + u) <= a (1 + 6.02 u) c' <= a (c - 10.1 u |C|^2 - 7.1 u c) (1 + 6.02 u), which is less.
 *   - else c <= s^2 < 26 u^2 |C|^2, so c - 11 u |C|^2 < 0 and c' = -inf: always a candidate.
 * A hit from inside or from the surface has c <= 0: likewise. Underflow adds at most 2^-123 to b: as a >= 1 and the
 * scene is scaled to 1, 2^-100 covers it.
 */
static MASK sphere_may_meet(const FLOAT b, const FLOAT a, const float4 s) {
    return b * magnitude(b) >= a * s.w;
}

#if defined(WITH_PREFETCH) && REAL_BYTES == 8 && !defined(WITH_ELLIPSOIDS)
#define WITH_SMALL_SPHERES
/* The same for the line through a light at a point, along w, of spheres that are small: where a radius is less than a
 * thousandth of the distance, sphere_may_meet() subtracts squares of which float does not hold the difference.
 *
 * s: (L - C, c'), as of a fixed point; r: the radius in the float buffers' unit, rounded; a: w.w in float.
 *
 * Claim: if the line meets the sphere, then |w x s|^2 <= R^2 a in float, with R = (1 + 2^-19) r + 2^-20 |s|_1.
 * Proof. Let W and S be w and L - C without rounding, and D = |S|. The line meets the sphere if |W x S| <= r |W|. Each
 * coordinate of w and s is rounded once (s is off by 2^-50 D, too), and each one of the cross product by up to three
 * roundings of u: so that is off by 4.02 u times the sum of the magnitudes of its two products. The vector of these sums
 * is at most sqrt(2) |W| D long. So |w x s| <= (r + 5.7 u D) |W|; its square is off by 3.01 u of itself. On the other side,
 * R >= ((1 + 31 u) r + 15.9 u D) (1 - 3 u), a >= (1 - 5.01 u) |W|^2, and products are rounded twice: R^2 a is at least
 * ((1 + 31 u) r + 15.9 u D)^2 (1 - 14 u) |W|^2. As sqrt((1 + 3.01 u) / (1 - 14 u)) < 1 + 9 u, that is more. Underflow adds
 * less than 2^-100. */
static MASK small_sphere_may_meet(const Float3 w, const FLOAT a, const float4 s, const float r) {
    const FLOAT x = FMA(w.y, (FLOAT)s.z, -(w.z * s.y));
    const FLOAT y = FMA(w.z, (FLOAT)s.x, -(w.x * s.z));
    const FLOAT z = FMA(w.x, (FLOAT)s.y, -(w.y * s.x));
    const float R = (1 + 0x1p-19f) * r + 0x1p-20f * ((fabs(s.x) + fabs(s.y)) + fabs(s.z));
    return FMA(x, x, FMA(y, y, z * z)) <= FMA((FLOAT)(R * R), a, (FLOAT)0x1p-100f);
}
#endif

/* What is needed of the equation a t^2 - 2 b t + c = 0 for the ray t d and the sphere |p - C| = r. */
typedef struct {
    REAL b;            /* C.d */
    Real3 v;           /* from the ray's point closest to the centre, to the centre; orthogonal to d */
    REAL discriminant; /* b^2 - a c = a (r^2 - |v|^2) */
    REAL_MASK by_b;    /* whether it was computed as b^2 - a c */
} Quadratic;

#if REAL_BYTES == 8
/* The last word on a ray and a sphere, where doubles are unsure: first in pairs, then in whole numbers.
 *
 * What is decided about is the scene as its file has it, in the world: the sphere |p - C| = r around f = C - eye, and the
 * ray along w = B^T d, where the rows of B are the camera's axes and d is the ray's direction in camera space, all of
 * them exactly the doubles that they are (see cltrace/reference/exact.py). With
 *
 *     a = w.w,   b = f.w,   c = f.f - r^2,   X = f x w,   D = b^2 - a c = a r^2 - X.X
 *
 * the ray hits if D >= 0 and, unless c < 0, b > 0; it does so at t = (b - sqrt(D)) / a, or with a plus if c <= 0.
 */
typedef struct {
    Pair x, y, z;
} Pair3;

static Pair dot_pairs(const Pair3 u, const Pair3 v) {
    return plus(plus(times(u.x, v.x), times(u.y, v.y)), times(u.z, v.z));
}

static Pair3 cross_pairs(const Pair3 u, const Pair3 v) {
    const Pair3 cross = {minus(times(u.y, v.z), times(u.z, v.y)), minus(times(u.z, v.x), times(u.x, v.z)),
                         minus(times(u.x, v.y), times(u.y, v.x))};
    return cross;
}

#ifdef WITH_SHAPES
static Pair3 choose_pairs(const REAL_MASK first, const Pair3 a, const Pair3 b) {
    const Pair3 c = {{first ? a.x.hi : b.x.hi, first ? a.x.lo : b.x.lo},
                     {first ? a.y.hi : b.y.hi, first ? a.y.lo : b.y.lo},
                     {first ? a.z.hi : b.z.hi, first ? a.z.lo : b.z.lo}};
    return c;
}
#endif

/* Of numbers of which two are no pairs. */
static Pair dot_axis(const real4 axis, const Pair3 v) {
    const Pair x = pair(axis.x, 0), y = pair(axis.y, 0), z = pair(axis.z, 0);
    return plus(plus(times(x, v.x), times(y, v.y)), times(z, v.z));
}

/* B^T v. */
static Pair3 pairs_in_world(const Spheres spheres, const Real3 v) {
    const real4 right = spheres.camera[1], up = spheres.camera[2], back = spheres.camera[3];
    const Pair3 w = {
        plus(plus(two_product(right.x, v.x), two_product(up.x, v.y)), two_product(back.x, v.z)),
        plus(plus(two_product(right.y, v.x), two_product(up.y, v.y)), two_product(back.y, v.z)),
        plus(plus(two_product(right.z, v.x), two_product(up.z, v.y)), two_product(back.z, v.z)),
    };
    return w;
}

/* The numbers above in pairs, and bounds of what b and D are off by. */
typedef struct {
    Pair3 w, X;
    Pair a, b, c, D;
    REAL b_error, D_error;
#ifdef WITH_PARALLEL_RAYS
    REAL c_error;
#endif
} Fine;

/* The bounds. With u = 2^-53, a sum of pairs is off by 3 u^2 of itself and a product by 7 u^2, products of two doubles by
 * nothing (Joldes, Muller and Popescu 2017). f is exact, as two_sum() is. No entry of B is above 1 but for rounding, so
 * with s = |d.x| + |d.y| + 1 each coordinate of w is off by 6 u^2 s. Let F = |f.x| + |f.y| + |f.z|.
 *   - b, and each coordinate of X: (7 + 6) u^2 of each product's F s, and 6 u^2 for the sums: below e = 2^-101 F s.
 *   - a: as s <= 1.74 |w|, it is 2 * 6 u^2 s (|w.x| + |w.y| + |w.z|) + 13 u^2 a < 50 u^2 a.
 *   - c comes from the host, to 2^-99 of itself: square_excess() in cltrace/plan/exact.py.
 *   - D from b: (2 |b| + e) e + 7 u^2 b^2 + (57 u^2 + 2^-99) a |c|, and 3 u^2 D: the bound below has 2^-98 for these.
 *   - D from X: (2 (|X.x| + |X.y| + |X.z|) + 3 e) e + 13 u^2 X.X + 57 u^2 a r^2, and 3 u^2 D: likewise 2^-99.
 * The constants have room for the rounding of the bounds themselves. Nothing underflows that matters: f is a multiple of
 * 2^-201 and w of 2^-523 (see below), so products of two doubles lose nothing up to b and X; and what vanishes below
 * 2^-1074 in D is nothing beside a bound of 2^-98 a r^2 or a |c|, which are 0 or at least 2^-404.
 *
 * Of an orthographic camera, f = C - eye - B^T o, and w is the third axis but for its sign: exact, and not above 1 in any
 * coordinate but for rounding. B^T o is off by 6 u^2 |o|_1 in each coordinate, and f, by that and 3 u^2 F, where F is |f|_1: below
 * 2^-102 s with s = F + |o|_1. So b, and each coordinate of X, are off by that for each of up to two coordinates of f, and
 * by 13 u^2 F: below e = 2^-100 s. D comes from X, as above. c is off by 2 F 2^-102 s, 13 u^2 F^2 and 3 u^2 (F^2 + r^2).
 */
static __attribute__((noinline)) Fine fine_quadratic(const Spheres spheres, const Ray ray, const Sphere sphere) {
    Fine e;
    const real4 eye = spheres.camera[0];
    REAL x = 0, y = 0, z = 0, rest = 0;
    FOR_EACH_INDEX(one, sphere.index) {
        const REAL_MASK here = TO_REAL_MASK(sphere.index == one);
        const real4 s = spheres.world[one];
        PUT_WHERE(here, x, (REAL)s.x);
        PUT_WHERE(here, y, (REAL)s.y);
        PUT_WHERE(here, z, (REAL)s.z);
        PUT_WHERE(here, rest, (REAL)s.w);
    }
#ifdef WITH_PARALLEL_RAYS
    const Pair3 o = pairs_in_world(spheres, ray.o);
    const Pair3 f = {minus(two_sum(x, (REAL)-eye.x), o.x), minus(two_sum(y, (REAL)-eye.y), o.y),
                     minus(two_sum(z, (REAL)-eye.z), o.z)};
#else
    const Pair3 f = {two_sum(x, (REAL)-eye.x), two_sum(y, (REAL)-eye.y), two_sum(z, (REAL)-eye.z)};
#endif
    e.w = pairs_in_world(spheres, ray.d);
    e.a = dot_pairs(e.w, e.w);
    e.b = dot_pairs(f, e.w);
#ifdef WITH_PARALLEL_RAYS
    e.X = cross_pairs(f, e.w);
    const REAL F = (fabs(f.x.hi) + fabs(f.y.hi)) + fabs(f.z.hi), s = F + ray.reach, e1 = e.b_error = 0x1p-100 * s;
    const Pair rr = two_product(sphere.r, sphere.r), arr = times(e.a, rr), XX = dot_pairs(e.X, e.X);
    e.c = minus(dot_pairs(f, f), rr);
    e.c_error = 0x1p-99 * (F * s + rr.hi);
    e.D = minus(arr, XX);
    e.D_error = (2 * ((fabs(e.X.x.hi) + fabs(e.X.y.hi)) + fabs(e.X.z.hi)) + 3 * e1) * e1 + 0x1p-99 * (arr.hi + XX.hi);
#else
    e.c = pair(sphere.c, rest);
    e.X = cross_pairs(f, e.w);
    e.b_error = 0x1p-101 * ((fabs(f.x.hi) + fabs(f.y.hi)) + fabs(f.z.hi)) * ((fabs(ray.d.x) + fabs(ray.d.y)) + 1);
    const Pair bb = times(e.b, e.b), ac = times(e.a, e.c), XX = dot_pairs(e.X, e.X);
    const Pair arr = times(e.a, two_product(sphere.r, sphere.r)), by_b = minus(bb, ac), by_X = minus(arr, XX);
    const REAL size = (fabs(e.X.x.hi) + fabs(e.X.y.hi)) + fabs(e.X.z.hi);
    const REAL error_b = (2 * fabs(e.b.hi) + e.b_error) * e.b_error + 0x1p-98 * (bb.hi + fabs(ac.hi));
    const REAL error_X = (2 * size + 3 * e.b_error) * e.b_error + 0x1p-99 * (arr.hi + XX.hi);
    const REAL_MASK better = error_b < error_X;
    e.D.hi = better ? by_b.hi : by_X.hi;
    e.D.lo = better ? by_b.lo : by_X.lo;
    e.D_error = better ? error_b : error_X;
#endif
    return e;
}

/* The same in whole numbers, for one ray and one or two spheres.
 *
 * unit: the exponent of the unit of lengths, and of b; a has twice the exponent of w's, which nobody needs.
 *
 * How many digits it takes. A coordinate and a radius are 0 or within 2^-149 .. 2^128 in magnitude (cltrace/scene/rules.py)
 * and have 53 bits: multiples of 2^-201. The axes are multiples of 2^-300 and not above 1 (cltrace/scene/camera.py). An
 * opening angle of 2^-149 degrees on 2^16 pixels is the least that makes d.x or d.y, a multiple of 2^-223; larger angles
 * have the larger d, up to 2^53 from multiples of 2^-83 on. So with F and G bits for the coordinates of f and w,
 * F <= 129 + 201 = 330 and G <= 4 + 523. Then |b| < 2^(F + G + 2), |D| < 2^(2 (F + G) + 5), and what comes_first() compares
 * is below 2^(4 (F + G) + 15): with the sign at most 3444 bits: DIGITS.
 *
 * Of an orthographic camera, o is a multiple of half of a pixel's size, and that is 2^-219 at least by the same rules, o
 * itself 2^144 at most. So f is a multiple of 2^-519, F <= 146 + 519 and G <= 2 + 300: at most 3,884 bits.
 */
typedef struct {
    Integer w[3], a;
    int unit, unit_f, digits;
#ifdef WITH_PARALLEL_RAYS
    Integer o[3]; /* B^T o, in the unit of f */
#endif
} WholeRay;

#ifdef WITH_PARALLEL_RAYS
/* Of the ray from (x, y, 0). */
static __attribute__((noinline)) WholeRay whole_ray(const Spheres spheres, const double x, const double y, const int first,
                                                    const int second, const int squares) {
    WholeRay ray;
    Span f = span_of_both(span_of(spheres.center_radius[first].w), span_of(spheres.center_radius[second].w));
    Span B = {INT_MAX, INT_MIN}, o = span_of_both(span_of(x), span_of(y));
    for (int k = 0; k < 3; k++) {
        const real4 axis = spheres.camera[k + 1], point = k == 0 ? spheres.camera[0] : spheres.world[k == 1 ? first : second];
        B = span_of_both(B, span_of_both(span_of(axis.x), span_of_both(span_of(axis.y), span_of(axis.z))));
        f = span_of_both(f, span_of_both(span_of(point.x), span_of_both(span_of(point.y), span_of(point.z))));
    }
    const int somewhere = x != 0 || y != 0;
    ray.unit_f = somewhere ? min(f.low, B.low + o.low) : f.low;
    const int high = somewhere ? max(f.high, B.high + o.high + 1) : f.high, bits = high - ray.unit_f + 2 + B.high - B.low + 2;
    const int n = ray.digits = min(DIGITS, ((squares ? 4 * bits + 16 : 2 * bits + 6) + 31) / 32);
    ray.unit = ray.unit_f + B.low;
    set_to(&ray.a, 0, 0, n);
    for (int i = 0; i < 3; i++) {
        const double right = i == 0 ? spheres.camera[1].x : i == 1 ? spheres.camera[1].y : spheres.camera[1].z;
        const double up = i == 0 ? spheres.camera[2].x : i == 1 ? spheres.camera[2].y : spheres.camera[2].z;
        const double back = i == 0 ? spheres.camera[3].x : i == 1 ? spheres.camera[3].y : spheres.camera[3].z;
        Integer axis, along;
        set_to(&ray.w[i], -back, B.low, n);
        add_product(&ray.a, &ray.w[i], &ray.w[i], n);
        set_to(&ray.o[i], 0, 0, n);
        set_to(&axis, right, B.low, n);
        set_to(&along, x, ray.unit_f - B.low, n);
        add_product(&ray.o[i], &axis, &along, n);
        set_to(&axis, up, B.low, n);
        set_to(&along, y, ray.unit_f - B.low, n);
        add_product(&ray.o[i], &axis, &along, n);
    }
    return ray;
}

/* b, D and c of one sphere. */
static __attribute__((noinline)) void whole_quadratic(Integer *b, Integer *D, Integer *c, const Spheres spheres,
                                                      const int index, const WholeRay *ray) {
    const real4 eye = spheres.camera[0], center = spheres.world[index];
    const int n = ray->digits;
    Integer f, other;
    set_to(b, 0, 0, n);
    set_to(c, 0, 0, n);
    for (int i = 0; i < 3; i++) {
        set_to(&f, i == 0 ? eye.x : i == 1 ? eye.y : eye.z, ray->unit_f, n);
        add(&f, &ray->o[i], n);
        negate(&f, n);
        set_to(&other, i == 0 ? center.x : i == 1 ? center.y : center.z, ray->unit_f, n);
        add(&f, &other, n);
        add_product(b, &f, &ray->w[i], n);
        add_product(c, &f, &f, n);
    }
    negate(c, n);
    set_to(&f, spheres.center_radius[index].w, ray->unit_f, n);
    add_product(c, &f, &f, n);
    set_to(D, 0, 0, n);
    add_product(D, b, b, n);
    add_product(D, &ray->a, c, n);
    negate(c, n);
}

/* D, b and c, correctly rounded, of the sphere `index` and the ray from (x, y, 0). */
static __attribute__((noinline)) double3 rounded_quadratic(const Spheres spheres, const int index, const double x,
                                                           const double y) {
    const WholeRay ray = whole_ray(spheres, x, y, index, index, 0);
    Integer b, D, c;
    whole_quadratic(&b, &D, &c, spheres, index, &ray);
    return (double3)(nearest_double(&D, 2 * ray.unit, ray.digits), nearest_double(&b, ray.unit, ray.digits),
                     nearest_double(&c, 2 * ray.unit_f, ray.digits));
}
#else

static __attribute__((noinline)) WholeRay whole_ray(const Spheres spheres, const double x, const double y, const int first,
                                                    const int second, const int squares) {
    WholeRay ray;
    const double d[3] = {x, y, -1};
    Span span_f = {INT_MAX, INT_MIN}, span_B = span_f, span_d = span_f;
    for (int k = 0; k < 3; k++) {
        const real4 axis = spheres.camera[k + 1], point = k == 0 ? spheres.camera[0] : spheres.world[k == 1 ? first : second];
        const double r = spheres.center_radius[k == 1 ? first : second].w;
        span_d = span_of_both(span_d, span_of(d[k]));
        span_B = span_of_both(span_B, span_of_both(span_of(axis.x), span_of_both(span_of(axis.y), span_of(axis.z))));
        span_f = span_of_both(span_f, span_of_both(span_of(point.x), span_of_both(span_of(point.y), span_of(point.z))));
        span_f = span_of_both(span_f, span_of(r));
    }
    const int bits = span_f.high - span_f.low + 1 + span_B.high - span_B.low + span_d.high - span_d.low + 2;
    const int n = ray.digits = min(DIGITS, ((squares ? 4 * bits + 16 : 2 * bits + 6) + 31) / 32);
    ray.unit_f = span_f.low;
    ray.unit = span_f.low + span_B.low + span_d.low;
    set_to(&ray.a, 0, 0, n);
    for (int i = 0; i < 3; i++) {
        set_to(&ray.w[i], 0, 0, n);
        for (int k = 0; k < 3; k++) {
            const real4 axis = spheres.camera[k + 1];
            Integer B, own;
            set_to(&B, i == 0 ? axis.x : i == 1 ? axis.y : axis.z, span_B.low, n);
            set_to(&own, d[k], span_d.low, n);
            add_product(&ray.w[i], &B, &own, n);
        }
        add_product(&ray.a, &ray.w[i], &ray.w[i], n);
    }
    return ray;
}

/* b and D of one sphere. */
static __attribute__((noinline)) void whole_quadratic(Integer *b, Integer *D, const Spheres spheres, const int index,
                                                      const WholeRay *ray) {
    const real4 eye = spheres.camera[0], center = spheres.world[index];
    const double r = spheres.center_radius[index].w;
    const int n = ray->digits;
    Integer f, other, less_c;
    set_to(b, 0, 0, n);
    set_to(&less_c, 0, 0, n);
    for (int i = 0; i < 3; i++) {
        set_to(&f, i == 0 ? center.x : i == 1 ? center.y : center.z, ray->unit_f, n);
        set_to(&other, -(i == 0 ? eye.x : i == 1 ? eye.y : eye.z), ray->unit_f, n);
        add(&f, &other, n);
        add_product(b, &f, &ray->w[i], n);
        add_product(&less_c, &f, &f, n);
    }
    negate(&less_c, n);
    set_to(&f, r, ray->unit_f, n);
    add_product(&less_c, &f, &f, n);
    set_to(D, 0, 0, n);
    add_product(D, b, b, n);
    add_product(D, &ray->a, &less_c, n);
}

/* D and b, correctly rounded, of the sphere `index` and the ray (x, y, -1). */
static __attribute__((noinline)) double2 rounded_quadratic(const Spheres spheres, const int index, const double x,
                                                           const double y) {
    const WholeRay ray = whole_ray(spheres, x, y, index, index, 0);
    Integer b, D;
    whole_quadratic(&b, &D, spheres, index, &ray);
    return (double2)(nearest_double(&D, 2 * ray.unit, ray.digits), nearest_double(&b, ray.unit, ray.digits));
}
#endif

/* -1, 0, 1: whether the ray (x, y, -1), which meets both spheres, meets the first one before the second, at the same
 * point, or after it.
 *
 * a (t - t') is p + v with p = b - b' and v = s sqrt(D) - s' sqrt(D'), where s = -1 from outside and else 1. Where p and
 * v differ in sign, the larger square decides: p^2 - v^2 = P + 2 s s' sqrt(D D') with P = p^2 - D - D'. Where these two
 * differ in sign, the larger square does: P^2 - 4 D D'.
 */
static __attribute__((noinline)) int order_of(const Spheres spheres, const int first, const int second, const double x,
                                              const double y) {
    const WholeRay ray = whole_ray(spheres, x, y, first, second, 1);
    const int n = ray.digits;
#ifdef WITH_PARALLEL_RAYS
    Integer p, b, D, E, P;
    whole_quadratic(&p, &D, &P, spheres, first, &ray);
    const int s = sign_of(&P, n) > 0 ? -1 : 1;
    whole_quadratic(&b, &E, &P, spheres, second, &ray);
    const int t = sign_of(&P, n) > 0 ? -1 : 1;
#else
    const int s = spheres.power[first].x > 0 ? -1 : 1, t = spheres.power[second].x > 0 ? -1 : 1;
    Integer p, b, D, E, P;
    whole_quadratic(&p, &D, spheres, first, &ray);
    whole_quadratic(&b, &E, spheres, second, &ray);
#endif
    negate(&b, n);
    add(&p, &b, n);
    const int sign_D = sign_of(&D, n), sign_E = sign_of(&E, n), sign_p = sign_of(&p, n);
    /* v has the sign of s D - s' E. */
    set_to(&P, 0, 0, n);
    add(&P, &E, n);
    negate(&P, n);
    add(&P, &D, n);
    const int sign_v = s != t ? (s * sign_D != 0 ? s * sign_D : -t * sign_E) : s * sign_of(&P, n);
    if (sign_p * sign_v >= 0) return sign_p != 0 ? sign_p : sign_v;
    /* p^2 - D - E. */
    set_to(&P, 0, 0, n);
    add(&P, &D, n);
    add(&P, &E, n);
    negate(&P, n);
    add_product(&P, &p, &p, n);
    const int sign_P = sign_of(&P, n), sign_root = s * t * sign_D * sign_E;
    if (sign_P * sign_root >= 0) return sign_p * (sign_P != 0 ? sign_P : sign_root);
    set_to(&b, 0, 0, n);
    add_product(&b, &D, &E, n);
    add(&b, &b, n);
    add(&b, &b, n);
    negate(&b, n);
    add_product(&b, &P, &P, n);
    return sign_p * sign_P * sign_of(&b, n);
}

/* Which lanes' pairs, off by this error at most, surely round to their hi. As hi + lo +/- error may be rounded down to
 * the middle between two doubles, it is twice the error; all that is below u of lo is below that. */
static REAL_MASK rounds_to_hi(const Pair x, const REAL error) {
    return (x.hi + (x.lo + 2 * error) == x.hi) & (x.hi + (x.lo - 2 * error) == x.hi);
}

#ifndef WITH_PARALLEL_RAYS
/* D, b and v; the first two correctly rounded. */
typedef struct {
    REAL discriminant, b;
    Real3 v;
} Decided;

/* For the lanes of `wanted`; b only for those of `with_b`. v = (w x X) / a, as w x (f x w) is a f - b w. */
static __attribute__((noinline)) Decided decide(const Spheres spheres, const Ray ray, const Sphere sphere,
                                                const REAL_MASK wanted, const REAL_MASK with_b) {
    const Fine e = fine_quadratic(spheres, ray, sphere);
    const Pair3 across = cross_pairs(e.w, e.X), v = {over(across.x, e.a), over(across.y, e.a), over(across.z, e.a)};
    Decided decided = {e.D.hi, e.b.hi,
                       {dot_axis(spheres.camera[1], v).hi, dot_axis(spheres.camera[2], v).hi,
                        dot_axis(spheres.camera[3], v).hi}};
    const MASK unsure = TO_MASK((wanted & !rounds_to_hi(e.D, e.D_error)) | (with_b & !rounds_to_hi(e.b, e.b_error)));
    if (ANY(unsure)) {
        int index[W], left[W];
        double x[W], y[W], D[W], b[W];
        STORE_LANES(sphere.index, index);
        STORE_LANES(unsure, left);
        STORE_LANES(ray.d.x, x);
        STORE_LANES(ray.d.y, y);
        STORE_LANES(decided.discriminant, D);
        STORE_LANES(decided.b, b);
        for (int lane = 0; lane < W; lane++) {
            if (!left[lane] || index[lane] < 0) continue;
            const double2 whole = rounded_quadratic(spheres, index[lane], x[lane], y[lane]);
            D[lane] = whole.x;
            b[lane] = whole.y;
        }
        decided.discriminant = LOAD_LANES(D);
        decided.b = LOAD_LANES(b);
    }
    return decided;
}
#endif
#endif

#ifndef WITH_PARALLEL_RAYS
/* The discriminant, in the form that is accurate here.
 *
 * c = |C|^2 - r^2 comes from the host, rounded once, so b^2 - a c has the error u (2 |b| |C| |d| + a |c|), while
 * a (r^2 - |v|^2) has u (2 r |C| + r^2) a: they are equal at about |b| = r |d|. So the first form is for rays that
 * start near the sphere or inside of it, and the second one for far and small spheres.
 *
 * The sign decides between hit and miss, that of the exact one as the last stage defines it. Both forms are off by less
 * than 16 u a |C|^2, u = 2^-53: |b| <= |C||d|, b is off by 4 u |C||d| and v by 6 u |C|. That the camera's axes are
 * orthonormal but for k, a few u, adds k a |C|^2. For a grazing ray b^2 + a r^2 is a |C|^2, so a discriminant D below
 * 2^-48 of that is left to decide(), which knows its sign and rounds it correctly. Above it, the error e of D moves
 * sqrt(D) by e / (2 sqrt(D)). In the second form e is at most (14 u + 2 k) a r |C| and sqrt(D) >= 2^-24 sqrt(a) |C|, so
 * that is below 2^-25 r |d| <= 2^-25 |b|. In the first one e is 8 u |b| r |d| + (2 u + k) a |c|, which is below 2^-25 of
 * D, or of b^2 where b is larger than sqrt(D).
 *
 * Nor is the sign of b in doubt then, or its error above 2^-26 of |b| + sqrt(D): if D is beyond the bound, sqrt(D) or,
 * where c > 0, |b| > sqrt(D) is at least 2^-24 r |d|. If it is not, |b| or r |d| is at least |C||d| / 2, and b is below
 * 2^-8 r |d| only if the eye is all but on the sphere and the ray all but along it: then it comes from decide(), too.
 *
 * v is off by 6 u |C|, which turns the normal by 6 u |C| / r. From |C| = 2^21 r on it comes from pairs, too.
 */
static Quadratic quadratic(const Spheres spheres, const Ray ray, const Sphere sphere) {
    Quadratic e;
    const Real3 C = sphere.center;
    const REAL rr = sphere.r * sphere.r;
    e.b = (C.x * ray.d.x + C.y * ray.d.y) - C.z;
    const REAL bb = e.b * e.b, arr = ray.a * rr;
    e.by_b = bb < arr;
#ifdef WITH_INSIDE
    /* Only the near root's normal is beyond; from inside, |b| may round to r |d| where a ray meets the centre. */
    e.by_b = e.by_b | (sphere.c <= 0);
#endif
    e.v.x = e.v.y = e.v.z = 0;
    e.discriminant = bb - ray.a * sphere.c;
    if (ANY(!TO_MASK(e.by_b))) {
        const REAL k = e.b * ray.over_a;
        e.v.x = C.x - k * ray.d.x;
        e.v.y = C.y - k * ray.d.y;
        e.v.z = C.z + k;
#if REAL_BYTES == 4
        /* As v.d = 0, v.z is also v.x d.x + v.y d.y. That beats C.z + b/a near the view's axis, where these nearly
         * cancel, by as much as d.x and d.y are small, and loses to it where they are large. */
        e.v.z = ray.a <= 1.0625f ? e.v.x * ray.d.x + e.v.y * ray.d.y : e.v.z;
#endif
        e.discriminant = e.by_b ? e.discriminant : ray.a * (rr - DOT(e.v, e.v));
    }
#if REAL_BYTES == 8
    const REAL bound = (bb + arr) * 0x1p-48;
    const REAL_MASK unsure = (e.discriminant <= bound) & (e.discriminant >= -bound), tiny = arr < bb * 0x1p-42;
    if (RARELY(ANY(TO_MASK(unsure | tiny)))) {
        const REAL_MASK all_but_on = unsure & (bb < arr * 0x1p-16);
        const Decided decided = decide(spheres, ray, sphere, unsure | tiny, all_but_on);
        e.discriminant = (unsure | tiny) ? decided.discriminant : e.discriminant;
        e.b = all_but_on ? decided.b : e.b;
        e.v.x = tiny ? decided.v.x : e.v.x;
        e.v.y = tiny ? decided.v.y : e.v.y;
        e.v.z = tiny ? decided.v.z : e.v.z;
    }
#endif
    return e;
}

#endif

/* Where a ray meets a sphere: the smallest t > 0, INFINITY if it does not; and the way there from the centre. */
typedef struct {
    REAL t;
    Real3 from_center; /* any, if there is no such t */
} Meeting;

#ifdef WITH_PARALLEL_RAYS
#if REAL_BYTES == 8
/* Puts what pairs and whole numbers say in place of a meeting, in the lanes of `wanted`: D, b and c are correctly rounded,
 * and so no root cancels. */
static __attribute__((noinline)) void decide_meeting(const Spheres spheres, const Ray ray, const Sphere sphere,
                                                     const REAL_MASK wanted, Meeting *at) {
    const Fine e = fine_quadratic(spheres, ray, sphere);
    const Pair3 across = cross_pairs(e.w, e.X), v = {over(across.x, e.a), over(across.y, e.a), over(across.z, e.a)};
    REAL D = e.D.hi, b = e.b.hi, c = e.c.hi;
    const MASK unsure = TO_MASK(wanted & !(rounds_to_hi(e.D, e.D_error) & rounds_to_hi(e.b, e.b_error) &
                                           rounds_to_hi(e.c, e.c_error)));
    if (ANY(unsure)) {
        int index[W], left[W];
        double x[W], y[W], each_D[W], each_b[W], each_c[W];
        STORE_LANES(sphere.index, index);
        STORE_LANES(unsure, left);
        STORE_LANES(ray.o.x, x);
        STORE_LANES(ray.o.y, y);
        STORE_LANES(D, each_D);
        STORE_LANES(b, each_b);
        STORE_LANES(c, each_c);
        for (int lane = 0; lane < W; lane++) {
            if (!left[lane] || index[lane] < 0) continue;
            const double3 whole = rounded_quadratic(spheres, index[lane], x[lane], y[lane]);
            each_D[lane] = whole.x;
            each_b[lane] = whole.y;
            each_c[lane] = whole.z;
        }
        D = LOAD_LANES(each_D);
        b = LOAD_LANES(each_b);
        c = LOAD_LANES(each_c);
    }
    /* With c > 0 the ray starts outside: it is c / (b + root) then. From inside it is b + root or -c / (root - b). */
    const REAL root = sqrt(D), q = fabs(b) + root;
    const REAL_MASK outside = c > 0;
    const REAL t = outside ? c / q : b >= 0 ? q : -c / q;
    const REAL_MASK hit = (D >= 0) & (t > 0) & (!outside | (b > 0));
    at->t = wanted ? (hit ? t : (REAL)INFINITY) : at->t;
    PUT_WHERE(wanted, at->from_center.x, -dot_axis(spheres.camera[1], v).hi);
    PUT_WHERE(wanted, at->from_center.y, -dot_axis(spheres.camera[2], v).hi);
    PUT_WHERE(wanted, at->from_center.z, outside ? root : -root);
}
#endif

/* Of a ray from o = (x, y, 0) along -z, the sphere is a disc: with (x, y) from the ray to its centre C, the ray meets it if
 * D = r^2 - (x^2 + y^2) >= 0, at t = b -/+ sqrt(D) with b = -C.z. The way from the centre to the point is (-x, -y, +/-
 * sqrt(D)), so its z tells from which side the sphere is met.
 *
 * What is meant is exactly what fine_quadratic() says, f and w in the world. With f = p R + q U + g K along the camera's
 * axes R, U and K, which are orthonormal but for k, 6 u of their squares and 4 u of their products, with u = 2^-53,
 * X.X is (p^2 + q^2) (1 +/- 16 u), and p is f.R +/- (6 u |p| + 4 u |q| + 4 u |g|). f.R is C.x, which was rounded once, less o.x,
 * but for 6 u |o.x| + 4 u |o.y|. All that, and the rounding of x, is below 23 u s, with s = |C|_1 + |o|_1, as |f|_1 is at most 1.8 s: x, y
 * and b are off by less than e = 2^-48 s. So X.X is off by less than 2 e (|x| + |y| + e) and 19 u (x^2 + y^2), and
 * D by that and 8 u r^2: D_error.
 *
 * Where D is above that, D_error and e are below 2^-26 of root m and m, with m the least of r and both |t|, roots are off by 2^-26 m
 * and t by 2^-24.7 of itself. So it is known which t is met, and n is right to 2^-25. */
static Meeting sphere_meet(const Spheres spheres, const Ray ray, const Sphere sphere) {
    const Real3 C = sphere.center;
    const REAL x = C.x - ray.o.x, y = C.y - ray.o.y, b = -C.z, r = sphere.r, rr = r * r, XX = x * x + y * y;
    Meeting at;
#if REAL_BYTES == 8
    const REAL D = rr - XX, root = sqrt(D), first = b - root, last = b + root;
    const REAL_MASK outside = first > 0;
    const REAL t = outside ? first : last;
    at.t = ((D >= 0) & (t > 0)) ? t : (REAL)INFINITY;
    at.from_center.z = outside ? root : -root;
#else
    /* |C|^2 - r^2 comes from the host: c is what the power of o has more than that. It serves where o is near the eye
     * beside the sphere's size, which is where b - root cancels. */
    const REAL c = sphere.c + (ray.o.x * (ray.o.x - 2 * C.x) + ray.o.y * (ray.o.y - 2 * C.y)), bb = b * b;
    const REAL_MASK near_eye = ray.o.x * ray.o.x + ray.o.y * ray.o.y < rr;
    const REAL D = (near_eye & (bb < rr)) ? bb - c : rr - XX, root = sqrt(D), q = fabs(b) + root;
    const REAL_MASK outside = near_eye ? c > 0 : b > root;
    const REAL robust = outside ? c / q : b >= 0 ? q : -c / q, direct = outside ? b - root : b + root;
    const REAL t = near_eye ? robust : direct;
    at.t = ((D >= 0) & (t > 0) & (!outside | (b > 0)) & (rr > 0)) ? t : (REAL)INFINITY;
    at.from_center.z = outside ? root : -root;
#endif
    at.from_center.x = -x;
    at.from_center.y = -y;
#if REAL_BYTES == 8
    const REAL e = 0x1p-48 * (((fabs(C.x) + fabs(C.y)) + fabs(C.z)) + ray.reach);
    const REAL D_error = 2 * e * ((fabs(x) + fabs(y)) + e) + 0x1p-48 * (rr + XX);
    const REAL near = fabs(first), far = fabs(last), least = near < far ? near : far, m = least < r ? least : r;
    const REAL_MASK sure = (D > D_error) & (D_error <= 0x1p-26 * root * m) & (e <= 0x1p-26 * m);
    const REAL_MASK unsure = !(sure | (D < -D_error));
    if (RARELY(ANY(TO_MASK(unsure)))) decide_meeting(spheres, ray, sphere, unsure, &at);
#endif
    return at;
}
#else

/* A discriminant of 0 is a hit. q = b + sign(b) sqrt(discriminant) does not cancel, and the roots are c/q and q/a. With
 * c > 0 the eye is outside: both roots have the sign of b, and c/q is the nearer one if b > 0. With c < 0 one root is
 * positive: q/a if b >= 0, else c/q. With c = 0 the eye is on the sphere, where the root 0 is no hit. Written such that
 * a NaN is a miss.
 *
 * Double has room to do without the division, which takes as long as all the rest: with a c > 2^-10 b^2 the root is
 * below (1 - 2^-11) b, and b - root loses 11 of 53 bits. Nor does an error of the discriminant D count for more: with
 * D <= b^2 / 4, b - root is b/2 or more, so 2^-26 of b (see quadratic) is 2^-25 of it; above that D is off by less than
 * 20 u b^2, as |C| |d| <= sqrt(2) |b|, and the root by 20 u b, which is below 2^-37 of b - root.
 *
 * From the centre to the point is t d - C. Where the discriminant came from v, t = (b - root)/a and it is
 * -(v + root/a d), without the cancellation of t d and C.
 */
static Meeting sphere_meet(const Spheres spheres, const Ray ray, const Sphere sphere) {
    const Quadratic e = quadratic(spheres, ray, sphere);
    const REAL root = sqrt(e.discriminant);
    const REAL_MASK behind = e.b < 0;
    REAL t;
#if REAL_BYTES == 8
    t = (e.b - root) * ray.over_a;
    const REAL_MASK cancels = e.by_b | !(ray.a * sphere.c > 0x1p-10 * (e.b * e.b));
    if (ANY(TO_MASK(cancels)))
#endif
    {
        const REAL q = behind ? e.b - root : e.b + root;
        const REAL_MASK first = (sphere.c > 0) | behind;
        const REAL robust = (first ? sphere.c : q) / (first ? q : ray.a);
#if REAL_BYTES == 8
        t = cancels ? robust : t;
#else
        t = robust;
#endif
    }
    REAL_MASK hit = (e.discriminant >= 0) & (t > 0);
#if REAL_BYTES == 4
    hit = hit & (sphere.r * sphere.r > 0); /* in float, the square of a radius may vanish beside the scene's size */
#endif
    Meeting at;
    at.t = hit ? t : (REAL)INFINITY;
    const REAL s = root * ray.over_a;
    at.from_center.x = -(e.v.x + s * ray.d.x);
    at.from_center.y = -(e.v.y + s * ray.d.y);
    at.from_center.z = s - e.v.z;
    if (ANY(TO_MASK(e.by_b))) {
        at.from_center.x = e.by_b ? t * ray.d.x - sphere.center.x : at.from_center.x;
        at.from_center.y = e.by_b ? t * ray.d.y - sphere.center.y : at.from_center.y;
        at.from_center.z = e.by_b ? -t - sphere.center.z : at.from_center.z;
    }
    return at;
}
#endif

#if REAL_BYTES == 8
/* t of a ray that is known to hit, in pairs, and a bound of its error. */
typedef struct {
    Pair t;
    REAL error;
} FineT;

/* D is off by D_error, its root by the lesser of D_error / sqrt(D) and sqrt(D_error), and q = |b| + sqrt(D) by that and
 * b_error. What a, c and the division add is below 2^-97 of t: see fine_quadratic(). Twice the sum of the shares is a
 * bound as long as it is below 1/2, and beyond that it is so large that it decides nothing. */
static __attribute__((noinline)) FineT fine_t(const Spheres spheres, const Ray ray, const Sphere sphere) {
    const Fine e = fine_quadratic(spheres, ray, sphere);
    const REAL_MASK some = e.D.hi > 0;
    const REAL near = some ? sqrt(e.D.hi) : (REAL)0;
    const Pair rest = minus(e.D, two_product(near, near));
    const Pair root = two_sum(near, some ? (rest.hi + rest.lo) / (2 * near) : (REAL)0);
    const REAL_MASK behind = e.b.hi < 0, first = (e.c.hi > 0) | behind;
    const Pair sum = plus(e.b, root), difference = minus(e.b, root);
    const Pair q = {behind ? difference.hi : sum.hi, behind ? difference.lo : sum.lo};
    const Pair numerator = {first ? e.c.hi : q.hi, first ? e.c.lo : q.lo};
    const Pair denominator = {first ? q.hi : e.a.hi, first ? q.lo : e.a.lo};
    const REAL by_root = e.D_error / near, least = sqrt(e.D_error), root_error = by_root < least ? by_root : least;
    FineT t = {over(numerator, denominator), 0};
    t.error = 2 * fabs(t.t.hi) * ((e.b_error + root_error) / fabs(q.hi) + 0x1p-97);
#ifdef WITH_PARALLEL_RAYS
    /* The host knows no c of such a ray. */
    t.error += first ? 2 * fabs(t.t.hi) * (e.c_error / fabs(e.c.hi)) : (REAL)0;
    t.error = fabs(e.c.hi) > e.c_error ? t.error : (REAL)INFINITY;
#endif
    return t;
}

/* Which of the lanes of `wanted`, whose rays hit both spheres, hit A before B; where they are hit at once, `tie` says. */
static REAL_MASK sphere_comes_first(const Spheres spheres, const Ray ray, const Sphere A, const Sphere B,
                                    const REAL_MASK tie, const REAL_MASK wanted) {
    const FineT a = fine_t(spheres, ray, A), b = fine_t(spheres, ray, B);
    const REAL gap = (a.t.hi - b.t.hi) + (a.t.lo - b.t.lo), error = a.error + b.error;
    const MASK unsure = TO_MASK(wanted & !((gap > error) | (gap < -error)));
    if (!ANY(unsure)) return gap < 0;
    int first[W], second[W], left[W];
    double x[W], y[W], order[W];
    STORE_LANES(A.index, first);
    STORE_LANES(B.index, second);
    STORE_LANES(unsure, left);
    STORE_LANES(ray.d.x, x);
    STORE_LANES(ray.d.y, y);
    STORE_LANES(gap, order);
#ifdef WITH_PARALLEL_RAYS
    STORE_LANES(ray.o.x, x);
    STORE_LANES(ray.o.y, y);
#endif
    for (int lane = 0; lane < W; lane++)
        if (left[lane] && second[lane] >= 0) order[lane] = order_of(spheres, first[lane], second[lane], x[lane], y[lane]);
    const REAL exact = LOAD_LANES(order);
    return (exact < 0) | ((exact == 0) & tie);
}
#endif

/* The outward unit normal. From the centre to the point is r long but for rounding, so after the division by r one
 * Newton step n (3 - n.n)/2 makes it unit to the last digits. */
static Real3 sphere_surface(const Sphere sphere, const Real3 from_center) {
    Real3 n = {from_center.x * sphere.over_r, from_center.y * sphere.over_r, from_center.z * sphere.over_r};
    const REAL unit = (real)0.5 * ((real)3 - DOT(n, n));
    n.x *= unit;
    n.y *= unit;
    n.z *= unit;
    return n;
}

/* Where a shadow ray starts: a point P of a sphere. P itself, rounded, is used by filters only. */
typedef struct {
    Sphere own;
    Real3 p;   /* from the own sphere's centre to P */
    REAL side; /* 1, or -1 where the ray that found P came from inside */
#ifdef WITH_SHAPES
    REAL_MASK stretched; /* whether it is an ellipsoid or a triangle; then p is not r long */
    REAL support;        /* n.p, with n the normal: how far the plane across n through P is from the centre */
#endif
#ifdef WITH_TRIANGLES
    INT index;          /* of the own surface, and as in Leaving: */
    Real3 q;            /* of a sphere the normal */
    Real3 anchor, step; /* its centre or corner in the world, and from there to P */
    REAL reach;
#endif
#if REAL_BYTES == 4
    Real3 from_eye;      /* P itself, in camera space */
    REAL_MASK near_eye;  /* whether that is the shorter way */
#endif
} Start;

/* side: as in Start; point: P itself, in camera space. */
static Start start_of(const Sphere own, const Real3 normal, const REAL side, const Real3 point) {
    Start P = {own, {own.r * normal.x, own.r * normal.y, own.r * normal.z}, side};
#ifdef WITH_SHAPES
    P.stretched = 0;
    P.support = own.r;
#endif
#if REAL_BYTES == 4
    P.from_eye = point;
    P.near_eye = DOT(point, point) < own.r * own.r;
#endif
    return P;
}

/* Where a ray from the eye meets its sphere at t. */
static Start start_at(const Ray ray, const Sphere own, const Real3 normal, const REAL t) {
    const Real3 point = POINT_OF(ray, t);
#if defined(WITH_INSIDE) && defined(WITH_PARALLEL_RAYS)
    return start_of(own, normal, normal.z >= 0 ? (REAL)1 : (REAL)-1, point);
#elif defined(WITH_INSIDE)
    return start_of(own, normal, own.c > 0 ? (REAL)1 : (REAL)-1, point);
#else
    return start_of(own, normal, 1, point);
#endif
}

/* From P to a point. With C the own centre, it is (point - C) - p, which never forms P. In float the error of that is
 * u max(|C|, r), so from a large sphere under the camera it is point - P, with the error u |P|. */
static Real3 towards(const Start P, const Real3 point) {
    const Real3 C = P.own.center;
    Real3 w = {(point.x - C.x) - P.p.x, (point.y - C.y) - P.p.y, (point.z - C.z) - P.p.z};
#if REAL_BYTES == 4
    w.x = P.near_eye ? point.x - P.from_eye.x : w.x;
    w.y = P.near_eye ? point.y - P.from_eye.y : w.y;
    w.z = P.near_eye ? point.z - P.from_eye.z : w.z;
#endif
    return w;
}

/* |f|^2 - r^2, the power of P, given f = B.center - P. With D = B.center - C it is also D.(D - 2p) + (R - r)(R + r), as
 * |p| = R: exact for concentric spheres, even one ulp apart. The errors go with the size of the terms. */
static REAL power_of(const Start P, const Sphere B, const Real3 f) {
    const Real3 C = P.own.center;
    const Real3 D = {B.center.x - C.x, B.center.y - C.y, B.center.z - C.z};
    const Real3 g = {f.x - P.p.x, f.y - P.p.y, f.z - P.p.z};
    const REAL ff = DOT(f, f), rr = B.r * B.r;
    const REAL shift = DOT(D, g), step = (P.own.r - B.r) * (P.own.r + B.r);
    const REAL size = (shift < 0 ? -shift : shift) + (step < 0 ? -step : step);
#ifdef WITH_SHAPES
    const REAL c = ((size < ff + rr) & !P.stretched) ? shift + step : ff - rr;
#else
    const REAL c = size < ff + rr ? shift + step : ff - rr;
#endif
#if REAL_BYTES == 4
    /* |B.center|^2 - r^2 comes from the host: what is added to it is small where P is near the eye. */
    const Real3 h = {P.from_eye.x - 2 * B.center.x, P.from_eye.y - 2 * B.center.y, P.from_eye.z - 2 * B.center.z};
    return P.near_eye ? B.c + DOT(P.from_eye, h) : c;
#else
    return c;
#endif
}

/* Whether a sphere B, not the own one, stands between P and a light, and so stops the light.
 *
 * f: from P to the centre of B; w: from P to the light; c: the power of P; r: the radius of B; far: 0 for a parallel light, where w has length 1 and every t > 0 counts; else 1, and t in
 * (0, 1) counts. outside: the sign of |L - C_B|^2 - r_B^2, computed exactly by the host; 1 for a parallel light.
 * The equation is a t^2 - 2 b t + c = 0, a = w.w, b = f.w, c = |f|^2 - r_B^2. No root is computed,
 * only signs: of the product c of the roots, of their sum 2b, and of a - 2b + c = |L - C_B|^2 - r_B^2, the value at
 * t = 1.
 *   c > 0, P outside: two roots of one sign if the discriminant is >= 0; positive if b > 0; the first is below 1 if
 *          the light is inside, or if their mean b/a is below 1.
 *   c < 0, P inside: one positive root, below 1 if the light is strictly outside.
 *   c = 0, P on B: the root 0 does not count, the other one is 2b/a.
 */
static REAL_MASK stands_between(const Real3 f, const Real3 w, const REAL c, const REAL r, const int far,
                                const int light_side) {
    const REAL a = DOT(w, w), b = DOT(f, w);
    const Real3 cross = {f.y * w.z - f.z * w.y, f.z * w.x - f.x * w.z, f.x * w.y - f.y * w.x};
    const REAL bb = b * b, arr = a * (r * r);
    const REAL_MASK meets = (bb < arr ? bb - a * c : arr - DOT(cross, cross)) >= 0;
    const REAL_MASK ahead = b > 0;
    const REAL_MASK enters = (c > 0) & meets & ahead;
    const REAL_MASK leaves = (c < 0) | ((c == 0) & ahead);
    if (light_side < 0) return c > 0; /* P outside and the light inside: surely one root between */
    if (light_side == 0) return enters & (b < a);
    return far ? (enters & (b < a)) | leaves : enters | leaves;
}

static REAL_MASK sphere_stops(const Start P, const Sphere B, const Real3 w, const int far, const int light_side) {
    const Real3 f = towards(P, B.center);
    return stands_between(f, w, power_of(P, B, f), B.r, far, light_side);
}

/* cylinder.cl: the cylinder with flat ends, decided in `real`, then in pairs.
 *
 * A cylinder is the points p with |(p - S) x u| <= r |u| and 0 <= (p - S).u <= u.u: the middle S of one end, the axis u
 * from there to the middle E of the other one, and the radius r, exactly the numbers of the file. With f = S - O, a ray
 * from O along w is within the endless cylinder where a t^2 - 2 b t + c <= 0, with
 *
 *     F = f x u,  G = w x u,  a = G.G,  b = F.G,  c = F.F - r^2 u.u,  D = b^2 - a c = u.u (r^2 a - V^2),  V = u.(f x
 * w),
 *
 * and between the planes of the ends where 0 <= t g - h <= u.u, with g = w.u and h = f.u. Where it passes a plane, g t
 * = N with N = h or k = h + u.u, it is on the disc there if q = |N G - g F|^2 - r^2 u.u g^2 <= 0. The middle of the way
 * through the endless cylinder, t = b / a, is between the planes if g b - a h >= 0 and a k - g b >= 0. So these signs
 * say all: a ray meets the solid if it meets a disc, or the endless cylinder with that middle between the planes; it
 * enters by the first disc if it meets that, else by the side, and leaves likewise. On the rim, it is the disc that is
 * met. cltrace/reference/cylinder.py has the same in exact numbers.
 */

/* One cylinder in all lanes, or each lane's own one. Lengths of the world. Where `real` is float, u is of length 1. */
typedef struct {
    Real3 start, end, u; /* end: not where `real` is float */
    REAL r, span;        /* span: u.u; where `real` is float, |E - S| */
} Rod;

static Rod rod_at(const Geometry geometry, const int number) {
    const real4 s = geometry.rod[2 * number], e = geometry.rod[2 * number + 1];
    Rod rod = {{s.x, s.y, s.z}, {e.x, e.y, e.z}, {e.x, e.y, e.z}, s.w, e.w};
    if (REAL_BYTES == 8) {
        rod.u.x = e.x - s.x;
        rod.u.y = e.y - s.y;
        rod.u.z = e.z - s.z;
        rod.span = DOT(rod.u, rod.u);
    }
    return rod;
}

/* Each lane's cylinder. Lanes with a negative number get any one. */
static Rod rods_of(const Geometry geometry, const INT number) {
    int one = LARGEST(number);
    Rod own = rod_at(geometry, max(one, 0));
    INT left = number == one ? (INT)-1 : number;
    while (ANY(left >= 0)) {
        one = LARGEST(left);
        const REAL_MASK here = TO_REAL_MASK(left == one);
        const Rod rod = rod_at(geometry, one);
        PUT3(PUT_WHERE, here, own.start, rod.start);
        PUT3(PUT_WHERE, here, own.end, rod.end);
        PUT3(PUT_WHERE, here, own.u, rod.u);
        PUT_WHERE(here, own.r, rod.r);
        PUT_WHERE(here, own.span, rod.span);
        left = left == one ? (INT)-1 : left;
    }
    return own;
}

static Real3 rod_cross(const Real3 a, const Real3 b) {
    const Real3 c = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return c;
}

/* Two directions across each lane's axis, e1 = x x u, with the coordinate axis x that u is furthest from, and e2 = u x
 * e1. */
typedef struct {
    Real3 first, second;
} Across;

static Across across_of(const Rod rod) {
    const REAL x = fabs(rod.u.x), y = fabs(rod.u.y), z = fabs(rod.u.z);
    const REAL_MASK by_x = (x <= y) & (x <= z), by_y = !by_x & (y <= z);
    Across e;
    e.first.x = by_x ? (REAL)0 : by_y ? rod.u.z : -rod.u.y;
    e.first.y = by_x ? -rod.u.z : by_y ? (REAL)0 : rod.u.x;
    e.first.z = by_x ? rod.u.y : by_y ? -rod.u.x : (REAL)0;
    e.second = rod_cross(rod.u, e.first);
    return e;
}

/* Where each lane's point q is: by its part, see cylinder_put(); q.y and q.z count e1 and e2. */
#define ON_START(q) ((q).x < 0)
#define ON_END(q) ((q).x > 1)

/* A ray, for the decisions here: it starts at anchor + step, of which the step is off by less than 2^-49 of `reach`,
 * and leads along w, which is off by less than 2^-49 of w1. own: lanes that start on the cylinder itself, at its point
 * q; inner: whether they leave it on its inside. */
typedef struct {
    Real3 anchor, step, w;
    REAL reach, w1;
    REAL_MASK own, inner;
    Real3 q;
} RodRay;

static RodRay rod_ray_of(const Leaving ray, const INT index) {
    const RodRay way = {ray.center, ray.p, ray.w, ray.reach, ray.w1, TO_REAL_MASK(ray.own == index), ray.inner, ray.q};
    return way;
}

/* The numbers above; of numbers that are vectors, the sums of the magnitudes. first, second: q of the disc at S and at
 * E; after, before: where the middle is. */
typedef struct {
    REAL s, u1, w1, F1, G1; /* sizes: s = |f| + reach */
    REAL uu, rr, span;
    REAL a, b, c, V, D, g, h, k, first, second, after, before;
    REAL v1, v2; /* of N G - g F of the two discs */
} RodValues;

#define ROD_SIZE(v) ((fabs((v).x) + fabs((v).y)) + fabs((v).z))

/* N G - g F, of which q is the square less that of the rim. */
static Real3 rod_disc(const Real3 F, const Real3 G, const REAL N, const REAL g) {
    const Real3 v = {N * G.x - g * F.x, N * G.y - g * F.y, N * G.z - g * F.z};
    return v;
}

static RodValues rod_values(const RodRay ray, const Rod rod) {
    const Real3 f = {(rod.start.x - ray.anchor.x) - ray.step.x, (rod.start.y - ray.anchor.y) - ray.step.y,
                     (rod.start.z - ray.anchor.z) - ray.step.z};
    const Real3 u = rod.u, w = ray.w;
    const Real3 F = rod_cross(f, u), G = rod_cross(w, u), X = rod_cross(f, w);
    RodValues e;
    e.s = ROD_SIZE(f) + ray.reach;
    e.u1 = ROD_SIZE(u);
    e.w1 = ray.w1;
    e.F1 = ROD_SIZE(F);
    e.G1 = ROD_SIZE(G);
    e.uu = DOT(u, u);
    e.rr = rod.r * rod.r;
    e.span = rod.span;
    e.a = DOT(G, G);
    e.b = DOT(F, G);
    e.g = DOT(w, u);
    e.V = DOT(u, X);
    const REAL VV = e.V * e.V;
    /* The point of the own surface is on the plane of its end, or on the side. */
    e.h = (ray.own & ON_START(ray.q)) ? (REAL)0 : (ray.own & ON_END(ray.q)) ? -e.span : DOT(f, u);
    e.k = (ray.own & ON_END(ray.q)) ? (REAL)0 : e.h + e.span;
    const REAL_MASK on_side = ray.own & !ON_START(ray.q) & !ON_END(ray.q);
    e.c = on_side ? (REAL)0 : DOT(F, F) - e.rr * e.uu;
    e.D = on_side ? e.b * e.b : e.uu * (e.a * e.rr - VV);
    const Real3 v1 = rod_disc(F, G, e.h, e.g), v2 = rod_disc(F, G, e.k, e.g);
    const REAL rim = e.rr * e.uu * (e.g * e.g);
    e.v1 = ROD_SIZE(v1);
    e.v2 = ROD_SIZE(v2);
    e.first = DOT(v1, v1) - rim;
    e.second = DOT(v2, v2) - rim;
    e.after = e.g * e.b - e.a * e.h;
    e.before = e.a * e.k - e.g * e.b;
    return e;
}

/* What a ray does, by the signs of these numbers, -1, 0 or 1 each. */
typedef struct {
    REAL a, b, c, D, g, h, k, first, second, after, before;
} RodSigns;

static REAL rod_sign(const REAL value) {
    return value > 0 ? (REAL)1 : value < 0 ? (REAL)-1 : (REAL)0;
}

static RodSigns signs_of_values(const RodValues e) {
    const RodSigns signs = {rod_sign(e.a),      rod_sign(e.b),     rod_sign(e.c),     rod_sign(e.D),
                            rod_sign(e.g),      rod_sign(e.h),     rod_sign(e.k),     rod_sign(e.first),
                            rod_sign(e.second), rod_sign(e.after), rod_sign(e.before)};
    return signs;
}

/* What follows from them. out: it starts outside, and enters where it is met; else it leaves there. flat: it is met on
 * a disc; last: which is the one at E. */
typedef struct {
    REAL_MASK hit, out, flat, last;
} RodVerdict;

static RodVerdict rod_verdict(const RodRay ray, const RodSigns is) {
    const REAL_MASK forth = is.g > 0, steep = is.g != 0;
    const REAL near = forth ? is.first : is.second, far = forth ? is.second : is.first;
    const REAL_MASK in_near = steep & (near <= 0), in_far = steep & (far <= 0);
    const REAL_MASK by_side = (is.a > 0) & (is.D >= 0) & (is.after >= 0) & (is.before >= 0);
    const REAL to_near = forth ? is.h : -is.k, to_far = forth ? is.k : -is.h;
    const REAL_MASK ahead = in_far ? to_far > 0 : (is.c < 0) | (is.b > 0);
    RodVerdict found;
    found.out = !ray.own & (in_near ? to_near > 0 : (is.c > 0) & (is.b > 0));
    found.flat = found.out ? in_near : in_far;
    found.last = found.out ? !forth : forth;
    found.hit = ray.own ? ray.inner & ahead : (in_near | in_far | by_side) & (found.out | ahead);
    return found;
}

/* t by the end that is met: N / g, c / q from outside, q / a from inside, or backwards, -c / q. */
static REAL rod_t(const RodValues e, const RodVerdict is) {
    const REAL q = fabs(e.b) + sqrt(e.D > 0 ? e.D : (REAL)0);
    const REAL_MASK by_q = is.out | (e.b < 0);
    const REAL round = (by_q ? fabs(e.c) : q) / (by_q ? q : e.a);
    return is.flat ? (is.last ? e.k : e.h) / e.g : round;
}

#if REAL_BYTES == 8
/* What the numbers are off by.
 *
 * With v = 2^-53, each coordinate of f is off by 2^-48 s, see RodRay, u by v of itself. So each coordinate of F is off
 * by 2^-47 s u1, of G by 2^-48 w1 u1, V by 2^-46 s w1 u1, g by 2^-48 w1 u1 and h by 2^-47 s u1. All others follow from
 * these: a product of two numbers is off by each one's error times the other one, by both errors' product, and by
 * roundings, which for sums of up to four products are below 2^-50 of all magnitudes. In pairs, f is off by 2^-99
 * s and w by 2^-101 w1, and what is computed by less than 2^-100: with small = 2^-49, all of that is less than so many
 * times what it is in double. */
typedef struct {
    REAL a, b, c, D, g, h, k, first, second, after, before;
} RodErrors;

/* A number and what it is off by. */
typedef struct {
    REAL value, error;
} RodNumber;

/* What x y is off by; round: roundings as a share. */
static REAL rod_product_error(const RodNumber x, const RodNumber y, const REAL round) {
    return fabs(x.value) * y.error + fabs(y.value) * x.error + x.error * y.error + round * fabs(x.value * y.value);
}

/* What F and G in each coordinate, a disc's N, and g are off by; and roundings as a share. */
typedef struct {
    REAL F, G, N, g, round;
} RodOff;

/* Of a disc's q. N, v: as in rod_disc(), v as a size. */
static REAL rod_disc_error(const RodValues e, const REAL N, const REAL v, const RodOff off) {
    const REAL by = (fabs(N) * off.G + e.G1 * off.N + fabs(e.g) * off.F + e.F1 * off.g) +
                    (2 * (off.N * off.G + off.g * off.F) + off.round * (fabs(N) * e.G1 + fabs(e.g) * e.F1));
    const REAL rim = e.rr * e.uu;
    return (2 * v * by + 3 * by * by) + rim * (2 * fabs(e.g) * off.g + off.g * off.g) +
           2 * off.round * (v * v + rim * (e.g * e.g));
}

static RodErrors rod_errors(const RodValues e, const REAL small) {
    const REAL round = small * 0x1p-50, sizes = small * (e.w1 * e.u1);
    const REAL g_error = 0x1p-48 * (small * (e.w1 * e.u1)), h_error = small * 0x1p-47 * (e.s * e.u1);
    RodOff off = {small * 0x1p-47 * (e.s * e.u1), 0x1p-48 * sizes, 0, g_error, round};
    const REAL FF = e.F1 * e.F1, GG = e.G1 * e.G1, V_error = 0x1p-46 * sizes * e.s;
    RodErrors by;
    by.a = (2 * e.G1 * off.G + 3 * off.G * off.G) + round * GG;
    by.b = (e.F1 * off.G + e.G1 * off.F + 3 * off.F * off.G) + round * (e.F1 * e.G1);
    by.c = (2 * e.F1 * off.F + 3 * off.F * off.F) + round * (FF + e.rr * e.uu);
    by.D = e.uu * (e.rr * by.a + (2 * fabs(e.V) * V_error + V_error * V_error)) +
           4 * round * e.uu * (e.a * e.rr + e.V * e.V);
    by.g = off.g;
    by.h = h_error;
    by.k = h_error + round * e.span;
    off.N = by.h;
    by.first = rod_disc_error(e, e.h, e.v1, off);
    off.N = by.k;
    by.second = rod_disc_error(e, e.k, e.v2, off);
    const RodNumber a = {e.a, by.a}, b = {e.b, by.b}, g = {e.g, by.g}, h = {e.h, by.h}, k = {e.k, by.k};
    const REAL gb = rod_product_error(g, b, round);
    by.after = gb + rod_product_error(a, h, round);
    by.before = gb + rod_product_error(a, k, round);
    return by;
}

/* What is exactly 0 at the own point has no error. */
static RodErrors rod_errors_at(const RodRay ray, const RodValues e, const REAL small) {
    RodErrors by = rod_errors(e, small);
    const REAL_MASK start = ray.own & ON_START(ray.q), end = ray.own & ON_END(ray.q), side = ray.own & !start & !end;
    by.h = start ? (REAL)0 : by.h;
    by.k = end ? (REAL)0 : by.k;
    by.c = side ? (REAL)0 : by.c;
    return by;
}

/* Within its error, a number's sign counts as 0. */
static RodSigns signs_within(const RodValues e, const RodErrors by) {
    const RodSigns signs = {sign_from(e.a, by.a),         sign_from(e.b, by.b),          sign_from(e.c, by.c),
                            sign_from(e.D, by.D),         sign_from(e.g, by.g),          sign_from(e.h, by.h),
                            sign_from(e.k, by.k),         sign_from(e.first, by.first),  sign_from(e.second, by.second),
                            sign_from(e.after, by.after), sign_from(e.before, by.before)};
    return signs;
}

/* Whether the signs that doubles are sure of, where 0 is unsure, say that a ray meets nothing. */
static REAL_MASK rod_passes(const RodRay ray, const RodSigns is) {
    const REAL_MASK beside = (is.first > 0) & (is.second > 0) & ((is.after < 0) | (is.before < 0));
    const REAL_MASK beyond = ((is.g > 0) & (is.k < 0)) | ((is.g < 0) & (is.h > 0));
    return ray.own ? !ray.inner : (is.D < 0) | beside | beyond | ((is.c > 0) & (is.b < 0));
}

/* Whether a verdict by such signs is that of the exact ones, and rod_t() is right to 2^-24. */
static REAL_MASK rod_is_sure(const RodRay ray, const RodValues e, const RodErrors by, const RodSigns is,
                             const RodVerdict found) {
    const REAL_MASK discs = (is.first > 0) & (is.second > 0), forth = is.g > 0;
    const REAL_MASK known = (is.first != 0) & (is.second != 0) & (discs | (is.g != 0));
    const REAL_MASK line = ray.own | !discs | ((is.a > 0) & (is.D > 0) & (is.after > 0) & (is.before > 0));
    const REAL_MASK in_near = (is.g != 0) & ((forth ? is.first : is.second) < 0),
                    in_far = (is.g != 0) & ((forth ? is.second : is.first) < 0);
    const REAL_MASK start = ray.own | (in_near ? (forth ? is.h : is.k) != 0 : (is.c < 0) | ((is.c > 0) & (is.b != 0)));
    const REAL_MASK end = found.out | (in_far ? (forth ? is.k : is.h) != 0 : ((is.c < 0) | ray.own) & (is.b != 0));
    const REAL root = sqrt(e.D > 0 ? e.D : (REAL)0), q = fabs(e.b) + root;
    const REAL N = found.last ? e.k : e.h, N_error = found.last ? by.k : by.h;
    const REAL_MASK flat_t = (fabs(N) > 0x1p26 * N_error) & (fabs(e.g) > 0x1p26 * by.g);
    const REAL_MASK by_c = found.out | (e.b < 0);
    const REAL_MASK side_t = (by.D <= 0x1p-26 * root * q) & (by.b <= 0x1p-27 * q) &
                             (by_c ? fabs(e.c) > 0x1p26 * by.c : by.a <= 0x1p-27 * e.a);
    return known & line & start & end & (found.flat ? flat_t : side_t);
}

/* The same in pairs: the numbers, a sum of which is made of vectors. */
typedef struct {
    Pair a, b, c, D, g, h, k;
} RodPairs;

/* |N G - g F|^2. */
static Pair rod_fine_disc(const Pair3 F, const Pair3 G, const Pair N, const Pair g) {
    const Pair3 v = {minus(times(N, G.x), times(g, F.x)), minus(times(N, G.y), times(g, F.y)),
                     minus(times(N, G.z), times(g, F.z))};
    return dot_pairs(v, v);
}

/* A ray in pairs, as FinePath. */
typedef struct {
    Pair3 step, w;
} RodFineRay;

/* Puts the values of pairs into `e`, of which the sizes stay. */
static __attribute__((noinline)) RodPairs rod_pairs(const RodRay ray, const RodFineRay fine, const Rod rod,
                                                    RodValues *e) {
    const Real3 S = rod.start, E = rod.end, O = ray.anchor;
    const Pair3 u = {two_sum(E.x, -S.x), two_sum(E.y, -S.y), two_sum(E.z, -S.z)}, w = fine.w;
    const Pair3 f = {minus(two_sum(S.x, -O.x), fine.step.x), minus(two_sum(S.y, -O.y), fine.step.y),
                     minus(two_sum(S.z, -O.z), fine.step.z)};
    const Pair none = pair(0, 0), rr = two_product(rod.r, rod.r);
    const Pair3 F = cross_pairs(f, u), G = cross_pairs(w, u);
    const Pair uu = dot_pairs(u, u), V = dot_pairs(u, cross_pairs(f, w)), VV = times(V, V);
    const Pair rim = times(rr, uu), back = {-uu.hi, -uu.lo};
    const REAL_MASK on_start = ray.own & ON_START(ray.q), on_end = ray.own & ON_END(ray.q);
    const REAL_MASK on_side = ray.own & !on_start & !on_end;
    RodPairs p;
    p.a = dot_pairs(G, G);
    p.b = dot_pairs(F, G);
    p.g = dot_pairs(w, u);
    p.h = choose_pair(on_start, none, choose_pair(on_end, back, dot_pairs(f, u)));
    p.k = choose_pair(on_end, none, plus(p.h, uu));
    p.c = choose_pair(on_side, none, minus(dot_pairs(F, F), rim));
    p.D = choose_pair(on_side, times(p.b, p.b), times(uu, minus(times(p.a, rr), VV)));
    e->a = p.a.hi;
    e->b = p.b.hi;
    e->c = p.c.hi;
    e->V = V.hi;
    e->D = p.D.hi;
    e->g = p.g.hi;
    e->h = p.h.hi;
    e->k = p.k.hi;
    const Pair edge = times(rim, times(p.g, p.g));
    e->first = minus(rod_fine_disc(F, G, p.h, p.g), edge).hi;
    e->second = minus(rod_fine_disc(F, G, p.k, p.g), edge).hi;
    const Pair gb = times(p.g, p.b);
    e->after = minus(gb, times(p.a, p.h)).hi;
    e->before = minus(times(p.a, p.k), gb).hi;
    return p;
}

/* What a ray does, in pairs: t, and a bound of what it is off by; WITH_RAYS, whether pairs are sure of it. */
typedef struct {
    RodVerdict is;
    FineT t;
    REAL_MASK known;
} FineRod;

static FineT rod_fine_t(const RodPairs p, const RodValues e, const RodErrors by, const RodVerdict is) {
    const REAL_MASK some = e.D > by.D, by_q = is.out | (e.b < 0);
    const REAL near = some ? sqrt(e.D) : (REAL)0;
    const Pair rest = minus(p.D, two_product(near, near));
    const Pair root = two_sum(near, some ? (rest.hi + rest.lo) / (2 * near) : (REAL)0);
    const Pair size = {e.b < 0 ? -p.b.hi : p.b.hi, e.b < 0 ? -p.b.lo : p.b.lo}, q = plus(size, root);
    const Pair power = {e.c < 0 ? -p.c.hi : p.c.hi, e.c < 0 ? -p.c.lo : p.c.lo};
    const Pair N = choose_pair(is.last, p.k, p.h);
    const Pair upper = choose_pair(is.flat, N, choose_pair(by_q, power, q));
    const Pair lower = choose_pair(is.flat, p.g, choose_pair(by_q, q, p.a));
    const REAL least = sqrt(by.D), by_root = some ? by.D / near : least;
    const REAL root_error = by_root < least ? by_root : least;
    const REAL round = (by.b + root_error) / q.hi + (by_q ? by.c / fabs(e.c) : by.a / e.a);
    const REAL flat = (is.last ? by.k : by.h) / fabs(N.hi) + by.g / fabs(e.g);
    FineT at = {over(upper, lower), 0};
    at.error = 2 * fabs(at.t.hi) * ((is.flat ? flat : round) + 0x1p-97);
    return at;
}

/* to_light: whether the ray leads from a point of another surface to a light. That point is rounded. Where it is on the
 * cylinder but for that, it counts as on it: so where cylinders cross, light leaves both. */
static __attribute__((noinline)) FineRod fine_rod(const RodRay ray, const RodFineRay fine, const Rod rod,
                                                  const int to_light) {
    RodValues e = rod_values(ray, rod);
    const RodErrors rough = rod_errors_at(ray, e, 1);
    const RodPairs p = rod_pairs(ray, fine, rod, &e);
    const RodErrors by = rod_errors_at(ray, e, 0x1p-49);
    RodSigns is = signs_within(e, by);
    if (to_light) {
        PUT_WHERE(fabs(e.c) <= rough.c, is.c, (REAL)0);
        PUT_WHERE(fabs(e.h) <= rough.h, is.h, (REAL)0);
        PUT_WHERE(fabs(e.k) <= rough.k, is.k, (REAL)0);
    }
    FineRod found;
    found.is = rod_verdict(ray, is);
    if (HAS(WITH_RAYS)) found.known = rod_passes(ray, is) | (found.is.hit & rod_is_sure(ray, e, by, is, found.is));
    found.t = rod_fine_t(p, e, by, found.is);
    return found;
}
#endif

/* Where a ray meets a cylinder, INFINITY if it does not, and by which part. */
typedef struct {
    REAL t;
    RodVerdict is;
    REAL_MASK unsure; /* whether double cannot tell; always false in single */
} RodMeeting;

static RodMeeting rod_meet(const RodRay ray, const Rod rod, const REAL_MASK wanted) {
    const RodValues e = rod_values(ray, rod);
#if REAL_BYTES == 8
    const RodErrors by = rod_errors_at(ray, e, 1);
    const RodSigns is = signs_within(e, by);
    RodMeeting at = {(REAL)INFINITY, rod_verdict(ray, is), 0};
    const REAL_MASK passes = rod_passes(ray, is);
    at.unsure = wanted & !passes & !(at.is.hit & rod_is_sure(ray, e, by, is, at.is));
    at.is.hit = wanted & at.is.hit & !passes & !at.unsure;
#else
    RodMeeting at = {(REAL)INFINITY, rod_verdict(ray, signs_of_values(e)), 0};
    at.is.hit = wanted & at.is.hit;
#endif
    const REAL t = rod_t(e, at.is);
    at.t = (at.is.hit & (t > 0)) ? t : at.t;
    return at;
}

/* The same of a ray that leaves a point or comes from the eye, where pairs decide what double cannot. index: each
 * lane's surface, number: the same among cylinders. */
static __attribute__((noinline)) RodMeeting rod_encounter(const Geometry geometry, const Leaving ray, const INT index,
                                                          const REAL_MASK wanted) {
    const Rod rod = rods_of(geometry, CYLINDER_OR_NONE(geometry, index));
    const RodRay way = rod_ray_of(ray, index);
    RodMeeting at = rod_meet(way, rod, wanted);
#if REAL_BYTES == 8
    if (!UNDECIDED(geometry, ANY(TO_MASK(at.unsure)))) return at;
    const RodFineRay fine = {fine_start(geometry, ray), pairs_in_world(geometry, ray.d)};
    const FineRod found = fine_rod(way, fine, rod, 0);
    if (HAS(WITH_RAYS) && !ANY(TO_MASK(found.known))) mark_undecided(geometry);
    const REAL_MASK hit = found.is.hit & (found.t.t.hi > 0);
    at.t = at.unsure ? (hit ? found.t.t.hi : (REAL)INFINITY) : at.t;
    at.is.hit = at.unsure ? hit : at.is.hit;
    at.is.out = at.unsure ? found.is.out : at.is.out;
    at.is.flat = at.unsure ? found.is.flat : at.is.flat;
    at.is.last = at.unsure ? found.is.last : at.is.last;
#endif
    return at;
}

/* What float32 is sure of about a line and a cylinder, so that few are left for doubles.
 *
 * With the middle M of the axis, e along it, of length 1, half of its length h, the radius r, and f from a point O of
 * the line to M, the line O + t w passes the axis with a = |G|^2, V = f.G, G = w x e, at the t = b / a that is closest
 * to it, b = f.w - (f.e) (w.e). There it is Y / a along the axis from M, Y = (w.e) (f.w) - |w|^2 (f.e). It is within
 * the endless cylinder for t = (b +/- sqrt(D)) / a, D = r^2 a - V^2, and so from Y / a - |w.e| sqrt(D) / a to
 * Y / a + |w.e| sqrt(D) / a along the axis: it meets the solid if and only if D >= 0 and |Y| <= h a + |w.e| sqrt(D).
 *
 * Let u = 2^-24, A = w.w, and s the sum of the magnitudes of the coordinates of M and of O. M, O, e, h, r and w are
 * rounded to float once, doubles' own roundings are below u / 16 of these, and a vector of products of two vectors,
 * each of which is rounded and added, is off by 3.01 u of their lengths at most, a cross product by 2.9 u. So
 *     f is off by 2.1 u s, w by 1.1 u |w|, e by 1.1 u, G by (1.1 + 1.1 + 2.9) u |w|, w.e by (1.1 + 1.1 + 3.1) u |w|,
 *     V by (2.1 + 5.1 + 3.1) u s |w|, f.w by (2.1 + 1.1 + 3.1) u s |w|, f.e by (2.1 + 1.1 + 3.1) u s,
 *     A by (2.2 + 3.1) u A, Y by (5.3 + 6.3 + 5.3 + 6.3) u s A and 4.1 u s A when it is added up, a by 14 u A.
 * D: with E = 2^-20 (r + s) = 16 u (r + s), |V| + 10.3 u s |w|, of which the square counts where |V| is at most about
 * r |w|, is more than V^2 by (2 r 10.3 u s + (10.3 u s)^2) A, and r^2 a is off by 14 u r^2 A, and 6 u r^2 A by r^2 and
 * the sum: all of that is below W A, W = E (2 r + E) = (32 u r (r + s) + E^2). Y: |w.e| sqrt(D) is off by less than
 * 24 u r A beside what D is off by, h a by 17 u h A, and sums by 4 u of all: with Y, below R A, R = 2^-18 (s + h
 * + r). What float loses below its range is less than 2^-100, and A at least 2^-40.
 */

/* What float says of lines and a cylinder, in the float buffers' unit: lanes whose lines may meet it; of what is above,
 * a, b, Y and w.e; what b is off by, times 1 / |w|; bounds of sqrt(D); and how large Y and what is added to it may be
 * where that is surely between the discs, negative where the line may pass beside. */
typedef struct {
    MASK may;
    FLOAT a, b, Y, we, error, least, most, room;
} RodLine;

/* seen: two of Scene's rod_seen. Where no lane may meet the cylinder, the rest is not made. */
static __attribute__((always_inline)) RodLine rod_line(__global const float4 *seen, const Float3 O, const Float3 w,
                                                       const FLOAT A) {
    const float4 middle = seen[0], axis = seen[1];
    const float h = middle.w, r = axis.w, m = (fabs(middle.x) + fabs(middle.y)) + fabs(middle.z);
    const Float3 f = {middle.x - O.x, middle.y - O.y, middle.z - O.z};
    const Float3 G = {FMA(w.y, (FLOAT)axis.z, -(w.z * axis.y)), FMA(w.z, (FLOAT)axis.x, -(w.x * axis.z)),
                      FMA(w.x, (FLOAT)axis.y, -(w.y * axis.x))};
    const FLOAT V = FMA(f.x, G.x, FMA(f.y, G.y, f.z * G.z)), a = FMA(G.x, G.x, FMA(G.y, G.y, G.z * G.z));
    const FLOAT s = m + ((magnitude(O.x) + magnitude(O.y)) + magnitude(O.z));
    const FLOAT E = 0x1p-20f * (r + s), D_error = FMA(E * (2 * r + E), A, (FLOAT)0x1p-100f);
    const FLOAT D = FMA((FLOAT)(r * r), a, -(V * V)), most = D + D_error, least = D - D_error;
    RodLine is;
    is.may = most >= 0;
    if (!ANY(is.may)) return is;
    const FLOAT we = dot_float(w, axis), fe = dot_float(f, axis), fw = FMA(f.x, w.x, FMA(f.y, w.y, f.z * w.z));
    const FLOAT Y_error = FMA(0x1p-18f * (s + (h + r)), A, (FLOAT)0x1p-100f);
    is.a = a;
    is.b = fw - fe * we;
    is.Y = FMA(we, fw, -(A * fe));
    is.we = we;
    is.error = 0x1p-19f * s;
    is.least = sqrt(least > 0 ? least : (FLOAT)0);
    is.most = sqrt(most > 0 ? most : (FLOAT)0);
    is.room = least > 0 ? h * a - Y_error : (FLOAT)-1;
    is.may = is.may & (magnitude(is.Y) <= FMA((FLOAT)h, a, magnitude(we) * is.most) + Y_error);
    return is;
}

/* The lanes whose lines are surely between the discs where they enter the endless cylinder (end = -1), are closest to
 * its axis (0) or leave it (1). */
static MASK is_between_discs(const RodLine line, const float end) {
    const FLOAT one = FMA(end * line.we, line.least, line.Y), other = FMA(end * line.we, line.most, line.Y);
    return (magnitude(one) < line.room) & (magnitude(other) < line.room);
}

/* What is read of cylinders. light: the number of a light, -1: the eye. */

static void cylinder_fetch(const Scene *scene, const int light, const int index) {
    FETCH(scene->rod_seen, 2 * (index - FIRST_CYLINDER(scene->geometry)));
    FETCH(scene->geometry.rod, 2 * (index - FIRST_CYLINDER(scene->geometry)));
}

static void cylinder_fetch_first(const Scene *scene, const int light, const int index) {
    FETCH(scene->rod_seen, 2 * (index - FIRST_CYLINDER(scene->geometry)));
}

/* Leaves of the tree hold them as balls. */
#define cylinder_fetch_leaf ball_fetch_leaf
#define cylinder_add_leaf ball_add_leaf
#define cylinder_add_leaf_for_packet ball_add_leaf_for_packet

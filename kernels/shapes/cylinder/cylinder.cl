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
 * met. cltrace/reference/cylinders.py has the same in exact numbers.
 */

/* One cylinder in all lanes, or each lane's own one. Lengths of the world. Where `real` is float, u is of length 1. */
typedef struct {
    INT index;           /* of the surface */
    Real3 start, end, u; /* end: not where `real` is float */
    REAL r, span;        /* span: u.u; where `real` is float, |E - S| */
} Cylinder;

/* The cylinders of surfaces. Lanes with a negative index get any one. */
static Cylinder cylinders_of(const Geometry geometry, const INT index) {
    const INT row = 2 * CYLINDER_OR_NONE(geometry, index);
    const Real4 s = rows_at(geometry.cylinder, row), e = rows_at(geometry.cylinder + 1, row);
    Cylinder cylinder = {index, xyz_of(s), xyz_of(e), xyz_of(e), s.w, e.w};
    if (REAL_BYTES == 8) {
        cylinder.u = difference(cylinder.end, cylinder.start);
        cylinder.span = DOT(cylinder.u, cylinder.u);
    }
    return cylinder;
}

/* Two directions across each lane's axis, e1 = x x u, with the coordinate axis x that u is furthest from, and e2 = u x
 * e1. */
typedef struct {
    Real3 first, second;
} Across;

static Across across_of(const Cylinder cylinder) {
    const REAL x = fabs(cylinder.u.x), y = fabs(cylinder.u.y), z = fabs(cylinder.u.z);
    const REAL_MASK by_x = (x <= y) & (x <= z), by_y = !by_x & (y <= z);
    Across e;
    e.first.x = by_x ? (REAL)0 : by_y ? cylinder.u.z : -cylinder.u.y;
    e.first.y = by_x ? -cylinder.u.z : by_y ? (REAL)0 : cylinder.u.x;
    e.first.z = by_x ? cylinder.u.y : by_y ? -cylinder.u.x : (REAL)0;
    e.second = cross_of(cylinder.u, e.first);
    return e;
}

/* Where each lane's point q is: by its part, see cylinder_put(); q.y and q.z count e1 and e2. */
#define ON_START(q) ((q).x < 0)
#define ON_END(q) ((q).x > 1)

/* The lanes whose ray starts on the cylinder itself: at which part, as q says. */
typedef struct {
    REAL_MASK any, start, end, side;
} OwnPart;

static OwnPart own_part_of(const Leaving ray, const Cylinder cylinder) {
    const REAL_MASK own = TO_REAL_MASK(ray.own == cylinder.index), start = own & ON_START(ray.q),
                    end = own & ON_END(ray.q);
    return (OwnPart){own, start, end, own & !start & !end};
}

/* The numbers above, their errors or their signs. first, second: q of the disc at S and at E; after, before: where the
 * middle is. */
typedef struct {
    REAL a, b, c, D, g, h, k, first, second, after, before;
} CylinderNumbers;

/* What else they are made from; of numbers that are vectors, the sums of the magnitudes. */
typedef struct {
    CylinderNumbers of;
    REAL s, u1, w1, F1, G1; /* sizes: s = |f| + reach */
    REAL uu, rr, span, V;
    REAL v1, v2; /* of N G - g F of the two discs */
} CylinderValues;

/* N G - g F, of which q is the square less that of the rim. */
static Real3 disc_vector(const Real3 F, const Real3 G, const REAL N, const REAL g) {
    return difference(scaled(G, N), scaled(F, g));
}

static CylinderValues cylinder_values(const Leaving ray, const Cylinder cylinder) {
    const OwnPart own = own_part_of(ray, cylinder);
    const Real3 f = difference(difference(cylinder.start, ray.center), ray.p), u = cylinder.u, w = ray.w;
    const Real3 F = cross_of(f, u), G = cross_of(w, u), X = cross_of(f, w);
    CylinderValues e;
    e.s = size_of(f) + ray.reach;
    e.u1 = size_of(u);
    e.w1 = ray.w1;
    e.F1 = size_of(F);
    e.G1 = size_of(G);
    e.uu = DOT(u, u);
    e.rr = cylinder.r * cylinder.r;
    e.span = cylinder.span;
    e.of.a = DOT(G, G);
    e.of.b = DOT(F, G);
    e.of.g = DOT(w, u);
    e.V = DOT(u, X);
    const REAL VV = e.V * e.V;
    /* The point of the own surface is on the plane of its end, or on the side. */
    e.of.h = own.start ? (REAL)0 : own.end ? -e.span : DOT(f, u);
    e.of.k = own.end ? (REAL)0 : e.of.h + e.span;
    e.of.c = own.side ? (REAL)0 : DOT(F, F) - e.rr * e.uu;
    e.of.D = own.side ? e.of.b * e.of.b : e.uu * (e.of.a * e.rr - VV);
    const Real3 v1 = disc_vector(F, G, e.of.h, e.of.g), v2 = disc_vector(F, G, e.of.k, e.of.g);
    const REAL rim = e.rr * e.uu * (e.of.g * e.of.g);
    e.v1 = size_of(v1);
    e.v2 = size_of(v2);
    e.of.first = DOT(v1, v1) - rim;
    e.of.second = DOT(v2, v2) - rim;
    e.of.after = e.of.g * e.of.b - e.of.a * e.of.h;
    e.of.before = e.of.a * e.of.k - e.of.g * e.of.b;
    return e;
}

/* The signs of these numbers, -1, 0 or 1 each, which say what a ray does; 0 of what is within its error. */
static CylinderNumbers signs_within(const CylinderNumbers e, const CylinderNumbers by) {
    return (CylinderNumbers){
        sign_from(e.a, by.a),         sign_from(e.b, by.b),          sign_from(e.c, by.c),
        sign_from(e.D, by.D),         sign_from(e.g, by.g),          sign_from(e.h, by.h),
        sign_from(e.k, by.k),         sign_from(e.first, by.first),  sign_from(e.second, by.second),
        sign_from(e.after, by.after), sign_from(e.before, by.before)};
}

/* What follows from them. out: it starts outside, and enters where it is met; else it leaves there. flat: it is met on
 * a disc; last: which is the one at E. */
typedef struct {
    REAL_MASK hit, out, flat, last;
} Verdict;

static Verdict cylinder_verdict(const Leaving ray, const Cylinder cylinder, const CylinderNumbers is) {
    const REAL_MASK own = own_part_of(ray, cylinder).any;
    const REAL_MASK forth = is.g > 0, steep = is.g != 0;
    const REAL near = forth ? is.first : is.second, far = forth ? is.second : is.first;
    const REAL_MASK in_near = steep & (near <= 0), in_far = steep & (far <= 0);
    const REAL_MASK by_side = (is.a > 0) & (is.D >= 0) & (is.after >= 0) & (is.before >= 0);
    const REAL to_near = forth ? is.h : -is.k, to_far = forth ? is.k : -is.h;
    const REAL_MASK ahead = in_far ? to_far > 0 : (is.c < 0) | (is.b > 0);
    Verdict found;
    found.out = !own & (in_near ? to_near > 0 : (is.c > 0) & (is.b > 0));
    found.flat = found.out ? in_near : in_far;
    found.last = found.out ? !forth : forth;
    found.hit = own ? ray.inner & ahead : (in_near | in_far | by_side) & (found.out | ahead);
    return found;
}

/* t by the end that is met: N / g, c / q from outside, q / a from inside, or backwards, -c / q. */
static REAL cylinder_t(const CylinderNumbers e, const Verdict is) {
    const REAL q = fabs(e.b) + sqrt(e.D > 0 ? e.D : (REAL)0);
    const REAL_MASK by_q = is.out | (e.b < 0);
    const REAL round = (by_q ? fabs(e.c) : q) / (by_q ? q : e.a);
    return is.flat ? (is.last ? e.k : e.h) / e.g : round;
}

#if REAL_BYTES == 8
/* What the numbers are off by.
 *
 * With v = 2^-53, each coordinate of f is off by 2^-48 s, see Leaving, u by v of itself. So each coordinate of F is off
 * by 2^-47 s u1, of G by 2^-48 w1 u1, V by 2^-46 s w1 u1, g by 2^-48 w1 u1 and h by 2^-47 s u1. All others follow from
 * these: a product of two numbers is off by each one's error times the other one, by both errors' product, and by
 * roundings, which for sums of up to four products are below 2^-50 of all magnitudes. In pairs, f is off by 2^-99
 * s and w by 2^-101 w1, and what is computed by less than 2^-100: with small = 2^-49, all of that is less than so many
 * times what it is in double. */

/* A number and what it is off by. */
typedef struct {
    REAL value, error;
} Inexact;

/* What x y is off by; round: roundings as a share. */
static REAL product_error(const Inexact x, const Inexact y, const REAL round) {
    return fabs(x.value) * y.error + fabs(y.value) * x.error + x.error * y.error + round * fabs(x.value * y.value);
}

/* What F and G in each coordinate, a disc's N, and g are off by; and roundings as a share. */
typedef struct {
    REAL F, G, N, g, round;
} CylinderOff;

/* Of a disc's q. N, v: as in disc_vector(), v as a size. */
static REAL disc_error(const CylinderValues e, const REAL N, const REAL v, const CylinderOff off) {
    const REAL g = e.of.g;
    const REAL by = (fabs(N) * off.G + e.G1 * off.N + fabs(g) * off.F + e.F1 * off.g) +
                    (2 * (off.N * off.G + off.g * off.F) + off.round * (fabs(N) * e.G1 + fabs(g) * e.F1));
    const REAL rim = e.rr * e.uu;
    return (2 * v * by + 3 * by * by) + rim * (2 * fabs(g) * off.g + off.g * off.g) +
           2 * off.round * (v * v + rim * (g * g));
}

/* What is exactly 0 at the own point has no error. */
static CylinderNumbers cylinder_errors(const OwnPart own, const CylinderValues v, const REAL small) {
    const CylinderNumbers e = v.of;
    const REAL round = small * 0x1p-50, sizes = small * (v.w1 * v.u1);
    const REAL g_error = 0x1p-48 * sizes, h_error = small * 0x1p-47 * (v.s * v.u1);
    CylinderOff off = {h_error, g_error, 0, g_error, round};
    const REAL FF = v.F1 * v.F1, GG = v.G1 * v.G1, V_error = 0x1p-46 * sizes * v.s;
    CylinderNumbers by;
    by.a = (2 * v.G1 * off.G + 3 * off.G * off.G) + round * GG;
    by.b = (v.F1 * off.G + v.G1 * off.F + 3 * off.F * off.G) + round * (v.F1 * v.G1);
    by.c = (2 * v.F1 * off.F + 3 * off.F * off.F) + round * (FF + v.rr * v.uu);
    by.D = v.uu * (v.rr * by.a + (2 * fabs(v.V) * V_error + V_error * V_error)) +
           4 * round * v.uu * (e.a * v.rr + v.V * v.V);
    by.g = off.g;
    by.h = h_error;
    by.k = h_error + round * v.span;
    off.N = by.h;
    by.first = disc_error(v, e.h, v.v1, off);
    off.N = by.k;
    by.second = disc_error(v, e.k, v.v2, off);
    const Inexact a = {e.a, by.a}, b = {e.b, by.b}, g = {e.g, by.g}, h = {e.h, by.h}, k = {e.k, by.k};
    const REAL gb = product_error(g, b, round);
    by.after = gb + product_error(a, h, round);
    by.before = gb + product_error(a, k, round);
    by.h = own.start ? (REAL)0 : by.h;
    by.k = own.end ? (REAL)0 : by.k;
    by.c = own.side ? (REAL)0 : by.c;
    return by;
}

/* Whether the signs that doubles are sure of, where 0 is unsure, say that a ray meets nothing. */
static REAL_MASK passes_cylinder(const REAL_MASK own, const REAL_MASK inner, const CylinderNumbers is) {
    const REAL_MASK beside = (is.first > 0) & (is.second > 0) & ((is.after < 0) | (is.before < 0));
    const REAL_MASK beyond = ((is.g > 0) & (is.k < 0)) | ((is.g < 0) & (is.h > 0));
    return own ? !inner : (is.D < 0) | beside | beyond | ((is.c > 0) & (is.b < 0));
}

/* Whether a verdict by such signs is that of the exact ones, and cylinder_t() is right to 2^-24. */
static REAL_MASK is_sure(const REAL_MASK own, const CylinderNumbers e, const CylinderNumbers by,
                         const CylinderNumbers is, const Verdict found) {
    const REAL_MASK discs = (is.first > 0) & (is.second > 0), forth = is.g > 0;
    const REAL_MASK known = (is.first != 0) & (is.second != 0) & (discs | (is.g != 0));
    const REAL_MASK line = own | !discs | ((is.a > 0) & (is.D > 0) & (is.after > 0) & (is.before > 0));
    const REAL_MASK in_near = (is.g != 0) & ((forth ? is.first : is.second) < 0),
                    in_far = (is.g != 0) & ((forth ? is.second : is.first) < 0);
    const REAL_MASK start = own | (in_near ? (forth ? is.h : is.k) != 0 : (is.c < 0) | ((is.c > 0) & (is.b != 0)));
    const REAL_MASK end = found.out | (in_far ? (forth ? is.k : is.h) != 0 : ((is.c < 0) | own) & (is.b != 0));
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
} CylinderPairs;

/* |N G - g F|^2. */
static Pair fine_disc(const Pair3 F, const Pair3 G, const Pair N, const Pair g) {
    const Pair3 v = minus3(times3(N, G), times3(g, F));
    return dot_pairs(v, v);
}

/* Puts the values of pairs into `e`, of which the sizes stay. */
static __attribute__((noinline)) CylinderPairs cylinder_pairs(const Leaving ray, const PairRay fine,
                                                              const Cylinder cylinder, CylinderValues *e) {
    const OwnPart own = own_part_of(ray, cylinder);
    const Pair3 u = pairs_between(cylinder.start, cylinder.end), w = fine.w;
    const Pair3 f = minus3(pairs_between(ray.center, cylinder.start), fine.step);
    const Pair none = pair(0, 0), rr = two_product(cylinder.r, cylinder.r);
    const Pair3 F = cross_pairs(f, u), G = cross_pairs(w, u);
    const Pair uu = dot_pairs(u, u), V = dot_pairs(u, cross_pairs(f, w)), VV = times(V, V);
    const Pair rim = times(rr, uu), back = {-uu.hi, -uu.lo};
    CylinderPairs p;
    p.a = dot_pairs(G, G);
    p.b = dot_pairs(F, G);
    p.g = dot_pairs(w, u);
    p.h = choose_pair(own.start, none, choose_pair(own.end, back, dot_pairs(f, u)));
    p.k = choose_pair(own.end, none, plus(p.h, uu));
    p.c = choose_pair(own.side, none, minus(dot_pairs(F, F), rim));
    p.D = choose_pair(own.side, times(p.b, p.b), times(uu, minus(times(p.a, rr), VV)));
    const Pair edge = times(rim, times(p.g, p.g)), gb = times(p.g, p.b);
    e->V = V.hi;
    e->of = (CylinderNumbers){p.a.hi,
                              p.b.hi,
                              p.c.hi,
                              p.D.hi,
                              p.g.hi,
                              p.h.hi,
                              p.k.hi,
                              minus(fine_disc(F, G, p.h, p.g), edge).hi,
                              minus(fine_disc(F, G, p.k, p.g), edge).hi,
                              minus(gb, times(p.a, p.h)).hi,
                              minus(times(p.a, p.k), gb).hi};
    return p;
}

/* What a ray does, in pairs: t, and a bound of what it is off by; WITH_RAYS, whether pairs are sure of it. */
typedef struct {
    Verdict is;
    FineT t;
    REAL_MASK known;
} FineCylinder;

static FineT fine_cylinder_t(const CylinderPairs p, const CylinderNumbers e, const CylinderNumbers by,
                             const Verdict is) {
    const REAL_MASK some = e.D > by.D, by_q = is.out | (e.b < 0);
    const Pair q = plus(negative_where(e.b < 0, p.b), root_of(p.D, some)), N = choose_pair(is.last, p.k, p.h);
    const Pair upper = choose_pair(is.flat, N, choose_pair(by_q, negative_where(e.c < 0, p.c), q));
    const Pair lower = choose_pair(is.flat, p.g, choose_pair(by_q, q, p.a));
    const REAL round = (by.b + root_error(e.D, by.D, some)) / q.hi + (by_q ? by.c / fabs(e.c) : by.a / e.a);
    const REAL flat = (is.last ? by.k : by.h) / fabs(N.hi) + by.g / fabs(e.g);
    FineT at = {over(upper, lower), 0};
    at.error = 2 * fabs(at.t.hi) * ((is.flat ? flat : round) + 0x1p-97);
    return at;
}

/* to_light: whether the ray leads from a point of another surface to a light. That point is rounded. Where it is on the
 * cylinder but for that, it counts as on it: so where cylinders cross, light leaves both. */
static __attribute__((noinline)) FineCylinder fine_cylinder(const Leaving ray, const PairRay fine,
                                                            const Cylinder cylinder, const int to_light) {
    const OwnPart own = own_part_of(ray, cylinder);
    CylinderValues e = cylinder_values(ray, cylinder);
    const CylinderNumbers rough = cylinder_errors(own, e, 1);
    const CylinderPairs p = cylinder_pairs(ray, fine, cylinder, &e);
    const CylinderNumbers by = cylinder_errors(own, e, 0x1p-49);
    CylinderNumbers is = signs_within(e.of, by);
    if (to_light) {
        PUT_WHERE(fabs(e.of.c) <= rough.c, is.c, (REAL)0);
        PUT_WHERE(fabs(e.of.h) <= rough.h, is.h, (REAL)0);
        PUT_WHERE(fabs(e.of.k) <= rough.k, is.k, (REAL)0);
    }
    FineCylinder found;
    found.is = cylinder_verdict(ray, cylinder, is);
    if (HAS(WITH_RAYS))
        found.known = passes_cylinder(own.any, ray.inner, is) |
                      (found.is.hit & is_sure(own.any, e.of, by, is, found.is));
    found.t = fine_cylinder_t(p, e.of, by, found.is);
    return found;
}
#endif

/* Where a ray meets a cylinder, INFINITY if it does not, and by which part. */
typedef struct {
    REAL t;
    Verdict is;
    REAL_MASK unsure; /* whether double cannot tell; always false in single */
} CylinderMeeting;

static CylinderMeeting cylinder_meet(const Leaving ray, const Cylinder cylinder, const REAL_MASK wanted) {
    const CylinderValues e = cylinder_values(ray, cylinder);
    CylinderNumbers by = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
#if REAL_BYTES == 8
    const OwnPart own = own_part_of(ray, cylinder);
    by = cylinder_errors(own, e, 1);
#endif
    const CylinderNumbers is = signs_within(e.of, by);
    CylinderMeeting at = {(REAL)INFINITY, cylinder_verdict(ray, cylinder, is), 0};
    at.is.hit = wanted & at.is.hit;
#if REAL_BYTES == 8
    const REAL_MASK passes = passes_cylinder(own.any, ray.inner, is);
    at.unsure = wanted & !passes & !(at.is.hit & is_sure(own.any, e.of, by, is, at.is));
    at.is.hit = at.is.hit & !passes & !at.unsure;
#endif
    const REAL t = cylinder_t(e.of, at.is);
    at.t = (at.is.hit & (t > 0)) ? t : at.t;
    return at;
}

/* The same of a ray that leaves a point or comes from the eye and meets what `index` names, where pairs decide what
 * double cannot. */
static __attribute__((noinline)) CylinderMeeting cylinder_meet_from(const Geometry geometry, const Leaving ray,
                                                                    const INT index, const REAL_MASK wanted) {
    const Cylinder cylinder = cylinders_of(geometry, index);
    CylinderMeeting at = cylinder_meet(ray, cylinder, wanted);
#if REAL_BYTES == 8
    if (!UNDECIDED(geometry, ANY(TO_MASK(at.unsure)))) return at;
    const FineCylinder found = fine_cylinder(ray, pair_ray(geometry, ray), cylinder, 0);
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
} CylinderLine;

/* seen: two of Scene's cylinder_seen. Where no lane may meet the cylinder, the rest is not made. */
static __attribute__((always_inline)) CylinderLine cylinder_line(__global const float4 *seen, const Float3 O,
                                                                 const Float3 w, const FLOAT A) {
    const float4 middle = seen[0], axis = seen[1];
    const float h = middle.w, r = axis.w, m = (fabs(middle.x) + fabs(middle.y)) + fabs(middle.z);
    const Float3 f = {middle.x - O.x, middle.y - O.y, middle.z - O.z};
    const Float3 G = {FMA(w.y, (FLOAT)axis.z, -(w.z * axis.y)), FMA(w.z, (FLOAT)axis.x, -(w.x * axis.z)),
                      FMA(w.x, (FLOAT)axis.y, -(w.y * axis.x))};
    const FLOAT V = FMA(f.x, G.x, FMA(f.y, G.y, f.z * G.z)), a = FMA(G.x, G.x, FMA(G.y, G.y, G.z * G.z));
    const FLOAT s = m + ((magnitude(O.x) + magnitude(O.y)) + magnitude(O.z));
    const FLOAT E = 0x1p-20f * (r + s), D_error = FMA(E * (2 * r + E), A, (FLOAT)0x1p-100f);
    const FLOAT D = FMA((FLOAT)(r * r), a, -(V * V)), most = D + D_error, least = D - D_error;
    CylinderLine is;
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
static MASK is_between_discs(const CylinderLine line, const float end) {
    const FLOAT one = FMA(end * line.we, line.least, line.Y), other = FMA(end * line.we, line.most, line.Y);
    return (magnitude(one) < line.room) & (magnitude(other) < line.room);
}

/* What is read of cylinders. light: the number of a light, -1: the eye. */

static void cylinder_fetch(const Scene *scene, const int light, const int index) {
    FETCH(scene->cylinder_seen, 2 * (index - FIRST_CYLINDER(scene->geometry)));
    FETCH(scene->geometry.cylinder, 2 * (index - FIRST_CYLINDER(scene->geometry)));
}

/* sphere.cl: the sphere, decided in `real`.
 *
 * A shape has five functions: X_may_meet is a float32 filter with a proof, X_meet finds where a ray meets it, X_exact_t
 * finds that in pairs, X_surface gives the point's normal, and X_stops tells whether it stands between a point and a
 * light. cltrace/reference has the same, without the filter.
 */

/* One sphere in all lanes, or each lane's own one. */
typedef struct {
    INT index;
    Real3 center;
    REAL r, over_r;
    REAL c; /* |center|^2 - r^2, the power of the eye */
} Sphere;

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

#if REAL_BYTES == 8
/* What was cut off of each lane's sphere. */
typedef struct {
    REAL x, y, z, c;
} Rest;

static Rest rest_of(const Spheres spheres, const INT index) {
    Rest own = {0, 0, 0, 0};
    FOR_EACH_INDEX(one, index) {
        const REAL_MASK here = TO_REAL_MASK(index == one);
        const float4 rest = spheres.rest[one];
        PUT_WHERE(here, own.x, rest.x * spheres.length);
        PUT_WHERE(here, own.y, rest.y * spheres.length);
        PUT_WHERE(here, own.z, rest.z * spheres.length);
        PUT_WHERE(here, own.c, rest.w * (spheres.length * spheres.length));
    }
    return own;
}
#endif

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

/* What is needed of the equation a t^2 - 2 b t + c = 0 for the ray t d and the sphere |p - C| = r. */
typedef struct {
    REAL b;            /* C.d */
    Real3 v;           /* from the ray's point closest to the centre, to the centre; orthogonal to d */
    REAL discriminant; /* b^2 - a c = a (r^2 - |v|^2) */
    REAL_MASK by_b;    /* whether it was computed as b^2 - a c */
} Quadratic;

#if REAL_BYTES == 8
/* The same numbers in pairs; by_b says which form of the discriminant. Rarely needed and long: kept out of line. */
typedef struct {
    Pair a, b, c, discriminant;
    Real3 v;
} Exact;

static __attribute__((noinline)) Exact exact_quadratic(const Spheres spheres, const Ray ray, const Sphere sphere,
                                                       const REAL_MASK by_b) {
    Exact e;
    const Rest rest = rest_of(spheres, sphere.index);
    const Pair x = pair(sphere.center.x, rest.x), dx = pair(ray.d.x, 0);
    const Pair y = pair(sphere.center.y, rest.y), dy = pair(ray.d.y, 0);
    const Pair z = pair(sphere.center.z, rest.z);
    e.c = pair(sphere.c, rest.c);
    e.a = plus(plus(times(dx, dx), times(dy, dy)), pair(1, 0));
    e.b = minus(plus(times(x, dx), times(y, dy)), z);
    const Pair k = over(e.b, e.a), vx = minus(x, times(k, dx)), vy = minus(y, times(k, dy)), vz = plus(z, k);
    const Pair vv = plus(plus(times(vx, vx), times(vy, vy)), times(vz, vz));
    const Pair far = times(e.a, minus(two_product(sphere.r, sphere.r), vv));
    const Pair near = minus(times(e.b, e.b), times(e.a, e.c));
    e.v.x = vx.hi;
    e.v.y = vy.hi;
    e.v.z = vz.hi;
    e.discriminant.hi = by_b ? near.hi : far.hi;
    e.discriminant.lo = by_b ? near.lo : far.lo;
    return e;
}
#endif

/* The discriminant, in the form that is accurate here.
 *
 * c = |C|^2 - r^2 comes from the host, rounded once, so b^2 - a c has the error u (2 |b| |C| |d| + a |c|), while
 * a (r^2 - |v|^2) has u (2 r |C| + r^2) a: they are equal at about |b| = r |d|. So the first form is for rays that
 * start near the sphere or inside of it, and the second one for far and small spheres.
 *
 * The sign decides between hit and miss. Both forms are off by less than 16 u a |C|^2, u = 2^-53: |b| <= |C||d|, b is
 * off by 4 u |C||d| and v by 6 u |C|. For a grazing ray b^2 + a r^2 is a |C|^2, so a discriminant D below 2^-48 of that
 * is computed again in pairs. Above it, the error e of D moves sqrt(D) by e / (2 sqrt(D)). In the second form e is at
 * most 14 u a r |C| and sqrt(D) >= 2^-24 sqrt(a) |C|, so that is below 2^-26 r |d| <= 2^-26 |b|. In the first one e is
 * 8 u |b| r |d| + 2 u a |c|, which is below 2^-26 of D, or of b^2 where b is larger than sqrt(D).
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
    if (ANY(TO_MASK(unsure | tiny))) {
        const Exact exact = exact_quadratic(spheres, ray, sphere, e.by_b);
        e.discriminant = (unsure | tiny) ? exact.discriminant.hi : e.discriminant;
        e.v.x = tiny ? exact.v.x : e.v.x;
        e.v.y = tiny ? exact.v.y : e.v.y;
        e.v.z = tiny ? exact.v.z : e.v.z;
    }
#endif
    return e;
}

/* Where a ray meets a sphere: the smallest t > 0, INFINITY if it does not; and the way there from the centre. */
typedef struct {
    REAL t;
    Real3 from_center; /* any, if there is no such t */
} Meeting;

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

#if REAL_BYTES == 8
/* The same in pairs, for a ray that is known to hit. */
static __attribute__((noinline)) Pair sphere_exact_t(const Spheres spheres, const Ray ray, const Sphere sphere) {
    const Real3 C = sphere.center;
    const REAL b = (C.x * ray.d.x + C.y * ray.d.y) - C.z;
    const Exact e = exact_quadratic(spheres, ray, sphere, b * b < ray.a * (sphere.r * sphere.r));
    const Pair c = e.c, D = e.discriminant;
    const REAL_MASK some = D.hi > 0;
    const REAL near = some ? sqrt(D.hi) : (REAL)0;
    const Pair rest = minus(D, two_product(near, near));
    const Pair root = two_sum(near, some ? (rest.hi + rest.lo) / (2 * near) : (REAL)0);
    const REAL_MASK behind = e.b.hi < 0, first = (c.hi > 0) | behind;
    const Pair sum = plus(e.b, root), difference = minus(e.b, root);
    const Pair q = {behind ? difference.hi : sum.hi, behind ? difference.lo : sum.lo};
    const Pair numerator = {first ? c.hi : q.hi, first ? c.lo : q.lo};
    const Pair denominator = {first ? q.hi : e.a.hi, first ? q.lo : e.a.lo};
    return over(numerator, denominator);
}

/* Whether the ray meets A before B. Distances that differ by less than 2^-70 are equal: then `tie` says. */
static REAL_MASK comes_first(const Spheres spheres, const Ray ray, const Sphere A, const Sphere B,
                             const REAL_MASK tie) {
    const Pair a = sphere_exact_t(spheres, ray, A), b = sphere_exact_t(spheres, ray, B);
    const REAL gap = (a.hi - b.hi) + (a.lo - b.lo), equal = b.hi * 0x1p-70;
    return (gap < -equal) | ((gap <= equal) & tie);
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
#if REAL_BYTES == 4
    Real3 from_eye;      /* P itself, in camera space */
    REAL_MASK near_eye;  /* whether that is the shorter way */
#endif
} Start;

static Start start_at(const Ray ray, const Sphere own, const Real3 normal, const REAL t) {
    Start P = {own, {own.r * normal.x, own.r * normal.y, own.r * normal.z}, 1};
#ifdef WITH_INSIDE
    P.side = own.c > 0 ? (REAL)1 : (REAL)-1;
#endif
#if REAL_BYTES == 4
    P.from_eye.x = t * ray.d.x;
    P.from_eye.y = t * ray.d.y;
    P.from_eye.z = -t;
    P.near_eye = DOT(P.from_eye, P.from_eye) < own.r * own.r;
#endif
    return P;
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
    const REAL c = size < ff + rr ? shift + step : ff - rr;
#if REAL_BYTES == 4
    /* |B.center|^2 - r^2 comes from the host: what is added to it is small where P is near the eye. */
    const Real3 h = {P.from_eye.x - 2 * B.center.x, P.from_eye.y - 2 * B.center.y, P.from_eye.z - 2 * B.center.z};
    return P.near_eye ? B.c + DOT(P.from_eye, h) : c;
#else
    return c;
#endif
}

/* Whether the sphere B, not the own one, stands between P and a light, and so stops the light.
 *
 * w: from P to the light; far: 0 for a parallel light, where w has length 1 and every t > 0 counts; else 1, and t in
 * (0, 1) counts. outside: the sign of |L - C_B|^2 - r_B^2, computed exactly by the host; 1 for a parallel light.
 * With f = C_B - P the equation is a t^2 - 2 b t + c = 0, a = w.w, b = f.w, c = |f|^2 - r_B^2. No root is computed,
 * only signs: of the product c of the roots, of their sum 2b, and of a - 2b + c = |L - C_B|^2 - r_B^2, the value at
 * t = 1.
 *   c > 0, P outside: two roots of one sign if the discriminant is >= 0; positive if b > 0; the first is below 1 if
 *          the light is inside, or if their mean b/a is below 1.
 *   c < 0, P inside: one positive root, below 1 if the light is strictly outside.
 *   c = 0, P on B: the root 0 does not count, the other one is 2b/a.
 */
static REAL_MASK sphere_stops(const Start P, const Sphere B, const Real3 w, const int far,
                              const int light_side) {
    const Real3 f = towards(P, B.center);
    const REAL a = DOT(w, w), b = DOT(f, w), c = power_of(P, B, f);
    const Real3 cross = {f.y * w.z - f.z * w.y, f.z * w.x - f.x * w.z, f.x * w.y - f.y * w.x};
    const REAL bb = b * b, arr = a * (B.r * B.r);
    const REAL_MASK meets = (bb < arr ? bb - a * c : arr - DOT(cross, cross)) >= 0;
    const REAL_MASK ahead = b > 0;
    const REAL_MASK enters = (c > 0) & meets & ahead;
    const REAL_MASK leaves = (c < 0) | ((c == 0) & ahead);
    if (light_side < 0) return c > 0; /* P outside and the light inside: surely one root between */
    if (light_side == 0) return enters & (b < a);
    return far ? (enters & (b < a)) | leaves : enters | leaves;
}

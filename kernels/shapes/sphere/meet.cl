/* meet.cl: where rays from the eye meet a sphere, as a camera with perspective sends them. */
#ifndef WITH_PARALLEL_RAYS
/* What is needed of the equation a t^2 - 2 b t + c = 0 for the ray t d and the sphere |p - C| = r. */
typedef struct {
    REAL b;            /* C.d */
    Real3 v;           /* from the ray's point closest to the centre, to the centre; orthogonal to d */
    REAL discriminant; /* b^2 - a c = a (r^2 - |v|^2) */
    REAL_MASK by_b;    /* whether it was computed as b^2 - a c */
} Quadratic;

#if REAL_BYTES == 8
/* Puts what pairs and whole numbers say in place of what doubles are unsure of. bb: b^2; arr: a r^2. */
static __attribute__((always_inline)) void decide_quadratic(const Geometry geometry, const Ray ray, const Sphere sphere,
                                                            const REAL bb, const REAL arr, Quadratic *e) {
    const REAL bound = (bb + arr) * 0x1p-48;
    const REAL_MASK unsure = (e->discriminant <= bound) & (e->discriminant >= -bound), tiny = arr < bb * 0x1p-42;
    if (UNDECIDED(geometry, ANY(TO_MASK(unsure | tiny)))) {
        const REAL_MASK all_but_on = unsure & (bb < arr * 0x1p-16);
        const Decided decided = decide(geometry, ray, sphere, unsure | tiny, all_but_on);
        e->discriminant = (unsure | tiny) ? decided.discriminant : e->discriminant;
        e->b = all_but_on ? decided.b : e->b;
        e->v = chosen(tiny, decided.v, e->v);
    }
}
#else
/* Float stands by what it says. */
static void decide_quadratic(const Geometry geometry, const Ray ray, const Sphere sphere, const REAL bb, const REAL arr,
                             Quadratic *e) {
}
#endif

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
 * that is below 2^-25 r |d| <= 2^-25 |b|. In the first one e is 8 u |b| r |d| + (2 u + k) a |c|, which is below 2^-25
 * of D, or of b^2 where b is larger than sqrt(D).
 *
 * Nor is the sign of b in doubt then, or its error above 2^-26 of |b| + sqrt(D): if D is beyond the bound, sqrt(D) or,
 * where c > 0, |b| > sqrt(D) is at least 2^-24 r |d|. If it is not, |b| or r |d| is at least |C||d| / 2, and b is below
 * 2^-8 r |d| only if the eye is all but on the sphere and the ray all but along it: then it comes from decide(), too.
 *
 * v is off by 6 u |C|, which turns the normal by 6 u |C| / r. From |C| = 2^21 r on it comes from pairs, too.
 */
static Quadratic quadratic(const Geometry geometry, const Ray ray, const Sphere sphere) {
    Quadratic e;
    const Real3 C = sphere.center;
    const REAL rr = sphere.r * sphere.r;
    e.b = (C.x * ray.d.x + C.y * ray.d.y) - C.z;
    const REAL bb = e.b * e.b, arr = ray.a * rr;
    e.by_b = bb < arr;
    /* Only the near root's normal is beyond; from inside, |b| may round to r |d| where a ray meets the centre. */
    if (HAS(WITH_INSIDE)) e.by_b = e.by_b | (sphere.c <= 0);
    e.v.x = e.v.y = e.v.z = 0;
    e.discriminant = bb - ray.a * sphere.c;
    if (ANY(!TO_MASK(e.by_b))) {
        const REAL k = e.b * ray.over_a;
        e.v.x = C.x - k * ray.d.x;
        e.v.y = C.y - k * ray.d.y;
        e.v.z = C.z + k;
        /* As v.d = 0, v.z is also v.x d.x + v.y d.y. In float, that beats C.z + b/a near the view's axis, where these
         * nearly cancel, by as much as d.x and d.y are small, and loses to it where they are large. */
        if (REAL_BYTES == 4) e.v.z = ray.a <= (real)1.0625f ? e.v.x * ray.d.x + e.v.y * ray.d.y : e.v.z;
        e.discriminant = e.by_b ? e.discriminant : ray.a * (rr - DOT(e.v, e.v));
    }
    decide_quadratic(geometry, ray, sphere, bb, arr, &e);
    return e;
}

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
static Meeting sphere_meet(const Geometry geometry, const Ray ray, const Sphere sphere) {
    const Quadratic e = quadratic(geometry, ray, sphere);
    const REAL root = sqrt(e.discriminant);
    const REAL_MASK behind = e.b < 0;
    REAL t = (e.b - root) * ray.over_a;
    REAL_MASK cancels = e.by_b | !(ray.a * sphere.c > (real)0x1p-10f * (e.b * e.b));
    if (REAL_BYTES == 4) cancels = TO_REAL_MASK(ALL_LANES);
    if (REAL_BYTES == 4 || ANY(TO_MASK(cancels))) {
        const REAL q = behind ? e.b - root : e.b + root;
        const REAL_MASK first = (sphere.c > 0) | behind;
        const REAL robust = (first ? sphere.c : q) / (first ? q : ray.a);
        t = cancels ? robust : t;
    }
    REAL_MASK hit = (e.discriminant >= 0) & (t > 0);
    /* In float, the square of a radius may vanish beside the scene's size. */
    if (REAL_BYTES == 4) hit = hit & (sphere.r * sphere.r > 0);
    Meeting at;
    at.t = hit ? t : (REAL)INFINITY;
    const REAL s = root * ray.over_a;
    at.from_center = (Real3){-(e.v.x + s * ray.d.x), -(e.v.y + s * ray.d.y), s - e.v.z};
    if (ANY(TO_MASK(e.by_b))) {
        const Real3 point = {t * ray.d.x, t * ray.d.y, -t};
        at.from_center = chosen(e.by_b, difference(point, sphere.center), at.from_center);
    }
    return at;
}
#endif

/* Where rays from the plane of an orthographic camera meet a sphere. */
#ifdef WITH_PARALLEL_RAYS
#if REAL_BYTES == 8
/* Puts what pairs and whole numbers say in place of a meeting, in the lanes of `wanted`: D, b and c are correctly
 * rounded, and so no root cancels. */
static __attribute__((noinline)) void decide_meeting(const Geometry geometry, const Ray ray, const Sphere sphere,
                                                     const REAL_MASK wanted, Meeting *at) {
    const Decided exact = decide(geometry, ray, sphere, wanted, wanted);
    const REAL b = exact.b, c = exact.c;
    /* With c > 0 the ray starts outside: it is c / (b + root) then. From inside it is b + root or -c / (root - b). */
    const REAL root = sqrt(exact.discriminant), q = fabs(b) + root;
    const REAL_MASK outside = c > 0;
    const REAL t = outside ? c / q : b >= 0 ? q : -c / q;
    const REAL_MASK hit = (exact.discriminant >= 0) & (t > 0) & (!outside | (b > 0));
    at->t = wanted ? (hit ? t : (REAL)INFINITY) : at->t;
    const Real3 from_center = {-exact.v.x, -exact.v.y, outside ? root : -root};
    at->from_center = chosen(wanted, from_center, at->from_center);
}

/* Of a ray from o = (x, y, 0) along -z, the sphere is a disc: with (x, y) from the ray to its centre C, the ray meets
 * it if D = r^2 - (x^2 + y^2) >= 0, at t = b -/+ sqrt(D) with b = -C.z. The way from the centre to the point is (-x,
 * -y, +/- sqrt(D)), so its z tells from which side the sphere is met.
 *
 * What is meant is exactly what fine_quadratic() says, f and w in the world. With f = p R + q U + g K along the
 * camera's axes R, U and K, which are orthonormal but for k, 6 u of their squares and 4 u of their products, with u =
 * 2^-53, X.X is (p^2 + q^2) (1 +/- 16 u), and p is f.R +/- (6 u |p| + 4 u |q| + 4 u |g|). f.R is C.x, which was rounded
 * once, less o.x, but for 6 u |o.x| + 4 u |o.y|. All that, and the rounding of x, is below 23 u s, with s = |C|_1 +
 * |o|_1, as |f|_1 is at most 1.8 s: x, y and b are off by less than e = 2^-48 s. So X.X is off by less than 2 e (|x| +
 * |y| + e) and 19 u (x^2 + y^2), and D by that and 8 u r^2: D_error.
 *
 * Where D is above that, D_error and e are below 2^-26 of root m and m, with m the least of r and both |t|, roots are
 * off by 2^-26 m and t by 2^-24.7 of itself. So it is known which t is met, and n is right to 2^-25. */
static Meeting sphere_meet(const Geometry geometry, const Ray ray, const Sphere sphere) {
    const Real3 C = sphere.center;
    const REAL x = C.x - ray.o.x, y = C.y - ray.o.y, b = -C.z, r = sphere.r, rr = r * r, XX = x * x + y * y;
    const REAL D = rr - XX, root = sqrt(D), first = b - root, last = b + root;
    const REAL_MASK outside = first > 0;
    const REAL t = outside ? first : last;
    Meeting at = {((D >= 0) & (t > 0)) ? t : (REAL)INFINITY, {-x, -y, outside ? root : -root}};
    const REAL e = 0x1p-48 * (((fabs(C.x) + fabs(C.y)) + fabs(C.z)) + ray.reach);
    const REAL D_error = 2 * e * ((fabs(x) + fabs(y)) + e) + 0x1p-48 * (rr + XX);
    const REAL near = fabs(first), far = fabs(last), least = near < far ? near : far, m = least < r ? least : r;
    const REAL_MASK sure = (D > D_error) & (D_error <= 0x1p-26 * root * m) & (e <= 0x1p-26 * m);
    const REAL_MASK unsure = !(sure | (D < -D_error));
    if (UNDECIDED(geometry, ANY(TO_MASK(unsure)))) decide_meeting(geometry, ray, sphere, unsure, &at);
    return at;
}
#else
/* The same disc in float. |C|^2 - r^2 comes from the host: c is what the power of o has more than that. It serves where
 * o is near the eye beside the sphere's size, which is where b - root cancels. */
static Meeting sphere_meet(const Geometry geometry, const Ray ray, const Sphere sphere) {
    const Real3 C = sphere.center;
    const REAL x = C.x - ray.o.x, y = C.y - ray.o.y, b = -C.z, r = sphere.r, rr = r * r, XX = x * x + y * y;
    const REAL c = sphere.c + (ray.o.x * (ray.o.x - 2 * C.x) + ray.o.y * (ray.o.y - 2 * C.y)), bb = b * b;
    const REAL_MASK near_eye = ray.o.x * ray.o.x + ray.o.y * ray.o.y < rr;
    const REAL D = (near_eye & (bb < rr)) ? bb - c : rr - XX, root = sqrt(D), q = fabs(b) + root;
    const REAL_MASK outside = near_eye ? c > 0 : b > root;
    const REAL robust = outside ? c / q : b >= 0 ? q : -c / q, direct = outside ? b - root : b + root;
    const REAL t = near_eye ? robust : direct;
    const REAL_MASK hit = (D >= 0) & (t > 0) & (!outside | (b > 0)) & (rr > 0);
    return (Meeting){hit ? t : (REAL)INFINITY, {-x, -y, outside ? root : -root}};
}
#endif
#endif

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
static __attribute__((always_inline)) void decide_quadratic(const Spheres spheres, const Ray ray, const Sphere sphere,
                                                            const REAL bb, const REAL arr, Quadratic *e) {
    const REAL bound = (bb + arr) * 0x1p-48;
    const REAL_MASK unsure = (e->discriminant <= bound) & (e->discriminant >= -bound), tiny = arr < bb * 0x1p-42;
    if (UNDECIDED(spheres, ANY(TO_MASK(unsure | tiny)))) {
        const REAL_MASK all_but_on = unsure & (bb < arr * 0x1p-16);
        const Decided decided = decide(spheres, ray, sphere, unsure | tiny, all_but_on);
        e->discriminant = (unsure | tiny) ? decided.discriminant : e->discriminant;
        e->b = all_but_on ? decided.b : e->b;
        e->v.x = tiny ? decided.v.x : e->v.x;
        e->v.y = tiny ? decided.v.y : e->v.y;
        e->v.z = tiny ? decided.v.z : e->v.z;
    }
}
#else
/* Float stands by what it says. */
static void decide_quadratic(const Spheres spheres, const Ray ray, const Sphere sphere, const REAL bb, const REAL arr,
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
static Quadratic quadratic(const Spheres spheres, const Ray ray, const Sphere sphere) {
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
    decide_quadratic(spheres, ray, sphere, bb, arr, &e);
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
static Meeting sphere_meet(const Spheres spheres, const Ray ray, const Sphere sphere) {
    const Quadratic e = quadratic(spheres, ray, sphere);
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

/* meet_parallel.cl: where rays from the plane of an orthographic camera meet a sphere. */
#ifdef WITH_PARALLEL_RAYS
#if REAL_BYTES == 8
/* Puts what pairs and whole numbers say in place of a meeting, in the lanes of `wanted`: D, b and c are correctly
 * rounded, and so no root cancels. */
static __attribute__((noinline)) void decide_meeting(const Spheres spheres, const Ray ray, const Sphere sphere,
                                                     const REAL_MASK wanted, Meeting *at) {
    const Decided exact = decide(spheres, ray, sphere, wanted, wanted);
    const REAL b = exact.b, c = exact.c;
    /* With c > 0 the ray starts outside: it is c / (b + root) then. From inside it is b + root or -c / (root - b). */
    const REAL root = sqrt(exact.discriminant), q = fabs(b) + root;
    const REAL_MASK outside = c > 0;
    const REAL t = outside ? c / q : b >= 0 ? q : -c / q;
    const REAL_MASK hit = (exact.discriminant >= 0) & (t > 0) & (!outside | (b > 0));
    at->t = wanted ? (hit ? t : (REAL)INFINITY) : at->t;
    PUT_WHERE(wanted, at->from_center.x, -exact.v.x);
    PUT_WHERE(wanted, at->from_center.y, -exact.v.y);
    PUT_WHERE(wanted, at->from_center.z, outside ? root : -root);
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
static Meeting sphere_meet(const Spheres spheres, const Ray ray, const Sphere sphere) {
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
    if (UNDECIDED(spheres, ANY(TO_MASK(unsure)))) decide_meeting(spheres, ray, sphere, unsure, &at);
    return at;
}
#else
/* The same disc in float. |C|^2 - r^2 comes from the host: c is what the power of o has more than that. It serves where
 * o is near the eye beside the sphere's size, which is where b - root cancels. */
static Meeting sphere_meet(const Spheres spheres, const Ray ray, const Sphere sphere) {
    const Real3 C = sphere.center;
    const REAL x = C.x - ray.o.x, y = C.y - ray.o.y, b = -C.z, r = sphere.r, rr = r * r, XX = x * x + y * y;
    const REAL c = sphere.c + (ray.o.x * (ray.o.x - 2 * C.x) + ray.o.y * (ray.o.y - 2 * C.y)), bb = b * b;
    const REAL_MASK near_eye = ray.o.x * ray.o.x + ray.o.y * ray.o.y < rr;
    const REAL D = (near_eye & (bb < rr)) ? bb - c : rr - XX, root = sqrt(D), q = fabs(b) + root;
    const REAL_MASK outside = near_eye ? c > 0 : b > root;
    const REAL robust = outside ? c / q : b >= 0 ? q : -c / q, direct = outside ? b - root : b + root;
    const REAL t = near_eye ? robust : direct;
    const REAL_MASK hit = (D >= 0) & (t > 0) & (!outside | (b > 0)) & (rr > 0);
    const Meeting at = {hit ? t : (REAL)INFINITY, {-x, -y, outside ? root : -root}};
    return at;
}
#endif
#endif

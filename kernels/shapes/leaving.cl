/* leaving.cl: rays that start on a surface: where that is exactly, and where they meet another surface.
 *
 * A ray leaves the sphere A at the point P = C + r n / |n| and leads along d. What is meant are exactly these numbers: the
 * centre C and the radius r of the file, and the doubles n and d, which are in camera space and stand for B^T n and B^T d
 * in the world (see sphere.cl). No rounded copy of P decides anything, so no ray needs an offset from its surface: the
 * own surface is met again or not by theory, and any other one is met where t > 0. cltrace/reference/equation.py has the
 * same numbers in the same order.
 */
#ifdef WITH_BOUNCES

/* Rays that leave surfaces. */
typedef struct {
    INT own;         /* index of the surface */
    REAL_MASK inner; /* whether the ray leaves it on its inside */
    Real3 n, d;      /* the outward unit normal there, and the direction, in camera space */
    /* What follows from these, in the world and rounded. */
    Real3 center; /* of the own sphere */
    REAL r;       /* its radius */
    Real3 p, w;   /* from that centre to P; the direction */
    REAL w1;      /* |w.x| + |w.y| + |w.z| */
} Leaving;

/* A sphere of the file, in the world. */
typedef struct {
    Real3 center;
    REAL r;
} Ball;

/* Each lane's sphere. Lanes with a negative index get any one. */
static Ball balls_of(const Spheres spheres, const INT index) {
    int each[W];
    real x[W], y[W], z[W], r[W];
    STORE_LANES(index, each);
    for (int lane = 0; lane < W; lane++) {
        const real4 place = spheres.place[max(each[lane], 0)];
        x[lane] = place.x;
        y[lane] = place.y;
        z[lane] = place.z;
        r[lane] = place.w;
    }
    const Ball ball = {{LOAD_LANES(x), LOAD_LANES(y), LOAD_LANES(z)}, LOAD_LANES(r)};
    return ball;
}

/* A vector of camera space in the world: B^T v. */
static Real3 turned_to_world(const Frame frame, const Real3 v) {
    const Real3 w = {(frame.right.x * v.x + frame.up.x * v.y) + frame.back.x * v.z,
                     (frame.right.y * v.x + frame.up.y * v.y) + frame.back.y * v.z,
                     (frame.right.z * v.x + frame.up.z * v.y) + frame.back.z * v.z};
    return w;
}

static Real3 turned_to_camera(const Frame frame, const Real3 v) {
    const Real3 c = {DOT(frame.right, v), DOT(frame.up, v), DOT(frame.back, v)};
    return c;
}

/* |x| + |y| + |z|. */
static REAL size_of(const Real3 v) {
    return (fabs(v.x) + fabs(v.y)) + fabs(v.z);
}

static Leaving leaving(const Frame frame, const Spheres spheres, const INT own, const REAL_MASK inner, const Real3 n,
                       const Real3 d) {
    const Ball ball = balls_of(spheres, own);
    const Real3 m = turned_to_world(frame, n);
    Leaving ray = {own, inner, n, d, ball.center, ball.r};
    ray.p.x = m.x * ball.r;
    ray.p.y = m.y * ball.r;
    ray.p.z = m.z * ball.r;
    ray.w = turned_to_world(frame, d);
    ray.w1 = size_of(ray.w);
    return ray;
}

/* Where such a ray meets a sphere: the smallest t > 0, INFINITY if it does not, and whether from the sphere's inside. */
typedef struct {
    REAL t;
    REAL_MASK inside;
} Encounter;

#if REAL_BYTES == 8
/* The last word on such rays and spheres, where doubles are unsure: the same numbers as in sphere_meet_from() below, in
 * pairs, and bounds of what they are off by. */
typedef struct {
    Pair a, b, c, D;
    REAL b_error, c_error, D_error;
} Finer;

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

/* With u = 2^-53, and s and w1 as in sphere_meet_from(): m = B^T n is off by 18 u^2, and 1 / |m|, of one Newton step from
 * double, by 20 u^2, so P is off by 60 u^2 r and f by 2^-99 s, w by 18 u^2 w1. So b and each coordinate of X are off by
 * less than e = 2^-98 s w1, and c and D by what is written below. */
static __attribute__((noinline)) Finer finer_from(const Spheres spheres, const Leaving ray, const Ball ball) {
    const Pair3 m = pairs_in_world(spheres, ray.n), w = pairs_in_world(spheres, ray.d);
    const Pair mm = dot_pairs(m, m);
    const REAL guess = 1 / sqrt(mm.hi);
    const Pair rest = minus(pair(1, 0), times(mm, two_product(guess, guess)));
    const Pair r = times(pair(ray.r, 0), two_sum(guess, (REAL)0.5 * guess * (rest.hi + rest.lo)));
    const Pair3 f = {minus(two_sum(ball.center.x, -ray.center.x), times(m.x, r)),
                     minus(two_sum(ball.center.y, -ray.center.y), times(m.y, r)),
                     minus(two_sum(ball.center.z, -ray.center.z), times(m.z, r))};
    const Pair3 X = cross_pairs(f, w);
    const Pair ff = dot_pairs(f, f), rr = two_product(ball.r, ball.r), XX = dot_pairs(X, X);
    Finer e;
    e.a = dot_pairs(w, w);
    const Pair arr = times(e.a, rr);
    e.b = dot_pairs(f, w);
    e.c = minus(ff, rr);
    e.D = minus(arr, XX);
    const REAL f1 = (fabs(f.x.hi) + fabs(f.y.hi)) + fabs(f.z.hi), X1 = (fabs(X.x.hi) + fabs(X.y.hi)) + fabs(X.z.hi);
    const REAL s = f1 + ray.r;
    e.b_error = 0x1p-98 * s * ray.w1;
    e.c_error = 0x1p-98 * s * f1 + 0x1p-101 * (ff.hi + rr.hi);
    e.D_error = (2 * X1 + e.b_error) * e.b_error + 0x1p-98 * (arr.hi + XX.hi);
    return e;
}

/* Where the ray meets the sphere, in pairs: t, or infinite; a bound of what it is off by; whether from inside.
 *
 * What is within its bound of 0 counts as 0. The bounds are below 2^-95 of the terms that they are about; only numbers
 * that are meant to touch come so near. */
typedef struct {
    Pair t;
    REAL error;
    REAL_MASK inside;
} FineEncounter;

static __attribute__((noinline)) FineEncounter fine_encounter(const Spheres spheres, const Leaving ray, const Ball ball,
                                                              const INT index) {
    const Finer e = finer_from(spheres, ray, ball);
    const REAL_MASK own = TO_REAL_MASK(index == ray.own), on = own | (fabs(e.c.hi) <= e.c_error), out = !on & (e.c.hi > 0);
    const REAL_MASK touches = fabs(e.D.hi) <= e.D_error, some = !touches & (e.D.hi > 0), forward = e.b.hi > 0;
    const REAL near = some ? sqrt(e.D.hi) : (REAL)0;
    const Pair rest = minus(e.D, two_product(near, near));
    const Pair root = two_sum(near, some ? (rest.hi + rest.lo) / (2 * near) : (REAL)0);
    const Pair size = {forward ? e.b.hi : -e.b.hi, forward ? e.b.lo : -e.b.lo}, q = plus(size, root);
    /* c / q from outside, 2 b / a from the surface, q / a from inside or, backwards, -c / q. */
    const REAL_MASK by_q = out | (!on & !forward);
    const Pair upper = {by_q ? fabs(e.c.hi) : on ? 2 * e.b.hi : q.hi,
                        by_q ? (out ? e.c.lo : -e.c.lo) : on ? 2 * e.b.lo : q.lo};
    const Pair lower = {by_q ? q.hi : e.a.hi, by_q ? q.lo : e.a.lo};
    const REAL_MASK hit = own ? ray.inner : on ? e.b.hi > e.b_error : out ? forward & (some | touches) : (REAL_MASK)(e.c.hi < 0);
    const REAL least = sqrt(e.D_error), by_root = some ? e.D_error / near : least;
    const REAL root_error = by_root < least ? by_root : least;
    FineEncounter at = {over(upper, lower), 0, !out};
    at.error = 2 * fabs(at.t.hi) * ((e.b_error + (on ? (REAL)0 : root_error)) / (on ? fabs(e.b.hi) : q.hi) +
                                    (by_q ? e.c_error / fabs(e.c.hi) : (REAL)0) + 0x1p-97);
    at.t.hi = hit ? at.t.hi : (REAL)INFINITY;
    return at;
}
#endif

/* Where the lanes of `wanted` meet the sphere. index: each lane's sphere, which is `ball`.
 *
 * a t^2 - 2 b t + c = 0 with f = C' - P, a = w.w, b = f.w and c = f.f - r'^2. D = b^2 - a c is computed as a r'^2 - X.X,
 * X = f x w, and no root cancels: from outside, c > 0, it is c / q with q = |b| + sqrt(D), and from inside q / a or -c / q.
 * The own sphere has c = 0: the root 0 does not count, and the other one, 2 b / a, only for a ray that leaves inwards.
 *
 * Bounds, with u = 2^-53, are sums of coordinates' magnitudes, as is w1, and s = |f|_1 + r. FromSurface in
 * cltrace/reference/equation.py derives them: b, and X as a vector, are off by less than e, and where doubles are sure,
 * t is right to 2^-24. A ray that surely passes by, or surely has an outer sphere behind it, needs nothing more. */
static Encounter sphere_meet_from(const Spheres spheres, const Leaving ray, const Ball ball, const INT index,
                                  const REAL_MASK wanted) {
    const Real3 w = ray.w, f = {(ball.center.x - ray.center.x) - ray.p.x, (ball.center.y - ray.center.y) - ray.p.y,
                                (ball.center.z - ray.center.z) - ray.p.z};
    const REAL_MASK own = TO_REAL_MASK(index == ray.own);
    const REAL a = DOT(w, w), b = DOT(f, w), ff = DOT(f, f), rr = ball.r * ball.r, c = ff - rr;
    const Real3 X = {f.y * w.z - f.z * w.y, f.z * w.x - f.x * w.z, f.x * w.y - f.y * w.x};
    const REAL XX = DOT(X, X), arr = a * rr, D = arr - XX;
    const REAL root = sqrt(D > 0 ? D : (REAL)0), q = fabs(b) + root;
    const REAL_MASK out = !own & (c > 0), by_q = out | (!own & (b < 0));
    const REAL t = (own ? b + b : by_q ? fabs(c) : q) / (by_q ? q : a);
    REAL_MASK hit = own ? ray.inner : (D >= 0) & (!out | (b > 0));
    Encounter at = {t, !out};
#if REAL_BYTES == 8
    const REAL f1 = size_of(f), s = f1 + ray.r, e = 0x1p-47 * s * ray.w1;
    const REAL D_error = (2 * size_of(X) * e + e * e) + 0x1p-47 * (arr + XX);
    const REAL c_error = 0x1p-46 * s * f1 + 0x1p-50 * (ff + rr), c_least = 0x1p26 * c_error;
    const REAL_MASK passes = !own & ((D < -D_error) | ((c > c_least) & (b < -e)));
    const REAL_MASK sure = own ? !ray.inner | (e <= 0x1p-26 * b)
                               : (D > D_error) & (D_error <= 0x1p-25 * root * q) & (e <= 0x1p-26 * q) & (fabs(c) > c_least);
    const REAL_MASK unsure = wanted & !passes & !sure;
    if (RARELY(ANY(TO_MASK(unsure)))) {
        const FineEncounter fine = fine_encounter(spheres, ray, ball, index);
        at.t = unsure ? fine.t.hi : at.t;
        at.inside = unsure ? fine.inside : at.inside;
        hit = unsure ? fine.t.hi < INFINITY : hit & !passes;
    }
#endif
    at.t = (hit & (at.t > 0)) ? at.t : (REAL)INFINITY;
    return at;
}

#if REAL_BYTES == 8
/* Which of the lanes' rays, which meet both spheres, meet A before B; where they are met at once, `tie` says. */
static __attribute__((noinline)) REAL_MASK comes_first_from(const Spheres spheres, const Leaving ray, const Ball A,
                                                            const INT index_A, const Ball B, const INT index_B,
                                                            const REAL_MASK tie) {
    const FineEncounter a = fine_encounter(spheres, ray, A, index_A), b = fine_encounter(spheres, ray, B, index_B);
    const REAL gap = (a.t.hi - b.t.hi) + (a.t.lo - b.t.lo), error = a.error + b.error;
    return (gap < -error) | (!(gap > error) & tie);
}
#endif

/* The outward unit normal of a sphere, in camera space, where such a ray meets it at t. */
static Real3 normal_from(const Frame frame, const Leaving ray, const Ball ball, const REAL t) {
    const Real3 g = {t * ray.w.x - ((ball.center.x - ray.center.x) - ray.p.x),
                     t * ray.w.y - ((ball.center.y - ray.center.y) - ray.p.y),
                     t * ray.w.z - ((ball.center.z - ray.center.z) - ray.p.z)};
    const REAL over = 1 / sqrt(DOT(g, g));
    const Real3 n = {g.x * over, g.y * over, g.z * over};
    return turned_to_camera(frame, n);
}
#endif

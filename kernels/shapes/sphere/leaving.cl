/* leaving.cl: spheres and ellipsoids, and rays that start on a surface. */

/* Spheres under a linear map.
 *
 * An ellipsoid is |K (x - C)| = r. K leads from the world to its own axes. There it is a sphere, and a ray keeps its t,
 * so all that is written for spheres holds for K f and K w in place of f and w. Its point is P = C + r K^-1 q / |q|,
 * where q is the normal in its own axes, and q is what is exact. Spheres have the map 0, which is 1.
 */
typedef struct {
    Real3 x, y, z; /* rows */
    REAL size;     /* the sum of the magnitudes of all numbers of K, or of K^-1 */
} Matrix;

/* Each lane's three rows of the buffer of maps; first: 0 for K, 3 for K^-1, 6 for what was cut off of K^-1. */
static Matrix matrices_of(const Geometry geometry, const INT map, const int first) {
    int each[W];
    real row[10][W];
    STORE_LANES(map, each);
    for (int lane = 0; lane < W; lane++) {
        __global const real4 *rows = &geometry.map[each[lane]].to_x + first;
        row[0][lane] = rows[0].x;
        row[1][lane] = rows[0].y;
        row[2][lane] = rows[0].z;
        row[3][lane] = rows[1].x;
        row[4][lane] = rows[1].y;
        row[5][lane] = rows[1].z;
        row[6][lane] = rows[2].x;
        row[7][lane] = rows[2].y;
        row[8][lane] = rows[2].z;
        row[9][lane] = rows[0].w;
    }
    const Matrix matrix = {{LOAD_LANES(row[0]), LOAD_LANES(row[1]), LOAD_LANES(row[2])},
                           {LOAD_LANES(row[3]), LOAD_LANES(row[4]), LOAD_LANES(row[5])},
                           {LOAD_LANES(row[6]), LOAD_LANES(row[7]), LOAD_LANES(row[8])},
                           LOAD_LANES(row[9])};
    return matrix;
}

static Real3 mapped(const Matrix m, const Real3 v) {
    const Real3 w = {DOT(m.x, v), DOT(m.y, v), DOT(m.z, v)};
    return w;
}

static Real3 mapped_back(const Matrix m, const Real3 v) {
    const Real3 w = {(m.x.x * v.x + m.y.x * v.y) + m.z.x * v.z, (m.x.y * v.x + m.y.y * v.y) + m.z.y * v.z,
                     (m.x.z * v.x + m.y.z * v.y) + m.z.z * v.z};
    return w;
}

#if REAL_BYTES == 8 || defined(WITH_PLANES)
static Pair dot_matrix(const Real3 row, const Real3 rest, const Pair3 v) {
    return plus(plus(times(pair(row.x, rest.x), v.x), times(pair(row.y, rest.y), v.y)),
                times(pair(row.z, rest.z), v.z));
}

static Pair3 mapped_pairs(const Matrix m, const Matrix rest, const Pair3 v) {
    const Pair3 w = {dot_matrix(m.x, rest.x, v), dot_matrix(m.y, rest.y, v), dot_matrix(m.z, rest.z, v)};
    return w;
}
#endif

/* Rays that start on a surface: where that is exactly, and where they meet another surface.
 *
 * A ray leaves the sphere A at the point P = C + r n / |n| and leads along d. What is meant are exactly these numbers:
 * the centre C and the radius r of the file, and the doubles n and d, which are in camera space and stand for B^T n and
 * B^T d in the world (see sphere/exact.cl). No rounded copy of P decides anything, so no ray needs an offset from its
 * surface: the own surface is met again or not by theory, and any other one is met where t > 0.
 * cltrace/reference/equation.py has the same numbers in the same order.
 */
#ifdef WITH_LEAVING
/* A sphere of the file, in the world. */
typedef struct {
    Real3 center;
    REAL r;
    INT map; /* WITH_ELLIPSOIDS */
} Ball;

/* Each lane's sphere. Lanes with a negative index get any one. */
static Ball balls_of(const Geometry geometry, const INT index) {
    int each[W];
    real x[W], y[W], z[W], r[W];
    STORE_LANES(index, each);
    for (int lane = 0; lane < W; lane++) {
        const real4 place = geometry.place[max(each[lane], 0)];
        x[lane] = place.x;
        y[lane] = place.y;
        z[lane] = place.z;
        r[lane] = place.w;
    }
    Ball ball = {{LOAD_LANES(x), LOAD_LANES(y), LOAD_LANES(z)}, LOAD_LANES(r)};
    for (int lane = 0; HAS(WITH_ELLIPSOIDS) && lane < W; lane++) each[lane] = geometry.map_of[max(each[lane], 0)];
    ball.map = HAS(WITH_ELLIPSOIDS) ? LOAD_LANES(each) : (INT)0;
    return ball;
}

/* The map of each lane's sphere. Lanes with a negative index get any one. */
static INT maps_of(const Geometry geometry, const INT index) {
    return balls_of(geometry, index).map;
}

/* Puts where rays leave spheres into all lanes. */
static void sphere_leave(const Frame frame, const Geometry geometry, Leaving *ray) {
    const Ball ball = balls_of(geometry, SPHERE_OR_NONE(geometry, ray->own));
    const Real3 m = turned_to_world(frame, ray->n);
    ray->center = ball.center;
    ray->r = ray->reach = ball.r;
    ray->p.x = m.x * ball.r;
    ray->p.y = m.y * ball.r;
    ray->p.z = m.z * ball.r;
    if (!HAS(WITH_ELLIPSOIDS) || !ANY(ball.map != 0)) return;
    const REAL_MASK stretched = TO_REAL_MASK(ball.map != 0);
    const Matrix L = matrices_of(geometry, ball.map, 3);
    const Real3 step = mapped(L, ray->q);
    PUT_WHERE(stretched, ray->p.x, step.x * ball.r);
    PUT_WHERE(stretched, ray->p.y, step.y * ball.r);
    PUT_WHERE(stretched, ray->p.z, step.z * ball.r);
    PUT_WHERE(stretched, ray->reach, ball.r * L.size);
}

/* A sphere as such a ray sees it: from P to its centre, along the ray, and what these are off by. See
 * sphere_meet_from().
 */
typedef struct {
    Real3 f, w;
    REAL s, f1, w1;
    REAL a_error; /* of w.w, beyond a few roundings of it */
} Approach;

static Approach approach_of(const Geometry geometry, const Leaving ray, const Ball ball) {
    Approach way = {{(ball.center.x - ray.center.x) - ray.p.x, (ball.center.y - ray.center.y) - ray.p.y,
                     (ball.center.z - ray.center.z) - ray.p.z},
                    ray.w};
    way.f1 = size_of(way.f);
    way.s = way.f1 + ray.reach;
    way.w1 = ray.w1;
    way.a_error = 0;
    if (HAS(WITH_ELLIPSOIDS) && ANY(ball.map != 0)) {
        const REAL_MASK stretched = TO_REAL_MASK(ball.map != 0);
        const Matrix K = matrices_of(geometry, ball.map, 0);
        const Real3 f = mapped(K, way.f), w = mapped(K, way.w);
        const REAL error = (real)0x1p-49f * (K.size * way.w1);
        PUT3(PUT_WHERE, stretched, way.f, f);
        PUT3(PUT_WHERE, stretched, way.w, w);
        PUT_WHERE(stretched, way.s, K.size * way.s);
        PUT_WHERE(stretched, way.f1, K.size * way.f1);
        PUT_WHERE(stretched, way.w1, K.size * way.w1);
        PUT_WHERE(stretched, way.a_error, error * (2 * size_of(w) + error));
    }
    return way;
}

#if REAL_BYTES == 8
/* The last word on such rays and spheres, where doubles are unsure: the same numbers as in sphere_meet_from() below, in
 * pairs, and bounds of what they are off by. */
typedef struct {
    Pair a, b, c, D;
    REAL a_error, b_error, c_error, D_error;
} Finer;

/* Puts the way from the ray's centre to P, in pairs, into all lanes. With u = 2^-53, m = B^T n is off by 18 u^2, and
 * 1 / |m|, of one Newton step from double, by 20 u^2, so P is off by 60 u^2 r. */
static void sphere_fine_start(const Geometry geometry, const Leaving ray, Pair3 *step) {
    Pair3 m = pairs_in_world(geometry, ray.n);
    Pair mm = dot_pairs(m, m);
    const INT own = SPHERE_OR_NONE(geometry, ray.own), map = HAS(WITH_ELLIPSOIDS) ? maps_of(geometry, own) : (INT)0;
    if (HAS(WITH_ELLIPSOIDS) && ANY((own >= 0) & (map != 0))) {
        const REAL_MASK stretched = TO_REAL_MASK((own >= 0) & (map != 0));
        const Pair3 q = {pair(ray.q.x, 0), pair(ray.q.y, 0), pair(ray.q.z, 0)};
        m = choose_pairs(stretched, mapped_pairs(matrices_of(geometry, map, 3), matrices_of(geometry, map, 6), q), m);
        mm = choose_pair(stretched, dot_pairs(q, q), mm);
    }
    const REAL guess = 1 / sqrt(mm.hi);
    const Pair rest = minus(pair(1, 0), times(mm, two_product(guess, guess)));
    const Pair r = times(pair(ray.r, 0), two_sum(guess, (REAL)0.5 * guess * (rest.hi + rest.lo)));
    step->x = times(m.x, r);
    step->y = times(m.y, r);
    step->z = times(m.z, r);
}

/* With s, f1 and w1 as in approach_of(), f is off by 2^-99 s and w by 18 u^2 w1. So b and each coordinate of X are off
 * by less than e = 2^-98 s w1, and c and D by what is written below. Of an ellipsoid, the products with K or with K^-1,
 * both of them sizes of which s, f1 and w1 have as factors, add 30 u^2 to each of these shares, for which there is
 * room; and w.w is off by more than a share of itself, as in approach_of(). */
static __attribute__((noinline)) Finer finer_from(const Geometry geometry, const Leaving ray, const Ball ball) {
    const Approach way = approach_of(geometry, ray, ball);
    Pair3 w = pairs_in_world(geometry, ray.d);
    const Pair3 step = fine_start(geometry, ray);
    Pair3 f = {minus(two_sum(ball.center.x, -ray.center.x), step.x),
               minus(two_sum(ball.center.y, -ray.center.y), step.y),
               minus(two_sum(ball.center.z, -ray.center.z), step.z)};
    if (HAS(WITH_ELLIPSOIDS) && ANY(ball.map != 0)) {
        const REAL_MASK stretched = TO_REAL_MASK(ball.map != 0);
        const Matrix K = matrices_of(geometry, ball.map, 0), none = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 0};
        f = choose_pairs(stretched, mapped_pairs(K, none, f), f);
        w = choose_pairs(stretched, mapped_pairs(K, none, w), w);
    }
    const Pair3 X = cross_pairs(f, w);
    const Pair ff = dot_pairs(f, f), rr = two_product(ball.r, ball.r), XX = dot_pairs(X, X);
    Finer e;
    e.a = dot_pairs(w, w);
    const Pair arr = times(e.a, rr);
    e.b = dot_pairs(f, w);
    e.c = minus(ff, rr);
    e.D = minus(arr, XX);
    const REAL X1 = (fabs(X.x.hi) + fabs(X.y.hi)) + fabs(X.z.hi);
    e.a_error = 0x1p-50 * way.a_error;
    e.b_error = 0x1p-98 * way.s * way.w1;
    e.c_error = 0x1p-98 * way.s * way.f1 + 0x1p-101 * (ff.hi + rr.hi);
    e.D_error = (2 * X1 + e.b_error) * e.b_error + 0x1p-98 * (arr.hi + XX.hi) + rr.hi * e.a_error;
    return e;
}

/* The power c of the point by which a ray leaves one sphere, of another one, in double: in whole numbers, so that it
 * has the right sign where spheres touch.
 *
 * With g = C' - C and m = B^T n it is A + B / sqrt(s), A = g.g + r^2 - r'^2, B = -2 r g.m and s = m.m. Where A and B
 * differ in sign, that is (A^2 s - B^2) / (s (A - B / sqrt(s))), of which only the numerator cancels. What would take
 * more than DIGITS digits counts as 0: no coordinates of a size do. */
static __attribute__((noinline)) double whole_power(const Geometry geometry, const int own, const int other,
                                                    const real4 n) {
    const real4 from = geometry.place[own], to = geometry.place[other];
    const double r = from.w, R = to.w;
    const Span f = span_of_both(span_of_both(span_of(r), span_of(R)), span_of_both(span_of_xyz(from), span_of_xyz(to)));
    const Span axes = span_of_axes(geometry), normal = span_of_xyz(n);
    const int bits_f = f.high - f.low + 1, bits_m = axes.high - axes.low + normal.high - normal.low + 2;
    const int digits = (4 * bits_f + 2 * bits_m + 12 + 31) / 32, unit_m = axes.low + normal.low;
    if (digits > DIGITS) return 0;
    Integer A, B, s, g, m, one, two;
    set_to(&A, r, f.low, digits);
    set_to(&B, 0, 0, digits);
    set_to(&s, 0, 0, digits);
    set_to(&one, R, f.low, digits);
    set_to(&g, 0, 0, digits);
    add_product(&g, &one, &one, digits);
    negate(&g, digits);
    one = A;
    add_product(&g, &one, &one, digits);
    A = g;
    for (int i = 0; i < 3; i++) {
        set_to(&g, coordinate(to, i), f.low, digits);
        set_to(&one, -coordinate(from, i), f.low, digits);
        add(&g, &one, digits);
        whole_turned(&m, geometry, n, i, axes.low, normal.low, digits);
        add_product(&A, &g, &g, digits);
        add_product(&B, &g, &m, digits);
        add_product(&s, &m, &m, digits);
    }
    /* B = -2 r g.m. */
    set_to(&one, r, f.low, digits);
    set_to(&two, 0, 0, digits);
    add_product(&two, &B, &one, digits);
    add(&two, &two, digits);
    negate(&two, digits);
    B = two;
    const int sign_A = sign_of(&A, digits), sign_B = sign_of(&B, digits);
    /* A^2 s - B^2. */
    set_to(&one, 0, 0, digits);
    add_product(&one, &B, &B, digits);
    negate(&one, digits);
    set_to(&two, 0, 0, digits);
    add_product(&two, &A, &A, digits);
    add_product(&one, &two, &s, digits);
    const double a = nearest_double(&A, 2 * f.low, digits), b = nearest_double(&B, 2 * f.low + unit_m, digits);
    const double square = nearest_double(&s, 2 * unit_m, digits), part = b / sqrt(square);
    if (sign_A * sign_B >= 0) return a + part;
    return nearest_double(&one, 4 * f.low + 2 * unit_m, digits) / square / (a - part);
}

/* Puts that in place of a power which pairs cannot tell from 0. */
static __attribute__((noinline)) void decide_power(const Geometry geometry, const Leaving ray, const INT index,
                                                   const MASK unsure, Finer *e) {
    int own[W], other[W], left[W];
    double x[W], y[W], z[W], c[W];
    STORE_LANES(ray.own, own);
    STORE_LANES(index, other);
    STORE_LANES(unsure, left);
    STORE_LANES(ray.n.x, x);
    STORE_LANES(ray.n.y, y);
    STORE_LANES(ray.n.z, z);
    STORE_LANES(e->c.hi, c);
    for (int lane = 0; lane < W; lane++)
        if (left[lane]) c[lane] = whole_power(geometry, own[lane], other[lane], (real4)(x[lane], y[lane], z[lane], 0));
    const REAL_MASK here = TO_REAL_MASK(unsure);
    const REAL whole = LOAD_LANES(c);
    PUT_WHERE(here, e->c.hi, whole);
    PUT_WHERE(here, e->c.lo, 0);
    PUT_WHERE(here, e->c_error, 0x1p-48 * fabs(whole));
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

static __attribute__((noinline)) FineEncounter fine_encounter(const Geometry geometry, const Leaving ray,
                                                              const Ball ball, const INT index) {
    Finer e = finer_from(geometry, ray, ball);
    const REAL_MASK own = TO_REAL_MASK(index == ray.own);
    const INT left = SPHERE_OR_NONE(geometry, ray.own);
    if (HAS(WITH_RAYS)) {
        const REAL_MASK power = fabs(e.c.hi) <= e.c_error, ahead = (e.c.hi > 0) & (fabs(e.b.hi) <= e.b_error);
        if (ANY(TO_MASK(power | ahead | (fabs(e.D.hi) <= e.D_error)))) mark_undecided(geometry);
    }
    MASK touching = (index >= 0) & (left >= 0) & TO_MASK(!own & (fabs(e.c.hi) <= e.c_error));
    if (HAS(WITH_ELLIPSOIDS)) touching = touching & (maps_of(geometry, left) == 0) & (ball.map == 0);
    if (ANY(touching)) decide_power(geometry, ray, index, touching, &e);
    const REAL_MASK on = own | (fabs(e.c.hi) <= e.c_error), out = !on & (e.c.hi > 0);
    const REAL_MASK touches = fabs(e.D.hi) <= e.D_error, some = !touches & (e.D.hi > 0), forward = e.b.hi > 0;
    const REAL near = some ? sqrt(e.D.hi) : (REAL)0;
    const Pair rest = minus(e.D, two_product(near, near));
    const Pair root = two_sum(near, some ? (rest.hi + rest.lo) / (2 * near) : (REAL)0);
    const Pair size = {forward ? e.b.hi : -e.b.hi, forward ? e.b.lo : -e.b.lo}, q = plus(size, root);
    /* c / q from outside, 2 b / a from the surface, q / a from inside or, backwards, -c / q. */
    const REAL_MASK by_q = out | (!on & !forward);
    const Pair upper = {by_q ? fabs(e.c.hi)
                        : on ? 2 * e.b.hi
                             : q.hi,
                        by_q ? (out ? e.c.lo : -e.c.lo)
                        : on ? 2 * e.b.lo
                             : q.lo};
    const Pair lower = {by_q ? q.hi : e.a.hi, by_q ? q.lo : e.a.lo};
    const REAL_MASK hit = own   ? ray.inner
                          : on  ? e.b.hi > e.b_error
                          : out ? forward & (some | touches)
                                : (REAL_MASK)(e.c.hi < 0);
    const REAL least = sqrt(e.D_error), by_root = some ? e.D_error / near : least;
    const REAL root_error = by_root < least ? by_root : least;
    FineEncounter at = {over(upper, lower), 0, !out};
    at.error = 2 * fabs(at.t.hi) *
               ((e.b_error + (on ? (REAL)0 : root_error)) / (on ? fabs(e.b.hi) : q.hi) +
                (by_q ? e.c_error / fabs(e.c.hi) : (REAL)0) + e.a_error / e.a.hi + 0x1p-97);
    at.t.hi = hit ? at.t.hi : (REAL)INFINITY;
    return at;
}
#endif

/* Where the lanes of `wanted` meet the sphere. index: each lane's sphere, which is `ball`.
 *
 * a t^2 - 2 b t + c = 0 with f = C' - P, a = w.w, b = f.w and c = f.f - r'^2. D = b^2 - a c is computed as a r'^2 -
 * X.X, X = f x w, and no root cancels: from outside, c > 0, it is c / q with q = |b| + sqrt(D), and from inside q / a
 * or -c / q. The own sphere has c = 0: the root 0 does not count, and the other one, 2 b / a, only for a ray that
 * leaves inwards.
 *
 * Bounds, with u = 2^-53, are sums of coordinates' magnitudes, as is w1, and s = |f|_1 + r. FromSurface in
 * cltrace/reference/equation.py derives them: b, and X as a vector, are off by less than e, and where doubles are sure,
 * t is right to 2^-24. A ray that surely passes by, or surely has an outer sphere behind it, needs nothing more. */
static Encounter sphere_meet_from(const Geometry geometry, const Leaving ray, const Ball ball, const INT index,
                                  const REAL_MASK wanted) {
    const Approach way = approach_of(geometry, ray, ball);
    const Real3 f = way.f, w = way.w;
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
    const REAL e = 0x1p-47 * way.s * way.w1;
    REAL D_error = (2 * size_of(X) * e + e * e) + 0x1p-47 * (arr + XX);
    if (HAS(WITH_ELLIPSOIDS)) D_error += rr * way.a_error;
    const REAL c_error = 0x1p-46 * way.s * way.f1 + 0x1p-50 * (ff + rr), c_least = 0x1p26 * c_error;
    const REAL_MASK passes = !own & ((D < -D_error) | ((c > c_least) & (b < -e)));
    REAL_MASK sure = own ? !ray.inner | (e <= 0x1p-26 * b)
                         : (D > D_error) & (D_error <= 0x1p-25 * root * q) & (e <= 0x1p-26 * q) & (fabs(c) > c_least);
    if (HAS(WITH_ELLIPSOIDS)) sure = sure & (way.a_error <= 0x1p-27 * a);
    const REAL_MASK unsure = wanted & !passes & !sure;
    if (UNDECIDED(geometry, ANY(TO_MASK(unsure)))) {
        const FineEncounter fine = fine_encounter(geometry, ray, ball, index);
        at.t = unsure ? fine.t.hi : at.t;
        at.inside = unsure ? fine.inside : at.inside;
        hit = unsure ? fine.t.hi < INFINITY : hit & !passes;
    }
#endif
    at.t = (hit & (at.t > 0)) ? at.t : (REAL)INFINITY;
    return at;
}

#if REAL_BYTES == 8
/* Puts t of rays that meet spheres into all lanes, in pairs, and a bound of what it is off by. */
static void sphere_fine_t(const Geometry geometry, const Leaving ray, const INT index, FineT *t) {
    const INT sphere = SPHERE_OR_NONE(geometry, index);
    if (KINDS_OF_SHAPES > 1 && !ANY(sphere >= 0)) return;
    const FineEncounter fine = fine_encounter(geometry, ray, balls_of(geometry, sphere), sphere);
    t->t = fine.t;
    t->error = fine.error;
}

/* Which of the lanes' rays, which meet both spheres, meet A before B; where they are met at once, `tie` says. */
static __attribute__((noinline)) REAL_MASK comes_first_from(const Geometry geometry, const Leaving ray, const INT A,
                                                            const INT B, const REAL_MASK tie) {
    const FineEncounter a = fine_encounter(geometry, ray, balls_of(geometry, A), A);
    const FineEncounter b = fine_encounter(geometry, ray, balls_of(geometry, B), B);
    const REAL gap = (a.t.hi - b.t.hi) + (a.t.lo - b.t.lo), error = a.error + b.error;
    return (gap < -error) | (!(gap > error) & tie);
}

/* Of spheres no such thing is known, and they break no tie by themselves. */
#define sphere_leave_out_tied(geometry, A, B, open)
#define sphere_break_tie(geometry, ray, A, B, close, first)
#endif

#ifdef WITH_PLANES
/* Where points that are `step` from A are strictly inside of a sphere or an ellipsoid. error: of the step. */
static MASK sphere_contains(const Scene *scene, const Real3 A, const Pair3 step, const REAL error, const int index) {
    const Ball ball = balls_of(scene->geometry, (INT)index);
    Pair3 f = {minus(two_sum(ball.center.x, -A.x), step.x), minus(two_sum(ball.center.y, -A.y), step.y),
               minus(two_sum(ball.center.z, -A.z), step.z)};
    REAL off = error;
    if (HAS(WITH_ELLIPSOIDS) && ANY(ball.map != 0)) {
        const Matrix K = matrices_of(scene->geometry, ball.map, 0), none = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 0};
        f = mapped_pairs(K, none, f);
        off *= K.size;
    }
    const REAL f1 = size_of_pairs(f), ff = f1 * f1, rr = ball.r * ball.r;
    const REAL c = minus(dot_pairs(f, f), two_product(ball.r, ball.r)).hi;
    return TO_MASK(c < -(2 * f1 * off + off * off + PAIR_ERROR * (ff + rr)));
}
#endif

/* What shadow rays start with is known since the point was met. */
static void sphere_place(const Geometry geometry, Start *start) {
}

/* Puts where the lanes' rays meet the spheres that `index` names into all lanes. */
static void sphere_encounter(const Scene *scene, const Leaving ray, const INT index, Encounter *at) {
    const INT sphere = SPHERE_OR_NONE(scene->geometry, index);
    const Ball ball = balls_of(scene->geometry, sphere);
    const Encounter on = sphere_meet_from(scene->geometry, ray, ball, sphere, TO_REAL_MASK(sphere >= 0));
    at->t = on.t;
    at->inside = on.inside;
}

/* The point where such a ray meets a sphere, or an ellipsoid. */
typedef struct {
    Real3 n; /* outward unit normal, in camera space */
    Real3 q; /* what stands for the point: of a sphere that is n, of an ellipsoid the normal in its own axes */
    /* WITH_ELLIPSOIDS: */
    REAL_MASK stretched; /* whether it is an ellipsoid */
    Real3 p;             /* from its centre to the point, in camera space */
    REAL support;        /* how far the plane that touches it there is from its centre */
    REAL spread;         /* see lift() */
} Spot;

static Spot spot_at(const Frame frame, const Geometry geometry, const Leaving ray, const Ball ball, const REAL t) {
    const Approach way = approach_of(geometry, ray, ball);
    Real3 g = {t * way.w.x - way.f.x, t * way.w.y - way.f.y, t * way.w.z - way.f.z};
    if (HAS(WITH_ELLIPSOIDS)) {
        /* A flat one is so small in its own axes, for its distance there, that doubles have both in one place. */
        const REAL_MASK lost = !(DOT(g, g) > 0);
        const Real3 back = {-way.w.x, -way.w.y, -way.w.z};
        PUT3(PUT_WHERE, lost, g, back);
    }
    const REAL over = 1 / sqrt(DOT(g, g));
    const Real3 q = {g.x * over, g.y * over, g.z * over};
    Spot spot;
    spot.q = spot.n = turned_to_camera(frame, q);
    if (!HAS(WITH_ELLIPSOIDS)) return spot;
    spot.stretched = TO_REAL_MASK(ball.map != 0);
    spot.p.x = ball.r * spot.n.x;
    spot.p.y = ball.r * spot.n.y;
    spot.p.z = ball.r * spot.n.z;
    spot.support = ball.r;
    spot.spread = 1;
    if (ANY(ball.map != 0)) {
        const Matrix K = matrices_of(geometry, ball.map, 0), L = matrices_of(geometry, ball.map, 3);
        const Real3 normal = mapped_back(K, q), step = mapped(L, q);
        const REAL shorter = 1 / sqrt(DOT(normal, normal));
        const Real3 unit = {normal.x * shorter, normal.y * shorter, normal.z * shorter};
        const Real3 from_center = {step.x * ball.r, step.y * ball.r, step.z * ball.r};
        const Real3 n = turned_to_camera(frame, unit), p = turned_to_camera(frame, from_center);
        PUT3(PUT_WHERE, spot.stretched, spot.n, n);
        PUT3(PUT_WHERE, spot.stretched, spot.q, q);
        PUT3(PUT_WHERE, spot.stretched, spot.p, p);
        PUT_WHERE(spot.stretched, spot.support, ball.r * shorter);
        PUT_WHERE(spot.stretched, spot.spread, K.size * L.size);
    }
    return spot;
}
#endif

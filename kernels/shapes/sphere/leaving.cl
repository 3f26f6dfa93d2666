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
    __global const real4 *rows = &geometry.map->to_x + first;
    const INT row = (INT)(sizeof(Map) / sizeof(real4)) * map;
    const Real4 x = rows_at(rows, row), y = rows_at(rows + 1, row), z = rows_at(rows + 2, row);
    return (Matrix){xyz_of(x), xyz_of(y), xyz_of(z), x.w};
}

static Real3 mapped(const Matrix m, const Real3 v) {
    return (Real3){DOT(m.x, v), DOT(m.y, v), DOT(m.z, v)};
}

static Real3 mapped_back(const Matrix m, const Real3 v) {
    return sum3(sum3(scaled(m.x, v.x), scaled(m.y, v.y)), scaled(m.z, v.z));
}

#if REAL_BYTES == 8 || defined(WITH_PLANES)
static Pair dot_row(const Real3 row, const Real3 rest, const Pair3 v) {
    return dot_pairs((Pair3){pair(row.x, rest.x), pair(row.y, rest.y), pair(row.z, rest.z)}, v);
}

static Pair3 mapped_pairs(const Matrix m, const Matrix rest, const Pair3 v) {
    return (Pair3){dot_row(m.x, rest.x, v), dot_row(m.y, rest.y, v), dot_row(m.z, rest.z, v)};
}
#endif

/* Rays that start on a surface: where that is exactly, and where they meet another surface.
 *
 * A ray leaves the sphere A at the point P = C + r n / |n| and leads along d. What is meant are exactly these numbers:
 * the centre C and the radius r of the file, and the doubles n and d, which are in camera space and stand for B^T n and
 * B^T d in the world (see sphere/exact.cl). No rounded copy of P decides anything, so no ray needs an offset from its
 * surface: the own surface is met again or not by theory, and any other one is met where t > 0.
 * cltrace/reference/spheres.py has the same numbers in the same order.
 */
#ifdef WITH_LEAVING
/* A sphere of the file, in the world. */
typedef struct {
    Real3 center;
    REAL r;
    INT map; /* WITH_ELLIPSOIDS */
} Ball;

/* The map of each lane's sphere. Lanes with a negative index get any one. */
static INT maps_of(const Geometry geometry, const INT index) {
    int each[W];
    STORE_LANES(index, each);
    for (int lane = 0; HAS(WITH_ELLIPSOIDS) && lane < W; lane++) each[lane] = MAP_OF(geometry, max(each[lane], 0));
    return HAS(WITH_ELLIPSOIDS) ? LOAD_LANES(each) : (INT)0;
}

/* Each lane's sphere, likewise. */
static Ball balls_of(const Geometry geometry, const INT index) {
    const Real4 place = rows_at(geometry.place, index);
    return (Ball){xyz_of(place), place.w, maps_of(geometry, index)};
}

/* Puts where rays leave spheres into all lanes. */
static void sphere_leave(const Frame frame, const Geometry geometry, Leaving *ray) {
    const Ball ball = balls_of(geometry, SPHERE_OR_NONE(geometry, ray->own));
    ray->center = ball.center;
    ray->r = ray->reach = ball.r;
    ray->p = scaled(turned_to_world(frame, ray->n), ball.r);
    if (!HAS(WITH_ELLIPSOIDS) || !ANY(ball.map != 0)) return;
    const REAL_MASK stretched = TO_REAL_MASK(ball.map != 0);
    const Matrix L = matrices_of(geometry, ball.map, 3);
    ray->p = chosen(stretched, scaled(mapped(L, ray->q), ball.r), ray->p);
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
    Approach way = {difference(difference(ball.center, ray.center), ray.p), ray.w};
    way.f1 = size_of(way.f);
    way.s = way.f1 + ray.reach;
    way.w1 = ray.w1;
    way.a_error = 0;
    if (HAS(WITH_ELLIPSOIDS) && ANY(ball.map != 0)) {
        const REAL_MASK stretched = TO_REAL_MASK(ball.map != 0);
        const Matrix K = matrices_of(geometry, ball.map, 0);
        const Real3 w = mapped(K, way.w);
        const REAL error = (real)0x1p-49f * (K.size * way.w1);
        way.f = chosen(stretched, mapped(K, way.f), way.f);
        way.w = chosen(stretched, w, way.w);
        PUT_WHERE(stretched, way.s, K.size * way.s);
        PUT_WHERE(stretched, way.f1, K.size * way.f1);
        PUT_WHERE(stretched, way.w1, K.size * way.w1);
        PUT_WHERE(stretched, way.a_error, error * (2 * size_of(w) + error));
    }
    return way;
}

#if REAL_BYTES == 8
/* v, times r / sqrt(vv) where `scales`. With u = 2^-53, that root of one Newton step from double is off by 20 u^2. */
static Pair3 scaled_to(const Pair3 v, const Pair vv, const REAL r, const REAL_MASK scales) {
    const REAL guess = 1 / sqrt(vv.hi);
    const Pair rest = minus(pair(1, 0), times(vv, two_product(guess, guess)));
    const Pair by = times(pair(r, 0), two_sum(guess, (REAL)0.5 * guess * (rest.hi + rest.lo)));
    return times3(choose_pair(scales, by, pair(1, 0)), v);
}

/* Puts the way from the ray's centre to P, in pairs, into all lanes. With u = 2^-53, m = B^T n is off by 18 u^2,
 * so P is off by 60 u^2 r. */
static void sphere_fine_start(const Geometry geometry, const Leaving ray, Pair3 *step) {
    Pair3 m = pairs_in_world(geometry, ray.n);
    Pair mm = dot_pairs(m, m);
    const INT own = SPHERE_OR_NONE(geometry, ray.own), map = HAS(WITH_ELLIPSOIDS) ? maps_of(geometry, own) : (INT)0;
    if (HAS(WITH_ELLIPSOIDS) && ANY((own >= 0) & (map != 0))) {
        const REAL_MASK stretched = TO_REAL_MASK((own >= 0) & (map != 0));
        const Pair3 q = pairs_of(ray.q);
        m = choose_pairs(stretched, mapped_pairs(matrices_of(geometry, map, 3), matrices_of(geometry, map, 6), q), m);
        mm = choose_pair(stretched, dot_pairs(q, q), mm);
    }
    *step = scaled_to(m, mm, ray.r, TO_REAL_MASK(ALL_LANES));
}

/* The last word on such rays and spheres, where doubles are unsure: the same numbers as in sphere_meet_from() below, in
 * pairs, and bounds of what they are off by.
 *
 * With s, f1 and w1 as in approach_of(), f is off by 2^-99 s and w by 18 u^2 w1. So b and each coordinate of X are off
 * by less than e = 2^-98 s w1, and c and D by what is written below. Of an ellipsoid, the products with K or with K^-1,
 * both of them sizes of which s, f1 and w1 have as factors, add 30 u^2 to each of these shares, for which there is
 * room; and w.w is off by more than a share of itself, as in approach_of(). */
static __attribute__((noinline)) Fine fine_from(const Geometry geometry, const Leaving ray, const Ball ball) {
    const Approach way = approach_of(geometry, ray, ball);
    Pair3 w = pairs_in_world(geometry, ray.d);
    Pair3 f = minus3(pairs_between(ray.center, ball.center), fine_start(geometry, ray));
    if (HAS(WITH_ELLIPSOIDS) && ANY(ball.map != 0)) {
        const REAL_MASK stretched = TO_REAL_MASK(ball.map != 0);
        const Matrix K = matrices_of(geometry, ball.map, 0), none = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 0};
        f = choose_pairs(stretched, mapped_pairs(K, none, f), f);
        w = choose_pairs(stretched, mapped_pairs(K, none, w), w);
    }
    const Pair3 X = cross_pairs(f, w);
    const Pair ff = dot_pairs(f, f), rr = two_product(ball.r, ball.r), XX = dot_pairs(X, X);
    Fine e;
    e.a = dot_pairs(w, w);
    const Pair arr = times(e.a, rr);
    e.b = dot_pairs(f, w);
    e.c = minus(ff, rr);
    e.D = minus(arr, XX);
    e.a_error = 0x1p-50 * way.a_error;
    e.b_error = 0x1p-98 * way.s * way.w1;
    e.c_error = 0x1p-98 * way.s * way.f1 + 0x1p-101 * (ff.hi + rr.hi);
    e.D_error = (2 * size_of_pairs(X) + e.b_error) * e.b_error + 0x1p-98 * (arr.hi + XX.hi) + rr.hi * e.a_error;
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
    set_to(&s, 0, 0, digits);
    set_to(&two, 0, 0, digits);
    set_to(&one, r, f.low, digits);
    multiply(&A, &one, &one, digits);
    set_to(&one, R, f.low, digits);
    multiply(&g, &one, &one, digits);
    add(&A, -1, &g, digits);
    for (int i = 0; i < 3; i++) {
        set_to(&g, coordinate(to, i), f.low, digits);
        set_to(&one, coordinate(from, i), f.low, digits);
        add(&g, -1, &one, digits);
        whole_turned(&m, geometry, n, i, axes.low, normal.low, digits);
        add_product(&A, &g, &g, digits);
        add_product(&two, &g, &m, digits);
        add_product(&s, &m, &m, digits);
    }
    /* B = -2 r g.m. */
    set_to(&one, r, f.low, digits);
    multiply(&m, &two, &one, digits);
    set_to(&B, 0, 0, digits);
    for (int k = 0; k < 2; k++) add(&B, -1, &m, digits);
    const int sign_A = sign_of(&A, digits), sign_B = sign_of(&B, digits);
    /* A^2 s - B^2. */
    multiply(&two, &A, &A, digits);
    multiply(&one, &two, &s, digits);
    multiply(&two, &B, &B, digits);
    add(&one, -1, &two, digits);
    const double a = nearest_double(&A, 2 * f.low, digits), b = nearest_double(&B, 2 * f.low + unit_m, digits);
    const double square = nearest_double(&s, 2 * unit_m, digits), part = b / sqrt(square);
    if (sign_A * sign_B >= 0) return a + part;
    return nearest_double(&one, 4 * f.low + 2 * unit_m, digits) / square / (a - part);
}

/* Puts that in place of a power which pairs cannot tell from 0. */
static __attribute__((noinline)) void decide_power(const Geometry geometry, const Leaving ray, const INT index,
                                                   const MASK unsure, Fine *e) {
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
    e->c = choose_pair(here, pair(whole, 0), e->c);
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
    Fine e = fine_from(geometry, ray, ball);
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
    const Pair q = plus(negative_where(!forward, e.b), root_of(e.D, some));
    /* c / q from outside, 2 b / a from the surface, q / a from inside or, backwards, -c / q. */
    const REAL_MASK by_q = out | (!on & !forward);
    const Pair twice = {2 * e.b.hi, 2 * e.b.lo};
    const Pair upper = choose_pair(by_q, negative_where(!out, e.c), choose_pair(on, twice, q));
    const Pair lower = choose_pair(by_q, q, e.a);
    const REAL_MASK hit = own   ? ray.inner
                          : on  ? e.b.hi > e.b_error
                          : out ? forward & (some | touches)
                                : (REAL_MASK)(e.c.hi < 0);
    const REAL off = e.b_error + (on ? (REAL)0 : root_error(e.D.hi, e.D_error, some));
    FineEncounter at = {over(upper, lower), 0, !out};
    at.error = 2 * fabs(at.t.hi) *
               (off / (on ? fabs(e.b.hi) : q.hi) + (by_q ? e.c_error / fabs(e.c.hi) : (REAL)0) + e.a_error / e.a.hi +
                0x1p-97);
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
 * cltrace/reference/spheres.py derives them: b, and X as a vector, are off by less than e, and where doubles are sure,
 * t is right to 2^-24. A ray that surely passes by, or surely has an outer sphere behind it, needs nothing more. */
static Encounter sphere_meet_from(const Geometry geometry, const Leaving ray, const Ball ball, const INT index,
                                  const REAL_MASK wanted) {
    const Approach way = approach_of(geometry, ray, ball);
    const Real3 f = way.f, w = way.w;
    const REAL_MASK own = TO_REAL_MASK(index == ray.own);
    const REAL a = DOT(w, w), b = DOT(f, w), ff = DOT(f, f), rr = ball.r * ball.r, c = ff - rr;
    const Real3 X = cross_of(f, w);
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
#endif

#ifdef WITH_PLANES
/* Where points that are `step` from A are strictly inside of a sphere or an ellipsoid. error: of the step. */
static MASK sphere_contains(const Scene *scene, const Real3 A, const Pair3 step, const REAL error, const int index) {
    const Ball ball = balls_of(scene->geometry, (INT)index);
    Pair3 f = minus3(pairs_between(A, ball.center), step);
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
    Real3 g = difference(scaled(way.w, t), way.f);
    if (HAS(WITH_ELLIPSOIDS)) {
        /* A flat one is so small in its own axes, for its distance there, that doubles have both in one place. */
        g = chosen(DOT(g, g) > 0, g, scaled(way.w, -1));
    }
    const Real3 q = scaled(g, 1 / sqrt(DOT(g, g)));
    Spot spot;
    spot.q = spot.n = turned_to_camera(frame, q);
    if (!HAS(WITH_ELLIPSOIDS)) return spot;
    spot.stretched = TO_REAL_MASK(ball.map != 0);
    spot.p = scaled(spot.n, ball.r);
    spot.support = ball.r;
    spot.spread = 1;
    if (ANY(ball.map != 0)) {
        const Matrix K = matrices_of(geometry, ball.map, 0), L = matrices_of(geometry, ball.map, 3);
        const Real3 normal = mapped_back(K, q), step = scaled(mapped(L, q), ball.r);
        const REAL shorter = 1 / sqrt(DOT(normal, normal));
        spot.n = chosen(spot.stretched, turned_to_camera(frame, scaled(normal, shorter)), spot.n);
        spot.q = chosen(spot.stretched, q, spot.q);
        spot.p = chosen(spot.stretched, turned_to_camera(frame, step), spot.p);
        PUT_WHERE(spot.stretched, spot.support, ball.r * shorter);
        PUT_WHERE(spot.stretched, spot.spread, K.size * L.size);
    }
    return spot;
}
#endif

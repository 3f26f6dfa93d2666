/* dispatch.cl: rays that meet triangles, or surfaces of whatever kind.
 */
/* The number in the scene file of each lane's surface; -1 for none. */
static INT ids_of(const Scene scene, const INT index) {
    int each[W];
    STORE_LANES(index, each);
    for (int lane = 0; lane < W; lane++) each[lane] = each[lane] < 0 ? -1 : scene.id_of[each[lane]];
    return LOAD_LANES(each);
}

#ifdef WITH_TRIANGLES
/* The number of each lane's triangle in its mesh; -1 for none. */
static INT primitives_of(const Scene scene, const INT index) {
    int each[W];
    STORE_LANES(index, each);
    for (int lane = 0; lane < W; lane++)
        each[lane] = each[lane] < scene.spheres.first ? -1 : scene.number_of[each[lane] - scene.spheres.first];
    return LOAD_LANES(each);
}
#endif

#ifdef WITH_TRIANGLES
#if REAL_BYTES == 8
static FinePath fine_path(const Spheres spheres, const Leaving ray) {
    const INT own = ray.own - (ray.own >= spheres.first ? (INT)spheres.first : (INT)0);
    const REAL_MASK whole = TO_REAL_MASK((ray.own < 0) | (ray.own >= spheres.first));
    const FinePath path = {ray.center, fine_start(spheres, ray), pairs_in_world(spheres, ray.d), ray.reach, ray.w1,
                           whole, whole, ray.d, ray.q, own};
    return path;
}

/* Lanes whose t is not right to 2^-24 of itself by double, and such in which it is unsure whether they meet at all. */
static __attribute__((noinline)) FineTriangle fine_meeting_of(const Spheres spheres, const Leaving ray, const INT number,
                                                              const REAL_MASK wanted) {
    return fine_triangle(spheres, fine_path(spheres, ray), number, wanted);
}

/* The same of rays from the eye. */
static __attribute__((noinline)) FineTriangle fine_meeting_from_eye(const Spheres *spheres, const Real3 *d, const Real3 *w,
                                                                    const INT number, const REAL_MASK wanted) {
    return fine_meeting_of(*spheres, from_eye(*spheres, *d, *w), number, wanted);
}
#endif

/* Where each of the lanes' rays meets its triangle. */
typedef struct {
    REAL t; /* INFINITY if it does not */
    Shares shares;
    REAL_MASK unsure; /* whether double cannot tell t; always false in single */
} Crossing;

/* The crossings of the lanes of `wanted`, as far as `real` tells. inside: lanes of which it is known that all three volumes
 * have the sign of D. */
static __attribute__((always_inline)) Crossing triangle_meet(const Path path, const Triangle T, const REAL_MASK wanted, const REAL_MASK inside) {
    const Volumes v = volumes_of(path, T);
    const REAL D = v.D, t = D / v.den;
    Crossing at = {(REAL)INFINITY, {v.EB, v.EC, v.den}, 0};
    REAL_MASK meets = inside;
#if REAL_BYTES == 8
    REAL_MASK misses = 0;
    if (ANY(TO_MASK(wanted & !inside))) {
        const REAL least = smaller_of(v.EA, smaller_of(v.EB, v.EC)), most = larger_of(v.EA, larger_of(v.EB, v.EC));
        const REAL_MASK split = (least < -v.E_error) & (most > v.E_error);
        const REAL_MASK before = (D > v.D_error) & (least < -v.E_error), behind = (D < -v.D_error) & (most > v.E_error);
        misses = !inside & (split | before | behind);
        meets = inside | ((D > 0) & (least > v.E_error)) | ((D < 0) & (most < -v.E_error));
    }
    const REAL_MASK sure_t = (fabs(D) > 0x1p26 * v.D_error) & (fabs(v.den) > 0x1p26 * v.den_error);
    at.unsure = wanted & !misses & !(meets & sure_t);
    at.t = (wanted & meets & sure_t) ? t : at.t;
#ifdef WITH_PARALLEL_RAYS
    /* Along parallel rays it is known that the volumes have one sign, and so that of N.w, not which: the triangle may be
     * behind the plane where they start. */
    at.t = t > 0 ? at.t : (REAL)INFINITY;
#endif
#else
    /* Float tells no ties apart: both triangles at an edge are met, and none is missed. */
    const REAL least = smaller_of(v.EA, smaller_of(v.EB, v.EC)), most = larger_of(v.EA, larger_of(v.EB, v.EC));
    meets = meets | ((D > 0) & (least >= 0)) | ((D < 0) & (most <= 0));
    at.t = (wanted & meets & (t > 0)) ? t : at.t;
#endif
    return at;
}

/* The same of rays from the eye along w, which is d in the world. number: of the triangles T. What is passed on where double
 * cannot tell is copied there: else compilers keep it in memory all the time. */
static __attribute__((always_inline)) Crossing triangle_meet_from_eye(const Spheres spheres, const Real3 d, const Real3 w, const Triangle T,
                                       const INT number, const REAL_MASK wanted, const REAL_MASK inside) {
#ifdef WITH_PARALLEL_RAYS
    const Path path = path_of(from_eye(spheres, d, w));
#else
    const Path path = {{spheres.eye.x, spheres.eye.y, spheres.eye.z}, {0, 0, 0}, w, 0, size_of(w)};
#endif
    Crossing at = triangle_meet(path, T, wanted, inside);
#if REAL_BYTES == 8
    if (RARELY(ANY(TO_MASK(at.unsure)))) {
        const Spheres all = spheres;
        const Real3 own_d = d, own_w = w;
        const FineTriangle fine = fine_meeting_from_eye(&all, &own_d, &own_w, number, at.unsure);
        at.t = (at.unsure & fine.hit) ? fine.t.hi : at.t;
    }
#endif
    return at;
}

/* Where the lanes of `wanted` meet the triangle that each of them names by its index; shares: where on it. */
static Encounter triangle_meet_from(const Scene scene, const Leaving ray, const INT index, const REAL_MASK wanted,
                                    Shares *shares) {
    const INT number = index - scene.spheres.first;
    const REAL_MASK other = wanted & TO_REAL_MASK(index != ray.own);
    const Crossing crossing = triangle_meet(path_of(ray), triangles_of(scene.spheres, number), other, 0);
    Encounter at = {crossing.t, 0};
    *shares = crossing.shares;
#if REAL_BYTES == 8
    if (RARELY(ANY(TO_MASK(crossing.unsure)))) {
        const FineTriangle fine = fine_meeting_of(scene.spheres, ray, number, crossing.unsure);
        at.t = (crossing.unsure & fine.hit) ? fine.t.hi : at.t;
    }
#endif
    return at;
}

#if REAL_BYTES == 8
/* t of rays that meet what they name, in pairs, and a bound of what it is off by. */
static __attribute__((noinline)) FineT fine_t_of(const Spheres spheres, const Leaving ray, const INT index) {
    const REAL_MASK face = TO_REAL_MASK(index >= spheres.first);
    const FineTriangle a = fine_triangle(spheres, fine_path(spheres, ray), (INT)(index - spheres.first), face);
    FineT t = {a.t, a.error};
#ifndef ONLY_TRIANGLES
    const INT sphere = SPHERE_OR_NONE(spheres, index);
    if (ANY(sphere >= 0)) {
        const FineEncounter b = fine_encounter(spheres, ray, balls_of(spheres, sphere), sphere);
        t.t = choose_pair(face, a.t, b.t);
        t.error = face ? a.error : b.error;
    }
#endif
    return t;
}
#endif

/* Which of the lanes' rays, which meet both surfaces, meet A before B; where they are met at once, the one that comes first
 * in the scene file, but for triangles in two planes, see plane_comes_first(). */
static __attribute__((noinline)) REAL_MASK comes_first_of(const Scene scene, const Leaving ray, const INT A, const INT B) {
    const INT a = ids_of(scene, A), b = ids_of(scene, B);
    const REAL_MASK tie = TO_REAL_MASK((a < b) | ((a == b) & (primitives_of(scene, A) < primitives_of(scene, B))));
#if REAL_BYTES == 8
    const FineT t = fine_t_of(scene.spheres, ray, A), other = fine_t_of(scene.spheres, ray, B);
    const REAL gap = (t.t.hi - other.t.hi) + (t.t.lo - other.t.lo), error = t.error + other.error;
    const REAL_MASK close = (gap >= -error) & (gap <= error);
    REAL_MASK first = tie;
    const INT one = A - scene.spheres.first, two = B - scene.spheres.first;
    const REAL_MASK flat = close & TO_REAL_MASK((one >= 0) & (two >= 0));
    if (ANY(TO_MASK(flat))) {
        const REAL_MASK before = plane_comes_first(scene.spheres, fine_path(scene.spheres, ray), one, two, tie, flat);
        first = flat ? before : tie;
    }
    return (gap < -error) | (!(gap > error) & first);
#else
    return tie;
#endif
}

/* A point of each lane's triangle: how much each corner counts, and the same as a start of rays, see place_on(). */
typedef struct {
    Weights weights;
    Real3 q;
} FacePoint;

/* The corner of the largest weight is the one that the point is counted from, and the other two weights are at most 1/2. A
 * point of an edge is moved inwards by INWARD of the triangle, far less than rounding does: a point on the edge itself would
 * be in the plane of the neighbour as well, and a ray from there would leave a closed room through that. */
#if REAL_BYTES == 8
#define INWARD 0x1p-64
#else
#define INWARD 0x1p-30f
#endif

static REAL kept_inward(const REAL weight) {
    return weight > INWARD ? (weight < (real)0.5f ? weight : (REAL)0.5f) : (REAL)INWARD;
}

static FacePoint face_point(const Shares shares) {
    const REAL share_b = shares.EB / shares.all, share_c = shares.EC / shares.all;
    const REAL b = share_b > 0 ? share_b : (REAL)0, c = share_c > 0 ? share_c : (REAL)0, rest = (1 - b) - c;
    const REAL a = rest > 0 ? rest : (REAL)0;
    const REAL_MASK first = (a >= b) & (a >= c), second = !first & (b >= c);
    FacePoint at;
    at.q.x = kept_inward(first ? b : second ? c : a);
    at.q.y = kept_inward(first ? c : second ? a : b);
    at.q.z = first ? (REAL)0 : second ? (REAL)1 : (REAL)2;
    const REAL most = (1 - at.q.x) - at.q.y;
    at.weights.a = first ? most : second ? at.q.y : at.q.x;
    at.weights.b = first ? at.q.x : second ? most : at.q.y;
    at.weights.c = first ? at.q.y : second ? at.q.x : most;
    return at;
}

/* Puts the world's coordinates of the lanes that start on triangles into their starts. */
static __attribute__((noinline)) void place_starts(const Spheres spheres, Start *P) {
    const REAL_MASK here = TO_REAL_MASK(P->index >= spheres.first);
    const Place3 place = places_of(spheres, P->index, P->q);
    PUT_WHERE(here, P->anchor.x, place.anchor.x);
    PUT_WHERE(here, P->anchor.y, place.anchor.y);
    PUT_WHERE(here, P->anchor.z, place.anchor.z);
    PUT_WHERE(here, P->step.x, place.step.x);
    PUT_WHERE(here, P->step.y, place.step.y);
    PUT_WHERE(here, P->step.z, place.step.z);
    PUT_WHERE(here, P->reach, place.reach);
}

#if REAL_BYTES == 8
/* As stands_before(), in pairs. */
static __attribute__((noinline)) REAL_MASK finely_before(const Spheres spheres, const Real3 to, const int at_point,
                                                         const Start P, const INT number, const REAL_MASK wanted) {
    const Real3 none = {0, 0, 0};
    Leaving point = {P.index, 0, P.q, to, P.anchor, P.own.r, P.reach, P.step, to, 0};
    point.q = P.q;
#ifdef WITH_ELLIPSOIDS
    point.map = SPHERE_OR_NONE(spheres, P.index) < 0 ? (INT)0 : balls_of(spheres, SPHERE_OR_NONE(spheres, P.index)).map;
#endif
    const Pair3 step = fine_start(spheres, point);
    const Pair3 still = {pair(0, 0), pair(0, 0), pair(0, 0)}, along = {pair(to.x, 0), pair(to.y, 0), pair(to.z, 0)};
    const REAL_MASK placed = TO_REAL_MASK(P.index >= spheres.first);
    FinePath path = {P.anchor, step, along, P.reach, size_of(to), 0, placed, none, P.q, P.index - (INT)spheres.first};
    if (at_point) {
        const Pair3 way = pairs_between(to, P.anchor);
        path.anchor = to;
        path.step = still;
        path.w.x = plus(way.x, step.x);
        path.w.y = plus(way.y, step.y);
        path.w.z = plus(way.z, step.z);
        path.reach = 0;
        path.w1 = (fabs(way.x.hi) + fabs(way.y.hi)) + fabs(way.z.hi) + P.reach;
        path.placed = 0;
    }
    const FineTriangle fine = fine_triangle(spheres, path, number, wanted);
    if (!at_point) return fine.hit;
    const Real3 a = corners_of(spheres, number, 0);
    const Pair3 e1 = pairs_between(a, corners_of(spheres, number, 1)), e2 = pairs_between(a, corners_of(spheres, number, 2));
    const Pair3 near = pairs_between(a, P.anchor);
    const Pair3 beyond = {plus(near.x, step.x), plus(near.y, step.y), plus(near.z, step.z)};
    const Pair side = dot_pairs(cross_pairs(e1, e2), beyond);
    const REAL size = (fabs(near.x.hi) + fabs(near.y.hi)) + fabs(near.z.hi) + P.reach;
    const REAL gh = ((fabs(e1.x.hi) + fabs(e1.y.hi)) + fabs(e1.z.hi)) * ((fabs(e2.x.hi) + fabs(e2.y.hi)) + fabs(e2.z.hi));
    REAL beyond_it = sign_from(side.hi, 0x1p-97 * size * gh);
    /* Whole numbers tell of a point of a triangle. As seen from P, D is N.(A - P). */
    const MASK unsure = TO_MASK(fine.hit & (beyond_it == 0) & placed);
    if (ANY(unsure)) {
        const REAL whole = TO_REAL(whole_signs(spheres, path, number, 0, 0, unsure));
        beyond_it = TO_REAL_MASK(unsure) ? -whole : beyond_it;
    }
    return fine.hit & (fine.side * beyond_it > 0);
}
#endif

/* Whether a triangle stands between a point P and a light, which is at a point, or in the direction `lamp`. inside: as in
 * triangle_meet().
 *
 * Of a light at a point, the ray leads from there to P; it meets the triangle before P if P is beyond the triangle's plane,
 * which is the sign of N.(P - A). What P - A is off by is below 2^-48 of the sum of the magnitudes that it is made from. */
static REAL_MASK stands_before(const Spheres spheres, const real4 lamp, const int at_point, const Start P, const Triangle T,
                               const int number, const REAL_MASK wanted, const REAL_MASK inside) {
    const REAL_MASK ends_there = at_point ? TO_REAL_MASK(ALL_LANES) : (REAL_MASK)0, endless = at_point ? (REAL_MASK)0 : TO_REAL_MASK(ALL_LANES);
    const Real3 to = {lamp.x, lamp.y, lamp.z}, none = {0, 0, 0};
    Path path = {P.anchor, P.step, to, P.reach, size_of(to)};
    if (at_point) {
        const Real3 way = difference(P.anchor, to);
        path.anchor = to;
        path.step = none;
        path.w.x = way.x + P.step.x;
        path.w.y = way.y + P.step.y;
        path.w.z = way.z + P.step.z;
        path.reach = 0;
        path.w1 = size_of(way) + P.reach;
    }
    const Volumes v = volumes_of(path, T);
    const REAL least = smaller_of(v.EA, smaller_of(v.EB, v.EC)), most = larger_of(v.EA, larger_of(v.EB, v.EC));
    const Real3 near = difference(P.anchor, T.a);
    const Real3 beyond = {near.x + P.step.x, near.y + P.step.y, near.z + P.step.z};
    const REAL side = at_point ? DOT(T.N, beyond) : v.D;
#if REAL_BYTES == 8
    const REAL side_error = 0x1p-46 * (size_of(near) + P.reach) * (T.g * T.h);
    const REAL_MASK split = !inside & (least < -v.E_error) & (most > v.E_error);
    const REAL_MASK front = v.D > v.D_error, back = v.D < -v.D_error;
    /* Along a parallel light it is known that the volumes have one sign, and so that of N.w, not which. */
    const REAL_MASK up = inside & (ends_there | (v.den > v.den_error)), down = inside & (ends_there | (v.den < -v.den_error));
    const REAL_MASK passes = (front & (inside ? down & endless : least < -v.E_error)) |
                             (back & (inside ? up & endless : most > v.E_error));
    const REAL_MASK ends = ends_there & ((front & (side < -side_error)) | (back & (side > side_error)));
    const REAL_MASK meets = (front & (up | (least > v.E_error)) & (endless | (side > side_error))) |
                            (back & (down | (most < -v.E_error)) & (endless | (side < -side_error)));
    const REAL_MASK unsure = wanted & !(split | passes | ends | meets);
    REAL_MASK stops = wanted & meets;
    if (RARELY(ANY(TO_MASK(unsure)))) stops = stops | finely_before(spheres, to, at_point, P, (INT)number, unsure);
    return stops;
#else
    const REAL_MASK front = v.D > 0, back = v.D < 0;
    const REAL_MASK up = inside & (ends_there | (v.den > 0)), down = inside & (ends_there | (v.den < 0));
    return wanted & ((front & (up | (least > 0)) & (endless | (side > 0))) |
                     (back & (down | (most < 0)) & (endless | (side < 0))));
#endif
}
#endif

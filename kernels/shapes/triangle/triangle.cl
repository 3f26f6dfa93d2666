/* triangle.cl: the triangle, decided in `real`; and rays that leave one.
 *
 * A mesh is its corners in the world, exactly the doubles of the buffer `vertex`. A ray starts at a point O and leads
 * along w. With A' = A - O for the corners A, B and C, the ray meets the triangle if the three volumes
 *
 *     E_AB = w.(A' x B'),   E_BC = w.(B' x C'),   E_CA = w.(C' x A')
 *
 * all have the sign of D = A'.N, with N = (B - A) x (C - A); and it does so at t = D / (N.w). No sign of t is asked
 * for: the three add up to N.w. With D = 0 the ray starts in the triangle's plane and never meets it.
 *
 * A volume of 0 means that the ray meets the line through an edge. Then it has the sign of the first number of A' x B',
 * in the world, that is not 0. That is its sign for the direction w + (e, e^2, e^3) with a small e: one and the same
 * ray for all edges, so exactly one of the triangles around an edge or a corner is met. cltrace/reference has the same.
 */

/* One triangle in all lanes, or each lane's own one. Lengths of the world. */
typedef struct {
    Real3 a, e1, e2; /* the corner A, from there to B and to C */
    Real3 N;         /* e1 x e2 */
    REAL g, h;       /* |e1| and |e2|, as sums of the coordinates' magnitudes */
} Triangle;

/* The three corners of each lane's triangle, or their normals. fourth: the fourth number of the row that names them. */
typedef struct {
    Real3 a, b, c;
    INT fourth;
} Corners;

static Real3 put_row(const REAL_MASK here, const Real3 v, const real4 row) {
    return chosen(here, (Real3){row.x, row.y, row.z}, v);
}

/* The same of lanes on many triangles. */
static __attribute__((always_inline)) Corners each_corners_at(__global const real4 *array, __global const int4 *face,
                                                              const INT index) {
    int each[W];
    __global const real4 *a[W], *b[W], *c[W];
    __global const int4 *row[W];
    STORE_LANES(index, each);
#pragma unroll
    for (int lane = 0; lane < W; lane++) {
        row[lane] = face + max(each[lane], 0);
        a[lane] = array + row[lane]->x;
        b[lane] = array + row[lane]->y;
        c[lane] = array + row[lane]->z;
    }
    return (Corners){{(REAL)EACH_LANE(a, ->x), (REAL)EACH_LANE(a, ->y), (REAL)EACH_LANE(a, ->z)},
                     {(REAL)EACH_LANE(b, ->x), (REAL)EACH_LANE(b, ->y), (REAL)EACH_LANE(b, ->z)},
                     {(REAL)EACH_LANE(c, ->x), (REAL)EACH_LANE(c, ->y), (REAL)EACH_LANE(c, ->z)},
                     (INT)EACH_LANE(row, ->w)};
}

/* Each lane's three rows of an array, of which `index` says which: those that `face` names there. Lanes with a negative
 * index get any. Neighbours are mostly on few triangles, and the numbers of one at a time are read faster than each
 * lane's own. With up to four triangles, frames of a million, where most packets have more, took 1.04 to 1.1 of the
 * time. */
#define FEW_TRIANGLES 2
static __attribute__((always_inline)) Corners corners_at(__global const real4 *array, __global const int4 *face,
                                                         const INT index) {
    int one = LARGEST(index);
    const int4 rows = face[max(one, 0)];
    const real4 a = array[rows.x], b = array[rows.y], c = array[rows.z];
    Corners own = {{a.x, a.y, a.z}, {b.x, b.y, b.z}, {c.x, c.y, c.z}, rows.w};
    INT left = index == one ? (INT)-1 : index;
    for (int k = 1; ANY(left >= 0); k++) {
        if (k == FEW_TRIANGLES) return each_corners_at(array, face, index);
        one = LARGEST(left);
        const MASK here = left == one;
        const REAL_MASK put = TO_REAL_MASK(here);
        const int4 more = face[one];
        own.a = put_row(put, own.a, array[more.x]);
        own.b = put_row(put, own.b, array[more.y]);
        own.c = put_row(put, own.c, array[more.z]);
        PUT_WHERE(here, own.fourth, (INT)more.w);
        left = here ? (INT)-1 : left;
    }
    return own;
}

static Triangle triangle_of(const Corners corners) {
    const Real3 e1 = difference(corners.b, corners.a), e2 = difference(corners.c, corners.a);
    return (Triangle){corners.a, e1, e2, cross_of(e1, e2), size_of(e1), size_of(e2)};
}

/* N of each lane's triangle. */
static __attribute__((noinline)) Real3 plane_normals(__global const real4 *vertex, __global const int4 *face,
                                                     const INT number) {
    return triangle_of(corners_at(vertex, face, number)).N;
}

static __attribute__((always_inline)) Triangle triangles_of(const Geometry geometry, const INT number) {
    return triangle_of(corners_at(geometry.vertex, geometry.face, number));
}

/* The filter. A facet is the three planes of a triangle's edges as seen from a fixed point: A' x B' and so on, times
 * the sign of D, in the axes of the camera, each divided by a bound of what its volume is off by in float. So what is
 * above 1 is surely positive and what is below -1 surely negative.
 *
 * From the eye, d = (x, y, -1): numbers and d are rounded once, and three roundings follow, so with e = 2^-24 a volume
 * is off by less than 5.01 e (X |n.x| + Y |n.y| + |n.z|), X and Y being the largest |x| and |y| of the picture; from a
 * light, with any w, by less than 5.01 e |n| |w|, and sqrt(w.w) is right to 4 e. [FACET_ROUNDINGS = 6] See
 * plan/shapes/mesh.py. */
typedef struct {
    MASK open, inside; /* whether all three volumes may be positive, and whether they surely are */
} Sides;

/* The sign of a plane for directions that it holds: that of its first number that is not 0. */
static int first_sign(const float4 n) {
    const float first = n.x != 0 ? n.x : n.y != 0 ? n.y : n.z;
    return first > 0;
}

/* bound: what the planes' bound is to be multiplied by. */
static Sides sides_of(const FLOAT x, const FLOAT y, const FLOAT z, const FLOAT bound, __global const float4 *facet) {
    const float4 ab = facet[0], bc = facet[1], ca = facet[2];
    const FLOAT one = FMA(x, (FLOAT)ab.x, FMA(y, (FLOAT)ab.y, z * ab.z));
    const FLOAT two = FMA(x, (FLOAT)bc.x, FMA(y, (FLOAT)bc.y, z * bc.z));
    const FLOAT three = FMA(x, (FLOAT)ca.x, FMA(y, (FLOAT)ca.y, z * ca.z));
    const FLOAT low = one < two ? one : two, least = low < three ? low : three;
    Sides sides;
#if REAL_BYTES == 8
    sides.open = least >= -bound;
    sides.inside = least > bound;
#else
    sides.open = least > 0;
    if (RARELY(ANY(least == 0)))
        sides.open = ((one > 0) | ((one == 0) & -first_sign(ab))) & ((two > 0) | ((two == 0) & -first_sign(bc))) &
                     ((three > 0) | ((three == 0) & -first_sign(ca)));
    sides.inside = sides.open;
#endif
    return sides;
}

/* 1/t for a ray that meets the triangle's plane at t, of rays that surely meet the triangle, or the plane's depth along
 * a parallel light. The numbers beside the edges are that plane. They and the direction are rounded once, three
 * roundings follow, and the plane itself is off by no more than one: together less than 6.1 of the 8 roundings here. */
static Bounds plane_at(const FLOAT x, const FLOAT y, const FLOAT z, __global const float4 *facet) {
    const float a = facet[0].w, b = facet[1].w, c = facet[2].w;
    const FLOAT at = FMA(x, (FLOAT)a, FMA(y, (FLOAT)b, z * c));
    const FLOAT size = FMA(magnitude(x), (FLOAT)fabs(a), FMA(magnitude(y), (FLOAT)fabs(b), magnitude(z) * fabs(c)));
    return (Bounds){FMA(size, (FLOAT)-0x1p-21f, at), FMA(size, (FLOAT)0x1p-21f, at)};
}

/* What is known of rays and triangles in double: the numbers above, and what they are off by.
 *
 * With u = 2^-53. Each coordinate of A' is off by u of itself for each of two subtractions and by what the step is off
 * by, together below 2^-48 s, s = |A'| + reach. e1 and e2 are off by u of themselves. So R = A' x w is off by less than
 * 2^-46 s w1 in each coordinate, and E_AB = -e1.R, which is w.(A' x e1), by less than g (2^-46 s w1 + 4 u s w1): below
 * 2^-45 g s w1; likewise E_CA with h. N is off by 5 u g h in each coordinate, D by h g (5 u + 2^-48 + 3 u) s < 2^-46 g
 * h s and N.w by less than 2^-47 g h w1. E_BC is what is left of N.w, and all of N.w is below g s w1 + h s w1 + |E_BC|,
 * so 2^-44 (g + h) s w1 has room for the sum of their errors; where N.w itself is off by more than that, since the
 * triangle is large beside s, its own bound counts. */
typedef struct {
    REAL D, den;     /* A'.N and N.w */
    REAL EA, EB, EC; /* opposite A, B, C: of the edges BC, CA, AB */
    REAL E_error, D_error, den_error;
} Volumes;

#define DOUBLE_ERROR(share) ((real)(REAL_BYTES == 8 ? share : 0)) /* of which float knows nothing */
static __attribute__((always_inline)) Volumes volumes_of(const Leaving ray, const Triangle T) {
    const Real3 A = difference(difference(T.a, ray.center), ray.p), R = cross_of(A, ray.w);
    const REAL s = size_of(A) + ray.reach, gh = T.g * T.h;
    Volumes v;
    v.D = DOT(A, T.N);
    v.den = DOT(T.N, ray.w);
    v.EB = DOT(T.e2, R);
    v.EC = -DOT(T.e1, R);
    v.EA = (v.den - v.EB) - v.EC;
    v.D_error = DOUBLE_ERROR(0x1p-45f) * s * gh;
    v.den_error = DOUBLE_ERROR(0x1p-46f) * ray.w1 * gh;
    v.E_error = DOUBLE_ERROR(0x1p-44f) * s * ray.w1 * (T.g + T.h) + v.den_error;
    return v;
}

/* How much each corner counts at a point of a triangle; together they are 1. */
typedef struct {
    REAL a, b, c;
} Weights;

static REAL smaller_of(const REAL a, const REAL b) {
    return a < b ? a : b;
}

static REAL larger_of(const REAL a, const REAL b) {
    return a > b ? a : b;
}

/* The corners from that on from which a point q of each lane's triangle is counted, see places_of(). */
static Corners turned_corners(const Corners c, const Real3 q) {
    const REAL_MASK first = q.z == 0, second = q.z == 1;
    return (Corners){chosen(first, c.a, chosen(second, c.b, c.c)), chosen(first, c.b, chosen(second, c.c, c.a)),
                     chosen(first, c.c, chosen(second, c.a, c.b)), c.fourth};
}

#if REAL_BYTES == 8
/* The last word on rays and triangles, where doubles are unsure: in pairs, then in whole numbers. */

/* A ray, in pairs, too. */
typedef struct {
    Leaving ray;
    PairRay fine;
    /* For whole numbers: */
    REAL_MASK whole;  /* whether it starts at the eye or on a triangle, along d of camera space; WITH_RAYS, see there */
    REAL_MASK placed; /* whether it starts there, wherever it leads */
} FinePath;

/* u (next corner - corner) + v (the one after - corner), in pairs, of the point q of each lane's triangle. */
static Pair3 fine_step(const Geometry geometry, const INT number, const Real3 q) {
    const Corners c = turned_corners(corners_at(geometry.vertex, geometry.face, number), q);
    return plus3(times3(pair(q.x, 0), pairs_between(c.a, c.b)), times3(pair(q.y, 0), pairs_between(c.a, c.c)));
}

/* Where a ray starts in whole numbers: anchor + u (next - anchor) + v (last - anchor); from the plane of an
 * orthographic camera, and WITH_RAYS, anchor + u next + v last. */
typedef struct {
    real4 anchor, next, last;
    double u, v;
    Span places, weights;
    int on_plane; /* whether it is that plane, or a start of rays.cl */
} WholeStart;

/* The lanes of a FinePath: the triangle that each ray leaves and the point (u, v, k) of that, and its direction;
 * WITH_RAYS, the three numbers whose sum is the one ray's start. */
typedef struct {
    int own[W];
    double u[W], v[W], k[W], x[W], y[W], z[W];
#ifdef WITH_RAYS
    real4 start[3];
#endif
} PathLanes;

static void store_path(PathLanes *to, const Geometry geometry, const FinePath path) {
    STORE_LANES(TRIANGLE_OR_NONE(geometry, path.ray.own), to->own);
    STORE_LANES(path.ray.q.x, to->u);
    STORE_LANES(path.ray.q.y, to->v);
    STORE_LANES(path.ray.q.z, to->k);
    STORE_LANES(path.ray.d.x, to->x);
    STORE_LANES(path.ray.d.y, to->y);
    STORE_LANES(path.ray.d.z, to->z);
#ifdef WITH_RAYS
    const Pair3 step = path.fine.step;
    to->start[0] = (real4)(path.ray.center.x, path.ray.center.y, path.ray.center.z, 0);
    to->start[1] = (real4)(step.x.hi, step.y.hi, step.z.hi, 0);
    to->start[2] = (real4)(step.x.lo, step.y.lo, step.z.lo, 0);
#endif
}

static real4 direction_of(const PathLanes *path, const int lane) {
    return (real4)(path->x[lane], path->y[lane], path->z[lane], 0);
}

/* Where a lane's ray starts: at its point of a triangle, or at the eye where it leaves none. */
static WholeStart whole_start(const Geometry geometry, const PathLanes *path, const int lane) {
    const int own = path->own[lane], k = (int)path->k[lane];
    const double u = path->u[lane], v = path->v[lane];
    WholeStart start = {geometry.camera[0], geometry.camera[0], geometry.camera[0], 0, 0};
    start.on_plane = HAS(WITH_PARALLEL_RAYS) && own < 0;
    if (start.on_plane) {
        start.next = geometry.camera[1];
        start.last = geometry.camera[2];
        start.u = u;
        start.v = v;
    }
#ifdef WITH_RAYS
    start.anchor = path->start[0];
    start.next = path->start[1];
    start.last = path->start[2];
    start.u = start.v = start.on_plane = 1;
#endif
    if (own >= 0) {
        const int4 face = geometry.face[own];
        const int corner[3] = {face.x, face.y, face.z};
        start.anchor = geometry.vertex[corner[k]];
        start.next = geometry.vertex[corner[(k + 1) % 3]];
        start.last = geometry.vertex[corner[(k + 2) % 3]];
        start.u = u;
        start.v = v;
    }
    start.places = span_of_both(span_of_xyz(start.anchor),
                                span_of_both(span_of_xyz(start.next), span_of_xyz(start.last)));
    start.weights = span_of_both(span_of(1), span_of_both(span_of(start.u), span_of(start.v)));
    return start;
}

/* Coordinate i of p - start, in the unit of `places` times that of `weights`. */
static __attribute__((noinline)) void whole_offset(Integer *out, const WholeStart start, const real4 p, const int i,
                                                   const int n) {
    const int unit = start.places.low, scale = start.weights.low;
    const real4 ends[3] = {p, start.next, start.last};
    const double factor[3] = {1, -start.u, -start.v};
    Integer way, from, weight;
    set_to(out, 0, 0, n);
    for (int k = 0; k < 3; k++) {
        if (factor[k] == 0) continue;
        set_to(&way, coordinate(ends[k], i), unit, n);
        set_to(&from, coordinate(start.anchor, i), unit, n);
        if (k == 0 || !start.on_plane) add(&way, -1, &from, n);
        set_to(&weight, factor[k], scale, n);
        add_product(out, &way, &weight, n);
    }
}

/* x x y; the product is none of them. */
static __attribute__((noinline)) void whole_cross(Integer *cross, const Integer *x, const Integer *y, const int n) {
    Integer part;
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        multiply(&cross[i], &x[j], &y[k], n);
        multiply(&part, &x[k], &y[j], n);
        add(&cross[i], -1, &part, n);
    }
}

/* The sign of a product, and that of the first number of v that is not 0 where it is 0. */
static int first_sign_of(const Integer *product, const Integer *v, const int n) {
    int sign = sign_of(product, n);
    for (int i = 0; i < 3 && sign == 0; i++) sign = sign_of(&v[i], n);
    return sign;
}

/* The sign of w.(X' x Y'), of X' x Y' where that is 0; and, without a direction, of Z'.(X' x Y'). What would take more
 * than DIGITS digits counts as 0: no coordinates of a size do. */
static __attribute__((noinline)) int whole_volume(const Geometry geometry, WholeStart start, const real4 X,
                                                  const real4 Y, const real4 Z, const int directed, const real4 way) {
    const Span B = span_of_axes(geometry), d = span_of_xyz(way);
    start.places = span_of_both(start.places,
                                span_of_both(span_of_xyz(X), span_of_both(span_of_xyz(Y), span_of_xyz(Z))));
    const int bits = start.places.high - start.places.low + start.weights.high - start.weights.low + 4;
    const int turned = B.high - B.low + d.high - d.low + 2;
    const int n = (2 * bits + (directed ? turned : bits) + 8 + 31) / 32;
    if (n > DIGITS) return HAS(WITH_RAYS) ? mark_undecided(geometry) : 0;
    Integer x[3], y[3], cross[3], volume, w;
    set_to(&volume, 0, 0, n);
    for (int i = 0; i < 3; i++) {
        whole_offset(&x[i], start, X, i, n);
        whole_offset(&y[i], start, Y, i, n);
    }
    whole_cross(cross, x, y, n);
    for (int i = 0; i < 3; i++) {
        if (directed) whole_turned(&w, geometry, way, i, B.low, d.low, n);
        else whole_offset(&w, start, Z, i, n);
        add_product(&volume, &cross[i], &w, n);
    }
    return directed ? first_sign_of(&volume, cross, n) : sign_of(&volume, n);
}

static int share_a_plane(const Geometry geometry, const int a, const int b);

/* The signs of the volumes of each lane's triangle in whole numbers, for the lanes of `unsure`: E of the edge from
 * corner `from` to corner `to`, or D where from = to. */
static __attribute__((noinline)) INT whole_signs(const Geometry geometry, const FinePath path, const INT number,
                                                 const int from, const int to, const MASK unsure) {
    if (HAS(WITH_RAYS) && !HAS(WITH_WHOLE)) return (INT)mark_undecided(geometry);
    int each[W], left[W], sign[W];
    PathLanes lanes;
    STORE_LANES(number, each);
    STORE_LANES(unsure, left);
    store_path(&lanes, geometry, path);
    for (int lane = 0; lane < W; lane++) {
        sign[lane] = 0;
        if (!left[lane]) continue;
        if (from == to && lanes.own[lane] >= 0 && share_a_plane(geometry, lanes.own[lane], each[lane])) continue;
        const int4 face = geometry.face[each[lane]];
        const real4 corner[3] = {geometry.vertex[face.x], geometry.vertex[face.y], geometry.vertex[face.z]};
        const WholeStart start = whole_start(geometry, &lanes, lane);
        sign[lane] = from == to ? whole_volume(geometry, start, corner[0], corner[1], corner[2], 0, (real4)(0))
                                : whole_volume(geometry, start, corner[from], corner[to], corner[from], 1,
                                               direction_of(&lanes, lane));
    }
    return LOAD_LANES(sign);
}

/* N and D of a triangle as seen from a start. */
static __attribute__((noinline)) void whole_plane(Integer *N, Integer *D, const WholeStart start, const real4 *corner,
                                                  const int n) {
    Integer a[3], e1[3], e2[3];
    for (int i = 0; i < 3; i++) {
        whole_offset(&a[i], start, corner[0], i, n);
        whole_offset(&e1[i], start, corner[1], i, n);
        whole_offset(&e2[i], start, corner[2], i, n);
        add(&e1[i], -1, &a[i], n);
        add(&e2[i], -1, &a[i], n);
    }
    whole_cross(N, e1, e2, n);
    set_to(D, 0, 0, n);
    for (int i = 0; i < 3; i++) add_product(D, &a[i], &N[i], n);
}

/* The sign of w.Q, and of Q where that is 0, see plane_comes_first(). corner: the three of A, then those of B. */
static __attribute__((noinline)) int whole_order(const Geometry geometry, WholeStart start, const real4 *corner,
                                                 const real4 way) {
    const Span B = span_of_axes(geometry), d = span_of_xyz(way);
    for (int k = 0; k < 6; k++) start.places = span_of_both(start.places, span_of_xyz(corner[k]));
    /* With places below 2^bits, edges are below 2^(bits + 1), N 2^(2 bits + 3), D 2^(3 bits + 5) and Q 2^(5 bits + 9).
     */
    const int bits = start.places.high - start.places.low + start.weights.high - start.weights.low + 4;
    const int n = (5 * bits + 9 + B.high - B.low + d.high - d.low + 6 + 31) / 32;
    if (n > DIGITS) return HAS(WITH_RAYS) ? mark_undecided(geometry) : 0;
    Integer N[2][3], D[2], Q[3], w, volume;
    for (int k = 0; k < 2; k++) whole_plane(N[k], &D[k], start, corner + 3 * k, n);
    const int sides = sign_of(&D[0], n) * sign_of(&D[1], n);
    negate(&D[1], n);
    set_to(&volume, 0, 0, n);
    for (int i = 0; i < 3; i++) {
        multiply(&Q[i], &D[0], &N[1][i], n);
        add_product(&Q[i], &D[1], &N[0][i], n);
        whole_turned(&w, geometry, way, i, B.low, d.low, n);
        add_product(&volume, &Q[i], &w, n);
    }
    return sides * first_sign_of(&volume, Q, n);
}

/* Whether two triangles are in one plane for a reason that needs no whole numbers: a plane across an axis. */
static int share_a_level(const real4 *a, const real4 *b) {
    int level[3] = {1, 1, 1};
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++) {
            const double at = coordinate(a[0], i);
            level[i] &= coordinate(a[k], i) == at && coordinate(b[k], i) == at;
        }
    }
    return level[0] || level[1] || level[2];
}

/* Whether the corners b are in the plane of the corners a, in whole numbers: whether none of the three volumes with
 * them, as seen from a[0], has a sign. With places below 2^bits a volume is below 2^(3 bits + 6). */
static __attribute__((noinline)) int whole_coplanar(const Geometry geometry, const real4 *a, const real4 *b) {
    const Span here = span_of_xyz(a[0]), one = span_of(1);
    const WholeStart start = {a[0], a[0], a[0], 0, 0, here, one, 0};
    Span places = here;
    for (int k = 0; k < 3; k++) places = span_of_both(places, span_of_both(span_of_xyz(a[k]), span_of_xyz(b[k])));
    if ((3 * (places.high - places.low + one.high - one.low + 4) + 8 + 31) / 32 > DIGITS) return 0;
    for (int k = 0; k < 3; k++)
        if (whole_volume(geometry, start, a[1], a[2], b[k], 0, (real4)(0)) != 0) return 0;
    return 1;
}

/* Planes that several triangles share. Whether two do takes whole numbers, but it is the same for all rays, so it is
 * found out once, and noted: of each triangle another one before it, of that one the next, down to the first one that
 * is known. Several work-items write at once, and what one of them notes may be lost or be seen late. Then it is found
 * out again. What is noted is always true, so no picture depends on that. */
static int first_in_plane(const Geometry geometry, int number) {
    for (int before = geometry.plane[number]; before; before = geometry.plane[number]) number = before - 1;
    return number;
}

static void note_plane(const Geometry geometry, const int a, const int b) {
    const int one = first_in_plane(geometry, a), two = first_in_plane(geometry, b), first = min(one, two);
    if (one != two) geometry.plane[max(one, two)] = first + 1;
    if (a != first) geometry.plane[a] = first + 1;
    if (b != first) geometry.plane[b] = first + 1;
}

/* Whether two triangles are in one plane. */
static __attribute__((noinline)) int share_a_plane(const Geometry geometry, const int a, const int b) {
    if (first_in_plane(geometry, a) == first_in_plane(geometry, b)) return 1;
    const int4 f = geometry.face[a], g = geometry.face[b];
    const real4 one[3] = {geometry.vertex[f.x], geometry.vertex[f.y], geometry.vertex[f.z]};
    const real4 two[3] = {geometry.vertex[g.x], geometry.vertex[g.y], geometry.vertex[g.z]};
    const int levels_alone = HAS(WITHOUT_RARE) || (HAS(WITH_RAYS) && !HAS(WITH_WHOLE));
    if (!share_a_level(one, two) && (levels_alone || !whole_coplanar(geometry, one, two))) return 0;
    note_plane(geometry, a, b);
    return 1;
}

/* The same, as far as it is known, or without whole numbers where there are none: what is not is left to another
 * program. */
static int is_known_in_plane(const Geometry geometry, const int a, const int b) {
    if (HAS(WITHOUT_RARE)) return share_a_plane(geometry, a, b);
    return first_in_plane(geometry, a) == first_in_plane(geometry, b);
}

/* In which lanes two surfaces are triangles that are known to be in one plane. A ray that meets both meets them at
 * once, and one that starts on one of them does not meet the other. */
static __attribute__((noinline)) MASK known_in_one_plane(const Geometry geometry, const INT A, const INT B) {
    const MASK both = IS_TRIANGLE(geometry, A) & IS_TRIANGLE(geometry, B);
    int a[W], b[W], same[W];
    STORE_LANES(A - (INT)FIRST_TRIANGLE(geometry), a);
    STORE_LANES(B - (INT)FIRST_TRIANGLE(geometry), b);
    STORE_LANES(both, same);
    for (int lane = 0; lane < W; lane++) {
        if (!same[lane]) continue;
        const int again = lane && a[lane] == a[lane - 1] && b[lane] == b[lane - 1];
        same[lane] = again ? same[lane - 1] : -is_known_in_plane(geometry, a[lane], b[lane]);
    }
    return LOAD_LANES(same);
}

/* What whole_order() says of each lane's triangles, for the lanes of `unsure`. */
static __attribute__((noinline)) INT whole_orders(const Geometry geometry, const FinePath path, const INT A,
                                                  const INT B, const MASK unsure) {
    if (HAS(WITH_RAYS) && !HAS(WITH_WHOLE)) return (INT)mark_undecided(geometry);
    int one[W], two[W], left[W], sign[W];
    PathLanes lanes;
    STORE_LANES(A, one);
    STORE_LANES(B, two);
    STORE_LANES(unsure, left);
    store_path(&lanes, geometry, path);
    for (int lane = 0; lane < W; lane++) {
        sign[lane] = 0;
        if (!left[lane] || share_a_plane(geometry, one[lane], two[lane])) continue;
        const int4 a = geometry.face[one[lane]], b = geometry.face[two[lane]];
        const real4 corner[6] = {geometry.vertex[a.x], geometry.vertex[a.y], geometry.vertex[a.z],
                                 geometry.vertex[b.x], geometry.vertex[b.y], geometry.vertex[b.z]};
        sign[lane] = whole_order(geometry, whole_start(geometry, &lanes, lane), corner, direction_of(&lanes, lane));
    }
    return LOAD_LANES(sign);
}

/* The sign of the first number of v that is not within its error of 0. */
static REAL first_sign_within(const Pair3 v, const REAL error) {
    const REAL x = sign_from(v.x.hi, error), y = sign_from(v.y.hi, error);
    return x != 0 ? x : y != 0 ? y : sign_from(v.z.hi, error);
}

/* E of the edge between two corners, X and Y, as seen from O in X and Y. Where E is 0, the result is tiny,
 * with the sign that breaks the tie. Both triangles at an edge compute E from the same end, so their signs never
 * disagree.
 *
 * Bounds, u = 2^-53: X' is off by 2^-99 of s, Y - X by u^2, each coordinate of X' x (Y - X) by less than 2^-98 s e,
 * with e the sum of the magnitudes of Y - X, and E by less than 2^-97 s e w1. */
static __attribute__((noinline)) REAL edge_volume(const Geometry geometry, const FinePath path, const INT number,
                                                  const int from, const int to, const REAL_MASK wanted) {
    const Corners corners = corners_at(geometry.vertex, geometry.face, number);
    const Real3 corner[3] = {corners.a, corners.b, corners.c}, x = corner[from], y = corner[to];
    const REAL_MASK flip = (y.x < x.x) | ((y.x == x.x) & ((y.y < x.y) | ((y.y == x.y) & (y.z < x.z))));
    const Real3 X = chosen(flip, y, x), Y = chosen(flip, x, y);
    const Pair3 P = minus3(pairs_between(path.ray.center, X), path.fine.step), e = pairs_between(X, Y);
    const Pair3 n = cross_pairs(P, e);
    const Pair E = dot_pairs(path.fine.w, n);
    const REAL size = (size_of_pairs(P) + path.ray.reach) * size_of_pairs(e), n_error = 0x1p-98 * size;
    REAL volume = fabs(E.hi) > 0x1p-97 * size * path.ray.w1 ? E.hi : (REAL)0;
    const REAL_MASK tie = wanted & (volume == 0);
    if (ANY(TO_MASK(tie))) {
        REAL first = first_sign_within(n, n_error);
        const MASK unsure = TO_MASK(tie & path.whole);
        if (HAS(WITH_RAYS) && ANY(TO_MASK(tie & !path.whole))) mark_undecided(geometry);
        if (ANY(unsure)) {
            const REAL whole = TO_REAL(whole_signs(geometry, path, number, from, to, unsure));
            first = TO_REAL_MASK(unsure) ? (flip ? -whole : whole) : first;
        }
        volume = tie ? 0x1p-1000 * first : volume;
    }
    return flip ? -volume : volume;
}

/* The plane of each lane's triangle as seen from O. With u = 2^-53, the N of pairs is off by less than 2^-99 gh, and D
 * by less than 2^-97 s gh. */
typedef struct {
    Pair3 N;
    Pair D;
    REAL s, gh; /* |A'| + reach and |e1| |e2|, as sums of the coordinates' magnitudes */
} FinePlane;

static FinePlane fine_plane(const Geometry geometry, const FinePath path, const INT number) {
    const Corners corners = corners_at(geometry.vertex, geometry.face, number);
    const Pair3 e1 = pairs_between(corners.a, corners.b), e2 = pairs_between(corners.a, corners.c);
    const Pair3 A = minus3(pairs_between(path.ray.center, corners.a), path.fine.step), N = cross_pairs(e1, e2);
    return (FinePlane){N, dot_pairs(A, N), size_of_pairs(A) + path.ray.reach, size_of_pairs(e1) * size_of_pairs(e2)};
}

/* Which of two triangles that a ray meets at one t, as far as pairs can tell, comes first, for the lanes of `wanted`.
 * At one t it is the one that the ray w + (e, e^2, e^3) meets first; in one plane, that of the lanes of `tie`.
 *
 * As t = D / (N.w), with the signs s of the D, A comes first where Q.w < 0 for Q = s_A s_B (D_A N_B - D_B N_A); and
 * where Q.w is 0, the first number of Q that is not 0 decides. Whole numbers find out; of a ray from a sphere, there
 * are none, and Q.w counts as 0. By the bounds above, and 2^-100 for each product, a number of Q is off by less than
 * 2^-96 (s_A + s_B) gh_A gh_B.
 */
static __attribute__((noinline)) REAL_MASK plane_comes_first(const Geometry geometry, const FinePath path, const INT A,
                                                             const INT B, const REAL_MASK tie, const REAL_MASK wanted) {
    const FinePlane a = fine_plane(geometry, path, A), b = fine_plane(geometry, path, B);
    const REAL sides = (a.D.hi < 0) ^ (b.D.hi < 0) ? (REAL)-1 : (REAL)1;
    const REAL error = 0x1p-95 * (a.s + b.s) * (a.gh * b.gh);
    REAL first = sides * first_sign_within(minus3(times3(a.D, b.N), times3(b.D, a.N)), error);
    const MASK exact = TO_MASK(wanted & path.whole);
    if (HAS(WITH_RAYS) && ANY(TO_MASK(wanted & !path.whole))) mark_undecided(geometry);
    if (ANY(exact)) {
        const REAL whole = TO_REAL(whole_orders(geometry, path, A, B, exact));
        first = TO_REAL_MASK(exact) ? whole : first;
    }
    return (first < 0) | ((first == 0) & tie);
}

/* t of each lane's ray in a triangle's plane, in pairs, with a bound of what it is off by. */
static FineT fine_t_in(const FinePlane plane, const FinePath path) {
    const Pair den = dot_pairs(plane.N, path.fine.w);
    const REAL D_error = 0x1p-97 * plane.s * plane.gh, den_error = 0x1p-97 * path.ray.w1 * plane.gh;
    FineT at;
    at.t = over(plane.D, den);
    at.error = 2 * fabs(at.t.hi) * (D_error / fabs(plane.D.hi) + den_error / fabs(den.hi) + 0x1p-97);
    return at;
}

/* Whether each lane's ray meets its triangle, and t in pairs. */
typedef struct {
    REAL_MASK hit;
    Pair t;
    REAL side;     /* the sign of D */
    Shares shares; /* where the ray meets it */
} FineTriangle;

static __attribute__((noinline)) FineTriangle fine_triangle(const Geometry geometry, const FinePath path,
                                                            const INT number, const REAL_MASK wanted) {
    const FinePlane plane = fine_plane(geometry, path, number);
    FineTriangle fine;
    fine.side = sign_from(plane.D.hi, 0x1p-97 * plane.s * plane.gh);
    const MASK unsure = TO_MASK(wanted & path.placed & (fine.side == 0));
    if (ANY(unsure)) {
        const REAL whole = TO_REAL(whole_signs(geometry, path, number, 0, 0, unsure));
        fine.side = TO_REAL_MASK(unsure) ? whole : fine.side;
    }
    fine.hit = wanted & (fine.side != 0);
    REAL volume[3] = {0, 0, 0};
    for (int k = 0; k < 3 && ANY(TO_MASK(fine.hit)); k++) {
        volume[k] = edge_volume(geometry, path, number, k, (k + 1) % 3, fine.hit);
        fine.hit = fine.hit & (fine.side * volume[k] > 0);
    }
    /* Of a hit all volumes have one sign, so their sum loses no digits. */
    fine.shares = (Shares){volume[2], volume[0], (volume[0] + volume[1]) + volume[2]};
    fine.t = fine_t_in(plane, path).t;
    return fine;
}

static FinePath fine_path(const Geometry geometry, const Leaving ray) {
    const REAL_MASK placed = TO_REAL_MASK((ray.own == -1) | IS_TRIANGLE(geometry, ray.own));
    const REAL_MASK whole = HAS(WITH_RAYS) ? (REAL_MASK)(ray.r >= 0) : placed;
    return (FinePath){ray, pair_ray(geometry, ray), whole, placed};
}

/* Lanes whose t is not right to 2^-24 of itself by double, and such in which it is unsure whether they meet at all. */
static __attribute__((noinline)) FineTriangle fine_meeting_of(const Geometry geometry, const Leaving ray,
                                                              const INT number, const REAL_MASK wanted) {
    return fine_triangle(geometry, fine_path(geometry, ray), number, wanted);
}

/* Puts the way from the corner to the point that rays leave into the lanes that leave triangles. */
static void triangle_fine_start(const Geometry geometry, const Leaving ray, Pair3 *step) {
    const Pair3 own = fine_step(geometry, TRIANGLE_OR_NONE(geometry, ray.own), ray.q);
    *step = KINDS_OF_SHAPES == 1 ? own : choose_pairs(TO_REAL_MASK(IS_TRIANGLE(geometry, ray.own)), own, *step);
}
#else
/* Float knows of no planes. */
static MASK known_in_one_plane(const Geometry geometry, const INT A, const INT B) {
    return 0;
}
#endif

/* Where a point q of each lane's triangle is: k = q.z is the corner that it is counted from, u = q.x counts the way
 * from there to the next corner and v = q.y that to the one after. Of lanes whose surface is a triangle. */
static __attribute__((always_inline)) Place3 places_of(const Geometry geometry, const INT index, const Real3 q) {
    const INT number = TRIANGLE_OR_NONE(geometry, index);
    const Corners c = turned_corners(corners_at(geometry.vertex, geometry.face, number), q);
    const Real3 x = difference(c.b, c.a), y = difference(c.c, c.a);
    return (Place3){c.a, sum3(scaled(x, q.x), scaled(y, q.y)), size_of(x) + size_of(y)};
}

/* What is read of triangles. light: the number of a light, -1: the eye. */

static void triangle_fetch(const Scene *scene, const int light, const int index) {
    const int number = index - FIRST_TRIANGLE(scene->geometry);
    __global const float4 *facets = light < 0 ? scene->facet : scene->light_facet + 3 * (long)light * scene->triangles;
    FETCH(facets, 3 * (long)number);
    FETCH(facets, 3 * (long)number + 2);
    FETCH(scene->geometry.face, number);
}

static void triangle_fetch_leaf(const Scene *scene, const int leaf) {
    __global const uchar *lines = (__global const uchar *)(scene->patch + (leaf - scene->tree.blocks));
    for (int line = 0; line < 6; line++) FETCH(lines, 64 * line);
}

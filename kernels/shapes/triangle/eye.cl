/* eye.cl: triangles along rays from the eye, and along rays that start on surfaces. */

/* Triangles along rays from the eye. */

/* Where each of the lanes' rays meets its triangle. */
typedef struct {
    REAL t; /* INFINITY if it does not */
    Shares shares;
    REAL_MASK unsure;    /* whether double cannot tell t; always false in single */
    REAL_MASK has_point; /* whether the error of the shares' point is at most 2^-24 of the way, as in the reference */
} Crossing;

/* The crossings of the lanes of `wanted`, as far as `real` tells. inside: lanes of which it is known that all three
 * volumes have the sign of D. */
#if REAL_BYTES == 8
static __attribute__((always_inline)) Crossing triangle_meet(const Leaving ray, const Triangle T,
                                                             const REAL_MASK wanted, const REAL_MASK inside) {
    const Volumes v = volumes_of(ray, T);
    const REAL D = v.D, t = D / v.den;
    Crossing at = {(REAL)INFINITY, {v.EB, v.EC, v.den}, 0};
    REAL_MASK meets = inside, misses = 0;
    if (ANY(TO_MASK(wanted & !inside))) {
        const REAL least = smaller_of(v.EA, smaller_of(v.EB, v.EC)), most = larger_of(v.EA, larger_of(v.EB, v.EC));
        const REAL_MASK split = (least < -v.E_error) & (most > v.E_error);
        const REAL_MASK before = (D > v.D_error) & (least < -v.E_error), behind = (D < -v.D_error) & (most > v.E_error);
        misses = !inside & (split | before | behind);
        meets = inside | ((D > 0) & (least > v.E_error)) | ((D < 0) & (most < -v.E_error));
    }
    const REAL_MASK sure_t = (fabs(D) > 0x1p26 * v.D_error) & (fabs(v.den) > 0x1p26 * v.den_error);
    at.unsure = wanted & !misses & !(meets & sure_t);
    at.has_point = v.E_error * (T.g + T.h) <= 0x1p-24 * (fabs(D) * ray.w1 + fabs(v.den) * ray.reach);
    at.t = (wanted & meets & sure_t) ? t : at.t;
    /* Along parallel rays it is known that the volumes have one sign, and so that of N.w, not which: the triangle may
     * be behind the plane where they start. */
    if (HAS(WITH_PARALLEL_RAYS)) at.t = t > 0 ? at.t : (REAL)INFINITY;
    return at;
}

/* Puts what pairs say into the lanes that are unsure. index: of the triangles. */
static __attribute__((always_inline)) void decide_crossing(const Geometry geometry, const Leaving ray, const INT index,
                                                           Crossing *at) {
    if (!UNDECIDED(geometry, ANY(TO_MASK(at->unsure)))) return;
    at->unsure = at->unsure & !TO_REAL_MASK(known_in_one_plane(geometry, index, ray.own));
    if (!ANY(TO_MASK(at->unsure))) return;
    const FineTriangle fine = fine_meeting_of(geometry, ray, TRIANGLE_OR_NONE(geometry, index), at->unsure);
    at->t = (at->unsure & fine.hit) ? fine.t.hi : at->t;
    put_shares(at->unsure & fine.hit & !at->has_point, fine.shares, &at->shares);
}
#else
/* Float tells no ties apart: both triangles at an edge are met, and none is missed. */
static __attribute__((always_inline)) Crossing triangle_meet(const Leaving ray, const Triangle T,
                                                             const REAL_MASK wanted, const REAL_MASK inside) {
    const Volumes v = volumes_of(ray, T);
    const REAL D = v.D, t = D / v.den;
    const REAL least = smaller_of(v.EA, smaller_of(v.EB, v.EC)), most = larger_of(v.EA, larger_of(v.EB, v.EC));
    const REAL_MASK meets = inside | ((D > 0) & (least >= 0)) | ((D < 0) & (most <= 0));
    const Crossing at = {(wanted & meets & (t > 0)) ? t : (REAL)INFINITY, {v.EB, v.EC, v.den}, 0};
    return at;
}
#define decide_crossing(geometry, ray, index, at)
#endif

/* The crossings of rays with the triangles that `index` names; others get any crossing. wanted, inside: as of
 * triangle_meet(). */
static __attribute__((always_inline)) Crossing crossing_of(const Geometry geometry, const Leaving ray, const INT index,
                                                           const REAL_MASK wanted, const REAL_MASK inside) {
    Crossing at = triangle_meet(ray, triangles_of(geometry, TRIANGLE_OR_NONE(geometry, index)), wanted, inside);
    decide_crossing(geometry, ray, index, &at);
    return at;
}

/* Where the lanes of a hit meet its triangles. */
static __attribute__((always_inline)) Crossing crossing_from_eye(const Geometry geometry, const EyeRay ray,
                                                                 const INT id, const MASK sure) {
    const MASK here = IS_TRIANGLE(geometry, id);
    return crossing_of(geometry, from_eye(geometry, ray), id, TO_REAL_MASK(here), TO_REAL_MASK(here & sure));
}

/* Bounds of 1/t, or of parallel rays -t, where rays meet a triangle's plane. That of parallel rays is known as along a
 * parallel light, to 2^-27 beside the roundings. */
static Bounds near_plane(const FLOAT x, const FLOAT y, __global const float4 *facet) {
    const Bounds plane = plane_at(x, y, (FLOAT)(HAS(WITH_PARALLEL_RAYS) ? 1 : -1), facet);
    if (!HAS(WITH_PARALLEL_RAYS)) return plane;
    return (Bounds){-plane.high - 0x1p-26f, -plane.low + 0x1p-26f};
}

/* Puts t of the lanes that have hit triangles so far into theirs. */
static __attribute__((noinline)) void triangle_settle_t(const Scene *scene, const EyeRay ray, const Rival hit,
                                                        REAL *t) {
    const MASK here = IS_TRIANGLE(scene->geometry, hit.id);
    if (!ANY(here)) return;
    const Crossing at = crossing_from_eye(scene->geometry, ray, hit.id, hit.sure);
    PUT_WHERE(TO_REAL_MASK(here), *t, at.t);
}

/* What is decided of a triangle: in which lanes it is hit, first, and bounds of 1/t there. */
typedef struct {
    MASK nearer;
    Bounds near;
} Decision;

/* That of the lanes of `open`, where float32 cannot tell. inside: as in triangle_meet(); hit: what they have hit so
 * far. */
static __attribute__((noinline)) Decision decide_triangle(const Scene *scene, const EyeRay *ray, const int index,
                                                          const MASK open, const MASK inside, const Rival *hit) {
    const Leaving way = from_eye(scene->geometry, *ray);
    const REAL t = crossing_of(scene->geometry, way, (INT)index, TO_REAL_MASK(open), TO_REAL_MASK(inside)).t;
    const REAL_MASK nearer = comes_before(scene, ray, t, (INT)index, hit) & (t < INFINITY);
    return (Decision){TO_MASK(nearer), near_of(t, scene->unit)};
}

/* Takes a triangle into account, and tells whether any lane hits it. Of an orthographic camera, the facets are lines on
 * the image plane, as those of a parallel light are. */
static __attribute__((always_inline)) int triangle_take(const Scene *scene, const Ray ray, EyeLine *line,
                                                        const int index, Hit *hit, Work *work) {
    const FLOAT x = line->x, y = line->y;
    MASK open = ALL_LANES, inside = 0;
    if (HAS(WITH_FILTER)) {
        __global const float4 *facet = scene->facet + 3 * (long)(index - FIRST_TRIANGLE(scene->geometry));
        const Sides sides = sides_of(x, y, (FLOAT)(HAS(WITH_PARALLEL_RAYS) ? 1 : -1), 1, facet);
        if (!ANY(sides.open)) {
            COUNT(FILTERED, ALL_LANES);
            return 0;
        }
        const Bounds near = near_plane(x, y, facet);
        MASK nearer = sides.inside & (near.low > hit->near.high);
        /* Of parallel rays, it may be behind the plane where they start. */
        if (HAS(WITH_PARALLEL_RAYS)) nearer = nearer & (near.high < 0);
        open = sides.open & !nearer & !(near.high < hit->near.low);
        if (HAS(WITH_PARALLEL_RAYS)) open = open & !(near.low > 0);
        inside = sides.inside;
        put_late(nearer, near, index, hit);
        hit->sure = hit->sure | nearer;
        if (!RARELY(ANY(open))) return ANY(nearer);
    }
    COUNT(DECIDED, open);
    if (is_over(scene)) return 0;
    /* Lanes that surely meet it, and have met another one in its plane: so at the same t. */
    const MASK level = open & inside & known_in_one_plane(scene->geometry, (INT)index, hit->id);
    const MASK lower = level & first_in_file(scene, (INT)index, hit->id);
    PUT_WHERE(lower, hit->id, (INT)index);
    hit->sure = hit->sure | lower;
    open = open & !level;
    if (!ANY(open)) return 1;
    const Scene all = *scene;
    const EyeRay own = eye_ray(ray);
    const Rival rival = {hit->t, hit->id, hit->sure};
    const Decision is = decide_triangle(&all, &own, index, open, inside, &rival);
    put_late(is.nearer, is.near, index, hit);
    PUT_WHERE(is.nearer, hit->sure, inside);
    return 1;
}

/* Puts into a hit where the rays meet triangles. */
static __attribute__((always_inline)) void triangle_settle(const Scene *scene, const Ray ray, Hit *hit) {
    const MASK face = IS_TRIANGLE(scene->geometry, hit->id);
    if (!ANY(face)) return;
    const REAL_MASK here = TO_REAL_MASK(face);
    const Crossing at = crossing_from_eye(scene->geometry, eye_ray(ray), hit->id, hit->sure);
    hit->shares = at.shares;
    /* Where a triangle is seen all but from its edge, rounding to float may lose it. */
    const REAL t = REAL_BYTES == 8 ? at.t : at.t < INFINITY ? at.t : TO_REAL(far_of(hit->near.low));
    PUT_WHERE(here, hit->t, t);
}

/* Triangles and rays that start on surfaces. */
/* A point of each lane's triangle: how much each corner counts, and the same as a start of rays, see places_of(). */
typedef struct {
    Weights weights;
    Real3 q;
} FacePoint;

/* The corner of the largest weight is the one that the point is counted from, and the other two weights are at most
 * 1/2. A point of an edge is moved inwards by INWARD of the triangle, far less than rounding does: a point on the edge
 * itself would be in the plane of the neighbour as well, and a ray from there would leave a closed room through that.
 */
#define INWARD ((real)(REAL_BYTES == 8 ? 0x1p-64f : 0x1p-30f))

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

/* Puts where rays leave triangles into their lanes. */
static void triangle_leave(const Frame frame, const Geometry geometry, Leaving *ray) {
    leave_place(TO_REAL_MASK(IS_TRIANGLE(geometry, ray->own)), places_of(geometry, ray->own, ray->q), ray);
}

/* Puts the world's coordinates of the lanes that start on triangles into their starts. */
static __attribute__((noinline)) void triangle_place(const Geometry geometry, Start *P) {
    start_from_place(TO_REAL_MASK(IS_TRIANGLE(geometry, P->index)), places_of(geometry, P->index, P->q), P);
}

/* Puts where the lanes' rays meet the triangles that `index` names into their lanes. */
static void triangle_encounter(const Scene *scene, const Leaving ray, const INT index, Encounter *at) {
    const REAL_MASK here = TO_REAL_MASK(IS_TRIANGLE(scene->geometry, index));
    /* A ray that leaves a triangle is in its plane there, and so does not meet it: not asking saves exact stages. */
    const REAL_MASK other = here & TO_REAL_MASK(index != ray.own);
    const Crossing crossing = crossing_of(scene->geometry, ray, index, other, 0);
    at->shares = crossing.shares;
    PUT_OF_SHAPE(here, at->t, crossing.t);
    PUT_OF_SHAPE(here, at->inside, (REAL_MASK)0);
}

/* A triangle is open: what meshes contain is told by how many of their triangles rays meet, see range.cl. */
#define triangle_contains(scene, A, step, error, index) ((MASK)0)

#if REAL_BYTES == 8
/* Puts t of rays that meet triangles into their lanes, in pairs, and a bound of what it is off by. */
static void triangle_fine_t(const Geometry geometry, const Leaving ray, const INT index, FineT *t) {
    const REAL_MASK here = TO_REAL_MASK(IS_TRIANGLE(geometry, index));
    const FinePath path = fine_path(geometry, ray);
    const FineT fine = fine_t_in(fine_plane(geometry, path, TRIANGLE_OR_NONE(geometry, index)), path);
    t->t = choose_pair(here, fine.t, t->t);
    t->error = here ? fine.error : t->error;
}

/* Where both A and B are triangles, in the lanes of `close`: their planes break a tie, see plane_comes_first(), and
 * such lanes are left out of `close`. */
static void triangle_break_tie(const Geometry geometry, const Leaving ray, const INT A, const INT B, REAL_MASK *close,
                               REAL_MASK *first) {
    const REAL_MASK flat = *close & TO_REAL_MASK(IS_TRIANGLE(geometry, A) & IS_TRIANGLE(geometry, B));
    if (!ANY(TO_MASK(flat))) return;
    const INT one = TRIANGLE_OR_NONE(geometry, A), two = TRIANGLE_OR_NONE(geometry, B);
    const REAL_MASK before = plane_comes_first(geometry, fine_path(geometry, ray), one, two, *first, flat);
    *first = flat ? before : *first;
    *close = *close & !flat;
}
#endif

/* Rays that leave surfaces against the triangles in a leaf of the tree, in float32: see find/leaves.cl. */
#ifdef WITH_BOUNCES

/* How a ray stands to a triangle, for 8 triangles and for W rays. may: whether it may meet it. x, y, z: from P to A;
 * wx, wy, wz: the unit direction.
 *
 * Triangles: with F = A - P, R = F x w and N = e x f, U = f.R, V = -e.R and L = N.w - U - V have the sign of N.w where
 * the ray's line passes inside; it does so at t = N.F / N.w. As for spheres, F is off by 4.1 u S and at most 2 S long,
 * and R is off by 14.2 u S. e and f are off by 1.01 u of themselves. So U is off by (14.2 + 2 * 1.01 + 2 * 3.03) u |f|,
 * less than 23 u |f|; V likewise; N by 4.9 u |e||f|; N.w by 9 u |e||f|, and N.F by (4.1 + 2 * 4.9 + 2 * 3.03) u |e||f|,
 * less than 20 u |e||f|; and |e||f| is at most |e| + |f|, as both are at most 2. So L is off by (23 + 9) u (|e| + |f|)
 * and by two roundings, which are 6 u (|e| + |f|) at most as U, V and N.w are below 2 |f|, 2 |e| and |e||f|. All that
 * is less than slack = 40 u (|e| + |f|) + 2^-48 [EDGE_ROUNDINGS = 40]. The last term is for edges so short that their
 * corners, which are rounded to double, may have become one: they are off by up to 2^-51, and all that is made of them
 * by less than 2^-49. The signs are turned with that of N.w. Where that is not sure, and the ray passes inside, they
 * sum up to 18 u |e||f| at most, and with the wrong sign none of them is below -slack either. */
#define PASSAGES(FLOATS, INTS, Passage, passage_of, range_of_passage, Range)                                       \
    typedef struct {                                                                                               \
        INTS may;                                                                                                  \
        FLOATS least, size, D;                                                                                     \
    } Passage;                                                                                                     \
    static Passage passage_of(const FLOATS x, const FLOATS y, const FLOATS z, const FLOATS wx, const FLOATS wy,    \
                              const FLOATS wz, const FLOATS ex, const FLOATS ey, const FLOATS ez, const FLOATS fx, \
                              const FLOATS fy, const FLOATS fz, const FLOATS nx, const FLOATS ny, const FLOATS nz, \
                              const FLOATS slack) {                                                                \
        const FLOATS X = FMA(y, wz, -(z * wy)), Y = FMA(z, wx, -(x * wz)), Z = FMA(x, wy, -(y * wx));              \
        const FLOATS den = FMA(nx, wx, FMA(ny, wy, nz * wz)), D = FMA(nx, x, FMA(ny, y, nz * z));                  \
        const FLOATS U = FMA(fx, X, FMA(fy, Y, fz * Z)), V = -FMA(ex, X, FMA(ey, Y, ez * Z));                      \
        const INTS sign = PASTE(as_, INTS)(den) & (int)0x80000000;                                                 \
        const FLOATS size = PASTE(as_, FLOATS)(PASTE(as_, INTS)(den) ^ sign);                                      \
        const FLOATS u = PASTE(as_, FLOATS)(PASTE(as_, INTS)(U) ^ sign);                                           \
        const FLOATS v = PASTE(as_, FLOATS)(PASTE(as_, INTS)(V) ^ sign);                                           \
        const FLOATS l = size - u - v, uv = u < v ? u : v, least = l < uv ? l : uv;                                \
        const Passage passage = {least >= -slack, least, size, PASTE(as_, FLOATS)(PASTE(as_, INTS)(D) ^ sign)};    \
        return passage;                                                                                            \
    }                                                                                                              \
    static Range range_of_passage(Passage *passage, const FLOATS slack) {                                          \
        const FLOATS D = passage->D, size = passage->size, less = D > slack ? D - slack : 0.0f;                    \
        const INTS steep = size > slack, sure = steep & (passage->least > slack) & (D > slack);                    \
        const Range range = {steep ? less * (1 - 0x1p-20f) / (size + slack) : 0.0f,                                \
                             sure ? (D + slack) * (1 + 0x1p-20f) / (size - slack) : (FLOATS)INFINITY};             \
        passage->may &= !steep | (D >= -slack);                                                                    \
        return range;                                                                                              \
    }

PASSAGES(float8, int8, Passage8, passage_of_8, range_of_passage_8, Range8)

/* Adds those triangles of a leaf that one ray may meet within its reach. */
static void triangle_add_leaf(const Scene *scene, const int leaf, Walker *walker, Search *search) {
    __global const Patch *patch = scene->patch + (leaf - scene->tree.blocks);
    const float8 x = patch->ax - walker->o.x, y = patch->ay - walker->o.y, z = patch->az - walker->o.z;
    const float8 ex = patch->ex, ey = patch->ey, ez = patch->ez, fx = patch->fx, fy = patch->fy, fz = patch->fz;
    const float8 nx = FMA(ey, fz, -(ez * fy)), ny = FMA(ez, fx, -(ex * fz)), nz = FMA(ex, fy, -(ey * fx));
    const float8 slack = patch->slack;
    Passage8 passage = passage_of_8(x, y, z, walker->w.x, walker->w.y, walker->w.z, ex, ey, ez, fx, fy, fz, nx, ny, nz,
                                    slack);
    if (!BITS_OF(passage.may)) return;
    const Range8 range = range_of_passage_8(&passage, slack);
    add_eight(search, walker, passage.may & (slack > 0), range, patch->index);
}

#if W > 1
PASSAGES(LANES(float), LANES(int), PassageW, passage_of_W, range_of_passage_W, RangeW)

/* Which of a patch's triangles any of the rays may meet within a distance, by their boxes. These are off by less
 * than 2^-22: A by u S, e and f by u of themselves, and A + e by u S. */
static int triangles_met(__global const Patch *patch, const Bundle *bundle, const float furthest) {
    __global const float8 *a = &patch->ax, *e = &patch->ex, *f = &patch->fx;
    float8 in[3], out[3], near;
    for (int j = 0; j < 3; j++) {
        const float8 low = a[j] + smaller(smaller(e[j], f[j]), 0.0f) - 0x1p-22f;
        const float8 high = a[j] + larger(larger(e[j], f[j]), 0.0f) + 0x1p-22f;
        in[j] = bundle->back[j] ? high : low;
        out[j] = bundle->back[j] ? low : high;
    }
    return boxes_met(bundle, in, out, furthest, &near);
}

/* The same for rays of a packet. */
static void triangle_add_leaf_for_packet(const Scene *scene, const int leaf, const MASK live, const Bundle *bundle,
                                         const float furthest, Search *search) {
    __global const Patch *patch = scene->patch + (leaf - scene->tree.blocks);
    const FLOAT ox = LOAD_LANES(search->o[0]), oy = LOAD_LANES(search->o[1]), oz = LOAD_LANES(search->o[2]);
    const FLOAT wx = LOAD_LANES(search->w[0]), wy = LOAD_LANES(search->w[1]), wz = LOAD_LANES(search->w[2]);
    FLOAT reach = LOAD_LANES(search->reach);
    for (int bits = triangles_met(patch, bundle, furthest) & BITS_OF(patch->slack > 0); bits; bits &= bits - 1) {
        const int i = lowest_of(bits), index = ((__global const int *)&patch->index)[i];
        if (index == bundle->own) continue;
        const FLOAT x = one_of(&patch->ax, i) - ox, y = one_of(&patch->ay, i) - oy, z = one_of(&patch->az, i) - oz;
        const float ex = one_of(&patch->ex, i), ey = one_of(&patch->ey, i), ez = one_of(&patch->ez, i);
        const float fx = one_of(&patch->fx, i), fy = one_of(&patch->fy, i), fz = one_of(&patch->fz, i);
        const float nx = FMA(ey, fz, -(ez * fy)), ny = FMA(ez, fx, -(ex * fz)), nz = FMA(ex, fy, -(ey * fx));
        const FLOAT slack = one_of(&patch->slack, i);
        PassageW passage = passage_of_W(x, y, z, wx, wy, wz, ex, ey, ez, fx, fy, fz, nx, ny, nz, slack);
        if (!ANY(passage.may & live)) continue;
        const RangeW range = range_of_passage_W(&passage, slack);
        add_for_packet(search, passage.may & live, range, index, &reach);
    }
    if (search->shorter) STORE_LANES(reach, search->reach);
}
#endif
#endif

/* leaving.cl: triangles and rays that start on surfaces. */
/* A point of each lane's triangle: how much each corner counts, and the same as a start of rays, see place_on(). */
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
static void triangle_leave(const Frame frame, const Spheres spheres, Leaving *ray) {
    const REAL_MASK here = TO_REAL_MASK(IS_TRIANGLE(spheres, ray->own));
    const Place3 place = places_of(spheres, ray->own, ray->q);
    leave_place(here, place, ray);
}

/* Puts the world's coordinates of the lanes that start on triangles into their starts. */
static __attribute__((noinline)) void triangle_place(const Spheres spheres, Start *P) {
    const REAL_MASK here = TO_REAL_MASK(IS_TRIANGLE(spheres, P->index));
    const Place3 place = places_of(spheres, P->index, P->q);
    PUT3(PUT_WHERE, here, P->anchor, place.anchor);
    PUT3(PUT_WHERE, here, P->step, place.step);
    PUT_WHERE(here, P->reach, place.reach);
}

/* Puts where the lanes' rays meet the triangles that `index` names into their lanes. */
static void triangle_encounter(const Scene *scene, const Leaving ray, const INT index, Encounter *at) {
    const REAL_MASK here = TO_REAL_MASK(IS_TRIANGLE(scene->spheres, index));
    const INT number = TRIANGLE_OR_NONE(scene->spheres, index);
    /* A ray that leaves a triangle is in its plane there, and so does not meet it: not asking saves exact stages. */
    const REAL_MASK other = here & TO_REAL_MASK(index != ray.own);
    Crossing crossing = triangle_meet(path_of(ray), triangles_of(scene->spheres, number), other, 0);
    decide_encounter(scene->spheres, ray, index, &crossing);
    at->shares = crossing.shares;
    PUT_OF_SHAPE(here, at->t, crossing.t);
    PUT_OF_SHAPE(here, at->inside, (REAL_MASK)0);
}

/* A triangle is open: what meshes contain is told by how many of their triangles rays meet, see range.cl. */
#define triangle_contains(scene, A, step, error, index) ((MASK)0)

/* The number of a triangle in its mesh. */
static int triangle_primitive(const Scene *scene, const int index) {
    return scene->number_of[index - FIRST_TRIANGLE(scene->spheres)];
}

#if REAL_BYTES == 8
/* Puts t of rays that meet triangles into their lanes, in pairs, and a bound of what it is off by. */
static void triangle_fine_t(const Spheres spheres, const Leaving ray, const INT index, FineT *t) {
    const REAL_MASK here = TO_REAL_MASK(IS_TRIANGLE(spheres, index));
    const FinePath path = fine_path(spheres, ray);
    const FineT fine = fine_t_in(fine_plane(spheres, path, TRIANGLE_OR_NONE(spheres, index)), path);
    t->t = choose_pair(here, fine.t, t->t);
    t->error = here ? fine.error : t->error;
}

/* Leaves those lanes out of `open` in which A and B are known to be in one plane. */
static void triangle_leave_out_tied(const Spheres spheres, const INT A, const INT B, REAL_MASK *open) {
    *open = *open & !TO_REAL_MASK(known_in_one_plane(spheres, A, B));
}

/* Where both A and B are triangles, in the lanes of `close`: their planes break a tie, see plane_comes_first(). */
static void triangle_break_tie(const Spheres spheres, const Leaving ray, const INT A, const INT B,
                               const REAL_MASK close, REAL_MASK *first) {
    const REAL_MASK flat = close & TO_REAL_MASK(IS_TRIANGLE(spheres, A) & IS_TRIANGLE(spheres, B));
    if (!ANY(TO_MASK(flat))) return;
    const INT one = TRIANGLE_OR_NONE(spheres, A), two = TRIANGLE_OR_NONE(spheres, B);
    const REAL_MASK before = plane_comes_first(spheres, fine_path(spheres, ray), one, two, *first, flat);
    *first = flat ? before : *first;
}
#endif

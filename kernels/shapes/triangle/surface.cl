/* surface.cl: points of triangles that rays have met: their normals, and what starts there. */
/* n, in camera space, but for the lanes of `lost`: of what is too short or too long to be squared in float, another
 * unit is taken; and where float has nothing of N, since the corners are as one in it, the normal is the way back along
 * the ray d. */
static __attribute__((noinline)) Real3 rescued_normals(const Frame frame, const Real3 N, const Real3 d,
                                                       const REAL_MASK lost, const Real3 n) {
    const REAL size = larger_of(fabs(N.x), larger_of(fabs(N.y), fabs(N.z)));
    const REAL_MASK known = (size > 0) & (N.x - N.x == 0) & (N.y - N.y == 0) & (N.z - N.z == 0);
    const Real3 m = {N.x / size, N.y / size, N.z / size}, turned = turned_to_camera(frame, m);
    const REAL over = 1 / sqrt(DOT(m, m)), back = -1 / sqrt(DOT(d, d));
    const Real3 own = {known ? turned.x * over : d.x * back, known ? turned.y * over : d.y * back,
                       known ? turned.z * over : d.z * back};
    const Real3 normal = {lost ? own.x : n.x, lost ? own.y : n.y, lost ? own.z : n.z};
    return normal;
}

/* Puts the points that are on triangles into an intersection. id: what the rays met, along d; shares: where on it; P:
 * the point, rounded, in camera space.
 *
 * As a function of its own it would keep all intersections in memory, with a copy for each one that calls: frames with
 * mirrors take 0.85 of the time. */
static __attribute__((always_inline)) void flatten(const Frame frame, const Scene *scene, const INT id,
                                                   const Shares shares, const Real3 d, const Real3 P,
                                                   Intersection *at) {
    const REAL_MASK here = TO_REAL_MASK(IS_TRIANGLE(scene->spheres, id));
    const INT number = TO_MASK(here) ? id - FIRST_TRIANGLE(scene->spheres) : (INT)-1;
    const FacePoint point = face_point(shares);
    const Real3 N = shading_normals(scene, number, point.weights);
    const REAL square = DOT(N, N), over = 1 / sqrt(square);
    const Real3 m = {N.x * over, N.y * over, N.z * over};
    Real3 n = turned_to_camera(frame, m);
    if (REAL_BYTES == 4) {
        const REAL_MASK lost = here & !((square > (real)0x1p-100f) & (square < INFINITY));
        if (RARELY(ANY(TO_MASK(lost)))) n = rescued_normals(frame, N, d, lost, n);
    }
    /* The shading normal faces the ray; the side from which that came is the one of the triangle's own plane. Only rays
     * that go on ask for it. */
    REAL side = 1;
    if (HAS(WITH_BOUNCES)) {
        const REAL_MASK back = TO_REAL_MASK((fourths_of(scene->spheres.face, number) & 1) != 0);
        side = (shares.all < 0) == back ? (REAL)-1 : (REAL)1;
    }
    const REAL turn = DOT(n, d) > 0 ? -side : side;
    PUT_OF_SHAPE(here, at->normal.x, turn * n.x);
    PUT_OF_SHAPE(here, at->normal.y, turn * n.y);
    PUT_OF_SHAPE(here, at->normal.z, turn * n.z);
    PUT3(PUT_OF_SHAPE, here, at->q, point.q);
    PUT_OF_SHAPE(here, at->spread, (REAL)1);
    start_at_place(here, P, side, &at->start);
    at->start.index = id;
    at->start.q = at->q;
    if (HAS(WITH_UV)) map_triangles(scene, number, point.weights, at);
}

/* Puts what a ray from the eye has met into an intersection. */
static __attribute__((always_inline)) void triangle_put(const Frame frame, const Scene *scene, const Ray ray,
                                                        const Hit hit, Intersection *at) {
    flatten(frame, scene, hit.id, hit.shares, ray.d, point_at(ray, hit.t), at);
}

#ifdef WITH_BOUNCES
/* The same of a ray that left a surface. */
static void triangle_put_from(const Frame frame, const Scene *scene, const Leaving ray, const Met met,
                              Intersection *at) {
    flatten(frame, scene, met.id, met.at.shares, ray.d, point_from(frame, scene, ray, met), at);
}
#endif

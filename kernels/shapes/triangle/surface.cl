/* surface.cl: points of triangles that rays have met, what meshes have at corners, and triangles between a point and a
 * light. */

/* Triangles between a point and a light. */
#if REAL_BYTES == 8
/* The sign of N.(P - A) of a triangle, in pairs, for the lanes of `wanted`. step: from the anchor of P to P. */
static __attribute__((noinline)) REAL finely_beyond(const Geometry geometry, const FinePath path, const Start P,
                                                    const Pair3 step, const INT number, const REAL_MASK wanted) {
    const Corners corners = corners_at(geometry.vertex, geometry.face, number);
    const Pair3 e1 = pairs_between(corners.a, corners.b), e2 = pairs_between(corners.a, corners.c);
    const Pair3 near = pairs_between(corners.a, P.anchor);
    const Pair side = dot_pairs(cross_pairs(e1, e2), plus3(near, step));
    const REAL size = size_of_pairs(near) + P.reach, gh = size_of_pairs(e1) * size_of_pairs(e2);
    const REAL sign = sign_from(side.hi, 0x1p-97 * size * gh);
    /* Whole numbers tell of a point of a triangle. As seen from P, D is N.(A - P). */
    const MASK unsure = TO_MASK(wanted & (sign == 0)) & IS_TRIANGLE(geometry, P.index);
    if (!ANY(unsure)) return sign;
    return TO_REAL_MASK(unsure) ? -TO_REAL(whole_signs(geometry, path, number, 0, 0, unsure)) : sign;
}

/* P, as where a ray starts: along a parallel light, if it is one. */
static FinePath fine_path_from(const Geometry geometry, const Real3 to, const Start P) {
    const Leaving ray = leaving_to(P, to);
    return (FinePath){ray, {fine_start(geometry, ray), pairs_of(to)}, 0, TO_REAL_MASK(IS_TRIANGLE(geometry, P.index))};
}

/* As decide_stops(), in pairs. */
static __attribute__((noinline)) REAL_MASK finely_before(const Geometry geometry, const Real3 to, const int at_point,
                                                         const Start P, const INT number, const REAL_MASK wanted) {
    FinePath path = fine_path_from(geometry, to, P);
    if (!at_point) return fine_triangle(geometry, path, number, wanted).hit;
    const Pair3 way = pairs_between(to, P.anchor), step = path.fine.step;
    path.ray.center = to;
    path.ray.reach = 0;
    path.ray.w1 = size_of_pairs(way) + P.reach;
    path.fine = (PairRay){pairs_of((Real3){0, 0, 0}), plus3(way, step)};
    path.placed = 0;
    const FineTriangle fine = fine_triangle(geometry, path, number, wanted);
    return fine.hit & (fine.side * finely_beyond(geometry, path, P, step, number, fine.hit) > 0);
}

/* The same of a light at a point, for lanes in which it is known that the ray meets the triangle, and the sign of D is.
 */
static __attribute__((noinline)) REAL_MASK finely_beyond_it(const Geometry geometry, const Real3 to, const Start P,
                                                            const INT number, const REAL_MASK wanted, const REAL D) {
    const FinePath path = fine_path_from(geometry, to, P);
    const REAL sign = finely_beyond(geometry, path, P, path.fine.step, number, wanted);
    return wanted & (sign * D > 0);
}
#endif

/* A triangle and the way between a point P and a light, which is at a point, or in the direction `to`.
 *
 * Of a light at a point, the ray leads from there to P; it meets the triangle before P if P is beyond the triangle's
 * plane, which is the sign of N.(P - A). What P - A is off by is below 2^-48 of the sum of the magnitudes that it is
 * made from. */
typedef struct {
    Volumes v;
    REAL least, most; /* of the volumes of the edges */
    REAL side;        /* N.(P - A); of a parallel light D */
    REAL side_error;  /* what that is off by, of a light at a point */
} Passing;

static __attribute__((always_inline)) Passing passing_of(const Real3 to, const int at_point, const Start P,
                                                         const Triangle T) {
    const Real3 none = {0, 0, 0};
    Leaving ray = leaving_to(P, to);
    if (at_point) {
        const Real3 way = difference(P.anchor, to);
        ray.center = to;
        ray.p = none;
        ray.w = sum3(way, P.step);
        ray.reach = 0;
        ray.w1 = size_of(way) + P.reach;
    }
    Passing is;
    is.v = volumes_of(ray, T);
    is.least = smaller_of(is.v.EA, smaller_of(is.v.EB, is.v.EC));
    is.most = larger_of(is.v.EA, larger_of(is.v.EB, is.v.EC));
    const Real3 near = difference(P.anchor, T.a);
    const Real3 beyond = sum3(near, P.step);
    is.side = at_point ? DOT(T.N, beyond) : is.v.D;
    is.side_error = DOUBLE_ERROR(0x1p-46f) * (size_of(near) + P.reach) * (T.g * T.h);
    return is;
}

/* The same as triangle_shadow() where float32 cannot tell: for the lanes of `wanted`, of which those of `inside` are as
 * in triangle_meet(). */
static __attribute__((noinline)) MASK decide_stops(const Geometry *all, const real4 lamp, const int at_point,
                                                   const Start *from, const int number, const MASK wanted,
                                                   const MASK surely_inside) {
    const Geometry geometry = *all;
    Start P = *from;
    place_start(geometry, &P);
    const Real3 to = {lamp.x, lamp.y, lamp.z};
    const REAL_MASK inside = TO_REAL_MASK(surely_inside), every = TO_REAL_MASK(ALL_LANES), none = 0;
    const REAL_MASK ends_there = at_point ? every : none, endless = at_point ? none : every;
    const Passing is = passing_of(to, at_point, P, triangles_of(geometry, (INT)number));
    const Volumes v = is.v;
    const REAL least = is.least, most = is.most, side = is.side, side_error = is.side_error;
    const REAL_MASK front = v.D > v.D_error, back = v.D < -v.D_error;
    /* Along a parallel light it is known that the volumes have one sign, and so that of N.w, not which. */
    const REAL_MASK up = inside & (ends_there | (v.den > v.den_error)),
                    down = inside & (ends_there | (v.den < -v.den_error));
    const REAL_MASK meets = (front & (up | (least > v.E_error)) & (endless | (side > side_error))) |
                            (back & (down | (most < -v.E_error)) & (endless | (side < -side_error)));
    REAL_MASK stops = TO_REAL_MASK(wanted) & meets;
#if REAL_BYTES == 8
    const REAL_MASK split = !inside & (least < -v.E_error) & (most > v.E_error);
    const REAL_MASK passes = (front & (inside ? down & endless : least < -v.E_error)) |
                             (back & (inside ? up & endless : most > v.E_error));
    const REAL_MASK ends = ends_there & ((front & (side < -side_error)) | (back & (side > side_error)));
    REAL_MASK unsure = TO_REAL_MASK(wanted) & !(split | passes | ends | meets);
    if (!UNDECIDED(geometry, ANY(TO_MASK(unsure)))) return TO_MASK(stops);
    /* Of a triangle in all but the plane of P, only the side of P is unsure. */
    const REAL_MASK met = unsure & inside & ends_there & (front | back);
    if (ANY(TO_MASK(met))) stops = stops | finely_beyond_it(geometry, to, P, (INT)number, met, v.D);
    unsure = unsure & !met;
    if (ANY(TO_MASK(unsure))) stops = stops | finely_before(geometry, to, at_point, P, (INT)number, unsure);
#endif
    return TO_MASK(stops);
}

/* The lanes of `may` in which a triangle stands between P and the light: in which the ray meets it, and P is beyond its
 * plane. As seen from a light at a point, with w the way to P, that is 1/t > 1; of a parallel light P is deeper. */
static MASK triangle_shadow(const Scene *scene, const ShadowRay ray, const Start start, const int index, MASK may,
                            Work *work) {
    const int number = index - FIRST_TRIANGLE(scene->geometry);
    may = may & (ray.own != index);
    MASK unsure = may, inside = 0, stops = 0;
    if (HAS(WITH_FILTER) && !ray.touches) {
        __global const float4 *facet = scene->light_facet + 3 * ((long)ray.number * scene->triangles + number);
        const FLOAT x = ray.at_point ? ray.w32.x : ray.u, y = ray.at_point ? ray.w32.y : ray.v;
        const FLOAT z = ray.at_point ? ray.w32.z : (FLOAT)1;
        const Sides sides = sides_of(x, y, z, ray.at_point ? sqrt(ray.a) : (FLOAT)1, facet);
        unsure = may & sides.open;
        COUNT(FILTERED, may & !unsure);
        if (!ANY(unsure)) return 0;
        const Bounds plane = plane_at(x, y, z, facet);
        /* P's own depth is off by a rounding of it, and by less than 2^-40; that of the plane by 2^-27, see
         * along_light(). */
        const FLOAT off = FMA(magnitude(ray.depth), (FLOAT)0x1p-22f, (FLOAT)0x1p-26f);
        const MASK beyond = ray.at_point ? plane.low > 1 : plane.high < ray.depth - off;
        const MASK before = ray.at_point ? plane.high < 1 : plane.low > ray.depth + off;
        inside = unsure & sides.inside;
        stops = inside & beyond;
        unsure = unsure & !stops & !before;
    }
    if (!RARELY(ANY(unsure))) return stops;
    COUNT(DECIDED, unsure);
    if (is_over(scene)) return stops;
    unsure = unsure & !known_in_one_plane(scene->geometry, (INT)index, ray.own);
    if (!ANY(unsure)) return stops;
    /* Copied here, lest compilers keep it in memory all the time. */
    const Geometry geometry = scene->geometry;
    const Start copy = start;
    return stops | decide_stops(&geometry, scene->lamp[ray.number], ray.at_point, &copy, number, unsure, inside);
}

/* What meshes have at the corners of their triangles, normals and texture coordinates, and in between.
 */

static REAL weighted(const Weights w, const REAL a, const REAL b, const REAL c) {
    return (w.a * a + w.b * b) + w.c * c;
}

/* The normals for shading at points of triangles, in the world, to any side and of any length. number: each lane's
 * triangle, negative for none. Where the corners have none, or where theirs add up to 0, it is the triangle's own. */
static Real3 shading_normals(const Scene *scene, const INT number, const Weights weights) {
    const Corners c = corners_at(scene->corner_normal, scene->normal_face, number);
    const INT mesh = number < 0 ? (INT)-1 : c.fourth;
    /* The matrix that takes the normals of each lane's mesh to the world; any one where there is none. */
    __global const real4 *matrix = &scene->mesh->normal_x;
    const Real4 x = rows_at(matrix, 3 * mesh), y = rows_at(matrix + 1, 3 * mesh), z = rows_at(matrix + 2, 3 * mesh);
    const Real3 n = {weighted(weights, c.a.x, c.b.x, c.c.x), weighted(weights, c.a.y, c.b.y, c.c.y),
                     weighted(weights, c.a.z, c.b.z, c.c.z)};
    const Real3 m = {DOT(x, n), DOT(y, n), DOT(z, n)};
    const REAL_MASK here = TO_REAL_MASK(mesh >= 0) & (DOT(m, m) > 0);
    if (!ANY((number >= 0) & !TO_MASK(here))) return m;
    const Real3 N = plane_normals(scene->geometry.vertex, scene->geometry.face, number);
    return chosen(here, m, N);
}

/* Where points of triangles are on a texture: (0, 0) where their corners do not say. Other lanes are left alone. */
static void map_triangles(const Scene *scene, const INT number, const Weights weights, Intersection *at) {
    int each[W];
    real u[3][W], v[3][W];
    STORE_LANES(number, each);
    for (int lane = 0; lane < W; lane++) {
        const int4 corner = scene->uv_face[max(each[lane], 0)];
        const real2 uv[3] = {scene->corner_uv[corner.x], scene->corner_uv[corner.y], scene->corner_uv[corner.z]};
        for (int k = 0; k < 3; k++) {
            u[k][lane] = corner.w < 0 ? 0 : uv[k].x;
            v[k][lane] = corner.w < 0 ? 0 : uv[k].y;
        }
    }
    const REAL_MASK here = TO_REAL_MASK(number >= 0);
    PUT_WHERE(here, at->u, weighted(weights, LOAD_LANES(u[0]), LOAD_LANES(u[1]), LOAD_LANES(u[2])));
    PUT_WHERE(here, at->v, weighted(weights, LOAD_LANES(v[0]), LOAD_LANES(v[1]), LOAD_LANES(v[2])));
}

/* Points of triangles that rays have met: their normals, and what starts there. */
/* n, in camera space, but for the lanes of `lost`: of what is too short or too long to be squared in float, another
 * unit is taken; and where float has nothing of N, since the corners are as one in it, the normal is the way back along
 * the ray d. */
static __attribute__((noinline)) Real3 rescued_normals(const Frame frame, const Real3 N, const Real3 d,
                                                       const REAL_MASK lost, const Real3 n) {
    const REAL size = larger_of(fabs(N.x), larger_of(fabs(N.y), fabs(N.z)));
    const REAL_MASK known = (size > 0) & (N.x - N.x == 0) & (N.y - N.y == 0) & (N.z - N.z == 0);
    const Real3 m = {N.x / size, N.y / size, N.z / size}, turned = turned_to_camera(frame, m);
    const REAL over = 1 / sqrt(DOT(m, m)), back = -1 / sqrt(DOT(d, d));
    return chosen(lost, chosen(known, scaled(turned, over), scaled(d, back)), n);
}

/* Puts the points that are on triangles into an intersection. id: what the rays met, along d; shares: where on it; P:
 * the point, rounded, in camera space.
 *
 * As a function of its own it would keep all intersections in memory, with a copy for each one that calls: frames with
 * mirrors take 0.85 of the time. */
static __attribute__((always_inline)) void flatten(const Frame frame, const Scene *scene, const INT id,
                                                   const Shares shares, const Real3 d, const Real3 P,
                                                   Intersection *at) {
    const REAL_MASK here = TO_REAL_MASK(IS_TRIANGLE(scene->geometry, id));
    const INT number = TO_MASK(here) ? id - FIRST_TRIANGLE(scene->geometry) : (INT)-1;
    const FacePoint point = face_point(shares);
    const Real3 N = shading_normals(scene, number, point.weights);
    const REAL square = DOT(N, N);
    Real3 n = turned_to_camera(frame, scaled(N, 1 / sqrt(square)));
    if (REAL_BYTES == 4) {
        const REAL_MASK lost = here & !((square > (real)0x1p-100f) & (square < INFINITY));
        if (RARELY(ANY(TO_MASK(lost)))) n = rescued_normals(frame, N, d, lost, n);
    }
    /* The shading normal faces the ray; the side from which that came is the one of the triangle's own plane. Only rays
     * that go on ask for it. */
    REAL side = 1;
    if (HAS(WITH_BOUNCES)) {
        const REAL_MASK back = TO_REAL_MASK(
            (numbers_at((__global const int *)scene->geometry.face + 3, 4 * number) & 1) != 0);
        side = (shares.all < 0) == back ? (REAL)-1 : (REAL)1;
    }
    n = scaled(n, DOT(n, d) > 0 ? -side : side);
    PUT3(PUT_OF_SHAPE, here, at->normal, n);
    PUT3(PUT_OF_SHAPE, here, at->q, point.q);
    PUT_OF_SHAPE(here, at->spread, (REAL)1);
    start_at_place(here, P, side, &at->start);
    at->start.index = id;
    at->start.q = at->q;
    if (MAPPED(scene)) map_triangles(scene, number, point.weights, at);
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

/* triangles.cl: triangles over cells, and between the light and patches of surfaces.
 */
#ifdef WITH_SHEETS
/* What is positive at the places of a cell where it shows a triangle, or where that cuts off a light; see sides_of().
 */
typedef struct {
    Model edge[3];
} Edges;

/* A model times a float of a buffer. The number is what it is. */
static Model dot_facet(const float x, const float y, const float z, const Model3 v, const FLOAT off) {
    Model m = plus_model(plus_model(scaled(v.x, x), scaled(v.y, y)), scaled(v.z, z));
    m.r += off;
    return m;
}

/* v: the directions; bound: what facets' bounds are to be multiplied by, as in sides_of(). */
static Edges edges_along(__global const float4 *facet, const Model3 v, const FLOAT bound) {
    Edges edges;
    for (int k = 0; k < 3; k++) edges.edge[k] = dot_facet(facet[k].x, facet[k].y, facet[k].z, v, bound);
    return edges;
}

/* 1/t at the plane, or its depth along parallel rays, off by `size` times 2^-22 beside the model's own rounding: see
 * plane_at(). */
static Model plane_along(__global const float4 *facet, const Model3 v) {
    const float a = facet[0].w, b = facet[1].w, c = facet[2].w;
    const FLOAT size = fabs(a) * (fabs(v.x.v) + radius_of(v.x)) + fabs(b) * (fabs(v.y.v) + radius_of(v.y)) +
                       fabs(c) * (fabs(v.z.v) + radius_of(v.z));
    return dot_facet(a, b, c, v, 0x1p-22f * size);
}

/* The share of a cell on the positive side of several lines. What is not there is beyond at least one of them. */
static Share share_within(const Share *sides, const int n) {
    Share all = {1, 1};
    for (int k = 0; k < n; k++) {
        all.least -= 1 - sides[k].least;
        all.most = sides[k].most < all.most ? sides[k].most : all.most;
    }
    all.least = all.least > 0 ? all.least : (FLOAT)0;
    return all;
}

/* Whether some place of the cell is surely on the positive side of all edges: its middle, or one of its corners. */
static MASK surely_within(const Edges edges) {
    MASK any = 0;
    for (int place = 0; place < 5; place++) {
        const float s = place == 4 ? 0 : (place & 1) ? 1 : -1, t = place == 4 ? 0 : (place & 2) ? 1 : -1;
        MASK all = ALL_LANES;
        for (int k = 0; k < 3; k++)
            all = all &
                  (edges.edge[k].v + s * edges.edge[k].x + t * edges.edge[k].y > edges.edge[k].r * (1 + ROUNDING));
        any = any | all;
    }
    return any;
}

/* Whether a rim of its mesh may be in the cell: an edge beyond which no triangle goes on, as seen from the eye (view 0)
 * or a light. */
static MASK rim_within(const Scene scene, const int view, const int number, const Edges edges) {
    const int4 beyond = scene.neighbour[number];
    const int each[3] = {beyond.x, beyond.y, beyond.z};
    __global const char *side = scene.face_side + (long)view * scene.triangles;
    MASK rim = 0;
    for (int k = 0; k < 3; k++) {
        const int goes_on = each[k] >= 0 && side[number] != 0 && side[max(each[k], 0)] == side[number];
        const MASK crosses = !(least_of(edges.edge[k]) > 0);
        if (!goes_on) rim = rim | crosses;
    }
    return rim;
}

/* Where a triangle is met by a cell's rays. */
static Extent extent_of_triangle(const Edges edges, const Model plane) {
    Extent extent = {ALL_LANES, 0, 0, INFINITY};
    for (int k = 0; k < 3; k++) {
        extent.covers = extent.covers & (least_of(edges.edge[k]) > 0);
        extent.misses = extent.misses | (most_of(edges.edge[k]) < 0);
    }
    const FLOAT low = least_of(plane), high = most_of(plane), loose = 8 * ROUNDING;
#ifdef WITH_PARALLEL_RAYS
    extent.least = low > 0 ? low * (1 - loose) : (FLOAT)0;
    extent.most = high > 0 ? high * (1 + loose) : (FLOAT)INFINITY;
    extent.covers = extent.covers & (low > 0);
    extent.misses = extent.misses | (high < 0);
#else
    extent.least = high > 0 ? 1 / high * (1 - loose) : (FLOAT)0;
    extent.most = low > 0 ? 1 / low * (1 + loose) : (FLOAT)INFINITY;
#endif
    return extent;
}

#if REAL_BYTES == 8
#define VOLUME_ROUNDING 0x1p-44
#define AXES_ROUNDING 0x1p-48
#else
#define VOLUME_ROUNDING 0x1p-15f
#define AXES_ROUNDING 0x1p-19f
#endif
/* Of a linear function's three values in double. */
static Model narrowed_by(const Real3 v, const REAL factor, const REAL off) {
    return narrowed(factor * v.x, factor * v.y, factor * v.z, off);
}

#ifdef WITH_TEXTURES
/* x + y b + z c, of numbers that were rounded once. */
static Model weighted_models(const float3 row, const Model b, const Model c) {
    Model m = plus_model(plus_model(constant_model(row.x), scaled(b, row.y)), scaled(c, row.z));
    m.r += 0x1p-23f * fabs(row.x);
    return m;
}
#endif

/* The part of a triangle's plane that a cell shows. With A from the ray's start to the corner A, and w along the ray,
 * E_AB and E_CA are linear in the place, as are D = A.N and N.w: see triangle.cl. t is D / (N.w), and B counts E_CA /
 * (N.w), C E_AB / (N.w).
 *
 * Volumes are off by 2^-44 (g + h) s w1 and 2^-46 w1 g h, see volumes_of(), which is 512 and 128 roundings of doubles;
 * as many of floats are 2^-15 and 2^-17. The rays of a cell are longer by its sides. */
static Area patch_of_triangle(const Frame frame, const Scene scene, const Cells cells, const int number, const INT id) {
    Area patch;
    patch.id = id;
    patch.side = 1;
    const REAL zero = 0, one = 1;
    const Triangle T = triangle_at(scene.spheres, number);
    const real4 eye = scene.spheres.eye;
    Real3 A = {T.a.x - eye.x, T.a.y - eye.y, T.a.z - eye.z};
    const Real3 right = {zero, zero, zero}, step_x = {(REAL)cells.h, zero, zero}, step_y = {zero, (REAL)cells.k, zero};
    const Real3 wx = turned_to_world(frame, step_x), wy = turned_to_world(frame, step_y);
    Real3 D, den, EB, EC;
#ifdef WITH_PARALLEL_RAYS
    const Real3 o = {cells.dx, cells.dy, zero}, start = turned_to_world(frame, o);
    const Real3 w = {scene.spheres.ahead.x, scene.spheres.ahead.y, scene.spheres.ahead.z};
    A.x -= start.x;
    A.y -= start.y;
    A.z -= start.z;
    const Real3 R = cross_of(A, w), Rx = cross_of(w, wx), Ry = cross_of(w, wy);
    D.x = DOT(A, T.N);
    D.y = -DOT(wx, T.N);
    D.z = -DOT(wy, T.N);
    den.x = DOT(T.N, w);
    den.y = den.z = zero;
    const REAL w1 = size_of(w), s = size_of(A) + size_of(start) + size_of(wx) + size_of(wy);
#else
    const Real3 d = {cells.dx, cells.dy, -one}, w = turned_to_world(frame, d);
    const Real3 R = cross_of(A, w), Rx = cross_of(A, wx), Ry = cross_of(A, wy);
    D.x = DOT(A, T.N);
    D.y = D.z = zero;
    den.x = DOT(T.N, w);
    den.y = DOT(T.N, wx);
    den.z = DOT(T.N, wy);
    const REAL w1 = size_of(w) + size_of(wx) + size_of(wy), s = size_of(A);
#endif
    EB.x = DOT(T.e2, R);
    EB.y = DOT(T.e2, Rx);
    EB.z = DOT(T.e2, Ry);
    EC.x = -DOT(T.e1, R);
    EC.y = -DOT(T.e1, Rx);
    EC.z = -DOT(T.e1, Ry);
    const REAL u = (REAL)VOLUME_ROUNDING;
    const REAL over = 1 / den.x, gh = T.g * T.h, den_error = u * w1 * gh,
               E_error = u * s * w1 * (T.g + T.h) + den_error, size = fabs(over);
    const Model whole = narrowed_by(den, over, den_error * size), share = reciprocal_of(whole);
    const Model t = times_model(narrowed_by(D, over * scene.unit, u * s * gh * size * scene.unit), share);
    const Model b = times_model(narrowed_by(EB, over, E_error * size), share),
                c = times_model(narrowed_by(EC, over, E_error * size), share);
    const Real3 origin = {0, 0, 0};
    put_points(&patch, cells, t, scene.unit);
    put_anchor(&patch, origin, patch.P);
    patch.limb = no_limb();
    patch.flat = 1;
#ifdef WITH_PARALLEL_RAYS
    patch.ray = patch.P;
    patch.over = constant_model(1);
#else
    const REAL nearness = 1 / (D.x * scene.unit),
               wrong = fabs(nearness) * u * s * gh / fabs(D.x) * (fabs(den.x) + fabs(den.y) + fabs(den.z));
    patch.ray = directions_of(cells, scene.unit);
    patch.over = narrowed_by(den, nearness, 2 * (den_error * fabs(nearness) + wrong));
#endif
#ifdef WITH_TEXTURES
    patch.tu = patch.tv = constant_model(0);
    const int4 place = scene.uv_face[number];
    if (place.w >= 0) {
        const real2 first = scene.corner_uv[place.x], second = scene.corner_uv[place.y],
                    third = scene.corner_uv[place.z];
        const float3 corner_u = (float3)((float)first.x, (float)(second.x - first.x), (float)(third.x - first.x)),
                     corner_v = (float3)((float)first.y, (float)(second.y - first.y), (float)(third.y - first.y));
        patch.tu = weighted_models(corner_u, b, c);
        patch.tv = weighted_models(corner_v, b, c);
    }
#endif
    /* The normal, and towards the eye. */
    const int4 corner = scene.normal_face[number];
    Real3 normal[3] = {T.N, right, right};
    if (corner.w >= 0) {
        const Mesh mesh = scene.mesh[corner.w];
        const int which[3] = {corner.x, corner.y, corner.z};
        for (int k = 0; k < 3; k++) {
            const real4 n = scene.corner_normal[which[k]];
            normal[k].x = DOT(mesh.normal_x, n);
            normal[k].y = DOT(mesh.normal_y, n);
            normal[k].z = DOT(mesh.normal_z, n);
        }
    }
    const REAL largest = (size_of(normal[0]) + size_of(normal[1])) + size_of(normal[2]);
    Model3 sum = {constant_model(0), constant_model(0), constant_model(0)};
    for (int k = 0; k < (corner.w >= 0 ? 3 : 1); k++) {
        const Real3 own = turned_to_camera(frame, normal[k]);
        const REAL shorter = 1 / largest, off = (REAL)AXES_ROUNDING;
        const Model3 m = {narrowed(own.x * shorter, 0, 0, off), narrowed(own.y * shorter, 0, 0, off),
                          narrowed(own.z * shorter, 0, 0, off)};
        const Model weight = corner.w < 0 ? constant_model(1)
                             : k == 0     ? minus_model(constant_model(1), plus_model(b, c))
                             : k == 1     ? b
                                          : c;
        sum = plus_vectors(sum, times_vector(weight, m));
    }
    const Model3 n = times_vector(over_root_of(square_of_vector(sum)), sum);
    const Model facing = dot_models(n, patch.v);
    const MASK front = least_of(facing) > 0, back = most_of(facing) < 0;
    const FLOAT turn = back ? (FLOAT)-1 : (FLOAT)1;
    patch.n.x = scaled(n.x, turn);
    patch.n.y = scaled(n.y, turn);
    patch.n.z = scaled(n.z, turn);
    patch.n.x.r = (front | back) ? patch.n.x.r : (FLOAT)INFINITY;
    patch.n = unit_or_any(patch.n);
    return patch;
}
#endif

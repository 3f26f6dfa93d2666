/* attributes.cl: what meshes have at the corners of their triangles, normals and texture coordinates, and in between. */
#ifdef WITH_TRIANGLES

static REAL weighted(const Weights w, const REAL a, const REAL b, const REAL c) {
    return (w.a * a + w.b * b) + w.c * c;
}

#ifdef WITH_NORMAL
/* The normals for shading at points of triangles, in the world, to any side and of any length. number: each lane's triangle,
 * negative for none. Where the corners have none, or where theirs add up to 0, it is the triangle's own. */
static Real3 shading_normals(const Scene scene, const INT number, const Weights weights) {
    int each[W], row[W], mesh[W];
    STORE_LANES(number, each);
    for (int lane = 0; lane < W; lane++) {
        const int index = max(each[lane], 0);
        mesh[lane] = scene.spheres.face[index].w >> 1;
        const int begin = scene.mesh[mesh[lane]].normals.x;
        row[lane] = each[lane] < 0 || begin < 0 ? -1 : begin + scene.number_of[index];
        if (row[lane] >= 0 && scene.normal_face[row[lane]].x < 0) row[lane] = -1;
    }
    const INT corners = LOAD_LANES(row);
    const MASK smooth = corners >= 0;
    Corners of = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}, matrix = of;
    put_corners(scene.corner_normal, scene.normal_face, corners, &of);
    INT left = smooth ? LOAD_LANES(mesh) : (INT)-1;
    for (int one = LARGEST(left); one >= 0; one = LARGEST(left)) {
        const REAL_MASK here = TO_REAL_MASK(left == one);
        put_row(here, &matrix.a, scene.mesh[one].normal_x);
        put_row(here, &matrix.b, scene.mesh[one].normal_y);
        put_row(here, &matrix.c, scene.mesh[one].normal_z);
        left = left == one ? (INT)-1 : left;
    }
    const Real3 n = {weighted(weights, of.a.x, of.b.x, of.c.x), weighted(weights, of.a.y, of.b.y, of.c.y),
                     weighted(weights, of.a.z, of.b.z, of.c.z)};
    const Real3 m = {DOT(matrix.a, n), DOT(matrix.b, n), DOT(matrix.c, n)};
    const REAL_MASK here = TO_REAL_MASK(smooth) & (DOT(m, m) > 0);
    if (!ANY((number >= 0) & !TO_MASK(here))) return m;
    const Real3 N = triangles_of(scene.spheres, number).N;
    const Real3 normal = {here ? m.x : N.x, here ? m.y : N.y, here ? m.z : N.z};
    return normal;
}
#endif

#ifdef WITH_UV
/* Where points of triangles are on a texture: (0, 0) where their corners do not say. Other lanes are left alone. */
static void map_triangles(const Scene scene, const INT number, const Weights weights, Intersection *at) {
    int each[W];
    real u[3][W], v[3][W];
    STORE_LANES(number, each);
    for (int lane = 0; lane < W; lane++) {
        const int index = max(each[lane], 0), begin = scene.mesh[scene.spheres.face[index].w >> 1].uvs.x;
        const int4 corner = begin < 0 ? (int4)(-1) : scene.uv_face[begin + scene.number_of[index]];
        const int4 known = max(corner, 0);
        const real2 uv[3] = {scene.corner_uv[known.x], scene.corner_uv[known.y], scene.corner_uv[known.z]};
        for (int k = 0; k < 3; k++) {
            u[k][lane] = corner.x < 0 ? 0 : uv[k].x;
            v[k][lane] = corner.x < 0 ? 0 : uv[k].y;
        }
    }
    const REAL_MASK here = TO_REAL_MASK(number >= 0);
    PUT_WHERE(here, at->u, weighted(weights, LOAD_LANES(u[0]), LOAD_LANES(u[1]), LOAD_LANES(u[2])));
    PUT_WHERE(here, at->v, weighted(weights, LOAD_LANES(v[0]), LOAD_LANES(v[1]), LOAD_LANES(v[2])));
}
#endif
#endif

/* attributes.cl: what meshes have at the corners of their triangles, normals and texture coordinates, and in between.
 */

static REAL weighted(const Weights w, const REAL a, const REAL b, const REAL c) {
    return (w.a * a + w.b * b) + w.c * c;
}

/* The matrix that takes the normals of each lane's mesh to the world; any one where there is none. */
static Corners normal_matrices(__global const Mesh *meshes, const INT mesh) {
    int one = LARGEST(mesh);
    __global const Mesh *first = meshes + max(one, 0);
    const real4 x = first->normal_x, y = first->normal_y, z = first->normal_z;
    Corners m = {{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}};
    INT left = mesh == one ? (INT)-1 : mesh;
    while (RARELY(ANY(left >= 0))) {
        one = LARGEST(left);
        const REAL_MASK here = TO_REAL_MASK(left == one);
        put_row(here, &m.a, meshes[one].normal_x);
        put_row(here, &m.b, meshes[one].normal_y);
        put_row(here, &m.c, meshes[one].normal_z);
        left = left == one ? (INT)-1 : left;
    }
    return m;
}

/* The normals for shading at points of triangles, in the world, to any side and of any length. number: each lane's
 * triangle, negative for none. Where the corners have none, or where theirs add up to 0, it is the triangle's own. */
static Real3 shading_normals(const Scene *scene, const INT number, const Weights weights) {
    const Corners c = corners_at(scene->corner_normal, scene->normal_face, number);
    const INT mesh = number < 0 ? (INT)-1 : c.fourth;
    const Corners matrix = normal_matrices(scene->mesh, mesh);
    const Real3 n = {weighted(weights, c.a.x, c.b.x, c.c.x), weighted(weights, c.a.y, c.b.y, c.c.y),
                     weighted(weights, c.a.z, c.b.z, c.c.z)};
    const Real3 m = {DOT(matrix.a, n), DOT(matrix.b, n), DOT(matrix.c, n)};
    const REAL_MASK here = TO_REAL_MASK(mesh >= 0) & (DOT(m, m) > 0);
    if (!ANY((number >= 0) & !TO_MASK(here))) return m;
    const Real3 N = plane_normals(scene->spheres.vertex, scene->spheres.face, number);
    const Real3 normal = {here ? m.x : N.x, here ? m.y : N.y, here ? m.z : N.z};
    return normal;
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

/* attributes.cl: what meshes have at the corners of their triangles, normals and texture coordinates, and in between. */
#ifdef WITH_TRIANGLES

static REAL weighted(const Weights w, const REAL a, const REAL b, const REAL c) {
    return (w.a * a + w.b * b) + w.c * c;
}

#ifdef WITH_NORMAL
/* What shading needs to know of a triangle: which row of normal_face has the normals of its corners, -1 for none; its mesh;
 * and whether its back is on the side to which N points. */
typedef struct {
    int row, mesh, back;
} Shading;

static Shading shading_of(const Scene scene, const int number) {
    const int part = scene.spheres.face[number].w, begin = scene.mesh[part >> 1].normals.x;
    Shading of = {begin < 0 ? -1 : begin + scene.number_of[number], part >> 1, part & 1};
    if (of.row >= 0 && scene.normal_face[of.row].x < 0) of.row = -1;
    return of;
}

/* The normals for shading at points of triangles, in the world, to any side and of any length. number: each lane's triangle,
 * negative for none. Where the corners have none, or where theirs add up to 0, it is the triangle's own. back: see Shading. */
static Real3 shading_normals(const Scene scene, const INT number, const Weights weights, REAL_MASK *back) {
    int row[W], mesh[W], behind[W], each[W];
    STORE_LANES(number, each);
    Shading of = {-1, -1, 0};
    for (int lane = 0, last = -1; lane < W; lane++) {
        if (each[lane] >= 0 && each[lane] != last) of = shading_of(scene, last = each[lane]);
        row[lane] = each[lane] < 0 ? -1 : of.row;
        mesh[lane] = row[lane] < 0 ? -1 : of.mesh;
        behind[lane] = of.back;
    }
    *back = TO_REAL_MASK(LOAD_LANES(behind) != 0);
    const INT rows = LOAD_LANES(row);
    const MASK smooth = rows >= 0;
    Corners normals, matrix = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    put_corners(scene.corner_normal, scene.normal_face, rows, &normals);
    INT left = LOAD_LANES(mesh);
    for (int one = LARGEST(left); one >= 0; one = LARGEST(left)) {
        const REAL_MASK here = TO_REAL_MASK(left == one);
        put_row(here, &matrix.a, scene.mesh[one].normal_x);
        put_row(here, &matrix.b, scene.mesh[one].normal_y);
        put_row(here, &matrix.c, scene.mesh[one].normal_z);
        left = left == one ? (INT)-1 : left;
    }
    const Corners c = normals;
    const Real3 n = {weighted(weights, c.a.x, c.b.x, c.c.x), weighted(weights, c.a.y, c.b.y, c.c.y),
                     weighted(weights, c.a.z, c.b.z, c.c.z)};
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

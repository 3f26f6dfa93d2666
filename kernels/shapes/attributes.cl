/* attributes.cl: what meshes have at the corners of their triangles, normals and texture coordinates, and in between. */
#ifdef WITH_TRIANGLES

/* How much each corner counts at a point of a triangle; together they are 1. */
typedef struct {
    REAL a, b, c;
} Weights;

static REAL weighted(const Weights w, const REAL a, const REAL b, const REAL c) {
    return (w.a * a + w.b * b) + w.c * c;
}

#ifdef WITH_NORMAL
/* The normals for shading at points of triangles, in the world, to any side and of any length. number: each lane's triangle,
 * negative for none; N: the triangles' own normals, which count where the corners have none or where theirs add up to 0. */
static Real3 shading_normals(const Scene scene, const INT number, const Real3 N, const Weights weights) {
    int each[W], smooth[W], some = 0;
    int4 corners[W];
    STORE_LANES(number, each);
    for (int lane = 0; lane < W; lane++) {
        const int index = max(each[lane], 0), begin = scene.mesh[scene.spheres.face[index].w >> 1].normals.x;
        corners[lane] = begin < 0 ? (int4)(-1) : scene.normal_face[begin + scene.number_of[index]];
        smooth[lane] = each[lane] >= 0 && corners[lane].x >= 0;
        some |= smooth[lane];
    }
    if (!some) return N;
    real x[3][W], y[3][W], z[3][W], row[9][W];
    for (int lane = 0; lane < W; lane++) {
        const int4 corner = max(corners[lane], 0);
        const real4 n[3] = {scene.corner_normal[corner.x], scene.corner_normal[corner.y], scene.corner_normal[corner.z]};
        __global const real4 *rows = &scene.mesh[scene.spheres.face[max(each[lane], 0)].w >> 1].normal_x;
        for (int k = 0; k < 3; k++) {
            x[k][lane] = n[k].x;
            y[k][lane] = n[k].y;
            z[k][lane] = n[k].z;
            row[3 * k][lane] = rows[k].x;
            row[3 * k + 1][lane] = rows[k].y;
            row[3 * k + 2][lane] = rows[k].z;
        }
    }
    const Real3 n = {weighted(weights, LOAD_LANES(x[0]), LOAD_LANES(x[1]), LOAD_LANES(x[2])),
                     weighted(weights, LOAD_LANES(y[0]), LOAD_LANES(y[1]), LOAD_LANES(y[2])),
                     weighted(weights, LOAD_LANES(z[0]), LOAD_LANES(z[1]), LOAD_LANES(z[2]))};
    const Real3 to_x = {LOAD_LANES(row[0]), LOAD_LANES(row[1]), LOAD_LANES(row[2])};
    const Real3 to_y = {LOAD_LANES(row[3]), LOAD_LANES(row[4]), LOAD_LANES(row[5])};
    const Real3 to_z = {LOAD_LANES(row[6]), LOAD_LANES(row[7]), LOAD_LANES(row[8])};
    const Real3 m = {DOT(to_x, n), DOT(to_y, n), DOT(to_z, n)};
    const REAL_MASK here = TO_REAL_MASK(LOAD_LANES(smooth) != 0) & (DOT(m, m) > 0);
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

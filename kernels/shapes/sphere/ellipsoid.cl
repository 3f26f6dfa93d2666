/* ellipsoid.cl: spheres under a linear map.
 *
 * An ellipsoid is |K (x - C)| = r. K leads from the world to its own axes. There it is a sphere, and a ray keeps its t,
 * so all that is written for spheres holds for K f and K w in place of f and w. Its point is P = C + r K^-1 q / |q|,
 * where q is the normal in its own axes, and q is what is exact. Spheres have the map 0, which is 1.
 */
typedef struct {
    Real3 x, y, z; /* rows */
    REAL size;     /* the sum of the magnitudes of all numbers of K, or of K^-1 */
} Matrix;

/* Each lane's three rows of the buffer of maps; first: 0 for K, 3 for K^-1, 6 for what was cut off of K^-1. */
static Matrix matrices_of(const Spheres spheres, const INT map, const int first) {
    int each[W];
    real row[10][W];
    STORE_LANES(map, each);
    for (int lane = 0; lane < W; lane++) {
        __global const real4 *rows = &spheres.map[each[lane]].to_x + first;
        row[0][lane] = rows[0].x;
        row[1][lane] = rows[0].y;
        row[2][lane] = rows[0].z;
        row[3][lane] = rows[1].x;
        row[4][lane] = rows[1].y;
        row[5][lane] = rows[1].z;
        row[6][lane] = rows[2].x;
        row[7][lane] = rows[2].y;
        row[8][lane] = rows[2].z;
        row[9][lane] = rows[0].w;
    }
    const Matrix matrix = {{LOAD_LANES(row[0]), LOAD_LANES(row[1]), LOAD_LANES(row[2])},
                           {LOAD_LANES(row[3]), LOAD_LANES(row[4]), LOAD_LANES(row[5])},
                           {LOAD_LANES(row[6]), LOAD_LANES(row[7]), LOAD_LANES(row[8])},
                           LOAD_LANES(row[9])};
    return matrix;
}

static Real3 mapped(const Matrix m, const Real3 v) {
    const Real3 w = {DOT(m.x, v), DOT(m.y, v), DOT(m.z, v)};
    return w;
}

static Real3 mapped_back(const Matrix m, const Real3 v) {
    const Real3 w = {(m.x.x * v.x + m.y.x * v.y) + m.z.x * v.z, (m.x.y * v.x + m.y.y * v.y) + m.z.y * v.z,
                     (m.x.z * v.x + m.y.z * v.y) + m.z.z * v.z};
    return w;
}

#if REAL_BYTES == 8 || defined(WITH_PLANES)
static Pair dot_matrix(const Real3 row, const Real3 rest, const Pair3 v) {
    return plus(plus(times(pair(row.x, rest.x), v.x), times(pair(row.y, rest.y), v.y)),
                times(pair(row.z, rest.z), v.z));
}

static Pair3 mapped_pairs(const Matrix m, const Matrix rest, const Pair3 v) {
    const Pair3 w = {dot_matrix(m.x, rest.x, v), dot_matrix(m.y, rest.y, v), dot_matrix(m.z, rest.z, v)};
    return w;
}
#endif

/* What sphere_stops() tells of a sphere. The ellipsoid is decided in its own axes, where it is one. */
static REAL_MASK ellipsoid_stops(const Spheres spheres, const Start P, const Sphere B, const int map, const Real3 w,
                                 const int far, const int light_side) {
    __global const Map *K = spheres.map + map;
    const Real3 f = towards(P, B.center);
    const Real3 F = {DOT(K->camera_x, f), DOT(K->camera_y, f), DOT(K->camera_z, f)};
    const Real3 G = {DOT(K->camera_x, w), DOT(K->camera_y, w), DOT(K->camera_z, w)};
    return stands_between(F, G, DOT(F, F) - B.r * B.r, B.r, far, light_side);
}

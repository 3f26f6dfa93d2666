/* quadrics.cl: ellipsoids over cells, and whatever parallel rays meet.
 *
 * In an ellipsoid's own axes it is a sphere, and a ray keeps its t. The matrix K that leads there is divided by the sum
 * of its numbers' magnitudes here, so that nothing becomes longer on the way; a sphere has K = 1. With F = K (C - O)
 * from where the ray starts, G = K d along it and X = F x G:
 *
 *     a = G.G,   b = F.G,   D = a r^2 - X.X,   t = (b -+ sqrt(D)) / a
 *
 * and the point is t G - F = (X x G -+ sqrt(D) G) / a as seen from the centre. Of a cell's rays either G is a linear
 * function of the place (s, t), or F is where they are parallel. So X and b are linear, and a and D are quadratic.
 */
#if HAS(WITH_AVERAGE) && WITH_QUADRICS
typedef struct {
    Sphere sphere;
    MASK stretched; /* whether it is an ellipsoid */
    Real3 x, y, z;  /* the rows of K, from camera space */
    REAL r;         /* its radius there */
} Quadric;

/* map: of each lane, 0 for a sphere. */
static Quadric stretched_by(const Spheres spheres, const Sphere sphere, const INT map) {
    Quadric own = {sphere, map != 0, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, sphere.r};
    if (!HAS(WITH_ELLIPSOIDS) || !ANY(own.stretched)) return own;
    const Matrix K = matrices_of(spheres, map, 9);
    const REAL over = TO_REAL_MASK(own.stretched) ? 1 / matrices_of(spheres, map, 0).size : (REAL)1;
    const Real3 x = {over * K.x.x, over * K.x.y, over * K.x.z}, y = {over * K.y.x, over * K.y.y, over * K.y.z},
                z = {over * K.z.x, over * K.z.y, over * K.z.z};
    own.x = x;
    own.y = y;
    own.z = z;
    own.r = over * sphere.r;
    return own;
}

static Quadric quadric_at(const Spheres spheres, const int index) {
    return stretched_by(spheres, sphere_at(spheres, index), HAS(WITH_ELLIPSOIDS) ? (INT)spheres.map_of[index] : (INT)0);
}

static Quadric quadrics_of(const Spheres spheres, const INT index) {
    const INT map = HAS(WITH_ELLIPSOIDS) ? numbers_at(spheres.map_of, index) : (INT)0;
    return stretched_by(spheres, spheres_of(spheres, index), index < 0 ? (INT)0 : map);
}

static Real3 in_own_axes(const Quadric own, const Real3 v) {
    if (!HAS(WITH_ELLIPSOIDS)) return v;
    const Real3 w = {DOT(own.x, v), DOT(own.y, v), DOT(own.z, v)};
    return w;
}

/* A vector in double that is a linear function of the place. */
typedef struct {
    Real3 v, s, t;
} Linear3;

static Real3 cross_in_double(const Real3 a, const Real3 b) {
    const Real3 c = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return c;
}

static Model3 narrowed_vector(const Linear3 l, const REAL r) {
    const Model3 m = {narrowed(l.v.x, l.s.x, l.t.x, r), narrowed(l.v.y, l.s.y, l.t.y, r),
                      narrowed(l.v.z, l.s.z, l.t.z, r)};
    return m;
}

static REAL norm_of(const Real3 v) {
    return (fabs(v.x) + fabs(v.y)) + fabs(v.z);
}

/* A cell's rays in a surface's own axes: X and G as linear functions of the place, and the coefficients of a and b. f,
 * g: no less than the magnitudes of F and G. */
typedef struct {
    Linear3 X, G;
    Real3 F;
    REAL f, g, a, as, at, ass, ast, att, b, bs, bt;
} CellRays;

/* Parallel rays, which start at linear functions of the place. */
static CellRays parallel_cell_rays(const Cells cells, const Quadric own, const Real3 C, const real unit) {
    const REAL zero = 0, wide = fabs(cells.dx) + fabs((REAL)cells.h) + fabs(cells.dy) + fabs((REAL)cells.k);
    const Real3 from = {C.x - unit * cells.dx, C.y - unit * cells.dy, C.z}, ahead = {0, 0, -1};
    const Real3 across = {unit * cells.h, zero, zero}, up = {zero, unit * cells.k, zero};
    const Real3 F = in_own_axes(own, from), G = in_own_axes(own, ahead), U = in_own_axes(own, across),
                V = in_own_axes(own, up);
    const CellRays rays = {{cross_in_double(F, G), cross_in_double(G, U), cross_in_double(G, V)},
                           {G, {zero, zero, zero}, {zero, zero, zero}},
                           F,
                           norm_of(C) + unit * wide,
                           1,
                           DOT(G, G),
                           0,
                           0,
                           0,
                           0,
                           0,
                           DOT(F, G),
                           -DOT(U, G),
                           -DOT(V, G)};
    return rays;
}

/* Rays from the eye. */
static CellRays eye_cell_rays(const Cells cells, const Quadric own, const Real3 C) {
    const REAL zero = 0, wide = fabs(cells.dx) + fabs((REAL)cells.h) + fabs(cells.dy) + fabs((REAL)cells.k);
    const Real3 middle = {cells.dx, cells.dy, (REAL)-1}, across = {(REAL)cells.h, zero, zero},
                up = {zero, (REAL)cells.k, zero};
    const Real3 F = in_own_axes(own, C), G = in_own_axes(own, middle), U = in_own_axes(own, across),
                V = in_own_axes(own, up);
    const CellRays rays = {{cross_in_double(F, G), cross_in_double(F, U), cross_in_double(F, V)},
                           {G, U, V},
                           F,
                           norm_of(C),
                           1 + wide,
                           DOT(G, G),
                           2 * DOT(G, U),
                           2 * DOT(G, V),
                           DOT(U, U),
                           2 * DOT(U, V),
                           DOT(V, V),
                           DOT(F, G),
                           DOT(F, U),
                           DOT(F, V)};
    return rays;
}

/* D is D0 + Ds s + Dt t - (ss s^2 + st s t + tt t^2), but for `off`. c: positive where all rays start outside of the
 * surface and lead towards it, negative where all start inside, and else 0. */
typedef struct {
    Model a, b, D;
    Model3 G, X;
    REAL D0, Ds, Dt, ss, st, tt, off;
    FLOAT c;
} Outline;

/* c of an outline, of parallel rays. */
static FLOAT side_of_starts(const Outline outline) {
    const FLOAT low = least_of(outline.D), high = most_of(outline.D), b0 = least_of(outline.b), b1 = most_of(outline.b);
    const FLOAT s0 = sqrt(low > 0 ? low : (FLOAT)0) * (1 - 8 * ROUNDING),
                s1 = sqrt(high > 0 ? high : (FLOAT)0) * (1 + 8 * ROUNDING);
    const MASK outside = b0 - s1 > 0, inside = (low > 0) & (b1 - s0 < 0) & (b0 + s0 > 0);
    return outside ? (FLOAT)1 : inside ? (FLOAT)-1 : (FLOAT)0;
}

/* In double, a number here is made of fewer than 16 roundings of products whose magnitudes add up to no more than those
 * of the vectors' numbers: |F| <= f and |G| <= g, so that X is off by ROUNDINGS f g =: e, in each coordinate, and b by
 * that. X.X is then off by 2 |X| e + 3 e^2, and a r^2 by 4 ROUNDINGS g^2 r^2; their own sums are off by ROUNDINGS of
 * themselves. */
#define ROUNDINGS (REAL_BYTES == 8 ? 0x1p-49f : 0x1p-20f)

/* The same of the eye, of which the host knows it better where the surface is a sphere. */
static FLOAT side_of_eye(const Outline outline, const Quadric own, const CellRays rays, const REAL r, const real unit) {
    const REAL rr = r * r, c = DOT(rays.F, rays.F) - rr, c_off = 4 * (REAL)ROUNDINGS * (rays.f * rays.f + rr),
               known = unit * unit * own.sphere.c, sure = fabs(c) > c_off ? c : (REAL)0;
    const FLOAT side = TO_FLOAT(TO_REAL_MASK(own.stretched) ? sure : known);
    return ((side > 0) & !(least_of(outline.b) > 0)) ? (FLOAT)0 : side;
}

static Outline outline_of(const Cells cells, const Quadric own, const real unit) {
    const Real3 C = {unit * own.sphere.center.x, unit * own.sphere.center.y, unit * own.sphere.center.z};
    const CellRays rays = HAS(WITH_PARALLEL_RAYS) ? parallel_cell_rays(cells, own, C, unit)
                                                  : eye_cell_rays(cells, own, C);
    const Linear3 X = rays.X;
    const REAL r = unit * own.r, rounding = (REAL)ROUNDINGS, e = rounding * rays.f * rays.g, rr = r * r;
    const REAL all = (norm_of(X.v) + norm_of(X.s)) + norm_of(X.t), halved = (REAL)0.5f;
    Outline outline;
    outline.D0 = rays.a * rr - DOT(X.v, X.v);
    outline.Ds = rays.as * rr - 2 * DOT(X.v, X.s);
    outline.Dt = rays.at * rr - 2 * DOT(X.v, X.t);
    outline.ss = DOT(X.s, X.s) - rays.ass * rr;
    outline.st = 2 * DOT(X.s, X.t) - rays.ast * rr;
    outline.tt = DOT(X.t, X.t) - rays.att * rr;
    outline.off = 2 * all * e + 3 * e * e + 4 * rounding * (rays.g * rays.g * rr + all * all);
    const Real3 bend = {outline.ss, outline.st, outline.tt};
    outline.D = narrowed_conic(outline.D0, outline.Ds, outline.Dt, bend, outline.off);
    outline.a = narrowed(rays.a + halved * (rays.ass + rays.att), rays.as, rays.at,
                         halved * (rays.ass + rays.att) + fabs(rays.ast) + rounding * rays.g * rays.g);
    outline.b = narrowed(rays.b, rays.bs, rays.bt, e);
    outline.X = narrowed_vector(X, e);
    outline.G = narrowed_vector(rays.G, rounding * rays.g);
    outline.c = HAS(WITH_PARALLEL_RAYS) ? side_of_starts(outline) : side_of_eye(outline, own, rays, r, unit);
    return outline;
}

/* Where it is met from outside, t is the smaller root, and from inside the larger one. */
static Extent extent_of(const Cells cells, const Outline outline) {
    const FLOAT b0 = least_of(outline.b), b1 = most_of(outline.b), D0 = least_of(outline.D), D1 = most_of(outline.D),
                c = outline.c;
    const FLOAT loose = 8 * ROUNDING, s0 = sqrt(D0 > 0 ? D0 : (FLOAT)0) * (1 - loose),
                s1 = sqrt(D1 > 0 ? D1 : (FLOAT)0) * (1 + loose);
    const FLOAT a0 = least_of(outline.a), a1 = most_of(outline.a), off = loose * (fabs(b0) + fabs(b1) + s1);
    Extent extent = {(D0 > 0) & (c != 0), (D1 < 0) | (b1 + s1 + off < 0), 0, INFINITY};
    const FLOAT low = (c > 0 ? b0 - s1 : b0 + s0) - off, high = (c > 0 ? b1 - s0 : b1 + s1) + off;
    extent.least = ((low > 0) & (c != 0)) ? low / a1 * (1 - loose) : (FLOAT)0;
    extent.most = ((high > 0) & (a0 > 0)) ? high / a0 * (1 + loose) : (FLOAT)INFINITY;
    return extent;
}

/* The share of cells that a disc has, whether or not something is before it. Where D's quadratic part is negative
 * definite, D is positive in an ellipse of the area pi Dm / sqrt(det), where Dm is its largest value and det = ss tt -
 * st^2 / 4, and that is sqrt(Dm tt / det) wide and sqrt(Dm ss / det) high to each side. With D off by `off`, it lies
 * between those of Dm -+ off. No share of a cell, whose area is 4, is larger than the whole ellipse's, a cell in which
 * it lies has all of it, and one that it is beside has none. */
static Share share_of_disc(const Cells cells, const Quadric own, const Outline outline) {
    const MASK clear = outline.c > 0;
    Share share = share_where_positive(outline.D);
    share.least = clear ? share.least : (FLOAT)0;
    share.most = clear ? share.most : (FLOAT)1;
    const REAL ss = outline.ss, st = outline.st, tt = outline.tt, det = ss * tt - (REAL)0.25f * st * st, over = 1 / det;
    const REAL x = (REAL)0.5f * (tt * outline.Ds - (REAL)0.5f * st * outline.Dt) * over;
    const REAL y = (REAL)0.5f * (ss * outline.Dt - (REAL)0.5f * st * outline.Ds) * over;
    const REAL top = outline.D0 + (REAL)0.5f * (outline.Ds * x + outline.Dt * y), loose = (REAL)0x1p-20f;
    const REAL high = top * (1 + loose) + outline.off, low = top * (1 - loose) - outline.off,
               unit = (REAL)0.785398163397448f / sqrt(det);
    const REAL wide = sqrt(high * tt * over) * (1 + loose), tall = sqrt(high * ss * over) * (1 + loose);
    const REAL_MASK round = (ss > 0) & (tt > 0) & (det > loose * (ss * tt)) & (high > 0);
    const REAL_MASK apart = round & ((fabs(x) - wide > 1) | (fabs(y) - tall > 1));
    const REAL_MASK whole = round & (fabs(x) + wide < 1) & (fabs(y) + tall < 1);
    const FLOAT most = TO_FLOAT(high * unit * (1 + loose)), least = TO_FLOAT(low * unit * (1 - loose));
    const MASK known = clear & TO_MASK(round), all = clear & TO_MASK(whole);
    share.most = (known & (most < share.most)) ? most : share.most;
    share.most = (clear & TO_MASK(apart)) ? (FLOAT)0 : share.most;
    share.least = (all & (least > share.least)) ? least : share.least;
    return share;
}

/* A point of the surface is q = (X x G -+ sqrt(D) G) / a in the own axes, where its normal is q; in camera space that
 * is K^T q. */
static Area patch_of_sphere(const Cells cells, const Quadric own, const Outline outline, const real unit) {
    Area patch;
    patch.id = own.sphere.index;
    patch.side = outline.c < 0 ? (FLOAT)-1 : (FLOAT)1;
    const Model root = scaled(root_with(outline.D, &patch.limb), -patch.side), over = reciprocal_of(outline.a);
    Model t = times_model(plus_model(outline.b, root), over);
    t.r = outline.c != 0 ? t.r : (FLOAT)INFINITY;
    const Real3 origin = {0, 0, 0};
    put_points(&patch, cells, t, unit);
    put_anchor(&patch, origin, patch.P);
    const FLOAT over_r = patch.side * TO_FLOAT(1 / (unit * own.r));
    const Model3 q = times_vector(scaled(over, over_r),
                                  plus_vectors(cross_models(outline.X, outline.G), times_vector(root, outline.G)));
    patch.n = q;
    if (HAS(WITH_ELLIPSOIDS) && ANY(own.stretched)) {
        const Real3 column[3] = {{own.x.x, own.y.x, own.z.x}, {own.x.y, own.y.y, own.z.y}, {own.x.z, own.y.z, own.z.z}};
        Model m[3];
        for (int k = 0; k < 3; k++) {
            const Model3 axis = {narrowed(column[k].x, 0, 0, 0), narrowed(column[k].y, 0, 0, 0),
                                 narrowed(column[k].z, 0, 0, 0)};
            m[k] = dot_models(axis, q);
        }
        const Model3 normal = {m[0], m[1], m[2]};
        const Model3 n = times_vector(over_root_of(square_of_vector(normal)), normal);
        patch.n.x = choose_model(own.stretched, n.x, q.x);
        patch.n.y = choose_model(own.stretched, n.y, q.y);
        patch.n.z = choose_model(own.stretched, n.z, q.z);
    }
    patch.n = unit_or_any(patch.n);
    return patch;
}
#endif

/* spheres.cl: spheres over cells, as a camera with perspective sees them. quadrics.cl has the same of ellipsoids and of
 * parallel rays.
 */
#if HAS(WITH_AVERAGE) && !WITH_QUADRICS
typedef Sphere Quadric;

static Quadric quadric_at(const Spheres spheres, const int index) {
    return sphere_at(spheres, index);
}

static Quadric quadrics_of(const Spheres spheres, const INT index) {
    return spheres_of(spheres, index);
}

/* A sphere over cells: b = C.d and D = b^2 - a c, which is positive inside of its outline. c: the power of the eye.
 * Lengths are in the float buffers' unit. */
typedef struct {
    Model b, D;
    FLOAT c;
} Outline;

/* With e = (h s, k t, 0) a place in the cell, and d its middle ray:
 *
 *     b(e) = C.d + C.e
 *     D(e) = b^2 - a c + 2 e.(b C - c d) + (C.x^2 - c) h^2 s^2 + (C.y^2 - c) k^2 t^2 + 2 C.x C.y h k s t
 *
 * C is rounded once, so no number here is off by more than 8 roundings of what its terms add up to, without their
 * signs. */
#define OUTLINE_ROUNDING (REAL_BYTES == 8 ? 0x1p-49f : 0x1p-20f)
static __attribute__((always_inline)) Outline outline_of(const Cells cells, const Quadric sphere, const real unit) {
    const Real3 C = {unit * sphere.center.x, unit * sphere.center.y, unit * sphere.center.z};
    const REAL c = unit * unit * sphere.c, dx = cells.dx, dy = cells.dy, h = cells.h, k = cells.k, X = C.x * h,
               Y = C.y * k;
    const REAL sum = fabs(C.x * dx) + fabs(C.y * dy) + fabs(C.z), all = sum + (fabs(X) + fabs(Y));
    const REAL b = C.x * dx + C.y * dy - C.z, a = (dx * dx + dy * dy) + 1;
    const REAL ss = c * h * h - X * X, tt = c * k * k - Y * Y, st = -2 * X * Y;
    const REAL off = 4 * (REAL)OUTLINE_ROUNDING * (all * all + (a + (h + k) * (1 + h + k)) * fabs(c));
    Outline outline;
    outline.b = narrowed(b, X, Y, (REAL)OUTLINE_ROUNDING * all);
    const Real3 bend = {ss, st, tt};
    outline.D = narrowed_conic(b * b - a * c, 2 * (b * X - c * dx * h), 2 * (b * Y - c * dy * k), bend, off);
    outline.c = TO_FLOAT(c);
    return outline;
}

/* t = (b - sqrt(D)) / a = c / (b + sqrt(D)), or from inside (b + sqrt(D)) / a = -c / (sqrt(D) - b). */
static Extent extent_of(const Cells cells, const Outline outline) {
    const FLOAT c = outline.c, b0 = least_of(outline.b), b1 = most_of(outline.b), D0 = least_of(outline.D),
                D1 = most_of(outline.D);
    const FLOAT s0 = sqrt(D0 > 0 ? D0 : (FLOAT)0), s1 = sqrt(D1 > 0 ? D1 : (FLOAT)0), loose = 8 * ROUNDING;
    const MASK outside = c > 0, ahead = b0 > 0;
    Extent extent = {(D0 > 0) & ((c < 0) | ahead), (D1 < 0) | ((c >= 0) & (b1 < 0)), 0, INFINITY};
    const FLOAT least = outside ? c / (b1 + s1) : (ahead ? (b0 + s0) / most_of(cells.a) : -c / (s1 - b0));
    const FLOAT most = outside ? c / (b0 + s0) : (ahead ? (b1 + s1) / least_of(cells.a) : -c / (s0 - b1));
    extent.least = least > 0 ? least * (1 - loose) : (FLOAT)0;
    extent.most = ((most > 0) & (ahead | (!outside & (s0 > b1)))) ? most * (1 + loose) : (FLOAT)INFINITY;
    return extent;
}

/* The share of cells that a sphere's disc has, whether or not something is before it. With C ahead of the eye, it is an
 * ellipse on the image plane, of the area pi r^2 sqrt(c) / (C.z^2 - r^2)^(3/2), and what lies between the tangents x =
 * (-C.x C.z +- r sqrt(C.x^2 + C.z^2 - r^2)) / (C.z^2 - r^2), and those of y. No share of a cell is larger than the
 * whole ellipse's, and a cell in which it lies has all of it. */
static Share share_of_disc(const Cells cells, const Quadric sphere, const Outline outline) {
    const MASK clear = (outline.c > 0) & (least_of(outline.b) > 0);
    Share share = share_where_positive(outline.D);
    share.least = clear ? share.least : (FLOAT)0;
    share.most = clear ? share.most : (FLOAT)1;
    const Real3 C = sphere.center;
    const REAL r = sphere.r, gap = (C.z - r) * (C.z + r), over = 1 / gap, h = fabs((REAL)cells.h),
               k = fabs((REAL)cells.k);
    const REAL area = (REAL)3.14159265358979f * (r * r) * sqrt(sphere.c) * over * sqrt(over) / (4 * h * k);
    const REAL loose = (REAL)0x1p-20f;
    const REAL x = -C.x * C.z * over - cells.dx, wide = r * sqrt(C.x * C.x + gap) * over;
    const REAL y = -C.y * C.z * over - cells.dy, high = r * sqrt(C.y * C.y + gap) * over;
    const REAL_MASK whole = (fabs(x) + wide < h * (1 - loose)) & (fabs(y) + high < k * (1 - loose)),
                    ahead = (C.z < -r) & (gap > r * r * loose);
    const FLOAT most = TO_FLOAT(area * (1 + loose)), least = TO_FLOAT(area * (1 - loose));
    const MASK known = clear & TO_MASK(ahead), all = known & TO_MASK(whole);
    share.most = (known & (most < share.most)) ? most : share.most;
    share.least = (all & (least > share.least)) ? least : share.least;
    return share;
}

/* From the points of rays that are nearest to a sphere's centre C, to it: f = C - (C.d / d.d) d. The latter is the part
 * of C along d. With u = d / |d|, turning by a small angle, u u^T has a second derivative whose norm is at most 2.65
 * times the square of the change of d, as |d| >= 1. So its tangent is off by 1.33 |C| times that square. */
static Model3 nearest_to_center(const Cells cells, const Real3 C) {
    const REAL dx = cells.dx, dy = cells.dy, h = cells.h, k = cells.k, a = (dx * dx + dy * dy) + 1, over = 1 / a;
    const REAL q = (C.x * dx + C.y * dy - C.z) * over, s = (C.x - 2 * q * dx) * h * over,
               t = (C.y - 2 * q * dy) * k * over;
    const REAL size = fabs(C.x) + fabs(C.y) + fabs(C.z), wide = 1 + fabs(dx) + fabs(dy);
    const REAL r = size * ((REAL)1.5f * (h * h + k * k) + 4 * (REAL)OUTLINE_ROUNDING * wide * wide);
    const Model3 f = {narrowed(C.x - q * dx, -s * dx - q * h, -t * dx, r),
                      narrowed(C.y - q * dy, -s * dy, -t * dy - q * k, r), narrowed(C.z + q, s, t, r)};
    return f;
}

/* t is c / (b + sqrt(D)) from outside, and (b + sqrt(D)) / a or -c / (sqrt(D) - b) from inside, so that nothing
 * cancels. */
static Area patch_of_sphere(const Cells cells, const Quadric sphere, const Outline outline, const real unit) {
    Area patch;
    patch.id = sphere.index;
    const MASK inside = outline.c <= 0;
    patch.side = inside ? (FLOAT)-1 : (FLOAT)1;
    const Model b = scaled(outline.b, outline.b.v < 0 ? (FLOAT)-1 : (FLOAT)1), root = root_with(outline.D, &patch.limb),
                sum = plus_model(b, root);
    const MASK far = inside & (outline.b.v >= 0);
    const Model over = reciprocal_of(choose_model(far, cells.a, sum));
    const Model t = times_model(choose_model(far, sum, constant_model(fabs(outline.c))), over);
    put_points(&patch, cells, t, unit);
    const FLOAT over_r = patch.side * TO_FLOAT(sphere.over_r / unit);
    /* The nearer end of the chord, from the centre; or the further one, from inside. */
    const Real3 C = {unit * sphere.center.x, unit * sphere.center.y, unit * sphere.center.z};
    const Model3 f = nearest_to_center(cells, C);
    const Model part = times_model(scaled(root, patch.side), reciprocal_of(cells.a));
    const Model3 p = {minus_model(scaled(times_model(part, cells.x), -1), f.x),
                      minus_model(scaled(times_model(part, cells.y), -1), f.y), minus_model(part, f.z)};
    patch.n.x = scaled(p.x, over_r);
    patch.n.y = scaled(p.y, over_r);
    patch.n.z = scaled(p.z, over_r);
    const REAL r = unit * sphere.r, power = unit * unit * sphere.c;
    const REAL_MASK small = power > r * r;
    const Real3 anchor = {small ? C.x : (REAL)0, small ? C.y : (REAL)0, small ? C.z : (REAL)0};
    put_anchor(&patch, anchor, choose_vector(TO_MASK(small), p, patch.P));
    return patch;
}
#endif

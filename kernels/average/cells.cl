/* cells.cl: which surfaces a cell of the picture shows, decided for all of its rays at once.
 *
 * Cells of level k have sides of 4^-k pixels. A packet of 4 x W/4 of them goes side by side, as pixels do.
 */
#ifdef WITH_AVERAGE
/* The rays (x, y, -1) through cells, and their squared lengths. dx, dy, h, k: x is dx + h s, and y is dy + k t. */
typedef struct {
    REAL dx, dy;
    real h, k;
    Model x, y, a;
} Cells;

/* A model of numbers that are known in double. */
static Model narrowed(const REAL v, const REAL x, const REAL y, const REAL r) {
    const Model m = {TO_FLOAT(v), TO_FLOAT(x), TO_FLOAT(y), TO_FLOAT(r)};
    return with_rounding(m);
}

/* x, y: the places of the middles, in halves of the cells of their level; size: of the whole picture in pixels. */
static Cells cells_around(const Frame frame, const int2 size, const int level, const INT x, const INT y) {
    const int parts = 1 << 2 * level;
    Cells cells;
    cells.h = frame.pixel.x / parts;
    cells.k = frame.pixel.y / parts;
    cells.dx = TO_REAL(x - size.x * parts) * cells.h;
    cells.dy = TO_REAL(size.y * parts - y) * cells.k;
    cells.x = narrowed(cells.dx, cells.h, 0, 0);
    cells.y = narrowed(cells.dy, 0, cells.k, 0);
    cells.a = plus_model(plus_model(square_of(cells.x), square_of(cells.y)), constant_model(1));
    return cells;
}

/* column, row: of the cells, among those of their level. */
static Cells cells_at(const Frame frame, const int2 size, const int level, const INT column, const INT row) {
    return cells_around(frame, size, level, 2 * column + 1, 2 * row + 1);
}

/* The rays through the middles. */
static Ray middle_rays(const Frame frame, const Scene scene, const Cells cells) {
    Ray ray;
#ifdef WITH_PARALLEL_RAYS
    ray.o.x = cells.dx;
    ray.o.y = cells.dy;
    ray.o.z = ray.d.x = ray.d.y = 0;
    ray.d.z = -1;
    ray.a = ray.over_a = 1;
    ray.reach = fabs(ray.o.x) + fabs(ray.o.y);
#else
    ray.d.x = cells.dx;
    ray.d.y = cells.dy;
    ray.d.z = -1;
    ray.a = (ray.d.x * ray.d.x + ray.d.y * ray.d.y) + 1;
    ray.over_a = 1 / ray.a;
#endif
    return for_shapes(frame, scene, ray);
}

/* A sphere over cells: b = C.d and D = b^2 - a c, which is positive inside of its outline. c: the power of the eye. Lengths are
 * in the float buffers' unit. */
typedef struct {
    Model b, D;
    FLOAT c;
} Outline;

/* With e = (h s, k t, 0) a place in the cell, and d its middle ray:
 *
 *     b(e) = C.d + C.e
 *     D(e) = b^2 - a c + 2 e.(b C - c d) + (C.x^2 - c) h^2 s^2 + (C.y^2 - c) k^2 t^2 + 2 C.x C.y h k s t
 *
 * C is rounded once, so no number here is off by more than 8 roundings of what its terms add up to, without their signs. */
#if REAL_BYTES == 8
#define OUTLINE_ROUNDING 0x1p-49
#else
#define OUTLINE_ROUNDING 0x1p-20f
#endif
static Outline outline_of(const Cells cells, const Sphere sphere, const real unit) {
    const Real3 C = {unit * sphere.center.x, unit * sphere.center.y, unit * sphere.center.z};
    const REAL c = unit * unit * sphere.c, dx = cells.dx, dy = cells.dy, h = cells.h, k = cells.k, X = C.x * h, Y = C.y * k;
    const REAL sum = fabs(C.x * dx) + fabs(C.y * dy) + fabs(C.z), all = sum + (fabs(X) + fabs(Y));
    const REAL b = C.x * dx + C.y * dy - C.z, a = (dx * dx + dy * dy) + 1;
    const REAL ss = (REAL)0.5f * (X * X - c * h * h), tt = (REAL)0.5f * (Y * Y - c * k * k), st = 2 * X * Y;
    const REAL off = 4 * (REAL)OUTLINE_ROUNDING * (all * all + (a + (h + k) * (1 + h + k)) * fabs(c));
    Outline outline;
    outline.b = narrowed(b, X, Y, (REAL)OUTLINE_ROUNDING * all);
    outline.D = narrowed(b * b - a * c + (ss + tt), 2 * (b * X - c * dx * h), 2 * (b * Y - c * dy * k), fabs(ss) + fabs(tt) + fabs(st) + off);
    outline.c = TO_FLOAT(c);
    return outline;
}

/* Where along the rays of a cell a surface is met: t is within least .. most where it is. */
typedef struct {
    MASK covers, misses; /* whether all rays of the cell meet it, and whether none does */
    FLOAT least, most;
} Extent;

/* t = (b - sqrt(D)) / a = c / (b + sqrt(D)), or from inside (b + sqrt(D)) / a = -c / (sqrt(D) - b). */
static Extent extent_of(const Cells cells, const Outline outline) {
    const FLOAT c = outline.c, b0 = least_of(outline.b), b1 = most_of(outline.b), D0 = least_of(outline.D), D1 = most_of(outline.D);
    const FLOAT s0 = sqrt(D0 > 0 ? D0 : (FLOAT)0), s1 = sqrt(D1 > 0 ? D1 : (FLOAT)0), loose = 8 * ROUNDING;
    const MASK outside = c > 0, ahead = b0 > 0;
    Extent extent = {(D0 > 0) & ((c < 0) | ahead), (D1 < 0) | ((c >= 0) & (b1 < 0)), 0, INFINITY};
    const FLOAT least = outside ? c / (b1 + s1) : (ahead ? (b0 + s0) / most_of(cells.a) : -c / (s1 - b0));
    const FLOAT most = outside ? c / (b0 + s0) : (ahead ? (b1 + s1) / least_of(cells.a) : -c / (s0 - b1));
    extent.least = least > 0 ? least * (1 - loose) : (FLOAT)0;
    extent.most = ((most > 0) & (ahead | (!outside & (s0 > b1)))) ? most * (1 + loose) : (FLOAT)INFINITY;
    return extent;
}

/* What cells show. cover: the surface that surely covers all of the cell and whose furthest point there is nearest, -1 for the
 * background; front: of all others in the cell, the one with the nearest point, -1 for none; others: how near the rest may be. */
typedef struct {
    INT cover, front;
    Extent of_cover, of_front;
    FLOAT others;
} Sight;

static Sight empty_sight(void) {
    const Extent far = {0, 0, INFINITY, INFINITY};
    const Sight view = {-1, -1, far, far, INFINITY};
    return view;
}

static void see(Sight *view, const int index, const Extent extent) {
    const MASK nearer = extent.covers & (extent.most < view->of_cover.most);
    /* What is no cover, or no longer. */
    const FLOAT near = nearer ? view->of_cover.least : (extent.misses ? (FLOAT)INFINITY : extent.least);
    const MASK first = near < view->of_front.least;
    const FLOAT next = first ? view->of_front.least : near;
    view->others = next < view->others ? next : view->others;
    PUT_WHERE(first, view->front, nearer ? view->cover : (INT)index);
    PUT_WHERE(first, view->of_front.least, near);
    PUT_WHERE(first, view->of_front.most, nearer ? view->of_cover.most : extent.most);
    PUT_WHERE(first, view->of_front.covers, extent.covers);
    PUT_WHERE(nearer, view->cover, (INT)index);
    PUT_WHERE(nearer, view->of_cover.least, extent.least);
    PUT_WHERE(nearer, view->of_cover.most, extent.most);
}

/* Where something is surely behind the cover, or is not there at all. */
static MASK behind_cover(const Sight view, const FLOAT least) {
    return (least > view.of_cover.most) | (least == INFINITY);
}

/* The share of cells that a sphere's disc has, whether or not something is before it. With C ahead of the eye, it is an ellipse
 * on the image plane, of the area pi r^2 sqrt(c) / (C.z^2 - r^2)^(3/2), and what lies between the tangents
 * x = (-C.x C.z +- r sqrt(C.x^2 + C.z^2 - r^2)) / (C.z^2 - r^2), and those of y. No share of a cell is larger than the whole
 * ellipse's, and a cell in which it lies has all of it. */
static Share share_of_disc(const Cells cells, const Sphere sphere, const Outline outline) {
    const MASK clear = (outline.c > 0) & (least_of(outline.b) > 0);
    Share share = share_where_positive(outline.D);
    share.least = clear ? share.least : (FLOAT)0;
    share.most = clear ? share.most : (FLOAT)1;
    const Real3 C = sphere.center;
    const REAL r = sphere.r, gap = (C.z - r) * (C.z + r), over = 1 / gap, h = fabs((REAL)cells.h), k = fabs((REAL)cells.k);
    const REAL area = (REAL)3.14159265358979f * (r * r) * sqrt(sphere.c) * over * sqrt(over) / (4 * h * k);
    const REAL loose = (REAL)0x1p-20f;
    const REAL x = -C.x * C.z * over - cells.dx, wide = r * sqrt(C.x * C.x + gap) * over;
    const REAL y = -C.y * C.z * over - cells.dy, high = r * sqrt(C.y * C.y + gap) * over;
    const REAL_MASK whole = (fabs(x) + wide < h * (1 - loose)) & (fabs(y) + high < k * (1 - loose)), ahead = (C.z < -r) & (gap > r * r * loose);
    const FLOAT most = TO_FLOAT(area * (1 + loose)), least = TO_FLOAT(area * (1 - loose));
    const MASK known = clear & TO_MASK(ahead), all = known & TO_MASK(whole);
    share.most = (known & (most < share.most)) ? most : share.most;
    share.least = (all & (least > share.least)) ? least : share.least;
    return share;
}

/* tile: the cells' place in the picture, in units of TILE x TILE pixels. */
static Sight sight_of(const Scene scene, const Cells cells, const int2 tile) {
    Sight view = empty_sight();
    float reach = INFINITY;
    const FLOAT a = most_of(cells.a);
    const Grid grid = scene.lists.grid[0];
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile);
        const int end = scene.lists.start[cell + 1];
        FETCH_AHEAD(scene, scene.eye_filter, -1, end);
        for (int k = scene.lists.start[cell]; k < end; k++) {
            const int2 entry = scene.lists.entry[k];
            if (as_float(entry.y) > reach) break;
            FETCH_ENTRY(scene, scene.eye_filter, -1, k + AHEAD);
            const Extent extent = extent_of(cells, outline_of(cells, sphere_at(scene.spheres, entry.x), scene.unit));
            if (!ANY((!extent.misses))) continue;
            see(&view, entry.x, extent);
            const FLOAT far = view.of_cover.most;
            reach = LARGEST_FLOAT(far * far * a * REACH_SLACK);
        }
    }
    return view;
}
#endif

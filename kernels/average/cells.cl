/* cells.cl: which surfaces a cell of the picture shows, decided for all of its rays at once.
 *
 * Cells of level k have sides of 2^-k pixels. A packet of 4 x W/4 of them goes side by side, as pixels do.
 */
#ifdef WITH_AVERAGE
/* The rays (x, y, -1) through cells, and their squared lengths. dx, dy, h, k: x is dx + h s, and y is dy + k t. Of an
 * orthographic camera these are where rays start, and x, y stay 0 and a is 1. */
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

/* v + x s + y t - (ss s^2 + st s t + tt t^2), known in double but for r, with its middle's plane: ss s^2 is within 0
 * and ss. */
static Model narrowed_conic(const REAL v, const REAL x, const REAL y, const Real3 bend, const REAL r) {
    const REAL ss = bend.x, st = bend.y, tt = bend.z, middle = (REAL)0.5f * (ss + tt);
    const Model m = {TO_FLOAT(v - middle), TO_FLOAT(x), TO_FLOAT(y),
                     TO_FLOAT((REAL)0.5f * (fabs(ss) + fabs(tt)) + fabs(st) + r), 0};
    return with_rounding(m);
}

/* size: of the whole picture in pixels; column, row: of the cells, among those of their level. */
static Cells cells_at(const Frame frame, const int2 size, const int level, const INT column, const INT row) {
    const int parts = 1 << level;
    Cells cells;
    cells.h = frame.pixel.x / parts;
    cells.k = frame.pixel.y / parts;
    cells.dx = TO_REAL(2 * column + 1 - size.x * parts) * cells.h;
    cells.dy = TO_REAL(size.y * parts - 2 * row - 1) * cells.k;
    cells.x = cells.y = constant_model(0);
    cells.a = constant_model(1);
    if (HAS(WITH_PARALLEL_RAYS)) return cells;
    cells.x = narrowed(cells.dx, cells.h, 0, 0);
    cells.y = narrowed(cells.dy, 0, cells.k, 0);
    cells.a = plus_model(plus_model(square_of(cells.x), square_of(cells.y)), cells.a);
    return cells;
}

/* Where along the rays of a cell a surface is met: t is within least .. most where it is. */
typedef struct {
    MASK covers, misses; /* whether all rays of the cell meet it, and whether none does */
    FLOAT least, most;
} Extent;

/* Points of a surface under cells. */
typedef struct {
    INT id;      /* which surface, -1 for none */
    Model3 P, n; /* in camera space; the unit normal that faces the eye */
    Model3 v;    /* the unit vector to the eye */
    /* From `anchor` to the points. Of a small sphere that is its centre: what shadows it depends on small differences.
     */
    Real3 anchor;
    Model3 p;
    Limb limb;
    FLOAT side;   /* 1 where it is seen from outside, -1 from inside */
    FLOAT radius; /* no point is further from the middle, anchor + (p.x.v, p.y.v, p.z.v) */
    int bare;     /* whether nothing else of them is known but this, P and side, so that shadows' rims are not */
} Area;

static Model3 constant_vector_in(const Real3 v, const real unit) {
    const Model3 m = {narrowed(unit * v.x, 0, 0, 0), narrowed(unit * v.y, 0, 0, 0), narrowed(unit * v.z, 0, 0, 0)};
    return m;
}

static Model3 choose_vector(const MASK first, const Model3 a, const Model3 b) {
    const Model3 m = {choose_model(first, a.x, b.x), choose_model(first, a.y, b.y), choose_model(first, a.z, b.z)};
    return m;
}

/* A unit vector: where it is not known, each coordinate is within -1 .. 1. */
static Model3 unit_or_any(const Model3 n) {
    const MASK known = is_known(n.x) & is_known(n.y) & is_known(n.z);
    const Model any = {0, 0, 0, 1};
    const Model3 unit = {choose_model(known, n.x, any), choose_model(known, n.y, any), choose_model(known, n.z, any)};
    return unit;
}

/* Puts in the points at t along a cell's rays, or along parallel ones, and the unit vectors from them to the eye. */
static void put_points(Area *patch, const Cells cells, const Model t, const real unit) {
    patch->P.z = scaled(t, -1);
    if (HAS(WITH_PARALLEL_RAYS)) {
        patch->P.x = narrowed(unit * cells.dx, unit * (REAL)cells.h, 0, 0);
        patch->P.y = narrowed(unit * cells.dy, 0, unit * (REAL)cells.k, 0);
        patch->v.x = patch->v.y = constant_model(0);
        patch->v.z = constant_model(1);
        return;
    }
    patch->P.x = times_model(t, cells.x);
    patch->P.y = times_model(t, cells.y);
    const Model over_d = over_root_of(cells.a);
    patch->v.x = scaled(times_model(over_d, cells.x), -1);
    patch->v.y = scaled(times_model(over_d, cells.y), -1);
    patch->v.z = over_d;
}

/* Puts in the points once more, as p from an anchor, and how far they are spread. */
static void put_anchor(Area *patch, const Real3 anchor, const Model3 p) {
    patch->bare = 0;
    patch->anchor = anchor;
    patch->p = p;
    const FLOAT x = radius_of(patch->p.x), y = radius_of(patch->p.y), z = radius_of(patch->p.z);
    patch->radius = sqrt((x * x + y * y) + z * z) * (1 + 4 * ROUNDING);
}

/* What is known of a packet of cells: the mean colour, in which each colour counts up to 1, the share that surfaces
 * have, and what these are off by at most, in levels of 255. beyond: where something is seen of which nothing is known.
 */
typedef struct {
    FLOAT color[3], coverage, error;
    MASK beyond;
} Means;

/* An error of colours in levels. Besides, colours are at most 1 and in float: each rounding is below 2^-16 of a level,
 * and 2^-12 are 16 of them. */
static FLOAT levels_of(const FLOAT error) {
    return error * 255.0f * 1.0001f + 0x1p-12f;
}
#endif

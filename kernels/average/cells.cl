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

/* v + x s + y t - (ss s^2 + st s t + tt t^2), known in double. */
static Conic conic_of(const REAL v, const REAL x, const REAL y, const REAL ss, const REAL st, const REAL tt,
                      const REAL r) {
    Conic D = {TO_FLOAT(v), TO_FLOAT(x), TO_FLOAT(y), TO_FLOAT(ss), TO_FLOAT(st), TO_FLOAT(tt), TO_FLOAT(r)};
    D.r += 0x1p-23f * (fabs(D.v) + fabs(D.x) + fabs(D.y) + (fabs(D.ss) + fabs(D.st) + fabs(D.tt))) + 0x1p-19f * D.r +
           VANISHING;
    return D;
}

/* x, y: the places of the middles, in halves of the cells of their level; size: of the whole picture in pixels. */
static Cells cells_around(const Frame frame, const int2 size, const int level, const INT x, const INT y) {
    const int parts = 1 << level;
    Cells cells;
    cells.h = frame.pixel.x / parts;
    cells.k = frame.pixel.y / parts;
    cells.dx = TO_REAL(x - size.x * parts) * cells.h;
    cells.dy = TO_REAL(size.y * parts - y) * cells.k;
#ifdef WITH_PARALLEL_RAYS
    cells.x = cells.y = constant_model(0);
    cells.a = constant_model(1);
#else
    cells.x = narrowed(cells.dx, cells.h, 0, 0);
    cells.y = narrowed(cells.dy, 0, cells.k, 0);
    cells.a = plus_model(plus_model(square_of(cells.x), square_of(cells.y)), constant_model(1));
#endif
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
    return for_shapes(frame, ray);
}

/* Where along the rays of a cell a surface is met: t is within least .. most where it is. */
typedef struct {
    MASK covers, misses; /* whether all rays of the cell meet it, and whether none does */
    FLOAT least, most;
} Extent;

/* Of a pixel or a part of one: sums of colours times areas, in units of 2^-40, and of errors times areas. */
typedef struct {
    long color[3], coverage;
    float error;
} Sum;

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
#ifdef WITH_SHEETS
    /* P is ray / over; of what is flat both are planes over the cell, and so are all linear functions of P times over.
     */
    int flat;
    Model over;
    Model3 ray;
#endif
#ifdef WITH_TEXTURES
    Model tu, tv;   /* where they are on a texture */
    Model paint[3]; /* red, green and blue there */
    MASK rough;     /* where these are the middle's, and what other places have besides: see paint_of() */
    Model3 q;       /* of a sphere the outward normal, in its own axes if they are `stretched`, else in camera space */
    MASK stretched;
#endif
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

/* The directions of a cell's rays, or where parallel ones start, as facets take them. */
static Model3 directions_of(const Cells cells, const real unit) {
#ifdef WITH_PARALLEL_RAYS
    const Model3 v = {narrowed(unit * cells.dx, unit * (REAL)cells.h, 0, 0),
                      narrowed(unit * cells.dy, 0, unit * (REAL)cells.k, 0), constant_model(1)};
#else
    const Model3 v = {cells.x, cells.y, constant_model(-1)};
#endif
    return v;
}

/* Puts in the points at t along a cell's rays, or along parallel ones, and the unit vectors from them to the eye. */
static void put_points(Area *patch, const Cells cells, const Model t, const real unit) {
#ifdef WITH_PARALLEL_RAYS
    patch->P = directions_of(cells, unit);
    patch->v.x = patch->v.y = constant_model(0);
    patch->v.z = constant_model(1);
#else
    patch->P.x = times_model(t, cells.x);
    patch->P.y = times_model(t, cells.y);
    const Model over_d = over_root_of(cells.a);
    patch->v.x = scaled(times_model(over_d, cells.x), -1);
    patch->v.y = scaled(times_model(over_d, cells.y), -1);
    patch->v.z = over_d;
#endif
    patch->P.z = scaled(t, -1);
#ifdef WITH_SHEETS
    patch->flat = 0;
#endif
}

/* Puts in the points once more, as p from an anchor, and how far they are spread. Shadows are looked for by planes, but
 * at outlines. */
static void put_anchor(Area *patch, const Real3 anchor, const Model3 p) {
    patch->bare = 0;
    patch->anchor = anchor;
    patch->p.x = flattened_inside(p.x, &patch->limb);
    patch->p.y = flattened_inside(p.y, &patch->limb);
    patch->p.z = flattened_inside(p.z, &patch->limb);
    const FLOAT x = radius_of(patch->p.x), y = radius_of(patch->p.y), z = radius_of(patch->p.z);
    patch->radius = sqrt((x * x + y * y) + z * z) * (1 + 4 * ROUNDING);
}

/* SURE: within the error; OPEN: too, but it may be large, and smaller after splitting; BEYOND: something in the cell
 * mirrors or is transparent, so that the pixel is one for samples.cl. */
#define SURE 0
#define OPEN 1
#define BEYOND 2

/* What is known of a packet of cells: the mean colour, the share that surfaces have, and the colour's error in levels
 * of 255. */
typedef struct {
    SHADE color[3];
    FLOAT coverage, error;
    INT state;
} Means;
#endif

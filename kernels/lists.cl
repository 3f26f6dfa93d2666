/* lists.cl: which spheres a ray can meet at all. cltrace/lists.py says what a sheet is, and makes them. */

typedef struct {
    real4 right, up, ahead; /* w: added to a coordinate, so that those of a parallel light count from the middle */
    float4 near_right, near_up, near_ahead; /* the same in float */
    float4 window;          /* x, y: half of the sides; z, w: cells in a unit of length */
    int4 cells;             /* columns, rows on level 0; the first cell's number; which levels hold anything */
    int4 flags;             /* x: whether float is fine enough for the cells */
} Grid;

typedef char layout_of_Grid_differs_from_numpy[sizeof(Grid) == Grid_BYTES ? 1 : -1];

typedef struct {
    __global const Grid *grid;  /* the picture, then the sheets of the lights */
    __global const int *start;  /* per cell: where its list begins; the next cell's begin is its end */
    __global const int2 *entry; /* a sphere's number, and the measure by which the list is sorted, as float bits */
} Lists;

/* The next level of a sheet, from coarse to fine. mask: the levels still to come; first: its first cell's number. */
typedef struct {
    int mask, level, columns, first, next;
} Level;

static Level first_level(const Grid grid) {
    const Level level = {grid.cells.w, 0, 0, 0, grid.cells.z};
    return level;
}

static Level next_level(const Grid grid, Level level) {
    level.level = 31 - (int)clz(level.mask);
    level.mask &= ~(1 << level.level);
    level.columns = ((grid.cells.x - 1) >> level.level) + 1;
    level.first = level.next;
    level.next += level.columns * (((grid.cells.y - 1) >> level.level) + 1);
    return level;
}

/* Whether the picture's lists hold anything for a tile: if not, it is all background. */
static int has_candidates(const Lists lists, const int2 tile) {
    const Grid grid = lists.grid[0];
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const int cell = level.first + (tile.y >> level.level) * level.columns + (tile.x >> level.level);
        if (lists.start[cell] != lists.start[cell + 1]) return 1;
    }
    return 0;
}

/* Tells a CPU to fetch what the first entries of a list will ask for: the filter's and the spheres' numbers. With many
 * spheres those are far apart in memory, and half of the time went into waiting for them. OpenCL's own prefetch() does
 * nothing on the CPU drivers. As far ahead as AHEAD in cltrace/lists.py. */
#if defined(WITH_PREFETCH) && W > 1 && defined(__has_builtin)
#if __has_builtin(__builtin_prefetch)
#define FETCH(array, index) __builtin_prefetch((const void *)(uintptr_t)((array) + (index)))
static void fetch_ahead(const Spheres spheres, const Lists lists, __global const float4 *filter, const int first) {
    for (int k = first; k < first + 8; k++) {
        const int index = lists.entry[k].x;
        FETCH(filter, index);
        FETCH(spheres.center_radius, index);
        FETCH(spheres.power, index);
    }
}
#define FETCH_AHEAD(scene, filter, first) fetch_ahead((scene).spheres, (scene).lists, filter, first)
#endif
#endif
#ifndef FETCH_AHEAD
#define FETCH_AHEAD(scene, filter, first)
#endif

/* cells.cl: which surfaces a ray from a fixed point can meet at all. cltrace/plan/accel/grids.py says what a grid is,
 * and makes the grids.
 */

/* A level of a grid, on the way from coarse to fine through those levels that hold anything. */
typedef struct {
    int mask;    /* a bit for each level that is still to come */
    int level;   /* a cell of this level is 2^level cells of level 0 wide and high */
    int columns; /* cells in one of its rows */
    int first;   /* where its first cell is in lists.start */
    int next;    /* where the first cell of the next level is */
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

/* Where the cell of this level that holds a cell of level 0 is in lists.start. place: that one's column and row. */
static int cell_of(const Level level, const int2 place) {
    return level.first + (place.y >> level.level) * level.columns + (place.x >> level.level);
}

/* Whether the picture's lists hold anything for a tile: if not, it is all background. tile: its column and row. */
static int tile_has_any(const Lists lists, const int2 tile) {
    const Grid grid = lists.grid[0];
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile);
        if (lists.start[cell] != lists.start[cell + 1]) return 1;
    }
    return 0;
}

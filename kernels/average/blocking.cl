/* blocking.cl: what stands between a patch and a light, of the light's lists. */
#ifdef WITH_AVERAGE
/* The cells of level 0 of a light's grid on which a patch may lie. */
typedef struct {
    MASK here, unknown; /* whether there are any, and whether that cannot be told */
    INT first_column, first_row, last_column, last_row;
} Cover;

/* A range of slopes or coordinates as columns or rows, 0 .. last. side, scale: of the grid's window. */
static INT index_on(const FLOAT x, const float side, const float scale, const int last) {
    const FLOAT place = (x + side) * scale, low = place > 0 ? place : (FLOAT)0;
    return TO_INT(low < last ? low : (FLOAT)last);
}

static Cover cover_of(const Grid grid, const Shaft *shaft, const MASK wanted) {
    Cover cover = {wanted, 0, 0, 0, 0, 0};
    if (grid.cells.x <= 1 && grid.cells.y <= 1) return cover;
    const FLOAT k = shaft->at_point ? -1 : 1;
    const Model3 from = shaft->at_point ? shaft->w : shaft->patch->P;
    const Float3 m = {k * from.x.v, k * from.y.v, k * from.z.v};
    const Float3 off = {fabs(k) * radius_of(from.x), fabs(k) * radius_of(from.y), fabs(k) * radius_of(from.z)};
    const float4 right = fabs(grid.near_right), up = fabs(grid.near_up), ahead = fabs(grid.near_ahead);
    const FLOAT x = DOT(m, grid.near_right) + grid.near_right.w, y = DOT(m, grid.near_up) + grid.near_up.w;
    const FLOAT z = shaft->at_point ? DOT(m, grid.near_ahead) : (FLOAT)1;
    const FLOAT loose = 1 + 0x1p-20f, dx = DOT(off, right) * loose, dy = DOT(off, up) * loose,
                dz = shaft->at_point ? DOT(off, ahead) * loose : (FLOAT)0;
    const FLOAT z0 = z - dz, z1 = z + dz, x0 = x - dx, x1 = x + dx, y0 = y - dy, y1 = y + dy;
    const FLOAT X = grid.window.x * loose * z1, Y = grid.window.y * loose * z1;
    cover.here = wanted & (z1 > 0) & (x0 <= X) & (x1 >= -X) & (y0 <= Y) & (y1 >= -Y);
    cover.unknown = cover.here & !(z0 > 0);
    cover.here = cover.here & (z0 > 0);
    const FLOAT a = cover.here ? z0 : (FLOAT)1, b = cover.here ? z1 : (FLOAT)1;
    const FLOAT slack = 0x1p-20f;
    const int columns = grid.cells.x - 1, rows = grid.cells.y - 1;
    const FLOAT left = x0 < 0 ? x0 / a : x0 / b, end = x1 < 0 ? x1 / b : x1 / a;
    const FLOAT low = y0 < 0 ? y0 / a : y0 / b, high = y1 < 0 ? y1 / b : y1 / a;
    cover.first_column = index_on(left - slack * fabs(left), grid.window.x, grid.window.z, columns);
    cover.last_column = index_on(end + slack * fabs(end), grid.window.x, grid.window.z, columns);
    cover.first_row = index_on(low - slack * fabs(low), grid.window.y, grid.window.w, rows);
    cover.last_row = index_on(high + slack * fabs(high), grid.window.y, grid.window.w, rows);
    return cover;
}

/* All that may block the light, of the list of one cell of the light's buffer. */
static void block_by_list(const Scene *scene, const Shaft *shaft, const int cell, const MASK in, Blocking *blocking) {
    const int end = scene->lists.start[cell + 1];
    for (int k = scene->lists.start[cell]; k < end; k++) {
        const int2 entry = scene->lists.entry[k];
        const MASK dark = (blocking->blocked.least >= 1) | blocking->odd;
        const MASK may = in & (shaft->far > as_float(entry.y)) & !dark;
        if (!ANY(may)) break;
        ASK_SHAPE(scene->spheres, entry.x, block(scene, shaft, entry.x, may, blocking));
    }
}

/* So many cells of a level, side by side, a patch's lists are looked at; where it lies on more, all may be blocked. */
#define MOST_CELLS_A_SIDE 12

/* The same of the lists of those cells of a level on which a patch may lie. */
static void block_by_level(const Scene *scene, const Shaft *shaft, const Level level, const Cover cover,
                           Blocking *blocking) {
    const INT column = cover.first_column >> level.level, row = cover.first_row >> level.level;
    const INT columns = (cover.last_column >> level.level) - column, rows = (cover.last_row >> level.level) - row;
    const MASK many = cover.here & ((columns >= MOST_CELLS_A_SIDE) | (rows >= MOST_CELLS_A_SIDE));
    blocking->blocked.most = many ? (FLOAT)1 : blocking->blocked.most;
    const MASK some = cover.here & !many;
    const int width = LARGEST(some ? columns : (INT)0) + 1, height = LARGEST(some ? rows : (INT)0) + 1;
    for (int place = 0; place < width * height; place++) {
        const int across = place % width, down = place / width;
        const MASK inside = some & (columns >= across) & (rows >= down);
        if (!ANY(inside)) continue;
        INT pending = inside ? level.first + (row + down) * level.columns + (column + across) : (INT)-1;
        for (int c = LARGEST(pending); c >= 0; c = LARGEST(pending)) {
            const MASK in = pending == c;
            pending = in ? (INT)-1 : pending;
            block_by_list(scene, shaft, c, in, blocking);
        }
    }
}

/* What is between a patch's points and a light. */
static Blocking blocking_of(const Scene *scene, const Shaft *shaft, const MASK wanted) {
    Blocking blocking = {{0, 0}, -1, {{0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}}, {-1, -1}, 0};
    const int4 grids = scene->light_buffer[shaft->number];
    for (int g = grids.x; g < grids.x + grids.y; g++) {
        const Grid grid = scene->lists.grid[g];
        const Cover cover = cover_of(grid, shaft, wanted);
        blocking.blocked.most = cover.unknown ? (FLOAT)1 : blocking.blocked.most;
        if (!ANY(cover.here)) continue;
        Level level = first_level(grid);
        while (level.mask) {
            level = next_level(grid, level);
            block_by_level(scene, shaft, level, cover, &blocking);
        }
    }
    return blocking;
}
#endif

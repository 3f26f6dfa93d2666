/* sight.cl: which surfaces a cell of the picture shows.
 */
#if defined(WITH_AVERAGE) && !defined(WITH_TRIANGLES)
/* What cells show. cover: the surface that surely covers all of the cell and whose furthest point there is nearest, -1
 * for the background; front, second: of all others in the cell, those with the nearest points, -1 for none; others: how
 * near the rest may be. */
typedef struct {
    INT cover, front, second;
    Extent of_cover, of_front, of_second;
    FLOAT others;
} Sight;

static Sight empty_sight(void) {
    const Extent far = {0, 0, INFINITY, INFINITY};
    const Sight view = {-1, -1, -1, far, far, far, INFINITY};
    return view;
}

static void put_extent(const MASK here, Extent *to, const Extent from) {
    PUT_WHERE(here, to->least, from.least);
    PUT_WHERE(here, to->most, from.most);
    PUT_WHERE(here, to->covers, from.covers);
}

static Sight choose_sight(const MASK first, const Sight a, Sight b) {
    PUT_WHERE(first, b.cover, a.cover);
    PUT_WHERE(first, b.front, a.front);
    PUT_WHERE(first, b.second, a.second);
    put_extent(first, &b.of_cover, a.of_cover);
    put_extent(first, &b.of_front, a.of_front);
    put_extent(first, &b.of_second, a.of_second);
    PUT_WHERE(first, b.others, a.others);
    return b;
}

static void see(Sight *view, const int index, const Extent extent) {
    const MASK nearer = extent.covers & (extent.most < view->of_cover.most);
    /* What is no cover, or no longer. */
    Extent rest = extent;
    rest.least = extent.misses ? (FLOAT)INFINITY : extent.least;
    put_extent(nearer, &rest, view->of_cover);
    const INT which = nearer ? view->cover : (INT)index;
    const MASK first = rest.least < view->of_front.least, next = !first & (rest.least < view->of_second.least);
    const FLOAT last = first | next ? view->of_second.least : rest.least;
    view->others = last < view->others ? last : view->others;
    PUT_WHERE(first, view->second, view->front);
    put_extent(first, &view->of_second, view->of_front);
    PUT_WHERE(first, view->front, which);
    put_extent(first, &view->of_front, rest);
    PUT_WHERE(next, view->second, which);
    put_extent(next, &view->of_second, rest);
    PUT_WHERE(nearer, view->cover, (INT)index);
    put_extent(nearer, &view->of_cover, extent);
}

/* Where something is surely behind the cover, or is not there at all. */
static MASK behind_cover(const Sight view, const FLOAT least) {
    return (least > view.of_cover.most) | (least == INFINITY);
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
        fetch_ahead(scene, -1, end);
        for (int k = scene.lists.start[cell]; k < end; k++) {
            const int2 entry = scene.lists.entry[k];
            if (as_float(entry.y) > reach) break;
            fetch_entry(scene, -1, k + AHEAD);
            const Extent extent = extent_of(cells, outline_of(cells, quadric_at(scene.spheres, entry.x), scene.unit));
            if (!ANY((!extent.misses))) continue;
            see(&view, entry.x, extent);
            const FLOAT far = view.of_cover.most;
            reach = LARGEST_FLOAT(DEPTH_AT(far, a) * REACH_SLACK);
        }
    }
    return view;
}

/* What cells show: nothing but the cover; something before it; or two, one behind the other. */
typedef struct {
    MASK plain, mixed, pair;
} Kind;

static Kind kind_of_sight(const Sight view) {
    Kind kind;
    kind.plain = behind_cover(view, view.of_front.least);
    kind.mixed = !kind.plain & behind_cover(view, view.of_second.least);
    kind.pair = !kind.plain & !kind.mixed & behind_cover(view, view.others);
    return kind;
}

/* By how many surfaces are to be looked at. */
#define RANKS 5
static INT rank_of(const Sight view) {
    const Kind kind = kind_of_sight(view);
    const INT plain = view.cover < 0 ? (INT)0 : (INT)1;
    return kind.plain ? plain : (kind.mixed ? (INT)2 : (kind.pair ? (INT)3 : (INT)4));
}

/* What 8 packets of cells show, in memory, and room for one. */
typedef struct {
    int id[3][9 * W], covers[3][9 * W];
    float least[3][9 * W], most[3][9 * W], others[9 * W];
} Sights;

/* first: where it is put, of the packet's first cell. */
static void store_sight(Sights *to, const int first, const Sight view) {
    const Extent extent[3] = {view.of_cover, view.of_front, view.of_second};
    const INT id[3] = {view.cover, view.front, view.second};
    for (int k = 0; k < 3; k++) {
        STORE_LANES(id[k], to->id[k] + first);
        STORE_LANES(extent[k].covers, to->covers[k] + first);
        STORE_LANES(extent[k].least, to->least[k] + first);
        STORE_LANES(extent[k].most, to->most[k] + first);
    }
    STORE_LANES(view.others, to->others + first);
}

/* which: the cell of each lane. */
static Sight load_sight(const Sights *from, const int *which) {
    int id[3][W], covers[3][W];
    float least[3][W], most[3][W], others[W];
    for (int lane = 0; lane < W; lane++) {
        const int i = which[lane];
        for (int k = 0; k < 3; k++) {
            id[k][lane] = from->id[k][i];
            covers[k][lane] = from->covers[k][i];
            least[k][lane] = from->least[k][i];
            most[k][lane] = from->most[k][i];
        }
        others[lane] = from->others[i];
    }
    Extent extent[3];
    for (int k = 0; k < 3; k++) {
        extent[k].covers = LOAD_LANES(covers[k]);
        extent[k].misses = 0;
        extent[k].least = LOAD_LANES(least[k]);
        extent[k].most = LOAD_LANES(most[k]);
    }
    const Sight view = {LOAD_LANES(id[0]), LOAD_LANES(id[1]), LOAD_LANES(id[2]), extent[0],
                        extent[1],         extent[2],         LOAD_LANES(others)};
    return view;
}
#endif

#if defined(WITH_AVERAGE) && defined(WITH_TRIANGLES)
/* Meshes have crowd.cl for this. */
typedef struct {
    int nothing;
} Sight, Sights;
#define RANKS 1

static Sight sight_of(const Scene scene, const Cells cells, const int2 tile) {
    const Sight view = {0};
    return view;
}

static INT rank_of(const Sight view) {
    return 0;
}

static void store_sight(Sights *to, const int first, const Sight view) {
}

static Sight load_sight(const Sights *from, const int *which) {
    const Sight view = {0};
    return view;
}
#endif

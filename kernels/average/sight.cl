/* sight.cl: which surfaces a cell of the picture shows.
 */
#if defined(WITH_AVERAGE) && !defined(WITH_TRIANGLES)
/* What cells show. cover: the surface that surely covers all of the cell and whose furthest point there is nearest, -1 for the
 * background; front, second: of all others in the cell, those with the nearest points, -1 for none; others: how near the rest may
 * be. */
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
        FETCH_AHEAD(scene, scene.eye_filter, -1, end);
        for (int k = scene.lists.start[cell]; k < end; k++) {
            const int2 entry = scene.lists.entry[k];
            if (as_float(entry.y) > reach) break;
            FETCH_ENTRY(scene, scene.eye_filter, -1, k + AHEAD);
            const Extent extent = extent_of(cells, outline_of(cells, quadric_at(scene.spheres, entry.x), scene.unit));
            if (!ANY((!extent.misses))) continue;
            see(&view, entry.x, extent);
            const FLOAT far = view.of_cover.most;
            reach = LARGEST_FLOAT(DEPTH_AT(far, a) * REACH_SLACK);
        }
    }
    return view;
}
#endif

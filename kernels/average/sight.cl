/* sight.cl: which surfaces a cell of the picture shows.
 */
#if defined(WITH_AVERAGE) && !defined(WITH_TRIANGLES)
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

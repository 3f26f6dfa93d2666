/* sight.cl: which surfaces a cell of the picture shows.
 *
 * Of what has a texture, mirrors or is transparent, and of triangles, no mean is known here. Pixels that may show such
 * a surface have that of their samples.
 */
#ifdef WITH_AVERAGE
/* What cells show. cover: the surface that surely covers all of the cell and whose furthest point there is nearest, -1
 * for the background; front: of all others in the cell, that with the nearest point, -1 for none; others: how near the
 * rest may be. All these have means that are known here; odd: how near one may be that has not. */
typedef struct {
    INT cover, front;
    Extent of_cover, of_front;
    FLOAT others, odd;
} Sight;

static Sight empty_sight(void) {
    const Extent far = {0, 0, INFINITY, INFINITY};
    const Sight view = {-1, -1, far, far, INFINITY, INFINITY};
    return view;
}

static int sphere_is_odd(const Scene *scene, const int index) {
    if (!HAS(WITH_BOUNCES) & !HAS(WITH_TEXTURES)) return 0;
    const int material = scene->material_of[index];
    if (HAS(WITH_TEXTURES) && scene->texture_of[material] >= 0) return 1;
    return HAS(WITH_BOUNCES) && (scene->bounce[material].x > 0 || scene->bounce[material].y > 0);
}

static Extent sphere_extent(const Scene *scene, const Cells cells, const int index) {
    return extent_of(cells, outline_of(cells, quadric_at(scene->spheres, index), scene->unit));
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
    const MASK first = rest.least < view->of_front.least;
    const FLOAT last = first ? view->of_front.least : rest.least;
    view->others = last < view->others ? last : view->others;
    PUT_WHERE(first, view->front, which);
    put_extent(first, &view->of_front, rest);
    PUT_WHERE(nearer, view->cover, (INT)index);
    put_extent(nearer, &view->of_cover, extent);
}

/* Where something is surely behind the cover, or is not there at all. */
static MASK behind_cover(const Sight view, const FLOAT least) {
    return (least > view.of_cover.most) | (least == INFINITY);
}

/* tile: the cells' place in the picture, in units of TILE x TILE pixels. */
static Sight sight_of(const Scene *scene, const Cells cells, const int2 tile) {
    Sight view = empty_sight();
    float reach = INFINITY;
    const FLOAT a = most_of(cells.a);
    const Grid grid = scene->lists.grid[0];
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile), end = scene->lists.start[cell + 1];
        fetch_ahead(scene, -1, end);
        for (int k = scene->lists.start[cell]; k < end; k++) {
            const int2 entry = scene->lists.entry[k];
            if (as_float(entry.y) > reach) break;
            fetch_entry(scene, -1, k + AHEAD);
            const Extent extent = ASK_SHAPE(scene->spheres, entry.x, extent(scene, cells, entry.x));
            if (!ANY((!extent.misses))) continue;
            if (ASK_SHAPE(scene->spheres, entry.x, is_odd(scene, entry.x))) {
                view.odd = (!extent.misses & (extent.least < view.odd)) ? extent.least : view.odd;
            } else {
                see(&view, entry.x, extent);
                reach = LARGEST_FLOAT(DEPTH_AT(view.of_cover.most, a) * REACH_SLACK);
            }
        }
    }
    return view;
}

/* Where something is seen, or may be, of which no mean is known here. */
static MASK is_beyond(const Sight view) {
    return (view.odd <= view.of_cover.most) & (view.odd < INFINITY);
}

/* What cells show: nothing but the cover, or one surface before it. */
typedef struct {
    MASK plain, mixed;
} Kind;

static Kind kind_of_sight(const Sight view) {
    Kind kind;
    kind.plain = behind_cover(view, view.of_front.least);
    kind.mixed = !kind.plain & behind_cover(view, view.others);
    return kind;
}

/* By how many surfaces are to be looked at. */
#define RANKS 4
static INT rank_of(const Sight view) {
    const Kind kind = kind_of_sight(view);
    const INT plain = view.cover < 0 ? (INT)0 : (INT)1;
    return kind.plain ? plain : (kind.mixed ? (INT)2 : (INT)3);
}

/* What so many cells show, in memory, and room for one packet more. */
#define MOST_SEEN ((RUN > 8 ? RUN : 8) * W)
typedef struct {
    int id[2][MOST_SEEN + W], covers[2][MOST_SEEN + W];
    float least[2][MOST_SEEN + W], most[2][MOST_SEEN + W], others[MOST_SEEN + W];
} Sights;

/* first: where it is put, of the packet's first cell. */
static void store_sight(Sights *to, const int first, const Sight view) {
    const Extent extent[2] = {view.of_cover, view.of_front};
    const INT id[2] = {view.cover, view.front};
    for (int k = 0; k < 2; k++) {
        STORE_LANES(id[k], to->id[k] + first);
        STORE_LANES(extent[k].covers, to->covers[k] + first);
        STORE_LANES(extent[k].least, to->least[k] + first);
        STORE_LANES(extent[k].most, to->most[k] + first);
    }
    STORE_LANES(view.others, to->others + first);
}

/* which: the cell of each lane. */
static Sight load_sight(const Sights *from, const int *which) {
    Sight view = empty_sight();
    Extent *extent[2] = {&view.of_cover, &view.of_front};
    INT *id[2] = {&view.cover, &view.front};
    float others[W];
    for (int k = 0; k < 2; k++) {
        int ids[W], covers[W];
        float least[W], most[W];
        for (int lane = 0; lane < W; lane++) {
            ids[lane] = from->id[k][which[lane]];
            covers[lane] = from->covers[k][which[lane]];
            least[lane] = from->least[k][which[lane]];
            most[lane] = from->most[k][which[lane]];
        }
        *id[k] = LOAD_LANES(ids);
        extent[k]->covers = LOAD_LANES(covers);
        extent[k]->least = LOAD_LANES(least);
        extent[k]->most = LOAD_LANES(most);
    }
    for (int lane = 0; lane < W; lane++) others[lane] = from->others[which[lane]];
    view.others = LOAD_LANES(others);
    return view;
}
#endif

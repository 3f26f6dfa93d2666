/* stopped.cl: whether anything stands between a point and a light. */

/* In which lanes the own surface is not known to be a triangle on which no shadow of a light can fall: see
 * find/unstoppable.cl. */
static MASK may_be_shaded(const Scene *scene, const int light, const INT own) {
    const INT number = own - FIRST_TRIANGLE(scene->geometry), word = number >= 0 ? number >> 5 : (INT)-1;
    const INT bits = numbers_at(scene->unstoppable + (long)light * ((scene->triangles + 31) / 32), word);
    return (((word >= 0 ? bits : (INT)0) >> (number & 31)) & 1) - 1;
}

/* Whether anything stands between a point and a light. */

/* In which lanes anything can stand between the light and the own surface at all. For the first `proved` lights,
 * unstoppable.cl has a bit for each triangle. Else the host has a bit for each sphere if there are few; for many, and
 * for triangles, all bits are set. */
static MASK may_be_stopped(const Scene *scene, const int number, const INT own) {
    if (HAS(WITH_TRIANGLES) && number < scene->proved) return may_be_shaded(scene, number, own);
    return -(((INT)scene->light_buffer[number].z >> (own & 31)) & 1);
}

/* The cell of level 0 of a grid that each lane's shadow ray goes through. here: the lanes that meet the grid's
 * window. */
typedef struct {
    MASK here;
    INT column, row;
} Cell;

static Cell cell_on(const Grid grid, const ShadowRay ray, const MASK lit) {
    Cell cell = {lit, 0, 0};
    if (grid.cells.x == 1 && grid.cells.y == 1) return cell;
    FLOAT x, y, ahead = 1;
    if (grid.flags.x && !ray.touches) {
        ahead = -dot_float(ray.w32, grid.near_ahead);
        cell.here = cell.here & (ahead > 0);
        if (!ANY(cell.here)) return cell;
        x = -dot_float(ray.w32, grid.near_right);
        y = -dot_float(ray.w32, grid.near_up);
    } else {
        x = TO_FLOAT(DOT(ray.from, grid.right) + grid.right.w);
        y = TO_FLOAT(DOT(ray.from, grid.up) + grid.up.w);
        if (ray.at_point) {
            ahead = TO_FLOAT(DOT(ray.from, grid.ahead));
            cell.here = cell.here & (ahead > 0);
        }
    }
    if (ray.at_point) {
        const FLOAT over = 1 / ahead;
        x *= over;
        y *= over;
    }
    cell.here = cell.here & (magnitude(x) <= grid.window.x) & (magnitude(y) <= grid.window.y);
    if (!ANY(cell.here)) return cell;
    /* x and y count from the window's middle. Lanes elsewhere get 0, as not every float can be converted to int. */
    const INT column = TO_INT(cell.here ? (x + grid.window.x) * grid.window.z : (FLOAT)0);
    const INT row = TO_INT(cell.here ? (y + grid.window.y) * grid.window.w : (FLOAT)0);
    const INT last_column = grid.cells.x - 1, last_row = grid.cells.y - 1;
    cell.column = column < last_column ? column : last_column;
    cell.row = row < last_row ? row : last_row;
    return cell;
}

#ifdef WITH_PLANES
/* The way from P to a light. */
static Leaving way_to_light(const Scene *scene, const ShadowRay *ray, const Start *start) {
    Start P = *start;
    place_start(scene->geometry, &P);
    Leaving way = way_to_lamp(scene->lamp[ray->number], ray->at_point, P);
    way.inner = P.side < 0;
    way.d = ray->w;
    return way;
}

/* The lanes of `lit` in which a cap stands between P and a light, where P is on a surface that is not clipped. */
static __attribute__((noinline)) MASK stopped_by_caps(const Scene *scene, const ShadowRay *ray, const Start *start,
                                                      const MASK lit) {
    const MASK asked = lit & are_unclipped(scene, ray->own);
    if (!ANY(asked)) return 0;
    const Leaving way = way_to_light(scene, ray, start);
    Entry entry = entry_of(scene->geometry, way);
    entry.here = entry.here & asked;
    if (ray->at_point) entry.here = entry.here & TO_MASK(entry.t < 1);
    return ANY(entry.here) ? closed_of_all(scene, &way, &entry).index >= 0 : (MASK)0;
}

/* The lanes of `stops`, in which a surface stands between P and a light, that it stops within the region. Rays that end
 * in the region are in it from where they enter it. */
static __attribute__((noinline)) MASK stops_in_region(const Scene *scene, const ShadowRay *ray, const Start *start,
                                                      const int index, const MASK stops) {
    const Geometry geometry = scene->geometry;
    if (scene->solid_of[index] < 0) return stops;
    const real4 L = scene->lamp[ray->number];
    const Real3 along = {L.x, L.y, L.z};
    const Leaving way = way_to_light(scene, ray, start);
    MASK open = are_unclipped(scene, ray->own);
    for (int plane = 0; plane < geometry.planes; plane++) {
        const REAL one = ray->at_point ? (REAL)1 : (REAL)0;
        const real4 S = geometry.clip[2 * plane], m = geometry.clip[2 * plane + 1];
        const Real3 to = ray->at_point ? difference(along, (Real3){S.x, S.y, S.z}) : along;
        open = open | TO_MASK(DOT(m, to) <= HEIGHT_ERROR * size_of_normal(m) * size_of(to) * one);
    }
    open = open & stops;
    if (!ANY(open)) return stops;
    Encounter at = {INFINITY};
    const INT asked = open ? (INT)index : (INT)-1;
    EACH_SHAPE(geometry, asked, encounter(scene, way, asked, &at));
    /* The ray from the light meets the triangle. At an edge, the ray to the light may meet the neighbour instead, so
     * only t is used. */
    const REAL_MASK known = TO_REAL_MASK(open);
    OF_TRIANGLES(if (IS_TRIANGLE(geometry, index)) at.t = crossing_of(geometry, way, asked, known, known).t;)
    const MASK met = open & TO_MASK(at.t < INFINITY);
    return stops & (!met | in_region(geometry, &way, asked, at.t, met, LIGHT_ERROR));
}
#else
#define stops_in_region(scene, ray, start, index, stops) stops
#define stopped_by_caps(scene, ray, start, lit) 0
#endif

/* The lanes of `lit` that stay lit after the list of one cell, which the rays of the lanes `in` go through. The list
 * is in depth order, by the surfaces' points nearest to the light. A surface no point of which is nearer to the light
 * than P stops nothing, so there the list ends for a lane. */
static MASK lit_after_list(const Scene *scene, const ShadowRay ray, const Start start, const int cell, const MASK in,
                           MASK lit, Work *work) {
    const int first = scene->lists.start[cell], end = scene->lists.start[cell + 1];
    if (ANY_FETCHED) fetch_ahead(scene, ray.number, first);
    for (int k = first; k < end; k++) {
        const int2 entry = scene->lists.entry[k];
        const MASK may = in & lit & (ray.depth > as_float(entry.y));
        if (!ANY(may)) break;
        if (ANY_FETCHED) fetch_entry(scene, ray.number, k + AHEAD);
        const MASK stops = ASK_SHAPE(scene->geometry, entry.x, shadow(scene, ray, start, entry.x, may, work));
        lit = lit & !(ANY(stops) ? stops_in_region(scene, &ray, &start, entry.x, stops) : stops);
    }
    return lit;
}

/* The same after the lists of one grid, from the coarsest level on. */
static MASK lit_after_grid(const Scene *scene, const Grid grid, const ShadowRay ray, const Start start, MASK lit,
                           Work *work) {
    const Cell cell = cell_on(grid, ray, lit);
    if (!ANY(cell.here)) return lit;
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const INT number = level.first + (cell.row >> level.level) * level.columns + (cell.column >> level.level);
        INT pending = cell.here & lit ? number : (INT)-1;
        fetch_lists(scene, ray.number, pending);
        for (int c = LARGEST(pending); c >= 0; c = LARGEST(pending)) {
            const MASK in = pending == c;
            pending = in ? (INT)-1 : pending;
            lit = lit_after_list(scene, ray, start, c, in, lit, work);
            if (!ANY(lit)) return lit;
        }
    }
    return lit;
}

/* The lanes of `lit` that stay lit: those without a surface between the point, where the rays start, and the light.
 *
 * The own surface needs no test. It is convex, so a ray that leaves it outwards never meets it again; a ray that leaves
 * it inwards is stopped by it if and only if the light is outside of it.
 */
static MASK lit_after_all(const Scene *scene, ShadowRay ray, const Start start, MASK lit, Work *work) {
    find_lists(scene, start, lit, &ray);
    const int4 grids = scene->light_buffer[ray.number];
    for (int g = grids.x; g < grids.x + grids.y; g++) {
        lit = lit_after_grid(scene, scene->lists.grid[g], ray, start, lit, work);
        if (!ANY(lit)) return lit;
    }
    return lit;
}

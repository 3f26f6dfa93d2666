/* cells.cl: which surfaces a ray from a fixed point can meet at all. cltrace/plan/accel/cells.py says what a grid is,
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

/* Fetches what an entry of a list will ask for: filter constants, and the sphere itself. With many spheres those are far
 * apart in memory, and most of the time went into waiting for them. */
#if defined(WITH_PREFETCH) && defined(FETCH)
static void fetch_entry(const Spheres spheres, const Lists lists, __global const float4 *filter,
                        __global const float4 *facets, const int k) {
    const int index = lists.entry[k].x;
#ifdef WITH_TRIANGLES
    if (index >= spheres.first) {
        FETCH(facets, 3 * (long)(index - spheres.first));
        FETCH(facets, 3 * (long)(index - spheres.first) + 2);
        FETCH(spheres.face, index - spheres.first);
        return;
    }
#endif
    FETCH(filter, index);
    FETCH(spheres.center_radius, index);
    FETCH(spheres.power, index);
}

/* The same for the first entries of a list. */
static void fetch_ahead(const Spheres spheres, const Lists lists, __global const float4 *filter,
                        __global const float4 *facets, const int first) {
    for (int k = first; k < first + AHEAD; k++) fetch_entry(spheres, lists, filter, facets, k);
}
#ifdef WITH_TRIANGLES
#define FACETS(scene, filter, light)                                                                                  \
    (light) < 0 ? (scene).facet : (scene).light_facet + 3 * (long)(light) * (scene).triangles
#else
#define FACETS(scene, filter, light) filter
#endif
#define FETCH_AHEAD(scene, filter, light, first)                                                                      \
    fetch_ahead((scene).spheres, (scene).lists, filter, FACETS(scene, filter, light), first)
#define FETCH_ENTRY(scene, filter, light, k)                                                                          \
    fetch_entry((scene).spheres, (scene).lists, filter, FACETS(scene, filter, light), k)

#if defined(WITH_BOUNCES) || !defined(ONLY_TRIANGLES)
/* The same for the lists of all lanes' cells in a light's buffer. Points of different surfaces have lists that are far
 * apart, and what has to be waited for is there in three steps: where a list begins, its first entry, that sphere's
 * filter. Few of the cells are different ones. */
static void fetch_lists(const Scene scene, const int light, INT cell) {
    int each[W], count = 0;
    for (int c = LARGEST(cell); c >= 0; c = LARGEST(cell)) {
        FETCH(scene.lists.start, c);
        each[count++] = c;
        cell = cell == c ? (INT)-1 : cell;
    }
    for (int k = 0; k < count; k++) FETCH(scene.lists.entry, scene.lists.start[each[k]]);
    for (int k = 0; k < count; k++) {
        const int index = scene.lists.entry[scene.lists.start[each[k]]].x;
#ifdef WITH_TRIANGLES
        if (index >= scene.spheres.first) {
            FETCH(scene.light_facet, 3 * ((long)light * scene.triangles + (index - scene.spheres.first)));
            continue;
        }
#endif
        FETCH(scene.light_filter, (long)light * scene.count + index);
    }
}
#define FETCH_LISTS(scene, light, cell) fetch_lists(scene, light, cell)
#endif

#ifdef WITH_SHADING
/* The same for the materials of surfaces, which shading waits for where each has its own: which one an entry has, and of a
 * surface that some lanes hit, that itself. */
#define FETCH_MATERIAL(scene, index, hit)                                                                             \
    if (ANY(TO_MASK(hit))) FETCH((scene).material, (scene).material_of[index])
#define FETCH_MATERIAL_OF(scene, k) FETCH((scene).material_of, (scene).lists.entry[k].x)
#endif

#ifdef WITH_BOUNCES
/* The same for the surfaces that each of the lanes has met. */
static void fetch_surfaces(const Scene scene, const INT index) {
    int each[W];
    STORE_LANES(index, each);
    for (int lane = 0; lane < W; lane++) {
        if (each[lane] < 0) continue;
#ifdef WITH_TRIANGLES
        if (each[lane] >= scene.spheres.first) {
            FETCH(scene.spheres.face, each[lane] - scene.spheres.first);
            FETCH(scene.normal_face, each[lane] - scene.spheres.first);
            FETCH(scene.material_of, each[lane]);
            continue;
        }
#endif
        FETCH(scene.spheres.place, each[lane]);
        FETCH(scene.spheres.center_radius, each[lane]);
        FETCH(scene.spheres.power, each[lane]);
        FETCH(scene.material_of, each[lane]);
    }
    for (int lane = 0; lane < W; lane++) {
        if (each[lane] < 0) continue;
        FETCH(scene.material, scene.material_of[each[lane]]);
        FETCH(scene.bounce, scene.material_of[each[lane]]);
    }
}
#define FETCH_SURFACES(scene, index) fetch_surfaces(scene, index)
#endif
#endif
#ifndef FETCH_AHEAD
#define FETCH_AHEAD(scene, filter, light, first)
#define FETCH_ENTRY(scene, filter, light, k)
#endif
#ifndef FETCH_LISTS
#define FETCH_LISTS(scene, light, cell)
#endif
#ifndef FETCH_MATERIAL
#define FETCH_MATERIAL(scene, index, hit)
#define FETCH_MATERIAL_OF(scene, k)
#endif
#ifndef FETCH_SURFACES
#define FETCH_SURFACES(scene, index)
#endif

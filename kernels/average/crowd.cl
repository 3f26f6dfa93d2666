/* crowd.cl: what cells show where there are meshes: any number of surfaces, up to CROWD of them.
 *
 * A cell that meets no rim of a mesh is either wholly covered by it or not at all: a triangle goes on beyond each edge, on the other
 * side of it. So one place that it surely covers says it of all the cell, however many triangles there are. Surfaces that follow
 * each other in depth without a gap are a group: of a mesh all triangles that go on in each other are in one group.
 */
#ifdef WITH_SHEETS
#define CROWD 24
#define GROUPS 3

/* Surfaces that a packet of cells may show. near, far: where along the rays they are, near is INFINITY where they are not. */
typedef struct {
    int count, index[CROWD];
    FLOAT near[CROWD], far[CROWD];
    Share share[CROWD];                     /* of the cell, whether or not something is before it */
    MASK covers[CROWD], rim[CROWD], sure[CROWD]; /* whether it covers the cell, whether a rim is in it, and whether it is there at all */
    FLOAT rest;                             /* what there was no room for is no nearer */
} Crowd;

static void join_crowd(const Scene scene, const Cells cells, const int index, Crowd *crowd) {
    Extent extent;
    Share share;
    MASK rim = 0, sure = 0;
    if (index >= scene.spheres.first) {
        const int number = index - scene.spheres.first;
        __global const float4 *facet = scene.facet + 3 * (long)number;
        const Model3 v = directions_of(cells, scene.unit);
        const Edges edges = edges_along(facet, v, 1);
        extent = extent_of_triangle(edges, plane_along(facet, v));
        if (!ANY((!extent.misses))) return;
        Share sides[3];
        for (int k = 0; k < 3; k++) sides[k] = share_where_positive(edges.edge[k]);
        share = share_within(sides, 3);
        share.least = extent.covers ? (FLOAT)1 : share.least;
        rim = rim_within(scene, 0, number, edges);
        sure = surely_within(edges) & (extent.most < INFINITY);
#ifdef WITH_PARALLEL_RAYS
        /* Some of it may be behind the plane where rays start. */
        sure = sure & (extent.least > 0);
        share.least = extent.least > 0 ? share.least : (FLOAT)0;
        rim = rim | !(extent.least > 0);
#endif
    } else {
#ifdef ONLY_TRIANGLES
        return;
#else
        const Quadric sphere = quadric_at(scene.spheres, index);
        const Outline outline = outline_of(cells, sphere, scene.unit);
        extent = extent_of(cells, outline);
        if (!ANY((!extent.misses))) return;
        share = share_of_disc(cells, sphere, outline);
        share.least = extent.covers ? (FLOAT)1 : share.least;
#endif
    }
    const FLOAT near = extent.misses ? (FLOAT)INFINITY : extent.least;
    if (crowd->count == CROWD) {
        crowd->rest = near < crowd->rest ? near : crowd->rest;
        return;
    }
    const int k = crowd->count++;
    crowd->index[k] = index;
    crowd->near[k] = near;
    crowd->far[k] = extent.most;
    crowd->covers[k] = extent.covers & !extent.misses;
    crowd->rim[k] = rim;
    crowd->sure[k] = sure & !extent.misses;
    crowd->share[k] = share;
}

/* tile: as in sight_of(). */
static void gather_crowd(const Scene scene, const Cells cells, const int2 tile, Crowd *crowd) {
    crowd->count = 0;
    crowd->rest = INFINITY;
    FLOAT far = INFINITY;
    float reach = INFINITY;
    const FLOAT a = most_of(cells.a);
    const Grid grid = scene.lists.grid[0];
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile), end = scene.lists.start[cell + 1];
        for (int k = scene.lists.start[cell]; k < end; k++) {
            const int2 entry = scene.lists.entry[k];
            if (as_float(entry.y) > reach) break;
            const int before = crowd->count;
            join_crowd(scene, cells, entry.x, crowd);
            if (crowd->count == before) continue;
            far = (crowd->covers[before] & (crowd->far[before] < far)) ? crowd->far[before] : far;
            reach = LARGEST_FLOAT(DEPTH_AT(far, a) * REACH_SLACK);
        }
    }
}

/* Behind what nothing is seen; INFINITY where the background may be. single: whether what is seen is one sheet of a mesh. */
typedef struct {
    FLOAT far;
    MASK single;
} Depth;

/* first_triangle: the index of the first surface that is one. */
static Depth depth_of(const Crowd *crowd, const int first_triangle) {
    Depth depth = {INFINITY, 0};
    for (int k = 0; k < crowd->count; k++) depth.far = (crowd->covers[k] & (crowd->far[k] < depth.far)) ? crowd->far[k] : depth.far;
    FLOAT begin = -1;
    for (int group = 0; group < GROUPS; group++) {
        FLOAT first = INFINITY, end = INFINITY, previous;
        for (int k = 0; k < crowd->count; k++) first = ((crowd->near[k] > begin) & (crowd->near[k] < first)) ? crowd->near[k] : first;
        end = first;
        do {
            previous = end;
            for (int k = 0; k < crowd->count; k++) {
                const MASK in = (crowd->near[k] > begin) & (crowd->near[k] <= end) & (crowd->near[k] < INFINITY);
                end = (in & (crowd->far[k] > end)) ? crowd->far[k] : end;
            }
        } while (ANY(end > previous));
        MASK rim = end >= crowd->rest, sure = 0;
        FLOAT shares = 0;
        for (int k = 0; k < crowd->count; k++) {
            const MASK in = (crowd->near[k] > begin) & (crowd->near[k] <= end) & (crowd->near[k] < INFINITY);
            rim = rim | (in & crowd->rim[k]);
            sure = sure | (in & crowd->sure[k]);
            shares += in ? (crowd->index[k] >= first_triangle ? crowd->share[k].most : (FLOAT)2) : (FLOAT)0;
        }
        const MASK closed = sure & !rim & (end < INFINITY);
        if (group == 0) depth.single = closed & (shares < 1.99f);
        depth.far = (closed & (end < depth.far)) ? end : depth.far;
        begin = end < INFINITY ? end : begin;
        begin = (closed | (end == INFINITY)) ? (FLOAT)INFINITY : begin;
        if (!ANY(begin < INFINITY)) break;
    }
    return depth;
}

/* Of all places of a cell, in which of them each surface is seen; none where `near` is behind the depth. */
static MASK seen_in(const Crowd *crowd, const Depth depth, const int k) {
    return (crowd->near[k] <= depth.far) & (crowd->near[k] < INFINITY);
}

static Tint tint_of_member(const Frame frame, const Scene scene, const Cells cells, const int index, const MASK seen, Work *work) {
    Area patch;
    if (index >= scene.spheres.first) {
        patch = patch_of_triangle(frame, scene, cells, index - scene.spheres.first, seen ? (INT)index : (INT)-1);
    } else {
#ifndef ONLY_TRIANGLES
        const Quadric sphere = quadric_at(scene.spheres, index);
        patch = patch_of_sphere(cells, sphere, outline_of(cells, sphere, scene.unit), scene.unit);
        patch.id = seen ? patch.id : (INT)-1;
#ifdef WITH_TEXTURES
        map_patch(frame, &patch);
#endif
#endif
    }
    Window all;
    open_window(&all);
    return tint_of(scene, patch, &all, work);
}

/* What the crowd's surfaces, and the background, make of the colour: sum over surfaces of weight times colour, where all weights
 * are 1 together and each is within its share. A surface has at least the share that it would have alone if nothing can be before
 * it: it is alone in front, or part of the only sheet; and at least what the others cannot have.
 *
 * Returns the lanes in which the mean is known; estimated: those in which something seen has no proof; edges: those that show
 * more than one surface, or may do so. */
static MASK crowd_tint(const Frame frame, const Scene scene, const Cells cells, const int2 tile, Tint *out, FLOAT *coverage, MASK *estimated,
                       MASK *edges, Work *work) {
    Crowd crowd;
    gather_crowd(scene, cells, tile, &crowd);
    const Depth depth = depth_of(&crowd, scene.spheres.first);
    const MASK open_sky = !(depth.far < INFINITY);
    MASK known = crowd.rest > depth.far;
    known = known | (!(crowd.rest < INFINITY));
    *estimated = *edges = 0;
    FLOAT all = open_sky ? (FLOAT)1 : (FLOAT)0, sum = 0, low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {0, 0, 0};
    for (int k = 0; k < crowd.count; k++) {
        const MASK seen = seen_in(&crowd, depth, k);
        if (!ANY(seen)) continue;
        MASK before = 0;
        for (int j = 0; j < crowd.count; j++)
            if (j != k) before = before | (seen_in(&crowd, depth, j) & (crowd.near[j] <= crowd.far[k]));
        crowd.share[k].least = (seen & (!before | depth.single)) ? crowd.share[k].least : (FLOAT)0;
        crowd.share[k].most = seen ? crowd.share[k].most : (FLOAT)0;
        all += crowd.share[k].most;
        *estimated = *estimated | beyond_proof(scene, seen ? (INT)crowd.index[k] : (INT)-1);
        *edges = *edges | (seen & !crowd.covers[k]) | before;
    }
    for (int c = 0; c < 3; c++) out->v[c] = out->e[c] = 0;
    const float background[3] = {frame.background.x, frame.background.y, frame.background.z};
    Share sky = {0, open_sky ? (FLOAT)1 : (FLOAT)0};
    const MASK wanted = known & !*estimated;
    MASK any = 0; /* where surfaces may be seen */
    for (int k = -1; k < crowd.count; k++) {
        const MASK seen = (k < 0 ? open_sky : seen_in(&crowd, depth, k)) & wanted;
        if (!ANY(seen)) continue;
        if (k >= 0) any = any | seen;
        Share share = sky;
        if (k >= 0) share = crowd.share[k];
        const FLOAT others = all - share.most, left = 1 - others;
        share.least = left > share.least ? left - 16 * ROUNDING : share.least;
        share.least = (seen & (share.least > 0)) ? share.least : (FLOAT)0;
        Tint tint;
        if (k < 0) {
            sky.least = share.least;
            for (int c = 0; c < 3; c++) {
                tint.v[c] = tint.least[c] = tint.most[c] = background[c] < 1 ? background[c] : 1;
                tint.e[c] = 0;
            }
        } else {
            tint = tint_of_member(frame, scene, cells, crowd.index[k], seen, work);
            clamp_tint(&tint, 1);
        }
        sum += share.least;
        for (int c = 0; c < 3; c++) {
            /* Of what surely is all of the cell the mean is known; else a part of it may be anything within the range. */
            const MASK whole = share.least >= 1 - 32 * ROUNDING;
            const FLOAT bottom = whole ? tint.v[c] - tint.e[c] : tint.least[c], top = whole ? tint.v[c] + tint.e[c] : tint.most[c];
            out->v[c] += seen ? share.least * bottom : (FLOAT)0;
            out->e[c] += seen ? share.least * top : (FLOAT)0;
            low[c] = (seen & !(tint.least[c] > low[c])) ? tint.least[c] : low[c];
            high[c] = (seen & !(tint.most[c] < high[c])) ? tint.most[c] : high[c];
        }
    }
    const FLOAT rest = sum < 1 ? 1 - sum : (FLOAT)0;
    for (int c = 0; c < 3; c++) {
        const FLOAT bottom = out->v[c] + rest * low[c], top = out->e[c] + rest * high[c];
        const MASK sky_alone = wanted & !any;
        out->v[c] = sky_alone ? (background[c] < 1 ? (FLOAT)background[c] : (FLOAT)1) : 0.5f * (bottom + top);
        out->e[c] = sky_alone ? (FLOAT)0 : 0.5f * (top - bottom) + 64 * ROUNDING;
        out->least[c] = low[c];
        out->most[c] = high[c];
        known = known & (out->e[c] < 1);
    }
    /* The sky has no more than what surfaces surely leave to it. */
    const FLOAT least = open_sky ? sum - sky.least : (FLOAT)1, most = 1 - sky.least;
    *coverage = (wanted & !any) ? (FLOAT)0 : 0.5f * (least + most);
#ifdef OUT_COVERAGE
    const FLOAT off = (wanted & !any) ? (FLOAT)0 : 0.5f * (most - least);
    out->e[0] = off > out->e[0] ? off : out->e[0];
    known = known & (off < 1);
#endif
    return known;
}
#endif

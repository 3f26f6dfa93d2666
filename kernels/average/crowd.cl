/* crowd.cl: what cells show where there are meshes: any number of surfaces, up to CROWD of them.
 *
 * A cell that meets no rim of a mesh is either wholly covered by it or not at all: a triangle goes on beyond each edge,
 * on the other side of it. So one place that it surely covers says it of all the cell, however many triangles there
 * are. Surfaces that follow each other in depth without a gap are a group: of a mesh all triangles that go on in each
 * other are in one group.
 */
#ifdef WITH_SHEETS
#define CROWD 24
#define GROUPS 3

/* Surfaces that a packet of cells may show. near, far: where along the rays they are, near is INFINITY where they are
 * not. */
typedef struct {
    int count, index[CROWD];
    FLOAT near[CROWD], far[CROWD];
    Share share[CROWD]; /* of the cell, whether or not something is before it */
    MASK covers[CROWD], rim[CROWD],
        sure[CROWD]; /* whether it covers the cell, whether a rim is in it, and whether it is there at all */
    /* It is where all lines are positive that cut the cell; vague: but for these lanes, in which that is not known. */
    Model line[CROWD][3], depth[CROWD]; /* depth: a plane that is larger where a surface is nearer, or not known */
    MASK cut[CROWD][3], vague[CROWD];
    FLOAT rest; /* what there was no room for is no nearer */
} Crowd;

/* may: the lanes in which it may be before what is known to cover the cell. */
static void join_crowd(const Scene scene, const Cells cells, const int index, const MASK may, Crowd *crowd) {
    Extent extent;
    Share share;
    MASK rim = 0, sure = 0, vague = 0;
    Edges edges;
    Model depth = constant_model(0);
    depth.r = INFINITY;
    if (index >= FIRST_TRIANGLE(scene.spheres)) {
        const int number = index - FIRST_TRIANGLE(scene.spheres);
        __global const float4 *facet = scene.facet + 3 * (long)number;
        const Model3 v = directions_of(cells, scene.unit);
        edges = edges_along(facet, v, 1);
        depth = plane_along(facet, v);
        extent = extent_of_triangle(edges, depth);
        extent.misses = extent.misses | !may;
        if (!ANY((!extent.misses))) return;
        Share sides[3];
        for (int k = 0; k < 3; k++) sides[k] = share_where_positive(edges.edge[k]);
        share = share_within(sides, 3);
        share.least = extent.covers ? (FLOAT)1 : share.least;
        rim = rim_within(scene, 0, number, edges);
        sure = surely_within(edges) & (extent.most < INFINITY);
#ifdef WITH_PARALLEL_RAYS
        /* Some of it may be behind the plane where rays start. */
        depth = scaled(depth, -1);
        vague = !(extent.least > 0);
        sure = sure & !vague;
        share.least = vague ? (FLOAT)0 : share.least;
        rim = rim | vague;
#endif
    } else {
#ifndef WITH_SPHERES
        return;
#else
        const Quadric sphere = quadric_at(scene.spheres, index);
        const Outline outline = outline_of(cells, sphere, scene.unit);
        extent = extent_of(cells, outline);
        extent.misses = extent.misses | !may;
        if (!ANY((!extent.misses))) return;
        share = share_of_disc(cells, sphere, outline);
        share.least = extent.covers ? (FLOAT)1 : share.least;
        edges.edge[0] = outline.D;
        edges.edge[1] = edges.edge[2] = constant_model(1);
        const MASK straight = (outline.c > 0) & (least_of(outline.b) > 0) &
                              (outline.D.r < fabs(outline.D.x) + fabs(outline.D.y));
        vague = !extent.covers & !straight;
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
    crowd->depth[k] = depth;
    crowd->vague[k] = vague;
    for (int e = 0; e < 3; e++) {
        crowd->line[k][e] = edges.edge[e];
        crowd->cut[k][e] = !extent.covers & !vague & !(least_of(edges.edge[e]) > 0);
    }
}

/* tile: as in sight_of(). */
static void gather_crowd(const Scene scene, const Cells cells, const int2 tile, Crowd *crowd) {
    crowd->count = 0;
    crowd->rest = INFINITY;
    /* Of each lane its own, so that what a cell shows does not depend on those beside it. */
    FLOAT far = INFINITY, reach = INFINITY;
    const FLOAT a = most_of(cells.a);
    const Grid grid = scene.lists.grid[0];
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile), end = scene.lists.start[cell + 1];
        for (int k = scene.lists.start[cell]; k < end; k++) {
            const int2 entry = scene.lists.entry[k];
            const MASK may = !((FLOAT)as_float(entry.y) > reach);
            if (!ANY(may)) break;
            const int before = crowd->count;
            join_crowd(scene, cells, entry.x, may, crowd);
            if (crowd->count == before) continue;
            far = (crowd->covers[before] & (crowd->far[before] < far)) ? crowd->far[before] : far;
            reach = DEPTH_AT(far, a) * REACH_SLACK;
        }
    }
}

/* Behind what nothing is seen; INFINITY where the background may be. single: whether what is seen is one sheet of a
 * mesh. */
typedef struct {
    FLOAT far;
    MASK single;
} Depth;

/* first_triangle: the index of the first surface that is one. */
static Depth depth_of(const Crowd *crowd, const int first_triangle) {
    Depth depth = {INFINITY, 0};
    for (int k = 0; k < crowd->count; k++)
        depth.far = (crowd->covers[k] & (crowd->far[k] < depth.far)) ? crowd->far[k] : depth.far;
    FLOAT begin = -1;
    for (int group = 0; group < GROUPS; group++) {
        FLOAT first = INFINITY, end = INFINITY, previous;
        for (int k = 0; k < crowd->count; k++)
            first = ((crowd->near[k] > begin) & (crowd->near[k] < first)) ? crowd->near[k] : first;
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
#endif

/* touches.cl: which pixels a surface may be seen in, from any place of them, in float32. A surface that is only near a
 * pixel may be named, too, but none that is in it is missed. */
#ifdef WITH_SAMPLES
/* Half of a pixel's width and height, and of its diagonal, where float32 knows rays: on the image plane z = -1, or of
 * parallel rays, in the float buffers' unit. */
typedef struct {
    float x, y, diagonal;
} Margins;

static Margins margins_of(const Frame frame, const Scene *scene) {
    const real unit = HAS(WITH_PARALLEL_RAYS) ? scene->unit : (real)1;
    const float x = (float)(frame.pixel.x * unit), y = (float)(frame.pixel.y * unit);
    const Margins margins = {x, y, sqrt(x * x + y * y) * (1 + 0x1p-20f)};
    return margins;
}

/* The middle rays of pixels, and of what these show the surface's number in the scene file, and t at the corners:
 * within near .. far, in the float buffers' unit. doubtful: where colours alone tell that the corners are not enough.
 */
typedef struct {
    Ray ray;
    EyeLine line;
    Margins margins;
    INT object;
    FLOAT near, far;
    MASK doubtful;
} Outlook;

/* Which of the pixels a sphere may be seen in.
 *
 * Let w be the middle's ray, w + e another one of the pixel, and e no longer than the diagonal h. If that meets the
 * sphere from outside, it does so first at s (w + e), within r of the centre and no further away than where tangents
 * touch the sphere, L. Then s <= L, as rays are no shorter than 1, and s w is within r + L h of the centre. So the line
 * along w meets a sphere that is so large, which small_sphere_may_meet() decides. The radius of an ellipsoid's sphere
 * is in its filter constant, and L is less than the way to its centre. Parallel rays are no further than h from each
 * other, and places on their plane are rounded by 2^-24 of 1 at most, twice each. */
static MASK sphere_is_near(const Scene *scene, const Outlook view, const int index) {
    const float4 s = scene->eye_filter[index];
    const FLOAT x = view.line.x, y = view.line.y;
    const float h = view.margins.diagonal * (1 + 0x1p-20f);
    if (HAS(WITH_PARALLEL_RAYS)) {
        const float r = (sqrt(s.z) + h) * (1 + 0x1p-20f) + 0x1p-21f;
        return FMA(s.x - x, s.x - x, (s.y - y) * (s.y - y)) <= r * r;
    }
    const int stretched = HAS(WITH_ELLIPSOIDS) && scene->spheres.map_of[index];
    const real unit = scene->unit;
    const float square = (s.x * s.x + s.y * s.y) + s.z * s.z;
    const float power = stretched ? square : (float)(scene->spheres.power[index].x * unit * unit);
    const float r = stretched ? sqrt(square - s.w) : (float)(scene->spheres.center_radius[index].w * unit);
    if (power <= 0) return ALL_LANES;
    const Float3 w = {x, y, -1};
    return small_sphere_may_meet(w, view.line.a, s, r + sqrt(power) * h);
}

/* How far a sphere is at most that covers all of a pixel, as lists count; INFINITY where it does not.
 *
 * With d how far the line along w is from the centre, the line along w + e is no further than d + |C| h. So it meets
 * the sphere where that is less than r, and from outside that is before the tangents' points. Rounding moves |w x s| by
 * less than 2^-20 |s|_1 |w|, see small_sphere_may_meet(). */
static FLOAT sphere_covers(const Scene *scene, const Outlook view, const int index) {
    if (HAS(WITH_ELLIPSOIDS) && scene->spheres.map_of[index]) return INFINITY;
    const float4 s = scene->eye_filter[index];
    const FLOAT x = view.line.x, y = view.line.y;
    const float h = view.margins.diagonal * (1 + 0x1p-20f);
    const real unit = scene->unit;
    const float own = (float)(scene->spheres.center_radius[index].w * unit);
    if (HAS(WITH_PARALLEL_RAYS)) {
        const float far = (float)(-scene->spheres.center_radius[index].z * unit),
                    R = own * (1 - 0x1p-19f) - h - 0x1p-20f;
        if (R <= 0 || far <= 2 * own) return INFINITY;
        const MASK covered = FMA(s.x - x, s.x - x, (s.y - y) * (s.y - y)) < R * R;
        return covered ? (FLOAT)(far * REACH_SLACK) : (FLOAT)INFINITY;
    }
    const float square = (s.x * s.x + s.y * s.y) + s.z * s.z,
                power = (float)(scene->spheres.power[index].x * unit * unit);
    const float size = sqrt(square) * (1 + 0x1p-20f);
    const float R = (1 - 0x1p-19f) * own - size * h - 0x1p-19f * ((fabs(s.x) + fabs(s.y)) + fabs(s.z));
    if (R <= 0 || power <= 0) return INFINITY;
    const Float3 w = {x, y, -1};
    const FLOAT a = FMA(w.y, (FLOAT)s.z, -(w.z * s.y)), b = FMA(w.z, (FLOAT)s.x, -(w.x * s.z)),
                c = FMA(w.x, (FLOAT)s.y, -(w.y * s.x));
    const MASK covered = FMA(a, a, FMA(b, b, c * c)) < FMA((FLOAT)(R * R), view.line.a, (FLOAT)-0x1p-100f);
    const MASK ahead = dot_float(w, s) > 0;
    return (covered & ahead) ? (FLOAT)(power * REACH_SLACK) : (FLOAT)INFINITY;
}

/* In which pixels a sphere is behind what they show, and nowhere before it. Where the middle's ray meets it from
 * outside, all of it is behind the tangent plane there: with the normal n, of any length, other rays w + e meet that at
 * t n.w / (n.w + n.e), parallel ones at t - n.e / n.w. */
static MASK sphere_is_behind(const Scene *scene, const Outlook view, const int index) {
    if (HAS(WITH_ELLIPSOIDS) && scene->spheres.map_of[index]) return 0;
    const Meeting at = sphere_meet(scene->spheres, view.ray, sphere_at(scene->spheres, index));
    const FLOAT t = TO_FLOAT(at.t * scene->unit) * (1 - 0x1p-20f);
    const Float3 n = {TO_FLOAT(at.from_center.x), TO_FLOAT(at.from_center.y), TO_FLOAT(at.from_center.z)};
    const FLOAT across = TO_FLOAT(-DOT(at.from_center, view.ray.d)),
                room = (fabs(n.x) * view.margins.x + fabs(n.y) * view.margins.y) * (1 + 0x1p-20f);
    const FLOAT least = HAS(WITH_PARALLEL_RAYS) ? t - room / across : t * (across / (across + room));
    return TO_MASK(at.t < INFINITY) & (across > 0) & (least > view.far);
}

/* Which of the pixels that are asked for a sphere may be seen in, before what they show. */
static MASK sphere_touches(const Scene *scene, const Outlook view, const int index, MASK asked) {
    asked = asked & (view.object != (HAS(WITH_TRIANGLES) ? scene->id_of[index] : index));
    if (ANY(asked)) asked = asked & sphere_is_near(scene, view, index);
    return ANY(asked) ? asked & !sphere_is_behind(scene, view, index) : asked;
}

#ifdef WITH_TRIANGLES
/* How far the planes of a triangle's edges are from the pixels' middles on the triangle's side, from the nearest place
 * of these if `sign` is -1, from the furthest one if it is 1.
 *
 * The planes are linear functions of the place, off by less than 1: see sides_of(). None of them is negative in all of
 * a pixel that the triangle touches, and all are positive all over one that it covers. */
static FLOAT least_side(const Outlook view, __global const float4 *facet, const int sign) {
    const float h = view.margins.x * (1 + 0x1p-20f), k = view.margins.y * (1 + 0x1p-20f);
    FLOAT least = INFINITY;
    for (int i = 0; i < 3; i++) {
        const float4 edge = facet[i];
        const FLOAT side = FMA(view.line.x, (FLOAT)edge.x,
                               FMA(view.line.y, (FLOAT)edge.y, (FLOAT)(HAS(WITH_PARALLEL_RAYS) ? edge.z : -edge.z)));
        const FLOAT most = side + sign * (fabs(edge.x) * h + fabs(edge.y) * k);
        least = least < most ? least : most;
    }
    return least;
}

static __global const float4 *facet_of(const Scene *scene, const int index) {
    return scene->facet + 3 * (long)(index - FIRST_TRIANGLE(scene->spheres));
}

/* How much less or more than at its middle what tells how near the plane is gets in a pixel. */
static float plane_room(const Outlook view, __global const float4 *facet) {
    return (fabs(facet[0].w) * view.margins.x + fabs(facet[1].w) * view.margins.y) * (1 + 0x1p-20f);
}

static MASK triangle_is_near(const Scene *scene, const Outlook view, const int index) {
    return least_side(view, facet_of(scene, index), 1) >= -1;
}

static FLOAT triangle_covers(const Scene *scene, const Outlook view, const int index) {
    __global const float4 *facet = facet_of(scene, index);
    const Bounds plane = near_plane(view.line.x, view.line.y, facet);
    const FLOAT low = plane.low - plane_room(view, facet), corner = sqrt(view.line.a) + view.margins.diagonal;
    const MASK covered = (least_side(view, facet, -1) > 1) & (HAS(WITH_PARALLEL_RAYS) ? plane.high < 0 : low > 0);
    const FLOAT far = far_of(low);
    return covered ? DEPTH_AT(far, corner * corner) * REACH_SLACK : (FLOAT)INFINITY;
}

/* The same of a triangle.
 *
 * What tells how near its own plane is is a linear function of the place, too. Triangles of
 * the mesh that the pixel shows are no other surface where their planes, all over the pixel, have the depths of its
 * corners, or are no further from these than they are from each other. */
static MASK triangle_touches(const Scene *scene, const Outlook view, const int index, const MASK asked) {
    __global const float4 *facet = facet_of(scene, index);
    const FLOAT low = HAS(WITH_PARALLEL_RAYS) ? -view.far : 1 / view.far,
                high = HAS(WITH_PARALLEL_RAYS) ? -view.near : 1 / view.near;
    const FLOAT more = (high - low) + 0x1p-18f * fabs(high);
    const float room = plane_room(view, facet);
    const Bounds plane = near_plane(view.line.x, view.line.y, facet);
    const MASK same = scene->id_of[index] == view.object;
    /* What is unknown is a NaN, see Bounds. */
    const MASK strays = !(same & (plane.high + room <= high + more) & (plane.low - room >= low - more));
    return asked & strays & !(plane.high + room < low - 0x1p-18f * fabs(low)) & triangle_is_near(scene, view, index);
}
#endif

/* Which of the pixels that are `asked` may show another surface than that of which the rays through their corners have
 * all met one: its number in the scene file is `object`, and -1 stands for none.
 *
 * near, far: t at the corners. The surface itself is no further away in between: a sphere is seen from outside,
 * and then 1/t is a concave function of the place, or of parallel rays -t. */
static MASK may_show_another(const Scene *scene, const int2 tile, const Outlook view, const MASK asked) {
    const FLOAT corner = sqrt(view.line.a) + view.margins.diagonal, most = DEPTH_AT(view.far, corner * corner);
    const FLOAT depth = most * REACH_SLACK;
    const float last = LARGEST_FLOAT(asked ? depth : (FLOAT)0);
    const Grid grid = scene->lists.grid[0];
    Level level = first_level(grid);
    MASK found = 0;
    while (level.mask && ANY(asked & !found)) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile), end = scene->lists.start[cell + 1];
        for (int k = scene->lists.start[cell]; k < end; k++) {
            const int2 entry = scene->lists.entry[k];
            if (as_float(entry.y) > last) break;
            const MASK other = asked & !found & (depth >= as_float(entry.y));
            if (ANY(other)) found = found | ASK_SHAPE(scene->spheres, entry.x, touches(scene, view, entry.x, other));
        }
    }
    return asked & found;
}

/* Entries of a tile's lists that may be seen in some of its pixels: all of these, unless `full`. seen: bit k of a
 * pixel's lane stands for the entry number k. */
#define LISTED 32
typedef struct {
    int count, full;
    int2 entry[LISTED];
    INT seen;
} Candidates;

/* What may be seen in the pixels that are asked for, up to what covers all of one. */
static void gather_candidates(const Scene *scene, const int2 tile, const Outlook view, const MASK asked,
                              Candidates *found) {
    FLOAT depth = asked ? (FLOAT)INFINITY : (FLOAT)0;
    float last = INFINITY;
    const Grid grid = scene->lists.grid[0];
    Level level = first_level(grid);
    found->count = found->full = 0;
    found->seen = 0;
    while (level.mask) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile), end = scene->lists.start[cell + 1];
        for (int k = scene->lists.start[cell]; k < end; k++) {
            const int2 entry = scene->lists.entry[k];
            if (as_float(entry.y) > last) break;
            const MASK open = asked & (depth >= as_float(entry.y));
            const MASK seen = open & ASK_SHAPE(scene->spheres, entry.x, is_near(scene, view, entry.x));
            if (!ANY(seen)) continue;
            found->full = found->count == LISTED;
            if (found->full) return;
            found->entry[found->count] = entry;
            found->seen |= seen ? (INT)(1 << found->count) : (INT)0;
            found->count++;
            const FLOAT far = ASK_SHAPE(scene->spheres, entry.x, covers(scene, view, entry.x));
            if (!ANY(seen & (far < depth))) continue;
            depth = (seen & (far < depth)) ? far : depth;
            last = LARGEST_FLOAT(depth);
        }
    }
}

/* What may be seen in one of the pixels. */
typedef struct {
    int count;
    int2 entry[LISTED];
} Few;

static void list_few(const Candidates *found, const int lane, Few *few) {
    few->count = 0;
    for (uint seen = ((const uint *)&found->seen)[lane]; seen; seen &= seen - 1)
        few->entry[few->count++] = found->entry[31 - clz(seen & -seen)];
}

/* Where a walk through lists is. */
typedef struct {
    Level level;
    int k, end;
} Walk;

/* The next entry of a tile's lists, or of the few that may be met, if these are known; where there is none, or no level
 * has a nearer one than `reach`, squared, its index is -1. */
static int2 next_entry(const Scene *scene, const int2 tile, const Few *few, const float reach, Walk *walk) {
    const int2 none = {-1, 0};
    for (;;) {
        while (walk->k == walk->end) {
            if (few || !walk->level.mask) return none;
            walk->level = next_level(scene->lists.grid[0], walk->level);
            const int cell = cell_of(walk->level, tile);
            walk->k = scene->lists.start[cell];
            walk->end = scene->lists.start[cell + 1];
            fetch_ahead(scene, -1, walk->end);
        }
        const int k = walk->k++;
        const int2 entry = few ? few->entry[k] : scene->lists.entry[k];
        if (as_float(entry.y) <= reach) {
            if (!few) fetch_entry(scene, -1, k + AHEAD);
            if (!few) fetch_material_of(scene, k + AHEAD);
            return entry;
        }
        if (!few) walk->k = walk->end;
    }
}

/* As closest_hit(). few: all that the rays may meet, if that is known. */
static Hit closest_among(const Scene *scene, const Ray ray, const int2 tile, const Few *few, Work *work) {
    Hit hit = no_hit();
    EyeLine line = eye_line(scene, ray);
    float reach = INFINITY;
    Walk walk = {first_level(scene->lists.grid[0]), 0, few ? few->count : 0};
    for (;;) {
        const int2 entry = next_entry(scene, tile, few, reach, &walk);
        if (entry.x < 0) break;
        if (meet_surface(scene, ray, &line, entry.x, &hit, work)) reach = end_of_lists(scene, line, hit);
    }
    settle_hit(scene, ray, &hit);
    return hit;
}
#endif

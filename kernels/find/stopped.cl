/* stopped.cl: whether anything stands between a point and a light. */
#ifdef WITH_SHADOWS

/* A shadow ray, from a point P of a surface to a light. */
typedef struct {
    int number;   /* the light's place in the buffers */
    int at_point; /* whether the light is at a point; else it is parallel */
    Real3 w;      /* from P to the light; to a parallel light a vector of length 1 */
    Float3 w32;   /* the same in the float buffers' unit */
    FLOAT a;      /* its square */
} ShadowRay;

/* Where a shadow ray is in the light's buffer. */
typedef struct {
    Real3 from;  /* the direction from the light to P, of a length that float can hold; parallel: P in the float unit */
    FLOAT u, v;  /* parallel: P across the light */
    FLOAT depth; /* of P, as the lists are sorted: its squared distance from the light; parallel: how far it is behind */
    int touches; /* whether P is so near the light that float32 cannot tell the direction */
} Place;

/* Whether anything can stand between a sphere and a light at all: one bit for each of few spheres, which the host
 * knows; of many spheres, all bits are set. */
static MASK may_be_stopped(const Scene scene, const int number, const INT own) {
    return -(((INT)scene.light_buffer[number].z >> (own & 31)) & 1);
}

/* Of a direction with the first three of a filter constant or an axis. */
static FLOAT dot_float(const Float3 w, const float4 s) {
    return FMA(w.x, (FLOAT)s.x, FMA(w.y, (FLOAT)s.y, w.z * s.z));
}

static Place place_of(const Scene scene, const ShadowRay ray, const Start start, const MASK lit) {
    Place place = {{0, 0, 0}, 0, 0, ray.a, 0};
    place.touches = ray.at_point && ANY(lit & (ray.a < 0x1p-40f));
    if (ray.at_point) {
        const real lift = scene.unit * (real)(place.touches ? 0x1p80f : 1.0f);
        place.from.x = -ray.w.x * lift;
        place.from.y = -ray.w.y * lift;
        place.from.z = -ray.w.z * lift;
        return place;
    }
    const Light light = scene.light[ray.number];
    const Real3 C = start.own.center, p = start.p;
    Real3 P = {C.x + p.x, C.y + p.y, C.z + p.z};
#if REAL_BYTES == 4
    P.x = start.near_eye ? start.from_eye.x : P.x;
    P.y = start.near_eye ? start.from_eye.y : P.y;
    P.z = start.near_eye ? start.from_eye.z : P.z;
#endif
    place.from.x = P.x * scene.unit;
    place.from.y = P.y * scene.unit;
    place.from.z = P.z * scene.unit;
    place.u = TO_FLOAT(DOT(place.from, light.axis));
    place.v = TO_FLOAT(DOT(place.from, light.across));
    place.depth = -TO_FLOAT(DOT(place.from, light.position));
    return place;
}

/* A cell of level 0 of a grid for each lane of `here`; the others see nothing of this grid. */
typedef struct {
    MASK here;
    INT column, row;
} Cell;

static Cell cell_on(const Grid grid, const ShadowRay ray, const Place place, const MASK lit) {
    Cell cell = {lit, 0, 0};
    FLOAT x, y, ahead = 1;
    if (grid.flags.x && !place.touches) {
        ahead = -dot_float(ray.w32, grid.near_ahead);
        cell.here = cell.here & (ahead > 0);
        if (!ANY(cell.here)) return cell;
        x = -dot_float(ray.w32, grid.near_right);
        y = -dot_float(ray.w32, grid.near_up);
    } else {
        x = TO_FLOAT(DOT(place.from, grid.right) + grid.right.w);
        y = TO_FLOAT(DOT(place.from, grid.up) + grid.up.w);
        if (ray.at_point) {
            ahead = TO_FLOAT(DOT(place.from, grid.ahead));
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
    /* x and y count from the middle. Lanes elsewhere get 0, a number that can be converted. */
    const INT column = TO_INT(cell.here ? (x + grid.window.x) * grid.window.z : (FLOAT)0);
    const INT row = TO_INT(cell.here ? (y + grid.window.y) * grid.window.w : (FLOAT)0);
    const INT last_column = grid.cells.x - 1, last_row = grid.cells.y - 1;
    cell.column = column < last_column ? column : last_column;
    cell.row = row < last_row ? row : last_row;
    return cell;
}

/* Whether the filter leaves any lane of `may` that the sphere can stop.
 *
 * A light at a point L: the sphere's constant is (L - C, c'), with c' made from |L - C|^2 - r^2 as for rays from the eye.
 * The line from the light to the point is a ray from a fixed point, too, and the proof of sphere_may_meet holds with
 * d = -w: L - C is rounded from the exact difference, and the rotation adds 2^-50 of it, a part of what 5.01 u leaves.
 * |w|^2 > 2^-40 makes up for a >= 1; shorter ones are left to sphere_stops().
 *
 * A parallel light: the constant is (u, v, r'^2) in the light's own coordinates. A ray that hits is within r of the axis
 * through the centre: sqrt((u - pu)^2 + (v - pv)^2) <= r. Rounding the coordinates moves each difference by at most
 * u (|u| + |pu|) <= 2.01 u (|u| + r), and the sum costs 3 u, where u = 2^-24 is the unit: what it takes is less than
 * r' = r + 8 u (|u| + |v| + r) + 2^-60 [DISC_ROUNDINGS = 8].
 */
static int filter_leaves(const Scene scene, const ShadowRay ray, const Place place, const int index, const MASK may) {
#ifdef WITH_FILTER
    const float4 s = scene.light_filter[(long)ray.number * scene.count + index];
    if (ray.at_point) return place.touches || ANY(may & sphere_may_meet(dot_float(ray.w32, s), ray.a, s));
    const FLOAT du = s.x - place.u, dv = s.y - place.v;
    return ANY(may & (FMA(du, du, dv * dv) <= s.z));
#else
    return 1;
#endif
}

/* Which of the lit lanes of `in` stay lit after one list. Lists are in the order of the depth of the spheres' nearest
 * points from the light: what is not nearer than P does not matter. */
static MASK lit_after_list(const Scene scene, const ShadowRay ray, const Place place, const Start start, const INT own,
                           const int cell, const MASK in, MASK lit, Work *work) {
    const int first = scene.lists.start[cell], end = scene.lists.start[cell + 1];
    FETCH_AHEAD(scene, scene.light_filter + (long)ray.number * scene.count, first);
    for (int k = first; k < end; k++) {
        const int2 entry = scene.lists.entry[k];
        const int index = entry.x;
        MASK may = in & lit & (place.depth > as_float(entry.y));
        if (!ANY(may)) break;
#ifndef WITH_INSIDE
        may = may & (own != index);
#endif
        if (!filter_leaves(scene, ray, place, index, may)) {
            COUNT(FILTERED, may);
            continue;
        }
        COUNT(DECIDED, may);
        const int side = scene.light_side[(long)ray.number * scene.count + index];
        const Sphere sphere = sphere_at(scene.spheres, index);
        REAL_MASK stops = sphere_stops(start, sphere, ray.w, ray.at_point, side);
#ifdef WITH_INSIDE
        const REAL_MASK self = TO_REAL_MASK(own == index);
        stops = (self & (start.side < 0) & ((REAL)side > 0)) | (!self & stops);
#endif
        lit = lit & !(may & TO_MASK(stops));
    }
    return lit;
}

/* Which of the lit lanes stay lit: those without a sphere between the point and the light.
 *
 * The own sphere is not tested: it is convex, so a ray that leaves on the normal's side never meets it again. Only from
 * its inside it stops a ray, if and only if the light is outside.
 */
static MASK cast_shadow_ray(const Scene scene, const ShadowRay ray, const Start start, const INT own, MASK lit,
                            Work *work) {
    const Place place = place_of(scene, ray, start, lit);
    const int4 grids = scene.light_buffer[ray.number];
    for (int g = grids.x; g < grids.x + grids.y; g++) {
        const Grid grid = scene.lists.grid[g];
        Cell cell = {lit, 0, 0};
        if (grid.cells.x > 1 || grid.cells.y > 1) {
            cell = cell_on(grid, ray, place, lit);
            if (!ANY(cell.here)) continue;
        }
        Level level = first_level(grid);
        while (level.mask) {
            level = next_level(grid, level);
            const INT number = level.first + (cell.row >> level.level) * level.columns + (cell.column >> level.level);
            INT pending = cell.here & lit ? number : (INT)-1;
            for (int c = LARGEST(pending); c >= 0; c = LARGEST(pending)) {
                const MASK in = pending == c;
                pending = in ? (INT)-1 : pending;
                lit = lit_after_list(scene, ray, place, start, own, c, in, lit, work);
                if (!ANY(lit)) return lit;
            }
        }
    }
    return lit;
}
#endif

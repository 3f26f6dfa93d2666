/* stopped.cl: whether anything stands between a point and a light. */
#ifdef WITH_SHADOWS

/* A shadow ray, from a point P of a surface to a light. */
typedef struct {
    int number;   /* the light's index in the buffers */
    int at_point; /* whether the light is at a point; else it is parallel */
    Real3 w;      /* from P to the light; to a parallel light a vector of length 1 */
    Float3 w32;   /* the same in the float buffers' unit; a parallel light's has length 1 here, too */
    FLOAT a;      /* |w32|^2 */
} ShadowRay;

/* Where a shadow ray is in the light buffer. Lengths are in the float buffers' unit. */
typedef struct {
    Real3 from;  /* from the light to P, times 2^80 if `touches`; of a parallel light: P itself */
    FLOAT u, v;  /* of a parallel light: the coordinates of P across it */
    FLOAT depth; /* P's place in the depth order: |P - L|^2; of a parallel light: -P.l, with l the unit vector to it */
    int touches; /* whether some lit P is so near the light that float32 cannot tell the direction between them */
} Place;

#ifdef WITH_UNSTOPPABLE
/* The number of `unstoppable` that has the bit of each lane's triangle; 0 of other surfaces. */
static INT bits_of_triangles(const Scene scene, const int light, const INT own) {
    __global const int *bits = scene.unstoppable + (long)light * ((scene.triangles + 31) / 32);
    INT left = own >= scene.spheres.first ? (own - scene.spheres.first) >> 5 : (INT)-1, found = 0;
    for (int one = LARGEST(left); one >= 0; one = LARGEST(left)) {
        PUT_WHERE(left == one, found, (INT)bits[one]);
        left = left == one ? (INT)-1 : left;
    }
    return found;
}
#endif

/* In which lanes anything can stand between the light and the own surface at all. Of few spheres the host has a bit for
 * each one; of many, and of triangles, all bits are set. */
static MASK may_be_stopped(const Scene scene, const int number, const INT own) {
#ifdef WITH_UNSTOPPABLE
    if (number < scene.proved)
        return ((bits_of_triangles(scene, number, own) >> ((own - scene.spheres.first) & 31)) & 1) - 1;
#endif
    return -(((INT)scene.light_buffer[number].z >> (own & 31)) & 1);
}

/* The scalar product, in float, of a direction and the first three of a filter constant, or of a grid's axis. */
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

/* The cell of level 0 of a grid that each lane's shadow ray goes through. here: the lanes that meet the grid's
 * window. */
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
    /* x and y count from the window's middle. Lanes elsewhere get 0, as not every float can be converted to int. */
    const INT column = TO_INT(cell.here ? (x + grid.window.x) * grid.window.z : (FLOAT)0);
    const INT row = TO_INT(cell.here ? (y + grid.window.y) * grid.window.w : (FLOAT)0);
    const INT last_column = grid.cells.x - 1, last_row = grid.cells.y - 1;
    cell.column = column < last_column ? column : last_column;
    cell.row = row < last_row ? row : last_row;
    return cell;
}

/* Whether the float32 filter leaves it open, for any lane of `may`, that the sphere stops the ray.
 *
 * A light at a point L: the filter constant is (L - C, c'), with c' made from |L - C|^2 - r^2 as for rays from the eye.
 * The line from the light to the point is a ray from a fixed point, too, so the proof of sphere_may_meet holds with
 * d = -w. There L - C is rounded from the exact difference, and turning it into camera space adds an error of 2^-50 of
 * it, for which 5.01 u has room. The proof needs a >= 1 against underflow alone, and |w|^2 >= 2^-40 does as well;
 * shorter rays are left to sphere_stops().
 *
 * A parallel light: the filter constant is (U, V, r'^2), with (U, V) the centre's coordinates across the light. A ray
 * from P, which is at (u, v), that meets the sphere passes its centre within r: sqrt((U - u)^2 + (V - v)^2) <= r. Let
 * e = 2^-24. Rounding the coordinates moves each difference by at most e (|U| + |u|) <= 2.01 e (|U| + r), or the same
 * of V, and the sum of squares is off by 3 e of itself: both together are less than what r' has more than r,
 * r' = r + 8 e (|U| + |V| + r) + 2^-60 [DISC_ROUNDINGS = 8]. See disc_filter in cltrace/plan/shapes/sphere.py.
 */
#ifndef ONLY_TRIANGLES
static int filter_leaves(const Scene scene, const ShadowRay ray, const Place place, const int index, const MASK may) {
#ifdef WITH_FILTER
    const float4 s = scene.light_filter[(long)ray.number * scene.count + index];
#ifdef WITH_SMALL_SPHERES
    if (ray.at_point) {
        if (place.touches) return 1;
        const MASK open = may & sphere_may_meet(dot_float(ray.w32, s), ray.a, s);
        if (!ANY(open)) return 0;
        const float r = (float)(scene.spheres.center_radius[index].w * scene.unit);
        return ANY(open & small_sphere_may_meet(ray.w32, ray.a, s, r));
    }
#else
    if (ray.at_point) return place.touches || ANY(may & sphere_may_meet(dot_float(ray.w32, s), ray.a, s));
#endif
    const FLOAT du = s.x - place.u, dv = s.y - place.v;
    return ANY(may & (FMA(du, du, dv * dv) <= s.z));
#else
    return 1;
#endif
}

#endif

#ifdef WITH_TRIANGLES
/* The same where float32 cannot tell: for the lanes of `wanted`, of which those of `inside` are as in triangle_meet(). */
static __attribute__((noinline)) MASK decide_stops(const Spheres *all, const real4 lamp, const int at_point,
                                                   const Start *from, const int number, const MASK wanted,
                                                   const MASK inside) {
    const Spheres spheres = *all;
    Start start = *from;
    place_starts(spheres, &start);
    return TO_MASK(stands_before(spheres, lamp, at_point, start, triangle_at(spheres, number), number, TO_REAL_MASK(wanted),
                                 TO_REAL_MASK(inside)));
}

/* The lanes of `may` in which a triangle stands between P and the light: in which the ray meets it, and P is beyond its
 * plane. As seen from a light at a point, with w the way to P, that is 1/t > 1; of a parallel light P is deeper. */
static MASK triangle_stops(const Scene scene, const ShadowRay ray, const Place place, const Start start, const int number,
                           const MASK may, Work *work) {
    MASK unsure = may, inside = 0, stops = 0;
#ifdef WITH_FILTER
    if (!place.touches) {
        __global const float4 *facet = scene.light_facet + 3 * ((long)ray.number * scene.triangles + number);
        const FLOAT x = ray.at_point ? ray.w32.x : place.u, y = ray.at_point ? ray.w32.y : place.v;
        const FLOAT z = ray.at_point ? ray.w32.z : (FLOAT)1;
        const Sides sides = sides_of(x, y, z, ray.at_point ? sqrt(ray.a) : (FLOAT)1, facet);
        unsure = may & sides.open;
        COUNT(FILTERED, may & !unsure);
        if (!ANY(unsure)) return 0;
        const Bounds plane = plane_at(x, y, z, facet);
        /* P's own depth is off by a rounding of it, and by less than 2^-40; that of the plane by 2^-27, see along_light(). */
        const FLOAT off = FMA(magnitude(place.depth), (FLOAT)0x1p-22f, (FLOAT)0x1p-26f);
        const MASK beyond = ray.at_point ? plane.low > 1 : plane.high < place.depth - off;
        const MASK before = ray.at_point ? plane.high < 1 : plane.low > place.depth + off;
        inside = unsure & sides.inside;
        stops = inside & beyond;
        unsure = unsure & !stops & !before;
    }
#endif
    if (!RARELY(ANY(unsure))) return stops;
    COUNT(DECIDED, unsure);
    /* Copied here, lest compilers keep it in memory all the time. */
    const Spheres spheres = scene.spheres;
    const Start copy = start;
    return stops | decide_stops(&spheres, scene.lamp[ray.number], ray.at_point, &copy, number, unsure, inside);
}
#endif

#ifndef ONLY_TRIANGLES
/* On which side of a sphere a light is: of abi.py's light_side. Where c' > 0 (see filter_leaves()), |L - C|^2 - r^2 is
 * greater still, so it is outside: of many spheres, that waits for no further array. */
static int side_of_light(const Scene scene, const ShadowRay ray, const int index) {
    const long seen = (long)ray.number * scene.count + index;
#ifdef WITH_SMALL_SPHERES
    if (ray.at_point && scene.light_filter[seen].w > 0) return 1;
#endif
    return scene.light_side[seen];
}

#if defined(WITH_BLOCKS) && !defined(WITH_TRIANGLES) && W > 1 && REAL_BYTES == 8
#define WITH_SHARED_ANSWERS
/* The lanes of `lit` for which the answer of sphere_stops() counts, whichever lists they have. Few spheres stop most rays of
 * a packet, so what is read later is asked for fewer lanes: with 100 lights, frames take 0.8 to 0.95 of the time.
 *
 * No bit changes: a ray is stopped if any sphere stops it, and where sphere_stops() says so in double, the ray's own list
 * has that sphere. Proof. Let u = 2^-53, f and w the ways from P to the sphere's centre and to the light, r the sphere's
 * radius and R that of P's own sphere. f is off by less than 2 u (|f| + R), and where the discriminant changes its sign,
 * the sphere's rim is off by less than 4 u (|f| + r). With r and R at most 16 |w|, and |f| <= |w| + r of what stops a ray,
 * both together are less than 6 (17 + 16) u |w| + 32 u |w| < 2^-45 |w|. Lists are made for spheres that look larger by
 * 2^-44 at least [FINE_SLACK in cltrace/plan/accel/light_buffer.py]. To a parallel light |w| = 1 in the float buffers'
 * unit, in which coordinates are about 1 at most. Where the rays `touch`, |w|^2 may have vanished in float. In single
 * there is no such room. */
static MASK shared_by(const Scene scene, const ShadowRay ray, const Place place, const Start start, const int index,
                      const MASK lit) {
    if (place.touches) return 0;
    const float r = (float)(scene.spheres.center_radius[index].w * scene.unit);
    const FLOAT R = TO_FLOAT(start.own.r * scene.unit);
    return lit & (FMA(R, R, (FLOAT)(r * r)) <= 0x1p8f * ray.a);
}
#endif

/* The lanes of `may` that a sphere stops; none where the filter rules it out for all those of `asked`. */
static MASK stopped_by(const Scene scene, const ShadowRay ray, const Place place, const Start start, const INT own,
                       const int index, MASK asked, MASK may, Work *work) {
#ifndef WITH_INSIDE
    asked = asked & (own != index);
    may = may & (own != index);
#endif
    if (!filter_leaves(scene, ray, place, index, asked)) {
        COUNT(FILTERED, asked);
        return 0;
    }
    COUNT(DECIDED, may);
    const int side = side_of_light(scene, ray, index);
    const Sphere sphere = sphere_at(scene.spheres, index);
#ifdef WITH_ELLIPSOIDS
    const int map = scene.spheres.map_of[index];
    REAL_MASK stops = map ? ellipsoid_stops(scene.spheres, start, sphere, map, ray.w, ray.at_point, side)
                          : sphere_stops(start, sphere, ray.w, ray.at_point, side);
#else
    REAL_MASK stops = sphere_stops(start, sphere, ray.w, ray.at_point, side);
#endif
#ifdef WITH_INSIDE
    const REAL_MASK self = TO_REAL_MASK(own == index);
    stops = (self & (start.side < 0) & ((REAL)side > 0)) | (!self & stops);
#endif
    return may & TO_MASK(stops);
}
#endif

/* The lanes of `lit` that stay lit after the list of one cell, which the rays of the lanes `in` go through. The list
 * is in depth order, by the spheres' points nearest to the light. A sphere no point of which is nearer to the light
 * than P stops nothing, so there the list ends for a lane. */
static MASK lit_after_list(const Scene scene, const ShadowRay ray, const Place place, Start start, const INT own,
                           const int cell, const MASK in, MASK lit, Work *work) {
    const int first = scene.lists.start[cell], end = scene.lists.start[cell + 1];
    /* Of triangles alone, that took more time than it saved. */
#ifndef ONLY_TRIANGLES
    FETCH_AHEAD(scene, scene.light_filter + (long)ray.number * scene.count, ray.number, first);
#endif
    for (int k = first; k < end; k++) {
        const int2 entry = scene.lists.entry[k];
        const int index = entry.x;
        MASK may = in & lit & (place.depth > as_float(entry.y));
        if (!ANY(may)) break;
#ifndef ONLY_TRIANGLES
        FETCH_ENTRY(scene, scene.light_filter + (long)ray.number * scene.count, ray.number, k + AHEAD);
#endif
#ifdef WITH_TRIANGLES
        if (index >= scene.spheres.first) {
            may = may & (own != index);
            lit = lit & !triangle_stops(scene, ray, place, start, index - scene.spheres.first, may, work);
            continue;
        }
#endif
#ifndef ONLY_TRIANGLES
#ifdef WITH_SHARED_ANSWERS
        const MASK all = may | shared_by(scene, ray, place, start, index, lit & (place.depth > as_float(entry.y)));
        const MASK stops = stopped_by(scene, ray, place, start, own, index, may, all, work);
#else
        const MASK stops = stopped_by(scene, ray, place, start, own, index, may, may, work);
#endif
        lit = lit & !stops;
#endif
    }
    return lit;
}

/* The lanes of `lit` that stay lit: those without a sphere between the point and the light. own: index of the sphere
 * that the point is on.
 *
 * The own sphere needs no test. It is convex, so a ray that leaves it outwards never meets it again; a ray that leaves
 * it inwards is stopped by it if and only if the light is outside of it.
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
            FETCH_LISTS(scene, ray.number, pending);
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

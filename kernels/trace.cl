/* trace.cl: from a pixel to its colour. The names, and their order, are those of cltrace/reference.py. */

/* The buffers of a scene. Spheres are in an order in which neighbours are near each other. */
typedef struct {
    Spheres spheres;
    __global const int *number;          /* per sphere: its number in the scene file */
    __global const int *material_of;     /* per sphere: index into material */
    __global const shade8 *material;     /* ka La C (rgb), kd C (rgb), ks, exponent */
    __global const Light *light;         /* parallel lights, then point lights, then spot lights */
    __global const float4 *candidate;    /* per sphere, for the filter of closest_hit */
    __global const float4 *occluder;     /* per light and sphere, for the filter of cast_shadow_ray */
    __global const char *outside;        /* per light and sphere: the sign of the light's power, 1 outside */
    __global const int4 *light_grids;    /* per light: its first sheet, their number; z: see may_be_blocked() */
    Lists lists;
    int count;   /* of spheres */
    int4 lights; /* numbers of parallel, point and spot lights, and of all */
    real unit;   /* a power of two: times a length, it is what the float buffers hold, which is about 1 at most */
} Scene;

/* What was done and what was skipped, counted in each lane for --stats, in the order of WORK in cltrace/layout.py. */
#ifdef OUT_WORK
typedef struct {
    INT count[WORK_KINDS];
} Work;
#define COUNT(kind, mask) work->count[kind] += (mask) ? (INT)1 : (INT)0
#else
typedef int Work;
#define COUNT(kind, mask)
#endif
#define SHADOW_RAYS 0
#define FACING_AWAY 1
#define UNBLOCKED 2
#define HIGHLIGHTS 3
#define FAINT_HIGHLIGHTS 4
#define FILTERED 5
#define DECIDED 6
#define BACKGROUND 7

/* What was hit: the sphere's place in the buffers, -1 = nothing, the distance in units of the ray's direction, and
 * where on it. */
typedef struct {
    REAL t;
    INT id;
    Real3 from_center;
} Hit;

/* All that is known of the point that was hit. */
typedef struct {
    MASK hit;
#ifdef WITH_DULL
    MASK dull; /* reflects no light at all */
#endif
    Sphere sphere;
    Real3 normal;   /* outward unit normal of the sphere */
    Start start;    /* where its shadow rays start */
    REAL side;      /* 1, or -1 where the ray came from inside: side * normal faces the ray */
    Shade3 ambient; /* ka La C */
    Shade3 diffuse; /* kd C */
    SHADE ks, exponent;
} Intersection;

/* The ray through the centres of the packet's pixels; row 0 is the top. size: of the whole picture. */
static Ray primary_ray(const View view, const int2 size, const INT column, const INT row) {
    Ray ray;
    ray.d.x = TO_REAL(2 * column + 1 - size.x) * view.pixel.x;
    ray.d.y = TO_REAL(size.y - 1 - 2 * row) * view.pixel.y;
    ray.d.z = -1;
    ray.a = (ray.d.x * ray.d.x + ray.d.y * ray.d.y) + 1;
    ray.over_a = 1 / ray.a;
    return ray;
}

/* |x|, by operators alone. */
static FLOAT magnitude(const FLOAT x) {
    return AS(float, AS(int, x) & 0x7fffffff);
}

/* A list ends for a ray where it has found something nearer, squared. With doubles that is known to 2^-25. */
#if REAL_BYTES == 8
#define REACH_SLACK (1.0f + 0x1p-20f)
#else
#define REACH_SLACK (1.0f + 0x1p-8f)
#endif

/* The numbers that each lane's sphere has in the scene file; -1 for none. */
static INT numbers_of(const Scene scene, const INT index) {
    int each[W];
    STORE_LANES(index, each);
    for (int lane = 0; lane < W; lane++) each[lane] = each[lane] < 0 ? -1 : scene.number[each[lane]];
    return LOAD_LANES(each);
}

/* The nearest sphere along the ray; of equally near ones, that with the lowest number.
 * tile: the packet's place in the picture, in units of 4x4 pixels.
 *
 * The filter. A candidate is (C, c'), rounded to float, with c' = c - 11 u (|C|^2 + |c|) - 2^-100 rounded down, and
 * c' = -inf where that is <= 0; u = 2^-24, c = |C|^2 - r^2. Claim: if the ray hits, then b |b| >= a c' in float.
 * Proof. Let b = C.d and a = d.d without rounding and b~, a~ as computed here. C and d are rounded once and at most
 * three roundings follow, so |b~ - b| <= 5.01 u sum |C_i d_i| <= 5.01 u |C||d|, and a~ <= (1 + 5.01 u) a. A hit from
 * outside has b > 0 and b^2 >= a c. With s = b/|d| <= |C|:
 *   - if s >= 5.01 u |C|:  b~^2 (1 - u) >= a (s - 5.01 u |C|)^2 (1 - u) >= a (c - 10.02 u |C|^2)(1 - u), and
 *     a~ c' (1 + u) <= a (1 + 6.02 u) c' <= a (c - 10.1 u |C|^2 - 7.1 u c) (1 + 6.02 u), which is less.
 *   - else c <= s^2 < 26 u^2 |C|^2, so c - 11 u |C|^2 < 0 and c' = -inf: always a candidate.
 * A hit from inside or from the surface has c <= 0: likewise. Underflow adds at most 2^-123 to b: as a >= 1 and the
 * scene is scaled to 1, 2^-100 covers it. The filter costs no more than a float tracer's own test.
 */
static Hit closest_hit(const Scene scene, const Ray ray, const int2 tile, Work *work) {
    Hit hit = {INFINITY, -1, {0, 0, 1}};
    const FLOAT dx = TO_FLOAT(ray.d.x), dy = TO_FLOAT(ray.d.y);
    const FLOAT a = FMA(dx, dx, FMA(dy, dy, (FLOAT)1.0f));
    int found = 0;         /* whether any lane may have a hit */
    float reach = INFINITY; /* no lane has a use for anything of which the nearest point is beyond, squared */
    const Grid grid = scene.lists.grid[0];
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const int cell = level.first + (tile.y >> level.level) * level.columns + (tile.x >> level.level);
        const int end = scene.lists.start[cell + 1];
        /* Of the next tile: its list is the next one. */
        FETCH_AHEAD(scene, scene.candidate, end);
        for (int k = scene.lists.start[cell]; k < end; k++) {
            const int2 entry = scene.lists.entry[k];
            if (as_float(entry.y) > reach) break;
            const int index = entry.x;
#ifdef WITH_FILTER
            const float4 s = scene.candidate[index];
            const FLOAT b = FMA(dx, (FLOAT)s.x, FMA(dy, (FLOAT)s.y, (FLOAT)-s.z));
            if (!ANY(b * magnitude(b) >= a * s.w)) {
                COUNT(FILTERED, ALL_LANES);
                continue;
            }
#endif
            COUNT(DECIDED, ALL_LANES);
            const Sphere sphere = sphere_at(scene.spheres, index);
            const Meeting at = intersect_sphere(scene.spheres, ray, sphere);
            const REAL t = at.t;
            REAL_MASK nearer = t < hit.t;
            if (found) {
#if REAL_BYTES == 8
                /* Where a discriminant is not computed in pairs, the distance is off by at most 2^-25 (see
                 * intersect_sphere). */
                const REAL margin = hit.t * 0x1p-22;
                const REAL_MASK close = (t - hit.t <= margin) & (hit.t - t <= margin) & (hit.t < INFINITY);
#else
                const REAL_MASK close = (t == hit.t) & (t < INFINITY);
#endif
                if (ANY(TO_MASK(close))) {
                    REAL_MASK first = TO_REAL_MASK(scene.number[index] < numbers_of(scene, hit.id));
#if REAL_BYTES == 8
                    first = comes_first(scene.spheres, ray, sphere, spheres_of(scene.spheres, hit.id), first);
#endif
                    nearer = close ? first : nearer;
                }
            }
            found = 1;
            hit.t = nearer ? t : hit.t;
            hit.id = TO_MASK(nearer) ? (INT)index : hit.id;
            hit.from_center.x = nearer ? at.from_center.x : hit.from_center.x;
            hit.from_center.y = nearer ? at.from_center.y : hit.from_center.y;
            hit.from_center.z = nearer ? at.from_center.z : hit.from_center.z;
            const FLOAT far = TO_FLOAT(hit.t * scene.unit);
            reach = LARGEST_FLOAT(far * far * a * REACH_SLACK);
        }
    }
    return hit;
}

/* Sphere, normal and material of each lane's hit. Lanes without a hit keep harmless values. */
static Intersection intersection_at(const Scene scene, const Ray ray, const Hit hit) {
    Intersection at;
    at.hit = hit.id >= 0;
    at.sphere = spheres_of(scene.spheres, hit.id);
    at.side = 1;
    at.ambient.x = at.ambient.y = at.ambient.z = at.diffuse.x = at.diffuse.y = at.diffuse.z = at.ks = at.exponent = 0;
#ifdef WITH_SHADING
    int each[W], last = -1;
    STORE_LANES(hit.id, each);
    for (int lane = 0; lane < W; lane++) {
        if (each[lane] == last || each[lane] < 0) continue;
        last = each[lane];
        const SHADE_MASK here = TO_SHADE_MASK(hit.id == last);
        const shade8 m = scene.material[scene.material_of[last]];
        at.ambient.x = here ? (SHADE)m.s0 : at.ambient.x;
        at.ambient.y = here ? (SHADE)m.s1 : at.ambient.y;
        at.ambient.z = here ? (SHADE)m.s2 : at.ambient.z;
        at.diffuse.x = here ? (SHADE)m.s3 : at.diffuse.x;
        at.diffuse.y = here ? (SHADE)m.s4 : at.diffuse.y;
        at.diffuse.z = here ? (SHADE)m.s5 : at.diffuse.z;
        at.ks = here ? (SHADE)m.s6 : at.ks;
        at.exponent = here ? (SHADE)m.s7 : at.exponent;
    }
#endif
#ifdef WITH_DULL
    at.dull = TO_MASK((at.diffuse.x <= 0) & (at.diffuse.y <= 0) & (at.diffuse.z <= 0) & (at.ks <= 0));
#endif
#ifdef WITH_NORMAL
    at.normal = normal_of(at.sphere, hit.from_center);
    at.start = start_at(ray, at.sphere, at.normal, hit.t);
#endif
#ifdef WITH_INSIDE
    at.side = at.sphere.c > 0 ? (REAL)1 : (REAL)-1;
#endif
    return at;
}

#ifdef WITH_SHADOWS
/* Whether anything can stand between a sphere and a light at all: one bit for each of few spheres, which the host
 * knows; of many spheres, all bits are set. */
static MASK may_be_blocked(const Scene scene, const int number, const INT own) {
    return -(((INT)scene.light_grids[number].z >> (own & 31)) & 1);
}

/* Of a direction with the first three of an occluder or an axis. */
static FLOAT dot_float(const Float3 w, const float4 s) {
    return FMA(w.x, (FLOAT)s.x, FMA(w.y, (FLOAT)s.y, w.z * s.z));
}

/* Which of the lit lanes stay lit: those without a sphere between the point and the light.
 *
 * w: from the point to the light, or to a parallel light a vector of length 1; w32: the same in the float buffers'
 * unit, a: its square. The own sphere is not tested: it is convex, so a ray that leaves on the normal's side never
 * meets it again. Only from its inside it blocks, if and only if the light is outside.
 *
 * The filter for a light at a point L: an occluder is (L - C, c'), with c' made from |L - C|^2 - r^2 as in closest_hit:
 * the line from the light to the point is a ray from a fixed origin, too, and the same proof holds with d = -w (L - C
 * is rounded from the exact difference; the rotation adds 2^-50 of it, a part of what 5.01 u leaves), where
 * |w|^2 > 2^-40 makes up for a >= 1; shorter ones are left to blocks(). Lists are in the order of the squared distance
 * of the spheres' nearest points from the light: what is not nearer than P does not matter.
 *
 * The filter for a parallel light: an occluder is (u, v, r'^2) in the light's own coordinates. A ray that hits is
 * within r of the axis through the centre: sqrt((u - pu)^2 + (v - pv)^2) <= r. Rounding the coordinates moves the
 * difference by at most u (|u| + |pu|) <= 2.01 u (|u| + r) each, and the sum costs 3 u: r' = r + 8 u (|u| + |v| + r) +
 * 2^-60 is more. Lists are in the order of the end towards the light: what does not reach beyond P does not matter.
 */
static MASK cast_shadow_ray(const Scene scene, const int number, const int at_point, const Intersection at,
                            const INT own, const Real3 w, const Float3 w32, const FLOAT a, MASK lit, Work *work) {
    const Light light = scene.light[number];
    FLOAT pu = 0, pv = 0, measure = a;
    const int at_light = at_point && ANY(lit & (a < 0x1p-40f));
    /* The sheets' point: the direction from the light, of a length that float can hold, or the place across it. */
    const real lift = scene.unit * (real)(at_light ? 0x1p80f : 1.0f);
    Real3 from = {-w.x * lift, -w.y * lift, -w.z * lift};
    if (!at_point) {
        const Real3 C = at.sphere.center, p = at.start.p;
        Real3 P = {C.x + p.x, C.y + p.y, C.z + p.z};
#if REAL_BYTES == 4
        P.x = at.start.near_eye ? at.start.from_eye.x : P.x;
        P.y = at.start.near_eye ? at.start.from_eye.y : P.y;
        P.z = at.start.near_eye ? at.start.from_eye.z : P.z;
#endif
        from.x = P.x * scene.unit;
        from.y = P.y * scene.unit;
        from.z = P.z * scene.unit;
        pu = TO_FLOAT(DOT(from, light.axis));
        pv = TO_FLOAT(DOT(from, light.across));
        measure = -TO_FLOAT(DOT(from, light.position));
    }

    const int4 grids = scene.light_grids[number];
    for (int g = grids.x; g < grids.x + grids.y; g++) {
        const Grid grid = scene.lists.grid[g];
        MASK here = lit;
        INT u = 0, v = 0;
        if (grid.cells.x > 1 || grid.cells.y > 1) {
            FLOAT x, y, ahead = 1;
            if (grid.flags.x && !at_light) {
                ahead = -dot_float(w32, grid.near_ahead);
                here = here & (ahead > 0);
                if (!ANY(here)) continue;
                x = -dot_float(w32, grid.near_right);
                y = -dot_float(w32, grid.near_up);
            } else {
                x = TO_FLOAT(DOT(from, grid.right) + grid.right.w);
                y = TO_FLOAT(DOT(from, grid.up) + grid.up.w);
                if (at_point) {
                    ahead = TO_FLOAT(DOT(from, grid.ahead));
                    here = here & (ahead > 0);
                }
            }
            if (at_point) {
                const FLOAT over = 1 / ahead;
                x *= over;
                y *= over;
            }
            here = here & (magnitude(x) <= grid.window.x) & (magnitude(y) <= grid.window.y);
            if (!ANY(here)) continue;
            /* Cells of level 0; x and y count from the middle. Other lanes get 0, a number that can be converted. */
            const INT column = TO_INT(here ? (x + grid.window.x) * grid.window.z : (FLOAT)0);
            const INT row = TO_INT(here ? (y + grid.window.y) * grid.window.w : (FLOAT)0);
            const INT last_column = grid.cells.x - 1, last_row = grid.cells.y - 1;
            u = column < last_column ? column : last_column;
            v = row < last_row ? row : last_row;
        }
        Level level = first_level(grid);
        while (level.mask) {
            level = next_level(grid, level);
            const INT cell = level.first + (v >> level.level) * level.columns + (u >> level.level);
            INT pending = here & lit ? cell : (INT)-1;
            for (int c = LARGEST(pending); c >= 0; c = LARGEST(pending)) {
                const MASK in = pending == c;
                pending = in ? (INT)-1 : pending;
                const int first = scene.lists.start[c], end = scene.lists.start[c + 1];
                FETCH_AHEAD(scene, scene.occluder + (long)number * scene.count, first);
                for (int k = first; k < end; k++) {
                    const int2 entry = scene.lists.entry[k];
                    const int index = entry.x;
                    MASK may = in & lit & (measure > as_float(entry.y));
                    if (!ANY(may)) break;
#ifndef WITH_INSIDE
                    may = may & (own != index);
#endif
#ifdef WITH_FILTER
                    const float4 s = scene.occluder[(long)number * scene.count + index];
                    if (at_point) {
                        const FLOAT b = dot_float(w32, s);
                        if (!at_light && !ANY(may & (b * magnitude(b) >= a * s.w))) {
                            COUNT(FILTERED, may);
                            continue;
                        }
                    } else {
                        const FLOAT du = s.x - pu, dv = s.y - pv;
                        if (!ANY(may & (FMA(du, du, dv * dv) <= s.z))) {
                            COUNT(FILTERED, may);
                            continue;
                        }
                    }
#endif
                    COUNT(DECIDED, may);
                    const int outside = scene.outside[(long)number * scene.count + index];
                    const Sphere sphere = sphere_at(scene.spheres, index);
                    REAL_MASK blocked = blocks(at.start, sphere, w, at_point, outside);
#ifdef WITH_INSIDE
                    const REAL_MASK self = TO_REAL_MASK(own == index);
                    blocked = (self & (at.side < 0) & ((REAL)outside > 0)) | (!self & blocked);
#endif
                    lit = lit & !(may & TO_MASK(blocked));
                }
                if (!ANY(lit)) return lit;
            }
        }
    }
    return lit;
}
#endif

#ifdef WITH_LIGHTS
/* 0 parallel, 1 point, 2 spot. One loop over all lights calls illuminate() from one place, where it is inlined: else
 * compilers copy an Intersection for each call, which took a fifth of the time. */
static int kind_of(const int4 lights, const int number) {
#ifdef WITH_PARALLEL
    if (number < lights.x) return 0;
#endif
#if defined(WITH_POINT) && defined(WITH_SPOT)
    return number < lights.x + lights.y ? 1 : 2;
#elif defined(WITH_POINT)
    return 1;
#elif defined(WITH_SPOT)
    return 2;
#else
    return 0;
#endif
}

/* What one light adds to the colour: kd C L max(0, n.l) + ks L max(0, r.v)^exponent, if nothing stands between.
 * kind: of kind_of(). view: the ray's unit direction. rays: the shadow rays cast so far. */
static Shade3 illuminate(const Scene scene, const int number, const int kind, const Intersection at, const INT own,
                         const Shade3 view, Shade3 color, INT *rays, Work *work) {
    const Light light = scene.light[number];
    const Real3 n = at.normal;
    const Real3 to = {light.position.x, light.position.y, light.position.z};
    Real3 w = to;
    REAL cosine = DOT(n, w); /* of n and the light, times |w| */
    if (kind != 0) {
        w = towards(at.start, to);
        /* n.(L - P) by way of the centre, as n.p = r exactly. */
        const Real3 h = {to.x - at.sphere.center.x, to.y - at.sphere.center.y, to.z - at.sphere.center.z};
        cosine = DOT(n, h) - at.sphere.r;
#if REAL_BYTES == 4
        cosine = at.start.near_eye ? DOT(n, w) : cosine;
#endif
    }
    MASK lit = at.hit & TO_MASK(at.side * cosine > 0);
#ifdef WITH_SPOT
    if (kind == 2) lit = lit & TO_MASK(-DOT(w, light.axis) >= light.axis.w * sqrt(DOT(w, w)));
#endif
#ifdef WITH_DULL
    lit = lit & !at.dull;
#endif
    COUNT(FACING_AWAY, at.hit & !lit);
    if (!ANY(lit)) return color;
    const real unit = kind != 0 ? scene.unit : (real)1;
    const Float3 w32 = {TO_FLOAT(w.x * unit), TO_FLOAT(w.y * unit), TO_FLOAT(w.z * unit)};
    const FLOAT a = FMA(w32.x, w32.x, FMA(w32.y, w32.y, w32.z * w32.z));
#ifdef WITH_SHADOWS
    *rays += lit ? (INT)1 : (INT)0;
    const MASK unsure = lit & may_be_blocked(scene, number, own);
    COUNT(SHADOW_RAYS, unsure);
    COUNT(UNBLOCKED, lit & !unsure);
    if (ANY(unsure)) {
        lit = (lit & !unsure) | cast_shadow_ray(scene, number, kind != 0, at, own, w, w32, a, unsure, work);
        if (!ANY(lit)) return color;
    }
#endif

#if SHADE_BYTES == 8
    Shade3 l = {TO_SHADE(w.x), TO_SHADE(w.y), TO_SHADE(w.z)};
#else
    Shade3 l = w32;
    if (ANY(lit & (a < 0x1p-80f))) {
        /* A light that all but touches the surface: |w|^2 must not vanish. */
        const MASK tiny = a < 0x1p-80f;
        l.x = tiny ? TO_FLOAT(w.x * unit * (real)0x1p80f) : l.x;
        l.y = tiny ? TO_FLOAT(w.y * unit * (real)0x1p80f) : l.y;
        l.z = tiny ? TO_FLOAT(w.z * unit * (real)0x1p80f) : l.z;
    }
#endif
    const SHADE over = 1 / sqrt(DOT(l, l));
    l.x *= over;
    l.y *= over;
    l.z *= over;
    const Shade3 N = {TO_SHADE(at.side * n.x), TO_SHADE(at.side * n.y), TO_SHADE(at.side * n.z)};
    const SHADE dot = DOT(N, l);
    const SHADE_MASK on = TO_SHADE_MASK(lit) & (dot > 0);
    const SHADE cosine_nl = dot < 1 ? dot : (SHADE)1;
    SHADE strength = 1;
#ifdef WITH_SPOT
    if (kind == 2 && light.cone.y > 0) {
        const Shade3 axis = {(shade_t)light.axis.x, (shade_t)light.axis.y, (shade_t)light.axis.z};
        const Shade3 cross = {axis.y * l.z - axis.z * l.y, axis.z * l.x - axis.x * l.z, axis.x * l.y - axis.y * l.x};
        const SHADE angle = atan2(sqrt(DOT(cross, cross)), -DOT(axis, l));
        const SHADE fall = 1 - (angle - light.cone.x) * light.cone.y;
        strength = fall < 1 ? (fall > 0 ? fall : (SHADE)0) : (SHADE)1;
    }
#endif
    SHADE highlight = 0;
#ifdef WITH_SPECULAR
    /* r = 2 (n.l) n - l is l mirrored at n; v = -view. */
    const Shade3 e = {2 * dot * N.x - l.x + view.x, 2 * dot * N.y - l.y + view.y, 2 * dot * N.z - l.z + view.z};
    const SHADE z = (shade_t)-0.5 * DOT(e, e);
    /* As log(1 + z) <= z, the lobe is at most exp(exponent z): below light.cone.z, no pixel shows that. */
    const SHADE_MASK shines = on & (at.ks > 0) & (at.exponent * z >= (shade_t)light.cone.z);
    COUNT(HIGHLIGHTS, TO_MASK(shines));
    COUNT(FAINT_HIGHLIGHTS, TO_MASK(on & !shines));
#ifndef KEEP_HIGHLIGHTS
    if (ANY(TO_MASK(shines)))
#endif
        highlight = shines ? at.ks * lobe(z, at.exponent) * strength : (SHADE)0;
#endif
    const SHADE amount = cosine_nl * strength;
    color.x = on ? color.x + (at.diffuse.x * amount + highlight) * light.color.x : color.x;
    color.y = on ? color.y + (at.diffuse.y * amount + highlight) * light.color.y : color.y;
    color.z = on ? color.z + (at.diffuse.z * amount + highlight) * light.color.z : color.z;
    return color;
}
#endif

/* The colour of a ray that hit, and how many shadow rays it took. */
static Shade3 shade(const Scene scene, const Ray ray, const Intersection at, const INT own, INT *rays, Work *work) {
    Shade3 color = at.ambient;
#ifdef WITH_LIGHTS
    const SHADE over = 1 / sqrt(TO_SHADE(ray.a));
    const Shade3 view = {TO_SHADE(ray.d.x) * over, TO_SHADE(ray.d.y) * over, -over};
    for (int number = 0; number < scene.lights.w; number++)
        color = illuminate(scene, number, kind_of(scene.lights, number), at, own, view, color, rays, work);
#endif
    return color;
}

#if defined(OUT_NORMAL) || defined(OUT_DIRECTION)
/* A direction of camera space, in the world. */
static Float3 to_world(const View view, const Real3 v) {
    const Float3 w = {TO_FLOAT(v.x * view.right.x + v.y * view.up.x + v.z * view.back.x),
                      TO_FLOAT(v.x * view.right.y + v.y * view.up.y + v.z * view.back.y),
                      TO_FLOAT(v.x * view.right.z + v.y * view.up.z + v.z * view.back.z)};
    return w;
}
#endif

#ifdef OUT_RGB8
/* Writes a packet of pixels of 3 bytes each: a row of 4 pixels is 3 whole words. */
static void store_rgb8(__global uchar *out, const int first, const int pitch, const LANES(uint) r, const LANES(uint) g,
                       const LANES(uint) b) {
#if W == 1
    vstore3((uchar3)((uchar)r, (uchar)g, (uchar)b), first, out);
#else
    const LANES(uint) p = r | (g << 8) | (b << 16);
#if W == 4
    const uint p0 = p.s0, p1 = p.s1, p2 = p.s2, p3 = p.s3;
    uint word[3];
#elif W == 8
    const uint2 p0 = p.s04, p1 = p.s15, p2 = p.s26, p3 = p.s37;
    uint2 word[3];
#else
    const uint4 p0 = p.s048c, p1 = p.s159d, p2 = p.s26ae, p3 = p.s37bf;
    uint4 word[3];
#endif
    word[0] = p0 | (p1 << 24);
    word[1] = (p1 >> 8) | (p2 << 16);
    word[2] = (p2 >> 16) | (p3 << 8);
    __global uint *row = (__global uint *)(out + 3 * first);
    const int step = 3 * pitch / 4;
    for (int k = 0; k < 3; k++) {
#if W == 4
        row[k] = word[k];
#else
        row[k] = word[k].s0;
        row[step + k] = word[k].s1;
#endif
#if W == 16
        row[2 * step + k] = word[k].s2;
        row[3 * step + k] = word[k].s3;
#endif
    }
#endif
}
#endif

/* Writes one number a lane, `stride` apart. */
#if W == 1
#define STORE(type, out, first, pitch, stride, value) (out)[(long)(first) * (stride)] = (value)
#else
#define STORE(type, out, first, pitch, stride, value)                                                             \
    do {                                                                                                          \
        type lane_[W];                                                                                            \
        STORE_LANES(value, lane_);                                                                                \
        for (int j_ = 0; j_ < W; j_++)                                                                            \
            (out)[((long)(first) + (j_ >> 2) * (pitch) + (j_ & 3)) * (stride)] = lane_[j_];                        \
    } while (0)
#endif

/* Where to write, each as the OUT_ flags say. Rows have `pitch` pixels, whole packets in both directions. */
typedef struct {
    __global uchar *rgb8;
    __global float *color, *normal, *direction;
    __global real *depth;
    __global int *id, *shadow_rays, *work;
    int pitch;
} Outputs;

/* The packet at (x, y) of the region (x, y, width, height) of a picture of this size; all of them multiples of 4. */
static void render_packet(const View view, const Scene scene, const int2 size, const int4 region, const int x,
                          const int y, const Outputs out) {
    const int pitch = out.pitch, first = y * pitch + x;
    const INT column = region.x + x + LANE_COLUMN, line = region.y + y + LANE_ROW;
    const int2 tile = {(region.x + x) >> 2, (region.y + y) >> 2};
    Hit hit = {INFINITY, -1, {0, 0, 1}};
    Shade3 color = {view.background.x, view.background.y, view.background.z};
    Float3 normal = {0, 0, 0};
    INT rays = 0;
    Work counts, *work = &counts;
#ifdef OUT_WORK
    for (int k = 0; k < WORK_KINDS; k++) counts.count[k] = 0;
    if (!has_candidates(scene.lists, tile)) COUNT(BACKGROUND, ALL_LANES);
#endif
    if (has_candidates(scene.lists, tile)) {
        const Ray ray = primary_ray(view, size, column, line);
        hit = closest_hit(scene, ray, tile, work);
#ifdef WITH_INTERSECTION
        if (ANY(hit.id >= 0)) {
            const Intersection at = intersection_at(scene, ray, hit);
#ifdef WITH_SHADING
            const Shade3 own = shade(scene, ray, at, hit.id, &rays, work);
            const SHADE_MASK any_hit = TO_SHADE_MASK(at.hit);
            color.x = any_hit ? own.x : color.x;
            color.y = any_hit ? own.y : color.y;
            color.z = any_hit ? own.z : color.z;
#endif
#ifdef OUT_NORMAL
            const Real3 facing = {at.side * at.normal.x, at.side * at.normal.y, at.side * at.normal.z};
            const Float3 world = to_world(view, facing);
            normal.x = at.hit ? world.x : (FLOAT)0;
            normal.y = at.hit ? world.y : (FLOAT)0;
            normal.z = at.hit ? world.z : (FLOAT)0;
#endif
        }
#endif
    }

#ifdef OUT_RGB8
    const shade_t rounding = view.quantize.x;
    store_rgb8(out.rgb8, first, pitch, byte_of(color.x, rounding), byte_of(color.y, rounding),
               byte_of(color.z, rounding));
#endif
#ifdef OUT_COLOR
    STORE(float, out.color, first, pitch, 3, TO_FLOAT(color.x));
    STORE(float, out.color + 1, first, pitch, 3, TO_FLOAT(color.y));
    STORE(float, out.color + 2, first, pitch, 3, TO_FLOAT(color.z));
#endif
#ifdef OUT_NORMAL
    STORE(float, out.normal, first, pitch, 3, normal.x);
    STORE(float, out.normal + 1, first, pitch, 3, normal.y);
    STORE(float, out.normal + 2, first, pitch, 3, normal.z);
#endif
#if defined(OUT_DIRECTION) || defined(OUT_DEPTH)
    const Ray ray = primary_ray(view, size, column, line);
#endif
#ifdef OUT_DIRECTION
    const REAL over = 1 / sqrt(ray.a);
    const Real3 unit = {ray.d.x * over, ray.d.y * over, -over};
    const Float3 direction = to_world(view, unit);
    STORE(float, out.direction, first, pitch, 3, direction.x);
    STORE(float, out.direction + 1, first, pitch, 3, direction.y);
    STORE(float, out.direction + 2, first, pitch, 3, direction.z);
#endif
#ifdef OUT_DEPTH
    STORE(real, out.depth, first, pitch, 1, hit.t * sqrt(ray.a));
#endif
#ifdef OUT_ID
    STORE(int, out.id, first, pitch, 1, numbers_of(scene, hit.id));
#endif
#ifdef OUT_SHADOW_RAYS
    STORE(int, out.shadow_rays, first, pitch, 1, rays);
#endif
#ifdef OUT_WORK
    for (int k = 0; k < WORK_KINDS; k++) STORE(int, out.work + k, first, pitch, WORK_KINDS, counts.count[k]);
#endif
}

/* A run of packets of the region; this launch starts at its row `row`. The run is a loop of ours, not a work-group:
 * for one of several work-items, PoCL keeps all variables in memory, which took a tenth of the time. */
__kernel void render(const View view, const int2 size, const int4 region, const int row, const int pitch,
                     __global const real4 *center_radius, __global const real2 *power, __global const float4 *rest,
                     __global const int *number, __global const int *material_of, __global const shade8 *material,
                     __global const Light *light, const int4 lights, const int count, __global const float4 *candidate,
                     __global const float4 *occluder, __global const char *outside, __global const int4 *light_grids,
                     __global const Grid *grid, __global const int *start, __global const int2 *entry,
                     __global uchar *rgb8, __global float *color, __global float *normal, __global float *direction,
                     __global real *depth, __global int *id, __global int *shadow_rays, __global int *work) {
    const Spheres spheres = {center_radius, power, rest, view.pixel.w};
    const Lists lists = {grid, start, entry};
    const Scene scene = {spheres,  number, material_of, material,    light, candidate, occluder,
                         outside,  light_grids, lists,       count, lights,    view.pixel.z};
    const Outputs out = {rgb8, color, normal, direction, depth, id, shadow_rays, work, pitch};
    const int begin = (int)get_global_id(0) * RUN * PACKET_WIDTH, y = row + (int)get_global_id(1) * PACKET_HEIGHT;
    if (y >= region.w) return;
    for (int x = begin; x < begin + RUN * PACKET_WIDTH && x < region.z; x += PACKET_WIDTH)
        render_packet(view, scene, size, region, x, y, out);
}

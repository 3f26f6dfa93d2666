/* trace.cl: from a pixel to its colour, as in the course's tutorial and in cltrace/reference/trace.py.
 *
 * Functions of a packet get what they need as it is, scene and ray and counters apart, although it is up to nine
 * arguments: a struct around them all is copied by compilers where the parts are not.
 */

/* Material of each lane's hit. Lanes without a hit keep harmless values. */
static Intersection material_at(const Scene scene, const INT id) {
    Intersection at;
    at.hit = id >= 0;
    at.ambient.x = at.ambient.y = at.ambient.z = at.diffuse.x = at.diffuse.y = at.diffuse.z = at.ks = at.exponent = 0;
#ifdef WITH_SHADING
    FOR_EACH_INDEX(one, id) {
        const SHADE_MASK here = TO_SHADE_MASK(id == one);
        const shade8 m = scene.material[scene.material_of[one]];
        PUT_WHERE(here, at.ambient.x, (SHADE)m.s0);
        PUT_WHERE(here, at.ambient.y, (SHADE)m.s1);
        PUT_WHERE(here, at.ambient.z, (SHADE)m.s2);
        PUT_WHERE(here, at.diffuse.x, (SHADE)m.s3);
        PUT_WHERE(here, at.diffuse.y, (SHADE)m.s4);
        PUT_WHERE(here, at.diffuse.z, (SHADE)m.s5);
        PUT_WHERE(here, at.ks, (SHADE)m.s6);
        PUT_WHERE(here, at.exponent, (SHADE)m.s7);
    }
#endif
#ifdef WITH_BLACK
    at.black = TO_MASK((at.diffuse.x <= 0) & (at.diffuse.y <= 0) & (at.diffuse.z <= 0) & (at.ks <= 0));
#endif
    return at;
}

/* Normal and material of each lane's hit. */
static Intersection intersection_at(const Scene scene, const Ray ray, const Hit hit) {
    Intersection at = material_at(scene, hit.id);
#ifdef WITH_NORMAL
    const Sphere sphere = spheres_of(scene.spheres, hit.id);
    at.normal = sphere_surface(sphere, hit.from_center);
    at.start = start_at(ray, sphere, at.normal, hit.t);
#endif
    return at;
}

/* The colour of each ray that hit. d: the rays' directions, a: d.d; own: index of the sphere that was hit; rays: each
 * lane's shadow rays, counted up. */
static Shade3 shade(const Scene scene, const Real3 d, const REAL a, const Intersection at, const INT own, INT *rays,
                    Work *work) {
    Shade3 color = at.ambient;
#ifdef WITH_LIGHTS
    const SHADE over = 1 / sqrt(TO_SHADE(a));
    const Shade3 view = {TO_SHADE(d.x) * over, TO_SHADE(d.y) * over, TO_SHADE(d.z) * over};
    for (int number = 0; number < scene.lights.w; number++)
        color = illuminate(scene, number, kind_of(scene.lights, number), at, own, view, color, rays, work);
#endif
    return color;
}

#ifdef WITH_BOUNCES
/* The same for rays that left a surface. */
static Intersection intersection_from(const Frame frame, const Scene scene, const Leaving ray, const Met met) {
    Intersection at = material_at(scene, met.id);
    at.normal = normal_from(frame, ray, balls_of(scene.spheres, met.id), met.t);
    at.start = start_of(spheres_of(scene.spheres, met.id), at.normal, met.inside);
    return at;
}

/* Colours that add up to a pixel's, as whole numbers of 2^-40. So their sum does not depend on the order of the rays. */
typedef struct {
    LONG x, y, z;
} Sum3;

/* weight c, rounded to the nearest even one; at most 2^61, as is their sum. Black stays black, where a weight is infinite,
 * too. */
static LONG part_of(const REAL weight, const SHADE c, const LONG sum) {
    const REAL parts = weight * TO_REAL(c) * (real)0x1p40f, most = (real)0x1p61f;
    const REAL kept = parts > 0 ? parts : (REAL)0;
    const LONG total = sum + TO_LONG(rint(kept < most ? kept : most));
    return total < (1L << 61) ? total : (LONG)(1L << 61);
}

static void add_to(Sum3 *sum, const MASK where, const REAL weight, const Shade3 color) {
    const REAL w = TO_REAL_MASK(where) ? weight : (REAL)0;
    sum->x = part_of(w, color.x, sum->x);
    sum->y = part_of(w, color.y, sum->y);
    sum->z = part_of(w, color.z, sum->z);
}

/* Rays on their way, and how much of their colour is in the pixel's. live: the lanes that have one; depth: 0 for those
 * from the eye. */
typedef struct {
    MASK live;
    INT own;
    REAL_MASK inner;
    Real3 n, d;
    REAL weight;
    int depth;
} Branch;

/* What a surface does with the rays that meet it: local (1 - r - t) + r mirrored + t refracted. */
typedef struct {
    REAL share;          /* of the local colour */
    REAL mirrors, sends; /* weights of the mirrored ray and of the refracted one */
    Real3 mirrored, refracted;
    REAL_MASK inside;    /* whether the rays meet it from inside */
} Bounce;

static Bounce bounce_at(const Scene scene, const Intersection at, const INT id, const Branch rays, Work *work) {
    real r[W], t[W], index[W];
    int each[W];
    STORE_LANES(id, each);
    for (int lane = 0; lane < W; lane++) {
        const real4 m = scene.bounce[scene.material_of[max(each[lane], 0)]];
        r[lane] = m.x;
        t[lane] = m.y;
        index[lane] = m.z;
    }
    const REAL R = LOAD_LANES(r), T = LOAD_LANES(t), rest = (1 - R) - T;
    Bounce bounce;
    bounce.share = rest > 0 ? rest : (REAL)0;
    bounce.inside = at.start.side < 0;
    bounce.mirrored = mirrored(rays.d, at.normal, at.start.side);
    bounce.mirrors = rays.weight * R;
#ifdef WITH_GLASS
    const Refraction through = refracted(rays.d, at.normal, at.start.side, LOAD_LANES(index));
    const REAL_MASK total = through.total & (T > 0);
    COUNT(TOTAL, TO_MASK(total) & rays.live);
    bounce.refracted = through.d;
    bounce.mirrors = total ? rays.weight * (R + T) : bounce.mirrors;
    bounce.sends = total ? (REAL)0 : rays.weight * T;
#endif
    return bounce;
}

/* The colours of rays that hit, with all that mirrors and glass add to them. at, own: what was hit; count: the pixels'
 * shadow rays, counted up. */
static Shade3 follow(const Frame frame, const Scene scene, const Ray ray, Intersection at, INT own, INT *count,
                     Work *work) {
    const Shade3 background = {frame.background.x, frame.background.y, frame.background.z};
    Sum3 sum = {0, 0, 0};
    Branch rays = {at.hit, own, 0, at.normal, ray.d, 1, 0};
#ifdef WITH_SPLITS
    Branch stack[BRANCHES];
    int height = 0;
#endif
    for (;;) {
        const int last = rays.depth > scene.bounces;
        Bounce bounce = bounce_at(scene, at, own, rays, work);
        if (last) {
            bounce.share = 1;
            bounce.mirrors = bounce.sends = 0;
        }
        const REAL weight = rays.weight * bounce.share;
        const MASK shown = at.hit & TO_MASK(weight > 0);
        COUNT(WEIGHTLESS, at.hit & !shown);
#ifndef KEEP_WEIGHTLESS
        at.hit = shown;
#endif
        if (ANY(at.hit))
            add_to(&sum, at.hit, weight, shade(scene, rays.d, DOT(rays.d, rays.d), at, own, count, work));

        /* On with the mirrored ray, or where there is none with the refracted one. */
        const MASK mirrors = rays.live & TO_MASK(bounce.mirrors > 0);
        Branch next = {mirrors, own, bounce.inside, at.normal, bounce.mirrored, bounce.mirrors, rays.depth + 1};
#ifdef WITH_GLASS
        const MASK sends = rays.live & TO_MASK(bounce.sends > 0), only = sends & !mirrors;
        const REAL_MASK through = TO_REAL_MASK(only);
        next.live = mirrors | only;
        next.inner = through ? !bounce.inside : bounce.inside;
        PUT_WHERE(through, next.d.x, bounce.refracted.x);
        PUT_WHERE(through, next.d.y, bounce.refracted.y);
        PUT_WHERE(through, next.d.z, bounce.refracted.z);
        PUT_WHERE(through, next.weight, bounce.sends);
#ifdef WITH_SPLITS
        if (ANY(sends & mirrors)) {
            const Branch other = {sends & mirrors, own, !bounce.inside, at.normal, bounce.refracted, bounce.sends, rays.depth + 1};
            stack[height++] = other;
        }
#endif
#endif
        rays = next;
        if (!ANY(rays.live)) {
#ifdef WITH_SPLITS
            if (height) {
                rays = stack[--height];
            } else
#endif
                break;
        }
        COUNT(BOUNCES, rays.live);
        const Leaving path = leaving(frame, scene.spheres, rays.own, rays.inner, rays.n, rays.d);
        const Met met = closest_from(scene, path, rays.live, work);
        add_to(&sum, rays.live & (met.id < 0), rays.weight, background);
        rays.live = rays.live & (met.id >= 0);
        at = intersection_from(frame, scene, path, met);
        own = met.id;
    }
    const Shade3 color = {TO_SHADE(TO_REAL(sum.x) * (real)0x1p-40f), TO_SHADE(TO_REAL(sum.y) * (real)0x1p-40f),
                          TO_SHADE(TO_REAL(sum.z) * (real)0x1p-40f)};
    return color;
}
#endif

/* What a packet of rays sees; lanes that hit nothing keep what they have in `pixels`. tile: the packet's place in the
 * picture, in units of TILE x TILE pixels. */
static Pixels trace(const Frame frame, const Scene scene, const Ray ray, const int2 tile, Pixels pixels, Work *work) {
    const Hit hit = pixels.hit = closest_hit(scene, ray, tile, work);
#ifdef WITH_INTERSECTION
    if (!ANY(hit.id >= 0)) return pixels;
    const Intersection at = intersection_at(scene, ray, hit);
#ifdef WITH_SHADING
#ifdef WITH_BOUNCES
    const Shade3 color = follow(frame, scene, ray, at, hit.id, &pixels.rays, work);
#else
    const Shade3 color = shade(scene, ray.d, ray.a, at, hit.id, &pixels.rays, work);
#endif
    const SHADE_MASK any_hit = TO_SHADE_MASK(at.hit);
    PUT_WHERE(any_hit, pixels.color.x, color.x);
    PUT_WHERE(any_hit, pixels.color.y, color.y);
    PUT_WHERE(any_hit, pixels.color.z, color.z);
#endif
#ifdef OUT_NORMAL
    const Real3 n = at.normal;
    const Real3 facing = {at.start.side * n.x, at.start.side * n.y, at.start.side * n.z};
    const Float3 world = to_world(frame, facing);
    pixels.normal.x = at.hit ? world.x : (FLOAT)0;
    pixels.normal.y = at.hit ? world.y : (FLOAT)0;
    pixels.normal.z = at.hit ? world.z : (FLOAT)0;
#endif
#endif
    return pixels;
}

/* Renders the packet at (x, y) of a region (x, y, width, height) of a picture of this size, all in pixels. The region
 * begins at a tile, so no packet is in two tiles. */
static void render_packet(const Frame frame, const Scene scene, const int2 size, const int4 region, const int x,
                          const int y, const Outputs out) {
    const INT column = region.x + x + LANE_COLUMN, row = region.y + y + LANE_ROW;
    const int2 tile = {(region.x + x) / TILE, (region.y + y) / TILE};
    Pixels pixels = {{INFINITY, -1, {0, 0, 1}},
                     {frame.background.x, frame.background.y, frame.background.z},
                     {0, 0, 0},
                     0};
    Work counts, *work = &counts;
#ifdef OUT_WORK
    for (int k = 0; k < COUNTERS; k++) counts.count[k] = 0;
#endif
    if (tile_has_any(scene.lists, tile)) {
        pixels = trace(frame, scene, primary_ray(frame, size, column, row), tile, pixels, work);
    } else {
        COUNT(BACKGROUND, ALL_LANES);
    }
#ifdef OUT_ID
    pixels.hit.id = ids_of(scene, pixels.hit.id);
#endif
    write(frame, size, column, row, pixels, work, out, y * out.pitch + x);
}

/* Each work-item renders RUN packets, side by side, one after the other. That is a loop here rather than a work-group:
 * where a group has several work-items, PoCL keeps all variables in memory, which took a tenth of the time. */
__kernel void render(RENDER_PARAMETERS) {
    const Scene scene = SCENE_OF_PARAMETERS;
    const Outputs out = OUTPUTS_OF_PARAMETERS;
    const int begin = (int)get_global_id(0) * RUN * PACKET_WIDTH, y = row + (int)get_global_id(1) * PACKET_HEIGHT;
    if (y >= region.w) return;
    for (int x = begin; x < begin + RUN * PACKET_WIDTH && x < region.z; x += PACKET_WIDTH)
        render_packet(frame, scene, size, region, x, y, out);
}

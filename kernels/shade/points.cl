/* points.cl: points that rays have met: normals and materials, how rays go on from there, and what pixels show. */

/* Points of surfaces of whatever shape. Each shape's function is called for its own lanes. */

#ifdef WITH_PLANES
/* Puts caps that rays have met into an intersection. planes: theirs, -1 for none; P: the points, in camera space. */
static __attribute__((noinline)) void put_caps(const Frame *camera, const Scene *scene, const Leaving *ray,
                                               const INT planes, const Real3 P, Intersection *at) {
    const Frame frame = *camera;
    const Leaving way = *ray;
    const PairRay fine = pair_ray(scene->geometry, way);
    for (int plane = 0; plane < scene->geometry.planes; plane++) {
        const MASK cap = planes == plane;
        if (!ANY(cap)) continue;
        const REAL_MASK here = TO_REAL_MASK(cap);
        const real4 S = scene->geometry.clip[2 * plane], m = scene->geometry.clip[2 * plane + 1];
        const REAL over_size = -1 / sqrt((REAL)((m.x * m.x + m.y * m.y) + m.z * m.z));
        const Real3 outward = {over_size * m.x, over_size * m.y, over_size * m.z};
        const Real3 n = turned_to_camera(frame, outward);
        Pair t;
        const Pair3 step = point_on_plane(fine, height_along(scene->geometry, way, fine, plane), &t);
        const Real3 place = {plus(pair(way.center.x, 0), step.x).hi, plus(pair(way.center.y, 0), step.y).hi,
                             plus(pair(way.center.z, 0), step.z).hi};
        PUT3(PUT_WHERE, here, at->normal, n);
        PUT3(PUT_WHERE, here, at->q, place);
        PUT_WHERE(here, at->spread, (REAL)1);
        start_at_place(here, P, (REAL)1, &at->start);
        start_from_place(here, (Place3){place, {0, 0, 0}, 0}, &at->start);
        PUT3(PUT_WHERE, here, at->start.q, place);
        PUT_WHERE(cap, at->start.index, (INT)CAP);
        PUT_WHERE(here, at->u, (REAL)0);
        PUT_WHERE(here, at->v, (REAL)0);
        if (!HAS_COLORS(scene) || S.w < 0) continue;
        const shade8 material = scene->material[(int)S.w];
        put_material(TO_SHADE_MASK(cap), material, at);
        PUT_WHERE(cap, at->black, (MASK)(material.s3 + material.s4 + material.s5 + material.s6 <= 0 ? -1 : 0));
        at->matte = at->matte | cap;
    }
}
#else
#define put_caps(camera, scene, ray, planes, P, at)
#endif

/* Puts what a ray from the eye has met into an intersection, but for its material. */
static __attribute__((always_inline)) void put_surfaces(const Frame frame, const Scene *scene, const Ray ray,
                                                        const Hit hit, Intersection *at) {
    Hit own = hit;
    if (HAS(WITH_PLANES)) own.id = hit.plane >= 0 ? (INT)-1 : hit.id;
    if (HAS(WITH_PLANES)) at->matte = 0;
    EACH_SHAPE(scene->geometry, own.id, put(frame, scene, ray, own, at));
    if (TEXTURED(scene)) paint(scene, own.id, at);
    if (HAS(WITH_PLANES) && ANY(hit.plane >= 0)) {
        const Leaving way = from_eye(scene->geometry, eye_ray(ray));
        put_caps(&frame, scene, &way, hit.plane, point_at(ray, hit.t), at);
    }
}

#ifdef WITH_BOUNCES
/* Normal and material of what a ray that left a surface has met. */
static Intersection intersection_from(const Frame frame, const Scene *scene, const Leaving ray, const Met met) {
    Intersection at = material_at(scene, met.id);
    Met own = met;
    if (HAS(WITH_PLANES)) own.id = met.plane >= 0 ? (INT)-1 : met.id;
    if (HAS(WITH_PLANES)) at.matte = 0;
    EACH_SHAPE(scene->geometry, own.id, put_from(frame, scene, ray, own, &at));
    if (TEXTURED(scene)) paint(scene, own.id, &at);
    if (HAS(WITH_PLANES) && ANY(met.plane >= 0))
        put_caps(&frame, scene, &ray, met.plane, point_from(frame, scene, ray, met), &at);
    return at;
}
#endif

/* Where mirrors and glass send a ray on. cltrace/reference/bounce.py has the same functions.
 *
 * Directions are never normalised on the way: their length stays that of the first one, but for rounding. n is the
 * outward unit normal; side is 1 where the ray came from outside and -1 where it came from inside. spread: of an
 * ellipsoid by how much its map may make an error larger, of a sphere 1.
 */
#ifdef WITH_BOUNCES
#define LIFT ((real)(REAL_BYTES == 8 ? 0x1p-48f : 0x1p-19f))

/* The direction, turned off the surface where rounding left it not surely on its side: there n.d is less than LIFT |d|,
 * and all that is off in it, here and in the decision about the own surface, is below that. */
static Real3 lift(const Real3 d, const Real3 n, const REAL side, const REAL spread) {
    const REAL e = side * DOT(n, d), least = LIFT * size_of(d) * spread;
    return sum3(d, scaled(n, e > least ? (REAL)0 : side * (2 * least - e)));
}

static Real3 mirrored(const Real3 d, const Real3 n, const REAL side, const REAL spread) {
    return lift(difference(d, scaled(n, 2 * DOT(n, d))), n, side, spread);
}

typedef struct {
    Real3 d;
    REAL_MASK total; /* whether all of it is reflected instead, and d is of no use */
} Refraction;

/* After Snell: with N facing the ray and c = -N.d, the part of d along the surface, d + c N, becomes eta times as long,
 * and the rest of |d| is along -N. Where nothing is left for that, reflection is total. (d x n)^2 keeps the digits that
 * 1 - c^2 would lose. */
static Refraction refracted(const Real3 d, const Real3 n, const REAL side, const REAL index, const REAL spread) {
    const REAL eta = side > 0 ? 1 / index : index, c = -(side * DOT(n, d));
    const Real3 N = scaled(n, side), X = cross_of(n, d);
    const REAL k = DOT(d, d) - (eta * eta) * DOT(X, X), root = sqrt(k > 0 ? k : (REAL)0);
    const REAL_MASK same = index == 1;
    const Real3 bent = difference(scaled(sum3(d, scaled(N, c)), eta), scaled(N, root));
    return (Refraction){chosen(same, d, lift(bent, n, -side, spread)), !same & (k < 0)};
}
#endif

/* What is known of a packet of pixels, in the units of the outputs. */

/* The byte, 0 .. 255, of a part of a linear colour, without gamma. rounding: 0.5 rounds to nearest, 0 rounds down. The
 * comparisons are such that a NaN would be black. */
static LANES(uint) byte_of(const SHADE value, const shade_t rounding) {
    const SHADE low = value > 0 ? value : (SHADE)0;
    const SHADE clamped = low < 1 ? low : (SHADE)1;
    return TO(uint, clamped * (shade_t)255 + rounding);
}

/* Turns a direction from camera space into the world. */
static Float3 to_world(const Frame frame, const Real3 v) {
    const Real3 turned = turned_to_world(frame, v);
    return (Float3){TO_FLOAT(turned.x), TO_FLOAT(turned.y), TO_FLOAT(turned.z)};
}

/* What is known of a packet of pixels when all is traced and shaded. */
typedef struct {
    Hit hit;
    Shade3 color;
    Float3 normal;          /* in the world, facing the ray; 0 where nothing was hit */
    INT rays;               /* shadow rays */
    FLOAT error, coverage;  /* WITH_SAMPLES: of the mean colour, in levels of 255; the share that surfaces have */
    FLOAT u, v;             /* where it is on a texture, 0 where nothing was hit */
    MASK wanted, overgrown; /* whether it is in the region; WITH_SPLITS: whether it takes more than MOST_RAYS rays */
} Pixels;

/* Puts colours into the pixels in which something was hit. */
static __attribute__((always_inline)) void show_colors(const MASK hit, const Shade3 color, Pixels *pixels) {
    const SHADE_MASK any_hit = TO_SHADE_MASK(hit);
    PUT3(PUT_WHERE, any_hit, pixels->color, color);
}

/* Puts the normals of the points that were hit into pixels, and where these are on textures. */
static __attribute__((always_inline)) void show_points(const Frame frame, const Intersection at, Pixels *pixels) {
    const Float3 world = to_world(frame, scaled(at.normal, at.start.side)), none = {0, 0, 0};
    pixels->normal = none;
    PUT3(PUT_WHERE, at.hit, pixels->normal, world);
    pixels->u = at.hit ? TO_FLOAT(at.u) : (FLOAT)0;
    pixels->v = at.hit ? TO_FLOAT(at.v) : (FLOAT)0;
}

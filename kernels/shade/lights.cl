/* lights.cl: what a light adds to a colour. */

/* All that is known of the points that were hit. */
typedef struct {
    MASK hit;
#ifdef WITH_BLACK
    MASK black; /* the material reflects no light at all */
#endif
    Real3 normal;   /* outward unit normal of the sphere, in camera space */
    Start start;    /* where its shadow rays start; start.side * normal faces the ray */
#ifdef WITH_SHAPES
    Real3 q;     /* see Spot and leave_triangle() */
    REAL spread; /* see lift() */
#endif
#ifdef WITH_UV
    REAL u, v; /* where the points are on a texture, see texture.cl */
#endif
    Shade3 ambient; /* ka La C */
    Shade3 diffuse; /* kd C */
    SHADE ks, exponent;
#if defined(WITH_MARKS) && defined(WITH_TEXTURES)
    INT texel; /* where the colour is in memory, -1 without a texture */
#endif
} Intersection;

#ifdef WITH_LIGHTS
/* The kind of a light, by its index in the buffers: 0 parallel, 1 point, 2 spot. So one loop over all lights can
 * call illuminate() from one place, where it is inlined: otherwise compilers copy an Intersection for each call,
 * which took a fifth of the time. lights: how many there are of each kind, and of all. */
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

/* A light as it is seen from the points that were hit. */
typedef struct {
    Real3 w;     /* from the point to the light; to a parallel light a vector of length 1 */
    REAL cosine; /* of the angle between w and the outward normal, times |w| */
} Direction;

static Direction direction_to(const Light light, const int kind, const Intersection at) {
    const Real3 n = at.normal, C = at.start.own.center;
    const Real3 to = {light.position.x, light.position.y, light.position.z};
    Direction direction = {to, DOT(n, to)};
    if (kind != 0) {
        direction.w = towards(at.start, to);
        /* n.(L - P) by way of the centre, as n.p = r exactly, or of an ellipsoid n.p = support. */
        const Real3 h = {to.x - C.x, to.y - C.y, to.z - C.z};
#ifdef WITH_SHAPES
        direction.cosine = DOT(n, h) - at.start.support;
#else
        direction.cosine = DOT(n, h) - at.start.own.r;
#endif
#if REAL_BYTES == 4
        direction.cosine = at.start.near_eye ? DOT(n, direction.w) : direction.cosine;
#endif
    }
    return direction;
}

/* The unit vector from the point to the light. w: the vector itself; w32: the same in the float buffers' unit;
 * a: |w32|^2; unit: w32 / w. */
static Shade3 unit_to(const Real3 w, const Float3 w32, const FLOAT a, const MASK lit, const real unit) {
#if SHADE_BYTES == 8
    Shade3 l = {TO_SHADE(w.x), TO_SHADE(w.y), TO_SHADE(w.z)};
#else
    Shade3 l = w32;
    if (ANY(lit & (a < 0x1p-80f))) {
        /* The light all but touches the surface: without a factor, |w|^2 would vanish in float. */
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
    return l;
}

/* The share of a light that leaves along -l. Of a spot light it is 1 up to the angle alpha1 from its axis, and falls
 * linearly with the angle to 0 at alpha2; of other lights it is 1. */
static SHADE strength_of(const Light light, const int kind, const Shade3 l) {
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
    return strength;
}

/* The colour and what one light adds to it: kd C L max(0, n.l) + ks L max(0, r.v)^exponent, if nothing stands between.
 * number: the light's index in the buffers; kind: of kind_of(); own: index of the sphere that was hit; view: the unit
 * direction of the ray that hit; rays: how many shadow rays each lane has sent, counted up. It is the tutorial's formula
 * from its first line to its last, and so longer than a screen. */
static Shade3 illuminate(const Scene scene, const int number, const int kind, const Intersection at, const INT own,
                         const Shade3 view, Shade3 color, INT *rays, Work *work) {
    const Light light = scene.light[number];
    const Direction direction = direction_to(light, kind, at);
    const Real3 w = direction.w;
    MASK lit = at.hit & TO_MASK(at.start.side * direction.cosine > 0);
#ifdef WITH_SPOT
    if (kind == 2) lit = lit & TO_MASK(-DOT(w, light.axis) >= light.axis.w * sqrt(DOT(w, w)));
#endif
#ifdef WITH_BLACK
    lit = lit & !at.black;
#endif
    COUNT(FACING_AWAY, at.hit & !lit);
    if (!ANY(lit)) return color;
    const real unit = kind != 0 ? scene.unit : (real)1;
    const Float3 w32 = {TO_FLOAT(w.x * unit), TO_FLOAT(w.y * unit), TO_FLOAT(w.z * unit)};
    const FLOAT a = FMA(w32.x, w32.x, FMA(w32.y, w32.y, w32.z * w32.z));
#ifdef WITH_SHADOWS
    *rays += lit ? (INT)1 : (INT)0;
    const MASK unsure = lit & may_be_stopped(scene, number, own);
    COUNT(SHADOW_RAYS, unsure);
    COUNT(UNSTOPPABLE, lit & !unsure);
    if (ANY(unsure)) {
        const ShadowRay ray = {number, kind != 0, w, w32, a};
        lit = (lit & !unsure) | cast_shadow_ray(scene, ray, at.start, own, unsure, work);
        if (!ANY(lit)) return color;
    }
#endif
    MARK(mark, lit, own, ~number);

    const Shade3 l = unit_to(w, w32, a, lit, unit);
    const Shade3 N = {TO_SHADE(at.start.side * at.normal.x), TO_SHADE(at.start.side * at.normal.y),
                      TO_SHADE(at.start.side * at.normal.z)};
    const SHADE dot = DOT(N, l);
    const SHADE_MASK on = TO_SHADE_MASK(lit) & (dot > 0);
    const SHADE cosine_nl = dot < 1 ? dot : (SHADE)1;
    const SHADE strength = strength_of(light, kind, l);
    SHADE highlight = 0;
#ifdef WITH_SPECULAR
    /* r = 2 (n.l) n - l is l mirrored at n; v = -view. */
    const Shade3 e = {2 * dot * N.x - l.x + view.x, 2 * dot * N.y - l.y + view.y, 2 * dot * N.z - l.z + view.z};
    const SHADE z = (shade_t)-0.5 * DOT(e, e);
    /* As log(1 + z) <= z, the lobe is at most exp(exponent z). Where exponent z is less than light.cone.z, that is too
     * faint for any pixel to show. */
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

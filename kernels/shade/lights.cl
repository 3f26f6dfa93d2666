/* lights.cl: what a light adds to a colour. */

/* All that is known of the points that were hit. */
typedef struct {
    MASK hit;
    MASK black;     /* WITH_BLACK, whether the material reflects no light at all */
    Real3 normal;   /* outward unit normal of the sphere, in camera space */
    Start start;    /* where its shadow rays start; start.side * normal faces the ray */
    Real3 q;        /* WITH_SHAPES, see Spot and place_on() */
    REAL spread;    /* WITH_SHAPES, see lift() */
    REAL u, v;      /* WITH_UV, where the points are on a texture, see texture.cl */
    Shade3 ambient; /* ka La C */
    Shade3 diffuse; /* kd C */
    SHADE ks, exponent;
    INT texel;   /* WITH_SAMPLES, where the colour is in memory, -1 without a texture */
    MASK uneven; /* WITH_SAMPLES, whether it is in a square of texels that differ by much, see plan/materials.py */
    MASK matte;  /* WITH_PLANES, whether it is a cap with a material of its own */
} Intersection;

/* What is known of the colours of points while lights are added. */
typedef struct {
    Shade3 view;  /* the unit direction of the ray that hit */
    Shade3 color; /* so far */
    INT rays;     /* how many shadow rays each lane has sent */
} Lighting;

/* The unit vector from the point to the light. */
#if SHADE_BYTES == 8
static Shade3 unit_to(const ShadowRay ray, const MASK lit) {
    const SHADE over = 1 / sqrt(DOT(ray.w, ray.w));
    const Shade3 l = {ray.w.x * over, ray.w.y * over, ray.w.z * over};
    return l;
}
#else
static Shade3 unit_to(const ShadowRay ray, const MASK lit) {
    Shade3 l = ray.w32;
    const MASK tiny = ray.a < 0x1p-80f;
    if (ANY(lit & tiny)) {
        /* The light all but touches the surface, or is near for the unit of lengths: in float, |w|^2 would vanish. A
         * power of two leaves the digits that w has in any unit. */
        const Real3 w = {ray.w.x * (real)0x1p80f, ray.w.y * (real)0x1p80f, ray.w.z * (real)0x1p80f};
        const REAL over = POWER_OF_TWO(1 / sqrt(DOT(w, w)));
        l.x = tiny ? TO_FLOAT(w.x * over) : l.x;
        l.y = tiny ? TO_FLOAT(w.y * over) : l.y;
        l.z = tiny ? TO_FLOAT(w.z * over) : l.z;
    }
    const SHADE over = 1 / sqrt(DOT(l, l));
    l.x *= over;
    l.y *= over;
    l.z *= over;
    return l;
}
#endif

/* Adds what one light does if nothing stands between: kd C L max(0, n.l) + ks L max(0, r.v)^exponent. lit: the lanes
 * where it is seen; l: the unit vector to it; strength: the share of it that leaves along -l. */
static void phong(const Light light, const SHADE strength, const Shade3 l, const Intersection at, const MASK lit,
                  Lighting *lighting, Work *work) {
    const Shade3 N = {TO_SHADE(at.start.side * at.normal.x), TO_SHADE(at.start.side * at.normal.y),
                      TO_SHADE(at.start.side * at.normal.z)};
    const SHADE dot = DOT(N, l);
    const SHADE_MASK on = TO_SHADE_MASK(lit);
    /* Where it is lit, n.l > 0 is known; so a highlight does not end where the rounded cosine does. Above 1, what is
     * diffuse and a highlight could overflow, see finite32() of plan/materials.py. */
    const SHADE cosine_nl = min(max(dot, (SHADE)0), (SHADE)1);
    SHADE highlight = 0;
    if (HAS(WITH_SPECULAR)) {
        /* r = 2 (n.l) n - l is l mirrored at n; v = -view. */
        const Shade3 view = lighting->view;
        const Shade3 e = {2 * dot * N.x - l.x + view.x, 2 * dot * N.y - l.y + view.y, 2 * dot * N.z - l.z + view.z};
        const SHADE z = (shade_t)-0.5 * DOT(e, e);
        /* As log(1 + z) <= z, the lobe is at most exp(exponent z). Where exponent z is less than light.cone.z, that is
         * too faint for any pixel to show. */
        const SHADE_MASK shines = on & (at.ks > 0) & (at.exponent * z >= (shade_t)light.cone.z);
        COUNT(HIGHLIGHTS, TO_MASK(shines));
        COUNT(FAINT_HIGHLIGHTS, TO_MASK(on & !shines));
        if (HAS(KEEP_HIGHLIGHTS) || ANY(TO_MASK(shines)))
            highlight = shines ? at.ks * lobe(z, at.exponent) * strength : (SHADE)0;
    }
    const SHADE amount = cosine_nl * strength;
    Shade3 *color = &lighting->color;
    color->x = on ? color->x + (at.diffuse.x * amount + highlight) * light.color.x : color->x;
    color->y = on ? color->y + (at.diffuse.y * amount + highlight) * light.color.y : color->y;
    color->z = on ? color->z + (at.diffuse.z * amount + highlight) * light.color.z : color->z;
}

/* The shadow ray to a light, along w. */
static ShadowRay shadow_ray_to(const Scene *scene, const int number, const int at_point, const Real3 w, const INT own) {
    const real unit = at_point ? scene->unit : (real)1;
    ShadowRay ray = {number, own, at_point, w, {TO_FLOAT(w.x * unit), TO_FLOAT(w.y * unit), TO_FLOAT(w.z * unit)}};
    ray.a = FMA(ray.w32.x, ray.w32.x, FMA(ray.w32.y, ray.w32.y, ray.w32.z * ray.w32.z));
    return ray;
}

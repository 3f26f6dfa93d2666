/* phong.cl: what a light adds to a colour, by Phong's formula. */

/* The highlight of Phong's formula. */

/* log(1 + z) for z in (-1, 0] and exp(y) for y <= 0, by operations that are rounded the same everywhere: the standard
 * lets log1p, exp and pow differ between devices, and drivers compute them one lane at a time. The polynomials are
 * Chebyshev interpolants on sqrt(1/2) - 1 .. sqrt(2) - 1, and on -log(2)/2 .. log(2)/2. */
#if SHADE_BYTES == 4
/* That of (log(1 + f) - f + f^2/2) / f^3, with a relative error of 2.5e-8 without rounding. */
static FLOAT log_1_plus(const FLOAT z) {
    const FLOAT s = 1.0f + z;
    const INT power = (AS(int, s) - 0x3f3504f3) >> 23; /* s = 2^power m, m in sqrt(1/2) .. sqrt(2) */
    const FLOAT m = AS(float, AS(int, s) - (power << 23));
    const FLOAT f = power == 0 ? z : m - 1.0f; /* z itself where 1 + z lost its digits */
    FLOAT g = -0.0790274377f;
    g = FMA(g, f, (FLOAT)0.126223198f);
    g = FMA(g, f, (FLOAT)-0.129981838f);
    g = FMA(g, f, (FLOAT)0.142144959f);
    g = FMA(g, f, (FLOAT)-0.166412815f);
    g = FMA(g, f, (FLOAT)0.200010451f);
    g = FMA(g, f, (FLOAT)-0.250003064f);
    g = FMA(g, f, (FLOAT)0.333333307f);
    g = FMA(g, f, (FLOAT)-0.5f);
    return FMA(TO_FLOAT(power), (FLOAT)0.693147181f, FMA(g * f, f, f));
}

/* That of exp, with 2.5e-9. */
static FLOAT exp_negative(const FLOAT y) {
    const FLOAT x = y < -87.0f ? (FLOAT)-87.0f : y; /* below, the result is 0 at any rate */
    const FLOAT k = FMA(x, (FLOAT)1.44269504f, (FLOAT)12582912.0f) - 12582912.0f;    /* x / log(2), rounded */
    const FLOAT f = FMA(k, (FLOAT)-1.42860677e-6f, FMA(k, (FLOAT)-0.693145752f, x)); /* log(2) in two parts */
    FLOAT g = 0.00139411084f;
    g = FMA(g, f, (FLOAT)0.0083751264f);
    g = FMA(g, f, (FLOAT)0.0416663529f);
    g = FMA(g, f, (FLOAT)0.166664155f);
    g = FMA(g, f, (FLOAT)0.500000005f);
    g = FMA(g, f, (FLOAT)1.00000004f);
    g = FMA(g, f, (FLOAT)1.0f);
    const FLOAT two_to_k = AS(float, (TO_INT(k) + 127) << 23);
    return y < -87.0f ? (FLOAT)0.0f : g * two_to_k;
}
#else
/* By way of r = f / (2 + f): log(1 + f) = 2 atanh(r). The polynomial is that of (atanh(r) - r) / r^3 in r^2, with which
 * the relative error is 2^-57 without rounding. With it, u = 2^-53: r is off by 3 u r, and the sum by about as much, so
 * the logarithm is within 8 u of itself. Where `power` is not 0, it is at least log(2) / 2, and the rounding of s is
 * off by u of 1. */
static REAL log_1_plus(const REAL z) {
    const REAL s = 1 + z;
    const REAL_INT bits = AS(long, s), biased = (bits + 0x00095f619980c433L) >> 52; /* power + 1023 */
    const REAL m = AS(double, bits - ((biased - 1023) << 52)); /* s = 2^power m, m in sqrt(1/2) .. sqrt(2) */
    const REAL power = AS(double, biased | 0x4330000000000000L) - (0x1p52 + 1023);
    const REAL f = power == 0 ? z : m - 1; /* z itself where 1 + z lost its digits */
    const REAL r = f / (2 + f), w = r * r;
    REAL g = 0.07308224842521703;
    g = g * w + 0.07665860800278021;
    g = g * w + 0.09091444562630861;
    g = g * w + 0.1111110556739754;
    g = g * w + 0.14285714312987743;
    g = g * w + 0.19999999999949752;
    g = g * w + 0.3333333333333335;
    return power * 0.6931471805599453 + 2 * (r + r * (w * g));
}

/* The polynomial is that of (exp(f) - 1 - f) / f^2, with which the relative error is 2^-55 without rounding, and below
 * 2^-51 with it, but for what is off in y. */
static REAL exp_negative(const REAL y) {
    const REAL x = y < -708.0 ? (REAL)-708.0 : y; /* below, the result is 0 at any rate */
    const REAL shifted = x * 1.4426950408889634 + 0x1.8p52, k = shifted - 0x1.8p52; /* x / log(2), rounded */
    const REAL f = (x - k * 0.6931471803691238) - k * 1.9082149292705877e-10;       /* log(2) in two parts */
    REAL g = 2.5100375832561234e-08;
    g = g * f + 2.7620075879983367e-07;
    g = g * f + 2.7557268480310024e-06;
    g = g * f + 2.4801521322368692e-05;
    g = g * f + 0.00019841269863040545;
    g = g * f + 0.0013888888917196719;
    g = g * f + 0.008333333333330065;
    g = g * f + 0.041666666666624164;
    g = g * f + 0.16666666666666669;
    g = g * f + 0.5;
    const REAL two_to_k = AS(double, (AS(long, shifted) + 1023) << 52);
    return y < -708.0 ? (REAL)0 : (1 + (f + f * f * g)) * two_to_k;
}
#endif

/* max(0, r.v)^exponent for unit vectors r and v; 0^0 = 1. z = r.v - 1, computed as -|r - v|^2 / 2. So z is never
 * above 0, and it keeps all digits where r.v is close to 1: then the power loses none, however large the exponent. */
static SHADE lobe(const SHADE z, const SHADE exponent) {
    const SHADE_MASK facing = z > -1;
    const SHADE power = exp_negative(exponent * log_1_plus(facing ? z : (SHADE)0));
    return facing ? power : (exponent == 0 ? (SHADE)1 : (SHADE)0);
}

/* What a light adds to a colour. */

/* All that is known of the points that were hit. */
typedef struct {
    MASK hit;
    MASK black;     /* whether the material reflects no light at all */
    Real3 normal;   /* outward unit normal of the sphere, in camera space */
    Start start;    /* where its shadow rays start; start.side * normal faces the ray */
    Real3 q;        /* WITH_SHAPES, see Spot and places_of() */
    REAL spread;    /* WITH_SHAPES, see lift() */
    REAL u, v;      /* if MAPPED(), where the points are on a texture, see materials.cl */
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
    return scaled(ray.w, 1 / sqrt(DOT(ray.w, ray.w)));
}
#else
static Shade3 unit_to(const ShadowRay ray, const MASK lit) {
    Shade3 l = ray.w32;
    const MASK tiny = ray.a < 0x1p-80f;
    if (ANY(lit & tiny)) {
        /* The light all but touches the surface, or is near for the unit of lengths: in float, |w|^2 would vanish. A
         * power of two leaves the digits that w has in any unit. */
        const Real3 w = scaled(ray.w, (real)0x1p80f);
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

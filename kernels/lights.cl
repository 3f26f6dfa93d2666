/* lights.cl: angles, the kinds of lights, and the way from a point of a surface to a light. */

/* Angles of vectors. A turn is TURN radians. */

/* atan(r) / (2 pi r) for |r| <= tan(pi / 8), by powers of r^2: a Chebyshev interpolant of (atan(r) - r) / r^3 on that
 * range, behind the 1 of the series. Without rounding of what is computed from them, its relative error is 2^-53 in
 * double and 2^-24 in float. */
#if REAL_BYTES == 8
#define TURN 6.2831853071795862
#define TAN_PI_8 0.41421356237309503
#define TURNS 12
__constant double turn_parts[TURNS] = {0.15915494309189535,    -0.053051647697298442, 0.031830988618371941,
                                       -0.022736420440031799,  0.017683882413208576,  -0.014468624007851604,
                                       0.012242489779883597,   -0.010606899401433589, 0.0093235335684088427,
                                       -0.0080937446363857617, 0.0062439123434348629, -0.0030520963781140546};
#else
#define TURN 6.28318531f
#define TAN_PI_8 0.41421357f
#define TURNS 6
__constant float turn_parts[TURNS] = {0.15915494f,    -0.0530516468f, 0.0318302587f,
                                      -0.0227017906f, 0.0170991793f,  -0.0102685625f};
#endif

/* The angle of the vector (x, y) from the x axis in turns, -1/2 .. 1/2: what atan2(y, x) / (2 pi) is, by operations
 * that are rounded the same everywhere. Of multiples of an eighth turn it is exactly that; of (0, 0) it is 0.
 *
 * It is off by less than 2^-51, or in float 2^-21. With u = 2^-53: the quotient r is off by 3 u r, which is as much of
 * the angle at most; the sum of the series by 2 u for its last steps and what is said above, as its later terms are
 * small; the product by u. That is less than 8 u of an angle of 1/16 turn at most. Each of the three sums that follow
 * adds u/2 of a number up to 1/2. So all of it is below 2 u; in float likewise. */
static REAL turns_of(const REAL y, const REAL x) {
    const REAL h = fabs(y), w = fabs(x);
    const REAL_MASK steep = h > w;
    const REAL low = steep ? w : h, high = steep ? h : w;
    const REAL_MASK large = low > high * TAN_PI_8;
    const REAL over = large ? low + high : high;
    const REAL r = (large ? low - high : low) / (over > 0 ? over : (REAL)1);
    const REAL square = r * r;
    REAL sum = turn_parts[TURNS - 1];
    for (int k = TURNS - 2; k >= 0; k--) sum = sum * square + turn_parts[k];
    const REAL octant = r * sum + (large ? (REAL)0.125f : (REAL)0);
    const REAL quadrant = steep ? (REAL)0.25f - octant : octant;
    const REAL angle = x < 0 ? (REAL)0.5f - quadrant : quadrant;
    return y < 0 ? -angle : angle;
}

/* The kinds of lights, LIGHT_KINDS of cltrace/plan/abi.py, and the way from a point of a surface to one.
 *
 * A parallel light is infinitely far away, as the sun all but is. Its `position` is the unit vector towards it, and its
 * `axis` and `across` are unit vectors across that. All other lights are at a point, `position`, in camera space. A
 * point light shines in all directions alike. A spot light shines into a cone around `axis` only: its strength is 1 up
 * to the angle alpha1 from there, and falls linearly with the angle to 0 at alpha2. A lambert light is at a point of a
 * flat lamp, across `axis`, and its strength is the cosine of the angle from there.
 */

/* A light as it is seen from the points that were hit. */
typedef struct {
    Real3 w;     /* from the point to the light; to a parallel light a vector of length 1 */
    REAL cosine; /* of the angle between w and the outward normal, times |w| */
} Direction;

/* A shadow ray, from a point P of a surface to a light, and where it is in the light's lists. Lengths that are FLOAT,
 * and `from`, are in the float buffers' unit. */
typedef struct {
    int number;   /* the light's index in the buffers */
    INT own;      /* the index of the surface that P is on */
    int at_point; /* whether the light is at a point; else it is parallel */
    Real3 w;      /* from P to the light; to a parallel light a vector of length 1 */
    Float3 w32;   /* the same in the float buffers' unit; a parallel light's has length 1 here, too */
    FLOAT a;      /* |w32|^2 */
    /* Known once cast_shadow_ray() has asked the light: */
    Real3 from;  /* from the light to P, times 2^80 if `touches`; of a parallel light: P itself */
    FLOAT u, v;  /* of a parallel light: the coordinates of P across it */
    FLOAT depth; /* P's place in the depth order: |P - L|^2; of a parallel light: -P.l, with l the unit vector to it */
    int touches; /* whether some lit P is so near the light that float32 cannot tell the direction between them */
} ShadowRay;

/* What the kinds of lights ask of a start: a point P of a surface. support_of(): how far the plane across its normal is
 * from its centre; point_of(): P itself, rounded, in camera space. */
#define support_of(start) (HAS(WITH_SHAPES) ? (start).support : (start).own.r)

static Real3 point_of(const Start start) {
    const Real3 P = sum3(start.own.center, start.p);
    return REAL_BYTES == 4 ? chosen(start.near_eye, start.from_eye, P) : P;
}

/* The scalar product of the outward normal n and the way w from P to L, by way of the centre: n.p = r exactly, or of an
 * ellipsoid n.p = support. In float, what is near the eye is better known from there. */
static REAL cosine_towards(const Start start, const Real3 n, const Real3 L, const Real3 w) {
    const REAL by_center = DOT(n, difference(L, start.own.center)) - support_of(start);
    return REAL_BYTES == 4 ? (start.near_eye ? DOT(n, w) : by_center) : by_center;
}

/* Whether a light is a spot light or a lambert light. */
#define IS_BEAM(kind) (HAS(WITH_POINTS) && (kind) > POINT_LIGHT)

/* Which kind a light is. So one loop over all lights can call illuminate() from one place, where it is inlined:
 * otherwise compilers copy an Intersection for each call, which took a fifth of the time. */
static int kind_of(const Light light) {
    return (int)light.color.w;
}

/* Whether it is at a point, where its rays end; if not, they are parallel. */
static int is_at_point(const int kind) {
    return HAS(WITH_POINTS) && kind != PARALLEL_LIGHT;
}

/* From a point of a surface to the light. n: the outward unit normal there. */
static Direction direction_to(const Light light, const int kind, const Real3 n, const Start start) {
    const Real3 L = {light.position.x, light.position.y, light.position.z};
    Direction direction;
    direction.w = is_at_point(kind) ? towards(start, L) : L;
    direction.cosine = is_at_point(kind) ? cosine_towards(start, n, L, direction.w) : DOT(n, L);
    return direction;
}

/* reaches() and strength_of() for spot and lambert lights. Few scenes have one, so these are not inlined. */
static __attribute__((noinline)) MASK beam_reaches(const int kind, const real4 axis, const Real3 w) {
    const REAL along = -DOT(w, axis);
    return kind == SPOT_LIGHT ? TO_MASK(along >= axis.w * sqrt(DOT(w, w))) : TO_MASK(along > 0);
}

static __attribute__((noinline)) SHADE beam_strength(const int kind, const real4 of, const float4 cone,
                                                     const Shade3 l) {
    const Shade3 axis = {(shade_t)of.x, (shade_t)of.y, (shade_t)of.z};
    const SHADE cosine = -DOT(axis, l);
    if (kind == LAMBERT_LIGHT) return cosine > 0 ? cosine : (SHADE)0;
    if (!(cone.y > 0)) return 1;
    const Shade3 cross = {axis.y * l.z - axis.z * l.y, axis.z * l.x - axis.x * l.z, axis.x * l.y - axis.y * l.x};
    const REAL turns = turns_of(TO_REAL(sqrt(DOT(cross, cross))), TO_REAL(cosine));
    const SHADE angle = TO_SHADE(turns * TURN);
    const SHADE fall = 1 - (angle - cone.x) * cone.y;
    return fall < 1 ? (fall > 0 ? fall : (SHADE)0) : (SHADE)1;
}

/* Whether the light shines along -w at all. w: from the point to the light, of any length. */
static MASK reaches(const Light light, const int kind, const Real3 w) {
    return IS_BEAM(kind) ? beam_reaches(kind, light.axis, w) : (MASK)ALL_LANES;
}

/* The share of the light that leaves along -l. l: the unit vector from the point to the light. */
static SHADE strength_of(const Light light, const int kind, const Shade3 l) {
    return IS_BEAM(kind) ? beam_strength(kind, light.axis, light.cone, l) : (SHADE)1;
}

/* Puts in where a shadow ray is in the light's lists of what may stop it. Those of a light at a point are of cells of
 * directions from it, in the order of distances; those of a parallel light are of cells across it, in the order of how
 * far what they name reaches towards it. lit: the lanes whose rays are cast. */
static void find_lists(const Scene *scene, const Start start, const MASK lit, ShadowRay *ray) {
    const Light light = scene->light[ray->number];
    if (is_at_point(kind_of(light))) {
        ray->touches = ANY(lit & (ray->a < 0x1p-40f));
        const real lift = scene->unit * (real)(ray->touches ? 0x1p80f : 1.0f);
        ray->from = scaled(ray->w, -lift);
        ray->depth = ray->a;
        return;
    }
    ray->from = scaled(point_of(start), scene->unit);
    ray->u = TO_FLOAT(DOT(ray->from, light.axis) + light.axis.w);
    ray->v = TO_FLOAT(DOT(ray->from, light.across) + light.across.w);
    ray->depth = -TO_FLOAT(DOT(ray->from, light.position) + light.position.w);
}

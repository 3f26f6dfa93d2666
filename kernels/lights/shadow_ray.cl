/* shadow_ray.cl: what is known of the way from a point of a surface to a light, whatever the light's kind is. */

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

#if REAL_BYTES == 8
static Real3 point_of(const Start start) {
    const Real3 C = start.own.center, p = start.p;
    const Real3 P = {C.x + p.x, C.y + p.y, C.z + p.z};
    return P;
}

/* The scalar product of the outward normal n and the way w from P to L, by way of the centre: n.p = r exactly, or of an
 * ellipsoid n.p = support. */
static REAL cosine_towards(const Start start, const Real3 n, const Real3 L, const Real3 w) {
    const Real3 C = start.own.center;
    const Real3 h = {L.x - C.x, L.y - C.y, L.z - C.z};
    return DOT(n, h) - support_of(start);
}
#else
static Real3 point_of(const Start start) {
    const Real3 C = start.own.center, p = start.p;
    const Real3 P = {start.near_eye ? start.from_eye.x : C.x + p.x, start.near_eye ? start.from_eye.y : C.y + p.y,
                     start.near_eye ? start.from_eye.z : C.z + p.z};
    return P;
}

/* The same in float, where what is near the eye is better known from there. */
static REAL cosine_towards(const Start start, const Real3 n, const Real3 L, const Real3 w) {
    const Real3 C = start.own.center;
    const Real3 h = {L.x - C.x, L.y - C.y, L.z - C.z};
    return start.near_eye ? DOT(n, w) : DOT(n, h) - support_of(start);
}
#endif

/* between.cl: whether a sphere stands between a point of a surface and a light. */

/* |f|^2 - r^2, the power of P, given f = B.center - P. With D = B.center - C it is also D.(D - 2p) + (R - r)(R + r), as
 * |p| = R: exact for concentric spheres, even one ulp apart. The errors go with the size of the terms. */
static REAL power_of(const Start P, const Sphere B, const Real3 f) {
    const Real3 C = P.own.center;
    const Real3 D = {B.center.x - C.x, B.center.y - C.y, B.center.z - C.z};
    const Real3 g = {f.x - P.p.x, f.y - P.p.y, f.z - P.p.z};
    const REAL ff = DOT(f, f), rr = B.r * B.r;
    const REAL shift = DOT(D, g), step = (P.own.r - B.r) * (P.own.r + B.r);
    const REAL size = (shift < 0 ? -shift : shift) + (step < 0 ? -step : step);
    REAL_MASK by_centres = size < ff + rr;
    if (HAS(WITH_SHAPES)) by_centres = by_centres & !P.stretched;
    const REAL c = by_centres ? shift + step : ff - rr;
    if (REAL_BYTES == 8) return c;
    /* |B.center|^2 - r^2 comes from the host: what is added to it is small where P is near the eye. */
    const Real3 h = {P.from_eye.x - 2 * B.center.x, P.from_eye.y - 2 * B.center.y, P.from_eye.z - 2 * B.center.z};
    return P.near_eye ? B.c + DOT(P.from_eye, h) : c;
}

/* Whether a sphere B, not the own one, stands between P and a light, and so stops the light.
 *
 * f: from P to the centre of B; w: from P to the light; c: the power of P; r: the radius of B; far: 0 for a parallel
 * light, where w has length 1 and every t > 0 counts; else 1, and t in (0, 1) counts. outside: the sign of |L - C_B|^2
 * - r_B^2, computed exactly by the host; 1 for a parallel light. The equation is a t^2 - 2 b t + c = 0, a = w.w, b =
 * f.w, c = |f|^2 - r_B^2. No root is computed, only signs: of the product c of the roots, of their sum 2b, and of a -
 * 2b + c = |L - C_B|^2 - r_B^2, the value at t = 1. c > 0, P outside: two roots of one sign if the discriminant is >=
 * 0; positive if b > 0; the first is below 1 if the light is inside, or if their mean b/a is below 1. c < 0, P inside:
 * one positive root, below 1 if the light is strictly outside. c = 0, P on B: the root 0 does not count, the other one
 * is 2b/a.
 */
static REAL_MASK stands_between(const Real3 f, const Real3 w, const REAL c, const REAL r, const int far,
                                const int light_side) {
    const REAL a = DOT(w, w), b = DOT(f, w);
    const Real3 cross = {f.y * w.z - f.z * w.y, f.z * w.x - f.x * w.z, f.x * w.y - f.y * w.x};
    const REAL bb = b * b, arr = a * (r * r);
    const REAL_MASK meets = (bb < arr ? bb - a * c : arr - DOT(cross, cross)) >= 0;
    const REAL_MASK ahead = b > 0;
    const REAL_MASK enters = (c > 0) & meets & ahead;
    const REAL_MASK leaves = (c < 0) | ((c == 0) & ahead);
    if (light_side < 0) return c > 0; /* P outside and the light inside: surely one root between */
    if (light_side == 0) return enters & (b < a);
    return far ? (enters & (b < a)) | leaves : enters | leaves;
}

static REAL_MASK sphere_stops(const Start P, const Sphere B, const Real3 w, const int far, const int light_side) {
    const Real3 f = towards(P, B.center);
    return stands_between(f, w, power_of(P, B, f), B.r, far, light_side);
}

/* sphere.cl: the sphere: what is in its buffers, its float32 filter with a proof, and the normal of a point.
 *
 * meet.cl finds where a ray from the eye meets it, exact.cl has the last word on that and tells which of two is met
 * first, and surface.cl tells whether it stands between a point and a light. cltrace/reference has
 * the same, without the filter.
 */

/* One sphere in all lanes, or each lane's own one. */
typedef struct {
    INT index;
    Real3 center;
    REAL r, over_r;
    REAL c; /* |center|^2 - r^2, the power of the eye */
} Sphere;

static Sphere sphere_at(const Geometry geometry, const int index) {
    const real4 s = geometry.center_radius[index];
    const real2 power = geometry.power[index];
    return (Sphere){index, {s.x, s.y, s.z}, s.w, power.y, power.x};
}

/* Each lane's sphere. Lanes with a negative index get a harmless one ahead. */
static Sphere spheres_of(const Geometry geometry, const INT index) {
    Sphere own = {index, {0, 0, -2}, 1, 1, 3};
    int each[W];
    STORE_LANES(index, each);
    if (each[0] >= 0 && !ANY(index != each[0])) return sphere_at(geometry, each[0]);
    FOR_EACH_INDEX(one, index) {
        const REAL_MASK here = TO_REAL_MASK(index == one);
        const Sphere sphere = sphere_at(geometry, one);
        PUT3(PUT_WHERE, here, own.center, sphere.center);
        PUT_WHERE(here, own.r, sphere.r);
        PUT_WHERE(here, own.over_r, sphere.over_r);
        PUT_WHERE(here, own.c, sphere.c);
    }
    return own;
}

/* Which lanes' rays from a fixed point may meet a sphere, by a test in float32 that costs no more than a float tracer's
 * own.
 *
 * s: the sphere's filter constant (C, c'), where C is its centre seen from that point. b: C.d in float, by two fused
 * operations or by more roundings; a: d.d in float. With c = |C|^2 - r^2 and u = 2^-24, the host has rounded C to float
 * and made c' = c - 11 u (|C|^2 + |c|) - 2^-100 [FILTER_ROUNDINGS = 11], rounded down, or -inf where that is <= 0: see
 * filter_constant in cltrace/plan/shapes/sphere.py.
 *
 * Claim: if the ray hits, then b |b| >= a c' in float.
 * Proof. Let b = C.d and a = d.d without rounding and b~, a~ as computed here. C and d are rounded once and at most
 * three roundings follow, so |b~ - b| <= 5.01 u sum |C_i d_i| <= 5.01 u |C||d|, and a~ <= (1 + 5.01 u) a. A hit from
 * outside has b > 0 and b^2 >= a c. With s = b/|d| <= |C|:
 *   - if s >= 5.01 u |C|:  b~^2 (1 - u) >= a (s - 5.01 u |C|)^2 (1 - u) >= a (c - 10.02 u |C|^2)(1 - u), and
 *     a~ c' (1 + u) <= a (1 + 6.02 u) c' <= a (c - 10.1 u |C|^2 - 7.1 u c) (1 + 6.02 u), which is less.
 *   - else c <= s^2 < 26 u^2 |C|^2, so c - 11 u |C|^2 < 0 and c' = -inf: always a candidate.
 * A hit from inside or from the surface has c <= 0: likewise. Underflow adds at most 2^-123 to b: as a >= 1 and the
 * scene is scaled to 1, 2^-100 covers it.
 */
static MASK sphere_may_meet(const FLOAT b, const FLOAT a, const float4 s) {
    return b * magnitude(b) >= a * s.w;
}

/* The same for the line through a light at a point, along w, of spheres that are small: where a radius is less than a
 * thousandth of the distance, sphere_may_meet() subtracts squares of which float does not hold the difference.
 *
 * s: (L - C, c'), as of a fixed point; r: the radius in the float buffers' unit, rounded; a: w.w in float.
 *
 * Claim: if the line meets the sphere, then |w x s|^2 <= R^2 a in float, with R = (1 + 2^-19) r + 2^-20 |s|_1.
 * Proof. Let W and S be w and L - C without rounding, and D = |S|. The line meets the sphere if |W x S| <= r |W|. Each
 * coordinate of w and s is rounded once (s is off by 2^-50 D, too), and each one of the cross product by up to three
 * roundings of u: so that is off by 4.02 u times the sum of the magnitudes of its two products. The vector of these
 * sums is at most sqrt(2) |W| D long. So |w x s| <= (r + 5.7 u D) |W|; its square is off by 3.01 u of itself. On the
 * other side, R >= ((1 + 31 u) r + 15.9 u D) (1 - 3 u), a >= (1 - 5.01 u) |W|^2, and products are rounded twice: R^2 a
 * is at least
 * ((1 + 31 u) r + 15.9 u D)^2 (1 - 14 u) |W|^2. As sqrt((1 + 3.01 u) / (1 - 14 u)) < 1 + 9 u, that is more. Underflow
 * adds less than 2^-100. */
static MASK small_sphere_may_meet(const Float3 w, const FLOAT a, const float4 s, const float r) {
    const FLOAT x = FMA(w.y, (FLOAT)s.z, -(w.z * s.y));
    const FLOAT y = FMA(w.z, (FLOAT)s.x, -(w.x * s.z));
    const FLOAT z = FMA(w.x, (FLOAT)s.y, -(w.y * s.x));
    const float R = (1 + 0x1p-19f) * r + 0x1p-20f * ((fabs(s.x) + fabs(s.y)) + fabs(s.z));
    return FMA(x, x, FMA(y, y, z * z)) <= FMA((FLOAT)(R * R), a, (FLOAT)0x1p-100f);
}

/* Where a ray meets a sphere: the smallest t > 0, INFINITY if it does not; and the way there from the centre. */
typedef struct {
    REAL t;
    Real3 from_center; /* any, if there is no such t */
} Meeting;

/* The outward unit normal. From the centre to the point is r long but for rounding, so after the division by r one
 * Newton step n (3 - n.n)/2 makes it unit to the last digits. */
static Real3 sphere_surface(const Sphere sphere, const Real3 from_center) {
    const Real3 n = scaled(from_center, sphere.over_r);
    return scaled(n, (real)0.5 * ((real)3 - DOT(n, n)));
}

/* What is read of spheres. light: the number of a light, -1: the eye. */

static void sphere_fetch(const Scene *scene, const int light, const int index) {
    __global const float4 *filter = light < 0 ? scene->eye_filter : scene->light_filter + (long)light * scene->count;
    FETCH(filter, index);
    FETCH(scene->geometry.center_radius, index);
    FETCH(scene->geometry.power, index);
}

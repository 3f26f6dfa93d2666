/* stops.cl: spheres and ellipsoids between a point and a light. */

/* Where small_sphere_may_meet() is asked, too. */
#define SMALL_SPHERES (HAS(WITH_PREFETCH) && REAL_BYTES == 8 && !HAS(WITH_ELLIPSOIDS))

/* Whether the float32 filter leaves it open, for any lane of `may`, that the sphere stops the ray.
 *
 * A light at a point L: the filter constant is (L - C, c'), with c' made from |L - C|^2 - r^2 as for rays from the eye.
 * The line from the light to the point is a ray from a fixed point, too, so the proof of sphere_may_meet holds with
 * d = -w. There L - C is rounded from the exact difference, and turning it into camera space adds an error of 2^-50 of
 * it, for which 5.01 u has room. The proof needs a >= 1 against underflow alone, and |w|^2 >= 2^-40 does as well;
 * shorter rays are left to sphere_stops().
 *
 * A parallel light: the filter constant is (U, V, r'^2), with (U, V) the centre's coordinates across the light. A ray
 * from P, which is at (u, v), that meets the sphere passes its centre within r: sqrt((U - u)^2 + (V - v)^2) <= r. Let
 * e = 2^-24. Rounding the coordinates moves each difference by at most e (|U| + |u|) <= 2.01 e (|U| + r), or the same
 * of V, and the sum of squares is off by 3 e of itself: both together are less than what r' has more than r,
 * r' = r + 8 e (|U| + |V| + r) + 2^-60 [DISC_ROUNDINGS = 8]. See disc_filter in cltrace/plan/shapes/sphere.py.
 */
static int sphere_filter_leaves(const Scene *scene, const ShadowRay ray, const int index, const MASK may) {
    if (!HAS(WITH_FILTER)) return 1;
    const float4 s = scene->light_filter[(long)ray.number * scene->count + index];
    if (!ray.at_point) {
        const FLOAT du = s.x - ray.u, dv = s.y - ray.v;
        return ANY(may & (FMA(du, du, dv * dv) <= s.z));
    }
    if (ray.touches) return 1;
    const MASK open = may & sphere_may_meet(dot_float(ray.w32, s), ray.a, s);
    if (!SMALL_SPHERES || !ANY(open)) return ANY(open);
    const float r = (float)(scene->spheres.center_radius[index].w * scene->unit);
    return ANY(open & small_sphere_may_meet(ray.w32, ray.a, s, r));
}

/* On which side of a sphere a light is: of abi.py's light_side. Where c' > 0 (see sphere_filter_leaves()), |L - C|^2 -
 * r^2 is greater still, so it is outside: of many spheres, that waits for no further array. */
static int side_of_light(const Scene *scene, const ShadowRay ray, const int index) {
    const long seen = (long)ray.number * scene->count + index;
    if (SMALL_SPHERES && ray.at_point && scene->light_filter[seen].w > 0) return 1;
    return scene->light_side[seen];
}

/* Whether a sphere or an ellipsoid that is not the own surface stops the rays. */
static REAL_MASK stands_in_the_way(const Scene *scene, const ShadowRay ray, const Start start, const int index,
                                   const int side) {
    const Sphere sphere = sphere_at(scene->spheres, index);
    const int map = HAS(WITH_ELLIPSOIDS) ? scene->spheres.map_of[index] : 0;
    return map ? ellipsoid_stops(scene->spheres, start, sphere, map, ray.w, ray.at_point, side)
               : sphere_stops(start, sphere, ray.w, ray.at_point, side);
}

/* The lanes of `may` that a sphere stops. */
static MASK sphere_shadow(const Scene *scene, const ShadowRay ray, const Start start, const int index, MASK may,
                          Work *work) {
    if (!HAS(WITH_INSIDE)) may = may & (ray.own != index);
    if (!sphere_filter_leaves(scene, ray, index, may)) {
        COUNT(FILTERED, may);
        return 0;
    }
    COUNT(DECIDED, may);
    const int side = side_of_light(scene, ray, index);
    const REAL_MASK stops = stands_in_the_way(scene, ray, start, index, side);
    if (!HAS(WITH_INSIDE)) return may & TO_MASK(stops);
    const REAL_MASK self = TO_REAL_MASK(ray.own == index);
    return may & TO_MASK((self & (start.side < 0) & ((REAL)side > 0)) | (!self & stops));
}

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

/* The lanes of `may` that a sphere stops; none where the filter rules it out for all those of `asked`. */
static MASK stopped_by(const Scene *scene, const ShadowRay ray, const Start start, const int index, MASK asked,
                       MASK may, Work *work) {
    if (!HAS(WITH_INSIDE)) {
        asked = asked & (ray.own != index);
        may = may & (ray.own != index);
    }
    if (!sphere_filter_leaves(scene, ray, index, asked)) {
        COUNT(FILTERED, asked);
        return 0;
    }
    COUNT(DECIDED, may);
    const int side = side_of_light(scene, ray, index);
    const REAL_MASK stops = stands_in_the_way(scene, ray, start, index, side);
    if (!HAS(WITH_INSIDE)) return may & TO_MASK(stops);
    const REAL_MASK self = TO_REAL_MASK(ray.own == index);
    return may & TO_MASK((self & (start.side < 0) & ((REAL)side > 0)) | (!self & stops));
}

#define SHARES_ANSWERS (HAS(WITH_BLOCKS) && !HAS(WITH_SAMPLES) && KINDS_OF_SHAPES == 1 && W > 1 && REAL_BYTES == 8)
/* The lanes of `lit` for which the answer of sphere_stops() counts, whichever lists they have. Few spheres stop most
 * rays of a packet, so what is read later is asked for fewer lanes: with 100 lights, frames take 0.8 to 0.95 of the
 * time. Samples of one pixel mostly have the same list: there it takes 1.03 of the time.
 *
 * No bit changes: a ray is stopped if any sphere stops it, and where sphere_stops() says so in double, the ray's own
 * list has that sphere. Proof. Let u = 2^-53, f and w the ways from P to the sphere's centre and to the light, r the
 * sphere's radius and R that of P's own sphere. f is off by less than 2 u (|f| + R), and where the discriminant changes
 * its sign, the sphere's rim is off by less than 4 u (|f| + r). With r and R at most 16 |w|, and |f| <= |w| + r of what
 * stops a ray, both together are less than 6 (17 + 16) u |w| + 32 u |w| < 2^-45 |w|. Lists are made for spheres that
 * look larger by 2^-44 at least [FINE_SLACK in cltrace/plan/accel/silhouettes.py]. To a parallel light |w| = 1 in the
 * float buffers' unit, in which coordinates are about 1 at most. Where the rays `touch`, |w|^2 may have vanished in
 * float. In single there is no such room. */
static MASK shared_by(const Scene *scene, const ShadowRay ray, const Start start, const int index, const MASK lit) {
    if (ray.touches) return 0;
    const float r = (float)(scene->spheres.center_radius[index].w * scene->unit);
    const FLOAT R = TO_FLOAT(start.own.r * scene->unit);
    return lit & (FMA(R, R, (FLOAT)(r * r)) <= 0x1p8f * ray.a);
}

/* The lanes that a sphere stops, of those of `may`, which ask, and of others of `lit`, for which the answer is the
 * same. */
static MASK sphere_shadow(const Scene *scene, const ShadowRay ray, const Start start, const int index, const MASK may,
                          const MASK lit, Work *work) {
    const MASK all = SHARES_ANSWERS ? may | shared_by(scene, ray, start, index, lit) : may;
    return stopped_by(scene, ray, start, index, may, all, work);
}

/* spot.cl: a light at a point, which shines into a cone only. `axis` is the unit vector along which it points. Its
 * strength is 1 up to the angle alpha1 from there, and falls linearly with the angle to 0 at alpha2. */

static int spot_is_at_point(const Light light) {
    return 1;
}

static Direction spot_direction(const Light light, const Real3 n, const Start start) {
    return point_direction(light, n, start);
}

static MASK spot_reaches(const Light light, const Real3 w) {
    return TO_MASK(-DOT(w, light.axis) >= light.axis.w * sqrt(DOT(w, w)));
}

static SHADE spot_strength(const Light light, const Shade3 l) {
    if (!(light.cone.y > 0)) return 1;
    const Shade3 axis = {(shade_t)light.axis.x, (shade_t)light.axis.y, (shade_t)light.axis.z};
    const Shade3 cross = {axis.y * l.z - axis.z * l.y, axis.z * l.x - axis.x * l.z, axis.x * l.y - axis.y * l.x};
    const REAL turns = turns_of(TO_REAL(sqrt(DOT(cross, cross))), TO_REAL(-DOT(axis, l)));
    const SHADE angle = TO_SHADE(turns * TURN);
    const SHADE fall = 1 - (angle - light.cone.x) * light.cone.y;
    return fall < 1 ? (fall > 0 ? fall : (SHADE)0) : (SHADE)1;
}

static void spot_lists(const Scene *scene, const Light light, const Start start, const MASK lit, ShadowRay *ray) {
    point_lists(scene, light, start, lit, ray);
}

/* lambert.cl: a light at a point of a flat lamp. `axis` is the unit vector across that, and its strength is the cosine
 * of the angle from there. */

static int lambert_is_at_point(const Light light) {
    return 1;
}

static Direction lambert_direction(const Light light, const Real3 n, const Start start) {
    return point_direction(light, n, start);
}

static MASK lambert_reaches(const Light light, const Real3 w) {
    return TO_MASK(-DOT(w, light.axis) > 0);
}

static SHADE lambert_strength(const Light light, const Shade3 l) {
    const Shade3 axis = {(shade_t)light.axis.x, (shade_t)light.axis.y, (shade_t)light.axis.z};
    const SHADE cosine = -DOT(axis, l);
    return cosine > 0 ? cosine : (SHADE)0;
}

static void lambert_lists(const Scene *scene, const Light light, const Start start, const MASK lit, ShadowRay *ray) {
    point_lists(scene, light, start, lit, ray);
}

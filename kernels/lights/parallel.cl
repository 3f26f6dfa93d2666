/* parallel.cl: a light infinitely far away, as the sun all but is. Its `position` is the unit vector towards it, and
 * its `axis` and `across` are unit vectors across that. */

static int parallel_is_at_point(const Light light) {
    return 0;
}

static Direction parallel_direction(const Light light, const Real3 n, const Start start) {
    const Real3 to = {light.position.x, light.position.y, light.position.z};
    const Direction direction = {to, DOT(n, to)};
    return direction;
}

static MASK parallel_reaches(const Light light, const Real3 w) {
    return ALL_LANES;
}

static SHADE parallel_strength(const Light light, const Shade3 l) {
    return 1;
}

/* Its lists are of cells across it, in the order of how far what they name reaches towards it. */
static void parallel_lists(const Scene *scene, const Light light, const Start start, const MASK lit, ShadowRay *ray) {
    const Real3 P = point_of(start);
    ray->from.x = P.x * scene->unit;
    ray->from.y = P.y * scene->unit;
    ray->from.z = P.z * scene->unit;
    ray->u = TO_FLOAT(DOT(ray->from, light.axis) + light.axis.w);
    ray->v = TO_FLOAT(DOT(ray->from, light.across) + light.across.w);
    ray->depth = -TO_FLOAT(DOT(ray->from, light.position) + light.position.w);
}

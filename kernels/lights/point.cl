/* point.cl: a light at a point, which shines in all directions alike. Its `position` is that point, in camera space. */

static int point_is_at_point(const Light light) {
    return 1;
}

static Direction point_direction(const Light light, const Real3 n, const Start start) {
    const Real3 L = {light.position.x, light.position.y, light.position.z};
    const Real3 w = towards(start, L);
    const Direction direction = {w, cosine_towards(start, n, L, w)};
    return direction;
}

static MASK point_reaches(const Light light, const Real3 w) {
    return ALL_LANES;
}

static SHADE point_strength(const Light light, const Shade3 l) {
    return 1;
}

/* Its lists are of cells of directions from it, in the order of distances. */
static void point_lists(const Scene *scene, const Light light, const Start start, const MASK lit, ShadowRay *ray) {
    ray->touches = ANY(lit & (ray->a < 0x1p-40f));
    const real lift = scene->unit * (real)(ray->touches ? 0x1p80f : 1.0f);
    ray->from.x = -ray->w.x * lift;
    ray->from.y = -ray->w.y * lift;
    ray->from.z = -ray->w.z * lift;
    ray->depth = ray->a;
}

/* kinds.cl: what the host's table of kinds knows of any light, asked of the light's own kind.
 *
 * A kind is a row of LIGHT_KINDS in cltrace/plan/abi.py and a file beside this one, with these functions:
 *   is_at_point  whether it is at a point, where its rays end; if not, it is so far away that they are parallel
 *   direction    from a point of a surface to the light
 *   reaches      whether the light shines along -w at all
 *   strength     the share of it that leaves along -l
 *   lists        where a shadow ray is in the light's lists of what may stop it
 */

/* Which kind a light is. So one loop over all lights can call illuminate() from one place, where it is inlined:
 * otherwise compilers copy an Intersection for each call, which took a fifth of the time. */
static int kind_of(const Light light) {
    return KINDS_OF_LIGHTS > 1 ? (int)light.color.w : ONLY_KIND_OF_LIGHTS;
}

static int is_at_point(const Light light, const int kind) {
    return ASK_LIGHT(kind, is_at_point(light));
}

/* n: the outward unit normal at the start. */
static Direction direction_to(const Light light, const int kind, const Real3 n, const Start start) {
    return ASK_LIGHT(kind, direction(light, n, start));
}

/* w: from the point to the light, of any length. */
static MASK reaches(const Light light, const int kind, const Real3 w) {
    return ASK_LIGHT(kind, reaches(light, w));
}

/* l: the unit vector from the point to the light. */
static SHADE strength_of(const Light light, const int kind, const Shade3 l) {
    return ASK_LIGHT(kind, strength(light, l));
}

/* lit: the lanes whose rays are cast. */
static void find_lists(const Scene *scene, const Start start, const MASK lit, ShadowRay *ray) {
    const Light light = scene->light[ray->number];
    ASK_LIGHT(kind_of(light), lists(scene, light, start, lit, ray));
}

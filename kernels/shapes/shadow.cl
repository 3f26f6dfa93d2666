/* shadow.cl: any surface between a point and a light. */

/* The lanes of `lit` that a surface stops, of which those of `may` ask: all others may be left lit. lit: lanes whose P
 * is deeper than the surface begins. */
static __attribute__((always_inline)) MASK surface_stops(const Scene *scene, const ShadowRay ray, const Start start,
                                                         const int index, const MASK may, const MASK lit, Work *work) {
    return ASK_SHAPE(scene->spheres, index, shadow(scene, ray, start, index, may, lit, work));
}

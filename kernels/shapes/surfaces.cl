/* surfaces.cl: points of surfaces of whatever shape. Each shape's function is called for its own lanes. */

/* Puts what a ray from the eye has met into an intersection, but for its material. */
static __attribute__((always_inline)) void put_surfaces(const Frame frame, const Scene *scene, const Ray ray,
                                                        const Hit hit, Intersection *at) {
    if (HAS(WITH_NORMAL)) EACH_SHAPE(scene->spheres, hit.id, put(frame, scene, ray, hit, at));
    if (HAS(WITH_TEXTURES)) paint(scene, hit.id, at);
}

#ifdef WITH_BOUNCES
/* Normal and material of what a ray that left a surface has met. */
static Intersection intersection_from(const Frame frame, const Scene *scene, const Leaving ray, const Met met) {
    Intersection at = material_at(scene, met.id);
    EACH_SHAPE(scene->spheres, met.id, put_from(frame, scene, ray, met, &at));
    if (HAS(WITH_TEXTURES)) paint(scene, met.id, &at);
    return at;
}
#endif

/* fetch.cl: what is read of cylinders. light: the number of a light, -1: the eye. */
#ifdef WITH_CYLINDERS

static void cylinder_fetch(const Scene *scene, const int light, const int index) {
    FETCH(scene->spheres.rod, 2 * (index - FIRST_CYLINDER(&scene->spheres)));
}

static void cylinder_fetch_first(const Scene *scene, const int light, const int index) {
    FETCH(scene->spheres.rod, 2 * (index - FIRST_CYLINDER(&scene->spheres)));
}

static void cylinder_fetch_hit(const Scene *scene, const int index) {
    FETCH(scene->spheres.rod, 2 * (index - FIRST_CYLINDER(&scene->spheres)));
}
#endif

/* fetch.cl: what is read of spheres. light: the number of a light, -1: the eye. */

static void sphere_fetch(const Scene *scene, const int light, const int index) {
    __global const float4 *filter = light < 0 ? scene->eye_filter : scene->light_filter + (long)light * scene->count;
    FETCH(filter, index);
    FETCH(scene->spheres.center_radius, index);
    FETCH(scene->spheres.power, index);
}

static void sphere_fetch_first(const Scene *scene, const int light, const int index) {
    FETCH(scene->light_filter, (long)light * scene->count + index);
}

/* Leaves of the tree hold them as balls. */
#define sphere_fetch_leaf ball_fetch_leaf
#define sphere_add_leaf ball_add_leaf
#define sphere_add_leaf_for_packet ball_add_leaf_for_packet

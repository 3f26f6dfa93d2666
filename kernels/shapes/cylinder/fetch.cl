/* fetch.cl: what is read of cylinders. light: the number of a light, -1: the eye. */

static void cylinder_fetch(const Scene *scene, const int light, const int index) {
    FETCH(scene->rod_seen, 2 * (index - FIRST_CYLINDER(scene->spheres)));
    FETCH(scene->spheres.rod, 2 * (index - FIRST_CYLINDER(scene->spheres)));
}

static void cylinder_fetch_first(const Scene *scene, const int light, const int index) {
    FETCH(scene->rod_seen, 2 * (index - FIRST_CYLINDER(scene->spheres)));
}

/* Leaves of the tree hold them as balls. */
#define cylinder_fetch_leaf ball_fetch_leaf
#define cylinder_add_leaf ball_add_leaf
#define cylinder_add_leaf_for_packet ball_add_leaf_for_packet

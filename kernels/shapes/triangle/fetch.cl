/* fetch.cl: what is read of triangles. light: the number of a light, -1: the eye. */

static void triangle_fetch(const Scene *scene, const int light, const int index) {
    const int number = index - FIRST_TRIANGLE(scene->spheres);
    __global const float4 *facets = light < 0 ? scene->facet : scene->light_facet + 3 * (long)light * scene->triangles;
    FETCH(facets, 3 * (long)number);
    FETCH(facets, 3 * (long)number + 2);
    FETCH(scene->spheres.face, number);
}

static void triangle_fetch_first(const Scene *scene, const int light, const int index) {
    FETCH(scene->light_facet, 3 * ((long)light * scene->triangles + (index - FIRST_TRIANGLE(scene->spheres))));
}

static void triangle_fetch_leaf(const Scene *scene, const int leaf) {
    __global const uchar *lines = (__global const uchar *)(scene->patch + (leaf - scene->tree.blocks));
    for (int line = 0; line < 6; line++) FETCH(lines, 64 * line);
}

/* proved.cl: triangles on which it is known that no shadow falls, see find/unstoppable.cl. */
#ifdef WITH_UNSTOPPABLE
/* The number of `unstoppable` that has the bit of each lane's triangle; 0 of other surfaces. */
static INT bits_of_triangles(const Scene *scene, const int light, const INT own) {
    __global const int *bits = scene->unstoppable + (long)light * ((scene->triangles + 31) / 32);
    INT left = IS_TRIANGLE(scene->spheres, own) ? (own - FIRST_TRIANGLE(scene->spheres)) >> 5 : (INT)-1, found = 0;
    for (int one = LARGEST(left); one >= 0; one = LARGEST(left)) {
        PUT_WHERE(left == one, found, (INT)bits[one]);
        left = left == one ? (INT)-1 : left;
    }
    return found;
}

/* In which lanes the own surface is not known to be a triangle on which no shadow of a light can fall. */
static MASK may_be_shaded(const Scene *scene, const int light, const INT own) {
    return ((bits_of_triangles(scene, light, own) >> ((own - FIRST_TRIANGLE(scene->spheres)) & 31)) & 1) - 1;
}
#define IS_PROVED(scene, light) ((light) < (scene)->proved)
#else
#define may_be_shaded(scene, light, own) ALL_LANES
#define IS_PROVED(scene, light) 0
#endif

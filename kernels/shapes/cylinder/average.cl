/* average.cl: what is to be known of cylinders, so that no mean is claimed to be known where they are. */
#ifdef WITH_AVERAGE
static int cylinder_is_odd(const Scene *scene, const int index) {
    return 1;
}

/* Where lists name a cylinder, it may be seen, and anywhere along the rays. */
static Extent cylinder_extent(const Scene *scene, const Cells cells, const int index) {
    const Extent extent = {0, 0, 0, INFINITY};
    return extent;
}

/* Whatever a cylinder may stop, of the light on a patch, is not known. */
static void cylinder_block(const Scene *scene, const Shaft *shaft, const int index, const MASK may,
                           Blocking *blocking) {
    blocking->odd = blocking->odd | may;
}
#endif

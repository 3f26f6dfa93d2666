/* triangles.cl: what is to be known of triangles, so that no mean is claimed to be known where they are. */
#if HAS(WITH_AVERAGE) && HAS(WITH_TRIANGLES)
static int triangle_is_odd(const Scene *scene, const int index) {
    return 1;
}

/* The planes of a triangle's edges are linear functions of the place, off by less than 1: see sides_of(). None of them
 * is negative in all of a cell that shows it. It is nowhere nearer than its plane, of which 1/t, or -t of parallel
 * rays, is linear, too. That it covers a cell is not told. */
static Extent triangle_extent(const Scene *scene, const Cells cells, const int index) {
    __global const float4 *facet = scene->facet + 3 * (long)(index - FIRST_TRIANGLE(scene->spheres));
    const real unit = HAS(WITH_PARALLEL_RAYS) ? scene->unit : (real)1;
    const FLOAT x = TO_FLOAT(unit * cells.dx), y = TO_FLOAT(unit * cells.dy), loose = 1 + 0x1p-20f;
    const float h = fabs((float)(unit * cells.h)), k = fabs((float)(unit * cells.k));
    const Bounds plane = near_plane(x, y, facet);
    const FLOAT near = plane.high + (fabs(facet[0].w) * h + fabs(facet[1].w) * k) * loose;
    Extent extent = {0, HAS(WITH_PARALLEL_RAYS) ? (MASK)0 : near < 0, 0, INFINITY};
    for (int i = 0; i < 3; i++) {
        const float4 edge = facet[i];
        const FLOAT side = FMA(x, (FLOAT)edge.x,
                               FMA(y, (FLOAT)edge.y, (FLOAT)(HAS(WITH_PARALLEL_RAYS) ? edge.z : -edge.z)));
        extent.misses = extent.misses | (side < -((fabs(edge.x) * h + fabs(edge.y) * k) * loose + 1));
    }
    const FLOAT least = HAS(WITH_PARALLEL_RAYS) ? -near : 1 / near;
    extent.least = least > 0 ? least * (1 - 0x1p-18f) : (FLOAT)0;
    return extent;
}

/* Whatever a triangle may stop, of the light on a patch, is not known. */
static void triangle_block(const Scene *scene, const Shaft *shaft, const int index, const MASK may,
                           Blocking *blocking) {
    blocking->odd = blocking->odd | may;
}
#endif

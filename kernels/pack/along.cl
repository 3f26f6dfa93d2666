/* along.cl: spheres as discs on the window of a parallel light, with the arithmetic of accel/silhouettes.py of
 * cltrace/plan. Their edges are doubles.
 */

/* What cube_discs() of tiles.cl makes, for all spheres, as a parallel light sees them: c is the axis that leads there.
 */
__kernel void discs_along(const int n, const int pitch, const double unit, const double4 a, const double4 b,
                          const double4 c, __global const double *restrict seen, __global const double *restrict radius,
                          __global char *restrict flags, __global double *restrict edges, __global float *restrict near,
                          __global double *restrict part) {
    Extent extent = no_discs();
    FOR_EACH_PACKET(i, n) {
        const INT flag = load_flags(flags + i);
        const MASK member = (flag & VISIBLE) != 0;
        const Real3 place = place_of(seen, pitch, i);
        const REAL r = column(radius, n, i) * unit, u = turned_along(a, place), v = turned_along(b, place),
                   s = turned_along(c, place);
        const FLOAT depth = rounded_down(-(s + r) - SLACK * (fabs(s) + r) - 0x1p-100);
        const REAL disc[EXTENTS] = {u - r, u + r, v - r, v + r, TO_REAL(depth), r - s + 0x1p-10};
        store_discs(disc, member, &extent, edges + i, pitch);
        STORE_LANES(member ? depth : (FLOAT)INFINITY, near + i);
        store_flags(flag & VISIBLE, flags + i);
    }
    note_discs(extent, part);
}

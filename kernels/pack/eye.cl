/* eye.cl: spheres as the eye sees them: the kernel's buffers, and which tiles they cover, in one pass over memory. This
 * is what cltrace/plan/shapes/sphere.py and accel/silhouettes.py make, with the same arithmetic.
 */

/* See accel/silhouettes.py. */
#define LOOSE 0x1p-44

/* Where the eye is, in scene units, and the camera's axes; unit: leads from scene units to the float buffers' unit. */
typedef struct {
    double unit;
    double4 place, right, up, back;
} Eye;

/* A sphere as the eye sees it. place: its centre in the world; far, radius, excess: the centre along the camera's axes,
 * and |centre|^2 - radius^2, in scene units; near, r, c: the same in the float buffers' unit, c rounded. */
typedef struct {
    Real3 place, far, near;
    REAL radius, r, c;
    Pair excess;
} FromEye;

INLINE FromEye from_eye(const Eye eye, const Real3 place, const REAL radius) {
    const Pair3 v = {two_sum(place.x, -eye.place.x), two_sum(place.y, -eye.place.y), two_sum(place.z, -eye.place.z)};
    FromEye s = {place};
    s.far.x = dot_product(eye.right, v), s.far.y = dot_product(eye.up, v), s.far.z = dot_product(eye.back, v);
    s.near.x = s.far.x * eye.unit, s.near.y = s.far.y * eye.unit, s.near.z = s.far.z * eye.unit;
    s.radius = radius, s.r = radius * eye.unit;
    s.excess = square_excess(v, radius);
    s.c = s.excess.hi * (eye.unit * eye.unit);
    return s;
}

/* Where the kernel's buffers are; see plan/abi.py. */
typedef struct {
    __global out4 *center_radius;
    __global out2 *power;
    __global double4 *world;
    __global float4 *eye_filter;
} Packed;

/* Puts a packet of spheres there. along: whether rays are parallel. */
INLINE void pack_spheres(const Packed to, const int i, const FromEye s, const int along) {
    const FLOAT x = TO_FLOAT(s.near.x), y = TO_FLOAT(s.near.y), z = TO_FLOAT(s.near.z), r = TO_FLOAT(s.r);
    if (along) WRITE_ROWS_4(float, to.eye_filter, i, x, y, disc_filter(s.near.x, s.near.y, s.r, LOOSE), (FLOAT)0);
    else WRITE_ROWS_4(float, to.eye_filter, i, x, y, z, filter_constant(s.near, s.c));
    if (sizeof(out2) == sizeof(float2)) {
        const REAL over_r = 1 / s.r, bounded = over_r < (REAL)FLT_MAX ? over_r : (REAL)FLT_MAX;
        WRITE_ROWS_4(float, to.center_radius, i, x, y, z, r);
        WRITE_ROWS_2(float, to.power, i, TO_FLOAT(s.c), TO_FLOAT(bounded));
    } else {
        WRITE_ROWS_4(double, to.center_radius, i, s.far.x, s.far.y, s.far.z, s.radius);
        WRITE_ROWS_2(double, to.power, i, s.excess.hi, 1 / s.radius);
        WRITE_ROWS_4(double, to.world, i, s.place.x, s.place.y, s.place.z, s.excess.lo);
    }
}

/* Which spheres are equal to none before them. */
INLINE MASK is_first(__global const char *again, const int n, const int i) {
    int lane[W];
    for (int k = 0; k < W; k++) lane[k] = again[min(i + k, n - 1)];
    return LOAD_LANES(lane) == 0;
}

/* loose: by how much slopes are off, beside a share of themselves; axis: x: leads from slopes to pixels, y, z: what is
 * added to begin and end; range: the first pixel, and the one after the last. */
INLINE Run pixels_of(const Slopes s, const double loose, const double4 axis, const int2 range, const int shift) {
    const REAL slack = (fabs(s.low) + fabs(s.high)) * SLACK + loose;
    return run_between(TO_FLOAT(ceil((s.low - slack) * axis.x + axis.y)),
                       TO_FLOAT(floor((s.high + slack) * axis.x + axis.z)), range, shift);
}

/* A sphere in the picture. across, down: its edges; loose: see pixels_of(); ahead: whether any of it may be before the
 * rays' starts; near: the depth of its nearest point, at least. */
typedef struct {
    Slopes across, down;
    double loose;
    MASK ahead;
    FLOAT near;
} Disc;

/* As slopes; depths are squared distances. */
INLINE Disc disc_from_eye(const FromEye s) {
    const Circles circle = circles(-s.near.z, s.r, (s.near.z - s.r) * (s.near.z + s.r));
    const Disc disc = {slopes(s.near.x, circle), slopes(-s.near.y, circle), 0, TO_MASK(s.near.z < s.r * (1 + SLACK)),
                       nearest(length_of(s.near.x, s.near.y, s.near.z), s.r, s.c)};
    return disc;
}

/* Of parallel rays: as places on the plane where they start; depths are distances from there. */
INLINE Disc disc_along_view(const FromEye s) {
    const REAL depth = -(s.near.z + s.r), size = fabs(s.near.z) + s.r;
    const Disc disc = {{s.near.x - s.r, s.near.x + s.r},
                       {-s.near.y - s.r, s.r - s.near.y},
                       LOOSE,
                       TO_MASK(s.near.z - s.r < SLACK * s.r + LOOSE),
                       rounded_down(depth - SLACK * size - LOOSE)};
    return disc;
}

/* What is on which work-item's spheres: the largest coordinate or radius, in scene units; minus the least power of
 * those that are sure, in scene units, or, along the view, minus 0 if the plane where rays start may cut any, else
 * minus 1; how many may be seen; how many of them are in the picture, and how many cells of level 0 these cover. */
#define NOTES 5

/* The first two of them, of each lane. */
typedef struct {
    REAL most, least;
} Ends;

INLINE Ends with_sphere(const Ends so_far, const FromEye s, const int along) {
    Ends e;
    e.most = LARGER(LARGER(LARGER(so_far.most, s.radius), fabs(s.far.x)), LARGER(fabs(s.far.y), fabs(s.far.z)));
    const REAL size = fabs(s.near.z);
    if (along) e.least = size - s.r > SLACK * (size + s.r) + LOOSE ? so_far.least : (REAL)0;
    else e.least = ((s.excess.lo == s.excess.lo) & (s.excess.hi < so_far.least)) ? s.excess.hi : so_far.least;
    return e;
}

/* unit, eye, right, up, back: of Eye; some_again, again: whether spheres are equal to one before them, which is not
 * seen; x_axis, y_axis, x_range, y_range: see pixels_of(); shift: a cell has
 * 2^shift pixels a side; along: whether rays are parallel; part: NOTES for each work-item. */
__kernel void
see_from_eye(const int n, const int pitch, const double unit, const double4 eye, const double4 right, const double4 up,
             const double4 back, const int some_again, const double4 x_axis, const double4 y_axis, const int2 x_range,
             const int2 y_range, const int shift, const int along, __global const double *restrict center,
             __global const double *restrict radius, __global const char *restrict again,
             __global out4 *restrict center_radius, __global out2 *restrict power, __global double4 *restrict world,
             __global float4 *restrict eye_filter, __global char *restrict flags, __global short *restrict covers,
             __global float *restrict near, __global int *restrict unsure, __global double *restrict part) {
    const Eye from = {unit, eye, right, up, back};
    const Packed to = {center_radius, power, world, eye_filter};
    Ends ends = {0, 1};
    LONG there = 0, members = 0, entries = 0;
    FOR_EACH_PACKET(i, n) {
        const Real3 place = point_of(center, n, i);
        const FromEye s = from_eye(from, place, column(radius, n, i));
        note_unsure(unsure, i, n, s.excess.lo);
        ends = with_sphere(ends, s, along);
        pack_spheres(to, i, s, along);
        MASK visible = LANE < n - i;
        if (some_again) visible &= is_first(again, n, i);
        store_flags(visible ? (INT)VISIBLE : (INT)0, flags + i);
        there += TO_LONG(visible ? (INT)1 : (INT)0);

        const Disc disc = along ? disc_along_view(s) : disc_from_eye(s);
        const Run row = pixels_of(disc.across, disc.loose, x_axis, x_range, shift),
                  rows = pixels_of(disc.down, disc.loose, y_axis, y_range, shift);
        visible &= disc.ahead & row.any & rows.any;
        store_covers(row, rows, covers + i, pitch);
        STORE_LANES(visible ? disc.near : (FLOAT)INFINITY, near + i);
        members += TO_LONG(visible ? (INT)1 : (INT)0);
        entries += TO_LONG(visible ? (row.more + 1) * (rows.more + 1) : (INT)0);
    }
    __global double *note = part + NOTES * get_global_id(0);
    note[0] = largest_lane(ends.most), note[1] = largest_lane(-ends.least), note[2] = sum_of_lanes(there);
    note[3] = sum_of_lanes(members), note[4] = sum_of_lanes(entries);
}

/* What follows from |centre|^2 - radius^2 = hi + lo, in scene units, of `count` spheres of these indices. The rest: see
 * see_from_eye(). */
__kernel void mend_eye(const int count, const int along, const double unit, const double4 eye, const double4 right,
                       const double4 up, const double4 back, __global const int *restrict index,
                       __global const double *restrict hi, __global const double *restrict lo,
                       __global const double *restrict center, __global const double *restrict radius,
                       __global out2 *restrict power, __global double4 *restrict world,
                       __global float4 *restrict eye_filter, __global float *restrict near) {
    const Eye from = {unit, eye, right, up, back};
    FOR_EACH_PACKET(i, count) {
        double place[4][W], value[W];
        for (int k = 0; k < W; k++) {
            const int j = min(i + k, count - 1);
            for (int x = 0; x < 3; x++) place[x][k] = center[3L * index[j] + x];
            place[3][k] = radius[index[j]], value[k] = hi[j];
        }
        const Real3 at = {LOAD_LANES(place[0]), LOAD_LANES(place[1]), LOAD_LANES(place[2])};
        FromEye s = from_eye(from, at, LOAD_LANES(place[3]));
        s.c = LOAD_LANES(value) * (unit * unit);
        float filter[W], depth[W];
        double small[W];
        STORE_LANES(filter_constant(s.near, s.c), filter);
        STORE_LANES(disc_from_eye(s).near, depth);
        STORE_LANES(s.c, small);
        for (int k = 0; k < W && i + k < count; k++) {
            const int sphere = index[i + k];
            if (!along) {
                eye_filter[sphere].w = filter[k];
                near[sphere] = near[sphere] < INFINITY ? depth[k] : near[sphere];
            }
            if (sizeof(out2) == sizeof(float2)) power[sphere].x = (float)small[k];
            else power[sphere].x = value[k], world[sphere].w = lo[i + k];
        }
    }
}

/* The buffers of spheres as a parallel light sees them, and all of them as discs: see cube_discs(). c: the axis that
 * leads to the light; a, b: those across. */
__kernel void see_along(const int n, const int pitch, const double unit, const double4 eye, const double4 right,
                        const double4 up, const double4 back, const double4 a, const double4 b, const double4 c,
                        const long first, __global const double *restrict center,
                        __global const double *restrict radius, __global float4 *restrict light_filter,
                        __global char *restrict light_side, __global char *restrict flags,
                        __global double *restrict edges, __global float *restrict near,
                        __global double *restrict part) {
    const Eye from = {unit, eye, right, up, back};
    Extent extent = no_discs();
    FOR_EACH_PACKET(i, n) {
        const FromEye sphere = from_eye(from, point_of(center, n, i), column(radius, n, i));
        const REAL r = sphere.r, u = turned_along(a, sphere.near), v = turned_along(b, sphere.near),
                   s = turned_along(c, sphere.near);
        WRITE_ROWS_4(float, light_filter, first + i, TO_FLOAT(u), TO_FLOAT(v), disc_filter(u, v, r, 0x1p-60), (FLOAT)0);
        for (int k = 0; k < W; k++) light_side[first + i + k] = 1;

        const INT flag = load_flags(flags + i);
        const MASK member = (flag & VISIBLE) != 0;
        const FLOAT depth = rounded_down(-(s + r) - SLACK * (fabs(s) + r) - 0x1p-100);
        const REAL disc[EXTENTS] = {u - r, u + r, v - r, v + r, TO_REAL(depth), r - s + 0x1p-10};
        store_discs(disc, member, &extent, edges + i, pitch);
        STORE_LANES(member ? depth : (FLOAT)INFINITY, near + i);
        store_flags(flag & VISIBLE, flags + i);
    }
    note_discs(extent, part);
}

/* unstoppable.cl: on which triangles no shadow can fall, so that no shadow ray from there needs to be cast.
 *
 * Of a light at a point L. A shadow ray from a point P of a triangle T looks at the list of its cell on each level, and
 * T itself is in one of these. So it is enough to look at T and each other surface N that are together in the lists
 * that a cell is in: T is unstoppable if none of these N can stand between L and a point of T.
 *
 * A point P is inside of T, not on an edge, see face_point(). So N stops no ray from T
 *   - if a plane through L, along an edge of T or N or between boxes around them, has T on one side, and N on the other
 * or on it;
 *   - if N is behind the plane of T as seen from L, or on it, or T before that of N;
 *   - if N begins beyond the furthest corner of T.
 *
 * The facets tell on which side of a plane a corner is, with the bounds of sides_of() and plane_at(), as a corner is a
 * direction from L like any other. Corners that both have in common are on the planes, exactly: neighbours have one or
 * two. Of planes of triangles, is_beside() may know more. What bounds leave open may be stopped, and so may a T whose
 * own plane is unsure, as L all but sees its edge. Of others, a point is so far from a plane along an edge that pairs
 * of doubles tell on which side: it has 2^-64 or more of the third corner's distance, which is 2^-22 or more of what
 * its volume is made from.
 *
 * plane_at() is about rays that meet the triangle. Elsewhere the plane's numbers N / D are off by less than 2^-26 / s
 * in all for each coordinate of a ray w, with s the largest corner's size, see _facets(). As |N / D| s is at least 1,
 * that is less than half a rounding of |w| |N / D|, and the products are off by 5 such roundings: together less than
 * the 8 here.
 */

/* Lists that are longer together, and all in them, are left as they are. */
#define MOST_LISTED 1024
/* On each level, two may be not full. */
#define PACKETS (MOST_LISTED / W + 32)

/* Up to W triangles that are in the lists of a cell, or other surfaces, side by side. */
typedef struct {
    INT number;    /* of the triangle; -1: of another surface */
    MASK asked;    /* whether it is asked about */
    FLOAT near;    /* where it begins, as the list says; INFINITY where there is nothing more */
    FLOAT far;     /* none of its points is further than that */
    FLOAT box[4];  /* what holds it on the grid's plane: the most that a point of it has of u, v, -u and -v */
    INT corner[3]; /* which vertices its corners are; -1 of another surface */
    FLOAT x[3], y[3], z[3],
        size[3]; /* from these to the light, along the camera's axes, in the float buffers' unit; how long */
    FLOAT nx[4], ny[4], nz[4]; /* the facet: the planes of the edges AB, BC and CA, and the triangle's own */
    float around[4];           /* the greatest of each number of the boxes */
    int of_cell;               /* whether the list is that of the cell itself, not of a larger one around it */
} Few;

/* Number i of a vector in memory. */
#define FLOAT_AT(vector, i) ((const float *)&(vector))[i]
#define INT_AT(vector, i) ((const int *)&(vector))[i]

/* A light at a point, and what its rays may meet. */
typedef struct {
    double4 place, right, up, back; /* where it is in the world, and the camera's axes there */
    double unit;                    /* of Scene */
    double4 eye;                    /* in the world; w: whether rays from there are all */
    int spheres;                    /* the index of the first triangle as a surface */
    __global const real4 *vertex;
    __global const int4 *face;
    __global const float4 *facet; /* of this light */
    __global const char *wanted;  /* which triangles are asked about */
} Lamp;

/* Sorts entries by their surfaces: neighbours in memory are mostly neighbours in space. By Shell. */
static void sort_by_index(int2 *entry, const int count) {
    for (int gap = count < 24 ? 1 : count < 160 ? 10 : 57; gap; gap = gap > 10 ? 10 : gap > 1 ? 1 : 0)
        for (int i = gap; i < count; i++) {
            const int2 one = entry[i];
            int k = i;
            for (; k >= gap && entry[k - gap].x > one.x; k -= gap) entry[k] = entry[k - gap];
            entry[k] = one;
        }
}

/* From a point of the world to the light, along the camera's axes, in the float buffers' unit. */
static Float3 way_to(const Lamp lamp, const REAL x, const REAL y, const REAL z) {
    const REAL X = lamp.place.x - x, Y = lamp.place.y - y, Z = lamp.place.z - z;
    return (Float3){TO_FLOAT(((lamp.right.x * X + lamp.right.y * Y) + lamp.right.z * Z) * lamp.unit),
                    TO_FLOAT(((lamp.up.x * X + lamp.up.y * Y) + lamp.up.z * Z) * lamp.unit),
                    TO_FLOAT(((lamp.back.x * X + lamp.back.y * Y) + lamp.back.z * Z) * lamp.unit)};
}

/* Whether eye and light are on one side of a triangle, but for rounding. Where they are not, what the eye sees is dark,
 * but where shading normals say something else, and it does not pay to ask for more. */
static MASK shows_both(const Lamp lamp, const Few *few) {
    const Float3 eye = way_to(lamp, lamp.eye.x, lamp.eye.y, lamp.eye.z);
    const FLOAT fx = few->x[1] - few->x[0], fy = few->y[1] - few->y[0], fz = few->z[1] - few->z[0];
    const FLOAT gx = few->x[2] - few->x[0], gy = few->y[2] - few->y[0], gz = few->z[2] - few->z[0];
    const FLOAT x = fy * gz - fz * gy, y = fz * gx - fx * gz, z = fx * gy - fy * gx;
    const FLOAT lit = (x * few->x[0] + y * few->y[0]) + z * few->z[0], between = (x * eye.x + y * eye.y) + z * eye.z;
    return (lit > 0) == (lit > between);
}

/* Up to W entries of a list; the last lanes have the last one again. */
static void put_few(const Lamp lamp, const Grid grid, const int2 *entry, const int count, const int of_cell, Few *few) {
    int number[W], asked[W];
    float near[W];
    for (int lane = 0; lane < W; lane++) {
        const int2 one = entry[min(lane, count - 1)];
        const int other = one.x < lamp.spheres;
        number[lane] = other ? -1 : one.x - lamp.spheres;
        near[lane] = lane < count ? as_float(one.y) : INFINITY;
        asked[lane] = lane < count && !other && lamp.wanted[number[lane]] ? -1 : 0;
    }
    few->number = LOAD_LANES(number);
    few->near = LOAD_LANES(near);
    few->asked = LOAD_LANES(asked);
    few->of_cell = of_cell;
    FLOAT own[3], most[4] = {-INFINITY, -INFINITY, -INFINITY, -INFINITY}, furthest = 0;
    const MASK other = few->number < 0;
    MASK open = other;
    for (int c = 0; c < 3; c++) {
        int corner[W];
        real4 place[W];
        float4 edge[W];
        for (int lane = 0; lane < W; lane++) {
            const int at = number[lane];
            corner[lane] = at < 0 ? -1 : ((__global const int *)(lamp.face + at))[c];
            place[lane] = lamp.vertex[max(corner[lane], 0)];
            edge[lane] = at < 0 ? (float4)NAN : lamp.facet[3 * (long)at + c];
        }
        few->corner[c] = LOAD_LANES(corner);
        few->nx[c] = (FLOAT)EACH_LANE(edge, .x);
        few->ny[c] = (FLOAT)EACH_LANE(edge, .y);
        few->nz[c] = (FLOAT)EACH_LANE(edge, .z);
        own[c] = (FLOAT)EACH_LANE(edge, .w);
        Float3 w = way_to(lamp, (REAL)EACH_LANE(place, .x), (REAL)EACH_LANE(place, .y), (REAL)EACH_LANE(place, .z));
        const FLOAT square = (w.x * w.x + w.y * w.y) + w.z * w.z;
        /* Nothing is known of other surfaces, and of what all but touches the light. */
        const MASK touches = square < 0x1p-80f;
        w.x = (touches | other) ? (FLOAT)NAN : w.x;
        few->asked &= !touches;
        few->x[c] = w.x;
        few->y[c] = w.y;
        few->z[c] = w.z;
        few->size[c] = sqrt(square);
        furthest = GREATER(square, furthest);
        /* As axes are no longer than 3, a product is off by less than 15 roundings of the 32 here. */
        const FLOAT loose = 0x1p-19f * ((magnitude(w.x) + magnitude(w.y)) + magnitude(w.z));
        const FLOAT ahead = -DOT(w, grid.near_ahead), over = 1 / ahead;
        const FLOAT u = -DOT(w, grid.near_right) * over, v = -DOT(w, grid.near_up) * over;
        const FLOAT u_off = loose * over * (1 + magnitude(u)), v_off = loose * over * (1 + magnitude(v));
        open |= !(ahead > loose);
        most[0] = GREATER(u + u_off, most[0]);
        most[1] = GREATER(v + v_off, most[1]);
        most[2] = GREATER(u_off - u, most[2]);
        most[3] = GREATER(v_off - v, most[3]);
    }
    few->nx[3] = own[0];
    few->ny[3] = own[1];
    few->nz[3] = own[2];
    /* A square is off by less than 9 roundings, and so is that of a point between the corners. */
    few->far = furthest * (1 + 0x1p-19f);
    for (int k = 0; k < 4; k++) {
        few->box[k] = open ? (FLOAT)INFINITY : most[k];
        few->around[k] = -INFINITY;
        for (int lane = 0; lane < count; lane++) few->around[k] = fmax(few->around[k], FLOAT_AT(few->box[k], lane));
    }
    if (lamp.eye.w != 0) few->asked &= shows_both(lamp, few);
}

/* The lists of a cell and of those around it, and what has been read of them so far. */
typedef struct {
    __global const int2 *entry;
    Few *few;
    int packets; /* how many of these */
} Reading;

/* Reads those entries of a list, from `first` to `end`, that are asked about, where `far` is negative; else those that
 * are not and begin before `far`. of_cell: as in Few. */
static void put_list(const Lamp lamp, const Grid grid, const int first, const int end, const float far,
                     const int of_cell, Reading *reading) {
    const int asked = far < 0;
    int2 chosen[MOST_LISTED];
    int count = 0;
    for (int k = first; k < end; k++) {
        const int2 one = reading->entry[k];
        if (!asked && !(as_float(one.y) < far)) break;
        if ((one.x >= lamp.spheres && lamp.wanted[one.x - lamp.spheres]) == asked) chosen[count++] = one;
    }
    sort_by_index(chosen, count);
    for (int k = 0; k < count; k += W)
        put_few(lamp, grid, chosen + k, min(count - k, W), of_cell, reading->few + reading->packets++);
}

/* Which of a few may stop a ray from triangle i of others. */
static MASK may_stop(const Few *few, const Few *others, const int i) {
    MASK may = (few->near < FLOAT_AT(others->far, i)) & (few->number != INT_AT(others->number, i));
    for (int k = 0; k < 4; k++) may &= few->box[k] >= -FLOAT_AT(others->box[k ^ 2], i);
    if (!ANY(may)) return may;
    for (int plane = 0; plane < 4; plane++) {
        const FLOAT nx = FLOAT_AT(others->nx[plane], i), ny = FLOAT_AT(others->ny[plane], i),
                    nz = FLOAT_AT(others->nz[plane], i);
        const int a = INT_AT(others->corner[plane % 3], i), b = INT_AT(others->corner[(plane + 1) % 3], i);
        const int c = plane == 3 ? INT_AT(others->corner[2], i) : a;
        const FLOAT off = ((magnitude(nx) + magnitude(ny)) + magnitude(nz)) * 0x1p-21f;
        MASK beyond = ALL_LANES;
        for (int k = 0; k < 3; k++) {
            const FLOAT at = FMA(few->x[k], nx, FMA(few->y[k], ny, few->z[k] * nz)), size = few->size[k];
            const MASK there = plane == 3 ? at - off * size >= 1 : at <= -size;
            beyond &= there | (few->corner[k] == a) | (few->corner[k] == b) | (few->corner[k] == c);
        }
        may &= !beyond;
        if (!ANY(may)) return may;
    }
    for (int plane = 0; plane < 4; plane++) {
        const FLOAT nx = few->nx[plane], ny = few->ny[plane], nz = few->nz[plane];
        const INT a = few->corner[plane % 3], b = few->corner[(plane + 1) % 3], c = plane == 3 ? few->corner[2] : a;
        const FLOAT off = ((magnitude(nx) + magnitude(ny)) + magnitude(nz)) * 0x1p-21f;
        MASK beyond = ALL_LANES;
        for (int k = 0; k < 3; k++) {
            const FLOAT x = FLOAT_AT(others->x[k], i), y = FLOAT_AT(others->y[k], i), z = FLOAT_AT(others->z[k], i);
            const FLOAT at = FMA(x, nx, FMA(y, ny, z * nz)), size = FLOAT_AT(others->size[k], i);
            const INT corner = INT_AT(others->corner[k], i);
            const MASK there = plane == 3 ? at + off * size <= 1 : at <= -size;
            beyond &= there | (corner == a) | (corner == b) | (corner == c);
        }
        may &= !beyond;
        if (!ANY(may)) return may;
    }
    return may;
}

/* Whether a coordinate is so small, but for 0, that products of three might underflow. */
static int is_tiny(const double4 size) {
    return (size.x > 0 && size.x < 0x1p-300) || (size.y > 0 && size.y < 0x1p-300) || (size.z > 0 && size.z < 0x1p-300);
}

/* Whether all corners of a triangle are behind the plane of another one as seen from the light (side = 1), or before it
 * (-1), or on it, by numbers of the world. With u = 2^-53, a coordinate of N is off by less than 4 u m, and N.d by less
 * than 8 u of the sum of |d| m, if nothing underflows. Where coordinates are equal, products are exactly 0: this knows
 * planes along axes, such as floors of several triangles that have no corner in common. */
static int is_beside(const Lamp lamp, const int number, const int plane, const double side) {
    const int4 face = lamp.face[plane], other = lamp.face[number];
    const real4 A = lamp.vertex[face.x], e = lamp.vertex[face.y] - A, f = lamp.vertex[face.z] - A;
    const real4 d[4] = {lamp.place - A, lamp.vertex[other.x] - A, lamp.vertex[other.y] - A, lamp.vertex[other.z] - A};
    const double4 xy = e.yzxw * f.zxyw, yx = e.zxyw * f.yzxw, N = xy - yx, m = fabs(xy) + fabs(yx);
    double towards = 0, tiny = 0;
    for (int k = 0; k < 4; k++) {
        const double4 size = fabs(d[k]), part = d[k] * N, off = size * m;
        const double at = (part.x + part.y) + part.z, error = 0x1p-49 * ((off.x + off.y) + off.z);
        if (k == 0) towards = fabs(at) > error ? side * copysign(1.0, at) : 0;
        if (towards == 0 || !(towards * at + error <= (k == 0 ? INFINITY : 0.0))) return 0;
        tiny += is_tiny(size);
    }
    return !(tiny + is_tiny(fabs(e)) + is_tiny(fabs(f)));
}

/* Whether numbers say more than may_stop() does of each of the lanes that may stop such a ray. */
static int are_beside(const Lamp lamp, const Few *few, const Few *others, const int i, const MASK may) {
    int each[W];
    STORE_LANES(may ? few->number : (INT)-2, each);
    const int number = INT_AT(others->number, i);
    for (int lane = 0; lane < W; lane++) {
        if (each[lane] == -2) continue;
        if (each[lane] < 0) return 0;
        if (!is_beside(lamp, each[lane], number, 1) && !is_beside(lamp, number, each[lane], -1)) return 0;
    }
    return 1;
}

/* Whether anything in some packets may stop a ray from triangle i of one of them; of larger cells' lists only where
 * that is in the list of the cell itself. */
static int may_be_stopped(const Lamp lamp, const Few *few, const int packets, const Few *own, const int i) {
    if (!(FLOAT_AT(own->nx[3], i) - FLOAT_AT(own->nx[3], i) == 0)) return 1;
    const float u = -FLOAT_AT(own->box[2], i), v = -FLOAT_AT(own->box[3], i);
    const float to_u = -FLOAT_AT(own->box[0], i), to_v = -FLOAT_AT(own->box[1], i);
    for (int k = 0; k < packets; k++) {
        if (!few[k].of_cell && !own->of_cell) continue;
        const float *around = few[k].around;
        if (around[0] < u || around[1] < v || around[2] < to_u || around[3] < to_v) continue;
        const MASK may = may_stop(few + k, own, i);
        if (ANY(may) && !are_beside(lamp, few + k, own, i, may)) return 1;
    }
    return 0;
}

/* Leaves what is in a list as it is. */
static void leave_open(__global const int2 *entry, const int first, const int end, const int spheres,
                       __global char *open) {
    for (int k = first; k < end; k++)
        if (entry[k].x >= spheres) open[entry[k].x - spheres] = 1;
}

/* Notes of each triangle that is wanted and in a grid's lists that it is there, in `listed`, and whether a point of it
 * may be in a shadow, in `open`. */
__kernel void find_stoppable(const Grid grid, const double4 place, const double4 right, const double4 up,
                             const double4 back, const double unit, const double4 eye, const int spheres,
                             const long facets, __global const int *restrict start, __global const int2 *restrict entry,
                             __global const float4 *restrict facet, __global const real4 *restrict vertex,
                             __global const int4 *restrict face, __global const char *restrict wanted,
                             __global char *restrict listed, __global char *restrict open) {
    const Lamp lamp = {place, right, up, back, unit, eye, spheres, vertex, face, facet + facets, wanted};
    const int items = get_global_size(0), item = get_global_id(0);
    Few few[PACKETS];
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const int cells = level.next - level.first;
        for (int cell = (long)cells * item / items; cell < (long)cells * (item + 1) / items; cell++) {
            const int first = start[level.first + cell], end = start[level.first + cell + 1];
            if (first == end) continue;
            const int2 corner = {(cell % level.columns) << level.level, (cell / level.columns) << level.level};
            /* The list of the cell itself, then those of the larger ones around it. */
            int list[32] = {level.first + cell}, lists = 1, total = end - first;
            for (Level above = first_level(grid); (above = next_level(grid, above)).level > level.level;) {
                list[lists] = cell_of(above, corner);
                total += start[list[lists] + 1] - start[list[lists]];
                lists++;
            }
            if (total > MOST_LISTED) {
                for (int k = 0; k < lists; k++)
                    if (k == 0 || start[list[k] + 1] - start[list[k]] <= MOST_LISTED)
                        leave_open(entry, start[list[k]], start[list[k] + 1], spheres, open);
                continue;
            }
            Reading reading = {entry, few, 0};
            for (int k = 0; k < lists; k++)
                put_list(lamp, grid, start[list[k]], start[list[k] + 1], -1, k == 0, &reading);
            const int asked = reading.packets;
            FLOAT most = 0;
            for (int k = 0; k < asked; k++) most = (few[k].asked & (few[k].far > most)) ? few[k].far : most;
            const float far = LARGEST_FLOAT(most);
            if (far == 0) continue;
            for (int k = 0; k < lists; k++)
                put_list(lamp, grid, start[list[k]], start[list[k] + 1], far, k == 0, &reading);
            for (int i = 0; i < W * asked; i++) {
                const Few *own = few + i / W;
                const int number = INT_AT(own->number, i % W);
                if (!INT_AT(own->asked, i % W) || open[number]) continue;
                listed[number] = 1;
                if (may_be_stopped(lamp, few, reading.packets, own, i % W)) open[number] = 1;
            }
        }
    }
}

/* Notes which triangles are in the lists of so many cells, the first ones, but for those that have been asked about. */
__kernel void find_listed(const int cells, const int spheres, __global const int *restrict start,
                          __global const int2 *restrict entry, __global char *restrict asked,
                          __global char *restrict wanted) {
    const int items = get_global_size(0), item = get_global_id(0), count = start[cells];
    for (int k = (long)count * item / items; k < (long)count * (item + 1) / items; k++)
        if (entry[k].x >= spheres && !asked[entry[k].x - spheres])
            asked[entry[k].x - spheres] = wanted[entry[k].x - spheres] = 1;
}

/* A bit for each triangle, 32 of them in a number: whether nothing can stop a ray from there. */
__kernel void note_unstoppable(const int triangles, const int first, __global const char *restrict listed,
                               __global const char *restrict open, __global int *restrict unstoppable) {
    const int words = (triangles + 31) / 32;
    for (int k = get_global_id(0); k < words; k += get_global_size(0)) {
        int bits = 0;
        for (int i = 0; i < 32 && 32 * k + i < triangles; i++) bits |= (listed[32 * k + i] & !open[32 * k + i]) << i;
        unstoppable[first + k] |= bits;
    }
}

/* samples.cl: antialiasing: which surfaces may be seen in a pixel, and mean colours of pixels from rays at fixed
 * places. */

/* Which pixels a cylinder may be seen in: all those that lists name it for, since where
 * it has a rim, it is different surfaces. */
#define cylinder_touches(scene, view, index, asked) (asked)

/* Which pixels a surface may be seen in, from any place of them, in float32. A surface that is only near a
 * pixel may be named, too, but none that is in it is missed. */
#ifdef WITH_SAMPLES
/* Half of a pixel's width and height, and of its diagonal, where float32 knows rays: on the image plane z = -1, or of
 * parallel rays, in the float buffers' unit. */
typedef struct {
    float x, y, diagonal;
} Margins;

static Margins margins_of(const Frame frame, const Scene *scene) {
    const real unit = HAS(WITH_PARALLEL_RAYS) ? scene->unit : (real)1;
    const float x = (float)(frame.pixel.x * unit), y = (float)(frame.pixel.y * unit);
    const Margins margins = {x, y, sqrt(x * x + y * y) * (1 + 0x1p-20f)};
    return margins;
}

/* The middle rays of pixels, and of what these show the surface's number in the scene file, and t at the corners:
 * within near .. far, in the float buffers' unit. doubtful: where colours alone tell that the corners are not enough.
 */
typedef struct {
    Ray ray;
    EyeLine line;
    Margins margins;
    INT object;
    FLOAT near, far;
    MASK doubtful;
} Outlook;

/* Which of the pixels a sphere may be seen in.
 *
 * Let w be the middle's ray, w + e another one of the pixel, and e no longer than the diagonal h. If that meets the
 * sphere from outside, it does so first at s (w + e), within r of the centre and no further away than where tangents
 * touch the sphere, L. Then s <= L, as rays are no shorter than 1, and s w is within r + L h of the centre. So the line
 * along w meets a sphere that is so large, which small_sphere_may_meet() decides. The radius of an ellipsoid's sphere
 * is in its filter constant, and L is less than the way to its centre. Parallel rays are no further than h from each
 * other, and places on their plane are rounded by 2^-24 of 1 at most, twice each. */
static MASK sphere_is_near(const Scene *scene, const Outlook view, const int index) {
    const float4 s = scene->eye_filter[index];
    const FLOAT x = view.line.x, y = view.line.y;
    const float h = view.margins.diagonal * (1 + 0x1p-20f);
    if (HAS(WITH_PARALLEL_RAYS)) {
        const float r = (sqrt(s.z) + h) * (1 + 0x1p-20f) + 0x1p-21f;
        return FMA(s.x - x, s.x - x, (s.y - y) * (s.y - y)) <= r * r;
    }
    const int stretched = MAP_OF(scene->geometry, index) != 0;
    const real unit = scene->unit;
    const float square = (s.x * s.x + s.y * s.y) + s.z * s.z;
    const float power = stretched ? square : (float)(scene->geometry.power[index].x * unit * unit);
    const float r = stretched ? sqrt(square - s.w) : (float)(scene->geometry.center_radius[index].w * unit);
    if (power <= 0) return ALL_LANES;
    const Float3 w = {x, y, -1};
    return small_sphere_may_meet(w, view.line.a, s, r + sqrt(power) * h);
}

/* In which pixels a sphere is behind what they show, and nowhere before it. Where the middle's ray meets it from
 * outside, all of it is behind the tangent plane there: with the normal n, of any length, other rays w + e meet that at
 * t n.w / (n.w + n.e), parallel ones at t - n.e / n.w. */
static MASK sphere_is_behind(const Scene *scene, const Outlook view, const int index) {
    if (MAP_OF(scene->geometry, index)) return 0;
    const Meeting at = sphere_meet(scene->geometry, view.ray, sphere_at(scene->geometry, index));
    const FLOAT t = TO_FLOAT(at.t * scene->unit) * (1 - 0x1p-20f);
    const Float3 n = {TO_FLOAT(at.from_center.x), TO_FLOAT(at.from_center.y), TO_FLOAT(at.from_center.z)};
    const FLOAT across = TO_FLOAT(-DOT(at.from_center, view.ray.d)),
                room = (fabs(n.x) * view.margins.x + fabs(n.y) * view.margins.y) * (1 + 0x1p-20f);
    const FLOAT least = HAS(WITH_PARALLEL_RAYS) ? t - room / across : t * (across / (across + room));
    return TO_MASK(at.t < INFINITY) & (across > 0) & (least > view.far);
}

/* Which of the pixels that are asked for a sphere may be seen in, before what they show. */
static MASK sphere_touches(const Scene *scene, const Outlook view, const int index, MASK asked) {
    asked = asked & (view.object != (HAS(WITH_TRIANGLES) ? scene->id_of[index] : index));
    if (ANY(asked)) asked = asked & sphere_is_near(scene, view, index);
    return ANY(asked) ? asked & !sphere_is_behind(scene, view, index) : asked;
}

#ifdef WITH_TRIANGLES
/* The same of a triangle.
 *
 * The planes of its edges are linear functions of the place, off by less than 1: see sides_of(). None of them is
 * negative in all of a pixel that the triangle touches. What tells how near its own plane is is a linear function, too.
 * Triangles of the mesh that the pixel shows are no other surface where their planes, all over the pixel, have the
 * depths of its corners, or are no further from these than they are from each other. */
static MASK triangle_touches(const Scene *scene, const Outlook view, const int index, const MASK asked) {
    __global const float4 *facet = scene->facet + 3 * (long)(index - FIRST_TRIANGLE(scene->geometry));
    const float h = view.margins.x * (1 + 0x1p-20f), k = view.margins.y * (1 + 0x1p-20f);
    MASK near = asked;
    for (int i = 0; i < 3; i++) {
        const float4 edge = facet[i];
        const FLOAT side = FMA(view.line.x, (FLOAT)edge.x,
                               FMA(view.line.y, (FLOAT)edge.y, (FLOAT)(HAS(WITH_PARALLEL_RAYS) ? edge.z : -edge.z)));
        near = near & !(side + (fabs(edge.x) * h + fabs(edge.y) * k) < -1);
    }
    const FLOAT low = HAS(WITH_PARALLEL_RAYS) ? -view.far : 1 / view.far,
                high = HAS(WITH_PARALLEL_RAYS) ? -view.near : 1 / view.near;
    const FLOAT more = (high - low) + 0x1p-18f * fabs(high);
    const float room = (fabs(facet[0].w) * view.margins.x + fabs(facet[1].w) * view.margins.y) * (1 + 0x1p-20f);
    const Bounds plane = near_plane(view.line.x, view.line.y, facet);
    const MASK same = scene->id_of[index] == view.object;
    /* What is unknown is a NaN, see Bounds. */
    const MASK strays = !(same & (plane.high + room <= high + more) & (plane.low - room >= low - more));
    return near & strays & !(plane.high + room < low - 0x1p-18f * fabs(low));
}
#endif

/* Which of the pixels that are `asked` may show another surface than that of which the rays through their corners have
 * all met one: its number in the scene file is `object`, and -1 stands for none.
 *
 * near, far: t at the corners. The surface itself is no further away in between: a sphere is seen from outside,
 * and then 1/t is a concave function of the place, or of parallel rays -t. */
static MASK may_show_another(const Scene *scene, const int2 tile, const Outlook view, const MASK asked) {
    const FLOAT corner = sqrt(view.line.a) + view.margins.diagonal, most = DEPTH_AT(view.far, corner * corner);
    const FLOAT depth = most * REACH_SLACK;
    const float last = LARGEST_FLOAT(asked ? depth : (FLOAT)0);
    const Grid grid = scene->lists.grid[0];
    Level level = first_level(grid);
    MASK found = 0;
    while (level.mask && ANY(asked & !found)) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile), end = scene->lists.start[cell + 1];
        for (int k = scene->lists.start[cell]; k < end; k++) {
            const int2 entry = scene->lists.entry[k];
            if (as_float(entry.y) > last) break;
            const MASK other = asked & !found & (depth >= as_float(entry.y));
            if (ANY(other)) found = found | ASK_SHAPE(scene->geometry, entry.x, touches(scene, view, entry.x, other));
        }
    }
    return asked & found;
}
#endif

/* Mean colours of pixels from rays at fixed places, each of which is decided as any ray is.
 *
 * First the rays through the corners of pixels, which neighbours share. Where the four of a pixel agree and nothing
 * else is in it, their mean is the pixel's. Where nothing else is in it and only colours differ, four more rays may do,
 * see try_few(). Else it is the mean over N places of a lattice, (i + 1/2, (a i mod N) + 1/2) / N from the
 * upper left corner: these are middles of pixels of a picture that is N times as large. The rays of a pixel are lanes
 * of one packet.
 *
 * Colours count up to 1 each, and are whole numbers of 2^-20 before they are added up. So a mean does not depend on the
 * order, on the width of packets or on what else is drawn.
 */
#ifdef WITH_SAMPLES
#define ONE (1 << 20) /* a full colour */
/* Corners that have met the same surface, lights and texels leave out the bend of the colour alone, where they differ
 * by no more than MOST_SLOPE. Their mean is mostly off by FEW_SCATTER of what they differ by. So is the mean of eight
 * rays, of which no difference above MOST_SLOPE counts. */
#define MOST_SLOPE (24 * ONE / 255)
#define FEW_SCATTER 0.28f
/* From so many rays of a lattice on, four come first where only colours tell that corners are not enough. Together with
 * the corners these are enough where they differ by no more than MOST_SLOPE. 95 of 100 means over n random rays are
 * within 1.96 standard deviations of one ray, over sqrt(n). */
#define TRIED 16
#define GRAIN_SCATTER 0.98f
/* They are enough, too, where they differ by no more than MOST_BEND, as on a small ball, but the mean of these four is
 * that of the corners but for MOST_BENT. What the mean of all is off by does not grow then. */
#define MOST_BEND (48 * ONE / 255)
#define MOST_BENT (2 * ONE / 255)
/* A quarter of a lattice comes first, but no fewer than 2^LOG_FIRST_FEW rays, and is enough where it differs by no more
 * than MOST_CONTRAST: an edge puts the mean of 16 off by 4 % of that. */
#define LOG_FIRST_FEW 4
#define MOST_CONTRAST (64 * ONE / 255)
/* Eight rays between more texels than MOST_KINDS, some of which are in uneven squares, may have missed letters of a
 * page; so may four corners that have met three different things. Then a pixel has all rays of the lattice. What covers
 * MISSED times the area that one ray stands for is missed by all of them in about a fifth of the pixels that have it.
 * It may be black or white. */
#define MOST_KINDS 5
#define MISSED 1.5f

static Outlook outlook_of(const Frame frame, const Scene *scene, const Packet packet) {
    const Ray ray = primary_ray(frame, packet.size, packet.column, packet.row);
    const Outlook view = {ray, eye_line(scene, ray), margins_of(frame, scene)};
    return view;
}

/* What is known of rays: red, green and blue in parts of ONE; of the surface that they meet a number, -1 for
 * none; what they have met on their way, and in the last bit whether uneven texels; the bits of t, rounded up,
 * in the float buffers' unit; whether one took too many rays. */
enum { RED, GREEN, BLUE, OBJECT, MET, FAR, LATE, FINDINGS };
typedef struct {
    INT of[FINDINGS];
} Found;

/* Where rays go: through the middles of those pixels of a picture of a size. */
typedef struct {
    int2 size;
    INT column, row;
} Places;

/* What the rays through the upper left corners of pixels find: of a row of packets that a work-item renders, of the one
 * below, and of those to their right. row: each one's first row in the picture, -1 where it is not known yet; begin:
 * their first column; region: x, y, width and height of what is rendered. */
typedef struct {
    int4 region;
    int begin, row[2];
    Found of[2][RUN + 1];
} PixelCorners;

/* The lanes of a packet `a` moved by one, so that each pixel has what is to its right, or below it; b: the packet
 * there.
 */
#define TO_THE_RIGHT(a, b) PASTE(TO_THE_RIGHT_, W)(a, b)
#define FROM_BELOW(a, b) PASTE(FROM_BELOW_, W)(a, b)
#define TO_THE_RIGHT_1(a, b) (b)
#define TO_THE_RIGHT_4(a, b) ((INT)((a).s123, (b).s0))
#define TO_THE_RIGHT_8(a, b) ((INT)((a).s123, (b).s0, (a).s567, (b).s4))
#define TO_THE_RIGHT_16(a, b) ((INT)((a).s123, (b).s0, (a).s567, (b).s4, (a).s9ab, (b).s8, (a).sdef, (b).sc))
#define FROM_BELOW_1(a, b) (b)
#define FROM_BELOW_4(a, b) (b)
#define FROM_BELOW_8(a, b) ((INT)((a).s4567, (b).s0123))
#define FROM_BELOW_16(a, b) ((INT)((a).s4567, (a).s89ab, (a).scdef, (b).s0123))

static INT parts_of(const SHADE color) {
    const SHADE seen = color > 0 ? color : (SHADE)0;
    return TO_INT((seen < 1 ? seen : (SHADE)1) * (shade_t)ONE + (shade_t)0.5f);
}

/* What rays through the middles of pixels find, all of which are in a tile. Corners and samples share one copy of the
 * code. */
static __attribute__((noinline)) void find(const Frame *camera, const Scene *scene, const Places *places,
                                           const int2 tile, Found *found, Work *work) {
    const Frame frame = *camera;
    const Ray ray = for_shapes(frame, primary_ray(frame, places->size, places->column, places->row));
    Pixels pixels = {{INFINITY, -1, {0, 0, 1}}, {frame.background.x, frame.background.y, frame.background.z}};
    pixels.wanted = ALL_LANES;
    work->mark = work->texels = 0;
    work->uneven = 0;
    const Hit hit = closest_hit(scene, ray, tile, work);
    MASK inside = 0;
    if (ANY(hit.id >= 0)) {
        const Intersection at = intersection_at(frame, scene, ray, hit);
        show_colors(at.hit, follow(frame, scene, ray, at, hit.id, &pixels, work), &pixels);
        if (TEXTURED(scene) && !HAS(WITH_BOUNCES)) {
            MARK(texels, at.texel >= 0, at.texel, 0);
            work->uneven = at.hit & at.uneven;
        }
        if (HAS(WITH_INSIDE)) inside = at.hit & TO_MASK(at.start.side < 0);
    }
    const FLOAT far = TO_FLOAT(hit.t * scene->unit) * (1 + 0x1p-20f);
    found->of[RED] = parts_of(pixels.color.x);
    found->of[GREEN] = parts_of(pixels.color.y);
    found->of[BLUE] = parts_of(pixels.color.z);
    found->of[OBJECT] = HAS(WITH_TRIANGLES) ? ids_of(scene, hit.id) : hit.id;
    if (HAS(WITH_PLANES))
        PUT_WHERE(hit.plane >= 0, found->of[OBJECT], (found->of[OBJECT] + ((hit.plane + 1) << 23)) & 0x7fffffff);
    found->of[MET] = AS(int, (work->mark + work->texels) << 1) | (work->uneven ? (INT)1 : (INT)0);
    found->of[FAR] = AS(int, inside ? (FLOAT)INFINITY : far);
    found->of[LATE] = pixels.overgrown;
}

/* The corners of a row of packets, which begins at `row`. The last tile of the region has the corners on its right and
 * lower edges, too. */
static const Found *corners_of_row(const Frame frame, const Scene *scene, const int2 size, const int row,
                                   PixelCorners *corners, Work *work) {
    const int slot = row / PACKET_HEIGHT & 1;
    const int4 region = corners->region;
    const int2 last = (region.xy + region.zw - 1) / TILE;
    if (corners->row[slot] == row) return corners->of[slot];
    corners->row[slot] = row;
    for (int i = 0; i <= RUN && corners->begin + i * PACKET_WIDTH <= region.x + region.z; i++) {
        const int2 first = {corners->begin + i * PACKET_WIDTH, row};
        /* With a pixel more, the middle of the picture is half a pixel further, and a pixel's middle is a corner. */
        const Places places = {size + 1, first.x + LANE_COLUMN, first.y + LANE_ROW};
        find(&frame, scene, &places, min(first / TILE, last), &corners->of[slot][i], work);
    }
    return corners->of[slot];
}

/* Sums over rays through a packet's pixels: red, green, blue and how many met a surface; the smallest and largest of
 * each. count: how many rays; late: whether one took too many; uneven: whether a texture may hide something from the
 * first ones; met: what these have met. */
#define FIRST_MET 8
typedef struct {
    INT sum[4], low[3], high[3], count, late, uneven, met[FIRST_MET];
} Totals;
#define NO_TOTALS {{0, 0, 0, 0}, {ONE, ONE, ONE}, {0, 0, 0}, 0, 0, 0, {0}}

/* Takes a corner into account. */
static void add_corner(const INT *found, Totals *totals) {
    for (int c = 0; c < 3; c++) {
        totals->sum[c] += found[c];
        totals->low[c] = min(totals->low[c], found[c]);
        totals->high[c] = max(totals->high[c], found[c]);
    }
    totals->late |= found[LATE];
}

/* The largest difference between colours, of red, green and blue. */
static INT contrast_of(const Totals *totals) {
    INT contrast = 0;
    for (int c = 0; c < 3; c++) contrast = max(contrast, totals->high[c] - totals->low[c]);
    return contrast;
}

/* In which pixels a texture may hide something from the first rays, if these have met more than so many kinds. */
static INT may_hide(const Scene *scene, const Totals *totals, const int rays, const int most) {
    INT kinds = 0, uneven = 0;
    for (int i = 0; TEXTURED(scene) && i < rays; i++) {
        MASK known = 0;
        for (int j = 0; j < i; j++) known = known | (totals->met[j] == totals->met[i]);
        kinds += known ? (INT)0 : (INT)1;
        uneven |= totals->met[i] & 1;
    }
    return kinds > most ? uneven : (INT)0;
}

/* The sums over corners. Returns the pixels in which these are not the mean. */
static MASK add_corners(const Frame frame, const Scene *scene, const Packet packet, PixelCorners *corners,
                        Outlook *view, Totals *totals, Work *work) {
    const int i = (packet.first.x - corners->begin) / PACKET_WIDTH, row = packet.first.y;
    const Found *upper = corners_of_row(frame, scene, packet.size, row, corners, work) + i,
                *lower = corners_of_row(frame, scene, packet.size, row + PACKET_HEIGHT, corners, work) + i;
    Found corner[4];
    for (int k = 0; k < FINDINGS; k++) {
        const INT own = upper->of[k], below = lower->of[k];
        const INT right = TO_THE_RIGHT(own, upper[1].of[k]), beyond = TO_THE_RIGHT(below, lower[1].of[k]);
        corner[0].of[k] = own;
        corner[1].of[k] = right;
        corner[2].of[k] = FROM_BELOW(own, below);
        corner[3].of[k] = FROM_BELOW(right, beyond);
    }
    MASK mixed = 0, rough = 0;
    FLOAT far = 0, near = INFINITY;
    for (int k = 0; k < 4; k++) {
        const INT *found = corner[k].of;
        const FLOAT t = AS(float, found[FAR]);
        far = t > far ? t : far;
        near = t < near ? t : near;
        mixed = mixed | (found[OBJECT] != corner[0].of[OBJECT]);
        rough = rough | (found[MET] != corner[0].of[MET]);
        if (TEXTURED(scene)) totals->met[k] = found[MET];
        add_corner(found, totals);
    }
    rough = rough | (contrast_of(totals) > MOST_SLOPE);
    totals->count = 4;
    totals->sum[3] = corner[0].of[OBJECT] >= 0 ? (INT)4 : (INT)0;
    totals->uneven = may_hide(scene, totals, 4, 2);
    view->object = corner[0].of[OBJECT];
    view->near = near;
    view->far = far;
    const MASK asked = packet.within & !mixed;
    if (ANY(asked)) mixed = mixed | may_show_another(scene, packet.tile, *view, asked);
    view->doubtful = packet.within & !mixed & rough;
    return packet.within & (mixed | rough);
}

/* The sums over rays through one pixel, of each lane's. */
static void add_rays(const Found *found, const MASK in, Totals *totals) {
    for (int c = 0; c < 3; c++) {
        const INT part = found->of[c];
        totals->sum[c] += in ? part : (INT)0;
        totals->low[c] = in ? min(totals->low[c], part) : totals->low[c];
        totals->high[c] = in ? max(totals->high[c], part) : totals->high[c];
    }
    totals->sum[3] += (in & (found->of[OBJECT] >= 0)) ? (INT)1 : (INT)0;
    totals->late |= found->of[LATE];
}

/* Puts what the lanes of `own` add up to into one lane of the totals. */
static void put_totals(const Totals *own, const int lane, Totals *totals) {
    const MASK here = (INT)lane == LANE_NUMBER;
    for (int c = 0; c < 4; c++) totals->sum[c] = here ? (INT)SUM(own->sum[c]) : totals->sum[c];
    for (int c = 0; c < 3; c++) {
        totals->low[c] = here ? (INT)(-LARGEST(-own->low[c])) : totals->low[c];
        totals->high[c] = here ? (INT)LARGEST(own->high[c]) : totals->high[c];
    }
    totals->late = here ? (INT)ANY(own->late) : totals->late;
    totals->count = here ? own->count : totals->count;
}

/* The binary logarithm of how many rays of a lattice come first. */
static int log_first_few(const Scene *scene) {
    return min(scene->lattice.x, max(scene->lattice.x - 2, LOG_FIRST_FEW));
}

/* The rays number first .. first + W - 1 through the places of a pixel: first those that come first, which are a
 * lattice themselves, of which the middle is all but that of the pixel, then the others. */
static Places lattice_places(const Scene *scene, const Packet packet, const int lane, const int first) {
    const int few = log_first_few(scene), n = 1 << scene->lattice.x, step = n >> few;
    const INT number = first + LANE_NUMBER;
    const INT i = (step * number + (((number >> few) + step / 2) & (step - 1))) & (n - 1);
    const Places places = {packet.size * n, (packet.first.x + lane % PACKET_WIDTH) * n + i,
                           (packet.first.y + lane / PACKET_WIDTH) * n + ((INT)scene->lattice.y * i & (n - 1))};
    return places;
}

static int largest_contrast(const Totals *own) {
    int contrast = 0;
    for (int c = 0; c < 3; c++) contrast = max(contrast, LARGEST(own->high[c]) + LARGEST(-own->low[c]));
    return contrast;
}

/* The sums over the rays through places of one pixel of a packet: those that come first, if these differ by little and
 * no texture may hide something, else all. */
static void sample_pixel(const Frame *finer, const Scene *scene, const Packet packet, const int lane, Totals *totals,
                         Work *work) {
    const int n = 1 << scene->lattice.x;
    Totals own = NO_TOTALS;
    int end = ((const int *)&totals->uneven)[lane] ? n : 1 << log_first_few(scene);
    for (int first = 0; first < end && !is_over(scene); first += W) {
        const Places places = lattice_places(scene, packet, lane, first);
        Found found;
        find(finer, scene, &places, packet.tile, &found, work);
        add_rays(&found, first + LANE_NUMBER < n, &own);
        if (first + W >= end && largest_contrast(&own) > MOST_CONTRAST) end = n;
    }
    own.count = end;
    put_totals(&own, lane, totals);
}

/* Adds what one lane's ray has found to the sums of a pixel. */
static void add_ray(const Found *found, const int lane, const int pixel, Totals *totals) {
    const int *parts = (const int *)found->of + lane;
    int *sum = (int *)totals->sum + pixel, *low = (int *)totals->low + pixel, *high = (int *)totals->high + pixel;
    for (int c = 0; c < 3; c++) {
        const int part = parts[c * W];
        sum[c * W] += part;
        low[c * W] = min(low[c * W], part);
        high[c * W] = max(high[c * W], part);
    }
    sum[3 * W] += parts[OBJECT * W] >= 0;
    ((int *)&totals->late)[pixel] |= parts[LATE * W];
    const int number = ((int *)&totals->count)[pixel]++;
    ((int *)totals->met)[number % FIRST_MET * W + pixel] = parts[MET * W];
}

/* Adds 4 rays of the lattice, which are one themselves, to the sums over corners of those pixels that are `doubtful`.
 * Returns those of them in which colours differ by much still, or might. Rays of different pixels are lanes of one
 * packet. */
static MASK try_few(const Frame *finer, const Scene *scene, const Packet packet, const MASK doubtful, Totals *totals,
                    Work *work) {
    const int n = 1 << scene->lattice.x;
    if (n < TRIED) return doubtful;
    int each[W], pixel[W], x[W], y[W], count = 0;
    STORE_LANES(doubtful, each);
    const Totals corners = *totals;
    for (int lane = 0; lane < W; lane++)
        if (each[lane]) pixel[count++] = lane;
    for (int first = 0; first < 4 * count && !is_over(scene); first += W) {
        for (int lane = 0; lane < W; lane++) {
            const int number = min(first + lane, 4 * count - 1), own = pixel[number / 4],
                      i = number % 4 * (n / 4) + n / 8;
            x[lane] = (packet.first.x + own % PACKET_WIDTH) * n + i;
            y[lane] = (packet.first.y + own / PACKET_WIDTH) * n + (scene->lattice.y * i & (n - 1));
        }
        const Places places = {packet.size * n, LOAD_LANES(x), LOAD_LANES(y)};
        Found found;
        find(finer, scene, &places, packet.tile, &found, work);
        for (int lane = 0; lane < W && first + lane < 4 * count; lane++)
            add_ray(&found, lane, pixel[(first + lane) / 4], totals);
    }
    const INT contrast = contrast_of(totals);
    INT bent = 0;
    for (int c = 0; c < 3; c++) {
        const INT more = totals->sum[c] - 2 * corners.sum[c];
        bent = max(bent, max(more, -more));
    }
    const MASK differ = (contrast > MOST_SLOPE) & ((contrast > MOST_BEND) | (bent > 4 * MOST_BENT));
    totals->uneven = doubtful ? may_hide(scene, totals, FIRST_MET, MOST_KINDS) : totals->uneven;
    return doubtful & (differ | (totals->uneven != 0));
}

/* Puts the sums over all places into the totals of those pixels that are `mixed` and need them, which it returns. Of
 * doubtful ones four rays are tried first. */
static MASK add_samples(const Frame frame, const Scene *scene, const Packet packet, const Outlook view, MASK mixed,
                        Totals *totals, Work *work) {
    Frame finer = frame;
    finer.pixel.x /= 1 << scene->lattice.x;
    finer.pixel.y /= 1 << scene->lattice.x;
    if (ANY(view.doubtful))
        mixed = (mixed & !view.doubtful) | try_few(&finer, scene, packet, view.doubtful, totals, work);
    if (!ANY(mixed)) return mixed;
    int each[W];
    STORE_LANES(mixed, each);
    for (int lane = 0; lane < W; lane++)
        if (each[lane]) sample_pixel(&finer, scene, packet, lane, totals, work);
    return mixed;
}

/* What means are off by, mostly, in levels: so many for each one by which the rays of a pixel differ. Something that no
 * ray of a lattice meets may be black or white; mostly it covers no more than an eighth of the area that one ray stands
 * for, or in uneven textures MISSED times that area. Where colours alone told that corners are not enough, rays may be
 * like random ones of two colours, whose standard deviation is half of the difference. mixed: the pixels that have a
 * lattice. */
static FLOAT error_of(const Scene *scene, const Outlook view, const Totals *totals, const MASK mixed) {
    const INT count = totals->count, lattice = 1 << scene->lattice.x;
    const FLOAT rays = TO_FLOAT(count), root = sqrt(TO_FLOAT(lattice) / rays), grain = GRAIN_SCATTER / sqrt(rays),
                edge = scene->scatter * (root * sqrt(root));
    const FLOAT contrast = TO_FLOAT(contrast_of(totals)),
                error = contrast * ((view.doubtful & (grain > edge)) ? grain : edge);
    const FLOAT unseen = ((totals->uneven != 0) ? MISSED * (ONE - contrast) : (FLOAT)(ONE / 8)) / rays;
    const FLOAT few = (contrast < MOST_SLOPE ? contrast : (FLOAT)MOST_SLOPE) * FEW_SCATTER;
    return (mixed ? (error > unseen ? error : unseen) : few) * (255.0f / ONE);
}

/* Puts the means into a packet of pixels. */
static void sample_pixels(const Frame frame, const Scene *scene, const Packet packet, PixelCorners *corners,
                          Pixels *pixels, Work *work) {
    Totals totals = NO_TOTALS;
    Outlook view = outlook_of(frame, scene, packet);
    MASK mixed = add_corners(frame, scene, packet, corners, &view, &totals, work);
    if (ANY(mixed)) mixed = add_samples(frame, scene, packet, view, mixed, &totals, work);
    const FLOAT over = 1 / TO_FLOAT(totals.count);
    const SHADE share = TO_SHADE(over) * (shade_t)(1.0f / ONE);
    pixels->color.x = TO_SHADE(totals.sum[0]) * share;
    pixels->color.y = TO_SHADE(totals.sum[1]) * share;
    pixels->color.z = TO_SHADE(totals.sum[2]) * share;
    pixels->coverage = TO_FLOAT(totals.sum[3]) * over;
    pixels->error = error_of(scene, view, &totals, mixed);
    /* What is beside the region may have corners that nobody has looked at. */
    pixels->overgrown = (totals.late != 0) & pixels->wanted;
    COUNT(SAMPLED, mixed);
}
#endif

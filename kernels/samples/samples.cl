/* samples.cl: mean colours of pixels from rays at fixed places, each of which is decided as any ray is.
 *
 * First the rays through the corners of pixels, which neighbours share. Where the four of a pixel agree and nothing
 * else is in it, their mean is the pixel's. Else it is the mean over N places of a lattice, (i + 1/2, (a i mod N) +
 * 1/2) / N from the upper left corner: these are middles of pixels of a picture that is N times as large.
 *
 * Colours count up to 1 each, and are whole numbers of 2^-20 before they are added up. So a mean does not depend on the
 * order, on the width of packets or on what else is drawn.
 */
#ifdef WITH_SAMPLES
/* A full colour. What corners may differ by where they have met the same surface, lights and texels, so that what they
 * leave out is the bend of the colour; and where not: an edge between corners moves the mean by a half of that at most.
 * What a plain pixel is off by, mostly, for each 1 by which its corners differ. */
#define ONE (1 << 20)
#define MOST_SLOPE (24 * ONE / 255)
#define MOST_STEP (8 * ONE / 255)
#define CORNER_SCATTER 0.25f

/* What is known of rays: red, green and blue in parts of ONE; of the surface that they meet a number, see touches.cl,
 * -1 for none; what they have met on their way; the bits of t, rounded up, in the float buffers' unit; whether one took
 * too many rays. */
enum { RED, GREEN, BLUE, OBJECT, MET, FAR, LATE, FINDINGS };
typedef struct {
    INT of[FINDINGS];
} Found;

/* Those of the upper left corners of pixels: of the packets that a work-item renders, and of those to their right and
 * below. origin: the first packet's first pixel in the picture. */
#define CORNER_ROWS ((W > 1 ? BLOCK_ROWS : 1) + 1)
typedef struct {
    int2 origin;
    Found of[CORNER_ROWS][RUN + 1];
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

/* What rays find, all of which are in a tile. Corners and samples share one copy of the code. */
static __attribute__((noinline)) Found find(const Frame *camera, const Scene *all, const Ray *from, const int2 tile,
                                            Work *work) {
    const Frame frame = *camera;
    const Scene scene = *all;
    const Ray ray = for_shapes(frame, *from);
    Pixels pixels = {{INFINITY, -1, {0, 0, 1}}, {frame.background.x, frame.background.y, frame.background.z}};
    pixels.wanted = ALL_LANES;
    work->mark = work->texels = 0;
    const Hit hit = closest_hit(scene, ray, tile, work);
    MASK inside = 0;
    if (ANY(hit.id >= 0)) {
        const Intersection at = intersection_at(frame, scene, ray, hit);
        show_colors(at.hit, follow(frame, scene, ray, at, hit.id, &pixels, work), &pixels);
        if (HAS(WITH_TEXTURES) & !HAS(WITH_BOUNCES)) MARK(texels, at.texel >= 0, at.texel, 0);
        if (HAS(WITH_INSIDE)) inside = at.hit & TO_MASK(at.start.side < 0);
    }
    const FLOAT far = TO_FLOAT(hit.t * scene.unit) * (1 + 0x1p-20f);
    Found found;
    found.of[RED] = parts_of(pixels.color.x);
    found.of[GREEN] = parts_of(pixels.color.y);
    found.of[BLUE] = parts_of(pixels.color.z);
    found.of[OBJECT] = HAS(WITH_TRIANGLES) ? ids_of(scene, hit.id) : hit.id;
    found.of[MET] = AS(int, work->mark + work->texels);
    found.of[FAR] = AS(int, inside ? (FLOAT)INFINITY : far);
    found.of[LATE] = pixels.overgrown;
    return found;
}

/* What the rays through the upper left corners of those packets find. The last tile of the region has the corners on
 * its right and lower edges, too. */
static void find_corners(const Frame frame, const Scene scene, const int2 size, const int4 region, const int2 begin,
                         PixelCorners *corners, Work *work) {
    const int2 last = (region.xy + region.zw - 1) / TILE;
    corners->origin = begin;
    for (int j = 0; j < CORNER_ROWS && begin.y + j * PACKET_HEIGHT <= region.y + region.w; j++)
        for (int i = 0; i <= RUN && begin.x + i * PACKET_WIDTH <= region.x + region.z; i++) {
            const int2 first = begin + (int2)(i * PACKET_WIDTH, j * PACKET_HEIGHT);
            /* With a pixel more, the middle of the picture is half a pixel further, and a pixel's middle is a corner.
             */
            const Ray ray = primary_ray(frame, size + 1, first.x + LANE_COLUMN, first.y + LANE_ROW);
            corners->of[j][i] = find(&frame, &scene, &ray, min(first / TILE, last), work);
        }
}

/* Sums over rays through a packet's pixels: red, green, blue and how many met a surface; the smallest and largest of
 * each. count: how many rays; late: whether one took too many. */
typedef struct {
    INT sum[4], low[3], high[3], count, late;
} Totals;

/* Takes a corner into account. */
static void add_corner(const INT *found, Totals *totals) {
    for (int c = 0; c < 3; c++) {
        totals->sum[c] += found[c];
        totals->low[c] = min(totals->low[c], found[c]);
        totals->high[c] = max(totals->high[c], found[c]);
    }
    totals->late |= found[LATE];
}

/* The sums over corners. Returns the pixels in which these are not the mean. */
static MASK add_corners(const Frame frame, const Scene scene, const Packet packet, const PixelCorners *corners,
                        Totals *totals) {
    const int i = (packet.first.x - corners->origin.x) / PACKET_WIDTH,
              j = (packet.first.y - corners->origin.y) / PACKET_HEIGHT;
    const Found *upper = &corners->of[j][i], *lower = &corners->of[j + 1][i];
    Found corner[4];
    for (int k = 0; k < FINDINGS; k++) {
        const INT own = upper->of[k], below = lower->of[k];
        const INT right = TO_THE_RIGHT(own, upper[1].of[k]), beyond = TO_THE_RIGHT(below, lower[1].of[k]);
        corner[0].of[k] = own;
        corner[1].of[k] = right;
        corner[2].of[k] = FROM_BELOW(own, below);
        corner[3].of[k] = FROM_BELOW(right, beyond);
    }
    MASK mixed = 0, turns = 0;
    FLOAT far = 0, near = INFINITY;
    for (int k = 0; k < 4; k++) {
        const INT *found = corner[k].of;
        const FLOAT t = AS(float, found[FAR]);
        far = t > far ? t : far;
        near = t < near ? t : near;
        mixed = mixed | (found[OBJECT] != corner[0].of[OBJECT]);
        turns = turns | (found[MET] != corner[0].of[MET]);
        add_corner(found, totals);
    }
    const INT most = turns ? (INT)MOST_STEP : (INT)MOST_SLOPE;
    for (int c = 0; c < 3; c++) mixed = mixed | (totals->high[c] - totals->low[c] > most);
    totals->count = 4;
    totals->sum[3] = corner[0].of[OBJECT] >= 0 ? (INT)4 : (INT)0;
    const MASK asked = packet.within & !mixed;
    if (ANY(asked)) mixed = mixed | crowded(frame, scene, packet, corner[0].of[OBJECT], near, far, asked);
    return packet.within & mixed;
}

/* The rays through places of pixels: ray number i of pixel p is number p N + i of all, and lanes are W of them from
 * `first` on; beyond `end` the last one is repeated. which: those of the packet's pixels. */
static Ray sample_rays(const Frame frame, const Scene scene, const Packet packet, const int *which, const int first,
                       const int end) {
    const int n = 1 << scene.lattice.x;
    int x[W], y[W];
    for (int lane = 0; lane < W; lane++) {
        const int number = min(first + lane, end - 1), i = number & (n - 1), pixel = which[number >> scene.lattice.x];
        x[lane] = (packet.first.x + pixel % PACKET_WIDTH) * n + i;
        y[lane] = (packet.first.y + pixel / PACKET_WIDTH) * n + (scene.lattice.y * i & (n - 1));
    }
    Frame finer = frame;
    finer.pixel.x /= n;
    finer.pixel.y /= n;
    return primary_ray(finer, packet.size * n, LOAD_LANES(x), LOAD_LANES(y));
}

/* The sums over all places, of one pixel. */
typedef struct {
    int sum[4], low[3], high[3], late;
} Tally;

static void add_ray(const int found[FINDINGS][W], const int lane, Tally *tally) {
    for (int c = 0; c < 3; c++) {
        tally->sum[c] += found[c][lane];
        tally->low[c] = min(tally->low[c], found[c][lane]);
        tally->high[c] = max(tally->high[c], found[c][lane]);
    }
    tally->sum[3] += found[OBJECT][lane] >= 0;
    tally->late |= found[LATE][lane];
}

/* Puts the sums over all places into the totals of those pixels that are `mixed`. */
static void add_samples(const Frame frame, const Scene scene, const Packet packet, const MASK mixed, Totals *totals,
                        Work *work) {
    int each[W], which[W], count = 0;
    Tally tally[W];
    STORE_LANES(mixed, each);
    for (int lane = 0; lane < W; lane++) {
        const Tally none = {{0, 0, 0, 0}, {ONE, ONE, ONE}, {0, 0, 0}, 0};
        tally[lane] = none;
        if (each[lane]) which[count++] = lane;
    }
    const int end = count << scene.lattice.x;
    for (int first = 0; first < end && !is_over(scene); first += W) {
        int found[FINDINGS][W];
        const Ray ray = sample_rays(frame, scene, packet, which, first, end);
        const Found rays = find(&frame, &scene, &ray, packet.tile, work);
        for (int k = 0; k < FINDINGS; k++) STORE_LANES(rays.of[k], found[k]);
        for (int lane = 0; lane < W && first + lane < end; lane++)
            add_ray(found, lane, &tally[which[(first + lane) >> scene.lattice.x]]);
    }
    for (int c = 0; c < 4; c++) PUT_WHERE(mixed, totals->sum[c], (INT)EACH_LANE(tally, .sum[c]));
    for (int c = 0; c < 3; c++) {
        PUT_WHERE(mixed, totals->low[c], (INT)EACH_LANE(tally, .low[c]));
        PUT_WHERE(mixed, totals->high[c], (INT)EACH_LANE(tally, .high[c]));
    }
    PUT_WHERE(mixed, totals->count, (INT)(1 << scene.lattice.x));
    totals->late |= (INT)EACH_LANE(tally, .late);
}

/* Puts the means into a packet of pixels. The error is an estimate: so many levels for each one by which the rays of a
 * pixel differ. */
static void sample_pixels(const Frame frame, const Scene scene, const Packet packet, const PixelCorners *corners,
                          Pixels *pixels, Work *work) {
    Totals totals = {{0, 0, 0, 0}, {ONE, ONE, ONE}, {0, 0, 0}, 0, 0};
    const MASK mixed = add_corners(frame, scene, packet, corners, &totals);
    if (ANY(mixed)) add_samples(frame, scene, packet, mixed, &totals, work);
    const FLOAT over = 1 / TO_FLOAT(totals.count);
    const SHADE share = TO_SHADE(over) * (shade_t)(1.0f / ONE);
    INT contrast = 0;
    for (int c = 0; c < 3; c++) contrast = max(contrast, totals.high[c] - totals.low[c]);
    pixels->color.x = TO_SHADE(totals.sum[0]) * share;
    pixels->color.y = TO_SHADE(totals.sum[1]) * share;
    pixels->color.z = TO_SHADE(totals.sum[2]) * share;
    pixels->coverage = TO_FLOAT(totals.sum[3]) * over;
    /* What no ray of a lattice meets covers an eighth of what one of them stands for, mostly, and may be black or
     * white. */
    const FLOAT unseen = over * (ONE / 8), error = TO_FLOAT(contrast) * scene.scatter;
    const FLOAT sampled = error > unseen ? error : unseen;
    pixels->error = (mixed ? sampled : TO_FLOAT(contrast) * CORNER_SCATTER) * (255.0f / ONE);
    pixels->overgrown = totals.late != 0;
    COUNT(SAMPLED, mixed);
}
#endif

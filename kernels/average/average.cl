/* average.cl: the mean colour of a pixel's square, each colour up to 1, with a bound of what it is off by.
 *
 * A pixel is one cell, then 16, 256 or 4,096: those cells that are not known well enough are split, breadth first, until the
 * bounds of all add up to no more than `levels`, or too many cells would be split at once. Sums are whole numbers, so that no
 * order of cells changes a bit.
 */
#ifdef WITH_AVERAGE
/* The finest level; how many cells of a level may be split; the finest level where there is no proof. */
#define FINEST 3
#define MOST_SPLIT 256
#define FINEST_ESTIMATE 2

/* SURE: within the error; OPEN: too, but it may be large, and smaller after splitting; ESTIMATED: the colour at the cell's
 * middle alone is known. */
#define SURE 0
#define OPEN 1
#define ESTIMATED 2

/* What is known of a packet of cells: the mean colour, the share that surfaces have, and the colour's error in levels of 255. */
typedef struct {
    SHADE color[3];
    FLOAT coverage, error;
    INT state;
} Means;

/* The rays through the middles of those cells that are `wanted`: their colours, 1 at most. */
static __attribute__((noinline)) void sample_cells(const Frame frame, const Scene scene, const Cells cells, const int2 tile, const MASK wanted, Means *means,
                         MASK *overgrown, Work *work) {
    Pixels pixels = {{INFINITY, -1, {0, 0, 1}},
                     {frame.background.x, frame.background.y, frame.background.z},
                     {0, 0, 0},
                     0};
#ifdef WITH_CEILING
    pixels.wanted = wanted;
    pixels.overgrown = 0;
#endif
    pixels = trace(frame, scene, middle_rays(frame, scene, cells), tile, pixels, work);
#ifdef WITH_CEILING
    *overgrown = *overgrown | pixels.overgrown;
#endif
    const SHADE color[3] = {pixels.color.x, pixels.color.y, pixels.color.z};
    const SHADE_MASK here = TO_SHADE_MASK(wanted);
    for (int k = 0; k < 3; k++) PUT_WHERE(here, means->color[k], color[k] < 1 ? color[k] : (SHADE)1);
    PUT_WHERE(wanted, means->coverage, pixels.hit.id >= 0 ? (FLOAT)1 : (FLOAT)0);
}

#ifndef WITH_TRIANGLES
/* The surfaces' part of what cells show. Returns the lanes in which it is known. */
static MASK mean_tint(const Frame frame, const Scene scene, const Cells cells, const Sight view, const MASK mixed, Tint *out, FLOAT *coverage,
                      Work *work) {
    Tint tints[2];
    Share share = {0, 0};
    for (int which = 0; which < 2; which++) {
        const INT id = which ? ((mixed) ? view.front : (INT)-1) : view.cover;
        Tint *tint = &tints[which];
        if (!ANY(id >= 0)) {
            for (int k = 0; k < 3; k++) tint->v[k] = tint->e[k] = tint->least[k] = tint->most[k] = 0;
        } else {
            const Quadric sphere = quadrics_of(scene.spheres, id);
            const Outline outline = outline_of(cells, sphere, scene.unit);
            *tint = tint_of(scene, patch_of_sphere(cells, sphere, outline, scene.unit), work);
            clamp_tint(tint);
            if (which) {
                /* What crosses the cover, or may, has any part of that. */
                const MASK clear = view.of_front.most < view.of_cover.least;
                share = share_of_disc(cells, sphere, outline);
                share.least = clear ? share.least : (FLOAT)0;
                share.most = view.of_front.covers ? (FLOAT)1 : share.most;
            }
        }
        if (which) break;
        const float background[3] = {frame.background.x, frame.background.y, frame.background.z};
        const MASK none = (view.cover < 0);
        for (int k = 0; k < 3; k++) {
            const FLOAT c = background[k] < 1 ? background[k] : 1;
            PUT_WHERE(none, tint->v[k], c);
            PUT_WHERE(none, tint->e[k], (FLOAT)0);
            PUT_WHERE(none, tint->least[k], c);
            PUT_WHERE(none, tint->most[k], c);
        }
    }
    *coverage = ((view.cover >= 0) | (mixed & view.of_front.covers)) ? (FLOAT)1 : (mixed ? 0.5f * (share.least + share.most) : (FLOAT)0);
    MASK known = ALL_LANES;
    for (int k = 0; k < 3; k++) {
        /* Of s f + (1 - s) b, with the share s of the front: it is linear in s. */
        const FLOAT p = share.least, q = share.most, f0 = tints[1].least[k], f1 = tints[1].most[k], b0 = tints[0].least[k],
                   b1 = tints[0].most[k];
        const FLOAT low = b0 + (f0 < b0 ? q : p) * (f0 - b0), high = b1 + (f1 > b1 ? q : p) * (f1 - b1);
        out->v[k] = mixed ? (FLOAT)0.5f * (low + high) : tints[0].v[k];
        out->e[k] = mixed ? (FLOAT)0.5f * (high - low) : tints[0].e[k];
        known = known & (out->e[k] < 1);
    }
#ifdef OUT_COVERAGE
    /* What is cut out by its coverage may be laid on any colour, so the coverage is to be as near as a colour. */
    const FLOAT off = (mixed & (view.cover < 0) & (!view.of_front.covers)) ? 0.5f * (share.most - share.least) : (FLOAT)0;
    out->e[0] = off > out->e[0] ? off : out->e[0];
    known = known & (off < 1);
#endif
    return known;
}
#endif

/* level, column, row, size: see cells_at(); tile: see sight_of(). */
static __attribute__((noinline)) void look_at_cells(const Frame frame, const Scene scene, const int2 size, const int level, const INT column,
                                                    const INT row, const int2 tile, Means *means, MASK *overgrown, Work *work) {
    const Cells cells = cells_at(frame, size, level, column, row);
    Tint tint;
#ifdef WITH_TRIANGLES
    MASK estimated;
    const MASK known = crowd_tint(frame, scene, cells, tile, &tint, &means->coverage, &estimated, work);
#else
    const Sight view = sight_of(scene, cells, tile);
    const MASK plain = behind_cover(view, view.of_front.least), mixed = !plain & behind_cover(view, view.others);
    const MASK estimated = beyond_proof(scene, view.cover) | (beyond_proof(scene, view.front) & (!plain));
    const MASK known = mean_tint(frame, scene, cells, view, mixed, &tint, &means->coverage, work) & (plain | mixed);
#endif
    const MASK open = (!known) & !estimated;
    FLOAT error = 0;
    for (int k = 0; k < 3; k++) {
        means->color[k] = TO_SHADE(tint.v[k]);
        error = tint.e[k] > error ? tint.e[k] : error;
    }
    /* Besides, colours are at most 1 and in float: each rounding is below 2^-16 of a level, and 2^-12 are 16 of them. */
    means->error = error * 255.0f * 1.0001f + 0x1p-12f;
    means->state = estimated ? (INT)ESTIMATED : open ? (INT)OPEN : (INT)SURE;
    if (level == 0 || !ANY(estimated | open)) return;
    sample_cells(frame, scene, cells, tile, estimated | open, means, overgrown, work);
    const float peak[3] = {scene.average.x, scene.average.y, scene.average.z};
    FLOAT most = 0;
    for (int k = 0; k < 3; k++) {
        const FLOAT below = TO_FLOAT(means->color[k]), above = peak[k] - below, far = below > above ? below : above;
        most = far > most ? far : most;
    }
#ifdef OUT_COVERAGE
#ifdef WITH_TRIANGLES
    most = 1 > most ? (FLOAT)1 : most;
#else
    most = ((view.cover < 0) & (1 > most)) ? (FLOAT)1 : most;
#endif
#endif
    means->error = estimated | open ? most * 255.0f + 0x1p-12f : means->error;
}

/* Of a pixel or a part of one: sums of colours times areas, in units of 2^-40, and of errors times areas. */
typedef struct {
    long color[3], coverage;
    float error;
    int estimated;
} Sum;

/* 16 cells of one level, 4 x 4. */
typedef struct {
    float color[3][16], coverage[16], error[16];
    int state[16];
} Group;

/* What a colour without a proof is off by is taken to be half of the largest difference from the cells beside it, and from the
 * points of the pixel's border that are in `border`, 4 for each side, if there are any. */
static void estimate_errors(Group *group, const float (*border)[16]) {
    for (int cell = 0; cell < 16; cell++) {
        if (group->state[cell] != ESTIMATED) continue;
        float most = 0;
        for (int side = 0; side < 4; side++) {
            const int across = side == 0 ? -1 : side == 1, down = side == 2 ? -1 : side == 3;
            const int column = (cell & 3) + across, row = (cell >> 2) + down;
            if (column < 0 || column > 3 || row < 0 || row > 3) {
                const int point = 4 * side + (side < 2 ? row : column);
                for (int k = 0; k < 3 && border; k++) most = fmax(most, fabs(group->color[k][cell] - border[k][point]));
                continue;
            }
            for (int k = 0; k < 3; k++) most = fmax(most, fabs(group->color[k][cell] - group->color[k][4 * row + column]));
#ifdef OUT_COVERAGE
            most = fmax(most, fabs(group->coverage[cell] - group->coverage[4 * row + column]));
#endif
        }
        group->error[cell] = most * 127.5f;
    }
}

static void add_cell(Sum *sum, const Group *group, const int cell, const float area) {
    for (int k = 0; k < 3; k++) sum->color[k] += (long)(group->color[k][cell] * area * 0x1p40f);
    sum->coverage += (long)(group->coverage[cell] * area * 0x1p40f);
    sum->error += group->error[cell] * area;
    sum->estimated |= group->state[cell] == ESTIMATED;
}

/* The colours at points of a pixel's border: of the left, the right, the upper and the lower side, beside the cells there. */
static void look_at_border(const Frame frame, const Scene scene, const int2 size, const int column, const int row, const int2 tile,
                           float (*border)[16], MASK *overgrown, Work *work) {
    for (int part = 0; part < 16 / W; part++) {
        int x[W], y[W];
        for (int lane = 0; lane < W; lane++) {
            const int side = (part * W + lane) >> 2, place = 2 * ((part * W + lane) & 3) + 1;
            x[lane] = 8 * column + (side < 2 ? 8 * side : place);
            y[lane] = 8 * row + (side < 2 ? place : 8 * (side - 2));
        }
        const Cells cells = cells_around(frame, size, 1, LOAD_LANES(x), LOAD_LANES(y));
        Means means;
        sample_cells(frame, scene, cells, tile, ALL_LANES, &means, overgrown, work);
        for (int k = 0; k < 3; k++) STORE_LANES(TO_FLOAT(means.color[k]), &border[k][part * W]);
    }
}

/* Where the first of the cells is that one is split into: column, row: of its own level. */
static void look_at_group(const Frame frame, const Scene scene, const int2 size, const int level, const int column, const int row,
                          const int2 tile, Group *group, MASK *overgrown, Work *work) {
    for (int part = 0; part < 16 / W; part++) {
#if W == 1
        const INT across = part & 3, down = part >> 2;
#else
        const INT across = LANE_COLUMN, down = LANE_ROW + part * PACKET_HEIGHT;
#endif
        Means means;
        look_at_cells(frame, scene, size, level, 4 * column + across, 4 * row + down, tile, &means, overgrown, work);
        for (int k = 0; k < 3; k++) STORE_LANES(TO_FLOAT(means.color[k]), &group->color[k][part * W]);
        STORE_LANES(means.coverage, &group->coverage[part * W]);
        STORE_LANES(means.error, &group->error[part * W]);
        STORE_LANES(means.state, &group->state[part * W]);
    }
    int estimated = 0;
    for (int cell = 0; cell < 16; cell++) estimated |= group->state[cell] == ESTIMATED;
    if (!estimated) return;
    float border[3][16];
    if (level == 1) look_at_border(frame, scene, size, column, row, tile, border, overgrown, work);
    estimate_errors(group, level == 1 ? border : 0);
}

/* The mean of one pixel, by its parts. column, row: of the pixel. */
static Sum split_pixel(const Frame frame, const Scene scene, const int2 size, const int column, const int row, const int2 tile,
                       MASK *overgrown, Work *work) {
    const float levels = scene.average.w;
    Sum sure = {{0, 0, 0}, 0, 0, 0}, open = sure;
    ushort split[2][MOST_SPLIT];
    int count = 1;
    split[0][0] = 0;
    for (int level = 1; level <= FINEST; level++) {
        const int parts = 1 << 2 * (level - 1);
        const float area = 1.0f / (16 * parts * parts);
        const Sum none = {{0, 0, 0}, 0, 0, 0};
        int next = 0;
        open = none;
        for (int i = 0; i < count; i++) {
            const int place = split[(level + 1) & 1][i], x = place & 63, y = place >> 6;
            Group group;
            look_at_group(frame, scene, size, level, column * parts + x, row * parts + y, tile, &group, overgrown, work);
            for (int cell = 0; cell < 16; cell++) {
                const int final = group.state[cell] == ESTIMATED && level >= FINEST_ESTIMATE;
                if (final || group.error[cell] <= levels * (1 << 2 * (level - 1)) * 0.5f) {
                    add_cell(&sure, &group, cell, area);
                } else {
                    if (next < MOST_SPLIT) split[level & 1][next] = (4 * x + (cell & 3)) | (4 * y + (cell >> 2)) << 6;
                    next++;
                    add_cell(&open, &group, cell, area);
                }
            }
        }
        if (sure.error + open.error <= levels || next == 0 || next > MOST_SPLIT) break;
        count = next;
    }
    for (int k = 0; k < 3; k++) sure.color[k] += open.color[k];
    sure.coverage += open.coverage;
    sure.error += open.error;
    sure.estimated |= open.estimated;
    return sure;
}

/* Puts the means into a packet of pixels. within: which of them are wanted. */
static void average_pixels(const Frame frame, const Scene scene, const int2 size, const INT column, const INT row, const int2 tile,
                           const MASK within, Pixels *pixels, Work *work) {
    const float levels = scene.average.w;
    Means means;
    MASK overgrown = 0;
    look_at_cells(frame, scene, size, 0, column, row, tile, &means, &overgrown, work);
    float color[3][W], coverage[W], error[W];
    int again[W], columns[W], rows[W], estimated[W], late[W];
    for (int k = 0; k < 3; k++) STORE_LANES(TO_FLOAT(means.color[k]), color[k]);
    STORE_LANES(means.coverage, coverage);
    STORE_LANES(means.error, error);
    STORE_LANES(within & ((means.state != SURE) | (means.error > levels)), again);
    STORE_LANES(column, columns);
    STORE_LANES(row, rows);
    for (int lane = 0; lane < W; lane++) {
        estimated[lane] = late[lane] = 0;
        if (!again[lane]) continue;
        MASK many = 0;
        const Sum sum = split_pixel(frame, scene, size, columns[lane], rows[lane], tile, &many, work);
        for (int k = 0; k < 3; k++) color[k][lane] = (float)sum.color[k] * 0x1p-40f;
        coverage[lane] = (float)sum.coverage * 0x1p-40f;
        error[lane] = sum.error;
        estimated[lane] = sum.estimated;
        late[lane] = ANY(many) != 0;
    }
    pixels->color.x = TO_SHADE(LOAD_LANES(color[0]));
    pixels->color.y = TO_SHADE(LOAD_LANES(color[1]));
    pixels->color.z = TO_SHADE(LOAD_LANES(color[2]));
    pixels->coverage = LOAD_LANES(coverage);
    pixels->error = LOAD_LANES(error);
    COUNT(ESTIMATES, LOAD_LANES(estimated) != 0);
    COUNT(TOO_FAR, (LOAD_LANES(estimated) == 0) & (pixels->error > levels));
#ifdef WITH_CEILING
    pixels->overgrown = LOAD_LANES(late) != 0;
#endif
}
#endif

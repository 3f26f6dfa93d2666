/* average.cl: the mean colour of a pixel's square, each colour up to 1, with a bound of what it is off by.
 *
 * A pixel is one cell, then 4, and so on up to 4,096: those cells that are known least are split, breadth first, until
 * the bounds of all add up to no more than `levels`, or too many would be split at once. The cells of all pixels of a
 * packet that are split are packets in turn. Sums are whole numbers, so that no order of cells changes a bit.
 */
#ifdef WITH_AVERAGE
/* The finest level, where textures may ask for it all over the picture a coarser one; how many cells of a level may be
 * split, those that are known least. */
#ifdef WITH_TEXTURES
#define FINEST 4
#else
#define FINEST 6
#endif
#define MOST_SPLIT 256
/* What part of the error that is left to a pixel its cells of one level may leave when others are split. */
#define KEPT 0.5f
/* Errors above that many levels are rough. */
#define ROUGH 2

#ifdef WITH_RUNS
/* Where in the picture the pixels of cells are, in units of TILE x TILE pixels. */
typedef struct {
    INT x, y;
} Tiles;
#else
typedef int2 Tiles;
#endif

/* The rays through the middles of those cells that are `wanted`: their colours, 1 at most. */
static __attribute__((noinline)) void sample_cells(const Frame frame, const Scene scene, const Cells cells,
                                                   const int2 tile, const MASK wanted, Means *means, MASK *overgrown,
                                                   Work *work) {
    Pixels pixels = {
        {INFINITY, -1, {0, 0, 1}}, {frame.background.x, frame.background.y, frame.background.z}, {0, 0, 0}, 0};
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
/* A surface before the cover. D: its discriminant; straight: where its outline is nearly a line, of which it is on one
 * side. */
typedef struct {
    Quadric shape;
    Outline outline;
    MASK straight;
} Front;

static Front front_of(const Scene scene, const Cells cells, const INT id) {
    Front front;
    front.shape = quadrics_of(scene.spheres, id);
    front.outline = outline_of(cells, front.shape, scene.unit);
    const Model D = front.outline.D;
    front.straight = (id >= 0) & (front.outline.c > 0) & (least_of(front.outline.b) > 0) &
                     (D.r < fabs(D.x) + fabs(D.y));
    return front;
}

/* What cells show of it. id: which it is, -1 in lanes that do not ask. */
static Area patch_in(const Frame frame, const Cells cells, const Front front, const INT id, const real unit) {
    Area patch = patch_of_sphere(cells, front.shape, front.outline, unit);
    patch.id = id;
#ifdef WITH_TEXTURES
    map_patch(frame, &patch);
#endif
    return patch;
}

/* A line, without the third variable. */
static Model flattened(const Model m) {
    const Model flat = {m.v, m.x, m.y, m.r + fabs(m.z), 0};
    return flat;
}

/* Which of two surfaces is nearer: a, where the model is negative. With t = (b - sqrt(D)) / d.d, it is the sign of the
 * difference of b - sqrt(D). */
static Model depth_difference(const Front a, const Front b) {
    const Model first = minus_model(a.outline.b, root_of(a.outline.D)),
                last = minus_model(b.outline.b, root_of(b.outline.D));
    Model order = flattened(minus_model(first, last));
#ifdef WITH_QUADRICS
    order.r = INFINITY; /* These have other b. */
#endif
    const MASK outside = (a.outline.c > 0) & (least_of(a.outline.b) > 0) & (b.outline.c > 0) &
                         (least_of(b.outline.b) > 0);
    order.r = outside ? order.r : (FLOAT)INFINITY;
    return order;
}

static void clear_tint(Tint *tint) {
    for (int k = 0; k < 3; k++) tint->v[k] = tint->e[k] = tint->least[k] = tint->most[k] = 0;
}

/* Up to what something more of the front, or of what is behind it, changes a colour. */
static FLOAT contrast_of(const Tint *front, const Tint *behind, const int k) {
    const FLOAT lighter = front->most[k] - behind->least[k], darker = behind->most[k] - front->least[k];
    return (lighter > 0 ? lighter : (FLOAT)0) + (darker > 0 ? darker : (FLOAT)0);
}

/* The surfaces' part of what cells show. Returns the lanes in which it is known. */
static MASK mean_tint(const Frame frame, const Scene scene, const Cells cells, const Sight view, Kind kind, Tint *out,
                      FLOAT *coverage, Work *work) {
    Tint tints[3];
    Window windows[3];
    Share share = {0, 0};
    MASK mixed = kind.mixed, fronts = kind.mixed | kind.pair;
    for (int which = 0; which < 3; which++) {
        open_window(&windows[which]);
        clear_tint(&tints[which]);
    }
    /* Which cells are cut in two by the front's outline: the rest of the cover, or of the background, is behind it. And
     * which are cut again by that of the second. */
    MASK halved = 0, cut_twice = 0;
    Front front[2];
    if (ANY(fronts)) {
        front[0] = front_of(scene, cells, fronts ? view.front : (INT)-1);
        Model line = front[0].outline.D;
        /* What crosses the cover, or may, has any part of it. */
        MASK clear = view.of_front.most < (kind.pair ? view.of_second.least : view.of_cover.least), crossing = 0;
        if (ANY(fronts & !clear)) {
            const Front next = front_of(scene, cells, kind.pair ? view.second : (mixed ? view.cover : (INT)-1));
            const Model order = depth_difference(front[0], next);
            const MASK open = fronts & !clear & is_known(order), hidden = open & mixed & (least_of(order) > 0);
            clear = clear | (open & (most_of(order) < 0));
            kind.plain = kind.plain | hidden;
            mixed = mixed & !hidden;
            fronts = fronts & !hidden;
            crossing = mixed & !clear & view.of_front.covers & is_known(order) &
                       (order.r < fabs(order.x) + fabs(order.y));
            line = choose_model(crossing, scaled(order, -1), line);
        }
        line = choose_model(clear & view.of_front.covers, constant_model(1), line);
        const Model rest = scaled(line, -1);
        share = share_of_disc(cells, front[0].shape, front[0].outline);
        share.least = clear ? share.least : (FLOAT)0;
        share.most = view.of_front.covers ? (FLOAT)1 : share.most;
        halved = (fronts & clear & (view.of_front.covers | front[0].straight)) | crossing;
        if (ANY(halved & kind.pair)) {
            front[1] = front_of(scene, cells, kind.pair ? view.second : (INT)-1);
            cut_twice = halved & kind.pair & !view.of_second.covers & front[1].straight;
            MASK beyond = view.of_second.most < view.of_cover.least;
            if (ANY(cut_twice & !beyond)) {
                const Model order = depth_difference(front[1],
                                                     front_of(scene, cells, cut_twice ? view.cover : (INT)-1));
                beyond = beyond | (is_known(order) & (most_of(order) < 0));
            }
            /* Then the first is before the cover where it is before the second, but it may be beside that. */
            cut_twice = cut_twice & beyond & (view.of_front.most < view.of_cover.least);
        }
        halved = halved & (mixed | cut_twice);
        if (ANY(halved)) {
            cut_window(&windows[0], &rest, halved);
            cut_window(&windows[1], &line, halved);
        }
        if (ANY(cut_twice)) {
            const Model E = front[1].outline.D, beside = scaled(E, -1);
            cut_window(&windows[2], &rest, cut_twice);
            cut_window(&windows[2], &E, cut_twice);
            cut_window(&windows[0], &beside, cut_twice);
        }
        const INT one = (mixed | cut_twice) ? view.front : (INT)-1, two = cut_twice ? view.second : (INT)-1;
        if (ANY(one >= 0)) {
            tints[1] = tint_of(scene, patch_in(frame, cells, front[0], one, scene.unit), &windows[1], work);
            clamp_tint(&tints[1], windows[1].share);
        }
        if (ANY(two >= 0)) {
            tints[2] = tint_of(scene, patch_in(frame, cells, front[1], two, scene.unit), &windows[2], work);
            clamp_tint(&tints[2], windows[2].share);
        }
    }
    const MASK known_kind = kind.plain | mixed | cut_twice;
    const INT cover = known_kind ? view.cover : (INT)-1;
    if (ANY(cover >= 0)) {
        const Front behind = front_of(scene, cells, cover);
        tints[0] = tint_of(scene, patch_in(frame, cells, behind, cover, scene.unit), &windows[0], work);
        clamp_tint(&tints[0], windows[0].share);
    }
    const float background[3] = {frame.background.x, frame.background.y, frame.background.z};
    const MASK none = (view.cover < 0);
    for (int k = 0; k < 3; k++) {
        const FLOAT c = background[k] < 1 ? background[k] : 1;
        PUT_WHERE(none, tints[0].v[k], c * windows[0].share);
        PUT_WHERE(none, tints[0].e[k], (FLOAT)0);
        PUT_WHERE(none, tints[0].least[k], c);
        PUT_WHERE(none, tints[0].most[k], c);
    }
    MASK known = known_kind;
    for (int k = 0; k < 3; k++) {
        /* Of s f + (1 - s) b, with the share s of the front: it is linear in s. */
        const FLOAT p = share.least, q = share.most, f0 = tints[1].least[k], f1 = tints[1].most[k],
                    b0 = tints[0].least[k], b1 = tints[0].most[k];
        const FLOAT low = b0 + (f0 < b0 ? q : p) * (f0 - b0), high = b1 + (f1 > b1 ? q : p) * (f1 - b1);
        /* Where outlines are nearly straight: what is in their strips is of the front, or of what is behind. */
        const FLOAT first = contrast_of(&tints[1], &tints[0], k), over = contrast_of(&tints[1], &tints[2], k);
        const FLOAT second = contrast_of(&tints[2], &tints[0], k),
                    largest = (cut_twice & (over > first)) ? over : first;
        const FLOAT beyond = windows[2].off - windows[1].off, strip = beyond > 0 ? beyond : (FLOAT)0;
        const FLOAT sum = tints[0].v[k] + tints[1].v[k] + (cut_twice ? tints[2].v[k] : (FLOAT)0);
        const FLOAT off = tints[0].e[k] + tints[1].e[k] + windows[1].off * largest +
                          (cut_twice ? tints[2].e[k] + strip * second : (FLOAT)0);
        const FLOAT range = (FLOAT)0.5f * (high - low);
        const MASK straight = halved & (cut_twice | (off < range));
        out->v[k] = fronts ? (straight ? sum : (FLOAT)0.5f * (low + high)) : tints[0].v[k];
        out->e[k] = fronts ? (straight ? off : range) : tints[0].e[k];
        known = known & (out->e[k] < 1);
    }
    const FLOAT middle = cut_twice ? 1 - windows[0].share : 0.5f * (share.least + share.most);
    *coverage = ((view.cover >= 0) | (mixed & view.of_front.covers)) ? (FLOAT)1 : (fronts ? middle : (FLOAT)0);
#ifdef OUT_COVERAGE
    /* What is cut out by its coverage may be laid on any colour, so the coverage is to be as near as a colour. */
    const FLOAT loose = cut_twice ? windows[0].off : 0.5f * (share.most - share.least);
    const FLOAT off = (fronts & (view.cover < 0) & (!view.of_front.covers)) ? loose : (FLOAT)0;
    out->e[0] = off > out->e[0] ? off : out->e[0];
    known = known & (off < 1);
#endif
    return known;
}
#endif

#ifdef WITH_RUNS
/* The same of cells of several tiles. */
static void sample_tiles(const Frame frame, const Scene scene, const Cells cells, const Tiles tiles, const MASK wanted,
                         Means *means, MASK *overgrown, Work *work) {
    int x[W], y[W], some[W];
    STORE_LANES(tiles.x, x);
    STORE_LANES(tiles.y, y);
    STORE_LANES(wanted, some);
    MASK left = wanted;
    for (int lane = 0; lane < W; lane++) {
        if (!some[lane]) continue;
        const int2 tile = {x[lane], y[lane]};
        const MASK here = left & (tiles.x == tile.x) & (tiles.y == tile.y);
        if (!ANY(here)) continue;
        sample_cells(frame, scene, cells, tile, here, means, overgrown, work);
        left = left & !here;
    }
}
#else
#define sample_tiles sample_cells
#endif

/* What cells show, given which surfaces these are. */
static __attribute__((noinline)) void look_at_cells(const Frame frame, const Scene scene, const Cells cells,
                                                    const int level, const Tiles tile, const Sight *sight, Means *means,
                                                    MASK *overgrown, Work *work) {
    Tint tint;
#ifdef WITH_TRIANGLES
    MASK beyond;
    const MASK known = crowd_tint(frame, scene, cells, tile, &tint, &means->coverage, &beyond, work);
#else
    const Sight view = *sight;
    Kind kind = kind_of_sight(view);
    const MASK beyond = beyond_proof(scene, view.cover) |
                        ((beyond_proof(scene, view.front) | beyond_proof(scene, view.second)) & !kind.plain);
    kind.plain = kind.plain & !beyond;
    kind.mixed = kind.mixed & !beyond;
    kind.pair = kind.pair & !beyond;
    const MASK known = mean_tint(frame, scene, cells, view, kind, &tint, &means->coverage, work);
#endif
    const MASK open = (!known) & !beyond;
    FLOAT error = 0;
    for (int k = 0; k < 3; k++) {
        means->color[k] = TO_SHADE(tint.v[k]);
        error = tint.e[k] > error ? tint.e[k] : error;
    }
    /* Besides, colours are at most 1 and in float: each rounding is below 2^-16 of a level, and 2^-12 are 16 of them.
     * The background alone is exact, as it is where no list holds anything. */
    const MASK nothing = known & (error == 0) & (means->coverage == 0);
    means->error = nothing ? (FLOAT)0 : error * 255.0f * 1.0001f + 0x1p-12f;
    means->state = beyond ? (INT)BEYOND : open ? (INT)OPEN : (INT)SURE;
    /* What is known but roughly is sampled, too, where it is not split any more: of what is within the bounds the
     * sample is mostly nearer to the mean than the middle. */
    const MASK rough = (known & !beyond) & (means->error > ROUGH) & (level == FINEST ? ALL_LANES : (MASK)0);
    if (level == 0 || !ANY(open | rough)) return;
    const FLOAT coverage = means->coverage;
    sample_tiles(frame, scene, cells, tile, open | rough, means, overgrown, work);
    means->coverage = rough ? coverage : means->coverage;
    FLOAT beside = 0;
    for (int k = 0; k < 3; k++) {
        const FLOAT low = tint.v[k] - tint.e[k], high = tint.v[k] + tint.e[k], at = TO_FLOAT(means->color[k]);
        const FLOAT kept = at < low ? low : (at > high ? high : at), off = tint.e[k] + fabs(kept - tint.v[k]);
        PUT_WHERE(TO_SHADE_MASK(rough), means->color[k], TO_SHADE(kept));
        beside = off > beside ? off : beside;
    }
    means->error = rough ? beside * 255.0f * 1.0001f + 0x1p-12f : means->error;
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
    means->error = open ? most * 255.0f + 0x1p-12f : means->error;
}

/* A cell that may be split. place: its column in the pixel, plus 64 times its row, plus 4,096 times the pixel's lane.
 */
typedef struct {
    float color[3], coverage, error;
    ushort place;
} Part;

static void add_cell(Sum *sum, const Part *cell, const float area) {
    for (int k = 0; k < 3; k++) sum->color[k] += (long)(cell->color[k] * area * 0x1p40f);
    sum->coverage += (long)(cell->coverage * area * 0x1p40f);
    sum->error += cell->error * area;
}

/* The error up to which cells are not split: what these leave is at most `budget`, and no more than MOST_SPLIT are
 * above it, unless those are all about equally large. */
static float largest_kept(const Part *cells, const int count, const float area, const float budget) {
    float kept = 0;
    for (int i = 0; i < count; i++) kept = fmax(kept, cells[i].error);
    for (int first = 1;; first = 0) {
        const float lower = kept * 0.75f;
        float sum = 0;
        int above = 0;
        for (int i = 0; i < count; i++) {
            if (cells[i].error > lower) above++;
            if (cells[i].error <= kept) sum += cells[i].error * area;
        }
        if (above > MOST_SPLIT) return first ? lower : kept;
        if (sum <= budget || !(lower > 0)) return kept;
        kept = lower;
    }
}

/* Those of a packet's pixels' parts that are lanes of one packet, by their order. columns, rows: of the pixels. */
static Cells cells_of_parts(const Frame frame, const int2 size, const int level, const int *columns, const int *rows,
                            const Part *parts, const int *order) {
    int x[W], y[W];
    for (int lane = 0; lane < W; lane++) {
        const int place = parts[order[lane]].place, pixel = place >> 12;
        x[lane] = (columns[pixel] << level) + (place & 63);
        y[lane] = (rows[pixel] << level) + (place >> 6 & 63);
    }
    return cells_at(frame, size, level, LOAD_LANES(x), LOAD_LANES(y));
}

static Tiles tiles_of_parts(const int *columns, const int *rows, const Part *parts, const int *order) {
#ifdef WITH_RUNS
    int x[W], y[W];
    for (int lane = 0; lane < W; lane++) {
        const int pixel = parts[order[lane]].place >> 12;
        x[lane] = columns[pixel] / TILE;
        y[lane] = rows[pixel] / TILE;
    }
    const Tiles tiles = {LOAD_LANES(x), LOAD_LANES(y)};
#else
    const int pixel = parts[order[0]].place >> 12;
    const Tiles tiles = {columns[pixel] / TILE, rows[pixel] / TILE};
#endif
    return tiles;
}

/* So many cells are seen before they are looked at. */
#define MOST_SEEN (8 * W)

/* Puts cells of which as many surfaces are to be looked at beside each other: the order is that of their ranks, and
 * beyond the last the last is repeated. */
static void sort_by_rank(const int *rank, const int count, int *order) {
    int next = 0;
    for (int one = 0; one < RANKS; one++)
        for (int i = 0; i < count; i++)
            if (rank[i] == one) order[next++] = i;
    for (int lane = 0; lane < W; lane++) order[count + lane] = order[count - 1];
}

/* Looks at parts of pixels, MOST_SEEN at most. level: of the cells; see cells_of_parts(). */
static void look_at_parts(const Frame frame, const Scene scene, const int2 size, const int level, const int *columns,
                          const int *rows, Part *parts, const int count, int *beyond, int *late, Work *work) {
    int order[MOST_SEEN + W], rank[MOST_SEEN + W];
    Sights sights;
    for (int first = 0, end = 0; first < count; first = end) {
        const int pixel = parts[first].place >> 12;
        const int2 tile = {columns[pixel] / TILE, rows[pixel] / TILE};
        for (; end < count && end < first + W; end++) {
            const int other = parts[end].place >> 12;
            if (columns[other] / TILE != tile.x || rows[other] / TILE != tile.y) break;
        }
        for (int lane = 0; lane < W; lane++) order[lane] = min(first + lane, end - 1);
        const Sight view = sight_of(scene, cells_of_parts(frame, size, level, columns, rows, parts, order), tile);
        store_sight(&sights, first, view);
        STORE_LANES(rank_of(view), rank + first);
    }
    sort_by_rank(rank, count, order);
    for (int first = 0; first < count; first += W) {
        Means means;
        MASK overgrown = 0;
        const Sight view = load_sight(&sights, order + first);
        const Cells cells = cells_of_parts(frame, size, level, columns, rows, parts, order + first);
        const Tiles tiles = tiles_of_parts(columns, rows, parts, order + first);
        look_at_cells(frame, scene, cells, level, tiles, &view, &means, &overgrown, work);
        float color[3][W], coverage[W], error[W];
        int grown[W], state[W];
        for (int k = 0; k < 3; k++) STORE_LANES(TO_FLOAT(means.color[k]), color[k]);
        STORE_LANES(means.coverage, coverage);
        STORE_LANES(means.error, error);
        STORE_LANES(overgrown, grown);
        STORE_LANES(means.state, state);
        for (int lane = 0; lane < W; lane++) {
            Part *part = &parts[order[first + lane]];
            for (int k = 0; k < 3; k++) part->color[k] = color[k][lane];
            part->coverage = coverage[lane];
            part->error = error[lane];
            if (state[lane] == BEYOND) beyond[part->place >> 12] = 1;
            late[part->place >> 12] |= grown[lane] != 0;
        }
    }
}

/* Puts in the places of the four parts of each cell. */
static void place_parts(const ushort *split, const int count, Part *parts) {
    for (int i = 0; i < 4 * count; i++) {
        const int from = split[i >> 2], across = 2 * (from & 63) + (i & 1), down = 2 * (from >> 6 & 63) + (i >> 1 & 1);
        parts[i].place = (ushort)((from & ~4095) | down << 6 | across);
    }
}

/* Adds those cells of one pixel that stay whole to its sum, and puts the places of the others into `split`. Returns how
 * many these are. */
static int keep_or_split(const Part *cells, const int count, const int level, const float levels, Sum *sum,
                         ushort *split) {
    const float area = 1.0f / (1 << 2 * level);
    float total = sum->error;
    for (int i = 0; i < count; i++) total += cells[i].error * area;
    const int last = level == FINEST || total <= levels;
    const float kept = last ? INFINITY : largest_kept(cells, count, area, KEPT * (levels - sum->error));
    int next = 0;
    for (int i = 0; i < count; i++) {
        if (cells[i].error <= kept || last || next == MOST_SPLIT) {
            add_cell(sum, &cells[i], area);
        } else {
            split[next++] = cells[i].place;
        }
    }
    return next;
}

/* The means of those of W pixels that are wanted `again`, by their parts; but for those of which a part is `beyond`
 * proof. */
static void split_pixels(const Frame frame, const Scene scene, const int2 size, const int *columns, const int *rows,
                         const int *again, Sum *sums, int *beyond, int *late, Work *work) {
    ushort split[W * MOST_SPLIT];
    Part cells[4 * W * MOST_SPLIT];
    int count = 0;
    for (int lane = 0; lane < W; lane++)
        if (again[lane]) split[count++] = (ushort)(lane << 12);
    for (int level = 1; count > 0; level++) {
        place_parts(split, count, cells);
        for (int first = 0; first < 4 * count; first += MOST_SEEN) {
            if (is_over(scene)) return;
            look_at_parts(frame, scene, size, level, columns, rows, cells + first, min(4 * count - first, MOST_SEEN),
                          beyond, late, work);
        }
        int next = 0;
        for (int first = 0, end = 0; first < 4 * count; first = end) {
            const int pixel = cells[first].place >> 12;
            while (end < 4 * count && cells[end].place >> 12 == pixel) end++;
            if (!beyond[pixel])
                next += keep_or_split(cells + first, end - first, level, scene.average.w, &sums[pixel], split + next);
        }
        count = next;
    }
}

#ifdef WITH_RUNS
/* What the pixels of a work-item's packets show, as whole cells. */
typedef struct {
    float color[3][RUN * W], coverage[RUN * W], error[RUN * W];
    int state[RUN * W];
} Wholes;

static Means load_means(const Wholes *wholes, const int first) {
    Means means;
    for (int k = 0; k < 3; k++) means.color[k] = TO_SHADE(LOAD_LANES(wholes->color[k] + first));
    means.coverage = LOAD_LANES(wholes->coverage + first);
    means.error = LOAD_LANES(wholes->error + first);
    means.state = LOAD_LANES(wholes->state + first);
    return means;
}

static void store_means(Wholes *wholes, const int first, const Means means) {
    for (int k = 0; k < 3; k++) STORE_LANES(TO_FLOAT(means.color[k]), wholes->color[k] + first);
    STORE_LANES(means.coverage, wholes->coverage + first);
    STORE_LANES(means.error, wholes->error + first);
    STORE_LANES(means.state, wholes->state + first);
}

/* The pixels of a run that are lanes of one packet, by their order. x, y: where the run begins. */
static Cells cells_of_run(const Frame frame, const int2 size, const int x, const int y, const int *order) {
    int column[W], row[W];
    for (int lane = 0; lane < W; lane++) {
        const int packet = order[lane] / W, place = order[lane] % W;
        column[lane] = x + packet * PACKET_WIDTH + (place & 3);
        row[lane] = y + (place >> 2);
    }
    return cells_at(frame, size, 0, LOAD_LANES(column), LOAD_LANES(row));
}

/* Splits those pixels of a run that are not known, or not well enough, W at once. which: the pixels that may be so. */
static void split_run(const Frame frame, const Scene scene, const int2 size, const int x, const int y, const int *which,
                      const int count, Wholes *wholes, Work *work) {
    const float levels = scene.average.w;
    int next = 0;
    while (next < count) {
        int columns[W], rows[W], again[W], beyond[W], late[W], place[W], some = 0;
        Sum sums[W];
        for (; next < count && some < W; next++) {
            const int i = which[next];
            if (wholes->state[i] == SURE && wholes->error[i] <= levels) continue;
            place[some] = i;
            columns[some] = x + i / W * PACKET_WIDTH + (i % W & 3);
            rows[some++] = y + (i % W >> 2);
        }
        if (some == 0) return;
        for (int k = 0; k < W; k++) {
            const Sum nothing = {{0, 0, 0}, 0, 0};
            sums[k] = nothing;
            again[k] = k < some;
            beyond[k] = late[k] = 0;
        }
        split_pixels(frame, scene, size, columns, rows, again, sums, beyond, late, work);
        for (int k = 0; k < some; k++) {
            for (int c = 0; c < 3; c++) wholes->color[c][place[k]] = (float)sums[k].color[c] * 0x1p-40f;
            wholes->coverage[place[k]] = (float)sums[k].coverage * 0x1p-40f;
            wholes->error[place[k]] = sums[k].error;
        }
    }
}

/* Looks at the pixels of up to RUN packets, side by side: quickly, and at the others, packed together, as usual. x, y:
 * where they begin; right, bottom: where the part of the picture ends that is wanted. */
static void look_at_run(const Frame frame, const Scene scene, const int2 size, const int x, const int y,
                        const int right, const int bottom, Wholes *wholes, Work *work) {
    int order[RUN * W + W], rank[RUN * W], rest[RUN * W], sorted[RUN * W + W], count = 0;
    Sights sights;
    for (int packet = 0; packet < RUN && x + packet * PACKET_WIDTH < right; packet++) {
        const int begin = x + packet * PACKET_WIDTH, first = packet * W;
        const int2 tile = {begin / TILE, y / TILE};
        if (!tile_has_any(scene.lists, tile)) continue;
        const INT column = begin + LANE_COLUMN, row = y + LANE_ROW;
        const Cells cells = cells_at(frame, size, 0, column, row);
        const Sight view = sight_of(scene, cells, tile);
        Means means;
        const MASK open = (column < right) & (row < bottom) & !look_quickly(frame, scene, &cells, &view, &means);
        store_means(wholes, first, means);
        if (!ANY(open)) continue;
        int wanted[W], ranks[W];
        store_sight(&sights, first, view);
        STORE_LANES(open, wanted);
        STORE_LANES(rank_of(view), ranks);
        for (int lane = 0; lane < W; lane++) {
            rest[count] = first + lane;
            rank[count] = ranks[lane];
            count += wanted[lane] != 0;
        }
    }
    if (count == 0) return;
    sort_by_rank(rank, count, sorted);
    for (int i = 0; i < count + W; i++) order[i] = rest[sorted[i]];
    for (int first = 0; first < count; first += W) {
        const Tiles none = {0, 0};
        const Sight view = load_sight(&sights, order + first);
        Means means;
        MASK overgrown = 0;
        look_at_cells(frame, scene, cells_of_run(frame, size, x, y, order + first), 0, none, &view, &means, &overgrown,
                      work);
        Wholes own;
        store_means(&own, 0, means);
        for (int lane = 0; lane < W; lane++) {
            const int place = order[first + lane];
            for (int k = 0; k < 3; k++) wholes->color[k][place] = own.color[k][lane];
            wholes->coverage[place] = own.coverage[lane];
            wholes->error[place] = own.error[lane];
            wholes->state[place] = own.state[lane];
        }
    }
    split_run(frame, scene, size, x, y, rest, count, wholes, work);
}
#define MEANS_OF(frame, scene, packet, known) (known)->means
#else
/* What pixels show, as whole cells: quickly, where that is enough. */
static Means look_at_pixels(const Frame frame, const Scene scene, const int2 size, const INT column, const INT row,
                            const int2 tile, const MASK within, Work *work) {
    Means means;
    MASK overgrown = 0;
    const Cells cells = cells_at(frame, size, 0, column, row);
    Sight view = sight_of(scene, cells, tile);
#ifdef WITH_QUICK
    Means quick;
    const MASK known = look_quickly(frame, scene, &cells, &view, &quick);
    if (!ANY(within & !known)) return quick;
    view = choose_sight(known, empty_sight(), view);
    look_at_cells(frame, scene, cells, 0, tile, &view, &means, &overgrown, work);
    for (int k = 0; k < 3; k++) PUT_WHERE(TO_SHADE_MASK(known), means.color[k], quick.color[k]);
    PUT_WHERE(known, means.coverage, quick.coverage);
    PUT_WHERE(known, means.error, quick.error);
    PUT_WHERE(known, means.state, quick.state);
#else
    look_at_cells(frame, scene, cells, 0, tile, &view, &means, &overgrown, work);
#endif
    return means;
}
#define MEANS_OF(frame, scene, packet, known) \
    look_at_pixels(frame, scene, packet.size, packet.column, packet.row, packet.tile, packet.within, &(known)->work)
#endif

/* Puts the means into a packet of pixels. within: which of them are wanted; means: of what they show as whole cells. */
static void average_pixels(const Frame frame, const Scene scene, const int2 size, const INT column, const INT row,
                           const int2 tile, const MASK within, const Means means, Pixels *pixels, Work *work) {
    const float levels = scene.average.w;
#ifdef WITH_RUNS
    pixels->color.x = means.color[0];
    pixels->color.y = means.color[1];
    pixels->color.z = means.color[2];
    pixels->coverage = means.coverage;
    pixels->error = means.error;
    COUNT(TOO_FAR, means.error > levels);
#else
    float color[3][W], coverage[W], error[W];
    int again[W], beyond[W], columns[W], rows[W], late[W];
    Sum sums[W];
    for (int k = 0; k < 3; k++) STORE_LANES(TO_FLOAT(means.color[k]), color[k]);
    STORE_LANES(means.coverage, coverage);
    STORE_LANES(means.error, error);
    const MASK sampled = within & (means.state == BEYOND);
    STORE_LANES(within & !sampled & ((means.state != SURE) | (means.error > levels)), again);
    STORE_LANES(sampled, beyond);
    STORE_LANES(column, columns);
    STORE_LANES(row, rows);
    for (int lane = 0; lane < W; lane++) {
        const Sum nothing = {{0, 0, 0}, 0, 0};
        sums[lane] = nothing;
        late[lane] = 0;
    }
    split_pixels(frame, scene, size, columns, rows, again, sums, beyond, late, work);
    const MASK estimated = LOAD_LANES(beyond) != 0;
#ifdef WITH_MARKS
    if (ANY(estimated)) sample_pixels(frame, scene, size, columns, rows, beyond, tile, sums, late, work);
#endif
    for (int lane = 0; lane < W; lane++) {
        const Sum sum = sums[lane];
        if (!again[lane] && !beyond[lane]) continue;
        for (int k = 0; k < 3; k++) color[k][lane] = (float)sum.color[k] * 0x1p-40f;
        coverage[lane] = (float)sum.coverage * 0x1p-40f;
        error[lane] = sum.error;
    }
    pixels->color.x = TO_SHADE(LOAD_LANES(color[0]));
    pixels->color.y = TO_SHADE(LOAD_LANES(color[1]));
    pixels->color.z = TO_SHADE(LOAD_LANES(color[2]));
    pixels->coverage = LOAD_LANES(coverage);
    pixels->error = LOAD_LANES(error);
    COUNT(ESTIMATES, estimated);
    COUNT(TOO_FAR, !estimated & (pixels->error > levels));
#ifdef WITH_CEILING
    pixels->overgrown = LOAD_LANES(late) != 0;
#endif
#endif
}
#endif

/* average.cl: the mean colour of a pixel's square, each colour up to 1, with a bound of what it is off by.
 *
 * The files of this folder, from the last to the first: this one adds up what cells show, fragments.cl says what that
 * is, by light.cl, shadows.cl and blocking.cl; plain.cl does the same for cells in which all is simple, sight.cl tells
 * which surfaces are in a cell, spheres.cl and quadrics.cl where these are, and models.cl and windows.cl count.
 *
 * A pixel is one cell, then 4, and so on up to 4,096: those cells that are known least are split, breadth first, until
 * the bounds of all add up to no more than `levels`, or too many would be split at once. The cells of W pixels that are
 * split are packets in turn. Sums are whole numbers, so that no order of cells changes a bit.
 *
 * The bound holds whatever is shown within it. Where it is large, that is what samples say, see proved_pixels().
 */
#ifdef WITH_AVERAGE
/* The finest level; how many cells of a level may be split, those that are known least. So a pixel has at most 1 + 4 +
 * 16 + 64 + 3 * 4 * MOST_SPLIT cells. */
#define FINEST 6
#define MOST_SPLIT 64
/* What part of the error that is left to a pixel its cells of one level may leave when others are split. */
#define KEPT 0.5f
/* Means of larger errors, in levels, are shown as samples have them. */
#define SMALL 1

/* A cell that may be split. place: its column in the pixel, plus 64 times its row, plus 4,096 times the pixel's number
 * in the batch. */
typedef struct {
    float color[3], coverage, error;
    ushort place;
} Part;

/* Of a pixel or a part of one: sums of colours times areas, in units of 2^-40, and of errors times areas. */
typedef struct {
    long color[3], coverage;
    float error;
} Sum;

/* Pixels that are split together, W at most. beyond: whether something is in one of which nothing is known; cells: how
 * many each one has had. */
typedef struct {
    int2 size; /* of the whole picture */
    int count, column[W], row[W], beyond[W], cells[W];
    Sum sum[W];
} Batch;

/* What the pixels of a work-item's packets side by side show. cells: as of a Batch. */
typedef struct {
    float color[3][RUN * W], coverage[RUN * W], error[RUN * W];
    int beyond[RUN * W], cells[RUN * W];
} Proofs;

static void add_cell(Sum *sum, const Part *cell, const float area) {
    for (int k = 0; k < 3; k++) sum->color[k] += (long)(cell->color[k] * area * 0x1p40f);
    sum->coverage += (long)(cell->coverage * area * 0x1p40f);
    sum->error += cell->error * area;
}

/* The error up to which cells are not split: what these leave is at most `budget`, and no more than MOST_SPLIT are
 * above it, unless those are all about equally large. No error is below 2^-12, but for 0. */
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
        if (sum <= budget || !(lower > 0x1p-13f)) return kept;
        kept = lower;
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

/* Puts in the places of the four parts of each cell. */
static void place_parts(const ushort *split, const int count, Part *parts) {
    for (int i = 0; i < 4 * count; i++) {
        const int from = split[i >> 2], across = 2 * (from & 63) + (i & 1), down = 2 * (from >> 6 & 63) + (i >> 1 & 1);
        parts[i].place = (ushort)((from & ~4095) | down << 6 | across);
    }
}

/* Those of a batch's parts that are lanes of one packet, by their order. */
static Cells cells_of_parts(const Frame frame, const Batch *batch, const int level, const Part *parts,
                            const int *order) {
    int x[W], y[W];
    for (int lane = 0; lane < W; lane++) {
        const int place = parts[order[lane]].place, pixel = place >> 12;
        x[lane] = (batch->column[pixel] << level) + (place & 63);
        y[lane] = (batch->row[pixel] << level) + (place >> 6 & 63);
    }
    return cells_at(frame, batch->size, level, LOAD_LANES(x), LOAD_LANES(y));
}

/* Where in the picture a part is, in units of TILE x TILE pixels. */
static int2 tile_of_part(const Batch *batch, const Part *part) {
    const int pixel = part->place >> 12;
    const int2 tile = {batch->column[pixel] / TILE, batch->row[pixel] / TILE};
    return tile;
}

/* Puts cells of which as many surfaces are to be looked at beside each other: the order is that of their ranks, and
 * beyond the last the last is repeated. */
static void sort_by_rank(const int *rank, const int count, int *order) {
    int next = 0;
    for (int one = 0; one < RANKS; one++)
        for (int i = 0; i < count; i++)
            if (rank[i] == one) order[next++] = i;
    for (int lane = 0; lane < W; lane++) order[count + lane] = order[count - 1];
}

/* Puts what cells show into those parts that are lanes of their packet. */
static void store_means(const Means means, const int *order, Part *parts, Batch *batch) {
    float color[3][W], coverage[W], error[W];
    int beyond[W];
    for (int k = 0; k < 3; k++) STORE_LANES(means.color[k], color[k]);
    STORE_LANES(means.coverage, coverage);
    STORE_LANES(means.error, error);
    STORE_LANES(means.beyond, beyond);
    for (int lane = 0; lane < W; lane++) {
        Part *part = &parts[order[lane]];
        for (int k = 0; k < 3; k++) part->color[k] = color[k][lane];
        part->coverage = coverage[lane];
        part->error = error[lane];
        batch->beyond[part->place >> 12] |= beyond[lane] != 0;
    }
}

/* Looks at parts of pixels, MOST_SEEN at most. level: of the cells. */
static void look_at_parts(const Frame frame, const Scene *scene, const int level, const int count, Part *parts,
                          Batch *batch) {
    int order[MOST_SEEN + W], rank[MOST_SEEN + W];
    Sights sights;
    for (int first = 0, end = 0; first < count; first = end) {
        const int2 tile = tile_of_part(batch, &parts[first]);
        for (; end < count && end < first + W; end++) {
            const int2 other = tile_of_part(batch, &parts[end]);
            if (other.x != tile.x || other.y != tile.y) break;
        }
        for (int lane = 0; lane < W; lane++) order[lane] = min(first + lane, end - 1);
        const Sight view = sight_of(scene, cells_of_parts(frame, batch, level, parts, order), tile);
        store_sight(&sights, first, view);
        STORE_LANES(rank_of(view), rank + first);
    }
    sort_by_rank(rank, count, order);
    for (int first = 0; first < count; first += W) {
        Means means;
        const Sight view = load_sight(&sights, order + first);
        look_at_cells(frame, scene, cells_of_parts(frame, batch, level, parts, order + first), &view, &means);
        store_means(means, order + first, parts, batch);
    }
}

/* Puts in the means of a batch, by parts of its pixels, but for those of which a part is `beyond` proof. */
static void split_batch(const Frame frame, const Scene *scene, Batch *batch) {
    ushort split[W * MOST_SPLIT];
    Part cells[4 * W * MOST_SPLIT];
    int count = batch->count;
    for (int pixel = 0; pixel < count; pixel++) split[pixel] = (ushort)(pixel << 12);
    for (int level = 1; count > 0; level++) {
        place_parts(split, count, cells);
        for (int first = 0; first < 4 * count && !is_over(scene); first += MOST_SEEN)
            look_at_parts(frame, scene, level, min(4 * count - first, MOST_SEEN), cells + first, batch);
        int next = 0;
        for (int first = 0, end = 0; first < 4 * count; first = end) {
            const int pixel = cells[first].place >> 12;
            while (end < 4 * count && cells[end].place >> 12 == pixel) end++;
            batch->cells[pixel] += end - first;
            if (!batch->beyond[pixel])
                next += keep_or_split(cells + first, end - first, level, scene->levels, &batch->sum[pixel],
                                      split + next);
        }
        count = next;
    }
}

/* A row of packets: up to RUN of them, from `first` on, before `right` and `bottom`. size: of the whole picture. All in
 * pixels. */
typedef struct {
    int2 size, first;
    int right, bottom;
} Row;

/* The pixels of a row that are lanes of one packet, by their order. */
static Cells cells_of_row(const Frame frame, const Row row, const int *order) {
    int x[W], y[W];
    for (int lane = 0; lane < W; lane++) {
        x[lane] = row.first.x + order[lane] / W * PACKET_WIDTH + order[lane] % W % PACKET_WIDTH;
        y[lane] = row.first.y + order[lane] % W / PACKET_WIDTH;
    }
    return cells_at(frame, row.size, 0, LOAD_LANES(x), LOAD_LANES(y));
}

/* Splits those pixels of a row that are not known well enough, W at once. which: the pixels that may be so. */
static void split_row(const Frame frame, const Scene *scene, const Row row, const int *which, const int count,
                      Proofs *proofs) {
    for (int next = 0; next < count;) {
        int place[W];
        Batch batch;
        batch.size = row.size;
        batch.count = 0;
        for (; next < count && batch.count < W; next++) {
            const int i = which[next];
            if (proofs->beyond[i] || proofs->error[i] <= scene->levels) continue;
            const Sum nothing = {{0, 0, 0}, 0, 0};
            const int k = batch.count++;
            place[k] = i;
            batch.column[k] = row.first.x + i / W * PACKET_WIDTH + i % W % PACKET_WIDTH;
            batch.row[k] = row.first.y + i % W / PACKET_WIDTH;
            batch.sum[k] = nothing;
            batch.beyond[k] = batch.cells[k] = 0;
        }
        if (batch.count == 0) return;
        split_batch(frame, scene, &batch);
        for (int k = 0; k < batch.count; k++) {
            const int i = place[k];
            for (int c = 0; c < 3; c++) proofs->color[c][i] = (float)batch.sum[k].color[c] * 0x1p-40f;
            proofs->coverage[i] = (float)batch.sum[k].coverage * 0x1p-40f;
            proofs->error[i] = batch.sum[k].error;
            proofs->beyond[i] = batch.beyond[k];
            proofs->cells[i] += batch.cells[k];
        }
    }
}

/* Puts what is known of a packet of pixels into those of their places. */
static void put_proofs(const Means means, const int *place, Proofs *proofs) {
    float color[3][W], coverage[W], error[W];
    int beyond[W];
    for (int k = 0; k < 3; k++) STORE_LANES(means.color[k], color[k]);
    STORE_LANES(means.coverage, coverage);
    STORE_LANES(means.error, error);
    STORE_LANES(means.beyond, beyond);
    for (int lane = 0; lane < W; lane++) {
        const int i = place[lane];
        for (int k = 0; k < 3; k++) proofs->color[k][i] = color[k][lane];
        proofs->coverage[i] = coverage[lane];
        proofs->error[i] = error[lane];
        proofs->beyond[i] = beyond[lane];
        proofs->cells[i] = 1;
    }
}

/* Looks at the pixels of a row: quickly, and at the others, packed together, as usual. */
static void prove_row(const Frame frame, const Scene *scene, const Row row, Proofs *proofs) {
    int order[RUN * W + W], rank[RUN * W], rest[RUN * W], sorted[RUN * W + W], count = 0;
    Sights sights;
    for (int packet = 0; packet < RUN && row.first.x + packet * PACKET_WIDTH < row.right; packet++) {
        const int begin = row.first.x + packet * PACKET_WIDTH, first = packet * W;
        const int2 tile = {begin / TILE, row.first.y / TILE};
        if (!tile_has_any(scene->lists, tile)) continue;
        const INT column = begin + LANE_COLUMN, line = row.first.y + LANE_ROW;
        const Cells cells = cells_at(frame, row.size, 0, column, line);
        const Sight view = sight_of(scene, cells, tile);
        int wanted[W], ranks[W], place[W];
        for (int lane = 0; lane < W; lane++) place[lane] = first + lane;
        Means means;
        const MASK within = (column < row.right) & (line < row.bottom),
                   quick = look_quickly(frame, scene, &cells, &view, &means);
        means.beyond = is_beyond(view);
        put_proofs(means, place, proofs);
        const MASK open = within & !means.beyond & !quick;
        if (!ANY(open)) continue;
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
        const Sight view = load_sight(&sights, order + first);
        Means means;
        look_at_cells(frame, scene, cells_of_row(frame, row, order + first), &view, &means);
        put_proofs(means, order + first, proofs);
    }
    split_row(frame, scene, row, rest, count, proofs);
}

/* What is known of a packet's pixels. first: the first one's number in its row. */
static Means proofs_of(const Proofs *proofs, const int first, Work *work) {
    Means means;
    for (int k = 0; k < 3; k++) means.color[k] = LOAD_LANES(proofs->color[k] + first);
    means.coverage = LOAD_LANES(proofs->coverage + first);
    means.error = LOAD_LANES(proofs->error + first);
    means.beyond = LOAD_LANES(proofs->beyond + first) != 0;
    COUNT_EACH(CELLS, LOAD_LANES(proofs->cells + first));
    return means;
}

/* Pixels of which samples are wanted, beside what is known of them. */
static MASK need_samples(const Means means) {
    return means.beyond | (means.error > SMALL);
}

/* What pixels show. pixels: what samples show of those that need them. Where the proof leaves an interval, the samples'
 * mean is mostly the best guess, so it is moved into that interval. The error is the distance to the interval's other
 * end. */
static Pixels proved_pixels(const Scene *scene, const Means means, Pixels pixels, Work *work) {
    const MASK sampled = need_samples(means), beyond = means.beyond, moved = sampled & !beyond;
    const FLOAT room = means.error * (1.0f / 255), shown[4] = {TO_FLOAT(pixels.color.x), TO_FLOAT(pixels.color.y),
                                                               TO_FLOAT(pixels.color.z), pixels.coverage};
    FLOAT mean[4], off = 0;
    for (int k = 0; k < 4; k++) {
        const FLOAT at = k < 3 ? means.color[min(k, 2)] : means.coverage, low = at - room, high = at + room;
        const FLOAT kept = shown[k] < low ? low : (shown[k] > high ? high : shown[k]), away = fabs(kept - at);
        mean[k] = beyond ? shown[k] : (sampled ? kept : at);
        if (k < 3 || HAS(OUT_COVERAGE)) off = away > off ? away : off;
    }
    pixels.color.x = TO_SHADE(mean[0]);
    pixels.color.y = TO_SHADE(mean[1]);
    pixels.color.z = TO_SHADE(mean[2]);
    pixels.coverage = mean[3];
    pixels.error = beyond ? pixels.error : means.error + (moved ? levels_of(off) : (FLOAT)0);
    COUNT(ESTIMATES, beyond);
    COUNT(TOO_FAR, !beyond & (means.error > scene->levels));
    return pixels;
}
#endif

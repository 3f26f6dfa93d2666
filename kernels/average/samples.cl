/* samples.cl: the mean colours of pixels that show mirrors or glass, from samples; their errors are estimates.
 *
 * A pixel is a square with samples at its corners, its middle and the middles of its sides; neighbours share all but
 * the middle. Each sample has a mark, which says what its rays have met. Where all are nearly on a plane, they give the
 * mean. Where there are two marks, one beyond a line, the line is found by halving on two sides of the square, and each
 * part of the square has the colour at its centroid. All other squares are split into 4, those that are known least
 * first, down to SMALLEST. Which these are depends on the pixel's own samples alone, and sums are whole numbers:
 * neither crops nor the width of packets change a bit.
 */
#if defined(WITH_AVERAGE) && defined(WITH_MARKS)
/* Places of samples are counted in these parts of a pixel, 2^GRID_LEVEL halves of cells; the side of a smallest square
 * in them. */
#define GRID_LEVEL 8
#define GRID (2 << GRID_LEVEL)
#define SMALLEST (GRID / 16)
/* In smaller squares no line is looked for: their four parts are as cheap. */
#define SMALLEST_LINED (GRID / 4)
/* So many squares of one size may be split in a pixel: all but the smallest. To split only a part of these would be a
 * bias: squares are known to be uncertain where a sample met what is thin, but not where all samples missed it. */
#define MOST_OPEN 64
/* What squares are off by is independent of each other, so that the squares of their errors add up. The error of a
 * pixel is that many times the root of the sum. */
#define SAFETY 3
/* What part of the sum that a pixel may still have its squares of one size may take. */
#define ALLOWED 0.7f
/* See errors_of(). */
#define THIN (1.0f / 16)
/* By what part of the error that is wanted both ends of a line may move the mean, or its bend. */
#define PRECISE 0.6f
/* What branches that were dropped may add to a sample, in levels. */
#ifdef WITH_DROPPING
#define LEFT_OUT (255 * (MOST_DROPPED * 0x1p-40f))
#else
#define LEFT_OUT 0
#endif

/* Red, green, blue, at most 1 each, and coverage; what was met, and that and where on textures: colours jump where the
 * first is another, and bend where the second is; whether it took too many rays. */
typedef struct {
    float c[4];
    uint met, mark;
    int overgrown;
} Sample;

/* So many squares are looked at together: the ends of their lines, or what is new where they are split, are packets.
 * There is room for their samples, and for those of a packet's pixels, a grid of half pixels. */
#define BATCH 8
#define PACKET_SAMPLES ((2 * PACKET_HEIGHT + 1) * (2 * PACKET_WIDTH + 1))
#define MOST_SAMPLES (PACKET_SAMPLES > 8 * BATCH ? PACKET_SAMPLES : 8 * BATCH)

/* x, y: from the picture's upper left corner. */
typedef struct {
    int count, x[MOST_SAMPLES], y[MOST_SAMPLES];
    Sample at[MOST_SAMPLES];
} Samples;

static void add_sample(Samples *samples, const int x, const int y) {
    samples->x[samples->count] = x;
    samples->y[samples->count++] = y;
}

static __attribute__((noinline)) void trace_samples(const Frame frame, const Scene scene, const int2 size,
                                                    const int2 tile, Samples *samples, Work *work) {
    for (int first = 0; first < samples->count && !is_over(scene); first += W) {
        int x[W], y[W];
        for (int lane = 0; lane < W; lane++) {
            const int i = min(first + lane, samples->count - 1);
            x[lane] = samples->x[i];
            y[lane] = samples->y[i];
        }
        Pixels pixels = {
            {INFINITY, -1, {0, 0, 1}}, {frame.background.x, frame.background.y, frame.background.z}, {0, 0, 0}, 0};
#ifdef WITH_CEILING
        pixels.wanted = ALL_LANES;
        pixels.overgrown = 0;
#endif
        work->mark = work->texels = 0;
        const Cells cells = cells_around(frame, size, GRID_LEVEL, LOAD_LANES(x), LOAD_LANES(y));
        pixels = trace(frame, scene, middle_rays(frame, scene, cells), tile, pixels, work);
        float c[4][W];
        uint met[W], mark[W];
        int overgrown[W];
        STORE_LANES(TO_FLOAT(pixels.color.x), c[0]);
        STORE_LANES(TO_FLOAT(pixels.color.y), c[1]);
        STORE_LANES(TO_FLOAT(pixels.color.z), c[2]);
        STORE_LANES((pixels.hit.id >= 0) ? (FLOAT)1 : (FLOAT)0, c[3]);
        STORE_LANES(work->mark, met);
        STORE_LANES(work->mark + work->texels, mark);
#ifdef WITH_CEILING
        STORE_LANES(pixels.overgrown, overgrown);
#else
        STORE_LANES((INT)0, overgrown);
#endif
        for (int lane = 0; lane < min(W, samples->count - first); lane++) {
            Sample *sample = &samples->at[first + lane];
            for (int k = 0; k < 4; k++) sample->c[k] = fmin(c[k][lane], 1.0f);
            sample->met = met[lane];
            sample->mark = mark[lane];
            sample->overgrown = overgrown[lane] != 0;
        }
    }
}

/* x, y: of its upper left corner; corner: from there clockwise; pixel: the lane of the pixel it is in.
 * bent, broken: what the middles of a whole pixel's sides say; both are 0 in parts of pixels. bent: the most by which
 * one is off the mean of its side's ends, in levels; broken: whether one has a mark that neither end has, so that no
 * single line goes through the square. */
typedef struct {
    int x, y, side, pixel;
    Sample corner[4], middle;
    float bent;
    int broken;
} Square;

/* The middles of the sides of a packet's pixels; side k goes clockwise from corner k. */
typedef struct {
    Sample of[W][4];
} SideMiddles;

/* What is to the right of the upper left corner, and below it, is 1. */
#define RIGHT(corner) ((corner) == 1 || (corner) == 2)
#define BELOW(corner) ((corner) >= 2)

/* Sums over squares that come in any order: of colours and coverage times areas, and of the squares of errors in levels
 * times areas. In units of 2^-40. */
typedef struct {
    long c[4], error;
} Total;

static void add_part(Total *total, const float *c, const float area) {
    for (int k = 0; k < 4; k++) total->c[k] += (long)(c[k] * area * 0x1p40f);
}

static void add_error(Total *total, const float error) {
    total->error += (long)(error * error * 0x1p40f);
}

/* Of what is an output a square's error and contrasts are. */
#ifdef OUT_COVERAGE
#define CHANNELS 4
#else
#define CHANNELS 3
#endif

static void note_overgrown_square(const Square *square, int *late) {
    for (int k = 0; k < 4; k++) late[square->pixel] |= square->corner[k].overgrown;
    late[square->pixel] |= square->middle.overgrown;
}

/* How far a square's samples are from a plane: of a quadratic in x and y the mean of the corners is twice as far from
 * its mean as the middle is, on the other side; and the difference between the diagonals' means tells of the rest. Of a
 * whole pixel, also how far the middles of its sides are from lines. In levels. */
static float bend_of(const Square *square) {
    float most = square->bent / 255;
    for (int k = 0; k < CHANNELS; k++) {
        const float one = square->corner[0].c[k] + square->corner[2].c[k],
                    other = square->corner[1].c[k] + square->corner[3].c[k];
        most = fmax(most, fmax(fabs(0.25f * (one + other) - square->middle.c[k]), 0.25f * fabs(one - other)));
    }
    return 255 * most;
}

static int is_smooth(const Square *square) {
    int one = 1;
    for (int k = 0; k < 4; k++) one &= square->corner[k].met == square->middle.met;
    return one;
}

/* Adds a square to its pixel; what is smooth by a rule that is exact for quadratics, but for x^2 y^2. */
static void add_square(const Square *square, const float error, Total *total) {
    const float side = (float)square->side / GRID;
    const float weight = is_smooth(square) ? 8 : 4;
    float c[4];
    for (int k = 0; k < 4; k++) {
        const float corners = square->corner[0].c[k] + square->corner[1].c[k] + square->corner[2].c[k] +
                              square->corner[3].c[k];
        c[k] = (corners + weight * square->middle.c[k]) / (4 + weight);
    }
    add_part(total, c, side * side);
    add_error(total, error * side * side);
}

/* Two marks in a square. first: that of the upper left corner; cut: the two sides on which they meet, of which side k
 * goes clockwise from corner k; contrast: between their colours, in levels. */
typedef struct {
    uint first, second;
    int cut[2];
    float contrast;
} Border;

/* Whether there is such a border. */
static int has_border(const Square *square, Border *border) {
    border->first = border->second = square->corner[0].mark;
    if (square->broken) return 0;
    int cuts = 0;
    for (int k = 0; k < 4; k++) {
        const uint mark = square->corner[k].mark, next = square->corner[(k + 1) & 3].mark;
        if (mark != border->first) {
            if (border->second != border->first && mark != border->second) return 0;
            border->second = mark;
        }
        if (mark != next) {
            if (cuts == 2) return 0;
            border->cut[cuts++] = k;
        }
    }
    if (cuts != 2 || (square->middle.mark != border->first && square->middle.mark != border->second)) return 0;
    border->contrast = 0;
    for (int c = 0; c < CHANNELS; c++) {
        float sum = 0, other = 0;
        int count = 0;
        for (int k = 0; k < 5; k++) {
            const Sample *sample = k < 4 ? &square->corner[k] : &square->middle;
            const int here = sample->mark == border->first;
            count += here;
            sum += here ? sample->c[c] : 0;
            other += here ? 0 : sample->c[c];
        }
        border->contrast = fmax(border->contrast, 255 * fabs(sum / count - other / (5 - count)));
    }
    return 1;
}

/* In levels, what a square's mean is mostly off by: of what is smooth no more than the middle is by itself, see
 * bend_of(). Where an edge cuts off a part p < 1/2 of a square with the contrast c, the samples' mean is off by about c
 * / 8, and the bend is c / 4 or more. */
static float error_of(const Square *square) {
    return bend_of(square) * (is_smooth(square) ? 1.0f / 3 : 0.5f);
}

/* The same of the parts of squares. Where these differ, what is thin may go through one of them between its samples, as
 * it does through those beside it: a 16th of their bend is added. */
static void errors_of(const Square *squares, const int count, float *error) {
    for (int i = 0; i < count; i++) error[i] = error_of(&squares[i]);
    for (int first = 0; first + 3 < count; first += 4) {
        float bend = 0;
        for (int i = first; i < first + 4; i++) bend = fmax(bend, is_smooth(&squares[i]) ? 0 : bend_of(&squares[i]));
        for (int i = first; i < first + 4; i++) error[i] += THIN * bend;
    }
}

/* Adds those squares of a pixel to it that are known well enough, all of one size: the squares of their errors add up
 * to no more than a part of what is left. Puts the others into `open`, and returns how many these are. */
static int keep_squares(const Square *squares, const int count, const float levels, Total *total, Square *open) {
    float error[4 * MOST_OPEN], kept = 0, lower = INFINITY;
    const float side = (float)squares->side / GRID, area = side * side;
    const float most = levels / SAFETY, left = fmax(ALLOWED * (most * most - (float)total->error * 0x1p-40f), 0.0f);
    errors_of(squares, count, error);
    for (int i = 0; i < count; i++) kept = fmax(kept, error[i]);
    for (lower = kept; lower > 0; lower *= 0.75f) {
        float sum = 0;
        int above = 0;
        for (int i = 0; i < count; i++) {
            sum += error[i] <= lower ? error[i] * area * error[i] * area : 0;
            above += error[i] > lower;
        }
        if (above > MOST_OPEN) break;
        kept = lower;
        if (sum <= left) break;
    }
    int next = 0;
    for (int i = 0; i < count; i++) {
        if (error[i] <= kept || next == MOST_OPEN) {
            add_square(&squares[i], error[i], total);
        } else {
            open[next++] = squares[i];
        }
    }
    return next;
}

/* Compares the middles of a pixel's sides with their ends. */
static void look_beside(Square *square, const Sample *sides, int *late) {
    square->bent = 0;
    square->broken = 0;
    for (int k = 0; k < 4; k++) {
        const Sample *from = &square->corner[k], *to = &square->corner[(k + 1) & 3], *side = &sides[k];
        for (int c = 0; c < CHANNELS; c++)
            square->bent = fmax(square->bent, 255 * fabs(0.5f * (from->c[c] + to->c[c]) - side->c[c]));
        square->broken |= side->mark != from->mark && side->mark != to->mark;
        late[square->pixel] |= side->overgrown;
    }
}

/* Whether any pixel that is wanted has the sample in this row and column, counted in halves of pixels. */
static int is_needed(const int *wanted, const int row, const int column) {
    int needed = 0;
    for (int y = max((row - 1) >> 1, 0); y <= min(row >> 1, PACKET_HEIGHT - 1); y++)
        for (int x = max((column - 1) >> 1, 0); x <= min(column >> 1, PACKET_WIDTH - 1); x++)
            needed |= wanted[PACKET_WIDTH * y + x];
    return needed;
}

/* The squares of those pixels of a packet that are wanted, and the middles of their sides. Returns how many squares
 * these are. */
static int squares_of_pixels(const Frame frame, const Scene scene, const int2 size, const int *columns, const int *rows,
                             const int *wanted, const int2 tile, Square *squares, SideMiddles *sides, int *late,
                             Work *work) {
    Samples samples;
    int number[2 * PACKET_HEIGHT + 1][2 * PACKET_WIDTH + 1], count = 0;
    samples.count = 0;
    for (int row = 0; row <= 2 * PACKET_HEIGHT; row++) {
        for (int column = 0; column <= 2 * PACKET_WIDTH; column++) {
            number[row][column] = samples.count;
            if (is_needed(wanted, row, column))
                add_sample(&samples, GRID * columns[0] + GRID / 2 * column, GRID * rows[0] + GRID / 2 * row);
        }
    }
    trace_samples(frame, scene, size, tile, &samples, work);
    for (int lane = 0; lane < W; lane++) {
        if (!wanted[lane]) continue;
        const int row = 2 * (lane / PACKET_WIDTH) + 1, column = 2 * (lane % PACKET_WIDTH) + 1;
        Square square = {GRID * columns[lane], GRID * rows[lane], GRID, lane};
        Sample *side = sides->of[lane];
        for (int k = 0; k < 4; k++) {
            square.corner[k] = samples.at[number[row + 2 * BELOW(k) - 1][column + 2 * RIGHT(k) - 1]];
            side[k] = samples.at[number[row + (k & 1 ? 0 : k - 1)][column + (k & 1 ? 2 - k : 0)]];
        }
        square.middle = samples.at[number[row][column]];
        look_beside(&square, side, late);
        note_overgrown_square(&square, late);
        squares[count++] = square;
    }
    return count;
}

/* Where two marks meet on a side of a square: between a place that has the first and one that has the second. */
typedef struct {
    int x[2], y[2];
} Gap;

static int width_of(const Gap gap) {
    return abs(gap.x[1] - gap.x[0]) + abs(gap.y[1] - gap.y[0]);
}

/* A square's line. failed: there is none, but more marks, or a curve. */
typedef struct {
    Border border;
    Gap gap[2];
    int width; /* up to which the gaps are halved */
    int failed, overgrown;
} Line;

/* An end of a line that is off by half a gap, along a side s, moves no more than a quarter of the gap times s from one
 * part to the other, and mostly a half of that. Of squares of the nth part of a pixel about n have the edge, so that
 * their gaps may be the root of n times as wide. */
static Line line_of(const Square *square, const float levels) {
    Line line;
    has_border(square, &line.border);
    line.failed = line.overgrown = 0;
    const float width = 2 * PRECISE * levels * sqrt(GRID * GRID * GRID / (float)square->side) / line.border.contrast;
    line.width = (int)clamp(width, 2.0f, 0.25f * square->side);
    for (int end = 0; end < 2; end++) {
        for (int k = 0; k < 2; k++) {
            const int corner = (line.border.cut[end] + k) & 3,
                      second = square->corner[corner].mark != line.border.first;
            line.gap[end].x[second] = square->x + RIGHT(corner) * square->side;
            line.gap[end].y[second] = square->y + BELOW(corner) * square->side;
        }
    }
    return line;
}

/* Halves the gaps of lines until they are narrow enough. */
static void narrow_gaps(const Frame frame, const Scene scene, const int2 size, const int2 tile, Line *lines,
                        const int count, Work *work) {
    for (;;) {
        Samples samples;
        int which[2 * BATCH];
        samples.count = 0;
        for (int i = 0; i < 2 * count; i++) {
            const Line *line = &lines[i >> 1];
            const Gap gap = line->gap[i & 1];
            if (line->failed || width_of(gap) <= line->width) continue;
            which[samples.count] = i;
            add_sample(&samples, (gap.x[0] + gap.x[1]) / 2, (gap.y[0] + gap.y[1]) / 2);
        }
        if (samples.count == 0) return;
        trace_samples(frame, scene, size, tile, &samples, work);
        for (int k = 0; k < samples.count; k++) {
            Line *line = &lines[which[k] >> 1];
            const uint mark = samples.at[k].mark;
            line->overgrown |= samples.at[k].overgrown;
            line->failed |= mark != line->border.first && mark != line->border.second;
            Gap *gap = &line->gap[which[k] & 1];
            const int second = mark != line->border.first;
            gap->x[second] = samples.x[k];
            gap->y[second] = samples.y[k];
        }
    }
}

/* A part of a square: twice its area, and its centroid from the square's upper left corner. */
typedef struct {
    float twice, x, y;
} Region;

/* The two parts of a square, that with the first mark and that with the second. */
static void regions_of(const Square *square, const Line *line, Region *regions) {
    for (int second = 0; second < 2; second++) {
        float x[6], y[6];
        int count = 0;
        for (int k = 0; k < 4; k++) {
            if ((square->corner[k].mark != line->border.first) == second) {
                x[count] = RIGHT(k) * square->side;
                y[count++] = BELOW(k) * square->side;
            }
            for (int end = 0; end < 2; end++) {
                if (line->border.cut[end] != k) continue;
                const Gap gap = line->gap[end];
                x[count] = 0.5f * (gap.x[0] + gap.x[1] - 2 * square->x);
                y[count++] = 0.5f * (gap.y[0] + gap.y[1] - 2 * square->y);
            }
        }
        Region region = {0, 0, 0};
        for (int k = 2; k < count; k++) {
            const float twice = (x[k - 1] - x[0]) * (y[k] - y[0]) - (x[k] - x[0]) * (y[k - 1] - y[0]);
            region.twice += twice;
            region.x += twice * (x[0] + x[k - 1] + x[k]) / 3;
            region.y += twice * (y[0] + y[k - 1] + y[k]) / 3;
        }
        region.x /= region.twice;
        region.y /= region.twice;
        regions[second] = region;
    }
}

/* Adds samples that tell whether a line is one: at the centroids of both parts, and beside its middle on either side,
 * as far off as the middle of a curve may be. Returns how far that is: the curve takes two thirds of that times its
 * length from a part. */
static float add_witnesses(const Square *square, const Line *line, const Region *regions, const float levels,
                           Samples *samples) {
    for (int k = 0; k < 2; k++)
        add_sample(samples, square->x + (int)(regions[k].x + 0.5f), square->y + (int)(regions[k].y + 0.5f));
    float x[2], y[2];
    for (int end = 0; end < 2; end++) {
        x[end] = 0.5f * (line->gap[end].x[0] + line->gap[end].x[1] - 2 * square->x);
        y[end] = 0.5f * (line->gap[end].y[0] + line->gap[end].y[1] - 2 * square->y);
    }
    const float mx = 0.5f * (x[0] + x[1]), my = 0.5f * (y[0] + y[1]), nx = y[0] - y[1], ny = x[1] - x[0];
    const float most = 1.5f * PRECISE * levels * sqrt(GRID * GRID * GRID / (float)square->side) / line->border.contrast;
    const float off = clamp(most, 2.0f, 0.125f * square->side);
    const float towards = nx * (regions[0].x - mx) + ny * (regions[0].y - my) < 0 ? -1 : 1,
                step = towards * off / sqrt(nx * nx + ny * ny);
    add_sample(samples, square->x + (int)floor(mx + step * nx + 0.5f), square->y + (int)floor(my + step * ny + 0.5f));
    add_sample(samples, square->x + (int)floor(mx - step * nx + 0.5f), square->y + (int)floor(my - step * ny + 0.5f));
    return off;
}

/* Adds those of some squares to their pixels, BATCH at most, that have a line. These are no more: their side is 0.
 * which: their numbers. */
static void follow_lines(const Frame frame, const Scene scene, const int2 size, const int2 tile, Square *squares,
                         const int *which, const int count, Total *totals, int *late, Work *work) {
    Line lines[BATCH];
    Region regions[2 * BATCH];
    float off[BATCH];
    int first[BATCH];
    for (int i = 0; i < count; i++) lines[i] = line_of(&squares[which[i]], scene.average.w);
    narrow_gaps(frame, scene, size, tile, lines, count, work);
    Samples samples;
    samples.count = 0;
    for (int i = 0; i < count; i++) {
        if (lines[i].failed) continue;
        const Square *square = &squares[which[i]];
        regions_of(square, &lines[i], regions + 2 * i);
        first[i] = samples.count;
        off[i] = add_witnesses(square, &lines[i], regions + 2 * i, scene.average.w, &samples);
    }
    if (samples.count) trace_samples(frame, scene, size, tile, &samples, work);
    for (int i = 0; i < count; i++) {
        Square *square = &squares[which[i]];
        late[square->pixel] |= lines[i].overgrown;
        if (lines[i].failed) continue;
        const Border border = lines[i].border;
        int found = 1;
        for (int k = 0; k < 4; k++) late[square->pixel] |= samples.at[first[i] + k].overgrown;
        for (int k = 0; k < 4; k++) found &= samples.at[first[i] + k].mark == ((k & 1) ? border.second : border.first);
        if (!found) continue;
        for (int k = 0; k < 2; k++)
            add_part(&totals[square->pixel], samples.at[first[i] + k].c,
                     0.5f * regions[2 * i + k].twice / (GRID * GRID));
        add_error(&totals[square->pixel],
                  border.contrast * (0.2f * lines[i].width + 0.3f * off[i]) * square->side / (GRID * GRID));
        square->side = 0;
    }
}

/* Puts in the four parts of each square, BATCH at most. Of whole pixels the sides' middles are known. */
static void split_squares(const Frame frame, const Scene scene, const int2 size, const int2 tile, const Square *squares,
                          const int count, const SideMiddles *sides, Square *parts, int *late, Work *work) {
    const int known = squares->side == GRID, each = known ? 4 : 8;
    Samples samples;
    samples.count = 0;
    for (int i = 0; i < count; i++) {
        const int x = squares[i].x, y = squares[i].y, h = squares[i].side / 2;
        for (int k = 0; k < 4; k++) add_sample(&samples, x + RIGHT(k) * h + h / 2, y + BELOW(k) * h + h / 2);
        if (known) continue;
        add_sample(&samples, x + h, y);
        add_sample(&samples, x + 2 * h, y + h);
        add_sample(&samples, x + h, y + 2 * h);
        add_sample(&samples, x, y + h);
    }
    trace_samples(frame, scene, size, tile, &samples, work);
    for (int i = 0; i < count; i++) {
        const Square *from = &squares[i];
        const Sample *middle = &samples.at[each * i], *side = known ? sides->of[from->pixel] : middle + 4;
        for (int k = 0; k < 4; k++) {
            Square square = {from->x + RIGHT(k) * (from->side / 2), from->y + BELOW(k) * (from->side / 2),
                             from->side / 2, from->pixel};
            square.corner[k] = from->corner[k];
            square.corner[(k + 1) & 3] = side[k];
            square.corner[(k + 2) & 3] = from->middle;
            square.corner[(k + 3) & 3] = side[(k + 3) & 3];
            square.middle = middle[k];
            square.bent = 0;
            square.broken = 0;
            note_overgrown_square(&square, late);
            parts[4 * i + k] = square;
        }
    }
}

/* Adds those squares to their pixels that have a line, and if they are the smallest all of them. Leaves the others, and
 * returns how many these are. */
static int follow_all(const Frame frame, const Scene scene, const int2 size, const int2 tile, Square *squares,
                      const int count, Total *totals, int *late, Work *work) {
    const int last = count > 0 && squares->side == SMALLEST;
    int which[BATCH], lines = 0, left = 0;
    for (int i = 0; i < count; i++) {
        Border border;
        if (squares[i].side >= SMALLEST_LINED && has_border(&squares[i], &border)) which[lines++] = i;
        if (lines < BATCH && i < count - 1) continue;
        if (lines) follow_lines(frame, scene, size, tile, squares, which, lines, totals, late, work);
        lines = 0;
    }
    for (int i = 0; i < count; i++) {
        if (squares[i].side == 0) continue;
        if (last) {
            add_square(&squares[i], error_of(&squares[i]), &totals[squares[i].pixel]);
        } else {
            squares[left++] = squares[i];
        }
    }
    return left;
}

/* The means of those pixels of a packet that are wanted. */
static __attribute__((noinline)) void sample_pixels(const Frame frame, const Scene scene, const int2 size,
                                                    const int *columns, const int *rows, const int *wanted,
                                                    const int2 tile, Sum *sums, int *late, Work *work) {
    Square squares[4 * MOST_OPEN * W], open[MOST_OPEN * W];
    SideMiddles sides;
    Total totals[W];
    for (int lane = 0; lane < W; lane++) {
        const Total nothing = {{0, 0, 0, 0}, 0};
        totals[lane] = nothing;
    }
    int count = squares_of_pixels(frame, scene, size, columns, rows, wanted, tile, squares, &sides, late, work);
    while (count > 0) {
        int left = 0;
        for (int first = 0, end = 0; first < count; first = end) {
            const int pixel = squares[first].pixel;
            while (end < count && squares[end].pixel == pixel) end++;
            left += keep_squares(squares + first, end - first, scene.average.w, &totals[pixel], open + left);
        }
        left = follow_all(frame, scene, size, tile, open, left, totals, late, work);
        count = 4 * left;
        for (int i = 0; i < left; i += BATCH)
            split_squares(frame, scene, size, tile, open + i, min(left - i, BATCH), &sides, squares + 4 * i, late,
                          work);
    }
    for (int lane = 0; lane < W; lane++) {
        const Total total = totals[lane];
        const Sum sum = {
            {total.c[0], total.c[1], total.c[2]}, total.c[3], SAFETY * sqrt((float)total.error * 0x1p-40f) + LEFT_OUT};
        if (wanted[lane]) sums[lane] = sum;
    }
}
#endif

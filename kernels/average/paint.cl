/* paint.cl: the colour that a texture gives a patch of a surface.
 */
#if defined(WITH_AVERAGE) && defined(WITH_TEXTURES)
/* The angle of (x, y) in turns. As a function of a point that is rho from the origin, it has the slope 1 / rho and its
 * second derivatives are within 1 / rho^2, in radians. */
static Model turns_of_models(const Model y, const Model x) {
    const FLOAT square = x.v * x.v + y.v * y.v, rx = radius_of(x), ry = radius_of(y);
    const FLOAT far = sqrt(rx * rx + ry * ry), rho = sqrt(square) * (1 - 8 * ROUNDING) - far, part = far / rho;
    const FLOAT turn = 0.15915494f, over = turn / square;
    Model m;
    m.v = TO_FLOAT(turns_of(TO_REAL(y.v), TO_REAL(x.v)));
    m.x = (x.v * y.x - y.v * x.x) * over;
    m.y = (x.v * y.y - y.v * x.y) * over;
    m.z = (x.v * y.z - y.v * x.z) * over;
    m.r = (fabs(x.v) * y.r + fabs(y.v) * x.r) * over + (0.5f * turn) * part * part + 2 * ROUNDING * (1 + gradient(m));
    m.r = (rho > 0) & is_known(x) & is_known(y) ? m.r : (FLOAT)INFINITY;
    return with_rounding(m);
}

static Model turned_coordinate(const FLOAT x, const FLOAT y, const FLOAT z, const Model3 v) {
    return plus_model(plus_model(scaled(v.x, x), scaled(v.y, y)), scaled(v.z, z));
}

/* Where a patch of spheres is on its texture, as map_spheres() has it: by the normal in own axes, or in the world. */
static void map_patch(const Frame frame, Area *patch) {
    Model3 q = patch->q;
    q.x = choose_model(patch->stretched, q.x, turned_coordinate(frame.right.x, frame.up.x, frame.back.x, patch->q));
    q.y = choose_model(patch->stretched, q.y, turned_coordinate(frame.right.y, frame.up.y, frame.back.y, patch->q));
    q.z = choose_model(patch->stretched, q.z, turned_coordinate(frame.right.z, frame.up.z, frame.back.z, patch->q));
    patch->tu = plus_model(constant_model(0.5f), turns_of_models(q.x, q.z));
    patch->tv = scaled(turns_of_models(root_of(plus_model(square_of(q.x), square_of(q.z))), q.y), 2);
}

/* A texture as one lane reads it. */
typedef struct {
    int columns, rows, begin, full;
} Sheet;

static int wrapped(const int place, const int size) {
    const int rest = place % size;
    return rest < 0 ? rest + size : rest;
}

/* Three colours of a texel, 0 .. 1. x, y: within the texture. */
static float3 texel_at(const Scene scene, const Sheet sheet, const int x, const int y) {
    const int deep = sheet.full > 255, shift = deep ? 16 : 8;
    const ulong bytes = as_ulong(vload8(0, scene.texel + sheet.begin + (deep ? 6 : 3) * (y * sheet.columns + x))),
                most = (ulong)sheet.full;
    return (float3)((float)(bytes & most), (float)(bytes >> shift & most), (float)(bytes >> 2 * shift & most)) /
           (float)sheet.full;
}

/* A coordinate on textures by lanes: a model, whose z is in `off`. */
typedef struct {
    float v[W], x[W], y[W], off[W];
} Coordinate;

static void store_coordinate(const Model m, Coordinate *to) {
    STORE_LANES(m.v, to->v);
    STORE_LANES(m.x, to->x);
    STORE_LANES(m.y, to->y);
    STORE_LANES(m.r + fabs(m.z), to->off);
}

/* The same of one lane in texels: c is at + s + t, off by `off`, and within `radius`. The texels that matter are
 * `count` from `first`. */
typedef struct {
    float at, s, t, off, radius;
    int first, count;
} Range;

/* Of more texels across or down, or in all, colours are not looked up. */
#define MOST_ACROSS 192
#define MOST_TEXELS 1536

/* Of a coordinate that is unknown, or of too many texels, count is 0. */
static Range range_of(const Coordinate *c, const int lane, const int size) {
    const float more = 1 + 0x1p-20f, at = c->v[lane] * size;
    Range range = {at, c->x[lane] * size, c->y[lane] * size, 0, 0, 0, 0};
    range.off = (c->off[lane] * size + fabs(at) * 0x1p-22f) * more;
    range.radius = (fabs(range.s) + fabs(range.t) + range.off) * more;
    if (!(range.radius < MOST_ACROSS && fabs(at) < 0x1p22f)) return range;
    range.first = (int)floor(at - range.radius);
    range.count = (int)floor(at + range.radius) - range.first + 2;
    range.at = at - range.first;
    if (range.count > MOST_ACROSS) range.count = 0;
    return range;
}

static int are_known(const Range x, const Range y) {
    return x.count > 0 && y.count > 0 && x.count * y.count <= MOST_TEXELS;
}

/* Texels that a cell may show, less the colour in its middle: rows of so many columns, or if they are `turned`, columns
 * of so many rows. All is named as of rows. sum: their integrals along rows, from below the middle on. low, high: their
 * range; steep: up to what colours differ from one texel to the next, across and down; total: the sum of that over all
 * squares between four texels, and sides: over the columns of squares, or the rows, of the most in each. */
typedef struct {
    int columns, rows, turned;
    float3 texel[MOST_TEXELS], sum[MOST_TEXELS];
    float3 middle, low, high, steep[2], total[2], sides[2];
} Texels;

/* The colour, or the integral of colours along a row up to x, between the four texels from (i, j) on. */
static float3 color_in(const Texels *texels, const float x, const float y, const int i, const int j) {
    const float3 *upper = texels->texel + j * texels->columns + i, *lower = upper + texels->columns;
    const float3 top = upper[0] + (x - i) * (upper[1] - upper[0]), bottom = lower[0] + (x - i) * (lower[1] - lower[0]);
    return top + (y - j) * (bottom - top);
}

static float3 row_integral(const Texels *texels, const float x, const int i, const int j) {
    const int place = j * texels->columns + i;
    const float part = x - i;
    return texels->sum[place] +
           part * (texels->texel[place] + 0.5f * part * (texels->texel[place + 1] - texels->texel[place]));
}

static float3 integral_in(const Texels *texels, const float x, const float y, const int i, const int j) {
    const float3 top = row_integral(texels, x, i, j), bottom = row_integral(texels, x, i, j + 1);
    return top + (y - j) * (bottom - top);
}

static void load_texels(const Scene scene, const Sheet sheet, const Range u, const Range v, Texels *texels) {
    texels->turned = v.radius > u.radius && (u.count > 2 || v.count > 2);
    const Range x = texels->turned ? v : u, y = texels->turned ? u : v;
    const int left = wrapped(u.first, sheet.columns), top = wrapped(v.first, sheet.rows), columns = x.count,
              middle_column = (int)x.at;
    const int step = texels->turned ? 1 : columns, next = texels->turned ? columns : 1;
    texels->columns = columns;
    texels->rows = y.count;
    for (int j = 0, row = top; j < v.count; j++, row = row + 1 == sheet.rows ? 0 : row + 1)
        for (int i = 0, column = left; i < u.count; i++, column = column + 1 == sheet.columns ? 0 : column + 1)
            texels->texel[j * step + i * next] = texel_at(scene, sheet, column, row);
    const float3 middle = color_in(texels, x.at, y.at, middle_column, (int)y.at);
    texels->middle = middle;
    texels->low = texels->high = texels->steep[0] = texels->steep[1] = texels->total[0] = texels->total[1] = 0;
    for (int j = 0; j < y.count; j++) {
        float3 *now = texels->texel + j * columns, *sums = texels->sum + j * columns;
        float3 sum = 0;
        for (int i = 0; i < columns; i++) {
            const float3 color = now[i] - middle;
            now[i] = color;
            texels->low = fmin(texels->low, color);
            texels->high = fmax(texels->high, color);
            if (i > 0) sum += 0.5f * (now[i - 1] + color);
            sums[i] = sum;
            if (i == 0 || j == 0) continue;
            const float3 *before = now - columns;
            const float3 across = fmax(fabs(before[i] - before[i - 1]), fabs(color - now[i - 1]));
            const float3 down = fmax(fabs(now[i - 1] - before[i - 1]), fabs(color - before[i]));
            texels->steep[0] = fmax(texels->steep[0], across);
            texels->steep[1] = fmax(texels->steep[1], down);
            texels->total[0] += across;
            texels->total[1] += down;
        }
        const float3 begin = row_integral(texels, x.at, middle_column, j);
        for (int i = 0; i < columns; i++) sums[i] -= begin;
    }
    texels->sides[0] = texels->sides[1] = 0;
    for (int i = 1; i < columns; i++) {
        float3 most = 0;
        for (int j = 0; j < y.count; j++)
            most = fmax(most, fabs(texels->texel[j * columns + i] - texels->texel[j * columns + i - 1]));
        texels->sides[0] += most;
    }
    for (int j = 1; j < y.count; j++) {
        float3 most = 0;
        for (int i = 0; i < columns; i++)
            most = fmax(most, fabs(texels->texel[j * columns + i] - texels->texel[(j - 1) * columns + i]));
        texels->sides[1] += most;
    }
}

/* How far on a line of the length 1 the next whole number of x is, which has the slope `step`. */
static float way_to_next(const float x, const float step) {
    return step > 0 ? (floor(x) + 1 - x) / step : step < 0 ? (ceil(x) - 1 - x) / step : INFINITY;
}

/* The integral of F dy along a line from (x, y) to (x + dx, y + dy), where F is integral_in(). Between lines through
 * texels it is of the third degree in the place on the line, so two points tell it (Gauss and Legendre). */
static float3 integral_along(const Texels *texels, const float x, const float y, const float dx, const float dy) {
    float3 sum = 0;
    if (dy == 0) return sum;
    float next_x = way_to_next(x, dx), next_y = way_to_next(y, dy), done = 0;
    for (int n = 0; n < texels->columns + texels->rows && done < 1; n++) {
        const float end = fmin(fmin(next_x, next_y), 1.0f), middle = 0.5f * (done + end), length = end - done,
                    apart = 0.288675135f * length;
        const int i = clamp((int)floor(x + middle * dx), 0, texels->columns - 2),
                  j = clamp((int)floor(y + middle * dy), 0, texels->rows - 2);
        const float first = middle - apart, last = middle + apart;
        sum += length * (integral_in(texels, x + first * dx, y + first * dy, i, j) +
                         integral_in(texels, x + last * dx, y + last * dy, i, j));
        if (next_x <= end) next_x += 1 / fabs(dx);
        if (next_y <= end) next_y += 1 / fabs(dy);
        done = end;
    }
    return 0.5f * dy * sum;
}

/* The sides of windows by lanes. */
typedef struct {
    float s0[4 + MOST_LINES][W], t0[4 + MOST_LINES][W], s1[4 + MOST_LINES][W], t1[4 + MOST_LINES][W], share[W];
    int sides;
} Polygons;

static void store_polygons(const Window *window, Polygons *to) {
    to->sides = window->sides;
    STORE_LANES(window->share, to->share);
    for (int k = 0; k < window->sides; k++) {
        STORE_LANES(window->s0[k], to->s0[k]);
        STORE_LANES(window->t0[k], to->t0[k]);
        STORE_LANES(window->s1[k], to->s1[k]);
        STORE_LANES(window->t1[k], to->t1[k]);
    }
}

/* Makes places that lie on a line, or nearly so, no less than a little wide, as otherwise their area would be all
 * roundings. What these are off by grows by that. Returns a quarter of the area that the cell has on the texture, with
 * its sign. */
static float widened_area(Range *x, Range *y) {
    const float area = x->s * y->t - x->t * y->s, gx = fabs(x->s) + fabs(x->t), gy = fabs(y->s) + fabs(y->t);
    Range *wide = gy > gx ? x : y;
    const Range *along = gy > gx ? y : x;
    const float g = fmax(gx, gy), more = 0x1p-10f * fmin(g, 1.0f);
    if (fabs(area) > more * g) return area;
    const float sign = (area < 0) != (gy > gx) ? 1.0f : -1.0f, turn = sign * more / fmax(g, 0x1p-60f);
    wide->s += turn * along->t;
    wide->t -= turn * along->s;
    wide->off += more;
    wide->radius += more;
    return x->s * y->t - x->t * y->s;
}

/* The mean over the cell of texels' colours within a window, and 0 elsewhere. off: what that is off by.
 *
 * By Green's theorem it is the integral of F dy around the window, divided by what the cell's area is on the texture,
 * which is 4 times `area`. Where places are off by e, colours are by e times their slope there, whose mean over the
 * cell is no more than the largest, no more than the sum over all squares, each wider by e, divided by the cell's area,
 * and no more than the sum over columns of squares: with x = a s + b t, of the cell's places no more than 1 / (2
 * max(|a|, |b|)) are in each unit of x. Roundings, with u = 2^-24, n columns, m rows, and A for the largest colour: F
 * is off by (n^2 + 8) u A, as sums are of up to n colours, and the border goes down and up by 4 ry in all; corners are
 * off by 3 u rx and 3 u ry, which is an area of 24 u rx ry; and F is A rx at most, so what is added up are less than n
 * + m + 26 roundings of 4 A rx ry. All this is divided by 4 area, too. */
static float3 mean_within(const Texels *texels, const Range u, const Range v, const Polygons *window, const int lane,
                          float3 *off) {
    Range x = texels->turned ? v : u, y = texels->turned ? u : v;
    const float area = widened_area(&x, &y), over = 0.25f / area;
    float3 sum = 0;
    for (int k = 0; k < window->sides; k++) {
        const float s0 = window->s0[k][lane], t0 = window->t0[k][lane], s1 = window->s1[k][lane],
                    t1 = window->t1[k][lane];
        const float x0 = x.s * s0 + x.t * t0, y0 = y.s * s0 + y.t * t0;
        sum += integral_along(texels, x.at + x0, y.at + y0, x.s * s1 + x.t * t1 - x0, y.s * s1 + y.t * t1 - y0);
    }
    const float n = texels->columns, m = texels->rows, wider = (1 + 2 * x.off) * (1 + 2 * y.off) * fabs(over);
    const float rounded = 0x1p-23f * y.radius * (n * n + 8 + (2 * (n + m) + 64) * x.radius) / fabs(area);
    const float3 largest = fmax(texels->high, -texels->low);
    const float wide_x = 0.5f * (1 + 2 * x.off) / fmax(fabs(x.s), fabs(x.t)),
                wide_y = 0.5f * (1 + 2 * y.off) / fmax(fabs(y.s), fabs(y.t));
    const float3 steep_x = fmin(fmin(texels->steep[0], texels->total[0] * wider), texels->sides[0] * wide_x);
    const float3 steep_y = fmin(fmin(texels->steep[1], texels->total[1] * wider), texels->sides[1] * wide_y);
    *off = (x.off * steep_x + y.off * steep_y + rounded * largest) * (1 + 0x1p-18f);
    return sum * over;
}

/* Where a patch is on its texture, by lanes. */
typedef struct {
    int which[W];
    Coordinate u, v;
} Places;

static void store_places(const Scene scene, const Area patch, Places *places) {
    STORE_LANES(patch.id, places->which);
    for (int lane = 0; lane < W; lane++)
        places->which[lane] = places->which[lane] < 0 ? -1 : scene.texture_of[scene.material_of[places->which[lane]]];
    store_coordinate(patch.tu, &places->u);
    store_coordinate(patch.tv, &places->v);
}

static Sheet sheet_at(const Scene scene, const int which) {
    const int4 texture = scene.texture[which];
    const Sheet sheet = {texture.x, texture.y, texture.z, texture.w};
    return sheet;
}

static void put_color(float to[3][W], const int lane, const float3 color) {
    to[0][lane] = color.x;
    to[1][lane] = color.y;
    to[2][lane] = color.z;
}

/* The moments of one lane's texture. */
typedef struct {
    float mean[3][W], off[3][W];
} TextureMoments;

/* Of what the texture has besides the colour in the middle: its mean within a window, and what that is off by. Of
 * bounds the smaller one holds: that of mean_within(), or up to what colours differ from the middle's, `range`. */
static void put_mean(const Texels *texels, const Range x, const Range y, const Polygons *window, const int lane,
                     const float3 range, TextureMoments *to) {
    float3 wrong;
    const float3 mean = mean_within(texels, x, y, window, lane, &wrong), all = window->share[lane] * range;
    put_color(to->mean, lane, wrong < all ? mean : (float3)0);
    put_color(to->off, lane, wrong < all ? wrong : all);
}

/* Puts in the moments of textures within a window, in some lanes: of what they have besides patch.paint, which is the
 * colour in the middle where cells show more than four texels. */
static void find_texture_moments(const Scene scene, const Area patch, const Window *window, const MASK here,
                                 Moments *moments) {
    if (!ANY(here & patch.rough)) return;
    Places places;
    Polygons polygons;
    TextureMoments found;
    int wanted[W];
    float range[3][W];
    store_places(scene, patch, &places);
    store_polygons(window, &polygons);
    STORE_LANES(here & patch.rough, wanted);
    for (int k = 0; k < 3; k++) {
        STORE_LANES(patch.paint[k].r, range[k]);
        STORE_LANES(moments->paint[k], found.mean[k]);
        STORE_LANES(moments->paint_off[k], found.off[k]);
    }
    for (int lane = 0; lane < W; lane++) {
        if (!wanted[lane]) continue;
        const Sheet sheet = sheet_at(scene, places.which[lane]);
        const Range x = range_of(&places.u, lane, sheet.columns), y = range_of(&places.v, lane, sheet.rows);
        const float3 most = (float3)(range[0][lane], range[1][lane], range[2][lane]);
        put_color(found.mean, lane, 0);
        put_color(found.off, lane, polygons.share[lane] * most);
        if (!are_known(x, y)) continue;
        Texels texels;
        load_texels(scene, sheet, x, y, &texels);
        put_mean(&texels, x, y, &polygons, lane, most, &found);
    }
    for (int k = 0; k < 3; k++) {
        moments->paint[k] = LOAD_LANES(found.mean[k]);
        moments->paint_off[k] = LOAD_LANES(found.off[k]);
    }
}

/* What textures multiply the colours of a patch with, and its moments within the window in which it is seen. Within
 * four texels, colour is a + (b - a) s + (c - a) t + (a - b - c + d) s t; of more, it is what is in the middle, and a
 * range. */
static void paint_of(const Scene scene, const Window *seen, Area *patch, Moments *moments) {
    Places places;
    Polygons polygons;
    TextureMoments found;
    store_places(scene, *patch, &places);
    store_polygons(seen, &polygons);
    float part[4][3][W], off[3][W], s0[W], t0[W], wide[W], high[W];
    int rough[W], any = 0;
    for (int lane = 0; lane < W; lane++) {
        put_color(part[0], lane, 1);
        for (int n = 1; n < 4; n++) put_color(part[n], lane, 0);
        put_color(off, lane, 0);
        put_color(found.mean, lane, 0);
        put_color(found.off, lane, 0);
        s0[lane] = t0[lane] = wide[lane] = high[lane] = 0;
        rough[lane] = 0;
        if (places.which[lane] < 0) continue;
        any = 1;
        const Sheet sheet = sheet_at(scene, places.which[lane]);
        const Range x = range_of(&places.u, lane, sheet.columns), y = range_of(&places.v, lane, sheet.rows);
        rough[lane] = -1;
        put_color(part[0], lane, 0.5f);
        put_color(off, lane, 0.5f);
        put_color(found.off, lane, 0.5f * polygons.share[lane]);
        if (!are_known(x, y)) continue;
        Texels texels;
        load_texels(scene, sheet, x, y, &texels);
        if (x.count > 2 || y.count > 2) {
            const float across = texels.turned ? y.radius : x.radius, down = texels.turned ? x.radius : y.radius;
            const float3 far = fmin(texels.steep[0] * across + texels.steep[1] * down, fmax(texels.high, -texels.low));
            const float3 most = far * (1 + 0x1p-18f) + 0x1p-20f;
            put_color(part[0], lane, texels.middle);
            put_color(off, lane, most);
            put_mean(&texels, x, y, &polygons, lane, most, &found);
            continue;
        }
        rough[lane] = 0;
        put_color(found.off, lane, 0);
        const float3 a = texels.texel[0], b = texels.texel[1], c = texels.texel[2], d = texels.texel[3];
        put_color(part[0], lane, a + texels.middle);
        put_color(part[1], lane, b - a);
        put_color(part[2], lane, c - a);
        put_color(part[3], lane, (a - b) - (c - d));
        put_color(off, lane, 0x1p-20f);
        s0[lane] = -x.first;
        t0[lane] = -y.first;
        wide[lane] = sheet.columns;
        high[lane] = sheet.rows;
    }
    for (int k = 0; k < 3; k++) patch->paint[k] = constant_model(1);
    patch->rough = LOAD_LANES(rough);
    if (!any) return;
    /* Where a range stands for the colour, the place does not matter, known or not. */
    const FLOAT columns = LOAD_LANES(wide), rows = LOAD_LANES(high);
    const Model zero = constant_model(0);
    const Model s = plus_model(choose_model(columns > 0, scaled(patch->tu, columns), zero),
                               constant_model(LOAD_LANES(s0)));
    const Model t = plus_model(choose_model(columns > 0, scaled(patch->tv, rows), zero),
                               constant_model(LOAD_LANES(t0)));
    const Model st = times_model(s, t);
    for (int k = 0; k < 3; k++) {
        const Model first = plus_model(constant_model(LOAD_LANES(part[0][k])), scaled(s, LOAD_LANES(part[1][k])));
        patch->paint[k] = plus_model(plus_model(first, scaled(t, LOAD_LANES(part[2][k]))),
                                     scaled(st, LOAD_LANES(part[3][k])));
        patch->paint[k].r += LOAD_LANES(off[k]);
        moments->paint[k] = LOAD_LANES(found.mean[k]);
        moments->paint_off[k] = LOAD_LANES(found.off[k]);
    }
}
#endif

/* paint.cl: the colour that a texture gives a patch of a surface.
 */
#if defined(WITH_AVERAGE) && defined(WITH_TEXTURES)
/* The angle of (x, y) in turns. As a function of a point that is rho from the origin, it has the slope 1 / rho and its second
 * derivatives are within 1 / rho^2, in radians. */
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

/* Three colours of a texel, 0 .. 1. The texture repeats. */
static float3 texel_at(const Scene scene, const Sheet sheet, const int column, const int row) {
    const int x = (column % sheet.columns + sheet.columns) % sheet.columns, y = (row % sheet.rows + sheet.rows) % sheet.rows;
    const int deep = sheet.full > 255, shift = deep ? 16 : 8;
    const ulong bytes = as_ulong(vload8(0, scene.texel + sheet.begin + (deep ? 6 : 3) * (y * sheet.columns + x))), most = (ulong)sheet.full;
    return (float3)((float)(bytes & most), (float)(bytes >> shift & most), (float)(bytes >> 2 * shift & most)) / (float)sheet.full;
}

/* The colour at a place, in texels. */
static float3 blend_at(const Scene scene, const Sheet sheet, const float x, const float y) {
    const int column = (int)floor(x), row = (int)floor(y);
    const float across = x - column, down = y - row;
    const float3 a = texel_at(scene, sheet, column, row), b = texel_at(scene, sheet, column + 1, row);
    const float3 c = texel_at(scene, sheet, column, row + 1), d = texel_at(scene, sheet, column + 1, row + 1);
    const float3 top = a + across * (b - a), bottom = c + across * (d - c);
    return top + down * (bottom - top);
}

/* Of so many texels across or down the range of colours is looked up; of more it is 0 .. 1. */
#define MOST_TEXELS 8

/* The range of a texture's colours over a rectangle. Between texels colours are bilinear, and so largest and least where lines
 * through texels, or the rectangle's sides, cross. */
static void range_of_texture(const Scene scene, const Sheet sheet, const float x0, const float x1, const float y0, const float y1,
                             float3 *low, float3 *high) {
    *low = 0;
    *high = 1;
    const float left = floor(x0), top = floor(y0);
    if (!(x1 - left < MOST_TEXELS && y1 - top < MOST_TEXELS)) return;
    *low = 1;
    *high = 0;
    for (int j = 0; j <= MOST_TEXELS + 1; j++) {
        const float y = j == 0 ? y0 : fmin(top + j, y1);
        for (int i = 0; i <= MOST_TEXELS + 1; i++) {
            const float x = i == 0 ? x0 : fmin(left + i, x1);
            const float3 color = blend_at(scene, sheet, x, y);
            *low = fmin(*low, color);
            *high = fmax(*high, color);
            if (x >= x1) break;
        }
        if (y >= y1) break;
    }
}

/* What textures multiply the colours of a patch with. Within four texels, colour is a + (b - a) s + (c - a) t + (a - b - c + d) s t;
 * of a larger rectangle the range is known. */
static void paint_of(const Scene scene, const Area patch, Model paint[3]) {
    float u[4][W], v[4][W], part[3][4][W], off[3][W], s0[W], t0[W];
    int each[W], any = 0;
    STORE_LANES(patch.id, each);
    STORE_LANES(patch.tu.v, u[0]);
    STORE_LANES(radius_of(patch.tu), u[1]);
    STORE_LANES(patch.tv.v, v[0]);
    STORE_LANES(radius_of(patch.tv), v[1]);
    for (int lane = 0; lane < W; lane++) {
        for (int k = 0; k < 3; k++) {
            part[k][0][lane] = 1;
            part[k][1][lane] = part[k][2][lane] = part[k][3][lane] = off[k][lane] = 0;
        }
        s0[lane] = t0[lane] = u[2][lane] = v[2][lane] = 0;
        const int which = each[lane] < 0 ? -1 : scene.texture_of[scene.material_of[each[lane]]];
        if (which < 0) continue;
        any = 1;
        const int4 texture = scene.texture[which];
        const Sheet sheet = {texture.x, texture.y, texture.z, texture.w};
        const float x = u[0][lane] * sheet.columns, y = v[0][lane] * sheet.rows, more = 1 + 0x1p-20f;
        const float rx = (u[1][lane] * sheet.columns + fabs(x) * 0x1p-22f) * more, ry = (v[1][lane] * sheet.rows + fabs(y) * 0x1p-22f) * more;
        const int near = rx < 0x1p20f && ry < 0x1p20f && fabs(x) < 0x1p22f && fabs(y) < 0x1p22f;
        const float left = floor(x - rx), top = floor(y - ry);
        if (near && x + rx < left + 1 && y + ry < top + 1) {
            const int i = (int)left, j = (int)top;
            const float3 a = texel_at(scene, sheet, i, j), b = texel_at(scene, sheet, i + 1, j);
            const float3 c = texel_at(scene, sheet, i, j + 1), d = texel_at(scene, sheet, i + 1, j + 1);
            const float3 ab = b - a, ac = c - a, abcd = (a - b) - (c - d);
            for (int k = 0; k < 3; k++) {
                part[k][0][lane] = k == 0 ? a.x : k == 1 ? a.y : a.z;
                part[k][1][lane] = k == 0 ? ab.x : k == 1 ? ab.y : ab.z;
                part[k][2][lane] = k == 0 ? ac.x : k == 1 ? ac.y : ac.z;
                part[k][3][lane] = k == 0 ? abcd.x : k == 1 ? abcd.y : abcd.z;
                off[k][lane] = 0x1p-20f;
            }
            s0[lane] = -left;
            t0[lane] = -top;
            u[2][lane] = sheet.columns;
            v[2][lane] = sheet.rows;
        } else {
            float3 low = 0, high = 1;
            if (near) range_of_texture(scene, sheet, x - rx, x + rx, y - ry, y + ry, &low, &high);
            const float3 middle = 0.5f * (low + high), half_way = 0.5f * (high - low) + 0x1p-20f;
            for (int k = 0; k < 3; k++) {
                part[k][0][lane] = k == 0 ? middle.x : k == 1 ? middle.y : middle.z;
                off[k][lane] = k == 0 ? half_way.x : k == 1 ? half_way.y : half_way.z;
            }
        }
    }
    for (int k = 0; k < 3; k++) paint[k] = constant_model(1);
    if (!any) return;
    /* Where a range stands for the colour, the place does not matter, known or not. */
    const FLOAT wide = LOAD_LANES(u[2]), high = LOAD_LANES(v[2]);
    const Model zero = constant_model(0);
    const Model s = plus_model(choose_model(wide > 0, scaled(patch.tu, wide), zero), constant_model(LOAD_LANES(s0)));
    const Model t = plus_model(choose_model(wide > 0, scaled(patch.tv, high), zero), constant_model(LOAD_LANES(t0)));
    const Model st = times_model(s, t);
    for (int k = 0; k < 3; k++) {
        const Model first = plus_model(constant_model(LOAD_LANES(part[k][0])), scaled(s, LOAD_LANES(part[k][1])));
        paint[k] = plus_model(plus_model(first, scaled(t, LOAD_LANES(part[k][2]))), scaled(st, LOAD_LANES(part[k][3])));
        paint[k].r += LOAD_LANES(off[k]);
    }
}
#endif

/* highlights.cl: the mean of a highlight over a whole cell.
 *
 * A highlight is the power c^e of the cosine c = r.v between the light that is reflected and the way to the eye. In a
 * cell that is a large part of it no plane is near to it. So a cell is divided into small squares there, as the lanes
 * of packets, and in each of them the midpoint rule is corrected by second derivatives: with the half side h, the mean
 * of g over a square is g at its middle and h^2 / 6 times the sum of a value that g_ss has in it and one that g_tt has.
 */
#if defined(WITH_AVERAGE) && defined(WITH_LIGHTS) && defined(WITH_SPECULAR)
/* So many squares are on each side of a cell. */
#define SQUARES 4
/* Highlights are looked at so where they are off by more than that. */
#define DULL 0x1p-8f

/* A function over a square: what it is in the middle, and its slopes and second derivatives along s and t there; what
 * these are off by in all of the square; and what the function is off by, of itself. */
typedef struct {
    FLOAT v, slope[2], bend[2], slope_off, bend_off, off;
} Jet;

/* The third variable of models. The root q of D has the slope D' / (2 q), and the second derivatives D'' / (2 q) - D'^2
 * / (4 q^3), where D'' is -2 ss, -st and -2 tt. In the square D' is larger by a limited amount, and D not below `low`;
 * with that, the latter are at most X, Y and XY, and slopes are off by the half side times these. D is as much larger
 * as smaller at most, and what is made of it here is convex: second derivatives are off towards X and Y at most. */
static Jet jet_of_root(const Conic D, const FLOAT s, const FLOAT t, const FLOAT side, const FLOAT middle,
                       const FLOAT swing) {
    const FLOAT x = D.x - 2 * D.ss * s - D.st * t, y = D.y - 2 * D.tt * t - D.st * s, st = fabs(D.st);
    const FLOAT dx = fabs(x) + side * (2 * D.ss + st), dy = fabs(y) + side * (2 * D.tt + st);
    const FLOAT at = conic_at(D, s, t), low = at - side * (dx + dy) - D.r, over = 1 / swing;
    const FLOAT q = sqrt(at), least = 1 / sqrt(low), cube = (FLOAT)0.25f * least * least * least,
                cube_here = (FLOAT)0.25f / (at * q);
    const FLOAT X = D.ss * least + dx * dx * cube, Y = D.tt * least + dy * dy * cube,
                XY = (FLOAT)0.5f * st * least + dx * dy * cube;
    const FLOAT xx = D.ss / q + x * x * cube_here, yy = D.tt / q + y * y * cube_here;
    const FLOAT bend_off = X - xx > Y - yy ? X - xx : Y - yy;
    const Jet w = {(q - middle) * over,      {(FLOAT)0.5f * x / q * over, (FLOAT)0.5f * y / q * over},
                   {-xx * over, -yy * over}, side * ((X > Y ? X : Y) + XY) * over,
                   bend_off * over,          low > 0 ? D.r * least * over : (FLOAT)INFINITY};
    return w;
}

static Jet jet_of(const Model m, const FLOAT s, const FLOAT t, const Jet w) {
    const FLOAT z = fabs(m.z);
    const Jet jet = {m.v + (m.x * s + m.y * t) + m.z * w.v,
                     {m.x + m.z * w.slope[0], m.y + m.z * w.slope[1]},
                     {m.z * w.bend[0], m.z * w.bend[1]},
                     z * w.slope_off,
                     z * w.bend_off,
                     m.r + z * w.off + ROUNDING * (fabs(m.v) + gradient(m))};
    return jet;
}

/* How far a function is from what it is in the middle, at most. */
static FLOAT reach_of(const Jet a, const FLOAT side) {
    return side * (fabs(a.slope[0]) + fabs(a.slope[1]) + 2 * a.slope_off);
}

/* 2 a b - c. */
static Jet reflected_jet(const Jet a, const Jet b, const Jet c, const FLOAT side) {
    const FLOAT ra = reach_of(a, side), rb = reach_of(b, side), most_a = fabs(a.v) + ra, most_b = fabs(b.v) + rb;
    FLOAT slope = 0, bend = 0;
    Jet r;
    r.v = 2 * a.v * b.v - c.v;
    for (int k = 0; k < 2; k++) {
        const FLOAT x = fabs(a.slope[k]), y = fabs(b.slope[k]);
        r.slope[k] = 2 * (a.slope[k] * b.v + a.v * b.slope[k]) - c.slope[k];
        r.bend[k] = 2 * (a.bend[k] * b.v + 2 * a.slope[k] * b.slope[k] + a.v * b.bend[k]) - c.bend[k];
        const FLOAT slope_here = x * rb + y * ra;
        const FLOAT bend_here = fabs(a.bend[k]) * rb + fabs(b.bend[k]) * ra + 2 * (x * b.slope_off + y * a.slope_off);
        slope = slope_here > slope ? slope_here : slope;
        bend = bend_here > bend ? bend_here : bend;
    }
    r.slope_off = 2 * (slope + a.slope_off * most_b + b.slope_off * most_a) + c.slope_off;
    r.bend_off = 2 * (bend + a.bend_off * most_b + b.bend_off * most_a + 2 * a.slope_off * b.slope_off) + c.bend_off;
    r.off = 2 * (most_a * b.off + (most_b + b.off) * a.off) + c.off + 4 * ROUNDING * (fabs(a.v * b.v) + fabs(c.v));
    return r;
}

/* Between what the mean of c^exponent over the square is. With g = c^e: g'' = e c^(e-1) c'' + e (e-1) c^(e-2) c'^2,
 * whose powers grow with c, for e >= 2. It is also between the least and the largest power. lobe() is right to 2^-15 of
 * the power, see highlight_power(), and what is added up here rounds by less than that once more. */
static Share mean_power(const Jet c, const FLOAT exponent, const FLOAT side) {
    const FLOAT rad = reach_of(c, side) + c.off, high = c.v + rad < 1 ? c.v + rad : (FLOAT)1, low = c.v - rad,
                v = c.v < 1 ? c.v : (FLOAT)1;
    const MASK curved = (low > 0) & (exponent >= 2);
    const SHADE e = TO_SHADE(exponent);
    const FLOAT at = TO_FLOAT(lobe(TO_SHADE(v - 1), e));
    const FLOAT up = TO_FLOAT(lobe(TO_SHADE(high - 1), e)) * (1 + 0x1p-14f),
                down = TO_FLOAT(lobe(TO_SHADE(low - 1), e)) * (1 - 0x1p-14f);
    const FLOAT over_high = 1 / high, over_low = 1 / (curved ? low : (FLOAT)1);
    const FLOAT up1 = exponent * up * over_high, down1 = exponent * down * over_low;
    const FLOAT up2 = (exponent - 1) * up1 * over_high, down2 = (exponent - 1) * down1 * over_low;
    FLOAT most = 0, least = 0;
    for (int k = 0; k < 2; k++) {
        const FLOAT x = fabs(c.slope[k]), steep = x + c.slope_off, flat = x > c.slope_off ? x - c.slope_off : (FLOAT)0;
        const FLOAT top = c.bend[k] + c.bend_off, bottom = c.bend[k] - c.bend_off;
        most += up2 * steep * steep + (top > 0 ? up1 : down1) * top;
        least += down2 * flat * flat + (bottom > 0 ? down1 : up1) * bottom;
    }
    const FLOAT part = side * side * (1.0f / 6), off = up1 * c.off + up * 0x1p-13f;
    const FLOAT above = at + part * most + off, below = at + part * least - off;
    const Share mean = {(curved & (below > down)) ? below : down, (curved & (above < up)) ? above : up};
    return mean;
}

/* Models of all lanes in memory. */
typedef struct {
    float v[W], x[W], y[W], r[W], z[W];
} Models;

static void store_models(Models *to, const Model m) {
    STORE_LANES(m.v, to->v);
    STORE_LANES(m.x, to->x);
    STORE_LANES(m.y, to->y);
    STORE_LANES(m.r, to->r);
    STORE_LANES(m.z, to->z);
}

/* That of one lane, in all lanes. */
static Model model_in(const Models *from, const int lane) {
    const Model m = {from->v[lane], from->x[lane], from->y[lane], from->r[lane], from->z[lane]};
    return m;
}

/* Puts the mean over whole cells of (2 a b - c)^exponent into some lanes of a highlight's model, where it is nearer: a
 * and b are the normal's cosines with the ways to the light and to the eye, and c is that between these. */
static __attribute__((noinline)) void mean_highlight(const Model *a, const Model *b, const Model *c,
                                                     const FLOAT exponent, const Limb *limb, const MASK here,
                                                     Model *highlight) {
    const float side = 1.0f / SQUARES;
    Models each[3];
    float conic[7][W], middle[W], swing[W], power[W], mean[W], off[W];
    int wanted[W];
    const MASK bent = limb->here;
    store_models(&each[0], *a);
    store_models(&each[1], *b);
    store_models(&each[2], *c);
    STORE_LANES(bent ? limb->D.v : (FLOAT)1, conic[0]);
    STORE_LANES(bent ? limb->D.x : (FLOAT)0, conic[1]);
    STORE_LANES(bent ? limb->D.y : (FLOAT)0, conic[2]);
    STORE_LANES(bent ? limb->D.ss : (FLOAT)0, conic[3]);
    STORE_LANES(bent ? limb->D.st : (FLOAT)0, conic[4]);
    STORE_LANES(bent ? limb->D.tt : (FLOAT)0, conic[5]);
    STORE_LANES(bent ? limb->D.r : (FLOAT)0, conic[6]);
    STORE_LANES(bent ? limb->middle : (FLOAT)1, middle);
    STORE_LANES(bent ? limb->swing : (FLOAT)1, swing);
    STORE_LANES(exponent, power);
    STORE_LANES(here, wanted);
    for (int lane = 0; lane < W; lane++) {
        mean[lane] = off[lane] = 0;
        if (!wanted[lane]) continue;
        const Conic D = {conic[0][lane], conic[1][lane], conic[2][lane], conic[3][lane],
                         conic[4][lane], conic[5][lane], conic[6][lane]};
        float least[W], most[W];
        for (int first = 0; first < SQUARES * SQUARES; first += W) {
            const INT square = first + LANE_COLUMN + 4 * LANE_ROW;
            const FLOAT s = side * TO_FLOAT(2 * (square % SQUARES) + 1) - 1,
                        t = side * TO_FLOAT(2 * (square / SQUARES) + 1) - 1;
            const Jet w = jet_of_root(D, s, t, side, middle[lane], swing[lane]);
            const Jet cosine = reflected_jet(jet_of(model_in(&each[0], lane), s, t, w),
                                             jet_of(model_in(&each[1], lane), s, t, w),
                                             jet_of(model_in(&each[2], lane), s, t, w), side);
            const Share part = mean_power(cosine, power[lane], side);
            STORE_LANES(part.least, least);
            STORE_LANES(part.most, most);
            for (int k = 0; k < W; k++) {
                mean[lane] += 0.5f * side * side * (least[k] + most[k]);
                off[lane] += 0.5f * side * side * (most[k] - least[k]);
            }
        }
    }
    const Model fine = {LOAD_LANES(mean), 0, 0, LOAD_LANES(off) + 32 * ROUNDING, 0};
    *highlight = choose_model(here & (fine.r < radius_of(*highlight)), fine, *highlight);
}
#endif

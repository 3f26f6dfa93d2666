/* windows.cl: parts of a cell, and means over them.
 *
 * A window is the part of a cell in which something is seen, or lit: where certain models are positive. In a cell their
 * zeros are almost straight. With straight ones, the window is a convex polygon, and what it is off by lies in the strips
 * |v + x s + y t| <= r. Of a strip, either the inner or the outer part is decided wrongly at a place, so what is never negative,
 * such as light, is off by no more than the larger of what is missing and what is too much.
 */
#ifdef WITH_AVERAGE
/* A silhouette, the edge of a spot's cone, and some shadows; of a triangle three edges, and those of some others before it. */
#ifdef WITH_SHEETS
#define MOST_LINES 10
/* So small a share of a cell is no matter, and counts as an error. */
#define TINY 0x1p-10f
#else
#define MOST_LINES 6
#endif

/* The polygon's sides, from (s0, t0) to (s1, t1), counterclockwise, in no order; those that are cut off are points. share: of the
 * cell, 0 .. 1, and off: what may be missing from it at most, or be too much. */
typedef struct {
    FLOAT s0[4 + MOST_LINES], t0[4 + MOST_LINES], s1[4 + MOST_LINES], t1[4 + MOST_LINES];
    FLOAT share, off;
    int sides;
} Window;

static void open_window(Window *window) {
    const float corner[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (int k = 0; k < 4; k++) {
        window->s0[k] = corner[k][0];
        window->t0[k] = corner[k][1];
        window->s1[k] = corner[(k + 1) & 3][0];
        window->t1[k] = corner[(k + 1) & 3][1];
    }
    window->share = 1;
    window->off = 0;
    window->sides = 4;
}

/* A quarter of twice the polygon's area: its sides are closed, so the sum does not depend on the origin. */
static FLOAT polygon_share(const Window *window) {
    FLOAT sum = 0;
    for (int k = 0; k < window->sides; k++) sum += window->s0[k] * window->t1[k] - window->s1[k] * window->t0[k];
    return (FLOAT)0.125f * sum;
}

/* Cuts off where a model is negative, in some lanes. What is left is no more than the line leaves of the cell, and no less than
 * what was there without what it cuts off of the cell. Where roundings let a sliver be met more than twice, the share is held
 * within that, and a sliver has none. */
static __attribute__((noinline)) void cut_window(Window *window, const Model *along, const MASK here) {
    const Model line = *along;
    const MASK known = is_known(line) & (fabs(line.v) < INFINITY);
    const FLOAT v = (here & known) ? line.v : (FLOAT)1, x = (here & known) ? line.x : (FLOAT)0, y = (here & known) ? line.y : (FLOAT)0;
    FLOAT leave_s = 0, leave_t = 0, enter_s = 0, enter_t = 0;
    for (int k = 0; k < window->sides; k++) {
        const FLOAT s0 = window->s0[k], t0 = window->t0[k], s1 = window->s1[k], t1 = window->t1[k];
        const FLOAT a = v + (x * s0 + y * t0), b = v + (x * s1 + y * t1);
        const MASK first = a > 0, last = b > 0;
        const FLOAT part = a / (a - b), s = s0 + part * (s1 - s0), t = t0 + part * (t1 - t0);
        const MASK leaves = first & !last, enters = last & !first;
        leave_s = leaves ? s : leave_s;
        leave_t = leaves ? t : leave_t;
        enter_s = enters ? s : enter_s;
        enter_t = enters ? t : enter_t;
        window->s0[k] = enters ? s : s0;
        window->t0[k] = enters ? t : t0;
        window->s1[k] = leaves ? s : ((first | last) ? s1 : s0);
        window->t1[k] = leaves ? t : ((first | last) ? t1 : t0);
    }
    window->s0[window->sides] = leave_s;
    window->t0[window->sides] = leave_t;
    window->s1[window->sides] = enter_s;
    window->t1[window->sides] = enter_t;
    window->sides++;
    const FLOAT alone = share_of(v, x, y), low = window->share - (1 - alone), high = window->share < alone ? window->share : alone;
    FLOAT share = polygon_share(window);
    share = share < high ? share : high;
    share = share > low ? share : low;
    window->share = share > 0 ? share : (FLOAT)0;
    const FLOAT more = share_of(v + line.r, x, y) - alone, less = alone - share_of(v - line.r, x, y);
    const FLOAT strip = (more > less ? more : less) + 64 * ROUNDING;
    window->off += here ? (known ? strip : (FLOAT)1) : (FLOAT)0;
}

/* Means over the cell of s and t within a window, and 0 elsewhere. */
typedef struct {
    FLOAT s, t;
} Center;

static Center center_of(const Window *window) {
    FLOAT s = 0, t = 0;
    for (int k = 0; k < window->sides; k++) {
        const FLOAT cross = window->s0[k] * window->t1[k] - window->s1[k] * window->t0[k];
        s += (window->s0[k] + window->s1[k]) * cross;
        t += (window->t0[k] + window->t1[k]) * cross;
    }
    s *= 1.0f / 24;
    t *= 1.0f / 24;
    const FLOAT most = window->share;
    const Center center = {fabs(s) <= most ? s : (FLOAT)0, fabs(t) <= most ? t : (FLOAT)0};
    return center;
}

/* The mean over the cell of sqrt(v + x s + y t) within a window, and 0 elsewhere. With D this plane, G its gradient and
 * F(D) = 2/3 D^(3/2), the field F G / |G|^2 has the divergence sqrt(D). What leaves through a side (ds, dt) is
 * (x dt - y ds) / |G|^2 times the mean of F along it, 4/15 (D1^(5/2) - D0^(5/2)) / (D1 - D0): with a and b the roots of D0 and
 * D1, that is 4/15 (a^4 + a^3 b + a^2 b^2 + a b^3 + b^4) / (a + b). */
static FLOAT mean_of_root(const Window *window, const Model D) {
    FLOAT sum = 0;
    for (int k = 0; k < window->sides; k++) {
        const FLOAT s0 = window->s0[k], t0 = window->t0[k], s1 = window->s1[k], t1 = window->t1[k];
        const FLOAT D0 = D.v + (D.x * s0 + D.y * t0), D1 = D.v + (D.x * s1 + D.y * t1);
        const FLOAT p = D0 > 0 ? D0 : (FLOAT)0, q = D1 > 0 ? D1 : (FLOAT)0, a = sqrt(p), b = sqrt(q), ab = a * b;
        const FLOAT up = (p * p + q * q) + ab * (p + q + ab);
        sum += (a + b > 0) ? (D.x * (t1 - t0) - D.y * (s1 - s0)) * (up / (a + b)) : (FLOAT)0;
    }
    return sum * (1.0f / 15) / (D.x * D.x + D.y * D.y);
}

/* Where a surface's outline is near, the root of its discriminant D, whose slope is infinite on the outline, is middle + swing w
 * with the models' third variable, w. off: what the mean of the root of D's plane is off by, from that of D's root. */
typedef struct {
    MASK here;
    Model D;
    FLOAT middle, swing, off;
} Limb;

static Limb no_limb(void) {
    const Limb limb = {0, {0, 0, 0, 0, 0}, 0, 1, 0};
    return limb;
}

/* The root, and what stands for it elsewhere.
 *
 * D lies between its plane p - r and p + r, and with G = max(|x|, |y|), no line of equal p is longer than 2 |gradient| / G in
 * the cell. So the means of their roots differ by no more than the integral of sqrt(p + r) - sqrt(p - r) over p, divided by
 * 2 G: up to the largest p, that is ((p + r)^(3/2) - max(0, p - r)^(3/2)) / (3 G). Each power is off by a few roundings. */
static Model root_with(const Model D, Limb *limb) {
    const FLOAT least = least_of(D), most = most_of(D), low = least > 0 ? least : (FLOAT)0, high = most > 0 ? most : (FLOAT)0;
    const FLOAT w0 = sqrt(low), w1 = sqrt(high), x = fabs(D.x), y = fabs(D.y), steep = x > y ? x : y;
    limb->here = is_known(D) & (low < 0.25f * high);
    limb->D = D;
    limb->middle = (FLOAT)0.5f * (w0 + w1);
    limb->swing = (FLOAT)0.5f * (w1 - w0);
    const FLOAT top = D.v + (x + y), up = top + D.r, down = top > D.r ? top - D.r : (FLOAT)0;
    limb->off = (up * sqrt(up) * (1 + 16 * ROUNDING) - down * sqrt(down)) / (3 * steep);
    const Model bent = {limb->middle, 0, 0, 4 * ROUNDING * w1 + VANISHING, limb->swing};
    return choose_model(limb->here, bent, root_of(D));
}
#endif

/* windows.cl: parts of a cell, and means over them.
 *
 * A window is the part of a cell in which something is seen, or lit: where certain models are positive. In a cell their
 * zeros are almost straight. With straight ones, the window is a convex polygon, and what it is off by lies in the
 * strips |v + x s + y t| <= r. Of a strip, either the inner or the outer part is decided wrongly at a place, so what is
 * never negative, such as light, is off by no more than the larger of what is missing and what is too much.
 */
#ifdef WITH_AVERAGE
/* Silhouettes, the horizon of a light, the edge of a spot's cone, and two shadows. */
#define MOST_LINES 6

/* The polygon's sides, from (s0, t0) to (s1, t1), counterclockwise, in no order; those that are cut off are points.
 * share: of the cell, 0 .. 1, and off: what may be missing from it at most, or be too much. */
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

/* Cuts off where a model is negative, in some lanes. What is left is no more than the line leaves of the cell, and no
 * less than what was there without what it cuts off of the cell. Where roundings let a sliver be met more than twice,
 * the share is held within that, and a sliver has none. */
static __attribute__((noinline)) void cut_window(Window *window, const Model *along, const MASK here) {
    const Model line = *along;
    const MASK known = is_known(line) & (fabs(line.v) < INFINITY);
    const FLOAT v = (here & known) ? line.v : (FLOAT)1, x = (here & known) ? line.x : (FLOAT)0,
                y = (here & known) ? line.y : (FLOAT)0;
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
    const FLOAT alone = share_of(v, x, y), low = window->share - (1 - alone),
                high = window->share < alone ? window->share : alone;
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
 * (x dt - y ds) / |G|^2 times the mean of F along it, 4/15 (D1^(5/2) - D0^(5/2)) / (D1 - D0): with a and b the roots of
 * D0 and D1, that is 4/15 (a^4 + a^3 b + a^2 b^2 + a b^3 + b^4) / (a + b). */
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

/* Near a surface's outline the slope of the root of its discriminant D is infinite. There, the root is middle + swing w
 * with the models' third variable, w. plane: D; flat: w as a plane; off: what the mean of the root is off by, besides
 * roundings. */
typedef struct {
    MASK here;
    Model plane, flat;
    FLOAT middle, swing, off;
} Limb;

/* What the mean over a cell of the root of D is off by at most, where D is off by r and does not fall below the slope
 * `steep` along s, or t: on each line along that, it is the integral of sqrt(D + r) - sqrt(D - r) over D, divided by
 * the slope. With the largest D that is
 * ((D + r)^(3/2) - max(0, D - r)^(3/2)) / (3 steep). Each power is off by a few roundings. Anywhere, no root is off by
 * more than r / sqrt(D - r). */
static FLOAT root_mean_off(const FLOAT least, const FLOAT top, const FLOAT r, const FLOAT steep) {
    const FLOAT up = top + r, down = top > r ? top - r : (FLOAT)0;
    const FLOAT sloped = (up * sqrt(up) * (1 + 16 * ROUNDING) - down * sqrt(down)) / (3 * steep);
    const FLOAT within = least > 0 ? r / sqrt(least) : (FLOAT)INFINITY;
    return ((steep > 0) & (sloped < within)) ? sloped : within;
}

/* The root of D, and what stands for it elsewhere. */
static Model root_with(const Model D, Limb *limb) {
    const Model root = root_of(D);
    const FLOAT least = least_of(D), most = most_of(D), low = least > 0 ? least : (FLOAT)0,
                high = most > 0 ? most : (FLOAT)0, x = fabs(D.x), y = fabs(D.y);
    const FLOAT w0 = sqrt(low), w1 = sqrt(high);
    limb->here = is_known(D) & (low < 0.25f * high);
    limb->plane = D;
    limb->middle = (FLOAT)0.5f * (w0 + w1);
    limb->swing = limb->here ? (FLOAT)0.5f * (w1 - w0) : (FLOAT)1;
    limb->off = root_mean_off(least, D.v + (x + y), D.r, x > y ? x : y);
    limb->flat = minus_model(root, constant_model(limb->middle));
    const Model bow = {limb->middle, 0, 0, 4 * ROUNDING * w1 + VANISHING, limb->swing};
    return choose_model(limb->here, bow, root);
}

/* A model with a plane for w: where the outline is in the cell, w is within -1 .. 1. */
static Model flattened_on(const Model m, const Limb *limb) {
    const FLOAT z = m.z / limb->swing;
    const Model f = limb->flat, flat = {m.v + z * f.v, m.x + z * f.x, m.y + z * f.y, m.r + fabs(z) * f.r, 0};
    const Model loose = {m.v, m.x, m.y, m.r + fabs(m.z), 0};
    return choose_model(flat.r < loose.r, with_rounding(flat), loose);
}

/* Means over the cell of 1, s, t and w within a window, and 0 elsewhere; off: what that of w is off by. */
typedef struct {
    FLOAT one, s, t, w, off;
} Moments;

static __attribute__((noinline)) void find_moments(const Window *window, const Limb *limb, Moments *moments) {
    const FLOAT one = window->share;
    const Center center = center_of(window);
    moments->one = one;
    moments->s = center.s;
    moments->t = center.t;
    moments->w = 0;
    moments->off = limb->here ? one : (FLOAT)0;
    if (!ANY(limb->here)) return;
    const FLOAT root = mean_of_root(window, limb->plane), off = limb->off / limb->swing;
    const FLOAT w = (root - limb->middle * one) / limb->swing;
    const MASK known = limb->here & (fabs(w) <= one) & (off < one);
    moments->w = known ? w : (FLOAT)0;
    moments->off = known ? off + 0x1p-14f : moments->off;
}
#endif

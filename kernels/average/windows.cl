/* windows.cl: parts of a cell, and means over them.
 *
 * A window is the part of a cell in which something is seen, or lit: where certain models are positive. In a cell their
 * zeros are almost straight. With straight ones, the window is a convex polygon, and what it is off by lies in the
 * strips |v + x s + y t| <= r. Of a strip, either the inner or the outer part is decided wrongly at a place, so what is
 * never negative, such as light, is off by no more than the larger of what is missing and what is too much.
 */
#ifdef WITH_AVERAGE
/* A silhouette, the edge of a spot's cone, and some shadows; of a triangle three edges, and those of some others before
 * it. */
#ifdef WITH_SHEETS
#define MOST_LINES 12
/* So small a share of a cell is no matter, and counts as an error. */
#define TINY 0x1p-10f
#else
#define MOST_LINES 6
#endif

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

/* A quadratic function of the place, v + x s + y t - (ss s^2 + st s t + tt t^2), but for r. */
typedef struct {
    FLOAT v, x, y, ss, st, tt, r;
} Conic;

/* The same with its middle's plane: of the quadratic part, ss s^2 is within 0 and ss. */
static Model model_of_conic(const Conic D) {
    const Model m = {D.v - (FLOAT)0.5f * (D.ss + D.tt), D.x, D.y,
                     (FLOAT)0.5f * (fabs(D.ss) + fabs(D.tt)) + fabs(D.st) + D.r, 0};
    return with_rounding(m);
}

static FLOAT conic_at(const Conic D, const FLOAT s, const FLOAT t) {
    return D.v + (s * (D.x - (D.ss * s + D.st * t)) + t * (D.y - D.tt * t));
}

/* The angle between the directions (1, 0) and (x, y), right to 2^-21 of it, and 0 where both are. Abramowitz and
 * Stegun, 4.4.49: atan(q) / q, for q within 0 .. 1, but for 2^-25. */
static FLOAT angle_of(const FLOAT y, const FLOAT x) {
    const FLOAT a = fabs(y), b = fabs(x), small = a < b ? a : b, large = a < b ? b : a,
                q = small / (large > 0 ? large : (FLOAT)1), z = q * q;
    const FLOAT far = ((0.0028662257f * z - 0.0161657367f) * z + 0.0429096138f) * z - 0.0752896400f;
    const FLOAT near = ((far * z + 0.1065626393f) * z - 0.1420889944f) * z + 0.1999355085f;
    const FLOAT acute = q + q * z * (near * z - 0.3333314528f);
    const FLOAT steep = a < b ? acute : (FLOAT)1.57079633f - acute, angle = x < 0 ? (FLOAT)3.14159265f - steep : steep;
    return y < 0 ? -angle : angle;
}

/* A conic as a sphere over the plane: D = R^2 - U^2 - V^2 with U = a s + b t - u and V = c t - v. */
typedef struct {
    FLOAT R, a, b, c, u, v;
} Dome;

/* Whether D is one is told by `round`, and whether it is so small that roundings of dome_over() do no harm: these are
 * of R / a of 2^-17, at R = 64 a below what a plane is off by. */
static Dome dome_of(const Conic D, MASK *round) {
    Dome dome;
    dome.a = sqrt(D.ss);
    dome.b = (FLOAT)0.5f * D.st / dome.a;
    dome.c = sqrt(D.tt - dome.b * dome.b);
    dome.u = (FLOAT)0.5f * D.x / dome.a;
    dome.v = ((FLOAT)0.5f * D.y - dome.u * dome.b) / dome.c;
    const FLOAT top = D.v + (dome.u * dome.u + dome.v * dome.v);
    dome.R = sqrt(top);
    *round = (D.ss > 0) & (dome.c > dome.a * 0.25f) & (dome.a > dome.c * 0.25f) & (top < 4096 * dome.a * dome.c);
    return dome;
}

/* The mean over the cell of sqrt(max(0, D)) within a window, and 0 elsewhere: what a sphere's half holds over the
 * polygon, divided by what the cell's area is there. off: what that is off by.
 *
 * With q^2 = U^2 + V^2, the field (U, V) (R^3 - D^(3/2)) / (3 q^2) has the divergence sqrt(D). On a side whose line is
 * d from the middle, with T from the foot of that along it and w = sqrt(D), what leaves up to T is a third of
 *
 *     R^3 X + d' (3 R^2 - d'^2) / 2 Y + d T w / 2,    tan X = T / d "less" T R / (d w),   tan Y = T / w
 *
 * where "less" is of the angles, so that tan X = -T d q^2 / ((w + R) (d^2 w + T^2 R)). d' is d. Beyond the outline w is
 * 0, and the same holds if q and d' are R at most. Angles of both ends are taken together.
 *
 * X and Y are off by 2^-20 of what tangents add up to without signs, and so is each product. D is off by e = 2^-20 R^2
 * at a corner, and what leaves changes with D by d T w R^2 / (6 (d^2 w^2 + T^2 R^2)), as the integral's slopes by w^2
 * cancel but for that. */
static FLOAT dome_over(const Window *window, const Conic D, const Dome dome, FLOAT *off) {
    const FLOAT R = dome.R, R2 = R * R, R3 = R2 * R, tiny = VANISHING;
    FLOAT sum = 0, unsure = 0;
    for (int k = 0; k < window->sides; k++) {
        const FLOAT s0 = window->s0[k], t0 = window->t0[k], s1 = window->s1[k], t1 = window->t1[k];
        const FLOAT U0 = dome.a * s0 + dome.b * t0 - dome.u, V0 = dome.c * t0 - dome.v;
        const FLOAT U = dome.a * (s1 - s0) + dome.b * (t1 - t0), V = dome.c * (t1 - t0);
        const FLOAT size = sqrt(U * U + V * V), over = 1 / (size > 0 ? size : (FLOAT)1), T0 = (U0 * U + V0 * V) * over,
                    T1 = T0 + size;
        const FLOAT d = (U0 * V - V0 * U) * over, dd = d * d, near = fabs(d) < R ? d : (d < 0 ? -R : R);
        const FLOAT D0 = conic_at(D, s0, t0), D1 = conic_at(D, s1, t1);
        const FLOAT w0 = sqrt(D0 > 0 ? D0 : (FLOAT)0), w1 = sqrt(D1 > 0 ? D1 : (FLOAT)0);
        const FLOAT T00 = T0 * T0, T11 = T1 * T1, m0 = dd * w0 + T00 * R + tiny, m1 = dd * w1 + T11 * R + tiny;
        const FLOAT q0 = dd + T00 < R2 ? dd + T00 : R2, q1 = dd + T11 < R2 ? dd + T11 : R2;
        const FLOAT n0 = -T0 * d * q0 / (w0 + R), n1 = -T1 * d * q1 / (w1 + R);
        const FLOAT X = angle_of(n1 * m0 - n0 * m1, m0 * m1 + n0 * n1),
                    Y = angle_of(T1 * w0 - T0 * w1, w0 * w1 + T0 * T1);
        const FLOAT across = (FLOAT)0.5f * near * (3 * R2 - near * near), part = (FLOAT)0.5f * d * (T1 * w1 - T0 * w0);
        const MASK side = size > 0;
        sum += side ? R3 * X + across * Y + part : (FLOAT)0;
        const FLOAT apart = fabs(n0) / m0 + fabs(n1) / m1,
                    wide = (fabs(T1 * w0) + fabs(T0 * w1)) / (w0 * w0 + T00 + tiny);
        const FLOAT tilt = R2 * R2 * fabs(d) *
                           (fabs(T0) * w0 / (dd * w0 * w0 + T00 * R2 + tiny) +
                            fabs(T1) * w1 / (dd * w1 * w1 + T11 * R2 + tiny));
        unsure += side ? R3 * (apart < 4 ? apart : (FLOAT)4) + fabs(across) * (wide < 4 ? wide : (FLOAT)4) +
                             (fabs(part) + tilt)
                       : (FLOAT)0;
    }
    const FLOAT unit = 1 / (12 * dome.a * dome.c);
    *off = 0x1p-19f * unit * unsure;
    return sum * unit;
}

/* Where the root of a discriminant D is no plane, it is middle + swing w with the models' third variable, w: near a
 * surface's outline, where its slope is infinite, or where the cell is a large part of the surface. flat: w as a plane.
 * off: what the mean of the root is off by, besides roundings. */
typedef struct {
    MASK here, steep, round; /* whether w is used; whether the outline is near; whether D has a dome */
    Conic D;
    Dome dome;
    Model plane, flat;
    FLOAT middle, swing, off;
} Limb;

static Limb no_limb(void) {
    Limb limb;
    limb.here = limb.steep = limb.round = 0;
    limb.swing = 1;
    limb.middle = limb.off = 0;
    limb.plane = limb.flat = constant_model(0);
    return limb;
}

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

/* The root of D, and what stands for it elsewhere. A plane does where it is off by less than 2^-12 of the root. */
static Model root_with(const Conic D, Limb *limb) {
    const Model plane = model_of_conic(D), root = root_of(plane);
    const FLOAT least = least_of(plane), most = most_of(plane), low = least > 0 ? least : (FLOAT)0,
                high = most > 0 ? most : (FLOAT)0;
    const FLOAT w1 = sqrt(high);
    const MASK steep = low < 0.25f * high, bent = steep | (root.r > 0x1p-12f * w1);
    *limb = no_limb();
    if (!ANY(bent)) return root;
    limb->dome = dome_of(D, &limb->round);
    limb->steep = steep;
    limb->here = is_known(plane) & (steep | (bent & limb->round));
    limb->D = D;
    limb->plane = plane;
    const FLOAT w0 = sqrt(low), x = fabs(D.x), y = fabs(D.y);
    limb->middle = (FLOAT)0.5f * (w0 + w1);
    limb->swing = (FLOAT)0.5f * (w1 - w0);
    const FLOAT bend_x = 2 * fabs(D.ss) + fabs(D.st), bend_y = 2 * fabs(D.tt) + fabs(D.st);
    const FLOAT steep_x = x - bend_x, steep_y = y - bend_y;
    const FLOAT r = limb->round ? D.r : plane.r;
    const FLOAT slope = limb->round ? (steep_x > steep_y ? steep_x : steep_y) : (x > y ? x : y);
    limb->off = root_mean_off(least, limb->round ? high : plane.v + (x + y), r, slope);
    const Model bow = {limb->middle, 0, 0, 4 * ROUNDING * w1 + VANISHING, limb->swing};
    limb->flat = minus_model(root, constant_model(limb->middle));
    return choose_model(limb->here, bow, root);
}

/* A model with a plane for w: where the outline is in the cell, w is within -1 .. 1. */
static Model flattened_on(const Model m, const Limb *limb) {
    const FLOAT z = m.z / limb->swing;
    const Model f = limb->flat, flat = {m.v + z * f.v, m.x + z * f.x, m.y + z * f.y, m.r + fabs(z) * f.r, 0};
    const Model loose = {m.v, m.x, m.y, m.r + fabs(m.z), 0};
    return choose_model(flat.r < loose.r, with_rounding(flat), loose);
}

/* The same, but as it is where the outline is near. */
static Model flattened_inside(const Model m, const Limb *limb) {
    return choose_model(limb->here & !limb->steep, flattened_on(m, limb), m);
}

/* Means over the cell of 1, s, t and w within a window, and 0 elsewhere; off: what that of w is off by. */
typedef struct {
    FLOAT one, s, t, w, off;
#ifdef WITH_TEXTURES
    FLOAT paint[3],
        paint_off[3]; /* of what a texture's red, green and blue have besides their model, and what these are off by */
#endif
} Moments;

static __attribute__((noinline)) void find_moments(const Window *window, const Limb *limb, Moments *moments) {
    const FLOAT one = window->share;
    const Center center = center_of(window);
    moments->one = one;
    moments->s = center.s;
    moments->t = center.t;
    moments->w = 0;
#ifdef WITH_TEXTURES
    for (int k = 0; k < 3; k++) moments->paint[k] = moments->paint_off[k] = 0;
#endif
    moments->off = limb->here ? one : (FLOAT)0;
    if (!ANY(limb->here)) return;
    FLOAT root = 0, off = 0;
    if (ANY(limb->here & limb->round)) root = dome_over(window, limb->D, limb->dome, &off);
    if (ANY(limb->here & !limb->round)) root = limb->round ? root : mean_of_root(window, limb->plane);
    off = ((limb->round ? off : (FLOAT)0) + limb->off) / limb->swing;
    const FLOAT w = (root - limb->middle * one) / limb->swing;
    const MASK known = limb->here & (fabs(w) <= one) & (off < one);
    moments->w = known ? w : (FLOAT)0;
    moments->off = known ? off + 0x1p-14f : moments->off;
}
#endif

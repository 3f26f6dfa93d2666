/* plain.cl: cells that show one surface, on which neither a shadow nor a light's cone ends. Their mean colour is nearly
 * that of the middle.
 *
 * Let e be the way from a cell's middle, as a part of that to its corners: |e| <= 1, and the mean of |e|^2 over the
 * cell is 1/3. If second derivatives of f by e are no larger than `bend` in any direction, |f(e) + f(-e) - 2 f(0)| <=
 * bend |e|^2, so that the mean of f is off from f(0) by bend / 6 at most. It is off by `slope` anywhere, if the first
 * derivatives are no larger than that.
 *
 * With f' and f'' for these, at once in all directions, (f g)'' = f'' g + 2 f' g' + f g'', also of scalar products. The
 * unit vector along w has a slope of |w'| / |w|, and while w moves on a straight line its second derivative is
 * sqrt(4/3) (|w'| / |w|)^2 at most: at the angle phi with the line, it is sin(phi) sqrt(4 - 3 sin(phi)^2) times that,
 * where w' is along the line.
 */
#if HAS(WITH_AVERAGE) && !WITH_QUADRICS
/* No less than sqrt(4/3). */
#define ARC 1.1548f

/* The point in a cell's middle, and how it changes over the cell. Lengths are in the float buffers' unit. P1, n1, v1:
 * most that slopes are, of the point, of the normal, and of the unit vector to the eye; P2, n2, v2: of second
 * derivatives; P_off: what P is off by; off: what n and v are. */
typedef struct {
    INT id; /* which surface, -1 for none */
    Real3 P;
    Float3 n, v; /* n faces the eye */
    FLOAT side, r, P1, P2, n1, n2, v1, v2, P_off, off;
} Middle;

/* A point of a sphere. far: t there, over the cell, at most.
 *
 * With the unit vector u along the ray d, P = rho u and n.u = -cos(theta), where cos(theta)^2 = D / (d.d r^2). Let k be
 * 1 / cos(theta) at most, w >= |u'| and T >= rho |u'|: with d' = 1 at a corner's distance h, these are h and t h. From
 * n.P' = 0 it follows that |rho'| <= T tan(theta) and |P'| <= T k; from n.P'' = -n'.P' = -|P'|^2 / r that
 *
 *     |rho''| <= k (|P'|^2 / r + 2 |rho'| w + ARC T w),   |P''| <= |rho''| + 2 |rho'| w + ARC T w <= k |P'| (|P'| / r +
 * (4 + 2 ARC) w)
 *
 * since k >= 1 and |P'| >= T. With m the sum of magnitudes in C.d, b is off by e m, with e = OUTLINE_ROUNDING, and D by
 * 4 e times m^2 and little more than d.d |c|, which is no more than b^2 or D. With s = m + sqrt(D) this is less than 9
 * e s^2, so that the root is off by less than 9 e s^2 / sqrt(D), and rho by 10 e s^2 / (sqrt(D) (|b| + sqrt(D))) of
 * itself. */
static Middle middle_of_sphere(const Cells cells, const Sphere sphere, const FLOAT far, const real unit) {
    const Outline outline = outline_of(cells, sphere, unit);
    const Real3 C = {unit * sphere.center.x, unit * sphere.center.y, unit * sphere.center.z};
    const REAL dx = cells.dx, dy = cells.dy, c = unit * unit * sphere.c, a = (dx * dx + dy * dy) + 1;
    const REAL b = C.x * dx + C.y * dy - C.z, sum = fabs(C.x * dx) + fabs(C.y * dy) + fabs(C.z), D = b * b - a * c;
    const REAL root = sqrt(D > 0 ? D : (REAL)0), all = fabs(b) + root;
    const REAL_MASK inside = c <= 0;
    const REAL t = (inside & (b >= 0)) ? all / a : fabs(c) / all;
    Middle m;
    m.id = sphere.index;
    m.side = TO_MASK(inside) ? (FLOAT)-1 : (FLOAT)1;
    m.P.x = t * dx;
    m.P.y = t * dy;
    m.P.z = -t;
    const REAL over_r = sphere.over_r / unit;
    const Float3 n = {TO_FLOAT((m.P.x - C.x) * over_r), TO_FLOAT((m.P.y - C.y) * over_r),
                      TO_FLOAT((m.P.z - C.z) * over_r)};
    m.n.x = m.side * n.x;
    m.n.y = m.side * n.y;
    m.n.z = m.side * n.z;
    const FLOAT over_d = 1 / sqrt(TO_FLOAT(a));
    m.v.x = -TO_FLOAT(dx) * over_d;
    m.v.y = -TO_FLOAT(dy) * over_d;
    m.v.z = over_d;
    m.r = TO_FLOAT(unit * sphere.r);
    const float h = (float)cells.h, k = (float)cells.k, w = sqrt(h * h + k * k);
    const FLOAT low = least_of(outline.D), over = m.r * sqrt(most_of(cells.a) / low),
                slant = over > 1 ? over : (FLOAT)1;
    m.P1 = far * w * slant;
    m.P2 = slant * m.P1 * (m.P1 / m.r + (4 + 2 * ARC) * w);
    m.n1 = m.P1 / m.r;
    m.n2 = m.P2 / m.r;
    m.v1 = w;
    m.v2 = ARC * w * w;
    const FLOAT s = TO_FLOAT(sum + root), part = 10 * (FLOAT)OUTLINE_ROUNDING * s / TO_FLOAT(root) * s / TO_FLOAT(all);
    const FLOAT from_eye = TO_FLOAT(t) / over_d;
    m.P_off = from_eye * part + 8 * (FLOAT)OUTLINE_ROUNDING * (s + from_eye);
    m.off = 0x1p-20f + m.P_off / m.r;
    const MASK known = low > 0;
    m.P1 = known ? m.P1 : (FLOAT)INFINITY;
    m.n2 = known ? m.n2 : (FLOAT)INFINITY;
    return m;
}

/* A colour's part, or what it is made of: in the middle, its largest slope and second derivative; off: what rounding
 * may have made of it. */
typedef struct {
    FLOAT at, slope, bend, off;
} Gentle;

/* What a light gives a cell, by one surface. */
typedef struct {
    Gentle amount, shine; /* of kd C and of 1, in the formula of Phong */
    MASK on;              /* the lanes in which all of the cell is lit, as far as surfaces face the light */
} Gift;

/* (f g), but for what rounding makes of g. */
static Gentle gentle_product(const Gentle f, const Gentle g) {
    const Gentle product = {f.at * g.at, f.slope * g.at + f.at * g.slope + f.slope * g.slope,
                            f.bend * (g.at + g.slope) + 2 * f.slope * g.slope + (f.at + f.slope) * g.bend,
                            f.off * g.at + f.at * g.off};
    return product;
}

/* ks max(0, r.v)^exponent, where r is l mirrored at n: r' is 2 n' + l' at most, since (n'.l) n + (n.l) n' is no longer
 * than n', and r'' is 2 ((n.l)'' + 2 (n.l)' n' + n'') + l''. As r' is orthogonal to r, and v' to v, the slope of r.v is
 * (r' + v') |r - v| at most; |r - v| is chord, and no more than that changes by r' + v' over the cell.
 *
 * With top, the largest r.v over the cell, (x^e)'' is e (e - 1) x^(e - 2) x'^2 + e x^(e - 1) x'', no more than that at
 * top, for e >= 2. Powers are right to 2^-15 of themselves; chord is off by `off`. Returns the lanes in which that
 * holds. */
static MASK shine_of(const Middle m, const Intersection at, const Float3 l, const Gentle l_bends, const Gentle cosine,
                     const MASK here, Gentle *shine) {
    const FLOAT l1 = l_bends.slope, l2 = l_bends.bend;
    const FLOAT exponent = TO_FLOAT(at.exponent), ks = TO_FLOAT(at.ks), two = 2 * cosine.at;
    const MASK shines = here & (ks > 0);
    const Gentle none = {0, 0, 0, 0};
    *shine = none;
    if (!ANY(shines)) return here;
    const Float3 e = {two * m.n.x - l.x - m.v.x, two * m.n.y - l.y - m.v.y, two * m.n.z - l.z - m.v.z};
    const FLOAT square = DOT(e, e), chord = sqrt(square), z = -0.5f * square;
    const FLOAT r1 = 2 * m.n1 + l1, r2 = 2 * (cosine.bend + 2 * cosine.slope * m.n1 + m.n2) + l2, turn = r1 + m.v1;
    const FLOAT off = 2 * cosine.off + 4 * m.off + 0x1p-20f, slope = turn * (chord + turn),
                bend = r2 + 2 * r1 * m.v1 + m.v2;
    const FLOAT z_off = (chord + off) * off, higher = z + slope + z_off, high = higher < 0 ? higher : (FLOAT)0,
                top = 1 + high;
    /* As log(1 + z) <= z, it is less than 2^-28 then. */
    const MASK faint = (exponent * high < -20) & (exponent >= 2);
    shine->off = shines & faint ? ks * 0x1p-26f : (FLOAT)0;
    const MASK bright = shines & !faint;
    if (!ANY(bright)) return here;
    const SHADE power = TO_SHADE(exponent);
    const FLOAT most = TO_FLOAT(lobe(TO_SHADE(high), power)), middle = TO_FLOAT(lobe(TO_SHADE(z), power));
    const FLOAT first = top > 0 ? exponent * most / top : (FLOAT)0,
                second = top > 0 ? (exponent - 1) * first / top : (FLOAT)0;
    shine->at = bright ? ks * middle : (FLOAT)0;
    shine->slope = bright ? ks * first * slope : (FLOAT)0;
    shine->bend = bright ? ks * (second * slope * slope + first * bend) : (FLOAT)0;
    shine->off = bright ? ks * (first * z_off + most * 0x1p-14f) : shine->off;
    return here & (!bright | (exponent >= 2));
}
/* Leaves of `here` the lanes in which all of a cell is within a light's cone, and returns those in which its edge, or
 * where it begins to fall off, may be in the cell. strength: what leaves along its rays; an angle a from the axis has
 * the slope l', and l'' + l'^2 / tan(a) for a second derivative. */
static MASK cone_of(const Light light, const Float3 l, const FLOAT l1, const FLOAT l2, const FLOAT off, MASK *here,
                    Gentle *strength) {
    const Float3 axis = {-(float)light.axis.x, -(float)light.axis.y, -(float)light.axis.z};
    const FLOAT cosine = DOT(axis, l), least = (float)light.axis.w, far = l1 + off + 0x1p-20f;
    const MASK crossed = *here & (fabs(cosine - least) <= far);
    *here = *here & (cosine > least);
    if (!(light.cone.y > 0) || !ANY(*here)) return crossed;
    const Float3 cross = {axis.y * l.z - axis.z * l.y, axis.z * l.x - axis.x * l.z, axis.x * l.y - axis.y * l.x};
    const FLOAT angle = atan2(sqrt(DOT(cross, cross)), cosine), begin = light.cone.x, over = light.cone.y;
    const FLOAT sine = sqrt(DOT(cross, cross)) - far;
    const MASK falls = *here & (angle - far > begin) & (sine > 0), kinked = *here & !falls & (angle + far >= begin);
    strength->at = falls ? 1 - (angle - begin) * over : (FLOAT)1;
    strength->slope = falls ? over * l1 : (FLOAT)0;
    strength->bend = falls ? over * (l2 + l1 * l1 / sine) : (FLOAT)0;
    strength->off = falls ? over * (off + 0x1p-20f) : (FLOAT)0;
    return crossed | kinked;
}
/* Whether something cuts off a light from all of a cell, and, as what is returned, whether it may from a part. w: the
 * way to it. */
static MASK shade_of(const Scene *scene, const int number, const Middle m, const Float3 w, const MASK here, MASK *lit) {
    const Light light = scene->light[number];
    const int at_point = is_at_point(light, kind_of(light));
    const FLOAT radius = m.P1 * (1 + 16 * ROUNDING) + m.P_off, size = sqrt(DOT(w, w));
    const Float3 P = {TO_FLOAT(m.P.x), TO_FLOAT(m.P.y), TO_FLOAT(m.P.z)};
    const Model zero = constant_model(0);
    Area patch;
    patch.id = m.id;
    patch.side = m.side;
    patch.anchor = m.P;
    patch.p.x = patch.p.y = patch.p.z = zero;
    patch.P.x = narrowed(m.P.x, 0, 0, TO_REAL(radius));
    patch.P.y = narrowed(m.P.y, 0, 0, TO_REAL(radius));
    patch.P.z = narrowed(m.P.z, 0, 0, TO_REAL(radius));
    patch.radius = radius;
    patch.bare = 1;
    const FLOAT loose = at_point ? radius + 0x1p-22f * size : (FLOAT)0x1p-22f;
    const Model3 ways = {{w.x, 0, 0, loose, 0}, {w.y, 0, 0, loose, 0}, {w.z, 0, 0, loose, 0}};
    const FLOAT depth = at_point ? (size + radius) * (size + radius) : radius - DOT(P, w),
                far = depth + fabs(depth) * 0x1p-20f + 0x1p-60f;
    const Shaft shaft = shaft_of(scene, number, &patch, ways, far);
    const Blocking blocking = blocking_of(scene, &shaft, here);
    const MASK dark = here & (blocking.blocked.least >= 1) & !blocking.odd;
    *lit = *lit & !dark;
    return here & !dark & ((blocking.blocked.most > 0) | blocking.odd);
}

/* The same of a light that is as bright as the cosine of the angle from its axis: `here` is where that is positive.
 * bends: of l, as Gentle has it. */
static MASK fade_of(const Light light, const Float3 l, const Gentle bends, MASK *here, Gentle *strength) {
    const Float3 axis = {(FLOAT)(float)light.axis.x, (FLOAT)(float)light.axis.y, (FLOAT)(float)light.axis.z};
    const Gentle cosine = {-DOT(axis, l), bends.slope, bends.bend, bends.off + 0x1p-21f};
    const MASK crossed = *here & !(fabs(cosine.at) > (cosine.slope + cosine.off) * (1 + 16 * ROUNDING));
    *here = *here & (cosine.at > 0);
    *strength = cosine;
    return crossed;
}

/* What one light gives. here: the lanes that ask; returns those of them in which it is known. */
static MASK gift_of(const Scene *scene, const int number, const Middle m, const Intersection at, const MASK here,
                    Gift *gift) {
    const Light light = scene->light[number];
    const int kind = kind_of(light), at_point = is_at_point(light, kind);
    const Gentle none = {0, 0, 0, 0};
    const real unit = at_point ? scene->unit : (real)1;
    const REAL zero = 0;
    const Real3 from = {at_point ? m.P.x : zero, at_point ? m.P.y : zero, at_point ? m.P.z : zero};
    const Float3 w = {TO_FLOAT(unit * light.position.x - from.x), TO_FLOAT(unit * light.position.y - from.y),
                      TO_FLOAT(unit * light.position.z - from.z)};
    const FLOAT square = DOT(w, w), over = 1 / sqrt(square), size = square * over;
    const Float3 l = {over * w.x, over * w.y, over * w.z};
    const FLOAT gap = size * (1 - 0x1p-20f) - m.P1, near = at_point ? 1 / gap : (FLOAT)0;
    const FLOAT l1 = m.P1 * near, l2 = m.P2 * near + ARC * l1 * l1, off = 0x1p-19f + m.P_off * near;
    MASK known = at_point ? here & (gap > 0) & (square > 0x1p-80f) : here;
    const FLOAT n_l = DOT(m.n, l);
    const Gentle cosine = {n_l, m.n1 + l1, m.n2 + 2 * m.n1 * l1 + l2, m.off + off + 0x1p-21f};
    const FLOAT margin = (cosine.slope + cosine.off) * (1 + 16 * ROUNDING);
    MASK on = known & (n_l > 0);
    known = known & (fabs(n_l) > margin);
    if (HAS(WITH_BLACK)) on = on & !at.black;
    Gentle strength = {1, 0, 0, 0};
    if (HAS(WITH_SPOT) && kind == SPOT && ANY(on)) known = known & !cone_of(light, l, l1, l2, off, &on, &strength);
    const Gentle bends = {0, l1, l2, off};
    if (HAS(WITH_LAMBERT) && kind == LAMBERT) known = known & !fade_of(light, l, bends, &on, &strength);
    on = on & known;
    const MASK unsure = HAS(WITH_SHADOWS) ? on & may_be_stopped(scene, number, m.id) : (MASK)0;
    if (ANY(unsure)) {
        known = known & !shade_of(scene, number, m, w, unsure, &on);
        on = on & known;
    }
    gift->on = on;
    gift->amount = gift->shine = none;
    if (!ANY(on)) return known;
    gift->amount = gentle_product(cosine, strength);
    if (HAS(WITH_SPECULAR)) {
        const Gentle l_bends = {0, l1, l2, 0};
        Gentle shine;
        known = known & (!on | shine_of(m, at, l, l_bends, cosine, on, &shine));
        gift->shine = gentle_product(shine, strength);
    }
    return known;
}

/* The ambient colour, and what all lights give. Returns the lanes in which these are known. */
static MASK colors_of(const Scene *scene, const Middle m, const MASK asked, Gentle *color) {
    const Intersection at = material_at(scene, m.id);
    const FLOAT ambient[3] = {TO_FLOAT(at.ambient.x), TO_FLOAT(at.ambient.y), TO_FLOAT(at.ambient.z)};
    const FLOAT kd[3] = {TO_FLOAT(at.diffuse.x), TO_FLOAT(at.diffuse.y), TO_FLOAT(at.diffuse.z)};
    MASK here = asked;
    for (int k = 0; k < 3; k++) {
        const Gentle first = {ambient[k], 0, 0, 0x1p-20f};
        color[k] = first;
    }
    for (int number = 0; HAS(WITH_LIGHTS) && number < scene->lights; number++) {
        Gift gift;
        here = here & gift_of(scene, number, m, at, here, &gift);
        if (!ANY(here)) return here;
        const float4 light = scene->light[number].color;
        const float each[3] = {light.x, light.y, light.z};
        for (int k = 0; k < 3; k++) {
            color[k].at += gift.on ? (kd[k] * gift.amount.at + gift.shine.at) * each[k] : (FLOAT)0;
            color[k].slope += gift.on ? (kd[k] * gift.amount.slope + gift.shine.slope) * each[k] : (FLOAT)0;
            color[k].bend += gift.on ? (kd[k] * gift.amount.bend + gift.shine.bend) * each[k] : (FLOAT)0;
            color[k].off += gift.on ? (kd[k] * gift.amount.off + gift.shine.off) * each[k] : (FLOAT)0;
        }
    }
    return here;
}

/* Looks at those cells of which that may be enough. Returns the lanes in which it is. */
static __attribute__((noinline)) MASK look_quickly(const Frame frame, const Scene *scene, const Cells *cells,
                                                   const Sight *view, Means *means) {
    const MASK plain = kind_of_sight(*view).plain, some = plain & (view->cover >= 0);
    const float background[3] = {frame.background.x, frame.background.y, frame.background.z};
    means->error = means->coverage = 0;
    means->beyond = 0;
    for (int k = 0; k < 3; k++) means->color[k] = background[k] < 1 ? background[k] : 1;
    const MASK none = plain & (view->cover < 0);
    if (!ANY(some)) return none;
    Middle m = middle_of_sphere(*cells, spheres_of(scene->spheres, some ? view->cover : (INT)-1), view->of_cover.most,
                                scene->unit);
    /* Where white light from behind the eye is off by more, so may any other. */
    const MASK asked = some & (m.n2 * 42.5f <= scene->levels);
    if (!ANY(asked)) return none;
    m.id = asked ? m.id : (INT)-1;
    Gentle color[3];
    MASK here = colors_of(scene, m, asked, color);
    FLOAT error = 0;
    for (int k = 0; k < 3; k++) {
        const FLOAT off = color[k].bend * (1.0f / 6) + color[k].off + 0x1p-20f * color[k].at,
                    far = color[k].slope + 2 * off;
        const MASK over = color[k].at - far > 1;
        here = here & (over | (color[k].at + far < 1));
        const FLOAT worst = over ? (FLOAT)0 : off;
        error = worst > error ? worst : error;
        PUT_WHERE(here, means->color[k], over ? (FLOAT)1 : color[k].at);
    }
    error = levels_of(error);
    here = here & (error <= scene->levels);
    PUT_WHERE(here, means->error, error);
    PUT_WHERE(here, means->coverage, (FLOAT)1);
    return none | here;
}
#elif HAS(WITH_AVERAGE)
/* Of ellipsoids and of parallel rays, all is looked at alike. */
static MASK look_quickly(const Frame frame, const Scene *scene, const Cells *cells, const Sight *view, Means *means) {
    return 0;
}
#endif

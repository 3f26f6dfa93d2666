/* light.cl: the mean colour of a patch, within the window of the cell in which it is seen. */
#ifdef WITH_AVERAGE
/* The numbers of these kinds of lights. */
#define SPOT 2
#define LAMBERT 3

/* Of a colour, for red, green and blue: v, its mean over the cell within a window and 0 elsewhere, off by at most e,
 * and what it is within at all points of the cell, as far as the window shows them. odd: where nothing is known of it.
 */
typedef struct {
    FLOAT v[3], e[3], least[3], most[3];
    MASK odd;
} Tint;

/* max(0, 1 + z)^exponent of a model z, which is 0 at most; 0^0 = 1. Where the tangent's error is too large, it is what
 * lies between the least and the largest power. f = c^e has the second derivative e (e - 1) c^(e - 2), which is largest
 * at one of the ends. lobe() is right to 2^-15 of the power. */
static Model highlight_power(const Model z, const FLOAT exponent) {
    const FLOAT most = most_of(z), least = least_of(z);
    const FLOAT high = most < 0 ? most : (FLOAT)0, low = least < high ? least : high, v = z.v < high ? z.v : high;
    const SHADE e = TO_SHADE(exponent);
    const FLOAT at_high = TO_FLOAT(lobe(TO_SHADE(high), e)), at_low = TO_FLOAT(lobe(TO_SHADE(low), e)),
                at = TO_FLOAT(lobe(TO_SHADE(v), e));
    const FLOAT top = 1 + high, bottom = 1 + low;
    const FLOAT bend = fabs(exponent * (exponent - 1)), up = at_high / (top * top), down = at_low / (bottom * bottom);
    const FLOAT rad = radius_of(z), rest = 0.5f * rad * rad * bend * (up > down ? up : down) * (1 + 0x1p-12f);
    const Model range = between_bounds(at_low, at_high);
    const MASK curved = (bottom > 0) & (z.v <= high) & (rest < range.r);
    const Model tangent = on_tangent(z, at, exponent * at / (1 + v), exponent >= 1 ? rest : -rest);
    Model m = choose_model(curved, tangent, range);
    m.r = is_known(z) ? m.r + at_high * 0x1p-14f : (FLOAT)INFINITY;
    return m;
}

/* The share of a spot light that leaves along its rays. cosine: of the angle with its axis. */
static Model strength_in_cone(const Light light, const Model cosine) {
    const FLOAT most = most_of(cosine), least = least_of(cosine);
    const FLOAT high = most < 1 ? most : (FLOAT)1, low = least > -1 ? least : (FLOAT)-1;
    const FLOAT loose = 0x1p-20f;
    const FLOAT first = atan2(sqrt((1 - high) * (1 + high)), high) - loose,
                last = atan2(sqrt((1 - low) * (1 + low)), low) + loose;
    const FLOAT begin = light.cone.x, over = light.cone.y;
    const FLOAT strong = 1 - (first - begin) * over, weak = 1 - (last - begin) * over;
    const FLOAT top = strong < 1 ? strong : (FLOAT)1, bottom = weak > 0 ? weak : (FLOAT)0;
    const Model range = between_bounds(bottom < 1 ? bottom : (FLOAT)1, top > 0 ? top : (FLOAT)0);
    /* Where the light falls off all over the patch: the arc cosine has the slope -1 / sqrt(1 - c^2) and the second
     * derivative -c / (1 - c^2)^(3/2). */
    const MASK falls = (strong < 1) & (weak > 0) & (high < 1) & (low > -1);
    const FLOAT v = cosine.v, sine = sqrt((1 - v) * (1 + v));
    const FLOAT far = fabs(high) > fabs(low) ? fabs(high) : fabs(low), thin = 1 / ((1 - far) * (1 + far));
    const FLOAT rad = radius_of(cosine), rest = (FLOAT)0.5f * rad * rad * far * thin * sqrt(thin) * over;
    Model tangent = on_tangent(cosine, 1 - (atan2(sine, v) - begin) * over, over / sine, 0);
    tangent.r += rest + loose * over;
    return choose_model(falls & (tangent.r < range.r), tangent, range);
}

/* A cosine of which the model may tell less than that it is within -1 .. 1. */
static Model at_most_one(const Model cosine) {
    const FLOAT least = least_of(cosine), high = most_of(cosine), low = least < 1 ? least : (FLOAT)1;
    return choose_model((high > 1) & is_known(cosine), between_bounds(low > -1 ? low : (FLOAT)-1, 1), cosine);
}

/* What a light gives a patch within a window, in the lanes in which it is `on`. w, l: the ways to it from the patch's
 * points, and unit vectors along these; a: the square of w; cosine: of l with the normal; strength: the share of it
 * that leaves along -l. The lines cut out its part of the window. lit: the moments of that, but for `blocked`; off:
 * what share of the cell that is off by; all: the lanes in which all of the cell is lit. */
typedef struct {
    int number, kind;
    Light light;
    Model3 w, l;
    Model a, cosine, strength, line[4];
    MASK cut[4], on, all;
    Moments lit;
    Share blocked;
    FLOAT off;
} Beam;

static void narrow_to_cone(const Area *patch, Beam *beam) {
    const Light light = beam->light;
    const Real3 axis = {-light.axis.x, -light.axis.y, -light.axis.z};
    const Model angle = dot_models(beam->l, constant_vector_in(axis, 1));
    beam->on = beam->on & !(most_of(angle) < (float)light.axis.w);
    if (light.cone.y > 0) {
        beam->strength = strength_in_cone(light, angle);
        return;
    }
    const Model within = minus_model(angle, with_rounding(constant_model((FLOAT)(float)light.axis.w)));
    const Model edge = flattened_on(within, &patch->limb);
    const Share lit = share_where_positive(edge);
    beam->line[1] = edge;
    beam->cut[1] = beam->on & (least_of(edge) < 0) & (edge.r < fabs(edge.x) + fabs(edge.y));
    beam->blocked.least = beam->cut[1] ? (FLOAT)0 : 1 - lit.most;
    beam->blocked.most = beam->cut[1] ? (FLOAT)0 : 1 - lit.least;
}

/* Of a light that is as bright as the cosine of the angle from its axis. */
static void fade_by_cosine(Beam *beam) {
    const Real3 axis = {-beam->light.axis.x, -beam->light.axis.y, -beam->light.axis.z};
    const Model cosine = dot_models(beam->l, constant_vector_in(axis, 1));
    beam->on = beam->on & !(most_of(cosine) < 0);
    beam->strength = positive_part(cosine);
}

/* A light, as a patch's points see it. */
static Beam beam_to(const Scene *scene, const int number, const Area *patch, const Moments *moments) {
    Beam beam;
    const Light light = scene->light[number];
    const int kind = kind_of(light), at_point = is_at_point(light, kind);
    const Real3 to = {light.position.x, light.position.y, light.position.z};
    const Real3 way = {scene->unit * to.x - patch->anchor.x, scene->unit * to.y - patch->anchor.y,
                       scene->unit * to.z - patch->anchor.z};
    const Model3 L = constant_vector_in(at_point ? way : to, 1);
    beam.number = number;
    beam.kind = kind;
    beam.light = light;
    beam.w = at_point ? minus_vectors(L, patch->p) : L;
    beam.a = square_of_vector(beam.w);
    beam.l = at_point ? times_vector(over_root_of(beam.a), beam.w) : beam.w;
    beam.cosine = at_point ? dot_models(patch->n, beam.l) : dot_constant(patch->n, beam.l);
    if (WITH_QUADRICS) beam.cosine = at_most_one(beam.cosine);
    beam.on = (patch->id >= 0) & !(most_of(beam.cosine) < 0);
    beam.all = beam.on;
    beam.strength = constant_model(1);
    for (int k = 0; k < 4; k++) beam.cut[k] = 0;
    beam.lit = *moments;
    beam.blocked.least = beam.blocked.most = beam.off = 0;
    /* Where the light is on the horizon of some points. */
    beam.line[0] = flattened_on(beam.cosine, &patch->limb);
    beam.cut[0] = beam.on & (least_of(beam.cosine) < 0) &
                  (2 * beam.line[0].r < fabs(beam.line[0].x) + fabs(beam.line[0].y));
    if (HAS(WITH_SPOT) && kind == SPOT) narrow_to_cone(patch, &beam);
    if (HAS(WITH_LAMBERT) && kind == LAMBERT) fade_by_cosine(&beam);
    return beam;
}

/* Leaves out what something stops. Returns where that is not known. */
static MASK cast_shadows(const Scene *scene, const Area *patch, Beam *beam) {
    const MASK unsure = beam->on & may_be_stopped(scene, beam->number, patch->id);
    if (!ANY(unsure)) return 0;
    const FLOAT depth = is_at_point(beam->light, beam->kind) ? most_of(beam->a)
                                                             : -least_of(dot_models(patch->P, beam->w));
    const Shaft shaft = shaft_of(scene, beam->number, patch, beam->w, depth + fabs(depth) * 0x1p-20f + 0x1p-60f);
    const Blocking blocking = blocking_of(scene, &shaft, unsure);
    const Share blocked = blocking.blocked;
    const FLOAT most = beam->blocked.most + blocked.most;
    beam->blocked.least = (unsure & (blocked.least > beam->blocked.least)) ? blocked.least : beam->blocked.least;
    beam->blocked.most = unsure ? (most < 1 ? most : (FLOAT)1) : beam->blocked.most;
    for (int k = 0; k < 2; k++) {
        beam->line[2 + k] = blocking.free[k];
        beam->cut[2 + k] = unsure & (blocking.by[k] >= 0);
    }
    beam->on = beam->on & (beam->blocked.least < 1);
    return unsure & blocking.odd;
}

/* Cuts the light's part out of the window in which a patch is seen. */
static void cut_to_light(const Area *patch, const Window *seen, Beam *beam) {
    const MASK any = beam->cut[0] | beam->cut[1] | beam->cut[2] | beam->cut[3];
    beam->all = !any & !(beam->blocked.most > 0);
    if (!ANY(beam->on & any)) return;
    Window window = *seen;
    window.off = 0;
    for (int k = 0; k < 4; k++) {
        const MASK here = beam->on & beam->cut[k];
        if (ANY(here)) cut_window(&window, &beam->line[k], here);
    }
    find_moments(&window, &patch->limb, &beam->lit);
    beam->off += window.off;
}

/* As phong() has it: r = 2 (n.l) n - l, r.v = 1 - |r - v|^2 / 2. No highlight where n.l <= 0, but all of it beside. */
static Model shine_in(const Area *patch, const Intersection at, const Beam *beam) {
    const Model none = constant_model(0);
    const MASK shines = beam->on & at.hit & (TO_FLOAT(at.ks) > 0);
    if (!HAS(WITH_SPECULAR) || !ANY(shines)) return none;
    const Model cosine = beam->cosine;
    const FLOAT exponent = TO_FLOAT(at.exponent), ks = TO_FLOAT(at.ks);
    const Model3 e = minus_vectors(times_vector(scaled(cosine, 2), patch->n), plus_vectors(beam->l, patch->v));
    Model power = highlight_power(scaled(square_of_vector(e), -0.5f), exponent);
    const Model some = between_bounds(0, most_of(power));
    power = choose_model((least_of(cosine) > 0) | beam->cut[0], power, some);
    return choose_model(shines, scaled(times_model(power, beam->strength), ks), none);
}

/* Adds (kd C amount + highlight) L, where it reaches the patch. */
static void add_light(Tint *tint, const Beam *beam, const Intersection at, const Model amount, const Model shine) {
    const float color[3] = {beam->light.color.x, beam->light.color.y, beam->light.color.z};
    const FLOAT kd[3] = {TO_FLOAT(at.diffuse.x), TO_FLOAT(at.diffuse.y), TO_FLOAT(at.diffuse.z)};
    const Moments lit = beam->lit;
    const Share blocked = beam->blocked;
    for (int k = 0; k < 3; k++) {
        const Model plain = scaled(amount, kd[k]), m = scaled(plus_model(plain, shine), (FLOAT)color[k]);
        const FLOAT low = least_of(m), least = low > 0 ? low : (FLOAT)0, high = most_of(m),
                    most = high <= 0 ? (FLOAT)0 : high;
        const FLOAT mean = lit.one * m.v + (lit.s * m.x + lit.t * m.y + lit.w * m.z);
        const FLOAT off = lit.one * m.r + fabs(m.z) * lit.off + most * beam->off +
                          16 * ROUNDING * (fabs(m.v) + gradient(m));
        const FLOAT less = mean - most * blocked.most, dim = less > 0 ? less : (FLOAT)0;
        const FLOAT top = most * (1 - blocked.least), bright = mean < top ? mean : top;
        const MASK some = blocked.most > 0;
        tint->v[k] += beam->on ? (some ? (FLOAT)0.5f * (dim + bright) : mean) : (FLOAT)0;
        tint->e[k] += beam->on ? (some ? fabs((FLOAT)0.5f * (bright - dim)) : (FLOAT)0) + off : (FLOAT)0;
        tint->least[k] += (beam->on & beam->all) ? least : (FLOAT)0;
        tint->most[k] += (beam->on & (blocked.least < 1)) ? most : (FLOAT)0;
    }
}

/* What one light adds to a patch: illuminate() for all points at once. */
static void illuminate_patch(const Scene *scene, const int number, const Area *patch, const Intersection at,
                             const Window *seen, const Moments *moments, Tint *tint) {
    Beam beam = beam_to(scene, number, patch, moments);
    if (HAS(WITH_BLACK)) beam.on = beam.on & !at.black;
    if (HAS(WITH_SHADOWS) && ANY(beam.on)) tint->odd = tint->odd | cast_shadows(scene, patch, &beam);
    if (!ANY(beam.on)) return;
    cut_to_light(patch, seen, &beam);
    const Model amount = times_model(choose_model(beam.cut[0], beam.cosine, positive_part(beam.cosine)), beam.strength);
    add_light(tint, &beam, at, amount, shine_in(patch, at, &beam));
}

/* The colour of patches within a window. */
static Tint tint_of(const Scene *scene, const Area *patch, const Window *seen) {
    const Intersection at = material_at(scene, patch->id);
    const FLOAT ambient[3] = {TO_FLOAT(at.ambient.x), TO_FLOAT(at.ambient.y), TO_FLOAT(at.ambient.z)};
    Tint tint;
    tint.odd = 0;
    for (int k = 0; k < 3; k++) {
        tint.v[k] = ambient[k] * seen->share;
        tint.least[k] = tint.most[k] = ambient[k];
        tint.e[k] = 0;
    }
    if (!HAS(WITH_LIGHTS)) return tint;
    Moments moments;
    find_moments(seen, &patch->limb, &moments);
    for (int number = 0; number < scene->lights; number++)
        illuminate_patch(scene, number, patch, at, seen, &moments, &tint);
    return tint;
}

/* The same tint where every colour is 1 at most. share: of the window. What c exceeds 1 by is convex in c, and so
 * nowhere above its chord from the least c to the most, where it is `excess`: no more is lost of the mean of c than the
 * chord has at that mean. */
static void clamp_tint(Tint *tint, const FLOAT share) {
    for (int k = 0; k < 3; k++) {
        const FLOAT excess = tint->most[k] - 1, low = tint->least[k] < 1 ? tint->least[k] : (FLOAT)1,
                    range = tint->most[k] - low;
        const FLOAT least = tint->v[k] - tint->e[k],
                    chord = excess * ((least - low * share) / (range > 0 ? range : (FLOAT)1));
        const FLOAT by_mean = least - (chord > 0 ? chord : (FLOAT)0), above = tint->v[k] + tint->e[k];
        const FLOAT bottom = by_mean > low * share ? by_mean : low * share, top = above < share ? above : share;
        const MASK over = excess > 0;
        tint->v[k] = over ? (FLOAT)0.5f * (bottom + top) : tint->v[k];
        tint->e[k] = over ? (FLOAT)0.5f * (top - bottom) : tint->e[k];
        tint->least[k] = low;
        tint->most[k] = over ? (FLOAT)1 : tint->most[k];
    }
}
#endif

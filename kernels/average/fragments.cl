/* fragments.cl: the mean colour of cells: which part of them shows which surface, and what colours these have there. */
#ifdef WITH_AVERAGE
/* A surface before the cover. D: its discriminant; straight: where its outline is nearly a line, of which it is on one
 * side. */
typedef struct {
    Quadric shape;
    Outline outline;
    MASK straight;
} Front;

/* Whether a line that a model is 0 on crosses cells, if it does, from side to side. */
static MASK is_straight(const Model m) {
    return is_known(m) & (m.r < fabs(m.x) + fabs(m.y));
}

static Front front_of(const Scene *scene, const Cells cells, const INT id) {
    Front front;
    front.shape = quadrics_of(scene->spheres, id);
    front.outline = outline_of(cells, front.shape, scene->unit);
    front.straight = (id >= 0) & (front.outline.c > 0) & (least_of(front.outline.b) > 0) & is_straight(front.outline.D);
    return front;
}

/* A line, without the third variable. */
static Model flattened(const Model m) {
    const Model flat = {m.v, m.x, m.y, m.r + fabs(m.z), 0};
    return flat;
}

/* Which of two surfaces is nearer: a, where the model is negative. With t = (b - sqrt(D)) / d.d, it is the sign of the
 * difference of b - sqrt(D). Ellipsoids have other b. */
static Model depth_difference(const Front a, const Front b) {
    const Model first = minus_model(a.outline.b, root_of(a.outline.D)),
                last = minus_model(b.outline.b, root_of(b.outline.D));
    Model order = flattened(minus_model(first, last));
    const MASK outside = (a.outline.c > 0) & (least_of(a.outline.b) > 0) & (b.outline.c > 0) &
                         (least_of(b.outline.b) > 0);
    order.r = (!WITH_QUADRICS & outside) ? order.r : (FLOAT)INFINITY;
    return order;
}

/* The parts of cells: of the cover, or the background, and of the front. share: what the front has where no line tells
 * it; halved: where a line parts the two, and their windows are known. */
typedef struct {
    Front front;
    Window window[2];
    Share share;
    MASK plain, mixed, halved;
} Division;

/* Which part the front has. What crosses the cover, or may, has any part of it. */
static void divide(const Scene *scene, const Cells cells, const Sight view, Division *parts) {
    const Kind kind = kind_of_sight(view);
    parts->plain = kind.plain;
    parts->mixed = kind.mixed;
    parts->halved = 0;
    parts->share.least = parts->share.most = 0;
    open_window(&parts->window[0]);
    open_window(&parts->window[1]);
    if (!ANY(kind.mixed)) return;
    parts->front = front_of(scene, cells, kind.mixed ? view.front : (INT)-1);
    Model line = parts->front.outline.D;
    MASK clear = view.of_front.most < view.of_cover.least, crossing = 0;
    const MASK close = kind.mixed & !clear;
    if (ANY(close)) {
        const Model order = depth_difference(parts->front, front_of(scene, cells, kind.mixed ? view.cover : (INT)-1));
        const MASK open = close & is_known(order), hidden = open & (least_of(order) > 0);
        clear = clear | (open & (most_of(order) < 0));
        parts->plain = parts->plain | hidden;
        parts->mixed = parts->mixed & !hidden;
        crossing = parts->mixed & !clear & view.of_front.covers & is_straight(order);
        line = choose_model(crossing, scaled(order, -1), line);
    }
    const MASK all = clear & view.of_front.covers;
    line = choose_model(all, constant_model(1), line);
    parts->share = share_of_disc(cells, parts->front.shape, parts->front.outline);
    parts->share.least = clear ? parts->share.least : (FLOAT)0;
    parts->share.most = view.of_front.covers ? (FLOAT)1 : parts->share.most;
    parts->halved = (parts->mixed & (all | (clear & parts->front.straight))) | crossing;
    if (!ANY(parts->halved)) return;
    const Model rest = scaled(line, -1);
    cut_window(&parts->window[0], &rest, parts->halved);
    cut_window(&parts->window[1], &line, parts->halved);
}

/* What cells show of a surface. id: which it is, -1 in lanes that do not ask. */
static Tint tint_in(const Scene *scene, const Cells cells, const Front *front, const INT id, const Window *window) {
    Area patch = patch_of_sphere(cells, front->shape, front->outline, scene->unit);
    patch.id = id;
    Tint tint = tint_of(scene, &patch, window);
    clamp_tint(&tint, window->share);
    return tint;
}

/* The colours of the parts. */
static void put_tints(const Frame frame, const Scene *scene, const Cells cells, const Sight view, const Division *parts,
                      Tint *tints) {
    const float background[3] = {frame.background.x, frame.background.y, frame.background.z};
    for (int k = 0; k < 3; k++)
        for (int which = 0; which < 2; which++)
            tints[which].v[k] = tints[which].e[k] = tints[which].least[k] = tints[which].most[k] = 0;
    tints[0].odd = tints[1].odd = 0;
    const INT front = parts->mixed ? view.front : (INT)-1, cover = (parts->plain | parts->mixed) ? view.cover : (INT)-1;
    if (ANY(front >= 0)) tints[1] = tint_in(scene, cells, &parts->front, front, &parts->window[1]);
    if (ANY(cover >= 0)) {
        const Front behind = front_of(scene, cells, cover);
        tints[0] = tint_in(scene, cells, &behind, cover, &parts->window[0]);
    }
    const MASK none = view.cover < 0;
    for (int k = 0; k < 3; k++) {
        const FLOAT c = background[k] < 1 ? background[k] : 1;
        PUT_WHERE(none, tints[0].v[k], c * parts->window[0].share);
        PUT_WHERE(none, tints[0].e[k], (FLOAT)0);
        PUT_WHERE(none, tints[0].least[k], c);
        PUT_WHERE(none, tints[0].most[k], c);
    }
}

/* Up to what something more of the front, or of what is behind it, changes a colour. */
static FLOAT difference_of(const Tint *front, const Tint *behind, const int k) {
    const FLOAT lighter = front->most[k] - behind->least[k], darker = behind->most[k] - front->least[k];
    return (lighter > 0 ? lighter : (FLOAT)0) + (darker > 0 ? darker : (FLOAT)0);
}

/* A mean of the parts' colours, red, green or blue, and what it is off by. */
typedef struct {
    FLOAT mean, off;
} Blend;

static Blend blend_of(const Division *parts, const Tint *tints, const int k) {
    /* Of s f + (1 - s) b, with the share s of the front: it is linear in s. */
    const FLOAT p = parts->share.least, q = parts->share.most, f0 = tints[1].least[k], f1 = tints[1].most[k],
                b0 = tints[0].least[k], b1 = tints[0].most[k];
    const FLOAT low = b0 + (f0 < b0 ? q : p) * (f0 - b0), high = b1 + (f1 > b1 ? q : p) * (f1 - b1),
                range = (FLOAT)0.5f * (high - low);
    /* Where the line is nearly straight: what is in its strip is of the front, or of what is behind. */
    const FLOAT off = tints[0].e[k] + tints[1].e[k] + parts->window[1].off * difference_of(&tints[1], &tints[0], k);
    const MASK straight = parts->halved & (off < range), mixed = parts->mixed;
    const FLOAT sum = tints[0].v[k] + tints[1].v[k];
    const Blend blend = {mixed ? (straight ? sum : (FLOAT)0.5f * (low + high)) : tints[0].v[k],
                         mixed ? (straight ? off : range) : tints[0].e[k]};
    return blend;
}

/* What cells show, given which surfaces these are. Where that is not known, colours are within 0 .. 1 all the same. */
static __attribute__((noinline)) void look_at_cells(const Frame frame, const Scene *scene, const Cells cells,
                                                    const Sight *sight, Means *means) {
    const Sight view = *sight;
    Division parts;
    Tint tints[2];
    divide(scene, cells, view, &parts);
    put_tints(frame, scene, cells, view, &parts, tints);
    means->beyond = tints[0].odd | tints[1].odd;
    MASK known = parts.plain | parts.mixed;
    FLOAT error = 0;
    for (int k = 0; k < 3; k++) {
        const Blend blend = blend_of(&parts, tints, k);
        known = known & (blend.off < 0.5f);
        means->color[k] = blend.mean;
        error = blend.off > error ? blend.off : error;
    }
    const Share share = parts.share;
    const FLOAT middle = 0.5f * (share.least + share.most);
    const MASK all = (view.cover >= 0) | (parts.mixed & view.of_front.covers);
    means->coverage = all ? (FLOAT)1 : (parts.mixed ? middle : (FLOAT)0);
    if (HAS(OUT_COVERAGE)) {
        /* What is cut out by its coverage may be laid on any colour, so the coverage is to be as near as a colour. */
        const FLOAT off = (parts.mixed & !all) ? 0.5f * (share.most - share.least) : (FLOAT)0;
        error = off > error ? off : error;
        known = known & (off < 0.5f);
    }
    for (int k = 0; k < 3; k++) means->color[k] = known ? means->color[k] : (FLOAT)0.5f;
    means->coverage = known ? means->coverage : (FLOAT)0.5f;
    /* The background alone is exact, as it is where no list holds anything. */
    const MASK nothing = known & (error == 0) & (means->coverage == 0);
    means->error = nothing ? (FLOAT)0 : levels_of(known ? error : (FLOAT)0.5f);
}
#endif

/* hiding.cl: which surfaces of a crowd hide which, and what each one shows of itself.
 *
 * In a cell, triangles have straight edges, and 1/t is a plane over each of them. So of two the common part is a
 * polygon, and which one is nearer there is told by the sign of a plane. A surface of which one edge alone is in the
 * cell leaves to those behind it what is on the other side of a line. What these leave of each other in turn is a
 * polygon again.
 */
#ifdef WITH_SHEETS
/* As many others may cut a surface in a lane. */
#define SLOTS 3

/* Of each surface, sets of others, with the bit 1 << k for the one of the number k: those that surely are before it
 * where both are, and those that may be. slack: what share of the cell that is wrong in; hidden: by one that is before
 * it; loose: the share of the cell that such ones may have, nevertheless. */
typedef struct {
    INT before[CROWD], unsure[CROWD];
    MASK seen[CROWD], hidden[CROWD];
    FLOAT slack[CROWD], loose;
} Order;

/* Cuts a window down to where a surface is. */
static void cut_to_member(Window *window, const Crowd *crowd, const int k, const MASK here) {
    for (int e = 0; e < 3; e++)
        if (ANY(here & crowd->cut[k][e])) cut_window(window, &crowd->line[k][e], here & crowd->cut[k][e]);
}

/* The share that is left, at most, of a window where a model is positive. */
static FLOAT share_left(const Window *window, const Model line, const MASK here) {
    Window part = *window;
    cut_window(&part, &line, here);
    return part.share + part.off;
}

/* Puts in which of two is before the other: in lanes in which one surely ends before the other one begins, and in which
 * the planes' difference has one sign in all of the cell, or in all but a tiny part of where both are. */
static void order_pair(const Crowd *crowd, const int j, const int k, const MASK both, Order *order) {
    const Model gap = minus_model(crowd->depth[j], crowd->depth[k]);
    const MASK told = both & is_known(gap);
    MASK first = (both & (crowd->far[j] < crowd->near[k])) | (told & (least_of(gap) > 0));
    MASK last = (both & !first) & ((crowd->far[k] < crowd->near[j]) | (told & (most_of(gap) < 0)));
    MASK open = both & !first & !last;
    if (ANY(open & !crowd->vague[j] & !crowd->vague[k])) {
        const MASK clear = open & !crowd->vague[j] & !crowd->vague[k];
        Window own, common;
        open_window(&own);
        cut_to_member(&own, crowd, k, clear);
        common = own;
        cut_to_member(&common, crowd, j, clear);
        const FLOAT all = common.share + common.off;
        const FLOAT nearer = share_left(&common, gap, clear), further = share_left(&common, scaled(gap, -1), clear);
        const MASK apart = clear & (all < TINY);
        const MASK before = clear & !apart & told & (further < TINY),
                   behind = clear & !apart & !before & told & (nearer < TINY);
        const FLOAT wrong = apart ? all : before ? further : behind ? nearer : (FLOAT)0;
        order->slack[j] += wrong;
        order->slack[k] += wrong;
        Window other;
        open_window(&other);
        cut_to_member(&other, crowd, j, clear);
        const FLOAT rest_k = own.share - common.share + common.off,
                    rest_j = other.share - common.share + (common.off + other.off);
        const MASK hides_k = before & (rest_k < TINY), hides_j = behind & (rest_j < TINY);
        order->hidden[k] = order->hidden[k] | hides_k;
        order->hidden[j] = order->hidden[j] | hides_j;
        order->loose += hides_k ? rest_k : hides_j ? rest_j : (FLOAT)0;
        first = first | before;
        last = last | behind;
        open = open & !apart & !before & !behind;
    }
    order->hidden[k] = order->hidden[k] | (first & crowd->covers[j]);
    order->hidden[j] = order->hidden[j] | (last & crowd->covers[k]);
    order->before[k] = order->before[k] | (first ? (INT)(1 << j) : (INT)0);
    order->before[j] = order->before[j] | (last ? (INT)(1 << k) : (INT)0);
    order->unsure[k] = order->unsure[k] | (open ? (INT)(1 << j) : (INT)0);
    order->unsure[j] = order->unsure[j] | (open ? (INT)(1 << k) : (INT)0);
}

/* Whether two triangles go on in each other, as the eye sees them, so that they are on opposite sides of an edge. */
static int are_beside(const Scene scene, const int one, const int two) {
    const int first = FIRST_TRIANGLE(scene.spheres);
    if (one < first || two < first) return 0;
    const int4 around = scene.neighbour[one - first];
    const int side = scene.face_side[one - first], other = two - first;
    return (around.x == other || around.y == other || around.z == other) && side != 0 && scene.face_side[other] == side;
}

static void order_crowd(const Scene scene, const Crowd *crowd, const Depth depth, Order *order) {
    order->loose = 0;
    for (int k = 0; k < crowd->count; k++) {
        order->before[k] = order->unsure[k] = 0;
        order->seen[k] = (crowd->near[k] <= depth.far) & (crowd->near[k] < INFINITY);
        order->hidden[k] = 0;
        order->slack[k] = 0;
    }
    for (int k = 1; k < crowd->count; k++) {
        for (int j = 0; j < k; j++) {
            const MASK both = order->seen[j] & order->seen[k] & !depth.single;
            if (ANY(both) && !are_beside(scene, crowd->index[j], crowd->index[k])) order_pair(crowd, j, k, both, order);
        }
    }
    for (int k = 0; k < crowd->count; k++) order->seen[k] = order->seen[k] & !order->hidden[k];
}

/* What is left of a member's part of cells, or with k = -1 of the background's. off: what share of the cell that is
 * wrong in; lost: what share others may have of it besides, and hidden: what share of it they surely have. */
typedef struct {
    Window window;
    FLOAT off, lost, hidden;
} Rest;

/* What two members have in common of a window that is cut to one of them, at most. */
static FLOAT common_share(const Window *window, const Crowd *crowd, const int k, const MASK here) {
    Window part = *window;
    cut_to_member(&part, crowd, k, here);
    return part.share + part.off;
}

/* Counts what others have of what is left, which no line cuts off. other: these, as bits, and sure: those that surely
 * are before it. All of them together have no more than the sum of their parts, and no less than that without what
 * every two have in common. Two that go on in each other have nothing. */
static void count_lost(const Scene scene, const Crowd *crowd, const INT other, const INT sure, Rest *rest) {
    for (int j = 0; j < crowd->count; j++) {
        const MASK here = (other & (INT)(1 << j)) != 0, clear = here & !crowd->vague[j];
        if (!ANY(here)) continue;
        Window common = rest->window;
        common.off = 0;
        cut_to_member(&common, crowd, j, clear);
        const FLOAT within = common.share + common.off, all = crowd->share[j].most;
        rest->lost += here ? ((clear & (within < all)) ? within : all) : (FLOAT)0;
        const MASK surely = clear & ((sure & (INT)(1 << j)) != 0);
        FLOAT more = common.share - common.off;
        for (int i = 0; i < j; i++) {
            const MASK twice = surely & ((other & sure & (INT)(1 << i)) != 0);
            if (!ANY(twice) || are_beside(scene, crowd->index[i], crowd->index[j])) continue;
            more -= twice ? common_share(&common, crowd, i, twice & !crowd->vague[i]) : (FLOAT)0;
        }
        rest->hidden += (surely & (more > 0)) ? more : (FLOAT)0;
    }
}

static void leave_rest(const Scene scene, const Crowd *crowd, const Order *order, const int k, const MASK here,
                       Rest *rest) {
    open_window(&rest->window);
    rest->lost = rest->hidden = 0;
    if (k >= 0) cut_to_member(&rest->window, crowd, k, here);
    Model slot[SLOTS];
    INT used = 0, other = 0, sure = 0;
    for (int n = 0; n < SLOTS; n++) slot[n] = constant_model(1);
    for (int j = 0; j < crowd->count; j++) {
        if (j == k) continue;
        const MASK surely = k < 0 ? ALL_LANES : (order->before[max(k, 0)] & (INT)(1 << j)) != 0;
        const MASK unsure = k < 0 ? (MASK)0 : (order->unsure[max(k, 0)] & (INT)(1 << j)) != 0,
                   may = here & order->seen[j] & (surely | unsure);
        if (!ANY(may)) continue;
        const MASK a = crowd->cut[j][0], b = crowd->cut[j][1], c = crowd->cut[j][2];
        const MASK one = (a & !b & !c) | (b & !a & !c) | (c & !a & !b), cuts = may & surely & one & (used < SLOTS);
        const Model line = scaled(
            choose_model(a, crowd->line[j][0], choose_model(b, crowd->line[j][1], crowd->line[j][2])), -1);
        for (int n = 0; n < SLOTS; n++) slot[n] = choose_model(cuts & (used == n), line, slot[n]);
        used = cuts ? used + 1 : used;
        other = (may & !cuts) ? other | (INT)(1 << j) : other;
        sure = (may & surely) ? sure | (INT)(1 << j) : sure;
    }
    for (int n = 0; n < SLOTS; n++)
        if (ANY(used > n)) cut_window(&rest->window, &slot[n], used > n);
    rest->off = rest->window.off + (k >= 0 ? order->slack[max(k, 0)] : (FLOAT)0);
    if (ANY(other != 0)) count_lost(scene, crowd, other, sure, rest);
}
#endif

/* mixture.cl: the mean colour of cells that show a crowd.
 */
#ifdef WITH_SHEETS
/* What a member of a crowd, or the background, adds: a tint within its window, where that is exact, else any share
 * between low and high of colours within the tint's. off: what share of the cell the window is wrong in. */
typedef struct {
    Tint tint;
    FLOAT share, off, low, high;
    MASK exact, here;
} Piece;

static Tint tint_of_member(const Frame frame, const Scene scene, const Cells cells, const int index, const MASK seen,
                           const Window *window, Work *work) {
    Area patch;
    if (index >= FIRST_TRIANGLE(scene.spheres)) {
        patch = patch_of_triangle(frame, scene, cells, index - FIRST_TRIANGLE(scene.spheres),
                                  seen ? (INT)index : (INT)-1);
    } else {
#ifdef WITH_SPHERES
        const Quadric sphere = quadric_at(scene.spheres, index);
        patch = patch_of_sphere(cells, sphere, outline_of(cells, sphere, scene.unit), scene.unit);
        patch.id = seen ? patch.id : (INT)-1;
#ifdef WITH_TEXTURES
        map_patch(frame, &patch);
#endif
#endif
    }
    return tint_of(scene, patch, window, work);
}

static Tint constant_tint(const float r, const float g, const float b) {
    const float color[3] = {r, g, b};
    Tint tint;
    for (int c = 0; c < 3; c++) {
        tint.v[c] = tint.least[c] = tint.most[c] = color[c] < 1 ? color[c] : 1;
        tint.e[c] = 0;
    }
    tint.off = 0;
    return tint;
}

/* Colours are within 0 .. 1, known or not. */
static void bound_tint(Tint *tint) {
    for (int c = 0; c < 3; c++) {
        tint->least[c] = tint->least[c] > 0 ? tint->least[c] : (FLOAT)0;
        tint->most[c] = tint->most[c] < 1 ? tint->most[c] : (FLOAT)1;
    }
}

/* The piece of a member, or with k = -1 of the background, in the lanes it is `here` in. */
static void put_piece(const Frame frame, const Scene scene, const Cells cells, const Crowd *crowd, const Order *order,
                      const int k, const MASK here, Piece *piece, Work *work) {
    Rest rest;
    leave_rest(scene, crowd, order, k, here, &rest);
    const MASK vague = k < 0 ? (MASK)0 : crowd->vague[max(k, 0)];
    const FLOAT all = k < 0 ? (FLOAT)1 : crowd->share[max(k, 0)].most;
    const FLOAT least = k < 0 ? (FLOAT)0 : crowd->share[max(k, 0)].least;
    const FLOAT share = rest.window.share, low = (vague ? least : share - rest.off) - rest.lost,
                most = vague ? all : share + rest.off, high = most - rest.hidden;
    piece->here = here;
    piece->share = share;
    piece->off = rest.off;
    piece->low = low > 0 ? low : (FLOAT)0;
    piece->high = high > 0 ? (high < all ? high : all) : (FLOAT)0;
    piece->exact = here & !vague;
    /* What shows next to nothing of itself may have any colour. */
    const MASK shows = here & (piece->high > TINY);
    for (int c = 0; c < 3; c++) {
        piece->tint.v[c] = piece->tint.e[c] = piece->tint.least[c] = 0;
        piece->tint.most[c] = 1;
    }
    piece->tint.off = 0;
    piece->exact = piece->exact & shows;
    piece->low = shows ? piece->low : (FLOAT)0;
    if (!ANY(shows)) return;
    Tint tint;
    if (k < 0) {
        tint = constant_tint(frame.background.x, frame.background.y, frame.background.z);
        for (int c = 0; c < 3; c++) tint.v[c] *= share;
    } else {
        tint = tint_of_member(frame, scene, cells, crowd->index[max(k, 0)], shows, &rest.window, work);
        clamp_tint(&tint, share);
        bound_tint(&tint);
    }
    /* What others have besides is an error, unless it is more than what the colour's range makes of the piece. */
    FLOAT widest = 0;
    for (int c = 0; c < 3; c++) widest = tint.most[c] - tint.least[c] > widest ? tint.most[c] - tint.least[c] : widest;
    piece->exact = piece->exact & !(rest.lost > widest * piece->low);
    piece->off += rest.lost;
    piece->tint.off = shows ? tint.off : (FLOAT)0;
    for (int c = 0; c < 3; c++) {
        piece->tint.v[c] = shows ? tint.v[c] : piece->tint.v[c];
        piece->tint.e[c] = shows ? tint.e[c] : piece->tint.e[c];
        piece->tint.least[c] = shows ? tint.least[c] : piece->tint.least[c];
        piece->tint.most[c] = shows ? tint.most[c] : piece->tint.most[c];
        piece->exact = piece->exact & (tint.e[c] < 1);
    }
}

/* What shares between each piece's low and high that are `left` together, or less, of what exceeds m in colours, make
 * at most; with sign = -1, of what is below m. The sum of w_k x_k with w_k <= cap_k and sum of w_k <= left is no more
 * than left H + sum of cap_k max(0, x_k - H) for any H >= 0, and with one of the x_k or 0 for H it is the largest
 * (linear programming). */
static FLOAT most_of_shares(const Piece *piece, const int count, const FLOAT left, const int c, const FLOAT m,
                            const int sign) {
    FLOAT best = INFINITY;
    for (int h = 0; h <= count; h++) {
        FLOAT H = 0;
        if (h < count) {
            const FLOAT at = sign > 0 ? piece[h].tint.most[c] - m : m - piece[h].tint.least[c];
            H = ((at > 0) & piece[h].here) ? at : (FLOAT)0;
        }
        FLOAT sum = left * H;
        for (int k = 0; k < count; k++) {
            const FLOAT x = (sign > 0 ? piece[k].tint.most[c] - m : m - piece[k].tint.least[c]) - H;
            sum += (piece[k].here & !piece[k].exact & (x > 0)) ? x * (piece[k].high - piece[k].low) : (FLOAT)0;
        }
        best = sum < best ? sum : best;
    }
    return best;
}

/* All shares are 1 together. So with any m the mean is m plus what the pieces have above it, less what they have below.
 */
static void mix_pieces(const Piece *piece, const int count, const FLOAT loose, Tint *out) {
    FLOAT left = 1;
    MASK vague = 0;
    for (int k = 0; k < count; k++) {
        left -= piece[k].here ? (piece[k].exact ? piece[k].share - piece[k].off : piece[k].low) : (FLOAT)0;
        vague = vague | (piece[k].here & !piece[k].exact);
    }
    left = (left > 0 ? left : (FLOAT)0) + 16 * ROUNDING;
    for (int c = 0; c < 3; c++) {
        FLOAT low = 1, high = 0;
        for (int k = 0; k < count; k++) {
            const MASK shows = piece[k].here & (piece[k].high > TINY);
            low = (shows & (piece[k].tint.least[c] < low)) ? piece[k].tint.least[c] : low;
            high = (shows & (piece[k].tint.most[c] > high)) ? piece[k].tint.most[c] : high;
        }
        const FLOAT m = (FLOAT)0.5f * (low + high);
        FLOAT bottom = m, top = m;
        for (int k = 0; k < count; k++) {
            const Tint tint = piece[k].tint;
            const FLOAT above = tint.most[c] - m, below = m - tint.least[c], far = above > below ? above : below;
            const FLOAT mean = tint.v[c] - m * piece[k].share, off = tint.e[c] + piece[k].off * far;
            const MASK here = piece[k].here;
            bottom += here ? (piece[k].exact ? mean - off : -piece[k].low * below - tint.off) : (FLOAT)0;
            top += here ? (piece[k].exact ? mean + off : piece[k].low * above + tint.off) : (FLOAT)0;
        }
        if (ANY(vague)) {
            bottom -= vague ? most_of_shares(piece, count, left, c, m, -1) : (FLOAT)0;
            top += vague ? most_of_shares(piece, count, left, c, m, 1) : (FLOAT)0;
        }
        out->v[c] = (FLOAT)0.5f * (bottom + top);
        out->e[c] = (FLOAT)0.5f * (top - bottom) + loose + 64 * ROUNDING;
        out->least[c] = low;
        out->most[c] = high;
    }
}

/* What cells show. Returns the lanes in which the mean is known; beyond: those in which something seen has no proof. */
static MASK crowd_tint(const Frame frame, const Scene scene, const Cells cells, const int2 tile, Tint *out,
                       FLOAT *coverage, MASK *beyond, Work *work) {
    Crowd crowd;
    gather_crowd(scene, cells, tile, &crowd);
    const Depth depth = depth_of(&crowd, FIRST_TRIANGLE(scene.spheres));
    const MASK open_sky = !(depth.far < INFINITY);
    MASK known = (crowd.rest > depth.far) | !(crowd.rest < INFINITY);
    Order order;
    order_crowd(scene, &crowd, depth, &order);
    MASK any = 0;
    *beyond = 0;
    for (int k = 0; k < crowd.count; k++) {
        const MASK seen = order.seen[k];
        *beyond = *beyond | beyond_proof(scene, seen ? (INT)crowd.index[k] : (INT)-1);
        any = any | seen;
    }
    const MASK wanted = known & !*beyond;
    Piece piece[CROWD + 1];
    for (int k = -1; k < crowd.count; k++)
        put_piece(frame, scene, cells, &crowd, &order, k, (k < 0 ? open_sky : order.seen[max(k, 0)]) & wanted,
                  &piece[k + 1], work);
    mix_pieces(piece, crowd.count + 1, order.loose, out);
    const MASK sky_alone = wanted & !any;
    const Tint sky = constant_tint(frame.background.x, frame.background.y, frame.background.z);
    for (int c = 0; c < 3; c++) {
        out->v[c] = sky_alone ? sky.v[c] : out->v[c];
        out->e[c] = sky_alone ? (FLOAT)0 : out->e[c];
        known = known & (out->e[c] < 1);
    }
    /* The sky has what surfaces leave to it. */
    const FLOAT least = open_sky ? 1 - (piece[0].high + order.loose) : (FLOAT)1,
                most = open_sky ? 1 - (piece[0].low - order.loose) : (FLOAT)1;
    *coverage = sky_alone ? (FLOAT)0 : (FLOAT)0.5f * (least + most);
#ifdef OUT_COVERAGE
    const FLOAT off = sky_alone ? (FLOAT)0 : (FLOAT)0.5f * (most - least);
    out->e[0] = off > out->e[0] ? off : out->e[0];
    known = known & (off < 1);
#endif
    return known;
}
#endif

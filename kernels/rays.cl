/* rays.cl: the kernel for arrays of rays, from anywhere to anywhere: cltrace/run/rays.py starts it. One ray at a time,
 * so W is 1.
 *
 * A ray is the points o + t w of the world with t_min < t < t_max. It is searched for as rays that leave surfaces are,
 * by closest_from() in find/tree.cl. Their bounds hold for starts near the scene, so the search begins at a place
 * o + t0 w with a double t0 >= t_min: at t_min, or at a place where the ray has not reached the scene yet. That place
 * is known exactly, as the sum of three doubles, so nothing is lost by it. Surfaces count from there on, t > t0, which
 * is the near or the far end of a sphere as the place is outside or inside of it.
 *
 * Every decision that pairs of doubles cannot make marks the ray as undecided; WITH_WHOLE, whole numbers make those
 * about triangles. The host decides marked rays among the candidates of the search, of which no surface is missing that
 * the ray may meet first.
 */

/* Where a search begins. Lengths in the tree's unit, in which all surfaces are within 1/2 of the middle. */
typedef struct {
    Leaving ray;
    double at;   /* t0 */
    int misses;  /* whether it surely passes the scene by, or is to end before that */
    int distant; /* whether the start is so far away that double cannot tell where the ray comes near the scene */
    int plain;   /* whether products of its numbers neither overflow nor vanish, so that all bounds hold */
} Beginning;

static int is_plain(const double x) {
    return x == 0 || (fabs(x) >= 0x1p-200 && fabs(x) <= 0x1p200);
}

/* One coordinate of o + t0 w: center + p + q exactly. */
static void begin_at(const double o, const double w, const double at, double *center, double *p, double *q) {
    const Pair way = two_product(at, w), sum = two_sum(o, way.hi), rest = two_sum(sum.lo, way.lo);
    const Pair place = two_sum(sum.hi, rest.hi), left = two_sum(place.lo, rest.lo);
    *center = place.hi;
    *p = left.hi;
    *q = left.lo;
}

/* The ray enters a ball of radius 0.9 around the middle before it comes to any surface, and leaves it behind them all.
 * Within 2^40, these are off by less than 2^-10: there is room for that between the scene, the ball and the filters'
 * range, which is 1. */
static Beginning beginning_of(const Scene *scene, const Real3 o, const Real3 w, const double t_min,
                              const double t_max) {
    const real4 middle = scene->tree.middle;
    const double unit = middle.w;
    const Real3 from = scaled(difference(o, (Real3){middle.x, middle.y, middle.z}), unit), X = cross_of(from, w);
    const double ww = DOT(w, w), beside = DOT(X, X) / ww, nearest = -DOT(from, w) / ww;
    const double chord = sqrt(fmax(0.81 - beside, 0.0) / ww);
    const double enters = (nearest - chord) / unit, leaves = (nearest + chord) / unit;
    Beginning begin;
    begin.at = t_min > enters ? t_min : enters;
    begin.distant = !(size_of(from) <= 0x1p40);
    begin.misses = !begin.distant && (beside > 0.36 || begin.at > leaves || begin.at >= t_max);
    begin.plain = is_plain(o.x) && is_plain(o.y) && is_plain(o.z) && is_plain(w.x) && is_plain(w.y) && is_plain(w.z) &&
                  is_plain(begin.at);
    /* Ties at edges are decided for the ray w + (e, e^2, e^3) from o. From the place, it passes an edge on the same
     * side where t > 0, and on the other one where t < 0. So whole numbers, which `r` tells, break ties for t0 >= 0
     * alone. */
    begin.ray = (Leaving){-1, 0, {0, 0, 1}, w, o, begin.at, 0, {0, 0, 0}, w, size_of(w), {0, 0, 0}};
    begin_at(o.x, w.x, begin.at, &begin.ray.center.x, &begin.ray.p.x, &begin.ray.q.x);
    begin_at(o.y, w.y, begin.at, &begin.ray.center.y, &begin.ray.p.y, &begin.ray.q.y);
    begin_at(o.z, w.z, begin.at, &begin.ray.center.z, &begin.ray.p.z, &begin.ray.q.z);
    begin.ray.reach = size_of(begin.ray.p);
    return begin;
}

/* t of what a ray has met, in pairs, and whether that is surely correctly rounded and before t_max; INFINITY where it
 * is surely beyond. Pairs are off by 2^-104 of sums. */
static double rounded_t(const Scene *scene, const Beginning *begin, const int index, const double t_max, int *sure) {
    const FineT on = fine_t_of(scene->geometry, begin->ray, index);
    const Pair t = plus(pair(begin->at, 0), on.t);
    const double error = 2 * (on.error + 0x1p-103 * (fabs(begin->at) + fabs(on.t.hi)));
    const double gap = (t.hi - t_max) + t.lo;
    if (gap > error) return INFINITY;
    *sure = *sure && gap < -error && t.hi + (t.lo - 2 * error) == t.hi && t.hi + (t.lo + 2 * error) == t.hi;
    return t.hi;
}

/* What a ray meets first, -1 for nothing, and t there. decided: 1, or 0 with the candidates' number as open, -1 where
 * it may be any surface. */
static void trace_ray(const Scene *scene, const Beginning *begin, const double t_max, __global int *met,
                      __global double *t, __global int *open, __global int *candidate) {
    const Geometry geometry = scene->geometry;
    Work work = no_work();
    Met found = {{INFINITY, 0, {0, 0, 0}}, -1, -1};
    Reached reached;
    Search search;
    const double rest = t_max - begin->at, limit = rest + 0x1p-50 * (fabs(rest) + fabs(begin->at));
    start_search(scene, &begin->ray, limit, &reached, &found, &work, &search);
    geometry.undecided[number_of_item()] = 0;
    walk_all(1, &search);
    const int several = search.decided, candidates = search.count[0];
    const float reach = search.reach[0];
    if (candidates > 0) decide_all(&search);
    int sure = begin->plain && !geometry.undecided[number_of_item()];
    double at = INFINITY;
    if (found.id >= 0) at = rounded_t(scene, begin, found.id, t_max, &sure);
    sure = sure && !geometry.undecided[number_of_item()];
    *met = at < INFINITY ? found.id : -1;
    *t = at;
    *open = 0;
    if (sure || (candidates == 0 && !several)) return;
    /* A triangle in whose plane the ray starts is never met, though the search, which begins before that, has met it
     * and left out what is behind. */
    const int any = several || begin->at < 0;
    *open = any ? -1 : 0;
    for (int k = 0; k < candidates && !any; k++)
        if (reached.near[k][0] <= reach) candidate[(*open)++] = reached.index[k][0];
}

/* Each work-item has `run` rays, one after the other. ends: t_min and t_max of each; met, t, open: of trace_ray();
 * candidate: room for CANDIDATES of each. */
APART
__kernel void trace_rays(RENDER_PARAMETERS, const int rays, const int run, __global const double *origin,
                         __global const double *way, __global const double *t_min, __global const double *t_max,
                         __global int *met, __global double *t, __global int *open, __global int *candidate) {
    const Scene scene = SCENE_OF_PARAMETERS;
    const int begin = (int)get_global_id(0) * run;
    for (int i = begin; i < min(begin + run, rays); i++) {
        const Real3 o = {origin[3 * i], origin[3 * i + 1], origin[3 * i + 2]};
        const Real3 w = {way[3 * i], way[3 * i + 1], way[3 * i + 2]};
        const Beginning from = beginning_of(&scene, o, w, t_min[i], t_max[i]);
        met[i] = -1;
        t[i] = INFINITY;
        open[i] = from.distant ? -1 : 0;
        if (from.distant || from.misses) continue;
        trace_ray(&scene, &from, t_max[i], met + i, t + i, open + i, candidate + (long)CANDIDATES * i);
    }
}

/* range.cl: clipping. Each ray is limited to its range within the convex region that the scene's planes keep.
 *
 * A plane is a point S and a normal m towards the kept side. The point of a ray o + t w is in the region if h + t g >=
 * 0 for every plane, with h = (o - S).m and g = m.w: h and g are a Height. The ray enters the region at the last t = -h
 * / g of the planes with g > 0. A ray that starts on a clipped surface is in the region, but for rounding, and has only
 * an end. So what a ray meets first of a surface, at t, counts if all heights at t are at least 0. No other point of a
 * convex surface need be looked for: if its first point is before the region, then either all of it is, or the ray
 * enters the region inside of it, where it meets a cap. cltrace/reference/clipping.py has the same.
 *
 * As everywhere, pairs decide what double cannot, and what is within its bound of 0 counts as 0.
 */
#ifdef WITH_PLANES
/* What heights are off by in double, as a share of the sizes that they are made from, and t, which is right to 2^-24 of
 * itself. */
#define HEIGHT_ERROR ((real)(REAL_BYTES == 8 ? 0x1p-47f : 0x1p-18f))
/* The share by which the directions of rays to lights are rounded. */
#define LIGHT_ERROR ((real)(REAL_BYTES == 8 ? 0x1p-44f : 0x1p-16f))
#define T_ERROR ((real)(REAL_BYTES == 8 ? 0x1p-22f : 0x1p-18f))

/* How far the points of a ray are within the region, times the length of a plane's normal: h + t g. h_size, g_size: the
 * sums of the magnitudes that h and g are made from. */
typedef struct {
    Pair h, g;
    REAL h_size, g_size;
} Height;

/* A ray in pairs: from its anchor to where it starts, and along it. */
typedef struct {
    Pair3 step, w;
} PairRay;

static PairRay pair_ray(const Geometry geometry, const Leaving ray) {
#if REAL_BYTES == 8
    const PairRay fine = {fine_start(geometry, ray), pairs_in_world(geometry, ray.d)};
#else
    const PairRay fine = {{pair(ray.p.x, 0), pair(ray.p.y, 0), pair(ray.p.z, 0)},
                          {pair(ray.w.x, 0), pair(ray.w.y, 0), pair(ray.w.z, 0)}};
#endif
    return fine;
}

static real size_of_normal(const real4 m) {
    return (fabs(m.x) + fabs(m.y)) + fabs(m.z);
}

static Height height_along(const Geometry geometry, const Leaving ray, const PairRay fine, const int plane) {
    const real4 S = geometry.clip[2 * plane], m = geometry.clip[2 * plane + 1];
    const Pair3 f = {plus(two_sum(ray.center.x, -(REAL)S.x), fine.step.x),
                     plus(two_sum(ray.center.y, -(REAL)S.y), fine.step.y),
                     plus(two_sum(ray.center.z, -(REAL)S.z), fine.step.z)};
    const Height height = {dot_axis(m, f), dot_axis(m, fine.w), size_of_normal(m) * (size_of_pairs(f) + ray.reach),
                           size_of_normal(m) * ray.w1};
    return height;
}

#if REAL_BYTES == 8
/* The signs of heights where rays meet what `index` names, in pairs. slack: as in height_signs(). */
static __attribute__((noinline)) REAL fine_height_signs(const Geometry geometry, const Leaving *ray, const int plane,
                                                        const INT index, const real slack) {
    const Height at = height_along(geometry, *ray, pair_ray(geometry, *ray), plane);
    const FineT t = fine_t_of(geometry, *ray, index);
    const REAL far = fabs(t.t.hi), size = at.h_size + far * at.g_size;
    return sign_from(plus(at.h, times(t.t, at.g)).hi, fabs(at.g.hi) * t.error + (PAIR_ERROR + slack) * size);
}
#endif

/* The signs of the heights above a plane of the points where the lanes of `asked` meet what `index` names, at t. slack:
 * the share by which the directions of rays to lights are rounded; 0 of all other rays. */
static REAL height_signs(const Geometry geometry, const Leaving *ray, const int plane, const INT index, const REAL t,
                         const MASK asked, const real slack) {
    const real4 S = geometry.clip[2 * plane], m = geometry.clip[2 * plane + 1];
    const Real3 f = {(ray->center.x - S.x) + ray->p.x, (ray->center.y - S.y) + ray->p.y,
                     (ray->center.z - S.z) + ray->p.z};
    const REAL g = DOT(m, ray->w), size = size_of_normal(m) * ((size_of(f) + ray->reach) + fabs(t) * ray->w1);
    const REAL sign = sign_from(DOT(m, f) + t * g, T_ERROR * fabs(t * g) + (HEIGHT_ERROR + slack) * size);
#if REAL_BYTES == 8
    const MASK unsure = asked & TO_MASK(sign == 0);
    if (UNDECIDED(geometry, ANY(unsure)))
        return TO_REAL_MASK(unsure) ? fine_height_signs(geometry, ray, plane, index, slack) : sign;
#endif
    return sign;
}

/* The lanes of `asked` that meet what `index` names, at t, within the region. */
static MASK in_region(const Geometry geometry, const Leaving *ray, const INT index, const REAL t, MASK asked,
                      const real slack) {
    for (int plane = 0; plane < geometry.planes && ANY(asked); plane++)
        asked = asked & TO_MASK(height_signs(geometry, ray, plane, index, t, asked, slack) >= 0);
    return asked;
}

/* In which lanes the planes do not clip a surface; not where there is none. */
static MASK are_unclipped(const Scene *scene, const INT index) {
    if (!scene->unclipped) return 0;
    int each[W];
    STORE_LANES(index, each);
    for (int lane = 0; lane < W; lane++) each[lane] = each[lane] < 0 ? 0 : scene->solid_of[each[lane]];
    return LOAD_LANES(each) < 0;
}

/* The lanes of `asked` in which what rays meet of a surface, at t, counts. planes: of the caps that they meet, -1 for
 * none: nothing that is clipped is met before a cap, or at once. */
static MASK counts(const Scene *scene, const Leaving *ray, const INT index, const REAL t, const INT planes,
                   const MASK asked) {
    const MASK alone = asked & are_unclipped(scene, index), capped = planes >= 0;
    MASK met = alone | in_region(scene->geometry, ray, index, t, asked & !alone & !capped, 0);
    for (int plane = 0; ANY(alone & capped) && plane < scene->geometry.planes; plane++) {
        const MASK here = alone & (planes == plane);
        if (ANY(here)) met = met & !(here & TO_MASK(height_signs(scene->geometry, ray, plane, index, t, here, 0) >= 0));
    }
    return met;
}

/* How far rays that start in the region go within it, rounded up: INFINITY where they never leave it, and where some
 * surfaces are not clipped, as they may meet these. */
static REAL end_of_range(const Scene *scene, const Leaving *ray) {
    REAL end = INFINITY;
    for (int plane = 0; !scene->unclipped && plane < scene->geometry.planes; plane++) {
        const real4 S = scene->geometry.clip[2 * plane], m = scene->geometry.clip[2 * plane + 1];
        const Real3 f = {(ray->center.x - S.x) + ray->p.x, (ray->center.y - S.y) + ray->p.y,
                         (ray->center.z - S.z) + ray->p.z};
        const REAL h = DOT(m, f) + HEIGHT_ERROR * size_of_normal(m) * (size_of(f) + ray->reach);
        const REAL g = DOT(m, ray->w) + HEIGHT_ERROR * size_of_normal(m) * ray->w1, t = (h > 0 ? h : (REAL)0) / -g;
        end = ((g < 0) & (t < end)) ? t : end;
    }
    return end;
}

/* Where rays of the camera enter the region. */
typedef struct {
    MASK here; /* the lanes that do so, ahead of where they start */
    INT plane; /* by which plane */
    REAL t;
    Pair3 point; /* from the rays' center */
    REAL error;  /* of that */
} Entry;

/* The order of two planes along rays: negative where the second one is entered later, or left earlier. */
static REAL plane_order(const Height at, const Height last) {
    return sign_from(minus(times(at.h, last.g), times(last.h, at.g)).hi,
                     PAIR_ERROR * (at.h_size * last.g_size + last.h_size * at.g_size));
}

static Height chosen_height(const REAL_MASK first, const Height a, const Height b) {
    const Height c = {choose_pair(first, a.h, b.h), choose_pair(first, a.g, b.g), first ? a.h_size : b.h_size,
                      first ? a.g_size : b.g_size};
    return c;
}

static Entry entry_of(const Geometry geometry, const Leaving ray) {
    const PairRay fine = pair_ray(geometry, ray);
    Height last = height_along(geometry, ray, fine, 0);
    Entry entry = {0, -1};
    for (int plane = 0; plane < geometry.planes; plane++) {
        const Height at = height_along(geometry, ray, fine, plane);
        const REAL_MASK enters = (at.h.hi < -PAIR_ERROR * at.h_size) & (at.g.hi > PAIR_ERROR * at.g_size);
        const REAL_MASK later = enters & (!TO_REAL_MASK(entry.here) | (plane_order(at, last) < 0));
        last = chosen_height(later, at, last);
        entry.here = entry.here | TO_MASK(later);
        PUT_WHERE(TO_MASK(later), entry.plane, (INT)plane);
    }
    for (int plane = 0; plane < geometry.planes && ANY(entry.here); plane++)
        entry.here = entry.here & !TO_MASK(plane_order(height_along(geometry, ray, fine, plane), last) < 0);
    const Pair t = over(minus(pair(0, 0), last.h), last.g);
    entry.t = t.hi;
    entry.point.x = plus(fine.step.x, times(t, fine.w.x));
    entry.point.y = plus(fine.step.y, times(t, fine.w.y));
    entry.point.z = plus(fine.step.z, times(t, fine.w.z));
    const REAL t_error = (last.h_size + fabs(t.hi) * last.g_size) / fabs(last.g.hi);
    entry.error = PAIR_ERROR * (ray.reach + (fabs(t.hi) + t_error) * ray.w1);
    return entry;
}

/* What a ray of the camera meets of one surface alone. */
static Hit hit_alone(const Scene *scene, const Ray ray, const EyeLine *line, const int index, Work *work) {
    Hit hit = no_hit();
    EyeLine own = *line;
    own.found = 0;
    if (!ASK_SHAPE(scene->geometry, index, take(scene, ray, &own, index, &hit, work))) return hit;
    EACH_SHAPE(scene->geometry, hit.id, settle(scene, ray, &hit));
    hit.id = TO_MASK(hit.t < INFINITY) ? hit.id : (INT)-1;
    return hit;
}

/* Takes a surface into account where it is in the region, as meet_surface() does. Nothing that is clipped is met before
 * a cap, or at once. */
static __attribute__((noinline)) int meet_in_region(const Scene *scene, const Ray *of, const EyeLine *line,
                                                    const int index, Hit *hit, Work *work) {
    const Ray ray = *of;
    const Hit alone = hit_alone(scene, ray, line, index, work);
    MASK met = alone.id >= 0;
    if (!ANY(met) || is_over(scene)) return 0;
    const Leaving way = from_eye(scene->geometry, eye_ray(ray));
    met = counts(scene, &way, (INT)index, alone.t, hit->plane, met);
    if (!ANY(met)) return 0;
    const MASK capped = hit->plane >= 0, close = met & !capped & TO_MASK(too_close(alone.t, hit->t));
    REAL_MASK nearer = TO_REAL_MASK(met) & ((alone.t < hit->t) | TO_REAL_MASK(capped));
    if (RARELY(ANY(close))) {
        const REAL_MASK first = comes_first_of(scene, way, (INT)index, close ? hit->id : (INT)index);
        nearer = TO_REAL_MASK(close) ? first : nearer;
    }
    const MASK put = TO_MASK(nearer);
    PUT_WHERE(nearer, hit->t, alone.t);
    PUT_WHERE(put, hit->id, alone.id);
    PUT_WHERE(put, hit->plane, (INT)-1);
    PUT3(PUT_WHERE, nearer, hit->from_center, alone.from_center);
    PUT_WHERE(nearer, hit->inside, alone.inside);
    PUT_WHERE(nearer, hit->shares.EB, alone.shares.EB);
    PUT_WHERE(nearer, hit->shares.EC, alone.shares.EC);
    PUT_WHERE(nearer, hit->shares.all, alone.shares.all);
    return ANY(put);
}

/* The surfaces of the lowest numbers that contain rays' entries. Of closed meshes, bits tell which ones do, of as many
 * at a time: those of which a ray meets an odd number of triangles beyond its entry, and none there. */
#define SOLIDS_AT_ONCE 31
typedef struct {
    INT index, id;                /* a surface, -1 for none; its number */
    int first;                    /* of the meshes, bits are those from this number on */
    INT odd, on;                  /* the bits of meshes that are met an odd number of times beyond, and at the entry */
    int triangle[SOLIDS_AT_ONCE]; /* one of each of these */
} Closed;

static void add_closed(const Scene *scene, const int index, const MASK contains, Closed *closed) {
    const MASK lower = contains & ((closed->index < 0) | (scene->id_of[index] < closed->id));
    PUT_WHERE(lower, closed->index, (INT)index);
    PUT_WHERE(lower, closed->id, (INT)scene->id_of[index]);
}

/* Whether a surface is a triangle that the bits are about. */
static int is_counted(const Scene *scene, const int index, const Closed *closed) {
    const int solid = scene->solid_of[index];
    return solid > closed->first && solid <= closed->first + SOLIDS_AT_ONCE;
}

/* Takes into account that rays meet a triangle, at t. */
static void count_triangle(const Scene *scene, const Leaving *way, const Entry *entry, const int index, const REAL t,
                           MASK met, Closed *closed) {
    met = met & entry->here;
    if (!ANY(met)) return;
    const int bit = scene->solid_of[index] - 1 - closed->first;
    closed->triangle[bit] = index;
    for (int plane = 0; plane < scene->geometry.planes; plane++) {
        const MASK here = met & (entry->plane == plane);
        if (!ANY(here)) continue;
        const REAL sign = height_signs(scene->geometry, way, plane, (INT)index, t, here, 0);
        closed->odd ^= (here & TO_MASK(sign > 0)) ? (INT)(1 << bit) : (INT)0;
        closed->on |= (here & TO_MASK(sign == 0)) ? (INT)(1 << bit) : (INT)0;
    }
}

/* Adds the meshes that the bits are about, and goes on to the next ones. */
static void add_meshes(const Scene *scene, Closed *closed) {
    for (int bit = 0; bit < SOLIDS_AT_ONCE; bit++) {
        const MASK contains = ((closed->odd & ~closed->on) & (INT)(1 << bit)) != 0;
        if (ANY(contains)) add_closed(scene, closed->triangle[bit], contains, closed);
    }
    closed->odd = closed->on = 0;
    closed->first += SOLIDS_AT_ONCE;
}

/* Adds a surface if it is convex and contains the entries. */
static void add_if_convex(const Scene *scene, const Leaving *way, const Entry *entry, const int index, Closed *closed) {
    if (closed->first > 0 || scene->solid_of[index] != 0) return;
    const MASK inside = ASK_SHAPE(scene->geometry, index,
                                  contains(scene, way->center, entry->point, entry->error, index));
    add_closed(scene, index, entry->here & inside, closed);
}

/* Those of all surfaces: of rays that start on surfaces which are not clipped, and enter the region. */
static __attribute__((noinline)) Closed closed_of_all(const Scene *scene, const Leaving *way, const Entry *entry) {
    Closed closed = {-1, 0, 0, 0, 0};
    do {
        for (int index = 0; index < scene->surfaces && !is_over(scene); index++) {
            add_if_convex(scene, way, entry, index, &closed);
            if (!is_counted(scene, index, &closed)) continue;
            Encounter at = {INFINITY};
            const INT asked = entry->here ? (INT)index : (INT)-1;
            EACH_SHAPE(scene->geometry, asked, encounter(scene, *way, asked, &at));
            count_triangle(scene, way, entry, index, at.t, TO_MASK(at.t < INFINITY), &closed);
        }
        add_meshes(scene, &closed);
    } while (closed.first < scene->solids);
    return closed;
}

/* Those that the lists of a tile have: of rays of the camera. */
static Closed closed_of_tile(const Scene *scene, const Ray ray, const Leaving *way, const int2 tile,
                             const EyeLine *line, const Entry *entry, Work *work) {
    const FLOAT far = DEPTH_AT(TO_FLOAT(entry->t * scene->unit), line->a) * REACH_SLACK;
    const float last = scene->solids ? INFINITY : LARGEST_FLOAT(entry->here ? far : (FLOAT)0);
    Closed closed = {-1, 0, 0, 0, 0};
    do {
        const Grid grid = scene->lists.grid[0];
        Level level = first_level(grid);
        while (level.mask) {
            level = next_level(grid, level);
            const int cell = cell_of(level, tile), end = scene->lists.start[cell + 1];
            for (int k = scene->lists.start[cell]; k < end; k++) {
                const int2 listed = scene->lists.entry[k];
                if (as_float(listed.y) > last) break;
                add_if_convex(scene, way, entry, listed.x, &closed);
                if (!is_counted(scene, listed.x, &closed)) continue;
                const Hit alone = hit_alone(scene, ray, line, listed.x, work);
                count_triangle(scene, way, entry, listed.x, alone.t, alone.id >= 0, &closed);
            }
        }
        add_meshes(scene, &closed);
    } while (closed.first < scene->solids);
    return closed;
}

/* Puts the caps that rays of the camera meet into a hit, and tells beyond which depth no lane looks for more. */
static __attribute__((noinline)) float meet_caps(const Scene *scene, const Ray *of, const EyeLine *line,
                                                 const int2 tile, Hit *hit, Work *work) {
    const Ray ray = *of;
    const Leaving way = from_eye(scene->geometry, eye_ray(ray));
    const Entry entry = entry_of(scene->geometry, way);
    if (!ANY(entry.here)) return INFINITY;
    const Closed closed = closed_of_tile(scene, ray, &way, tile, line, &entry, work);
    const MASK cap = closed.index >= 0;
    if (!ANY(cap)) return INFINITY;
    PUT_WHERE(TO_REAL_MASK(cap), hit->t, entry.t);
    PUT_WHERE(cap, hit->id, closed.index);
    PUT_WHERE(cap, hit->plane, entry.plane);
    return end_of_lists(scene, *line, *hit);
}

/* The same of those of `live` that leave surfaces which are not clipped. */
static __attribute__((noinline)) void meet_caps_from(const Scene *scene, const Leaving *ray, const MASK live,
                                                     Met *met) {
    const MASK asked = live & are_unclipped(scene, ray->own);
    if (!ANY(asked)) return;
    Entry entry = entry_of(scene->geometry, *ray);
    entry.here = entry.here & asked;
    if (!ANY(entry.here)) return;
    const Closed closed = closed_of_all(scene, ray, &entry);
    const MASK cap = closed.index >= 0;
    PUT_WHERE(TO_REAL_MASK(cap), met->at.t, entry.t);
    PUT_WHERE(TO_REAL_MASK(cap), met->at.inside, (REAL_MASK)0);
    PUT_WHERE(cap, met->id, closed.index);
    PUT_WHERE(cap, met->plane, entry.plane);
}

/* Rays leave a cap from the point q of the world, rounded, which need not be in its plane: nothing is met there. */
#define CAP (-2)
static void leave_cap(Leaving *ray) {
    const REAL_MASK here = TO_REAL_MASK(ray->own == CAP);
    PUT3(PUT_WHERE, here, ray->center, ray->q);
    const Real3 none = {0, 0, 0};
    PUT3(PUT_WHERE, here, ray->p, none);
    PUT_WHERE(here, ray->r, (REAL)0);
    PUT_WHERE(here, ray->reach, (REAL)0);
}
#define FIRST_REACH(scene, ray, line, tile, hit, work) meet_caps(scene, &(ray), &(line), tile, hit, work)
#define FAR_END(scene, ray) end_of_range(scene, ray)
#else
#define FIRST_REACH(scene, ray, line, tile, hit, work) INFINITY
#define FAR_END(scene, ray) ((REAL)INFINITY)
#endif

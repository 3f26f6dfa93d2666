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

static real size_of_normal(const real4 m) {
    return (fabs(m.x) + fabs(m.y)) + fabs(m.z);
}

static Height height_along(const Geometry geometry, const Leaving ray, const PairRay fine, const int plane) {
    const real4 S = geometry.clip[2 * plane], m = geometry.clip[2 * plane + 1];
    const Pair3 f = plus3(pairs_between((Real3){S.x, S.y, S.z}, ray.center), fine.step);
    return (Height){dot_axis(m, f), dot_axis(m, fine.w), size_of_normal(m) * (size_of_pairs(f) + ray.reach),
                    size_of_normal(m) * ray.w1};
}

/* The same in double, without what is below that. */
static Height rough_height(const Geometry geometry, const Leaving *ray, const int plane) {
    const real4 S = geometry.clip[2 * plane], m = geometry.clip[2 * plane + 1];
    const Real3 f = sum3(difference(ray->center, (Real3){S.x, S.y, S.z}), ray->p);
    return (Height){pair(DOT(m, f), 0), pair(DOT(m, ray->w), 0), size_of_normal(m) * (size_of(f) + ray->reach),
                    size_of_normal(m) * ray->w1};
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
    const Height at = rough_height(geometry, ray, plane);
    const REAL way = t * at.g.hi,
               error = T_ERROR * fabs(way) + (HEIGHT_ERROR + slack) * (at.h_size + fabs(t) * at.g_size);
    const REAL sign = sign_from(at.h.hi + way, error);
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
        const Height at = rough_height(scene->geometry, ray, plane);
        const REAL h = at.h.hi + HEIGHT_ERROR * at.h_size, g = at.g.hi + HEIGHT_ERROR * at.g_size;
        const REAL t = (h > 0 ? h : (REAL)0) / -g;
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
    return (Height){choose_pair(first, a.h, b.h), choose_pair(first, a.g, b.g), first ? a.h_size : b.h_size,
                    first ? a.g_size : b.g_size};
}

/* From the rays' center to where they meet a plane, t there. */
static Pair3 point_on_plane(const PairRay fine, const Height at, Pair *t) {
    *t = over(minus(pair(0, 0), at.h), at.g);
    return plus3(fine.step, times3(*t, fine.w));
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
    Pair t;
    entry.point = point_on_plane(fine, last, &t);
    entry.t = t.hi;
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
    put_shares(nearer, alone.shares, &hit->shares);
    return ANY(put);
}

/* The surfaces of the lowest numbers that contain rays' entries. First the convex ones are looked at, then the closed
 * meshes one by one: such a mesh does if a ray meets an odd number of its triangles beyond its entry, and none there.
 */
typedef struct {
    INT index, id;   /* a surface, -1 for none; its number */
    int solid, next; /* which mesh is looked at, of Scene's solid_of, 0 for what is convex; and the next one there is */
    int triangle;    /* one of it */
    MASK odd, touches; /* whether rays meet an odd number beyond their entries, and any at these */
} Closed;

static void add_closed(const Scene *scene, const int index, const MASK contains, Closed *closed) {
    const MASK lower = contains & ((closed->index < 0) | (scene->id_of[index] < closed->id));
    PUT_WHERE(lower, closed->index, (INT)index);
    PUT_WHERE(lower, closed->id, (INT)scene->id_of[index]);
}

/* Takes into account that rays meet a triangle, at t. */
static void count_triangle(const Scene *scene, const Leaving *way, const Entry *entry, const int index, const REAL t,
                           MASK met, Closed *closed) {
    met = met & entry->here;
    for (int plane = 0; ANY(met) && plane < scene->geometry.planes; plane++) {
        const MASK here = met & (entry->plane == plane);
        if (!ANY(here)) continue;
        const REAL sign = height_signs(scene->geometry, way, plane, (INT)index, t, here, 0);
        closed->odd ^= here & TO_MASK(sign > 0);
        closed->touches |= here & TO_MASK(sign == 0);
    }
}

/* Whether a surface is a triangle of the mesh that is looked at. What is convex is added if it contains the entries. */
static int is_counted(const Scene *scene, const Leaving *way, const Entry *entry, const int index, Closed *closed) {
    const int solid = scene->solid_of[index];
    if (solid > closed->solid) closed->next = min(closed->next, solid);
    if (solid != closed->solid) return 0;
    closed->triangle = index;
    if (solid > 0) return 1;
    const MASK inside = ASK_SHAPE(scene->geometry, index,
                                  contains(scene, way->center, entry->point, entry->error, index));
    add_closed(scene, index, entry->here & inside, closed);
    return 0;
}

/* Adds the mesh that is looked at, and goes on to the next one. Whether there is one. */
static int goes_on(const Scene *scene, Closed *closed) {
    if (closed->solid > 0) add_closed(scene, closed->triangle, closed->odd & !closed->touches, closed);
    closed->solid = closed->next;
    closed->next = INT_MAX;
    closed->odd = closed->touches = 0;
    return closed->solid < INT_MAX;
}

/* Those of all surfaces: of rays that start on surfaces which are not clipped, and enter the region. */
static __attribute__((noinline)) Closed closed_of_all(const Scene *scene, const Leaving *way, const Entry *entry) {
    Closed closed = {-1, 0, 0, INT_MAX, 0, 0, 0};
    do {
        for (int index = 0; index < scene->surfaces && !is_over(scene); index++) {
            if (!is_counted(scene, way, entry, index, &closed)) continue;
            Encounter at = {INFINITY};
            const INT asked = entry->here ? (INT)index : (INT)-1;
            EACH_SHAPE(scene->geometry, asked, encounter(scene, *way, asked, &at));
            count_triangle(scene, way, entry, index, at.t, TO_MASK(at.t < INFINITY), &closed);
        }
    } while (goes_on(scene, &closed));
    return closed;
}

/* Those that the lists of a tile have: of rays of the camera. */
static Closed closed_of_tile(const Scene *scene, const Ray ray, const Leaving *way, const int2 tile,
                             const EyeLine *line, const Entry *entry, Work *work) {
    const FLOAT far = DEPTH_AT(TO_FLOAT(entry->t * scene->unit), line->a) * REACH_SLACK;
    const float last = scene->solids ? INFINITY : LARGEST_FLOAT(entry->here ? far : (FLOAT)0);
    Closed closed = {-1, 0, 0, INT_MAX, 0, 0, 0};
    do {
        const Grid grid = scene->lists.grid[0];
        Level level = first_level(grid);
        while (level.mask) {
            level = next_level(grid, level);
            const int cell = cell_of(level, tile), end = scene->lists.start[cell + 1];
            for (int k = scene->lists.start[cell]; k < end; k++) {
                const int2 listed = scene->lists.entry[k];
                if (as_float(listed.y) > last) break;
                if (!is_counted(scene, way, entry, listed.x, &closed)) continue;
                const Hit alone = hit_alone(scene, ray, line, listed.x, work);
                count_triangle(scene, way, entry, listed.x, alone.t, alone.id >= 0, &closed);
            }
        }
    } while (goes_on(scene, &closed));
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

#define FIRST_REACH(scene, ray, line, tile, hit, work) meet_caps(scene, &(ray), &(line), tile, hit, work)
#define FAR_END(scene, ray) end_of_range(scene, ray)
#else
#define FIRST_REACH(scene, ray, line, tile, hit, work) INFINITY
#define FAR_END(scene, ray) ((REAL)INFINITY)
#endif

/* dispatch.cl: what is asked of a surface, whatever its shape is.
 *
 * A shape is a row of SHAPES in cltrace/plan/abi.py and a folder beside this file, with these functions; here are those
 * who ask them, but for shade/points.cl, and what asks for shadows, fetches lists and walks the tree in find/.
 *   take        takes it into account along rays from the eye: first by a filter in float32, then for certain
 *   touches     which pixels it may be seen in, see samples.cl
 *   contains    whether it is convex, and rays enter the region of clipping planes inside of it
 *   settle      puts into a hit what is not known of late shapes before
 *   settle_t    the same of t alone
 *   shadow      which lanes' shadow rays it stops
 *   put, put_from  normals, textures and starts of rays at points of it
 *   leave       where rays leave it; fine_start: the same in pairs
 *   encounter   where rays that left a surface meet it; fine_t: t there, in pairs
 *   fetch, fetch_leaf  what is to be read of it soon
 *   add_leaf, add_leaf_for_packet  those of a leaf of the tree that rays may meet
 */

/* The number of each lane's triangle in its mesh; -1 of all else. */
static INT primitives_of(const Scene *scene, const INT index) {
    int each[W];
    STORE_LANES(index, each);
    for (int lane = 0; lane < W; lane++) {
        const int number = each[lane] - FIRST_TRIANGLE(scene->geometry);
        each[lane] = HAS(WITH_TRIANGLES) && number >= 0 ? scene->number_of[number] : -1;
    }
    return LOAD_LANES(each);
}

static MASK first_in_file(const Scene *scene, const INT A, const INT B) {
    const INT a = ids_of(scene, A), b = ids_of(scene, B);
    return (a < b) | ((a == b) & (primitives_of(scene, A) < primitives_of(scene, B)));
}

#ifdef WITH_PLANES
static int meet_in_region(const Scene *scene, const Ray *ray, const EyeLine *line, const int index, Hit *hit,
                          Work *work);
#define meet_surface(scene, ray, line, index, hit, work) meet_in_region(scene, &(ray), line, index, hit, work)
#define settle_hit(scene, ray, hit)
#else
/* Takes a surface into account, and tells whether any lane's hit may be another one now. */
static __attribute__((always_inline)) int meet_surface(const Scene *scene, const Ray ray, EyeLine *line,
                                                       const int index, Hit *hit, Work *work) {
    return ASK_SHAPE(scene->geometry, index, take(scene, ray, line, index, hit, work));
}

/* Puts into a hit what its shape tells late. */
static __attribute__((always_inline)) void settle_hit(const Scene *scene, const Ray ray, Hit *hit) {
    EACH_SHAPE(scene->geometry, hit->id, settle(scene, ray, hit));
}
#endif

#ifdef WITH_PLACED
/* Puts where shadow rays start in the world into starts on triangles; those of other shapes know it. */
static void place_start(const Geometry geometry, Start *start) {
    OF_TRIANGLES(if (ANY(IS_TRIANGLE(geometry, start->index))) triangle_place(geometry, start);)
}
#endif

#ifdef WITH_LEAVING
#if REAL_BYTES == 8
static Pair3 fine_start(const Geometry geometry, const Leaving ray) {
    if (HAS(WITH_RAYS)) return (Pair3){pair(ray.p.x, ray.q.x), pair(ray.p.y, ray.q.y), pair(ray.p.z, ray.q.z)};
    const Pair3 none = pairs_of((Real3){0, 0, 0});
    Pair3 step = none;
    EACH_SHAPE(geometry, ray.own, fine_start(geometry, ray, &step));
    const MASK eye = ray.own < 0;
    if (!HAS(WITH_SHAPES) || !ANY(eye)) return step;
    Pair3 from = none;
    if (HAS(WITH_PARALLEL_RAYS))
        from = choose_pairs(TO_REAL_MASK(ray.own == -1), pairs_in_world(geometry, ray.q), from);
    return choose_pairs(TO_REAL_MASK(eye), from, step);
}

/* t of rays that meet what they name, in pairs, and a bound of what it is off by. */
static __attribute__((noinline)) FineT fine_t_of(const Geometry geometry, const Leaving ray, const INT index) {
    FineT t = {pair(0, 0), 0};
    EACH_SHAPE(geometry, index, fine_t(geometry, ray, index, &t));
    return t;
}
#endif

/* Which of the lanes' rays, which meet both surfaces, meet A before B; where they are met at once, the one that comes
 * first in the scene file, unless planes of triangles break the tie. Lanes that do not ask have A twice. */
static __attribute__((noinline)) REAL_MASK comes_first_of(const Scene *scene, const Leaving ray, const INT A,
                                                          const INT B) {
    REAL_MASK first = TO_REAL_MASK(first_in_file(scene, A, B));
    if (is_over(scene)) return first;
#if REAL_BYTES == 8
    REAL_MASK open = TO_REAL_MASK(A != B);
    OF_TRIANGLES(open = open & !TO_REAL_MASK(known_in_one_plane(scene->geometry, A, B));)
    if (!UNDECIDED(scene->geometry, ANY(TO_MASK(open)))) return first;
    const FineT t = fine_t_of(scene->geometry, ray, A), other = fine_t_of(scene->geometry, ray, B);
    const REAL gap = (t.t.hi - other.t.hi) + (t.t.lo - other.t.lo), error = t.error + other.error;
    REAL_MASK close = open & (gap >= -error) & (gap <= error);
    OF_TRIANGLES(triangle_break_tie(scene->geometry, ray, A, B, &close, &first);)
    if (HAS(WITH_RAYS) && ANY(TO_MASK(close))) mark_undecided(scene->geometry);
    first = open ? (gap < -error) | (!(gap > error) & first) : first;
#endif
    return first;
}

static __attribute__((noinline)) REAL_MASK comes_before(const Scene *scene, const EyeRay *ray, const REAL t,
                                                        const INT index, const Rival *hit) {
    REAL rival = hit->t;
    EACH_SHAPE(scene->geometry, hit->id, settle_t(scene, *ray, *hit, &rival));
    const REAL_MASK close = too_close(t, rival);
    if (!ANY(TO_MASK(close))) return t < rival;
    const INT other = TO_MASK(close) ? hit->id : index;
    return close ? comes_first_of(scene, from_eye(scene->geometry, *ray), index, other) : t < rival;
}

/* A ray that leaves a surface, in camera space along d. inner, n, q: as in Leaving. */
static Leaving leaving(const Frame frame, const Geometry geometry, const INT own, const REAL_MASK inner, const Real3 n,
                       const Real3 q, const Real3 d) {
    Leaving ray = {own, inner, n, d};
    if (HAS(WITH_SHAPES)) ray.q = q;
    ray.w = turned_to_world(frame, d);
    ray.w1 = size_of(ray.w);
    EACH_SHAPE(geometry, own, leave(frame, geometry, &ray));
    if (HAS(WITH_PLANES)) leave_place(TO_REAL_MASK(own == CAP), (Place3){q, {0, 0, 0}, 0}, &ray);
    return ray;
}

/* Where a ray that left a surface has met another one, rounded, in camera space. */
static Real3 point_from(const Frame frame, const Scene *scene, const Leaving ray, const Met met) {
    const real4 eye = scene->geometry.eye;
    const Real3 from = difference(ray.center, (Real3){eye.x, eye.y, eye.z});
    return turned_to_camera(frame, sum3(from, sum3(ray.p, scaled(ray.w, met.at.t))));
}
#endif

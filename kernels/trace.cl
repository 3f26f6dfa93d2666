/* trace.cl: from a ray to its colour, as in the course's tutorial. cltrace/reference/trace.py has the same functions in
 * the same order. The scene is passed by a pointer, and all else that functions of a packet need as it is: a struct
 * around ray, hit and counters is copied by compilers where the parts are not. */

/* The rays through the centres of the packet's pixels; row 0 is the top. size: of the whole picture. */
static Ray primary_ray(const Frame frame, const int2 size, const INT column, const INT row) {
    Ray ray;
    const REAL x = TO_REAL(2 * column + 1 - size.x) * frame.pixel.x, y = TO_REAL(size.y - 1 - 2 * row) * frame.pixel.y;
    ray.d.z = -1;
    if (HAS(WITH_PARALLEL_RAYS)) {
        ray.o.x = x;
        ray.o.y = y;
        ray.o.z = ray.d.x = ray.d.y = 0;
        ray.a = ray.over_a = 1;
        ray.reach = fabs(x) + fabs(y);
    } else {
        ray.d.x = x;
        ray.d.y = y;
        ray.a = (x * x + y * y) + 1;
        ray.over_a = 1 / ray.a;
    }
    return ray;
}

/* The nearest surface along the ray; of equally near ones, the first in the scene file. tile: see trace(). */
static Hit closest_hit(const Scene *scene, const Ray ray, const int2 tile, Work *work) {
    Hit hit = no_hit();
    EyeLine line = eye_line(scene, ray);
    float reach = FIRST_REACH(scene, ray, line, tile, &hit,
                              work); /* nothing matters of which the nearest point is beyond, squared */
    const Grid grid = scene->lists.grid[0];
    Level level = first_level(grid);
    while (level.mask) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile), end = scene->lists.start[cell + 1];
        /* Of the next tile: its list is the next one. */
        fetch_ahead(scene, -1, end);
        for (int k = scene->lists.start[cell]; k < end; k++) {
            const int2 entry = scene->lists.entry[k];
            if (as_float(entry.y) > reach) break;
            fetch_entry(scene, -1, k + AHEAD);
            if (meet_surface(scene, ray, &line, entry.x, &hit, work)) reach = end_of_lists(scene, line, hit);
        }
    }
    settle_hit(scene, ray, &hit);
    return hit;
}

/* Normal and material of each lane's hit. */
static Intersection intersection_at(const Frame frame, const Scene *scene, const Ray ray, const Hit hit) {
    Intersection at = material_at(scene, hit.id);
    put_surfaces(frame, scene, ray, hit, &at);
    return at;
}

/* The lanes of `lit` in which nothing stops the light. rays: how many each lane has sent, counted up. */
static MASK cast_shadow_ray(const Scene *scene, const ShadowRay ray, const Start start, const MASK lit, INT *rays,
                            Work *work) {
    *rays += lit ? (INT)1 : (INT)0;
    const MASK unsure = lit & may_be_stopped(scene, ray.number, ray.own);
    COUNT(SHADOW_RAYS, unsure);
    COUNT(UNSTOPPABLE, lit & !unsure);
    if (!ANY(unsure)) return lit;
    const MASK left = (lit & !unsure) | lit_after_all(scene, ray, start, unsure, work);
    return HAS(WITH_PLANES) ? left & !stopped_by_caps(scene, &ray, &start, left) : left;
}

/* Adds what one light does to the colours of points, where it shines and nothing stands between. number: the light's
 * index in the buffers; own: index of the surface that was hit. */
static void illuminate(const Scene *scene, const int number, const Intersection at, const INT own, Lighting *lighting,
                       Work *work) {
    const Light light = scene->light[number];
    const int kind = kind_of(light);
    const Direction direction = direction_to(light, kind, at.normal, at.start);
    MASK lit = at.hit & TO_MASK(at.start.side * direction.cosine > 0);
    lit = lit & reaches(light, kind, direction.w) & !at.black;
    COUNT(FACING_AWAY, at.hit & !lit);
    if (!ANY(lit)) return;
    const ShadowRay ray = shadow_ray_to(scene, number, is_at_point(kind), direction.w, own);
    lit = cast_shadow_ray(scene, ray, at.start, lit, &lighting->rays, work);
    if (!ANY(lit)) return;
    MARK(mark, lit, own, ~number);
    const Shade3 l = unit_to(ray, lit);
    phong(light, strength_of(light, kind, l), l, at, lit, lighting, work);
}

/* The colour of each ray that hit. d: the rays' directions, a: d.d; own: index of the sphere that was hit; rays: each
 * lane's shadow rays, counted up. */
static Shade3 shade(const Scene *scene, const Real3 d, const REAL a, const Intersection at, const INT own, INT *rays,
                    Work *work) {
    const SHADE over = 1 / sqrt(TO_SHADE(a));
    const INT left = HAS(WITH_PLANES) ? at.start.index : own;
    Lighting lighting = {{TO_SHADE(d.x) * over, TO_SHADE(d.y) * over, TO_SHADE(d.z) * over}, at.ambient, *rays};
    for (int number = 0; number < scene->lights; number++) illuminate(scene, number, at, left, &lighting, work);
    *rays = lighting.rays;
    return lighting.color;
}

/* The same with all that mirrors and glass add to it. */
static Shade3 follow(const Frame frame, const Scene *scene, const Ray ray, const Intersection at, const INT own,
                     Pixels *pixels, Work *work) {
#ifdef WITH_BOUNCES
    return color_with_branches(frame, scene, ray, at, own, pixels, work);
#else
    return shade(scene, ray.d, ray.a, at, own, &pixels->rays, work);
#endif
}

/* What a packet of rays sees; lanes that hit nothing keep what they have in `pixels`, which other lights may have made.
 * tile: the packet's place in the picture, in units of TILE x TILE pixels. */
static Pixels trace(const Frame frame, const Scene *scene, const Ray ray, const int2 tile, Pixels pixels, Work *work) {
    const Hit hit = pixels.hit = closest_hit(scene, ray, tile, work);
    if (!(HAS_COLORS(scene) || EXTRA(scene, shown)) || !ANY(hit.id >= 0)) return pixels;
    Intersection at = intersection_at(frame, scene, ray, hit);
    if (EXTRA(scene, started)) at.ambient = pixels.color;
    if (HAS_COLORS(scene)) show_colors(at.hit, follow(frame, scene, ray, at, hit.id, &pixels, work), &pixels);
    if (EXTRA(scene, shown)) show_points(frame, at, &pixels);
    return pixels;
}

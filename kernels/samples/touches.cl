/* touches.cl: which pixels a surface may be seen in, from any place of them, in float32. A surface that is only near a
 * pixel may be named, too, but none that is in it is missed. */
#ifdef WITH_SAMPLES
/* Half of a pixel's width and height, and of its diagonal, where float32 knows rays: on the image plane z = -1, or of
 * parallel rays, in the float buffers' unit. */
typedef struct {
    float x, y, diagonal;
} Margins;

static Margins margins_of(const Frame frame, const Scene *scene) {
    const real unit = HAS(WITH_PARALLEL_RAYS) ? scene->unit : (real)1;
    const float x = (float)(frame.pixel.x * unit), y = (float)(frame.pixel.y * unit);
    const Margins margins = {x, y, sqrt(x * x + y * y) * (1 + 0x1p-20f)};
    return margins;
}

/* The middle rays of pixels, and of what these show the surface's number in the scene file, and t at the corners:
 * within near .. far, in the float buffers' unit. doubtful: where colours alone tell that the corners are not enough.
 */
typedef struct {
    Ray ray;
    EyeLine line;
    Margins margins;
    INT object;
    FLOAT near, far;
    MASK doubtful;
} Outlook;

/* Which of the pixels a sphere may be seen in.
 *
 * Let w be the middle's ray, w + e another one of the pixel, and e no longer than the diagonal h. If that meets the
 * sphere from outside, it does so first at s (w + e), within r of the centre and no further away than where tangents
 * touch the sphere, L. Then s <= L, as rays are no shorter than 1, and s w is within r + L h of the centre. So the line
 * along w meets a sphere that is so large, which small_sphere_may_meet() decides. The radius of an ellipsoid's sphere
 * is in its filter constant, and L is less than the way to its centre. Parallel rays are no further than h from each
 * other, and places on their plane are rounded by 2^-24 of 1 at most, twice each. */
static MASK sphere_is_near(const Scene *scene, const Outlook view, const int index) {
    const float4 s = scene->eye_filter[index];
    const FLOAT x = view.line.x, y = view.line.y;
    const float h = view.margins.diagonal * (1 + 0x1p-20f);
    if (HAS(WITH_PARALLEL_RAYS)) {
        const float r = (sqrt(s.z) + h) * (1 + 0x1p-20f) + 0x1p-21f;
        return FMA(s.x - x, s.x - x, (s.y - y) * (s.y - y)) <= r * r;
    }
    const int stretched = HAS(WITH_ELLIPSOIDS) && scene->spheres.map_of[index];
    const real unit = scene->unit;
    const float square = (s.x * s.x + s.y * s.y) + s.z * s.z;
    const float power = stretched ? square : (float)(scene->spheres.power[index].x * unit * unit);
    const float r = stretched ? sqrt(square - s.w) : (float)(scene->spheres.center_radius[index].w * unit);
    if (power <= 0) return ALL_LANES;
    const Float3 w = {x, y, -1};
    return small_sphere_may_meet(w, view.line.a, s, r + sqrt(power) * h);
}

/* In which pixels a sphere is behind what they show, and nowhere before it. Where the middle's ray meets it from
 * outside, all of it is behind the tangent plane there: with the normal n, of any length, other rays w + e meet that at
 * t n.w / (n.w + n.e), parallel ones at t - n.e / n.w. */
static MASK sphere_is_behind(const Scene *scene, const Outlook view, const int index) {
    if (HAS(WITH_ELLIPSOIDS) && scene->spheres.map_of[index]) return 0;
    const Meeting at = sphere_meet(scene->spheres, view.ray, sphere_at(scene->spheres, index));
    const FLOAT t = TO_FLOAT(at.t * scene->unit) * (1 - 0x1p-20f);
    const Float3 n = {TO_FLOAT(at.from_center.x), TO_FLOAT(at.from_center.y), TO_FLOAT(at.from_center.z)};
    const FLOAT across = TO_FLOAT(-DOT(at.from_center, view.ray.d)),
                room = (fabs(n.x) * view.margins.x + fabs(n.y) * view.margins.y) * (1 + 0x1p-20f);
    const FLOAT least = HAS(WITH_PARALLEL_RAYS) ? t - room / across : t * (across / (across + room));
    return TO_MASK(at.t < INFINITY) & (across > 0) & (least > view.far);
}

/* Which of the pixels that are asked for a sphere may be seen in, before what they show. */
static MASK sphere_touches(const Scene *scene, const Outlook view, const int index, MASK asked) {
    asked = asked & (view.object != (HAS(WITH_TRIANGLES) ? scene->id_of[index] : index));
    if (ANY(asked)) asked = asked & sphere_is_near(scene, view, index);
    return ANY(asked) ? asked & !sphere_is_behind(scene, view, index) : asked;
}

#ifdef WITH_TRIANGLES
/* The same of a triangle.
 *
 * The planes of its edges are linear functions of the place, off by less than 1: see sides_of(). None of them is
 * negative in all of a pixel that the triangle touches. What tells how near its own plane is is a linear function, too.
 * Triangles of the mesh that the pixel shows are no other surface where their planes, all over the pixel, have the
 * depths of its corners, or are no further from these than they are from each other. */
static MASK triangle_touches(const Scene *scene, const Outlook view, const int index, const MASK asked) {
    __global const float4 *facet = scene->facet + 3 * (long)(index - FIRST_TRIANGLE(scene->spheres));
    const float h = view.margins.x * (1 + 0x1p-20f), k = view.margins.y * (1 + 0x1p-20f);
    MASK near = asked;
    for (int i = 0; i < 3; i++) {
        const float4 edge = facet[i];
        const FLOAT side = FMA(view.line.x, (FLOAT)edge.x,
                               FMA(view.line.y, (FLOAT)edge.y, (FLOAT)(HAS(WITH_PARALLEL_RAYS) ? edge.z : -edge.z)));
        near = near & !(side + (fabs(edge.x) * h + fabs(edge.y) * k) < -1);
    }
    const FLOAT low = HAS(WITH_PARALLEL_RAYS) ? -view.far : 1 / view.far,
                high = HAS(WITH_PARALLEL_RAYS) ? -view.near : 1 / view.near;
    const FLOAT more = (high - low) + 0x1p-18f * fabs(high);
    const float room = (fabs(facet[0].w) * view.margins.x + fabs(facet[1].w) * view.margins.y) * (1 + 0x1p-20f);
    const Bounds plane = near_plane(view.line.x, view.line.y, facet);
    const MASK same = scene->id_of[index] == view.object;
    /* What is unknown is a NaN, see Bounds. */
    const MASK strays = !(same & (plane.high + room <= high + more) & (plane.low - room >= low - more));
    return near & strays & !(plane.high + room < low - 0x1p-18f * fabs(low));
}
#endif

/* Which of the pixels that are `asked` may show another surface than that of which the rays through their corners have
 * all met one: its number in the scene file is `object`, and -1 stands for none.
 *
 * near, far: t at the corners. The surface itself is no further away in between: a sphere is seen from outside,
 * and then 1/t is a concave function of the place, or of parallel rays -t. */
static MASK may_show_another(const Scene *scene, const int2 tile, const Outlook view, const MASK asked) {
    const FLOAT corner = sqrt(view.line.a) + view.margins.diagonal, most = DEPTH_AT(view.far, corner * corner);
    const FLOAT depth = most * REACH_SLACK;
    const float last = LARGEST_FLOAT(asked ? depth : (FLOAT)0);
    const Grid grid = scene->lists.grid[0];
    Level level = first_level(grid);
    MASK found = 0;
    while (level.mask && ANY(asked & !found)) {
        level = next_level(grid, level);
        const int cell = cell_of(level, tile), end = scene->lists.start[cell + 1];
        for (int k = scene->lists.start[cell]; k < end; k++) {
            const int2 entry = scene->lists.entry[k];
            if (as_float(entry.y) > last) break;
            const MASK other = asked & !found & (depth >= as_float(entry.y));
            if (ANY(other)) found = found | ASK_SHAPE(scene->spheres, entry.x, touches(scene, view, entry.x, other));
        }
    }
    return asked & found;
}
#endif

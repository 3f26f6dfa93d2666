/* patch.cl: the part of a surface that a cell shows, and the light on it. */
#ifdef WITH_AVERAGE
#ifdef WITH_LIGHTS
#ifdef WITH_SHADOWS
/* What centres are off by, of themselves. */
#if REAL_BYTES == 8
#define CENTER_ROUNDING 0x1p-50
#else
#define CENTER_ROUNDING 0x1p-21f
#endif

/* What is known of the light's way to a patch. */
typedef struct {
    Share blocked; /* the share of the points that the light does not reach, but for */
    INT only;      /* a surface of which that is counted, -1 for none */
    /* what these are: the light's way is free of them where the model is positive. by: which surfaces, -1 for none */
    Model free[2];
    INT by[2];
#ifdef WITH_TRIANGLES
    MASK sure,
        leaky; /* whether a mesh surely stops the light somewhere, and whether a rim of one may be before the light */
    FLOAT off; /* the share of the cell in which lines tell it wrongly, within the window of what is seen */
#endif
} Blocking;

static void block(Blocking *blocking, const int index, const MASK here, const Share share) {
    const MASK again = (blocking->only == index);
    const FLOAT least = here ? share.least : (FLOAT)0, more = (here & !again) ? share.most : (FLOAT)0;
    blocking->blocked.least = least > blocking->blocked.least ? least : blocking->blocked.least;
    const FLOAT most = blocking->blocked.most + more;
    blocking->blocked.most = most < 1 ? most : (FLOAT)1;
    blocking->only = (here & (share.most > 0)) ? (INT)index : blocking->only;
}

/* What leads from camera space to the axes of a surface, as in quadrics.cl: K, divided by the sum of its numbers'
 * magnitudes. Nothing becomes longer on the way, and what its numbers are off by is less than a rounding of the vector
 * that is taken there. */
typedef struct {
    float over;
#ifdef WITH_ELLIPSOIDS
    int stretched;
    float3 x, y, z;
#endif
} OwnAxes;

#ifdef WITH_ELLIPSOIDS
static FLOAT dot_row(const float3 row, const Float3 v) {
    return (row.x * v.x + row.y * v.y) + row.z * v.z;
}

/* Rounding the row moves a number by less than 2^-24 of the vector's. */
static Model model_along(const float3 row, const Model3 v) {
    Model m = plus_model(plus_model(scaled(v.x, row.x), scaled(v.y, row.y)), scaled(v.z, row.z));
    m.r += 0x1p-23f *
           ((fabs(v.x.v) + radius_of(v.x)) + (fabs(v.y.v) + radius_of(v.y)) + (fabs(v.z.v) + radius_of(v.z)));
    return m;
}

static OwnAxes own_axes(const Scene scene, const int index) {
    OwnAxes axes = {1, scene.spheres.map_of[index] != 0, 0, 0, 0};
    if (!axes.stretched) return axes;
    __global const Map *K = scene.spheres.map + scene.spheres.map_of[index];
    const real over = 1 / K->to_x.w;
    axes.over = over;
    axes.x = convert_float4(over * K->camera_x).xyz;
    axes.y = convert_float4(over * K->camera_y).xyz;
    axes.z = convert_float4(over * K->camera_z).xyz;
    return axes;
}

static int is_round(const OwnAxes axes) {
    return !axes.stretched;
}

static Float3 along_axes(const OwnAxes axes, const Float3 v) {
    if (!axes.stretched) return v;
    const Float3 own = {dot_row(axes.x, v), dot_row(axes.y, v), dot_row(axes.z, v)};
    return own;
}

static Model3 models_along(const OwnAxes axes, const Model3 v) {
    if (!axes.stretched) return v;
    const Model3 own = {model_along(axes.x, v), model_along(axes.y, v), model_along(axes.z, v)};
    return own;
}
#else
static OwnAxes own_axes(const Scene scene, const int index) {
    const OwnAxes axes = {1};
    return axes;
}

#define is_round(axes) 1
#define along_axes(axes, v) v
#define models_along(axes, v) v
#endif

/* Notes that a surface blocks the light where a model is positive. Returns the lanes in which that is not told
 * otherwise. */
static MASK block_where(Blocking *blocking, const int index, const MASK here, const Model shadow) {
    const FLOAT r = shadow.r + fabs(shadow.z);
    const Model free = {-shadow.v, -shadow.x, -shadow.y, r, 0};
    const MASK again = here & ((blocking->by[0] == index) | (blocking->by[1] == index));
    MASK left = here & !again & (r < fabs(shadow.x) + fabs(shadow.y));
    for (int k = 0; k < 2; k++) {
        const MASK put = left & (blocking->by[k] < 0);
        blocking->free[k] = choose_model(put, free, blocking->free[k]);
        blocking->by[k] = put ? (INT)index : blocking->by[k];
        left = left & !put;
    }
    return again | (blocking->by[0] == index) | (blocking->by[1] == index);
}

#if REAL_BYTES == 8
/* Whether a sphere surely is clear of the ways to the light, which lead away from it: the one from the patch's middle
 * is nearest to C where it begins, then. Of a large sphere, such as the ground, the roundings of floats are larger than
 * a patch, so this is in double; less than 16 of its roundings are 2^-46 of the coordinates. w is off by no more than
 * its radius. */
static MASK leads_away(const Real3 C, const REAL r, const Area *patch, const Model3 w) {
    const Real3 f = {(C.x - patch->anchor.x) - TO_REAL(patch->p.x.v), (C.y - patch->anchor.y) - TO_REAL(patch->p.y.v),
                     (C.z - patch->anchor.z) - TO_REAL(patch->p.z.v)};
    const Real3 to_light = {TO_REAL(w.x.v), TO_REAL(w.y.v), TO_REAL(w.z.v)};
    const Real3 A = patch->anchor;
    const REAL size = (fabs(C.x) + fabs(C.y) + fabs(C.z)) + (fabs(A.x) + fabs(A.y) + fabs(A.z)) + r;
    const REAL far = fabs(to_light.x) + fabs(to_light.y) + fabs(to_light.z),
               off = TO_REAL(radius_of(w.x) + radius_of(w.y) + radius_of(w.z));
    const REAL cosine = DOT(f, to_light) + 2 * off * size + 0x1p-46 * size * far;
    const FLOAT gap = TO_FLOAT(sqrt(DOT(f, f)) - r - 0x1p-46 * size);
    return TO_MASK(cosine < 0) & (gap > patch->radius * (1 + 4 * ROUNDING));
}
#endif
/* Whether the eye, or all that parallel rays start at, surely is outside of a sphere. */
static int eye_is_outside(const Scene scene, const int index) {
#ifdef WITH_ELLIPSOIDS
    if (scene.spheres.map_of[index] != 0) return 0;
#endif
#ifdef WITH_PARALLEL_RAYS
    const real4 s = scene.spheres.center_radius[index];
    return s.z + s.w < 0;
#else
    return scene.spheres.power[index].x > 0;
#endif
}

/* What is positive where the way w from a point to a light goes through a sphere: r |w| - |X|, with X = f x w and f
 * from the point to the centre. Since f - w is s, the same for all points, X is s x w, or s x f, which is linear in the
 * place; of parallel light, where w is constant, s is -w. Let e be the unit vector along X in the middle. With X' for
 * what X has across e,
 *
 *     e.X <= |X| <= e.X + X'.X' / (2 e.X),   e.X = (e x s).w
 *
 * and |X'| is at most |s| times what points are apart from the middle, `far`. s is off by s_off, and 2^-23 of itself, e
 * by 2^-20 in length and in direction, and e x s by 2^-21 |s|. shorter: whether f is shorter than w, or w is constant.
 */
static Model shadow_of(const Model3 f, const Model3 w, const Model a, const MASK shorter, const Float3 s,
                       const FLOAT s_off, const FLOAT r, const FLOAT far) {
    const Model3 g = choose_vector(shorter, f, w);
    const Float3 X = {s.y * g.z.v - s.z * g.y.v, s.z * g.x.v - s.x * g.z.v, s.x * g.y.v - s.y * g.x.v};
    const FLOAT size = sqrt(DOT(X, X)), over = 1 / size, s_size = sqrt(DOT(s, s));
    const FLOAT rounding = (ROUNDING * s_size + s_off) * (fabs(g.x.v) + fabs(g.y.v) + fabs(g.z.v));
    const Float3 e = {over * X.x, over * X.y, over * X.z};
    const FLOAT off = 0x1p-21f * s_size;
    const Model3 across = {{e.y * s.z - e.z * s.y, 0, 0, off, 0},
                           {e.z * s.x - e.x * s.z, 0, 0, off, 0},
                           {e.x * s.y - e.y * s.x, 0, 0, off, 0}};
    const FLOAT aside = s_size * far + 2 * rounding, least = size - aside, bow = (FLOAT)0.25f * aside * aside / least;
    Model m = minus_model(scaled(root_of(a), r), dot_constant(g, across));
    m.v -= bow;
    m.r += bow * (1 + ROUNDING) + 2 * rounding + ROUNDING * size;
    m.r = least > 0 ? m.r : (FLOAT)INFINITY;
    return m;
}

/* Whether a light at infinity or at a point is cut off by a sphere from points P of the patch: with f = C - P, w from P
 * to the light and X = f x w, where D = w.w r^2 - X.X > 0, if both ends of the way are outside of the sphere and the
 * point of the way that is nearest to C lies between them, 0 < f.w < w.w. w: from the patch's points. Where f.w < 0 and
 * P is outside, so is the way. What the eye sees from outside of a sphere is outside of it, and what the patch has else
 * is in no window.
 *
 * The way from a point P' that is no further than `radius` from P is nowhere further than that from the way from P. So
 * what the distance of C from that way says of P', it says of all of the patch, but for `radius`. */
static void block_by_sphere(const Scene scene, const int number, const int kind, const Area *patch, const Model3 w,
                            const int index, const MASK may, Blocking *blocking) {
    const real4 s = scene.spheres.center_radius[index];
    const int light_side = scene.light_side[(long)number * scene.count + index],
              seen_from_outside = eye_is_outside(scene, index);
    const Real3 C = {scene.unit * s.x, scene.unit * s.y, scene.unit * s.z};
    /* From the anchor to C. */
    const Float3 g = {TO_FLOAT(C.x - patch->anchor.x), TO_FLOAT(C.y - patch->anchor.y),
                      TO_FLOAT(C.z - patch->anchor.z)};
    const Float3 way = {g.x - patch->p.x.v, g.y - patch->p.y.v, g.z - patch->p.z.v}, to_light = {w.x.v, w.y.v, w.z.v};
    const OwnAxes axes = own_axes(scene, index);
    const Float3 f0 = along_axes(axes, way), w0 = along_axes(axes, to_light);
    const FLOAT radius = (FLOAT)((float)(scene.unit * s.w) * axes.over);
    const FLOAT a0 = DOT(w0, w0), along = DOT(f0, w0) / a0;
    const FLOAT low = along > 0 ? along : (FLOAT)0, x = (((FLOAT)kind != 0) & (low > 1)) ? (FLOAT)1 : low;
    const Float3 q = {f0.x - x * w0.x, f0.y - x * w0.y, f0.z - x * w0.z};
    const FLOAT off = 4 * ROUNDING *
                      ((fabs(g.x) + fabs(g.y) + fabs(g.z) + radius) + (fabs(way.x) + fabs(way.y) + fabs(way.z)) +
                       x * (fabs(to_light.x) + fabs(to_light.y) + fabs(to_light.z)));
    const FLOAT reach = patch->radius + off, outer = radius + reach, apart = DOT(q, q);
    const MASK within = may & !(apart > outer * outer);
    if (!ANY(within)) return;
    const FLOAT gap = sqrt(apart), away = sqrt(DOT(f0, f0));
    /* Where both ends of the way are inside, so is all of it. */
    const MASK inside = (away + reach < radius) & ((FLOAT)light_side < 0);
    MASK near = within & !inside;
#if REAL_BYTES == 8
    if (is_round(axes) && ANY(near & (off > patch->radius))) near = near & !leads_away(C, scene.unit * s.w, patch, w);
#endif
    if (!ANY(near)) return;
    const MASK outside = away > outer;
    const MASK wholly = near & (((gap + reach < radius) & (outside | ((FLOAT)light_side > 0))) |
                                (outside & ((FLOAT)light_side < 0)));
    Share share = {0, 1};
    if (light_side > 0 && !patch->bare && ANY(near & !wholly)) {
        const REAL rounded = (REAL)CENTER_ROUNDING * ((fabs(C.x) + fabs(C.y)) + fabs(C.z));
        const Model3 from_anchor = {narrowed(C.x - patch->anchor.x, 0, 0, rounded),
                                    narrowed(C.y - patch->anchor.y, 0, 0, rounded),
                                    narrowed(C.z - patch->anchor.z, 0, 0, rounded)};
        const Model3 f = models_along(axes, minus_vectors(from_anchor, patch->p)), v = models_along(axes, w);
        const Model a = square_of_vector(v), b = kind == 0 ? dot_constant(f, v) : dot_models(f, v);
        const real4 to = scene.light[number].position;
        const Float3 from_light = {TO_FLOAT(C.x - scene.unit * to.x), TO_FLOAT(C.y - scene.unit * to.y),
                                   TO_FLOAT(C.z - scene.unit * to.z)};
        const Float3 back = {-w0.x, -w0.y, -w0.z}, s0 = kind == 0 ? back : along_axes(axes, from_light);
        const REAL loose = kind == 0 ? (REAL)0
                                     : 2 * (rounded + (REAL)CENTER_ROUNDING * scene.unit *
                                                          (fabs(to.x) + fabs(to.y) + fabs(to.z)));
        const Model D = shadow_of(f, v, a, kind == 0 ? ALL_LANES : DOT(f0, f0) < a0, s0, TO_FLOAT(loose), radius,
                                  patch->radius);
        const MASK started = outside | ((FLOAT)seen_from_outside > 0), behind = started & (most_of(b) < 0);
        const MASK between = (least_of(b) > 0) & (((FLOAT)kind == 0) | (most_of(b) < least_of(a))) & started;
        const MASK told = block_where(blocking, index, near & !wholly & between, D);
        const Model flat = {D.v, D.x, D.y, D.r + fabs(D.z), 0};
        const Share part = share_where_positive(flat);
        share.least = between ? part.least : (FLOAT)0;
        share.most = between ? (told ? (FLOAT)0 : part.most) : (behind ? (FLOAT)0 : (FLOAT)1);
        share.least = told ? (FLOAT)0 : share.least;
    }
    share.least = wholly ? (FLOAT)1 : share.least;
    share.most = wholly ? (FLOAT)1 : share.most;
    block(blocking, index, near, share);
}

#ifdef WITH_TRIANGLES
/* The number of a triangle's edge. Two triangles on the same side of it, as the light sees them, have the same number
 * for it: those of which one faces the light and the other one does not. If they have two edges in common they take
 * theirs for different ones. side: how the light sees all triangles. */
static int number_of_edge(const Scene scene, __global const char *side, const int triangle, const int k) {
    const int4 around = scene.neighbour[triangle];
    const int other = k == 0 ? around.x : k == 1 ? around.y : around.z;
    const int twice = (around.x == other) + (around.y == other) + (around.z == other) > 1;
    if (other < 0 || twice || side[triangle] * side[other] >= 0) return 4 * triangle + k;
    const int4 back = scene.neighbour[other];
    return min(4 * triangle + k, 4 * other + (back.x == triangle ? 0 : back.y == triangle ? 1 : 2));
}

/* Notes the triangle that blocks the light within some lines: its edges, and its plane. Where one of them alone is in a
 * patch, or one alone is in what is seen of it, all on its inner side is dark. That may be told already, by the
 * triangle that has this edge in common with it at a solid's rim. Returns the lanes, of those it is `here` in, in which
 * lines tell all of this triangle. most: of what is seen the triangle darkens no larger share of the cell, where that
 * is known. A line that may be anywhere in the cell cuts off nothing. */
static MASK block_by_lines(const Model *line, const int *number, const Window *seen, const MASK here,
                           Blocking *blocking, FLOAT *most) {
    MASK crosses[4], told = 0, loose = 0;
    INT count = 0;
    for (int k = 0; k < 4; k++) {
        crosses[k] = !(least_of(line[k]) > 0);
        count = crosses[k] ? count + 1 : count;
        const MASK straight = line[k].r < fabs(line[k].x) + fabs(line[k].y);
        loose = loose | (crosses[k] & !straight);
        crosses[k] = crosses[k] & straight;
        told = told | (here & ((blocking->by[0] == number[k]) | (blocking->by[1] == number[k])));
    }
    const MASK some = here & !told & (count > 1);
    Window dark;
    *most = 1;
    if (ANY(some)) {
        dark = *seen;
        dark.off = 0;
        for (int k = 0; k < 4; k++)
            if (ANY(some & crosses[k])) cut_window(&dark, &line[k], some & crosses[k]);
        const FLOAT share = dark.share + dark.off;
        *most = (some & (share < 1)) ? share : (FLOAT)1;
        const MASK none = some & (share < TINY);
        blocking->off += none ? share : (FLOAT)0;
        told = told | none;
    }
    for (int k = 0; k < 4; k++) {
        MASK alone = here & !told & crosses[k];
        FLOAT wrong = 0;
        if (ANY(alone & (count > 1))) {
            Window all = *seen;
            all.off = 0;
            cut_window(&all, &line[k], alone);
            wrong = count > 1 ? all.share - dark.share + (all.off + dark.off) : (FLOAT)0;
        }
        alone = alone & !loose & ((count == 1) | (wrong < TINY));
        if (!ANY(alone)) continue;
        const MASK noted = alone & block_where(blocking, number[k], alone, line[k]);
        blocking->off += noted ? wrong : (FLOAT)0;
        told = told | noted;
    }
    return told;
}

/* The way from a patch's points to a light, as its facets take it, times patch.over where the patch is flat: along,
 * what edges and planes are linear in; reach, what the plane is beyond; bound: what facets' bounds are to be multiplied
 * by. seen: the part of the cell that shows the patch. */
typedef struct {
    const Window *seen;
    Model3 along;
    Model reach;
    FLOAT bound;
} Way;

static Way way_to_light(const Light light, const int kind, const Area patch, const Model3 L, const Model3 w,
                        const Window *seen) {
    Way way;
    way.seen = seen;
    Model3 P = patch.P;
    Model over = constant_model(1);
    if (patch.flat) {
        P = patch.ray;
        over = patch.over;
    }
    const FLOAT most = most_of(over);
    if (kind == 0) {
        const Real3 axis = {light.axis.x, light.axis.y, light.axis.z},
                    across = {light.across.x, light.across.y, light.across.z};
        way.along.x = dot_models(P, constant_vector_in(axis, 1));
        way.along.y = dot_models(P, constant_vector_in(across, 1));
        way.along.z = over;
        way.reach = dot_models(P, L);
        way.reach.r += 0x1p-26f * most + 0x1p-22f * (fabs(way.reach.v) + radius_of(way.reach));
        way.bound = most;
    } else {
        way.along = patch.flat ? minus_vectors(times_vector(over, L), P) : w;
        way.reach = over;
        way.bound = sqrt(most_of(square_of_vector(way.along)));
    }
    return way;
}

/* Whether a light is cut off by a triangle: it is where P is on the positive side of the edges' planes, as the light
 * sees them, and beyond the triangle's own; see triangle_shadow().
 *
 * Where no rim of a mesh and no plane is between the light and the patch's points, meshes cut off all of it or nothing.
 * The triangle beyond an edge of the own one, if the light sees both the same way round, is beside the own one as the
 * light sees it, and so cuts off nothing of it; but what goes on in that one goes on in the own one, so the former does
 * not hold there. */
static void block_by_triangle(const Scene scene, const int number, const int kind, const Area *patch, const Way *way,
                              const int triangle, const MASK may, Blocking *blocking) {
    __global const float4 *facet = scene.light_facet + 3 * ((long)number * scene.triangles + triangle);
    const Model plane = plane_along(facet, way->along);
    const Model beyond = kind == 0 ? scaled(plus_model(way->reach, plane), -1) : minus_model(plane, way->reach);
    const Edges edges = edges_along(facet, way->along, way->bound);
    MASK here = may & !(most_of(beyond) < 0);
    for (int k = 0; k < 3; k++) here = here & !(most_of(edges.edge[k]) < 0);
    if (!ANY(here)) return;
    const int4 neighbour = scene.neighbour[triangle];
    const int each[3] = {neighbour.x, neighbour.y, neighbour.z};
    __global const char *side = scene.face_side + (1 + (long)number) * scene.triangles;
    MASK beside = 0;
    for (int k = 0; k < 3; k++)
        if (each[k] >= 0 && side[triangle] != 0 && side[max(each[k], 0)] == side[triangle])
            beside = beside | (here & (patch->id == FIRST_TRIANGLE(scene.spheres) + each[k]));
    const MASK before = least_of(beyond) > 0;
    blocking->leaky = blocking->leaky | beside | (here & (rim_within(scene, 1 + number, triangle, edges) | !before));
    here = here & !beside;
    blocking->sure = blocking->sure | (here & before & surely_within(edges));
    Model line[4] = {edges.edge[0], edges.edge[1], edges.edge[2], beyond};
    int lines[4] = {0, 0, 0, FIRST_TRIANGLE(scene.spheres) + 4 * triangle + 3};
    for (int k = 0; k < 3; k++) lines[k] = FIRST_TRIANGLE(scene.spheres) + number_of_edge(scene, side, triangle, k);
    FLOAT most;
    here = here & !block_by_lines(line, lines, way->seen, here, blocking, &most);
    if (!ANY(here)) return;
    Share sides[4];
    for (int k = 0; k < 3; k++) sides[k] = share_where_positive(edges.edge[k]);
    sides[3] = share_where_positive(beyond);
    Share share = share_within(sides, 4);
    share.most = share.most < most ? share.most : most;
    share.least = share.least < most ? share.least : most;
    block(blocking, FIRST_TRIANGLE(scene.spheres) + triangle, here, share);
}
#else
/* There are no triangles. */
typedef int Way;
#endif

/* The ways to a light from all that is within `radius` of a patch's middle, for the light's filters: the way from there
 * to a light at a point, and its square, or where parallel light meets the plane across it. The way is rounded as p is,
 * which counts as a distance. */
typedef struct {
    Float3 w;
    FLOAT a, u, v, radius;
} Shaft;

static Shaft shaft_of(const Scene scene, const int number, const int kind, const Area *patch, const Model3 w) {
    const FLOAT off = 0x1p-22f * (fabs(patch->p.x.v) + fabs(patch->p.y.v) + fabs(patch->p.z.v));
    Shaft shaft = {{w.x.v, w.y.v, w.z.v}, w.x.v * w.x.v + w.y.v * w.y.v + w.z.v * w.z.v, 0, 0, patch->radius + off};
    if (kind == 0) {
        const Light light = scene.light[number];
        const Real3 P = {patch->anchor.x + TO_REAL(patch->p.x.v), patch->anchor.y + TO_REAL(patch->p.y.v),
                         patch->anchor.z + TO_REAL(patch->p.z.v)};
        shaft.u = TO_FLOAT(DOT(P, light.axis));
        shaft.v = TO_FLOAT(DOT(P, light.across));
    }
    return shaft;
}

/* Whether the light's filter leaves it open that a sphere is in the way of any point within the shaft.
 *
 * A way that meets the sphere does so no further than `radius` from a point of the way to the middle, at the same part
 * of both. So that meets a sphere whose radius is larger by it, R = r + radius: with R^2 - r^2 in place,
 * sphere_filter_leaves() tells it. That is made of 5 roundings, for which 2^-19 of it is enough, and as many of c' are
 * less than 2^-21. A parallel light's coordinates are off by 2^-24 of (2 |U| + R), and the sum of squares by three
 * roundings. */
static MASK shaft_may_meet(const Scene scene, const int number, const int kind, const Shaft shaft, const int index,
                           const MASK may) {
#ifdef WITH_FILTER
#ifdef WITH_ELLIPSOIDS
    if (scene.spheres.map_of[index] != 0) return may;
#endif
    const float4 s = scene.light_filter[(long)number * scene.count + index];
    const float r = (float)(scene.unit * scene.spheres.center_radius[index].w);
    if (kind == 0) {
        const FLOAT x = s.x - shaft.u, y = s.y - shaft.v;
        const FLOAT R = (1 + ROUNDING) * (r + shaft.radius) + ROUNDING * (fabs(s.x) + fabs(s.y)) + 0x1p-60f;
        return may & !(x * x + y * y > R * R);
    }
    const FLOAT b = dot_float(shaft.w, s), more = (2 * r + shaft.radius) * shaft.radius * (1 + 0x1p-19f);
    return may & ((shaft.a < 0x1p-40f) | !(b * magnitude(b) < shaft.a * (s.w - 0x1p-21f * fabs(s.w) - more)));
#else
    return may;
#endif
}

/* All that may block the light, of the list of one cell of the light's buffer. far: how far a patch's points are in the
 * list's order, at most. */
static void block_by_list(const Scene scene, const int number, const int kind, const Area *patch, const Model3 w,
                          const Way *way, const FLOAT far, const int cell, const MASK in, const Shaft shaft,
                          Blocking *blocking) {
    const int end = scene.lists.start[cell + 1];
    for (int k = scene.lists.start[cell]; k < end; k++) {
        const int2 entry = scene.lists.entry[k];
        const int index = entry.x;
        const MASK dark = blocking->blocked.least >= 1;
        MASK may = in & (far > as_float(entry.y)) & (!dark);
        if (!ANY(may)) break;
#ifdef WITH_TRIANGLES
        if (index >= FIRST_TRIANGLE(scene.spheres)) {
            block_by_triangle(scene, number, kind, patch, way, index - FIRST_TRIANGLE(scene.spheres),
                              may & (patch->id != index), blocking);
            continue;
        }
#endif
        may = shaft_may_meet(scene, number, kind, shaft, index, may);
        if (!ANY(may)) continue;
        const MASK own = may & (patch->id == index);
        if (ANY(own)) {
            /* From inside, it stands before every light outside of it. */
            const Share all = {1, 1};
            const int light_side = scene.light_side[(long)number * scene.count + index];
            block(blocking, index, (own) & (patch->side < 0) & ((FLOAT)light_side > 0), all);
            may = may & (patch->id != index);
        }
        block_by_sphere(scene, number, kind, patch, w, index, (may), blocking);
    }
}

/* The cells of level 0 of a light's grid on which a patch may lie. */
typedef struct {
    MASK here, unknown; /* whether there are any, and whether that cannot be told */
    INT first_column, first_row, last_column, last_row;
} Cover;

/* A range of slopes or coordinates as columns or rows, 0 .. last. side, scale: of the grid's window. */
static INT index_on(const FLOAT x, const float side, const float scale, const int last) {
    const FLOAT place = (x + side) * scale, low = place > 0 ? place : (FLOAT)0;
    return TO_INT(low < last ? low : (FLOAT)last);
}

static Cover cover_of(const Scene scene, const Grid grid, const int kind, const Area *patch, const Model3 w,
                      const MASK wanted) {
    Cover cover = {wanted, 0, 0, 0, 0, 0};
    if (grid.cells.x <= 1 && grid.cells.y <= 1) return cover;
    const FLOAT k = kind == 0 ? 1 : -1;
    const Model3 from = kind == 0 ? patch->P : w;
    const Float3 m = {k * from.x.v, k * from.y.v, k * from.z.v};
    const Float3 off = {fabs(k) * radius_of(from.x), fabs(k) * radius_of(from.y), fabs(k) * radius_of(from.z)};
    const float4 right = fabs(grid.near_right), up = fabs(grid.near_up), ahead = fabs(grid.near_ahead);
    const FLOAT x = DOT(m, grid.near_right) + grid.near_right.w, y = DOT(m, grid.near_up) + grid.near_up.w;
    const FLOAT z = kind == 0 ? (FLOAT)1 : DOT(m, grid.near_ahead);
    const FLOAT loose = 1 + 0x1p-20f, dx = DOT(off, right) * loose, dy = DOT(off, up) * loose,
                dz = kind == 0 ? (FLOAT)0 : DOT(off, ahead) * loose;
    const FLOAT z0 = z - dz, z1 = z + dz, x0 = x - dx, x1 = x + dx, y0 = y - dy, y1 = y + dy;
    const FLOAT X = grid.window.x * loose * z1, Y = grid.window.y * loose * z1;
    cover.here = wanted & (z1 > 0) & (x0 <= X) & (x1 >= -X) & (y0 <= Y) & (y1 >= -Y);
    cover.unknown = cover.here & !(z0 > 0);
    cover.here = cover.here & (z0 > 0);
    const FLOAT a = cover.here ? z0 : (FLOAT)1, b = cover.here ? z1 : (FLOAT)1;
    const FLOAT slack = 0x1p-20f;
    const int columns = grid.cells.x - 1, rows = grid.cells.y - 1;
    const FLOAT left = x0 < 0 ? x0 / a : x0 / b, end = x1 < 0 ? x1 / b : x1 / a;
    const FLOAT low = y0 < 0 ? y0 / a : y0 / b, high = y1 < 0 ? y1 / b : y1 / a;
    cover.first_column = index_on(left - slack * fabs(left), grid.window.x, grid.window.z, columns);
    cover.last_column = index_on(end + slack * fabs(end), grid.window.x, grid.window.z, columns);
    cover.first_row = index_on(low - slack * fabs(low), grid.window.y, grid.window.w, rows);
    cover.last_row = index_on(high + slack * fabs(high), grid.window.y, grid.window.w, rows);
    return cover;
}

/* So many cells of a level, side by side, a patch's lists are looked at; where it lies on more, all may be blocked. */
#define MOST_CELLS_A_SIDE 12

/* What is between a patch's points and a light. w: from the points to it; way: the same for triangles; far: see
 * block_by_list(). */
static Blocking blocking_of(const Scene scene, const int number, const int kind, const Area *patch, const Model3 w,
                            const Way *way, const FLOAT far, const MASK wanted) {
    Blocking blocking = {{0, 0}, -1, {{0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}}, {-1, -1}};
#ifdef WITH_TRIANGLES
    blocking.sure = blocking.leaky = 0;
    blocking.off = 0;
#endif
    const Shaft shaft = shaft_of(scene, number, kind, patch, w);
    const int4 grids = scene.light_buffer[number];
    for (int g = grids.x; g < grids.x + grids.y; g++) {
        const Grid grid = scene.lists.grid[g];
        const Cover cover = cover_of(scene, grid, kind, patch, w, wanted);
        blocking.blocked.most = cover.unknown ? (FLOAT)1 : blocking.blocked.most;
#ifdef WITH_TRIANGLES
        blocking.leaky = blocking.leaky | cover.unknown;
#endif
        if (!ANY((cover.here))) continue;
        Level level = first_level(grid);
        while (level.mask) {
            level = next_level(grid, level);
            const INT column = cover.first_column >> level.level, row = cover.first_row >> level.level;
            const INT columns = (cover.last_column >> level.level) - column,
                      rows = (cover.last_row >> level.level) - row;
            const MASK many = (columns >= MOST_CELLS_A_SIDE) | (rows >= MOST_CELLS_A_SIDE);
            blocking.blocked.most = ((many)&cover.here) ? (FLOAT)1 : blocking.blocked.most;
#ifdef WITH_TRIANGLES
            blocking.leaky = blocking.leaky | ((many)&cover.here);
#endif
            const MASK some = (cover.here) & !many;
            const int width = LARGEST(some ? columns : (INT)0) + 1, height = LARGEST(some ? rows : (INT)0) + 1;
            for (int place = 0; place < width * height; place++) {
                const int across = place % width, down = place / width;
                const MASK inside = some & (columns >= across) & (rows >= down);
                if (!ANY(inside)) continue;
                INT pending = inside ? level.first + (row + down) * level.columns + (column + across) : (INT)-1;
                for (int c = LARGEST(pending); c >= 0; c = LARGEST(pending)) {
                    const MASK in = pending == c;
                    pending = in ? (INT)-1 : pending;
                    block_by_list(scene, number, kind, patch, w, way, far, c, in, shaft, &blocking);
                }
            }
        }
    }
#ifdef WITH_TRIANGLES
    const MASK closed = blocking.sure & !blocking.leaky;
    blocking.blocked.least = closed ? (FLOAT)1 : blocking.blocked.least;
    blocking.blocked.most = closed ? (FLOAT)1 : blocking.blocked.most;
#endif
    return blocking;
}
#endif

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

#ifdef WITH_SPOT
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
#endif

/* Of a colour, for red, green and blue: v, its mean over the cell within a window and 0 elsewhere, off by at most e,
 * and what it is within at all points of the cell, as far as the window shows them. */
typedef struct {
    FLOAT v[3], e[3], least[3], most[3];
#ifdef WITH_SHEETS
    FLOAT off; /* the share of the cell in which it may be beyond that */
#endif
} Tint;

/* What a light gives a patch within a window. lit: the moments of where it does so, but for `blocked`; off: what share
 * of the cell that is off by; all: the lanes in which all of the cell is lit. */
typedef struct {
    Moments lit;
    Share blocked;
    FLOAT off;
    MASK all;
} Reach;

/* Adds what a light gives a patch: (kd C amount + highlight) L, where it reaches it. shine: what has the highlight's
 * mean. */
static void add_light(Tint *tint, const Light light, const Area patch, const Intersection at, const Model amount,
                      const Model highlight, const Model shine, const Reach *reach, const MASK on) {
    const float color[3] = {light.color.x, light.color.y, light.color.z};
    const FLOAT kd[3] = {TO_FLOAT(at.diffuse.x), TO_FLOAT(at.diffuse.y), TO_FLOAT(at.diffuse.z)};
    const Moments lit = reach->lit;
    for (int k = 0; k < 3; k++) {
        const Model plain = scaled(amount, kd[k]);
#ifdef WITH_TEXTURES
        const Model diffuse = times_model(plain, patch.paint[k]),
                    even = choose_model(patch.rough, scaled(plain, patch.paint[k].v), diffuse);
#else
        const Model diffuse = plain, even = plain;
#endif
        const Model all = scaled(plus_model(diffuse, highlight), (FLOAT)color[k]),
                    m = scaled(plus_model(even, shine), (FLOAT)color[k]);
        const FLOAT low = least_of(all), least = low > 0 ? low : (FLOAT)0, high = most_of(all),
                    most = high <= 0 ? (FLOAT)0 : high;
        FLOAT mean = lit.one * m.v + (lit.s * m.x + lit.t * m.y + lit.w * m.z);
        FLOAT off = lit.one * m.r + fabs(m.z) * lit.off + most * reach->off + 16 * ROUNDING * (fabs(m.v) + gradient(m));
#ifdef WITH_TEXTURES
        /* Of amount C, what the mean of C has besides its model counts by the amount in the middle, and any of C by
         * what the amount differs from that: the means of |s| and |t| are at most 1/2. */
        const FLOAT half_lit = lit.one < 0.5f ? lit.one : (FLOAT)0.5f;
        const FLOAT varied = half_lit * (fabs(plain.x) + fabs(plain.y)) + lit.one * (fabs(plain.z) + plain.r);
        mean += color[k] * plain.v * lit.paint[k];
        off += patch.rough ? color[k] * (fabs(plain.v) * lit.paint_off[k] + varied * patch.paint[k].r) : (FLOAT)0;
#endif
        const FLOAT less = mean - most * reach->blocked.most, dim = less > 0 ? less : (FLOAT)0;
        const FLOAT top = most * (1 - reach->blocked.least), bright = mean < top ? mean : top;
        const MASK some = reach->blocked.most > 0;
        tint->v[k] += on ? (some ? (FLOAT)0.5f * (dim + bright) : mean) : (FLOAT)0;
        tint->e[k] += on ? (some ? fabs((FLOAT)0.5f * (bright - dim)) : (FLOAT)0) + off : (FLOAT)0;
        tint->least[k] += (on & reach->all) ? least : (FLOAT)0;
        tint->most[k] += (on & (reach->blocked.least < 1)) ? most : (FLOAT)0;
    }
}

#ifdef WITH_QUADRICS
/* A cosine of which the model may tell less than that it is within -1 .. 1. */
static Model at_most_one(const Model cosine) {
    const FLOAT least = least_of(cosine), high = most_of(cosine), low = least < 1 ? least : (FLOAT)1;
    return choose_model((high > 1) & is_known(cosine), between_bounds(low > -1 ? low : (FLOAT)-1, 1), cosine);
}
#endif

/* What one light adds to a patch: illuminate() for all points at once. */
static void illuminate_patch(const Scene scene, const int number, const int kind, const Area patch,
                             const Intersection at, const Window *seen, const Moments *moments, Tint *tint,
                             Work *work) {
    const Light light = scene.light[number];
    const Real3 to = {light.position.x, light.position.y, light.position.z};
    const Real3 way = {scene.unit * to.x - patch.anchor.x, scene.unit * to.y - patch.anchor.y,
                       scene.unit * to.z - patch.anchor.z};
    const Model3 L = constant_vector_in(kind == 0 ? to : way, 1), w = kind == 0 ? L : minus_vectors(L, patch.p);
    const Model a = square_of_vector(w);
    const Model over = kind == 0 ? constant_model(1) : over_root_of(a);
    const Model3 l = kind == 0 ? w : times_vector(over, w);
#ifdef WITH_QUADRICS
    const Model cosine = at_most_one(kind == 0 ? dot_constant(patch.n, l) : dot_models(patch.n, l));
#else
    const Model cosine = kind == 0 ? dot_constant(patch.n, l) : dot_models(patch.n, l);
#endif
    MASK on = (patch.id >= 0) & !(most_of(cosine) < 0);
    Model strength = constant_model(1);
    /* The light's part of the window is cut out by these lines. */
    Model line[4];
    MASK cut[4] = {0, 0, 0, 0};
    Reach reach = {*moments, {0, 0}, 0, on};
    /* Where the light is on the horizon of some points. */
    line[0] = flattened_on(cosine, &patch.limb);
    cut[0] = on & (least_of(cosine) < 0) & (2 * line[0].r < fabs(line[0].x) + fabs(line[0].y));
#ifdef WITH_SPOT
    if (kind == 2) {
        const Real3 axis = {-light.axis.x, -light.axis.y, -light.axis.z};
        const Model angle = dot_models(l, constant_vector_in(axis, 1));
        on = on & !(most_of(angle) < (float)light.axis.w);
        if (light.cone.y > 0) {
            strength = strength_in_cone(light, angle);
        } else {
            const Model within = minus_model(angle, with_rounding(constant_model((FLOAT)(float)light.axis.w)));
            const Model edge = flattened_on(within, &patch.limb);
            const Share lit = share_where_positive(edge);
            line[1] = edge;
            cut[1] = on & (least_of(edge) < 0) & (edge.r < fabs(edge.x) + fabs(edge.y));
            reach.blocked.least = cut[1] ? (FLOAT)0 : 1 - lit.most;
            reach.blocked.most = cut[1] ? (FLOAT)0 : 1 - lit.least;
        }
    }
#endif
#ifdef WITH_BLACK
    on = on & (!at.black);
#endif
    if (!ANY((on))) return;
#ifdef WITH_SHADOWS
    const MASK unsure = on & (may_be_stopped(scene, number, patch.id));
    if (ANY((unsure))) {
        const FLOAT depth = kind == 0 ? -least_of(dot_models(patch.P, L)) : most_of(a);
        const FLOAT far = depth + fabs(depth) * 0x1p-20f + 0x1p-60f;
#ifdef WITH_TRIANGLES
        const Way way = way_to_light(light, kind, patch, L, w, seen);
#else
        const Way way = 0;
#endif
        const Blocking blocking = blocking_of(scene, number, kind, &patch, w, &way, far, unsure);
        const Share blocked = blocking.blocked;
        const FLOAT most = reach.blocked.most + blocked.most;
        reach.blocked.least = (unsure & (blocked.least > reach.blocked.least)) ? blocked.least : reach.blocked.least;
        reach.blocked.most = unsure ? (most < 1 ? most : (FLOAT)1) : reach.blocked.most;
#ifdef WITH_TRIANGLES
        reach.off = unsure ? blocking.off : (FLOAT)0;
#endif
        for (int k = 0; k < 2; k++) {
            line[2 + k] = blocking.free[k];
            cut[2 + k] = unsure & (blocking.by[k] >= 0);
        }
    }
#endif
    on = on & (reach.blocked.least < 1);
    if (!ANY(on)) return;
    const MASK any = cut[0] | cut[1] | cut[2] | cut[3];
    if (ANY(on & any)) {
        Window window = *seen;
        window.off = 0;
        for (int k = 0; k < 4; k++) {
            if (ANY(on & cut[k])) cut_window(&window, &line[k], on & cut[k]);
        }
        find_moments(&window, &patch.limb, &reach.lit);
#ifdef WITH_TEXTURES
        for (int k = 0; k < 3; k++) {
            reach.lit.paint[k] = moments->paint[k];
            reach.lit.paint_off[k] = moments->paint_off[k];
        }
        find_texture_moments(scene, patch, &window, on & any, &reach.lit);
#endif
        reach.off += window.off;
    }
    reach.all = !any & !(reach.blocked.most > 0);
#ifdef WITH_SHEETS
    tint->off += on ? reach.off : (FLOAT)0;
#endif
    const Model amount = times_model(choose_model(cut[0], cosine, positive_part(cosine)), strength);
    Model highlight = constant_model(0), shine = highlight;
#ifdef WITH_SPECULAR
    const MASK shines = on & (at.hit) & (TO_FLOAT(at.ks) > 0);
    if (ANY((shines))) {
        /* As illuminate() has it: r = 2 (n.l) n - l, r.v = 1 - |r - v|^2 / 2. No highlight where n.l <= 0, but all of
         * it beside. */
        const Model3 e = minus_vectors(times_vector(scaled(cosine, 2), patch.n), plus_vectors(l, patch.v));
        Model power = highlight_power(scaled(square_of_vector(e), -0.5f), TO_FLOAT(at.exponent));
        const Model some = between_bounds(0, most_of(power));
        power = choose_model((least_of(cosine) > 0) | cut[0], power, some);
        highlight = choose_model(shines, scaled(times_model(power, strength), TO_FLOAT(at.ks)), highlight);
        shine = highlight;
        const MASK rough = shines & reach.all & (seen->share >= 1) & (least_of(cosine) > 0) & (highlight.r > DULL) &
                           (!patch.limb.here | patch.limb.round);
        if (kind != 2 && ANY(rough)) {
            const Model to_eye = dot_models(patch.n, patch.v), between = dot_models(l, patch.v);
            mean_highlight(&cosine, &to_eye, &between, TO_FLOAT(at.exponent), &patch.limb, rough, &power);
            shine = choose_model(rough, scaled(power, TO_FLOAT(at.ks)), highlight);
        }
    }
#endif
    add_light(tint, light, patch, at, amount, highlight, shine, &reach, on);
}
#else
typedef struct {
    FLOAT v[3], e[3], least[3], most[3];
#ifdef WITH_SHEETS
    FLOAT off; /* the share of the cell in which it may be beyond that */
#endif
} Tint;
#endif

/* The colour of patches within a window. */
static Tint tint_of(const Scene scene, Area patch, const Window *seen, Work *work) {
    const Intersection at = material_at(scene, patch.id);
    const FLOAT ambient[3] = {TO_FLOAT(at.ambient.x), TO_FLOAT(at.ambient.y), TO_FLOAT(at.ambient.z)};
    Tint tint;
#ifdef WITH_SHEETS
    tint.off = 0;
#endif
    for (int k = 0; k < 3; k++) {
        tint.v[k] = ambient[k] * seen->share;
        tint.least[k] = tint.most[k] = ambient[k];
        tint.e[k] = 0;
    }
#if defined(WITH_LIGHTS) || defined(WITH_TEXTURES)
    Moments moments;
    find_moments(seen, &patch.limb, &moments);
#endif
#ifdef WITH_TEXTURES
    paint_of(scene, seen, &patch, &moments);
    for (int k = 0; k < 3; k++) {
        const Model m = scaled(patch.paint[k], ambient[k]);
        const FLOAT within = patch.rough ? ambient[k] * moments.paint_off[k] : seen->share * (m.r + fabs(m.z));
        tint.v[k] = seen->share * m.v + (moments.s * m.x + moments.t * m.y) + ambient[k] * moments.paint[k];
        tint.e[k] = within + 16 * ROUNDING * (fabs(m.v) + gradient(m));
        tint.least[k] = least_of(m);
        tint.most[k] = most_of(m);
    }
#endif
#ifdef WITH_LIGHTS
    for (int number = 0; number < scene.lights; number++)
        illuminate_patch(scene, number, kind_of(scene.light[number]), patch, at, seen, &moments, &tint, work);
#endif
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

/* Whether the colour of a surface is beyond what is proved here. */
static MASK beyond_proof(const Scene scene, const INT id) {
#ifdef WITH_BOUNCES
    int each[W], found[W];
    STORE_LANES(id, each);
    for (int lane = 0; lane < W; lane++) {
        found[lane] = 0;
        if (each[lane] < 0) continue;
        const int material = scene.material_of[each[lane]];
        found[lane] |= scene.bounce[material].x > 0 || scene.bounce[material].y > 0;
    }
    return LOAD_LANES(found) != 0;
#else
    return (MASK)0;
#endif
}
#endif

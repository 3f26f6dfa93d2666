/* shadows.cl: which part of a patch a light does not reach.
 *
 * A patch is what a cell shows of a surface: see Area.
 */
#ifdef WITH_AVERAGE
/* What centres are off by, of themselves. */
#define CENTER_ROUNDING (REAL_BYTES == 8 ? 0x1p-50f : 0x1p-21f)

/* What is known of the light's way to a patch. */
typedef struct {
    Share blocked; /* the share of the points that the light does not reach, but for */
    INT only;      /* a surface of which that is counted, -1 for none */
    /* what these are: the light's way is free of them where the model is positive. by: which surfaces, -1 for none */
    Model free[2];
    INT by[2];
    MASK odd; /* whether something may be between of which it is not known what it stops */
} Blocking;

/* The ways from a patch to a light. w: from its points; far: how far these are in the order of the light's lists, at
 * most. For the light's filters, from all that is within `radius` of the patch's middle: v, the way from there to a
 * light at a point, and its square a, or where parallel light meets the plane across it, x and y. The way is rounded as
 * p is, which counts as a distance. */
typedef struct {
    int number, at_point;
    const Area *patch;
    Model3 w;
    FLOAT far;
    Float3 v;
    FLOAT a, x, y, radius;
} Shaft;

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
    int stretched;
    float3 x, y, z;
} OwnAxes;

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

static OwnAxes own_axes(const Scene *scene, const int index) {
    OwnAxes axes = {1, HAS(WITH_ELLIPSOIDS) && scene->spheres.map_of[index] != 0, 0, 0, 0};
    if (!axes.stretched) return axes;
    __global const Map *K = scene->spheres.map + scene->spheres.map_of[index];
    const real over = 1 / K->to_x.w;
    axes.over = over;
    axes.x = convert_float4(over * K->camera_x).xyz;
    axes.y = convert_float4(over * K->camera_y).xyz;
    axes.z = convert_float4(over * K->camera_z).xyz;
    return axes;
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

/* Whether a sphere surely is clear of the ways to the light, which lead away from it: the one from the patch's middle
 * is nearest to C where it begins, then. Of a large sphere, such as the ground, the roundings of floats are larger than
 * a patch, so this is in double; less than 16 of its roundings are 2^-46 of the coordinates. w is off by no more than
 * its radius. */
static MASK leads_away(const Real3 C, const REAL r, const Area *patch, const Model3 w) {
    if (REAL_BYTES != 8) return 0;
    const Real3 f = {(C.x - patch->anchor.x) - TO_REAL(patch->p.x.v), (C.y - patch->anchor.y) - TO_REAL(patch->p.y.v),
                     (C.z - patch->anchor.z) - TO_REAL(patch->p.z.v)};
    const Real3 to_light = {TO_REAL(w.x.v), TO_REAL(w.y.v), TO_REAL(w.z.v)};
    const Real3 A = patch->anchor;
    const REAL size = (fabs(C.x) + fabs(C.y) + fabs(C.z)) + (fabs(A.x) + fabs(A.y) + fabs(A.z)) + r;
    const REAL far = fabs(to_light.x) + fabs(to_light.y) + fabs(to_light.z),
               off = TO_REAL(radius_of(w.x) + radius_of(w.y) + radius_of(w.z));
    const REAL cosine = DOT(f, to_light) + 2 * off * size + (REAL)0x1p-46f * size * far;
    const FLOAT gap = TO_FLOAT(sqrt(DOT(f, f)) - r - (REAL)0x1p-46f * size);
    return TO_MASK(cosine < 0) & (gap > patch->radius * (1 + 4 * ROUNDING));
}
/* Whether the eye, or all that parallel rays start at, surely is outside of a sphere. */
static int eye_is_outside(const Scene *scene, const int index) {
    if (HAS(WITH_ELLIPSOIDS) && scene->spheres.map_of[index] != 0) return 0;
    const real4 s = scene->spheres.center_radius[index];
    return HAS(WITH_PARALLEL_RAYS) ? s.z + s.w < 0 : scene->spheres.power[index].x > 0;
}

/* What is positive where the way w from a point to a light goes through a sphere: r |w| - |X|, with X = f x w and f
 * from the point to the centre. Since f - w is s, the same for all points, X is s x w, or s x f, which is linear in the
 * place; of parallel light, where w is constant, s is -w. Let e be the unit vector along X in the middle. With X' for
 * what X has across e,
 *
 *     e.X <= |X| <= e.X + X'.X' / (2 e.X),   e.X = (e x s).w
 *
 * and |X'| is at most |s| times what points are apart from the middle, `far`. s is off by `off`, and 2^-23 of itself, e
 * by 2^-20 in length and in direction, and e x s by 2^-21 |s|. shorter: whether f is shorter than w, or w is constant.
 */
typedef struct {
    Float3 s;
    FLOAT off, far;
    MASK shorter;
} Lever;

static Model shadow_of(const Model3 f, const Model3 w, const Model a, const Lever lever, const FLOAT r) {
    const Float3 s = lever.s;
    const Model3 g = choose_vector(lever.shorter, f, w);
    const Float3 X = {s.y * g.z.v - s.z * g.y.v, s.z * g.x.v - s.x * g.z.v, s.x * g.y.v - s.y * g.x.v};
    const FLOAT size = sqrt(DOT(X, X)), over = 1 / size, s_size = sqrt(DOT(s, s));
    const FLOAT rounding = (ROUNDING * s_size + lever.off) * (fabs(g.x.v) + fabs(g.y.v) + fabs(g.z.v));
    const Float3 e = {over * X.x, over * X.y, over * X.z};
    const FLOAT off = 0x1p-21f * s_size;
    const Model3 across = {{e.y * s.z - e.z * s.y, 0, 0, off, 0},
                           {e.z * s.x - e.x * s.z, 0, 0, off, 0},
                           {e.x * s.y - e.y * s.x, 0, 0, off, 0}};
    const FLOAT aside = s_size * lever.far + 2 * rounding, least = size - aside,
                bow = (FLOAT)0.25f * aside * aside / least;
    Model m = minus_model(scaled(root_of(a), r), dot_constant(g, across));
    m.v -= bow;
    m.r += bow * (1 + ROUNDING) + 2 * rounding + ROUNDING * size;
    m.r = least > 0 ? m.r : (FLOAT)INFINITY;
    return m;
}

/* A sphere beside a shaft, in the sphere's own axes. C: its centre, along the camera's axes; f, w: from the middle of
 * the patch to the centre, and to the light; apart: the square of how near the centre is to that way; reach: how far
 * the patch goes around its middle, and what roundings are. */
typedef struct {
    int index, light_side, seen_from_outside;
    Real3 C;
    OwnAxes axes;
    Float3 f, w;
    FLOAT radius, apart, reach, off;
} Beside;

static Beside beside(const Scene *scene, const Shaft *shaft, const int index) {
    const Area *patch = shaft->patch;
    const real4 s = scene->spheres.center_radius[index];
    Beside at;
    at.index = index;
    at.light_side = scene->light_side[(long)shaft->number * scene->count + index];
    at.seen_from_outside = eye_is_outside(scene, index);
    at.axes = own_axes(scene, index);
    const Real3 C = {scene->unit * s.x, scene->unit * s.y, scene->unit * s.z};
    /* From the anchor to C. */
    const Float3 g = {TO_FLOAT(C.x - patch->anchor.x), TO_FLOAT(C.y - patch->anchor.y),
                      TO_FLOAT(C.z - patch->anchor.z)};
    const Float3 way = {g.x - patch->p.x.v, g.y - patch->p.y.v, g.z - patch->p.z.v}, v = shaft->v;
    at.C = C;
    at.f = along_axes(at.axes, way);
    at.w = along_axes(at.axes, v);
    at.radius = (FLOAT)((float)(scene->unit * s.w) * at.axes.over);
    const FLOAT along = DOT(at.f, at.w) / DOT(at.w, at.w), low = along > 0 ? along : (FLOAT)0;
    const FLOAT x = shaft->at_point ? (low > 1 ? (FLOAT)1 : low) : low;
    const Float3 q = {at.f.x - x * at.w.x, at.f.y - x * at.w.y, at.f.z - x * at.w.z};
    at.apart = DOT(q, q);
    at.off = 4 * ROUNDING *
             ((fabs(g.x) + fabs(g.y) + fabs(g.z) + at.radius) + (fabs(way.x) + fabs(way.y) + fabs(way.z)) +
              x * (fabs(v.x) + fabs(v.y) + fabs(v.z)));
    at.reach = patch->radius + at.off;
    return at;
}

/* What share of the light a sphere stops whose rim may be in the shadow on the patch: a line, where that is near to it.
 * outside: where the patch is, all of it. */
static Share block_by_rim(const Scene *scene, const Shaft *shaft, const Beside at, const MASK outside, const MASK asked,
                          Blocking *blocking) {
    const Area *patch = shaft->patch;
    const Real3 C = at.C;
    const REAL rounded = (REAL)CENTER_ROUNDING * ((fabs(C.x) + fabs(C.y)) + fabs(C.z));
    const Model3 from_anchor = {narrowed(C.x - patch->anchor.x, 0, 0, rounded),
                                narrowed(C.y - patch->anchor.y, 0, 0, rounded),
                                narrowed(C.z - patch->anchor.z, 0, 0, rounded)};
    const Model3 f = models_along(at.axes, minus_vectors(from_anchor, patch->p)), v = models_along(at.axes, shaft->w);
    const Model a = square_of_vector(v), b = shaft->at_point ? dot_models(f, v) : dot_constant(f, v);
    const real4 to = scene->light[shaft->number].position;
    const Float3 from_light = {TO_FLOAT(C.x - scene->unit * to.x), TO_FLOAT(C.y - scene->unit * to.y),
                               TO_FLOAT(C.z - scene->unit * to.z)},
                 back = {-at.w.x, -at.w.y, -at.w.z};
    Lever lever = {back, 0, patch->radius, ALL_LANES};
    if (shaft->at_point) {
        lever.s = along_axes(at.axes, from_light);
        lever.off = TO_FLOAT(2 *
                             (rounded + (REAL)CENTER_ROUNDING * scene->unit * (fabs(to.x) + fabs(to.y) + fabs(to.z))));
        lever.shorter = DOT(at.f, at.f) < DOT(at.w, at.w);
    }
    const Model D = shadow_of(f, v, a, lever, at.radius);
    const MASK started = outside | ((FLOAT)at.seen_from_outside > 0), behind = started & (most_of(b) < 0),
               before = shaft->at_point ? most_of(b) < least_of(a) : (MASK)ALL_LANES,
               between = (least_of(b) > 0) & before & started;
    const MASK told = block_where(blocking, at.index, asked & between, D);
    const Model flat = {D.v, D.x, D.y, D.r + fabs(D.z), 0};
    const Share part = share_where_positive(flat);
    Share share = {between ? part.least : (FLOAT)0,
                   between ? (told ? (FLOAT)0 : part.most) : (behind ? (FLOAT)0 : (FLOAT)1)};
    share.least = told ? (FLOAT)0 : share.least;
    return share;
}

/* Whether a light at infinity or at a point is cut off by a sphere from points P of the patch: with f = C - P, w from P
 * to the light and X = f x w, where D = w.w r^2 - X.X > 0, if both ends of the way are outside of the sphere and the
 * point of the way that is nearest to C lies between them, 0 < f.w < w.w. w: from the patch's points. Where f.w < 0 and
 * P is outside, so is the way. What the eye sees from outside of a sphere is outside of it, and what the patch has else
 * is in no window.
 *
 * The way from a point P' that is no further than `radius` from P is nowhere further than that from the way from P. So
 * what the distance of C from that way says of P', it says of all of the patch, but for `radius`. */
static void block_by_other(const Scene *scene, const Shaft *shaft, const int index, const MASK may,
                           Blocking *blocking) {
    const Beside at = beside(scene, shaft, index);
    const FLOAT outer = at.radius + at.reach;
    const MASK within = may & !(at.apart > outer * outer);
    if (!ANY(within)) return;
    const FLOAT gap = sqrt(at.apart), away = sqrt(DOT(at.f, at.f)), light_side = (FLOAT)at.light_side;
    /* Where both ends of the way are inside, so is all of it. */
    const MASK inside = (away + at.reach < at.radius) & (light_side < 0);
    MASK near = within & !inside;
    if (!at.axes.stretched && ANY(near & (at.off > shaft->patch->radius)))
        near = near & !leads_away(at.C, scene->unit * scene->spheres.center_radius[index].w, shaft->patch, shaft->w);
    if (!ANY(near)) return;
    const MASK outside = away > outer;
    const MASK wholly = near &
                        (((gap + at.reach < at.radius) & (outside | (light_side > 0))) | (outside & (light_side < 0)));
    Share share = {0, 1};
    if (at.light_side > 0 && !shaft->patch->bare && ANY(near & !wholly))
        share = block_by_rim(scene, shaft, at, outside, near & !wholly, blocking);
    share.least = wholly ? (FLOAT)1 : share.least;
    share.most = wholly ? (FLOAT)1 : share.most;
    block(blocking, index, near, share);
}

static Shaft shaft_of(const Scene *scene, const int number, const Area *patch, const Model3 w, const FLOAT far) {
    const Light light = scene->light[number];
    const FLOAT off = 0x1p-22f * (fabs(patch->p.x.v) + fabs(patch->p.y.v) + fabs(patch->p.z.v));
    Shaft shaft = {number,
                   is_at_point(light, kind_of(light)),
                   patch,
                   w,
                   far,
                   {w.x.v, w.y.v, w.z.v},
                   w.x.v * w.x.v + w.y.v * w.y.v + w.z.v * w.z.v,
                   0,
                   0,
                   patch->radius + off};
    if (shaft.at_point) return shaft;
    const Real3 P = {patch->anchor.x + TO_REAL(patch->p.x.v), patch->anchor.y + TO_REAL(patch->p.y.v),
                     patch->anchor.z + TO_REAL(patch->p.z.v)};
    shaft.x = TO_FLOAT(DOT(P, light.axis) + light.axis.w);
    shaft.y = TO_FLOAT(DOT(P, light.across) + light.across.w);
    return shaft;
}

/* Whether the light's filter leaves it open that a sphere is in the way of any point within the shaft.
 *
 * A way that meets the sphere does so no further than `radius` from a point of the way to the middle, at the same part
 * of both. So that meets a sphere whose radius is larger by it, R = r + radius: with R^2 - r^2 in place,
 * sphere_filter_leaves() tells it. That is made of 5 roundings, for which 2^-19 of it is enough, and as many of c' are
 * less than 2^-21. A parallel light's coordinates are off by 2^-24 of (2 |U| + R), and the sum of squares by three
 * roundings. */
static MASK shaft_may_meet(const Scene *scene, const Shaft *shaft, const int index, const MASK may) {
    if (!HAS(WITH_FILTER)) return may;
    if (HAS(WITH_ELLIPSOIDS) && scene->spheres.map_of[index] != 0) return may;
    const float4 s = scene->light_filter[(long)shaft->number * scene->count + index];
    const float r = (float)(scene->unit * scene->spheres.center_radius[index].w);
    if (!shaft->at_point) {
        const FLOAT x = s.x - shaft->x, y = s.y - shaft->y;
        const FLOAT R = (1 + ROUNDING) * (r + shaft->radius) + ROUNDING * (fabs(s.x) + fabs(s.y)) + 0x1p-60f;
        return may & !(x * x + y * y > R * R);
    }
    const FLOAT b = dot_float(shaft->v, s), more = (2 * r + shaft->radius) * shaft->radius * (1 + 0x1p-19f);
    return may & ((shaft->a < 0x1p-40f) | !(b * magnitude(b) < shaft->a * (s.w - 0x1p-21f * fabs(s.w) - more)));
}

static void sphere_block(const Scene *scene, const Shaft *shaft, const int index, MASK may, Blocking *blocking) {
    const Area *patch = shaft->patch;
    may = shaft_may_meet(scene, shaft, index, may);
    if (!ANY(may)) return;
    const MASK own = may & (patch->id == index);
    if (ANY(own)) {
        /* From inside, it stands before every light outside of it. */
        const Share all = {1, 1};
        const int light_side = scene->light_side[(long)shaft->number * scene->count + index];
        block(blocking, index, own & (patch->side < 0) & ((FLOAT)light_side > 0), all);
        may = may & !own;
    }
    if (ANY(may)) block_by_other(scene, shaft, index, may, blocking);
}
#endif

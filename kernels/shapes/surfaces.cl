/* surfaces.cl: points of surfaces of whatever shape. Each shape's function is called for its own lanes. */

#ifdef WITH_PLANES
/* Puts caps that rays have met into an intersection. planes: theirs, -1 for none; P: the points, in camera space. */
static __attribute__((noinline)) void put_caps(const Frame *camera, const Scene *scene, const Leaving *ray,
                                               const INT planes, const Real3 P, Intersection *at) {
    const Frame frame = *camera;
    const Leaving way = *ray;
    const PairRay fine = pair_ray(scene->spheres, way);
    for (int plane = 0; plane < scene->spheres.planes; plane++) {
        const MASK cap = planes == plane;
        if (!ANY(cap)) continue;
        const REAL_MASK here = TO_REAL_MASK(cap);
        const real4 S = scene->spheres.clip[2 * plane], m = scene->spheres.clip[2 * plane + 1];
        const REAL over_size = -1 / sqrt((REAL)((m.x * m.x + m.y * m.y) + m.z * m.z));
        const Real3 outward = {over_size * m.x, over_size * m.y, over_size * m.z}, none = {0, 0, 0};
        const Real3 n = turned_to_camera(frame, outward);
        const Height height = height_along(scene->spheres, way, fine, plane);
        const Pair t = over(minus(pair(0, 0), height.h), height.g);
        const Real3 place = {plus(pair(way.center.x, 0), plus(fine.step.x, times(t, fine.w.x))).hi,
                             plus(pair(way.center.y, 0), plus(fine.step.y, times(t, fine.w.y))).hi,
                             plus(pair(way.center.z, 0), plus(fine.step.z, times(t, fine.w.z))).hi};
        PUT3(PUT_WHERE, here, at->normal, n);
        PUT3(PUT_WHERE, here, at->q, place);
        PUT3(PUT_WHERE, here, at->start.own.center, P);
        PUT3(PUT_WHERE, here, at->start.from_eye, P);
        PUT3(PUT_WHERE, here, at->start.anchor, place);
        PUT3(PUT_WHERE, here, at->start.q, place);
        PUT3(PUT_WHERE, here, at->start.p, none);
        PUT3(PUT_WHERE, here, at->start.step, none);
        PUT_WHERE(here, at->start.own.r, (REAL)0);
        PUT_WHERE(here, at->start.support, (REAL)0);
        PUT_WHERE(here, at->start.reach, (REAL)0);
        PUT_WHERE(here, at->start.side, (REAL)1);
        PUT_WHERE(here, at->start.stretched, here);
        PUT_WHERE(here, at->start.near_eye, (REAL_MASK)0);
        PUT_WHERE(here, at->spread, (REAL)1);
        PUT_WHERE(cap, at->start.index, (INT)CAP);
        if (HAS(WITH_UV)) PUT_WHERE(here, at->u, (REAL)0);
        if (HAS(WITH_UV)) PUT_WHERE(here, at->v, (REAL)0);
        if (!HAS(WITH_SHADING) || S.w < 0) continue;
        const shade8 material = scene->material[(int)S.w];
        put_material(TO_SHADE_MASK(cap), material, at);
        if (HAS(WITH_BLACK))
            PUT_WHERE(cap, at->black, (MASK)(material.s3 + material.s4 + material.s5 + material.s6 <= 0 ? -1 : 0));
        at->matte = at->matte | cap;
    }
}
#endif

/* Puts what a ray from the eye has met into an intersection, but for its material. */
static __attribute__((always_inline)) void put_surfaces(const Frame frame, const Scene *scene, const Ray ray,
                                                        const Hit hit, Intersection *at) {
#ifdef WITH_PLANES
    Hit own = hit;
    own.id = hit.plane >= 0 ? (INT)-1 : hit.id;
    at->matte = 0;
#else
#define own hit
#endif
    if (HAS(WITH_NORMAL)) EACH_SHAPE(scene->spheres, own.id, put(frame, scene, ray, own, at));
    if (HAS(WITH_TEXTURES)) paint(scene, own.id, at);
#ifdef WITH_PLANES
    if (ANY(hit.plane >= 0)) {
        const Leaving way = from_eye(scene->spheres, eye_ray(ray));
        put_caps(&frame, scene, &way, hit.plane, point_at(ray, hit.t), at);
    }
#else
#undef own
#endif
}

#ifdef WITH_BOUNCES
/* Normal and material of what a ray that left a surface has met. */
static Intersection intersection_from(const Frame frame, const Scene *scene, const Leaving ray, const Met met) {
    Intersection at = material_at(scene, met.id);
#ifdef WITH_PLANES
    Met own = met;
    own.id = met.plane >= 0 ? (INT)-1 : met.id;
    at.matte = 0;
#else
#define own met
#endif
    EACH_SHAPE(scene->spheres, own.id, put_from(frame, scene, ray, own, &at));
    if (HAS(WITH_TEXTURES)) paint(scene, own.id, &at);
#ifdef WITH_PLANES
    if (ANY(met.plane >= 0)) put_caps(&frame, scene, &ray, met.plane, point_from(frame, scene, ray, met), &at);
#else
#undef own
#endif
    return at;
}
#endif

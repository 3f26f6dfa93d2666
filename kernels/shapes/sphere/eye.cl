/* eye.cl: spheres and ellipsoids along rays from the eye. */

/* Which lanes' rays meet a sphere, at t, before what they have hit so far. Of equally near ones, the sphere that comes
 * first in the scene file is hit. */
static REAL_MASK closer(const Scene *scene, const Ray ray, const Sphere sphere, const int index, const REAL t,
                        const Hit hit) {
    const REAL_MASK nearer = t < hit.t;
    const REAL_MASK close = too_close(t, hit.t);
    if (!UNDECIDED(scene->geometry, ANY(TO_MASK(close)))) return nearer;
    const INT rival = SPHERE_OR_NONE(scene->geometry, hit.id);
    REAL_MASK first = TO_REAL_MASK(scene->id_of[index] < ids_of(scene, hit.id));
#if REAL_BYTES == 8
    REAL_MASK round = close;
#ifdef WITH_ELLIPSOIDS
    const MASK maps = (maps_of(scene->geometry, sphere.index) != 0) | (maps_of(scene->geometry, rival) != 0);
    const MASK stretched = TO_MASK(close) & maps;
    round = close & !TO_REAL_MASK(stretched);
    const Leaving way = from_eye(scene->geometry, eye_ray(ray));
    const REAL_MASK mixed = comes_first_of(scene, way, sphere.index, stretched ? rival : sphere.index);
#else
    const REAL_MASK mixed = first;
#endif
    const REAL_MASK exact = sphere_comes_first(scene->geometry, ray, sphere, spheres_of(scene->geometry, rival), first,
                                               round);
    first = round ? exact : mixed;
#endif
    return close ? first : nearer;
}

/* Which lanes may meet a sphere, as far as float32 knows. Of parallel rays it is the test of a parallel light, see
 * sphere_filter_leaves(). The host has made the disc larger by what the axes of the camera are not orthonormal by. */
static __attribute__((always_inline)) MASK passes_filter(const Scene *scene, const EyeLine line, const int index) {
    const FLOAT dx = line.x, dy = line.y;
    const float4 s = scene->eye_filter[index];
    if (HAS(WITH_PARALLEL_RAYS)) {
        const FLOAT du = s.x - dx, dv = s.y - dy;
        return FMA(du, du, dv * dv) <= s.z;
    }
    const FLOAT b = FMA(dx, (FLOAT)s.x, FMA(dy, (FLOAT)s.y, (FLOAT)-s.z));
    return sphere_may_meet(b, line.a, s);
}

#ifdef WITH_ELLIPSOIDS
/* Where the rays meet a sphere or an ellipsoid. inside: of an ellipsoid, whether from there. */
static __attribute__((always_inline)) Meeting meeting_of(const Scene *scene, const Ray ray, const Sphere sphere,
                                                         const int index, REAL_MASK *inside) {
    if (!MAP_OF(scene->geometry, index)) return sphere_meet(scene->geometry, ray, sphere);
    const Ball ball = balls_of(scene->geometry, (INT)index);
    const Leaving path = from_eye(scene->geometry, eye_ray(ray));
    const Encounter met = sphere_meet_from(scene->geometry, path, ball, (INT)index, TO_REAL_MASK(ALL_LANES));
    const Meeting at = {met.t, ray.d};
    *inside = met.inside;
    return at;
}
#else
#define meeting_of(scene, ray, sphere, index, inside) sphere_meet((scene)->geometry, ray, sphere)
#endif

/* Takes a sphere into account, and tells whether any lane may meet it. */
static __attribute__((always_inline)) int sphere_take(const Scene *scene, const Ray ray, EyeLine *line, const int index,
                                                      Hit *hit, Work *work) {
    if (HAS(WITH_FILTER) && !ANY(passes_filter(scene, *line, index))) {
        COUNT(FILTERED, ALL_LANES);
        return 0;
    }
    COUNT(DECIDED, ALL_LANES);
    const Sphere sphere = sphere_at(scene->geometry, index);
    REAL_MASK inside = 0;
    const Meeting at = meeting_of(scene, ray, sphere, index, &inside);
    REAL_MASK nearer = at.t < hit->t;
    if (ANY_LATE || line->found) nearer = closer(scene, ray, sphere, index, at.t, *hit);
    if (ANY_LATE) nearer = nearer_than_any(scene, ray, index, at.t, *hit, nearer);
    line->found = 1;
    hit->t = nearer ? at.t : hit->t;
    hit->id = TO_MASK(nearer) ? (INT)index : hit->id;
    PUT3(PUT_WHERE, nearer, hit->from_center, at.from_center);
    if (HAS(WITH_ELLIPSOIDS)) PUT_WHERE(nearer, hit->inside, inside);
    if (ANY_LATE) put_late(TO_MASK(nearer), near_of(at.t, scene->unit), index, hit);
    return 1;
}

/* A sphere is decided when it is taken. */
#define sphere_settle(scene, ray, hit)
#define sphere_settle_t(scene, ray, hit, t)

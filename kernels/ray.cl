/* ray.cl: the rays from the eye, and those that leave surfaces.
 *
 * Everything is in camera space: the eye is the origin and looks along -z, x is right, y is up. The host has moved the
 * scene there in more than double precision. Lengths are in scene units. Where `real` is float, and in all float
 * buffers, they are multiplied by a power of two that makes the largest coordinate about 1.
 *
 * A primary ray is the points t d, t > 0, with d = (x, y, -1). d is not normalised, which would be one rounding more,
 * so t is in units of |d|. Of an orthographic camera, it is the points o + t d with o = (x, y, 0) and d = (0, 0, -1).
 */

/* A vector of camera space in the world: B^T v. */
static Real3 turned_to_world(const Frame frame, const Real3 v) {
    const Real3 w = {(frame.right.x * v.x + frame.up.x * v.y) + frame.back.x * v.z,
                     (frame.right.y * v.x + frame.up.y * v.y) + frame.back.y * v.z,
                     (frame.right.z * v.x + frame.up.z * v.y) + frame.back.z * v.z};
    return w;
}

/* Rays that leave surfaces. */
typedef struct {
    INT own;         /* index of the surface; -1: none, it comes from the eye */
    REAL_MASK inner; /* whether the ray leaves it on its inside */
    Real3 n, d;      /* the outward unit normal there, and the direction, in camera space */
    /* What follows from these, in the world and rounded. */
    Real3 center;  /* of the own sphere */
    REAL r, reach; /* its radius, and how far it is from there at most */
    Real3 p, w;    /* from that centre to P; the direction */
    REAL w1;       /* |w.x| + |w.y| + |w.z| */
    /* WITH_SHAPES, of an ellipsoid: see shapes/sphere/ellipsoid.cl; of a triangle: the point's u, v and corner, see
     * triangle_leave(); of a ray from an orthographic camera: its place on the plane. */
    Real3 q;
} Leaving;

static Real3 turned_to_camera(const Frame frame, const Real3 v) {
    const Real3 c = {DOT(frame.right, v), DOT(frame.up, v), DOT(frame.back, v)};
    return c;
}

typedef struct {
    REAL a, over_a; /* d.d, 1 / d.d */
    Real3 d;
    /* Of parallel rays only: */
    Real3 o;
    REAL reach; /* |o.x| + |o.y| */
    Real3 w;    /* WITH_SHAPES, the direction in the world; of an orthographic camera, the way from the eye to o */
} Ray;

/* What tells a ray from the others of its camera, in camera space. */
#define OWN(ray) (HAS(WITH_PARALLEL_RAYS) ? (ray).o : (ray).d)

/* That, and the same in the world: all that is passed on of a ray of the camera. */
typedef struct {
    Real3 own, w;
} EyeRay;

static EyeRay eye_ray(const Ray ray) {
    const EyeRay of = {OWN(ray), ray.w};
    return of;
}

/* A ray of the camera as one that leaves a point. The ray of an orthographic camera leaves exactly the eye plus x and y
 * times two axes of the camera. */
static Leaving from_eye(const Spheres spheres, const EyeRay from) {
    const Real3 own = from.own, w = from.w;
    const Real3 eye = {spheres.eye.x, spheres.eye.y, spheres.eye.z}, none = {0, 0, 0};
    if (HAS(WITH_PARALLEL_RAYS)) {
        const Real3 d = {0, 0, -1}, ahead = {spheres.ahead.x, spheres.ahead.y, spheres.ahead.z};
        const Leaving ray = {-1, 0, {1, 0, 0}, d, eye, 0, size_of(own), w, ahead, size_of(ahead), own};
        return ray;
    }
    const Leaving ray = {-1, 0, {1, 0, 0}, own, eye, 0, 0, none, w, size_of(w), none};
    return ray;
}

/* The point of a ray at t. */
static Real3 point_at(const Ray ray, const REAL t) {
    const Real3 seen = {t * ray.d.x, t * ray.d.y, -t}, ahead = {ray.o.x, ray.o.y, -t};
    return HAS(WITH_PARALLEL_RAYS) ? ahead : seen;
}

/* A ray of the camera with all that ellipsoids and triangles need of it. */
static Ray for_shapes(const Frame frame, Ray ray) {
    if (HAS(WITH_SHAPES)) ray.w = turned_to_world(frame, OWN(ray));
    return ray;
}

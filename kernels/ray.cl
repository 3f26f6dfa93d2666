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

#ifdef WITH_LEAVING
/* Rays that leave surfaces. */
typedef struct {
    INT own;         /* index of the surface */
    REAL_MASK inner; /* whether the ray leaves it on its inside */
    Real3 n, d;      /* the outward unit normal there, and the direction, in camera space */
    /* What follows from these, in the world and rounded. */
    Real3 center;  /* of the own sphere */
    REAL r, reach; /* its radius, and how far it is from there at most */
    Real3 p, w;    /* from that centre to P; the direction */
    REAL w1;       /* |w.x| + |w.y| + |w.z| */
#ifdef WITH_SHAPES
    /* Of an ellipsoid: see shapes/ellipsoid.cl; of a triangle: the point's u, v and corner, see leave_triangle(); of a ray
     * from an orthographic camera: its place on the plane. */
    Real3 q;
#endif
#ifdef WITH_ELLIPSOIDS
    INT map; /* of the own surface */
#endif
} Leaving;

static Real3 turned_to_camera(const Frame frame, const Real3 v) {
    const Real3 c = {DOT(frame.right, v), DOT(frame.up, v), DOT(frame.back, v)};
    return c;
}

/* |x| + |y| + |z|. */
static REAL size_of(const Real3 v) {
    return (fabs(v.x) + fabs(v.y)) + fabs(v.z);
}
#endif

typedef struct {
    REAL a, over_a; /* d.d, 1 / d.d */
    Real3 d;
#ifdef WITH_PARALLEL_RAYS
    Real3 o;
    REAL reach; /* |o.x| + |o.y| */
#endif
#ifdef WITH_ELLIPSOIDS
    Leaving leaving; /* the same, as a ray that leaves a point */
#endif
#ifdef WITH_TRIANGLES
    Real3 w; /* the direction in the world; of an orthographic camera, the way from the eye to o */
#endif
} Ray;

/* What tells a ray from the others of its camera, in camera space: with w, all that is passed on of it. */
#ifdef WITH_PARALLEL_RAYS
#define OWN(ray) ray.o
#else
#define OWN(ray) ray.d
#endif

#if defined(WITH_ELLIPSOIDS) && !defined(WITH_PARALLEL_RAYS)
/* A ray from the eye, as one that leaves a point. */
static Leaving leaving_eye(const Frame frame, const Spheres spheres, const Real3 d) {
    Leaving ray = {-1, 0, {1, 0, 0}, d, {spheres.eye.x, spheres.eye.y, spheres.eye.z}, 0, 0, {0, 0, 0}};
    ray.w = turned_to_world(frame, d);
    ray.w1 = size_of(ray.w);
    const Real3 none = {0, 0, 0};
    ray.q = none;
#ifdef WITH_ELLIPSOIDS
    ray.map = 0;
#endif
    return ray;
}
#endif

#if defined(WITH_PARALLEL_RAYS) && defined(WITH_SHAPES)
/* A ray of an orthographic camera as one that leaves a point: exactly the eye plus x and y times two axes of the camera.
 * o: (x, y, 0); p: the same in the world. */
static Leaving from_eye(const Spheres spheres, const Real3 o, const Real3 p) {
    const Real3 d = {0, 0, -1}, w = {spheres.ahead.x, spheres.ahead.y, spheres.ahead.z};
    Leaving ray = {-1, 0, {1, 0, 0}, d, {spheres.eye.x, spheres.eye.y, spheres.eye.z}, 0, size_of(o), p, w, size_of(w), o};
#ifdef WITH_ELLIPSOIDS
    ray.map = 0;
#endif
    return ray;
}
#elif defined(WITH_TRIANGLES)
/* The same where w, the direction in the world, is known. */
static Leaving from_eye(const Spheres spheres, const Real3 d, const Real3 w) {
    const Real3 none = {0, 0, 0};
    Leaving ray = {-1, 0, {1, 0, 0}, d, {spheres.eye.x, spheres.eye.y, spheres.eye.z}, 0, 0, none, w, size_of(w), none};
    return ray;
}
#endif

/* The rays through the centres of the packet's pixels; row 0 is the top. size: of the whole picture. */
static Ray primary_ray(const Frame frame, const int2 size, const INT column, const INT row) {
    Ray ray;
#ifdef WITH_PARALLEL_RAYS
    ray.o.x = TO_REAL(2 * column + 1 - size.x) * frame.pixel.x;
    ray.o.y = TO_REAL(size.y - 1 - 2 * row) * frame.pixel.y;
    ray.o.z = ray.d.x = ray.d.y = 0;
    ray.d.z = -1;
    ray.a = ray.over_a = 1;
    ray.reach = fabs(ray.o.x) + fabs(ray.o.y);
#else
    ray.d.x = TO_REAL(2 * column + 1 - size.x) * frame.pixel.x;
    ray.d.y = TO_REAL(size.y - 1 - 2 * row) * frame.pixel.y;
    ray.d.z = -1;
    ray.a = (ray.d.x * ray.d.x + ray.d.y * ray.d.y) + 1;
    ray.over_a = 1 / ray.a;
#endif
    return ray;
}

/* The point of a ray at t. */
#ifdef WITH_PARALLEL_RAYS
#define POINT_OF(ray, t) {ray.o.x, ray.o.y, -t}
#else
#define POINT_OF(ray, t) {t * ray.d.x, t * ray.d.y, -t}
#endif

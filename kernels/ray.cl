/* ray.cl: the rays from the eye.
 *
 * Everything is in camera space: the eye is the origin and looks along -z, x is right, y is up. The host has moved the
 * scene there in more than double precision. Lengths are in scene units. Where `real` is float, and in all float
 * buffers, they are multiplied by a power of two that makes the largest coordinate about 1.
 *
 * A primary ray is the points t d, t > 0, with d = (x, y, -1). d is not normalised, which would be one rounding more,
 * so t is in units of |d|.
 */

typedef struct {
    REAL a, over_a; /* d.d, 1 / d.d */
    Real3 d;
} Ray;

/* The rays through the centres of the packet's pixels; row 0 is the top. size: of the whole picture. */
static Ray primary_ray(const Frame frame, const int2 size, const INT column, const INT row) {
    Ray ray;
    ray.d.x = TO_REAL(2 * column + 1 - size.x) * frame.pixel.x;
    ray.d.y = TO_REAL(size.y - 1 - 2 * row) * frame.pixel.y;
    ray.d.z = -1;
    ray.a = (ray.d.x * ray.d.x + ray.d.y * ray.d.y) + 1;
    ray.over_a = 1 / ray.a;
    return ray;
}

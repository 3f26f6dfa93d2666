/* ray.cl: the rays from the eye.
 *
 * Everything is in camera space: the eye is the origin and looks along -z, x is right, y is up. A primary ray is t d
 * with d = (x, y, -1), not normalised: that is one rounding less, and t comes out in units of d. The host has moved the
 * scene there in more than double precision. Where `real` is float, and in all float buffers, lengths are times a power
 * of two that makes the largest coordinate about 1.
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

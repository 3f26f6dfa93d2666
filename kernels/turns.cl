/* turns.cl: angles of vectors. A turn is TURN radians. */

/* atan(r) / (2 pi r) for |r| <= tan(pi / 8), by powers of r^2: a Chebyshev interpolant of (atan(r) - r) / r^3 on that
 * range, behind the 1 of the series. Without rounding of what is computed from them, its relative error is 2^-53 in
 * double and 2^-24 in float. */
#if REAL_BYTES == 8
#define TURN 6.2831853071795862
#define TAN_PI_8 0.41421356237309503
#define TURNS 12
__constant double turn_parts[TURNS] = {0.15915494309189535,    -0.053051647697298442, 0.031830988618371941,
                                       -0.022736420440031799,  0.017683882413208576,  -0.014468624007851604,
                                       0.012242489779883597,   -0.010606899401433589, 0.0093235335684088427,
                                       -0.0080937446363857617, 0.0062439123434348629, -0.0030520963781140546};
#else
#define TURN 6.28318531f
#define TAN_PI_8 0.41421357f
#define TURNS 6
__constant float turn_parts[TURNS] = {0.15915494f,    -0.0530516468f, 0.0318302587f,
                                      -0.0227017906f, 0.0170991793f,  -0.0102685625f};
#endif

/* The angle of the vector (x, y) from the x axis in turns, -1/2 .. 1/2: what atan2(y, x) / (2 pi) is, by operations
 * that are rounded the same everywhere. Of multiples of an eighth turn it is exactly that; of (0, 0) it is 0.
 *
 * It is off by less than 2^-51, or in float 2^-21. With u = 2^-53: the quotient r is off by 3 u r, which is as much of
 * the angle at most; the sum of the series by 2 u for its last steps and what is said above, as its later terms are
 * small; the product by u. That is less than 8 u of an angle of 1/16 turn at most. Each of the three sums that follow
 * adds u/2 of a number up to 1/2. So all of it is below 2 u; in float likewise. */
static REAL turns_of(const REAL y, const REAL x) {
    const REAL h = fabs(y), w = fabs(x);
    const REAL_MASK steep = h > w;
    const REAL low = steep ? w : h, high = steep ? h : w;
    const REAL_MASK large = low > high * TAN_PI_8;
    const REAL over = large ? low + high : high;
    const REAL r = (large ? low - high : low) / (over > 0 ? over : (REAL)1);
    const REAL square = r * r;
    REAL sum = turn_parts[TURNS - 1];
    for (int k = TURNS - 2; k >= 0; k--) sum = sum * square + turn_parts[k];
    const REAL octant = r * sum + (large ? (REAL)0.125f : (REAL)0);
    const REAL quadrant = steep ? (REAL)0.25f - octant : octant;
    const REAL angle = x < 0 ? (REAL)0.5f - quadrant : quadrant;
    return y < 0 ? -angle : angle;
}

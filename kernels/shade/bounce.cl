/* bounce.cl: where mirrors and glass send a ray on. cltrace/reference/bounce.py has the same functions.
 *
 * Directions are never normalised on the way: their length stays that of the first one, but for rounding. n is the
 * outward unit normal; side is 1 where the ray came from outside and -1 where it came from inside. spread: of an
 * ellipsoid by how much its map may make an error larger, of a sphere 1.
 */
#ifdef WITH_BOUNCES
#define LIFT ((real)(REAL_BYTES == 8 ? 0x1p-48f : 0x1p-19f))

/* The direction, turned off the surface where rounding left it not surely on its side: there n.d is less than LIFT |d|,
 * and all that is off in it, here and in the decision about the own surface, is below that. */
static Real3 lift(Real3 d, const Real3 n, const REAL side, const REAL spread) {
    const REAL e = side * DOT(n, d), least = LIFT * size_of(d) * spread;
    const REAL more = e > least ? (REAL)0 : side * (2 * least - e);
    d.x += more * n.x;
    d.y += more * n.y;
    d.z += more * n.z;
    return d;
}

static Real3 mirrored(const Real3 d, const Real3 n, const REAL side, const REAL spread) {
    const REAL k = 2 * DOT(n, d);
    const Real3 out = {d.x - k * n.x, d.y - k * n.y, d.z - k * n.z};
    return lift(out, n, side, spread);
}

typedef struct {
    Real3 d;
    REAL_MASK total; /* whether all of it is reflected instead, and d is of no use */
} Refraction;

/* After Snell: with N facing the ray and c = -N.d, the part of d along the surface, d + c N, becomes eta times as long,
 * and the rest of |d| is along -N. Where nothing is left for that, reflection is total. (d x n)^2 keeps the digits that
 * 1 - c^2 would lose. */
static Refraction refracted(const Real3 d, const Real3 n, const REAL side, const REAL index, const REAL spread) {
    const REAL eta = side > 0 ? 1 / index : index, c = -(side * DOT(n, d));
    const Real3 N = {side * n.x, side * n.y, side * n.z};
    const Real3 X = {n.y * d.z - n.z * d.y, n.z * d.x - n.x * d.z, n.x * d.y - n.y * d.x};
    const REAL k = DOT(d, d) - (eta * eta) * DOT(X, X), root = sqrt(k > 0 ? k : (REAL)0);
    const REAL_MASK same = index == 1;
    const Real3 bent = {eta * (d.x + c * N.x) - root * N.x, eta * (d.y + c * N.y) - root * N.y,
                        eta * (d.z + c * N.z) - root * N.z};
    Refraction out = {lift(bent, n, -side, spread), !same & (k < 0)};
    out.d.x = same ? d.x : out.d.x;
    out.d.y = same ? d.y : out.d.y;
    out.d.z = same ? d.z : out.d.z;
    return out;
}
#endif

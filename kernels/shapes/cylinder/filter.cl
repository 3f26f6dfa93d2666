/* filter.cl: what float32 is sure of about a line and a cylinder, so that few are left for doubles.
 *
 * With the middle M of the axis, e along it, of length 1, half of its length h, the radius r, and f from a point O of
 * the line to M, the line O + t w passes the axis with a = |G|^2, V = f.G, G = w x e, at the t = b / a that is closest
 * to it, b = f.w - (f.e) (w.e). There it is Y / a along the axis from M, Y = (w.e) (f.w) - |w|^2 (f.e). It is within
 * the endless cylinder for t = (b +/- sqrt(D)) / a, D = r^2 a - V^2, and so from Y / a - |w.e| sqrt(D) / a to
 * Y / a + |w.e| sqrt(D) / a along the axis: it meets the solid if and only if D >= 0 and |Y| <= h a + |w.e| sqrt(D).
 *
 * Let u = 2^-24, A = w.w, and s the sum of the magnitudes of the coordinates of M and of O. M, O, e, h, r and w are
 * rounded to float once, doubles' own roundings are below u / 16 of these, and a vector of products of two vectors,
 * each of which is rounded and added, is off by 3.01 u of their lengths at most, a cross product by 2.9 u. So
 *     f is off by 2.1 u s, w by 1.1 u |w|, e by 1.1 u, G by (1.1 + 1.1 + 2.9) u |w|, w.e by (1.1 + 1.1 + 3.1) u |w|,
 *     V by (2.1 + 5.1 + 3.1) u s |w|, f.w by (2.1 + 1.1 + 3.1) u s |w|, f.e by (2.1 + 1.1 + 3.1) u s,
 *     A by (2.2 + 3.1) u A, Y by (5.3 + 6.3 + 5.3 + 6.3) u s A and 4.1 u s A when it is added up, a by 14 u A.
 * D: with E = 2^-20 (r + s) = 16 u (r + s), |V| + 10.3 u s |w|, of which the square counts where |V| is at most about
 * r |w|, is more than V^2 by (2 r 10.3 u s + (10.3 u s)^2) A, and r^2 a is off by 14 u r^2 A, and 6 u r^2 A by r^2 and
 * the sum: all of that is below W A, W = E (2 r + E) = (32 u r (r + s) + E^2). Y: |w.e| sqrt(D) is off by less than
 * 24 u r A beside what D is off by, h a by 17 u h A, and sums by 4 u of all: with Y, below R A, R = 2^-18 (s + h
 * + r). What float loses below its range is less than 2^-100, and A at least 2^-40.
 */

/* What float says of lines and a cylinder, in the float buffers' unit: lanes whose lines may meet it; of what is above,
 * a, b, Y and w.e; what b is off by, times 1 / |w|; bounds of sqrt(D); and how large Y and what is added to it may be
 * where that is surely between the discs, negative where the line may pass beside. */
typedef struct {
    MASK may;
    FLOAT a, b, Y, we, error, least, most, room;
} RodLine;

/* seen: two of Scene's rod_seen. Where no lane may meet the cylinder, the rest is not made. */
static __attribute__((always_inline)) RodLine rod_line(__global const float4 *seen, const Float3 O, const Float3 w,
                                                       const FLOAT A) {
    const float4 middle = seen[0], axis = seen[1];
    const float h = middle.w, r = axis.w, m = (fabs(middle.x) + fabs(middle.y)) + fabs(middle.z);
    const Float3 f = {middle.x - O.x, middle.y - O.y, middle.z - O.z};
    const Float3 G = {FMA(w.y, (FLOAT)axis.z, -(w.z * axis.y)), FMA(w.z, (FLOAT)axis.x, -(w.x * axis.z)),
                      FMA(w.x, (FLOAT)axis.y, -(w.y * axis.x))};
    const FLOAT V = FMA(f.x, G.x, FMA(f.y, G.y, f.z * G.z)), a = FMA(G.x, G.x, FMA(G.y, G.y, G.z * G.z));
    const FLOAT s = m + ((magnitude(O.x) + magnitude(O.y)) + magnitude(O.z));
    const FLOAT E = 0x1p-20f * (r + s), D_error = FMA(E * (2 * r + E), A, (FLOAT)0x1p-100f);
    const FLOAT D = FMA((FLOAT)(r * r), a, -(V * V)), most = D + D_error, least = D - D_error;
    RodLine is;
    is.may = most >= 0;
    if (!ANY(is.may)) return is;
    const FLOAT we = dot_float(w, axis), fe = dot_float(f, axis), fw = FMA(f.x, w.x, FMA(f.y, w.y, f.z * w.z));
    const FLOAT Y_error = FMA(0x1p-18f * (s + (h + r)), A, (FLOAT)0x1p-100f);
    is.a = a;
    is.b = fw - fe * we;
    is.Y = FMA(we, fw, -(A * fe));
    is.we = we;
    is.error = 0x1p-19f * s;
    is.least = sqrt(least > 0 ? least : (FLOAT)0);
    is.most = sqrt(most > 0 ? most : (FLOAT)0);
    is.room = least > 0 ? h * a - Y_error : (FLOAT)-1;
    is.may = is.may & (magnitude(is.Y) <= FMA((FLOAT)h, a, magnitude(we) * is.most) + Y_error);
    return is;
}

/* The lanes whose lines are surely between the discs where they enter the endless cylinder (end = -1), are closest to
 * its axis (0) or leave it (1). */
static MASK is_between_discs(const RodLine line, const float end) {
    const FLOAT one = FMA(end * line.we, line.least, line.Y), other = FMA(end * line.we, line.most, line.Y);
    return (magnitude(one) < line.room) & (magnitude(other) < line.room);
}

/* phong.cl: the highlight of Phong's formula. */

#if SHADE_BYTES == 4
/* log(1 + z) for z in (-1, 0] and exp(y) for y <= 0, in float, by operations that are rounded the same everywhere: the
 * standard lets log1p, exp and pow differ between devices, and drivers compute them one lane at a time.
 * The polynomials are Chebyshev interpolants, of (log(1 + f) - f + f^2/2) / f^3 on sqrt(1/2) - 1 .. sqrt(2) - 1 and of
 * exp on -log(2)/2 .. log(2)/2. Without rounding their relative errors are 2.5e-8 and 2.5e-9.
 */
static FLOAT log_1_plus(const FLOAT z) {
    const FLOAT s = 1.0f + z;
    const INT power = (AS(int, s) - 0x3f3504f3) >> 23; /* s = 2^power m, m in sqrt(1/2) .. sqrt(2) */
    const FLOAT m = AS(float, AS(int, s) - (power << 23));
    const FLOAT f = power == 0 ? z : m - 1.0f; /* z itself where 1 + z lost its digits */
    FLOAT g = -0.0790274377f;
    g = FMA(g, f, (FLOAT)0.126223198f);
    g = FMA(g, f, (FLOAT)-0.129981838f);
    g = FMA(g, f, (FLOAT)0.142144959f);
    g = FMA(g, f, (FLOAT)-0.166412815f);
    g = FMA(g, f, (FLOAT)0.200010451f);
    g = FMA(g, f, (FLOAT)-0.250003064f);
    g = FMA(g, f, (FLOAT)0.333333307f);
    g = FMA(g, f, (FLOAT)-0.5f);
    return FMA(TO_FLOAT(power), (FLOAT)0.693147181f, FMA(g * f, f, f));
}

static FLOAT exp_negative(const FLOAT y) {
    const FLOAT x = y < -87.0f ? (FLOAT)-87.0f : y; /* below, the result is 0 at any rate */
    const FLOAT k = FMA(x, (FLOAT)1.44269504f, (FLOAT)12582912.0f) - 12582912.0f;    /* x / log(2), rounded */
    const FLOAT f = FMA(k, (FLOAT)-1.42860677e-6f, FMA(k, (FLOAT)-0.693145752f, x)); /* log(2) in two parts */
    FLOAT g = 0.00139411084f;
    g = FMA(g, f, (FLOAT)0.0083751264f);
    g = FMA(g, f, (FLOAT)0.0416663529f);
    g = FMA(g, f, (FLOAT)0.166664155f);
    g = FMA(g, f, (FLOAT)0.500000005f);
    g = FMA(g, f, (FLOAT)1.00000004f);
    g = FMA(g, f, (FLOAT)1.0f);
    const FLOAT two_to_k = AS(float, (TO_INT(k) + 127) << 23);
    return y < -87.0f ? (FLOAT)0.0f : g * two_to_k;
}
#else
#define log_1_plus(z) log1p(z)
#define exp_negative(y) exp(y)
#endif

/* max(0, r.v)^exponent for unit vectors r and v; 0^0 = 1. z = r.v - 1, computed as -|r - v|^2 / 2. So z is never
 * above 0, and it keeps all digits where r.v is close to 1: then the power loses none, however large the exponent. */
static SHADE lobe(const SHADE z, const SHADE exponent) {
    const SHADE_MASK facing = z > -1;
    const SHADE power = exp_negative(exponent * log_1_plus(facing ? z : (SHADE)0));
    return facing ? power : (exponent == 0 ? (SHADE)1 : (SHADE)0);
}

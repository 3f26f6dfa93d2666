/* packet.cl: the number types, and what a packet of pixels is.
 *
 * A work-item owns a packet of W pixels and computes them side by side in vectors of W lanes: 4 columns by W/4 rows on
 * a CPU (W = 4, 8 or 16), one pixel on a GPU (W = 1). The same source serves all of them. A lane never looks at another
 * one, except to ask whether any lane still needs some work, and how far the furthest one has to look. So a picture
 * does not depend on W.
 *
 * What is compiled is set by -D flags: the host derives them from scene, outputs and device. FLAGS in
 * cltrace/plan/abi.py lists them all, and what each one means.
 *
 * Contraction is off and every FMA is spelled out: each other expression is rounded as it stands, so that all devices
 * and the reference compute the same bits where real is double. None of the built-in dot, cross, length, normalize is
 * used: the standard bounds their errors only absolutely.
 */
#pragma OPENCL FP_CONTRACT OFF

#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)

#if W == 1
#define LANES(type) type
#else
#define LANES(type) PASTE(type, W)
#endif
#define TO(type, x) PASTE(convert_, LANES(type))(x)
#define AS(type, x) PASTE(as_, LANES(type))(x)

/* Tells a CPU to fetch what is at an index of an array. OpenCL's own prefetch() does nothing on the CPU drivers. */
#if W > 1 && defined(__has_builtin)
#if __has_builtin(__builtin_prefetch)
#define FETCH(array, index) __builtin_prefetch((const void *)(uintptr_t)((array) + (index)))
#endif
#endif

/* real: the precision that decides. shade_t: the precision of colours. */
#if REAL_BYTES == 8
typedef double real;
typedef double2 real2;
typedef double4 real4;
typedef LANES(double) REAL;
#define TO_REAL(x) TO(double, x)
#define REAL_INT LANES(long)
#define TO_REAL_INT(x) TO(long, x)
#else
typedef float real;
typedef float2 real2;
typedef float4 real4;
typedef LANES(float) REAL;
#define TO_REAL(x) TO(float, x)
#define REAL_INT LANES(int)
#define TO_REAL_INT(x) (x)
#endif
#if SHADE_BYTES == 8
typedef double shade_t;
typedef double8 shade8;
typedef LANES(double) SHADE;
#define TO_SHADE(x) TO(double, x)
#define SHADE_INT LANES(long)
#define TO_SHADE_INT(x) TO(long, x)
#else
typedef float shade_t;
typedef float8 shade8;
typedef LANES(float) SHADE;
#define TO_SHADE(x) TO(float, x)
#define SHADE_INT LANES(int)
#define TO_SHADE_INT(x) TO(int, x)
#endif
typedef LANES(float) FLOAT;
typedef LANES(int) INT;
typedef LANES(long) LONG;
#define TO_FLOAT(x) TO(float, x)
#define TO_LONG(x) TO(long, x)
#define TO_INT(x) TO(int, x)

/* A mask is what a comparison gives: -1 or 0 in each lane, as wide as the numbers that were compared. With W = 1 it is
 * an int, 1 or 0. */
#if W == 1
typedef int MASK;       /* of INT and FLOAT */
typedef int REAL_MASK;  /* of REAL */
typedef int SHADE_MASK; /* of SHADE */
#define TO_MASK(m) (m)
#define TO_REAL_MASK(m) (m)
#define TO_SHADE_MASK(m) (m)
#else
typedef INT MASK;
typedef REAL_INT REAL_MASK;
typedef SHADE_INT SHADE_MASK;
#define TO_MASK(m) TO_INT(m)
#define TO_REAL_MASK(m) TO_REAL_INT(m)
#define TO_SHADE_MASK(m) TO_SHADE_INT(m)
#endif

#if W == 1
#define ALL_LANES 1
#else
#define ALL_LANES ((MASK)(-1))
#endif

/* ANY: whether any lane of a MASK is set. LARGEST: the largest lane of an INT. On the CPU drivers the built-in any()
 * looks at one lane after the other, which cost more than all arithmetic: 64 spheres took three times as long. */
#if W == 1
#define ANY(mask) (mask)
#define LARGEST(value) (value)
#else
#ifdef __has_builtin
#if __has_builtin(__builtin_reduce_or) && __has_builtin(__builtin_reduce_max)
#if W == 16 && (defined(WITH_TRIANGLES) || defined(WITH_BLOCKS)) && defined(__AVX512DQ__)
#define ANY(mask) (__builtin_ia32_cvtd2mask512(mask) != 0)
#else
#define ANY(mask) (__builtin_reduce_or(mask) != 0)
#endif
#define LARGEST(value) __builtin_reduce_max(value)
#endif
#endif
#ifndef ANY
static int any_lane(const MASK mask) {
#if W == 4
    const int4 quarter = mask;
#else
#if W == 16
    const int8 half = mask.lo | mask.hi;
#else
    const int8 half = mask;
#endif
    const int4 quarter = half.lo | half.hi;
#endif
    const int2 pair = quarter.lo | quarter.hi;
    return (pair.x | pair.y) != 0;
}
#define ANY(mask) any_lane(mask)
static int LARGEST(const INT x) {
#if W == 4
    const int4 quarter = x;
#else
#if W == 16
    const int8 half = x.lo > x.hi ? x.lo : x.hi;
#else
    const int8 half = x;
#endif
    const int4 quarter = half.lo > half.hi ? half.lo : half.hi;
#endif
    const int2 pair = quarter.lo > quarter.hi ? quarter.lo : quarter.hi;
    return pair.x > pair.y ? pair.x : pair.y;
}
#endif
#endif
/* The largest lane of a FLOAT, all >= 0: read as whole numbers, the bits of such floats are in the same order. */
#define LARGEST_FLOAT(value) as_float(LARGEST(AS(int, value)))

/* Writes the lanes to an array in memory, and reads them. */
#if W == 1
#define STORE_LANES(value, array) (array)[0] = (value)
#define LOAD_LANES(array) (array)[0]
#else
#define STORE_LANES(value, array) PASTE(vstore, W)(value, 0, array)
#define LOAD_LANES(array) PASTE(vload, W)(0, array)
#endif

/* `member` of what is in an array of one thing for each lane, as a vector. An array that only this reads is in no memory. */
#define FOUR_OF(array, k, member) (array)[k] member, (array)[k + 1] member, (array)[k + 2] member, (array)[k + 3] member
#if W == 1
#define EACH_LANE(array, member) ((array)[0] member)
#elif W == 4
#define EACH_LANE(array, member) (FOUR_OF(array, 0, member))
#elif W == 8
#define EACH_LANE(array, member) (FOUR_OF(array, 0, member), FOUR_OF(array, 4, member))
#else
#define EACH_LANE(array, member) \
    (FOUR_OF(array, 0, member), FOUR_OF(array, 4, member), FOUR_OF(array, 8, member), FOUR_OF(array, 12, member))
#endif

/* Where the lanes are within the packet: 4 columns, W/4 rows. */
#if W == 1
#define PACKET_WIDTH 1
#define PACKET_HEIGHT 1
#define LANE_COLUMN 0
#define LANE_ROW 0
#elif W == 4
#define PACKET_WIDTH 4
#define PACKET_HEIGHT 1
#define LANE_COLUMN ((INT)(0, 1, 2, 3))
#define LANE_ROW ((INT)(0, 0, 0, 0))
#elif W == 8
#define PACKET_WIDTH 4
#define PACKET_HEIGHT 2
#define LANE_COLUMN ((INT)(0, 1, 2, 3, 0, 1, 2, 3))
#define LANE_ROW ((INT)(0, 0, 0, 0, 1, 1, 1, 1))
#elif W == 16
#define PACKET_WIDTH 4
#define PACKET_HEIGHT 4
#define LANE_COLUMN ((INT)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3))
#define LANE_ROW ((INT)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3))
#else
#error "W must be 1, 4, 8 or 16"
#endif

/* Real3 and Float3: a point or a direction for each lane, in camera space unless told otherwise. Shade3: a colour for
 * each lane, linear, or a direction in the precision of colours. */
typedef struct {
    REAL x, y, z;
} Real3;
typedef struct {
    FLOAT x, y, z;
} Float3;
#if SHADE_BYTES == 8
typedef Real3 Shade3;
#else
typedef Float3 Shade3;
#endif

/* a b + c in float, where one rounding or two are equally good. */
#ifdef NO_FMA
#define FMA(a, b, c) ((a) * (b) + (c))
#else
#define FMA(a, b, c) fma(a, b, c)
#endif

/* (x x' + y y') + z z', rounded in this order. */
#define DOT(a, b) (((a).x * (b).x + (a).y * (b).y) + (a).z * (b).z)

/* A condition that hardly ever holds. Compilers then keep what it needs out of the way, and more of what is needed all
 * the time in registers: frames take 0.97 of the time. */
#ifdef __has_builtin
#if __has_builtin(__builtin_expect)
#define RARELY(condition) __builtin_expect(condition, 0)
#endif
#endif
#ifndef RARELY
#define RARELY(condition) (condition)
#endif

/* |x|, by operators alone. */
static FLOAT magnitude(const FLOAT x) {
    return AS(float, AS(int, x) & 0x7fffffff);
}

/* FOR_EACH_INDEX is for reading what each lane has in memory at its own index, such as its sphere's material. The block
 * that follows it runs once for each run of neighbouring lanes with the same index, and `one` is that index: mostly all
 * lanes have the same one. Lanes with a negative index are left out. In the block, PUT_WHERE puts a value into those
 * lanes of a variable that a mask names. */
#define FOR_EACH_INDEX(one, index)          \
    int one##_[W], one = -1;                \
    STORE_LANES(index, one##_);             \
    for (int lane = 0; lane < W; lane++)    \
        if (one##_[lane] != one && one##_[lane] >= 0 && ((one = one##_[lane]), 1))
#define PUT_WHERE(mask, variable, value) variable = (mask) ? (value) : (variable)

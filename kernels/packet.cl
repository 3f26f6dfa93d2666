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

/* 1 if a flag of the host's is set, which -D defines as 1, else 0: compilers leave out what is behind `if (HAS(flag))`.
 * Only flags of the table can be asked for: of each, the host's header says #define IS_<flag> 0. */
#define HAS(flag) PASTE(IS_, flag)
#define IS_1 1

/* What else a compiler knows of itself. */
#ifndef __has_builtin
#define __has_builtin(name) 0
#endif

/* `type` for each lane. */
#define LANES(type) PASTE(LANES_OF_, W)(type)
#define LANES_OF_1(type) type
#define LANES_OF_4(type) type##4
#define LANES_OF_8(type) type##8
#define LANES_OF_16(type) type##16
#define TO(type, x) PASTE(convert_, LANES(type))(x)
#define AS(type, x) PASTE(as_, LANES(type))(x)

/* Tells a CPU to fetch what is at an index of an array. OpenCL's own prefetch() does nothing on the CPU drivers. */
#if W > 1 && __has_builtin(__builtin_prefetch)
#define CAN_FETCH 1
#define FETCH(array, index) __builtin_prefetch((const void *)(uintptr_t)((array) + (index)))
#else
#define CAN_FETCH 0
#define FETCH(array, index)
#endif

typedef LANES(float) FLOAT;
typedef LANES(int) INT;
typedef LANES(long) LONG;
#define TO_FLOAT(x) TO(float, x)
#define TO_LONG(x) TO(long, x)
#define TO_INT(x) TO(int, x)

/* real: the precision that decides. shade_t: the precision of colours. */
#if REAL_BYTES == 8
typedef double real;
typedef double2 real2;
typedef double4 real4;
typedef LANES(double) REAL;
#define TO_REAL(x) TO(double, x)
#define REAL_INT LANES(long)
#define TO_REAL_INT(x) TO(long, x)
/* A power of two with the exponent of x > 0. */
#define POWER_OF_TWO(x) AS(double, AS(long, x) & 0x7ff0000000000000L)
#else
typedef float real;
typedef float2 real2;
typedef float4 real4;
typedef LANES(float) REAL;
#define TO_REAL(x) TO(float, x)
#define REAL_INT LANES(int)
#define TO_REAL_INT(x) (x)
#define POWER_OF_TWO(x) AS(float, AS(int, x) & 0x7f800000)
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
typedef double shade_t;
typedef double4 shade4;
typedef double8 shade8;
typedef LANES(double) SHADE;
typedef Real3 Shade3;
#define TO_SHADE(x) TO(double, x)
#define SHADE_INT LANES(long)
#define TO_SHADE_INT(x) TO(long, x)
#else
typedef float shade_t;
typedef float4 shade4;
typedef float8 shade8;
typedef LANES(float) SHADE;
typedef Float3 Shade3;
#define TO_SHADE(x) TO(float, x)
#define SHADE_INT LANES(int)
#define TO_SHADE_INT(x) TO(int, x)
#endif

/* A mask is what a comparison gives: -1 or 0 in each lane, as wide as the numbers that were compared. With W = 1 it is
 * an int, 1 or 0. MASK: of INT and FLOAT; REAL_MASK: of REAL; SHADE_MASK: of SHADE.
 *
 * ANY: whether any lane of a MASK is set. LARGEST: the largest lane of an INT. On the CPU drivers the built-in any()
 * looks at one lane after the other, which cost more than all arithmetic: 64 spheres took three times as long.
 *
 * STORE_LANES writes the lanes to an array in memory, and LOAD_LANES reads them. EACH_LANE is `member` of what is in an
 * array of one thing for each lane, as a vector: an array that only this reads is in no memory. LANE_COLUMN, LANE_ROW:
 * where the lanes are within the packet, which has 4 columns and W/4 rows. */
#define FOUR_OF(array, k, member) (array)[k] member, (array)[k + 1] member, (array)[k + 2] member, (array)[k + 3] member
#if W == 1
typedef int MASK;
typedef int REAL_MASK;
typedef int SHADE_MASK;
#define ALL_LANES 1
#define TO_MASK(m) (m)
#define TO_REAL_MASK(m) (m)
#define TO_SHADE_MASK(m) (m)
#define ANY(mask) (mask)
#define LARGEST(value) (value)
#define SUM(value) (value)
#define LANE_NUMBER 0
#define STORE_LANES(value, array) (array)[0] = (value)
#define LOAD_LANES(array) (array)[0]
#define EACH_LANE(array, member) ((array)[0] member)
#define PACKET_WIDTH 1
#define PACKET_HEIGHT 1
#define LANE_COLUMN 0
#define LANE_ROW 0
#else
typedef INT MASK;
typedef REAL_INT REAL_MASK;
typedef SHADE_INT SHADE_MASK;
#define ALL_LANES ((MASK)(-1))
#define TO_MASK(m) TO_INT(m)
#define TO_REAL_MASK(m) TO_REAL_INT(m)
#define TO_SHADE_MASK(m) TO_SHADE_INT(m)
#if !(__has_builtin(__builtin_reduce_or) && __has_builtin(__builtin_reduce_max))
#define ANY(mask) (PASTE(any_of_, W)(mask) != 0)
#define LARGEST(value) PASTE(largest_of_, W)(value)
#elif W == 16 && (defined(WITH_TRIANGLES) || defined(WITH_SAMPLES)) && defined(__AVX512DQ__)
#define ANY(mask) (__builtin_ia32_cvtd2mask512(mask) != 0)
#define LARGEST(value) __builtin_reduce_max(value)
#else
#define ANY(mask) (__builtin_reduce_or(mask) != 0)
#define LARGEST(value) __builtin_reduce_max(value)
#endif
#define STORE_LANES(value, array) PASTE(vstore, W)(value, 0, array)
#define LOAD_LANES(array) PASTE(vload, W)(0, array)
#define EACH_LANE(array, member) PASTE(EACH_LANE_OF_, W)(array, member)
#define EACH_LANE_OF_4(array, member) (FOUR_OF(array, 0, member))
#define EACH_LANE_OF_8(array, member) (FOUR_OF(array, 0, member), FOUR_OF(array, 4, member))
#define EACH_LANE_OF_16(array, member) \
    (FOUR_OF(array, 0, member), FOUR_OF(array, 4, member), FOUR_OF(array, 8, member), FOUR_OF(array, 12, member))
#define PACKET_WIDTH 4
#define PACKET_HEIGHT (W / 4)
#define SUM(value) PASTE(sum_of_, W)(value)
#define LANE_NUMBER (4 * LANE_ROW + LANE_COLUMN)
#define LANE_COLUMN ((INT)(PASTE(COLUMNS_OF_, W)))
#define LANE_ROW ((INT)(PASTE(ROWS_OF_, W)))
#define COLUMNS_OF_4 0, 1, 2, 3
#define COLUMNS_OF_8 COLUMNS_OF_4, COLUMNS_OF_4
#define COLUMNS_OF_16 COLUMNS_OF_8, COLUMNS_OF_8
#define ROWS_OF_4 0, 0, 0, 0
#define ROWS_OF_8 ROWS_OF_4, 1, 1, 1, 1
#define ROWS_OF_16 ROWS_OF_8, 2, 2, 2, 2, 3, 3, 3, 3
#endif

/* What all lanes are together, by halves: any_of_4() and so on join 4 lanes to one number. */
#define OR(a, b) ((a) | (b))
#define PLUS(a, b) ((a) + (b))
#define GREATER(a, b) ((a) > (b) ? (a) : (b))
#define FOLD(name, type, join)                   \
    static type name##_of_2(const type##2 x) {   \
        return join(x.x, x.y);                   \
    }                                            \
    static type name##_of_4(const type##4 x) {   \
        return name##_of_2(join(x.lo, x.hi));    \
    }                                            \
    static type name##_of_8(const type##8 x) {   \
        return name##_of_4(join(x.lo, x.hi));    \
    }                                            \
    static type name##_of_16(const type##16 x) { \
        return name##_of_8(join(x.lo, x.hi));    \
    }
FOLD(any, int, OR)
FOLD(sum, int, PLUS)
FOLD(largest, int, GREATER)
FOLD(furthest, float, GREATER)

/* The largest lane of a FLOAT, all >= 0: read as whole numbers, the bits of such floats are in the same order. */
#define LARGEST_FLOAT(value) as_float(LARGEST(AS(int, value)))

/* a b + c in float, where one rounding or two are equally good. */
#ifdef NO_FMA
#define FMA(a, b, c) ((a) * (b) + (c))
#else
#define FMA(a, b, c) fma(a, b, c)
#endif

/* (x x' + y y') + z z', rounded in this order. */
#define DOT(a, b) (((a).x * (b).x + (a).y * (b).y) + (a).z * (b).z)

/* |x| + |y| + |z|. */
static REAL size_of(const Real3 v) {
    return (fabs(v.x) + fabs(v.y)) + fabs(v.z);
}

static Real3 sum3(const Real3 a, const Real3 b) {
    return (Real3){a.x + b.x, a.y + b.y, a.z + b.z};
}

static Real3 difference(const Real3 a, const Real3 b) {
    return (Real3){a.x - b.x, a.y - b.y, a.z - b.z};
}

static Real3 scaled(const Real3 v, const REAL s) {
    return (Real3){v.x * s, v.y * s, v.z * s};
}

static Real3 cross_of(const Real3 a, const Real3 b) {
    return (Real3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static Real3 chosen(const REAL_MASK first, const Real3 a, const Real3 b) {
    return (Real3){first ? a.x : b.x, first ? a.y : b.y, first ? a.z : b.z};
}

/* The scalar product in float, by fused operations, of a direction and the first three of a filter constant, or of a
 * grid's axis.
 */
static FLOAT dot_float(const Float3 w, const float4 s) {
    return FMA(w.x, (FLOAT)s.x, FMA(w.y, (FLOAT)s.y, w.z * s.z));
}

/* A condition that hardly ever holds. Compilers then keep what it needs out of the way, and more of what is needed all
 * the time in registers: frames take 0.97 of the time. */
#if __has_builtin(__builtin_expect)
#define RARELY(condition) __builtin_expect(condition, 0)
#else
#define RARELY(condition) (condition)
#endif

/* The same of what double cannot decide. A program WITHOUT_RARE has nothing of what is behind it: there the condition
 * never holds, but the pixel is marked, and another program draws that. */
#define UNDECIDED(geometry, condition) (HAS(WITHOUT_RARE) ? (condition) && mark_undecided(geometry) : RARELY(condition))

/* Functions out of line have their arguments in memory, and their callers' variables with them. That keeps code small
 * where they are rarely called, but every work-item of a GPU has that memory then. What has nothing rare needs none. */
#if W == 1 && (REAL_BYTES == 4 || defined(WITHOUT_RARE))
#define noinline
#endif

/* Stands before a kernel, and forbids drivers to join its work-items to vectors: packets are vectors already. Without
 * it, Intel's compiler for CPUs does that. It then takes 11.6 s for first.xml instead of 1, and 98 s for room.xml
 * instead of 5; frames are no faster. With W = 1 it also passes wrong numbers to functions out of line, and spheres are
 * lost. */
#define APART PASTE(APART_, cl_intel_vec_len_hint)
#define APART_1 __attribute__((intel_vec_len_hint(1)))
#define APART_cl_intel_vec_len_hint

/* |x|, by operators alone. */
static FLOAT magnitude(const FLOAT x) {
    return AS(float, AS(int, x) & 0x7fffffff);
}

/* FOR_EACH_INDEX is for reading what each lane has in memory at its own index, such as its sphere's material. The block
 * that follows it runs once for each run of neighbouring lanes with the same index, and `one` is that index: mostly all
 * lanes have the same one. Lanes with a negative index are left out. In the block, PUT_WHERE puts a value into those
 * lanes of a variable that a mask names. */
#define FOR_EACH_INDEX(one, index)       \
    int one##_[W], one = -1;             \
    STORE_LANES(index, one##_);          \
    for (int lane = 0; lane < W; lane++) \
        if (one##_[lane] != one && one##_[lane] >= 0 && ((one = one##_[lane]), 1))
#define PUT_WHERE(mask, variable, value) variable = (mask) ? (value) : (variable)
/* The same of x, y and z, by PUT_WHERE or another macro like it. */
#define PUT3(put, mask, variable, value)    \
    do {                                    \
        put(mask, (variable).x, (value).x); \
        put(mask, (variable).y, (value).y); \
        put(mask, (variable).z, (value).z); \
    } while (0)

/* Each lane's row of an array, which `index` says; any row where that is negative. Mostly all lanes have the same one.
 */
typedef struct {
    REAL x, y, z, w;
} Real4;

static __attribute__((noinline)) Real4 rows_at(__global const real4 *array, const INT index) {
    const int one = LARGEST(index);
    if (!ANY((index >= 0) & (index != one))) {
        const real4 row = array[max(one, 0)];
        return (Real4){row.x, row.y, row.z, row.w};
    }
    int each[W];
    __global const real4 *row[W];
    STORE_LANES(index, each);
#pragma unroll
    for (int lane = 0; lane < W; lane++) row[lane] = array + max(each[lane], 0);
    return (Real4){(REAL)EACH_LANE(row, ->x), (REAL)EACH_LANE(row, ->y), (REAL)EACH_LANE(row, ->z),
                   (REAL)EACH_LANE(row, ->w)};
}

static Real3 xyz_of(const Real4 row) {
    return (Real3){row.x, row.y, row.z};
}

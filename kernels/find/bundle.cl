/* bundle.cl: a packet's rays that leave surfaces, together as long as they go the same way. */
#if defined(WITH_BOUNCES) && W > 1

/* Bit k: whether lane k is set. */
#define lane_bits(mask) PASTE(bits_of_, W)(mask)
static int bits_of_4(const int4 mask) {
    const int4 bits = mask & (int4)(1, 2, 4, 8);
    return (bits.x | bits.y) | (bits.z | bits.w);
}
#define bits_of_8(mask) BITS_OF(mask)
#if defined(__AVX512DQ__) && __has_builtin(__builtin_ia32_cvtd2mask512)
#define bits_of_16(mask) ((int)__builtin_ia32_cvtd2mask512(mask))
#else
#define bits_of_16(mask) (BITS_OF((mask).lo) | BITS_OF((mask).hi) << 8)
#endif

/* Rays whose directions have the same signs, and bounds of where they go.
 *
 * over, from, to: as in Walker. near, far: of each coordinate of their starts, with what these are off by, the extreme
 * ones, such that the planes of a box are entered later than from `near`, and left earlier than from `far`. least,
 * most: 1 / w, by size. */
typedef struct {
    MASK live;
    int own; /* the surface that all of them leave; -1 if it is not the same one */
    Float3 over, from, to;
    float near[3], far[3], least[3], most[3];
    int back[3]; /* whether they go against an axis */
} Bundle;

static float furthest_of_4(const float4 four) {
    const float2 two = four.lo > four.hi ? four.lo : four.hi;
    return two.x > two.y ? two.x : two.y;
}

static float furthest_of_8(const float8 eight) {
    return furthest_of_4(eight.lo > eight.hi ? eight.lo : eight.hi);
}

static float furthest_of_16(const float16 x) {
    return furthest_of_8(larger(x.lo, x.hi));
}

/* The largest lane. */
static float largest_of(const FLOAT x) {
    return PASTE(furthest_of_, W)(x);
}

static void bundle_rays(const Search *search, const MASK live, Bundle *bundle) {
    const int first = search->own[lowest_of(lane_bits(live))];
    bundle->live = live;
    bundle->own = ANY(live & (LOAD_LANES(search->own) != first)) ? -1 : first;
    FLOAT over[3], from[3], to[3];
    for (int j = 0; j < 3; j++) {
        const FLOAT o = LOAD_LANES(search->o[j]), pad = FMA((FLOAT)0x1p-22f, fabs(o), (FLOAT)0x1p-50f);
        over[j] = LOAD_LANES(search->over[j]);
        const int back = bundle->back[j] = ANY(live & (over[j] < 0));
        const FLOAT low = o - pad, high = o + pad, size = fabs(over[j]);
        from[j] = -(back ? low : high) * over[j];
        to[j] = -(back ? high : low) * over[j];
        const float highest = largest_of(live ? high : (FLOAT)-INFINITY),
                    lowest = -largest_of(live ? -low : (FLOAT)-INFINITY);
        const float most = largest_of(live ? size : (FLOAT)0.0f), least = -largest_of(live ? -size : (FLOAT)-INFINITY);
        bundle->near[j] = back ? lowest : highest;
        bundle->far[j] = back ? highest : lowest;
        bundle->least[j] = back ? -least : least;
        bundle->most[j] = back ? -most : most;
    }
    const Float3 all_over = {over[0], over[1], over[2]}, all_from = {from[0], from[1], from[2]},
                 all_to = {to[0], to[1], to[2]};
    bundle->over = all_over;
    bundle->from = all_from;
    bundle->to = all_to;
}

/* Which of 8 boxes any of the rays may meet within a distance; near: not before that. in, out: the planes by which the
 * rays enter the boxes, and those by which they leave. */
static int boxes_met(const Bundle *bundle, const float8 *in, const float8 *out, const float furthest, float8 *near) {
    float8 first = 0, last = INFINITY;
    for (int j = 0; j < 3; j++) {
        const float8 a = in[j] - bundle->near[j], b = out[j] - bundle->far[j];
        first = larger(first, smaller(a * bundle->least[j], a * bundle->most[j]));
        last = smaller(last, larger(b * bundle->least[j], b * bundle->most[j]));
    }
    *near = first;
    return BITS_OF((first <= last * (1 + 0x1p-20f)) & (first <= furthest));
}

/* Makes room for a leaf in the lists of some rays, as make_room(). */
static int make_room_for_packet(Search *search, const MASK here) {
    int room = 1;
    for (int left = lane_bits(here & (LOAD_LANES(search->count) > CANDIDATES - 8)); left; left &= left - 1) {
        const int lane = lowest_of(left);
        room &= make_room(search, lane, search->reach[lane]);
    }
    return room;
}

/* Adds a shape for those rays that may meet it within their reach. */
static void add_for_packet(Search *search, const MASK may, const RangeW range, const int index, FLOAT *reach) {
    const MASK here = may & (range.near <= *reach) & (LOAD_LANES(search->own) != index);
    int bits = lane_bits(here);
    if (!bits) return;
    const MASK shorter = MAY_PASS(search->scene) ? (MASK)0 : here & (range.far < *reach);
    *reach = shorter ? range.far : *reach;
    search->shorter |= ANY(shorter);
    float near[W];
    STORE_LANES(range.near, near);
    for (; bits; bits &= bits - 1) {
        const int lane = lowest_of(bits);
        add_candidate(search, lane, index, near[lane]);
    }
}

/* Number i of 8 that are in memory side by side. */
static float one_of(__global const float8 *eight, const int i) {
    return ((__global const float *)eight)[i];
}
#endif

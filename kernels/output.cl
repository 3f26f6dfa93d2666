/* output.cl: from colours and hits to the outputs in memory. */

/* The byte, 0 .. 255, of a part of a linear colour, without gamma. rounding: 0.5 rounds to nearest, 0 rounds down. The
 * comparisons are such that a NaN would be black. */
static LANES(uint) byte_of(const SHADE value, const shade_t rounding) {
    const SHADE low = value > 0 ? value : (SHADE)0;
    const SHADE clamped = low < 1 ? low : (SHADE)1;
    return TO(uint, clamped * (shade_t)255 + rounding);
}

#if defined(OUT_NORMAL) || defined(OUT_DIRECTION)
/* Turns a direction from camera space into the world. */
static Float3 to_world(const Frame frame, const Real3 v) {
    const Real3 turned = turned_to_world(frame, v);
    const Float3 w = {TO_FLOAT(turned.x), TO_FLOAT(turned.y), TO_FLOAT(turned.z)};
    return w;
}
#endif

#ifdef OUT_RGB8
/* Writes a packet of pixels of 3 bytes each: a row of 4 pixels is 3 whole words. */
static void store_rgb8(__global uchar *out, const int first, const int pitch, const LANES(uint) r, const LANES(uint) g,
                       const LANES(uint) b) {
#if W == 1
    vstore3((uchar3)((uchar)r, (uchar)g, (uchar)b), first, out);
#else
    const LANES(uint) p = r | (g << 8) | (b << 16);
#if W == 4
    const uint p0 = p.s0, p1 = p.s1, p2 = p.s2, p3 = p.s3;
    uint word[3];
#elif W == 8
    const uint2 p0 = p.s04, p1 = p.s15, p2 = p.s26, p3 = p.s37;
    uint2 word[3];
#else
    const uint4 p0 = p.s048c, p1 = p.s159d, p2 = p.s26ae, p3 = p.s37bf;
    uint4 word[3];
#endif
    word[0] = p0 | (p1 << 24);
    word[1] = (p1 >> 8) | (p2 << 16);
    word[2] = (p2 >> 16) | (p3 << 8);
    __global uint *row = (__global uint *)(out + 3 * first);
    const int step = 3 * pitch / 4;
    for (int k = 0; k < 3; k++) {
#if W == 4
        row[k] = word[k];
#else
        row[k] = word[k].s0;
        row[step + k] = word[k].s1;
#endif
#if W == 16
        row[2 * step + k] = word[k].s2;
        row[3 * step + k] = word[k].s3;
#endif
    }
#endif
}
#endif

/* Writes one number for each lane. first: index of the packet's first pixel; stride: numbers from a pixel to the
 * next. */
#if W == 1
#define STORE(type, out, first, pitch, stride, value) (out)[(long)(first) * (stride)] = (value)
#else
#define STORE(type, out, first, pitch, stride, value)                                                             \
    do {                                                                                                          \
        type lane_[W];                                                                                            \
        STORE_LANES(value, lane_);                                                                                \
        for (int j_ = 0; j_ < W; j_++)                                                                            \
            (out)[((long)(first) + (j_ >> 2) * (pitch) + (j_ & 3)) * (stride)] = lane_[j_];                        \
    } while (0)
#endif

/* What is known of a packet of pixels when all is traced and shaded. */
typedef struct {
    Hit hit;
    Shade3 color;
    Float3 normal; /* in the world, facing the ray; 0 where nothing was hit */
    INT rays;      /* shadow rays */
#ifdef WITH_AVERAGE
    FLOAT error, coverage; /* of the mean colour, in levels of 255; the share that surfaces have */
#endif
#ifdef OUT_PRIMITIVE
    INT primitive; /* a triangle's number within its mesh, -1 elsewhere */
#endif
#ifdef OUT_UV
    FLOAT u, v; /* where it is on a texture, 0 where nothing was hit */
#endif
#ifdef WITH_CEILING
    MASK wanted, overgrown; /* whether it is in the region; whether it takes more than MOST_RAYS rays */
#endif
} Pixels;

/* Writes what the OUT_ flags ask for. first: index of the packet's first pixel in the outputs. */
static void write(const Frame frame, const int2 size, const INT column, const INT row, const Pixels pixels,
                  const Work *work, const Outputs out, const int first) {
    const int pitch = out.pitch;
#ifdef OUT_RGB8
    const shade_t rounding = frame.quantize.x;
    store_rgb8(out.rgb8, first, pitch, byte_of(pixels.color.x, rounding), byte_of(pixels.color.y, rounding),
               byte_of(pixels.color.z, rounding));
#endif
#ifdef OUT_COLOR
    STORE(float, out.color, first, pitch, 3, TO_FLOAT(pixels.color.x));
    STORE(float, out.color + 1, first, pitch, 3, TO_FLOAT(pixels.color.y));
    STORE(float, out.color + 2, first, pitch, 3, TO_FLOAT(pixels.color.z));
#endif
#ifdef OUT_NORMAL
    STORE(float, out.normal, first, pitch, 3, pixels.normal.x);
    STORE(float, out.normal + 1, first, pitch, 3, pixels.normal.y);
    STORE(float, out.normal + 2, first, pitch, 3, pixels.normal.z);
#endif
#if defined(OUT_DIRECTION) || defined(OUT_DEPTH)
    const Ray ray = primary_ray(frame, size, column, row);
#endif
#ifdef OUT_DIRECTION
    const REAL over = 1 / sqrt(ray.a);
    const Real3 unit = {ray.d.x * over, ray.d.y * over, -over};
    const Float3 direction = to_world(frame, unit);
    STORE(float, out.direction, first, pitch, 3, direction.x);
    STORE(float, out.direction + 1, first, pitch, 3, direction.y);
    STORE(float, out.direction + 2, first, pitch, 3, direction.z);
#endif
#ifdef OUT_DEPTH
    STORE(real, out.depth, first, pitch, 1, pixels.hit.t * sqrt(ray.a));
#endif
#ifdef OUT_ID
    STORE(int, out.id, first, pitch, 1, pixels.hit.id);
#endif
#ifdef OUT_PRIMITIVE
    STORE(int, out.primitive, first, pitch, 1, pixels.primitive);
#endif
#ifdef OUT_UV
    STORE(float, out.uv, first, pitch, 2, pixels.u);
    STORE(float, out.uv + 1, first, pitch, 2, pixels.v);
#endif
#ifdef OUT_ERROR
    STORE(float, out.error, first, pitch, 1, pixels.error);
#endif
#ifdef OUT_COVERAGE
    STORE(float, out.coverage, first, pitch, 1, pixels.coverage);
#endif
#ifdef OUT_SHADOW_RAYS
    STORE(int, out.shadow_rays, first, pitch, 1, pixels.rays);
#endif
#ifdef OUT_WORK
    for (int k = 0; k < COUNTERS; k++) STORE(int, out.work + k, first, pitch, COUNTERS, work->count[k]);
#endif
}

#ifdef WITH_CEILING
/* The packets of the whole picture, counted row by row. (x, y): a packet's first pixel, in pixels of the picture. */
static int packet_number(const int2 size, const int x, const int y) {
    return y / PACKET_HEIGHT * ((size.x + PACKET_WIDTH - 1) / PACKET_WIDTH) + x / PACKET_WIDTH;
}

/* Notes the first lane of a packet that is overgrown, unless such a pixel of an earlier packet is noted. All packets before
 * that one are still rendered, and those after it are not. So it is always the same pixel that is noted in the end. */
static void note_overgrown(const Outputs out, const int number, const MASK overgrown) {
    if (!RARELY(ANY(overgrown))) return;
    int each[W], lane = 0;
    STORE_LANES(overgrown, each);
    while (!each[lane]) lane++;
    atomic_min(out.overgrown, number * W + lane);
}
#endif

/* output.cl: from colours and hits to the outputs in memory. */

/* Writes a packet of pixels of 3 bytes each: a row of 4 pixels is 3 whole words. Rows: a number for each row of a
 * packet; COLUMN(p, k): the pixels of its column k. */
#if W == 1
static void store_rgb8(__global uchar *out, const int first, const int pitch, const LANES(uint) r, const LANES(uint) g,
                       const LANES(uint) b) {
    vstore3((uchar3)((uchar)r, (uchar)g, (uchar)b), first, out);
}
#else
#define ROWS_IN_4 uint
#define ROWS_IN_8 uint2
#define ROWS_IN_16 uint4
#define COLUMNS_IN_4(p) {p.s0, p.s1, p.s2, p.s3}
#define COLUMNS_IN_8(p) {p.s04, p.s15, p.s26, p.s37}
#define COLUMNS_IN_16(p) {p.s048c, p.s159d, p.s26ae, p.s37bf}
static void store_rgb8(__global uchar *out, const int first, const int pitch, const LANES(uint) r, const LANES(uint) g,
                       const LANES(uint) b) {
    typedef PASTE(ROWS_IN_, W) Rows;
    const LANES(uint) pixel = r | (g << 8) | (b << 16);
    const Rows p[4] = PASTE(COLUMNS_IN_, W)(pixel);
    const Rows word[3] = {p[0] | (p[1] << 24), (p[1] >> 8) | (p[2] << 16), (p[2] >> 16) | (p[3] << 8)};
    __global uint *row = (__global uint *)(out + 3 * (long)first);
    for (int k = 0; k < 3; k++) {
#pragma unroll
        for (int j = 0; j < W / 4; j++) row[j * (3 * pitch / 4) + k] = ((const uint *)&word[k])[j];
    }
}
#endif

/* Writes one number for each lane. first: index of the packet's first pixel; stride: numbers from a pixel to the
 * next. */
#if W == 1
#define STORE(type, out, first, pitch, stride, value) (out)[(long)(first) * (stride)] = (value)
#else
#define STORE(type, out, first, pitch, stride, value)                                                                  \
    do {                                                                                                               \
        type lane_[W];                                                                                                 \
        STORE_LANES(value, lane_);                                                                                     \
        for (int j_ = 0; j_ < W; j_++) (out)[((long)(first) + (j_ >> 2) * (pitch) + (j_ & 3)) * (stride)] = lane_[j_]; \
    } while (0)
#endif

#define STORE3(out, first, pitch, value)                             \
    do {                                                             \
        STORE(float, out, first, pitch, 3, TO_FLOAT((value).x));     \
        STORE(float, out + 1, first, pitch, 3, TO_FLOAT((value).y)); \
        STORE(float, out + 2, first, pitch, 3, TO_FLOAT((value).z)); \
    } while (0)

/* A packet of pixels of a picture. */
typedef struct {
    int2 size;       /* of the whole picture, in pixels */
    int2 first;      /* the column and row of its first pixel in the picture */
    INT column, row; /* those of each lane's pixel */
    int2 tile;       /* its place in units of TILE x TILE pixels; the region begins at a tile, so it is in one only */
    MASK within;     /* which pixels are wanted: those of the region */
} Packet;

/* The colours of a packet in the lights of launches before this one, and those in these and its own lights. first:
 * index of the packet's first pixel. */
static Shade3 colors_so_far(const Outputs out, const int first) {
    shade4 color[W];
    for (int j = 0; j < W; j++) color[j] = out.so_far[first + (j >> 2) * out.pitch + (j & 3)];
    return (Shade3){(SHADE)EACH_LANE(color, .x), (SHADE)EACH_LANE(color, .y), (SHADE)EACH_LANE(color, .z)};
}

static void keep_colors(const Shade3 color, const Outputs out, const int first) {
    shade_t red[W], green[W], blue[W];
    STORE_LANES(color.x, red);
    STORE_LANES(color.y, green);
    STORE_LANES(color.z, blue);
    for (int j = 0; j < W; j++)
        out.so_far[first + (j >> 2) * out.pitch + (j & 3)] = (shade4)(red[j], green[j], blue[j], 0);
}

/* Of each pixel, the number of a triangle in its mesh, or of a cap -2 less the number of its plane; -1 of all else. */
static INT primitives_in(const Scene *scene, const Hit hit) {
    const INT primitive = primitives_of(scene, hit.id);
    return HAS(WITH_PLANES) ? ((hit.id >= 0) & (hit.plane >= 0) ? -2 - hit.plane : primitive) : primitive;
}

/* Writes the outputs other than bytes. first: index of the packet's first pixel in the outputs. */
static __attribute__((noinline)) void write_more(const Frame *camera, const Scene *scene, const Packet *packet,
                                                 const Pixels *pixels, const Outputs *outputs, const int first) {
    const Outputs out = *outputs;
    const int pitch = out.pitch;
    const Ray ray = primary_ray(*camera, packet->size, packet->column, packet->row);
    if (out.so_far) keep_colors(pixels->color, out, first);
    if (out.color) STORE3(out.color, first, pitch, pixels->color);
    if (out.normal) STORE3(out.normal, first, pitch, pixels->normal);
    if (out.direction) {
        const REAL over = 1 / sqrt(ray.a);
        const Real3 unit = {ray.d.x * over, ray.d.y * over, -over};
        const Float3 direction = to_world(*camera, unit);
        STORE3(out.direction, first, pitch, direction);
    }
    if (out.depth) STORE(real, out.depth, first, pitch, 1, pixels->hit.t * sqrt(ray.a));
    if (out.id) STORE(int, out.id, first, pitch, 1, ids_of(scene, pixels->hit.id));
    if (out.primitive) STORE(int, out.primitive, first, pitch, 1, primitives_in(scene, pixels->hit));
    if (out.uv) {
        STORE(float, out.uv, first, pitch, 2, pixels->u);
        STORE(float, out.uv + 1, first, pitch, 2, pixels->v);
    }
    if (out.error) STORE(float, out.error, first, pitch, 1, pixels->error);
    if (out.coverage) STORE(float, out.coverage, first, pitch, 1, pixels->coverage);
    if (out.shadow_rays) STORE(int, out.shadow_rays, first, pitch, 1, pixels->rays);
}

/* Writes all outputs that are wanted. */
static void write(const Frame frame, const Scene *scene, const Packet packet, const Pixels pixels, const Work *work,
                  const Outputs out, const int first) {
    if (!HAS(WITH_EXTRAS) || out.rgb8) {
        const shade_t rounding = frame.quantize.x;
        store_rgb8(out.rgb8, first, out.pitch, byte_of(pixels.color.x, rounding), byte_of(pixels.color.y, rounding),
                   byte_of(pixels.color.z, rounding));
    }
    if (EXTRA(scene, more)) {
        const Frame camera = frame;
        const Packet of = packet;
        const Pixels shown = pixels;
        const Outputs others = out;
        write_more(&camera, scene, &of, &shown, &others, first);
    }
    for (int k = 0; HAS(OUT_WORK) && k < COUNTERS; k++)
        STORE(int, out.work + k, first, out.pitch, COUNTERS, work->count[k]);
}

/* render.cl: the kernel: packets of pixels, from their places in the picture to the outputs. */

/* What is known of a packet before it is looked at. */
typedef struct {
    Work work; /* what has been counted */
#ifdef WITH_SAMPLES
    PixelCorners corners;
#endif
} Known;

/* Which pixels are in the region, without its margin. Only these are noted if they take too many rays. Then packets
 * behind the noted one are not rendered, but all packets before it still are, so the pixel noted last is always the
 * same. */
static MASK wanted_of(const int4 region, const INT column, const INT row, const Outputs out) {
    return (column < region.x + region.z) & (row < region.y + region.w) & (column >= region.x + out.margin.x) &
           (row >= region.y + out.margin.y);
}

/* The packets of the whole picture, counted row by row. */
static int number_of(const Packet packet) {
    const int columns = (packet.size.x + PACKET_WIDTH - 1) / PACKET_WIDTH;
    return packet.first.y / PACKET_HEIGHT * columns + packet.first.x / PACKET_WIDTH;
}

static int is_given_up(const Scene *scene, const Packet packet) {
    return HAS(WITH_SPLITS) ? number_of(packet) > *scene->last / W : is_over(scene);
}

/* Notes the first lane of a packet that is overgrown, unless such a pixel of an earlier packet is noted. */
static void note_overgrown(const Scene *scene, const Packet packet, const Pixels pixels) {
    if (!HAS(WITH_SPLITS) || !RARELY(ANY(pixels.overgrown))) return;
    int each[W], lane = 0;
    STORE_LANES(pixels.overgrown, each);
    while (!each[lane]) lane++;
    atomic_min(scene->last, number_of(packet) * W + lane);
}

/* IN_STAGES: whether the first program has left the work-item's pixel to the second one. */
static int is_undecided(const Scene *scene) {
    return scene->geometry.undecided[number_of_item()];
}

/* Whether the first program has drawn the work-item's pixel, or was told to draw no more. */
static int is_drawn(const Scene *scene) {
    return HAS(IN_STAGES) && !HAS(WITHOUT_RARE) && !is_undecided(scene);
}

static Ray ray_of(const Frame frame, const Packet packet) {
    return for_shapes(frame, primary_ray(frame, packet.size, packet.column, packet.row));
}

/* What a packet shows, where its tile is not all background. pixels: as they are where nothing is hit. */
#ifdef WITH_SAMPLES
static Pixels seen_by(const Frame frame, const Scene *scene, const Packet packet, Pixels pixels, Known *known) {
    if (EXTRA(scene, centres)) pixels = trace(frame, scene, ray_of(frame, packet), packet.tile, pixels, &known->work);
    sample_pixels(frame, scene, packet, &known->corners, &pixels, &known->work);
    return pixels;
}
#else
#define seen_by(frame, scene, packet, pixels, known) \
    trace(frame, scene, ray_of(frame, packet), (packet).tile, pixels, &(known)->work)
#endif

/* Renders the packet at a place of a region, which is x, y, width and height of a part of the picture: all in pixels.
 */
static void render_packet(const Frame frame, const Scene *scene, const int2 size, const int4 region, const int2 place,
                          const Outputs out, Known *known) {
    const int2 first = region.xy + place;
    const INT column = first.x + LANE_COLUMN, row = first.y + LANE_ROW;
    const MASK within = wanted_of(region, column, row, out);
    const Packet packet = {size, first, column, row, first / TILE, within};
    if (is_given_up(scene, packet)) return;
    Pixels pixels = {{INFINITY, -1, {0, 0, 1}}, {frame.background.x, frame.background.y, frame.background.z}};
    pixels.wanted = within;
    const int at = place.y * out.pitch + place.x;
    if (EXTRA(scene, started)) pixels.color = colors_so_far(out, at);
    Work *work = &known->work;
    if (tile_has_any(scene->lists, packet.tile)) {
        pixels = seen_by(frame, scene, packet, pixels, known);
    } else {
        if (HAS(WITH_SAMPLES)) {
            pixels.color.x = pixels.color.x < 1 ? pixels.color.x : (SHADE)1;
            pixels.color.y = pixels.color.y < 1 ? pixels.color.y : (SHADE)1;
            pixels.color.z = pixels.color.z < 1 ? pixels.color.z : (SHADE)1;
        }
        COUNT(BACKGROUND, ALL_LANES);
    }
    if (HAS(WITHOUT_RARE) && is_undecided(scene)) return;
    write(frame, scene, packet, pixels, work, out, at);
    note_overgrown(scene, packet, pixels);
}

/* Each work-item renders RUN packets, side by side, one after the other. That is a loop here rather than a work-group:
 * where a group has several work-items, PoCL keeps all variables in memory, which took a tenth of the time. With
 * many lights or samples, a work-item renders `high` rows of RUN packets. With many lights it goes column by column, so
 * that what a packet has brought into the cache is still there for its neighbours: with 100 lights that takes 0.9 of
 * the time that row by row takes. */

/* Where in the region a work-item begins. row: of the region, at which the launch starts; high: as above. */
static int2 place_of_item(const int row, const int high) {
    return (int2)((int)get_global_id(0) * RUN * PACKET_WIDTH, row + (int)get_global_id(1) * high * PACKET_HEIGHT);
}

/* The loop is in the kernel itself, as compilers work on all that is in a function once more in each one that calls
 * it, which took a twentieth of the time that a first picture takes. */
APART
__kernel void render(RENDER_PARAMETERS) {
    const Frame frame = FRAME_OF_PARAMETERS;
    const Scene scene = SCENE_OF_PARAMETERS;
    if (is_drawn(&scene)) return;
    const Outputs out = OUTPUTS_OF_PARAMETERS;
    const int2 begin = place_of_item(row, high);
    Known known;
#ifdef WITH_SAMPLES
    known.corners.region = region;
    known.corners.begin = region.x + begin.x;
    known.corners.row[0] = known.corners.row[1] = -1;
#endif
    for (int k = 0; k < RUN * high; k++) {
        /* Samples keep the corners that two rows share, so they go row by row. */
        const int column = HAS(WITH_SAMPLES) ? k % RUN : k / high, line = HAS(WITH_SAMPLES) ? k / RUN : k % high;
        const int2 place = begin + (int2)(column * PACKET_WIDTH, line * PACKET_HEIGHT);
        if (place.x >= region.z || place.y >= region.w) continue;
        known.work = no_work();
        render_packet(frame, &scene, size, region, place, out, &known);
    }
}

/* render.cl: the kernel: packets of pixels, from their places in the picture to the outputs. */

/* Renders the packet at (x, y) of a region (x, y, width, height) of a picture of this size, all in pixels. The region
 * begins at a tile, so no packet is in two tiles. */
static void render_packet(const Frame frame, const Scene scene, const int2 size, const int4 region, const int x,
                          const int y, const Outputs out
#ifdef WITH_RUNS
                          , const Wholes *wholes, const int first, const Work *before
#endif
) {
    const INT column = region.x + x + LANE_COLUMN, row = region.y + y + LANE_ROW;
    const int2 tile = {(region.x + x) / TILE, (region.y + y) / TILE};
    Pixels pixels = {{INFINITY, -1, {0, 0, 1}},
                     {frame.background.x, frame.background.y, frame.background.z},
                     {0, 0, 0},
                     0};
#ifdef OUT_UV
    pixels.u = pixels.v = 0;
#endif
    Work counts, *work = &counts;
#ifdef OUT_WORK
    for (int k = 0; k < COUNTERS; k++) counts.count[k] = 0;
#ifdef WITH_RUNS
    if (first == 0) counts = *before;
#endif
#endif
#ifdef WITH_CEILING
    const int number = packet_number(size, region.x + x, region.y + y);
    if (number > *out.overgrown / W) return;
    pixels.wanted = (column >= region.x + out.margin.x) & (column < region.x + region.z) &
                    (row >= region.y + out.margin.y) & (row < region.y + region.w);
#endif
#ifdef WITH_AVERAGE
    if (tile_has_any(scene.lists, tile)) {
#ifdef WITH_CEILING
        const MASK within = pixels.wanted;
#else
        const MASK within = (column < region.x + region.z) & (row < region.y + region.w);
#endif
#ifdef WITH_CENTRES
        pixels = trace(frame, scene, for_shapes(frame, scene, primary_ray(frame, size, column, row)), tile, pixels, work);
#endif
#ifdef WITH_RUNS
        const Means means = load_means(wholes, first);
#else
        const Means means = look_at_pixels(frame, scene, size, column, row, tile, within, work);
#endif
        average_pixels(frame, scene, size, column, row, tile, within, means, &pixels, work);
    } else {
        pixels.color.x = pixels.color.x < 1 ? pixels.color.x : (SHADE)1;
        pixels.color.y = pixels.color.y < 1 ? pixels.color.y : (SHADE)1;
        pixels.color.z = pixels.color.z < 1 ? pixels.color.z : (SHADE)1;
        COUNT(BACKGROUND, ALL_LANES);
    }
#else
    if (tile_has_any(scene.lists, tile)) {
        pixels = trace(frame, scene, for_shapes(frame, scene, primary_ray(frame, size, column, row)), tile, pixels, work);
    } else {
        COUNT(BACKGROUND, ALL_LANES);
    }
#endif
#ifdef OUT_PRIMITIVE
#ifdef WITH_TRIANGLES
    pixels.primitive = primitives_of(scene, pixels.hit.id);
#else
    pixels.primitive = -1;
#endif
#endif
#ifdef OUT_ID
    pixels.hit.id = ids_of(scene, pixels.hit.id);
#endif
    write(frame, size, column, row, pixels, work, out, y * out.pitch + x);
#ifdef WITH_CEILING
    note_overgrown(out, number, pixels.overgrown);
#endif
}

#ifdef WITH_RUNS
/* RUN packets side by side, of which the first is at (x, y) of the region. */
static void render_run(const Frame frame, const Scene scene, const int2 size, const int4 region, const int x, const int y, const Outputs out) {
    Wholes wholes;
    Work counts;
#ifdef OUT_WORK
    for (int k = 0; k < COUNTERS; k++) counts.count[k] = 0;
#endif
    look_at_run(frame, scene, size, region.x + x, region.y + y, region.x + region.z, region.y + region.w, &wholes, &counts);
    for (int k = 0; k < RUN && x + k * PACKET_WIDTH < region.z; k++)
        render_packet(frame, scene, size, region, x + k * PACKET_WIDTH, y, out, &wholes, k * W, &counts);
}
#endif

/* Each work-item renders RUN packets, side by side, one after the other. That is a loop here rather than a work-group:
 * where a group has several work-items, PoCL keeps all variables in memory, which took a tenth of the time. WITH_BLOCKS
 * there are BLOCK rows of them, rendered column by column: what a packet has brought into the cache is still there for
 * those below it and beside it. With 100 lights that takes 0.9 of the time that row by row takes. */
__kernel void render(RENDER_PARAMETERS) {
    const Scene scene = SCENE_OF_PARAMETERS;
    const Outputs out = OUTPUTS_OF_PARAMETERS;
#if defined(WITH_BLOCKS) && W > 1
    const int begin = (int)get_global_id(0) * RUN * PACKET_WIDTH, top = row + (int)get_global_id(1) * BLOCK * PACKET_HEIGHT;
#ifdef WITH_RUNS
    for (int y = top; y < top + BLOCK * PACKET_HEIGHT && y < region.w; y += PACKET_HEIGHT)
        render_run(frame, scene, size, region, begin, y, out);
#else
    for (int x = begin; x < begin + RUN * PACKET_WIDTH && x < region.z; x += PACKET_WIDTH)
        for (int y = top; y < top + BLOCK * PACKET_HEIGHT && y < region.w; y += PACKET_HEIGHT)
            render_packet(frame, scene, size, region, x, y, out);
#endif
#else
    const int begin = (int)get_global_id(0) * RUN * PACKET_WIDTH, y = row + (int)get_global_id(1) * PACKET_HEIGHT;
    if (y >= region.w) return;
#ifdef WITH_RUNS
    render_run(frame, scene, size, region, begin, y, out);
#else
    for (int x = begin; x < begin + RUN * PACKET_WIDTH && x < region.z; x += PACKET_WIDTH)
        render_packet(frame, scene, size, region, x, y, out);
#endif
#endif
}

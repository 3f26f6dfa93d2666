/* pixels.cl: what is known of a packet of pixels, in the units of the outputs. */

/* The byte, 0 .. 255, of a part of a linear colour, without gamma. rounding: 0.5 rounds to nearest, 0 rounds down. The
 * comparisons are such that a NaN would be black. */
static LANES(uint) byte_of(const SHADE value, const shade_t rounding) {
    const SHADE low = value > 0 ? value : (SHADE)0;
    const SHADE clamped = low < 1 ? low : (SHADE)1;
    return TO(uint, clamped * (shade_t)255 + rounding);
}

/* Turns a direction from camera space into the world. */
static Float3 to_world(const Frame frame, const Real3 v) {
    const Real3 turned = turned_to_world(frame, v);
    const Float3 w = {TO_FLOAT(turned.x), TO_FLOAT(turned.y), TO_FLOAT(turned.z)};
    return w;
}

/* What is known of a packet of pixels when all is traced and shaded. */
typedef struct {
    Hit hit;
    Shade3 color;
    Float3 normal;          /* in the world, facing the ray; 0 where nothing was hit */
    INT rays;               /* shadow rays */
    FLOAT error, coverage;  /* WITH_SAMPLES: of the mean colour, in levels of 255; the share that surfaces have */
    FLOAT u, v;             /* OUT_UV: where it is on a texture, 0 where nothing was hit */
    MASK wanted, overgrown; /* WITH_CEILING: whether it is in the region; whether it takes more than MOST_RAYS rays */
} Pixels;

/* Which pixels are wanted, where too many rays may be one's end; all else does not ask. */
static MASK wanted_lanes(const Pixels pixels) {
    return HAS(WITH_CEILING) ? pixels.wanted : (MASK)ALL_LANES;
}

/* Puts colours into the pixels in which something was hit. */
static __attribute__((always_inline)) void show_colors(const MASK hit, const Shade3 color, Pixels *pixels) {
    const SHADE_MASK any_hit = TO_SHADE_MASK(hit);
    PUT3(PUT_WHERE, any_hit, pixels->color, color);
}

/* Puts the normals of the points that were hit into pixels, and where these are on textures. */
static __attribute__((always_inline)) void show_points(const Frame frame, const Intersection at, Pixels *pixels) {
    if (HAS(OUT_NORMAL)) {
        const Real3 n = at.normal;
        const Real3 facing = {at.start.side * n.x, at.start.side * n.y, at.start.side * n.z};
        const Float3 world = to_world(frame, facing);
        pixels->normal.x = at.hit ? world.x : (FLOAT)0;
        pixels->normal.y = at.hit ? world.y : (FLOAT)0;
        pixels->normal.z = at.hit ? world.z : (FLOAT)0;
    }
    if (HAS(OUT_UV)) {
        pixels->u = at.hit ? TO_FLOAT(at.u) : (FLOAT)0;
        pixels->v = at.hit ? TO_FLOAT(at.v) : (FLOAT)0;
    }
}

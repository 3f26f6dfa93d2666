/* materials.cl: what surfaces are made of, and textures. */

/* What surfaces are made of. */

/* The value that all lanes with a value >= 0 have; -1 if some have others, or none has any. */
static int common_of(const INT value) {
    const int one = LARGEST(value);
    return ANY((value >= 0) & (value != one)) ? -1 : one;
}

/* The number that an array has for each lane's index, -1 for none. */
static __attribute__((noinline)) INT numbers_at(__global const int *array, const INT index) {
    const int one = common_of(index);
    if (one >= 0) return index < 0 ? (INT)-1 : (INT)array[one];
    int each[W], number[W];
    STORE_LANES(index, each);
#pragma unroll
    for (int lane = 0; lane < W; lane++) number[lane] = array[max(each[lane], 0)];
    return index < 0 ? (INT)-1 : (INT)EACH_LANE(number, );
}

/* The index of the material of each lane's surface, -1 for none. */
static __attribute__((always_inline)) INT materials_of(const Scene *scene, const INT id) {
    return scene->materials == 1 ? (id < 0 ? (INT)-1 : (INT)0) : numbers_at(scene->material_of, id);
}

/* Puts a material into the lanes of `here`. */
static __attribute__((always_inline)) void put_material(const SHADE_MASK here, const shade8 m, Intersection *at) {
    PUT_WHERE(here, at->ambient.x, (SHADE)m.s0);
    PUT_WHERE(here, at->ambient.y, (SHADE)m.s1);
    PUT_WHERE(here, at->ambient.z, (SHADE)m.s2);
    PUT_WHERE(here, at->diffuse.x, (SHADE)m.s3);
    PUT_WHERE(here, at->diffuse.y, (SHADE)m.s4);
    PUT_WHERE(here, at->diffuse.z, (SHADE)m.s5);
    PUT_WHERE(here, at->ks, (SHADE)m.s6);
    PUT_WHERE(here, at->exponent, (SHADE)m.s7);
}

static __attribute__((always_inline)) void put_materials(const Scene *scene, const INT id, Intersection *at) {
    INT left = materials_of(scene, id);
    do {
        const int one = LARGEST(left);
        put_material(TO_SHADE_MASK(left == one), scene->material[max(one, 0)], at);
        left = left == one ? (INT)-1 : left;
    } while (RARELY(ANY(left >= 0)));
}

/* Material of each lane's hit. Lanes without a hit keep harmless values. As a function of its own it would keep
 * intersections in memory, as triangle_put() would: frames with mirrors take 0.9 of the time. */
static __attribute__((always_inline)) Intersection material_at(const Scene *scene, const INT id) {
    Intersection at;
    at.hit = id >= 0;
    at.ambient.x = at.ambient.y = at.ambient.z = at.diffuse.x = at.diffuse.y = at.diffuse.z = at.ks = at.exponent = 0;
    if (HAS_COLORS(scene)) put_materials(scene, id, &at);
    at.black = TO_MASK((at.diffuse.x <= 0) & (at.diffuse.y <= 0) & (at.diffuse.z <= 0) & (at.ks <= 0));
    return at;
}

/* The colour of a texture at a point: u to the right and v downwards, both 1 at its far edge. */

/* The two texels between which a point is, along one side of a texture, and its share of the way from the first. */
typedef struct {
    INT first, second;
    SHADE share;
} Between;

/* c: u or v; size: how many texels the side has. As textures repeat, the whole part of c does not matter. What is
 * behind it is exact, but for negative numbers near 0, where it is rounded by 2^-54 or, in float, 2^-25. However large
 * c is, `first` is within 0 .. size - 1, as what is less than 1, times size, is rounded to less than size. From 2^53,
 * or 2^24, on, numbers have nothing behind their whole part: they are at the first texel, as is what is no number. */
static Between between(const REAL c, const INT size) {
    const REAL rest = c - floor(c), x = (rest < 1 ? rest : (REAL)0) * TO_REAL(size);
    Between at = {TO_INT(x), 0, 0};
    const INT next = at.first + 1;
    at.second = next == size ? (INT)0 : next;
    at.share = TO_SHADE(x - TO_REAL(at.first));
    return at;
}

/* What is in memory from a texel on: red, green and blue, in 8 or 16 bits each from the lowest, and then something
 * else. Textures of which SIGNED_FULL is a full colour may go below 0, and have each number larger by as much. */
typedef LANES(ulong) Texel;

static Texel texels_at(const Scene *scene, const INT place) {
    int each[W];
    ulong bytes[W];
    STORE_LANES(place, each);
    for (int lane = 0; lane < W; lane++) bytes[lane] = as_ulong(vload8(0, scene->texel + each[lane]));
    return LOAD_LANES(bytes);
}

/* The number for red, green or blue between four texels: the upper two, then the lower two. bits: all those that a
 * number may have; shift: what is below the wanted one. These numbers are exact, and so are their differences: at a
 * texel the number is the texel's own, and nowhere is it beyond those of all four. */
static SHADE blended(const Texel four[4], const Texel shift, const Texel bits, const SHADE across, const SHADE down) {
    const SHADE a = TO_SHADE(four[0] >> shift & bits), b = TO_SHADE(four[1] >> shift & bits);
    const SHADE c = TO_SHADE(four[2] >> shift & bits), d = TO_SHADE(four[3] >> shift & bits);
    const SHADE top = a + across * (b - a), bottom = c + across * (d - c);
    return top + down * (bottom - top);
}

/* Whether squares of texels are uneven. place: where in memory that is told of them. */
static MASK are_uneven(const Scene *scene, const INT place) {
    int each[W];
    STORE_LANES(place, each);
    for (int lane = 0; lane < W; lane++) each[lane] = scene->texel[each[lane]];
    return LOAD_LANES(each) != 0;
}

/* Multiplies the colours of points with those of their textures there, if they have one. id: what was hit. */
static void paint(const Scene *scene, const INT id, Intersection *at) {
    int each[W], width[W], height[W], begin[W], full[W];
    STORE_LANES(id, each);
    for (int lane = 0; lane < W; lane++) {
        const int which = each[lane] < 0 ? -1 : scene->texture_of[scene->material_of[each[lane]]];
        const int4 texture = which < 0 ? (int4)(1, 1, 0, 0) : scene->texture[which];
        width[lane] = texture.x;
        height[lane] = texture.y;
        begin[lane] = texture.z;
        full[lane] = texture.w;
    }
    const INT columns = LOAD_LANES(width), first = LOAD_LANES(begin), most = LOAD_LANES(full);
    if (HAS(WITH_SAMPLES)) at->texel = -1, at->uneven = 0;
    if (!ANY(most > 0)) return;
    const INT rows = LOAD_LANES(height);
    const Between u = between(at->u, columns), v = between(at->v, rows);
    const INT size = most > 255 ? (INT)6 : (INT)3, top = v.first * columns, bottom = v.second * columns;
    const Texel four[4] = {
        texels_at(scene, first + size * (top + u.first)), texels_at(scene, first + size * (top + u.second)),
        texels_at(scene, first + size * (bottom + u.first)), texels_at(scene, first + size * (bottom + u.second))};
    const Texel bits = TO(ulong, most > 255 ? (INT)65535 : (INT)255), green = TO(ulong, most > 255 ? (INT)16 : (INT)8);
    const SHADE white = TO_SHADE(most), none = TO_SHADE(most == SIGNED_FULL ? (INT)1 : (INT)0);
    const Shade3 color = {blended(four, 0, bits, u.share, v.share) / white - none,
                          blended(four, green, bits, u.share, v.share) / white - none,
                          blended(four, 2 * green, bits, u.share, v.share) / white - none};
    const SHADE_MASK here = TO_SHADE_MASK(most > 0);
    if (HAS(WITH_SAMPLES)) {
        at->texel = most > 0 ? first + size * (top + u.first) : (INT)-1;
        const INT square = v.first / SQUARE * ((columns + SQUARE - 1) / SQUARE) + u.first / SQUARE;
        at->uneven = (most > 0) & are_uneven(scene, first + size * columns * rows + square);
    }
    PUT_WHERE(here, at->ambient.x, at->ambient.x * color.x);
    PUT_WHERE(here, at->ambient.y, at->ambient.y * color.y);
    PUT_WHERE(here, at->ambient.z, at->ambient.z * color.z);
    PUT_WHERE(here, at->diffuse.x, at->diffuse.x * color.x);
    PUT_WHERE(here, at->diffuse.y, at->diffuse.y * color.y);
    PUT_WHERE(here, at->diffuse.z, at->diffuse.z * color.z);
}

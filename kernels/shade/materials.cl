/* materials.cl: what surfaces are made of. */

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
    if (!ANY_TINY) {
        FOR_EACH_INDEX(one, id) put_material(TO_SHADE_MASK(id == one), scene->material[scene->material_of[one]], at);
        return;
    }
    INT left = materials_of(scene, id);
    do {
        const int one = LARGEST(left);
        put_material(TO_SHADE_MASK(left == one), scene->material[max(one, 0)], at);
        left = left == one ? (INT)-1 : left;
    } while (RARELY(ANY(left >= 0)));
}

#if ANY_TINY
/* As a function of its own it would keep intersections in memory, as triangle_put() would: frames with mirrors take
 * 0.9 of the time. */
static __attribute__((always_inline)) Intersection material_at(const Scene *scene, const INT id);
#endif

/* Material of each lane's hit. Lanes without a hit keep harmless values. */
static Intersection material_at(const Scene *scene, const INT id) {
    Intersection at;
    at.hit = id >= 0;
    at.ambient.x = at.ambient.y = at.ambient.z = at.diffuse.x = at.diffuse.y = at.diffuse.z = at.ks = at.exponent = 0;
    if (HAS(WITH_SHADING)) put_materials(scene, id, &at);
    if (HAS(WITH_BLACK))
        at.black = TO_MASK((at.diffuse.x <= 0) & (at.diffuse.y <= 0) & (at.diffuse.z <= 0) & (at.ks <= 0));
    return at;
}

/* counters.cl: what was done and what was skipped, counted in each lane for --stats: COUNTERS of cltrace/plan/abi.py;
 * and marks, which tell samples apart that met different surfaces. */
typedef struct {
    INT count[HAS(OUT_WORK) ? COUNTERS : 1];
    LANES(uint) mark, texels;
    MASK uneven; /* which have met uneven squares of texels, see shade/texture.cl */
} Work;

/* Nothing counted so far. */
static Work no_work(void) {
    Work work;
    for (int k = 0; HAS(OUT_WORK) && k < COUNTERS; k++) work.count[k] = 0;
    return work;
}

/* Counts the lanes of a mask. */
#define COUNT(kind, mask)                                                                     \
    do {                                                                                      \
        if (HAS(OUT_WORK)) work->count[HAS(OUT_WORK) ? kind : 0] += (mask) ? (INT)1 : (INT)0; \
    } while (0)

/* Whether the host wants nothing more. What long loops leave then is no picture: the host has it drawn again. */
static int is_over(const Scene *scene) {
    return *scene->last < 0;
}

/* Where a work-item's mark is in `undecided`, behind that of all. */
static int number_of_item(void) {
    return 1 + (int)(get_global_id(1) * get_global_size(0) + get_global_id(0));
}

/* The first program IN_STAGES leaves a work-item's pixel to the second one. */
static int mark_undecided(const Spheres spheres) {
    spheres.undecided[0] = spheres.undecided[number_of_item()] = 1;
    return 0;
}

/* A sum of such numbers says what all rays of a sample have met, in whatever order: surfaces at each depth, and lights
 * that reach these; and, as another sum, between which texels. Equal numbers of two different sums are a matter of
 * chance, one in 2^31. */
static LANES(uint) mark_of(const INT surface, const int what) {
    LANES(uint) h = AS(uint, surface) * 0x9e3779b1u + (uint)what * 0x85ebca6bu;
    h = (h ^ (h >> 15)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12)) * 0x297a2d39u;
    return h ^ (h >> 15);
}
#define MARK(where, mask, surface, what)                                                        \
    do {                                                                                        \
        if (HAS(WITH_SAMPLES)) work->where += (mask) ? mark_of(surface, what) : (LANES(uint))0; \
    } while (0)

/* counters.cl: what was done and what was skipped, counted in each lane for --stats: COUNTERS of cltrace/plan/abi.py; and marks,
 * which tell samples apart that met different surfaces. */
#if defined(OUT_WORK) || defined(WITH_MARKS)
typedef struct {
#ifdef OUT_WORK
    INT count[COUNTERS];
#endif
#ifdef WITH_MARKS
    LANES(uint) mark, texels;
#endif
} Work;
#else
typedef int Work;
#endif

#ifdef OUT_WORK
#define COUNT(kind, mask) work->count[kind] += (mask) ? (INT)1 : (INT)0
#else
#define COUNT(kind, mask)
#endif

#ifdef WITH_MARKS
/* A sum of such numbers says what all rays of a sample have met, in whatever order: surfaces at each depth, and lights that reach
 * these; and, as another sum, between which texels. Equal numbers of two different sums are a matter of chance, one in 2^32. */
static LANES(uint) mark_of(const INT surface, const int what) {
    LANES(uint) h = AS(uint, surface) * 0x9e3779b1u + (uint)what * 0x85ebca6bu;
    h = (h ^ (h >> 15)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12)) * 0x297a2d39u;
    return h ^ (h >> 15);
}
#define MARK(where, mask, surface, what) work->where += (mask) ? mark_of(surface, what) : (LANES(uint))0
#else
#define MARK(where, mask, surface, what)
#endif

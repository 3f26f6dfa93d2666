/* counters.cl: what was done and what was skipped, counted in each lane for --stats: COUNTERS of cltrace/plan/abi.py. */
#ifdef OUT_WORK
typedef struct {
    INT count[COUNTERS];
} Work;
#define COUNT(kind, mask) work->count[kind] += (mask) ? (INT)1 : (INT)0
#else
typedef int Work;
#define COUNT(kind, mask)
#endif

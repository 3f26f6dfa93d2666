/* cells.cl: the lists of a grid's cells: surfaces are counted cell by cell, the counts are added up to where each list
 * begins, the surfaces are written there, and each list is sorted.
 *
 * In which order work-items come to a list is not known, but what they write is sorted by a key that no two entries
 * share. An entry is a whole number while it is made: above the depth, as bits that rise with it, below the index.
 */

/* A level's cells in a row, and its first cell, for the levels from 0 on. */
typedef struct {
    int pitch[16], base[16];
} Levels;

INLINE int bits_of(const int size) {
    return size > 0 ? 32 - clz(size) : 0;
}

/* How many spheres have each size, and how many entries all take if each is on the level of its size. For each
 * work-item: 16 numbers of spheres, then that of entries. */
__kernel void tally(const int n, const int pitch, __global const short *restrict covers,
                    __global const float *restrict near, __global long *restrict part) {
    long entries = 0, spheres[16];
    for (int k = 0; k < 16; k++) spheres[k] = 0;
    FOR_EACH_MEMBER(i, n) {
        const int left = covers[i], top = covers[pitch + i], wide = covers[2L * pitch + i],
                  high = covers[3L * pitch + i];
        const int level = bits_of(max(wide, high));
        spheres[level]++;
        entries += (((left + wide) >> level) - (left >> level) + 1) * (((top + high) >> level) - (top >> level) + 1);
    }
    __global long *note = part + 17 * get_global_id(0);
    for (int k = 0; k < 16; k++) note[k] = spheres[k];
    note[16] = entries;
}

/* For each cell that surface i covers on a level. */
#define FOR_EACH_CELL(cell, i, level)                                          \
    const int right_ = (covers[i] + covers[2L * pitch + i]) >> level;          \
    const int bottom_ = (covers[pitch + i] + covers[3L * pitch + i]) >> level; \
    const int pitch_ = levels->pitch[level], base_ = levels->base[level];      \
    for (int row_ = covers[pitch + i] >> level; row_ <= bottom_; row_++)       \
        for (int cell = base_ + row_ * pitch_ + (covers[i] >> level); cell <= base_ + row_ * pitch_ + right_; cell++)

/* level < 0: each surface is on the level of its size. */
INLINE int level_of(const int wide, const int high, const int level) {
    return level < 0 ? bits_of(max(wide, high)) : level;
}

/* A depth, as bits that rise with it, above an index. */
INLINE ulong key_of(const float near, const int index) {
    const int bits = as_int(near);
    const uint rising = as_uint(bits ^ (bits >> 31 & 0x7fffffff)) ^ 0x80000000u;
    return (ulong)rising << 32 | (uint)index;
}

/* How many entries each cell has. level: see level_of(). */
__kernel void count_entries(const int n, const int pitch, const int level, __constant Levels *levels,
                            __global const short *restrict covers, __global const float *restrict near,
                            volatile __global int *count) {
    FOR_EACH_MEMBER(i, n) {
        const int own = level_of(covers[2L * pitch + i], covers[3L * pitch + i], level);
        FOR_EACH_CELL(cell, i, own)
        atomic_inc(count + cell);
    }
}

/* The sums of `count` over one part of the cells for each work-item. */
__kernel void sum_cells(const int cells, __global const int *restrict count, __global int *restrict sum) {
    int total = 0;
    FOR_EACH_OF_PART(i, cells, 1)
    total += count[i];
    sum[get_global_id(0)] = total;
}

/* Where each list begins, from `at` on, and the same in `count`, for scattering; after them, where the last one ends.
 * sum: of sum_cells(); first: where the first list begins. */
__kernel void start_cells(const int cells, const int at, const int first, __global int *restrict count,
                          __global const int *restrict sum, __global int *restrict start) {
    int total = first;
    for (int k = 0; k < get_global_id(0); k++) total += sum[k];
    FOR_EACH_OF_PART(i, cells, 1) {
        const int more = count[i];
        start[at + i] = count[i] = total;
        total += more;
    }
    if (get_global_id(0) == get_global_size(0) - 1) start[at + cells] = total;
}

/* The entries, each into the lists of its cells. first, named, member: surface i has the index member[i] where these
 * are named, and else first + i. */
__kernel void scatter_entries(const int n, const int pitch, const int level, const int first, const int named,
                              __constant Levels *levels, __global const int *restrict member,
                              __global const short *restrict covers, __global const float *restrict near,
                              volatile __global int *next, __global ulong *restrict entry) {
    FOR_EACH_MEMBER(i, n) {
        const ulong key = key_of(near[i], named ? member[i] : first + i);
        const int own = level_of(covers[2L * pitch + i], covers[3L * pitch + i], level);
        FOR_EACH_CELL(cell, i, own)
        entry[atomic_inc(next + cell)] = key;
    }
}

static void sink(__global ulong *heap, int at, const int count) {
    const ulong key = heap[at];
    for (int child = 2 * at + 1; child < count; child = 2 * at + 1) {
        child += child + 1 < count && heap[child] < heap[child + 1];
        if (heap[child] <= key) break;
        heap[at] = heap[child];
        at = child;
    }
    heap[at] = key;
}

/* Sorts a list as a heap, which needs no room. */
static void heap_sort(__global ulong *list, const int count) {
    for (int i = count / 2 - 1; i >= 0; i--) sink(list, i, count);
    for (int i = count - 1; i > 0; i--) {
        const ulong most = list[0];
        list[0] = list[i];
        list[i] = most;
        sink(list, 0, i);
    }
}

/* Sorts each list, and gives the depths their own bits. at: of the first list in `start`. */
__kernel void sort_lists(const int cells, const int at, __global const int *restrict start,
                         __global ulong *restrict entry) {
    FOR_EACH_SPHERE(cell, cells) {
        __global ulong *list = entry + start[at + cell];
        const int count = start[at + cell + 1] - start[at + cell];
        heap_sort(list, count);
        for (int i = 0; i < count; i++) {
            const int bits = as_int((uint)(list[i] >> 32) ^ 0x80000000u);
            list[i] = (ulong)as_uint(bits ^ (bits >> 31 & 0x7fffffff)) << 32 | (uint)list[i];
        }
    }
}

/* cells.cl: the lists of a grid's cells, as cltrace/plan/accel/cells.py makes them: spheres are counted cell by cell, the
 * counts are added up to where each list begins, the spheres are written there, and each list is sorted.
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

/* How many entries the spheres take if each is on the level of its size less a lift, for lifts from 0 to lifts - 1, and
 * how many spheres have each size. For each work-item: 16 numbers of entries, 16 of spheres. */
__kernel void tally(
    const int n,
    const int pitch,
    const int lifts,
    __global const short *restrict covers,
    __global const float *restrict near,
    __global long *restrict part
) {
    long entries[16], spheres[16];
    for (int k = 0; k < 16; k++)
        entries[k] = spheres[k] = 0;
    const int items = get_global_size(0), item = get_global_id(0);
    for (int i = (long)n * item / items; i < (long)n * (item + 1) / items; i++) {
        if (!(near[i] < INFINITY))
            continue;
        const int left = covers[i], top = covers[pitch + i], wide = covers[2L * pitch + i], high = covers[3L * pitch + i];
        const int bits = bits_of(max(wide, high));
        spheres[bits]++;
        for (int lift = 0; lift < lifts; lift++) {
            const int level = max(bits - lift, 0);
            const int columns = ((left + wide) >> level) - (left >> level) + 1, rows = ((top + high) >> level) - (top >> level) + 1;
            entries[lift] += columns * rows;
        }
    }
    for (int k = 0; k < 16; k++)
        part[32 * item + k] = entries[k], part[32 * item + 16 + k] = spheres[k];
}

/* For each cell that a sphere covers, on the level of its size less `lift`; lift < 0: on level 0. */
#define FOR_EACH_CELL(cell, i)                                                                                      \
    const int wide_ = covers[2L * pitch + i], high_ = covers[3L * pitch + i];                                       \
    const int level_ = lift < 0 ? 0 : max(bits_of(max(wide_, high_)) - lift, 0);                                    \
    const int left_ = covers[i], top_ = covers[pitch + i], right_ = (left_ + wide_) >> level_;                      \
    const int pitch_ = levels->pitch[level_], base_ = levels->base[level_];                                         \
    for (int row_ = top_ >> level_; row_ <= (top_ + high_) >> level_; row_++)                                       \
        for (int cell = base_ + row_ * pitch_ + (left_ >> level_); cell <= base_ + row_ * pitch_ + right_; cell++)

__kernel void count_entries(
    const int n,
    const int pitch,
    const int lift,
    __constant Levels *levels,
    __global const short *restrict covers,
    __global const float *restrict near,
    volatile __global int *count
) {
    FOR_EACH_SPHERE(i, n) {
        if (!(near[i] < INFINITY))
            continue;
        FOR_EACH_CELL(cell, i)
            atomic_inc(count + cell);
    }
}

/* The sums of `count` over one part of the cells for each work-item. */
__kernel void sum_cells(const int cells, __global const int *restrict count, __global int *restrict sum) {
    const int items = get_global_size(0), item = get_global_id(0);
    int total = 0;
    for (int i = (long)cells * item / items; i < (long)cells * (item + 1) / items; i++)
        total += count[i];
    sum[item] = total;
}

/* Where each list begins, and the same in `count`, for scattering. sum: of sum_cells(); first: where the first list
 * begins. */
__kernel void start_cells(
    const int cells,
    const int first,
    __global int *restrict count,
    __global const int *restrict sum,
    __global int *restrict start
) {
    const int items = get_global_size(0), item = get_global_id(0);
    int total = first;
    for (int k = 0; k < item; k++)
        total += sum[k];
    for (int i = (long)cells * item / items; i < (long)cells * (item + 1) / items; i++) {
        const int more = count[i];
        start[i] = count[i] = total;
        total += more;
    }
}

/* The entries of all spheres, each into the lists of its cells. mask: the bits of a depth that an entry keeps. */
__kernel void scatter_entries(
    const int n,
    const int pitch,
    const int lift,
    const int first,
    const uint mask,
    __constant Levels *levels,
    __global const short *restrict covers,
    __global const float *restrict near,
    volatile __global int *next,
    __global ulong *restrict entry
) {
    FOR_EACH_SPHERE(i, n) {
        if (!(near[i] < INFINITY))
            continue;
        const int bits = as_int(near[i]);
        const uint rising = as_uint(bits ^ (bits >> 31 & 0x7fffffff)) ^ 0x80000000u;
        const ulong key = (ulong)(rising & mask) << 32 | (uint)i;
        FOR_EACH_CELL(cell, i)
            entry[atomic_inc(next + cell) - first] = key;
    }
}

static void sink(__global ulong *heap, int at, const int count) {
    const ulong key = heap[at];
    for (int child = 2 * at + 1; child < count; child = 2 * at + 1) {
        child += child + 1 < count && heap[child] < heap[child + 1];
        if (heap[child] <= key)
            break;
        heap[at] = heap[child];
        at = child;
    }
    heap[at] = key;
}

/* Lists of more entries are sorted as heaps, whose time does not grow with the square of the number. */
#define SHORT_LIST 48

/* Sorts each list, and gives the depths their own bits. first, last: where the first list begins, and the last one
 * ends. */
__kernel void sort_lists(
    const int cells,
    const int first,
    const int last,
    __global const int *restrict start,
    __global ulong *restrict entry
) {
    FOR_EACH_SPHERE(cell, cells) {
        __global ulong *list = entry + (start[cell] - first);
        const int count = (cell + 1 < cells ? start[cell + 1] : last) - start[cell];
        if (count <= SHORT_LIST)
            for (int i = 1; i < count; i++) {
                const ulong key = list[i];
                int k = i;
                for (; k > 0 && list[k - 1] > key; k--)
                    list[k] = list[k - 1];
                list[k] = key;
            }
        else {
            for (int i = count / 2 - 1; i >= 0; i--)
                sink(list, i, count);
            for (int i = count - 1; i > 0; i--) {
                const ulong most = list[0];
                list[0] = list[i];
                list[i] = most;
                sink(list, 0, i);
            }
        }
        for (int i = 0; i < count; i++) {
            const int bits = as_int((uint)(list[i] >> 32) ^ 0x80000000u);
            list[i] = (ulong)as_uint(bits ^ (bits >> 31 & 0x7fffffff)) << 32 | (uint)list[i];
        }
    }
}

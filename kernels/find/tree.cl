/* tree.cl: the nearest surface along rays that leave a surface, by a tree of boxes. cltrace/plan/accel/bvh.py makes it.
 *
 * One ray at a time walks the tree in float32, against the 8 children of a node, the 8 spheres of a block or the 8
 * triangles of a patch at once. That yields the few shapes that the ray may meet first, with a proof that it is none of the
 * others; then all lanes' rays are decided side by side. Lengths are in the tree's unit, in which the scene's size is about 1, and places count from
 * the scene's middle.
 */
#ifdef WITH_BOUNCES

/* Bit k: whether comparison k of 8 holds. */
#if defined(__AVX__) && defined(__has_builtin)
#if __has_builtin(__builtin_ia32_movmskps256)
#define BITS_OF(mask) __builtin_ia32_movmskps256(as_float8(mask))
#endif
#endif
#ifndef BITS_OF
static int bits_of(const int8 mask) {
    const int8 bits = mask & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    const int4 four = bits.lo | bits.hi;
    const int2 two = four.lo | four.hi;
    return two.x | two.y;
}
#define BITS_OF(mask) bits_of(mask)
#endif

/* Of numbers none of which is a NaN. fmax() and fmin() are three instructions for what is one here. */
static float8 larger(const float8 a, const float8 b) {
    return a > b ? a : b;
}

static float8 smaller(const float8 a, const float8 b) {
    return a < b ? a : b;
}

/* One ray, and what it has found out so far. */
typedef struct {
    float3 o, w; /* its start and its unit direction */
    float reach; /* nothing beyond this distance matters any more */
    int own;     /* the surface that it leaves */
    int lane;
} Walker;

/* The shapes that a packet's rays may meet first, with lower bounds of the distance; room for two leaves' of a ray. */
#define CANDIDATES 16
typedef struct {
    int count[W], index[CANDIDATES][W];
    float near[CANDIDATES][W];
} Candidates;

/* What rays that leave surfaces have met: as Hit, and the side. */
typedef struct {
    REAL t;
    INT id;
    REAL_MASK inside; /* whether the ray comes from the inside of what it meets */
} Met;

/* Which lanes' rays meet a shape, at t, before what they have met so far. As closer(). */
static REAL_MASK closer_from(const Scene scene, const Leaving ray, const INT index, const REAL t, const Met met) {
    const REAL_MASK nearer = t < met.t;
    const REAL_MASK close = too_close(t, met.t);
    if (!RARELY(ANY(TO_MASK(close)))) return nearer;
#ifdef WITH_TRIANGLES
    const REAL_MASK first = comes_first_of(scene, ray, index, met.id);
#else
    REAL_MASK first = TO_REAL_MASK(ids_of(scene, index) < ids_of(scene, met.id));
#if REAL_BYTES == 8
    const Ball ball = balls_of(scene.spheres, index), other = balls_of(scene.spheres, met.id);
    first = comes_first_from(scene.spheres, ray, ball, index, other, met.id, first);
#endif
#endif
    return close ? first : nearer;
}

/* Takes one shape for each lane, -1 for none, into account. */
static void meet(const Scene scene, const Leaving ray, const INT index, Met *met, Work *work) {
    const MASK wanted = index >= 0;
    COUNT(DECIDED, wanted);
#ifdef ONLY_TRIANGLES
    const Encounter at = triangle_meet_from(scene, ray, index, TO_REAL_MASK(wanted));
#else
#ifdef WITH_TRIANGLES
    const MASK flat = index >= scene.spheres.first;
    const INT round = flat ? (INT)-1 : index;
#else
    const INT round = index;
#endif
    const Ball ball = balls_of(scene.spheres, round);
    Encounter at = sphere_meet_from(scene.spheres, ray, ball, round, TO_REAL_MASK(round >= 0));
#ifdef WITH_TRIANGLES
    if (ANY(flat)) {
        const REAL_MASK here = TO_REAL_MASK(flat);
        const Encounter on = triangle_meet_from(scene, ray, flat ? index : (INT)-1, here);
        PUT_WHERE(here, at.t, on.t);
        PUT_WHERE(here, at.inside, on.inside);
    }
#endif
#endif
    const REAL_MASK nearer = TO_REAL_MASK(wanted) & closer_from(scene, ray, index, at.t, *met);
    PUT_WHERE(nearer, met->t, at.t);
    PUT_WHERE(nearer, met->inside, at.inside);
    PUT_WHERE(TO_MASK(nearer), met->id, index);
}

/* Decides all candidates, and forgets them. scale: the length of the ray's direction in the tree's unit. Returns how far
 * each ray has to look from now on. */
static __attribute__((noinline)) FLOAT decide_all(const Scene scene, const Leaving ray, const REAL scale,
                                                  Candidates *list, Met *met, Work *work) {
    FLOAT reach = TO_FLOAT(met->t * scale) * REACH_SLACK;
    INT left = LOAD_LANES(list->count);
    for (int k = 0; ANY(left > k); k++) {
        const MASK wanted = (left > k) & (LOAD_LANES(list->near[k]) <= reach);
        if (!ANY(wanted)) continue;
        meet(scene, ray, wanted ? LOAD_LANES(list->index[k]) : (INT)-1, met, work);
        reach = TO_FLOAT(met->t * scale) * REACH_SLACK;
    }
    for (int lane = 0; lane < W; lane++) list->count[lane] = 0;
    return reach;
}

/* Makes room for a leaf: forgets the candidates that lie too far. Returns whether there is room now. */
static int make_room(const Walker *walker, Candidates *list) {
    const int lane = walker->lane, count = list->count[lane];
    int kept = 0;
    for (int k = 0; k < count; k++) {
        if (list->near[k][lane] > walker->reach) continue;
        list->index[kept][lane] = list->index[k][lane];
        list->near[kept++][lane] = list->near[k][lane];
    }
    list->count[lane] = kept;
    return kept <= CANDIDATES - 8;
}

#ifndef ONLY_TRIANGLES
/* Adds those of a block's spheres that the ray may meet within its reach.
 *
 * The spheres' centres and P are off by u S each, u = 2^-24, S being the scene's size, so F = C - P is by 4.1 u S, w by
 * 1.01 u, and X = F x w by 14.2 u S; b = F.w is by 12.2 u S. outer is the radius and e = 24 u S more, inner as much less
 * [WIDEN = 24]. So |X| > outer is a miss for certain. And as (R + e)^2 - R^2 exceeds what X^2 is off by, the ray enters
 * the sphere beyond b - sqrt(outer^2 - X^2) - e, and, if it does so from outside, before b - sqrt(inner^2 - X^2) + e; if it
 * starts inside, it leaves before b + sqrt(outer^2 - X^2) + e. The second needs 2 R e - e^2 above 36 u S R, so R > 2 e. */
static void add_block(const Tree tree, const int number, Walker *walker, Candidates *list) {
    __global const Block *block = tree.block + number;
    const float e = tree.widen;
    const float8 x = block->x - walker->o.x, y = block->y - walker->o.y, z = block->z - walker->o.z;
    const float8 outer = block->outer * fabs(block->outer), inner = block->inner * block->inner;
    const float wx = walker->w.x, wy = walker->w.y, wz = walker->w.z;
    const float8 b = x * wx + (y * wy + z * wz);
    const float8 X = y * wz - z * wy, Y = z * wx - x * wz, Z = x * wy - y * wx;
    const float8 XX = X * X + (Y * Y + Z * Z);
    const float8 way = sqrt(larger(outer - XX, 0.0f)), first = b - way - e;
    int bits = BITS_OF((XX <= outer) & (b + way + e >= 0) & (first <= walker->reach) & (block->index != walker->own));
    if (!bits) return;
    const int8 sure = block->inner > e;
    const float8 entered = b - sqrt(larger(inner - XX, 0.0f)) + e;
    const int8 starts_inside = sure & (x * x + (y * y + z * z) < inner), enters = sure & (XX <= inner) & (first > 0);
    const float8 last = starts_inside ? b + way + e : enters ? entered : (float8)INFINITY;
    float near[8], far[8];
    int index[8];
    vstore8(first, 0, near);
    vstore8(last, 0, far);
    vstore8(block->index, 0, index);
    const int lane = walker->lane;
    for (; bits; bits &= bits - 1) {
        const int i = 31 - (int)clz(bits & -bits), n = list->count[lane]++;
        list->index[n][lane] = index[i];
        list->near[n][lane] = near[i];
        walker->reach = fmin(walker->reach, far[i]);
    }
}

#endif

#ifdef WITH_PATCHES
/* Adds those of a patch's triangles that the ray may meet within its reach.
 *
 * With C = A - P and R = C x w, U = f.R, V = -e.R and L = N.w - U - V have the sign of N.w, N = e x f, where the ray's line
 * passes inside; it does so at t = (N.C) / (N.w). Let u = 2^-24. As for spheres above, C is off by 4.1 u S and at most 2 S
 * long, R is off by 14.2 u S; S, the scene's size, is 1 at most. e and f are off by 1.01 u of themselves. So U is off by
 * (14.2 + 2 * 1.01 + 2 * 3.03) u |f|, which is less than 23 u |f|; likewise V; N by 4.9 u |e||f|; N.w by 9 u |e||f|, and N.C
 * by (4.1 + 2 * 4.9 + 2 * 3.03) u |e||f|, which is less than 20 u |e||f|; and |e||f| is at most |e| + |f|, as both are at
 * most 2. So L is off by (23 + 9) u (|e| + |f|) and by two roundings, which are 6 u (|e| + |f|) at most as U, V and N.w are
 * below 2 |f|, 2 |e| and |e||f|. All that is less than slack = 40 u (|e| + |f|) + 2^-100 [EDGE_ROUNDINGS = 40]; the last
 * term is for what is below float's range.
 *
 * The signs are turned with that of N.w. Where that is not sure, and the ray passes inside, they sum up to 18 u |e||f| at
 * most, and with the wrong sign none of them is below -slack either. */
static void add_patch(const Scene scene, const int number, Walker *walker, Candidates *list) {
    __global const Patch *patch = scene.patch + number;
    const float8 wx = walker->w.x, wy = walker->w.y, wz = walker->w.z;
    const float8 ex = patch->ex, ey = patch->ey, ez = patch->ez, fx = patch->fx, fy = patch->fy, fz = patch->fz;
    const float8 x = patch->ax - walker->o.x, y = patch->ay - walker->o.y, z = patch->az - walker->o.z;
    const float8 X = FMA(y, wz, -(z * wy)), Y = FMA(z, wx, -(x * wz)), Z = FMA(x, wy, -(y * wx));
    const float8 nx = FMA(ey, fz, -(ez * fy)), ny = FMA(ez, fx, -(ex * fz)), nz = FMA(ex, fy, -(ey * fx));
    const float8 den = FMA(nx, wx, FMA(ny, wy, nz * wz)), slack = patch->slack;
    const int8 sign = as_int8(den) & (int)0x80000000;
    const float8 size = as_float8(as_int8(den) ^ sign);
    const float8 U = as_float8(as_int8(FMA(fx, X, FMA(fy, Y, fz * Z))) ^ sign);
    const float8 V = as_float8(as_int8(FMA(ex, X, FMA(ey, Y, ez * Z))) ^ sign ^ (int)0x80000000);
    const float8 D = as_float8(as_int8(FMA(nx, x, FMA(ny, y, nz * z))) ^ sign);
    const float8 least = smaller(smaller(U, V), size - U - V);
    const int8 steep = size > slack;
    /* The distance is at least this, but for roundings. */
    const float8 first = steep ? larger(D - slack, 0.0f) * (1 - 0x1p-20f) / (size + slack) : 0.0f;
    int bits = BITS_OF((least >= -slack) & (!steep | (D >= -slack)) & (first <= walker->reach) &
                       (patch->index != walker->own) & (slack > 0));
    if (!bits) return;
    const int8 sure = steep & (least > slack) & (D > slack);
    const float8 last = sure ? (D + slack) * (1 + 0x1p-20f) / (size - slack) : (float8)INFINITY;
    float near[8], far[8];
    int index[8];
    vstore8(first, 0, near);
    vstore8(last, 0, far);
    vstore8(patch->index, 0, index);
    const int lane = walker->lane;
    for (; bits; bits &= bits - 1) {
        const int i = 31 - (int)clz(bits & -bits), n = list->count[lane]++;
        list->index[n][lane] = index[i];
        list->near[n][lane] = near[i];
        walker->reach = fmin(walker->reach, far[i]);
    }
}
#endif

/* Adds those of a leaf's shapes that the ray may meet within its reach. */
static void add_leaf(const Scene scene, const int number, Walker *walker, Candidates *list) {
#ifdef ONLY_TRIANGLES
    add_patch(scene, number, walker, list);
#else
#ifdef WITH_PATCHES
    if (number >= scene.tree.blocks) {
        add_patch(scene, number - scene.tree.blocks, walker, list);
        return;
    }
#endif
    add_block(scene.tree, number, walker, list);
#endif
}

#ifdef WITH_TREE
/* Nodes and leaves that are still to be visited, each with the distance at which the ray enters its box in the upper half:
 * that is a float of at least 0, so the numbers are in the order of these distances. Each level of the tree adds 7 at most,
 * and there are no more than 9: see build_tree() in cltrace/plan/accel/bvh.py. */
#define STACK 64
typedef struct {
    int top;
    ulong entry[STACK];
} Stack;

/* Fetches a node or a leaf that is to be visited soon: in large trees, half of the time is waiting. */
static void fetch_child(const Scene scene, const int child) {
#ifdef FETCH
    const Tree tree = scene.tree;
#ifdef WITH_PATCHES
    if (child < -tree.blocks) {
        __global const uchar *leaf = (__global const uchar *)(scene.patch + (~child - tree.blocks));
        FETCH(leaf, 0);
        FETCH(leaf, 64);
        FETCH(leaf, 128);
        FETCH(leaf, 192);
        FETCH(leaf, 256);
        FETCH(leaf, 320);
        return;
    }
#endif
    __global const uchar *lines = child < 0 ? (__global const uchar *)(tree.block + ~child)
                                            : (__global const uchar *)(tree.node + child);
    FETCH(lines, 0);
    FETCH(lines, 64);
    FETCH(lines, 128);
#endif
}

/* Puts those children of a node on the stack whose boxes the ray enters within its reach, the nearest on top.
 *
 * Boxes are rounded outwards. 1 / w and the products are off by 3 u each, which the factor of `far` makes good, and P by
 * u |o|, and by what double rounds, which pad makes good. No direction is so nearly along a plane that its reciprocal
 * leaves float's range. */
static void add_children(const Scene scene, const int number, const Walker *walker, const float3 over, Stack *stack) {
    __global const Node *node = scene.tree.node + number;
    __global const float8 *planes = &node->low_x;
    const int x = over.x < 0, y = over.y < 0, z = over.z < 0;
    const float3 pad = copysign(0x1p-22f * fabs(walker->o) + 0x1p-50f, over);
    const float3 from = -(walker->o + pad) * over, to = -(walker->o - pad) * over;
    const float8 near = larger(larger(fma(planes[x], over.x, from.x), fma(planes[2 + y], over.y, from.y)),
                               larger(fma(planes[4 + z], over.z, from.z), 0.0f));
    const float8 far = smaller(smaller(fma(planes[1 - x], over.x, to.x), fma(planes[3 - y], over.y, to.y)),
                               fma(planes[5 - z], over.z, to.z));
    int bits = BITS_OF((near <= far * (1 + 0x1p-20f)) & (near <= walker->reach));
    if (!bits) return;
    int enter[8], child[8];
    vstore8(as_int8(near), 0, enter);
    vstore8(node->child, 0, child);
    const int base = stack->top;
    for (; bits; bits &= bits - 1) {
        const int i = 31 - (int)clz(bits & -bits);
        fetch_child(scene, child[i]);
        const ulong entry = (ulong)(uint)enter[i] << 32 | (uint)child[i];
        int k = stack->top++;
        for (; k > base && stack->entry[k - 1] < entry; k--) stack->entry[k] = stack->entry[k - 1];
        stack->entry[k] = entry;
    }
}
#endif

/* The nearest surface that each of the lanes `live` of these rays meets; of equally near ones that with the lowest id. */
static __attribute__((noinline)) Met closest_from(const Scene scene, const Leaving ray, const MASK live, Work *work) {
    Met met = {INFINITY, -1, 0};
    const Tree tree = scene.tree;
    const REAL length = sqrt(DOT(ray.w, ray.w)), scale = length * tree.middle.w, over = 1 / length;
    /* The far side of the own surface is met for certain. */
    const MASK inner = live & TO_MASK(ray.inner);
    if (ANY(inner)) meet(scene, ray, inner ? ray.own : (INT)-1, &met, work);
    float x[W], y[W], z[W], wx[W], wy[W], wz[W], reach[W];
    int own[W], wanted[W];
    STORE_LANES(TO_FLOAT(((ray.center.x - tree.middle.x) + ray.p.x) * tree.middle.w), x);
    STORE_LANES(TO_FLOAT(((ray.center.y - tree.middle.y) + ray.p.y) * tree.middle.w), y);
    STORE_LANES(TO_FLOAT(((ray.center.z - tree.middle.z) + ray.p.z) * tree.middle.w), z);
    STORE_LANES(TO_FLOAT(ray.w.x * over), wx);
    STORE_LANES(TO_FLOAT(ray.w.y * over), wy);
    STORE_LANES(TO_FLOAT(ray.w.z * over), wz);
    STORE_LANES(TO_FLOAT(met.t * scale) * REACH_SLACK, reach);
    STORE_LANES(ray.own, own);
    STORE_LANES(live, wanted);
    Candidates list;
    for (int lane = 0; lane < W; lane++) list.count[lane] = 0;
    for (int lane = 0; lane < W; lane++) {
        if (!wanted[lane]) continue;
        Walker walker = {{x[lane], y[lane], z[lane]}, {wx[lane], wy[lane], wz[lane]}, reach[lane], own[lane], lane};
#ifdef WITH_TREE
        const float3 least = fmax(fabs(walker.w), 0x1p-60f), reciprocal = copysign(1 / least, walker.w);
        Stack stack;
        stack.top = 1;
        stack.entry[0] = 0;
        while (stack.top) {
            const ulong entry = stack.entry[--stack.top];
            if (as_float((int)(entry >> 32)) > walker.reach) continue;
            const int number = (int)entry;
            if (number >= 0) {
                add_children(scene, number, &walker, reciprocal, &stack);
                continue;
            }
            const int leaf = ~number;
#else
#ifdef WITH_PATCHES
        const int leaves = tree.blocks + scene.patches;
#else
        const int leaves = tree.blocks;
#endif
        for (int leaf = 0; leaf < leaves; leaf++) {
#endif
            if (list.count[lane] > CANDIDATES - 8 && !make_room(&walker, &list)) {
                float all[W];
                STORE_LANES(decide_all(scene, ray, scale, &list, &met, work), all);
                walker.reach = fmin(walker.reach, all[lane]);
            }
            add_leaf(scene, leaf, &walker, &list);
        }
    }
    decide_all(scene, ray, scale, &list, &met, work);
    return met;
}
#endif

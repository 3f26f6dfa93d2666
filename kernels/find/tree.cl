/* tree.cl: the nearest surface along rays that leave a surface, by a tree of boxes. cltrace/plan/accel/bvh.py makes
 * it.
 *
 * The rays walk the tree in float32: those of a packet together as long as they go the same way, else one at a time
 * against all 8 children of a node at once. That yields the few shapes that each ray may meet first, with a proof that
 * it is none of the others (leaves.cl); then all lanes' rays are decided side by side.
 */
#ifdef WITH_BOUNCES

/* What rays that leave surfaces have met: as Hit, and the side. */
typedef struct {
    REAL t;
    INT id;
    REAL_MASK inside; /* whether the ray comes from the inside of what it meets */
#ifdef WITH_TRIANGLES
    Shares shares; /* where on a triangle */
#endif
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
    Shares shares;
    const Encounter at = triangle_meet_from(scene, ray, index, TO_REAL_MASK(wanted), &shares);
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
    Shares shares = met->shares;
    if (ANY(flat)) {
        const REAL_MASK here = TO_REAL_MASK(flat);
        const Encounter on = triangle_meet_from(scene, ray, flat ? index : (INT)-1, here, &shares);
        PUT_WHERE(here, at.t, on.t);
        PUT_WHERE(here, at.inside, on.inside);
    }
#endif
#endif
    const REAL_MASK nearer = TO_REAL_MASK(wanted) & closer_from(scene, ray, index, at.t, *met);
    PUT_WHERE(nearer, met->t, at.t);
    PUT_WHERE(nearer, met->inside, at.inside);
    PUT_WHERE(TO_MASK(nearer), met->id, index);
#ifdef WITH_TRIANGLES
    PUT_WHERE(nearer, met->shares.EB, shares.EB);
    PUT_WHERE(nearer, met->shares.EC, shares.EC);
    PUT_WHERE(nearer, met->shares.all, shares.all);
#endif
}

/* Decides all candidates, and forgets them. scale: the length of the ray's direction in the tree's unit. Tells how
 * far each ray has to look from now on. */
static __attribute__((noinline)) void decide_all(const Scene *all, const Leaving *ray, const REAL scale, Search *search,
                                                 Met *met, Work *work) {
    const Scene scene = *all;
    FLOAT reach = TO_FLOAT(met->t * scale) * REACH_SLACK;
    const INT left = LOAD_LANES(search->count);
    for (int k = 0; ANY(left > k); k++) {
        const MASK wanted = (left > k) & (LOAD_LANES(search->near[k]) <= reach);
        if (!ANY(wanted)) continue;
        meet(scene, *ray, wanted ? LOAD_LANES(search->index[k]) : (INT)-1, met, work);
        reach = TO_FLOAT(met->t * scale) * REACH_SLACK;
    }
    const FLOAT before = LOAD_LANES(search->reach);
    STORE_LANES(reach < before ? reach : before, search->reach);
    search->shorter = 1;
    STORE_LANES((INT)0, search->count);
}

/* The ray of a lane. The starts of all rays are off by u |o| and by what double rounds, which pad makes good; 1 / w
 * and the products are by 3 u each, which is left to whoever compares distances. No direction is so nearly along a
 * plane that its reciprocal leaves float's range. */
static Walker walker_of(const Search *search, const int lane) {
    Walker walker;
    walker.o = (float3)(search->o[0][lane], search->o[1][lane], search->o[2][lane]);
    walker.w = (float3)(search->w[0][lane], search->w[1][lane], search->w[2][lane]);
    walker.over = (float3)(search->over[0][lane], search->over[1][lane], search->over[2][lane]);
    const float3 pad = copysign(0x1p-22f * fabs(walker.o) + 0x1p-50f, walker.over);
    walker.from = -(walker.o + pad) * walker.over;
    walker.to = -(walker.o - pad) * walker.over;
    walker.reach = search->reach[lane];
    walker.own = search->own[lane];
    walker.lane = lane;
    return walker;
}

static int leaves_of(const Scene scene) {
#ifdef WITH_PATCHES
    return scene.tree.blocks + scene.patches;
#else
    return scene.tree.blocks;
#endif
}

#ifdef WITH_TREE
/* What is still to be visited, each with the distance at which it is entered in the upper half: that is a float of
 * at least 0, so the numbers are in the order of these distances. Each level of the tree adds 7 at most, and there
 * are no more than 9: see build_tree() in cltrace/plan/accel/bvh.py. */
#define STACK 64
typedef struct {
    int top;
    ulong entry[STACK];
} Stack;

static float entered(const ulong entry) {
    return as_float((int)(entry >> 32));
}

/* Trees of fewer leaves are in a processor's cache, all of them. */
#define LARGE_TREE 2048

/* Fetches a node or a leaf that is to be visited soon: in large trees, half of the time is waiting. */
static void fetch_child(const Scene scene, const int child) {
#ifdef FETCH
    if (leaves_of(scene) < LARGE_TREE) return;
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
    FETCH(lines, 192);
#endif
}

/* Puts those children of a node on the stack whose boxes the ray enters within its reach, the nearest on top. Boxes are
 * rounded outwards. */
static void add_children(const Scene scene, const int number, const Walker *walker, Stack *stack) {
    __global const Node *node = scene.tree.node + number;
    __global const float8 *planes = &node->low_x;
    const float3 over = walker->over, from = walker->from, to = walker->to;
    const int x = over.x < 0, y = over.y < 0, z = over.z < 0;
    const float8 near = larger(larger(FMA(planes[x], over.x, from.x), FMA(planes[2 + y], over.y, from.y)),
                               larger(FMA(planes[4 + z], over.z, from.z), 0.0f));
    const float8 far = smaller(smaller(FMA(planes[1 - x], over.x, to.x), FMA(planes[3 - y], over.y, to.y)),
                               FMA(planes[5 - z], over.z, to.z));
    int bits = BITS_OF((near <= far * (1 + 0x1p-20f)) & (near <= walker->reach));
    if (!bits) return;
    int enter[8], child[8];
    vstore8(as_int8(near), 0, enter);
    vstore8(node->child, 0, child);
    const int base = stack->top;
    for (; bits; bits &= bits - 1) {
        const int i = lowest_of(bits);
        fetch_child(scene, child[i]);
        const ulong entry = (ulong)(uint)enter[i] << 32 | (uint)child[i];
        int k = stack->top++;
        for (; k > base && stack->entry[k - 1] < entry; k--) stack->entry[k] = stack->entry[k - 1];
        stack->entry[k] = entry;
    }
}
#endif

/* Looks for what the ray of a lane may meet, in the part of the tree below a child. */
static void walk_alone(const Scene *all, const Leaving *ray, const REAL scale, const int lane, const int from,
                       Search *search, Met *met, Work *work) {
    const Scene scene = *all;
    Walker walker = walker_of(search, lane);
#ifdef WITH_TREE
    Stack stack;
    stack.top = 1;
    stack.entry[0] = (uint)from;
    while (stack.top) {
        const ulong entry = stack.entry[--stack.top];
        if (entered(entry) > walker.reach) continue;
        const int child = (int)entry;
        if (child >= 0) {
            add_children(scene, child, &walker, &stack);
            continue;
        }
        const int leaf = ~child;
#else
    for (int leaf = 0; leaf < from; leaf++) {
#endif
        if (!make_room(search, lane, walker.reach)) {
            search->reach[lane] = walker.reach;
            decide_all(all, ray, scale, search, met, work);
            walker.reach = search->reach[lane];
        }
        add_leaf(scene, leaf, &walker, search);
    }
    if (walker.reach < search->reach[lane]) {
        search->reach[lane] = walker.reach;
        search->shorter = 1;
    }
}

#if W > 1 && defined(WITH_TREE)
/* So few rays of a packet go on one at a time. */
#define ALONE 5

/* Puts those children of a node on the stack whose boxes any of the rays may enter within the furthest reach: as 8
 * times the node plus the child's place. The nearest is on top. */
static void add_children_for_bundle(const Scene scene, const int number, const Bundle *bundle, const float furthest,
                                    Stack *stack) {
    __global const Node *node = scene.tree.node + number;
    __global const float8 *planes = &node->low_x;
    const int x = bundle->back[0], y = bundle->back[1], z = bundle->back[2];
    float8 near;
    int bits = boxes_met(bundle, planes[x], planes[1 - x], planes[2 + y], planes[3 - y], planes[4 + z], planes[5 - z], furthest,
                         &near);
    if (!bits) return;
    int enter[8];
    vstore8(as_int8(near), 0, enter);
    const int base = stack->top;
    for (; bits; bits &= bits - 1) {
        const int i = lowest_of(bits);
        fetch_child(scene, ((__global const int *)&node->child)[i]);
        const ulong entry = (ulong)(uint)enter[i] << 32 | (uint)(8 * number + i);
        int k = stack->top++;
        for (; k > base && stack->entry[k - 1] < entry; k--) stack->entry[k] = stack->entry[k - 1];
        stack->entry[k] = entry;
    }
}

/* Which rays of a bundle enter a child of a node within their reach. */
static MASK entering(const Scene scene, const Bundle *bundle, const int number, const int i, const FLOAT reach) {
    __global const float8 *planes = &scene.tree.node[number].low_x;
    const int x = bundle->back[0], y = bundle->back[1], z = bundle->back[2];
    const FLOAT x0 = FMA((FLOAT)one_of(planes + x, i), bundle->over.x, bundle->from.x);
    const FLOAT y0 = FMA((FLOAT)one_of(planes + 2 + y, i), bundle->over.y, bundle->from.y);
    const FLOAT z0 = FMA((FLOAT)one_of(planes + 4 + z, i), bundle->over.z, bundle->from.z);
    const FLOAT x1 = FMA((FLOAT)one_of(planes + 1 - x, i), bundle->over.x, bundle->to.x);
    const FLOAT y1 = FMA((FLOAT)one_of(planes + 3 - y, i), bundle->over.y, bundle->to.y);
    const FLOAT z1 = FMA((FLOAT)one_of(planes + 5 - z, i), bundle->over.z, bundle->to.z);
    const FLOAT xy = x0 > y0 ? x0 : y0, z_in = z0 > 0 ? z0 : (FLOAT)0.0f, in = xy > z_in ? xy : z_in;
    const FLOAT last = x1 < y1 ? x1 : y1, out = (last < z1 ? last : z1) * (1 + 0x1p-20f);
    return bundle->live & (in <= out) & (in <= reach);
}

/* Looks for what these rays may meet. Their directions have the same signs. */
static void walk_together(const Scene *all, const Leaving *ray, const REAL scale, const MASK live, Search *search, Met *met,
                          Work *work) {
    const Scene scene = *all;
    Bundle bundle;
    if (popcount(lane_bits(live)) > ALONE) bundle_rays(search, live, &bundle);
    FLOAT reach = LOAD_LANES(search->reach);
    float furthest = LARGEST_FLOAT(live ? reach : (FLOAT)0.0f);
    Stack stack;
    stack.top = 0;
    int child = 0;
    MASK here = live;
    for (;;) {
        int bits = lane_bits(here);
        if (child >= 0 && popcount(bits) > ALONE) {
            add_children_for_bundle(scene, child, &bundle, furthest, &stack);
        } else {
            if (popcount(bits) > ALONE) {
                if (!make_room_for_packet(search, here)) decide_all(all, ray, scale, search, met, work);
                add_leaf_for_packet(scene, ~child, here, &bundle, furthest, search);
            } else {
                for (; bits; bits &= bits - 1) walk_alone(all, ray, scale, lowest_of(bits), child, search, met, work);
            }
            if (search->shorter) {
                search->shorter = 0;
                reach = LOAD_LANES(search->reach);
                furthest = LARGEST_FLOAT(live ? reach : (FLOAT)0.0f);
            }
        }
        do {
            if (!stack.top) return;
            const ulong entry = stack.entry[--stack.top];
            if (entered(entry) > furthest) {
                here = 0;
                continue;
            }
            const int number = (int)((uint)entry >> 3), i = (int)entry & 7;
            child = ((__global const int *)&scene.tree.node[number].child)[i];
            here = entering(scene, &bundle, number, i, reach);
        } while (!ANY(here));
    }
}
#endif

/* The nearest surface that each of the lanes `live` of these rays meets; of equally near ones that with the lowest
 * id. */
static __attribute__((noinline)) Met closest_from(const Scene *all, const Leaving *ray, const MASK live, Work *work) {
    const Scene scene = *all;
    Met met;
    met.t = INFINITY;
    met.id = -1;
    met.inside = 0;
#ifdef WITH_TRIANGLES
    met.shares.EB = met.shares.EC = met.shares.all = 0;
#endif
    const Tree tree = scene.tree;
    const REAL ww = DOT(ray->w, ray->w);
#if REAL_BYTES == 8
    /* 1 / |w|, by one Newton step from float: right to 2^-40. */
    const REAL guess = TO_REAL(1 / sqrt(TO_FLOAT(ww))), over = guess * (1.5 - 0.5 * ww * (guess * guess));
#else
    const REAL over = 1 / sqrt(ww);
#endif
    const REAL scale = ww * over * tree.middle.w;
#ifndef ONLY_TRIANGLES
    /* The far side of the own sphere is met for certain. */
    const MASK inner = live & TO_MASK(ray->inner);
    if (ANY(inner)) meet(scene, *ray, inner ? ray->own : (INT)-1, &met, work);
#endif
    const FLOAT wx = TO_FLOAT(ray->w.x * over), wy = TO_FLOAT(ray->w.y * over), wz = TO_FLOAT(ray->w.z * over);
    Search search;
    STORE_LANES(TO_FLOAT(((ray->center.x - tree.middle.x) + ray->p.x) * tree.middle.w), search.o[0]);
    STORE_LANES(TO_FLOAT(((ray->center.y - tree.middle.y) + ray->p.y) * tree.middle.w), search.o[1]);
    STORE_LANES(TO_FLOAT(((ray->center.z - tree.middle.z) + ray->p.z) * tree.middle.w), search.o[2]);
    STORE_LANES(wx, search.w[0]);
    STORE_LANES(wy, search.w[1]);
    STORE_LANES(wz, search.w[2]);
    STORE_LANES(copysign(1 / fmax(fabs(wx), 0x1p-60f), wx), search.over[0]);
    STORE_LANES(copysign(1 / fmax(fabs(wy), 0x1p-60f), wy), search.over[1]);
    STORE_LANES(copysign(1 / fmax(fabs(wz), 0x1p-60f), wz), search.over[2]);
    STORE_LANES(TO_FLOAT(met.t * scale) * REACH_SLACK, search.reach);
    STORE_LANES(ray->own, search.own);
    STORE_LANES((INT)0, search.count);
    search.shorter = 0;
#if W > 1 && defined(WITH_TREE)
    MASK left = live;
    for (int bits = lane_bits(left); bits; bits = lane_bits(left)) {
        const int lane = lowest_of(bits);
        const MASK like = (AS(int, wx) ^ as_int(search.w[0][lane])) | (AS(int, wy) ^ as_int(search.w[1][lane])) |
                          (AS(int, wz) ^ as_int(search.w[2][lane]));
        const MASK group = left & (like >= 0);
        walk_together(all, ray, scale, group, &search, &met, work);
        left &= ~group;
    }
#else
#ifdef WITH_TREE
    const int from = 0;
#else
    const int from = leaves_of(scene);
#endif
    int wanted[W];
    STORE_LANES(live, wanted);
    for (int lane = 0; lane < W; lane++)
        if (wanted[lane]) walk_alone(all, ray, scale, lane, from, &search, &met, work);
#endif
    if (ANY(LOAD_LANES(search.count) > 0)) decide_all(all, ray, scale, &search, &met, work);
    return met;
}
#endif

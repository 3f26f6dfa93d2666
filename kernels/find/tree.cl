/* tree.cl: the nearest surface along rays that leave a surface, by a tree of boxes. cltrace/plan/accel/tree.py makes
 * it.
 *
 * The rays walk the tree in float32: those of a packet together as long as they go the same way, else one at a time
 * against all 8 children of a node at once. That yields the few shapes that each ray may meet first, with a proof that
 * it is none of the others (leaves.cl); then all lanes' rays are decided side by side.
 */
#ifdef WITH_BOUNCES

/* Which lanes' rays meet a surface, at t, before what they have met so far. As closer(). */
static REAL_MASK closer_from(const Scene *scene, const Leaving ray, const INT index, const REAL t, const Met met) {
    const REAL_MASK nearer = t < met.at.t;
    const REAL_MASK close = too_close(t, met.at.t);
    if (!RARELY(ANY(TO_MASK(close)))) return nearer;
    return close ? comes_first_of(scene, ray, index, TO_MASK(close) ? met.id : index) : nearer;
}

/* Takes one surface for each lane, -1 for none, into account. */
static void meet(const Scene *scene, const Leaving ray, const INT index, Met *met, Work *work) {
    const MASK wanted = index >= 0;
    COUNT(DECIDED, wanted);
    Encounter at = met->at;
    EACH_SHAPE(scene->geometry, index, encounter(scene, ray, index, &at));
    Met rival = *met;
#ifdef WITH_PLANES
    const MASK capped = met->plane >= 0, some = wanted & TO_MASK(at.t < INFINITY);
    PUT_WHERE(TO_REAL_MASK(!counts(scene, &ray, index, at.t, met->plane, some)), at.t, (REAL)INFINITY);
    PUT_WHERE(TO_REAL_MASK(capped), rival.at.t, (REAL)INFINITY);
    PUT_WHERE(TO_MASK(at.t < INFINITY), met->plane, (INT)-1);
#endif
    const REAL_MASK nearer = TO_REAL_MASK(wanted) & closer_from(scene, ray, index, at.t, rival);
    PUT_WHERE(nearer, met->at.t, at.t);
    PUT_WHERE(nearer, met->at.inside, at.inside);
    PUT_WHERE(TO_MASK(nearer), met->id, index);
    if (ANY_LATE) put_shares(nearer, at.shares, &met->at.shares);
}

/* Decides all candidates, and forgets them. Tells how far each ray has to look from now on. */
static __attribute__((noinline)) void decide_all(Search *search) {
    const Scene *scene = search->scene;
    const REAL scale = search->scale;
    Met *met = search->met;
    FLOAT reach = TO_FLOAT(met->at.t * scale) * REACH_SLACK;
    const INT left = LOAD_LANES(search->count);
    for (int k = 0; ANY(left > k); k++) {
        const MASK wanted = (left > k) & (LOAD_LANES(search->found->near[k]) <= reach);
        if (!ANY(wanted)) continue;
        meet(scene, *search->ray, wanted ? LOAD_LANES(search->found->index[k]) : (INT)-1, met, search->work);
        reach = TO_FLOAT(met->at.t * scale) * REACH_SLACK;
    }
    const FLOAT before = LOAD_LANES(search->reach);
    STORE_LANES(reach < before ? reach : before, search->reach);
    search->shorter = 1;
    if (HAS(WITH_RAYS)) search->decided = 1;
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

static int leaves_of(const Scene *scene) {
    return scene->tree.blocks + scene->patches;
}

/* What is still to be visited, each with the distance at which it is entered in the upper half: that is a float of
 * at least 0, so the numbers are in the order of these distances. Each level of the tree adds 7 at most, and there
 * are no more than 9: see build_tree() in cltrace/plan/accel/tree.py. */
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
static void fetch_child(const Scene *scene, const int child) {
    if (!CAN_FETCH || leaves_of(scene) < LARGE_TREE) return;
    if (child < 0) {
        ASK_LEAF(scene->tree, ~child, fetch_leaf(scene, ~child));
        return;
    }
    __global const uchar *lines = (__global const uchar *)(scene->tree.node + child);
    for (int line = 0; line < 4; line++) FETCH(lines, 64 * line);
}

/* Puts those children of a node on the stack whose boxes the ray enters within its reach, the nearest on top. Boxes are
 * rounded outwards. */
static void add_children(const Scene *scene, const int number, const Walker *walker, Stack *stack) {
    __global const Node *node = scene->tree.node + number;
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

/* Looks for what the ray of a lane may meet in a leaf. */
static __attribute__((always_inline)) void visit_leaf(const int leaf, Walker *walker, Search *search) {
    if (!make_room(search, walker->lane, walker->reach)) {
        search->reach[walker->lane] = walker->reach;
        decide_all(search);
        walker->reach = search->reach[walker->lane];
    }
    const Scene *scene = search->scene;
    ASK_LEAF(scene->tree, leaf, add_leaf(scene, leaf, walker, search));
}

/* The same in all leaves below a child of the tree; where there is no tree, in the first `from` leaves, which are all.
 */
static __attribute__((always_inline)) void visit_leaves(const int from, Walker *walker, Search *search) {
    if (!HAS(WITH_TREE)) {
        for (int leaf = 0; leaf < from; leaf++) visit_leaf(leaf, walker, search);
        return;
    }
    const Scene *scene = search->scene;
    Stack stack;
    stack.top = 1;
    stack.entry[0] = (uint)from;
    while (stack.top) {
        const ulong entry = stack.entry[--stack.top];
        if (entered(entry) > walker->reach) continue;
        const int child = (int)entry;
        if (child >= 0) add_children(scene, child, walker, &stack);
        else visit_leaf(~child, walker, search);
    }
}

/* Looks for what the ray of a lane may meet, in the part of the tree below a child. */
static void walk_alone(const int lane, const int from, Search *search) {
    Walker walker = walker_of(search, lane);
    visit_leaves(from, &walker, search);
    if (walker.reach < search->reach[lane]) {
        search->reach[lane] = walker.reach;
        search->shorter = 1;
    }
}

/* The same for each of these rays. */
static void walk_each(const MASK live, Search *search) {
    const int from = HAS(WITH_TREE) ? 0 : leaves_of(search->scene);
    int wanted[W];
    STORE_LANES(live, wanted);
    for (int lane = 0; lane < W; lane++)
        if (wanted[lane]) walk_alone(lane, from, search);
}

#if W > 1
/* So few rays of a packet go on one at a time. */
#define ALONE 5

/* Puts those children of a node on the stack whose boxes any of the rays may enter within the furthest reach: as 8
 * times the node plus the child's place. The nearest is on top. */
static void add_children_for_bundle(const Scene *scene, const int number, const Bundle *bundle, const float furthest,
                                    Stack *stack) {
    __global const Node *node = scene->tree.node + number;
    __global const float8 *planes = &node->low_x;
    const int x = bundle->back[0], y = bundle->back[1], z = bundle->back[2];
    float8 near;
    const float8 in[3] = {planes[x], planes[2 + y], planes[4 + z]};
    const float8 out[3] = {planes[1 - x], planes[3 - y], planes[5 - z]};
    int bits = boxes_met(bundle, in, out, furthest, &near);
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
static MASK entering(const Scene *scene, const Bundle *bundle, const int number, const int i, const FLOAT reach) {
    __global const float8 *planes = &scene->tree.node[number].low_x;
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
static void walk_together(const MASK live, Search *search) {
    const Scene *scene = search->scene;
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
                if (!make_room_for_packet(search, here)) decide_all(search);
                ASK_LEAF(scene->tree, ~child, add_leaf_for_packet(scene, ~child, here, &bundle, furthest, search));
            } else {
                for (; bits; bits &= bits - 1) walk_alone(lowest_of(bits), child, search);
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
            child = ((__global const int *)&scene->tree.node[number].child)[i];
            here = entering(scene, &bundle, number, i, reach);
        } while (!ANY(here));
    }
}

/* All of these rays, those together that go into the same octant. */
static void walk_all(const MASK live, Search *search) {
    if (!HAS(WITH_TREE)) {
        walk_each(live, search);
        return;
    }
    const FLOAT wx = LOAD_LANES(search->w[0]), wy = LOAD_LANES(search->w[1]), wz = LOAD_LANES(search->w[2]);
    MASK left = live;
    for (int bits = lane_bits(left); bits; bits = lane_bits(left)) {
        const int lane = lowest_of(bits);
        const MASK like = (AS(int, wx) ^ as_int(search->w[0][lane])) | (AS(int, wy) ^ as_int(search->w[1][lane])) |
                          (AS(int, wz) ^ as_int(search->w[2][lane]));
        const MASK group = left & (like >= 0);
        walk_together(group, search);
        left &= ~group;
    }
}
#else
#define walk_all(live, search) walk_each(live, search)
#endif

/* 1 / |w|, from the square of |w|: by one Newton step from float, which is right to 2^-40. */
static REAL over_root(const REAL ww) {
    if (REAL_BYTES == 4) return 1 / sqrt(ww);
    const REAL guess = TO_REAL(1 / sqrt(TO_FLOAT(ww)));
    return guess * ((real)1.5f - (real)0.5f * ww * (guess * guess));
}

/* Begins the search of rays for what they meet before `limit`, in t, and before what is in `met`. found: room for
 * candidates. */
static void start_search(const Scene *scene, const Leaving *ray, const REAL limit, Reached *found, Met *met, Work *work,
                         Search *search) {
    const real4 middle = scene->tree.middle;
    const REAL ww = DOT(ray->w, ray->w), over = over_root(ww);
    const Real3 from = sum3(difference(ray->center, (Real3){middle.x, middle.y, middle.z}), ray->p);
    const Real3 start = scaled(from, middle.w), way = scaled(ray->w, over);
    const FLOAT o[3] = {TO_FLOAT(start.x), TO_FLOAT(start.y), TO_FLOAT(start.z)};
    const FLOAT w[3] = {TO_FLOAT(way.x), TO_FLOAT(way.y), TO_FLOAT(way.z)};
    for (int j = 0; j < 3; j++) {
        STORE_LANES(o[j], search->o[j]);
        STORE_LANES(w[j], search->w[j]);
        STORE_LANES(copysign(1 / fmax(fabs(w[j]), 0x1p-60f), w[j]), search->over[j]);
    }
    search->scene = scene;
    search->ray = ray;
    search->found = found;
    search->met = met;
    search->work = work;
    search->scale = ww * over * middle.w;
    const REAL end = met->at.t < limit ? met->at.t : limit;
    STORE_LANES(TO_FLOAT(end * search->scale) * REACH_SLACK, search->reach);
    STORE_LANES(ray->own, search->own);
    STORE_LANES((INT)0, search->count);
    search->shorter = search->decided = 0;
}

/* The nearest surface that each of the lanes `live` of these rays meets; of equally near ones that with the lowest id.
 *
 * limit: how far each ray has to look, in t. Surfaces beyond it are left out where that saves work, and may be returned
 * otherwise: whoever has a limit compares t with it. */
static __attribute__((noinline)) Met closest_from(const Scene *all, const Leaving *ray, const MASK live,
                                                  const REAL limit, Work *work) {
    Met met = {{INFINITY, 0, {0, 0, 0}}, -1, -1};
#ifdef WITH_PLANES
    meet_caps_from(all, ray, live, &met);
#endif
    /* The far side of what is round is met for certain. */
    const MASK inner = live & TO_MASK(ray->inner);
    if (ANY_ROUND && ANY(inner)) meet(all, *ray, inner ? ray->own : (INT)-1, &met, work);
    Reached found; /* is large: most of it is never read before it is written */
    Search search;
    start_search(all, ray, limit, &found, &met, work, &search);
    walk_all(live, &search);
    if (ANY(LOAD_LANES(search.count) > 0)) decide_all(&search);
    return met;
}
#endif

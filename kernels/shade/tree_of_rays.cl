/* tree_of_rays.cl: what mirrors and glass add to a pixel. cltrace/reference/trace.py has the same in follow().
 *
 * A ray that meets a surface may go on as two rays, one mirrored and one refracted, and each of these again. A pixel is the
 * sum of what all of them see, each with its weight.
 */
#ifdef WITH_BOUNCES
static Shade3 shade(const Scene scene, const Real3 d, const REAL a, const Intersection at, const INT own, INT *rays,
                    Work *work);
#ifdef WITH_TRIANGLES
static __attribute__((always_inline)) INT materials_of(const Scene scene, const INT id);
#endif
static Intersection intersection_from(const Frame frame, const Scene scene, const Leaving ray, const Met met);

/* Colours that add up to a pixel's, as whole numbers of 2^-40. So their sum does not depend on the order of the rays. */
typedef struct {
    LONG x, y, z;
} Sum3;

/* A number of at least 0, rounded to the nearest even one. rint() is 25 instructions on a CPU. What is at least ALL_WHOLE is whole
 * already, and the sum of ALL_WHOLE and what is less is rounded there. */
#if REAL_BYTES == 8
#define ALL_WHOLE 0x1p52
#else
#define ALL_WHOLE 0x1p23f
#endif
static REAL rounded(const REAL x) {
    const REAL sum = x + ALL_WHOLE;
    return x < ALL_WHOLE ? sum - ALL_WHOLE : x;
}

/* weight c, rounded to the nearest even one; at most 2^61, as is their sum. Black stays black, where a weight is infinite,
 * too. */
static LONG part_of(const REAL weight, const SHADE c, const LONG sum) {
    const REAL parts = weight * TO_REAL(c) * (real)0x1p40f, most = (real)0x1p61f;
    const REAL kept = parts > 0 ? parts : (REAL)0;
    const LONG total = sum + TO_LONG(rounded(kept < most ? kept : most));
    return total < (1L << 61) ? total : (LONG)(1L << 61);
}

static void add_to(Sum3 *sum, const MASK where, const REAL weight, const Shade3 color) {
    const REAL w = TO_REAL_MASK(where) ? weight : (REAL)0;
    sum->x = part_of(w, color.x, sum->x);
    sum->y = part_of(w, color.y, sum->y);
    sum->z = part_of(w, color.z, sum->z);
}

static Shade3 color_of(const Sum3 sum) {
    const Shade3 color = {TO_SHADE(TO_REAL(sum.x) * (real)0x1p-40f), TO_SHADE(TO_REAL(sum.y) * (real)0x1p-40f),
                          TO_SHADE(TO_REAL(sum.z) * (real)0x1p-40f)};
    return color;
}

/* Rays on their way, and how much of their colour is in the pixel's. live: the lanes that have one; depth: 0 for those
 * from the eye. */
typedef struct {
    MASK live;
    INT own;
    REAL_MASK inner;
    Real3 n, d;
    REAL weight;
    int depth;
#ifdef WITH_SHAPES
    Real3 q;
#endif
} Branch;

/* What stands for the point where a ray leaves a surface, and how much lift() has to do there. */
#ifdef WITH_SHAPES
#define EXACT_POINT(at) (at).q
#define SPREAD(at) (at).spread
#else
#define EXACT_POINT(at) (at).n
#define SPREAD(at) ((REAL)1)
#endif

/* What a surface does with the rays that meet it: local (1 - r - t) + r mirrored + t refracted. */
typedef struct {
    REAL share;          /* of the local colour */
    REAL mirrors, sends; /* weights of the mirrored ray and of the refracted one */
    Real3 mirrored, refracted;
    REAL_MASK inside;    /* whether the rays meet it from inside */
} Bounce;

/* Of each lane's surface: how much it mirrors, how much it sends on, and its index of refraction. Lanes with a negative id
 * get any ones. */
static Real3 bounces_of(const Scene scene, const INT id) {
#ifdef WITH_TRIANGLES
    /* As in material_at(). */
    INT left = materials_of(scene, id);
    real4 m = scene.bounce[max(LARGEST(left), 0)];
    Real3 r = {m.x, m.y, m.z};
    for (;;) {
        left = left == LARGEST(left) ? (INT)-1 : left;
        const int one = LARGEST(left);
        if (one < 0) return r;
        const REAL_MASK here = TO_REAL_MASK(left == one);
        m = scene.bounce[one];
        PUT_WHERE(here, r.x, (REAL)m.x);
        PUT_WHERE(here, r.y, (REAL)m.y);
        PUT_WHERE(here, r.z, (REAL)m.z);
    }
#else
    real r[W], t[W], index[W];
    int each[W];
    STORE_LANES(id, each);
    for (int lane = 0; lane < W; lane++) {
        const real4 m = scene.bounce[scene.material_of[max(each[lane], 0)]];
        r[lane] = m.x;
        t[lane] = m.y;
        index[lane] = m.z;
    }
    const Real3 all = {LOAD_LANES(r), LOAD_LANES(t), LOAD_LANES(index)};
    return all;
#endif
}

static Bounce bounce_at(const Scene scene, const Intersection at, const INT id, const Branch rays, Work *work) {
    const Real3 of = bounces_of(scene, id);
    const REAL R = of.x, T = of.y, rest = (1 - R) - T;
    Bounce bounce;
    bounce.share = rest > 0 ? rest : (REAL)0;
    bounce.inside = at.start.side < 0;
    bounce.mirrored = mirrored(rays.d, at.normal, at.start.side, SPREAD(at));
    bounce.mirrors = rays.weight * R;
#ifdef WITH_GLASS
    const Refraction through = refracted(rays.d, at.normal, at.start.side, of.z, SPREAD(at));
    const REAL_MASK total = through.total & (T > 0);
    COUNT(TOTAL, TO_MASK(total) & rays.live);
    bounce.refracted = through.d;
    bounce.mirrors = total ? rays.weight * (R + T) : bounce.mirrors;
    bounce.sends = total ? (REAL)0 : rays.weight * T;
#endif
    return bounce;
}

/* What all rays of a pixel see, but for branches that were dropped. */
typedef struct {
    Sum3 sum, slack; /* with them, the sum would be larger by `slack` at most */
    INT rays;        /* those that were traced, that from the eye included */
    MASK alone;      /* where the rays from the eye are all: what they meet sends none on. Then no sum is needed */
    Shade3 first;    /* the own colours of what they meet */
} Gathered;

#ifdef WITH_DROPPING
/* What is seen with a weight adds at most parts = weight * most to a sum, before rounding. Each of its contributions x is
 * rounded to x + 1/2 at most, and to 2 x at most, as nothing up to 1/2 is rounded up. roundings: half of how many
 * contributions there can be. */
static LONG slack_of(const REAL parts, const real roundings) {
    const REAL more = parts < roundings ? parts : (REAL)roundings;
    return TO_LONG(ceil(parts > (real)0.5f ? parts + more : (REAL)0));
}

/* Which lanes' branches are dropped: those that add `faint` to no sum. Their weights are as if something of the scene's
 * greatest brightness filled all that they see; it is that even after rounding, see plan/dropping.py. depth: of the rays
 * that branch, so that 2^(bounces + 1 - depth) - 1 rays follow in each branch. */
static MASK drop(const Scene scene, const MASK branches, const REAL weight, const real faint, const int depth, Sum3 *slack,
                 Work *work) {
    const MASK dropped = branches & TO_MASK(weight * scene.brightest.w <= faint);
    COUNT(DROPPED, dropped);
    if (!ANY(dropped)) return dropped;
    const REAL w = TO_REAL_MASK(dropped) ? weight : (REAL)0;
    const real roundings = ldexp((real)1, scene.bounces - depth);
    slack->x += slack_of(w * scene.brightest.x, roundings);
    slack->y += slack_of(w * scene.brightest.y, roundings);
    slack->z += slack_of(w * scene.brightest.z, roundings);
    return dropped;
}
#endif

/* In units of a sum: 2^-11, an eighth of a level. */
#define MOST_DROPPED (1L << 29)

#ifdef WITH_MARKS
/* What has no more weight leaves no mark: an edge in it is one of less than a level. */
#define FAINT_MARK (real)0x1p-8f
#endif

/* Sums up the colours of rays that hit, with all that mirrors and glass add to them. at, own: what was hit; faint: what
 * adds no more than this to a sum may be dropped, in its units; count: the pixels' shadow rays, counted up. */
static Gathered gather(const Frame frame, const Scene scene, const Ray ray, Intersection at, INT own, const real faint,
                       INT *count, Work *work) {
    const Shade3 background = {frame.background.x, frame.background.y, frame.background.z};
    Gathered all = {{0, 0, 0}, {0, 0, 0}, 1, 0, {0, 0, 0}};
    Branch rays = {at.hit, own, 0, at.normal, ray.d, 1, 0};
#ifdef WITH_SPLITS
    Branch stack[BRANCHES];
    int height = 0;
#endif
    for (;;) {
        const int last = rays.depth > scene.bounces;
        Bounce bounce = bounce_at(scene, at, own, rays, work);
        if (last) {
            bounce.share = 1;
            bounce.mirrors = bounce.sends = 0;
        }
        const REAL weight = rays.weight * bounce.share;
        const MASK shown = at.hit & TO_MASK(weight > 0);
        COUNT(WEIGHTLESS, at.hit & !shown);
#ifdef WITH_MARKS
        const MASK marked = rays.live & TO_MASK(rays.weight > FAINT_MARK);
        MARK(mark, marked, own, rays.depth);
#ifdef WITH_TEXTURES
        MARK(texels, marked & (at.texel >= 0), at.texel, rays.depth);
#endif
        const LANES(uint) mark = work->mark;
#endif
#ifndef KEEP_WEIGHTLESS
        at.hit = shown;
#endif
        if (ANY(at.hit)) {
            const Shade3 shown_color = shade(scene, rays.d, DOT(rays.d, rays.d), at, own, count, work);
            add_to(&all.sum, at.hit, weight, shown_color);
            if (rays.depth == 0) all.first = shown_color;
        }
#ifdef WITH_MARKS
        PUT_WHERE(!(marked & TO_MASK(weight > FAINT_MARK)), work->mark, mark);
#endif

        /* On with the mirrored ray, or where there is none with the refracted one. Whichever waits, there is one of a
         * depth at most, so BRANCHES are enough. (If the lighter one went first, only as many could wait as halve a weight
         * before it is dropped; but of each lane, and a packet's lanes may split at different depths.) */
        MASK mirrors = rays.live & TO_MASK(bounce.mirrors > 0);
        if (rays.depth == 0) all.alone = rays.live & !mirrors;
#ifdef WITH_DROPPING
        mirrors = mirrors & !drop(scene, mirrors, bounce.mirrors, faint, rays.depth, &all.slack, work);
#endif
        Branch next = {mirrors, own, bounce.inside, at.normal, bounce.mirrored, bounce.mirrors, rays.depth + 1};
#ifdef WITH_GLASS
        MASK sends = rays.live & TO_MASK(bounce.sends > 0);
        if (rays.depth == 0) all.alone = all.alone & !sends;
#ifdef WITH_DROPPING
        sends = sends & !drop(scene, sends, bounce.sends, faint, rays.depth, &all.slack, work);
#endif
        const MASK only = sends & !mirrors;
        const REAL_MASK through = TO_REAL_MASK(only);
        next.live = mirrors | only;
        next.inner = through ? !bounce.inside : bounce.inside;
        PUT_WHERE(through, next.d.x, bounce.refracted.x);
        PUT_WHERE(through, next.d.y, bounce.refracted.y);
        PUT_WHERE(through, next.d.z, bounce.refracted.z);
        PUT_WHERE(through, next.weight, bounce.sends);
#ifdef WITH_SPLITS
        if (ANY(sends & mirrors)) {
            Branch other = {sends & mirrors, own, !bounce.inside, at.normal, bounce.refracted, bounce.sends, rays.depth + 1};
#ifdef WITH_SHAPES
            other.q = at.q;
#endif
            stack[height++] = other;
        }
#endif
#endif
#ifdef WITH_SHAPES
        next.q = at.q;
#endif
        /* On until some rays meet something: first those, then the ones that wait. */
        Leaving path;
        Met met;
        for (rays = next;;) {
            if (ANY(rays.live)) {
                COUNT(BOUNCES, rays.live);
#ifdef WITH_CEILING
                all.rays += rays.live ? (INT)1 : (INT)0;
                if (ANY(all.rays > MOST_RAYS)) return all;
#endif
                path = leaving(frame, scene.spheres, rays.own, rays.inner, rays.n, EXACT_POINT(rays), rays.d);
                met = closest_from(&scene, &path, rays.live, work);
                FETCH_SURFACES(scene, met.id);
                add_to(&all.sum, rays.live & (met.id < 0), rays.weight, background);
                rays.live = rays.live & (met.id >= 0);
                if (ANY(rays.live)) break;
            }
#ifdef WITH_SPLITS
            if (height) {
                rays = stack[--height];
                continue;
            }
#endif
            return all;
        }
        at = intersection_from(frame, scene, path, met);
        own = met.id;
    }
}

/* Which lanes' outputs might be others with what was dropped. Bytes and floats never fall as a sum grows. Of means over pixels samples
 * may lack a part of a level, see plan/dropping.py. */
static MASK unproven(const Frame frame, const Gathered all, const Shade3 color) {
#if defined(WITH_DROPPING) && defined(WITH_AVERAGE)
    const LONG most = (LONG)MOST_DROPPED;
    const LONG more = (all.slack.x > most) | (all.slack.y > most) | (all.slack.z > most);
    return TO_INT(more);
#elif defined(WITH_DROPPING)
    const LONG most = 1L << 61;
    const LONG x = all.sum.x + all.slack.x, y = all.sum.y + all.slack.y, z = all.sum.z + all.slack.z;
    const Sum3 sum = {x < most ? x : most, y < most ? y : most, z < most ? z : most};
    const Shade3 high = color_of(sum);
    const shade_t rounding = frame.quantize.x;
    MASK differ = (byte_of(color.x, rounding) != byte_of(high.x, rounding)) |
                  (byte_of(color.y, rounding) != byte_of(high.y, rounding)) |
                  (byte_of(color.z, rounding) != byte_of(high.z, rounding));
#ifdef PROVE_COLOR
    differ = differ | (TO_FLOAT(color.x) != TO_FLOAT(high.x)) | (TO_FLOAT(color.y) != TO_FLOAT(high.y)) |
             (TO_FLOAT(color.z) != TO_FLOAT(high.z));
#endif
    return differ;
#else
    return (MASK)0;
#endif
}

/* The colours of rays that hit, with all that mirrors and glass add to them. at, own: what was hit.
 *
 * First without branches that are faint, then, where an output might be another with them, without those that are 64 times
 * fainter, and so on until all that is dropped would be rounded to nothing. A ray that is traced with one limit is traced
 * with all lower ones. So where there are too many rays with one limit, there would be too many without any. */
static Shade3 follow(const Frame frame, const Scene scene, const Ray ray, Intersection at, const INT own, Pixels *pixels,
                     Work *work) {
    Shade3 color = {0, 0, 0};
#ifdef WITH_CEILING
    at.hit = at.hit & pixels->wanted;
#endif
#ifdef WITH_DROPPING
    const real first = scene.faint;
#else
    const real first = -1;
#endif
    for (real faint = first; ANY(at.hit); faint = faint > 32 ? faint / 64 : (real)0.5f) {
#ifdef WITH_MARKS
        PUT_WHERE(at.hit, work->mark, (LANES(uint))0);
        PUT_WHERE(at.hit, work->texels, (LANES(uint))0);
#endif
        const Gathered all = gather(frame, scene, ray, at, own, faint, &pixels->rays, work);
#ifdef WITH_CEILING
        pixels->overgrown = at.hit & (all.rays > MOST_RAYS);
        if (ANY(pixels->overgrown)) break;
#endif
        Shade3 seen = color_of(all.sum);
        const SHADE_MASK alone = TO_SHADE_MASK(all.alone);
        PUT_WHERE(alone, seen.x, all.first.x);
        PUT_WHERE(alone, seen.y, all.first.y);
        PUT_WHERE(alone, seen.z, all.first.z);
        const SHADE_MASK here = TO_SHADE_MASK(at.hit);
        PUT_WHERE(here, color.x, seen.x);
        PUT_WHERE(here, color.y, seen.y);
        PUT_WHERE(here, color.z, seen.z);
        at.hit = at.hit & !all.alone & unproven(frame, all, seen);
        COUNT(RETRACED, at.hit);
    }
    return color;
}
#endif

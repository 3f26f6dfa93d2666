/* tree_of_rays.cl: what mirrors and glass add to a pixel. cltrace/reference/trace.py has the same in follow().
 *
 * A ray that meets a surface may go on as two rays, one mirrored and one refracted, and each of these again. A pixel is
 * the sum of what all of them see, each with its weight.
 */
#ifdef WITH_BOUNCES
static Shade3 shade(const Scene *scene, const Real3 d, const REAL a, const Intersection at, const INT own, INT *rays,
                    Work *work);

/* Colours that add up to a pixel's, as whole numbers of 2^-40. So their sum does not depend on the order of the rays.
 */
typedef struct {
    LONG x, y, z;
} Sum3;

/* A number of at least 0, rounded to the nearest even one. rint() is 25 instructions on a CPU. What is at least
 * ALL_WHOLE is whole already, and the sum of ALL_WHOLE and what is less is rounded there. */
#define ALL_WHOLE ((real)(REAL_BYTES == 8 ? 0x1p52f : 0x1p23f))
static REAL rounded(const REAL x) {
    const REAL sum = x + ALL_WHOLE;
    return x < ALL_WHOLE ? sum - ALL_WHOLE : x;
}

/* weight c, rounded to the nearest even one; at most 2^61, as is their sum. Black stays black, where a weight is
 * infinite, too. */
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
    return (Shade3){TO_SHADE(TO_REAL(sum.x) * (real)0x1p-40f), TO_SHADE(TO_REAL(sum.y) * (real)0x1p-40f),
                    TO_SHADE(TO_REAL(sum.z) * (real)0x1p-40f)};
}

/* Rays on their way, and how much of their colour is in the pixel's. live: the lanes that have one; own: the surface
 * that they leave, and once they have met another one, that; depth: 0 for those from the eye. */
typedef struct {
    MASK live;
    INT own;
    REAL_MASK inner;
    Real3 n, d;
    REAL weight;
    int depth;
    Real3 q; /* WITH_SHAPES, what stands for the point where they leave a surface */
} Branch;

/* How much lift() has to do at points. */
static REAL spread_at(const Intersection at) {
    return HAS(WITH_SHAPES) ? at.spread : (REAL)1;
}

/* What a surface does with the rays that meet it: local (1 - r - t) + r mirrored + t refracted. */
typedef struct {
    REAL share;          /* of the local colour */
    REAL mirrors, sends; /* weights of the mirrored ray and of the refracted one */
    Real3 mirrored, refracted;
    REAL_MASK inside; /* whether the rays meet it from inside */
} Bounce;

static Bounce bounce_at(const Scene *scene, const Intersection at, const Branch rays, Work *work) {
    const Real4 of = rows_at(scene->bounce, materials_of(scene, rays.own)); /* reflectance, transmittance, index */
    const REAL_MASK matte = HAS(WITH_PLANES) ? TO_REAL_MASK(at.matte) : (REAL_MASK)0;
    const REAL R = matte ? (REAL)0 : of.x, T = matte ? (REAL)0 : of.y, rest = (1 - R) - T;
    Bounce bounce;
    bounce.share = rest > 0 ? rest : (REAL)0;
    bounce.inside = at.start.side < 0;
    bounce.mirrored = mirrored(rays.d, at.normal, at.start.side, spread_at(at));
    bounce.mirrors = rays.weight * R;
    bounce.sends = 0;
    if (HAS(WITH_GLASS)) {
        const Refraction through = refracted(rays.d, at.normal, at.start.side, of.z, spread_at(at));
        const REAL_MASK total = through.total & (T > 0);
        COUNT(TOTAL, TO_MASK(total) & rays.live);
        bounce.refracted = through.d;
        bounce.mirrors = total ? rays.weight * (R + T) : bounce.mirrors;
        bounce.sends = total ? (REAL)0 : rays.weight * T;
    }
    if (rays.depth > scene->bounces) {
        bounce.share = 1;
        bounce.mirrors = bounce.sends = 0;
    }
    return bounce;
}

/* What all rays of a pixel see, but for branches that were dropped. */
typedef struct {
    Sum3 sum, slack; /* with them, the sum would be larger by `slack` at most */
    INT rays;        /* those that were traced, that from the eye included */
    INT shadow_rays; /* those that were traced to lights */
    MASK alone;      /* where the rays from the eye are all: what they meet sends none on. Then no sum is needed */
    Shade3 first;    /* the own colours of what they meet */
    real faint;      /* what adds no more than this to a sum is dropped, in its units */
} Gathered;

/* What is seen with a weight adds at most parts = weight * most to a sum, before rounding. Each of its contributions x
 * is rounded to x + 1/2 at most, and to 2 x at most, as nothing up to 1/2 is rounded up. roundings: half of how many
 * contributions there can be. */
static LONG slack_of(const REAL parts, const real roundings) {
    const REAL more = parts < roundings ? parts : (REAL)roundings;
    return TO_LONG(ceil(parts > (real)0.5f ? parts + more : (REAL)0));
}

/* Which lanes' branches are dropped: those that add `faint` to no sum. Their weights are as if something of the scene's
 * greatest brightness filled all that they see; it is that even after rounding, see plan/materials.py. depth: of the
 * rays that branch, so that 2^(bounces + 1 - depth) - 1 rays follow in each branch. */
static MASK drop(const Scene *scene, const MASK branches, const REAL weight, const real faint, const int depth,
                 Sum3 *slack, Work *work) {
    if (!HAS(WITH_SPLITS)) return 0;
    const MASK dropped = branches & TO_MASK(weight * scene->brightest.w <= faint);
    COUNT(DROPPED, dropped);
    if (!ANY(dropped)) return dropped;
    const REAL w = TO_REAL_MASK(dropped) ? weight : (REAL)0;
    const real roundings = ldexp((real)1, scene->bounces - depth);
    slack->x += slack_of(w * scene->brightest.x, roundings);
    slack->y += slack_of(w * scene->brightest.y, roundings);
    slack->z += slack_of(w * scene->brightest.z, roundings);
    return dropped;
}

/* In units of a sum: 2^-11, an eighth of a level. */
#define MOST_DROPPED (1L << 29)

/* Marks what rays have met, where that has some weight; an edge in what has no more than FAINT_MARK is one of less than
 * a level. forget_marks() takes back what has been marked since, where the own colour has no weight either. */
#define FAINT_MARK (real)0x1p-8f
static MASK mark_met(const Scene *scene, const Branch rays, const Intersection at, Work *work) {
    if (!HAS(WITH_SAMPLES)) return 0;
    const MASK marked = rays.live & TO_MASK(rays.weight > FAINT_MARK);
    MARK(mark, marked, rays.own, rays.depth);
    if (TEXTURED(scene)) {
        MARK(texels, marked & (at.texel >= 0), at.texel, rays.depth);
        work->uneven = work->uneven | (marked & at.uneven);
    }
    return marked;
}

static void forget_marks(const MASK marked, const REAL weight, const LANES(uint) mark, Work *work) {
    if (HAS(WITH_SAMPLES)) PUT_WHERE(!(marked & TO_MASK(weight > FAINT_MARK)), work->mark, mark);
}

static void clear_marks(const MASK where, Work *work) {
    if (!HAS(WITH_SAMPLES)) return;
    PUT_WHERE(where, work->mark, (LANES(uint))0);
    PUT_WHERE(where, work->texels, (LANES(uint))0);
    PUT_WHERE(where, work->uneven, (MASK)0);
}

/* Adds the own colours of what rays have met. */
static void add_own_color(const Scene *scene, const Branch rays, Intersection at, const REAL weight, Gathered *all,
                          Work *work) {
    const MASK shown = at.hit & TO_MASK(weight > 0);
    COUNT(WEIGHTLESS, at.hit & !shown);
    const MASK marked = mark_met(scene, rays, at, work);
    const LANES(uint) mark = HAS(WITH_SAMPLES) ? work->mark : (LANES(uint))0;
    if (!HAS(KEEP_WEIGHTLESS)) at.hit = shown;
    if (ANY(at.hit)) {
        const Shade3 color = shade(scene, rays.d, DOT(rays.d, rays.d), at, rays.own, &all->shadow_rays, work);
        add_to(&all->sum, at.hit, weight, color);
        if (rays.depth == 0) all->first = color;
    }
    forget_marks(marked, weight, mark, work);
}

/* Branches that wait for others. Whichever waits, there is one of a depth at most, so BRANCHES are enough. (If the
 * lighter one went first, only as many could wait as halve a weight before it is dropped; but of each lane, and a
 * packet's lanes may split at different depths.) */
typedef struct {
    Branch branch[BRANCHES];
    int height;
} Waiting;

/* How rays go on: with the mirrored ray, or where there is none with the refracted one. Where there are both, that
 * waits. */
static Branch go_on(const Scene *scene, const Branch rays, const Intersection at, const Bounce bounce, Gathered *all,
                    Waiting *waiting, Work *work) {
    MASK mirrors = rays.live & TO_MASK(bounce.mirrors > 0);
    if (rays.depth == 0) all->alone = rays.live & !mirrors;
    mirrors = mirrors & !drop(scene, mirrors, bounce.mirrors, all->faint, rays.depth, &all->slack, work);
    const INT left = HAS(WITH_PLANES) ? at.start.index : rays.own;
    Branch next = {mirrors, left, bounce.inside, at.normal, bounce.mirrored, bounce.mirrors, rays.depth + 1};
    if (HAS(WITH_SHAPES)) next.q = at.q;
    if (!HAS(WITH_GLASS)) return next;
    MASK sends = rays.live & TO_MASK(bounce.sends > 0);
    if (rays.depth == 0) all->alone = all->alone & !sends;
    sends = sends & !drop(scene, sends, bounce.sends, all->faint, rays.depth, &all->slack, work);
    const MASK only = sends & !mirrors;
    const REAL_MASK through = TO_REAL_MASK(only);
    next.live = mirrors | only;
    next.inner = through ? !bounce.inside : bounce.inside;
    PUT3(PUT_WHERE, through, next.d, bounce.refracted);
    PUT_WHERE(through, next.weight, bounce.sends);
    if (HAS(WITH_SPLITS) && ANY(sends & mirrors)) {
        Branch other = {sends & mirrors,  left,         !bounce.inside, at.normal,
                        bounce.refracted, bounce.sends, rays.depth + 1};
        if (HAS(WITH_SHAPES)) other.q = at.q;
        waiting->branch[waiting->height++] = other;
    }
    return next;
}

/* Sums up the colours of rays along d that hit, with all that mirrors and glass add to them. at, own: what was hit;
 * faint: what adds no more than this to a sum may be dropped, in its units. */
static Gathered gather(const Frame frame, const Scene *scene, const Real3 d, Intersection at, const INT own,
                       const real faint, Work *work) {
    const Shade3 background = {frame.background.x, frame.background.y, frame.background.z};
    Gathered all = {{0, 0, 0}, {0, 0, 0}, 1, 0, 0, {0, 0, 0}, faint};
    Branch rays = {at.hit, own, 0, at.normal, d, 1, 0};
    Waiting waiting;
    waiting.height = 0;
    for (;;) {
        const Bounce bounce = bounce_at(scene, at, rays, work);
        add_own_color(scene, rays, at, rays.weight * bounce.share, &all, work);
        rays = go_on(scene, rays, at, bounce, &all, &waiting, work);
        /* On until some rays meet something: first these, then the ones that wait. */
        Leaving path;
        Met met;
        for (;;) {
            if (ANY(rays.live)) {
                if (is_over(scene)) return all;
                COUNT(BOUNCES, rays.live);
                all.rays += rays.live ? (INT)1 : (INT)0;
                if (HAS(WITH_SPLITS) && ANY(all.rays > MOST_RAYS)) return all;
                path = leaving(frame, scene->geometry, rays.own, rays.inner, rays.n, rays.q, rays.d);
                met = closest_from(scene, &path, rays.live, FAR_END(scene, &path), work);
                add_to(&all.sum, rays.live & (met.id < 0), rays.weight, background);
                rays.live = rays.live & (met.id >= 0);
                if (ANY(rays.live)) break;
            }
            if (!HAS(WITH_SPLITS) || waiting.height == 0) return all;
            rays = waiting.branch[--waiting.height];
        }
        at = intersection_from(frame, scene, path, met);
        rays.own = met.id;
    }
}

/* Which lanes' outputs might be others with what was dropped. Bytes and floats never fall as a sum grows. Of means over
 * pixels samples may lack a part of a level, see plan/materials.py. */
static MASK unproven(const Frame frame, const Scene *scene, const Gathered all, const Shade3 color) {
    if (!HAS(WITH_SPLITS) || all.faint < 0) return 0;
    if (HAS(WITH_SAMPLES)) {
        const LONG part = (LONG)MOST_DROPPED;
        const LONG more = (all.slack.x > part) | (all.slack.y > part) | (all.slack.z > part);
        return TO_INT(more);
    }
    const LONG most = 1L << 61;
    const LONG x = all.sum.x + all.slack.x, y = all.sum.y + all.slack.y, z = all.sum.z + all.slack.z;
    const Sum3 sum = {x < most ? x : most, y < most ? y : most, z < most ? z : most};
    const Shade3 high = color_of(sum);
    const shade_t rounding = frame.quantize.x;
    const MASK bytes = (byte_of(color.x, rounding) != byte_of(high.x, rounding)) |
                       (byte_of(color.y, rounding) != byte_of(high.y, rounding)) |
                       (byte_of(color.z, rounding) != byte_of(high.z, rounding));
    if (!scene->prove) return bytes;
    return bytes | (TO_FLOAT(color.x) != TO_FLOAT(high.x)) | (TO_FLOAT(color.y) != TO_FLOAT(high.y)) |
           (TO_FLOAT(color.z) != TO_FLOAT(high.z));
}

/* The colours of rays that hit, with all that mirrors and glass add to them. at, own: what was hit.
 *
 * First without branches that are faint, then, where an output might be another with them, without those that are 64
 * times fainter, and so on until all that is dropped would be rounded to nothing. A ray that is traced with one limit
 * is traced with all lower ones. So where there are too many rays with one limit, there would be too many without any.
 */
static Shade3 color_with_branches(const Frame frame, const Scene *scene, const Ray ray, Intersection at, const INT own,
                                  Pixels *pixels, Work *work) {
    Shade3 color = {0, 0, 0};
    if (HAS(WITH_SPLITS)) at.hit = at.hit & pixels->wanted; /* pixels outside the region are not to be noted */
    for (real faint = scene->faint; ANY(at.hit); faint = faint > 32 ? faint / 64 : (real)0.5f) {
        clear_marks(at.hit, work);
        const Gathered all = gather(frame, scene, ray.d, at, own, faint, work);
        pixels->rays += all.shadow_rays;
        if (HAS(WITH_SPLITS)) {
            pixels->overgrown = at.hit & (all.rays > MOST_RAYS);
            if (ANY(pixels->overgrown)) break;
        }
        Shade3 seen = color_of(all.sum);
        const SHADE_MASK alone = TO_SHADE_MASK(all.alone);
        PUT3(PUT_WHERE, alone, seen, all.first);
        const SHADE_MASK here = TO_SHADE_MASK(at.hit);
        PUT3(PUT_WHERE, here, color, seen);
        at.hit = at.hit & !all.alone & unproven(frame, scene, all, seen);
        COUNT(RETRACED, at.hit);
    }
    return color;
}
#endif

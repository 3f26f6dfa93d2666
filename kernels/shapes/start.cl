/* start.cl: points of surfaces, where rays start. */

/* Where a shadow ray starts: a point P of a sphere. P itself, rounded, is used by filters only. */
typedef struct {
    Sphere own;
    Real3 p;             /* from the own sphere's centre to P */
    REAL side;           /* 1, or -1 where the ray that found P came from inside */
    REAL_MASK stretched; /* whether it is no sphere; then p is not r long */
    REAL support;        /* n.p, with n the normal: how far the plane across n through P is from the centre */
    INT index;           /* of the own surface, and as in Leaving: */
    Real3 q;             /* of a sphere the normal */
    Real3 anchor, step;  /* its centre or corner in the world, and from there to P */
    REAL reach;
    /* Where `real` is float: */
    Real3 from_eye;     /* P itself, in camera space */
    REAL_MASK near_eye; /* whether that is the shorter way */
} Start;

/* side: as in Start; point: P itself, in camera space. */
static Start start_of(const Sphere own, const Real3 normal, const REAL side, const Real3 point) {
    Start P = {own, scaled(normal, own.r), side};
    P.stretched = 0;
    P.support = own.r;
    P.from_eye = point;
    P.near_eye = REAL_BYTES == 4 ? DOT(point, point) < own.r * own.r : (REAL_MASK)0;
    return P;
}

/* Where a ray from the eye meets its sphere at t. */
static Start start_at(const Ray ray, const Sphere own, const Real3 normal, const REAL t) {
    const Real3 point = point_at(ray, t);
    const REAL_MASK outside = HAS(WITH_PARALLEL_RAYS) ? normal.z >= 0 : own.c > 0;
    return start_of(own, normal, HAS(WITH_INSIDE) ? (outside ? (REAL)1 : (REAL)-1) : (REAL)1, point);
}

/* Puts into the lanes `here` of a start that it is at P, in camera space, of a surface that is no sphere. side: as in
 * Start. */
static __attribute__((always_inline)) void start_at_place(const REAL_MASK here, const Real3 P, const REAL side,
                                                          Start *start) {
    PUT3(PUT_OF_SHAPE, here, start->own.center, P);
    PUT_OF_SHAPE(here, start->own.r, (REAL)0);
    const Real3 none = {0, 0, 0};
    PUT3(PUT_OF_SHAPE, here, start->p, none);
    PUT_OF_SHAPE(here, start->support, (REAL)0);
    PUT_OF_SHAPE(here, start->side, side);
    PUT_OF_SHAPE(here, start->stretched, here);
    PUT3(PUT_OF_SHAPE, here, start->from_eye, P);
    PUT_OF_SHAPE(here, start->near_eye, (REAL_MASK)0);
}

/* Where a point is that is counted from another one of its surface, in the world. */
typedef struct {
    Real3 anchor, step; /* that other one, and from there to the point */
    REAL reach;         /* no less than |step| */
} Place3;

/* Puts such a point into the lanes `here` of rays that leave it. */
static void leave_place(const REAL_MASK here, const Place3 place, Leaving *ray) {
    PUT3(PUT_OF_SHAPE, here, ray->center, place.anchor);
    PUT3(PUT_OF_SHAPE, here, ray->p, place.step);
    PUT_OF_SHAPE(here, ray->r, (REAL)0);
    PUT_OF_SHAPE(here, ray->reach, place.reach);
}

/* Puts the same place, in the world, into the lanes `here` of a start. */
static void start_from_place(const REAL_MASK here, const Place3 place, Start *start) {
    PUT3(PUT_OF_SHAPE, here, start->anchor, place.anchor);
    PUT3(PUT_OF_SHAPE, here, start->step, place.step);
    PUT_OF_SHAPE(here, start->reach, place.reach);
}

/* P, as where a ray starts that leads along `to`, in the world. */
static Leaving leaving_to(const Start P, const Real3 to) {
    return (Leaving){P.index, 0, P.q, to, P.anchor, P.own.r, P.reach, P.step, to, size_of(to), P.q};
}

/* The way from a start to a light, which is at a point, or in the direction of the lamp. */
static Leaving way_to_lamp(const real4 lamp, const int at_point, const Start P) {
    const Real3 L = {lamp.x, lamp.y, lamp.z}, way = difference(L, P.anchor);
    Leaving ray = leaving_to(P, L);
    if (at_point) {
        ray.w = difference(way, P.step);
        ray.w1 = size_of(way) + P.reach;
    }
    return ray;
}

/* From P to a point. With C the own centre, it is (point - C) - p, which never forms P. In float the error of that is
 * u max(|C|, r), so from a large sphere under the camera it is point - P, with the error u |P|. */
static Real3 towards(const Start P, const Real3 point) {
    const Real3 w = difference(difference(point, P.own.center), P.p);
    return REAL_BYTES == 4 ? chosen(P.near_eye, difference(point, P.from_eye), w) : w;
}

/* A ray that starts anywhere in pairs: from its `center` to where it starts, and along it. The step is off by less than
 * 2^-99 of the reach, and w by less than 2^-101 of w1. */
#if defined(WITH_LEAVING) && (REAL_BYTES == 8 || defined(WITH_PLANES))
typedef struct {
    Pair3 step, w;
} PairRay;

#if REAL_BYTES == 8
/* The step: dispatch.cl asks the shape that the ray leaves. */
static Pair3 fine_start(const Geometry geometry, const Leaving ray);
#define pair_ray(geometry, ray) ((PairRay){fine_start(geometry, ray), pairs_in_world(geometry, (ray).d)})
#else
#define pair_ray(geometry, ray) ((PairRay){pairs_of((ray).p), pairs_of((ray).w)})
#endif
#endif

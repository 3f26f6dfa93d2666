/* kinds.cl: which shape a surface has, and how it is asked. The surfaces' indices are in the order of the shapes.
 *
 * Of a shape, FIRST_X(geometry) is the index of its first surface, IS_X(geometry, index) tells which lanes' surface is
 * one, and X_OR_NONE(geometry, index) is that one's number among its kind, -1 for none. */
#define KINDS_OF_SHAPES (HAS(WITH_SPHERES) + HAS(WITH_CYLINDERS) + HAS(WITH_TRIANGLES))

#define FIRST_CYLINDER(geometry) ((geometry).first_cylinder)
#define FIRST_TRIANGLE(geometry) ((geometry).first_triangle)

#define BEFORE_TRIANGLES(geometry, index) (HAS(WITH_TRIANGLES) ? (index) < FIRST_TRIANGLE(geometry) : (MASK)ALL_LANES)
#define IS_SPHERE(geometry, index) \
    (HAS(WITH_CYLINDERS) ? (index) < FIRST_CYLINDER(geometry) : BEFORE_TRIANGLES(geometry, index))
#define IS_CYLINDER(geometry, index) (((index) >= FIRST_CYLINDER(geometry)) & BEFORE_TRIANGLES(geometry, index))
#define IS_TRIANGLE(geometry, index) ((index) >= FIRST_TRIANGLE(geometry))

#define NUMBER_OR_NONE(is, index, first) (KINDS_OF_SHAPES == 1 ? (index) - first : (is) ? (index) - first : (INT) - 1)
#define SPHERE_OR_NONE(geometry, index) NUMBER_OR_NONE(IS_SPHERE(geometry, index), index, 0)
#define CYLINDER_OR_NONE(geometry, index) NUMBER_OR_NONE(IS_CYLINDER(geometry, index), index, FIRST_CYLINDER(geometry))
#define TRIANGLE_OR_NONE(geometry, index) NUMBER_OR_NONE(IS_TRIANGLE(geometry, index), index, FIRST_TRIANGLE(geometry))

/* Which map makes a sphere an ellipsoid; 0: none. */
#define MAP_OF(geometry, index) (HAS(WITH_ELLIPSOIDS) && (geometry).maps ? (geometry).map_of[index] : 0)

/* What the walkers, lists and shading ask of shapes without knowing their names.
 *   ANY_ROUND    there are such as a ray meets again that leaves them inwards
 *   ANY_FETCHED  lists of shadow rays fetch surfaces ahead: of triangles alone, that took more time than it saved
 *   ANY_LATE     of some, only bounds of 1/t are known while a ray from the eye looks for the nearest, see Hit
 *   IS_LATE      which lanes' surface is one of these */
#define ANY_ROUND (HAS(WITH_SPHERES) || HAS(WITH_CYLINDERS))
#define ANY_FETCHED ANY_ROUND
#define ANY_LATE (HAS(WITH_CYLINDERS) || HAS(WITH_TRIANGLES))
#define IS_LATE(geometry, index) \
    ((index) >= (HAS(WITH_CYLINDERS) ? FIRST_CYLINDER(geometry) : FIRST_TRIANGLE(geometry)))

/* A text that is there only if the scene has cylinders, or triangles; the functions of spheres are always there. */
#ifdef WITH_CYLINDERS
#define OF_CYLINDERS(text) text
#else
#define OF_CYLINDERS(text)
#endif
#ifdef WITH_TRIANGLES
#define OF_TRIANGLES(text) text
#else
#define OF_TRIANGLES(text)
#endif

/* ASK_SHAPE(geometry, index, question(...)) is what the function <shape>_question(...) of one surface returns, and
 * ASK_LEAF(tree, index, question(...)) the same for a leaf of the tree, where what is no triangle is a ball. */
#define ASK_SHAPE(geometry, index, question)                                                                         \
    (OF_TRIANGLES(KINDS_OF_SHAPES == 1 || (index) >= FIRST_TRIANGLE(geometry) ? triangle_##question :) OF_CYLINDERS( \
        !HAS(WITH_SPHERES) || (index) >= FIRST_CYLINDER(geometry) ? cylinder_##question :) sphere_##question)
#define ASK_LEAF(tree, index, question) \
    (OF_TRIANGLES(KINDS_OF_SHAPES == 1 || (index) >= (tree).blocks ? triangle_##question :) ball_##question)

/* EACH_SHAPE(geometry, index, question(...)) calls the first shape's function for all lanes, and then those of other
 * shapes that some lane's surface has: each of these puts what it knows into its own lanes, by PUT_OF_SHAPE(). */
#define EACH_SHAPE(geometry, index, question)                                                             \
    do {                                                                                                  \
        if (HAS(WITH_SPHERES)) sphere_##question;                                                         \
        OF_CYLINDERS(if (!HAS(WITH_SPHERES) || ANY(IS_CYLINDER(geometry, index))) cylinder_##question;)   \
        OF_TRIANGLES(if (KINDS_OF_SHAPES == 1 || ANY(IS_TRIANGLE(geometry, index))) triangle_##question;) \
    } while (0)
/* Where one shape is all, it knows of all lanes; but a cap is none. */
#define PUT_OF_SHAPE(mask, variable, value) \
    variable = KINDS_OF_SHAPES == 1 && !HAS(WITH_PLANES) ? (value) : (mask) ? (value) : (variable)

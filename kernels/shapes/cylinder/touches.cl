/* touches.cl: which pixels a cylinder may be seen in: see samples/touches.cl. All those that lists name it for: where
 * it has a rim, it is different surfaces. */
#define cylinder_touches(scene, view, index, asked) (asked)

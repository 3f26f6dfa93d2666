"""The mistakes that are looked for: what each is, what to change in the code, and what it makes of the rules.

A mistake has variants where it is made in more than one way. Its name stands for all of them. Where two mistakes make
the same picture, the one that is about less comes first: so the table begins with glass, and ends with all.
"""

from __future__ import annotations

from cltrace.students.rules import ENOUGH, Changes, Mistake, variants
from cltrace.students.whole import PICTURE_MISTAKES

__all__ = ["BY_NAME", "ENOUGH", "MISTAKES", "Changes", "Mistake"]

MISTAKES = (
    # Mirrors and glass
    Mistake(
        "total-reflection-dropped",
        "what glass reflects totally is lost",
        "where Snell's law has no solution, t joins r: the mirrored ray counts r + t",
        variants(total=("dropped", "straight")),
    ),
    Mistake(
        "index-not-inverted",
        "light that leaves glass is bent as if it entered",
        "the ratio in Snell's law is 1 / iof on the way in and iof on the way out",
        variants(media=("entering",), turned_for_rays=(True, False)),
    ),
    Mistake(
        "refraction-inverted",
        "light is bent the wrong way where it enters or leaves glass",
        "the ratio in Snell's law is 1 / iof on the way in and iof on the way out",
        variants(media=("inverted",)),
    ),
    Mistake(
        "no-bending",
        "light goes straight through glass",
        "bend it by Snell's law, at each surface that it meets: with 1 / iof on the way in and iof on the way out",
        variants(media=("none",)),
    ),
    Mistake(
        "fresnel",
        "glass mirrors more where it is seen at a slant, by Fresnel's or Schlick's formula",
        "the course has no Fresnel: the shares are r, t and 1 - r - t at every angle",
        variants(fresnel=("both", "t", "both exact", "t exact")),
    ),
    Mistake(
        "no-refraction",
        "nothing is seen through glass: not there yet?",
        "follow the refracted ray, and add t times what it sees",
        (*variants(clear=("none", "dark")), {"clear": "none", "own_share": "but r"}),
    ),
    Mistake(
        "glass-without-shadow",
        "what lets light through casts no shadow",
        "every surface casts a full shadow, glass too: the course has no exception",
        variants(clear_shadows=(False,)),
    ),
    Mistake(
        "no-mirrors",
        "nothing is seen in mirrors: not there yet?",
        "follow the mirrored ray, and add r times what it sees",
        variants(mirrors=("none", "dark")),
    ),
    Mistake(
        "reflection-wrong",
        "mirrored rays go elsewhere",
        "the mirrored direction is d - 2 (n.d) n, with n and d of length 1",
        (
            *variants(reflection=("reversed", "back")),
            *variants(reflection=("sign", "once"), unit_mirrored=(True, False)),
        ),
    ),
    Mistake(
        "secondary-background",
        "mirrors and glass show black where they should show the background",
        "a ray that meets nothing sees the background, whichever ray it is",
        variants(far_background=(False,)),
    ),
    Mistake(
        "own-share-whole",
        "what mirrors or lets light through shows all of its own colour, too",
        "its own colour counts 1 - r - t",
        variants(own_share=("whole", "but r", "but t")),
    ),
    Mistake(
        "share-doubled",
        "reflectance or transmittance counts twice",
        "add r times the mirrored colour and t times the refracted one, once each",
        (
            *variants(mirrors=("double", "squared")),
            *variants(clear=("double", "squared")),
            *variants(mirrors=("squared",), clear=("squared",)),
            *variants(mirrors=("double",), clear=("double",)),
        ),
    ),
    Mistake(
        "mirror-depth",
        "rays bounce once more, or once less, than max_bounces says",
        "the camera's ray has depth 0 and goes on while depth <= max_bounces; the last hit shows its local colour",
        (*variants(more_bounces=(-1, 1)), *variants(last=("black", "weighted"), more_bounces=(0, -1))),
    ),
    Mistake(
        "one-bounce",
        "rays bounce only once",
        "mirrored and refracted rays bounce, too, up to max_bounces: call trace() from itself",
        variants(deepest=(0,), last=("local", "weighted", "black")),
    ),
    Mistake(
        "no-bounces",
        "nothing is seen in mirrors or through glass: not there yet?",
        "follow the mirrored and the refracted ray, and add r and t times what they see",
        variants(deepest=(-1,), last=("local", "weighted", "black")),
    ),
    # Textures
    Mistake(
        "texture-clamped",
        "textures do not repeat",
        "u and v repeat: take u - floor(u) and v - floor(v)",
        variants(clamped_uv=(True,)),
    ),
    Mistake(
        "half-texel",
        "textures are off by half a texel",
        "x = u width and y = v height, without 0.5: u = 0 is just the first column",
        variants(texels_off=(-0.5, 0.5)),
    ),
    Mistake(
        "nearest-texel",
        "textures show the nearest texel, in squares",
        "mix the four texels around u width, v height by how near they are",
        (*variants(texture=("nearest",), texels_off=(0.0, 0.5, -0.5)),),
    ),
    Mistake(
        "texture-swapped",
        "u and v are exchanged",
        "u goes along the width of the image, v along its height",
        variants(swapped_uv=(True,)),
    ),
    Mistake(
        "texture-flipped",
        "textures are turned over",
        "v = 0 is the top row of the image and u = 0 its left column",
        (*variants(turned_v=(True,), turned_u=(False, True)), {"turned_u": True}),
    ),
    Mistake(
        "no-textures",
        "textures are not seen: not there yet?",
        "the colour of a surface with a texture is the texel's at (u, v)",
        variants(texture=("white", "black")),
    ),
    Mistake(
        "flat-mesh-colors",
        "each triangle of a mesh has one colour",
        "mix the colours of a triangle's corners as normals are mixed, by the weights of the point",
        variants(mesh_colors=("first", "mean")),
    ),
    Mistake(
        "no-mesh-colors",
        "the colours of meshes' vertices or faces are not seen: not there yet?",
        "the colour of a point is that of its face, or mixed of those of the corners",
        variants(mesh_colors=("none",)),
    ),
    # Surfaces
    Mistake(
        "near-root-only",
        "of a sphere only the nearer point is looked at, so that it is not met from inside",
        "if the nearer point is behind the ray's start, take the further one",
        variants(roots=("near",)),
    ),
    Mistake(
        "far-root",
        "of a sphere the further point is met",
        "the nearer of the two points in front is met: t1 if t1 > 0, or else t2",
        variants(roots=("far",)),
    ),
    Mistake(
        "culled-faces",
        "triangles are met from one side only",
        "both sides of a triangle are drawn: do not leave out those with n.d > 0 or det < 0",
        variants(culled=("back", "clockwise", "front", "counter")),
    ),
    Mistake(
        "normal-not-normalized",
        "normals are not of length 1",
        "normalize n after it is interpolated, and after it is transformed",
        variants(long_normals=("m", "t", "r", "mt", "mr")),
    ),
    Mistake(
        "normal-transform",
        "normals are transformed as points are",
        "take normals to the world by the transposed inverse of the matrix, and normalize them after that",
        (
            *variants(normals=("matrix", "none", "inverse"), flat_normals=(False, True)),
            *variants(normals=("matrix", "none", "inverse"), normals_of=("s", "m")),
            *variants(normals=("matrix", "none", "inverse"), normals_of=("s", ""), sided_by_normal=(True,)),
        ),
    ),
    Mistake(
        "normal-not-flipped",
        "normals are not turned against a ray that comes from inside",
        "if n.d > 0, use -n: for shading, for reflection and for refraction",
        (
            *variants(turned_for_light=(False,), turned_for_rays=(True, False), turned_meshes=(False, True)),
            *variants(turned_for_light=(True, False), turned_for_rays=(False,), media=("right", "entering")),
        ),
    ),
    Mistake(
        "rotation-reversed",
        "rotations turn the other way",
        "rotations are counter-clockwise about the positive axis: cos, -sin in the first row",
        variants(transforms=("turned back",)),
    ),
    Mistake(
        "degrees-for-radians",
        "angles in degrees are taken for radians",
        "multiply them by pi / 180 before sin, cos and tan",
        (*variants(radians=(True,)), *variants(transforms=("radians", "radians, positive"))),
    ),
    Mistake(
        "no-rotation",
        "rotations are left out: not there yet?",
        "rotateX, rotateY and rotateZ turn about the axis by theta degrees",
        variants(transforms=("no-rotation",)),
    ),
    Mistake(
        "no-scale",
        "scaling is left out: not there yet?",
        "a scale multiplies x, y and z",
        variants(transforms=("no-scale",)),
    ),
    Mistake(
        "no-translation",
        "translations are left out: not there yet?",
        "a translation is added to the point, not to the normal",
        variants(transforms=("no-translation",)),
    ),
    Mistake(
        "transform-order",
        "the steps of transforms act in the wrong order",
        "multiply them in the order of the file, M = T1 T2 ... Tn: the last one acts first, on the placed sphere",
        variants(transforms=("reversed", "placed-last", "moved-first")),
    ),
    Mistake(
        "transform-transposed",
        "matrices are transposed",
        "the steps act on column vectors: M p with the translation in the last column",
        variants(transforms=("transposed",)),
    ),
    Mistake(
        "no-transforms",
        "what has a transform is where it would be without: not there yet?",
        "take rays into the object's space by the inverse of M = T1 T2 ... Tn, or points to the world by M",
        variants(transforms=("none",)),
    ),
    Mistake(
        "no-meshes",
        "meshes are not seen: not there yet?",
        "read the OBJ file, and intersect each triangle",
        variants(missing=("m",)),
    ),
    Mistake(
        "no-spheres", "spheres are not seen: not there yet?", "intersect each sphere, too", variants(missing=("s",))
    ),
    Mistake(
        "no-cylinders",
        "cylinders are not seen: not there yet?",
        "intersect each cylinder, too, with its flat ends",
        variants(missing=("c",)),
    ),
    Mistake(
        "last-hit",
        "it is not the nearest surface that is seen",
        "keep the smallest t of all surfaces",
        variants(hits=("last", "last part", "first", "farthest")),
    ),
    # Lights
    Mistake(
        "spot-angle",
        "the cone of a spot light is too narrow or too wide",
        "alpha1 and alpha2 are the angles from the axis, neither halves nor doubles of these",
        variants(spot=("half", "double")),
    ),
    Mistake(
        "spot-edge",
        "a spot light fades otherwise between alpha1 and alpha2",
        "it fades linearly in the angle: (alpha2 - angle) / (alpha2 - alpha1)",
        variants(spot=("outer", "inner", "cosine", "smooth")),
    ),
    Mistake(
        "no-spot-cone",
        "a spot light shines in all directions: not there yet?",
        "it is full within alpha1 of its axis, fades until alpha2, and does not shine beyond",
        variants(spot=("none",)),
    ),
    Mistake("no-spot-lights", "spot lights do not shine: not there yet?", "add them as point lights with a cone", ()),
    Mistake(
        "no-point-lights",
        "point lights do not shine: not there yet?",
        "add them, with l = position - P, normalized",
        (),
    ),
    Mistake(
        "no-parallel-lights",
        "parallel lights do not shine: not there yet?",
        "add them, with l = -direction, normalized",
        (),
    ),
    Mistake("light-missing", "not all of the lights shine", "add up what all lights of the file give", ()),
    Mistake(
        "light-not-normalized",
        "the vector to the light is not of length 1",
        "normalize l before n.l and r.v",
        variants(long_lights=("o", "os", "p", "po", "pos")),
    ),
    Mistake(
        "attenuation",
        "light fades with the distance",
        "the course has no attenuation: a point light is as strong everywhere",
        variants(attenuation=("D2", "D", "1+D", "1+D2", "1+D+D2")),
    ),
    Mistake(
        "shadow-beyond-light",
        "what is behind a light casts shadows",
        "a shadow ray ends at the light: count only hits with t < the distance to it",
        variants(past_lights=(True,)),
    ),
    Mistake(
        "large-epsilon",
        "what is near a surface casts no shadow on it, or is not mirrored: the epsilon of new rays is too large",
        "use a far smaller epsilon, such as 1e-4 of the size of the scene, or compute in doubles",
        variants(measured=("ray", "light", "normal"), spared=(False, True)),
        fitted=True,
    ),
    # Phong's formula
    Mistake(
        "highlight-reversed",
        "highlights are where they would be if the mirrored light, or the eye, were on the other side",
        "r = 2 (n.l) n - l and v = -d: look at both signs",
        variants(highlight=("reversed",)),
    ),
    Mistake(
        "highlight-times-cosine",
        "highlights are multiplied by n.l",
        "ks L (r.v)^exponent has no n.l",
        variants(highlight=("cosine",)),
    ),
    Mistake(
        "specular-tinted",
        "highlights have the surface's colour",
        "multiply only the diffuse and ambient terms by the colour: ks L (r.v)^exponent",
        variants(tinted=(True,)),
    ),
    Mistake(
        "blinn",
        "highlights follow Blinn's half vector",
        "use the mirrored light: r = 2 (n.l) n - l, and (r.v)^exponent",
        variants(halfway=(1.0, 4.0, 2.0)),
    ),
    Mistake(
        "no-highlights",
        "there are no highlights: not there yet?",
        "add ks L (r.v)^exponent for each light that reaches the point",
        variants(ks=("none",)),
    ),
    Mistake(
        "no-facing-gate",
        "lights behind a surface shine on it",
        "add diffuse and specular terms only where n.l > 0",
        variants(facing=("highlight", "negative", "both", "absolute"), own_shadow=(True, False)),
    ),
    Mistake(
        "ka-twice",
        "ambient light is multiplied by ka twice, or counts twice",
        "add ka La C, once",
        variants(ka=("twice", "double")),
    ),
    Mistake(
        "ka-forgotten",
        "ambient light is not multiplied by ka, or not by the colour",
        "ambient light adds ka La C",
        variants(ka=("one", "bare")),
    ),
    Mistake(
        "ambient-per-light",
        "ambient light is added once for every light",
        "add ka La C once, before the loop over the lights",
        variants(ambient=("each", "one more", "reaching", "facing", "shining", "lit")),
    ),
    Mistake(
        "no-ambient",
        "there is no ambient light: not there yet?",
        "add ka La C, once, where shadows are, too",
        variants(ka=("none",)),
    ),
    Mistake(
        "early-clamp",
        "colours are clamped before they are mixed",
        "clamp once, at the end: not the light's colour, nor the local colour, nor what a mirror shows",
        variants(clamped=("local", "light", "traced", "both", "lights")),
    ),
    Mistake(
        "no-diffuse",
        "there is no diffuse light: not there yet?",
        "add kd L C (n.l) for each light that reaches the point",
        variants(kd=("none",)),
    ),
    Mistake(
        "light-reversed",
        "light comes from where it goes to",
        "the direction of a parallel or spot light is the one in which it travels: l = -direction",
        (
            *variants(reversed=("p", "o", "a", "pa", "po")),
            *variants(reversed=("p", "o", "po"), reversed_for=("shading", "shadows")),
        ),
    ),
    Mistake(
        "no-shadows",
        "nothing casts a shadow",
        "cast a ray to each light, and leave out the light if it hits anything on the way",
        variants(shadows=(False,)),
    ),
    Mistake(
        "ray-not-normalized",
        "the rays of the camera are not of length 1",
        "normalize d, of which v = -d and Snell's law make use",
        variants(long_rays=(True,)),
    ),
    # The camera
    Mistake(
        "pixel-corner",
        "rays go through the corners of the pixels",
        "x_n = (u + 0.5) / width and y_n = (v + 0.5) / height",
        (*variants(sample=((0, 1), (0, 0), (1, 0), (1, 1), (0, 0.5), (0.5, 0), (0.5, 1))), {"columns": "ends"}),
    ),
    Mistake(
        "full-field-of-view",
        "the angle of horizontal_fov is taken for the whole opening",
        "x_i = (2 x_n - 1) tan(angle): the file's angle is half of the opening, so do not halve it",
        (
            *variants(opening=((0.5, 0.5), (0.5, 1.0), (1.0, 0.5), (2.0, 2.0))),
            *variants(opening=((0.5, 0.5),), aspect=("tangent", "vertical")),
        ),
    ),
    Mistake(
        "tangent-vertical-field",
        "the vertical field follows from the horizontal one by tangents",
        "fov_y = fov_x height / width as angles, then y_i = (2 y_n - 1) tan(fov_y); see --square-pixels",
        variants(aspect=("tangent", "horizontal", "vertical")),
    ),
    Mistake(
        "aspect-inverted",
        "the shorter side's angle is multiplied by the wrong quotient",
        "fov_y = fov_x height / width where the picture is wide, and fov_x = fov_y width / height where it is tall",
        variants(aspect=("inverted",)),
    ),
    Mistake(
        "tall-as-wide",
        "the file's angle is taken for the width of a picture that is taller than wide",
        "where height > width the angle is the height's: fov_y = angle and fov_x = angle width / height",
        variants(aspect=("wide",)),
    ),
    Mistake(
        "aspect-ignored",
        "both sides have the same angle, though the picture is not square",
        "fov_y = fov_x height / width",
        variants(aspect=("none",)),
    ),
    Mistake(
        "up-not-orthogonal",
        "up is taken for the camera's y axis as it is",
        "x = up x z and y = z x x, with z = position - lookat, all of length 1",
        variants(axes=("unit up", "up")),
    ),
    Mistake(
        "camera-not-normalized",
        "the camera's axes are not of length 1",
        "normalize z = position - lookat, then x = up x z; y = z x x is of length 1 then",
        variants(axes=("x", "xy", "z", "yz")),
    ),
    Mistake(
        "camera-transposed",
        "the camera's matrix is transposed",
        "d = x_i x + y_i y - z: the axes are the columns of the matrix",
        variants(axes=("transposed",)),
    ),
    Mistake(
        "camera-backwards",
        "the camera looks backwards",
        "it looks along -z: d = x_i x + y_i y - z with z = position - lookat",
        variants(axes=("backwards",)),
    ),
    *PICTURE_MISTAKES,
)

BY_NAME = {mistake.name: mistake for mistake in MISTAKES}

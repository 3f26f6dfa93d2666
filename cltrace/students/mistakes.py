"""The mistakes that are looked for: what each is, what to change in the code, and what it makes of the rules.

A mistake has variants where it is made in more than one way. Its name stands for all of them. Where two mistakes make
the same picture, the one that is about less comes first: so the table begins with glass, and ends with all.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

Changes = dict[str, Any]  # of fields of Rules

ENOUGH = 4  # wrong pixels to tell a mistake by: rounding at an outline makes one or two


@dataclass(frozen=True)
class Mistake:
    """One of the mistakes, which go by their names.

    what: what is wrong, in words; change: what to do in the code; variants: how it is made, the usual way first;
    fitted: whether its epsilon is to be found by trying; whole: whether it is seen in the picture before anything is
    traced, see `whole`.
    """

    name: str
    what: str
    change: str
    variants: tuple[Changes, ...]
    fitted: bool = False
    whole: bool = False


def _of(**values: tuple[Any, ...]) -> tuple[Changes, ...]:
    """Every combination of these values."""
    return tuple(dict(zip(values, row, strict=True)) for row in product(*values.values()))


MISTAKES = (
    # Mirrors and glass
    Mistake(
        "total-reflection-dropped",
        "what glass reflects totally is lost",
        "where Snell's law has no solution, t joins r: the mirrored ray counts r + t",
        _of(total=("dropped", "straight")),
    ),
    Mistake(
        "index-not-inverted",
        "light that leaves glass is bent as if it entered",
        "the ratio in Snell's law is 1 / iof on the way in and iof on the way out",
        _of(media=("entering",), turned_for_rays=(True, False)),
    ),
    Mistake(
        "refraction-inverted",
        "light is bent the wrong way where it enters or leaves glass",
        "the ratio in Snell's law is 1 / iof on the way in and iof on the way out",
        _of(media=("inverted",)),
    ),
    Mistake(
        "no-bending",
        "light goes straight through glass",
        "bend it by Snell's law, at each surface that it meets: with 1 / iof on the way in and iof on the way out",
        _of(media=("none",)),
    ),
    Mistake(
        "fresnel",
        "glass mirrors more where it is seen at a slant, by Fresnel's or Schlick's formula",
        "the course has no Fresnel: the shares are r, t and 1 - r - t at every angle",
        _of(fresnel=("both", "t", "both exact", "t exact")),
    ),
    Mistake(
        "no-refraction",
        "nothing is seen through glass: not there yet?",
        "follow the refracted ray, and add t times what it sees",
        (*_of(clear=("none", "dark")), {"clear": "none", "own_share": "but r"}),
    ),
    Mistake(
        "glass-without-shadow",
        "what lets light through casts no shadow",
        "every surface casts a full shadow, glass too: the course has no exception",
        _of(clear_shadows=(False,)),
    ),
    Mistake(
        "no-mirrors",
        "nothing is seen in mirrors: not there yet?",
        "follow the mirrored ray, and add r times what it sees",
        _of(mirrors=("none", "dark")),
    ),
    Mistake(
        "reflection-wrong",
        "mirrored rays go elsewhere",
        "the mirrored direction is d - 2 (n.d) n, with n and d of length 1",
        (*_of(reflection=("reversed", "back")), *_of(reflection=("sign", "once"), unit_mirrored=(True, False))),
    ),
    Mistake(
        "secondary-background",
        "mirrors and glass show black where they should show the background",
        "a ray that meets nothing sees the background, whichever ray it is",
        _of(far_background=(False,)),
    ),
    Mistake(
        "own-share-whole",
        "what mirrors or lets light through shows all of its own colour, too",
        "its own colour counts 1 - r - t",
        _of(own_share=("whole", "but r", "but t")),
    ),
    Mistake(
        "share-doubled",
        "reflectance or transmittance counts twice",
        "add r times the mirrored colour and t times the refracted one, once each",
        (
            *_of(mirrors=("double", "squared")),
            *_of(clear=("double", "squared")),
            *_of(mirrors=("squared",), clear=("squared",)),
            *_of(mirrors=("double",), clear=("double",)),
        ),
    ),
    Mistake(
        "mirror-depth",
        "rays bounce once more, or once less, than max_bounces says",
        "the camera's ray has depth 0 and goes on while depth <= max_bounces; the last hit shows its local colour",
        (*_of(more_bounces=(-1, 1)), *_of(last=("black", "weighted"), more_bounces=(0, -1))),
    ),
    Mistake(
        "one-bounce",
        "rays bounce only once",
        "mirrored and refracted rays bounce, too, up to max_bounces: call trace() from itself",
        _of(deepest=(0,), last=("local", "weighted", "black")),
    ),
    Mistake(
        "no-bounces",
        "nothing is seen in mirrors or through glass: not there yet?",
        "follow the mirrored and the refracted ray, and add r and t times what they see",
        _of(deepest=(-1,), last=("local", "weighted", "black")),
    ),
    # Textures
    Mistake(
        "texture-clamped",
        "textures do not repeat",
        "u and v repeat: take u - floor(u) and v - floor(v)",
        _of(clamped_uv=(True,)),
    ),
    Mistake(
        "half-texel",
        "textures are off by half a texel",
        "x = u width and y = v height, without 0.5: u = 0 is just the first column",
        _of(texels_off=(-0.5, 0.5)),
    ),
    Mistake(
        "nearest-texel",
        "textures show the nearest texel, in squares",
        "mix the four texels around u width, v height by how near they are",
        (*_of(texture=("nearest",), texels_off=(0.0, 0.5, -0.5)),),
    ),
    Mistake(
        "texture-swapped",
        "u and v are exchanged",
        "u goes along the width of the image, v along its height",
        _of(swapped_uv=(True,)),
    ),
    Mistake(
        "texture-flipped",
        "textures are turned over",
        "v = 0 is the top row of the image and u = 0 its left column",
        (*_of(turned_v=(True,), turned_u=(False, True)), {"turned_u": True}),
    ),
    Mistake(
        "no-textures",
        "textures are not seen: not there yet?",
        "the colour of a surface with a texture is the texel's at (u, v)",
        _of(texture=("white", "black")),
    ),
    Mistake(
        "flat-mesh-colors",
        "each triangle of a mesh has one colour",
        "mix the colours of a triangle's corners as normals are mixed, by the weights of the point",
        _of(mesh_colors=("first", "mean")),
    ),
    Mistake(
        "no-mesh-colors",
        "the colours of meshes' vertices or faces are not seen: not there yet?",
        "the colour of a point is that of its face, or mixed of those of the corners",
        _of(mesh_colors=("none",)),
    ),
    # Surfaces
    Mistake(
        "near-root-only",
        "of a sphere only the nearer point is looked at, so that it is not met from inside",
        "if the nearer point is behind the ray's start, take the further one",
        _of(roots=("near",)),
    ),
    Mistake(
        "far-root",
        "of a sphere the further point is met",
        "the nearer of the two points in front is met: t1 if t1 > 0, or else t2",
        _of(roots=("far",)),
    ),
    Mistake(
        "culled-faces",
        "triangles are met from one side only",
        "both sides of a triangle are drawn: do not leave out those with n.d > 0 or det < 0",
        _of(culled=("back", "clockwise", "front", "counter")),
    ),
    Mistake(
        "normal-not-normalized",
        "normals are not of length 1",
        "normalize n after it is interpolated, and after it is transformed",
        _of(long_normals=("m", "t", "r", "mt", "mr")),
    ),
    Mistake(
        "normal-transform",
        "normals are transformed as points are",
        "take normals to the world by the transposed inverse of the matrix, and normalize them after that",
        (
            *_of(normals=("matrix", "none", "inverse"), flat_normals=(False, True)),
            *_of(normals=("matrix", "none", "inverse"), normals_of=("s", "m")),
            *_of(normals=("matrix", "none", "inverse"), normals_of=("s", ""), sided_by_normal=(True,)),
        ),
    ),
    Mistake(
        "normal-not-flipped",
        "normals are not turned against a ray that comes from inside",
        "if n.d > 0, use -n: for shading, for reflection and for refraction",
        (
            *_of(turned_for_light=(False,), turned_for_rays=(True, False), turned_meshes=(False, True)),
            *_of(turned_for_light=(True, False), turned_for_rays=(False,), media=("right", "entering")),
        ),
    ),
    Mistake(
        "rotation-reversed",
        "rotations turn the other way",
        "rotations are counter-clockwise about the positive axis: cos, -sin in the first row",
        _of(transforms=("turned back",)),
    ),
    Mistake(
        "degrees-for-radians",
        "angles in degrees are taken for radians",
        "multiply them by pi / 180 before sin, cos and tan",
        (*_of(radians=(True,)), *_of(transforms=("radians", "radians, positive"))),
    ),
    Mistake(
        "no-rotation",
        "rotations are left out: not there yet?",
        "rotateX, rotateY and rotateZ turn about the axis by theta degrees",
        _of(transforms=("no-rotation",)),
    ),
    Mistake(
        "no-scale",
        "scaling is left out: not there yet?",
        "a scale multiplies x, y and z",
        _of(transforms=("no-scale",)),
    ),
    Mistake(
        "no-translation",
        "translations are left out: not there yet?",
        "a translation is added to the point, not to the normal",
        _of(transforms=("no-translation",)),
    ),
    Mistake(
        "transform-order",
        "the steps of transforms act in the wrong order",
        "multiply them in the order of the file, M = T1 T2 ... Tn: the last one acts first, on the placed sphere",
        _of(transforms=("reversed", "placed-last", "moved-first")),
    ),
    Mistake(
        "transform-transposed",
        "matrices are transposed",
        "the steps act on column vectors: M p with the translation in the last column",
        _of(transforms=("transposed",)),
    ),
    Mistake(
        "no-transforms",
        "what has a transform is where it would be without: not there yet?",
        "take rays into the object's space by the inverse of M = T1 T2 ... Tn, or points to the world by M",
        _of(transforms=("none",)),
    ),
    Mistake(
        "no-meshes",
        "meshes are not seen: not there yet?",
        "read the OBJ file, and intersect each triangle",
        _of(missing=("m",)),
    ),
    Mistake("no-spheres", "spheres are not seen: not there yet?", "intersect each sphere, too", _of(missing=("s",))),
    Mistake(
        "no-cylinders",
        "cylinders are not seen: not there yet?",
        "intersect each cylinder, too, with its flat ends",
        _of(missing=("c",)),
    ),
    Mistake(
        "last-hit",
        "it is not the nearest surface that is seen",
        "keep the smallest t of all surfaces",
        _of(hits=("last", "last part", "first", "farthest")),
    ),
    # Lights
    Mistake(
        "spot-angle",
        "the cone of a spot light is too narrow or too wide",
        "alpha1 and alpha2 are the angles from the axis, neither halves nor doubles of these",
        _of(spot=("half", "double")),
    ),
    Mistake(
        "spot-edge",
        "a spot light fades otherwise between alpha1 and alpha2",
        "it fades linearly in the angle: (alpha2 - angle) / (alpha2 - alpha1)",
        _of(spot=("outer", "inner", "cosine", "smooth")),
    ),
    Mistake(
        "no-spot-cone",
        "a spot light shines in all directions: not there yet?",
        "it is full within alpha1 of its axis, fades until alpha2, and does not shine beyond",
        _of(spot=("none",)),
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
        _of(long_lights=("o", "os", "p", "po", "pos")),
    ),
    Mistake(
        "attenuation",
        "light fades with the distance",
        "the course has no attenuation: a point light is as strong everywhere",
        _of(attenuation=("D2", "D", "1+D", "1+D2", "1+D+D2")),
    ),
    Mistake(
        "shadow-beyond-light",
        "what is behind a light casts shadows",
        "a shadow ray ends at the light: count only hits with t < the distance to it",
        _of(past_lights=(True,)),
    ),
    Mistake(
        "large-epsilon",
        "what is near a surface casts no shadow on it, or is not mirrored: the epsilon of new rays is too large",
        "use a far smaller epsilon, such as 1e-4 of the size of the scene, or compute in doubles",
        _of(measured=("ray", "light", "normal"), spared=(False, True)),
        fitted=True,
    ),
    # Phong's formula
    Mistake(
        "highlight-reversed",
        "highlights are where they would be if the mirrored light, or the eye, were on the other side",
        "r = 2 (n.l) n - l and v = -d: look at both signs",
        _of(highlight=("reversed",)),
    ),
    Mistake(
        "highlight-times-cosine",
        "highlights are multiplied by n.l",
        "ks L (r.v)^exponent has no n.l",
        _of(highlight=("cosine",)),
    ),
    Mistake(
        "specular-tinted",
        "highlights have the surface's colour",
        "multiply only the diffuse and ambient terms by the colour: ks L (r.v)^exponent",
        _of(tinted=(True,)),
    ),
    Mistake(
        "blinn",
        "highlights follow Blinn's half vector",
        "use the mirrored light: r = 2 (n.l) n - l, and (r.v)^exponent",
        _of(halfway=(1.0, 4.0, 2.0)),
    ),
    Mistake(
        "no-highlights",
        "there are no highlights: not there yet?",
        "add ks L (r.v)^exponent for each light that reaches the point",
        _of(ks=("none",)),
    ),
    Mistake(
        "no-facing-gate",
        "lights behind a surface shine on it",
        "add diffuse and specular terms only where n.l > 0",
        _of(facing=("highlight", "negative", "both", "absolute"), own_shadow=(True, False)),
    ),
    Mistake(
        "ka-twice",
        "ambient light is multiplied by ka twice, or counts twice",
        "add ka La C, once",
        _of(ka=("twice", "double")),
    ),
    Mistake(
        "ka-forgotten",
        "ambient light is not multiplied by ka, or not by the colour",
        "ambient light adds ka La C",
        _of(ka=("one", "bare")),
    ),
    Mistake(
        "ambient-per-light",
        "ambient light is added once for every light",
        "add ka La C once, before the loop over the lights",
        _of(ambient=("each", "one more", "reaching", "facing", "shining", "lit")),
    ),
    Mistake(
        "no-ambient",
        "there is no ambient light: not there yet?",
        "add ka La C, once, where shadows are, too",
        _of(ka=("none",)),
    ),
    Mistake(
        "early-clamp",
        "colours are clamped before they are mixed",
        "clamp once, at the end: not the light's colour, nor the local colour, nor what a mirror shows",
        _of(clamped=("local", "light", "traced", "both", "lights")),
    ),
    Mistake(
        "no-diffuse",
        "there is no diffuse light: not there yet?",
        "add kd L C (n.l) for each light that reaches the point",
        _of(kd=("none",)),
    ),
    Mistake(
        "light-reversed",
        "light comes from where it goes to",
        "the direction of a parallel or spot light is the one in which it travels: l = -direction",
        (
            *_of(reversed=("p", "o", "a", "pa", "po")),
            *_of(reversed=("p", "o", "po"), reversed_for=("shading", "shadows")),
        ),
    ),
    Mistake(
        "no-shadows",
        "nothing casts a shadow",
        "cast a ray to each light, and leave out the light if it hits anything on the way",
        _of(shadows=(False,)),
    ),
    Mistake(
        "ray-not-normalized",
        "the rays of the camera are not of length 1",
        "normalize d, of which v = -d and Snell's law make use",
        _of(long_rays=(True,)),
    ),
    # The camera
    Mistake(
        "pixel-corner",
        "rays go through the corners of the pixels",
        "x_n = (u + 0.5) / width and y_n = (v + 0.5) / height",
        (*_of(sample=((0, 1), (0, 0), (1, 0), (1, 1), (0, 0.5), (0.5, 0), (0.5, 1))), {"columns": "ends"}),
    ),
    Mistake(
        "full-field-of-view",
        "the angle of horizontal_fov is taken for the whole opening",
        "x_i = (2 x_n - 1) tan(angle): the file's angle is half of the opening, so do not halve it",
        (
            *_of(opening=((0.5, 0.5), (0.5, 1.0), (1.0, 0.5), (2.0, 2.0))),
            *_of(opening=((0.5, 0.5),), aspect=("tangent", "vertical")),
        ),
    ),
    Mistake(
        "tangent-vertical-field",
        "the vertical field follows from the horizontal one by tangents",
        "fov_y = fov_x height / width as angles, then y_i = (2 y_n - 1) tan(fov_y); see --square-pixels",
        _of(aspect=("tangent", "horizontal", "vertical")),
    ),
    Mistake(
        "aspect-inverted",
        "the shorter side's angle is multiplied by the wrong quotient",
        "fov_y = fov_x height / width where the picture is wide, and fov_x = fov_y width / height where it is tall",
        _of(aspect=("inverted",)),
    ),
    Mistake(
        "tall-as-wide",
        "the file's angle is taken for the width of a picture that is taller than wide",
        "where height > width the angle is the height's: fov_y = angle and fov_x = angle width / height",
        _of(aspect=("wide",)),
    ),
    Mistake(
        "aspect-ignored",
        "both sides have the same angle, though the picture is not square",
        "fov_y = fov_x height / width",
        _of(aspect=("none",)),
    ),
    Mistake(
        "up-not-orthogonal",
        "up is taken for the camera's y axis as it is",
        "x = up x z and y = z x x, with z = position - lookat, all of length 1",
        _of(axes=("unit up", "up")),
    ),
    Mistake(
        "camera-not-normalized",
        "the camera's axes are not of length 1",
        "normalize z = position - lookat, then x = up x z; y = z x x is of length 1 then",
        _of(axes=("x", "xy", "z", "yz")),
    ),
    Mistake(
        "camera-transposed",
        "the camera's matrix is transposed",
        "d = x_i x + y_i y - z: the axes are the columns of the matrix",
        _of(axes=("transposed",)),
    ),
    Mistake(
        "camera-backwards",
        "the camera looks backwards",
        "it looks along -z: d = x_i x + y_i y - z with z = position - lookat",
        _of(axes=("backwards",)),
    ),
    # All of the picture
    Mistake(
        "integer-division",
        "whole numbers are divided where fractions are meant",
        "divide floating point numbers: u / width, height / width, texel / 255",
        (
            *_of(columns=("zero", "halves"), upside_down=(False, True)),
            *_of(aspect=("zero", "whole")),
            *_of(rounding=("whole",)),
            *_of(texture=("whole", "nearest whole")),
        ),
    ),
    Mistake(
        "gamma",
        "a gamma curve is applied",
        "write the bytes linearly: 255 c, without pow() and without an sRGB format of the image",
        _of(gamma=(2.2, 0.0, 2.0, 1.8, 2.4, 1 / 2.2)),
        whole=True,
    ),
    Mistake(
        "swapped-channels",
        "red, green and blue are written in another order",
        "the bytes of a pixel are red, green, blue; some image formats and windows want blue first",
        _of(channels=((2, 1, 0), (1, 0, 2), (0, 2, 1), (1, 2, 0), (2, 0, 1))),
        whole=True,
    ),
    Mistake(
        "grey",
        "the picture is grey",
        "write red, green and blue of the colour, not one number",
        _of(grey=((0.299, 0.587, 0.114), (0.2126, 0.7152, 0.0722), (1 / 3, 1 / 3, 1 / 3))),
        whole=True,
    ),
    Mistake(
        "colour-profile",
        "the colours are those of another screen: a colour profile, or a screenshot",
        "write the bytes yourself, instead of copying them from a window, and into a file without a profile",
        (),
        whole=True,
    ),
    Mistake("inverted", "black is white", "write 255 c, not 255 - 255 c", _of(inverted=(True,)), whole=True),
    Mistake(
        "upside-down",
        "top and bottom are exchanged",
        "y_i points up and rows are counted from the top: write row height - 1 - v, or turn y_i's sign",
        _of(upside_down=(True,)),
        whole=True,
    ),
    Mistake(
        "mirrored",
        "left and right are exchanged",
        "the camera's x axis is up x z with z = position - lookat: the other order turns it round",
        _of(mirrored=(True,)),
        whole=True,
    ),
    Mistake(
        "transposed",
        "rows and columns are exchanged",
        "image[y][x] is the pixel of column x and row y",
        _of(transposed=(True,)),
        whole=True,
    ),
    Mistake(
        "shifted",
        "all is some pixels aside",
        "the first column is u = 0 and the last one u = width - 1: x_n = (u + 0.5) / width",
        (),
        whole=True,
    ),
    Mistake(
        "wrapped",
        "what is brighter than 1 starts again at black",
        "clamp the colour to 0..1 before it becomes a byte: 255 * 1.07 does not fit",
        _of(rounding=("wrapped",)),
    ),
    Mistake(
        "unscaled",
        "colours of 0..1 are written as bytes without 255",
        "write int(255 c + 0.5)",
        _of(rounding=("unscaled",)),
    ),
    Mistake(
        "only-background",
        "the picture shows nothing but the background: no ray meets anything",
        "print the ray of the middle pixel, and what it should meet: --explain says both",
        (),
        whole=True,
    ),
    Mistake(
        "black",
        "the picture is black",
        "does the loop write its pixels, and is the picture saved after it? print one colour",
        (),
        whole=True,
    ),
    Mistake(
        "one-colour",
        "the picture has one colour",
        "does each pixel have its own ray, and is each one's colour written to its own place?",
        (),
        whole=True,
    ),
    Mistake(
        "cut-off",
        "the picture ends before its end",
        "close the file, and let the loops go through all rows",
        (),
        whole=True,
    ),
    Mistake(
        "border",
        "there is a frame around the picture",
        "write the picture as the program has it, not the window",
        (),
        whole=True,
    ),
    Mistake(
        "acne",
        "surfaces shadow themselves here and there: rays meet the surface that they start on",
        "start new rays a small epsilon off the surface, or ignore hits with t < epsilon",
        _of(reaching=(None,)),
    ),
    Mistake(
        "antialiased",
        "outlines are smooth: pixels have more than one ray",
        "the course has one ray for each pixel, through its middle",
        (),
        whole=True,
    ),
    Mistake(
        "truncated",
        "colours are rounded down to bytes",
        "round to the nearest: int(255 c + 0.5); the course's own pictures are truncated, see --truncate",
        _of(rounding=("down", "256")),
    ),
)

BY_NAME = {mistake.name: mistake for mistake in MISTAKES}

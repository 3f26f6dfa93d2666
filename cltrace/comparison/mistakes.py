"""The mistakes that are looked for: what each is, what to change in the code, and what it makes of the rules.

A mistake has variants where it is made in more than one way. Its name stands for all of them.
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
    fitted: whether its epsilon is to be found by trying.
    """

    name: str
    what: str
    change: str
    variants: tuple[Changes, ...]
    fitted: bool = False


def _of(**values: tuple[Any, ...]) -> tuple[Changes, ...]:
    """Every combination of these values."""
    return tuple(dict(zip(values, row, strict=True)) for row in product(*values.values()))


MISTAKES = (
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
        "pixel-corner",
        "rays go through the corners of the pixels",
        "x_n = (u + 0.5) / width and y_n = (v + 0.5) / height",
        (*_of(sample=((0, 1), (0, 0), (1, 0), (1, 1), (0, 0.5), (0.5, 0), (0.5, 1))), {"columns": "ends"}),
    ),
    Mistake(
        "upside-down",
        "top and bottom are exchanged",
        "y_i points up and rows are counted from the top: write row height - 1 - v, or turn y_i's sign",
        _of(upside_down=(True,)),
    ),
    Mistake(
        "mirrored",
        "left and right are exchanged",
        "the camera's x axis is up x z with z = position - lookat: the other order turns it round",
        _of(mirrored=(True,)),
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
        "no-facing-gate",
        "lights behind a surface shine on it",
        "add diffuse and specular terms only where n.l > 0",
        _of(facing=("highlight", "negative", "both"), own_shadow=(True, False)),
    ),
    Mistake(
        "early-clamp",
        "colours are clamped before they are mixed",
        "clamp once, at the end: not the light's colour, nor the local colour, nor what a mirror shows",
        _of(clamped=("local", "light", "traced", "both", "lights")),
    ),
    Mistake(
        "ambient-per-light",
        "ambient light is added once for every light",
        "add ka La C once, before the loop over the lights",
        _of(ambient=("each", "one more", "reaching", "facing", "shining", "lit")),
    ),
    Mistake(
        "gamma",
        "a gamma curve is applied",
        "write the bytes linearly: 255 c, without pow() and without an sRGB format of the image",
        _of(gamma=(2.2, 0.0, 2.0, 1.8, 2.4, 1 / 2.2)),
    ),
    Mistake(
        "integer-division",
        "whole numbers are divided where fractions are meant",
        "divide floating point numbers: u / width, height / width, texel / 255; mix the four texels around a place",
        (
            *_of(columns=("zero", "halves"), upside_down=(False, True)),
            *_of(aspect=("zero", "whole", "none")),
            *_of(rounding=("whole",)),
            *_of(texture=("whole", "nearest", "nearest whole")),
        ),
    ),
    Mistake(
        "normal-not-flipped",
        "normals are not turned against a ray that comes from inside",
        "if n.d > 0, use -n: for shading, for reflection and for refraction",
        (
            *_of(turned_for_light=(False,), turned_for_rays=(True, False)),
            *_of(turned_for_light=(True, False), turned_for_rays=(False,), media=("right", "entering")),
        ),
    ),
    Mistake(
        "transform-order",
        "the steps of transforms act in the wrong order",
        "multiply them in the order of the file, M = T1 T2 ... Tn: the last one acts first, on the placed sphere",
        _of(transforms=("reversed", "placed-last", "moved-first")),
    ),
    Mistake(
        "normal-transform",
        "normals are transformed as points are",
        "take normals to the world by the transposed inverse of the matrix, and normalize them after that",
        _of(normals=("matrix", "none", "inverse"), flat_normals=(False, True)),
    ),
    Mistake(
        "texture-flipped",
        "textures are turned over",
        "v = 0 is the top row of the image and u = 0 its left column",
        (*_of(turned_v=(True,), turned_u=(False, True)), {"turned_u": True}),
    ),
    Mistake(
        "half-texel",
        "textures are off by half a texel",
        "x = u width and y = v height, without 0.5: u = 0 is just the first column",
        _of(texels_off=(-0.5, 0.5)),
    ),
    Mistake(
        "mirror-depth",
        "rays bounce once more, or once less, than max_bounces says",
        "the camera's ray has depth 0 and goes on while depth <= max_bounces; the last hit shows its local colour",
        (
            *_of(more_bounces=(-1, 1)),
            *_of(last=("black", "weighted"), more_bounces=(0, -1)),
        ),
    ),
    Mistake(
        "refraction-inverted",
        "light is bent the wrong way where it enters or leaves glass",
        "the ratio in Snell's law is 1 / iof on the way in and iof on the way out",
        _of(media=("inverted", "entering")),
    ),
    Mistake(
        "acne",
        "surfaces shadow themselves here and there: rays meet the surface that they start on",
        "start new rays a small epsilon off the surface, or ignore hits with t < epsilon",
        _of(reaching=(None,)),
    ),
    Mistake(
        "truncated",
        "colours are rounded down to bytes",
        "round to the nearest: int(255 c + 0.5); the course's own pictures are truncated, see --truncate",
        _of(rounding=("down", "256")),
    ),
)

BY_NAME = {mistake.name: mistake for mistake in MISTAKES}

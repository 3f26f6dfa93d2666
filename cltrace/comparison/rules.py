"""What a tracer decides, one field each. The defaults are the format's; every other value is a mistake that is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Rules:
    """How a tracer works, stage by stage: from the rays of the camera to the bytes of the picture.

    opening: by what the angles of both sides are multiplied; aspect: how the shorter side's angle follows, "own" being
    the camera's, "tangent" by the tangent, "horizontal" and "vertical" too, but with the file's angle always across, or
    always upright; "none" not at all, "zero" and "whole" by a quotient of whole numbers; sample: where in a pixel its
    ray goes through, from its left and from its bottom, 0..1; columns: how a pixel's number becomes a place: "centers",
    "ends" with the first and last pixel at the very ends, "zero" and "halves" by divisions of whole numbers;
    upside_down, mirrored: whether rows or columns are in the reverse order.

    transforms: in which order steps act, "reversed" the first listed one first, "moved-first" any translation before
    all else, "placed-last" a sphere's position after its transform; normals: what takes them to the world, "right" the
    inverse transpose; flat_normals: whether those of faces that have none of their own are taken there, too, instead of
    made of the corners in the world.

    reversed: of which lights the vector to them is, by the first letters of parallel and other ones, and a for the axis
    of spot lights; reversed_for: whether for shading, shadow rays or both; past_lights: whether what is behind a light
    casts shadows; own_shadow: whether a surface may stand in its own light; epsilon: how far from its start a ray meets
    nothing, or 0 for what rounding needs; measured: along which vector, "ray" of length 1, "light" the whole way to a
    light, or "normal", along which the start is moved; spared: whether mirrored and refracted rays have none; reaching:
    which lights may reach the first point that is seen, and those that mirrors and glass show, in bits, -1 for all;
    None where that is left open.

    facing: what happens to a light behind the surface, "lit" in front only; ambient: how often it counts: "once", or
    for each light, for those that nothing hides, that face the surface, too, or shine there, or both; tinted: whether
    highlights have the surface's colour; halfway: Blinn's formula, with this times the exponent, 0 for Phong's;
    clamped: what is clamped before the end; texture: how it is looked up, "whole" with texels of 0 and 1 only;
    texels_off: how far off, in texels.

    turned_for_light, turned_for_rays: whether normals are turned against the ray for shading and for refraction; media:
    by what a ray is bent, "right", "inverted" or "entering" as if it always came from outside; more_bounces: how many
    more than max_bounces; last: what a ray shows that bounces no more.

    gamma: the exponent 1/gamma is applied at the end, 0 for sRGB's curve; rounding: how a colour becomes a byte.
    """

    opening: tuple[float, float] = (1.0, 1.0)
    aspect: Literal["own", "tangent", "horizontal", "vertical", "none", "zero", "whole"] = "own"
    sample: tuple[float, float] = (0.5, 0.5)
    columns: Literal["centers", "ends", "zero", "halves"] = "centers"
    upside_down: bool = False
    mirrored: bool = False

    transforms: Literal["file", "reversed", "moved-first", "placed-last"] = "file"
    normals: Literal["right", "matrix", "none", "inverse"] = "right"
    flat_normals: bool = False

    reversed: Literal["", "p", "a", "pa", "o", "po"] = ""
    reversed_for: Literal["both", "shading", "shadows"] = "both"
    shadows: bool = True
    past_lights: bool = False
    own_shadow: bool = True
    epsilon: float = 0.0
    measured: Literal["ray", "light", "normal"] = "ray"
    spared: bool = False
    reaching: tuple[int, int] | None = (-1, -1)

    facing: Literal["lit", "highlight", "negative", "both"] = "lit"
    ambient: Literal["once", "each", "one more", "reaching", "facing", "shining", "lit"] = "once"
    tinted: bool = False
    halfway: float = 0.0
    clamped: Literal["end", "local", "traced", "both", "light", "lights"] = "end"
    texture: Literal["right", "nearest", "whole", "nearest whole"] = "right"
    turned_u: bool = False
    turned_v: bool = False
    texels_off: float = 0.0

    turned_for_light: bool = True
    turned_for_rays: bool = True
    media: Literal["right", "inverted", "entering"] = "right"
    more_bounces: int = 0
    last: Literal["local", "weighted", "black"] = "local"

    gamma: float = 1.0
    rounding: Literal["nearest", "down", "256", "whole"] = "nearest"


RIGHT = Rules()

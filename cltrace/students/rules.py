"""What a tracer decides, one field each. The defaults are the format's; every other value is a mistake that is made.

The fields are in a record for each stage of a tracer, from the rays of the camera to the bytes of the picture. No two
records have a field of one name, so that a mistake is said by names alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import product
from typing import Any, Literal


@dataclass(frozen=True)
class CameraRules:
    """The rays of the camera.

    opening: by what the angles of both sides are multiplied; aspect: how the shorter side's angle follows, "own" being
    the camera's, "tangent" by the tangent, "horizontal" and "vertical" too, but with the file's angle always across,
    or always upright; "wide" as "own", with the file's angle always across; "none" not at all, "inverted" by the other
    quotient, "zero" and "whole" by one of whole numbers; radians: whether the file's angles are taken for such; axes:
    which of the camera's are not made unit vectors, "up" being taken as it is, "unit up" as a unit vector, "backwards"
    all looking the other way and "transposed" their matrix; long_rays: whether primary rays are no unit vectors;
    sample: where in a pixel its ray goes through, from its left and from its bottom, 0..1, or beyond where all is
    shifted; columns: how a pixel's number becomes a place: "centers", "ends" with the first and last pixel at the very
    ends, "zero" and "halves" by divisions of whole numbers; upside_down, mirrored: whether rows or columns are in the
    reverse order; transposed: whether rows are columns.
    """

    opening: tuple[float, float] = (1.0, 1.0)
    aspect: Literal["own", "tangent", "horizontal", "vertical", "none", "zero", "whole", "wide", "inverted"] = "own"
    radians: bool = False
    axes: Literal["right", "x", "xy", "z", "yz", "up", "unit up", "backwards", "transposed"] = "right"
    long_rays: bool = False
    sample: tuple[float, float] = (0.5, 0.5)
    columns: Literal["centers", "ends", "zero", "halves"] = "centers"
    upside_down: bool = False
    mirrored: bool = False
    transposed: bool = False


@dataclass(frozen=True)
class SurfaceRules:
    """What surfaces there are, where, and which of them rays meet.

    transforms: in which order steps act, "reversed" the first listed one first, "moved-first" any translation before
    all else, "placed-last" a sphere's position after its transform, and others by what they do to the steps, see
    `shapes.edited`; missing: the surfaces that are not there, by the first letters of their kinds; hits: which of the
    surfaces on its way a ray meets; roots: which of a sphere's two points are looked at; culled: the faces that are
    not there, those that are seen from behind or from before, by their normals or by their winding; normals: what
    takes them to the world, "right" the inverse transpose; normals_of: of which kind of surfaces alone that is wrong;
    sided_by_normal: whether such a one of a sphere says which side is seen; flat_normals: whether those of faces that
    have none of their own are taken there, too, instead of made of the corners in the world; long_normals: which are
    no unit vectors: of meshes, m, and of spheres after the transform, t, and before it, r; clear_shadows: whether what
    lets light through casts shadows; turned_meshes: whether normals of meshes are turned against the ray, even where
    others are not.
    """

    transforms: str = "file"
    missing: Literal["", "s", "m", "c"] = ""
    hits: Literal["nearest", "last", "last part", "first", "farthest"] = "nearest"
    roots: Literal["both", "near", "far"] = "both"
    culled: Literal["", "back", "front", "clockwise", "counter"] = ""
    normals: Literal["right", "matrix", "none", "inverse"] = "right"
    normals_of: Literal["", "s", "m"] = ""
    sided_by_normal: bool = False
    flat_normals: bool = False
    long_normals: Literal["", "m", "t", "r", "mt", "mr"] = ""
    clear_shadows: bool = True
    turned_meshes: bool = False


@dataclass(frozen=True)
class LightRules:
    """Where light comes from, how strong it is, and what hides it.

    reversed: of which lights the vector to them is, by the first letters of parallel and other ones, and a for the
    axis of spot lights; reversed_for: whether for shading, shadow rays or both; long_lights: of which lights it is no
    unit vector, and s where the angle of a spot light suffers; attenuation: what divides light, of the distance D;
    spot: how it fades; shadows: whether there are any; past_lights: whether what is behind a light casts shadows;
    own_shadow: whether a surface may stand in its own light; epsilon: how far from its start a ray meets nothing, or 0
    for what rounding needs; measured: along which vector, "ray" of length 1, "light" the whole way to a light, or
    "normal", along which the start is moved; spared: whether mirrored and refracted rays have none; reaching: which
    lights may reach the first point that is seen, and those that mirrors and glass show, in bits, -1 for all; None
    where that is left open.
    """

    reversed: Literal["", "p", "a", "pa", "o", "po"] = ""
    reversed_for: Literal["both", "shading", "shadows"] = "both"
    long_lights: Literal["", "p", "o", "po", "os", "pos"] = ""
    attenuation: Literal["1", "D", "D2", "1+D", "1+D2", "1+D+D2"] = "1"
    spot: Literal["right", "none", "inner", "outer", "cosine", "smooth", "half", "double"] = "right"
    shadows: bool = True
    past_lights: bool = False
    own_shadow: bool = True
    epsilon: float = 0.0
    measured: Literal["ray", "light", "normal"] = "ray"
    spared: bool = False
    reaching: tuple[int, int] | None = (-1, -1)

    @property
    def epsilon_of_bounces(self) -> float:
        return 0.0 if self.spared else self.epsilon


@dataclass(frozen=True)
class PhongRules:
    """What light makes of a surface's own colour.

    turned_for_light: whether normals are turned against the ray; facing: what happens to a light behind the surface,
    "lit" in front only; ambient: how often it counts: "once", or for each light, for those that nothing hides, that
    face the surface, too, or shine there, or both; ka, kd, ks: what is made of the coefficients, "bare" being without
    the surface's colour; highlight: which way the mirrored light goes, or that n.l counts, too; tinted: whether
    highlights have the surface's colour; halfway: Blinn's formula, with this times the exponent, 0 for Phong's;
    clamped: what is clamped before the end.
    """

    turned_for_light: bool = True
    facing: Literal["lit", "highlight", "negative", "both", "absolute"] = "lit"
    ambient: Literal["once", "each", "one more", "reaching", "facing", "shining", "lit"] = "once"
    ka: Literal["right", "none", "one", "twice", "bare", "double"] = "right"
    kd: Literal["right", "none"] = "right"
    ks: Literal["right", "none"] = "right"
    highlight: Literal["right", "reversed", "cosine"] = "right"
    tinted: bool = False
    halfway: float = 0.0
    clamped: Literal["end", "local", "traced", "both", "light", "lights"] = "end"


@dataclass(frozen=True)
class TextureRules:
    """How a texture is looked up.

    texture: "whole" with texels of 0 and 1 only; swapped_uv, clamped_uv: whether u and v are exchanged, or do not
    repeat; turned_u, turned_v: whether they go the other way; texels_off: how far off, in texels; mesh_colors: what is
    made of the colours of meshes' vertices and faces, "first" and "mean" being one colour for each triangle.
    """

    texture: Literal["right", "nearest", "whole", "nearest whole", "white", "black"] = "right"
    swapped_uv: bool = False
    clamped_uv: bool = False
    turned_u: bool = False
    turned_v: bool = False
    texels_off: float = 0.0
    mesh_colors: Literal["right", "none", "first", "mean"] = "right"


@dataclass(frozen=True)
class BounceRules:
    """Mirrors and glass.

    turned_for_rays: whether normals are turned against the ray for refraction; media: by what a ray is bent, "right",
    "inverted", "entering" as if it always came from outside, or "none"; mirrors, clear: what is made of r and t,
    "dark" being that no such ray goes on; own_share: of what r and t leave, or "whole"; reflection: d - 2 (n.d) n with
    a mistake; unit_mirrored: whether that is normalized after it; total: what total reflection does to t; fresnel: who
    gives and by which formula; far_background: whether mirrors and glass show the background; more_bounces: how many
    more than max_bounces; deepest: instead of max_bounces; last: what a ray shows that bounces no more.
    """

    turned_for_rays: bool = True
    media: Literal["right", "inverted", "entering", "none"] = "right"
    mirrors: Literal["right", "none", "dark", "double", "squared"] = "right"
    clear: Literal["right", "none", "dark", "double", "squared"] = "right"
    own_share: Literal["right", "whole", "but r", "but t"] = "right"
    reflection: Literal["right", "reversed", "once", "sign", "back"] = "right"
    unit_mirrored: bool = False
    total: Literal["right", "dropped", "straight", "local"] = "right"
    fresnel: Literal["", "t", "both", "t exact", "both exact"] = ""
    far_background: bool = True
    more_bounces: int = 0
    deepest: int | None = None
    last: Literal["local", "weighted", "black"] = "local"


@dataclass(frozen=True)
class PictureRules:
    """How colours become bytes.

    gamma: the exponent 1/gamma is applied at the end, 0 for sRGB's curve; channels: which of red, green and blue are
    written for each; grey: the weights of the three in their mean; inverted: whether black is white; profile: rows of
    the matrix that takes light of a screen by sRGB's curve to that of another one; rounding: how a colour becomes a
    byte.
    """

    gamma: float = 1.0
    channels: tuple[int, int, int] = (0, 1, 2)
    grey: tuple[float, float, float] | None = None
    inverted: bool = False
    profile: tuple[float, ...] | None = None
    rounding: Literal["nearest", "down", "256", "whole", "wrapped", "unscaled"] = "nearest"


@dataclass(frozen=True)
class Rules:
    """How a tracer works, stage by stage."""

    camera: CameraRules = field(default_factory=CameraRules)
    surfaces: SurfaceRules = field(default_factory=SurfaceRules)
    lights: LightRules = field(default_factory=LightRules)
    phong: PhongRules = field(default_factory=PhongRules)
    textures: TextureRules = field(default_factory=TextureRules)
    bounces: BounceRules = field(default_factory=BounceRules)
    picture: PictureRules = field(default_factory=PictureRules)

    def changed(self, **changes: Any) -> Rules:
        """The same with other values of some fields, whichever records have them."""
        parts: dict[str, dict[str, Any]] = {}
        for name, value in changes.items():
            parts.setdefault(_RECORD[name], {})[name] = value
        return replace(self, **{part: replace(getattr(self, part), **values) for part, values in parts.items()})

    @property
    def linear(self) -> Rules:
        """The same until colours become bytes, which then is right."""
        return replace(self, picture=PictureRules())


RIGHT = Rules()
_RECORD = {rule.name: part.name for part in fields(Rules) for rule in fields(getattr(RIGHT, part.name))}


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


def variants(**values: tuple[Any, ...]) -> tuple[Changes, ...]:
    """Every combination of these values."""
    return tuple(dict(zip(values, row, strict=True)) for row in product(*values.values()))


def can_be_made_together(made: Mapping[str, Changes]) -> bool:
    """Whether no two mistakes, by their names, say something of one rule."""
    return len({key for changes in made.values() for key in changes}) == sum(map(len, made.values()))

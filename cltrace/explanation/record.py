"""Everything that is known of a pixel.

Points and directions are in the world, in scene units, and directions have length 1, unless something else is said.
Colours are linear, 1 = full, and not clamped.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

from cltrace.explanation.textbook import Textbook, Triple
from cltrace.scene.colors import Transfer

Fate = Literal["lit", "behind", "beside the cone", "in shadow", "at the point"]


@dataclass(frozen=True)
class SurfaceName:
    """Which surface, in the words of the scene's file.

    kind: what it is in the file; id: its number, as the output `id` has it; line: of
    the scene's file, 0 if it is not known; file: of a mesh, "" if it is not known; primitive: of a triangle, its number
    in the mesh, -1 for none; face_line: the line of its face in the mesh's file, 0 if it is not known.
    """

    kind: str
    id: int
    line: int = 0
    file: str = ""
    primitive: int = -1
    face_line: int = 0


@dataclass(frozen=True)
class LightName:
    """Which light. kind: its element's name; number: among all lights, from 0; line: of the file, 0 if unknown."""

    kind: str
    number: int
    line: int = 0


@dataclass(frozen=True)
class CameraRay:
    """From the pixel to its ray.

    u, v: the pixel's column and row, as the tutorial counts them: v from the bottom; x_n, y_n: the same from 0 to 1;
    fov_x, fov_y: half of the opening angles, in degrees, 0 of an orthographic camera; height: of what an orthographic
    camera shows, in scene units, None of others; x_i, y_i: on the image plane at z = -1, or where the ray of an
    orthographic camera starts; direction: of the ray, in camera space; axes: the camera's x, y and z in the world;
    line: of <camera>, 0 if it is not known.
    """

    u: int
    v: int
    x_n: float
    y_n: float
    fov_x: float
    fov_y: float
    square_pixels: bool
    height: float | None
    x_i: float
    y_i: float
    direction: Triple
    axes: tuple[Triple, Triple, Triple]
    line: int


@dataclass(frozen=True)
class SurfaceTest:
    """A ray and a surface.

    textbook: the textbook's numbers, see cltrace/explanation/textbook.py; distance: where the ray meets it first, by
    exact arithmetic, inf if it does not; remark: where exact arithmetic says something else than the textbook's
    numbers, "" if it does not.
    """

    surface: SurfaceName
    textbook: Textbook
    distance: float
    remark: str = ""


@dataclass(frozen=True)
class Placement:
    """What a surface's transform makes of it, and of the ray.

    matrix: from the object's space to the world, M = T1 T2 ... Tn, its upper three rows; inverse: of it, likewise;
    origin, direction: the ray in the object's space, the direction not normalised, so that t is the same.
    """

    matrix: tuple[tuple[float, ...], ...]
    inverse: tuple[tuple[float, ...], ...]
    origin: Triple
    direction: Triple


@dataclass(frozen=True)
class Texel:
    """One of the four pixels of a texture that are mixed: its column and row, its share, and its colour."""

    x: int
    y: int
    weight: float
    color: Triple


@dataclass(frozen=True)
class TextureLookup:
    """name: of the file, "" if unknown; size: (width, height) in pixels; uv: not wrapped; x, y: the pixel at the upper
    left of the four that are mixed; right, down: the shares of those to the right of it and below; color: the mixture;
    texels: the four, the upper ones first.
    """

    name: str
    size: tuple[int, int]
    uv: tuple[float, float]
    x: int
    y: int
    right: float
    down: float
    color: Triple
    texels: tuple[Texel, ...]


@dataclass(frozen=True)
class Hit:
    """The closest surface, and the point there.

    shape: what the normal is made of, one of the NORMALS of cltrace/explanation/textbook.py; t: the distance; normal:
    facing the side from which the ray came; turned: whether it had to be turned there; inside: whether that is the
    inside; placement: of what has a transform, as far as it is known; color: C, the material's times the texture's; the
    rest is the material's.
    """

    surface: SurfaceName
    shape: str
    t: float
    point: Triple
    normal: Triple
    turned: bool
    inside: bool
    placement: Placement | None
    color: Triple
    texture: TextureLookup | None
    ka: float
    kd: float
    ks: float
    exponent: float
    reflectance: float
    transmittance: float
    index: float


@dataclass(frozen=True)
class Met:
    """A surface on the way of a shadow ray, at which distance from the point, and where; inf and None if unknown."""

    surface: SurfaceName
    distance: float
    point: Triple | None


@dataclass(frozen=True)
class LightTerm:
    """What a light adds at a point.

    L: its colour; fate: whether it reaches the point, or why not; l: towards the light; distance: to the light, inf of
    a parallel one; n_l: n.l; cone: of a spot light, the angle between its axis and the way to the point, alpha1 and
    alpha2, in degrees; strength: of a spot light in that direction, 1 of any other; between: what stands between,
    nearest first, few of `blockers` in all; behind: what is on the way behind the light, and does not matter; r: the
    mirrored direction; r_v: r.v, v being towards the eye; diffuse, specular: the two terms of Phong's formula. Of a
    light that adds nothing, both are 0.
    """

    light: LightName
    L: Triple
    fate: Fate
    l: Triple  # noqa: E741
    distance: float
    n_l: float
    cone: tuple[float, float, float] | None
    strength: float
    between: tuple[Met, ...]
    blockers: int
    behind: Met | None
    r: Triple
    r_v: float
    diffuse: Triple
    specular: Triple


@dataclass(frozen=True)
class SoftTerm:
    """What a soft light adds at a point: what its members add.

    L: the sum of their colours; members: one term each.
    """

    light: LightName
    L: Triple
    members: tuple[LightTerm, ...]

    @property
    def fates(self) -> dict[Fate, int]:
        """How many of the members reach the point, and how many do not for each reason; "lit" comes first."""
        return {fate: count for fate in get_args(Fate) if (count := sum(one.fate == fate for one in self.members))}

    @property
    def fate(self) -> Fate:
        """That of a light of which any member reaches the point is lit; else it is what most members have."""
        return max(self.fates, key=lambda fate: (fate == "lit", self.fates[fate]))

    @property
    def diffuse(self) -> Triple:
        return total(one.diffuse for one in self.members)

    @property
    def specular(self) -> Triple:
        return total(one.specular for one in self.members)


def total(colors: Iterable[Triple]) -> Triple:
    """The sum of colours, in their order."""
    red, green, blue = 0.0, 0.0, 0.0
    for color in colors:
        red, green, blue = red + color[0], green + color[1], blue + color[2]
    return (red, green, blue)


@dataclass(frozen=True)
class AmbientTerm:
    """ka L C of an ambient light of the colour L."""

    light: LightName
    L: Triple
    color: Triple


@dataclass(frozen=True)
class Bounce:
    """A ray that goes on from a mirror or through glass.

    kind: mirrored or refracted; total: whether it is total reflection, which gets the share of the refracted ray, too;
    share: of its colour that is seen; ray: its place among the rays, None if it is too faint for any byte and only its
    colour is known; rays: how many rays it stands for; color: what it sees; angle_in, angle_out: to the normal, in
    degrees.
    """

    kind: str
    total: bool
    share: float
    ray: int | None
    rays: int
    color: Triple
    angle_in: float
    angle_out: float


@dataclass(frozen=True)
class Term:
    """One line of a sum."""

    label: str
    color: Triple


@dataclass(frozen=True)
class TracedRay:
    """A ray, what it meets, and the colour that it sees.

    kind: primary, mirrored or refracted; depth: how many bounces lie behind it; weight: its share of the pixel; tests:
    the surfaces that it meets, closest first, few of `meets` in all; missed: of a pixel's own ray, those that it does
    not meet, but that the pixels beside it show before its closest hit; hit: None for the background; ambient, lights:
    what the point shows itself, none if that does not count; local_terms, local: the terms of that, and their sum;
    share: of it in the ray's colour, 1 - reflectance - transmittance where rays go on; last: whether max_bounces ends
    here what would go on; terms, color: what adds up to the colour that the ray sees, and their sum.
    """

    kind: str
    depth: int
    weight: float
    origin: Triple
    direction: Triple
    tests: tuple[SurfaceTest, ...]
    meets: int
    missed: tuple[SurfaceTest, ...]
    hit: Hit | None
    ambient: tuple[AmbientTerm, ...]
    lights: tuple[LightTerm | SoftTerm, ...]
    local_terms: tuple[Term, ...]
    local: Triple
    share: float
    last: bool
    bounces: tuple[Bounce, ...]
    terms: tuple[Term, ...]
    color: Triple


@dataclass(frozen=True)
class Facts:
    """Why a pixel of a scene has its colour.

    path: of the scene's file, "" if it was made otherwise; x, y: the pixel's column and row, from the top left; width,
    height: of the picture; surfaces: how many the scene has; rays: the pixel's ray and after it those of mirrors and
    glass, each before those that go on from it; color: the pixel's, linear, not clamped; rgb8: its bytes, those of the
    reference tracer; truncate: whether they are cut to a whole number instead of rounded; transfer: the scene's curve.
    """

    path: str
    x: int
    y: int
    width: int
    height: int
    max_bounces: int
    surfaces: int
    camera: CameraRay
    rays: tuple[TracedRay, ...]
    color: Triple
    rgb8: tuple[int, int, int]
    truncate: bool
    transfer: Transfer

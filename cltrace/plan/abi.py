"""What the host and the kernel agree on, in one table: structs, arguments, outputs, counters, constants and flags.

Everything that either side needs of it is made from here: the numpy dtypes, the order of the kernel's arguments, and a
header in OpenCL C that stands before the kernel's own files (`python -m cltrace.plan.abi` prints it). So a new buffer
or a new output is one line here. Lengths are in scene units where the type is `real` and double, and otherwise in units
of which one is `length` scene units.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

Precision = Literal["accurate", "single", "double"]


class Field(NamedTuple):
    """A field of a struct or an argument. type: an OpenCL scalar or vector type, `real`, or a struct of STRUCTS."""

    name: str
    type: str
    text: str


# Only whole vectors of 4, so that there is nothing to pad.
STRUCTS = {
    "Frame": (
        Field("pixel", "real4", "x, y: size of a pixel on the image plane z = -1"),
        Field("right", "real4", "xyz: the camera's x axis in the world"),
        Field("up", "real4", "xyz: its y axis"),
        Field("back", "real4", "xyz: its z axis, against the view"),
        Field("background", "float4", "rgb, linear"),
        Field("quantize", "float4", "x: what is added to 255 c before it is cut to an integer: 0.5 or 0"),
    ),
    "Light": (
        Field("position", "real4", "point, spot: xyz in camera space; parallel: unit vector towards the light"),
        Field("axis", "real4", "spot: unit vector in which it points, w: cosine of alpha2; parallel: u axis across it"),
        Field("across", "real4", "parallel: v axis across it"),
        Field("color", "float4", "rgb, linear"),
        Field("cone", "float4", "spot: x: alpha1, y: 1 / (alpha2 - alpha1), radians, 0 if equal; z: see illuminate()"),
    ),
    "Grid": (
        Field("right", "real4", "x axis; w: added to the coordinate, so that a parallel light's count from the middle"),
        Field("up", "real4", "y axis, likewise"),
        Field("ahead", "real4", "z axis"),
        Field("near_right", "float4", "the same three in float"),
        Field("near_up", "float4", ""),
        Field("near_ahead", "float4", ""),
        Field("window", "float4", "x, y: half of the sides; z, w: cells in a unit of length"),
        Field("cells", "int4", "columns and rows on level 0; the first cell's number; which levels hold anything"),
        Field("flags", "int4", "x: whether float is fine enough for the cells"),
    ),
}


@dataclass(frozen=True)
class Argument:
    """An argument of the kernel `render`, in the order of ARGUMENTS.

    kind: value (a scalar or a struct), buffer (read by the kernel) or output (written, one record a pixel); group: the
    struct of the kernel in which it is found; channels: of an output, numbers a pixel.
    """

    name: str
    type: str
    kind: Literal["value", "buffer", "output"]
    group: str
    text: str
    channels: int = 1

    @property
    def parameter(self) -> str:
        """How OpenCL C declares it."""
        pointer = {"value": "const {} {}", "buffer": "__global const {} *{}", "output": "__global {} *{}"}
        return pointer[self.kind].format(self.type, self.name)


def _values(group: str, *rows: tuple[str, str, str]) -> tuple[Argument, ...]:
    return tuple(Argument(name, type_, "value", group, text) for name, type_, text in rows)


def _buffers(group: str, *rows: tuple[str, str, str]) -> tuple[Argument, ...]:
    return tuple(Argument(name, type_, "buffer", group, text) for name, type_, text in rows)


def _outputs(*rows: tuple[str, str, int, str]) -> tuple[Argument, ...]:
    return tuple(Argument(name, type_, "output", "Outputs", text, n) for name, type_, n, text in rows)


# What --stats counts, by the last index of the output `work`: the kernel's name for it, and the words for a reader.
COUNTERS = {
    "SHADOW_RAYS": "shadow rays traced",
    "FACING_AWAY": "shadow rays to lights that shine on the other side or elsewhere",
    "UNSTOPPABLE": "shadow rays that no sphere can stop",
    "HIGHLIGHTS": "highlights computed",
    "FAINT_HIGHLIGHTS": "highlights too faint for a pixel",
    "FILTERED": "spheres that float32 rules out for a ray",
    "DECIDED": "spheres that are decided in full for a ray",
    "BACKGROUND": "rays through tiles of background only",
}

ARGUMENTS = (
    *_values(
        "",
        ("frame", "Frame", "the camera and the picture"),
        ("size", "int2", "pixels of the whole picture"),
        ("region", "int4", "x, y, width, height: the part that is wanted; x and y are multiples of TILE"),
        ("row", "int", "of the region: where this launch starts"),
    ),
    *_values("Outputs", ("pitch", "int", "pixels in a row of the outputs: whole packets")),
    *_values(
        "Scene",
        ("lights", "int4", "numbers of parallel, point and spot lights, and of all"),
        ("count", "int", "of spheres"),
        ("unit", "real", "a power of two: times a length, it is what the float buffers hold, which is about 1 at most"),
    ),
    *_buffers(
        "Spheres",
        ("center_radius", "real4", "centre in camera space, radius"),
        ("power", "real2", "|centre|^2 - radius^2 of the unrounded scene, 1 / radius"),
        ("world", "real4", "centre in the world, as the scene has it; w: what was cut off of power. Not in single"),
        ("camera", "real4", "in the world: the eye, right, up and back. Not in single"),
    ),
    *_buffers(
        "Scene",
        ("id_of", "int", "a sphere's place in the scene file"),
        ("material_of", "int", "a sphere's index into material"),
        ("material", "shade8", "ka La C (rgb), kd C (rgb), ks, exponent"),
        ("light", "Light", "parallel lights, then point lights, then spot lights"),
        ("eye_filter", "float4", "a sphere, for sphere_may_meet"),
        ("light_filter", "float4", "a light's spheres, for the filters of stopped()"),
        ("light_side", "char", "a light's spheres: whether the light is outside (1), on (0) or inside (-1)"),
        ("light_buffer", "int4", "a light's first grid, their number; z: see may_be_stopped()"),
    ),
    *_buffers(
        "Lists",
        ("grid", "Grid", "the picture's tiles, then the grids of the lights"),
        ("start", "int", "where a cell's list begins in entry; the next cell's begin is its end"),
        ("entry", "int2", "a sphere's index, and the depth by which the list is sorted, as float bits"),
    ),
    *_outputs(
        ("rgb8", "uchar", 3, "linear bytes"),
        ("color", "float", 3, "linear, not clamped"),
        ("normal", "float", 3, "unit, in the world, facing the camera"),
        ("direction", "float", 3, "of the pixel's ray, unit, in the world"),
        ("depth", "real", 1, "distance from the eye"),
        ("id", "int", 1, "the sphere's place in the scene file, -1 = nothing"),
        ("shadow_rays", "int", 1, "to how many lights"),
        ("work", "int", len(COUNTERS), "how often was done what COUNTERS names"),
    ),
)
OUTPUTS = {a.name: a for a in ARGUMENTS if a.kind == "output"}
# What can be shown; the other outputs count what was done.
PICTURES = tuple(name for name in OUTPUTS if name not in ("shadow_rays", "work"))

# Numbers that both sides rely on. A comment that proves something from one of them names it in brackets with its value,
# such as [TILE = 4], and a test compares the two.
CONSTANTS = {
    "TILE": 4,  # pixels in the side of a cell of the picture's finest tiles, and in a packet's row
    "AHEAD": 8,  # entries that the kernel fetches ahead, even beyond the last list
    "FEW": 16,  # up to so many spheres, a light has one list for all of them, and a bit for each
    "WHOLE": 30,  # the level of a grid that is one cell only
    "FILTER_ROUNDINGS": 11,  # units of 2^-24 by which float32 filters of rays from a fixed point are made wider
    "DISC_ROUNDINGS": 8,  # the same for discs across a parallel light
}

# The -D flags that have no value. Each is set if the scene, the outputs or the device need it.
FLAGS = {
    "NO_FMA": "the driver calls a function for each fma",
    "WITH_FILTER": "a float32 test with a proved bound goes before each exact one",
    "WITH_INTERSECTION": "more is needed of a hit than its index and distance",
    "WITH_NORMAL": "the normal, too",
    "WITH_INSIDE": "the camera is inside of a sphere",
    "WITH_SHADING": "colours are wanted",
    "WITH_LIGHTS": "some light adds to them",
    "WITH_PARALLEL": "there is a parallel light",
    "WITH_POINT": "there is a point light",
    "WITH_SPOT": "there is a spot light",
    "WITH_SHADOWS": "something may stand between a sphere and a light",
    "WITH_SPECULAR": "some sphere shines",
    "WITH_BLACK": "some sphere reflects no light at all",
    "WITH_PREFETCH": "the spheres are so many that a cache holds few of them",
    "KEEP_HIGHLIGHTS": "highlights that no pixel shows are computed, too",
    **{f"OUT_{name.upper()}": f"write {name}" for name in OUTPUTS},
}
# The -D flags with a value.
VALUES = {
    "W": "pixels in a packet: 1, 4, 8 or 16",
    "RUN": "packets that a work-item renders, one after the other",
    "REAL_BYTES": "8: geometry is decided in double; 4: in float",
    "SHADE_BYTES": "8: Phong's formula in double; 4: in float",
    **{f"{name}_BYTES": f"size of {name} as numpy lays it out" for name in STRUCTS},
}


def real_dtype(precision: Precision) -> np.dtype[Any]:
    """The type that decides hits and shadows in this precision."""
    return np.dtype("f4" if precision == "single" else "f8")


def shade_dtype(precision: Precision) -> np.dtype[Any]:
    """The type that colours are computed in."""
    return np.dtype("f8" if precision == "double" else "f4")


def dtype_of(type_: str, precision: Precision) -> np.dtype[Any]:
    """The numpy dtype of a type of this table. Of a vector type it has a shape, of a struct fields."""
    if type_ in STRUCTS:
        return np.dtype([(f.name, *_scalar_and_width(f.type, precision)) for f in STRUCTS[type_]])
    scalar, width = _scalar_and_width(type_, precision)
    return np.dtype((scalar, width)) if width > 1 else scalar


def _scalar_and_width(type_: str, precision: Precision) -> tuple[np.dtype[Any], int]:
    name, width = re.fullmatch(r"([a-z]+)(\d*)", type_).groups()  # type: ignore[union-attr]
    scalars = {"float": "f4", "int": "i4", "char": "i1", "uchar": "u1"}
    scalar = {"real": real_dtype(precision), "shade": shade_dtype(precision)}.get(name)
    return (np.dtype(scalars[name]) if scalar is None else scalar), int(width or 1)


def options(precision: Precision, features: frozenset[str]) -> list[str]:
    """The compiler's -D options for a precision and flags that are set. KeyError for one that is not in FLAGS."""
    for name in features:
        FLAGS[name]
    sizes = {
        "REAL_BYTES": real_dtype(precision).itemsize,
        "SHADE_BYTES": shade_dtype(precision).itemsize,
        **{f"{name}_BYTES": dtype_of(name, precision).itemsize for name in STRUCTS},
    }
    return [f"-D{k}={v}" for k, v in sizes.items()] + [f"-D{name}" for name in sorted(features)]


def header() -> str:
    """The table in OpenCL C: constants, structs, and the kernel's parameters as macros."""
    lines = [f"#define {name} {value}" for name, value in CONSTANTS.items()]
    lines += [f"#define {name} {i}" for i, name in enumerate(COUNTERS)] + [f"#define COUNTERS {len(COUNTERS)}"]
    for name, fields in STRUCTS.items():
        lines += _struct(name, [(f"{f.type} {f.name}", f.text) for f in fields])
        # The build fails here, by name, if the host lays a struct out differently.
        lines.append(f"typedef char layout_of_{name}_differs_from_numpy[sizeof({name}) == {name}_BYTES ? 1 : -1];")
    groups: dict[str, list[Argument]] = {}
    for argument in ARGUMENTS:
        groups.setdefault(argument.group, []).append(argument)
    loose = groups.pop("")
    for name in ("Spheres", "Lists", "Scene", "Outputs"):
        inner = [(f"{g} {g.lower()}", "") for g in ("Spheres", "Lists")] if name == "Scene" else []
        fields_of = [(a.parameter.removeprefix("const "), a.text) for a in groups[name]]
        lines += _struct(name, inner + fields_of)
    lines.append("#define RENDER_PARAMETERS " + ", ".join(a.parameter for a in ARGUMENTS))
    for name, members in groups.items():
        nested = [f".{g.lower()} = {g.upper()}_OF_PARAMETERS" for g in ("Spheres", "Lists")] if name == "Scene" else []
        values = [f".{a.name} = {a.name}" for a in members]
        lines.append(f"#define {name.upper()}_OF_PARAMETERS {{{', '.join(nested + values)}}}")
    assert [a.name for a in loose] == ["frame", "size", "region", "row"]
    return "\n".join(lines) + "\n"


def _struct(name: str, fields: list[tuple[str, str]]) -> list[str]:
    comment = {True: " /* {} */", False: ""}
    rows = [f"    {declaration};{comment[bool(text)].format(text)}" for declaration, text in fields]
    return ["typedef struct {", *rows, f"}} {name};"]


if __name__ == "__main__":
    print(header(), end="")

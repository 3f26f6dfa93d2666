"""What the host and the kernel agree on, in one table: structs, arguments, outputs, counters, constants and flags.

Everything that either side needs of it is made from here: the numpy dtypes, the order of the kernel's arguments, and a
header in OpenCL C that stands before the kernel's own files, see opencl.py. So a new buffer is one line here;
docs/developers.md says what a new output needs besides.

Units: where `real` is double, lengths of that type are in scene units. All lengths that are float, and so in single
every length, are in the float buffers' unit: a power of two of scene units, for which the largest coordinate is about
1. The argument `unit` leads from lengths of type `real` to float ones; in single it is 1.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, Literal, NamedTuple

import numpy as np

from cltrace.base.limits import MAX_RAYS
from cltrace.scene import SIGNED_FULL

Precision = Literal["accurate", "single", "double"]
Kind = Literal["value", "buffer", "output", "note"]


class Field(NamedTuple):
    """A field of a struct or an argument. type: an OpenCL scalar or vector type, `real`, or a struct of STRUCTS."""

    name: str
    type: str
    text: str


def _fields(type_: str, names: str, text: str) -> tuple[Field, ...]:
    """Fields of one type, of which the first one says what they are."""
    first, *others = names.split()
    return (Field(first, type_, text), *(Field(name, type_, "") for name in others))


# Only whole vectors of 4, so that there is nothing to pad.
STRUCTS = {
    "Light": (
        Field("position", "real4", "at a point: xyz in camera space; parallel: unit vector towards it, w: see across"),
        Field("axis", "real4", "spot, lambert: unit vector along which it points, w: cos(alpha2); parallel: u axis"),
        Field("across", "real4", "parallel: v axis; w: where these count from, 0: the eye, see Move in plan/lights.py"),
        Field("color", "float4", "rgb, linear; w: its kind, a number of LIGHT_KINDS"),
        Field("cone", "float4", "spot: x: alpha1, radians, y: 1 / (alpha2 - alpha1), 0 if equal; z: see phong()"),
    ),
    "Grid": (
        Field("right", "real4", "xyz: x axis; w, of a parallel light: what makes x count from the window's middle"),
        Field("up", "real4", "y axis, the same"),
        Field("ahead", "real4", "z axis"),
        *_fields("float4", "near_right near_up near_ahead", "these three axes in float"),
        Field("window", "float4", "x, y: half of its sides; z, w: columns and rows of cells in a unit of length"),
        Field("cells", "int4", "columns, rows on level 0; where its first cell is in start; a bit for each level used"),
        Field("flags", "int4", "x: whether float tells the cells apart"),
    ),
    "Map": (
        *_fields(
            "real4", "to_x to_y to_z", "xyz: the rows of K, which leads from the world to an ellipsoid's own axes"
        ),
        *_fields("real4", "from_x from_y from_z", "rows of its inverse; w of to_x, from_x: the sums of all magnitudes"),
        *_fields("real4", "rest_x rest_y rest_z", "what was cut off of the inverse"),
        *_fields("real4", "camera_x camera_y camera_z", "the rows of what leads from camera space to the own axes"),
    ),
    "Mesh": _fields(
        "real4", "normal_x normal_y normal_z", "xyz: the rows of what takes the object's normals to the world"
    ),
    # Places in trees are from the scene's middle, in the tree's unit.
    "Node": (
        *_fields("float8", "low_x high_x low_y high_y low_z high_z", "the boxes of 8 children"),
        Field("child", "int8", ">= 0: a node; < 0: ~ a leaf, a block or `blocks` + a patch. A missing one has no box"),
    ),
    "Block": (
        *_fields("float8", "x y z", "the centres of 8 spheres"),
        Field("outer", "float8", "radii that are surely too large; < 0 where there is no sphere"),
        Field("inner", "float8", "radii that are surely too small, at least 0"),
        Field("index", "int8", "which spheres these are"),
    ),
    "Patch": (
        *_fields("float8", "ax ay az", "the first corners A of 8 triangles"),
        *_fields("float8", "ex ey ez", "the edges B - A"),
        *_fields("float8", "fx fy fz", "the edges C - A"),
        Field("slack", "float8", "see triangle_add_leaf(); < 0 where there is no triangle"),
        Field("index", "int8", "which triangles these are, as primitives"),
    ),
}


@dataclass(frozen=True)
class Argument:
    """An argument of the kernel `render`, in the order of ARGUMENTS.

    kind: value (a scalar or a vector), buffer (read by the kernel), output (written, one record for each pixel) or note
    (numbers that are 0 at first, and that the kernel changes where it has found something);
    group: the struct of the kernel that holds it, "" for none; text: what it is; channels: numbers for each pixel of an
    output; needs: the flag without which the kernel has no such argument, "" for none. The group's member is there
    nevertheless, and 0 then.
    """

    name: str
    type: str
    kind: Kind
    group: str
    text: str
    channels: int = 1
    needs: str = ""

    @property
    def parameter(self) -> str:
        """How OpenCL C declares it."""
        pointer = {"value": "const {} {}", "buffer": "__global const {} *{}", "output": "__global {} *{}"}
        pointer["note"] = "volatile __global {} *{}"
        return pointer[self.kind].format(self.type, self.name)


def _arguments(kind: Kind, group: str, needs: str, *rows: tuple[Any, ...]) -> tuple[Argument, ...]:
    """Arguments that agree in this. rows: name, type and text of each, and the channels of an output of several."""
    return tuple(
        Argument(name, type_, kind, group, text, channels[0] if channels else 1, needs)
        for name, type_, text, *channels in rows
    )


_values, _buffers = partial(_arguments, "value"), partial(_arguments, "buffer")
_outputs, _notes = partial(_arguments, "output", "Outputs"), partial(_arguments, "note")


# What --stats counts, in the order of the last axis of the output `work`: the kernel's names, and words for a reader.
COUNTERS = {
    "SHADOW_RAYS": "shadow rays traced",
    "FACING_AWAY": "shadow rays to lights that shine on the other side or elsewhere",
    "UNSTOPPABLE": "shadow rays that no sphere can stop",
    "HIGHLIGHTS": "highlights computed",
    "FAINT_HIGHLIGHTS": "highlights too faint for a pixel",
    "FILTERED": "spheres that float32 rules out for a ray",
    "DECIDED": "spheres that are decided in full for a ray",
    "BACKGROUND": "rays through tiles of background only",
    "BOUNCES": "rays that mirrors and glass send on",
    "WEIGHTLESS": "points whose own colour has no weight",
    "TOTAL": "refracted rays that total reflection makes one with the mirrored ray",
    "DROPPED": "branches too faint for any output",
    "RETRACED": "pixels traced again, as what was dropped might show",
    "SAMPLED": "pixels that have all samples, as the rays through their corners do not agree",
}

# The kinds of lights that are traced, by their numbers <KIND>_LIGHT in kernels/lights.cl.
LIGHT_KINDS = ("parallel", "point", "spot", "lambert")


# The shapes, in the order of the surfaces' indices. Each has a flag WITH_<SHAPE>S and a folder in kernels/shapes/, with
# functions named after it; kernels/shapes/dispatch.cl lists them, and kinds.cl calls that of a surface.
SHAPES = ("sphere", "cylinder", "triangle")

ARGUMENTS = (
    # Not one struct: where functions hand that on, NVIDIA's compiler reads it from memory that is not there.
    *_values(
        "Frame",
        "",
        ("pixel", "real4", "x, y: half of a pixel's width and height at z = -1, or of parallel rays as lengths"),
        ("right", "real4", "xyz: the camera's x axis in the world"),
        ("up", "real4", "xyz: its y axis"),
        ("back", "real4", "xyz: its z axis, against the view"),
        ("background", "float4", "rgb, linear"),
        ("quantize", "float4", "x: what is added to 255 c before it is cut to a whole number: 0.5 or 0"),
    ),
    *_values(
        "",
        "",
        ("size", "int2", "pixels of the whole picture"),
        ("region", "int4", "x, y, width, height of the part that is wanted, in pixels; x and y are multiples of TILE"),
        ("row", "int", "row of the region at which this launch starts"),
        ("high", "int", "rows of packets that a work-item renders; launches have multiples of it"),
    ),
    *_values(
        "Outputs",
        "",
        ("pitch", "int", "pixels in a row of the outputs, which hold whole packets"),
        ("margin", "int2", "columns and rows before the first pixel that is wanted, as the region begins at a tile"),
    ),
    *_values(
        "Scene",
        "",
        ("lights", "int", "how many lights there are"),
        ("count", "int", "how many spheres there are"),
        ("unit", "real", "a power of two: a length of type real, times this, is in the float buffers' unit"),
        ("shading", "int", "whether colours are wanted"),
        ("more", "int", "whether there are outputs other than bytes"),
        ("shown", "int", "whether normals or places on textures are outputs"),
        ("mapped", "int", "whether the places of points on textures are needed"),
        ("textures", "int", "how many textures there are that a wanted colour may depend on"),
        ("started", "int", "whether `so_far` has colours of lights that have been added before"),
        ("materials", "int", "how many materials there are"),
    ),
    *_buffers(
        "Geometry",
        "",
        ("center_radius", "real4", "centre in camera space, radius"),
        ("power", "real2", "x: |centre|^2 - radius^2, made before the centre was rounded; y: 1 / radius"),
        ("world", "real4", "xyz: centre in the world, unrounded; w: what was cut off of power. Not in single"),
        ("camera", "real4", "xyz of four, in the world: the eye, the axes right, up and back. Not in single"),
    ),
    *_buffers(
        "Scene",
        "",
        ("id_of", "int", "a surface's number in the scene; a triangle has its mesh's"),
        ("material_of", "int", "the index in material of a surface's material"),
        ("material", "shade8", "ka La C (rgb), kd C (rgb), ks, exponent"),
        ("light", "Light", "in the order of LIGHT_KINDS"),
        ("eye_filter", "float4", "a sphere's filter constant for rays from the eye, see sphere_may_meet()"),
        ("light_filter", "float4", "for each light in turn, all spheres' filter constants, see sphere_filter_leaves()"),
        ("light_side", "char", "the same: whether the light is outside of the sphere (1), on it (0) or inside (-1)"),
        ("light_buffer", "int4", "x: index of a light's first grid, y: how many it has, z: see may_be_stopped()"),
    ),
    *_buffers(
        "Lists",
        "",
        ("grid", "Grid", "the picture's tiles, then the grids of the lights"),
        ("start", "int", "where a cell's list begins in entry; it ends where the next cell's list begins"),
        ("entry", "int2", "x: a sphere's index, y: the depth by which the list is sorted, as the bits of a float"),
    ),
    *_outputs(
        "",
        ("rgb8", "uchar", "linear colour in bytes, without gamma", 3),
        ("color", "float", "linear colour, not clamped", 3),
        ("normal", "float", "unit vector in the world, facing the camera, 0 = nothing", 3),
        ("direction", "float", "unit vector of the pixel's ray in the world", 3),
        ("depth", "real", "distance from the eye, or from the plane of an orthographic camera, infinite = nothing"),
        ("id", "int", "the surface's number in the scene, -1 = nothing"),
        ("primitive", "int", "a triangle's number within its mesh, -1 = a sphere or nothing"),
        ("uv", "float", "u, v: where the point is on a texture, 0 = nothing", 2),
        ("error", "float", "an estimate of the mean colour's error, in levels of 255"),
        ("coverage", "float", "the share of the pixel that surfaces cover"),
        ("shadow_rays", "int", "to how many lights a shadow ray was sent"),
        ("work", "int", "how often the pixel did what COUNTERS names", len(COUNTERS)),
    ),
    # In single, all places in the world are from the scene's middle.
    *_buffers("Geometry", "WITH_LEAVING", ("place", "real4", "a sphere's centre in the world; radius")),
    *_values("Geometry", "WITH_SHAPES", ("eye", "real4", "xyz: the eye in the world")),
    *_values("Geometry", "WITH_PARALLEL_RAYS", ("ahead", "real4", "xyz: the direction of parallel rays, in the world")),
    *_values("Geometry", "WITH_ELLIPSOIDS", ("maps", "int", "how many maps there are")),
    *_buffers(
        "Geometry",
        "WITH_ELLIPSOIDS",
        ("map_of", "int", "of a sphere, which of the maps makes it an ellipsoid; 0: none"),
        ("map", "Map", "the first one is 1"),
    ),
    *_values(
        "Scene",
        "WITH_BOUNCES",
        ("bounces", "int", "up to which depth rays are sent on; the eye's have depth 0"),
        ("brightest", "real4", "rgb: more than anything in the scene shows, in units of a sum, 2^-40; w: the largest"),
        ("faint", "real", "branches that add no more to a sum are dropped at first, in the same units; < 0: none are"),
        ("prove", "int", "whether `color` must not depend on what is dropped; bytes never do"),
    ),
    *_buffers("Scene", "WITH_BOUNCES", ("bounce", "real4", "of a material: reflectance, transmittance, index")),
    *_buffers(
        "Scene",
        "",
        ("texture_of", "int", "of a material, which texture its colour is multiplied with; -1: none"),
        ("texture", "int4", "x, y: its width and height; z: where in texel it begins; w: the number of a full colour"),
        ("texel", "uchar", "red, green, blue, row by row from the top; each takes two bytes if full is not 255"),
    ),
    *_values(
        "Tree",
        "WITH_BOUNCES",
        ("middle", "real4", "xyz: the scene's middle in the world; w: the tree's units in a length of type real"),
        ("widen", "float", "what outer and inner radii of blocks differ from the radius by"),
        ("blocks", "int", "how many blocks there are"),
    ),
    *_buffers(
        "Tree",
        "WITH_BOUNCES",
        ("node", "Node", "the tree of boxes that rays from surfaces walk through; the first one is its root"),
        ("block", "Block", "its leaves of spheres"),
    ),
    *_buffers("Scene", "WITH_PLACED", ("lamp", "real4", "xyz: a light in the world, or the way to a parallel one")),
    *_values("Geometry", "WITH_CYLINDERS", ("first_cylinder", "int", "the index of the first cylinder as a surface")),
    *_buffers(
        "Geometry",
        "WITH_CYLINDERS",
        # In single the second one is the axis, of length 1, and w is its length.
        ("cylinder", "real4", "two each: xyz: the middle of its start, w: its radius; xyz: that of its end"),
    ),
    *_values("Scene", "WITH_CYLINDERS", ("cylinders", "int", "how many cylinders there are")),
    *_buffers(
        "Scene",
        "WITH_CYLINDERS",
        ("cylinder_side", "char", "for each light in turn, on which side of each cylinder it is, as light_side"),
        # In camera space and the float buffers' unit.
        ("cylinder_seen", "float4", "two each: xyz: its middle, w: half of its length; xyz: its axis, w: its radius"),
    ),
    *_values("Geometry", "WITH_PLANES", ("planes", "int", "how many planes clip the scene")),
    *_buffers(
        "Geometry",
        "WITH_PLANES",
        # The material is an index, -1: that of what a cap closes. The normal leads to the kept side.
        ("clip", "real4", "two for each plane, in the world: xyz: a point, w: its caps' material; xyz: its normal"),
    ),
    *_values(
        "Scene",
        "WITH_PLANES",
        ("surfaces", "int", "how many surfaces there are"),
        ("solids", "int", "how many closed meshes the planes clip"),
        ("unclipped", "int", "whether there are surfaces that the planes do not clip"),
    ),
    # -1: the planes do not clip it; 0: it belongs to no closed mesh.
    *_buffers("Scene", "WITH_PLANES", ("solid_of", "int", "of a surface, the number of its closed mesh, 0 or -1")),
    *_values("Scene", "WITH_TRIANGLES", ("patches", "int", "how many patches there are")),
    *_buffers("Scene", "WITH_TRIANGLES", ("patch", "Patch", "the tree's leaves of triangles")),
    *_values("Geometry", "WITH_TRIANGLES", ("first_triangle", "int", "the index of the first triangle as a surface")),
    *_buffers(
        "Geometry",
        "WITH_TRIANGLES",
        ("vertex", "real4", "corners of triangles in the world"),
        ("face", "int4", "xyz: a triangle's corners A, B, C; w: twice its mesh, plus 1 where N points to its back"),
    ),
    # 0: none is known, see note_plane().
    *_notes("Geometry", "WITH_TRIANGLES", ("plane", "int", "1 plus a triangle before this one in the same plane")),
    *_values(
        "Scene",
        "WITH_TRIANGLES",
        ("triangles", "int", "how many triangles there are"),
    ),
    *_buffers(
        "Scene",
        "WITH_TRIANGLES",
        ("facet", "float4", "three for each triangle, as the eye sees it: see sides_of()"),
        ("light_facet", "float4", "for each light in turn, the same for all triangles as the light sees them"),
        ("number_of", "int", "a triangle's number within its mesh"),
        ("mesh", "Mesh", "what the triangles of a mesh have in common"),
        ("corner_normal", "real4", "xyz: normals of corners, in the objects' spaces, 1 in size at most in single"),
        ("normal_face", "int4", "xyz: which normals a triangle's corners have; w: its mesh, -1: they have none"),
        ("corner_uv", "real2", "texture coordinates of corners"),
        ("uv_face", "int4", "xyz: which of these a triangle's corners have; w: -1: none"),
    ),
    *_notes("Geometry", "IN_STAGES", ("undecided", "uchar", "whether any pixel is left to the second program; which")),
    *_values("Scene", "WITH_TRIANGLES", ("proved", "int", "of how many lights `unstoppable` is known")),
    # For each light in turn, with the bits of 32 triangles in a number.
    *_buffers("Scene", "WITH_TRIANGLES", ("unstoppable", "int", "a bit for each triangle, see unstoppable.cl")),
    *_values(
        "Scene",
        "WITH_SAMPLES",
        ("lattice", "int2", "x: log2 of N, the rays of a pixel where few do not agree; y: which lattice, see LATTICES"),
        ("scatter", "float", "what a mean over them is off by at most, mostly, for each 1 by which they differ"),
        ("centres", "int", "whether rays through pixels' centres are traced, too, for other outputs than means"),
    ),
    *_notes("Outputs", "", ("so_far", "shade4", "rgb: a pixel's colour in the lights so far, not clamped")),
    # A pixel is W times its packet's number in the picture, row by row, plus its lane. The kernel writes one of more
    # than MOST_RAYS rays, and the host a number below 0 where it wants no more.
    *_notes("Scene", "", ("last", "int", "the last pixel that is wanted")),
)
OUTPUTS = {a.name: a for a in ARGUMENTS if a.kind == "output"}
# The outputs that show something of the picture; the other ones count what was done for it.
PICTURES = tuple(name for name in OUTPUTS if name not in ("shadow_rays", "work"))

# Numbers that both sides rely on. A comment that proves something from one of them names it in brackets with its value,
# such as [TILE = 4], and a test compares the two.
CONSTANTS = {
    "TILE": 4,  # pixels in the side of a cell of the picture's finest tiles, and in a packet's row
    "AHEAD": 8,  # entries that the kernel looks at to fetch their spheres ahead, even beyond the end of the last list
    "FILTER_ROUNDINGS": 11,  # by so many times 2^-24, float32 filters of rays from a fixed point are made wider
    "DISC_ROUNDINGS": 8,  # the same for discs across a parallel light
    "FACET_ROUNDINGS": 6,  # the same for the planes of triangles' edges
    "SQUARE": 8,  # texels in the side of a square of which it is known whether it is uneven
    "MOST_RAYS": MAX_RAYS,  # a pixel that takes more is given up
    "WIDEN": 24,  # the same for spheres as seen from anywhere: 2^-24 of the scene's size
    "SIGNED_FULL": SIGNED_FULL,  # a full colour in textures that may go below 0, where each number is larger by as much
    "EDGE_ROUNDINGS": 40,  # the same for triangles as seen from anywhere: 2^-24 of the lengths of two edges
}

# The flags of a program for surfaces of every shape.
EVERY_SHAPE = (*(f"WITH_{shape.upper()}S" for shape in SHAPES), "WITH_ELLIPSOIDS", "WITH_SHAPES", "WITH_PLACED")

# The -D flags without a value. Each is set if the scene, the outputs or the device need it.
FLAGS = {
    "NO_FMA": "this driver's fma() is a slow call of a function: multiply and add instead",
    "IN_STAGES": "two programs draw a picture: the second one what the first one has marked as undecided",
    "WITHOUT_RARE": "this is the first one, which decides what double is sure of",
    "WITH_FILTER": "a float32 test with a proved bound goes before each decision",
    "WITH_EXTRAS": "outputs beside bytes, planes, an eye inside of a surface, or several passes",
    "WITH_PREFETCH": "there are so many surfaces that a cache holds few of them",
    "WITH_TEXTURES": "some surface has a texture, and WITH_EXTRAS, which includes textures, is not set",
    "WITH_PARALLEL_RAYS": "the camera's rays are parallel",
    "WITH_INSIDE": "the eye may be inside of a sphere or on it",
    "WITH_POINTS": "lights at points are possible: with parallel ones alone, frames take 0.94 of the time",
    "WITH_ELLIPSOIDS": "there are ellipsoids",
    "WITH_SHAPES": "there is more than spheres",
    "WITH_PLACED": "some shape is decided in the world",
    "WITH_LEAVING": "some rays are decided that may start anywhere: those from surfaces, and all that meet ellipsoids",
    "WITH_BOUNCES": "something mirrors or is transparent",
    "WITH_RAYS": "the program is that of kernels/rays.cl: arrays of rays, of which the host decides those it marks",
    "WITH_WHOLE": "that program has whole numbers for triangles, which take as long to compile as all the rest",
    **{f"WITH_{shape.upper()}S": f"there are {shape}s" for shape in SHAPES},
    "WITH_GLASS": "something is transparent",
    "WITH_SPLITS": "something mirrors and is transparent, so that a pixel may take many rays",
    "WITH_PLANES": "planes clip the scene",
    "WITH_TREE": "rays from surfaces walk through a tree",
    "WITH_SAMPLES": "colours are means over pixels, of rays at fixed places",
    "KEEP_HIGHLIGHTS": "highlights that no pixel shows are computed, too",
    "KEEP_WEIGHTLESS": "colours of no weight are computed, too",
    "OUT_WORK": "write what is counted",
}


def real_dtype(precision: Precision) -> np.dtype[Any]:
    """The dtype that hits and shadows are decided in: `real` of the kernel."""
    return np.dtype("f4" if precision == "single" else "f8")


def shade_dtype(precision: Precision) -> np.dtype[Any]:
    """The dtype that colours are computed in: `shade` of the table, SHADE of the kernel."""
    return np.dtype("f8" if precision == "double" else "f4")


@cache
def dtype_of(type_: str, precision: Precision) -> np.dtype[Any]:
    """The numpy dtype of a type of this table: with a shape for a vector type, with fields for a struct."""
    if type_ in STRUCTS:
        return np.dtype([(f.name, *_scalar_and_width(f.type, precision)) for f in STRUCTS[type_]])
    scalar, width = _scalar_and_width(type_, precision)
    return np.dtype((scalar, width)) if width > 1 else scalar


def _scalar_and_width(type_: str, precision: Precision) -> tuple[np.dtype[Any], int]:
    name, width = re.fullmatch(r"([a-z]+)(\d*)", type_).groups()  # type: ignore[union-attr]
    scalars = {"float": "f4", "int": "i4", "char": "i1", "uchar": "u1"}
    scalar = {"real": real_dtype(precision), "shade": shade_dtype(precision)}.get(name)
    return (np.dtype(scalars[name]) if scalar is None else scalar), int(width or 1)


def arguments_of(features: frozenset[str]) -> list[Argument]:
    """The arguments, in their order, of a kernel that is built with these flags."""
    return [a for a in ARGUMENTS if not a.needs or a.needs in features]

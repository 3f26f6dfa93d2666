"""A ScenePacking: what no camera changes of a scene, as arrays in the order in which they are packed."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import joined
from cltrace.plan.accel.tree import NO_PATHS, Paths
from cltrace.plan.lights import useful_lights
from cltrace.plan.materials import NO_BOUNCES, NO_TEXTURES, Bounces, Materials, brightest, packed_textures
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Ints
from cltrace.plan.shapes.cylinder import CylinderPacking
from cltrace.plan.shapes.mesh import MeshPacking
from cltrace.plan.shapes.shape import Arrays, ShapePacking, share
from cltrace.plan.shapes.sphere import SpherePacking
from cltrace.scene import AMBIENT, Scene, Vector

S = TypeVar("S")

# A row for each shape. Surfaces are in this order wherever there is one list of all of them. Triangles are last, as the
# kernel, and what is held on a device, tell them by the first one's index.
SHAPES: tuple[type[ShapePacking], ...] = (SpherePacking, CylinderPacking, MeshPacking)


@dataclass(frozen=True, eq=False)
class Clipping:
    """The planes that clip a world, k of them, of which a surface may be left alone: see kernels/find/range.cl.

    point, normal: (k, 3), in the world; a normal leads to the kept side, and its largest coordinate is in [1, 2);
    material: (k,), the index of the caps' material, -1 for that of the surface that a cap closes; solid_of: (n,),
    abi's; solids: how many closed meshes there are.
    """

    point: Array
    normal: Array
    material: Ints
    solid_of: Ints
    solids: int

    def __bool__(self) -> bool:
        """Whether there are any planes."""
        return len(self.point) > 0

    @classmethod
    def of(cls, scene: Scene, shapes: Sequence[ShapePacking]) -> Clipping:
        planes, solid_of = scene.planes, np.zeros(0, np.int32)
        if len(planes):
            solid_of = np.concatenate([shape.solid_of(scene) for shape in shapes]).astype(np.int32)
        _, exponent = np.frexp(np.abs(planes["normal"]).max(axis=1))
        normal = -np.ldexp(planes["normal"], 1 - exponent[:, None])
        return cls(planes["point"], normal, planes["material"], solid_of, int(solid_of.max(initial=0)))

    def arrays(self, real: np.dtype[Any], exponent: int | None, paths: Paths) -> Arrays:
        """The kernel's buffers by name. exponent: of the float buffers, where `real` is float; else None."""
        planes = np.zeros((len(self.point), 2, 4), real)
        planes[:, 0, :3], planes[:, 0, 3] = paths.moved(self.point, exponent), self.material
        planes[:, 1, :3] = self.normal
        return {"clip": planes.reshape(-1, 4), "solid_of": self.solid_of}

    def values(self) -> dict[str, Any]:
        """The kernel's arguments by name."""
        return {
            "planes": len(self.point),
            "surfaces": len(self.solid_of),
            "solids": self.solids,
            "unclipped": int((self.solid_of < 0).any()),
        }


@dataclass(frozen=True)
class ScenePacking:
    """What no camera changes: n surfaces, their materials and the lights, for one precision.

    shapes: the surfaces of each of SHAPES, in that order; id: (n,), the number of each one in the scene, where a
    triangle has its mesh's; material_of: (n,), the index of each one's material in materials; textures: the buffers of
    packed_textures(); lights: (m,) of the scene's lamps, those that can add to a colour, in the order of LIGHT_KINDS;
    soft: whether any light is soft, and so stands for many; bounces: what surfaces do with rays; clipping: the planes
    that clip them; paths: for rays that may start anywhere, NO_PATHS if there are none; background: linear (r, g, b);
    peak: (3,), brightest() where a ray may become two, else 0; skipped: what the scene does not need, in words, and how
    often; seconds: what took how long: "tree".
    """

    shapes: tuple[ShapePacking, ...]
    id: Ints
    material_of: Ints
    materials: Materials
    textures: Arrays
    lights: NDArray[np.void]
    soft: bool
    bounces: Bounces
    clipping: Clipping
    paths: Paths
    background: Vector
    peak: Array
    skipped: dict[str, int]
    seconds: dict[str, float]

    def of_shape(self, kind: type[S]) -> S:
        """Its surfaces of one of SHAPES, for who packs that one alone."""
        return next(shape for shape in self.shapes if isinstance(shape, kind))

    @property
    def placed(self) -> Iterator[tuple[int, ShapePacking]]:
        """The index of each shape's first surface, and the shape."""
        return zip(accumulate((len(shape.number) for shape in self.shapes), initial=0), self.shapes, strict=False)

    @classmethod
    def of(cls, scene: Scene, request: Request, before: Before | None = None) -> ScenePacking:
        """The world of a scene. Many surfaces are sorted by place, so that neighbours are near each other in memory.

        before: a world of another scene with as many meshes, for the same request; it says what is kept, which besides
        is the spheres' order, if it is still good.
        """
        old = before.world.shapes if before else (None,) * len(SHAPES)
        known = [(before.scene, shape) if before and shape else None for shape in old]
        shapes = tuple(row.of(scene, request, one) for row, one in zip(SHAPES, known, strict=True))
        # The number and the place of each surface are those that they were.
        same = before.world if before and all(a is b for a, b in zip(shapes, old, strict=True)) else None
        same = same if before and before.scene.planes is scene.planes else None
        materials, of = _materials(scene, request, shapes, before)
        lights = useful_lights(scene.lamps, materials.reflect(of), "lights" in request.keep)
        useless = int((scene.lamps["kind"] != AMBIENT).sum()) - len(lights)
        skipped = {f"{shape.words} equal to others": shape.left_out for shape in shapes if shape.left_out}
        bounces, textures, peak = NO_BOUNCES, NO_TEXTURES, np.zeros(3)
        if request.needs_colors:
            bounces = Bounces.of(materials.bounce, of, "bounces" in request.keep)
            textures = packed_textures(scene.textures, materials.texture, of, squares=request.means)
        if bounces.splits:
            peak = brightest(materials, of, lights, scene.background)
        paths, seconds = NO_PATHS, dict[str, float]()
        if same and same.bounces.any == bounces.any:
            paths = same.paths
        elif len(of) and (bounces.any or len(scene.planes) or any(shape.leave for shape in shapes)):
            with timed(seconds, "tree"):
                paths = paths_of(shapes, tree=bounces.any)
        return cls(
            shapes=shapes,
            id=same.id if same else joined([shape.number for shape in shapes]),
            material_of=of,
            materials=materials,
            textures=textures,
            lights=lights,
            soft=scene.lamps is not scene.lights,
            bounces=bounces,
            clipping=same.clipping if same else Clipping.of(scene, shapes),
            paths=paths,
            background=scene.background,
            peak=peak,
            skipped=skipped | ({"lights that add nothing": useless} if useless else {}),
            seconds=seconds,
        )

    def differs_in_materials(self, other: ScenePacking) -> bool:
        """Whether all that a CameraView shows of one is what it shows of the other, but for colours and
        coefficients."""
        return (
            all(one is another for one, another in zip(self.shapes, other.shapes, strict=True))
            and self.id is other.id
            and self.paths is other.paths
            and self.clipping is other.clipping
            and self.lights.tobytes() == other.lights.tobytes()
            and (self.bounces.any, self.bounces.glass) == (other.bounces.any, other.bounces.glass)
        )


def paths_of(shapes: Sequence[ShapePacking], tree: bool = True, room: float = 1.0) -> Paths:
    """The paths among the surfaces of all shapes. tree: whether rays leave any of them; room: of Paths.of()."""
    names = {name for shape in shapes for name in shape.tree}
    parts = {name: joined([shape.tree[name] for shape in shapes if name in shape.tree]) for name in names}
    return Paths.of(**parts if tree else parts | {"member": None}, room=room)


class Before(NamedTuple):
    """A scene and its world, of which the world of another scene keeps what both have in common.

    The one rule: a part of a world is kept where all that it is made from is the same objects for both, be it arrays of
    the scenes or other parts of the worlds. The arrays of scenes are read-only, so that the same object has the same
    numbers. Equal arrays that are two objects are not looked for.
    """

    scene: Scene
    world: ScenePacking


def _materials(
    scene: Scene, request: Request, shapes: tuple[ShapePacking, ...], before: Before | None
) -> tuple[Materials, Ints]:
    """The materials, and the index of that of each surface.

    Where most spheres have a material of their own, those are in the spheres' order, too. before: see
    ScenePacking.of().
    """
    if before and share(before.scene, scene, "columns.shade", "columns.material", "columns.rest"):
        world = before.world
        if all(one.row is another.row for one, another in zip(shapes, world.shapes, strict=True)):
            return world.materials, world.material_of
    of = joined([shape.material(scene) for shape in shapes])
    if scene.columns.materials_count > len(of) // 2 and not scene.meshes and not len(scene.planes):
        return Materials.of(scene, request, of), np.arange(len(of), dtype=np.int32)
    return Materials.of(scene, request, None), of


@contextmanager
def timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[name] = seconds.get(name, 0.0) + time.perf_counter() - start

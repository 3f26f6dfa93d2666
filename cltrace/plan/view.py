"""A CameraView: a world as one camera sees it, in camera space, and the lists of what its rays can meet."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import real_dtype
from cltrace.plan.accel.grids import CellGrid, PictureWindow, build
from cltrace.plan.accel.tree import NO_PATHS
from cltrace.plan.lights import Lamp, Move, are_at_points, dim_highlights, kinds, lamp_places, pack_lights
from cltrace.plan.lists import Grids
from cltrace.plan.request import Region, Request
from cltrace.plan.rounding import Array
from cltrace.plan.shapes.shape import Arrays, InView, ShapePacking
from cltrace.plan.shapes.sphere import exponent, in_camera_space
from cltrace.plan.world import ScenePacking, timed
from cltrace.scene import AnyCamera


@dataclass(frozen=True)
class CameraView:
    """A world as one camera sees it.

    region: (x, y, width, height), the part of the picture that is wanted, in pixels; exponent: the kernel's depths are
    in units of 2^exponent scene units; arrays: the kernel's buffers by name, with the dtypes of abi.ARGUMENTS, none of
    them empty; values: those of its other arguments that depend on no output; inside: whether the eye is inside of a
    sphere or on it; skipped: of ScenePacking, and what this camera does not need; seconds: what took how long: "lists";
    lit: which of the arrays have rows for each light in turn.
    """

    camera: AnyCamera
    region: Region
    exponent: int
    arrays: Arrays
    values: dict[str, Any]
    inside: bool
    skipped: dict[str, int]
    seconds: dict[str, float]
    lit: frozenset[str] = frozenset()

    @classmethod
    def of(cls, world: ScenePacking, camera: AnyCamera, request: Request, methods: Methods | None = None) -> CameraView:
        """Moves the world into camera space, in more than double precision, and lists which surfaces a ray can meet.

        request: the one that the world was made for; methods: for what takes longest, None for numpy's. Raises
        ValueError if its crop is not within the picture.
        """
        methods = methods or Methods(
            lambda shape, *how: shape.in_view(*how), lambda grids: build(grids, request.precision)
        )
        shapes = [methods.in_view(shape, camera, first) for first, shape in world.placed]
        lengths = [part for shape in shapes for part in shape.lengths()]
        k = exponent_of(world, camera, lengths)
        base = cls.without_lists(world, camera, request, k)
        lights = [*map(Lamp, world.lights, base.arrays["light"])]
        known = methods.known(k)
        lights = lights[len(known.light) :] if known else lights
        sights = [shape.see(k, lights, request) for shape in shapes]
        arrays = {name: array for sight in sights for name, array in sight.arrays.items()}
        lit = {name: array for sight in sights for name, array in sight.lit.items()}
        seconds: dict[str, float] = {}
        with timed(seconds, "lists"):
            grids = Grids(world, sights, lights, request)
            arrays |= lit | methods.build(grids.made(PictureWindow.of(camera, request, k)))
            arrays["light_buffer"] = grids.light_buffer
        if known:
            arrays |= known.before(arrays, base.arrays["light"], Move.of(known.camera, camera, base.values["unit"]))
        return replace(
            base,
            arrays=base.arrays | _not_empty(arrays),
            inside=any(bool(sight.eye.inside.any()) for sight in sights),
            skipped=base.skipped | grids.skipped,
            seconds=seconds,
            lit=frozenset(lit),
        )

    def recolored(self, world: ScenePacking, request: Request) -> CameraView:
        """The same view of a world that differs_in_materials() from the one that was seen."""
        lights = self.arrays["light"].copy()
        dim_highlights(lights[: len(world.lights)], world.lights, request.precision, _brightest(world, self.camera))
        values = self.values | {"materials": len(world.materials.packed)}
        return replace(self, arrays=self.arrays | _not_empty(_shades(world) | {"light": lights}), values=values)

    @classmethod
    def without_lists(cls, world: ScenePacking, camera: AnyCamera, request: Request, k: int) -> CameraView:
        """All of a view but how surfaces are seen from the eye and the lights, and the lists of them.

        k: lengths in scene units, times 2^k, are in the float buffers' unit. Raises ValueError as of() does.
        """
        real, basis = real_dtype(request.precision), np.array(camera.basis())
        # float32 has little room for squares. So lengths in float32 are multiplied by a power of two that makes the
        # largest coordinate about 1. Times another power of two, a scene is then the same numbers there. Double has
        # room for the fourth power of every float32 number, and keeps scene units.
        exponent, unit = (k, 0) if real.itemsize == 4 else (None, k)
        place = np.array([(*vector, 0.0) for vector in (camera.position, *camera.basis())], real)
        lights = in_camera_space(camera, world.lights["position"]) * (1 if exponent is None else 2.0**k)
        lamp = np.zeros((len(world.lights), 4), real)
        # Without paths nobody reads places in the world, and the scene's middle is not known.
        placed = None if world.paths is NO_PATHS else exponent
        lamp[:, :3] = lamp_places(world.lights, world.paths.middle, placed)
        arrays = {
            "id_of": world.id,
            "light": pack_lights(world.lights, lights, basis, request.precision, _brightest(world, camera)),
            "unstoppable": np.zeros(0, np.int32),  # not known before it is worth while: see run/unstoppable.py
            "camera": place[:0] if exponent is not None else place,
            "lamp": lamp,
            **world.paths.arrays(),
        }
        arrays |= _shades(world) | world.clipping.arrays(real, placed, world.paths)
        values = {
            "lights": len(world.lights),
            "materials": len(world.materials.packed),
            "unit": math.ldexp(1.0, unit),
            "proved": 0,
            "bounces": camera.max_bounces,
            "ahead": (*(-basis[2]).tolist(), 0.0),
            **world.clipping.values(),
            **world.paths.values(camera, exponent),
        }
        for first, shape in world.placed:
            arrays |= shape.packed(real, exponent, basis, world.paths)
            values |= shape.values(first)
        region, depths = request.region_of(camera.resolution), 0 if exponent is None else -k
        return cls(camera, region, depths, _not_empty(arrays), values, False, dict(world.skipped), {})


def exponent_of(world: ScenePacking, camera: AnyCamera, lengths: Sequence[Array], least: float = 0.0) -> int:
    """The k for which 2^k times the largest length of a view is in [1/2, 1).

    lengths: coordinates and radii of surfaces, in camera space; least: the largest one of those that are not there.
    """
    points = in_camera_space(camera, world.lights["position"])[are_at_points(kinds(world.lights))]
    plane = max(camera.image_plane()) if camera.parallel else 0.0
    return exponent([*lengths, points], max(plane, least))


def _brightest(world: ScenePacking, camera: AnyCamera) -> float:
    """The largest ks of any material, times what all rays of a pixel together may weigh."""
    return world.materials.brightest * world.bounces.growth(camera.max_bounces)


def _shades(world: ScenePacking) -> Arrays:
    """The buffers of materials and textures."""
    packed = {"material_of": world.material_of, "material": world.materials.packed, "bounce": world.materials.bounce}
    return packed | world.textures


def _not_empty(arrays: Arrays) -> Arrays:
    """These arrays, those that are empty with one element: no buffer is empty."""
    return {name: a if len(a) else np.zeros((1, *a.shape[1:]), a.dtype) for name, a in arrays.items()}


@dataclass(frozen=True)
class KeptLights:
    """What some lights of a world see, which cameras that agree in `key` have in common.

    camera, light: that of which it was made, and the lights' records; light_buffer: abi's, which counts these lights'
    grids from 0; grids: of the lights in turn; listed, lists: where their lists are on a device; lit, buffers: what has
    rows for each light, of Sights, and on the device; idle: how many surfaces are in none of the lists, in all.
    """

    key: tuple[Any, ...]
    camera: AnyCamera
    light: NDArray[np.void]
    light_buffer: NDArray[np.int32]
    grids: list[CellGrid]
    listed: list[Any]
    lists: Any
    lit: Arrays
    buffers: dict[str, Any]
    idle: int = 0

    def before(self, arrays: Arrays, light: NDArray[np.void], move: Move) -> Arrays:
        """A view's arrays with the rows of these lights, to which `arrays` has those of the others.

        light: the records of all of the view's lights; move: to its camera.
        """
        rows = {name: np.concatenate([a, arrays[name]]) for name, a in self.lit.items() if name in arrays}
        further = np.array([len(arrays["grid"]) - len(self.grids), 0, 0, 0], np.int32)
        rows["light_buffer"] = np.concatenate([self.light_buffer + further, arrays["light_buffer"]])
        return rows | {"light": move.lights(light, self.light)}


class Methods(NamedTuple):
    """How CameraView.of() makes what takes longest. Arrays that are kept elsewhere, their dicts lack.

    in_view: what Shape.in_view() makes; build: makes the lists of grids, see Lists, and adds those that are known. Each
    grid is made when it is asked for. known: what is known where lengths in scene units are multiplied by 2^k.
    """

    in_view: Callable[[ShapePacking, AnyCamera, int], InView]
    build: Callable[[Iterator[CellGrid]], Arrays]
    known: Callable[[int], KeptLights | None] = lambda k: None

"""What a shape is to the host: a row of SHAPES in world.py, of which ScenePacking, CameraView and the lists know this
alone."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.accel.silhouettes import Silhouettes
from cltrace.plan.accel.tree import Paths
from cltrace.plan.lights import Lamp
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Ints, Mask
from cltrace.scene import AnyCamera, Scene

Arrays = dict[str, NDArray[Any]]


def share(old: Scene, new: Scene, *names: str) -> bool:
    """Whether two scenes have the same objects by these names, which may have dots."""
    return all(get(old) is get(new) for get in map(attrgetter, names))


class Sights(NamedTuple):
    """The surfaces of one shape as the eye and the lights see them, in the float buffers' unit.

    arrays: the kernel's buffers by name; lit: those with rows for each light in turn; eye, lights: as seen from there.
    """

    arrays: Arrays
    lit: Arrays
    eye: Silhouettes
    lights: list[Silhouettes]


@dataclass
class InView(ABC):
    """The surfaces of one shape as a camera sees them. first: the index of the first one as a surface."""

    shape: ShapePacking
    camera: AnyCamera
    first: int

    @abstractmethod
    def lengths(self) -> Sequence[Array]:
        """Coordinates and radii, in scene units: the largest one of all shapes is to be about 1."""

    @abstractmethod
    def see(self, k: int, lights: list[Lamp], request: Request) -> Sights:
        """They in 2^-k scene units, which is the float buffers' unit."""


@dataclass(frozen=True, eq=False)
class ShapePacking(ABC):
    """All n surfaces of one shape in a world, in the order in which they are packed: what no camera changes.

    row: (n,), which one of the scene each one is, the same object as of another world if that has the same order;
    number: (n,), the number of each one's surface in the scene; flags: abi.FLAGS that the kernel has for them; tree:
    what Paths.of() wants of them, by name; leave: whether rays that meet some of them are decided as those that leave
    surfaces; words: what they are, for messages.
    """

    row: Ints
    number: Ints
    flags: tuple[str, ...]
    tree: dict[str, Any]
    leave: bool
    words: ClassVar[str]

    @classmethod
    @abstractmethod
    def of(cls, scene: Scene, request: Request, before: tuple[Scene, Self] | None) -> Self:
        """Those of a scene. before: another scene, and its surfaces, which are returned if they are the same ones."""

    @property
    def left_out(self) -> int:
        """How many of the scene's surfaces are left out or not visible, as they equal others."""
        return 0

    @property
    def visible(self) -> Mask:
        """(n,): which of them rays can meet."""
        return np.ones(len(self.number), bool)

    @abstractmethod
    def material(self, scene: Scene) -> Ints:
        """(n,): the index in the scene of each one's material."""

    @abstractmethod
    def solid_of(self, scene: Scene) -> Ints:
        """(n,): what abi.py has of that name, where planes clip the scene."""

    @property
    @abstractmethod
    def sizes(self) -> Array:
        """Radii and lengths, in scene units, that the bounds of errors of single rays depend on."""

    @abstractmethod
    def values(self, first: int) -> dict[str, Any]:
        """The kernel's arguments by name. first: the index of the first one as a surface."""

    @abstractmethod
    def packed(self, real: np.dtype[Any], exponent: int | None, basis: Array, paths: Paths) -> Arrays:
        """The kernel's buffers by name, but for those that depend on how the surfaces are seen.

        real: the dtype of hits; exponent: of the float buffers, where `real` is float, else None; basis: (3, 3), the
        camera's axes in the world; paths: of the world.
        """

    @abstractmethod
    def in_view(self, camera: AnyCamera, first: int) -> InView:
        """They as a camera sees them. first: as of values()."""

"""Where a scene was read from, so that what is said of it can name the lines of its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.scene.camera import Camera


class MeshFile(NamedTuple):
    """The file of a mesh: its name, as the scene has it, and (f,) int32, the line of each triangle's face."""

    name: str
    lines: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Source:
    """The file of a scene, and the lines of what it holds: 1 is the first, 0 is one that is not known.

    path: the file's name, as it was given; view: the camera of the file; camera: the line of <camera>; lights: (n,)
    int32, of each light; surfaces: (m,) int32, of each surface, by its number; meshes: the files of the meshes, by the
    numbers of these surfaces; textures: the files of the textures, in their order; transforms: (k, 3, 4), the affine
    maps of the k steps of a surface's transform, in the order of the file, by the surface's number: of the first
    surfaces that have one; files: what the scene is made of: its own file, and those of its meshes and textures; size:
    bytes of its own file and those of its meshes.
    """

    path: str
    view: Camera
    camera: int
    lights: NDArray[np.int32]
    surfaces: NDArray[np.int32]
    meshes: Mapping[int, MeshFile] = field(default_factory=dict)
    textures: tuple[str, ...] = ()
    transforms: Mapping[int, NDArray[np.float64]] = field(default_factory=dict)
    files: tuple[Path, ...] = ()
    size: int = 0

    @property
    def knows_all_lines(self) -> bool:
        """Whether no line is 0."""
        return self.camera > 0 and bool(self.lights.all()) and bool(self.surfaces.all())

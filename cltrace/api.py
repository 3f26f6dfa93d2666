"""What `import cltrace` offers."""

from __future__ import annotations

import os
import warnings

from cltrace.comparison.pictures import compare
from cltrace.comparison.record import Cause, Comparison
from cltrace.errors import (
    BuildError,
    CltraceError,
    DeviceError,
    MissingPackageError,
    SceneError,
    SceneWarning,
    TooManyRaysError,
    UsageError,
)
from cltrace.explanation.pixel import explain
from cltrace.explanation.record import Explanation
from cltrace.formats.xml_reader import read
from cltrace.lighting import lit
from cltrace.movie.animate import animate
from cltrace.movie.frames import orbit
from cltrace.picture.colorbar import colorbar
from cltrace.picture.image import Image
from cltrace.rays import Hits, trace_rays
from cltrace.renderer import Renderer, render
from cltrace.run.devices import Device, devices
from cltrace.scene import (
    Camera,
    Material,
    Mesh,
    Orthographic,
    Scene,
    ambient_light,
    parallel_light,
    point_light,
    spot_light,
)

__all__ = [
    "BuildError",
    "Camera",
    "Cause",
    "CltraceError",
    "Comparison",
    "Device",
    "DeviceError",
    "Explanation",
    "Hits",
    "Image",
    "Material",
    "Mesh",
    "MissingPackageError",
    "Orthographic",
    "Renderer",
    "Scene",
    "SceneError",
    "SceneWarning",
    "TooManyRaysError",
    "UsageError",
    "ambient_light",
    "animate",
    "colorbar",
    "compare",
    "devices",
    "explain",
    "lit",
    "load",
    "orbit",
    "parallel_light",
    "point_light",
    "render",
    "spot_light",
    "trace_rays",
]


def load(path: str | os.PathLike[str]) -> Scene:
    """Reads a scene file of the course's XML format.

    Raises SceneError with all faults of the file. What the file has and no picture shows is a SceneWarning.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"path: must be a str or a Path, got {path!r}")
    scene, ignored = read(path)
    for text in ignored:
        warnings.warn(text, SceneWarning, stacklevel=2)
    return scene

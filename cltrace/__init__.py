"""cltrace: a fast and accurate OpenCL ray tracer of the course's scene format.

import cltrace
image = cltrace.render(cltrace.load("scene.xml"))
image.save("scene.png")
"""

from __future__ import annotations

import os
import warnings

from . import caches as caches  # before anything imports pyopencl
from .device import Device, devices
from .errors import BuildError, CltraceError, DeviceError, SceneError, SceneWarning, UsageError
from .image import Image
from .reader import read
from .scene import Camera, Scene, ambient_light, parallel_light, point_light, spot_light
from .tracer import Renderer, render

__all__ = [
    "BuildError",
    "Camera",
    "CltraceError",
    "Device",
    "DeviceError",
    "Image",
    "Renderer",
    "Scene",
    "SceneError",
    "SceneWarning",
    "UsageError",
    "ambient_light",
    "devices",
    "load",
    "parallel_light",
    "point_light",
    "render",
    "spot_light",
]


def load(path: str | os.PathLike[str]) -> Scene:
    """Reads a scene file. Raises SceneError with all its faults; what it ignores is a SceneWarning."""
    scene, ignored = read(path)
    for text in ignored:
        warnings.warn(text, SceneWarning, stacklevel=2)
    return scene

"""cltrace: a fast and accurate OpenCL ray tracer of the course's scene format.

import cltrace
image = cltrace.render(cltrace.load("scene.xml"))
image.save("scene.png")
"""

from __future__ import annotations

import os
import warnings

from cltrace.errors import BuildError, CltraceError, DeviceError, SceneError, SceneWarning, UsageError
from cltrace.formats.xml_reader import read
from cltrace.picture.image import Image
from cltrace.renderer import Renderer, render
from cltrace.run import caches as caches  # before anything imports pyopencl
from cltrace.run.devices import Device, devices
from cltrace.scene import Camera, Scene, ambient_light, parallel_light, point_light, spot_light

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

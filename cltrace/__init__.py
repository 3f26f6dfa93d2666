"""cltrace: a fast and accurate OpenCL ray tracer of the course's scene format.

import cltrace
image = cltrace.render(cltrace.load("scene.xml"))
image.save("scene.png")

camera = cltrace.Camera(position=(0, 0, 9), lookat=(0, 0, 0), horizontal_fov=30, resolution=(800, 600))
lights = [cltrace.ambient_light(), cltrace.point_light((5, 8, 9))]
scene = cltrace.Scene.from_spheres(camera, lights, centers, radii, colors)  # arrays (n, 3), (n,), (n, 3)
image = cltrace.render(scene, outputs=("rgb8", "depth", "id"))
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

__version__ = "0.1.0"

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
    "__version__",
    "ambient_light",
    "devices",
    "load",
    "parallel_light",
    "point_light",
    "render",
    "spot_light",
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

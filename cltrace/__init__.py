"""cltrace: a fast and accurate OpenCL ray tracer of the course's scene format.

import cltrace
image = cltrace.render(cltrace.load("scene.xml"))
image.save("scene.png")

camera = cltrace.Camera(position=(0, 0, 9), lookat=(0, 0, 0), horizontal_fov=30, resolution=(800, 600))
lights = [cltrace.ambient_light(), cltrace.point_light((5, 8, 9))]
scene = cltrace.Scene.from_spheres(camera, lights, centers, radii, colors)  # arrays (n, 3), (n,), (n, 3)
scene = cltrace.Scene.from_meshes(camera, lights, [cltrace.Mesh(vertices, faces)])  # arrays (v, 3), (f, 3)
image = cltrace.render(scene, outputs=("rgb8", "depth", "id"))
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from cltrace.api import *  # noqa: F403
else:  # A type checker should not take this for a promise of any name.

    def __getattr__(name: str) -> Any:
        """A name of `cltrace.api`, which is imported when the first one is used.

        Numpy and OpenCL take a while to load. The command can be interrupted cleanly before that begins.
        """
        offered = vars(importlib.import_module("cltrace.api"))
        globals().update({key: offered[key] for key in ("__all__", *offered["__all__"])})
        if name not in globals():
            raise AttributeError(f"module 'cltrace' has no attribute {name!r}")
        return globals()[name]


def __dir__() -> list[str]:
    return sorted({*globals(), *importlib.import_module("cltrace.api").__all__})

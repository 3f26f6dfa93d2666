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

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from cltrace.api import *  # noqa: F403
else:  # A type checker should not take this for a promise of any name.

    def __getattr__(name: str) -> Any:
        """A name of `cltrace.api`, from its module, which is imported when the first one of it is used.

        All modules together take as long to load as numpy and OpenCL. The command can be interrupted cleanly before
        that begins.
        """
        if name == "__all__":
            return sorted(_modules())
        if name not in _modules():
            raise AttributeError(f"module 'cltrace' has no attribute {name!r}")
        found = globals()[name] = getattr(import_module(_modules()[name]), name)
        return found


@cache
def _modules() -> dict[str, str]:
    """The module of each name that `import cltrace` offers: what `cltrace.api` imports, which is read alone."""
    imports = ast.parse(Path(__file__).with_name("api.py").read_text("utf-8")).body
    parts = [part for part in imports if isinstance(part, ast.ImportFrom) and part.module != "__future__"]
    return {name.name: str(part.module) for part in parts for name in part.names}


def __dir__() -> list[str]:
    return sorted({*globals(), *_modules()})

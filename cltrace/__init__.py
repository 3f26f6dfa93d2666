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

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

# The names that `import cltrace` offers, by their modules; below, the same for type checkers and editors.
_NAMES = {
    "cltrace.base.errors": (
        "BuildError",
        "CltraceError",
        "DeviceError",
        "MissingPackageError",
        "SceneError",
        "SceneWarning",
        "TooManyRaysError",
        "TooSlowError",
        "UsageError",
    ),
    "cltrace.explanation.explanation": ("Explanation",),
    "cltrace.explanation.pixel": ("explain",),
    "cltrace.formats.reader": ("load",),
    "cltrace.movie.animate": ("animate",),
    "cltrace.movie.frames": ("orbit",),
    "cltrace.picture.palettes": ("colorbar",),
    "cltrace.picture.image": ("Image",),
    "cltrace.renderers.rays": ("Hits", "trace_rays"),
    "cltrace.renderers.renderer": ("Renderer", "render"),
    "cltrace.run.devices": ("Device", "devices"),
    "cltrace.scene": (
        "Camera",
        "Material",
        "Mesh",
        "Orthographic",
        "Scene",
        "ambient_light",
        "axes",
        "ball_light",
        "box_corners",
        "box_edges",
        "box_images",
        "panel_light",
        "parallel_light",
        "point_light",
        "sky_light",
        "spot_light",
        "sun_light",
    ),
    "cltrace.students.compare": ("compare",),
    "cltrace.students.comparison": ("Cause", "Comparison"),
    "cltrace.students.lit": ("lit",),
    "cltrace.viewer.view": ("view",),
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names}

if TYPE_CHECKING:
    from cltrace.base.errors import BuildError as BuildError
    from cltrace.base.errors import CltraceError as CltraceError
    from cltrace.base.errors import DeviceError as DeviceError
    from cltrace.base.errors import MissingPackageError as MissingPackageError
    from cltrace.base.errors import SceneError as SceneError
    from cltrace.base.errors import SceneWarning as SceneWarning
    from cltrace.base.errors import TooManyRaysError as TooManyRaysError
    from cltrace.base.errors import TooSlowError as TooSlowError
    from cltrace.base.errors import UsageError as UsageError
    from cltrace.explanation.explanation import Explanation as Explanation
    from cltrace.explanation.pixel import explain as explain
    from cltrace.formats.reader import load as load
    from cltrace.movie.animate import animate as animate
    from cltrace.movie.frames import orbit as orbit
    from cltrace.picture.image import Image as Image
    from cltrace.picture.palettes import colorbar as colorbar
    from cltrace.renderers.rays import Hits as Hits
    from cltrace.renderers.rays import trace_rays as trace_rays
    from cltrace.renderers.renderer import Renderer as Renderer
    from cltrace.renderers.renderer import render as render
    from cltrace.run.devices import Device as Device
    from cltrace.run.devices import devices as devices
    from cltrace.scene import Camera as Camera
    from cltrace.scene import Material as Material
    from cltrace.scene import Mesh as Mesh
    from cltrace.scene import Orthographic as Orthographic
    from cltrace.scene import Scene as Scene
    from cltrace.scene import ambient_light as ambient_light
    from cltrace.scene import axes as axes
    from cltrace.scene import ball_light as ball_light
    from cltrace.scene import box_corners as box_corners
    from cltrace.scene import box_edges as box_edges
    from cltrace.scene import box_images as box_images
    from cltrace.scene import panel_light as panel_light
    from cltrace.scene import parallel_light as parallel_light
    from cltrace.scene import point_light as point_light
    from cltrace.scene import sky_light as sky_light
    from cltrace.scene import spot_light as spot_light
    from cltrace.scene import sun_light as sun_light
    from cltrace.students.compare import compare as compare
    from cltrace.students.comparison import Cause as Cause
    from cltrace.students.comparison import Comparison as Comparison
    from cltrace.students.lit import lit as lit
    from cltrace.viewer.view import view as view
else:  # A type checker should not take this for a promise of any name.
    __all__ = sorted(_MODULE_OF)

    def __getattr__(name: str) -> Any:
        """A name of another module, which is imported when the first name of it is used.

        All modules together take as long to load as numpy and OpenCL. The command can be interrupted cleanly before
        that begins.
        """
        if name not in _MODULE_OF:
            raise AttributeError(f"module 'cltrace' has no attribute {name!r}")
        found = globals()[name] = getattr(import_module(_MODULE_OF[name]), name)
        return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULE_OF})

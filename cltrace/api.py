"""What `import cltrace` offers, and which module has it. Nothing is to be here but imports."""

from __future__ import annotations

from cltrace.base.errors import (
    BuildError,
    CltraceError,
    DeviceError,
    MissingPackageError,
    SceneError,
    SceneWarning,
    TooManyRaysError,
    TooSlowError,
    UsageError,
)
from cltrace.explanation.explanation import Explanation
from cltrace.explanation.pixel import explain
from cltrace.formats.xml_reader import load
from cltrace.movie.animate import animate
from cltrace.movie.frames import orbit
from cltrace.picture.colorbar import colorbar
from cltrace.picture.image import Image
from cltrace.rays import Hits, trace_rays
from cltrace.renderers.renderer import Renderer, render
from cltrace.run.devices import Device, devices
from cltrace.scene import (
    Camera,
    Material,
    Mesh,
    Orthographic,
    Scene,
    ambient_light,
    axes,
    ball_light,
    box_corners,
    box_edges,
    box_images,
    panel_light,
    parallel_light,
    point_light,
    sky_light,
    spot_light,
    sun_light,
)
from cltrace.students.compare import compare
from cltrace.students.comparison import Cause, Comparison
from cltrace.students.lit import lit
from cltrace.viewer.view import view

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
    "TooSlowError",
    "UsageError",
    "ambient_light",
    "animate",
    "axes",
    "ball_light",
    "box_corners",
    "box_edges",
    "box_images",
    "colorbar",
    "compare",
    "devices",
    "explain",
    "lit",
    "load",
    "orbit",
    "panel_light",
    "parallel_light",
    "point_light",
    "render",
    "sky_light",
    "spot_light",
    "sun_light",
    "trace_rays",
    "view",
]

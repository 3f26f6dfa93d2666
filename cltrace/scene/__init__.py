"""What a picture depends on, in world space: immutable, without files, bytes or devices."""

from cltrace.scene.boxes import axes, box_corners, box_edges, box_images
from cltrace.scene.camera import AnyCamera, Camera, Orthographic, check_resolution
from cltrace.scene.changes import with_spheres
from cltrace.scene.lights import (
    AMBIENT,
    BALL,
    LAMBERT,
    LIGHT,
    PANEL,
    PARALLEL,
    POINT,
    SKY,
    SOFT,
    SPOT,
    SUN,
    ambient_light,
    ball_light,
    panel_light,
    parallel_light,
    point_light,
    sky_light,
    spans_no_area,
    spot_light,
    sun_light,
)
from cltrace.scene.maps import uniform_scales
from cltrace.scene.materials import FULL, MATERIAL, SIGNED_FULL, Material, Texture, texels
from cltrace.scene.members import lamps_of, members_of
from cltrace.scene.meshes import Geometry, Mesh, PlacedMesh, place_faults
from cltrace.scene.rules import ANY, CONE, FOV, NOT_NEGATIVE, POSITIVE, Rule, Vector
from cltrace.scene.scene import Scene, share_all_but_camera
from cltrace.scene.shapes.cut import CUT
from cltrace.scene.shapes.cylinder import CYLINDER, Bonds
from cltrace.scene.shapes.table import OTHER_FIELDS
from cltrace.scene.source import MeshFile, Source
from cltrace.scene.surfaces import SPHERE, extent_faults, inverse_faults, reaches

__all__ = [
    "AMBIENT",
    "ANY",
    "BALL",
    "CONE",
    "CUT",
    "CYLINDER",
    "FOV",
    "FULL",
    "LAMBERT",
    "LIGHT",
    "MATERIAL",
    "NOT_NEGATIVE",
    "OTHER_FIELDS",
    "PANEL",
    "PARALLEL",
    "POINT",
    "POSITIVE",
    "SIGNED_FULL",
    "SKY",
    "SOFT",
    "SPHERE",
    "SPOT",
    "SUN",
    "AnyCamera",
    "Bonds",
    "Camera",
    "Geometry",
    "Material",
    "Mesh",
    "MeshFile",
    "Orthographic",
    "PlacedMesh",
    "Rule",
    "Scene",
    "Source",
    "Texture",
    "Vector",
    "ambient_light",
    "axes",
    "ball_light",
    "box_corners",
    "box_edges",
    "box_images",
    "check_resolution",
    "extent_faults",
    "inverse_faults",
    "lamps_of",
    "members_of",
    "panel_light",
    "parallel_light",
    "place_faults",
    "point_light",
    "reaches",
    "share_all_but_camera",
    "sky_light",
    "spans_no_area",
    "spot_light",
    "sun_light",
    "texels",
    "uniform_scales",
    "with_spheres",
]

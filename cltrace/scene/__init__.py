"""What a picture depends on, in world space: immutable, without files, bytes or devices."""

from cltrace.scene.camera import MAX_BOUNCES, AnyCamera, Camera, Orthographic, check_resolution
from cltrace.scene.changes import with_spheres
from cltrace.scene.cylinders import CYLINDER, MAX_CYLINDERS, Bonds, axes, box_corners, box_edges
from cltrace.scene.lights import (
    AMBIENT,
    LIGHT,
    MAX_LIGHTS,
    PARALLEL,
    POINT,
    SPOT,
    ambient_light,
    parallel_light,
    point_light,
    spot_light,
)
from cltrace.scene.maps import uniform_scales
from cltrace.scene.materials import MATERIAL, MAX_TEXELS, Material, Texture, texels
from cltrace.scene.meshes import MAX_MESHES, MAX_TRIANGLES, MAX_VERTICES, Geometry, Mesh, PlacedMesh, place_faults
from cltrace.scene.rules import ANY, CONE, FOV, NOT_NEGATIVE, POSITIVE, Rule, Vector
from cltrace.scene.scene import OTHERS, Scene, colors_given, share_all_but_camera
from cltrace.scene.source import MeshFile, Source
from cltrace.scene.surfaces import MAX_SPHERES, SPHERE, extent_faults, inverse_faults, reaches

__all__ = [
    "AMBIENT",
    "ANY",
    "CONE",
    "CYLINDER",
    "FOV",
    "LIGHT",
    "MATERIAL",
    "MAX_BOUNCES",
    "MAX_CYLINDERS",
    "MAX_LIGHTS",
    "MAX_MESHES",
    "MAX_SPHERES",
    "MAX_TEXELS",
    "MAX_TRIANGLES",
    "MAX_VERTICES",
    "NOT_NEGATIVE",
    "OTHERS",
    "PARALLEL",
    "POINT",
    "POSITIVE",
    "SPHERE",
    "SPOT",
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
    "box_corners",
    "box_edges",
    "check_resolution",
    "colors_given",
    "extent_faults",
    "inverse_faults",
    "parallel_light",
    "place_faults",
    "point_light",
    "reaches",
    "share_all_but_camera",
    "spot_light",
    "texels",
    "uniform_scales",
    "with_spheres",
]

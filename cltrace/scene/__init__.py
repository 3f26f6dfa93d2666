"""What a picture depends on, in world space: immutable, without files, bytes or devices."""

from cltrace.scene.camera import AnyCamera, Camera, Orthographic, check_resolution
from cltrace.scene.changes import with_spheres
from cltrace.scene.clipping import PLANE
from cltrace.scene.cylinders import CYLINDER, Bonds, axes, box_corners, box_edges, box_images
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
    lamps_of,
    members_of,
    panel_light,
    parallel_light,
    point_light,
    sky_light,
    spans_no_area,
    spot_light,
    sun_light,
)
from cltrace.scene.materials import FULL, MATERIAL, SIGNED_FULL, Material, Texture, texels
from cltrace.scene.meshes import Geometry, Mesh, PlacedMesh, place_faults
from cltrace.scene.rules import ANY, CONE, FOV, NOT_NEGATIVE, POSITIVE, Rule, Vector
from cltrace.scene.scene import OTHER_FIELDS, MeshFile, Scene, Source, share_all_but_camera
from cltrace.scene.spheres import SPHERE, extent_faults, inverse_faults, reaches, uniform_scales

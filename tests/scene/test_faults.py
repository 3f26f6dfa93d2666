"""What scenes, cameras, lights, meshes and materials refuse: each fault names the argument and the place in it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace as Thing
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import LogNorm

import cltrace
from cltrace import Camera, Material, Mesh, Orthographic, Scene
from cltrace.scene import MATERIAL, PLANE, SPHERE, Geometry, PlacedMesh, materials, meshes, texels

V = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1.0)])
F = [(0, 1, 2), (0, 2, 3)]
RED, BLUE, TEXTURE = (1, 0, 0), (0, 0, 1), np.zeros((2, 2, 3), np.uint8)
MASKED = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])
NO_BYTES = "must be linear with 1 as full, but whole numbers up to"
FAR = "must not exceed 3.4e38 in magnitude, got"
PIXELS = "must be within 1..65536 each and 1073741824 pixels, got"
Call = Callable[[], object]


def build(**changed: Any) -> Scene:
    given = {"camera": Camera(), "lights": [], "centers": [(0, 0, -3), (1, 0, -3)], "radii": 0.5}
    return Scene.from_spheres(**given | changed)


def placed(*meshes: Any, textures: Any = (), texture: int = -1) -> Scene:
    shade = np.zeros(1, MATERIAL)
    shade["texture"] = texture
    return Scene(Camera(), [], np.zeros(0, SPHERE), shade, meshes=meshes, textures=textures)


def planes(count: int = 1, **values: Any) -> Scene:
    found = np.zeros(count, PLANE)
    for name, value in {"normal": 1, **values}.items():
        found[name] = value
    return replace(build(), planes=found)


def bonded(pairs: Any, **how: Any) -> Scene:
    return build(**{"centers": V[:3], "bonds": pairs, "bond_radius": 0.1, **how})


def rods(starts: Any, ends: Any, radius: Any = 1, **how: Any) -> Scene:
    return build().with_cylinders(starts, ends, radius, **how)


def fitted(**how: Any) -> Camera:
    return Camera.fit(build(), **how)


def panel(*edges: Any) -> Any:
    return cltrace.panel_light((0, 0, 0), RED, *edges)


sky = cltrace.sky_light
LINE = Mesh([(0, 0, 0), (0, 0, 1), (0, 0, 2)], [(0, 1, 2)])
F3, BENT, LONG = np.arange(9).reshape(3, 3), np.diag([1, 1e38, 1]), [(1, 0, 0), (30, 1, 0), (0, 30, 1)]
FAULTS: list[tuple[Call, str]] = [
    # Numbers: shapes, rules, and what is no real number, or none that a double can hold, at any depth.
    (lambda: build(centers=[(0, 0), (1, 1)]), "centers: must have shape (n, 3), got (2, 2)"),
    (lambda: build(centers=[(0, 0, 0), (0, math.nan, 0)]), "centers[1][1]: must be a finite number, got nan"),
    (lambda: build(centers=[("0", "0", "0")]), "centers: must be numbers, got '0' among them"),
    (lambda: build(radii=[1, 0]), "radii[1]: must be > 0, got 0"),
    (lambda: build(radii=1e-46), "radii: must be at least 1.4e-45 in magnitude, got 1e-46"),
    (lambda: build(radii=[1, 2, 3]), "radii: must have shape (2,) or be one value, got (3,)"),
    (lambda: build(radii=True), "radii: must be numbers, got True"),
    (lambda: build(colors=(-1, 0, 0)), "colors[0]: must be >= 0, got -1"),
    (lambda: build(exponent=-1), "exponent: must be >= 0, got -1"),
    (lambda: build(background=(0, 0, -0.5)), "background[2]: must be >= 0, got -0.5"),
    (lambda: build(centers=[(0, 0, 1j)]), "centers: must be numbers, got 1j among them"),
    (lambda: build(centers=np.zeros((2, 3), complex)), "centers: must be numbers, got an array of complex128"),
    (lambda: build(radii=[np.timedelta64(1, "s"), 1]), "radii: must be numbers, got 1 seconds (timedelta64[s]) among"),
    (lambda: build(radii=[np.True_, 1]), "radii: must be numbers, got True (bool) among them"),
    (lambda: build(radii=b"12"), "radii: must be numbers, got b'12'"),
    (lambda: build(radii=MASKED), "radii: must not be masked; use its filled() or compressed()"),
    (lambda: build(background=[0, 0, np.ma.masked]), "background: must not be masked"),
    (lambda: build(centers=[(0, 0, 10**400)]), f"centers: {FAR} an integer beyond 1.7e308"),
    (lambda: build(centers=[(0, 0, 0), (0, 0)]), "centers: must be an array, got rows of different lengths"),
    (lambda: build(colors=(255.0, 128.0, 0.0)), f"colors: {NO_BYTES} 255 look like bytes of 0 to 255; divide by 255"),
    (lambda: build(background=(0, 2, 0)), f"background: {NO_BYTES} 2 look like bytes of 0 to 255; divide by 255, or"),
    (lambda: build(centers=[0.5], radii=[(0, 0, -3)]), "centers: must have shape (n, 3), got (1,); radii has shape (1"),
    # Something else altogether.
    (lambda: Scene(Camera(), [], np.array([1.0]), np.zeros(0, MATERIAL)), "spheres: must be an (n,) array of dtype"),
    (lambda: Scene(Camera(), [], np.zeros(0, SPHERE), [1.0]), "materials: must be an (n,) a"),  # type: ignore[arg-type]
    (lambda: replace(build(), output_file=5), "output_file: must be a text, got 5"),  # type: ignore[arg-type]
    (lambda: build(camera=[], lights=Camera()), "camera: must be a cltrace.Camera or Orthographic, got []; the order"),
    (lambda: build().seen_by((0, 0, 1)), "camera: must be a cltrace.Camera or Orthographic,"),  # type: ignore[arg-type]
    (lambda: build(lights=5), "lights: must be a list of lights, got 5"),
    (lambda: build(lights=[(1, 2, 3)]), "lights: must be a list of what ambient_light(), point_light(), sky_light() a"),
    (lambda: build(lights="stdio"), "lights: must be one of studio, flat, sky, rim, or a list of lights, got 'stdio'"),
    # Mirrors, glass and ellipsoids.
    (lambda: build(transmittance=[0, -1]), "transmittance[1]: must be >= 0, got -1"),
    (lambda: build(index=math.inf), "index: must be a finite number, got inf"),
    (lambda: build(index=[1, -1], transmittance=0.5), "index[1]: must be > 0 where transmittance > 0, got -1"),
    (lambda: build(transform=[1, 2, 3]), "transform: must have shape (3, 3) or (2, 3, 3), got (3,)"),
    (lambda: build(transform=np.diag([1, 1, math.nan])), "transform[2][2]: must be a finite number, got nan"),
    (lambda: build(transform=np.zeros((3, 3))), "transform: must not be singular"),
    (lambda: build(transform=[[1, 2, 3], [4, 5, 6], [7, 8, 9 + 1e-12]]), "transform: must not distort so much that"),
    (lambda: build(transform=np.diag([1, 1, 1e-40])), f"transform: its inverse {FAR} 1e+40"),
    (lambda: build(transform=[np.eye(3), BENT], radii=[1, 10]), "transform: of sphere 1, half of the extent along y m"),
    (lambda: build(transform=1e-38 * np.eye(3), radii=[1, 1e-38]), "transform: of sphere 1, the radius must be at lea"),
    (lambda: replace(build(), spheres=_of_map(1), to_object=[np.eye(3)]), "spheres.to_object[1]: must be -1 or the in"),
    (lambda: replace(build(), to_object=np.eye(3)), "to_object: must have shape (n, 3, 3), got (3, 3)"),
    (lambda: replace(build(), to_object=[np.eye(3), np.ones((3, 3))]), "to_object[1]: must not be singular"),
    (lambda: replace(build(), to_object=[np.diag([1, 1e39, 1])]), f"to_object[0][1][1]: {FAR} 1e+39"),
    (lambda: replace(build(), spheres=_of_map(0), to_object=[np.diag([1, 1, 1e-40])]), "spheres.radius[1]: half of th"),
    # Lights.
    (lambda: cltrace.point_light((1, 2)), "light.position: must be 3 numbers, got (1, 2)"),
    (lambda: cltrace.spot_light((0, 0, 0), (0, 0, 1), (1, 2), 3), "light.alpha1: must be on"),  # type: ignore[arg-type]
    (lambda: cltrace.ambient_light((255, 255, 255)), f"light.color: {NO_BYTES} 255 look like bytes"),
    (lambda: sky(up=(0, 1, 0), below=(0, 0, 200)), f"light.below: {NO_BYTES} 200"),
    (lambda: sky(below=RED), "light.below: goes with up, which is not given"),
    (lambda: sky(directions=0), "light.directions: must be a whole number within 1..1024, got 0"),
    (lambda: sky(directions=1025), "light.directions: must be a whole number within 1..1024, got 1025; --limit lights"),
    (lambda: panel((1, 0), (0, 1, 0)), "light.across: must be 3 numbers"),
    (lambda: build(lights=[sky(up=(0, 0, 0))]), "lights.direction[0]: must not be 0"),
    (lambda: build(lights=[cltrace.sun_light((0, 0, 1), RED, 181)]), "lights.alpha2[0]: must be within [0, 180]"),
    (lambda: build(lights=[cltrace.ball_light((0, 0, 0), RED, 0)]), "lights.radius[0]: must be > 0, got 0"),
    (lambda: build(lights=[cltrace.ball_light((3e38, 0, 0), RED, 3e38)]), "lights.position[0]: all of the light must"),
    (lambda: build(lights=[panel((1, 0, 0), (2, 0, 0))]), "lights.edges[0]: must not be along one line"),
    (lambda: build(lights=[cltrace.point_light((0, 0, 0), (-1.0, 0, 0))]), "lights.color[0][0]: must be >= 0"),
    (lambda: build(lights=[sky(directions=1000), sky(directions=25)]), "lights: must be at most 1024 with all members"),
    # Cameras.
    (lambda: Camera(horizontal_fov=90), "camera.horizontal_fov: must be within (0, 90), got 90"),
    (lambda: Camera(lookat=(0, 0, 0)), "camera.lookat: must differ from position"),
    (lambda: Camera(up=(0, 0, 0)), "camera.up: must not be 0"),
    (lambda: Camera(up=(0, 0, 3)), "camera.up: must not be parallel to the view"),
    (lambda: Camera(position=(1, 2)), "camera.position: must have shape (3,), got (2,)"),
    (lambda: Camera(resolution=(0, 5)), f"camera.resolution: {PIXELS} 0x5"),
    (lambda: Camera(resolution=(2.5, 5)), "camera.resolution: must be two integers (width,"),  # type: ignore[arg-type]
    (lambda: Camera(resolution=(10**5000, 5)), f"camera.resolution: {PIXELS} an integer of 16610 bitsx5"),
    (lambda: Camera(max_bounces=-1), "camera.max_bounces: must be within 0..100, got -1"),
    (lambda: Camera(square_pixels=1), "camera.square_pixels: must be True or False, got 1"),  # type: ignore[arg-type]
    (lambda: Camera(fov=50, horizontal_fov=25), "camera.fov: must not be given together with horizontal_fov"),
    (lambda: Camera(fov_axis="x"), "camera.fov_axis: must not be given without fov"),
    (lambda: Camera(fov=50, fov_axis="z"), 'camera.fov_axis: must be "x" or "y", got \'z\''),  # type: ignore[arg-type]
    (lambda: Camera(fov=180), "camera.fov: must be within (0, 180), got 180"),
    (lambda: Camera(fov=120, fov_axis="y", resolution=(20, 10), square_pixels=False), "camera.fov: must leave the lon"),
    (lambda: fitted(view="side"), "view: must be one of front, back, right, left, top, bottom, isometric, or three"),
    (lambda: fitted(view=(0, 0, 0)), "view: must not be 0"),
    (lambda: fitted(margin=0.5), "margin: must be below 0.5, got 0.5"),
    (lambda: Camera.fit(Scene.from_spheres(Camera(), [], [], 1)), "scene: must have surfaces"),
    *((lambda kind=kind: kind.fit(Scene.from_meshes(Camera(), [], LINE), "front"), "scene: must not be a single point")
      for kind in (Camera, Orthographic)),
    # Meshes.
    (lambda: Mesh(V, [(0, 1, 1.5)]), "mesh.faces[0][2]: must be the index of a vertex, of which there are 4, got 1.5"),
    (lambda: Mesh(V, np.array([[0, 1, 2**63]], np.uint64)), "mesh.faces[0][2]: must be the index"),
    (lambda: Mesh(V, [(0, 1, 2, 3)]), "mesh.faces: must have shape (n, 3), got (1, 4)"),
    (lambda: Mesh(V, np.ones((1, 3), bool)), "mesh.faces: must be numbers"),
    (lambda: Mesh([*V, (np.nan, 0, 0)], F), "mesh.vertices[4][0]: must be a finite number"),
    (lambda: Mesh(V.astype(object), F), "mesh.vertices: must be numbers"),
    (lambda: Mesh(V, F, normals=np.ones((2, 3))), "mesh.normals: must have shape (4, 3) or (2, 3, 3), got (2, 3)"),
    (lambda: Mesh(V, F, uv=np.zeros((4, 3))), "mesh.uv: must have shape (4, 2) or (2, 3, 2), got (4, 3)"),
    (lambda: Mesh(V, F, material="red"), "mesh.material: must be a cltrace.Material, got 'r"),  # type: ignore[arg-type]
    (lambda: Mesh(V, F, transform=np.eye(2)), "mesh.transform: must have shape (3, 3), (3, 4) or (4, 4), got (2, 2)"),
    (lambda: Mesh(V, F, transform=np.diag([1, 1, 0])), "mesh.transform: must not be singular"),
    (lambda: Mesh(V, F, transform=np.eye(4) + np.eye(4, k=-3)), "mesh.transform[3]: must be 0, 0, 0, 1, got 1, 0, 0,"),
    (lambda: Mesh(2 * V, F, transform=3e38 * np.eye(3)), "mesh.transform: in the world, vertices"),
    (lambda: Mesh.of("room.obj"), "mesh: must have vertices and faces, or points and faces or cells, got 'room.obj'"),
    (lambda: Mesh.of(Mesh(V, F), colors=[RED]), "mesh.colors: must not be given with a Mesh, which has its own"),
    (lambda: Mesh.of(Thing(points=V, cells=[("tetra", [(0, 1, 2, 3)])])), "mesh.cells: must have some of type triangl"),
    (lambda: Mesh.of(Thing(points=V, cells=np.array([3, 0, 1, 2]))), "mesh.cells: must be a list of blocks with type"),
    (lambda: Mesh.of(Thing(points=V, faces=np.array([3, 0, 1]))), "mesh.faces: must be polygons, each after the count"),
    (lambda: Mesh.of(Thing(points=V, faces=np.array([2, 0, 1]))), "mesh: must have triangles, and has none"),
    (lambda: Mesh.of(Thing(points=V, faces=np.zeros(0), n_strips=1)), "mesh.strips: must be none; triangulate()"),
    (lambda: Geometry(V, F, V, [(0, 1, 2), (0, -1, 1)]), "mesh.normal_of[1]: must be -1 for all three corners or for"),
    (lambda: Geometry(V, F, V, [(0, 1, 2), (4, 0, 0)]), "mesh.normal_of[1][0]: must be the index of a normal, of whic"),
    (lambda: Geometry(V, F, uv=V[:, :2], uv_of=[(0, 1, -2)] * 2), "mesh.uv_of[0][2]: must be the index of uv, of whic"),
    (lambda: PlacedMesh(V), "mesh.geometry: must be a cltrace.scene.Geometry"),  # type: ignore[arg-type]
    (lambda: PlacedMesh(Geometry(V, F), np.eye(3)), "mesh.to_world: must have shape (3, 4), got (3, 3)"),
    (lambda: PlacedMesh(Geometry(V, F), number=1.5), "mesh.number: must be an integer withi"),  # type: ignore[arg-type]
    (lambda: placed(Mesh(V, F)), "meshes[0]: must be a cltrace.scene.PlacedMesh, got <cltrace.Mesh"),
    (lambda: placed(PlacedMesh(Geometry(V, F), material=1)), "meshes[0].material: must be the index of a material, go"),
    (lambda: placed(*[PlacedMesh(Geometry(V, F))] * 2), "meshes[1].number: must be greater than that of the mesh befo"),
    (lambda: Scene.from_meshes(Camera(), [], 5), "meshes: must be a list of cltrace.Mesh, g"),  # type: ignore[arg-type]
    (lambda: Scene.from_meshes(Camera(), [], [5]), "meshes[0]: must be a cltrace.Mesh, got"),  # type: ignore[list-item]
    # Materials and textures.
    (lambda: Material(color=(255, 0, 0)), f"material.color: {NO_BYTES} 255"),
    (lambda: Material(color="reddish"), "material.color: must be numbers, the name of a colour in CSS, or #rrggbb"),
    (lambda: Material(kd=[1, 2]), "material.kd: must have shape (), got (2,)"),  # type: ignore[arg-type]
    (lambda: Material(transmittance=0.5, index=0), "material.index: must be > 0 where transmittance > 0, got 0"),
    (lambda: Material(texture="wall.png"), "material.texture: must be an array of uint8 or uint16, got 'wall.png'"),
    (lambda: Material(texture=np.zeros((2, 2, 3), np.int16)), "material.texture: must be an array of uint8 or uint16"),
    (lambda: Material(texture=np.zeros((3, 64, 64), np.uint8)), "material.texture: must have shape (h, w, 3), (h, w,"),
    (lambda: Material(texture=np.ma.zeros((4, 4, 3), np.uint8)), "material.texture: must be an array of uint8 or uint"),
    (lambda: placed(texture=0), "materials.texture[0]: must be -1 or the index of one of textures, got 0"),
    (lambda: placed(textures=5), "textures: must be a list of arrays, got 5"),
    (lambda: placed(textures=[TEXTURE, np.zeros((2, 2))]), "textures[1]: must be an array of uint8 or uint16, got an"),
    # Colours of meshes, and values.
    (lambda: Mesh(V, F, colors=[RED] * 3), "mesh.colors: must be one for each of 4 vertices or 2 faces, got 3"),
    (lambda: Mesh(V, F, values=[1, 2, 3]), "mesh.values: must be one for each of 4 vertices or 2 faces, got 3"),
    (lambda: Mesh(V, F, values=[1, 2, 3, math.nan]), "mesh.values[3]: must not be nan, which has no colour"),
    (lambda: Mesh(V, F, values=[1, 2], colors=[RED, BLUE]), "mesh.values: must not be given together with colors"),
    (lambda: Mesh(V, F, cmap="viridis"), "mesh.cmap: goes with values, which are not given"),
    (lambda: Mesh(V, F, colors=[(1.5, 0, 0), BLUE]), "mesh.colors[0][0]: must be within 0..1, as it is a share"),
    (lambda: Mesh(V, F, colors=[(1, 0, 0, 0.5), (0, 0, 0, 1)]), "mesh.colors[0]: must have no alpha below 1"),
    (lambda: Mesh(V, F, colors=["red", "bleu"]), "mesh.colors[1]: must be numbers, the name of a colour"),
    (lambda: Mesh(V, F, colors=[RED, BLUE], uv=V[:, :2]), "mesh.uv: must not be given together with colors or values"),
    (lambda: Mesh(V, F, material=Material(texture=TEXTURE), colors=[RED] * 2), "mesh.material: must have no texture w"),
    (lambda: Mesh(V, F, values=[0, 1], norm=np.log), "mesh.clim: must be values of which norm makes finite numbers, g"),
    (lambda: Mesh(V, F, values=[0, 1], norm=np.log, clim=(1, 3)), "mesh.values[0]: must be one of which norm makes a"),
    (lambda: Mesh(V, F, values=[-1, -2], norm=LogNorm()), "mesh.norm: must have two limits for values that differ"),
    (lambda: Mesh(V, F, values=[0, 1], norm="log"), "mesh.norm: must be a function, such as numpy.log or LogNorm()"),
    (lambda: Mesh(V, F, values=[0, 1], norm=lambda v: np.append(v, 1)), "mesh.norm: must make"),
    # Clipping.
    (lambda: build().clipped((0, 0), (0, 0, 1)), "point: must have shape (3,), got (2,)"),
    (lambda: build().clipped((0, 0, 0), (0, 0, 0)), "normal: must not be 0"),
    (lambda: build().clipped((0, 0, 0), (0, 0, 1), (-1, 0, 0)), "cap_color[0]: must be >= 0"),
    (lambda: build().clipped((0, 0, 0), (0, 0, 1), [[RED, BLUE]]), "cap_color: must be one colour"),
    (lambda: planes(normal=0), "planes.normal[0]: must be not 0"),
    (lambda: planes(material=9), "planes.material[0]: must be -1 or the index of a material, got 9"),
    (lambda: planes(257), "planes: must be at most 256, got 257"),
    # Bonds, cylinders and boxes.
    (lambda: build(bond_radius=1), "bond_radius: goes with bonds, which are not given"),
    (lambda: bonded([(0, 1)], bond_radius=None), "bond_radius: must be given with bonds"),
    (lambda: bonded([(0, 3)]), "bonds[0][1]: must be the index of a center, of which there are 3, got 3"),
    (lambda: bonded([(1, 1)]), "bonds[0]: must be two different centers, got 1 twice"),
    (lambda: bonded([(0, 1), (1, 2), (1, 0)]), "bonds[2]: must be once, but 1 and 0 are joined by bonds[0], too"),
    (lambda: bonded([(0, 1)] * 2, box=(9, 9, 9)), "bonds[1]: must be once, but 0 and 1 are joined by bonds[0], too, o"),
    (lambda: bonded([0, 1]), "bonds: must have shape (n, 2), got (2,)"),
    (lambda: bonded([(0, 1)], bond_radius=0), "bond_radius: must be > 0, got 0"),
    (lambda: bonded([(0, 1)], bond_colors=[RED] * 3), "bond_colors: must have shape (3,), (1, 3) or (1, 2, 3)"),
    (lambda: bonded([(0, 1)], box=(1, 2)), "box: must be 3 lengths or a (3, 3) matrix of its edges, got shape (2,)"),
    (lambda: bonded([(0, 1)], box=[(1, 0, 0), (2, 0, 0), (0, 0, 1)]), "box: must not be flat"),
    (lambda: bonded([(0, 1)], centers=[(0, 0, 0)] * 2), "bonds[0]: must not be the start"),
    (lambda: bonded([(0, 1), (1, 2)], box=LONG, centers=V[:3] + 0.3 * F3), "box: is too flat for bonds that are"),
    (lambda: rods([(0, 0, 0)], [(0, 0, 0)]), "ends[0]: must not be the start"),
    (lambda: rods([(0, 0, 0)], [(0, 0, 1), (1, 1, 1)]), "ends: must be as many as starts, 1, got 2"),
    (lambda: rods([(0, 0, 0)], [(0, 0, 1)], -1), "radius: must be > 0, got -1"),
    (lambda: rods([(0, 0, 0)], [(0, 0, 1)], colors=[RED] * 2), "colors: must have shape (3,), (1, 3) or (1, 2, 3), go"),
    (lambda: build().replicate((1, 2, 3)), "offsets: must have shape (n, 3), got (3,)"),
    (lambda: build().replicate([(1e200, 0, 0)]), f"offsets[0][0]: {FAR} 1e+200"),
    (lambda: bonded([(0, 1)]).replicate(np.zeros((10**7, 3))), "offsets: must make at most 16777216 cylinders, got"),
    (lambda: cltrace.box_images((1, 1, 1), (10**6, 10**6, 10**6)), "counts: must be at most 16777216 boxes in all, go"),
    *((lambda counts=counts: cltrace.box_images((1, 1, 1), counts), "counts: must be 3 whole numbers of at least 1")
      for counts in ((2, 2), (0, 1, 1), (1, 1, 1.5), 2)),
]  # fmt: skip


def _of_map(index: int) -> np.ndarray:
    spheres = build().spheres.copy()
    spheres["to_object"][1] = index
    return spheres


@pytest.mark.parametrize("number", range(len(FAULTS)))
def test_fault(number: int) -> None:
    """The message is one line, and fits a terminal's few."""
    call, message = FAULTS[number]
    with pytest.raises((ValueError, TypeError)) as caught:
        call()
    said = str(caught.value)
    assert said.startswith(message)
    assert said.isprintable()
    assert len(said) < 250


def test_a_list_that_contains_itself_is_no_number() -> None:
    endless: list[object] = []
    endless.append(endless)
    with pytest.raises(ValueError, match=r"^radii: must be numbers, got \[.*\] among them$"):
        build(radii=endless)


def test_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    shape = Geometry(V, [*F, (3, 2, 1)])
    found = [PlacedMesh(shape, number=i) for i in range(3)]
    for name, most, message in (
        ("MAX_MESHES", 2, "meshes: must be at most 2, got 3"),
        ("MAX_TRIANGLES", 8, "meshes: must be at most 8 triangles in all, got 9"),
        ("MAX_VERTICES", 11, "meshes: must be at most 11 vertices in all, got 12"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(meshes, name, most)
            assert len(placed(*found[:2]).meshes) == 2
            for make in (lambda: placed(*found), lambda: Scene.from_meshes(Camera(), [], [Mesh(V, shape.faces)] * 3)):
                with pytest.raises(ValueError) as caught:
                    make()
                assert str(caught.value) == message
    monkeypatch.setattr(materials, "MAX_TEXELS", 7)
    shades = [Material(texture=TEXTURE), Material(texture=TEXTURE)]
    for make in (
        lambda: placed(textures=[TEXTURE, TEXTURE]),
        lambda: Scene.from_meshes(Camera(), [], [Mesh(V, F, material=shade) for shade in shades]),
    ):
        with pytest.raises(ValueError, match=r"^textures: must be at most 7 pixels in all, got 8$"):
            make()
    assert len(Scene.from_meshes(Camera(), [], [Mesh(V, F, material=shades[0])] * 3).textures) == 1
    with pytest.raises(ValueError, match=r"^x: must have 1 to 7 pixels, got 4 x 2$"):
        texels("x", np.zeros((4, 2), np.uint8))

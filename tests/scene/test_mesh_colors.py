"""Colours of meshes: of vertices, faces and values, exact at corners and linear between; other libraries' meshes."""

from __future__ import annotations

import pickle
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize, TwoSlopeNorm

import cltrace
from cltrace.run.devices import Device

VERTICES = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
FACES = [(0, 1, 2), (0, 2, 3)]
RED, GREEN, BLUE, BLACK = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)
UNLIT = cltrace.Material(ka=1, kd=0, ks=0)
SIZE = 64
CAMERA = cltrace.Orthographic((0.5, 0.5, 5), (0.5, 0.5, 0), height=1, resolution=(SIZE, SIZE))


def square(**given: Any) -> cltrace.Mesh:
    return cltrace.Mesh(VERTICES, FACES, material=UNLIT, **given)


def picture(mesh: cltrace.Mesh, device: Device, **how: Any) -> cltrace.Image:
    scene = cltrace.Scene.from_meshes(CAMERA, [cltrace.ambient_light("white")], mesh, **how)
    return cltrace.render(scene, device, outputs=("rgb8", "color"))


def places() -> tuple[np.ndarray, np.ndarray]:
    """x and y of the pixels' middles, which are those of the square."""
    middles = (np.arange(SIZE) + 0.5) / SIZE
    return np.broadcast_to(middles, (SIZE, SIZE)), np.broadcast_to(1 - middles[:, None], (SIZE, SIZE))


@pytest.mark.parametrize("transfer", ["linear", "srgb"])
def test_colors_of_vertices_are_interpolated(transfer: Any, device: Device) -> None:
    """No corner's colour is on a line between the others', where c + b - a is below 0."""
    image = picture(square(colors=[RED, GREEN, BLUE, BLACK]), device, transfer=transfer)
    x, y = places()
    lower = np.stack([1 - x, x - y, y], axis=-1)
    upper = np.stack([1 - y, 0 * x, x], axis=-1)
    wanted = np.where((y < x)[..., None], lower, upper)
    assert np.abs(image.color - wanted).max() < 2e-6


def test_interpolation_is_of_linear_colors(device: Device) -> None:
    image = picture(square(colors=["#808080", "#808080", "#ff0000", "#ff0000"]), device, transfer="srgb")
    grey = ((128 / 255 + 0.055) / 1.055) ** 2.4
    _, y = places()
    assert np.abs(image.color[..., 0] - (grey + y * (1 - grey))).max() < 1e-4  # of a 16-bit texel
    assert np.abs(image.color[..., 1] - grey * (1 - y)).max() < 1e-4


def test_bytes_come_back(device: Device) -> None:
    """A face of one colour shows it, whatever its neighbours have, with either curve."""
    n = 16
    grid = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (part.ravel() for part in (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]))
    y, x = np.divmod(np.arange((n + 1) ** 2), n + 1) / np.float64(n)
    faces = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
    random = np.random.default_rng(1)
    levels = random.integers(0, 256, (n * n, 3))
    vertices, colors = np.stack([x, y, 0 * x], axis=1), np.repeat(levels, 2, axis=0) / 255
    wanted = np.repeat(np.repeat(levels.reshape(n, n, 3)[::-1], SIZE // n, axis=0), SIZE // n, axis=1)
    for transfer in ("linear", "srgb"):
        mesh = cltrace.Mesh(vertices, faces, material=UNLIT, colors=colors)
        assert (picture(mesh, device, transfer=transfer).rgb8 == wanted).all()
    values = np.repeat(levels[:, 0], 2)
    mesh = cltrace.Mesh(vertices, faces, material=UNLIT, values=values, clim=(0, 255), cmap="magma")
    shown = picture(mesh, device).rgb8
    assert (shown == colormaps["magma"](wanted[..., 0] / 255, bytes=True)[..., :3]).all()


def test_values_are_interpolated_and_do_not_wrap(device: Device) -> None:
    mesh = square(values=[0, 1, 1, 0], cmap="viridis")
    shown, table = picture(mesh, device).rgb8.astype(int), colormaps["viridis"](np.arange(256), bytes=True)[:, :3]
    x, _ = places()
    wanted = table[np.minimum((x * 256).astype(int), 255)].astype(int)
    assert np.abs(shown - wanted).max() <= np.abs(np.diff(table.astype(int), axis=0)).max()  # a step of the map
    # At the high end itself, and beyond.
    for values in ([1, 1, 1, 1], [5, 5, 5, 5]):
        high = picture(square(values=values, cmap="viridis", clim=(0, 1)), device).rgb8
        assert (high == table[-1]).all()
    # A map of few colours keeps its steps.
    steps = picture(square(values=[0, 1, 1, 0], cmap=np.array([RED, GREEN, BLUE], float)), device).rgb8
    assert {tuple(color) for color in steps.reshape(-1, 3).tolist()} <= {(255, 0, 0), (0, 255, 0), (0, 0, 255)}
    assert (steps[:, : SIZE // 3] == (255, 0, 0)).all()
    assert (steps[:, -SIZE // 3 + 1 :] == (0, 0, 255)).all()


def test_norms(device: Device) -> None:
    values = [1, 100, 100, 1]
    shown = [picture(square(values=values, norm=norm), device).rgb8 for norm in (np.log, LogNorm(), LogNorm(1, 100))]
    assert (shown[0] == shown[1]).all()
    assert (shown[1] == shown[2]).all()
    middle = picture(square(values=[10] * 4, norm=LogNorm(1, 100)), device).rgb8
    assert (middle == colormaps["viridis"](0.5, bytes=True)[:3]).all()


def test_steps_and_ends_of_norms() -> None:
    """A norm of steps tells colours of the map by number; beyond the limits of TwoSlopeNorm are the ends' colours."""
    for norm, few, values in (
        (BoundaryNorm([0, 1, 2, 3, 4, 5], 256), "viridis", np.arange(5) + 0.5),
        (BoundaryNorm([0, 1, 5], 4, extend="both"), ListedColormap(["red", "lime", "blue", "gold"]), [-9, 0.5, 2, 9]),
        (TwoSlopeNorm(0, -1, 1), "viridis", [-2, -0.5, 0.5, 9]),
    ):
        shown = colormaps[few] if isinstance(few, str) else few
        wanted = shown(norm(np.array(values)), bytes=True)[:, :3]
        given: dict[str, Any] = {"values": values, "cmap": few, "norm": norm}
        found = cltrace.Scene.from_spheres(cltrace.Camera(), [], np.eye(5, 3)[: len(values)], 1, **given)
        assert np.rint(found.columns.shade["color"] * 255).astype(int).tolist() == wanted.tolist()
    bar = cltrace.colorbar(norm=BoundaryNorm([0, 1, 4], 256), size=(20, 40), ticks=False)[:, 0, :3].tolist()
    top, bottom = (np.array(colormaps["viridis"](index, bytes=True)[:3]).tolist() for index in (255, 0))
    assert bar == [top] * 30 + [bottom] * 10
    marked = cltrace.colorbar(norm=BoundaryNorm([0, 1, 4], 256), size=(40, 80))
    assert len(np.unique(marked[:, 0, :3], axis=0)) == 3  # two colours and what is beyond the bar
    with pytest.raises(ValueError, match=r"norm: must have two limits .* say clim"):
        cltrace.colorbar(norm=LogNorm())
    with pytest.raises(ValueError, match=r"clim: must be values of which norm makes finite numbers, got 0, 1"):
        cltrace.colorbar(norm=np.log)
    assert cltrace.colorbar(norm=Normalize()).tolist() == cltrace.colorbar().tolist()


def test_material_and_placement(device: Device) -> None:
    half = cltrace.Material((0.5, 0.5, 0.5), ka=1, kd=0, ks=0)
    mesh = cltrace.Mesh(VERTICES, FACES, material=half, colors=[RED, BLUE])
    assert np.unique(picture(mesh, device).rgb8.reshape(-1, 3), axis=0).tolist() == [[0, 0, 128], [128, 0, 0]]
    again = cltrace.Mesh.of(mesh, UNLIT, transform=np.diag([1.0, 1.0, 2.0]))
    assert again.colors is mesh.colors
    assert np.unique(picture(again, device).rgb8.reshape(-1, 3), axis=0).tolist() == [[0, 0, 255], [255, 0, 0]]
    scene = cltrace.Scene.from_meshes(CAMERA, [], [mesh, cltrace.Mesh.of(mesh, half)])
    assert len(scene.textures) == 1
    assert len(pickle.loads(pickle.dumps(scene)).textures) == 1
    other = replace(scene, camera=CAMERA)  # which checks textures
    assert other.textures[0].dtype == np.int16
    assert mesh.vertices.tolist() == [list(map(float, v)) for v in VERTICES]
    assert mesh.faces.tolist() == [list(f) for f in FACES]


def test_the_reference_has_the_same_colors(device: Device) -> None:
    mesh = square(colors=[RED, GREEN, BLUE, BLACK])
    scene = cltrace.Scene.from_meshes(CAMERA, [cltrace.ambient_light("white")], mesh)
    image = picture(mesh, device)
    for x, y in ((3, 5), (40, 20), (60, 60)):
        told = cltrace.explain(scene, x, y).color
        assert np.abs(np.array(told) - image.color[y, x]).max() < 1e-6


def corners_of(mesh: cltrace.Mesh) -> list[Any]:
    assert mesh.colors
    assert mesh.colors.corners is not None
    return np.rint(mesh.colors.corners * 255).astype(int).tolist()


BYTES = np.array([(255, 0, 0, 255), (0, 255, 0, 255), (0, 0, 255, 255), (0, 0, 0, 255)], np.uint8)
WANTED = [[BYTES[i, :3].tolist() for i in face] for face in FACES]


def test_colors_of_other_libraries_arrive() -> None:
    points, faces = np.array(VERTICES, float), np.array(FACES)
    plain = SimpleNamespace(kind=None)
    assert cltrace.Mesh.of(SimpleNamespace(vertices=points, faces=faces, visual=plain)).colors is None
    colored = SimpleNamespace(kind="vertex", vertex_colors=BYTES)
    trimesh = SimpleNamespace(vertices=points, faces=faces, visual=colored)
    assert corners_of(cltrace.Mesh.of(trimesh)) == WANTED
    by_face = SimpleNamespace(kind="face", face_colors=BYTES[:2])
    mesh = cltrace.Mesh.of(SimpleNamespace(vertices=points, faces=faces, visual=by_face))
    assert corners_of(mesh) == [[[255, 0, 0]] * 3, [[0, 255, 0]] * 3]
    whole = SimpleNamespace(geometry={}, to_mesh=lambda: trimesh)  # trimesh's Scene
    assert corners_of(cltrace.Mesh.of(whole)) == WANTED
    # Of parts with colours of either kind, each keeps its own: no two triangles share a vertex then.
    painted, bare = (SimpleNamespace(vertices=points, faces=faces, visual=of) for of in (by_face, plain))
    mixed = SimpleNamespace(geometry={}, to_mesh=None, dump=lambda: [painted, trimesh, bare])
    of_faces = [[[255, 0, 0]] * 3, [[0, 255, 0]] * 3]
    assert corners_of(cltrace.Mesh.of(mixed)) == [*of_faces, *WANTED, *[[[255, 255, 255]] * 3] * 2]
    assert cltrace.Mesh.of(mixed).faces.max() == 17
    cells = [("triangle", faces)]
    parts = dict(zip(("red", "green", "blue", "alpha"), BYTES.T.view(np.int8), strict=True))
    assert corners_of(cltrace.Mesh.of(SimpleNamespace(points=points, cells=cells, point_data=parts))) == WANTED
    # What is given here comes first.
    assert corners_of(cltrace.Mesh.of(trimesh, colors=["red", "red"])) == [[[255, 0, 0]] * 3] * 2


def test_pyvista() -> None:
    points = np.array([*VERTICES, (2, 2, 0)], float)
    data = {"RGBA": np.concatenate([BYTES, BYTES[:1]]), "height": np.arange(5.0)}
    mixed = np.array([3, 0, 1, 2, 3, 0, 2, 3, 4, 0, 1, 2, 3, 5, 0, 1, 2, 4, 3, 3, 1, 2, 4])
    poly = SimpleNamespace(points=points, faces=mixed, point_data=data, n_strips=0, extract_surface=None)
    mesh = cltrace.Mesh.of(poly)
    fans = [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 4], [0, 4, 3], [1, 2, 4]]
    assert mesh.faces.tolist() == fans
    assert corners_of(mesh)[:2] == WANTED
    grid = SimpleNamespace(
        points=points, cells=mixed, celltypes=[], point_data={}, extract_surface=lambda algorithm: poly
    )
    assert cltrace.Mesh.of(grid).faces.tolist() == fans
    older = SimpleNamespace(points=points, cells=mixed, point_data={}, extract_surface=lambda: poly)
    assert cltrace.Mesh.of(older).faces.tolist() == fans
    assert cltrace.Mesh.of(grid, values="height", cmap="magma").colors is not None
    with pytest.raises(
        ValueError, match=r"mesh.values: must be numbers or a name of point_data, RGBA, height, got 'p'"
    ):
        cltrace.Mesh.of(grid, values="p")
    cells = {"p": np.arange(3.0)}
    of_cells = SimpleNamespace(points=points, faces=mixed, point_data={"vtkIds": points}, cell_data=cells, n_strips=0)
    with pytest.raises(ValueError, match=r"point_data, none, got 'p'; cell_data_to_point_data\(\) makes"):
        cltrace.Mesh.of(of_cells, values="p")
    for empty in (np.zeros(0, int), np.array([2, 0, 1])):  # points alone, and a line
        with pytest.raises(ValueError, match=r"mesh: must have triangles, and has none; .* Scene\.from_spheres"):
            cltrace.Mesh.of(SimpleNamespace(points=points, faces=empty, n_strips=0))

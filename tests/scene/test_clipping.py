"""Scenes on one side of a plane: what is left, in which order, and what is refused."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import cltrace
from cltrace import Camera, Mesh, Scene, ambient_light
from cltrace.scene import CUT, sections, with_spheres

CAMERA = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 30, (64, 48))
# In front of z = 0, cut by it, touching it from behind, and behind it.
PLACES = [(0, 0, 3), (1, 0, 0.1), (0, 1, -0.4), (0, 2, -3)]

CUBE = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4)]
CUBE += [(1, 5, 7), (1, 7, 3)]


def balls(**how: object) -> Scene:
    return Scene.from_spheres(CAMERA, ambient_light(), PLACES, 0.4, **how)  # type: ignore[arg-type]


def test_what_is_beyond_is_gone_and_what_is_cut_has_a_cap() -> None:
    scene = balls(colors=np.eye(4, 3)).clipped((5, 5, 0), (0, 0, 2), "red")
    # What touches the plane counts as cut, as no double can tell.
    assert scene.columns.center.tolist() == [[0, 2, -3]]
    assert scene.cuts["center"].tolist() == [[1, 0, 0.1], [0, 1, -0.4]] * 2
    assert scene.cuts["flat"].tolist() == [1, 1, 0, 0]
    assert scene.sphere_numbers.tolist() == [0]
    assert scene.cuts["number"].tolist() == [1, 2, 3, 4]
    color = scene.materials["color"][scene.cuts["material"]]
    assert color.tolist() == [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert len(balls().clipped((0, 0, 0), (0, 0, 1)).cuts) == 2
    assert repr(scene) == "<cltrace.Scene 64x48: 1 spheres, 4 cut balls and caps, 1 lights>"


def test_first_hits_are_those_of_balls_within_half_of_space() -> None:
    """Against intervals in doubles, for rays from all around."""
    rng = np.random.default_rng(2)
    centers, radii, normal = rng.normal(size=(40, 3)), rng.uniform(0.1, 0.7, 40), rng.normal(size=3)
    point = rng.normal(size=3) * 0.1
    scene = Scene.from_spheres(CAMERA, ambient_light(), centers, radii).clipped(point, normal, "gold")
    o = rng.normal(size=(4000, 3)) * 2
    d = rng.normal(size=o.shape) - o
    hits = cltrace.trace_rays(scene, o, d)
    f, dd = centers - o[:, None], (d * d).sum(axis=1)[:, None]
    b = np.einsum("ijk,ik->ij", f, d)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b * b - dd * ((f * f).sum(axis=2) - radii**2))
    g, h = d @ normal, (point - o) @ normal
    plane = (h / g)[:, None]
    near = np.fmax((b - root) / dd, np.where((g < 0)[:, None], plane, -np.inf))
    far = np.fmin((b + root) / dd, np.where((g > 0)[:, None], plane, np.inf))
    ends = np.where(np.isnan(root) | (near > far) | (far < 0), np.inf, np.where(near > 0, near, far))
    truth = ends.min(axis=1)
    assert np.array_equal(np.isfinite(truth), hits.id >= 0)
    assert np.allclose(hits.t[hits.id >= 0], truth[np.isfinite(truth)], rtol=1e-9)
    caps = set(scene.cuts["number"][scene.cuts["flat"] == 1].tolist())
    on_plane = np.isfinite(truth) & (np.abs(truth - plane[:, 0]) < 1e-9)
    assert on_plane.sum() > 100
    assert [k in caps for k in hits.id.tolist()] == on_plane.tolist()
    assert np.allclose(hits.normal[on_plane] @ normal / np.linalg.norm(normal), np.where(g < 0, 1, -1)[on_plane])


def test_a_plane_beside_all_changes_no_picture() -> None:
    scene = balls()
    assert np.array_equal(cltrace.render(scene).rgb8, cltrace.render(scene.clipped((0, 0, 5), (0, 0, 1), "red")).rgb8)
    assert not cltrace.render(scene.clipped((0, 0, 5), (0, 0, -1), "red")).rgb8.any()


@pytest.mark.parametrize("turn", [np.eye(3), np.array([(0.8, 0, 0.6), (0, 1, 0), (-0.6, 0, 0.8)])])
@pytest.mark.parametrize("scales", [(0.4, 0.4, 0.44), (3, 3, 1)])
@pytest.mark.parametrize("side", [1, -1])
def test_a_plane_beside_an_ellipsoid_leaves_it(side: int, scales: tuple[float, ...], turn: Any) -> None:
    """Also where its box has a diagonal that the plane cuts."""
    place = turn @ np.diag(scales)
    bottom = -side * np.linalg.norm(place[2])
    near, over = (
        Scene.from_spheres(CAMERA, ambient_light(), [(0, 0, bottom * by)], 1, transform=place)
        for by in (1 + 1e-6, 1 - 1e-6)
    )
    assert len(near.clipped((0, 0, 0), (0, 0, 1)).columns) == (side > 0)
    with pytest.raises(ValueError, match=r"^spheres\[0\]: is an ellipsoid that the plane cuts"):
        over.clipped((0, 0, 0), (0, 0, 1))


@pytest.mark.parametrize(
    ("start", "end", "radius", "reach"),
    [((0, 0, -4), (0, 0, 0), 0.1, 0), ((-3, 0, -4), (0, 0, 0), 0.4, 0.24), ((-3, 0, 0), (0, 0, 0), 0.1, 0.1)],
)
@pytest.mark.parametrize("side", [1, -1])
def test_a_plane_beside_a_cylinder_leaves_it(side: int, start: Any, end: Any, radius: float, reach: float) -> None:
    """Its ends are flat: they reach radius times the sine of the angle between the axis and the normal."""
    ends = np.array([start, end]) * (1, 1, side)
    scene = balls().clipped((0, 0, -9), (0, 0, 1)).with_cylinders(ends[:1], ends[1:], radius)
    near, over = ((0, 0, side * (reach + off)) for off in (1e-6, -1e-6))
    assert len(scene.clipped(near, (0, 0, 1)).cylinders) == (side > 0)
    with pytest.raises(ValueError, match=r"^cylinders\[0\]: the plane cuts it"):
        scene.clipped(over, (0, 0, 1))


def test_several_planes() -> None:
    scene = balls().clipped((0, 0, 0), (0, 0, 1), "red").clipped((0.5, 0, 0), (1, 0, 0), "blue")
    assert scene.cuts["center"].tolist() == [[0, 1, -0.4]] * 2
    with pytest.raises(ValueError, match=r"^cut balls\[0\]: the plane cuts a ball that is cut already; a ball"):
        balls().clipped((0, 0, 0), (0, 0, 1)).clipped((1, 0, 0), (1, 0, 0))


def test_several_planes_close_a_mesh() -> None:
    """Each with a cap of its own, which the others cut, also where what they have left was moved in between."""
    cube = Mesh([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], CUBE)
    scene = Scene.from_meshes(CAMERA, ambient_light(), cube).clipped((0.3, 0, 0), (1, 0, 0), "gold")
    assert sum(map(volume_of, scene.meshes)) == pytest.approx(1.3 * 2 * 2)
    both = scene.clipped((0, 0.5, 0), (0, 1, 0), "red")
    assert [mesh.material for mesh in both.meshes] == [0, 1, 2]
    assert sum(map(volume_of, both.meshes)) == pytest.approx(1.3 * 1.5 * 2)
    corner = both.clipped((0.2, 0.4, 0), (1, 1, 0), "blue")
    assert sum(map(volume_of, corner.meshes)) == pytest.approx((1.3 * 1.5 - 0.2**2 / 2) * 2)
    moved = both.replicate([(5, 0, 0)]).clipped((5.2, 0.4, 0), (1, 1, 0), "blue")
    assert sum(map(volume_of, moved.meshes)) == pytest.approx((1.3 * 1.5 - 0.2**2 / 2) * 2)
    assert len(pickle.loads(pickle.dumps(both)).clipped((0, 0, 0), (0, 0, 1), "blue").meshes) == 4
    # What is not cut is not closed again, and a plane beside the cut mesh cuts no more of the whole one.
    assert len(scene.clipped((0.5, 0, 0), (1, 0, 0), "red").meshes) == 2


def test_clipped_scenes_are_made_anew_pickled_moved_and_changed() -> None:
    scene = balls(values=[1, 2, 3, 4]).clipped((0, 0, 0), (0, 0, 1), "red")
    again = pickle.loads(pickle.dumps(scene))
    given = {name: getattr(scene, name) for name in ("spheres", "materials", "cuts")}
    made = Scene(scene.camera, scene.lights, **given)
    image = cltrace.render(scene, outputs=("rgb8", "id"))
    for other in (again, made):
        assert np.array_equal(cltrace.render(other, outputs=("rgb8", "id")).rgb8, image.rgb8)
    twice = scene.replicate([(0, 0, 0), (0, 0.5, 0)])
    assert twice.cuts["center"][4:].tolist() == (scene.cuts["center"] + (0, 0.5, 0)).tolist()
    assert twice.cuts["number"].tolist() == list(range(2, 10))
    painted = with_spheres(scene, {"colors": "lime"})
    assert (
        painted.materials["color"][painted.cuts["material"]].tolist()
        == scene.materials["color"][scene.cuts["material"]].tolist()
    )
    more = with_spheres(painted, {"centers": [(0, 2, -3), (0, 3, -3)]})
    assert more.cuts["number"].tolist() == [2, 3, 4, 5]


def test_what_is_left_is_painted_and_moved() -> None:
    scene = balls(colors=np.eye(4, 3)).clipped((0, 0, 0), (0, 0, 1), "red")
    renderer = cltrace.Renderer(scene, outputs=("rgb8", "id"))
    before = renderer.render()
    renderer.update(colors="lime", centers=[(0.3, 2, -3)])
    after = renderer.render()
    assert np.array_equal(after.rgb8, cltrace.render(renderer.scene).rgb8)
    cut = np.isin(before.id, scene.cuts["number"])
    assert cut.sum() > 10
    assert not np.array_equal(before.rgb8, after.rgb8)
    assert np.array_equal(before.rgb8[cut], after.rgb8[cut])


def ring(turned: bool = False, **how: object) -> Mesh:
    """A torus of radii 1 and 0.4. turned: its triangles are clockwise."""
    n = 48
    u, v = np.meshgrid(*[np.linspace(0, 2 * np.pi, n, endpoint=False)] * 2)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i, np.roll(i, -1, 1), np.roll(np.roll(i, -1, 0), -1, 1), np.roll(i, -1, 0)
    faces = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))])
    normals = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=-1).reshape(-1, 3)
    vertices = normals * 0.4 + np.stack([np.cos(u), np.sin(u), 0 * u], axis=-1).reshape(-1, 3)
    return Mesh(vertices, faces, normals=normals, transform=np.diag((1.0, 1, -1)) if turned else None, **how)  # type: ignore[arg-type]


def volume_of(mesh: Any, signed: int = 1) -> float:
    a, b, c = mesh.vertices[mesh.geometry.faces].transpose(1, 0, 2)
    return signed * float((a * np.cross(b, c)).sum()) / 6


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 1, 0.1), (0.3, 0.5, 1), (1, 0, 0)])
def test_halves_of_a_mesh_are_closed_and_together_all_of_it(normal: tuple[float, ...], turned: bool) -> None:
    """By their volumes, to which what closes them adds, and by its areas, which are equal."""
    scene = Scene.from_meshes(CAMERA, ambient_light(), ring(turned))
    halves = [scene.clipped((0.01, 0.02, 0.03), s * np.array(normal), "gold") for s in (1, -1)]
    sign = -1 if turned else 1
    # The torus has its corners clockwise or not; what closes it always leads out of it.
    volumes = [volume_of(half.meshes[0], sign) + volume_of(half.meshes[1]) for half in halves]
    assert min(volumes) > 0.5
    assert sum(volumes) == pytest.approx(volume_of(scene.meshes[0], sign), rel=1e-12)
    caps = [half.meshes[1].vertices[half.meshes[1].geometry.faces] for half in halves]
    areas = [np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]).sum(axis=0) / 2 for t in caps]
    assert np.allclose(areas[0], -areas[1], rtol=0, atol=1e-12)
    assert np.allclose(areas[0] / np.linalg.norm(areas[0]), np.array(normal) / np.linalg.norm(normal))


def test_a_cut_mesh_looks_as_before_where_it_is() -> None:
    """Normals and colours of what is left are those of the whole."""
    mesh = ring(values=np.arange(48 * 48.0), cmap="viridis")
    scene = Scene.from_meshes(Camera((0, 2, 3), (0, 0, 0), (0, 1, 0), 30, (64, 48)), ambient_light(), mesh)
    whole, half = (
        cltrace.render(each, None, "accurate", ("id", "normal", "color", "depth"))
        for each in (scene, scene.clipped((0, 0.1, 0), (0, 1, 0.2), "gold"))
    )
    left = (half.id == 0) & np.isclose(half.depth, whole.depth, rtol=1e-6)
    assert left.sum() > 200
    assert (half.id == 1).sum() > 5
    assert np.abs(half.normal - whole.normal)[left].max() < 1e-5
    assert np.abs(half.color - whole.color)[left].max() < 1e-4


def test_meshes_whose_triangles_share_no_vertices_are_closed() -> None:
    """As of an STL file, in any order of corners; and one with a hole in the plane stays open."""
    whole, rng = ring(), np.random.default_rng(3)
    corners = whole.vertices[whole.faces]
    turn = (rng.integers(3, size=(len(corners), 1)) + np.arange(3)) % 3
    loose = np.take_along_axis(corners, turn[..., None], axis=1).reshape(-1, 3)
    order = rng.permutation(len(loose))
    faces = np.argsort(order).reshape(-1, 3)
    plane = (0.01, 0.02, 0.03), (0.3, 0.5, 1), "gold"
    one, other = (
        Scene.from_meshes(CAMERA, ambient_light(), mesh).clipped(*plane).meshes
        for mesh in (Mesh(whole.vertices, whole.faces), Mesh(loose[order], faces))
    )
    assert len(one) == len(other) == 2
    assert [volume_of(mesh) for mesh in one] == pytest.approx([volume_of(mesh) for mesh in other], rel=1e-12)
    height = (loose.reshape(-1, 3, 3) - plane[0]) @ plane[1]
    cut = int(np.argmax((height.min(axis=1) < 0) & (height.max(axis=1) > 0)))
    holed = Mesh(loose[order], np.delete(faces, cut, axis=0))
    assert len(Scene.from_meshes(CAMERA, ambient_light(), holed).clipped(*plane).meshes) == 1


def test_caps_have_no_more_triangles_than_a_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each line is split at each end of another one: that is known before there is memory taken for it."""
    scene = Scene.from_meshes(CAMERA, ambient_light(), ring())
    most = len(scene.clipped((0, 0, 0.1), (0.1, 0, 1)).meshes[1].geometry.faces)
    monkeypatch.setattr(sections, "MAX_TRIANGLES", 2 * most)
    assert len(scene.clipped((0, 0, 0.1), (0.1, 0, 1)).meshes) == 2
    monkeypatch.setattr(sections, "MAX_TRIANGLES", most // 2)
    words = rf"^meshes: the cap of surface 0 must be at most {most // 2} triangles, got \d+$"
    with pytest.raises(ValueError, match=words):
        scene.clipped((0, 0, 0.1), (0.1, 0, 1))


def test_what_is_open_stays_open_and_has_its_own_color() -> None:
    square = Mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)])
    cut = Scene.from_meshes(CAMERA, ambient_light(), square).clipped((0.5, 0, 0), (1, 0, 0), "gold")
    assert len(cut.meshes) == 1
    assert cut.meshes[0].vertices[:, 0].max() == 0.5
    closed = Scene.from_meshes(CAMERA, ambient_light(), ring(material=cltrace.Material((0, 1, 0))))
    own = closed.clipped((0, 0, 0.1), (0, 0, 1))
    assert [own.materials["color"][mesh.material].tolist() for mesh in own.meshes] == [[0, 1, 0], [0, 1, 0]]
    assert [mesh.number for mesh in own.meshes] == [0, 1]


CUT_BALL = np.zeros(1, CUT)
CUT_BALL["radius"], CUT_BALL["end"] = 1, 1


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: balls().clipped((0, 0), (0, 0, 1)), r"point: must have shape \(3,\)"),
        (lambda: balls().clipped((0, 0, 0), (0, 0, 0)), "normal: must not be 0"),
        (lambda: balls().clipped((0, 0, 0), (0, 0, 1), (-1, 0, 0)), r"cap_color\[0\]: must be >= 0"),
        (lambda: balls().clipped((0, 0, 0), (0, 0, 1), [[(1, 0, 0), (0, 1, 0)]]), "cap_color: must be one colour"),
        (
            lambda: balls(transform=np.diag((1.0, 2, 3))).clipped((0, 0, 0), (0, 0, 1)),
            r"spheres\[1\]: is an ellipsoid that the plane cuts",
        ),
        (
            lambda: balls(bonds=[(0, 3)], bond_radius=0.1).clipped((0, 0, 0), (0, 0, 1)),
            r"cylinders\[0\]: the plane cuts it",
        ),
        (lambda: _made(radius=0), r"cuts\.radius\[0\]: must be > 0"),
        (lambda: _made(end=0), r"cuts\.end\[0\]: must be another place than the start"),
        (lambda: _made(flat=2), r"cuts\.flat\[0\]: must be 0 or 1, got 2"),
        (lambda: _made(material=9), r"cuts\.material\[0\]: must be the index of a material, got 9"),
    ],
)
def test_what_cannot_be_is_refused(call: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f"^{words}"):
        call()


def _made(**fields: int) -> Scene:
    cuts, scene = CUT_BALL.copy(), balls()
    cuts["number"] = 4
    for name, value in fields.items():
        cuts[name] = value
    return Scene(CAMERA, ambient_light(), scene.spheres, scene.materials, cuts=cuts)


def test_comparisons_refuse_cut_balls() -> None:
    scene = balls().clipped((0, 0, 0), (0, 0, 1))
    with pytest.raises(ValueError, match=r"^scene: must have no cut balls, which no scene file has"):
        cltrace.compare(scene, np.zeros((48, 64, 3), np.uint8))

"""Colours as users write them: names, #rrggbb, and values through a colour map."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import LogNorm

import cltrace
from cltrace.run.devices import Device
from cltrace.scene import colormaps as maps
from cltrace.scene import with_spheres

PAIR = {"centers": [(0, 0, 0), (1, 0, 0)], "radii": 0.5}
CAMERA = cltrace.Camera((0, 0, 40), (0, 0, 0), horizontal_fov=14, resolution=(192, 192))


def pair(**given: Any) -> cltrace.Scene:
    return cltrace.Scene.from_spheres(cltrace.Camera(), [], **PAIR, **given)


def unlit(n: int, **given: Any) -> cltrace.Scene:
    """n balls in a lattice, that show exactly their colours."""
    places = np.indices((16, 16)).reshape(2, -1).T[:n] - 7.5
    centers = np.column_stack([places, np.zeros(n)])
    light = [cltrace.ambient_light("white")]
    return cltrace.Scene.from_spheres(CAMERA, light, centers, 0.45, ka=1, kd=0, ks=0, **given)


def colors_of(values: Any, *how: Any) -> np.ndarray:
    given = np.array(values, float)
    return maps.Scale.of(given, *how).colors(given)


def bytes_shown(scene: cltrace.Scene, device: Device) -> np.ndarray:
    """(n, 3): the one colour that each surface shows, of which all must be seen."""
    image = cltrace.render(scene, device, outputs=("rgb8", "id"))
    shown = np.zeros((len(scene.columns), 3), np.uint8)
    seen = image.id >= 0
    shown[image.id[seen]] = image.rgb8[seen]
    assert (image.rgb8[seen] == shown[image.id[seen]]).all()
    assert len(np.unique(image.id[seen])) == len(shown)
    return shown


def test_names_are_those_of_css() -> None:
    red, teal = (1.0, 0.0, 0.0), (0, 128 / 255, 128 / 255)
    for colors in (
        ["red", "teal"],
        np.array(["red", "#008080"]),
        np.array(["red", "teal"], object),
        ("#f00", "rgb(0,128,128)"),
        ["red", teal],
        [(*red, 1), (*teal, 1)],
        np.array([(*red, 1), (*teal, 1)]),
    ):
        assert pair(colors=colors).materials["color"].tolist() == [list(red), list(teal)]
    assert pair(colors="TEAL").materials["color"].tolist() == [list(teal)]
    assert pair(background="red").background == red
    assert cltrace.Material("teal").color == cltrace.Material((*teal, 1)).color == teal
    for light in (cltrace.ambient_light("red"), cltrace.point_light((0, 0, 1), color="red")):
        assert light["color"].tolist() == [list(red)]


@pytest.mark.parametrize("transfer", ["linear", "srgb"])
def test_unlit_surfaces_have_the_bytes_of_their_texts(transfer: Any, device: Device) -> None:
    texts = [f"#{k:02x}{255 - k:02x}{k * 7 % 256:02x}" for k in range(256)]
    scene = unlit(256, colors=texts, transfer=transfer)
    assert [f"#{bytes(c).hex()}" for c in bytes_shown(scene, device)] == texts


@pytest.mark.parametrize("name", ["viridis", "coolwarm", "turbo", "jet", "bone"])
def test_unlit_surfaces_have_the_bytes_of_matplotlib(name: str, device: Device) -> None:
    own = colormaps[name](np.arange(256), bytes=True)[:, :3]
    assert np.array_equal(bytes_shown(unlit(256, values=np.arange(256), cmap=name), device), own)
    assert np.array_equal(bytes_shown(unlit(256, values=np.arange(256), cmap=colormaps[name]), device), own)
    bar = cltrace.colorbar(name, size=(1, 256), ticks=False)
    assert np.array_equal(bar[::-1, 0], colormaps[name](np.arange(256), bytes=True))
    lying = cltrace.colorbar(name, size=(256, 1), ticks=False)
    assert np.array_equal(lying[0], bar[::-1, 0])


def test_values_and_limits() -> None:
    values = np.array([-5.0, 0.0, 0.25, 1.0, 7.0])
    map_ = colormaps["magma"]
    expected = map_(np.array([0, 0, 0.25, 1, 1]), bytes=True)[:, :3]
    assert np.array_equal(np.rint(colors_of(values, "magma", (0, 1)) * 255), expected)
    whole = map_((values + 5) / 12, bytes=True)[:, :3]
    assert np.array_equal(np.rint(colors_of(values, "magma") * 255), whole)
    table = np.array([[1, 0, 0], [0, 0.3, 0], [0, 0, 1]], float)
    assert colors_of([0, 1, 2, 3], table).tolist() == np.float32(table[[0, 1, 2, 2]]).tolist()
    assert colors_of([0, 1], lambda t: np.column_stack([t, t / 2, 0 * t])).tolist() == [[0, 0, 0], [1, 0.5, 0]]
    assert colors_of([3, 3], "magma").tolist() == colors_of([0, 0], "magma", (0, 1)).tolist()
    assert colors_of([]).shape == (0, 3)


def test_the_package_cmap_has_the_same_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cmap")
    find = maps.importlib.util.find_spec
    monkeypatch.setattr(maps.importlib.util, "find_spec", lambda name: None if name == "matplotlib" else find(name))
    for name in ("viridis", "magma", "turbo", "gray", "Blues"):
        own = colormaps[name](np.arange(256), bytes=True)[:, :3]
        assert np.array_equal(np.rint(colors_of(np.arange(256), name) * 255), own)


def test_a_map_without_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maps.importlib.util, "find_spec", lambda name: None)
    words = "cmap: 'viridis' is a name, which needs the package cmap or matplotlib, which is not installed: "
    with pytest.raises(cltrace.MissingPackageError) as caught:
        pair(values=[1, 2])
    assert str(caught.value) == f"{words}pip install 'cltrace[cmap]'"
    assert isinstance(caught.value, ImportError)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    table = np.array([(255, 0, 0), (0, 0, 255)], np.uint8)
    assert pair(values=[1, 2], cmap=table).materials["color"].tolist() == [[1, 0, 0], [0, 0, 1]]


def test_later_values_have_the_map_and_the_limits_of_those_before(device: Device) -> None:
    values = np.arange(256.0)
    scene = unlit(256, values=values, cmap="magma")  # whose limits are those of its values
    for kept in (scene, scene.seen_by(CAMERA), scene.in_front_of("red"), pickle.loads(pickle.dumps(scene))):
        renderer = cltrace.Renderer(kept, device).update(kd=0).update(values=values / 2)
        colors = colormaps["magma"](values / 510, bytes=True)[:, :3] / np.float32(255)
        assert (renderer.scene.materials["color"] == colors).all()
        renderer.update(colors="red").update(values=values)
        assert (renderer.scene.materials["color"] == scene.materials["color"]).all()
        renderer.update(values=values, cmap="gray")
        assert renderer.scene.materials["color"][128].tolist() == [np.float32(128 / 255)] * 3
        renderer.update(values=values, clim=(0, 128))
        assert renderer.scene.materials["color"][200].tolist() == [1, 1, 1]
    frames = [{"values": values / 2}, {"values": values / 4, "clim": (0, 100)}, {"values": values / 4}]
    shown = [image.rgb8 for image in cltrace.animate(frames, scene=scene, device=device)]
    assert np.array_equal(shown[0], cltrace.render(unlit(256, values=values / 2, cmap="magma", clim=(0, 255))).rgb8)
    assert np.array_equal(shown[1], cltrace.render(unlit(256, values=values / 4, cmap="magma", clim=(0, 100))).rgb8)
    assert np.array_equal(shown[1], shown[2])


def test_a_function_that_cannot_be_pickled_is_asked_for_again() -> None:
    scene = pair(values=[1, 2], cmap=lambda t: np.column_stack([t, t, t]))
    there = pickle.loads(pickle.dumps(scene))
    assert (there.materials == scene.materials).all()
    with pytest.raises(ValueError, match=r"cmap: must be given again, as the scene's is a function that could not"):
        with_spheres(there, {"values": [1, 2]})
    assert with_spheres(there, {"values": [1, 2], "cmap": "gray"}).materials["color"].tolist() == [[0] * 3, [1] * 3]


def test_norms() -> None:
    values = np.array([1.0, 10.0, 100.0, 1000.0])
    wanted = colormaps["viridis"](np.array([0, 1 / 3, 2 / 3, 1]), bytes=True)[:, :3]
    for norm, clim in ((np.log10, None), (LogNorm(), None), (LogNorm(1, 1000), None), (LogNorm(3, 30), (1, 1000))):
        assert np.array_equal(np.rint(colors_of(values, "viridis", clim, norm) * 255), wanted)
    own = LogNorm()
    colors_of(values, "viridis", None, own)
    assert own.vmin is None  # it stays as it was
    tall = {"size": (200, 300), "color": "red"}
    bar = cltrace.colorbar("gray", (1, 1000), norm=LogNorm(), **tall)
    assert np.array_equal(cltrace.colorbar("gray", norm=LogNorm(1, 1000), **tall), bar)
    assert not np.array_equal(cltrace.colorbar("gray", (1, 1000), **tall), bar)
    # Four decades: their lines are as far from each other, a third of the bar's length.
    inside = (bar[..., 0] == bar[..., 1]) & (bar[..., 3] == 255)
    edge = int(inside.any(axis=0).sum())  # the first column beside the bar
    rows = np.flatnonzero(bar[:, edge, 3] == 255)
    assert len(rows) == 4
    assert np.ptp(np.diff(rows)) <= 1
    assert abs(np.diff(rows)[0] - inside.any(axis=1).sum() / 3) <= 1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"colors": ["red", "bleu"]}, "colors[1]: must be numbers, the name of a colour in CSS, or #rrggbb, got 'b"),
        ({"colors": "#12345"}, "colors: must be numbers, the name of a colour in CSS, or #rrggbb, got '#12345'"),
        ({"colors": "#ff000080"}, "colors: must have no alpha, got '#ff000080'"),
        ({"values": [1, np.nan]}, "values[1]: must not be nan, which has no colour; leave it out, or give colors"),
        ({"values": [1]}, "values: must have shape (2,), got (1,)"),
        ({"values": [[1, 2]]}, "values: must have shape (n,), got (1, 2)"),
        ({"values": [1, 2], "colors": "red"}, "values: must not be given together with colors"),
        ({"values": [1, 2], "cmap": "nope"}, "cmap: must be the name of a colour map of matplotlib"),
        ({"values": [1, 2], "cmap": 3}, "cmap: must be a name, a callable, or an array (k, 3) or (k, 4) of uint8"),
        ({"values": [1, 2], "cmap": lambda t: t}, "cmap: must make (2, 3) or (2, 4) of uint8 or floats of 2 numbers"),
        ({"values": [1, 2], "cmap": [(0.5, 0, 7.0)]}, "cmap: must make colours within 0..1, or bytes"),
        ({"values": [1, 2], "clim": (2, 1)}, "clim: must be two rising numbers, got 2, 1"),
        ({"clim": (0, 1)}, "clim: goes with values, which are not given"),
        ({"background": (1, 1, 1, 1.5)}, "background_alpha: must be within 0..1, as it is an alpha, got 1.5"),
        ({"transfer": "gamma"}, "transfer: must be linear or srgb, got 'gamma'"),
        ({"colors": [(1, 1, 1, 1), (1, 1, 1, 0.25)]}, "colors[1]: must have no alpha below 1, as surfaces are opaque"),
        ({"colors": np.array([(255, 1, 1, 255), (1, 1, 1, 9)])}, "colors[1]: must have no alpha below 255, "),
        ({"colors": [(127.5, 3.5, 1), (1, 1, 1)]}, "colors: must be linear with 1 as full, but numbers up to 127.5 "),
    ],
)
def test_what_is_no_colour_is_said(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        pair(**given)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("size", [(90, 200), (300, 48)])
def test_a_bar_has_round_numbers_beside_it(size: tuple[int, int]) -> None:
    bar = cltrace.colorbar("gray", (-1, 3), size, color="red")
    assert bar.shape == (size[1], size[0], 4)
    ink = (bar[..., :3] == (255, 0, 0)).all(axis=-1) & (bar[..., 3] > 0)
    bare = (bar[..., 0] == bar[..., 2]) & (bar[..., 3] == 255)
    assert bare.sum() > 1000
    assert ink.sum() > 50
    assert not (ink & bare).any()
    assert (bar[bar[..., 3] == 0][:, 0] == 255).all()  # the transparent rest has the colour of the ink
    with pytest.raises(ValueError, match=r"^size: must have room for the numbers, [0-9]+ pixels, got 9x12$"):
        cltrace.colorbar("gray", (-1, 3), (9, 12))

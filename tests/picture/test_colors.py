"""Colours as users write them: names, #rrggbb, and values through a colour map."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from matplotlib import colormaps

import cltrace
from cltrace.run.devices import Device
from cltrace.scene import colormaps as maps

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
    ):
        assert pair(colors=colors).materials["color"].tolist() == [list(red), list(teal)]
    assert pair(colors="TEAL").materials["color"].tolist() == [list(teal)]
    assert pair(background="red").background == red
    assert cltrace.Material("teal").color == teal
    for light in (cltrace.ambient_light("red"), cltrace.point_light((0, 0, 1), color="red")):
        assert light["color"].tolist() == [list(red)]


def test_unlit_surfaces_have_the_bytes_of_their_texts(device: Device) -> None:
    texts = [f"#{k:02x}{255 - k:02x}{k * 7 % 256:02x}" for k in range(256)]
    assert [f"#{bytes(c).hex()}" for c in bytes_shown(unlit(256, colors=texts), device)] == texts


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
    assert np.array_equal(np.rint(maps.colors_of(values, "magma", (0, 1)) * 255), expected)
    whole = map_((values + 5) / 12, bytes=True)[:, :3]
    assert np.array_equal(np.rint(maps.colors_of(values, "magma") * 255), whole)
    table = np.array([[1, 0, 0], [0, 0.3, 0], [0, 0, 1]], float)
    assert maps.colors_of([0, 1, 2, 3], table).tolist() == np.float32(table[[0, 1, 2, 2]]).tolist()
    assert maps.colors_of([0, 1], lambda t: np.column_stack([t, t / 2, 0 * t])).tolist() == [[0, 0, 0], [1, 0.5, 0]]
    assert maps.colors_of([3, 3], "magma").tolist() == maps.colors_of([0, 0], "magma", (0, 1)).tolist()
    assert maps.colors_of([]).shape == (0, 3)


def test_the_package_cmap_has_the_same_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cmap")
    find = maps.importlib.util.find_spec
    monkeypatch.setattr(maps.importlib.util, "find_spec", lambda name: None if name == "matplotlib" else find(name))
    for name in ("viridis", "magma", "turbo", "gray", "Blues"):
        own = colormaps[name](np.arange(256), bytes=True)[:, :3]
        assert np.array_equal(np.rint(maps.colors_of(np.arange(256), name) * 255), own)


def test_a_map_without_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maps.importlib.util, "find_spec", lambda name: None)
    words = (
        "cmap: 'viridis' is a name, which needs the package cmap or matplotlib, which is not installed: pip install "
    )
    with pytest.raises(cltrace.MissingPackageError) as caught:
        pair(values=[1, 2])
    assert str(caught.value) == words + "'cltrace[cmap]'"
    assert isinstance(caught.value, ImportError)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    table = np.array([(255, 0, 0), (0, 0, 255)], np.uint8)
    assert pair(values=[1, 2], cmap=table).materials["color"].tolist() == [[1, 0, 0], [0, 0, 1]]


def test_an_updated_renderer_shows_other_values(device: Device) -> None:
    values = np.arange(256)
    renderer = cltrace.Renderer(unlit(256, values=values), device)
    renderer.update(values=values[::-1], cmap="magma", clim=(0, 300))
    fresh = unlit(256, values=values[::-1], cmap="magma", clim=(0, 300))
    assert np.array_equal(renderer.render().rgb8, cltrace.render(fresh, device).rgb8)
    with pytest.raises(ValueError, match=r"^values: must have shape \(256,\), got \(3,\)$"):
        renderer.update(values=[1, 2, 3])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"colors": ["red", "bleu"]},
            "colors[1]: must be numbers, the name of a colour in CSS, or #rrggbb, got 'bleu'",
        ),
        ({"colors": np.array(["bleu", "red"])}, "colors[0]: must be numbers, the name of a colour in CSS, or #rrggbb"),
        ({"colors": "#12345"}, "colors: must be numbers, the name of a colour in CSS, or #rrggbb, got '#12345'"),
        ({"colors": "#ff000080"}, "colors: must have no alpha, got '#ff000080'"),
        ({"colors": ["red"] * 3}, "colors: must have shape (2, 3) or be one value, got (3, 3)"),
        ({"background": "sky"}, "background: must be numbers, the name of a colour in CSS, or #rrggbb, got 'sky'"),
        ({"values": [1, np.nan]}, "values[1]: must not be nan, which has no colour; leave it out, or give colors"),
        ({"values": [1, np.inf]}, "values[1]: must be a finite number, got inf"),
        ({"values": [1]}, "values: must have shape (2,), got (1,)"),
        ({"values": [[1, 2]]}, "values: must have shape (n,), got (1, 2)"),
        ({"values": [1, 2], "colors": "red"}, "values: must not be given together with colors"),
        ({"values": [1, 2], "cmap": "nope"}, "cmap: must be the name of a colour map of matplotlib"),
        ({"values": [1, 2], "cmap": 3}, "cmap: must be a name, a callable, or an array (k, 3) or (k, 4) of uint8"),
        ({"values": [1, 2], "cmap": lambda t: t}, "cmap: must make (2, 3) or (2, 4) of uint8 or floats of 2 numbers"),
        ({"values": [1, 2], "cmap": [(0.5, 0, 7.0)]}, "cmap: must make colours within 0..1, or bytes"),
        ({"values": [1, 2], "clim": (2, 1)}, "clim: must be two rising numbers, got 2, 1"),
        ({"values": [1, 2], "clim": 3}, "clim: must have shape (2,), got ()"),
        ({"clim": (0, 1)}, "clim: goes with values, which are not given"),
        ({"cmap": "viridis"}, "cmap: goes with values, which are not given"),
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

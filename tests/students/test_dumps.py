"""Numbers that a program has found on its way are compared, however it writes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image as Picture

import cltrace
from cltrace import cli
from cltrace.students.dumps import SO, compare_dump

SCENES = Path(__file__).parents[2] / "scenes"
Values = NDArray[Any]


@pytest.fixture(scope="module")
def scene() -> cltrace.Scene:
    found = cltrace.load(SCENES / "three-lights.xml")
    turned = replace(found.camera, resolution=(48, 32), up=(0.2, 1.0, 0.1))
    return found.seen_by(turned)


@pytest.fixture(scope="module")
def right(scene: cltrace.Scene) -> cltrace.Image:
    return cltrace.render(scene, outputs=("rgb8", "color", "normal", "direction", "depth", "id", "uv"))


def along_z(scene: cltrace.Scene, right: cltrace.Image) -> Values:
    return right.depth * -(right.direction @ np.array(scene.camera.basis())[2])


def grey(values: Values) -> Values:
    seen = np.isfinite(values)
    least, most = values[seen].min(), values[seen].max()
    return np.rint(np.where(seen, 250 - 200 * (np.where(seen, values, most) - least) / (most - least), 0)).astype(
        np.uint8
    )


# How a program may write each output, and words of how it is read.
WAYS: list[tuple[str, Callable[[cltrace.Scene, cltrace.Image], Values], str]] = [
    ("normal", lambda s, r: r.as_rgb8("normal"), "(v + 1)/2 in the world's axes"),
    ("normal", lambda s, r: r.as_rgb8("normal", s.camera.basis()), "(v + 1)/2 in the camera's axes"),
    ("normal", lambda s, r: r.normal, "numbers of -1..1 in the world's axes"),
    ("normal", lambda s, r: -r.normal @ np.array(s.camera.basis()).T, "numbers of -1..1 in the camera's axes, pointi"),
    ("normal", lambda s, r: (r.normal + 1) / 2, "(v + 1)/2 in the world's axes"),
    ("normal", lambda s, r: 3 * r.normal, "numbers of -1..1 in the world's axes, not of length 1"),
    ("normal", lambda s, r: np.abs(255 * r.normal).astype(np.uint8), "|v| in the world's axes"),
    ("direction", lambda s, r: r.as_rgb8("direction"), "(v + 1)/2 in the world's axes"),
    ("depth", lambda s, r: r.depth, "t along the ray"),
    ("depth", lambda s, r: along_z(s, r), "t along the camera's z axis"),
    ("depth", lambda s, r: r.as_rgb8("depth"), "a grey that is even in 1/t along the ray"),
    ("depth", lambda s, r: grey(r.depth), "a grey that is even in t along the ray"),
    ("id", lambda s, r: r.as_rgb8("id"), "one colour each"),
    ("uv", lambda s, r: r.uv, "u and v"),
    ("uv", lambda s, r: np.stack([r.uv[..., 0], 1 - r.uv[..., 1]], axis=2), "1 - v"),
    ("color", lambda s, r: r.color, "linear colours"),
    ("color", lambda s, r: np.minimum(255 * r.color, 255), "linear colours times 255, clamped to 1"),
]  # fmt: skip


@pytest.mark.parametrize(("show", "way", "how"), WAYS, ids=[f"{show}: {how}" for show, _, how in WAYS])
def test_each_way_to_write_is_found(
    scene: cltrace.Scene, right: cltrace.Image, show: str, way: Callable[..., Values], how: str
) -> None:
    dump = compare_dump(scene, show, np.ascontiguousarray(way(scene, right)))
    assert dump.same, str(dump)
    assert dump.how.startswith(how)
    assert SO[show] in str(dump)


@pytest.mark.parametrize("show", ["normal", "depth", "id", "direction", "uv", "color"])
def test_what_is_wrong_is_not_the_same(scene: cltrace.Scene, right: cltrace.Image, show: str) -> None:
    """Numbers of a part are those of another one: that part is told, and the others agree. Noise fits nothing."""
    mine = np.array(getattr(right, show), np.float64 if show != "id" else np.uint8)
    mine = np.repeat(mine[..., None], 3, axis=2) if show == "id" else mine
    part = mine.copy()
    part[10:20, 20:30] = part[10:20, 20:30][::-1, ::-1]
    dump = compare_dump(scene, show, part)
    assert 0.9 < dump.agreeing < 1
    assert dump.worst is not None
    x, y = dump.worst
    assert 20 <= x < 30
    assert 10 <= y < 20
    noise = (
        np.random.default_rng(3).random(mine.shape)
        if show != "id"
        else np.random.default_rng(3).integers(0, 255, mine.shape)
    )
    dump = compare_dump(scene, show, noise.astype(mine.dtype))
    assert dump.agreeing < 0.3
    assert "wrong, however it is read" in str(dump)


def test_the_command(right: cltrace.Image, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, name = str(SCENES / "three-lights.xml"), str(tmp_path / "mine.png")
    assert cli.main([path, "--size", "45x30", "--show", "lit", "-o", name]) == 0
    capsys.readouterr()
    assert cli.main([path, "--size", "45x30", "--show", "lit", "--compare", name]) == 0
    assert capsys.readouterr().out.startswith("lit, read as one colour each: the same.")
    with Picture.open(name) as picture:
        Picture.fromarray(np.array(picture)[::-1]).save(name)
    assert cli.main([path, "--size", "45x30", "--show", "lit", "--compare", name]) == 1
    assert "why: cltrace" in capsys.readouterr().out
    np.save(tmp_path / "mine.npy", np.array(["a"]))
    for wrong in (["--compare", str(tmp_path / "mine.npy")], ["--compare", str(tmp_path / "mine.npy"), "--truncate"]):
        assert cli.main([path, *wrong]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1

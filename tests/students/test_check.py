"""What --check and check() say of a picture."""

from __future__ import annotations

import numpy as np
import pytest

import cltrace
from cltrace.scene import Scene
from cltrace.scene.lights import lamps_of
from cltrace.students import check as module
from cltrace.students.check import check

SIZE = (30, 20)


def balls(lights: list[np.ndarray] | str = "studio", kd: float = 0.8) -> Scene:
    camera = cltrace.Camera((0, 0, 9), (0, 0, 0), horizontal_fov=30, resolution=SIZE)
    return Scene.from_spheres(camera, lights, [(-1, 0, 0), (1, 0, 0.5)], 1, (0.7, 0.5, 0.3), ka=0.2, kd=kd)


def drawn(scene: Scene) -> cltrace.Image:
    return cltrace.Renderer(scene, outputs=("rgb8", "id")).render()


@pytest.mark.parametrize("truncate", [False, True])
def test_a_byte_may_be_the_next_one_at_the_edge_of_a_level(truncate: bool) -> None:
    """A background of exactly such an edge, which a picture may have either way, and none that is farther from it."""
    edge = (100 if truncate else 100.5) / 255
    for colour, allowed in (
        (edge, (100, 101)),
        (edge - 1e-4, (100,)),
        (edge + 1e-4, (101,)),
        (edge - 3e-6, (100, 101)),
    ):
        scene = Scene.from_spheres(balls().camera, [], np.zeros((0, 3)), 1, (1, 1, 1), background=(colour,) * 3)
        image = drawn(scene)
        for byte in range(98, 104):
            byte -= truncate  # 99 and 100 are beside 100
            image.rgb8[...] = byte
            report = check(scene, image, "accurate", truncate=truncate)
            assert report.ok == (byte + truncate in allowed), (colour, byte, str(report))
            assert report.differing - report.rounded == (0 if report.ok else 600)


def test_one_pixel_may_be_off_by_a_level() -> None:
    scene, image = balls(), drawn(balls())
    image.rgb8[9:11, 15] ^= 1
    two = check(scene, image, "accurate")
    image.rgb8[10, 15] ^= 1
    one = check(scene, image, "accurate")
    assert (one.ok, two.ok, two.off_by_more, two.rounded) == (True, False, 0, 0)
    assert str(two).startswith(
        "check FAILED: 600 of 600 pixels against the reference, precision accurate: 0 other ids, 2"
    )
    assert two.where == [(15, 9), (15, 10)]
    image.rgb8[9, 15] ^= 3
    assert not check(scene, image, "accurate").ok


def test_lights_make_the_sample_smaller(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "DEFAULT_TESTS", 50_000)
    few, many = balls([cltrace.point_light((5, 5, 5))]), balls([cltrace.sky_light(directions=64)])
    assert len(lamps_of(many.lights)[0]) == 64
    reports = [check(scene, drawn(scene), "accurate") for scene in (few, many)]
    assert [(report.pixels, bool(report.shrunk)) for report in reports] == [(595, True), (18, True)]
    assert "ms a pixel for 2 spheres and 64 lights" in str(reports[1])


def test_what_cannot_be_compared_is_refused() -> None:
    scene = balls()
    part = cltrace.Renderer(scene, outputs=("rgb8", "id"), crop=(3, 4, 13, 10)).render()
    with pytest.raises(ValueError, match=r"^check: the image has 10x6 pixels, the camera 30x20; see origin$"):
        check(scene, part, "accurate")
    assert check(scene, part, "accurate", origin=(3, 4)).ok
    assert not check(scene, part, "accurate", origin=(0, 0)).ok
    with pytest.raises(ValueError, match=r"^pixels: must be at least 1, got 0$"):
        check(scene, drawn(scene), "accurate", pixels=0)

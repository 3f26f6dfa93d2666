"""`explain`: the numbers that it prints are those of the picture."""

from __future__ import annotations

import functools
import random
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENES

import cltrace
from cltrace.explanation.pixel import Explainer
from cltrace.reference import byte_of
from cltrace.run.devices import Device

FIRST = SCENES[0].parent / "first.xml"
SLOW_SCENES = ("room", "thousand")  # whose pixels take the reference 50 ms and more


@functools.cache
def drawn(path: Path, device: Device) -> tuple[cltrace.Scene, cltrace.Image]:
    scene = cltrace.load(path)
    return scene, cltrace.render(scene, device, outputs=("rgb8", "id"))


def printed_bytes(explanation: cltrace.Explanation) -> tuple[list[int], list[int]]:
    """The bytes of the terms of the pixel's own sum, added as they are printed, and the bytes that are printed."""
    lines = str(explanation).split("\n")
    begin = max(i for i, line in enumerate(lines) if line.startswith("Sum "))
    end = next(i for i in range(begin, len(lines)) if lines[i].startswith("  = color"))
    terms = lines[begin + 1 : end]
    for i, line in enumerate(terms):
        if line.startswith("  = local color"):
            terms = terms[i + 1 :]
            break
    rows = np.array([[float(word) for word in line.split()[-3:]] for line in terms]).reshape(-1, 3)
    bytes_ = [byte_of(channel, explanation.truncate) for channel in rows.sum(axis=0)]
    return bytes_, [int(word) for word in lines[-1].split()[-3:]]


def check_scene(path: Path, device: Device, pixels: int) -> None:
    scene, image = drawn(path, device)
    explainer, (width, height) = Explainer(scene), scene.camera.resolution
    place = random.Random(path.name)
    for _ in range(pixels):
        x, y = place.randrange(width), place.randrange(height)
        found = explainer.pixel(x, y)
        hit = found.rays[0].hit
        assert found.rgb8 == tuple(image.rgb8[y, x].tolist()), (x, y)
        assert (hit.surface.id if hit else -1) == image.id[y, x], (x, y)
        assert np.allclose(found.rays[0].color, found.color, rtol=1e-12, atol=1e-14), (x, y)
        assert printed_bytes(found) == (list(found.rgb8), list(found.rgb8)), (x, y)


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_the_printed_terms_add_up_to_the_pictures_bytes(path: Path, device: Device) -> None:
    check_scene(path, device, 2 if path.stem in SLOW_SCENES else 15)


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_the_printed_terms_add_up_to_the_pictures_bytes_everywhere(path: Path, device: Device) -> None:
    check_scene(path, device, 200 if path.stem in SLOW_SCENES else 1000)

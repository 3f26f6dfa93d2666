"""The kernel against the exact oracle: 21 regimes, no excused band."""

from __future__ import annotations

import numpy as np
import pytest

import cltrace
from cltrace.bench.oracle import closest
from cltrace.bench.regimes import REGIMES, camera_space, rays
from cltrace.run.devices import Device

THINNED = (8_000, 2)
LONG = (1_050_000, 12)


def compare(name: str, device: Device, precision: str, total: int, seeds: int) -> None:
    """`total` rays of a regime, over several seeds: no other id, t within 0.52 ulp of float32 and 1e-8 in double."""
    make = dict(REGIMES)[name]
    side = int(np.ceil(np.sqrt(total / seeds)))
    wrong = 0
    for seed in range(seeds):
        scene = make(seed, size=(side, side))
        image = cltrace.render(scene, device, precision, ("id", "depth"))
        assert image.id is not None
        assert image.depth is not None
        d = rays(scene.camera)
        index, t = closest(camera_space(scene)[0], d, *camera_space(scene)[1:])
        wrong += int((image.id.ravel() != index).sum())
        hit = index >= 0
        exact = np.float64(t[hit].astype(np.longdouble) * np.sqrt((d[hit].astype(np.longdouble) ** 2).sum(axis=1)))
        got = image.depth.ravel()[hit]
        assert np.abs(got / exact - 1).max(initial=0) <= 1e-8
        ulps = np.abs(got.astype(np.float32).astype(np.longdouble) - exact) / np.spacing(exact.astype(np.float32))
        assert ulps.max(initial=0) <= 0.52
    assert wrong == 0


@pytest.mark.parametrize("name", [name for name, _ in REGIMES])
@pytest.mark.parametrize("precision", ["accurate", "double"])
def test_regime(device: Device, name: str, precision: str) -> None:
    compare(name, device, precision, *THINNED)


@pytest.mark.stress
@pytest.mark.parametrize("name", [name for name, _ in REGIMES])
def test_regime_with_a_million_rays(device: Device, name: str) -> None:
    compare(name, device, "accurate", *LONG)

"""Lights: a file for each kind, and the table of them, by the number that a scene has for the kind."""

from collections.abc import Callable, Iterable

import numpy as np

from cltrace.reference.exact import Frame
from cltrace.reference.lights.lambert import LambertLight
from cltrace.reference.lights.light import Light, ShadowRay
from cltrace.reference.lights.parallel import ParallelLight
from cltrace.reference.lights.point import PointLight
from cltrace.reference.lights.spot import SpotLight
from cltrace.scene import LAMBERT, PARALLEL, POINT, SPOT

# What makes each kind from a scene's light, the camera's position in the world, and its axes.
KINDS: dict[int, Callable[[np.void, Iterable[float], Frame], Light]] = {
    PARALLEL: ParallelLight.of,
    POINT: PointLight.of,
    SPOT: SpotLight.of,
    LAMBERT: LambertLight.of,
}

__all__ = ["KINDS", "LambertLight", "Light", "ParallelLight", "PointLight", "ShadowRay", "SpotLight"]

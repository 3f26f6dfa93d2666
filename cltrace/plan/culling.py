"""What cannot matter: spheres inside others or there twice, and those that cannot stand between one and a light.

All tests are made with every sphere larger by more than any rounding, here or in the kernel, can amount to: a sphere is
left out only if no ray could ever tell, so no picture changes. (Extreme scenes in single: docs/accuracy.md.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.exact import Array, squared_length
from cltrace.plan.shapes.sphere import Seen

Mask = NDArray[np.bool_]
# Spheres that others are looked for in: the largest ones.
SHELLS = 8


def larger(radius: Array, slack: float) -> Array:
    """Radii with room for rounding. slack: relative to lengths, of 4 at most; in a discriminant it moves the silhouette
    of a sphere of radius r at such a distance by 16 slack / r.
    """
    return radius + 16 * slack * (1 + 1 / radius)


def hidden(center: Array, radius: Array, outside: Mask, slack: float) -> Mask:
    """Which spheres lie inside a larger one, one of the SHELLS largest, that has the eye and all lights outside of it.

    Whoever looks at such a sphere, eye or light, sees the larger one: all spheres are opaque. center: (n, 3), lengths
    at most 4; outside: (n,), whether eye and lights are outside of this sphere.
    """
    out = np.zeros(len(radius), bool)
    roomy = larger(radius, slack)
    least = radius.min(initial=np.inf)
    largest = np.argpartition(-radius, SHELLS)[:SHELLS] if len(radius) > SHELLS else np.arange(len(radius))
    for shell in largest:
        inner = 2 * radius[shell] - roomy[shell]
        if outside[shell] and inner > least:
            near = np.flatnonzero(np.abs(center[:, 0] - center[shell, 0]) < inner)
            out[near] |= np.sqrt(squared_length(center[near] - center[shell])) + roomy[near] < inner
    return out


def repeated(center: Array, radius: Array, by_place: bool) -> Mask:
    """(n,): which spheres are the same as one before them: of those, the first one counts.

    by_place: whether they are in the order of spatial_order(). There only neighbours are compared: equal ones mostly
    are some.
    """
    order = np.arange(len(radius)) if by_place else np.lexsort((radius, *center.T))
    c, r = center[order], radius[order]
    out = np.zeros(len(radius), bool)
    out[order[1:]] = (r[1:] == r[:-1]) & (c[1:] == c[:-1]).all(axis=1)
    return out


def point_shadows(seen: Seen, slack: float) -> Mask:
    """(n, n): whether sphere [j] can stand between a light and any point of sphere [i]. seen: from the light."""
    roomy = larger(seen.radius, slack)
    distance = np.sqrt(squared_length(seen.center))
    # A light inside of a sphere, or all but, sees it everywhere.
    clear = distance > roomy
    safe = np.where(clear, distance, 1.0)
    half = np.where(clear, np.arcsin(np.minimum(roomy / safe, 1)), np.pi)
    direction = seen.center / safe[:, None]
    cross = np.cross(direction[:, None], direction[None])
    angle = np.arctan2(np.sqrt((cross * cross).sum(axis=-1)), direction @ direction.T)
    loose = 16 * slack * (1 + 1 / safe)
    overlap = angle <= (half + loose)[:, None] + (half + loose)[None]
    return np.asarray(overlap & ((distance - roomy)[None] < (distance + roomy)[:, None]))


def parallel_shadows(axes: Array, seen: Seen, slack: float) -> Mask:
    """The same for a parallel light. axes: (3, 3), two across the light and one towards it."""
    roomy = larger(seen.radius, slack) + slack * 16
    u, v, s = axes @ seen.center.T
    gap = np.hypot(u[:, None] - u[None], v[:, None] - v[None])
    return np.asarray((gap <= roomy[:, None] + roomy[None]) & ((s + roomy)[None] > (s - roomy)[:, None]))

"""Simulation boxes: their edges and corners as cylinders and spheres show them, their images, and axes."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.limits import MAX_BOXES, MAX_IMAGES
from cltrace.scene.rules import ANY, POSITIVE, check_rule, checked, described, numbers, vector

Floats = NDArray[np.float64]


def box_of(box: ArrayLike) -> Floats:
    """(3, 3): the edges of a box of three lengths, or of three vectors as rows. Raises ValueError, which names it."""
    given = numbers("box", box)
    if given.shape not in ((3,), (3, 3)):
        raise ValueError(f"box: must be 3 lengths or a (3, 3) matrix of its edges, got shape {given.shape}")
    check_rule("box", POSITIVE if given.ndim == 1 else ANY, given)
    edges = np.diag(given) if given.ndim == 1 else given
    sizes = np.sqrt((edges * edges).sum(axis=1))
    if not sizes.all() or abs(np.linalg.det(edges / sizes[:, None])) < 2.0**-40:
        raise ValueError("box: must not be flat")
    return np.asarray(edges)


def box_edges(box: ArrayLike, origin: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[Floats, Floats]:
    """The starts and ends, (12, 3) each, of the edges of a box, for Scene.with_cylinders().

    box: its three lengths along x, y and z, or a (3, 3) matrix whose rows are its edges; origin: its corner, scene
    units. Raises ValueError, which names the argument.
    """
    edges, corner = box_of(box), np.array(vector("origin", origin))
    starts, ends = [], []
    for k in range(3):
        for i in (0, 1):
            for j in (0, 1):
                start = corner + i * edges[(k + 1) % 3] + j * edges[(k + 2) % 3]
                starts.append(start)
                ends.append(start + edges[k])
    return np.array(starts), np.array(ends)


def box_corners(box: ArrayLike, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Floats:
    """The corners, (8, 3), of a box, where spheres make the ends of its edges round. The arguments are those of
    box_edges()."""
    edges, corner = box_of(box), np.array(vector("origin", origin))
    return corner + np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) @ edges


def box_images(box: ArrayLike, counts: ArrayLike) -> Floats:
    """The offsets, (k, 3), from a periodic box to its images side by side, its own first, for Scene.replicate().

    box: as of box_edges(); counts: how many boxes there are along each of the three edges. Raises ValueError, which
    names the argument.
    """
    edges, given = box_of(box), numbers("counts", counts)
    if given.shape != (3,) or not (given >= 1).all() or (given % 1).any():
        raise ValueError(f"counts: must be 3 whole numbers of at least 1, got {described(counts)}")
    if given.prod() > MAX_BOXES:
        raise ValueError(f"counts: must be at most {MAX_BOXES} boxes in all, got {given.prod():g}")
    return np.array(list(itertools.product(*(range(int(count)) for count in given)))) @ edges


def axes(length: float = 1.0, origin: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[Floats, Floats]:
    """The starts and ends, (3, 3) each, of the axes x, y and z from a point, for Scene.with_cylinders().

    length: scene units. Raises ValueError, which names the argument.
    """
    starts = np.tile(np.array(vector("origin", origin)), (3, 1))
    return starts, starts + float(checked("length", POSITIVE, length, ())) * np.eye(3)


def to_nearest(way: Floats, box: Floats) -> Floats:
    """(k, 3): what takes the ends of ways, (k, 3), to those of their images in a periodic box that are nearest.

    Along each edge, the image in the cell about the start is within half of it. No nearer one is further than that, so
    a box that is higher than all bonds has none. Raises ValueError if there are too many boxes to look at.
    """
    inverse = np.linalg.inv(box)
    first = -np.einsum("ij,jk->ik", np.rint(np.einsum("ij,jk->ik", way, inverse)), box)
    least = np.square(way + first).sum(axis=1)
    far = np.sqrt(least.max(initial=0))
    most = np.floor(far * np.sqrt(np.square(inverse).sum(axis=0)) + 0.5)
    if np.prod(2 * most + 1) > MAX_IMAGES:
        raise ValueError(f"box: is too flat for bonds that are {far:g} long; shorter edges may give the same images")
    nearest = first
    for steps in itertools.product(*(range(-int(n), int(n) + 1) for n in most)):
        shift = first + np.einsum("j,jk->k", np.array(steps, float), box)
        square = np.square(way + shift).sum(axis=1)
        shorter = square < least * (1 - 2.0**-40)
        nearest, least = np.where(shorter[:, None], shift, nearest), np.where(shorter, square, least)
    return np.asarray(nearest)

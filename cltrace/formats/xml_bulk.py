"""Spheres by the thousand: those that are laid out as in the format's listing are converted together.

A row is a sphere: 14 numbers in the order of the file, which are its radius, centre, colour, Phong coefficients,
reflectance, transmittance and index of refraction, and then its index into the maps of the ellipsoids, -1 for a sphere.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.formats.xml_elements import ELEMENTS
from cltrace.formats.xml_values import NUMBER
from cltrace.scene import MATERIAL, SPHERE

ROW = 15
NO_ROW = (math.nan,) * ROW


def _layout(tag: str) -> str:
    """The pattern of an element as libxml2 writes it, laid out as in the format's listing; a group for each number."""
    schema = ELEMENTS[tag]
    start = tag + "".join(rf' {name}="({NUMBER})"' for name in schema.attributes)
    children = "".join(_layout(slot.split("|")[0]) + r"\s*" for slot in schema.children)
    return rf"<{start}>\s*{children}</{tag}>" if children else f"<{start}/>"


def _rules(tag: str) -> Iterator[Any]:
    """The rule of each number of that pattern, in the same order."""
    schema = ELEMENTS[tag]
    yield from schema.attributes.values()
    for slot in schema.children:
        yield from _rules(slot.split("|")[0])


_STANDARD = re.compile(_layout("sphere").encode())
_COLUMNS = [*_rules("sphere")]
_T, _INDEX = 12, 13  # the columns of the transmittance and the index of refraction


def bulk(spheres: Sequence[etree._Element]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which spheres are laid out as usual and free of faults, (n,), and their rows, (n, 15); NaN for the others."""
    found = [_STANDARD.fullmatch(etree.tostring(sphere, with_tail=False)) for sphere in spheres]
    usual = [i for i, match in enumerate(found) if match]
    written = [text for match in found if match for text in match.groups()]
    values = np.array(list(map(float, written))).reshape(len(usual), len(_COLUMNS))
    ok = np.ones(len(usual), np.bool_)
    for column, rule in enumerate(_COLUMNS):
        ok &= rule.admits(values[:, column])
    ok &= (values[:, _T] == 0) | (values[:, _INDEX] > 0)
    # A number that reads as 0 but is not written so may have underflowed.
    ok[[i // len(_COLUMNS) for i in np.flatnonzero(values == 0).tolist() if written[i].strip(b"+-0.")]] = False
    good = np.zeros(len(spheres), np.bool_)
    good[usual] = ok
    rows = np.full((len(spheres), ROW), np.nan)
    rows[good, :-1], rows[good, -1] = values[ok], -1
    return good, rows


def packed(rows: NDArray[np.float64]) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """(n,) SPHERE and (m,) MATERIAL records; equal materials are one record, in the order of their first use.

    Where nothing is let through, any index of refraction is as good as another: there it is 1.
    """
    shades = np.ascontiguousarray(rows[:, 4:-1]) + 0.0  # makes -0 a 0, as they are compared as bytes
    shades[rows[:, _T] == 0, -1] = 1
    _, first, of_sphere = np.unique(
        shades.view(f"V{shades.itemsize * shades.shape[1]}"), return_index=True, return_inverse=True
    )
    order = np.argsort(first)
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order))
    spheres = np.empty(len(rows), SPHERE)
    spheres["radius"], spheres["center"], spheres["material"] = rows[:, 0], rows[:, 1:4], rank[of_sphere.ravel()]
    spheres["to_object"] = rows[:, -1]
    materials = np.empty(len(order), MATERIAL)
    materials["texture"] = -1
    shades = shades[first[order]]
    materials["color"] = shades[:, :3]
    for column, name in enumerate(("ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index"), 3):
        materials[name] = shades[:, column]
    return spheres, materials

"""Spheres by the thousand: those that are laid out as in the format's listing are converted together.

A row is a sphere: 14 numbers in the order of the file, which are its radius, centre, colour, Phong coefficients,
reflectance, transmittance and index of refraction; then the index of its texture, -1 for none, and its index into the
maps of the ellipsoids, -1 for a sphere. A finish is what a row has of the material: the colour up to the texture.
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

ROW, FINISH, FINISHED = 16, slice(4, 15), 11
SHARES = slice(7, 9)  # of a finish: the reflectance and the transmittance
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
    rows[good, :-2], rows[good, -2:] = values[ok], -1
    return good, rows


def packed_spheres(rows: NDArray[np.float64], materials: NDArray[np.integer[Any]]) -> NDArray[np.void]:
    """(n,) SPHERE records of rows; materials: (n,), the indices of theirs."""
    spheres = np.empty(len(rows), SPHERE)
    spheres["radius"], spheres["center"] = rows[:, 0], rows[:, 1:4]
    spheres["material"], spheres["to_object"] = materials, rows[:, -1]
    return spheres


def packed_materials(finishes: NDArray[np.float64]) -> tuple[NDArray[np.void], NDArray[np.int32]]:
    """(m,) MATERIAL records and the index of that of each finish, (n, 11).

    Equal materials are one record, in the order of their first use. Where nothing is let through, any index of
    refraction is as good as another: there it is 1.
    """
    shades = np.ascontiguousarray(finishes) + 0.0  # makes -0 a 0, as they are compared as bytes
    shades[shades[:, 8] == 0, 9] = 1
    _, first, of_finish = np.unique(
        shades.view(f"V{shades.itemsize * shades.shape[1]}"), return_index=True, return_inverse=True
    )
    order = np.argsort(first)
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order))
    materials = np.empty(len(order), MATERIAL)
    shades = shades[first[order]]
    materials["color"] = shades[:, :3]
    names = ("ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index", "texture")
    for column, name in enumerate(names, 3):
        materials[name] = shades[:, column]
    return materials, rank[of_finish.ravel()]

"""Spheres and ellipsoids: their records, and what spheres and materials hold as arrays.

The surface is { x : |K (x - center)| = radius } with K, the linear map from the world to the object's own axes, an
entry of the scene's to_object, or 1 without one. Plain arrays give a column for each quantity.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import inverses
from cltrace.base.arrays import blockwise
from cltrace.base.limits import MAX_SPHERES
from cltrace.scene.colors import color_numbers
from cltrace.scene.materials import COEFFICIENTS, MATERIAL, Frozen, check_index, packed
from cltrace.scene.rules import (
    ANY,
    NOT_NEGATIVE,
    POSITIVE,
    Rule,
    check_none,
    check_not_bytes,
    check_rule,
    numbers,
    real_numbers,
)
from cltrace.scene.surfaces import Floats, Surfaces, moved

SPHERE = np.dtype(
    [
        ("center", "f8", (3,)),  # scene units
        ("radius", "f8"),  # scene units
        ("material", "i4"),  # index into the scene's materials
        ("to_object", "i4"),  # index into the scene's to_object; -1: a sphere
    ]
)
MAX_DEVIATION = 2.0**-24  # of an ellipsoid's distances from its centre: depths are given to no more


def check_spheres(spheres: NDArray[np.void], materials: int, to_object: NDArray[np.float64]) -> None:
    """Raises ValueError, which names field and index, where a SPHERE array holds what is not allowed.

    materials: how many there are; to_object: (k, 3, 3), of numbers that the rules allow.
    """
    if len(spheres) > MAX_SPHERES:
        raise ValueError(f"spheres: must be at most {MAX_SPHERES}, got {len(spheres)}")
    check_rule("spheres.center", ANY, spheres["center"])
    check_rule("spheres.radius", POSITIVE, spheres["radius"])
    of, maps = spheres["material"], spheres["to_object"]
    check_none("spheres.material", (of < 0) | (of >= materials), "the index of a material", of)
    words = "-1 or the index of one of to_object"
    check_none("spheres.to_object", (maps < -1) | (maps >= len(to_object)), words, maps)
    reach = reaches(to_object)
    singular = np.isnan(reach).any(axis=1)
    if singular.any():
        raise ValueError(f"to_object[{int(np.argmax(singular))}]: must not be singular")
    check_extents("spheres.radius[{}]: ", spheres["radius"], maps, reach)


def check_extents(place: str, radii: NDArray[Any], maps: NDArray[np.int32], reach: NDArray[np.float64]) -> None:
    """Raises ValueError where one of n ellipsoids reaches too far, or not far enough. place: where its index is {}.

    radii: (n,) or (); maps: (n,), the index of the map of each, -1 for none; reach: (k, 3), of each map.
    """
    bent = np.flatnonzero(maps >= 0)
    for i, fault in extent_faults(np.broadcast_to(radii, maps.shape)[bent], reach[maps[bent]]):
        raise ValueError(place.format(bent[i]) + fault)


def inverse_faults(to_world: NDArray[np.float64], to_object: NDArray[np.float64]) -> Iterator[tuple[int, str]]:
    """What is wrong with the maps of ellipsoids, each with its index, in words that belong behind "transform: ".

    to_world: L, (n, 3, 3), what makes an ellipsoid of a sphere; to_object: K, (n, 3, 3), its inverses as they were
    rounded, NaN for none.
    """
    # With E = K L - 1, K is (1 + E) L^-1. So where the surface is to have |L^-1 x| = r, |K x| differs from r by |E| r
    # at most: points have an error of at most that share of their distance from the centre. |E| is at most the square
    # root of the sum of its squares.
    with np.errstate(over="ignore", invalid="ignore"):
        errors = np.sqrt(np.square(_products(to_object, to_world) - np.eye(3)).sum(axis=(1, 2)))
    admitted = ANY.admits(to_object)
    for i in np.flatnonzero(~admitted.all(axis=(1, 2)) | ~(errors <= MAX_DEVIATION)).tolist():
        extreme = to_object[i][~admitted[i]].tolist()
        if np.isnan(to_object[i]).any() or (not extreme and np.isnan(errors[i])):
            yield i, "must not be singular"
        elif extreme:
            yield i, f"its inverse {ANY.fault(extreme[0])}"
        else:
            yield i, "must not distort so much that rounding spoils its inverse"


def extent_faults(radii: NDArray[np.float64], reach: NDArray[np.float64]) -> Iterator[tuple[int, str]]:
    """Ellipsoids that reach too far, or not far enough, each with its index and words that begin with what is wrong.

    Half of the extent along each axis of the world obeys the rule of a radius. radii: (n,); reach: (n, 3), the same
    halves with radius 1.
    """
    with np.errstate(over="ignore"):
        extents = radii[:, None] * reach
    bad = ~POSITIVE.admits(extents)
    for i in np.flatnonzero(bad.any(axis=1)).tolist():
        axis = int(np.argmax(bad[i]))
        yield i, f"half of the extent along {'xyz'[axis]} {POSITIVE.fault(float(extents[i, axis]))}"


def reaches(to_object: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half of the extents along the axes of the world of the ellipsoids of radius 1 with (k, 3, 3) maps, (k, 3).

    NaN of a singular map.
    """
    return row_lengths(inverses(to_object))


def row_lengths(maps: NDArray[np.float64]) -> NDArray[np.float64]:
    """The lengths of the rows of (k, 3, 3) maps, (k, 3); one beyond 1e154 may be infinite."""
    with np.errstate(over="ignore"):
        return np.asarray(np.sqrt(np.square(maps).sum(axis=2)))


def shaped(
    radius: NDArray[Any], n: int, transform: ArrayLike | None
) -> tuple[NDArray[Any], NDArray[np.int32], NDArray[np.float64]]:
    """What a linear map makes of n spheres: their radii, which of the maps each of them has, and the scene's to_object.

    Raises ValueError, which names the argument and the index.
    """
    if transform is None:
        return radius, np.array(-1, np.int32), np.empty((0, 3, 3))
    to_world = numbers("transform", transform)
    if to_world.shape not in ((3, 3), (n, 3, 3)):
        raise ValueError(f"transform: must have shape (3, 3) or {(n, 3, 3)}, got {to_world.shape}")
    check_rule("transform", ANY, to_world)
    maps = to_world.reshape(-1, 3, 3)
    scales = uniform_scales(maps)
    bent = np.flatnonzero(np.isnan(scales))
    to_object = inverses(maps[bent])
    for i, fault in inverse_faults(maps[bent], to_object):
        raise ValueError(f"transform{f'[{bent[i]}]' if to_world.ndim == 3 else ''}: {fault}")
    radii = np.broadcast_to(radius * np.where(np.isnan(scales), 1.0, scales), (n,))
    for i in np.flatnonzero(~POSITIVE.admits(radii)).tolist():
        raise ValueError(f"transform: of sphere {i}, the radius {POSITIVE.fault(float(radii[i]))}")
    index = np.full(len(maps), -1, np.int32)
    index[bent] = np.arange(len(bent))
    of_sphere = np.array(np.broadcast_to(index, (n,)))
    check_extents("transform: of sphere {}, ", radii, of_sphere, row_lengths(maps[bent]))
    return np.array(radii), of_sphere, to_object


def uniform_scales(maps: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how much each of (n, 3, 3) maps scales all lengths, (n,); NaN where it is not by the same in all directions.

    That is decided to 2^-50 of L^T L, within which rounding leaves a rotation and a uniform scale.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        square = _products(maps.transpose(0, 2, 1), maps)
        mean = np.trace(square, axis1=1, axis2=2) / 3
        off = np.abs(square - mean[:, None, None] * np.eye(3)).max(axis=(1, 2), initial=0)
        return np.where((off <= 2.0**-50 * mean) & (mean > 0), np.sqrt(mean), np.nan)


def _products(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The products of (n, 3, 3) matrices, rounded alike on every machine, which `@` does not promise."""
    x, y, z = (a[:, :, k, None] * b[:, k, None, :] for k in range(3))
    return (x + y) + z


Shade = Mapping[str, NDArray[Any]]
# The arguments of a material, by the names of MATERIAL's fields.
ARGUMENTS = {"color": "colors", **{name: name for name in (*COEFFICIENTS, "index")}}


@dataclass(frozen=True, eq=False)
class Columns(Frozen):
    """n spheres and m materials. A quantity that all of them share is one value, without the first axis. Read-only.

    center: (n, 3), and radius: (n,) or (), in scene units; material: (n,) or (), index of a sphere's material, None
    where each sphere has its own, in the same order; to_object: (n,) or (), index of the map of an ellipsoid, -1 for
    none; shade: color (m, 3) or (3,), and the other fields of MATERIAL, (m,) or (), by their names; count: m; rest:
    MATERIAL, those of meshes alone, which come after these; follows: whether ka is kd, as it was not given. Numbers are
    float32 or float64.
    """

    center: NDArray[Any]
    radius: NDArray[Any]
    material: NDArray[np.int32] | None
    to_object: NDArray[np.int32]
    shade: Shade
    count: int
    rest: NDArray[np.void] = field(default_factory=lambda: np.zeros(0, MATERIAL))
    follows: bool = False

    def __post_init__(self) -> None:
        self.__setstate__(vars(self).copy())

    def __len__(self) -> int:
        """n."""
        return len(self.center)

    @classmethod
    def of_records(cls, spheres: NDArray[np.void], materials: NDArray[np.void]) -> Columns:
        """Views of SPHERE and MATERIAL arrays."""
        shade = {name: materials[name] for name in (*ARGUMENTS, "texture")}
        center, radius, material, to_object = (spheres[name] for name in ("center", "radius", "material", "to_object"))
        return cls(center, radius, material=material, to_object=to_object, shade=shade, count=len(materials))

    @property
    def materials_count(self) -> int:
        """How many materials there are in all."""
        return self.count + len(self.rest)

    @property
    def material_of(self) -> NDArray[np.int32]:
        """(n,) or (): the index of each sphere's material."""
        return np.arange(len(self), dtype=np.int32) if self.material is None else self.material

    def with_more(self, materials: NDArray[np.void]) -> Columns:
        """The same with more MATERIAL records, after all others."""
        return replace(self, rest=np.concatenate([self.rest, materials]))

    def every_shade(self) -> Shade:
        """As `shade`, of all materials: those of the spheres, then the rest."""
        if not len(self.rest):
            return self.shade
        found = {}
        for name in MATERIAL.names or ():
            width = (3,) if name == "color" else ()
            own = np.broadcast_to(self.shade.get(name, np.array(-1, np.int32)), (self.count, *width))
            found[name] = np.concatenate([own, self.rest[name]])
        return found

    @functools.cached_property
    def spheres(self) -> NDArray[np.void]:
        """(n,) SPHERE."""
        out = np.empty(len(self), SPHERE)
        out["center"], out["radius"], out["to_object"] = self.center, self.radius, self.to_object
        out["material"] = self.material_of
        out.flags.writeable = False
        return out

    @functools.cached_property
    def materials(self) -> NDArray[np.void]:
        """(m,) MATERIAL."""
        out = packed(self.materials_count, self.every_shade())
        out.flags.writeable = False
        return out


def points(centers: ArrayLike, radii: ArrayLike) -> NDArray[Any]:
    """The centres as an (n, 3) array; ValueError if they are none, with advice where they and the radii are swapped."""
    found = real_numbers("centers", centers)
    if found.shape == (0,):  # an empty list
        return found.reshape(0, 3)
    if found.ndim == 2 and found.shape[1] == 3:
        if len(found) > MAX_SPHERES:
            raise ValueError(f"centers: must be at most {MAX_SPHERES}, got {len(found)}")
        check_rule("centers", ANY, found)
        return found
    words = f"centers: must have shape (n, 3), got {found.shape}"
    if found.ndim < 2 and np.shape(numbers("radii", radii))[1:] == (3,):
        words += f"; radii has shape {np.shape(radii)}: are the two swapped?"
    raise ValueError(words)


def shades(given: Mapping[str, ArrayLike], n: int) -> dict[str, NDArray[Any]]:
    """Columns of materials: what users gave for n spheres, by the names of MATERIAL's fields, as checked copies.

    Raises ValueError, which names the argument and the index.
    """
    found = {}
    for name, value in given.items():
        if name == "color":
            found[name] = column("colors", NOT_NEGATIVE, color_numbers("colors", value), (n, 3))
            check_not_bytes("colors", found[name], reflected=True)
        else:
            found[name] = column(ARGUMENTS[name], ANY if name == "index" else NOT_NEGATIVE, value, (n,))
    if "index" in found and "transmittance" in found:
        check_index("index", found["index"], found["transmittance"])
    return found


def column(name: str, rule: Rule, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[Any]:
    """One value, or one for each of shape[0], as a checked copy of `shape` or shape[1:].

    Raises ValueError, which names the argument and the index.
    """
    array = real_numbers(name, value)
    if array.shape == shape[:1] == (0,):  # an empty list
        return array.reshape(shape)
    try:
        whole = np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(f"{name}: must have shape {shape} or be one value, got {array.shape}") from None
    check_rule(name, rule, array)
    if array.shape in (shape, shape[1:]):
        return array
    if array.size == 1 and len(shape) == 1:
        return array.reshape(())
    return np.array(whole)


@dataclass(frozen=True, eq=False)
class Spheres(Surfaces):
    """columns: what they and materials hold; to_object: (k, 3, 3), the maps of ellipsoids."""

    columns: Columns
    to_object: Floats
    words: ClassVar[str] = "spheres"
    most: ClassVar[float] = MAX_SPHERES

    def __len__(self) -> int:
        return len(self.columns)

    def moved(self, moves: Floats, first: int, spheres: int) -> Spheres:
        of, k = self.columns, len(moves)
        radius, kind, material = (np.tile(x, k) if x.ndim else x for x in (of.radius, of.to_object, of.material_of))
        center = moved("centers", of.center, moves)
        return replace(self, columns=replace(of, center=center, radius=radius, to_object=kind, material=material))

    def reach(self, directions: Floats) -> list[Floats]:
        """An ellipsoid C + r L s, with |s| = 1, reaches d.C + r |L^T d|."""
        columns, lengths = self.columns, np.sqrt((directions * directions).sum(axis=1))
        stretch = np.sqrt((np.einsum("kij,ni->nkj", inverses(self.to_object), directions) ** 2).sum(axis=2))

        def part(block: slice) -> Floats:
            center = columns.center[block].astype(np.float64)
            radius = np.asarray(columns.radius[block] if columns.radius.ndim else columns.radius, np.float64)
            kind = columns.to_object[block] if columns.to_object.ndim else columns.to_object
            found = []
            for row, length, by in zip(directions, lengths, stretch, strict=True):
                size = np.where(kind >= 0, by[kind], length) if len(by) else length
                found.append((center @ row + radius * size).max())
            return np.array(found)

        return blockwise(len(columns), part) if len(columns) else []

"""What spheres and materials hold, as arrays: a column for each quantity, as plain arrays give them."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene.materials import COEFFICIENTS, check_index, packed
from cltrace.scene.rules import ANY, NOT_NEGATIVE, Rule, check_not_bytes, check_rule, real_numbers
from cltrace.scene.surfaces import SPHERE

# The arguments of a material, by the names of MATERIAL's fields.
ARGUMENTS = {"color": "colors", **{name: name for name in (*COEFFICIENTS, "index")}}


@dataclass(frozen=True, eq=False)
class Columns:
    """n spheres and m materials. A quantity that all of them share is one value, without the first axis. Read-only.

    center: (n, 3), and radius: (n,) or (), in scene units; material: (n,) or (), index of a sphere's material, None
    where each sphere has its own, in the same order; to_object: (n,) or (), index of the map of an ellipsoid, -1 for
    none; shade: color (m, 3) or (3,), and the other fields of MATERIAL, (m,) or (), by their names; materials_count: m.
    Numbers are float32 or float64.
    """

    center: NDArray[Any]
    radius: NDArray[Any]
    material: NDArray[np.int32] | None
    to_object: NDArray[np.int32]
    shade: Mapping[str, NDArray[Any]]
    materials_count: int

    def __post_init__(self) -> None:
        arrays = (self.center, self.radius, self.material, self.to_object, *self.shade.values())
        for array in arrays:
            if array is not None:
                array.flags.writeable = False

    @classmethod
    def of_records(cls, spheres: NDArray[np.void], materials: NDArray[np.void]) -> Columns:
        """Views of SPHERE and MATERIAL arrays."""
        center, radius, material, to_object = (spheres[name] for name in ("center", "radius", "material", "to_object"))
        shade = {name: materials[name] for name in (*ARGUMENTS, "texture")}
        return cls(center, radius, material, to_object, shade, len(materials))

    @functools.cached_property
    def spheres(self) -> NDArray[np.void]:
        """(n,) SPHERE."""
        out = np.empty(len(self.center), SPHERE)
        out["center"], out["radius"], out["to_object"] = self.center, self.radius, self.to_object
        out["material"] = np.arange(len(out)) if self.material is None else self.material
        out.flags.writeable = False
        return out

    @functools.cached_property
    def materials(self) -> NDArray[np.void]:
        """(m,) MATERIAL."""
        out = packed(self.materials_count, self.shade)
        out.flags.writeable = False
        return out

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: self.__dict__[f.name] for f in fields(self)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()


def shades(given: Mapping[str, ArrayLike], n: int) -> dict[str, NDArray[Any]]:
    """Columns of materials: what users gave for n spheres, by the names of MATERIAL's fields, as checked copies.

    Raises ValueError, which names the argument and the index.
    """
    found = {}
    for name, value in given.items():
        shape = (n, 3) if name == "color" else (n,)
        found[name] = column(ARGUMENTS[name], ANY if name == "index" else NOT_NEGATIVE, value, shape)
        if name == "color":
            check_not_bytes("colors", found[name], reflected=True)
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

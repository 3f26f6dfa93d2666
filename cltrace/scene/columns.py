"""What spheres and materials hold, as arrays: a column for each quantity, as plain arrays give them."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.limits import MAX_SPHERES
from cltrace.scene.colors import color_numbers
from cltrace.scene.materials import COEFFICIENTS, MATERIAL, check_index, packed
from cltrace.scene.rules import ANY, NOT_NEGATIVE, Rule, check_not_bytes, check_rule, numbers, real_numbers
from cltrace.scene.surfaces import SPHERE

Shade = Mapping[str, NDArray[Any]]
# The arguments of a material, by the names of MATERIAL's fields.
ARGUMENTS = {"color": "colors", **{name: name for name in (*COEFFICIENTS, "index")}}


@dataclass(frozen=True, eq=False)
class Columns:
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
        arrays = (self.center, self.radius, self.material, self.to_object, self.rest, *self.shade.values())
        for array in arrays:
            if array is not None:
                array.flags.writeable = False

    def __len__(self) -> int:
        """n."""
        return len(self.center)

    @classmethod
    def of_records(cls, spheres: NDArray[np.void], materials: NDArray[np.void]) -> Columns:
        """Views of SPHERE and MATERIAL arrays."""
        center, radius, material, to_object = (spheres[name] for name in ("center", "radius", "material", "to_object"))
        shade = {name: materials[name] for name in (*ARGUMENTS, "texture")}
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

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: self.__dict__[f.name] for f in fields(self)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()


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
    swapped = found.ndim < 2 and np.shape(numbers("radii", radii))[1:] == (3,)
    raise ValueError(
        f"centers: must have shape (n, 3), got {found.shape}"
        + (f"; radii has shape {np.shape(radii)}: are the two swapped?" if swapped else "")
    )


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

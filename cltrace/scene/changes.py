"""The same scene with other spheres: other places, sizes or materials, checked as Scene.from_spheres checks them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene.colormaps import colors_given
from cltrace.scene.colors import decoded
from cltrace.scene.materials import check_index, packed
from cltrace.scene.rules import POSITIVE
from cltrace.scene.scene import Scene
from cltrace.scene.spheres import ARGUMENTS, Columns, Shade, check_extents, column, points, reaches, shades
from cltrace.scene.surfaces import NumberedSurfaces, fields_of


def with_spheres(scene: Scene, given: Mapping[str, ArrayLike]) -> Scene:
    """A scene with other spheres. What is not changed is the same arrays.

    given: by the names of Scene.from_spheres, some of centers, radii, colors, values, cmap, clim, norm, ka, kd, ks,
    exponent, reflectance, transmittance and index. Where ka was not given at first, it follows kd. Values have the map,
    the limits and the norm of those before, but for what is given. The numbers of meshes that come after all spheres
    stay those after all spheres.

    Raises ValueError, which names the argument and the index, also where the number of spheres changes and an array of
    as many as there were is not given, where there are ellipsoids, or meshes between the spheres.
    """
    columns, others = scene.columns, scene.others
    n = len(columns)
    given = dict(given)
    shown = {name: given.pop(name, None) for name in ("colors", "values", "cmap", "clim", "norm")}
    count = len(np.atleast_1d(given["centers"])) if "centers" in given else n
    colors, scale = colors_given(count, before=scene.scale, **shown)
    if colors is not None:
        given["colors"] = colors
    if "centers" in given:
        center = points(given["centers"], given.get("radii", 1.0))
        if len(center) != n:
            others = _with_number(scene, given, len(center))
            n = len(center)
        columns = replace(columns, center=center)
    if "radii" in given:
        columns = replace(columns, radius=column("radii", POSITIVE, given["radii"], (n,)))
    if columns.to_object.ndim and ("radii" in given):
        check_extents("radii[{}]: ", columns.radius, columns.to_object, reaches(scene.to_object))
    shade = shades({name: given[argument] for name, argument in ARGUMENTS.items() if argument in given}, n)
    if "color" in shade:
        shade["color"] = decoded(shade["color"], scene.transfer)
    made = scene.with_fields(columns=columns, **fields_of(others), **{"scale": scale} if scale else {})
    if len(columns) != len(scene.columns) or shade:
        made = _shaded(made, shade)
    return made.following()


def _with_number(scene: Scene, given: Mapping[str, ArrayLike], n: int) -> tuple[NumberedSurfaces, ...]:
    """The other surfaces, if the number of spheres becomes n. Raises ValueError if it may not with what is given."""
    columns = scene.columns
    was = len(columns)
    if (columns.to_object >= 0).any():
        raise ValueError(f"centers: must be {was}, as ellipsoids keep their shapes, got {n}")
    others = tuple(shape.beside(n, was) for shape in scene.others)
    lengths = {"radii": columns.radius.ndim > 0}
    shared = columns.material is not None and columns.material.ndim == 0
    for name, argument in ARGUMENTS.items():
        follows = name == "ka" and "kd" in given and columns.follows
        lengths[argument] = columns.shade[name].ndim > (name == "color") and not shared and not follows
    if scene.scale:  # colours that were made of values
        lengths["values"] = lengths.pop("colors") and "colors" not in given
    for argument, per_sphere in lengths.items():
        if per_sphere and argument not in given:
            raise ValueError(f"{argument}: must be given, too, where there are {n} centers instead of {was}")
    return others


def _shaded(scene: Scene, given: Shade) -> Scene:
    """The same with another shade of the spheres, one value of which is for all or for each."""
    columns, others = scene.columns, scene.others
    n = len(columns)
    follows = columns.follows and "ka" not in given
    if follows and "kd" in given:
        given = {**given, "ka": given["kd"]}
    shade = {name: given[name] if name in given else _of_spheres(columns, name) for name in columns.shade}
    if "index" in given or "transmittance" in given:
        check_index("index", shade["index"], shade["transmittance"])
    one = not any(values.ndim > (name == "color") for name, values in shade.items())
    material: NDArray[np.int32] | None
    count, material = (1, np.zeros((), np.int32)) if one else (n, None)
    # Who has a material that no sphere has.
    parts = [shape.materials for shape in others]
    of = was = np.concatenate(parts)
    rest = columns.rest
    if (of < columns.count).any():  # those of a file are in no order
        kinds = np.unique(of)
        rest = packed(columns.materials_count, columns.every_shade())[kinds]
        of = count + np.searchsorted(kinds, of)
    else:
        of = of + (count - columns.count)
    if of.tolist() != was.tolist():
        own = np.split(of, np.cumsum([len(part) for part in parts])[:-1])
        others = tuple(shape.with_materials(some) for shape, some in zip(others, own, strict=True))
    found = replace(columns, material=material, shade=shade, count=count, rest=rest, follows=follows)
    return scene.with_fields(columns=found, **fields_of(others))


def _of_spheres(columns: Columns, name: str) -> NDArray[Any]:
    """A quantity of the spheres' materials: one value for all or for each."""
    values, material = columns.shade[name], columns.material
    if material is None or values.ndim == (name == "color"):
        return values
    return np.asarray(values[material])

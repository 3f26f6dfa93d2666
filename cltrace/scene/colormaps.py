"""Colours of data: from values to colours, by a colour map and its limits.

A map's own bytes are kept to the last: an unlit surface (ka = 1 in an ambient light of 1, kd = ks = 0) shows them.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.errors import MissingPackageError
from cltrace.scene.rules import ANY, check_rule, checked, described, numbers

# A map for the shares 0..1 of (n,) float64: (n, 3) or (n, 4), uint8 or float with 1 as full.
Map = Callable[[NDArray[np.float64]], NDArray[Any]]
DEFAULT_MAP = "viridis"


def limits_of(values: NDArray[np.float64], clim: ArrayLike | None) -> tuple[float, float]:
    """The values at a map's two ends: `clim`, or the least and the largest of the values.

    Raises ValueError if they are not two rising numbers.
    """
    if clim is None:
        return (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    low, high = checked("clim", ANY, clim, (2,)).tolist()
    if low > high:
        raise ValueError(f"clim: must be two rising numbers, got {low:g}, {high:g}")
    return low, high


def colors_of(values: ArrayLike, cmap: Any = None, clim: ArrayLike | None = None) -> NDArray[np.float32]:
    """(n, 3) float32, the map's colours of (n,) values, 1 being full.

    cmap: see `map_of`; clim: see `limits_of`; values beyond it have the colours of the ends. What a map says of
    transparency does not count. Raises ValueError, which names the argument, MissingPackageError if a map's name needs
    a package that is not there.
    """
    given = numbers("values", values)
    if given.ndim != 1:
        raise ValueError(f"values: must have shape (n,), got {given.shape}")
    if np.isnan(given).any():
        i = int(np.argmax(np.isnan(given)))
        raise ValueError(f"values[{i}]: must not be nan, which has no colour; leave it out, or give colors instead")
    check_rule("values", ANY, given)
    low, high = limits_of(given, clim)
    return mapped(map_of(cmap), shares(given, low, high))


def shares(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.float64]:
    """Where values are between two ends, 0..1; all 0 where there is nothing between."""
    if not high > low:
        return np.zeros(values.shape)
    return np.clip((values - low) / (high - low), 0.0, 1.0)


def mapped(colormap: Map, share: NDArray[np.float64]) -> NDArray[np.float32]:
    """(n, 3) float32, 1 being full: what a map makes of shares (n,). Raises ValueError if it makes no colours."""
    found = np.asarray(colormap(share))
    if found.shape not in ((len(share), 3), (len(share), 4)) or not (
        found.dtype == np.uint8 or found.dtype.kind == "f"
    ):
        wanted = f"({len(share)}, 3) or ({len(share)}, 4) of uint8 or floats"
        raise ValueError(f"cmap: must make {wanted} of {len(share)} numbers, made {described(found)}")
    colors = np.asarray(found[:, :3], np.float32)
    if found.dtype == np.uint8:
        colors = colors / np.float32(255)
    if not ((colors >= 0) & (colors <= 1)).all():
        raise ValueError("cmap: must make colours within 0..1, or bytes")
    return colors


def map_of(cmap: Any) -> Map:
    """A colour map of what a user calls one: a name; a callable, which takes numbers 0..1; or a table of colours.

    Names are those of matplotlib, viridis if it is None. They are looked up in matplotlib where that is installed, else
    in the package cmap, which has others, too. A callable that takes `bytes=True`, as the maps of both packages do, is
    asked for its bytes. A table is an array (k, 3) or (k, 4), of uint8, or of floats with 1 as full: the k-th part of
    the values has its k-th row.

    Raises ValueError if there is no such map, and MissingPackageError if neither package is there for a name.
    """
    if cmap is None or isinstance(cmap, str):
        return _bytes_of(_named(DEFAULT_MAP if cmap is None else cmap))
    if callable(cmap):
        return _bytes_of(cmap)
    table = np.asarray(cmap)
    if table.ndim != 2 or table.shape[1] not in (3, 4) or not len(table) or table.dtype.kind not in "uf":
        raise ValueError(
            "cmap: must be a name, a callable, or an array (k, 3) or (k, 4) of uint8 or floats, "
            f"got {described(cmap if table.dtype == object else table)}"
        )
    return lambda share: table[np.minimum((share * len(table)).astype(np.intp), len(table) - 1)]


def _bytes_of(cmap: Any) -> Map:
    """A callable that makes bytes, if it can."""

    def ask(share: NDArray[np.float64]) -> NDArray[Any]:
        try:
            return np.asarray(cmap(share, bytes=True))
        except TypeError:
            return np.asarray(cmap(share))

    return ask


def _named(name: str) -> Any:
    """The map of this name of matplotlib or of the package cmap."""
    packages = [package for package in ("matplotlib", "cmap") if importlib.util.find_spec(package)]
    if not packages:
        raise MissingPackageError(f"cmap: {name!r} is a name, which", "cmap or matplotlib", "cmap")
    if "matplotlib" in packages:
        maps = importlib.import_module("matplotlib").colormaps
        if name in maps:
            return maps[name]
    if "cmap" in packages:
        try:
            return _truncating(importlib.import_module("cmap").Colormap(name))
        except ValueError:
            pass
    raise ValueError(f"cmap: must be the name of a colour map of {' or '.join(packages)}, got {described(name)}")


def _truncating(colormap: Any) -> Map:
    """A map of the package cmap with matplotlib's bytes, which are its numbers times 255, cut to whole ones."""
    table = (np.asarray(colormap.lut(256)) * 255).astype(np.uint8)
    return map_of(table)

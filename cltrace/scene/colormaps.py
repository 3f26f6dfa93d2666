"""Colours of data: from values to colours, by a colour map and its limits.

A map's own bytes are kept to the last: an unlit surface (ka = 1 in an ambient light of 1, kd = ks = 0) shows them.
"""

from __future__ import annotations

import importlib
import importlib.util
import pickle
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.errors import MissingPackageError
from cltrace.scene.rules import ANY, check_rule, checked, described, numbers

# A map for the shares 0..1 of (n,) float64: (n, 3) or (n, 4), uint8 or float with 1 as full.
Map = Callable[[NDArray[np.float64]], NDArray[Any]]


@dataclass(frozen=True)
class Scale:
    """How values become colours, so that more of them become the same.

    cmap: see map_of(); low, high: the values at its two ends, whose colours values beyond have, too; norm: None, or
    what the values go through first, see Scale.of().
    """

    cmap: Any
    low: float
    high: float
    norm: Any = None

    @classmethod
    def of(
        cls,
        values: NDArray[np.float64],
        cmap: Any = None,
        clim: ArrayLike | None = None,
        norm: Any = None,
        before: Scale | None = None,
    ) -> Scale:
        """For (n,) values. What is None is that of `before`, and without one the default.

        clim: (low, high), the least and the largest value by default; norm: a function of (n,) values, such as
        numpy.log, whose results between those of the two ends are spread evenly over the map; or a norm of matplotlib,
        such as LogNorm(), which says itself what 0..1 is, and whose own limits count where there is no clim.

        Raises ValueError, which names the argument.
        """
        if norm is not None and not callable(norm):
            raise ValueError(f"norm: must be a function, such as numpy.log or LogNorm(), got {described(norm)}")
        limits = None if clim is None else tuple(checked("clim", ANY, clim, (2,)).tolist())
        if limits and limits[0] > limits[1]:
            raise ValueError(f"clim: must be two rising numbers, got {limits[0]:g}, {limits[1]:g}")
        chosen = norm if norm is not None or before is None else before.norm
        if hasattr(chosen, "autoscale_None"):
            chosen, (low, high) = _scaled(chosen, values, limits)
        elif limits is None and before is not None:
            low, high = before.low, before.high
        else:
            low, high = limits or ((float(values.min()), float(values.max())) if values.size else (0.0, 1.0))
        return cls(before.cmap if cmap is None and before else cmap, low, high, norm=chosen)

    def shares(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where (n,) values are on the map, 0..1; all 0 where its two ends are one value. Raises ValueError."""
        with np.errstate(all="ignore"):  # what becomes of a logarithm of 0 is said below
            if hasattr(self.norm, "autoscale_None"):
                made = np.ma.asarray(self.norm(values))
                found = np.ma.filled(made.astype(np.float64), np.nan)
                if made.dtype.kind in "iu":  # as of BoundaryNorm, which colour of the map it is
                    found = (found + 0.5) / count_of(self.cmap)
                found = np.clip(found, 0.0, 1.0)  # TwoSlopeNorm makes infinite numbers of what is beyond its limits
            else:
                ends, found = np.array([self.low, self.high]), values
                if self.norm is not None:
                    ends, found = (np.asarray(self.norm(x), np.float64) for x in (ends, values))
                if not np.isfinite(ends).all():
                    limits = f"{self.low:g}, {self.high:g}"
                    raise ValueError(f"clim: must be values of which norm makes finite numbers, got {limits}")
                found = (found - ends[0]) / (ends[1] - ends[0]) if ends[1] != ends[0] else 0 * found
        if found.shape != values.shape:
            raise ValueError(f"norm: must make {values.shape} of {values.shape} values, made {found.shape}")
        if not np.isfinite(found).all():
            i = int(np.argmin(np.isfinite(found)))
            raise ValueError(f"values[{i}]: must be one of which norm makes a finite number, got {values[i]:g}")
        return np.clip(found, 0.0, 1.0)

    @property
    def steps(self) -> NDArray[np.float64] | None:
        """The values at which the next colour begins, of a norm that has them, as BoundaryNorm."""
        found = getattr(self.norm, "boundaries", None)
        return None if found is None else np.asarray(found, np.float64)

    def colors(self, values: NDArray[np.float64]) -> NDArray[np.float32]:
        """(n, 3) float32, the map's colours of (n,) values, 1 being full. Raises ValueError."""
        return mapped(map_of(self.cmap), self.shares(values))

    def __getstate__(self) -> dict[str, Any]:
        """Functions that cannot be pickled, as lambdas cannot, are not part of a pickle, and are missed when needed."""
        state = dict(self.__dict__)
        for name in ("cmap", "norm"):
            try:
                pickle.dumps(state[name])
            except (pickle.PicklingError, AttributeError, TypeError):
                state[name] = Lost(name)
        return state


@dataclass(frozen=True)
class Lost:
    """In place of a function that could not be pickled."""

    name: str

    def __call__(self, *values: object, **options: object) -> NoReturn:
        raise ValueError(f"{self.name}: must be given again, as the scene's is a function that could not be pickled")


def values_given(colors: ArrayLike | None, values: ArrayLike | None, **options: Any) -> NDArray[np.float64] | None:
    """(n,) values to be shown as colours; None if there are none. Raises ValueError, with advice where one is nan.

    colors: what may be given instead; options: cmap, clim and norm, which go with values alone.
    """
    if values is None:
        for name, option in options.items():
            if option is not None:
                raise ValueError(f"{name}: goes with values, which are not given")
        return None
    if colors is not None:
        raise ValueError("values: must not be given together with colors")
    given = numbers("values", values)
    if given.ndim != 1:
        raise ValueError(f"values: must have shape (n,), got {given.shape}")
    if np.isnan(given).any():
        i = int(np.argmax(np.isnan(given)))
        raise ValueError(f"values[{i}]: must not be nan, which has no colour; leave it out, or give colors instead")
    check_rule("values", ANY, given)
    return given


def _scaled(
    norm: Any, values: NDArray[np.float64], limits: tuple[float, float] | None
) -> tuple[Any, tuple[float, float]]:
    """A copy of a norm of matplotlib that has its limits, and which: these, its own, or those of the values."""
    own = copy(norm)
    try:
        if limits is not None:
            own.vmin, own.vmax = limits
        own.autoscale_None(values)
        if values.size:
            own(values[:1])
    except ValueError as error:
        raise ValueError(f"norm: {error}") from None
    if own.vmin is None or own.vmax is None:  # there are no values
        return own, (0.0, 1.0)
    low, high = float(own.vmin), float(own.vmax)
    if not high > low and values.size and values.max() > values.min():  # as a logarithm of negative values only
        raise ValueError(f"norm: must have two limits for values that differ, and has {low:g}, {high:g}: say clim")
    return own, (low, high)


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
    found = _resolved(cmap)
    if callable(found):
        return _bytes_of(found)
    table = np.asarray(found)
    if table.ndim != 2 or table.shape[1] not in (3, 4) or not len(table) or table.dtype.kind not in "uf":
        got = described(cmap if table.dtype == object else table)
        raise ValueError(
            f"cmap: must be a name, a callable, or an array (k, 3) or (k, 4) of uint8 or floats, got {got}"
        )
    return lambda share: table[np.minimum((share * len(table)).astype(np.intp), len(table) - 1)]


def count_of(cmap: Any) -> int:
    """Of how many colours a map consists, 256 where it does not say. cmap: as of map_of()."""
    found = _resolved(cmap)
    return int(getattr(found, "N", 256)) if callable(found) else len(found)


def _resolved(cmap: Any) -> Any:
    """The callable or the table that a user means."""
    return _named("viridis" if cmap is None else cmap) if cmap is None or isinstance(cmap, str) else cmap


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
            table = np.asarray(importlib.import_module("cmap").Colormap(name).lut(256))
            return map_of((table * 255).astype(np.uint8))  # cut to whole ones, as matplotlib's bytes are
        except ValueError:
            pass
    raise ValueError(f"cmap: must be the name of a colour map of {' or '.join(packages)}, got {described(name)}")


def colors_given(
    n: int, colors: ArrayLike | None, values: ArrayLike | None, before: Scale | None = None, **options: Any
) -> tuple[ArrayLike | None, Scale | None]:
    """The colours of n spheres that have either colors or values, None if neither, and how values become colours.

    before: the scale of earlier values, which these keep except for options that are given: cmap, clim, norm.
    Raises ValueError.
    """
    array = values_given(colors, values, **options)
    if array is None:
        return colors, before
    if len(array) != n:
        raise ValueError(f"values: must have shape {(n,)}, got {array.shape}")
    scale = Scale.of(array, before=before, **options)
    return scale.colors(array), scale

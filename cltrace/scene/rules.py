"""The values that a scene may hold, and the words of the fault where one is not allowed.

Whatever a user hands over (numbers, sequences, arrays) passes through `numbers` or `vector` here, whose errors name the
argument and the index. The readers of files use the same rules, so a fault reads the same from Python and from a file.
"""

from __future__ import annotations

import math
import reprlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arrays import LARGE, blockwise, copied, rows_in

Vector = tuple[float, float, float]

# A number is 0, or its magnitude is within float32's range. Its square and the square of that then stay within
# double's range, so that nothing that is computed from it overflows or vanishes.
SMALLEST, LARGEST = 2.0**-149, (2.0 - 2.0**-23) * 2.0**127
# Colours of surfaces above this are taken for bytes. No surface returns so many times the light that falls on it, and
# among bytes only a nearly black picture has none above.
BYTES = 16


@dataclass(frozen=True)
class Rule:
    """The values that a number may have: finite, 0 or within float32's range, and within these bounds.

    text: the bounds in words; low, high: the bounds; open_low, open_high: whether the bound itself is excluded.
    """

    text: str
    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False
    open_high: bool = False

    def admits(self, value: Any) -> Any:
        """Whether each value is allowed: an array of bools of the same shape, or one bool for a float."""
        size = abs(value)
        low = value > self.low if self.open_low else value >= self.low
        high = value < self.high if self.open_high else value <= self.high
        return low & high & ((size == 0) | ((size >= SMALLEST) & (size <= LARGEST)))

    def admits_all(self, block: NDArray[Any]) -> bool:
        """Whether all values are allowed."""
        if not block.size:
            return True
        ends = np.array([block.min(), block.max()])
        if not self.admits(ends).all():  # as of nan
            return False
        if ends[0] > 0 or block.dtype == np.float32:  # which holds nothing but 0 below SMALLEST
            return True
        size = np.abs(block)
        return not ((size < SMALLEST) & (size > 0)).any()

    def fault(self, value: float) -> str | None:
        """What is wrong with one value, in words that belong behind its name; None if nothing is."""
        if self.admits(value):
            return None
        if not math.isfinite(value):
            return f"must be a finite number, got {value:g}"
        if abs(value) > LARGEST:
            return f"must not exceed 3.4e38 in magnitude, got {value:g}"
        if value != 0 and abs(value) < SMALLEST:
            zero = "" if self.open_low and self.low == 0 else "0 or "
            return f"must be {zero}at least 1.4e-45 in magnitude, got {value:g}"
        return f"must be {self.text}, got {value:g}"


ANY = Rule("a finite number")
POSITIVE = Rule("> 0", low=0, open_low=True)
NOT_NEGATIVE = Rule(">= 0", low=0)
FOV = Rule("within (0, 90)", low=0, high=90, open_low=True, open_high=True)
FULL_FOV = Rule("within (0, 180)", low=0, high=180, open_low=True, open_high=True)
CONE = Rule("within [0, 180]", low=0, high=180)


def numbers(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """`value` as a new array of doubles of its own shape.

    Raises ValueError, which begins with the name, where anything in it is not a real number: numpy alone would take
    bools, the real part of complex numbers, time spans and what lies under a mask for numbers.
    """
    _refuse_strangers(name, value)
    try:
        with np.errstate(over="ignore"):  # a long double may become infinite, which the rules then refuse
            return np.array(value, np.float64)
    except OverflowError:
        raise ValueError(f"{name}: must not exceed 3.4e38 in magnitude, got an integer beyond 1.7e308") from None
    except ValueError:
        raise ValueError(f"{name}: must be an array, got rows of different lengths") from None


def large_or_numbers(name: str, value: ArrayLike) -> NDArray[Any]:
    """`value` itself if it is a large array of float32 or float64, which is to be copied once it is checked; else a new
    array, as of numbers(). In float32 there is half as much to check, and no number is too small.
    """
    if type(value) is np.ndarray and value.nbytes >= LARGE and value.dtype in (np.float32, np.float64):
        return value
    return numbers(name, value)


def checked(name: str, rule: Rule, value: ArrayLike, shape: tuple[int, ...], more: int = 0) -> NDArray[np.float64]:
    """`value` as a new array of doubles of this shape, where -1 stands for any length. more: of copied().

    Raises ValueError, which names the argument and the index of the first number that the rule does not allow.
    """
    array = large_or_numbers(name, value)
    if array.shape == (0,) and shape[:1] == (-1,):  # an empty list
        array = array.reshape(0, *shape[1:])
    if len(array.shape) != len(shape) or any(n not in (-1, got) for n, got in zip(shape, array.shape, strict=True)):
        wanted = str(tuple("n" if n < 0 else n for n in shape)).replace("'", "")
        raise ValueError(f"{name}: must have shape {wanted}, got {array.shape}")
    check_rule(name, rule, array)
    return copied(array, np.float64, more) if array is value or more else array


def real_numbers(name: str, value: ArrayLike) -> NDArray[Any]:
    """`value` as a new array of its own shape: float32 where that holds whatever the type of its values can hold, else
    float64. Raises ValueError as numbers() does.
    """
    if not isinstance(value, np.ndarray) or not value.ndim:
        return numbers(name, value)
    _refuse_strangers(name, value)
    array = np.asarray(value)
    return copied(array, np.float32 if np.can_cast(array.dtype, np.float32) else np.float64)


def check_rule(name: str, rule: Rule, array: NDArray[Any]) -> None:
    """Raises ValueError, which names the array and the index, at the first number that the rule does not allow."""
    if not array.ndim:
        good = bool(rule.admits(array))
    else:
        good = all(blockwise(len(array), lambda rows: rule.admits_all(array[rows]), rows_in(array)))
    if not good:
        where = np.argwhere(~rule.admits(array))[0]
        index = "".join(f"[{i}]" for i in where)
        raise ValueError(f"{name}{index}: {rule.fault(float(array[tuple(where)]))}")


def check_none(name: str, bad: NDArray[np.bool_], words: str, values: NDArray[Any]) -> None:
    """Raises ValueError at the first of (n,) values that is bad: it names the index, and what it must be."""
    if bad.any():
        i = int(np.argmax(bad))
        raise ValueError(f"{name}[{i}]: must be {words}, got {values[i]}")


def records_of(name: str, value: NDArray[np.void], dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """A copy of an (n,) array of these records; TypeError if it is none: numpy would turn a number into all fields."""
    if not isinstance(value, np.ndarray) or value.dtype.names != dtype.names or value.ndim != 1:
        words = f"must be an (n,) array of dtype cltrace.scene.{name[:-1].upper()}, got {described(value)}"
        raise TypeError(f"{name}: {words}; Scene.from_spheres() takes plain arrays")
    return np.array(value, dtype)


def indices(name: str, value: ArrayLike, width: int, count: int, what: str, least: int = 0) -> NDArray[np.int32]:
    """(n, width) indices of `count` things. Raises ValueError, which names the place of the first that is none."""
    whole = type(value) is np.ndarray and value.dtype.kind in "iu"
    array = np.asarray(value) if whole else numbers(name, value)
    if array.shape == (0,):  # an empty list
        array = array.reshape(0, width)
    if array.ndim != 2 or array.shape[1] != width:
        raise ValueError(f"{name}: must have shape (n, {width}), got {array.shape}")
    within = not array.size or (array.min() >= least and array.max() < count)
    if not within or not (whole or (array == np.floor(array)).all()):
        good = (array >= least) & (array < count) & (array == np.floor(array))
        i, k = np.argwhere(~good)[0]
        words = f"must be the index of {what}, of which there are {count}, got {array[i, k]:g}"
        raise ValueError(f"{name}[{i}][{k}]: {words}")
    return array.astype(np.int32)


def vector(name: str, value: ArrayLike, rule: Rule = ANY) -> Vector:
    """Three numbers as a tuple of floats; ValueError names the argument."""
    x, y, z = checked(name, rule, value, (3,)).tolist()
    return (x, y, z)


def check_not_bytes(name: str, color: ArrayLike, reflected: bool = False) -> None:
    """Raises ValueError where colours look like bytes: 0 to 255, one of them above 1.

    Colours are linear with 1 as full. reflected: this is the share of the light that a surface returns, of which more
    than 1 makes little sense, so whole floats are refused as integers are, and so are others above BYTES, such as
    means of bytes. A light may be brighter than 1; whoever means that writes a float, such as 2.0.
    """
    array = np.asarray(color)
    if array.dtype.kind not in ("iuf" if reflected else "iu") or not array.size or not 1 < array.max() <= 255:
        return
    whole = (array == np.rint(array)).all()
    if whole or array.max() > BYTES:
        hint = "" if reflected or array.max() > BYTES else f", or write {array.max():.1f}"
        found = f"{'whole ' if whole else ''}numbers up to {array.max():g} look like bytes of 0 to 255"
        raise ValueError(f"{name}: must be linear with 1 as full, but {found}; divide by 255{hint}")


def is_whole(value: object) -> bool:
    """Whether this is an integer of Python or numpy. A bool is not, nor is a time span, which numpy counts to them."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.timedelta64))


def is_masked(value: object) -> bool:
    """Whether this is a masked array of numpy, which does not import what it has for them until somebody uses it."""
    return "numpy.ma" in sys.modules and isinstance(value, np.ma.MaskedArray)


def described(value: object) -> str:
    """A value in a few words, for a message."""
    if isinstance(value, np.ndarray) and value.ndim:
        names = value.dtype.names
        kind = f"records of {', '.join(names)}" if names else str(value.dtype)
        return f"an array of {kind}, shape {value.shape}"
    if isinstance(value, np.generic):
        return f"{value} ({value.dtype})"
    if isinstance(value, (list, tuple)) and any(isinstance(x, np.ndarray) for x in value):
        return f"a {type(value).__name__} of arrays"
    return _SHORT.repr(value)


class _Short(reprlib.Repr):
    """repr() of a limited length, also of integers that have more digits than Python writes."""

    maxother = maxstring = 60

    def repr_int(self, x: int, level: int) -> str:
        return repr(x) if x.bit_length() <= 128 else f"an integer of {x.bit_length()} bits"


_SHORT = _Short()
_DEEPEST = 8  # no argument is a sequence within a sequence so many times; a list may contain itself


def _refuse_strangers(name: str, value: Any, depth: int = 0) -> None:
    """Raises ValueError where anything in a value, at any depth of its sequences, is not a real number."""
    if is_masked(value):
        raise ValueError(f"{name}: must not be masked; use its filled() or compressed()")
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "iuf":
            raise ValueError(f"{name}: must be numbers, got {described(value)}")
    elif isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray)) and depth < _DEEPEST:
        if not set(map(type, value)) <= {int, float}:
            for element in value:
                _refuse_strangers(name, element, depth + 1)
    elif not isinstance(value, (int, float, np.integer, np.floating)) or isinstance(value, (bool, np.timedelta64)):
        if hasattr(value, "__array__") and not isinstance(value, np.generic):  # such as a column of a table
            _refuse_strangers(name, np.asarray(value), depth)
        else:
            raise ValueError(f"{name}: must be numbers, got {described(value)}{' among them' if depth else ''}")

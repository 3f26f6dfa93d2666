"""The numbers of many lines of an OBJ file at once; None where anything about them is not as usual.

A usual line is known to be right. The lines of a block that is not usual are read in smaller parts, and in the end one
by one, which alone words the messages.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import two_product
from cltrace.base.warning_filters import warnings_are
from cltrace.formats.obj_text import BLANK, Bytes, Places

SLASH, POINT = b"/."
Doubles = NDArray[np.float64]
Integers = NDArray[np.int64]

_E, _BIG_E, _PLUS, _MINUS, _0, _9 = b"eE+-09"
_MOST = 9 * 10**18  # of a number without its point: somewhat more fits in 63 bits
_POWERS = np.array([10.0**k for k in range(23)])  # These are exact.


class FaceCorners(NamedTuple):
    """The corners of f faces, c in all.

    sizes: (f,), how many each face has; indices: (3, c), of vertex, texture coordinate and normal as they are written,
    0 where there is none.
    """

    sizes: Integers
    indices: Integers


def word_ends(text: Bytes) -> Places:
    """Where the words of a text end, which begins and ends blank."""
    blank = text <= BLANK
    return np.flatnonzero(blank[1:] > blank[:-1]) + 1


def counts(ends: Places, feeds: Places) -> Integers:
    """(n,): how many of the words that end at `ends` there are in each line."""
    n = len(feeds)
    width = len(ends) // max(n, 1)
    if width and width * n == len(ends):
        table = ends.reshape(n, width)
        if (table[:, -1] <= feeds).all() and (table[1:, 0] > feeds[:-1]).all():
            return np.full(n, width)
    return np.diff(np.searchsorted(ends, feeds, "right"), prepend=0)


def decimals(text: Bytes, ends: Places) -> Doubles | None:
    """The words of a text as doubles, rounded right, -0 as 0.

    A number without its point is an integer m up to 9 10^18, and m = hi + lo exactly. It is to be divided by p = 10^k,
    k <= 22, which is exact, too. q = hi / p leaves (hi - q p) + lo, which is 2^-52 hi at most, and whose two roundings
    are within 2^-104 hi. Divided by p, with one more rounding, it makes q right to 2^-102 of itself: where 2^-100 of q
    more or less makes no difference, the sum is rounded right. What else there is, Python's float() reads.
    """
    if not _signs_are_right(text):
        return None
    parts = _exponents(text, ends)
    if parts is None:
        return None
    data, stops, exponents = parts
    whole = integers(data.translate(None, b"."), len(ends))
    places = _places(text, stops)
    if whole is None or places is None:
        return None
    places = places - exponents
    strange = (places < 0) | (places >= len(_POWERS)) | (whole > _MOST) | (whole < -_MOST)
    power = _POWERS[np.where(strange, 0, places)]
    hi = whole.astype(np.float64)
    lo = (whole - np.where(strange, 0, hi).astype(np.int64)).astype(np.float64)
    q: Doubles = hi / power
    product = two_product(q, power)
    rest = (((hi - product[0]) - product[1]) + lo) / power
    error = 2.0**-100 * np.abs(q)
    value: Doubles = q + (rest - error)
    for i in np.flatnonzero(strange | (value != q + (rest + error))).tolist():
        value[i] = float(text[ends[i - 1] if i else 0 : ends[i]].tobytes())
        if value[i] == 0 and whole[i]:
            return None  # It vanishes.
    value += 0.0  # makes -0 a 0
    return value


def _signs_are_right(text: Bytes) -> bool:
    """Whether a text, which begins and ends blank, has signs only in front of numbers and of exponents.

    numpy takes a sign for the beginning of a number anywhere, leaves out blanks behind it, and reads it alone as 0.
    """
    signs = np.flatnonzero((text == _PLUS) | (text == _MINUS))
    before, behind = text[signs - 1], text[signs + 1]
    behind = np.where(behind == POINT, text[np.minimum(signs + 2, len(text) - 1)], behind)
    right = (before <= BLANK) | (before == SLASH) | (before == _E) | (before == _BIG_E)
    return bool((right & (behind >= _0) & (behind <= _9)).all())


def _exponents(text: Bytes, ends: Places) -> tuple[bytes, Places, Integers] | None:
    """The text with blanks for exponents, where the words then end, and their exponents; None if one is no number."""
    data = text.tobytes()
    exponents = np.zeros(len(ends), np.int64)
    if b"e" not in data and b"E" not in data:
        return data, ends, exponents
    letters = np.flatnonzero((text == _E) | (text == _BIG_E))
    word = np.searchsorted(ends, letters, "right")
    if (word[1:] == word[:-1]).any():
        return None
    sizes = ends[word] - letters  # of the exponents with their letters
    place = np.arange(sizes.sum()) + np.repeat(letters - (np.cumsum(sizes) - sizes), sizes)
    behind = text[place]
    behind[np.cumsum(sizes) - sizes] = BLANK  # in place of the letters
    found = integers(behind.tobytes() + b" ", len(letters))
    if found is None:
        return None
    bare, stops = text.copy(), ends.copy()
    bare[place] = BLANK
    stops[word], exponents[word] = letters, np.clip(found, -9999, 9999)
    return bare.tobytes(), stops, exponents


def _places(text: Bytes, stops: Places) -> Integers | None:
    """How many digits each word has behind its point up to where it stops; None if one has two points."""
    points = np.flatnonzero(text == POINT)
    if len(points) == len(stops) and (points < stops).all() and (points[1:] >= stops[:-1]).all():
        return stops - points - 1
    word = np.searchsorted(stops, points, "right")
    if (word[1:] == word[:-1]).any() or (len(word) and word[-1] == len(stops)):
        return None
    places = np.zeros(len(stops), np.int64)
    places[word] = stops[word] - points - 1
    return places


def integers(data: bytes, count: int) -> Integers | None:
    """The words of a text as integers, those beyond 63 bits as the largest; None if they are not that many or none.

    Its signs are to be right. numpy reads what is blank as a 0.
    """
    if data.isspace():
        return None
    try:
        with warnings_are("error"):
            found = np.fromstring(data, np.int64, sep=" ")
    except (DeprecationWarning, ValueError):
        return None
    return found if len(found) == count else None


def corners(text: Bytes, feeds: Places) -> FaceCorners | None:
    """The corners of faces, one face a line."""
    ends = word_ends(text)
    sizes = counts(ends, feeds)
    if not len(ends) or sizes.min() < 3 or not _signs_are_right(text):
        return None
    slashes = np.flatnonzero(text == SLASH)
    many = len(slashes) // len(ends)
    if many <= 2 and many * len(ends) == len(slashes):
        table = slashes.reshape(len(ends), many)
        if not many or ((table[:, -1] < ends).all() and (table[1:, 0] >= ends[:-1]).all()):
            return _alike(text, ends, sizes, table)
    return _mixed(text, ends, sizes, slashes)


def _alike(text: Bytes, ends: Places, sizes: Integers, slashes: Places) -> FaceCorners | None:
    """Where all corners have as many slashes, which are at (c, 0..2). Mostly, all are written alike."""
    many = slashes.shape[1]
    index = np.zeros((3, len(ends)), np.int64)
    rows = [0]
    if many:
        behind = slashes[:, -1] + 1 < ends
        between = slashes[:, 1] > slashes[:, 0] + 1 if many == 2 else behind
        if not behind.all() or between.any() != between.all() or (text[slashes[:, 0] - 1] <= BLANK).any():
            return _mixed(text, ends, sizes, slashes.ravel())
        rows = [0, *([1] if between.all() else []), *([2] if many == 2 else [])]
    found = integers(_split(text), len(ends) * len(rows))
    if found is None:
        return None
    index[rows] = found.reshape(len(ends), len(rows)).T
    return FaceCorners(sizes, index) if (index[rows] != 0).all() else None


def _mixed(text: Bytes, ends: Places, sizes: Integers, slashes: Places) -> FaceCorners | None:
    """Where corners have different numbers of slashes, or nothing behind one."""
    word = np.searchsorted(ends, slashes, "right")
    many = np.bincount(word, minlength=len(ends))
    if many.max() > 2:
        return None
    first = np.concatenate([[0], np.cumsum(many)])[:-1]
    slashed = np.flatnonzero(many)
    if (text[slashes[first[slashed]] - 1] <= BLANK).any():
        return None
    full = text[slashes + 1] > BLANK
    full &= text[slashes + 1] != SLASH
    has = np.zeros((3, len(ends)), np.bool_)
    has[0] = True
    has[1, slashed] = full[first[slashed]]
    twice = np.flatnonzero(many == 2)
    has[2, twice] = full[first[twice] + 1]
    found = integers(_split(text), int(has.sum()))
    if found is None or (found == 0).any():
        return None
    index = np.zeros((3, len(ends)), np.int64)
    index.T[has.T] = found
    return FaceCorners(sizes, index)


def _split(text: Bytes) -> bytes:
    data: Any = text.tobytes()
    return bytes(data.replace(b"/", b" "))

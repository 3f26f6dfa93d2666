"""What a program has found on its way to a picture, normals or distances, beside what is right.

Programs write such numbers in many ways. Each way to read them is tried, and the one that fits most pixels is said.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.errors import UsageError, printable
from cltrace.formats.files import UnreadableError, check_regular
from cltrace.picture.image import Image, Output
from cltrace.plan.abi import Precision
from cltrace.renderers.renderer import render
from cltrace.run.devices import Device
from cltrace.scene import Scene
from cltrace.students.compare import pixels_of, question, size_faults
from cltrace.students.lit import lighting
from cltrace.students.places import inside

Floats = NDArray[np.float64]
Reading = tuple[str, Floats, Floats]  # in words; the own and the right values, (h, w, k), in the same terms

# All of what needs no light, so that one kernel serves a student who looks at one after the other.
_GEOMETRY: tuple[Output, ...] = ("id", "direction", "depth", "normal", "uv")
FITS = 0.5  # of the pixels, at least, that a reading has to make right
_BYTES, _FLOATS = 1.51 / 127.5, 1e-3  # by how much bytes of -1..1, and single precision, may be off
_FITTED = 4  # rounds in which a line is fitted to the pixels that are nearest to it, so that wrong ones do not count
SO = {
    "direction": "look at what the rays meet",
    "id": "look at the point and at the normal",
    "depth": "look at the normal and at light",
    "normal": "look at light: l, n.l and r.v",
    "uv": "look at the texel",
    "lit": "look at Phong's formula",
    "color": "look at how colours become bytes",
}


@dataclass(frozen=True, eq=False)
class Dump:
    """An own output beside the right one. str() is what the command prints.

    show: which output; how: the reading that fits best, in words; off: (h, w), by how much it differs, 1 being as much
    as is allowed, and 0 where nothing is compared; compared: how many pixels are; ask: what explains the worst of them.
    """

    show: str
    how: str
    off: Floats
    compared: int
    worst: tuple[int, int] | None
    values: str
    ask: str

    @property
    def same(self) -> bool:
        return not (self.off > 1).any()

    @property
    def agreeing(self) -> float:
        """The share of the compared pixels that agree."""
        return 1 - float((self.off > 1).sum()) / max(self.compared, 1)

    def __str__(self) -> str:
        if self.same:
            return f"{self.show}, read as {self.how}: the same. If the picture is wrong, {SO[self.show]}"
        share = f"{100 * self.agreeing:.1f} % of the pixels agree"
        first = f"{self.show}, read as {self.how}: {share}"
        if self.agreeing < FITS:
            first = f"{self.show}: wrong, however it is read; as {self.how}, {share}"
        assert self.worst
        return f"{first}\nthe worst pixel is {self.worst[0]},{self.worst[1]}: {self.values}\n  why: {self.ask}"


def compare_dump(
    scene: Scene,
    show: str,
    mine: str | os.PathLike[str] | NDArray[Any],
    *,
    device: str | Device | None = None,
    precision: Precision | None = None,
) -> Dump:
    """Compares an output of another program with the right one.

    show: one of SO; mine: the name of a picture, or of a .npy file of numbers, or either as an array: bytes (h, w, 3),
    or floats (h, w) or (h, w, k). Raises ValueError where its shape is not that of the scene's picture, and UsageError
    where a file cannot be read.
    """
    own, is_bytes = _own(mine, scene.camera.resolution)
    size = own.shape[1], own.shape[0]
    scene = scene if size == scene.camera.resolution else scene.seen_by(replace(scene.camera, resolution=size))
    image = render(scene, device, precision, ("color", "id", "direction") if show == "color" else _GEOMETRY)
    seen = image.id >= 0 if show not in ("direction", "color") else np.ones(image.id.shape, np.bool_)
    if show in ("id", "lit"):
        right = image.id if show == "id" else _sets(lighting(scene, device, precision).lit)
        readings: Iterable[Reading] = [("one colour each", *_classes(own, right, seen))]
    else:
        readings = _readings(show, own, image, np.array(scene.camera.basis()), seen, is_bytes)
    best: tuple[str, Floats, Floats, Floats] | None = None
    for how, a, b in readings:
        with np.errstate(invalid="ignore"):
            allowed = _allowed(show, b, is_bytes)
            off = np.where(seen, np.nan_to_num(np.abs(a - b).max(axis=2) / allowed, nan=np.inf), 0.0)
        if best is None or (off > 1).sum() < (best[1] > 1).sum():
            best = how, off, a, b
    assert best is not None
    how, off, a, b = best
    worst = next(inside(np.clip(np.ceil(off - 1), 0, 255).astype(np.uint8)), None)
    if worst is None:
        return Dump(show, how, off, compared=int(seen.sum()), worst=None, values="", ask="")
    x, y = worst
    values = "" if show in ("id", "lit") else f"{_words(a[y, x])}, right is {_words(b[y, x])}"
    values = values or ("the right one has another colour" if show == "lit" else f"right is surface {image.id[y, x]}")
    ask = question(scene, False, x, y)
    return Dump(show, how, off, compared=int(seen.sum()), worst=worst, values=values, ask=ask)


def _own(mine: str | os.PathLike[str] | NDArray[Any], size: tuple[int, int]) -> tuple[NDArray[Any], bool]:
    """The own numbers, (h, w, k), and whether they are bytes."""
    if isinstance(mine, np.ndarray):
        values = mine
    elif Path(mine).suffix.lower() == ".npy":
        values = _read(os.fspath(mine))
    else:
        values = pixels_of(mine, size)
    if values.dtype == np.uint8:
        return pixels_of(values, size), True
    if values.dtype.kind not in "fiu" or values.ndim not in (2, 3):
        raise ValueError(f"array: must be (h, w) or (h, w, k) numbers, got {values.shape} of {values.dtype}")
    for fault in size_faults(values.shape[1::-1], size):
        raise ValueError(f"array: {fault}")
    return np.asarray(values if values.ndim == 3 else values[..., None], np.float64), False


def _read(path: str) -> NDArray[Any]:
    try:
        check_regular(path)
        return np.asarray(np.load(path, allow_pickle=False))
    except UnreadableError as error:
        raise UsageError(f"{printable(path)}: {error}") from None
    except (ValueError, EOFError, OSError):
        raise UsageError(f"{printable(path)}: is no .npy file of numbers") from None


def _allowed(show: str, right: Floats, is_bytes: bool) -> Any:
    """By how much values may be off."""
    if show == "depth":
        return 2.0 if is_bytes else _FLOATS * np.abs(right).max(axis=2)
    if show == "color":
        return 1.5 / 255
    return _BYTES if is_bytes else _FLOATS


def _readings(
    show: str, own: NDArray[Any], image: Image, axes: Floats, seen: NDArray[np.bool_], is_bytes: bool
) -> Iterator[Reading]:
    if show == "color":
        right = np.asarray(image.color, np.float64)
        values = own / 255 if is_bytes else own
        for scale, how in ((1, "linear colours"), (255, "linear colours times 255")):
            yield how, _three(values / scale), right
            yield f"{how}, clamped to 1", np.minimum(_three(values / scale), 1), np.minimum(right, 1)
    elif show == "uv":
        yield from _uv(own / 255 if is_bytes else own, np.asarray(image.uv, np.float64))
    elif show == "depth":
        along = -(np.asarray(image.direction, np.float64) @ axes[2])
        yield from _depths(
            own[..., :1].astype(np.float64), np.asarray(image.depth), along=along, seen=seen, is_bytes=is_bytes
        )
    else:
        yield from _vectors(_three(own), np.asarray(getattr(image, show), np.float64), axes, is_bytes)


def _vectors(own: Floats, right: Floats, axes: Floats, is_bytes: bool) -> Iterator[Reading]:
    ranges = [("(v + 1)/2", own / 127.5 - 1 if is_bytes else 2 * own - 1)]
    ranges = ranges if is_bytes else [("numbers of -1..1", own), *ranges]
    for turned, space, (how, values) in product((1, -1), ("world", "camera"), ranges):
        b = turned * (right if space == "world" else right @ axes.T)
        words = f"{how} in the {space}'s axes" + (", pointing the other way" if turned < 0 else "")
        yield words, values, b
        length = np.linalg.norm(values, axis=2, keepdims=True)
        yield f"{words}, not of length 1", values / np.where(length > 0, length, 1), b
    for space in ("world", "camera"):
        b = right if space == "world" else right @ axes.T
        for how, values in ranges:
            flip = np.where((values * b).sum(axis=2, keepdims=True) < 0, -1, 1)
            yield f"{how} in the {space}'s axes, not all turned against the ray", flip * values, b
        for how, cut in (("|v|", np.abs(b)), ("v, 0 where it is negative", np.maximum(b, 0))):
            yield f"{how} in the {space}'s axes", own / 255 if is_bytes else own, cut


def _uv(own: Floats, right: Floats) -> Iterator[Reading]:
    """u and v without their whole parts. Of two that are nearly 1 apart, the own one is moved to the other's side."""
    b = right - np.floor(right)
    own = np.concatenate([own, np.zeros_like(own)], axis=2)[..., :2]
    for swap, flip_u, flip_v in product((False, True), repeat=3):
        a = own[..., ::-1] if swap else own
        a = np.stack([1 - a[..., 0] if flip_u else a[..., 0], 1 - a[..., 1] if flip_v else a[..., 1]], axis=2)
        words = [word for word, is_so in (("exchanged", swap), ("1 - u", flip_u), ("1 - v", flip_v)) if is_so]
        yield ", ".join(words) or "u and v", a + np.rint(b - a), b


def _depths(own: Floats, depth: Floats, along: Floats, seen: NDArray[np.bool_], is_bytes: bool) -> Iterator[Reading]:
    """As they are, or of bytes as a line through them or through their reciprocals."""
    for how, right in (("t along the ray", depth), ("t along the camera's z axis", depth * along)):
        if not is_bytes:
            yield how, own, right[..., None]
            continue
        for name, x in ((how, right), (f"1/{how}", 1 / right)):
            a, b = _line(x[seen], own[..., 0][seen])
            yield f"a grey that is even in {name}", own, np.rint(a * x + b)[..., None]


def _line(x: Floats, y: Floats) -> tuple[float, float]:
    """a and b of y = a x + b, (n,), by the half of the points that are nearest to it: others may be wrong."""
    near, a, b = np.arange(len(x)), 0.0, 0.0
    for _ in range(_FITTED):
        wide = len(near) > 1 and np.ptp(x[near]) > 0
        a, b = np.polyfit(x[near], y[near], 1).tolist() if wide else (a, float(np.median(y)) if len(y) else 0.0)
        off = np.abs(a * x + b - y)
        near = np.flatnonzero(off <= np.median(off)) if len(off) else near
    return a, b


def _classes(own: NDArray[Any], right: NDArray[Any], seen: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """0 where a colour is the most frequent one of what it is most frequent for; elsewhere 2. And 0 to compare with."""
    _, color = np.unique(own.reshape(-1, own.shape[2]), axis=0, return_inverse=True)
    _, number = np.unique(right, return_inverse=True)
    color, number = color.ravel(), number.ravel()
    rows = np.flatnonzero(seen)
    table = np.zeros((color.max() + 1, number.max() + 1), np.int64)
    np.add.at(table, (color[rows], number[rows]), 1)
    fits = (table.argmax(axis=1)[color] == number) & (table.argmax(axis=0)[number] == color)
    return np.where(fits, 0.0, 2.0).reshape(*seen.shape, 1), np.zeros((*seen.shape, 1))


def _sets(lit: NDArray[np.bool_]) -> NDArray[np.intp]:
    """(h, w): a number for each set of lights."""
    packed = np.packbits(lit, axis=2)
    _, number = np.unique(packed.reshape(-1, packed.shape[2]), axis=0, return_inverse=True)
    return number.reshape(lit.shape[:2])


def _three(values: NDArray[Any]) -> Floats:
    """(h, w, 3)."""
    return (
        np.repeat(values, 3, axis=2).astype(np.float64) if values.shape[2] == 1 else values[..., :3].astype(np.float64)
    )


def _words(values: Floats) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"

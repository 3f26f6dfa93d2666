"""What is wrong with a picture as a whole: turned, moved, in other colours, cut off. It is seen without tracing a ray.

Such mistakes hide all others. So they are found first, and the search goes on with a tracer that makes them, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.scene.colors import decoded
from cltrace.students.rules import RIGHT, CameraRules, Changes, Mistake, variants
from cltrace.students.tracer import to_bytes

Levels = NDArray[np.int64]  # (h, w, 3), 0..255
Bits = NDArray[np.bool_]
Made = dict[str, Changes]

# The mistakes that are about all of the picture, see mistakes.py.
PICTURE_MISTAKES = (
    Mistake(
        "integer-division",
        "whole numbers are divided where fractions are meant",
        "divide floating point numbers: u / width, height / width, texel / 255",
        (
            *variants(columns=("zero", "halves"), upside_down=(False, True)),
            *variants(aspect=("zero", "whole")),
            *variants(rounding=("whole",)),
            *variants(texture=("whole", "nearest whole")),
        ),
    ),
    Mistake(
        "gamma",
        "a gamma curve is applied",
        "write the bytes linearly: 255 c, without pow() and without an sRGB format of the image",
        variants(gamma=(2.2, 0.0, 2.0, 1.8, 2.4, 1 / 2.2)),
        whole=True,
    ),
    Mistake(
        "swapped-channels",
        "red, green and blue are written in another order",
        "the bytes of a pixel are red, green, blue; some image formats and windows want blue first",
        variants(channels=((2, 1, 0), (1, 0, 2), (0, 2, 1), (1, 2, 0), (2, 0, 1))),
        whole=True,
    ),
    Mistake(
        "grey",
        "the picture is grey",
        "write red, green and blue of the colour, not one number",
        variants(grey=((0.299, 0.587, 0.114), (0.2126, 0.7152, 0.0722), (1 / 3, 1 / 3, 1 / 3))),
        whole=True,
    ),
    Mistake(
        "colour-profile",
        "the colours are those of another screen: a colour profile, or a screenshot",
        "write the bytes yourself, instead of copying them from a window, and into a file without a profile",
        (),
        whole=True,
    ),
    Mistake("inverted", "black is white", "write 255 c, not 255 - 255 c", variants(inverted=(True,)), whole=True),
    Mistake(
        "upside-down",
        "top and bottom are exchanged",
        "y_i points up and rows are counted from the top: write row height - 1 - v, or turn y_i's sign",
        variants(upside_down=(True,)),
        whole=True,
    ),
    Mistake(
        "mirrored",
        "left and right are exchanged",
        "the camera's x axis is up x z with z = position - lookat: the other order turns it round",
        variants(mirrored=(True,)),
        whole=True,
    ),
    Mistake(
        "transposed",
        "rows and columns are exchanged",
        "image[y][x] is the pixel of column x and row y",
        variants(transposed=(True,)),
        whole=True,
    ),
    Mistake(
        "shifted",
        "all is some pixels aside",
        "the first column is u = 0 and the last one u = width - 1: x_n = (u + 0.5) / width",
        (),
        whole=True,
    ),
    Mistake(
        "wrapped",
        "what is brighter than 1 starts again at black",
        "clamp the colour to 0..1 before it becomes a byte: 255 * 1.07 does not fit",
        variants(rounding=("wrapped",)),
    ),
    Mistake(
        "unscaled",
        "colours of 0..1 are written as bytes without 255",
        "write int(255 c + 0.5)",
        variants(rounding=("unscaled",)),
    ),
    Mistake(
        "only-background",
        "the picture shows nothing but the background: no ray meets anything",
        "print the ray of the middle pixel, and what it should meet: --explain says both",
        (),
        whole=True,
    ),
    Mistake(
        "black",
        "the picture is black",
        "does the loop write its pixels, and is the picture saved after it? print one colour",
        (),
        whole=True,
    ),
    Mistake(
        "one-colour",
        "the picture has one colour",
        "does each pixel have its own ray, and is each one's colour written to its own place?",
        (),
        whole=True,
    ),
    Mistake(
        "cut-off",
        "the picture ends before its end",
        "close the file, and let the loops go through all rows",
        (),
        whole=True,
    ),
    Mistake(
        "border",
        "there is a frame around the picture",
        "write the picture as the program has it, not the window",
        (),
        whole=True,
    ),
    Mistake(
        "acne",
        "surfaces shadow themselves here and there: rays meet the surface that they start on",
        "start new rays a small epsilon off the surface, or ignore hits with t < epsilon",
        variants(reaching=(None,)),
    ),
    Mistake(
        "antialiased",
        "outlines are smooth: pixels have more than one ray",
        "the course has one ray for each pixel, through its middle",
        (),
        whole=True,
    ),
    Mistake(
        "truncated",
        "colours are rounded down to bytes",
        "round to the nearest: int(255 c + 0.5); the course's own pictures are truncated, see --truncate",
        variants(rounding=("down", "256")),
    ),
)
_BY_NAME = {mistake.name: mistake for mistake in PICTURE_MISTAKES}

_PROBES = 800  # pixels that are looked at
_STEP = 8  # levels by which these differ from a neighbour: where all is alike, all placings fit
_FAR = 8  # pixels, by which a picture may be shifted
_HALF = 0.5  # of what is otherwise wrong, and of all that is looked at, at least that a sure change makes right
_SOME = 0.2  # of what is otherwise wrong, at least that a change makes right which is worth a look
_EDGE = 32  # levels from side to side of an edge by which smooth pictures are told
_MIXED, _SMOOTH = 12, 0.4  # edges with a pixel between their sides, and their share, from which on a picture is smooth
_FITTED = 8  # rounds in which a colour profile is fitted to the pixels that are nearest to it, wrong ones left out
_COLORS = ("gamma", "swapped-channels", "grey", "inverted")
_PLACES: tuple[Made, ...] = tuple(
    {name: _BY_NAME[name].variants[0] for name in names}
    for names in (("upside-down",), ("mirrored",), ("upside-down", "mirrored"), ("transposed",))
)


@dataclass(frozen=True)
class Whole:
    """What was found.

    made: the mistakes that a tracer can make, with what each makes of the rules; covers: others, each with the pixels
    that it explains, (h, w); free: (h, w), pixels that tell nothing of any other mistake, as outlines of smooth
    pictures do not; sure: whether it is wrong whatever else is, or only if it explains the picture together with what
    is found beside it; brief: whether no more than one mistake is to be looked for beside it.
    """

    made: Made = field(default_factory=dict)
    covers: dict[str, Bits] = field(default_factory=dict)
    free: Bits | None = None
    sure: bool = True
    brief: bool = False


def whole(mine: Levels, right: Levels, tolerance: int, background: Levels, antialias: bool) -> Iterator[Whole]:
    """Looks at a picture and the right one: what is to be tried, in turns, until something explains the picture.

    background: (3,), whose pixels are no sign of anything; antialias: whether both are smooth.
    """
    wrong = np.abs(mine - right).max(axis=2) > tolerance
    if not wrong.any():
        yield Whole()
        return
    if not np.ptp(mine, axis=(0, 1)).any():
        name = "only-background" if np.abs(mine[0, 0] - background).max() <= 1 else "one-colour"
        yield Whole(covers={name if mine.any() else "black": wrong})
        return
    framed = dict(_framed(mine, wrong, background))
    if framed:
        yield Whole(covers=framed)
        return
    seems_smooth = not antialias and is_smooth(mine)
    for smooth in (False, True) if seems_smooth else (antialias,):
        free, covers = uneven(mine) if smooth else None, {}
        if free is not None and not antialias:
            low, high = around(right)
            between = ((mine >= low - tolerance) & (mine <= high + tolerance)).all(axis=2)
            free = free | (uneven(right) & between)
            covers = {"antialiased": wrong & free & between}
        made, sure = _made(mine, right, tolerance, free)
        # One mistake may do what most of a change of the whole picture would. Two beside a smooth picture would be
        # three, which explain too much by chance.
        yield Whole(covers=covers, free=free, brief=sure or seems_smooth)
        if made:
            yield Whole(made, covers | _strips(made, wrong), free=free, sure=sure)


def around(picture: NDArray[Any]) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
    """The least and the greatest levels of each pixel and those next to it, (h, w, 3) each."""
    ends = []
    for of in (np.minimum, np.maximum):
        found = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge").astype(np.int16)
        found = of(of(found[:-2], found[1:-1]), found[2:])
        ends.append(of(of(found[:, :-2], found[:, 1:-1]), found[:, 2:]))
    return ends[0], ends[1]


def uneven(picture: NDArray[Any]) -> Bits:
    """(h, w): where so much changes from pixel to pixel that the mean of one is not what its middle shows."""
    low, high = around(picture)
    return np.asarray((high - low).max(axis=2) > _STEP)


def is_smooth(mine: Levels) -> bool:
    """Whether most edges between two even sides have one pixel between these, of a colour between theirs.

    In sharp pictures, hardly any have.
    """
    mixed = edges = 0
    for lines in (mine, mine.swapaxes(0, 1)):
        if lines.shape[1] < 5:
            continue
        channel = np.abs(lines[:, 3:-1] - lines[:, 1:-3]).argmax(axis=2)[..., None]
        count = lines.shape[1] - 4
        at = [np.take_along_axis(lines[:, i : count + i], channel, axis=2)[..., 0] for i in range(5)]
        far, way = np.abs(at[3] - at[1]), np.sign(at[3] - at[1])
        edge = (far >= _EDGE) & (8 * np.abs(at[1] - at[0]) <= far) & (8 * np.abs(at[4] - at[3]) <= far)
        between = np.minimum((at[2] - at[1]) * way, (at[3] - at[2]) * way) * 8 > far
        edges, mixed = edges + int(edge.sum()), mixed + int((edge & between).sum())
    return mixed >= max(_MIXED, _SMOOTH * edges)


def _strips(made: Made, wrong: Bits) -> dict[str, Bits]:
    """The columns and rows at the sides that a shift brought in, where they are wrong."""
    if "shifted" not in made:
        return {}
    x, y = made["shifted"]["sample"]
    strips = np.ones(wrong.shape, np.bool_)
    dx, dy = round(abs(x - 0.5)), round(abs(y - 0.5))
    strips[dy : len(wrong) - dy, dx : wrong.shape[1] - dx] = False
    return {"shifted": strips & wrong}


def _made(mine: Levels, right: Levels, tolerance: int, free: Bits | None) -> tuple[Made, bool]:
    """The placing and the colours that fit best, if they fit far better than what should be there; whether it is sure.

    Beside another mistake they leave most of the picture wrong. Then the search has to find that one, too: a picture
    that is alike on both sides fits its mirror image about as well when its light comes from elsewhere.

    free: pixels that are not looked at, if any.
    """
    height, width = mine.shape[:2]
    steps = np.zeros((height, width), np.bool_)
    steps[:, 1:] |= np.abs(np.diff(mine, axis=1)).max(axis=2) >= _STEP
    steps[1:] |= np.abs(np.diff(mine, axis=0)).max(axis=2) >= _STEP
    if free is not None:
        steps = ~free
    where = np.flatnonzero(steps) if steps.sum() > 20 else np.arange(height * width)
    y, x = np.divmod(np.random.default_rng(0).permutation(where)[:_PROBES], width)

    def fits(made: Made) -> float:
        rules = RIGHT.changed(**{key: value for changes in made.values() for key, value in changes.items()})
        seen = _seen(right, x, y, rules.camera)
        if made.keys() <= {"shifted"}:
            return float((np.abs(mine[y, x] - seen).max(axis=1) <= tolerance).mean())
        # A level of the right picture stands for the colours that are nearest to it.
        ends = [to_bytes(np.maximum(seen + off, 0) / 255, rules.picture) for off in (-0.499, 0.499)]
        low, high = np.minimum(*ends) - tolerance, np.maximum(*ends) + tolerance
        off = (mine[y, x] < low) | (mine[y, x] > high)
        return 1 - float(off.any(axis=1).mean())

    before, best, made = fits({}), 0.0, {}
    for tried in _tried(height == width):
        fit = fits(tried)
        if fit > best:
            best, made = fit, tried
    for place in _places(height == width) if best < _HALF else ():
        rules = RIGHT.changed(**{key: value for changes in place.values() for key, value in changes.items()})
        tried = {**place, **profile(mine[y, x], _seen(right, x, y, rules.camera))}
        fit = fits(tried)
        if fit > best:
            best, made = fit, tried
    gain = (best - before) / (1 - before) if before < 1 else 0.0
    return made if gain >= _SOME else {}, min(best, gain) >= _HALF


def profile(mine: Levels, right: Levels) -> Made:
    """The colour profile that is nearest to what pixels, (n, 3), show.

    White stays white, as profiles are adapted to it: each row of the matrix has the sum 1. So what a pixel has beside
    its green is shown beside its green.
    """
    right_light, shown = decoded(right / 255, "srgb"), decoded(mine / 255, "srgb")
    green = right_light[:, 1:2]
    light = (right_light - green)[:, ::2]
    rows = np.arange(len(light))
    for _ in range(_FITTED):
        matrix = np.linalg.lstsq(light[rows], (shown - green)[rows], rcond=None)[0]
        off = np.abs(light @ matrix + green - shown).max(axis=1)
        rows = np.argsort(off, kind="stable")[: max(len(off) // 2, 3)]
    red, blue = matrix
    weights = np.stack([red, 1 - red - blue, blue], axis=1)
    # Every screen's red is mostly red. Else the colours are exchanged.
    is_screen = (weights.argmax(axis=1) == range(3)).all()
    return {"colour-profile": {"profile": tuple(weights.ravel().tolist())}} if is_screen else {}


def _places(square: bool) -> list[Made]:
    return [{}, *(_PLACES if square else _PLACES[:3])]


def _tried(square: bool) -> Iterator[Made]:
    """From what is simple to what is not."""
    places = _places(square)
    colors = [{name: way} for name in _COLORS for way in _BY_NAME[name].variants]
    yield from places[1:]
    yield from colors
    yield from ({**place, **color} for place in places[1:] for color in colors)
    reach = range(-_FAR, _FAR + 1)
    for dx, dy in sorted(((i, j) for i in reach for j in reach if i or j), key=lambda ij: abs(ij[0]) + abs(ij[1])):
        yield {"shifted": {"sample": (0.5 + dx, 0.5 - dy)}}


def _seen(right: Levels, x: NDArray[np.intp], y: NDArray[np.intp], rules: CameraRules) -> Levels:
    """What pixels show of the right picture, (n, 3)."""
    height, width = right.shape[:2]
    x, y = (y, x) if rules.transposed else (x, y)
    x = width - 1 - x if rules.mirrored else x
    y = height - 1 - y if rules.upside_down else y
    x, y = x + round(rules.sample[0] - 0.5), y - round(rules.sample[1] - 0.5)
    return np.asarray(right[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)])


def _framed(mine: Levels, wrong: Bits, background: Levels) -> Iterator[tuple[str, Bits]]:
    """Rows or columns of one colour at the picture's sides, where they are nearly all that is wrong."""
    height, width = wrong.shape
    counts = [_even(rows, background) for rows in (mine, mine[::-1], mine.swapaxes(0, 1), mine.swapaxes(0, 1)[::-1])]
    top, bottom, left, right = counts
    frame = np.ones(wrong.shape, np.bool_)
    frame[top : height - bottom, left : width - right] = False
    sides = sum(count > 0 for count in counts)
    if frame.all() or not wrong[frame].any() or wrong[~frame].mean() > 0.1 * wrong[frame].mean():
        return
    if sides == 1 and (top or bottom):
        yield "cut-off", frame & wrong
    elif sides == 4:
        yield "border", frame & wrong


def _even(rows: Levels, background: Levels) -> int:
    """How many rows there are, from the first one on, of its first pixel's colour, which is not the background's."""
    color = rows[0, 0]
    if np.abs(color - background).max() <= 1:
        return 0
    even = (rows == color).all(axis=(1, 2))
    return len(even) if even.all() else int(np.argmin(even))

"""Compares a picture with the right one."""

from __future__ import annotations

import os
import shlex
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Picture
from PIL import UnidentifiedImageError

from cltrace.base.errors import UsageError, printable
from cltrace.explanation.pixel import Explainer
from cltrace.formats.files import UnreadableError, check_regular
from cltrace.picture.image import Image
from cltrace.plan.abi import Precision
from cltrace.renderers.renderer import render
from cltrace.run.devices import Device
from cltrace.scene import Camera, Scene
from cltrace.students.comparison import Bytes, Cause, Comparison, places
from cltrace.students.rules import RIGHT, Rules
from cltrace.students.search import LIKELY, Search, Verdict
from cltrace.students.tracer import to_bytes
from cltrace.students.whole import around, uneven, whole

# Files that hold every pixel as it was written. JPEG does not.
FORMATS = ("PNG", "BMP", "PPM", "TGA")
INNER = 0.01  # of a smooth picture's pixels, wrong with all around them: so many are no matter of outlines


def compare(
    scene: Scene,
    picture: Image | Bytes | str | os.PathLike[str],
    *,
    tolerance: int = 1,
    device: str | Device | None = None,
    precision: Precision | None = None,
    truncate: bool = False,
    antialias: bool = False,
) -> Comparison:
    """Compares a picture of a scene with the right one, and says which mistakes explain the difference.

    picture: an Image with rgb8; an array of uint8, (h, w, 3), (h, w, 4) with alpha, which is ignored, or (h, w) grey;
    or the name of a PNG, BMP, PPM or TGA file; row 0 is the top; one that is larger or smaller than the scene's by a
    factor is compared at its own size; tolerance: by how many levels, 0..255, a channel may differ; device, precision:
    what renders the right picture; truncate: whether that rounds bytes down; antialias: whether both are smooth, so
    that along outlines any mixture of the colours around is right.

    Raises ValueError, which names the argument, where one is not allowed or the picture has other proportions than
    the scene's, TypeError where the scene or the picture is something else altogether, UsageError where the file is no
    such picture, and what `render` raises.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene: must be a cltrace.Scene, such as cltrace.load() gives, got {scene!r}")
    if scene.transfer != "linear":
        raise ValueError("scene: must have the transfer 'linear', as scene files have, got 'srgb'")
    if len(scene.planes):
        raise ValueError("scene: must have no clipping planes, which no scene file has")
    if isinstance(tolerance, bool) or not isinstance(tolerance, (int, np.integer)) or not 0 <= tolerance <= 255:
        raise ValueError(f"tolerance: must be a whole number of levels within 0..255, got {tolerance!r}")
    asked = scene.camera.resolution
    mine = pixels_of(picture, asked)
    size = mine.shape[1], mine.shape[0]
    scene = scene if size == asked else scene.seen_by(replace(scene.camera, resolution=size))
    right = render(scene, device, precision, truncate=truncate).rgb8
    smoothed = partial(_smoothed, draw=partial(render, scene, device, precision, truncate=truncate))
    if antialias:
        right = smoothed(mine, right, int(tolerance))
    result = Comparison(mine, right, int(tolerance), asked=None if size == asked else asked)
    result = _judged(scene, result, RIGHT.changed(rounding="down" if truncate else "nearest"), antialias)
    if result.same or not result.error.any():
        return result
    error = result.error
    if not antialias and [cause.name for cause in result.causes] == ["antialiased"]:
        smooth = Comparison(mine, smoothed(mine, right, int(tolerance)), int(tolerance))
        left = float(((error > tolerance) & (smooth.error > tolerance)).sum() / (error > tolerance).sum())
        if 1 - left > result.explained:  # penumbras are smooth, too
            result, error = replace(result, causes=(Cause("antialiased", 1 - left),), explained=1 - left), smooth.error
    ask = partial(question, scene, truncate)
    return replace(result, places=places(Explainer(scene), mine, error, ask=ask, truncate=truncate))


def _smoothed(mine: Bytes, sharp: Bytes, tolerance: int, draw: Callable[..., Image]) -> Bytes:
    """The smooth picture, and where it differs from the sharp one what is nearest to the own one of what is around.

    How an outline is mixed depends on where the rays of a pixel go, which every program decides otherwise. The smooth
    picture takes far longer than the sharp one, which is enough where more than outlines is wrong.
    """
    low, high = around(sharp)
    right = np.where(uneven(sharp)[..., None], np.clip(mine, low, high), sharp)
    wrong = (np.abs(mine.astype(np.int16) - right).max(axis=2) > tolerance).astype(np.uint8)
    if around(wrong[..., None])[0].mean() <= INNER:
        smooth = draw(antialias=True).rgb8
        ends = around(smooth)
        low, high = np.minimum(low, ends[0]), np.maximum(high, ends[1])
        soft = np.abs(smooth.astype(np.int16) - sharp).max(axis=2) > tolerance
        right = np.where(soft[..., None], np.clip(mine, low, high), smooth)
    return right.astype(np.uint8)


def _judged(scene: Scene, result: Comparison, base: Rules, antialias: bool) -> Comparison:
    """The comparison with the causes of its differences: of the whole picture, then of what a tracer sees otherwise.

    base: the rules of the right picture; antialias: whether both are smooth.
    """
    mine, right = result.mine.astype(np.int64), result.right.astype(np.int64)
    wrong = result.error > result.tolerance
    if not result.error.any():
        return result
    background = to_bytes(np.array(scene.background))
    trials = list(whole(mine, right, tolerance=result.tolerance, background=background, antialias=antialias))
    count = max(int(wrong.sum()), 1)
    parts = {name: float(cover.sum()) / count for name, cover in trials[0].covers.items()}
    if sum(parts.values()) == 1 and not trials[0].made and trials[0].free is None:
        return replace(result, causes=tuple(Cause(*item) for item in parts.items()), explained=1.0)
    searches = [Search(scene, mine, right, tolerance=result.tolerance, base=base, found=found) for found in trials]
    search, verdict = _first([s for s in searches if s.found.free is None]) or _smooth(searches, count)
    parts = {name: float(cover.sum()) / count for name, cover in search.found.covers.items()}
    left = 1 - sum(parts.values())
    together, shares = search.explains(verdict)
    for name, share in shares.items():
        parts[name] = parts.get(name, 0.0) + left * share
    causes = [Cause(name, share, verdict.rivals.get(name, ())) for name, share in parts.items() if share > 0]
    return replace(
        result,
        causes=tuple(sorted(causes, key=lambda cause: -cause.explains)),
        explained=1 - left + left * together if causes else 0.0,
    )


def _first(searches: list[Search]) -> tuple[Search, Verdict] | None:
    """The search that first finds what explains the picture, and what does: all look in turns, from quick to long."""
    for verdicts in zip_longest(*(search.verdicts() for search in searches)):
        for search, verdict in zip(searches, verdicts, strict=True):
            if verdict:
                return search, verdict
    return None


def _smooth(searches: list[Search], count: int) -> tuple[Search, Verdict]:
    """What explains a picture that seems to be smooth, where nothing does as if it were sharp.

    It need not be smooth unless that is most of what is wrong, or the rest is found. If nothing is, it is the last
    search where that is sure of what it began with, or else the first one. count: wrong pixels.
    """
    smooth = [search for search in searches if search.found.free is not None]
    found = _first(smooth)
    is_most = any(sum(int(cover.sum()) for cover in s.found.covers.values()) >= LIKELY * count for s in smooth)
    if found and not is_most and len(found[1].named.made) <= len(found[0].whole):
        covers = {name: cover for name, cover in found[0].found.covers.items() if name != "antialiased"}
        found[0].found = replace(found[0].found, covers=covers)
    if found and (found[1].named.made or is_most or not smooth[0].found.covers):
        return found
    searches = smooth if is_most else [s for s in searches if s not in smooth] or smooth
    search = searches[-1 if searches[-1].found.sure else 0]
    return search, search.unknown()


def question(scene: Scene, truncate: bool, x: int, y: int) -> str:
    """The command that explains a pixel; of a scene that is not just as its file has it, the call."""
    camera, source = scene.camera, scene.source
    options = [f"--explain {x},{y}"] + ["--truncate"] * truncate
    if (
        source is None
        or not isinstance(camera, Camera)
        or replace(source.view, resolution=camera.resolution, square_pixels=camera.square_pixels) != camera
    ):
        return f"cltrace.explain(scene, {x}, {y}{', truncate=True' if truncate else ''})"
    if camera.square_pixels:
        options.insert(0, "--square-pixels")
    if camera.resolution != source.view.resolution:
        options.insert(0, "--size {}x{}".format(*camera.resolution))
    return " ".join(["cltrace", shlex.quote(printable(source.path)), *options])


def pixels_of(picture: Any, size: tuple[int, int]) -> Bytes:
    """(h, w, 3) uint8: the pixels of an Image, an array or a file of these proportions; see compare()."""
    if isinstance(picture, (str, os.PathLike)):
        return _read(os.fspath(picture), size)
    if not isinstance(picture, (Image, np.ndarray)):
        raise TypeError(f"picture: must be a cltrace.Image, an array of uint8 or the name of a file, got {picture!r}")
    pixels = picture.as_rgb8() if isinstance(picture, Image) else picture
    if pixels.dtype != np.uint8 or not (pixels.ndim == 2 or (pixels.ndim == 3 and pixels.shape[2] in (3, 4))):
        shape = f"got {pixels.shape} of {pixels.dtype}"
        raise ValueError(f"picture: must have shape (h, w, 3), (h, w, 4) or (h, w) and be of uint8, {shape}")
    if fault := size_fault(pixels.shape[1::-1], size):
        raise ValueError(f"picture: {fault}")
    return np.array(np.repeat(pixels[..., None], 3, axis=2) if pixels.ndim == 2 else pixels[..., :3])


def size_fault(found: tuple[int, ...], size: tuple[int, int]) -> str:
    """What is wrong with a picture's width and height; "" if they have the proportions of the scene's."""
    (width, height), (w, h) = found, size
    if width and width * h == height * w:
        return ""
    advice = "are width and height exchanged?" if (height, width) == (w, h) else "--size compares at another size"
    return f"has {width}x{height} pixels, but the scene's picture has {w}x{h}; {advice}"


def _read(path: str, size: tuple[int, int]) -> Bytes:
    """The pixels of a file, as they are stored. Raises UsageError, which begins with its name."""
    try:
        check_regular(path)
        with warnings.catch_warnings(), Path(path).open("rb") as file:
            warnings.simplefilter("ignore")  # of many pixels, which are counted here
            with Picture.open(file, formats=FORMATS) as image:
                if fault := size_fault(image.size, size):
                    raise UnreadableError(fault)
                return _bytes_of(image)
    except UnreadableError as error:
        raise UsageError(f"{printable(path)}: {error}") from None
    except UnidentifiedImageError:
        raise UsageError(f"{printable(path)}: is no {', '.join(FORMATS[:-1])} or {FORMATS[-1]} picture") from None
    except MemoryError:
        raise
    except Exception as error:  # decoders raise whatever their code does
        words = error.strerror if isinstance(error, OSError) else None
        raise UsageError(f"{printable(path)}: {f'cannot be read: {words}' if words else 'is damaged'}") from None


def _bytes_of(image: Picture.Image) -> Bytes:
    image.load()
    image.info.pop("transparency", None)
    if image.mode.startswith("I"):  # 16 bits of grey
        grey = (np.asarray(image).astype(np.float64) / 257 + 0.5).astype(np.uint8)
        return np.repeat(grey[..., None], 3, axis=2)
    return np.array(image.convert("RGB"))

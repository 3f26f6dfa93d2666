"""What the frames of a movie show, which of them are picked, and how their files are called."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cltrace.picture.files import is_named_as_folder
from cltrace.plan.request import Crop
from cltrace.scene import AnyCamera, Camera, Orthographic, Scene, with_spheres
from cltrace.scene.rules import LARGEST, Vector, is_whole, vector

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
# What a frame may change of the one before it, beside its camera: the arguments of Renderer.update().
CHANGES = (
    *("centers", "radii", "colors", "values", "cmap", "clim", "norm", "ka", "kd", "ks", "exponent"),
    *("reflectance", "transmittance", "index"),
)
# Digits of a frame's number, so that no counting goes on for ever.
RANGE = re.compile(r"([0-9]{0,9})(?::([0-9]{0,9}))?(?::([0-9]{0,9}))?")
# The number of a frame in the name of its file.
NUMBER = re.compile(r"%(0[1-9])?d")
# Formats of one file for all frames.
MOVIES = (".mp4", ".gif", ".apng")


class MovieFrame(NamedTuple):
    """A frame of a movie: its number, from 0, and what it shows; crop: where other frames have another one."""

    number: int
    scene: Scene
    crop: Crop | None = None


def frames_of(items: Iterable[object], scene: Scene | None = None, select: slice = slice(None)) -> Iterator[MovieFrame]:
    """The frames that `select` picks, each from what was there before it.

    items: a Scene takes the place of what was there; a Camera looks at it; a mapping changes its spheres, as
    Renderer.update() takes it, and looks with another camera if it has one called "camera". scene: what is there
    before the first of them; select: of the numbers of the frames, whose parts are None or not negative.

    Raises ValueError if there are none, TypeError for what is none of these, for one of them instead of several, and
    for a first item that is no Scene where there is no scene, and ValueError where an update has no such name or value.
    What is about one item begins with the number of the frame.
    """
    if isinstance(items, (Scene, Camera, Orthographic, Mapping, str)) or not isinstance(items, Iterable):
        raise TypeError(f"frames: must be a list, or another iterable, of Scenes, Cameras and dicts, got {items!r}")
    start, stop, step = select.start or 0, select.stop, select.step or 1
    number = -1
    for number, item in enumerate(items):
        if stop is not None and number >= stop:
            return
        try:
            scene = _after(scene, item)
        except (TypeError, ValueError) as error:
            raise type(error)(f"frames[{number}]: {error}") from None
        if number >= start and (number - start) % step == 0:
            yield MovieFrame(number, scene)
    if number < 0:
        raise ValueError("frames: must be at least one, got none")


def _after(scene: Scene | None, item: object) -> Scene:
    """The scene that an item makes of the one before it."""
    if isinstance(item, Scene):
        return item
    if not isinstance(item, (Camera, Orthographic, Mapping)):
        raise TypeError(f"must be a Scene, a Camera, or a dict of what update() takes, got {item!r}")
    if scene is None:
        raise TypeError("must be a Scene, since there is no scene=... that a camera or a dict could change")
    if isinstance(item, (Camera, Orthographic)):
        return scene.seen_by(item)
    given = {name: value for name, value in item.items() if name != "camera" and value is not None}
    unknown = [name for name in given if name not in CHANGES]
    if unknown:
        raise ValueError(f"must be of camera, {', '.join(CHANGES)}, got {unknown[0]!r}")
    if given:
        scene = with_spheres(scene, given)
    return scene.seen_by(item["camera"]) if item.get("camera") is not None else scene


def orbit(scene: Scene, n: int, axis: str | ArrayLike | None = None, degrees: float = 360.0) -> list[AnyCamera]:
    """n cameras on a circle about the point that the scene's camera looks at; the first is the scene's own.

    axis: that they turn about, as "x", "y", "z" or three numbers, None for the camera's up; degrees: from the first to
    the one that would come after the last, so that a movie of 360 degrees can be repeated. It is the camera that turns,
    counter-clockwise if the axis points at who looks. Raises ValueError, which names the argument.
    """
    camera = scene.camera
    if not is_whole(n) or n < 1:
        raise ValueError(f"n: must be a whole number >= 1, got {n!r}")
    if not isinstance(degrees, (int, float)) or not abs(degrees) <= LARGEST:
        raise ValueError(f"degrees: must be a finite number, got {degrees!r}")
    if isinstance(axis, str) and axis not in AXES:
        raise ValueError(f"axis: must be x, y, z or three numbers, got {axis!r}")
    given = camera.up if axis is None else AXES[axis] if isinstance(axis, str) else vector("axis", axis)
    length = math.hypot(*given)
    if not 0 < length < math.inf:
        raise ValueError(f"axis: must have a length, got {given}")
    unit = np.array(given) / length
    return [camera, *(turned(camera, unit, math.radians(degrees * k / n)) for k in range(1, n))]


def turned(camera: AnyCamera, axis: Any, angle: float) -> AnyCamera:
    """The camera, turned about an axis of length 1 through what it looks at; radians."""
    middle = np.array(camera.lookat)
    sine, cosine = math.sin(angle), math.cos(angle)

    def turn(v: Any) -> Vector:  # Rodrigues' formula
        x, y, z = (v * cosine + np.cross(axis, v) * sine + axis * (axis @ v) * (1 - cosine)).tolist()
        return (x, y, z)

    position = (middle + turn(np.array(camera.position) - middle)).tolist()
    return replace(camera, position=tuple(position), up=turn(np.array(camera.up)))


def range_of(text: str) -> slice:
    """A:B:S, of which each part may be missing, or the number of one frame. Raises ValueError."""
    match = RANGE.fullmatch(text)
    if not match or not text:
        raise ValueError(f"must be A:B or A:B:S, such as 0:100 or 3::10, or a number, got {text!r}")
    start, stop, step = (int(part) if part else None for part in match.groups())
    if ":" not in text:
        assert start is not None
        return slice(start, start + 1)
    if step == 0:
        raise ValueError(f"must have a step of 1 at least, got {text!r}")
    if start is not None and stop is not None and stop <= start:
        raise ValueError(f"must pick a frame, got {text!r}")
    return slice(start, stop, step)


class Pattern(NamedTuple):
    """The name of a file, or of as many as there are frames.

    text: in which %04d, or another number of digits, stands for a frame's number, and %% for a percent sign.
    """

    text: str

    @property
    def suffix(self) -> str:
        """Of the file, in small letters."""
        return Path(self.text).suffix.lower()

    def of(self, number: int) -> str:
        """The name of the file of a frame."""
        parts = self.text.split("%%")
        return "%".join(NUMBER.sub(lambda match: match.group() % number, part) for part in parts)


def pattern_of(output: str, stem: str, frames: bool) -> Pattern:
    """What a user's output means.

    output: a name with %04d where there are frames, or a movie's; {} in it is the stem of the scene's name; a folder
    gets files of the stem's name. frames: whether there may be more than one frame. Raises ValueError, in words that
    belong behind the option's name.
    """
    if not output:
        raise ValueError("must not be empty")
    output = output.replace("{}", stem.replace("%", "%%") if frames else stem)
    if Path(output).is_dir() or is_named_as_folder(output):
        output = str(Path(output, f"{stem.replace('%', '%%')}%04d.png" if frames else f"{stem}.png"))
    if not frames:
        return Pattern(output.replace("%", "%%"))
    pattern = Pattern(output)
    count = len(NUMBER.findall(output.replace("%%", "")))
    if count > 1 or len(NUMBER.sub("", output.replace("%%", "")).split("%")) > 1:
        raise ValueError(
            f"must have one %d or %04d for the number of a frame, and %% for a percent sign, got {output!r}"
        )
    if pattern.suffix in MOVIES and count:
        raise ValueError(f"a movie is one file, and its name has no number, got {output!r}")
    if pattern.suffix == ".png" and not count:
        raise ValueError(f"must have a %04d for the number of a frame, such as frame%04d.png, got {output!r}")
    if pattern.suffix not in (*MOVIES, ".png"):
        raise ValueError(f"the name of frames must end in .png, of a movie in {', '.join(MOVIES)}, got {output!r}")
    return pattern

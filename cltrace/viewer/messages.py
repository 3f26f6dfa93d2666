"""What the page and the server say to each other: one type each way, and the lines that an explanation draws.

Lines are the pixel's rays, those that go on from it, and shadow rays."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal, get_args

from cltrace.explanation.explanation import Explanation
from cltrace.explanation.textbook import Triple
from cltrace.students.comparison import members

Moves = Literal["orbit", "pan", "zoom", "fit", "parallel", "back", "undo", "fov", "reset"]
Settings = Literal["show", "samples", "light", "frame", "shown"]
# What is answered, which may take long.
Questions = Literal["explain", "centre", "copy", "compare", "write"]
Kind = Literal[Moves, Settings, Questions]
Pictures = Literal["moving", "exact", "smooth", "outline", "mine", "difference"]
Texts = Literal["explanation", "lines", "comparison", "copy", "said", "fault", "error"]
LARGEST = 2**28  # pixels, and more than any drag


@dataclass(frozen=True)
class Event:
    """What was done in the page.

    orbit, pan, zoom: a drag of the pointer, x and y, see cameras.py; fit, parallel, back, undo: keys; show: the button
    of `name`; centre, explain: about the pixel in column x and row y; copy: the camera, as `name`; compare: with the
    picture of --compare; shown: the picture that counts x events is on the screen; fov: the whole opening angle, x
    degrees; samples: x rays a pixel of the smooth picture; light: number x shines y times as bright as the scene says,
    0 to 1; reset: these three as the scene has them; frame: number x of the movie; write: the movie's file.
    """

    kind: Kind
    x: float = 0.0
    y: float = 0.0
    name: str = ""

    @classmethod
    def of(cls, text: str) -> Event:
        """From JSON. Raises ValueError where it is no event."""
        given = json.loads(text)
        if not isinstance(given, dict) or not given.keys() <= {field.name for field in fields(cls)}:
            raise ValueError("an event has kind, x, y and name")
        kind, x, y, name = (given.get(field.name, field.default) for field in fields(cls))
        if kind not in get_args(Kind) or not isinstance(name, str):
            raise ValueError(f"there is no event {kind!r} {name!r}")
        if not all(type(v) in (int, float) and abs(v) <= LARGEST for v in (x, y)):
            raise ValueError(f"an event's x and y are numbers within {LARGEST}, got {x!r} and {y!r}")
        return cls(kind, x, y, name)


@dataclass(frozen=True)
class Message:
    """What the page is to show.

    moving, exact, smooth: a picture, with its caption, of `width` and `height` pixels at rest, that counts `number`
    events; home: whether it is by the scene's own camera; data is a JPEG while it moves, else the PNG of the command.
    explanation, comparison, copy, said: a text. lines: those of an explanation, see lines.py, as JSON; outline: a PNG
    that lies over the picture, around the surface that is explained. mine, difference: PNGs beside a comparison. fault:
    what is wrong with the scene's file now, "" for nothing; error: what was asked for and cannot be. state: what the
    controls show beside a picture, see Session._state().
    """

    kind: Literal[Pictures, Texts]
    text: str = ""
    data: bytes = b""
    width: int = 0
    height: int = 0
    number: int = 0
    home: bool = True
    state: dict[str, Any] | None = None

    def head(self) -> dict[str, Any]:
        """All but the data, as JSON has it."""
        head = asdict(self)
        del head["data"]
        return head

    def encoded(self) -> bytes:
        """A line of JSON, and then the data."""
        return json.dumps(self.head()).encode() + b"\n" + self.data


# Lines that are drawn at most: glass in the light of a sky has more.
MOST = 2000


@dataclass(frozen=True)
class RayLine:
    """From one point of the world to another.

    kind: of a ray: primary, mirrored, refracted; of a shadow ray its fate, see LightTerm, and "beyond" for the rest of
    the way to the light behind what blocks it.
    """

    kind: str
    start: Triple
    end: Triple


def as_json(found: Explanation, reach: float) -> str:
    """The first MOST lines of an explanation, and how many there are. reach: see lines_of()."""
    lines = list(lines_of(found, reach))
    return json.dumps({"lines": [asdict(line) for line in lines[:MOST]], "count": len(lines)})


def lines_of(found: Explanation, reach: float) -> Iterator[RayLine]:
    """All of them, the pixel's ray first. reach: how long those are that have no end, in scene units.

    A shadow ray goes from the point to what blocks it, and on to the light.
    """
    for ray in found.rays:
        yield RayLine(ray.kind, ray.origin, ray.hit.point if ray.hit else _along(ray.origin, ray.direction, reach))
        for light in (one for lights in ray.lights for one in members(lights)):
            assert ray.hit
            start = ray.hit.point
            end = _along(start, light.l, light.distance if math.isfinite(light.distance) else reach)
            blocker = light.between[0].point if light.between else None
            yield RayLine(light.fate, start, blocker or end)
            if blocker:
                yield RayLine("beyond", blocker, end)


def _along(start: Triple, direction: Triple, distance: float) -> Triple:
    x, y, z = (place + distance * towards for place, towards in zip(start, direction, strict=True))
    return (x, y, z)

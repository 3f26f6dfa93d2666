"""The frames of a movie that windows look through, as animate() has them."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cltrace.base.errors import CltraceError
from cltrace.movie.animate import FPS
from cltrace.movie.frames import Frame, frames_of
from cltrace.scene import Scene
from cltrace.scene.rules import is_whole

# Raises where a movie is not wanted any more.
Check = Callable[[], None]


@dataclass(frozen=True)
class Film:
    """A movie.

    items: what its frames show of a scene, as animate() takes them; count: how many there are; fps: frames a second;
    file: where write() writes it, which calls what it is given for each frame; "" if nowhere.
    """

    items: Callable[[Scene], Iterable[object]] = lambda scene: [scene]
    count: int = 1
    fps: float = FPS
    file: str = ""
    write: Callable[[Check], object] = lambda check: None


def film_of(
    frames: Sequence[object] | Callable[[int], object],
    count: int | None,
    output: str | os.PathLike[str] | None,
    fps: float,
    animate: Callable[..., object],
) -> Film:
    """The film of these arguments of view(). animate: writes frames to an output. Raises TypeError and ValueError."""
    if callable(frames):
        number = int(count or 0) if is_whole(count) else 0
        if number < 1:
            raise ValueError(f"count: must be how many frames the function makes, 1 at least, got {count!r}")
    elif not isinstance(frames, Sequence) or isinstance(frames, str) or not frames:
        raise TypeError(f"frames: must be a list of frames, at least one, or a function of a number, got {frames!r}")
    elif count is not None:
        raise ValueError(f"count: goes with a function of a frame's number, got {count!r}")
    else:
        number = len(frames)

    def items(check: Check = lambda: None) -> Iterator[Any]:
        for k in range(number):
            check()
            yield frames(k) if callable(frames) else frames[k]

    file = "" if output is None else os.fspath(output)
    return Film(lambda scene: items(), number, fps, file, lambda check: animate(items(check), file))


class Frames:
    """The scenes of a film's frames, each made when it is first asked for, after those before it: a frame is what it
    changes of the last one. Several threads may ask."""

    def __init__(self, film: Film, scene: Scene) -> None:
        self._coming: Iterator[Frame] | None = None
        self._film, self._scene = film, scene
        self._made, self._fault, self._lock = list[Scene](), "", threading.Lock()

    def __len__(self) -> int:
        return self._film.count

    def __getitem__(self, number: int) -> Scene:
        """Raises ValueError where a frame, or one before it, cannot be."""
        with self._lock:
            if self._coming is None:
                self._coming = frames_of(self._film.items(self._scene), self._scene)
            while len(self._made) <= number and not self._fault:
                try:
                    self._made.append(next(self._coming).scene)
                except StopIteration:
                    self._fault = f"frames: there are only {len(self._made)}"
                except Exception as error:  # of the user's function, too
                    words = isinstance(error, (CltraceError, TypeError, ValueError))
                    self._fault = str(error) if words else f"frames[{len(self._made)}]: {error!r}"
            if len(self._made) <= number:
                raise ValueError(self._fault)
            return self._made[number]

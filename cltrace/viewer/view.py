"""cltrace.view(): a program's scene in the browser or in its notebook, and what it shares with the command."""

from __future__ import annotations

import importlib
import os
import sys
import threading
import webbrowser
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

from cltrace.base.errors import MissingPackageError
from cltrace.movie.animate import FPS, animate
from cltrace.plan.abi import Precision
from cltrace.run.devices import Device, choose
from cltrace.scene import Scene
from cltrace.viewer.stage import Stage, film_of


def view(
    scene: Scene,
    device: str | Device | None = None,
    precision: Precision | None = None,
    samples: int | None = None,
    outline: tuple[Any, float] | None = None,
    fog: tuple[Any, float, float] | None = None,
    *,
    frames: Sequence[object] | Callable[[int], object] | None = None,
    count: int | None = None,
    output: str | os.PathLike[str] | None = None,
    fps: float = FPS,
) -> Any:
    """Shows a scene, to be turned and clicked.

    In a notebook it returns a widget, which shows itself at the end of a cell: its `camera` is where it looks from now,
    `close()` ends it. Elsewhere it shows the scene in the browser until Ctrl-C, as `cltrace view` does, and prints the
    address. The arguments are those of Renderer; samples is about the last picture at rest alone, which is antialiased.
    It needs the extra `view`.

    frames: a movie to look through: a list of what animate() takes, such as cameras, scenes and dicts of what changes,
    or a function that makes one of its number, from 0 to count - 1; output, fps: as of animate(), which a button calls.

    Raises MissingPackageError without it, TypeError and ValueError for what makes no sense, and what Renderer raises.
    """
    options: dict[str, Any] = {"precision": precision, "outline": outline, "fog": fog}
    chosen = device if isinstance(device, Device) else choose(device)
    film = None
    if frames is not None:
        smooth: dict[str, Any] = {**options, "antialias": True, "samples": samples}
        write = partial(animate, scene=scene, device=chosen, fps=fps, progress=False, **smooth)
        film = film_of(frames, count, output, fps, write)
    stage = Stage(scene, chosen, options=options, samples=samples, film=film)
    if _in_notebook():
        return _needed("widget", "cltrace.view in a notebook", "anywidget").Widget(stage)
    with suppress(KeyboardInterrupt):
        serve(stage, "cltrace.view", print, lambda: None)


def serve(stage: Stage, what: str, say: Callable[[str], object], begun: Callable[[], object]) -> None:
    """Serves a stage until a signal raises, and opens the browser where there is one.

    what: who needs the extra, in words; say: where messages go; begun: is called when it serves. Raises
    MissingPackageError without the extra.
    """
    server = _needed("server", what, "aiohttp").Server(stage)

    def ready() -> None:
        say(f"cltrace: {stage.name} is at {server.address} (Ctrl-C ends it)")
        if sys.platform != "linux" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY"))):
            threading.Thread(target=webbrowser.open, args=[server.address], daemon=True).start()
        else:
            port = server.port
            say(f"cltrace: from another machine: ssh -L {port}:127.0.0.1:{port} this-one, and the same address")
        begun()

    server.run(ready)


def _in_notebook() -> bool:
    """Whether the program is cells that a Jupyter kernel runs."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


def _needed(module: str, what: str, package: str) -> Any:
    """A module of the viewer that needs a package of the extra. Raises MissingPackageError without it."""
    try:
        return importlib.import_module(f"cltrace.viewer.{module}")
    except ModuleNotFoundError:
        raise MissingPackageError(what, package, "view") from None

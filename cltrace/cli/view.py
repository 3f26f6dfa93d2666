"""--view: a scene in the browser, until Ctrl-C."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from cltrace.base.errors import CltraceError, UsageError
from cltrace.cli.movie import draw_movie, orbit_of
from cltrace.cli.options import Movie, View
from cltrace.cli.reporter import Reporter
from cltrace.cli.scenes import scene_of
from cltrace.cli.watch import changes
from cltrace.movie.animate import FPS
from cltrace.process.console import tell
from cltrace.run.devices import Device, choose
from cltrace.scene import AnyCamera, Scene
from cltrace.students.compare import compare
from cltrace.students.comparison import Comparison
from cltrace.viewer.film import Film
from cltrace.viewer.stage import Stage
from cltrace.viewer.view import serve


def view(work: View, reporter: Reporter) -> int:
    """Serves the viewer until a signal raises."""
    turns = changes(work, reporter) if work.watch else None
    if turns:
        next(turns)
    drawing, device = work.drawing, choose(work.drawing.device)
    options = drawing.renderer_options(())
    for name in ("outputs", "antialias", "samples"):
        del options[name]
    smooth = {"antialias": True, "samples": drawing.samples}
    read = partial(scene_of, work.scene, reporter, lines=True)
    scene = read()
    film = _film(work.movie, reporter, scene) if work.movie else None
    try:
        stage = Stage(scene, device, options=options, smooth=smooth, judge=_judge(work, device), film=film)
    except ValueError as error:
        raise UsageError(str(error)) from None

    def begun() -> None:
        if turns:
            threading.Thread(target=_follow, args=(turns, stage, read), daemon=True).start()

    serve(stage, "--view", tell, begun)
    return 0


def _film(movie: Movie, reporter: Reporter, scene: Scene) -> Film:
    """The movie that the command would write. Raises UsageError where it would write none."""

    def cameras(seen: Scene) -> list[AnyCamera]:
        return orbit_of(movie, reporter, seen)[0]

    def write(check: Callable[[], None]) -> int:
        return draw_movie(movie, reporter, lambda *_: check())

    frames, file = orbit_of(movie, reporter, scene)
    return Film(cameras, len(frames), movie.fps or FPS, file, write)


def _judge(work: View, device: Device) -> Callable[[Scene], Comparison] | None:
    """What compares the picture of --compare, if there is one, as --compare alone does."""
    if work.compare is None:
        return None
    drawing = work.drawing
    how: dict[str, Any] = {"truncate": drawing.truncate, "antialias": drawing.antialias}
    return partial(compare, picture=work.compare, device=device, precision=drawing.precision, **how)


def _follow(turns: Iterator[None], stage: Stage, read: Callable[[], Scene]) -> None:
    """Shows what is saved; what is wrong with it is told here, too."""
    for _ in turns:
        try:
            stage.follow(read)
        except CltraceError as error:
            tell(str(error))

"""--view: a scene in the browser, until Ctrl-C."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from cltrace.base.errors import CltraceError, UsageError
from cltrace.cli.options import View
from cltrace.cli.reporter import Reporter
from cltrace.cli.scenes import scene_of
from cltrace.cli.watch import changes
from cltrace.process.console import tell
from cltrace.run.devices import Device, choose
from cltrace.scene import Scene
from cltrace.students.compare import compare
from cltrace.students.comparison import Comparison
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
    smooth = {"antialias": drawing.antialias or True, "samples": drawing.samples}
    read = partial(scene_of, work.scene, reporter, lines=True)
    try:
        stage = Stage(read(), device, options=options, smooth=smooth, judge=_judge(work, device))
    except ValueError as error:
        raise UsageError(str(error)) from None

    def begun() -> None:
        if turns:
            threading.Thread(target=_follow, args=(turns, stage, read), daemon=True).start()

    serve(stage, "--view", tell, begun)
    return 0


def _judge(work: View, device: Device) -> Callable[[Scene], Comparison] | None:
    """What compares the picture of --compare, if there is one, as --compare alone does."""
    if work.compare is None:
        return None
    drawing = work.drawing
    how: dict[str, Any] = {"truncate": drawing.truncate, "antialias": bool(drawing.antialias)}
    return partial(compare, picture=work.compare, device=device, precision=drawing.precision, **how)


def _follow(turns: Iterator[None], stage: Stage, read: Callable[[], Scene]) -> None:
    """Shows what is saved; what is wrong with it is told here, too."""
    for _ in turns:
        try:
            stage.follow(read)
        except CltraceError as error:
            tell(str(error))

"""--view: a scene in the browser, until Ctrl-C."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import partial
from typing import Any

from cltrace.base.errors import CltraceError
from cltrace.cli.command import changes
from cltrace.cli.files import Reporter, scene_of
from cltrace.cli.many import draw_many, orbit_of
from cltrace.cli.options import Options, refusing
from cltrace.movie.animate import FPS
from cltrace.process.console import tell
from cltrace.run.devices import choose
from cltrace.students.compare import compare
from cltrace.viewer.stage import Film, Stage
from cltrace.viewer.view import serve


def view(options: Options, reporter: Reporter) -> int:
    """Serves the viewer until a signal raises."""
    turns = changes(options, reporter) if options.watch else None
    if turns:
        next(turns)
    device = choose(options.device)
    how = options.renderer_options(())
    del how["outputs"], how["antialias"], how["samples"]
    read = partial(scene_of, options.scenes[0], options, reporter)
    scene = read()
    film = comparison = None
    if options.orbit is not None:
        frames, file = orbit_of(options, scene)

        write = partial(draw_many, options, reporter)
        film = Film(lambda seen: orbit_of(options, seen)[0], len(frames), options.fps or FPS, file, write)
    if options.compare is not None:  # as --compare alone does
        own: dict[str, Any] = {"truncate": options.truncate, "antialias": options.antialias}
        comparison = partial(compare, picture=options.compare, device=device, precision=options.precision, **own)
    with refusing():
        stage = Stage(scene, device, options=how, samples=options.samples, compare=comparison, film=film)

    def follow(turns: Iterator[None]) -> None:
        """Shows what is saved; what is wrong with it is told here, too."""
        for _ in turns:
            try:
                stage.follow(read)
            except CltraceError as error:
                tell(str(error))

    def begun() -> None:
        if turns:
            threading.Thread(target=follow, args=(turns,), daemon=True).start()

    serve(stage, "--view", tell, begun)
    return 0

"""cltrace.view(): a program's scene in the browser, and what it shares with the command."""

from __future__ import annotations

import importlib
import os
import sys
import threading
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from cltrace.base.errors import MissingPackageError
from cltrace.plan.abi import Precision
from cltrace.plan.request import Antialias
from cltrace.run.devices import Device, choose
from cltrace.scene import Scene
from cltrace.viewer.stage import Stage


def view(
    scene: Scene,
    device: str | Device | None = None,
    precision: Precision | None = None,
    antialias: Antialias = True,
    samples: int | None = None,
    outline: tuple[Any, float] | None = None,
    fog: tuple[Any, float, float] | None = None,
) -> None:
    """Shows a scene in the browser, to be turned and clicked, until Ctrl-C: `cltrace view` for scenes of arrays.

    It prints the address. The arguments are those of Renderer; antialias and samples are about the last picture at rest
    alone. It needs the extra `view`.

    Raises MissingPackageError without it, RuntimeError in a notebook, which has no Ctrl-C, and what Renderer raises.
    """
    if "ipykernel" in sys.modules:
        raise RuntimeError("view: a notebook cannot wait for the browser; call it in a script")
    options: dict[str, Any] = {"precision": precision, "outline": outline, "fog": fog}
    chosen = device if isinstance(device, Device) else choose(device)
    stage = Stage(scene, chosen, options=options, smooth={"antialias": antialias, "samples": samples})
    with suppress(KeyboardInterrupt):
        serve(stage, "cltrace.view", print, lambda: None)


def serve(stage: Stage, what: str, say: Callable[[str], object], begun: Callable[[], object]) -> None:
    """Serves a stage until a signal raises, and opens the browser where there is one.

    what: who needs the extra, in words; say: where messages go; begun: is called when it serves. Raises
    MissingPackageError without the extra.
    """
    try:
        server = importlib.import_module("cltrace.viewer.server").Server(stage)
    except ModuleNotFoundError:
        raise MissingPackageError(what, "aiohttp", "view") from None

    def ready() -> None:
        say(f"cltrace: {stage.name} is at {server.address}; Ctrl-C ends it")
        if sys.platform != "linux" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY"))):
            threading.Thread(target=webbrowser.open, args=[server.address], daemon=True).start()
        else:
            port = server.port
            say(f"cltrace: from another machine: ssh -L {port}:127.0.0.1:{port} this-one, and the same address")
        begun()

    server.run(ready)

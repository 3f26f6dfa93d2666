"""A scene in a notebook. Events and messages are the kernel's own: where the notebook is, the widget is, too."""

from __future__ import annotations

import asyncio
import json
import re
import threading
from base64 import b64encode
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from importlib import resources
from typing import Any

import anywidget
import traitlets
from IPython import get_ipython

from cltrace.scene import AnyCamera
from cltrace.viewer.messages import Event, Message
from cltrace.viewer.session import Session, SessionRunner
from cltrace.viewer.stage import Stage


def _module() -> str:
    """The page as one module, as widgets are: its modules one after the other, without their imports and exports."""
    files = {file.name: file.read_text("utf-8") for file in (resources.files("cltrace.viewer") / "page").iterdir()}
    modules = [text for name, text in sorted(files.items()) if name.endswith(".js") and name != "socket.js"]
    body = files["index.html"].partition("<body>")[2].partition("</body>")[0]
    code = re.sub(r"^import [^;]*;\n|^export (?!default)", "", "\n".join(modules), flags=re.MULTILINE)
    return f"const BODY = {json.dumps(body)}, STYLE = {json.dumps(files['viewer.css'])};\n{code}"


class Widget(anywidget.AnyWidget):
    """A scene in a notebook, to be turned and clicked.

    It is drawn while any of its views is open. close() ends it. camera: where it looks from now, also when a hand has
    moved it. picture: the PNG that is there without a kernel, too. Raises what Stage.draw raises.
    """

    _esm = _module()
    picture = traitlets.Bytes().tag(sync=True)

    def __init__(self, stage: Stage) -> None:
        self._session, self._views = Session(stage), set[str]()
        self._thread: WindowThread | None = None
        super().__init__(
            picture=stage.draw(stage.frames[0], "color", "exact", lambda: False, stage.samples).file(".png")
        )
        self.on_msg(self._hear)
        self._shell = get_ipython()
        self._shell.observe(self._end, "exit_now")  # which it says when the kernel stops

    @property
    def camera(self) -> AnyCamera:
        return self._session.camera

    def close(self) -> None:
        """Ends it, here and in the notebook."""
        self._end()
        if self.comm is not None:  # it is open
            self._shell.unobserve(self._end, "exit_now")
        super().close()

    def _repr_mimebundle_(self, **kwargs: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        """The widget, and a picture for what shows notebooks without widgets."""
        data, metadata = super()._repr_mimebundle_(**kwargs) or ({}, {})
        return data | {"image/png": b64encode(self.picture).decode()}, metadata

    def _hear(self, _: object, said: dict[str, Any], __: object) -> None:
        """What a view says: that it is there, that it is gone, or an event. Any thread of the kernel may call it."""
        match said:
            case {"open": view}:
                self._views.add(view)
                self._end()
                self._thread = WindowThread(self._session, self._tell, self._thread)
                self._thread.start()
            case {"close": view}:
                self._views.discard(view)
                if not self._views:
                    self._end()
            case {"event": text} if self._thread:
                with suppress(ValueError):
                    self._thread.hear(Event.of(text))

    def _tell(self, message: Message) -> None:
        self.send(message.head(), [message.data])

    def _end(self, *_: object) -> None:
        """Ends what is drawn."""
        if self._thread:
            self._thread.hear(None)


class WindowThread(threading.Thread):
    """A widget's window on a thread of its own, until it hears None: it goes on while the kernel computes something.

    before: the one whose end it waits for.
    """

    def __init__(self, session: Session, tell: Callable[[Message], None], before: WindowThread | None) -> None:
        super().__init__(daemon=True)
        self._session, self._tell, self._before = session, tell, before
        self._runner, self._events = asyncio.Runner(loop_factory=asyncio.new_event_loop), asyncio.Queue[Event | None]()
        self._loop = self._runner.get_loop()

    def hear(self, event: Event | None) -> None:
        with suppress(RuntimeError):  # it has ended
            self._loop.call_soon_threadsafe(self._events.put_nowait, event)

    def run(self) -> None:
        if self._before:
            self._before.join()
            self._before = None
        self._session.reopen()
        with ThreadPoolExecutor(1) as draws, ThreadPoolExecutor(2) as answers, self._runner:
            self._runner.run(self._live(draws, answers))

    async def _live(self, draws: ThreadPoolExecutor, answers: ThreadPoolExecutor) -> None:
        await SessionRunner(self._session, self._send, draws, answers).live(self._heard())

    async def _heard(self) -> AsyncIterator[Event]:
        while event := await self._events.get():
            yield event

    async def _send(self, message: Message) -> None:
        self._tell(message)

"""When a window draws and answers, whatever carries events and messages between it and its session."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from concurrent.futures import Executor
from contextlib import suppress
from functools import partial

from cltrace.viewer.messages import Event, Message
from cltrace.viewer.session import Session

# Seconds without an event after which the exact picture is drawn.
REST = 0.12
# Kinds of events that are answered, which may take long.
ASKED = ("explain", "centre", "copy", "compare", "write")


class Window:
    """A session's pictures and answers, which are sent while events come.

    send: takes a message to the window; draws: a thread, for pictures; answers: two, one of which may write a movie. A
    picture is drawn when the one before it is on the screen: none waits anywhere, and each shows what is newest.
    """

    def __init__(
        self, session: Session, send: Callable[[Message], Awaitable[None]], draws: Executor, answers: Executor
    ) -> None:
        self._stage, self._session, self._send = session.stage, session, send
        self._draws, self._answers, self._loop = draws, answers, asyncio.get_running_loop()
        self._woken, self._shown = asyncio.Event(), asyncio.Event()
        self._shown.set()

    async def live(self, events: AsyncIterator[Event]) -> None:
        """Until there are no more events. Raises what `events` raises."""
        changed = partial(self._loop.call_soon_threadsafe, self._changed)
        self._stage.changed.add(changed)
        tasks = {asyncio.create_task(self._tell_fault()), asyncio.create_task(self._draw())}
        try:
            async for event in events:
                if event.kind == "shown":
                    self._shown.set()
                elif event.kind in ASKED:
                    tasks.add(task := asyncio.create_task(self._answer(event)))
                    task.add_done_callback(tasks.discard)
                else:
                    self._session.handle(event)
                    self._woken.set()
        finally:
            self._stage.changed.discard(changed)
            self._session.close()
            for task in tasks:
                task.cancel()

    def _changed(self) -> None:
        """The scene, or what is wrong with it, is another one."""
        self._session.refresh()
        self._woken.set()
        self._told = asyncio.create_task(self._tell_fault())

    async def _tell_fault(self) -> None:
        await self._send(Message("fault", self._stage.fault))

    async def _draw(self) -> None:
        """Draws one picture after the other, as long as there is something new to see."""
        while True:
            await self._shown.wait()
            with suppress(TimeoutError):
                wait = {"moving": 0.0, "done": None}.get(self._session.phase, REST)
                await asyncio.wait_for(self._woken.wait(), wait)
            self._woken.clear()
            message = await self._loop.run_in_executor(self._draws, self._session.draw)
            if message:
                if message.data:  # of an error, no page says that it is on the screen
                    self._shown.clear()
                await self._send(message)

    async def _answer(self, event: Event) -> None:
        """Answers a question."""
        answers = self._session.answer(event)
        while message := await self._loop.run_in_executor(self._answers, next, answers, None):
            await self._send(message)
        self._woken.set()

"""What is held of work that is over."""

from __future__ import annotations

import time
import weakref

import pytest

from cltrace.base import waiting
from cltrace.base.waiting import interruptible


class Work:
    """That is slow, and has been told so. With a thousand lights, a picture's may have a gigabyte."""

    told = 0

    def stop(self) -> None: ...

    def slow(self) -> str:
        self.told += 1
        return "work is slow"


def test_work_that_is_over_is_not_held(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(waiting, "SLOW", 0.01)
    work = Work()
    alive, end = weakref.ref(work), time.monotonic() + 20
    with interruptible(work.stop, work.slow) as begin:
        begin()
        while not work.told and time.monotonic() < end:
            time.sleep(0.01)
    assert work.told
    del work, begin
    while alive() and time.monotonic() < end:
        time.sleep(0.01)
    assert not alive()

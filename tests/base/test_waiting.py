"""What a stopwatch counts, and what is held of work that is over."""

from __future__ import annotations

import time
import weakref

import pytest

from cltrace.base import waiting
from cltrace.base.waiting import Stopwatch, interruptible


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


@pytest.mark.parametrize(("own", "seconds"), [(True, 5), (False, 20)])
def test_seconds_of_other_programs_do_not_count(own: bool, seconds: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 20 seconds of a clock, processors worked 5 for this process; what is left out is in neither."""
    clock, worked = [100.0], [7.0]
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(time, "process_time", lambda: worked[0])
    watch = Stopwatch(own)
    clock[0], worked[0] = 120.0, 12.0
    assert watch.seconds() == seconds
    with watch.stopped():
        clock[0], worked[0] = 150.0, 90.0
    assert watch.seconds() == seconds

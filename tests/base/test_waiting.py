"""What a stopwatch counts."""

from __future__ import annotations

import time

import pytest

from cltrace.base.waiting import Stopwatch


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

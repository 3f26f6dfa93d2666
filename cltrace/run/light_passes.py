"""A plan on a device that adds its lights a few at a time: see cltrace.plan.passes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from cltrace.plan.abi import COUNTERS
from cltrace.plan.plan import Plan
from cltrace.run.devices import Device
from cltrace.run.executor import Executor, Frame
from cltrace.run.rows import Rows

# A plan, and the buffers that its arrays lack.
Made = tuple[Plan, dict[str, Any]]


class LightPasses(Executor):
    """An Executor of the first pass, which draws the others after it, each of which is made when it is needed.

    later: what makes each of the other passes' plans. All have the outputs and the features of the first one.
    """

    def __init__(
        self,
        first: Made,
        later: Sequence[Callable[[], Made]],
        device: Device,
        width: int,
        before: Executor | None = None,
    ) -> None:
        super().__init__(first[0], device, width, before, first[1])
        self._later = later
        self._drawing: Executor | None = None

    def _executor(self, make: Callable[[], Made]) -> Executor:
        """That of a later pass, for this one's region."""
        plan, made = make()
        executor = Executor(plan, self.device, self.width, self, made)
        executor.take_over(self)
        return executor.of(self.region)

    def draw(
        self,
        frame: Frame,
        drawn: Callable[[int], object] = lambda rows: None,
        take: Callable[[int], range | None] | None = None,
    ) -> None:
        """See Executor. Rows count as drawn when the last pass has drawn them; `take` is asked in the first one."""
        strips: list[range] = []
        asked = take or Rows(self.region[3] + self._margin[1]).take

        def note(most: int) -> range | None:
            if strip := asked(most):
                strips.append(strip)
            return strip

        def heard(rows: int) -> None:
            drawn(0)

        super().draw(frame, heard, note)
        for make in self._later if strips else ():
            rest, told = iter(strips), drawn if make is self._later[-1] else heard
            self._drawing = self._executor(make)
            try:
                self._drawing.draw(frame, told, lambda most, rest=rest: next(rest, None))  # type: ignore[misc]
                # Each pass writes all outputs, depths in its own unit.
                self.plan = replace(self.plan, exponent=self._drawing.plan.exponent)
            finally:
                self._drawing = None  # whose memory the next pass needs

    def stop(self) -> None:
        """See Executor."""
        super().stop()
        if executor := self._drawing:
            executor.stop()

    def work(self) -> dict[str, int]:
        """See Executor: of all passes together."""
        total = dict.fromkeys(COUNTERS.values(), 0)
        makers: list[Callable[[], Executor]] = [self._first, *(partial(self._executor, make) for make in self._later)]
        for make in makers:
            for name, count in make().work().items():
                total[name] += count
        return total

    def _first(self) -> Executor:
        """The first pass alone."""
        other = object.__new__(Executor)
        other.__dict__.update(self.__dict__)
        return other

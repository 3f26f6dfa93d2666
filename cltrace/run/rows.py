"""The rows of a picture that nobody has drawn yet, as one or several devices take them."""

from __future__ import annotations

import threading
from collections.abc import Iterable

# Strips begin at multiples of so many rows, which every packet divides.
STEP = 16


class Rows:
    """Rows to draw, from 0 to `height`; any number of threads may take them.

    devices: how many share them. Near the end, strips become small, so that none waits long for the last one. lacking:
    how many rows are not part of the picture yet; stopped: whether nobody gets any more.
    """

    def __init__(self, height: int, devices: int = 1) -> None:
        self._left, self.lacking, self._devices = [range(height)] if height else [], height, devices
        self._changed, self.stopped = threading.Condition(), False

    def take(self, most: int) -> range | None:
        """The next strip, of at most so many rows, a multiple of STEP; None if there is none now."""
        with self._changed:
            if self.stopped or not self._left:
                return None
            part = self._left.pop()
            if self._devices > 1:
                left = len(part) + sum(map(len, self._left))
                most = min(most, STEP * -(-left // (2 * self._devices * STEP)))
            if len(part) > most:
                self._left.append(part[most:])
            return part[:most]

    def give_back(self, strips: Iterable[range]) -> None:
        """Strips that were taken, and are not drawn."""
        with self._changed:
            self._left += strips
            self._changed.notify_all()

    def settle(self, strips: Iterable[range]) -> None:
        """Strips that were taken, and are part of the picture now."""
        with self._changed:
            self.lacking -= sum(map(len, strips))
            self._changed.notify_all()

    def stop(self) -> None:
        """Nobody gets any more."""
        with self._changed:
            self.stopped = True
            self._changed.notify_all()

    def wait(self) -> bool:
        """Waits until there is something to take, True, or there will be nothing any more, False."""
        with self._changed:
            self._changed.wait_for(lambda: self._left or self.stopped or not self.lacking)
            return bool(self._left) and not self.stopped

    def wait_for_all(self) -> None:
        """Waits until none is lacking, or it was stopped."""
        with self._changed:
            self._changed.wait_for(lambda: self.stopped or not self.lacking)

"""What a work tells whoever asked for it."""

from __future__ import annotations

from pathlib import Path

from cltrace.process.console import tell


class Reporter:
    """Says what is done, unless only errors are wanted. files: what the scenes are made of that were read."""

    def __init__(self, quiet: bool) -> None:
        self._quiet, self.files = quiet, set[Path]()

    def say(self, message: str) -> None:
        """A message that is no error."""
        if not self._quiet:
            tell(message)

    @property
    def progress(self) -> bool | None:
        """Whether there is a bar, as bar() has it."""
        return False if self._quiet else None

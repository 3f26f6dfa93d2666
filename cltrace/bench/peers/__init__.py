"""Other programs that draw the same scenes: a file each, and a row of PEERS."""

from __future__ import annotations

from pathlib import Path

from cltrace.bench.tracers import Tracer

from . import embree, mitsuba, povray
from .peer import PeerError as PeerError

PEERS = (embree.tracers, povray.tracers, mitsuba.tracers)


def installed(folder: Path) -> tuple[list[Tracer], list[str]]:
    """The peers that are here, and for each other one why it is not. folder: where they may keep files."""
    found: list[Tracer] = []
    missing = []
    for tracers in PEERS:
        try:
            found += tracers(folder)
        except PeerError as error:
            missing.append(str(error))
    return found, missing

"""What all peers have in common: a program reads a scene from a file, and writes a picture."""

from __future__ import annotations

import contextlib
import math
import subprocess
from abc import abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.bench.tracers import Tracer
from cltrace.scene import Scene

PEER_SECONDS = 120


class PeerError(Exception):
    """A peer's program failed; str() is one line."""


class Peer(Tracer):
    """A program that reads a scene from a file, which is written once for each scene."""

    def __init__(self, program: str, folder: Path) -> None:
        self._program, self._folder = program, folder
        self._scene: Scene | None = None

    def _file(self, scene: Scene, suffix: str) -> Path:
        path = self._folder / f"scene{suffix}"
        if self._scene is not scene:
            self._scene = None
            self._write(scene, path)
            self._scene = scene
        return path

    @abstractmethod
    def _write(self, scene: Scene, path: Path) -> None: ...


def seen_from_the_eye(scene: Scene, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 3) in camera space: what a careful user of a float32 tracer hands over."""
    moved: NDArray[np.float64] = (points - np.array(scene.camera.position)) @ np.array(scene.camera.basis()).T
    return moved


@contextlib.contextmanager
def understood(program: str) -> Iterator[None]:
    """Turns what goes wrong while reading what a peer has written into a PeerError."""
    try:
        yield
    except (ValueError, LookupError, TypeError, OSError) as error:
        raise PeerError(f"{Path(program).name}: cannot read what it wrote: {error}") from None


def seconds(text: Any) -> float:
    """A time that a peer has measured; ValueError if it is none that can be compared."""
    value = float(text)
    if not 0 < value < math.inf:
        raise ValueError(f"a time of {text}")
    return value


def call(command: list[str]) -> subprocess.CompletedProcess[str]:
    name = Path(command[0]).name
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=PEER_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        raise PeerError(f"{name} took more than {PEER_SECONDS} s") from None
    except OSError as error:
        raise PeerError(f"{name}: {error.strerror}") from None
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
        raise PeerError(f"{name} failed with status {done.returncode}: {last}")
    return done

"""Whether a file shows what would be drawn: a hash of all that a picture depends on, which is kept in the file itself.

There is no list of files beside them, which two processes that draw frames into one folder could spoil for each other,
and which would be wrong once a file is copied or made by something else.
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cltrace import __version__
from cltrace.picture.png import text_of
from cltrace.scene import Scene

NAME = "cltrace"  # of the text in a PNG
# What is no part of a picture, or is there twice.
LEFT_OUT = {"output_file", "source", "scale", "spheres", "materials"}


class Fingerprints:
    """Hashes of scenes. What a scene shares with the one before it is not read again. Several threads may ask for one.

    options: whatever else the pictures depend on, of which repr() says all.
    """

    def __init__(self, options: Mapping[str, object]) -> None:
        self._options = repr((__version__, sorted(options.items())))
        self._digests: dict[str, tuple[object, bytes]] = {}
        self._lock = threading.Lock()

    def of(self, scene: Scene) -> str:
        """64 digits, which are equal for scenes with equal contents, wherever they were read from."""
        names = sorted({f.name for f in fields(scene)} - LEFT_OUT | {"columns"})
        with self._lock:
            parts = [self._options.encode(), *(self._digest(name, getattr(scene, name)) for name in names)]
        return hashlib.sha256(b"\0".join(parts)).hexdigest()

    def _digest(self, name: str, value: object) -> bytes:
        found = self._digests.get(name)
        if found is None or found[0] is not value:
            digest = hashlib.sha256()
            _feed(digest, value)
            self._digests[name] = found = (value, digest.digest())
        return found[1]


def shows(path: Path, fingerprint: str) -> bool:
    """Whether a file is a whole PNG that was written with this fingerprint."""
    try:
        with path.open("rb") as file:
            return text_of(file, NAME) == fingerprint
    except OSError:
        return False


def _feed(digest: Any, value: object) -> None:
    """Gives a value to a hash, with what tells it from others that have the same bytes."""
    if isinstance(value, np.ndarray):
        digest.update(f"array {value.dtype.descr} {value.shape};".encode())
        digest.update(np.ascontiguousarray(value).view(np.uint8).data if value.size else b"")
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(f"{type(value).__name__}(".encode())
        for f in fields(value):
            _feed(digest, getattr(value, f.name))
        digest.update(b")")
    elif isinstance(value, Mapping):
        _feed(digest, sorted(value.items()))
    elif isinstance(value, (tuple, list)):
        digest.update(b"[")
        for part in value:
            _feed(digest, part)
        digest.update(b"]")
    else:
        digest.update(f"{value!r};".encode())

"""A folder for the kernel caches of PoCL and pyopencl, where the usual one cannot be written.

PoCL hides its devices, and pyopencl fails, if they cannot create their cache: as in containers and on clusters with a
read-only home. Imported before pyopencl, which looks once.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def ensure() -> None:
    """Points XDG_CACHE_HOME to a temporary folder of this user if the usual cache folder cannot be written."""
    usual = os.environ.get("XDG_CACHE_HOME")
    try:
        folder = Path(usual) if usual else Path.home() / ".cache"
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return
    except (OSError, RuntimeError):  # RuntimeError: there is no home
        pass
    user = os.getuid() if hasattr(os, "getuid") else "user"
    spare = Path(tempfile.gettempdir()) / f"cltrace-cache-{user}"
    spare.mkdir(mode=0o700, exist_ok=True)
    # A folder that somebody else has put there could bring somebody else's programs.
    if not hasattr(os, "getuid") or spare.stat().st_uid == os.getuid():
        os.environ["XDG_CACHE_HOME"] = str(spare)


ensure()

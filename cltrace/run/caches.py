"""A folder for the kernel caches of PoCL and pyopencl, where the usual one cannot be written.

PoCL hides its devices, and pyopencl fails, if they cannot create their caches, as in containers and on clusters with a
read-only home. This module is imported before pyopencl, which looks only once. The programs in these caches are run, so
a folder is used only if nobody else can have filled it.
"""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path

# The folders that PoCL, pyopencl and its tools make in the cache folder.
CACHES = ("pocl", "pyopencl", "pytools")


def ensure() -> None:
    """Points XDG_CACHE_HOME to a temporary folder of this user if the usual cache folder cannot be used.

    Where there is no such folder either, pyopencl is told to do without a cache. Raises nothing.
    """
    chosen = os.environ.get("XDG_CACHE_HOME")
    if _usable(Path(chosen)) if chosen else _usual():
        return
    spare = _spare()
    if spare:
        os.environ["XDG_CACHE_HOME"] = str(spare)
    else:
        os.environ.setdefault("PYOPENCL_NO_CACHE", "1")


def _usual() -> bool:
    """Whether ~/.cache can be used and is this user's: `sudo` may leave HOME with somebody else."""
    try:
        folder = Path.home() / ".cache"
        return _usable(folder) and is_own(folder.stat())
    except (OSError, RuntimeError):  # RuntimeError: there is no home.
        return False


def _spare() -> Path | None:
    """A folder of this user among the temporary ones, or None. If others have taken its name, the next one is tried."""
    user = os.getuid() if hasattr(os, "getuid") else "user"
    for suffix in ("", *(f"-{k}" for k in range(1, 10))):
        try:
            folder = Path(tempfile.gettempdir()) / f"cltrace-cache-{user}{suffix}"
            folder.mkdir(mode=0o700, exist_ok=True)
            found = folder.lstat()
        except OSError:
            continue
        if stat.S_ISDIR(found.st_mode) and is_own(found) and _usable(folder):
            return folder
    return None


def is_own(found: os.stat_result) -> bool:
    """Whether this user owns a folder, and not everybody may write there. True on a system that has no users."""
    return not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & stat.S_IWOTH)


def _usable(folder: Path) -> bool:
    """Whether files can be made in the caches of a folder. It is made if it is not there."""
    try:
        for cache in CACHES:
            (folder / cache).mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder / cache):
                pass
    except OSError:
        return False
    return True


ensure()

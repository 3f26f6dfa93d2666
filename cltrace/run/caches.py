"""A folder for the kernel caches of PoCL and pyopencl, where the usual one cannot be written, and what is wrong in it.

PoCL hides its devices, and pyopencl fails, if they cannot create their caches, as in containers and on clusters with a
read-only home. This module is imported before pyopencl, which looks only once. The programs in these caches are run, so
a folder is used only if nobody else can have filled it. A file that a full disk or a crash has cut ends the process
that loads it, so such files are removed before.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import math
import os
import site
import stat
import struct
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

log = logging.getLogger("cltrace")
# The folders that PoCL, pyopencl and its tools make in the cache folder.
CACHES = ("pocl", "pyopencl", "pytools")
# What ends the process, or its import of pyopencl, where it is set and empty, as a shell's `NAME= command` has it.
NOT_EMPTY = ("POCL_CACHE_DIR", "PYOPENCL_NO_CACHE", "PYOPENCL_COMPILER_OUTPUT")
# Bytes that must be free there: the files of the largest kernel take 2.3 MB while it is compiled.
ROOM = 2**22
# A folder in memory, which Linux has.
SHARED = "/dev/shm"
# Where PoCL puts a program, by the hash of what it is made from.
PROGRAM = "[A-P][A-P]/" + "[A-P]" * 37
# What was wrong with the caches, for --doctor.
notes: list[str] = []
# When the folder of PoCL's programs had last changed that was looked through, in ns, by its name.
_looked: dict[Path, int] = {}


def ensure() -> None:
    """Points XDG_CACHE_HOME to a temporary folder of this user if the usual cache folder cannot be used.

    Where there is no such folder either, pyopencl is told to do without a cache. A POCL_CACHE_DIR that cannot be used
    and a variable of NOT_EMPTY that is empty are taken for not set. Raises nothing.
    """
    for name in NOT_EMPTY:
        if os.environ.get(name) == "":
            del os.environ[name]
    if "POCL_CACHE_DIR" in os.environ and not _usable(Path(os.environ["POCL_CACHE_DIR"]), ("",)):
        del os.environ["POCL_CACHE_DIR"]
    chosen = os.environ.get("XDG_CACHE_HOME")
    if _usable(Path(chosen)) if chosen else _usual():
        return
    spare = _spare()
    if spare:
        os.environ["XDG_CACHE_HOME"] = str(spare)
    else:
        os.environ.setdefault("PYOPENCL_NO_CACHE", "1")


def home() -> Path:
    """The folder of all caches."""
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))  # noqa: PTH111 - it never fails


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
    for place in (tempfile.gettempdir, lambda: SHARED):
        for suffix in ("", *(f"-{k}" for k in range(1, 10))):
            try:
                folder = Path(place()) / f"cltrace-cache-{user}{suffix}"
                folder.mkdir(mode=0o700, exist_ok=True)
                found = folder.lstat()
            except OSError:
                continue
            if stat.S_ISDIR(found.st_mode) and is_own(found):
                if _usable(folder):
                    return folder
                break
    return None


def is_own(found: os.stat_result) -> bool:
    """Whether this user owns a folder, and not everybody may write there. True on a system that has no users."""
    return not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & stat.S_IWOTH)


def _usable(folder: Path, caches: Sequence[str] = CACHES) -> bool:
    """Whether files can be made in the caches of a folder, of which the first is PoCL's. They are made if need be."""
    try:
        for cache in caches:
            check_room(folder / cache, ROOM if cache == caches[0] else 1)
    except OSError as error:
        notes.append(f"{folder} cannot be used: {error.strerror}")
        return False
    return True


def check_room(folder: Path, size: int = ROOM) -> None:
    """Raises OSError if a file of so many bytes cannot be written in a folder, which is made if it is not there."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
        if hasattr(os, "posix_fallocate"):  # which writes nothing where the disk can do without
            os.posix_fallocate(file.fileno(), 0, size)
        else:
            file.write(bytes(size))


def largest_file() -> float:
    """How many bytes a file of this process may have: `ulimit -f`."""
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0] if resource else -1
    return limit if limit >= 0 else math.inf


def mend_kernels() -> None:
    """Removes damaged files from PoCL's cache, unless this process has done so since the folder changed.

    PoCL makes each file in that folder, and moves it when it is whole. It takes 0.07 ms for each program there, for
    whose files one has to look: a crash may cut a file without a trace in the times of its folders.
    """
    root = Path(os.environ.get("POCL_CACHE_DIR") or home() / "pocl" / "kcache")
    with contextlib.suppress(OSError):  # there is none yet
        changed = root.stat().st_mtime_ns
        if sys.platform == "linux" and _looked.get(root) != changed:
            _looked[root] = changed
            for program in root.glob(PROGRAM):
                _mend(path for path in _files(program) if path.suffix in WHOLE)


def _files(folder: str | Path) -> Iterator[Path]:
    """All files in a folder and in those below. Nothing where another process removes it meanwhile."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                yield from _files(entry.path)
            else:
                yield Path(entry.path)


def _mend(files: Iterable[Path]) -> None:
    """Removes those of the files that are damaged, and says so. They are made again when they are needed."""
    for path in files:
        try:
            with path.open("rb", buffering=0) as file:
                if WHOLE[path.suffix](file, os.fstat(file.fileno()).st_size):
                    continue
            path.unlink()
        except OSError:  # it has gone, or belongs to somebody else
            continue
        notes.append(f"{path} was damaged, and is made again")
        log.warning(notes[-1])


def _is_library(file: BinaryIO, size: int) -> bool:
    """Whether an ELF file, if it is one of 64 bits, is as long as its table of sections says, which is its end."""
    head = file.read(64)
    if head[:4] != b"\x7fELF" or len(head) < 64:
        return False
    (place,), (length, count) = struct.unpack_from("=Q", head, 40), struct.unpack_from("=HH", head, 58)
    return head[4] != 2 or place + length * count <= size


def _is_bitcode(file: BinaryIO, size: int) -> bool:
    """Whether the blocks of an LLVM file, whose second word says how many more words there are, fill it."""
    at = 4 if file.read(4) == b"BC\xc0\xde" else size + 1
    while at < size:
        file.seek(at)
        at += 8 + 4 * int.from_bytes(file.read(8)[4:], "little")
    return at == size


def _is_database(file: BinaryIO, size: int) -> bool:
    """Whether an SQLite file has the pages that it says, which a new one has not yet."""
    head = file.read(32)
    page, pages = int.from_bytes(head[16:18], "big"), int.from_bytes(head[28:32], "big")
    return size == 0 or (head.startswith(b"SQLite format 3\0") and pages * (65536 if page == 1 else page) <= size)


WHOLE: dict[str, Callable[[BinaryIO, int], bool]] = {".so": _is_library, ".bc": _is_bitcode, ".sqlite": _is_database}


SYSTEM = Path("/etc/OpenCL/vendors")
LIBRARY = "libintelocl.so"


def ensure_vendors() -> None:
    """Sets OCL_ICD_VENDORS if Intel's driver is in this environment, as pip installs it, and nobody else has set it.

    The OpenCL loader finds drivers by .icd files, each of which holds the path of a driver's library, in one folder of
    the system. Intel's wheels bring such a file, but pip puts it elsewhere, and the path in it is that of another
    machine. The loader reads one folder only, which OCL_ICD_VENDORS names (drivers from wheels beside pyopencl come on
    top): so a folder is made here that holds the system's .icd files and a right one for Intel's driver.

    It is not enough to load the library beforehand. With its symbols shared, it takes the place of the loader and hides
    every other driver; without, the loader does not know it.
    """
    if sys.platform != "linux" or os.environ.get("OCL_ICD_VENDORS"):
        return
    homes = [sys.prefix, *([site.getuserbase()] if site.ENABLE_USER_SITE else [])]
    library = next((path for home in homes if (path := Path(home, "lib", LIBRARY)).exists()), None)
    if library is None:
        return
    # Without a cache folder Intel's driver is not found, but all others are. RuntimeError: there is no home.
    with contextlib.suppress(OSError, RuntimeError):
        os.environ["OCL_ICD_VENDORS"] = str(_vendor_folder(_icd_files(library)))


def _icd_files(library: Path) -> dict[str, str]:
    """Names and texts of the system's .icd files, and of one for Intel's library unless one names it already."""
    # An environment of conda has a folder of its own, whose paths are right.
    folders = [folder for folder in (SYSTEM, Path(sys.prefix, "etc/OpenCL/vendors")) if folder.is_dir()]
    texts = {path.name: path.read_text("utf-8", "replace").strip() for f in folders for path in sorted(f.glob("*.icd"))}
    usable = {name: text for name, text in texts.items() if "/" not in text or Path(text).exists()}
    if not any(text.endswith(LIBRARY) for text in usable.values()):
        usable["cltrace-intel.icd"] = str(library)
    return usable


def _vendor_folder(files: dict[str, str]) -> Path:
    """A folder of the user's cache that holds these files, by name and text.

    Its name depends on them, so it is written once, by whoever comes first, and no process changes what another one
    reads. The libraries that it names are run, so it must be this user's own. Raises OSError if it is not, or cannot be
    made.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    key = hashlib.sha256(repr(sorted(files.items())).encode()).hexdigest()[:16]
    folder = cache / "cltrace" / f"vendors-{key}"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not is_own(folder.stat()):
        raise PermissionError(f"{folder} is somebody else's")
    for name, text in files.items():
        if not (folder / name).exists():
            with tempfile.NamedTemporaryFile("w", dir=folder, prefix=".", delete=False, encoding="utf-8") as file:
                file.write(f"{text}\n")
            Path(file.name).replace(folder / name)
    return folder


ensure()
_mend((home() / "pytools").glob("*.sqlite"))
ensure_vendors()

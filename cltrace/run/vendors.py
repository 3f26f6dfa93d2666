"""Makes Intel's driver known to the OpenCL loader where pip has installed it (the extra `intel`).

The OpenCL loader finds drivers by .icd files, each of which holds the path of a driver's library, in one folder of the
system. Intel's wheels bring such a file, but pip puts it elsewhere, and the path in it is that of another machine. The
loader reads one folder only, which OCL_ICD_VENDORS names (drivers from wheels beside pyopencl come on top): so a
folder is made here that holds the system's .icd files and a right one for Intel's driver.

It is not enough to load the library beforehand. With its symbols shared, it takes the place of the loader and hides
every other driver; without, the loader does not know it.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import site
import sys
import tempfile
from pathlib import Path

from cltrace.run.caches import is_own

SYSTEM = Path("/etc/OpenCL/vendors")
LIBRARY = "libintelocl.so"


def ensure() -> None:
    """Sets OCL_ICD_VENDORS if Intel's driver is in this environment and nobody else has set it."""
    if sys.platform != "linux" or os.environ.get("OCL_ICD_VENDORS"):
        return
    homes = [sys.prefix, *([site.getuserbase()] if site.ENABLE_USER_SITE else [])]
    library = next((path for home in homes if (path := Path(home, "lib", LIBRARY)).exists()), None)
    if library is None:
        return
    # Without a cache folder Intel's driver is not found, but all others are. RuntimeError: there is no home.
    with contextlib.suppress(OSError, RuntimeError):
        os.environ["OCL_ICD_VENDORS"] = str(_folder(_icd_files(library)))


def _icd_files(library: Path) -> dict[str, str]:
    """Names and texts of the system's .icd files, and of one for Intel's library unless one names it already."""
    # An environment of conda has a folder of its own, whose paths are right.
    folders = [folder for folder in (SYSTEM, Path(sys.prefix, "etc/OpenCL/vendors")) if folder.is_dir()]
    texts = {path.name: path.read_text("utf-8", "replace").strip() for f in folders for path in sorted(f.glob("*.icd"))}
    usable = {name: text for name, text in texts.items() if "/" not in text or Path(text).exists()}
    if not any(text.endswith(LIBRARY) for text in usable.values()):
        usable["cltrace-intel.icd"] = str(library)
    return usable


def _folder(files: dict[str, str]) -> Path:
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

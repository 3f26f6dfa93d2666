"""Where and when something was measured, and what the machine did beside."""

from __future__ import annotations

import contextlib
import datetime
import os
import platform
import subprocess
from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from cltrace.base.arrays import processors

# From these shares of all processors' time on, while something is timed, times are in doubt: what other processes took,
# and what the host did.
OTHERS, STEAL = 0.05, 0.02
TICK = 1 / os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 0.01


class Watch:
    """What the machine does while something is timed. Nothing is known of it without /proc, as Linux has it."""

    def __init__(self) -> None:
        self._sums = (0.0, 0.0, 0.0, 0.0)

    @contextlib.contextmanager
    def timing(self) -> Iterator[None]:
        """Something is timed until this ends."""
        start = _seconds()
        try:
            yield
        finally:
            if start and (now := _seconds()):
                busy, steal, whole, own = (s + b - a for s, a, b in zip(self._sums, start, now, strict=True))
                self._sums = busy, steal, whole, own

    def so_far(self) -> dict[str, Any]:
        """load: of the last minute; others, steal: the shares of all processors' time that other processes took, and
        other guests of the host; loaded: a sentence, if that is too much, else empty."""
        busy, steal, whole, own = self._sums
        if not whole:
            return {"loaded": ""}
        shares = {"others": max(0.0, busy - own) / whole, "steal": steal / whole}
        too_much = []
        if shares["others"] > OTHERS:
            too_much.append(f"other processes took {shares['others']:.0%} of the processors")
        if shares["steal"] > STEAL:
            too_much.append(f"the host held back {shares['steal']:.0%} of them")
        text = f"LOADED MACHINE: {' and '.join(too_much)}" if too_much else ""
        return {"load": round(os.getloadavg()[0], 2), **{k: round(v, 4) for k, v in shares.items()}, "loaded": text}


def _seconds() -> tuple[float, float, float, float] | None:
    """Since the machine started: of all processors busy, stolen, and in all; of this process and its children."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        user, nice, system, idle, wait, hard, soft, steal = map(int, Path("/proc/stat").read_text().split()[1:9])
        busy = user + nice + system + hard + soft
        return TICK * busy, TICK * steal, TICK * (busy + steal + idle + wait), TICK * _used("self")
    return None


def _used(pid: str) -> int:
    """Ticks of a process, of its children that have ended and, as peers run on, of those that have not."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:  # it has just ended
        return 0
    ticks = sum(map(int, fields[11:15]))
    for children in Path(f"/proc/{pid}/task").glob("*/children"):  # none in kernels that do not tell
        with contextlib.suppress(OSError):  # the thread has just ended
            ticks += sum(_used(child) for child in children.read_text().split())
    return ticks


def about(devices: Sequence[str]) -> dict[str, Any]:
    """The machine and what runs on it, for results.json and below tables and plots."""
    cpu = platform.processor() or platform.machine()
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                cpu = line.partition(":")[2].strip()
                break
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(" ", "minutes").removesuffix("+00:00"),
        "cltrace": metadata.version("cltrace"),
        "commit": commit(),
        "cpu": cpu,
        "cores": processors(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "packages": {name: metadata.version(name) for name in ("numpy", "pyopencl")},
        "devices": list(devices),
    }


def commit() -> str:
    """The checkout's commit, with a + if files differ from it; empty if this is none."""
    root = Path(__file__).parents[2]
    command = ["git", "-C", str(root), "describe", "--always", "--abbrev=10", "--dirty=+", "--exclude=*"]
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        if (root / ".git").exists():
            return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    return ""


def sentence(about: dict[str, Any]) -> str:
    """Names machine, drivers, day, commit, and the load."""
    drivers = "; ".join(about["devices"])
    which = f"cltrace {about['cltrace']}" + (f" ({about['commit']})" if about.get("commit") else "")
    said = f"Measured on {about['date']} UTC with {which} on {about['cores']} cores of {about['cpu']}, {drivers}."
    if "load" in about:
        said += f" Load {about['load']:g}, other processes {about['others']:.1%}, steal {about['steal']:.1%}."
    return said

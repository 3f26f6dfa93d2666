"""Drivers that may end the whole process are met in another one first, as LLVM does where it lacks an instruction.

What is not known of a driver is tried once for each of its versions and widths of packets: a small picture, which
`cltrace.cli.doctor` draws in a process of its own. That it was drawn, or that the driver ended the process, is
remembered in the cache folder.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import signal
import subprocess
import sys
from functools import cache
from pathlib import Path

from cltrace.base import limits
from cltrace.base.errors import DeviceError
from cltrace.base.waiting import Announcement
from cltrace.run.caches import home
from cltrace.run.devices import Device

# Seconds until a child is given up: a driver's first program has taken 12 seconds on a busy machine.
PATIENCE = 120
# The exit status of one that was given up, or could not begin.
GIVEN_UP = 124
# How drivers end a process: by these signals, or with such a status on Windows. Others come from elsewhere.
FAULTS = {signal.SIGABRT, signal.SIGSEGV, signal.SIGILL, signal.SIGFPE, getattr(signal, "SIGBUS", None)}
WINDOWS_FAULT = 0xC0000000
# The environment variable of a process that is a trial itself.
TRIAL = "CLTRACE_TRIAL"


def child(*arguments: str, patience: int = PATIENCE) -> tuple[int, str]:
    """Status and last line of another Python; what ended it, if it did not end by itself.

    patience: the seconds after which it is given up.
    """
    # -P: what lies in the current folder is not imported.
    command, environment = [sys.executable, "-P", *arguments], os.environ | {TRIAL: "1"}
    # What a child draws is no stranger's, and a limit that it passes would be taken for the driver's fault.
    environment.pop(limits.CHANGED, None)
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=patience,
            check=False,
            errors="replace",
            env=environment,
        )
    except subprocess.TimeoutExpired:
        return GIVEN_UP, f"no answer within {patience} seconds"
    except OSError as error:
        return GIVEN_UP, f"no other process can be begun: {error.strerror}"
    said, complaint = (_last_line(text) for text in (done.stdout, done.stderr))
    if done.returncode < 0:
        try:
            name = signal.Signals(-done.returncode).name
        except ValueError:
            name = f"signal {-done.returncode}"
        return done.returncode, f"the driver ended the process with {name}{complaint and f': {complaint}'}"
    return done.returncode, said or complaint or f"exit status {done.returncode}"


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else ""


@cache
def check_driver(device: Device, width: int) -> None:
    """Raises DeviceError if the device's driver would end this process with packets of so many pixels."""
    record = device.record
    if (record.known and width <= device.width and device.kind == "cpu") or TRIAL in os.environ:
        return
    note, words = _note(device, width), f"{device.name} cannot draw with --width {width}"
    try:
        fault = note.read_text("utf-8")
    except (OSError, ValueError):
        with Announcement(f"trying {device.name}, which is new here ..."):
            status, answer = child("-m", "cltrace.cli.doctor", "draw", device.spec, str(width))
        if status == GIVEN_UP:
            raise DeviceError(f"{words}: {answer}") from None
        is_fault = -status in FAULTS or status >= WINDOWS_FAULT
        fault = answer if is_fault else ""
        if is_fault or status >= 0:
            _remember(note, fault)
    if fault:
        raise DeviceError(f"{words}: {fault}; it is not tried again before {note} is removed")


def _remember(note: Path, fault: str) -> None:
    """Writes the file of a trial, if that is possible."""
    with contextlib.suppress(OSError):
        note.parent.mkdir(mode=0o700, exist_ok=True)
        part = note.with_suffix(f".{os.getpid()}")
        part.write_text(fault, "utf-8")
        part.replace(note)


def _note(device: Device, width: int) -> Path:
    """The file that says what came of a trial: nothing, or what is wrong."""
    words = f"{device.platform} {device.cl.driver_version} {device.cl.name} {width}"
    return home() / "cltrace" / f"driver-{hashlib.sha256(words.encode()).hexdigest()[:16]}"

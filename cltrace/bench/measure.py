"""Times and errors of all tracers on one scene, in turn, round by round, and where they were measured."""

from __future__ import annotations

import contextlib
import datetime
import json
import math
import platform
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from cltrace.base.arrays import processors
from cltrace.base.errors import UsageError
from cltrace.process.console import tell
from cltrace.run.devices import Device

from .scenes import Case
from .tracers import BenchTracer, Product
from .truth import Errors, Truth, differ, rms, truth_of_frame, truth_of_means
from .user import NEW, takers

# Rounds agree where the quartiles of their times are no further apart than this share of the median, of so many rounds.
AGREE, LEAST_ROUNDS = 0.1, 3
# A tracer is timed in so many rounds of a scene, or in LEAST_ROUNDS or more until it has used so many seconds. What
# takes too many seconds a picture is timed once.
ROUNDS, SECONDS, TOO_LONG = 11, 0.5, 3
# Short frames are repeated until a round takes about this long, in seconds: several times what a scheduler gives a
# process before another one has its turn.
ENOUGH, MOST_FRAMES = 0.04, 100
# From these shares of the processors' time on, times are in doubt: what other processes took, and what the host did.
OTHERS, STEAL = 0.05, 0.02
# How long the machine is watched before each scene, in seconds.
PAUSE = 0.2
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Spread:
    """Seconds of repeated rounds: the median and the quartiles, and whether these are close to each other."""

    low: float
    median: float
    high: float
    steady: bool

    @classmethod
    def of(cls, seconds: Sequence[float]) -> Spread:
        """NaN of nothing."""
        if len(seconds) < 2:
            only = next(iter(seconds), math.nan)
            return cls(only, only, only, False)
        low, median, high = statistics.quantiles(seconds, n=4, method="inclusive")
        return cls(low, median, high, len(seconds) >= LEAST_ROUNDS and high - low <= AGREE * median)


@dataclass
class Measurement:
    """What was measured of one tracer on one scene.

    group: the scene's class, a row of scenes.GROUPS; surfaces: how many the scene has; size: of the picture in pixels;
    tracer, label, variant, level, version: as of tracers.BenchTracer; frames: seconds of a frame, the median of each
    round; whole: seconds of each round, as of tracers.Run; errors: those of the pixels, None if they are not known;
    differ: the share of pixels of which a byte differs from the truth; rms: of all bytes from the truth, in levels of
    255; note: why something is missing.
    """

    group: str
    scene: str
    surfaces: int
    size: tuple[int, int]
    tracer: str
    label: str
    variant: str = ""
    level: int | None = None
    version: str = ""
    frames: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    errors: Errors | None = None
    differ: float | None = None
    rms: float | None = None
    note: str = ""

    @property
    def time(self) -> Spread:
        """Of a frame with its readback."""
        return Spread.of(self.frames)


@dataclass
class Wait:
    """What a user waits for: one of user.WAYS to a picture, as often as there were rounds."""

    scene: str
    tracer: str
    way: str
    version: str = ""
    seconds: list[float] = field(default_factory=list)

    @property
    def time(self) -> Spread:
        return Spread.of(self.seconds)


Work = dict[str, dict[str, int]]


@dataclass
class Results:
    """A whole run.

    about: of about() and Watch, and the seconds that it took; work: what was counted, by scene; missing: why peers were
    not there; finished: whether all of it was measured.
    """

    about: dict[str, Any]
    points: list[Measurement] = field(default_factory=list)
    waits: list[Wait] = field(default_factory=list)
    work: Work = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    finished: bool = False

    @property
    def loaded(self) -> str:
        """What the machine did besides, if that was so much that times are in doubt; else nothing."""
        return str(self.about.get("loaded", ""))

    def as_json(self) -> str:
        """A line for each point and wait."""
        parts = {name: json.dumps(value, indent=1, ensure_ascii=False) for name, value in asdict(self).items()}
        for name in ("points", "waits"):
            parts[name] = "[{}]".format(",".join(f"\n  {json.dumps(asdict(row))}" for row in getattr(self, name)))
        return "{\n" + ",\n".join(f' "{name}": {text}' for name, text in parts.items()) + "\n}\n"


def load(path: str | Path) -> Results:
    """What as_json() has written. Raises UsageError, with the file's name, for anything else."""
    try:
        given = json.loads(Path(path).read_text("utf-8"))
        for row in given["points"]:
            row["size"], row["errors"] = tuple(row["size"]), row["errors"] and Errors(**row["errors"])
        given["points"] = [Measurement(**row) for row in given["points"]]
        given["waits"] = [Wait(**row) for row in given["waits"]]
        return Results(**given)
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from None
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise UsageError(f"{path}: these are no results of cltrace-bench: {error}") from None


# --------------------------------------------------------------------------------------------------------- the machine


class Watch:
    """What the machine does besides. Nothing is known of it without /proc, as Linux has it."""

    def __init__(self) -> None:
        self._start, self._busy, self._paused = ticks(), 0, 0

    def pause(self) -> None:
        """Watches for a moment, in which nothing of ours is at work: who is busy then is another process."""
        busy, _, whole = ticks()
        time.sleep(PAUSE)
        now, _, end = ticks()
        self._busy, self._paused = self._busy + now - busy, self._paused + end - whole

    def so_far(self) -> dict[str, Any]:
        """others, steal: the shares of all processors' time that other processes took in the pauses, and other guests
        of the host in all; loaded: a sentence, if that is too much, else empty."""
        _, steal, whole = (now - start for now, start in zip(ticks(), self._start, strict=True))
        found = {"others": self._busy / max(1, self._paused), "steal": steal / max(1, whole)}
        too_much = found["others"] > OTHERS or found["steal"] > STEAL
        text = "LOADED MACHINE: others took {others:.0%} of the processors, the host held back {steal:.0%} of them"
        return {**found, "loaded": text.format(**found) if too_much else ""}


def ticks() -> tuple[int, int, int]:
    """Since the machine started, of all processors: busy, stolen, and in all; zeros where that is not known."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        user, nice, system, idle, wait, hard, soft, steal = map(int, Path("/proc/stat").read_text().split()[1:9])
        busy = user + nice + system + hard + soft
        return busy, steal, busy + steal + idle + wait
    return 0, 0, 0


def about(device: Device) -> dict[str, Any]:
    """The machine and what runs on it, for results.json and below tables and plots."""
    cpu, commit = platform.processor() or platform.machine(), ""
    with contextlib.suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
        cpu = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    describe = ["git", "-C", str(ROOT), "describe", "--always", "--abbrev=10", "--dirty=+", "--exclude=*"]
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        if (ROOT / ".git").exists():
            commit = subprocess.run(describe, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    date = datetime.datetime.now(datetime.UTC).isoformat(" ", "minutes").removesuffix("+00:00")
    return {"date": date, "cltrace": metadata.version("cltrace"), "commit": commit, "cpu": cpu, "cores": processors(),
            "device": device.label}  # fmt: skip


def sentence(about: dict[str, Any]) -> str:
    """Names machine, driver, day, commit, and the load."""
    which = f"cltrace {about['cltrace']}" + (f" ({about['commit']})" if about.get("commit") else "")
    where = f"{about['cores']} cores of {about['cpu']}, {about['device']}"
    said = f"Measured on {about['date']} UTC with {which} on {where}."
    if "others" in about:
        said += f" Other processes {about['others']:.1%}, steal {about['steal']:.1%}."
    return said


# ------------------------------------------------------------------------------------------------------------ measuring

Say = Callable[[str], None]


def measure(
    case: Case, tracers: Sequence[BenchTracer], truth: Truth | None, say: Say, rounds: int | None = None
) -> list[Measurement]:
    """Measures all tracers on one scene, in turn, round by round.

    truth: of the case, None if errors are not looked for; say: is told what happens, for a user who waits; rounds:
    exactly so many, whatever they take, None for ROUNDS within SECONDS.
    """
    scene, points = case.scene, list[Measurement]()
    live: dict[int, BenchTracer] = {}
    for tracer in (tracer for tracer in tracers if tracer.task == case.task):
        refused = ", ".join(tracer.refuses(scene))
        if not refused:
            live[len(points)] = tracer
        surfaces = len(scene.spheres) + scene.triangles + len(scene.cylinders)
        points.append(Measurement(case.group, case.name, surfaces, scene.camera.resolution, tracer.name, tracer.label,
                            tracer.variant, tracer.level, tracer.version, note=refused))  # fmt: skip
    # Round 0 is not timed: its first frame may have to compile, and the second says how long a frame takes.
    frames, spent = dict.fromkeys(live, 2), dict.fromkeys(live, 0.0)
    for number in range(1 + (rounds or ROUNDS)):
        for k, tracer in list(live.items()):
            point = points[k]
            if not rounds and number > LEAST_ROUNDS and spent[k] >= SECONDS:
                continue
            say(f"{point.label}: round {number}")
            start = time.perf_counter()
            try:
                done = tracer.run(scene, frames[k])
            except Exception as error:  # whatever a peer raises
                if not tracer.version:
                    raise
                point.note = f"{type(error).__name__}: {error}".splitlines()[0]
                del live[k]
                continue
            if number == 0:
                frames[k] = min(MOST_FRAMES, max(1, math.ceil(ENOUGH / max(1e-6, done.frames[-1]))))
                if truth:
                    point.differ, point.rms = differ(done.rgb8, truth.levels), rms(done.rgb8, truth.levels)
                    if truth.answer and not tracer.variant and (answer := tracer.answer(scene)):
                        point.errors = truth.errors(answer)
                continue
            spent[k] += time.perf_counter() - start
            point.frames.append(statistics.median(done.frames))
            point.whole.append(done.whole)
            if not rounds and point.frames[-1] > TOO_LONG:
                point.note = f"{point.frames[-1]:.0f} s a picture: no further round"
                del live[k]
    return points


def truth_of(case: Case, device: Device) -> Truth:
    """What pictures of a case are held against: double precision where the device has it."""
    if case.task == "samples":
        return truth_of_means(case.scene, device)
    best = Product(device, "double" if device.has_double else "single")
    return truth_of_frame(case.scene, best.answer(case.scene))


def measure_waits(
    case: Case, device: Device, peers: Sequence[BenchTracer], rounds: int, say: Say, anew: bool
) -> list[Wait]:
    """Measures what a user waits for, in turn, round by round.

    anew: also with nothing compiled, which takes longest. Who fails once is asked no more.
    """
    with tempfile.TemporaryDirectory() as folder:
        ways = [taker for taker in takers(case.scene, device.spec, peers, Path(folder)) if anew or taker[2] != NEW]
        waits = [Wait(case.name, tracer, way, version) for tracer, version, way, _ in ways]
        for number in range(rounds):
            for wait, (_, _, _, take) in zip(waits, ways, strict=True):
                if len(wait.seconds) == number:
                    say(f"{wait.tracer}, {wait.way}: round {number + 1} of {rounds}")
                    try:
                        wait.seconds.append(take())
                    except Exception as error:
                        if not wait.version:
                            raise
                        tell(f"{wait.tracer}, {wait.way}: {error}")
    return [wait for wait in waits if wait.seconds]

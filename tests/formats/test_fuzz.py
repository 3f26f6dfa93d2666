"""Files and command lines that are almost right: a picture, or clear words; never a traceback, NaN, hang or other file.

What was found stays as a literal case of its own elsewhere. FUZZ=N makes the cases N times as many, and others:
`FUZZ=40 .venv/bin/pytest -m "slow or not slow" tests/formats/test_fuzz.py` has 100,000 damaged scenes.
"""

from __future__ import annotations

import contextlib
import random
import resource
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fuzzing import FACTOR, NAMES, NUMBERS, Files, damaged, valid

import cltrace
from cltrace import SceneError, cli
from cltrace.cli import command
from cltrace.cli.options import Options, options_of, parser
from cltrace.formats.reader import read
from cltrace.run.devices import Device
from cltrace.scene import Scene
from cltrace.students.check import check

SECONDS, MEGABYTES = 5.0, 1000  # that a file may take


pytestmark = pytest.mark.usefixtures("own_folder")


def write(files: Files) -> None:
    for name in ("s.xml", "m.obj", "t.png"):
        Path(name).unlink(missing_ok=True)
    for name, data in files.items():
        Path(name).write_bytes(data)


@contextlib.contextmanager
def limits(case: object, seconds: float = SECONDS) -> Iterator[None]:
    """Fails where a case takes too long, or is the first of its process to take too much memory."""
    start, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert time.process_time() - start < seconds, case
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MEGABYTES * 1000, case


def read_all() -> tuple[Scene, list[str]] | None:
    """The scene s.xml and its warnings, or None for faults, of which each must name a file and a line that it has."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return read("s.xml")
        except SceneError as error:
            for line in str(error).split("\n"):
                name, number = line.split(":")[:2]
                if number.isdigit():
                    data = Path(name).read_bytes()
                    assert int(number) <= data.count(b"\n") + data.count(b"\r") + 1, line
                else:
                    assert name in ("s.xml", "m.obj", "t.png"), line
            return None


@pytest.mark.parametrize("part", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 5))])
def test_damaged_scenes(part: int) -> None:
    """Trees, attributes, numbers, encodings, lines, chunks, ends and bytes. Of what is valid nothing is refused."""
    outcomes = Counter[bool]()
    for k in range(500 * FACTOR):
        rng = random.Random(f"{FACTOR} {part} {k}")
        files = valid(rng)
        if k % 50 == 0:
            write(files)
            assert read_all()
        write(damaged(rng, files))
        with limits(k):
            found = read_all()
        outcomes[found is not None] += 1
        if found:
            assert Path(found[0].output_file).name == found[0].output_file
    assert min(outcomes[True], outcomes[False]) > 50
    assert [path.name for path in Path("..").iterdir()] == ["here"]


@pytest.mark.slow
def test_damaged_scenes_are_drawn_right(any_device: Device) -> None:
    """Those that are still scenes, as by the reference, and without NaN."""
    count = 0
    for k in range(200 * FACTOR):
        rng = random.Random(f"{FACTOR} drawn {k}")
        write(damaged(rng, valid(rng)))
        found = read_all()
        if found is None or any(
            "may spoil colours" in warning for warning in found[1]
        ):  # whose colours are not promised
            continue
        scene = found[0].seen_by(replace(found[0].camera, resolution=(9, 7), max_bounces=1))
        with contextlib.suppress(cltrace.CltraceError):  # as of cameras that look nowhere
            image = cltrace.render(scene, any_device, outputs=("rgb8", "color", "depth", "normal", "id"))
            for name in ("color", "depth", "normal"):
                assert not np.isnan(getattr(image, name)).any(), name
            report = check(scene, image, "accurate", 6)
            assert report.ok, str(report)
        count += 1
    assert count > 30


# Options whose work is another program's or does not end, and the one that asks for tracebacks.
ASIDE = {"--verbose", "--cluster", "--doctor", "--list-devices", "--watch", "--help", "-h", "--version"}
_VALUES = (
    "1 0 -1 3 16 17 8x6 0x0 9x 1e3x5 70000x70000 0,0,4,4 4,4,0,0 1,2,3 1,2 :2 1:9:2 x X 0,0,0 inf nan 1e400 all "
    "text json none color id depth normal rgb8,id accurate single double cpu gpu 0:0 9:9 s.xml t.png - . = "
    "a.png a.exr a.npy a.npz a%04d.png a.mp4 a.gif a.apng a.jpg {}.png none/a.png a.png/"
)
VALUES = _VALUES.split()


def line_of(rng: random.Random, options: list[list[str]]) -> list[str]:
    """Some options with some values, and some scenes."""
    line: list[str] = []
    for _ in range(rng.choice([0, 1, 2, 3, 5])):
        name = rng.choice(rng.choice(options))
        value = rng.choice(VALUES if rng.random() < 0.9 else [*NAMES[:9], *NUMBERS])
        line += rng.choice([[name, value], [f"{name}={value}"], [name]])
    for _ in range(rng.choice([0, 1, 1, 1, 1, 2])):
        line.insert(rng.randrange(len(line) + 1), rng.choice(["s.xml", "s.xml", "s.xml", "t.png", "none.xml", *NAMES]))
    return [word.replace("\0", "") for word in line]


@pytest.mark.slow
def test_command_lines(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Any options with any values: a status, some words, and files of these names in this folder only."""
    write(valid(random.Random(1)))
    options = [a.option_strings for a in parser(whole=True)._actions if a.option_strings]
    options = [names for names in options if not ASIDE.intersection(names)]
    do, statuses, drawn = command.do, Counter[int](), 0

    def small(asked: Options, reporter: object) -> int:
        """Pictures of 8x6 with the usual kernel are drawn; of other works only the options are read."""
        nonlocal drawn
        other = asked.many or asked.view or asked.doctor or asked.list_devices or asked.explain or asked.cluster
        if other or asked.compare or asked.show == "lit" or drawn >= 60 * FACTOR:
            return 0
        drawn += 1
        how = {name: getattr(usual, name) for name in ("device", *usual.renderer_options(())) if name != "outputs"}
        return do(Options(**vars(asked) | {"size": (8, 6)} | how), reporter)  # type: ignore[arg-type]

    usual = options_of(["s.xml"])
    monkeypatch.setattr(command, "do", small)
    before = {path: path.read_bytes() for path in Path().iterdir()}
    for k in range(1500 * FACTOR):  # some of which compile a kernel
        line = line_of(random.Random(f"{FACTOR} line {k}"), options)
        with limits(line, 60), contextlib.suppress(SystemExit):
            statuses[cli.main(line)] += 1
        said = capsys.readouterr()
        assert "Traceback" not in said.err, line
        assert "Error" not in said.err.replace("SceneError", ""), (line, said.err)
        for path in set(Path().iterdir()) - set(before):
            assert path.suffix in (".png", ".exr", ".npy", ".npz"), (line, path)
            path.unlink()
        assert {path: path.read_bytes() for path in Path().iterdir()} == before, line
    assert set(statuses) <= {0, 1, 2, 3}
    assert min(statuses[0], statuses[2]) > 50
    assert [path.name for path in Path("..").iterdir()] == ["here"]

"""--limit, which changes what a scene may have, and CLTRACE_LIMITS, in processes of their own."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from cltrace.base import limits
from cltrace.cli import command

ROOT = Path(__file__).parents[2]
MINIMAL = (ROOT / "scenes/minimal.xml").read_text("utf-8")
LIGHT = '<point_light><color r="0" g="0" b="0.001"/><position x="1" y="2" z="3"/></point_light>\n'


def call(folder: Path, *arguments: str, scene: Path | str = "s.xml", **environment: str) -> tuple[int, str]:
    """The status and the last line of `cltrace s.xml -q`."""
    line = [sys.executable, "-m", "cltrace", scene, "-q", *arguments]
    env = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    done = subprocess.run(line, cwd=folder, env=env, capture_output=True, text=True, check=False)
    return done.returncode, (done.stderr.splitlines() or [""])[-1]


@pytest.mark.slow
def test_more_lights_than_usual(tmp_path: Path) -> None:
    (tmp_path / "s.xml").write_text(MINIMAL.replace("</lights>", LIGHT * 1100 + "</lights>"))
    status, words = call(tmp_path)
    assert status == 2
    assert re.fullmatch(
        r"s\.xml:\d+: lights: must be at most 1024, .*; --limit lights=N or CLTRACE_LIMITS allows more", words
    )
    assert call(tmp_path, "--limit", "lights=1102", "--size", "8x8") == (0, "")
    assert call(tmp_path, "--limit=lights=1101", "--size", "8x8")[0] == 2
    assert call(tmp_path, "--size", "8x8", CLTRACE_LIMITS="steps=9000 lights=1102") == (0, "")
    # The option counts where both say something.
    assert call(tmp_path, "--limit", "lights=3", CLTRACE_LIMITS="lights=1102")[0] == 2


def test_limits_reach_other_processes(tmp_path: Path) -> None:
    """Such as those that draw the frames of a movie: what rays a pixel may take is a number of their kernels.

    What they say of it is what one process says.
    """
    pytest.importorskip("dask")
    few = ("--limit", "rays=3", "--size", "8x8", "--cluster", "local:1", "--orbit", "2", "-o", "f_%d.png")
    status, words = call(tmp_path, *few, scene=ROOT / "scenes/step7-glass.xml")
    assert status == 2
    assert words.endswith("takes more than 3 rays; --limit rays=N or CLTRACE_LIMITS allows more")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lights=1e3", "argument --limit: lights must be a whole number within 1..65536, got '1e3'"),
        ("spheres=67108865", "argument --limit: spheres must be a whole number within 1..67108864, got '67108865'"),
        ("balls=1", "argument --limit: must be NAME=VALUE, with a name of lights, spheres, cylinders, "),
        # In one process that has loaded all modules, it is too late.
        ("lights=5", "argument --limit: must be written out, and one for each name, got 'lights=5'"),
    ],
)
def test_what_is_no_limit(text: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["s.xml", "--limit", text]) == 2
    assert words in capsys.readouterr().err


def test_one_fault_in_the_environment_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """In whatever order they are; and it is said of all that are wrong."""
    for name in ("MAX_LIGHTS", "MAX_STEPS"):
        monkeypatch.setattr(limits, name, getattr(limits, name))
    with pytest.raises(ValueError, match=r"^must be NAME=VALUE, .* got 'ligths=9'; rays must be .*, got 'x'$"):
        limits.change(["lights=5", "ligths=9", "rays=x", "steps=6"])
    assert (limits.current("lights"), limits.current("steps")) == (5, 6)


def test_hints(monkeypatch: pytest.MonkeyPatch) -> None:
    assert limits.hint("lights") == "; --limit lights=N or CLTRACE_LIMITS allows more"
    monkeypatch.setattr(limits, "MAX_LIGHTS", 2**16)
    assert limits.hint("lights") == ""


def test_meshes_named_again_are_refused_before_anything_is_made(tmp_path: Path) -> None:
    few = ("--limit", "instances=11", "--size", "8x8")
    status, words = call(tmp_path, *few, scene=ROOT / "scenes/step4-meshes.xml")
    assert status == 2
    told = "surfaces: must have at most 11 triangles of files that are named again; --limit instances=N or "
    assert words.endswith(f"{told}CLTRACE_LIMITS allows more")
    assert list(tmp_path.iterdir()) == []


def test_each_limit_is_in_the_docs() -> None:
    text = (ROOT / "docs/format.md").read_text("utf-8")
    assert all(re.search(rf"\b{name}\b", text[text.index("`--limit NAME") :]) for name in limits.NAMES)

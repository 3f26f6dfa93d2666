"""The command cltrace-bench does its work, and says what is wrong with what is asked of it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from cltrace.bench import cli
from cltrace.plan.request import PRECISIONS

SCENES = Path(__file__).parents[2] / "scenes"
RESULTS = Path(__file__).parents[2] / "docs" / "benchmark.json"


def run(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cltrace.bench", *map(str, arguments)]
    env = {k: v for k, v in os.environ.items() if k != "PYOPENCL_CTX"} | environment
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=240, check=False)


@pytest.mark.slow
def test_quick(tmp_path: Path) -> None:
    done = run("--quick", "--size", "96x54", "--rounds", 1, "--precision", "accurate", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "bench-results"
    results = json.loads((folder / "results.json").read_text())
    assert results["finished"] is True
    assert {row["group"] for row in results["points"]} == {"ordinary", "ground spheres", "far from the origin"}
    for row in results["points"]:
        assert row["size"] == [96, 54]
        assert row["frames"] or row["note"]
    assert {"others", "loaded", "commit"} <= results["about"].keys()
    for line in ("accurate", "ordinary: 16 balls (16 surfaces, 96x54)", "what a user waits for"):
        assert line in done.stdout
    assert {"results.json", "table.md"} <= {path.name for path in folder.iterdir()}


@pytest.mark.stress
def test_given_scenes_without_plots(tmp_path: Path) -> None:
    scene = SCENES / "minimal.xml"
    done = run(scene, "--quick", "--no-plots", "--precision", "accurate", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = json.loads((tmp_path / "out" / "results.json").read_text())["points"]
    assert {row["scene"] for row in rows} == {"minimal"}
    assert [row["tracer"] for row in rows if row["tracer"] in PRECISIONS] == ["accurate"]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"results.json", "table.md"}


def test_without_matplotlib(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import sys; sys.modules['matplotlib'] = None\n")
    done = run("--quick", cwd=tmp_path, PYTHONPATH=str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "cltrace-bench: the plots need matplotlib: pip install 'cltrace[bench]', or say --no-plots\n"
    )


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["missing.xml"], 2, "missing.xml: "),
        (["--device", "no such"], 3, "cltrace-bench: no device matches 'no such'"),
        (["--rounds", "0"], 2, "cltrace-bench: argument --rounds: must be a whole number >= 1, got '0'"),
        (["--size", "9"], 2, "cltrace-bench: argument --size: must be WIDTHxHEIGHT, such as 640x480, got '9'"),
        (["--from", "missing.json"], 2, "cltrace-bench: missing.json: No such file or directory"),
        (["--from", "file"], 2, "cltrace-bench: file: these are no results of cltrace-bench: "),
        (["--from", "file", "--quick"], 2, "cltrace-bench: --counted, --from and --publish go with no scenes"),
    ],
)
@pytest.mark.usefixtures("own_folder")
def test_faults(arguments: list[str], status: int, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("file").touch()
    assert cli.main([*arguments, "--no-plots"]) == status
    assert capsys.readouterr().err.startswith(message)


@pytest.mark.slow
def test_another_run_again(tmp_path: Path) -> None:
    """Tables and plots of results.json are made again."""
    assert cli.main(["--from", str(RESULTS), "-o", str(tmp_path)]) == 0
    assert (tmp_path / "results.json").read_bytes() == RESULTS.read_bytes()
    kinds = {f"{name}{scheme}.png" for name in ("time-error", "antialiasing", "growth") for scheme in ("", "-dark")}
    assert {path.name for path in tmp_path.iterdir()} == {"results.json", "table.md"} | kinds


@pytest.mark.slow
def test_ctrl_c_keeps_what_was_measured(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cltrace.bench", "--quick", "--no-plots", "--rounds", "9", "-o", "out"]
    command += ["--precision", "accurate"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("ordinary: 16 balls"):  # the first table: the second scene has begun
            break
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err.endswith("cltrace-bench: interrupted; what was measured is kept\n")
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["finished"] is False
    measured = {row["scene"] for row in results["points"] if row["frames"]}
    assert "16 balls" in measured
    assert "moved by 1e+06" not in measured
    assert "| accurate | " in (tmp_path / "out" / "table.md").read_text()

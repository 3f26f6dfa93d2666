"""The command as its users meet it: a process, its output, its files and its exit status."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

import cltrace
from cltrace import cli

FIRST = Path(__file__).parents[2] / "scenes" / "step3-shadows.xml"


def run(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "cltrace", *map(str, arguments)]
    env = {k: v for k, v in os.environ.items() if k != "PYOPENCL_CTX"} | environment
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, timeout=120, check=False)


def call(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[bytes]:
    """What `run` does, in this process: much faster, where a process of its own makes no difference."""
    buffers = io.BytesIO(), io.BytesIO()
    out, err = (io.TextIOWrapper(buffer, "utf-8", write_through=True) for buffer in buffers)
    with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = cli.main([*map(str, arguments)])
        except SystemExit as end:  # of --help
            status = end.code
    return subprocess.CompletedProcess(arguments, status, *(buffer.getvalue() for buffer in buffers))


def pixels(data: bytes | Path) -> np.ndarray:
    with Picture.open(io.BytesIO(data) if isinstance(data, bytes) else data) as picture:
        assert picture.format == "PNG"
        assert picture.mode == "RGB"
        return np.asarray(picture)


def test_scene_alone_does_the_right_thing(tmp_path: Path) -> None:
    done = run(FIRST, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == b""
    assert done.stderr.startswith(b"cltrace: wrote step3-shadows.png, 481x361, ")
    assert [p.name for p in tmp_path.iterdir()] == ["step3-shadows.png"]
    expected = cltrace.render(cltrace.load(FIRST)).rgb8
    assert np.array_equal(pixels(tmp_path / "step3-shadows.png"), expected)


def test_the_installed_command_is_the_same() -> None:
    command = Path(sys.executable).parent / "cltrace"
    done = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("cltrace ")


def test_stdout_quiet_and_options(tmp_path: Path) -> None:
    whole = pixels(call(FIRST, "-o", "-", "-q", cwd=tmp_path).stdout)
    crop = pixels(call(FIRST, "-o", "-", "-q", "--crop", "100,200,140,230", cwd=tmp_path).stdout)
    assert np.array_equal(crop, whole[200:230, 100:140])
    assert pixels(call(FIRST, "-o", "-", "--size", "64X48", cwd=tmp_path).stdout).shape == (48, 64, 3)
    square = pixels(call(FIRST, "-o", "-", "--square-pixels", cwd=tmp_path).stdout)
    assert not np.array_equal(square, whole)
    down = pixels(call(FIRST, "-o", "-", "--truncate", cwd=tmp_path).stdout)
    assert set(np.unique(whole.astype(int) - down)) == {0, 1}
    # A link is written through.
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.png").symlink_to("folder/x.png")
    assert call(FIRST, "-q", "-o", "link.png", cwd=tmp_path).stderr == b""
    assert (tmp_path / "link.png").is_symlink()
    assert np.array_equal(pixels(tmp_path / "folder/x.png"), whole)
    assert len(list(tmp_path.rglob("*"))) == 3


def test_stats_json_is_one_object_on_stdout(tmp_path: Path) -> None:
    done = call(FIRST, "--stats=json", "--repeat", 3, cwd=tmp_path)
    stats = json.loads(done.stdout)
    assert done.stdout.count(b"\n") == 1
    assert {"device", "spheres", "triangles", "cylinders", "features", "work", "skipped"} <= set(stats)
    assert stats["precision"] == "accurate"
    assert stats["size"] == [481, 361]
    assert set(stats["seconds"]) == {"read", "pack", "lists", "build", "upload", "kernel", "readback", "write", "total"}
    assert all(value >= 0 for value in stats["seconds"].values())
    assert stats["rays"]["primary"] == 481 * 361
    assert 0 < stats["rays"]["shadow"] < 481 * 361
    text = call(FIRST, "--stats", "--show", "id", cwd=tmp_path)
    assert text.stdout == b""
    assert re.search(rb"(?m)^seconds +[0-9.e-]+ kernel$", text.stderr)
    assert re.search(rb"(?m)^rays +0 shadow$", text.stderr)


def test_check(tmp_path: Path) -> None:
    done = call(FIRST, "--check=500", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert b"check ok: 500 of 173641 pixels" in done.stderr
    crop = call(FIRST, "--crop", "200,200,230,220", "--check=all", "--show", "id", cwd=tmp_path)
    assert crop.returncode == 0
    assert b"check ok: 600 of 600 pixels" in crop.stderr


def test_list_devices(tmp_path: Path) -> None:
    done = call("--list-devices", cwd=tmp_path)
    assert (done.returncode, done.stdout.decode().splitlines()) == (0, [d.line() for d in cltrace.devices()])
    brief, long = (call("nowhere.xml", *more, cwd=tmp_path).stderr.decode() for more in ((), ("-v",)))
    assert long.startswith("Traceback ")
    assert long.endswith(brief)


def test_no_driver_gives_advice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The loader finds nothing in an empty folder, but for a wheel's driver beside it."""
    monkeypatch.setattr(cltrace.run.devices, "devices", list)
    monkeypatch.setattr(cltrace.cli.command, "devices", list)
    for argument, stream in (("--list-devices", "stdout"), (FIRST, "stderr")):
        done = call(argument, cwd=tmp_path)
        assert done.returncode == 3
        assert b"no OpenCL device found" in getattr(done, stream)
        assert b"apt-get install pocl-opencl-icd" in getattr(done, stream)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "which scene? Say cltrace SCENE.xml; see cltrace --help"),
        (["{scene}", "--size", "0x5"], "argument --size: must be within 1..65536 each and 1073741824 pixels, got 0x5;"),
        (["{scene}", "--size", "5"], "argument --size: must be WIDTHxHEIGHT, such as 640x480, got '5';"),
        (["{scene}", "--crop", "5,5,5,9"], "crop: must be within 0,0,481,361 and not empty, got 5,5,5,9"),
        (["{scene}", "--crop", "-1,0,10,10"], "--crop: must be X0,Y0,X1,Y1 without a sign, such as 0,0,64,64, got"),
        (["{scene}", "--check=few"], "argument --check: must be a whole number >= 1, got 'few';"),
        (["--check", "{scene}"], "argument --check: put the scene first, or say --check=N; "),
        (["{scene}", "--frobnicate"], "unrecognized arguments: --frobnicate;"),
        (["{scene}", "--outputs", "id,colour"], "argument --outputs: must be of rgb8, color, "),
        (["{scene}", "-o", "no/such/x.png"], "-o: there is no folder 'no/such'"),
        (["{scene}", "-o", "."], "-o: '.' is a folder"),
        (["{scene}", "-o", "s.png/."], "-o: 's.png/.' is a folder"),
        (["{scene}", "-o", "x.bmp"], "-o: the name of a picture must end in .png, .tif, .tiff, .jpg, .jpeg, .exr"),
        (["{scene}", "-o", "/dev/stdout"], ".npy or .npz, got '/dev/stdout'; -o - writes it to stdout"),
        (["{scene}", "-o", "/proc/x.png"], "cannot write /proc/x.png: "),
        (["{scene}", "-o", "-", "--stats=json"], "-o - and --stats=json both want stdout"),
        (["nowhere.xml"], "nowhere.xml: "),
        (["-"], "a scene is not read from stdin: say the name of its file"),
        (["--doctor", "x.xml"], "--doctor takes no scene, got 'x.xml'"),
        (["--doctor", "-o", "x.txt"], "--doctor takes no -o"),
        (["{scene}", "--width", "5"], "argument --width: invalid choice: 5 (choose from "),
        (["--list-devices", "-d", "gpu"], "--list-devices lists all devices, so it takes no -d; --doctor -d SPEC "),
    ],
)
def test_bad_usage(tmp_path: Path, arguments: list[str], message: str) -> None:
    done = call(*(a.replace("{scene}", str(FIRST)) for a in arguments), cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr.decode()
    assert b"Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("spec", "source"), [("99:0", ""), ("", ""), ("nosuchthing", " (from PYOPENCL_CTX)")])
def test_bad_device(tmp_path: Path, spec: str, source: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if source:
        monkeypatch.setenv("PYOPENCL_CTX", spec)
    done = call(FIRST, *([] if source else ["-d", spec]), cwd=tmp_path)
    assert done.returncode == 3
    told = f"cltrace: no device matches {spec!r}{source}; choose one of:"
    assert done.stderr.decode().splitlines() == [told, *(d.line() for d in cltrace.devices())]
    assert not list(tmp_path.iterdir())
    assert call(FIRST, "-d", "cpu", cwd=tmp_path).returncode == 0  # which counts more than the environment


def test_faults_of_the_scene_are_all_told_and_nothing_is_written(tmp_path: Path) -> None:
    bad = tmp_path / "bad.xml"
    bad.write_text(FIRST.read_text().replace('radius="', 'radius="-'))
    done = call("bad.xml", cwd=tmp_path)
    assert done.returncode == 2
    lines = done.stderr.decode().splitlines()
    assert [line.split(": ")[0] for line in lines] == [f"bad.xml:{number}" for number in (36, 45, 54, 63, 72, 135)]
    assert lines[4] == "bad.xml:72: sphere: radius must be > 0, got -0.55 (7 times, also in lines 81, 90, 99, …)"
    assert [p.name for p in tmp_path.iterdir()] == ["bad.xml"]


def test_a_limit_of_the_size_of_files(tmp_path: Path) -> None:
    """LLVM would end the process, with the status 1, which is that of a check that failed."""
    script = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)); from cltrace import cli; "
    line = [sys.executable, "-c", f"{script}raise SystemExit(cli.main({[str(FIRST), '-q', '-o', 'x.png']}))"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    told = "cltrace: compiling takes files of 4194304 bytes, but they may have 4096 here: ulimit -f\n"
    assert (done.returncode, done.stderr) == (3, told)
    assert not list(tmp_path.iterdir())


def test_names_that_the_locale_lacks(tmp_path: Path) -> None:
    """In the C locale, which many batch systems have, names are bytes beyond ASCII."""
    environment = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = run(FIRST, "--size", "8x6", "-q", "-o", "\u00e4.png", cwd=tmp_path, **environment)
    assert (done.returncode, done.stderr) == (0, b"")
    assert [path.name for path in tmp_path.iterdir()] == ["\u00e4.png"]


TEXTURED = """<scene output_file="t.png"><background_color r="0" g="0" b="0"/><camera><position x="0" y="0" z="4"/>
<lookat x="0" y="0" z="0"/><up x="0" y="1" z="0"/><horizontal_fov angle="45"/>
<resolution horizontal="8" vertical="6"/><max_bounces n="1"/></camera>
<lights><ambient_light><color r="1" g="1" b="1"/></ambient_light></lights><surfaces>
<mesh name="maps/m.png"><material_textured><texture name="t.png"/><phong ka="1" kd="0" ks="0" exponent="1"/>
<reflectance r="0"/><transmittance t="0"/><refraction iof="1"/></material_textured></mesh></surfaces></scene>
"""
ANSWER = "cltrace: {}: {!r} is {!r}, which the picture is made from and would replace\n"


@pytest.fixture
def textured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scene s.xml with a texture t.png and an OBJ file with the name of a picture, in the current folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.xml").write_text(TEXTURED)
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps/m.png").write_text("v -1 -1 0\nv 1 -1 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n")
    Picture.fromarray(np.full((1, 1, 3), 99, np.uint8)).save(tmp_path / "t.png")
    return tmp_path


@pytest.mark.parametrize(
    ("options", "origin", "target", "file"),
    [
        ([], "output_file", "t.png", "t.png"),
        (["--watch"], "output_file", "t.png", "t.png"),
        (["-o", "a.png", "-o", "./maps/../t.png"], "-o", "./maps/../t.png", "t.png"),
        (["-o", "link.png"], "-o", "link.png", "t.png"),
        (["-o", "hard.png"], "-o", "hard.png", "maps/m.png"),
        (["--show", "lit"], "output_file", "t.png", "t.png"),
        (["--compare", "mine.png", "-o", "mine.png"], "-o", "mine.png", "mine.png"),
        (["s.xml"], "output_file", "t.png", "t.png"),
        (["other.xml", "-o", "{}.png"], "-o", "other.png", "t.png"),
        (["--orbit", "3", "-o", "f%02d.png"], "output", "f02.png", "t.png"),
        (["--orbit", "3", "-o", "f.gif"], "-o", "f.gif", "t.png"),
        (["-o", "scene.png"], "-o", "scene.png", "s.xml"),
    ],
)
def test_no_input_is_replaced_by_a_picture(
    options: list[str], origin: str, target: str, file: str, textured: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By no name that a file has, in no kind of work."""
    if "--watch" in options:
        pytest.importorskip("watchfiles")
    for name in ("link.png", "f02.png", "f.gif", "other.png"):
        Path(name).symlink_to("t.png")
    Path("hard.png").hardlink_to("maps/m.png")
    Path("scene.png").symlink_to("s.xml")
    Path("other.xml").write_text(TEXTURED)
    Path("mine.png").write_bytes(Path("t.png").read_bytes())
    names = [path for path in textured.rglob("*") if path.is_file()]
    before = {path: path.read_bytes() for path in names}
    assert cli.main(["s.xml", *options]) == 2
    assert capsys.readouterr().err.endswith(ANSWER.format(origin, target, file))
    assert {path: path.read_bytes() for path in names} == before


def test_odd_names(tmp_path: Path) -> None:
    """Names that look like options and folders, and links that lead to themselves."""
    (tmp_path / "-x.xml").write_text(TEXTURED.replace('"t.png"/>', '"u.png"/>'))
    (tmp_path / "s.xml").write_bytes(FIRST.read_bytes())
    for name in ("s.png", "loop", "loop.xml"):
        (tmp_path / name).symlink_to(name)
    before = sorted(tmp_path.iterdir())
    for arguments, message in [
        (("-o", "a.png", "--", "-x.xml"), "-x.xml:5: "),
        (("s.xml/", "-o", "a.png"), "s.xml/: cannot be read: Not a directory\n"),
        (("s.xml", "-o", "s.png"), "cltrace: -o: Too many levels of symbolic links: 's.png'\n"),
        (("s.xml", "-o", "loop/s.png"), "cltrace: -o: there is no folder 'loop'\n"),
        (("loop.xml",), "loop.xml: cannot be read: Too many levels of symbolic links\n"),
        (("s.xml", "-o", "x" * 300 + ".png"), "cltrace: -o: File name too long: "),
    ]:
        done = call(*arguments, cwd=tmp_path)
        assert done.returncode == 2
        assert done.stderr.decode().startswith(message)
    assert sorted(tmp_path.iterdir()) == before


def test_full_and_closed_streams(tmp_path: Path) -> None:
    """Each is told, or harmless; what one stream lacks is never found in the other."""

    def shell(redirection: str, *arguments: str) -> subprocess.CompletedProcess[bytes]:
        command = f"{sys.executable} -m cltrace {' '.join(arguments)} {redirection}"
        return subprocess.run(["sh", "-c", command], cwd=tmp_path, capture_output=True, timeout=120, check=False)

    warned = tmp_path / "warned.xml"
    warned.write_text(FIRST.read_text().replace("<camera>", "<camera><hat/>"))
    small = "--size", "8x6"
    assert shell("> /dev/full", str(FIRST), "--stats=json", *small).returncode == 2
    assert shell("> /dev/full", "--list-devices").returncode == 2
    closed = shell(">&-", str(FIRST), "-o -", *small)
    assert (closed.returncode, closed.stderr) == (2, b"cltrace: stdout is closed\n")
    assert shell("2> /dev/full", str(FIRST), *small).returncode == 0
    assert pixels(shell("2>&-", "warned.xml", "-o -", *small).stdout).shape == (6, 8, 3)
    json.loads(shell("2>&-", "warned.xml", "--stats=json", *small).stdout)


def test_unwritable_cache(tmp_path: Path) -> None:
    """PoCL hides its devices, and pyopencl fails, without a cache folder: another one is found."""
    (tmp_path / "file").write_text("in the way")
    done = run(FIRST, "-o", "x.png", cwd=tmp_path, HOME=str(tmp_path / "file"), XDG_CACHE_HOME=str(tmp_path / "file"))
    assert done.returncode == 0, done.stderr


def test_the_log_is_shown_on_a_terminal_only(tmp_path: Path) -> None:
    """The library logs, and prints nothing; the command tells it where somebody is looking."""
    script = """
import logging, sys
from cltrace.process.console import command
def body():
    logging.getLogger("cltrace").info("compiling the kernel ...")
    logging.getLogger("other").info("nothing of ours")
    return 0
sys.exit(command("cltrace", body))
"""
    ours, theirs = os.openpty()
    seen = subprocess.run([sys.executable, "-c", script], stderr=theirs, stdout=subprocess.PIPE, check=True)
    os.close(theirs)
    assert os.read(ours, 1000) == b"cltrace: compiling the kernel ...\r\n"
    os.close(ours)
    assert seen.stdout == b""
    unseen = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    assert (unseen.stdout, unseen.stderr) == (b"", b"")


def test_help_fits_one_screen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    done = call("--help", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.count(b"\n  cltrace scene.xml") == 3
    assert len(done.stdout.splitlines()) <= 40
    assert max(map(len, done.stdout.decode().splitlines())) <= 100
    assert b"--help all shows all options." in done.stdout
    assert b"--bits" not in done.stdout


def test_help_all_has_every_option(tmp_path: Path) -> None:
    whole = call("--help", "all", cwd=tmp_path)
    assert whole.returncode == 0
    options = [option for action in cli.parser()._actions for option in action.option_strings]
    assert not [option for option in options if not re.search(rf"{option}\b", whole.stdout.decode())]
    assert call("-h", FIRST, cwd=tmp_path).stdout == call(FIRST, "--help", cwd=tmp_path).stdout

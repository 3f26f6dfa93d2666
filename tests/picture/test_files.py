"""Files that are written whole or not at all, and the folder of the kernel caches."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from cltrace.picture import files
from cltrace.picture.files import whole_file
from cltrace.run import caches

pytestmark = pytest.mark.usefixtures("own_folder")


def write(name: str, data: bytes = b"new") -> None:
    with whole_file(Path(name)) as file:
        file.write(data)


def names(folder: str = ".") -> list[str]:
    return sorted(path.name for path in Path(folder).iterdir())


# --- Whole files


NAMES = ["s.png", "\U0001f600" * 61 + ".png", "\u00e4" * 125 + ".png", "x" * 255, ".png", os.fsdecode(b"\xff" * 70)]


@pytest.mark.parametrize("name", NAMES, ids=["plain", "4 bytes", "2 bytes", "long", "suffix", "no text"])
def test_every_valid_name_can_be_written(name: str) -> None:
    write(name)
    write(name, b"newer")
    assert Path(name).read_bytes() == b"newer"
    assert names() == [name]


def test_what_fails_leaves_the_old_file() -> None:
    Path("old").write_bytes(b"old")
    with suppress(KeyboardInterrupt), whole_file(Path("old")) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert Path("old").read_bytes() == b"old"
    assert names() == ["old"]


def test_a_new_file_has_the_rights_that_the_umask_leaves() -> None:
    before = os.umask(0o027)
    write("new")
    os.umask(before)
    assert Path("new").stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize(
    ("links", "code"),
    [
        ({"s.png": "t.png", "t.png": "s.png"}, errno.ELOOP),
        ({"s.png": "."}, errno.EISDIR),
        ({"s.png": "none/t.png"}, errno.ENOENT),
    ],
)
def test_links_that_lead_nowhere(links: dict[str, str], code: int) -> None:
    for name, target in links.items():
        Path(name).symlink_to(target)
    with pytest.raises(OSError) as caught:
        write("s.png")
    assert caught.value.errno == code
    assert {name: str(Path(name).readlink()) for name in names()} == links


def test_a_device_is_written_into() -> None:
    before = Path(os.devnull).stat()
    Path("null.png").symlink_to(os.devnull)
    write("null.png")
    after = Path(os.devnull).stat()
    assert (after.st_ino, after.st_mode, after.st_rdev) == (before.st_ino, before.st_mode, before.st_rdev)
    Path("full.png").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left on device"):
        write("full.png")


WAITS = """
import sys, time
from pathlib import Path
from cltrace.process.console import command
from cltrace.picture.files import whole_file

def body():
    with whole_file(Path("s.png")) as file:
        print("ready", flush=True)
        time.sleep(60)
    return 0

sys.exit(command("test", body))
"""


@contextmanager
def writing(script: str = WAITS) -> Iterator[subprocess.Popen[bytes]]:
    """A process that is writing s.png."""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        yield process


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGXCPU"])
def test_a_signal_leaves_nothing_behind(name: str) -> None:
    number = getattr(signal, name)
    with writing() as process:
        assert len(names()) == 1
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert said == (b"test: interrupted\n" if number == signal.SIGINT else b"")
    assert names() == []


def test_a_signal_that_is_ignored_stays_so() -> None:
    """As with nohup, or in the background of a shell."""
    ignoring = "import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
    with writing(ignoring + WAITS.replace("60", "0.5")) as process:
        process.send_signal(signal.SIGHUP)
        assert process.wait(60) == 0
    assert names() == ["s.png"]


def test_what_a_kill_has_left_is_removed_by_the_next_run() -> None:
    """What another process still writes stays, and so does what only looks alike."""
    alike = ".s.png-01234567-0123456789abcde.part"
    Path(alike).touch()
    with writing() as process:
        (part,) = [name for name in names() if len(name) == len(f".s.png-{files.HOST}-0123456789abcdef.part")]
        write("a.png")
        assert part in names()
        process.kill()
    assert part in names()
    files._remove_left.cache_clear()
    write("b.png")
    assert names() == [alike, "a.png", "b.png"]


def test_what_another_host_writes_stays_for_a_day() -> None:
    """A lock may hold on one host only, so that one can be had tells nothing of the other."""
    parts = [f".s.png-{host}-0123456789abcdef.part" for host in (files.HOST, "f" * 8)]
    day_old = f".t.png-{'f' * 8}-0123456789abcdef.part"
    for name in (*parts, day_old):
        Path(name).touch()
    os.utime(day_old, (0, time.time() - files.OLD - 1))
    write("a.png")
    assert names() == [parts[1], "a.png"]


# --- The folder of the caches


def cache_home(monkeypatch: pytest.MonkeyPatch, home: str = "home/none") -> str | None:
    """XDG_CACHE_HOME after ensure(), where HOME is this and the temporary folder is `tmp`."""
    for name in ("home", "tmp"):
        Path(name).mkdir(exist_ok=True)
    Path("home/none").touch()  # No folder can be made in a file, not even by root.
    monkeypatch.setenv("HOME", str(Path(home).absolute()))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("PYOPENCL_NO_CACHE", "")  # which is as if it were not set
    monkeypatch.setattr(tempfile, "tempdir", str(Path("tmp").absolute()))
    caches.ensure()
    found = os.environ.get("XDG_CACHE_HOME")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    return os.path.relpath(found) if found else None


SCENE = str(Path(__file__).parents[2] / "scenes" / "minimal.xml")
SPARE = f"tmp/cltrace-cache-{os.getuid()}"


@pytest.mark.parametrize("link", [False, True])
def test_the_usual_cache_is_kept(link: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("home").mkdir()
    Path("scratch").mkdir()
    if link:
        Path("home/.cache").symlink_to("../scratch")
    assert cache_home(monkeypatch, "home") is None
    assert Path("home/.cache").is_dir()
    assert not names("tmp")


@pytest.mark.parametrize("file", ["home/.cache", *(f"home/.cache/{cache}" for cache in caches.CACHES)])
def test_a_cache_that_is_no_folder(monkeypatch: pytest.MonkeyPatch, file: str) -> None:
    Path(file).parent.mkdir(parents=True)
    Path(file).touch()
    for _ in range(2):
        assert cache_home(monkeypatch, "home") == SPARE
        assert Path(SPARE).stat().st_mode & 0o777 == 0o700


def test_a_home_that_cannot_be_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "home", Mock(side_effect=RuntimeError("Could not determine home directory.")))
    assert cache_home(monkeypatch) == SPARE


def test_no_folder_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    no_folder = FileNotFoundError(errno.ENOENT, "No usable directory found")
    monkeypatch.setattr(tempfile, "gettempdir", Mock(side_effect=no_folder))
    monkeypatch.setattr(caches, "SHARED", "/dev/null")
    assert cache_home(monkeypatch) is None
    assert os.environ["PYOPENCL_NO_CACHE"] == "1"


@pytest.mark.parametrize("taken_by", ["file", "open folder", "nothing", "../theirs", SPARE])
def test_a_spare_folder_that_others_have_planted(monkeypatch: pytest.MonkeyPatch, taken_by: str) -> None:
    """Others' file, a folder that all may write to, or a link to this."""
    spare = Path(SPARE)
    spare.parent.mkdir()
    Path("theirs").mkdir()
    if taken_by == "file":
        spare.touch()
    elif taken_by == "open folder":
        spare.mkdir()
        spare.chmod(0o777)
    else:
        spare.symlink_to(Path(taken_by).name if taken_by == SPARE else taken_by)
    assert cache_home(monkeypatch) == f"{SPARE}-1"
    assert not names("theirs")


def test_a_folder_of_another_user(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the usual one nor a spare one of somebody else is used."""
    Path("home/.cache").mkdir(parents=True)
    Path(SPARE).mkdir(parents=True)
    user = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: user + 1)
    Path(f"tmp/cltrace-cache-{user + 1}").mkdir()
    assert cache_home(monkeypatch, "home") is None
    assert os.environ["PYOPENCL_NO_CACHE"] == "1"


@pytest.mark.parametrize("full", [{"home/.cache/pocl"}, {"home/.cache/pocl", f"{SPARE}/pocl"}])
def test_a_full_disk(monkeypatch: pytest.MonkeyPatch, full: set[str]) -> None:
    """An empty file can be made there, but not the files of a kernel. Where temporary files go may be full, too."""

    def fill(file: int, _: int, size: int) -> None:
        if Path(f"/proc/self/fd/{file}").readlink().parent in {Path(folder).resolve() for folder in full}:
            raise OSError(errno.ENOSPC, "No space left on device")
        assert size in (1, caches.ROOM)

    monkeypatch.setattr(os, "posix_fallocate", fill)
    Path("shared").mkdir()
    monkeypatch.setattr(caches, "SHARED", str(Path("shared").resolve()))
    monkeypatch.setattr(caches, "notes", [])
    assert cache_home(monkeypatch, "home") == (SPARE if len(full) == 1 else SPARE.replace("tmp", "shared"))
    assert caches.notes[0] == f"{Path('home/.cache').resolve()} cannot be used: No space left on device"
    assert len(caches.notes) == len(full)
    folder = Path("home/.cache/pocl").resolve()
    with pytest.raises(OSError, match="No space left"):
        caches.check_room(folder)


def test_a_cache_of_pocl_that_cannot_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """Found by one on a full disk: no kernel was built, and --doctor found no device."""
    Path("file").touch()
    for folder, left in (("file/kernels", None), ("kernels", "kernels")):
        monkeypatch.setenv("POCL_CACHE_DIR", folder)
        monkeypatch.setattr(caches, "notes", [])
        assert cache_home(monkeypatch, "home") is None
        assert os.environ.get("POCL_CACHE_DIR") == left
        assert caches.notes == ([] if left else ["file/kernels cannot be used: Not a directory"])


def cut(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 3)


@pytest.mark.slow
def test_damaged_caches_are_mended_once(tmp_path: Path) -> None:
    """What a full disk or a crash has cut is told, and made again; it ended every later run with SIGABRT or SIGBUS."""
    cache = tmp_path / "cache"
    environment = {k: v for k, v in os.environ.items() if k != "POCL_CACHE_DIR"} | {"XDG_CACHE_HOME": str(cache)}

    def run(*arguments: str) -> tuple[int, str]:
        command = [sys.executable, "-m", "cltrace", *arguments]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
        return done.returncode, done.stdout + done.stderr

    draw = (SCENE, "-q", "--size=8x6", "-o", "s.png")
    assert run(*draw) == (0, "")
    libraries, programs, databases = ([*cache.rglob(name)] for name in ("render.so", "program.bc", "*.sqlite"))
    if not libraries:
        pytest.skip("no PoCL")
    picture = Path("s.png").read_bytes()
    for damage, paths in [(cut, libraries), (lambda path: path.write_bytes(b""), libraries), (cut, programs)]:
        damage(paths[0])
        told = f"cltrace: {paths[0]} was damaged, and is made again\n"
        assert run(*draw) == (0, told)
        assert run(*draw) == (0, "")
        assert Path("s.png").read_bytes() == picture
    cut(databases[0])
    assert run(*draw) == (0, f"{databases[0]} was damaged, and is made again\n")
    cut(programs[0])
    status, report = run("--doctor", "-d", "cpu")
    assert (status, f"           {programs[0]} was damaged, and is made again\n" in report) == (0, True)


def test_variables_that_others_cannot_read() -> None:
    """Found by `POCL_CACHE_DIR= cltrace ...`: PoCL ended the process with SIGABRT, and pyopencl with a traceback."""
    environment = os.environ | dict.fromkeys(caches.NOT_EMPTY, "")
    line = [sys.executable, "-m", "cltrace", "--list-devices"]
    done = subprocess.run(line, env=environment, capture_output=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.slow
def test_commands_share_an_empty_cache() -> None:
    """Ten at once compile the same kernel, and write it to the same place."""
    environment = {k: v for k, v in os.environ.items() if k != "POCL_CACHE_DIR"} | {"XDG_CACHE_HOME": "cache"}
    line = [sys.executable, "-m", "cltrace", SCENE, "--size", "64x48", "-q", "-o"]
    how: dict[str, Any] = {"env": environment, "stderr": subprocess.PIPE}
    running = [subprocess.Popen([*line, f"{k}.png"], **how) for k in range(10)]
    assert [process.communicate(timeout=300)[1] for process in running] == [b""] * 10
    assert [process.returncode for process in running] == [0] * 10
    subprocess.run([*line, "want.png"], env=environment, check=True, timeout=60)
    assert {Path(f"{k}.png").read_bytes() for k in range(10)} == {Path("want.png").read_bytes()}


def test_a_cache_is_looked_through_again_when_it_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What another process has left meanwhile is found, too."""
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(caches, "notes", [])
    caches.mend_kernels()  # no folder yet
    folder = tmp_path / "cache" / "AB" / ("C" * 37) / "render" / "1-1-1"
    folder.mkdir(parents=True)
    for name in ("one.so", "two.bc", "other.txt"):
        (folder / name).touch()
        (tmp_path / "cache" / f"tempfile_{name}").touch()  # as the driver does
        caches.mend_kernels()
        assert names(str(folder)) == (["other.txt"] if name == "other.txt" else [])
    assert [note.split()[0] for note in caches.notes] == [str(folder / "one.so"), str(folder / "two.bc")]

"""A signal ends a command with its status and without a traceback, whenever it comes."""

from __future__ import annotations

import hashlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import cltrace
from cltrace.base.waiting import aside

SIGNALS = ["SIGINT", "SIGTERM", "SIGHUP", "SIGXCPU"]


def run(script: str, cwd: Path) -> subprocess.CompletedProcess[bytes]:
    env = os.environ | {"PYTHONPATH": str(cwd)}
    return subprocess.run(
        [sys.executable, "-c", script], cwd=cwd, env=env, capture_output=True, timeout=60, check=False
    )


def program(cwd: Path, module: str) -> subprocess.CompletedProcess[bytes]:
    """What becomes of a program whose main() is in this module."""
    (cwd / "a_program.py").write_text(module)
    return run("from cltrace.process.entry import start; start('a_program')", cwd)


@pytest.mark.parametrize("package", ["cltrace", "cltrace.bench"])
def test_what_takes_its_time_is_imported_late(tmp_path: Path, package: str) -> None:
    heavy = {"numpy", "pyopencl", "PIL"}
    done = run(f"import sys, {package}.__main__; print({heavy} & set(sys.modules))", tmp_path)
    assert done.stdout == b"set()\n", done.stderr


def test_only_what_a_name_needs_is_imported(tmp_path: Path) -> None:
    late = "{'pyopencl', 'cltrace.reference'}"
    done = run(f"import sys, cltrace; cltrace.load; print({late} & set(sys.modules))", tmp_path)
    assert done.stdout == b"set()\n", done.stderr
    assert all(getattr(cltrace, name) for name in cltrace.__all__)
    assert set(cltrace.__all__) <= set(dir(cltrace))
    typed = re.findall(r"import (\w+) as \1\n", Path(cltrace.__file__).read_text("utf-8"))
    assert sorted(typed) == cltrace.__all__
    with pytest.raises(AttributeError, match="'cltrace' has no attribute 'lod'"):
        cltrace.lod  # type: ignore[attr-defined]  # noqa: B018


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have no such limit")
@pytest.mark.parametrize("limit", [300_000, 800_000])
def test_too_few_addresses(tmp_path: Path, limit: int) -> None:
    """`ulimit -v`: libraries ended the process, OpenBLAS with the status of a check that failed."""
    line = f"ulimit -v {limit}; exec {sys.executable} -m cltrace none.xml"
    done = subprocess.run(["bash", "-c", line], cwd=tmp_path, capture_output=True, text=True, check=False)
    words = f"not enough memory: ulimit -v is {limit}, and must be 950000 at least"
    assert (done.returncode, done.stderr) == (2, f"cltrace: {words}\n")


IMPORTED = """
import os, signal
os.kill(os.getpid(), signal.NAME)
def main(): return 0
"""
AT_THE_END = """
import atexit, os, signal
atexit.register(os.kill, os.getpid(), signal.NAME)
def main(): return 7
"""
COMMAND = """
import os, signal, time
from cltrace.process.console import command

def main():
    return command("test", body)
"""
# Python drops what is raised there, and prints a traceback, as of the sqlite files of pytools.
DELETED = f"""{COMMAND}
class File:
    def __del__(self):
        os.kill(os.getpid(), signal.NAME)
        time.sleep(0.1)

def body():
    File()
    time.sleep(30)
    return 0
"""
SECOND = f"""{COMMAND}
def body():
    try:
        os.kill(os.getpid(), signal.NAME)
    finally:
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGINT)
        print("cleaned up", flush=True)
    return 0
"""


@pytest.mark.parametrize("name", SIGNALS)
@pytest.mark.parametrize(
    ("text", "status", "out"),
    [(IMPORTED, None, b""), (AT_THE_END, 7, b""), (DELETED, None, b""), (SECOND, None, b"cleaned up\n")],
    ids=["during the imports", "at the end", "while an object is deleted", "after another one"],
)
def test_a_signal_ends_a_program(tmp_path: Path, text: str, status: int | None, out: bytes, name: str) -> None:
    """At once, without a traceback, and a second one does not disturb the first."""
    done = program(tmp_path, text.replace("NAME", name))
    told = b"test: interrupted\n" if name == "SIGINT" and COMMAND in text else b""
    assert (done.returncode, done.stdout, done.stderr) == (status or 128 + getattr(signal, name), out, told)


def test_the_handlers_of_a_caller_are_given_back() -> None:
    from cltrace.process.console import command

    before = [signal.getsignal(getattr(signal, name)) for name in SIGNALS]
    assert command("test", lambda: 5) == 5
    assert [signal.getsignal(getattr(signal, name)) for name in SIGNALS] == before


@pytest.mark.parametrize(
    ("module", "status", "out", "err"),
    [
        # As where there is less memory than the libraries take.
        ("raise ImportError('x.so: failed to map')", 2, "", "a_program: cannot be loaded: x.so: failed to map\n"),
        ("raise MemoryError()", 2, "", "a_program: cannot be loaded: not enough memory\n"),
        # What --help prints is written before it, and a fault of the program keeps its traceback.
        ("def main():\n    print('help')\n    raise SystemExit(0)\n", 0, "help\n", ""),
        ("def main():\n    return 1 / 0\n", 1, "", "ZeroDivisionError: division by zero\n"),
    ],
)
def test_the_end_of_a_program(tmp_path: Path, module: str, status: int, out: str, err: str) -> None:
    done = program(tmp_path, module)
    assert (done.returncode, done.stdout.decode()) == (status, out)
    assert done.stderr.decode().endswith(err)


def test_a_signal_is_heard_while_a_driver_compiles() -> None:
    """It was heard when the driver came back, which took up to 14 seconds."""
    ended = threading.Event()

    def compile_() -> None:
        hashlib.pbkdf2_hmac("sha256", b"", b"", 5_000_000)  # as busy, and as deaf
        ended.set()

    # A shell starts what is in the background with this signal ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        threading.Timer(0.1, os.kill, [os.getpid(), signal.SIGINT]).start()
        with pytest.raises(KeyboardInterrupt):
            aside(compile_)
    finally:
        signal.signal(signal.SIGINT, before)
    assert not ended.is_set()
    assert aside(lambda: 3) == 3
    with pytest.raises(ZeroDivisionError):
        aside(lambda: 1 // 0)


HEAD = """<scene output_file="p.png"><background_color r="0.2" g="0.3" b="0.5"/>
<camera><position x="0" y="0" z="6"/><lookat x="0" y="0" z="0"/><up x="0" y="1" z="0"/><horizontal_fov angle="25"/>
<resolution horizontal="640" vertical="360"/><max_bounces n="20"/></camera>
<lights><ambient_light><color r="1" g="1" b="1"/></ambient_light>
<point_light><color r="1" g="1" b="1"/><position x="3" y="4" z="5"/></point_light></lights><surfaces>"""
MATERIAL = """<material_solid><color r="0.8" g="0.7" b="0.6"/><phong ka="0.1" kd="0.5" ks="0.3" exponent="20"/>
<reflectance r="{}"/><transmittance t="{}"/><refraction iof="1.5"/></material_solid>"""


def nested() -> str:
    """15 spheres of glass, each in the next one: of each pixel a million rays."""
    ball = f'<position x="0" y="0" z="0"/>{MATERIAL.format(0.4, 0.5)}</sphere>'
    balls = "".join(f'<sphere radius="{2 - 0.1 * i:.1f}">{ball}' for i in range(15))
    return f"{HEAD}{balls}</surfaces></scene>"


# Either signal ends all of them in the same way, so that each is sent to some.
SLOW = [
    (["-o", "p.png"], "max_bounces, which is 20", "SIGINT"),
    (["--orbit", "9", "-o", "m%d.png"], "max_bounces, which is 20", "SIGTERM"),
    (["--explain", "320,180"], "--explain is slow: lower max_bounces, which is 20", "SIGINT"),
    pytest.param(["-o", "p.png", "--antialias"], "samples, which is 32", "SIGTERM", marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("options", "words", "name"), SLOW)
def test_what_is_slow_is_told_and_can_be_stopped(tmp_path: Path, options: list[str], words: str, name: str) -> None:
    """Each of these did not hear a signal for 6 seconds and more, most of them for minutes."""
    (tmp_path / "s.xml").write_text(nested())
    (tmp_path / "p.png").write_bytes(b"before")
    files = sorted(tmp_path.iterdir())
    # A shell starts what is in the background with SIGINT ignored, which a child would inherit.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    command = subprocess.Popen(
        [sys.executable, "-m", "cltrace", "s.xml", *options], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    signal.signal(signal.SIGINT, before)
    with command:
        assert command.stderr is not None
        told = command.stderr.readline()
        sent = time.monotonic()
        command.send_signal(getattr(signal, name))
        rest = command.stderr.read()
        assert command.wait() == 128 + getattr(signal, name)
        assert time.monotonic() - sent < 5
    assert words in told
    assert rest == ("cltrace: interrupted\n" if name == "SIGINT" else "")
    assert sorted(tmp_path.iterdir()) == files
    assert (tmp_path / "p.png").read_bytes() == b"before"


@pytest.mark.slow
@pytest.mark.parametrize("options", [[], ["--antialias"]])
def test_what_would_take_hours_is_refused(tmp_path: Path, options: list[str]) -> None:
    (tmp_path / "s.xml").write_text(nested())
    line = [sys.executable, "-m", "cltrace", "s.xml", "-q", "--limit", "seconds=1", *options]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    hint = "--limit seconds=N or CLTRACE_LIMITS allows more"
    told = rf"cltrace: drawing takes longer than 1 s; lower max_bounces, which is 20.*; {hint}"
    assert done.returncode == 2
    assert re.fullmatch(told, done.stderr.splitlines()[-1])  # before that it says that it is slow
    assert not list(tmp_path.glob("*.png*"))

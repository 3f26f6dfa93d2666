"""The server: who may come in, what it sends, and how it ends. Each test is of the command, as users start it."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import closing, contextmanager
from http.client import HTTPConnection
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import pytest

import cltrace
from cltrace import cli

aiohttp = pytest.importorskip("aiohttp", reason="the viewer needs the extra view")
FILE = Path(__file__).parents[2] / "scenes" / "minimal.xml"


class Running(NamedTuple):
    """A viewer that runs."""

    address: str

    @property
    def host(self) -> str:
        return urlsplit(self.address).netloc

    def status(self, path: str, method: str = "GET", **headers: str) -> int:
        """What a request gets."""
        with closing(HTTPConnection("127.0.0.1", urlsplit(self.address).port or 0)) as connection:
            connection.request(method, path, headers=headers)
            return connection.getresponse().status


@contextmanager
def viewer(spec: str, *arguments: str, cwd: Path | None = None) -> Iterator[Running]:
    """The command, which is interrupted at the end."""
    line = [sys.executable, "-m", "cltrace", "view", *arguments, "-d", spec]
    env = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    with subprocess.Popen(line, stderr=subprocess.PIPE, text=True, cwd=cwd, env=env) as process:
        guard = threading.Timer(300, process.kill)
        guard.start()
        try:
            first = process.stderr.readline()
            match = re.search(r" is at (http://127\.0\.0\.1:\d+/[\w-]{22}/) \(Ctrl-C ends it\)", first)
            assert match, first
            assert "ssh -L" in process.stderr.readline()
            yield Running(match[1])
        finally:
            guard.cancel()
            process.send_signal(signal.SIGINT)
            status = process.wait(30)
    assert status == 130


@pytest.fixture(scope="module")
def running(spec: str) -> Iterator[Running]:
    with viewer(spec, str(FILE)) as found:
        yield found


def test_the_page(running: Running) -> None:
    path = urlsplit(running.address).path
    for name in ("", "index.html", "socket.js", "viewer.js", "explanation.js", "viewer.css"):
        assert running.status(path + name, Host=running.host) == 200
    assert running.status(path, Host=running.host.replace("127.0.0.1", "localhost")) == 200
    assert running.status(path, Host=running.host, Origin=f"http://{running.host}") == 200


def test_nothing_else_is_there(running: Running) -> None:
    path = urlsplit(running.address).path
    inside = ("server.py", "../server.py", "%2e%2e/server.py", "../page/viewer.js", "viewer.js/", "__init__.py")
    outside = ("/", "/viewer.js", path[:-2] + "/", f"{path[:-2]}-/viewer.js", "/%C3%A4/")
    for target in (*outside, *(path + name for name in inside)):
        assert running.status(target, Host=running.host) == 404, target
    assert running.status(path, "POST", Host=running.host) == 404


def test_other_hosts_and_origins_may_not(running: Running) -> None:
    path, host = urlsplit(running.address).path, running.host
    port = urlsplit(running.address).port
    for other in (f"evil.example:{port}", "evil.example", "127.0.0.1", f"127.0.0.1:{port}.evil.example", ""):
        assert running.status(path, Host=other) == 403
    for other in ("http://evil.example", "null", f"https://{host}", f"http://localhost:{port}", "http://127.0.0.1"):
        assert running.status(path, Host=host, Origin=other) == 403


def run(running: Running, body: Callable[[Any], Awaitable[None]], origin: str | None = "", path: str = "socket") -> int:
    """Talks through the websocket. Returns 101, or what it gets instead of one."""

    async def talk() -> int:
        headers = {} if origin is None else {"Origin": origin or f"http://{running.host}"}
        async with aiohttp.ClientSession() as session:
            try:
                async with session.ws_connect(running.address + path, headers=headers, max_msg_size=0) as line:
                    await body(line)
            except aiohttp.WSServerHandshakeError as error:
                return int(error.status)
        return 101

    return asyncio.run(talk())


async def nothing(line: Any) -> None:
    pass


def test_the_websocket_asks_who_comes(running: Running) -> None:
    assert run(running, nothing) == 101
    assert run(running, nothing, origin=None) == 403
    assert run(running, nothing, origin="http://evil.example") == 403
    assert run(running, nothing, path="../wrong-token/socket") == 404


async def until(line: Any, *kinds: str) -> tuple[dict[str, Any], bytes]:
    """The next message of these kinds; pictures before it are shown."""
    while True:
        head, _, data = (await line.receive_bytes(timeout=60)).partition(b"\n")
        message = json.loads(head)
        if data and message["kind"] not in ("mine", "difference"):
            await line.send_json({"kind": "shown", "x": message["number"]})
        if message["kind"] in kinds:
            return message, data


def test_pictures_come_and_are_the_commands(running: Running, spec: str, tmp_path: Path) -> None:
    async def body(line: Any) -> None:
        for kind in ("exact", "smooth"):
            file = tmp_path / f"{kind}.png"
            cltrace.render(cltrace.load(FILE), spec, antialias=kind == "smooth").save(file)
            _, data = await until(line, kind)
            assert data == file.read_bytes()
        await line.send_json({"kind": "explain", "x": 240, "y": 180})
        message, _ = await until(line, "explanation")
        assert "sphere 0" in message["text"]

    assert run(running, body) == 101


def test_pictures_wait_for_the_one_before(running: Running) -> None:
    """Until a picture is on the screen no other one is sent, and then it is one that counts all events."""

    async def body(line: Any) -> None:
        await until(line, "smooth")
        await line.send_json({"kind": "orbit", "x": 0.01})
        first = json.loads((await line.receive_bytes()).partition(b"\n")[0])
        for _ in range(50):
            await line.send_json({"kind": "orbit", "x": 0.01})
        with pytest.raises(asyncio.TimeoutError):
            await line.receive_bytes(timeout=0.5)
        await line.send_json({"kind": "shown", "x": first["number"]})
        second, _ = await until(line, "moving")
        assert (first["number"], second["number"]) == (1, 51)

    assert run(running, body) == 101


@pytest.mark.slow
def test_an_error_is_no_picture(spec: str, tmp_path: Path) -> None:
    """No page says that it is on the screen, and pictures come after it all the same."""
    light = '<parallel_light><color r="0" g="0" b="0"/><direction x="0" y="0" z="-1"/></parallel_light>'
    (tmp_path / "s.xml").write_text(re.sub("<lights>", "<lights>" + 33 * light, FILE.read_text()))

    async def body(line: Any) -> None:
        await until(line, "smooth")
        await line.send_json({"kind": "show", "name": "lit"})
        message, _ = await until(line, "error")
        assert message["text"].startswith("lit: must be of at most 32 lights")
        await line.send_json({"kind": "show", "name": "color"})
        await until(line, "exact")
        await line.send_json({"kind": "explain", "x": 240, "y": 180})
        await until(line, "outline")
        await until(line, "smooth")

    with viewer(spec, "s.xml", cwd=tmp_path) as running:
        assert run(running, body) == 101


@pytest.mark.parametrize(
    "text",
    ["no JSON", "", "[]", "1", '{"x": 1}', '{"kind": "fall"}', '{"kind": ["orbit"]}', "[" * 500]
    + ['{"kind": "show", "name": "%s"}' % ("a" * 5000)]
    + ['{"kind": "orbit", ' + rest for rest in ('"z": 1}', '"x": "1"}', '"x": NaN}', '"y": 1e99}', '"name": 1}')],
)
def test_who_says_what_no_page_says_has_to_go(running: Running, text: str) -> None:
    async def body(line: Any) -> None:
        await line.send_str(text)
        async for _ in line:
            pass
        assert line.close_code in (aiohttp.WSCloseCode.POLICY_VIOLATION, aiohttp.WSCloseCode.MESSAGE_TOO_BIG)

    assert run(running, body) == 101
    test_the_page(running)


@pytest.mark.skipif(sys.platform != "linux", reason="the variables are those of Linux")
def test_a_browser_is_opened(spec: str, tmp_path: Path) -> None:
    """Where there is a display; $BROWSER says which."""
    script, seen = tmp_path / "browser", tmp_path / "seen"
    script.write_text(f'#!/bin/sh\necho "$1" > {seen}.part && mv {seen}.part {seen}\n')
    script.chmod(0o755)
    line = [sys.executable, "-m", "cltrace", "view", str(FILE), "-d", spec, "-q"]
    env = os.environ | {"DISPLAY": ":0", "BROWSER": str(script)}
    with subprocess.Popen(line, stderr=subprocess.PIPE, text=True, env=env) as process:
        address = re.search(r"http\S+/", process.stderr.readline())
        for _ in range(600):
            if seen.exists():
                break
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 130
    assert seen.read_text() == f"{address[0]}\n"


def test_a_program(spec: str) -> None:
    """Shows its scene until Ctrl-C, and goes on after it. What makes no sense is said before."""
    scene = f"import cltrace; scene = cltrace.load({str(FILE)!r}); "
    line = [sys.executable, "-u", "-c", f"{scene}cltrace.view(scene, {spec!r}, samples=64); print('goes on')"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as process:
        running = Running(re.search(r"http\S+/", process.stdout.readline())[0])
        assert running.status(urlsplit(running.address).path, Host=running.host) == 200

        async def open_page(line: Any) -> None:
            await until(line, "exact")
            process.send_signal(signal.SIGINT)
            async with asyncio.timeout(15):  # and not when the page has not answered for 30
                async for _ in line:
                    pass

        assert run(running, open_page) == 101
        assert process.communicate(timeout=15)[0].endswith("goes on\n")
    assert process.returncode == 0
    with pytest.raises(ValueError, match=r"^samples: must be "):
        cltrace.view(cltrace.load(FILE), spec, samples=5)


def test_a_port_in_use_is_another_port(running: Running, spec: str) -> None:
    with viewer(spec, str(FILE)) as other:
        assert running.host != other.host
        for each in (running, other):
            assert each.status(urlsplit(each.address).path, Host=each.host) == 200


def test_files_are_followed(spec: str, tmp_path: Path) -> None:
    pytest.importorskip("watchfiles")
    scene, text = tmp_path / "s.xml", FILE.read_text()
    scene.write_text(text)
    with viewer(spec, "s.xml", "--watch", cwd=tmp_path) as found:

        async def body(line: Any) -> None:
            _, before = await until(line, "smooth")
            scene.write_text(text.replace('<sphere radius="', '<sphere radius="-'))
            message, _ = await until(line, "fault")
            while not message["text"]:
                message, _ = await until(line, "fault")
            assert re.match(r"s\.xml:\d+: sphere: radius must be > 0", message["text"])
            scene.write_text(re.sub(r'background_color r="[^"]*"', 'background_color r="0.9"', text))
            message, _ = await until(line, "fault")
            assert message["text"] == ""
            _, after = await until(line, "smooth")
            assert after != before

        assert run(found, body) == 101


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-o", "a.png"], "--view takes no -o\n"),
        (["--crop", "0,0,9,9"], "--view takes no --crop\n"),
        ([str(FILE)], "--view is for one picture, of one scene\n"),
        (["--fps", "9"], "--view takes no --fps\n"),
        (["--orbit", "9", "--frames", "9"], "--frames: there are only 9 frames"),
        (["--orbit", "9", "-o", "a.tiff"], "must end in"),
        ([], "pip install 'cltrace[view]'"),
    ],
)
def test_what_does_not_go_together(
    arguments: list[str], words: str, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    monkeypatch.delitem(sys.modules, "cltrace.viewer.server", raising=False)
    assert cli.main(["view", str(FILE), *arguments]) == 2
    assert words in capsys.readouterr().err


def test_the_command_does_not_import_it(tmp_path: Path) -> None:
    """Without --view, neither the viewer nor its server is there."""
    line = [sys.executable, "-X", "importtime", "-m", "cltrace", str(FILE), "-q", "-o", str(tmp_path / "a.png")]
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    names = set(re.findall(r"\| +(\S+)$", done.stderr, re.MULTILINE))
    assert "cltrace.renderers.renderer" in names
    assert not [name for name in names if name.startswith(("aiohttp", "asyncio", "cltrace.viewer"))]

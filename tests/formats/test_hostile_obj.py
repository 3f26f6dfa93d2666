"""Meshes and textures from strangers: whatever is in their files, there is a picture or one clear error, and soon."""

from __future__ import annotations

import contextlib
import io
import os
import socket
import struct
import subprocess
import sys
import zlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from cltrace import cli
from cltrace.base.errors import SceneError
from cltrace.formats.reader import read
from cltrace.scene import Scene

GOOD = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n"
CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"

SCENE = """\
<scene output_file="out.png">
  <background_color r="0" g="0" b="0"/>
  <camera>
    <position x="0" y="0" z="4"/><lookat x="0" y="0" z="0"/><up x="0" y="1" z="0"/>
    <horizontal_fov angle="30"/><resolution horizontal="8" vertical="6"/><max_bounces n="1"/>
  </camera>
  <lights><ambient_light><color r="1" g="1" b="1"/></ambient_light></lights>
  <surfaces>
{surfaces}
  </surfaces>
</scene>
"""
FINISH = '<phong ka="1" kd="1" ks="0" exponent="1"/><reflectance r="0"/><transmittance t="0"/><refraction iof="0"/>'
LINE = 9  # of the first surface
TEXTURE = f"scene.xml:{LINE}: material_textured texture: name "  # begins what is wrong with its texture


def mesh_of(name: str = "room.obj", texture: str | None = None) -> str:
    """A line of a scene: a mesh, white or with a texture."""
    paint = f'<texture name="{texture}"/>' if texture is not None else '<color r="1" g="1" b="1"/>'
    kind = "solid" if texture is None else "textured"
    return f'<mesh name="{name}"><material_{kind}>{paint}{FINISH}</material_{kind}></mesh>'


@pytest.fixture(autouse=True)
def _in_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scene").mkdir()
    monkeypatch.chdir(tmp_path / "scene")


def write_scene(*surfaces: str) -> None:
    Path("scene.xml").write_text(SCENE.format(surfaces="\n".join(surfaces or (mesh_of(),))))


def scene_of(obj: bytes | str | None = None, *surfaces: str) -> Scene:
    """The scene that is read; a fault is an error, and so is a warning of Python or Pillow."""
    if obj is not None:
        Path("room.obj").write_bytes(obj if isinstance(obj, bytes) else obj.encode())
    write_scene(*surfaces)
    return read("scene.xml")[0]


def faults_of(obj: bytes | str | None = None, *surfaces: str) -> list[str]:
    """What is wrong with a scene: lines that a terminal takes for text, of a length that fits one, not too many."""
    with pytest.raises(SceneError) as caught:
        scene_of(obj, *surfaces)
    lines = str(caught.value).split("\n")
    assert 0 < len(lines) <= 110
    for line in lines:
        assert line.isprintable()
        assert len(line) < 400, line
        assert "Traceback" not in line
        assert str(Path.cwd()) not in line, "the machine's own path"
    return lines


def refused(obj: bytes | str | None = None, *surfaces: str) -> list[str]:
    """The same of the command, which ends with 2, says one line for each fault, and writes nothing."""
    lines = faults_of(obj, *surfaces)
    before = sorted(os.listdir())  # noqa: PTH208
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = cli.main(["scene.xml"])
    assert status == 2
    assert out.getvalue() == ""
    said = err.getvalue().splitlines()
    assert [line.removeprefix("cltrace: ") for line in said] == lines
    assert sorted(os.listdir()) == before  # noqa: PTH208
    return lines


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]) << 20,) * 2)
from cltrace.base.errors import SceneError
from cltrace.formats.reader import read
status = 0
for name in sys.argv[2:]:
    try:
        scene, _ = read(name)
        print(sum(len(mesh.geometry.faces) for mesh in scene.meshes), [t.shape for t in scene.textures])
    except SceneError as error:
        print(error)
        status = 2
sys.exit(status)
"""


def limited(megabytes: int = 1500, seconds: float = 30, scenes: Iterable[str] = ("scene.xml",)) -> tuple[int, str]:
    """Status and words of a process that reads scenes with so much address space and time."""
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(megabytes), *scenes],
        env=env, capture_output=True, text=True, timeout=seconds, check=False)  # fmt: skip
    assert done.stderr == ""
    assert len(done.stdout) < 10_000
    return done.returncode, done.stdout


# --- words of OBJ files

V1 = "v 0 0 0\n"
BAD_LINES = [
    # (what precedes, the line with the fault)
    *((V1, f"v {rest}") for rest in (
        "", "1", "1 2", "1 2 3 4 5", "1 2 3 4 5 6 7", "1 2 x", "x y z", "1 2 3abc", "1,5 2 3", "1 2 3\0", "1\x002 3 4",
        "nan 0 0", "0 inf 0", "0 0 -inf", "NaN 0 0", "Infinity 0 0", "1e400 0 0", "-1e400 0 0", "1e39 0 0", "0 0 1e309",
        "0x10 0 0", "0x1p3 0 0", "1_000 0 0", "\u0661 0 0", "\u00b2 0 0", "1e 0 0", "1e+ 0 0", "e5 0 0", ". 0 0",
        "- 0 0",
        "--1 0 0", "+-1 0 0", "1.2.3 0 0", "1d5 0 0", "1f 0 0", "1 2 3j", "1/2 0 0", "(1 2 3)", "'1' 2 3", "1 2 3;",
        "\u2212 1 2", "\u22121 2 3", "1\u00a02 3", "true 0 0", "None 0 0", "1" + "0" * 400 + " 0 0",
    )),
    *((CORNERS, f"f {rest}") for rest in (
        "", "1", "1 2", "1 2 0", "0 1 2", "1 2 4", "1 2 -4", "1 2 99999999999", "1 2 -99999999999",
        "1 2 " + "9" * 40, "1 2 " + "9" * 5000, "1 2 2147483648", "1 2 4294967297", "1 2 18446744073709551617",
        "1 2 1.0", "1 2 1e0", "1 2 3.5", "1 2 x", "a b c", "1 2 3x", "1 2 nan", "1 2 inf", "1 2 0x1", "1 2 1_0", 
        "1 2 \u0663",
        "1,2,3", "1 2 3;", "1 2 --1", "1 2 -", "1 2 +", "1 2 -0", "1 2 3\0",
        "/ / /", "/1 /2 /3", "//1 //2 //3", "1/1 2/1 3/1", "1//1 2//1 3//1", "1/0 2/0 3/0", "1/1/1 2/1/1 3/1/1",
        "1/1/1/1 2/1/1/1 3/1/1/1", "1///1 2///1 3///1", "1\\2\\3", "1|2|3", "1 2 3 4", "1 2 3 0", "1 2 3 1 2 3 9",
    )),
    *((CORNERS + "vt 0 0\nvn 0 0 1\n", f"f {rest}") for rest in (
        "1/2 2/1 3/1", "1|1 2|1 3|1",
        "1/1 2/1 3/-2", "1//2 2//1 3//1", "1/1/2 2/1/1 3/1/1", "1/x 2/1 3/1", "1//x 2//1 3//1",
    )),
    *(("", f"vt {rest}") for rest in ("", "x", "0 nan", "0 inf", "0 1e400", "0x1 0", "0 0 0 0", "0 0 x")),
    *(("", f"vn {rest}") for rest in ("", "0", "0 0", "0 0 x", "0 0 nan", "0 inf 0", "0 0 1 1", "1e400 0 0")),
    ("", "f 1 2 3"), ("", "f -1 -2 -3"), (V1, "f -1 -1 -2"), (V1, "f 1 1 2"),
]  # fmt: skip


@pytest.mark.parametrize("before", ["", "\r\n\r\n# one\n", "v 9 9 9 \\\n\n\n"], ids=["plain", "lines", "continued"])
def test_every_bad_line_is_named(before: str) -> None:
    """By the number of the line, in a message of its own, wherever it stands."""
    wrong = []
    for preamble, line in BAD_LINES:
        if before.startswith("v") and preamble == "" and line.startswith("f"):
            continue  # there is a vertex then
        if before.startswith("v") and line in ("f 1 2 4", "f 1 2 -4", "f 1 2 3 4", "f -1 -1 -2", "f 1 1 2"):
            continue
        text = before + preamble + line + "\n"
        number = (before + preamble).count("\n") + 1
        try:
            lines = faults_of(text.encode())
        except BaseException as error:
            wrong.append((line[:40], f"{type(error).__name__}: {error}"[:200]))
            continue
        if not any(f"room.obj:{number}: " in said for said in lines):
            wrong.append((line[:40], lines[0][:200]))
    assert not wrong, "\n".join(map(str, wrong))


def test_comments_and_names_may_be_in_any_encoding() -> None:
    for bytes_ in ("# \xe4\xf6\n".encode("latin-1"), b"o \xff\xfe\x80\n", "g \u732b\n".encode(), b"usemtl \xc3\x28\n"):
        shape = scene_of(bytes_ + CORNERS.encode() + b"f 1 2 3\n" + bytes_).meshes[0].geometry
        assert len(shape.faces) == 1
    for encoding in ("utf-16", "utf-32"):
        assert "room.obj:1: " in refused((CORNERS + "f 1 2 3\n").encode(encoding))[0]


# --- huge and endless


def test_a_face_of_a_hundred_thousand_corners() -> None:
    corners = np.arange(100_000) % 3 + 1
    shape = scene_of(CORNERS + "f " + " ".join(map(str, corners.tolist())) + "\n").meshes[0].geometry
    assert shape.faces.shape == (99_998, 3)
    assert shape.faces[-1].tolist() == [0, int(corners[-2]) - 1, int(corners[-1]) - 1]


@pytest.mark.stress
def test_a_face_of_fifty_megabytes() -> None:
    with Path("room.obj").open("wb") as file:
        file.write(CORNERS.encode() + b"f " + b"1 2 3 " * (50 * 2**20 // 6) + b"\n")
    write_scene()
    status, said = limited(6000, 120)
    assert status in (0, 2), said
    assert "room.obj:4: " in said if status else said.startswith(str(50 * 2**20 // 6 * 3 - 2))


def test_a_line_of_megabytes_is_not_repeated_in_its_message() -> None:
    for line in (
        "v " + "9" * 2_000_000,
        "f 1 2 " + "x" * 2_000_000,
        "q" * 2_000_000 + " 1",
        "f " + "1 " * 400_000 + "9",
    ):
        Path("room.obj").write_text(CORNERS + line + "\n" + "f 1 2 3\n")
        write_scene()
        status, said = limited()
        assert (status == 2 and "room.obj:4: " in said) or line.startswith("q")


def test_files_that_claim_to_be_huge() -> None:
    """Holes on the disk: 3 GB of zeros, with nothing and with something in front of them."""
    for start in (b"", GOOD):
        with Path("room.obj").open("wb") as file:
            file.write(start)
            file.truncate(3 * 2**30)
        write_scene()
        status, said = limited()
        assert status == 2
        assert "room.obj" in said
        assert len(said.splitlines()) == 1
    with Path("room.obj").open("wb") as file:
        file.write(GOOD)
        file.truncate(2**25)
    status, said = limited()
    assert status == 2
    assert "room.obj:9: " in said


def test_many_short_lines_take_little_memory() -> None:
    for text in ("\n" * 5_000_000, "#\n" * 1_000_000, "v 0 0 0\n" * 300_000, "g\n" * 500_000):
        Path("room.obj").write_text(text + "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -3\n")
        write_scene()
        assert limited()[0] == 0


def test_alternating_lines_take_little_time() -> None:
    """No two lines of a kind in a row; every face has another form; every number needs care."""
    few = "".join(f"v {k} 0 0\nvt 0 {k}\nvn 0 {k} 1\ng {k}\n#\n" for k in range(1, 60_000))
    forms = ("{0} 2 3", "{0}/1 2/1 3/1", "{0}//1 2//1 3//1", "-1 -2 -3", "1/1/1 2/2/2 3/3/3 {0}/4/4")
    faces = "".join("f " + forms[k % 5].format(k) + "\n" for k in range(4, 60_000))
    Path("room.obj").write_text(few + faces)
    write_scene()
    status, said = limited()
    assert status == 0, said
    assert said.split()[0] == str(59_996 + len(range(8, 60_000, 5)) + (4 % 5 == 4))


# --- names and places

OUTSIDE = [
    "../outside.obj", "sub/../../outside.obj", "./../outside.obj", "..", "../", "../scene/../outside.obj",
    "/etc/passwd",
    "//etc/passwd", "/dev/zero", "/proc/self/environ", "/", "sub/../../scene/../outside.obj", "../scene/room.obj",
]  # fmt: skip
NOWHERE = [
    "none.obj", ".", "./", "sub", "sub/", "room.obj/x", "sub/none.obj", "none/room.obj", "~/outside.obj",
    "~root/x.obj", "$HOME/x.obj", "%2e%2e/outside.obj", "file:///etc/passwd", "http://localhost/x.obj", "C:/x.obj", "-",
    "x" * 300, "x/" * 3000 + "x", "room.obj ", " room.obj", "\u00e4.obj", "a&#10;b.obj", "a&#9;b.obj", "\u202ejbo.obj",
    "room.obj&#x85;", "CON", "room.obj:stream", "*.obj", "|ls", "ROOM.OBJ",
]  # fmt: skip


@pytest.mark.parametrize("kind", ["mesh", "texture"])
def test_names_of_what_is_outside_or_nowhere(kind: str) -> None:
    """Neither is opened. Each is a fault of the scene's line, where the name is quoted."""
    Path("../outside.obj").write_bytes(GOOD)
    Path("room.obj").write_bytes(GOOD)
    Path("sub").mkdir()
    for name in [*OUTSIDE, *NOWHERE, "", "\\\\host\\share\\x.obj", "..\\outside.obj", "C:\\x.obj"]:
        said = refused(None, "", mesh_of(name) if kind == "mesh" else mesh_of("room.obj", name))
        assert len(said) == 1, name
        assert said[0].startswith(f"scene.xml:{LINE + 1}: "), (name, said)
        assert f"{kind}: name " in said[0]
        assert "root:" not in said[0]


@pytest.mark.parametrize("texture", [False, True])
def test_files_that_are_no_files(texture: bool) -> None:
    """Pipes, sockets, devices and folders are never opened: nothing waits for what does not come."""
    Path("room.obj").write_bytes(GOOD)
    os.mkfifo("pipe")
    Path("folder").mkdir()
    names = ["pipe", "folder", "link"]
    Path("link").symlink_to("pipe")
    server = socket.socket(socket.AF_UNIX)
    server.bind("socket")
    names.append("socket")
    with contextlib.suppress(OSError):
        os.mknod("zero", 0o20666, os.makedev(1, 5))
        names.append("zero")
    for name in names:
        write_scene(mesh_of("room.obj", name) if texture else mesh_of(name))
        status, said = limited(seconds=20)
        assert status == 2
        assert said.startswith(f"scene.xml:{LINE}: "), said
        assert len(said.splitlines()) == 1
    server.close()


# --- textures


def png(width: int, height: int, depth: int, color: int, rows: bytes, *chunks: bytes) -> bytes:
    """A PNG of these scan lines, each of which begins with its filter."""
    header = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)
    parts = [chunk(b"IHDR", header), *chunks, chunk(b"IDAT", zlib.compress(rows, 9)), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def test_bombs() -> None:
    """A few bytes that claim, or unfold to, gigabytes. What is harmless may be read. One process reads all of them."""
    bombs = {
        "20000x10000": png(20_000, 10_000, 8, 2, b""),
        "65535x65535": png(65_535, 65_535, 1, 0, b""),
        "2^31 - 1": png(2**31 - 1, 2**31 - 1, 8, 6, b""),
        "2^32 - 1": png(2**32 - 1, 2**32 - 1, 8, 2, b""),
        "wide": png(2**31 - 1, 1, 8, 0, b""),
        "no width": png(0, 5, 8, 2, b""),
        "no height": png(5, 0, 8, 2, b""),
        "no pixels": png(0, 0, 8, 2, b""),
        "of zeros": png(20_000, 10_000, 1, 0, bytes(2501 * 10_000)),
        "text": png(1, 1, 8, 2, bytes(4), chunk(b"zTXt", b"x\0\0" + zlib.compress(bytes(2**27), 9))),
        "much text": png(1, 1, 8, 2, bytes(4), *[chunk(b"zTXt", b"x\0\0" + zlib.compress(bytes(2**20 - 1), 9))] * 200),
        "profile": png(1, 1, 8, 2, bytes(4), chunk(b"iCCP", b"x\0\0" + zlib.compress(bytes(2**27), 9))),
        "chunk": b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 2**31 - 1) + b"IHDR",
        "jpeg": b"\xff\xd8\xff\xc0\x00\x11\x08\xff\xdc\xff\xdc\x03\x01\x22\x00\x02\x11\x01\x03\x11\x01",
        "depth": png(5, 5, 7, 2, bytes(80)),
        "kind": png(5, 5, 8, 5, bytes(80)),
        "no palette": png(5, 5, 8, 3, bytes(30)),
        "filter": png(5, 5, 8, 2, b"\x09" * 80),
    }
    Path("room.obj").write_bytes(GOOD)
    for k, data in enumerate(bombs.values()):
        Path(f"{k}.png").write_bytes(data)
        write_scene(mesh_of("room.obj", f"{k}.png"))
        Path("scene.xml").rename(f"{k}.xml")
    status, said = limited(1000, scenes=[f"{k}.xml" for k in range(len(bombs))])
    assert status == 2
    for k, (name, line) in enumerate(zip(bombs, said.splitlines(), strict=True)):
        harmless = name in ("text", "much text", "profile", "no palette", "filter") and line.startswith("1 ")
        assert harmless or line.startswith(TEXTURE.replace("scene", str(k))), (name, line)

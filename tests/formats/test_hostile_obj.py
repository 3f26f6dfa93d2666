"""Meshes and textures from strangers: whatever is in their files, there is a picture or one clear error, and soon."""

from __future__ import annotations

import contextlib
import io
import os
import random
import socket
import struct
import subprocess
import sys
import warnings
import zlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

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


def test_a_bad_line_in_the_command() -> None:
    said = refused(CORNERS + "f 1 2 3\nf 1 2 9\nv 1 2 oops\n")
    assert len(said) == 2
    assert "room.obj:5: " in said[0]
    assert "room.obj:6: " in said[1]


@pytest.mark.parametrize(
    "number",
    ["+1", "1.", ".5", "-.5", "-.5e-3", "1E5", "1e+5", "-0", "00012", "1e-30", "0.1", "1" * 30, "3.4e38", "-0.0"],
)
def test_every_decimal_number_is_read(number: str) -> None:
    scene = scene_of(f"v {number} 0 0\nv 0 {number} {number}\nv 1 1 1\nf 1 2 3\n")
    assert scene.meshes[0].vertices[0, 0] == float(number)
    assert scene.meshes[0].vertices[1, 2] == float(number)


def test_doubles_are_rounded_once() -> None:
    rng = random.Random(0)
    texts = ["".join(rng.choices("0123456789", k=25)) for _ in range(300)]
    numbers = (
        [f"0.{text}" for text in texts] + [f"{t[:3]}.{t[3:]}" for t in texts] + [f"{t[0]}.{t[1:]}e-7" for t in texts]
    )
    numbers += [
        "9007199254740993",
        "0.1000000000000000055511151231257827",
        "1.7976931348623157e-30",
        "2.2250738585072011e-7",
    ]
    text = "".join(f"v {x} 0 0\n" for x in numbers) + "f 1 2 3\n"
    assert scene_of(text).meshes[0].vertices[:, 0].tolist() == [float(x) for x in numbers]


SAME_TRIANGLE = [
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
    "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n",
    "\ufeffv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "v  0   0\t0 \nv\t1 0 0\t\n  v 0 1 0\n\tf  1  2  3  \n",
    "# f 9 9 9\nv 0 0 0 # one\nv 1 0 0# two\nv 0 1 0 #\nf 1 2 3 # 4\n#",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 -2 3\n",
    "v 0 0 \\\n0\nv 1 0 0\nv 0 \\\n1 \\\n 0\nf 1 \\\n 2 3\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 \\",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 \\\n",
    "v 0 0 \\\r\n0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n",
    "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n",  # indices count in the whole file
    "v 0 0 0 1\nv 1 0 0 1.0\nv 0 1 0 1\nf 1 2 3\n",
    "v 0 0 0 1 1 1\nv 1 0 0 0.5 0 1\nv 0 1 0 1 0 0\nf 1 2 3\n",
    'mtllib a b c.mtl\no f 1 2 3\ng v 1 2 3\ns off\nusemtl "x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n',
    "v 0 0 0\nv 1 0 0\nv 0 1 0\n\n\n\n \n\t\nf 1 2 3\n\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\np 1\nf 1 2 3\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 001 +2 3\n",
]


@pytest.mark.parametrize("text", SAME_TRIANGLE)
def test_other_ways_to_write_a_triangle(text: str) -> None:
    if text.endswith("f 001 +2 3\n"):
        with contextlib.suppress(SceneError):  # A sign may be refused, but not misread.
            assert scene_of(text).meshes[0].geometry.faces.tolist() == [[0, 1, 2]]
        return
    shape = scene_of(text).meshes[0].geometry
    assert shape.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert shape.faces.tolist() == [[0, 1, 2]]
    assert shape.normal_of.tolist() == [[-1, -1, -1]]
    assert shape.uv_of.tolist() == [[-1, -1, -1]]


def test_comments_and_names_may_be_in_any_encoding() -> None:
    for bytes_ in ("# \xe4\xf6\n".encode("latin-1"), b"o \xff\xfe\x80\n", "g \u732b\n".encode(), b"usemtl \xc3\x28\n"):
        shape = scene_of(bytes_ + CORNERS.encode() + b"f 1 2 3\n" + bytes_).meshes[0].geometry
        assert len(shape.faces) == 1
    for encoding in ("utf-16", "utf-32"):
        assert "room.obj:1: " in refused((CORNERS + "f 1 2 3\n").encode(encoding))[0]


def test_negative_indices_count_from_their_line() -> None:
    text = "".join(
        f"v {k} 0 0\nv {k} 1 0\nv {k} 0 1\nvt {k} 0\nvn 0 0 1\nf -3/-1/-1 -2/-1/-1 -1/-1/-1\n" for k in range(300)
    )
    shape = scene_of(text).meshes[0].geometry
    assert shape.faces.ravel().tolist() == list(range(900))
    assert shape.uv_of.tolist() == [[k] * 3 for k in range(300)]
    assert shape.normal_of.tolist() == [[k] * 3 for k in range(300)]
    assert shape.uv[:, 0].tolist() == list(range(300))


def test_forms_of_corners_may_mix_between_lines() -> None:
    text = CORNERS + "vt .25 .5\nvn 0 0 2\nf 1 2 3\nf 1/1 2/1 3/1\nf 1//1 2//1 3//1\nf 1/1/1 2/1/1 3/1/1\nf 3 2 1 \nf 1/1 3/1 2/1\n"  # fmt: skip  # noqa: E501
    shape = scene_of(text).meshes[0].geometry
    assert shape.faces.tolist() == [[0, 1, 2]] * 4 + [[2, 1, 0], [0, 2, 1]]
    assert shape.uv_of[:, 0].tolist() == [-1, 0, -1, 0, -1, 0]
    assert shape.normal_of[:, 0].tolist() == [-1, -1, 0, 0, -1, -1]


def test_forms_of_corners_that_mix_within_a_face() -> None:
    """Some corners with and others without: a fault of that line, or a face without; never another corner's."""
    for line in ("f 1 2/1 3/1", "f 1/1 2/1 3", "f 1//1 2 3", "f 1/1/1 2/1 3//1", "f 1/ 2/ 3/", "f 1// 2// 3//", "f 1/1/ 2/1/ 3/1/"):  # fmt: skip  # noqa: E501
        text = CORNERS + "vt .25 .5\nvn 0 0 2\n" + line + "\n"
        try:
            shape = scene_of(text).meshes[0].geometry
        except SceneError as error:
            assert "room.obj:6: " in str(error)  # noqa: PT017
            continue
        assert shape.faces.tolist() == [[0, 1, 2]]
        for of in (shape.uv_of, shape.normal_of):
            assert of.tolist() in ([[-1] * 3], [[0] * 3]), line


@pytest.mark.parametrize(
    "text", ["", "# nothing\n", "#", "\n\n", "\ufeff", CORNERS, "vn 0 0 1\n", "mtllib x\n", "\\\n", "\\"]
)
def test_files_without_faces(text: str) -> None:
    """A fault that says so, or a mesh of nothing."""
    try:
        scene = scene_of(text)
    except SceneError as error:
        assert "room.obj" in str(error)  # noqa: PT017
        assert "Traceback" not in str(error)  # noqa: PT017
    else:
        assert sum(len(mesh.geometry.faces) for mesh in scene.meshes) == 0


def test_faces_without_area_are_counted_and_drawn_around() -> None:
    Path("room.obj").write_text(CORNERS + "v 2 0 0\nf 1 1 2\nf 1 2 3\nf 1 2 4\nf 3 3 3\n")
    write_scene()
    scene, told = read("scene.xml")
    assert len(scene.meshes[0].geometry.faces) == 4
    assert len(told) == 1
    assert "room.obj:5: " in told[0]
    assert "3" in told[0]


@pytest.mark.slow
def test_a_hundred_thousand_faults_are_not_all_told() -> None:
    said = faults_of(CORNERS + "".join(f"f 1 2 {k}\n" for k in range(10, 100_010)))
    assert "room.obj:4: " in said[0]
    said = faults_of("v 1 2\n" * 100_000)
    assert "room.obj:1: " in said[0]
    assert len(said) == 1
    assert len(read_warnings("".join(f"thing{k} 1\n" for k in range(100_000)) + GOOD.decode())) <= 110


def read_warnings(text: str) -> list[str]:
    Path("room.obj").write_text(text)
    write_scene()
    return read("scene.xml")[1]


def test_faults_of_all_files_are_told_at_once() -> None:
    Path("a.obj").write_text("v 1 2\n")
    Path("b.obj").write_text("f 1 2 3\n")
    Path("t.png").write_bytes(b"no")
    Path("ok.obj").write_bytes(GOOD)
    said = refused(None, mesh_of("a.obj"), mesh_of("none.obj"), mesh_of("b.obj"), mesh_of("ok.obj", "t.png"))
    for name in ("a.obj:1: ", "b.obj:1: ", "none.obj", "t.png", f"scene.xml:{LINE + 1}: ", f"scene.xml:{LINE + 3}: "):
        assert any(name in line for line in said), name


def test_a_mesh_that_is_used_often_is_read_once() -> None:
    scene = scene_of(GOOD, *[mesh_of()] * 500)
    assert len(scene.meshes) == 500
    assert len({id(mesh.geometry) for mesh in scene.meshes}) == 1
    said = faults_of("v 1 2\n", *[mesh_of()] * 500)
    assert len(said) <= 2
    assert "room.obj:1: " in said[0]


def test_other_names_of_the_same_file() -> None:
    Path("sub").mkdir()
    Path("sub/room.obj").write_bytes(GOOD)
    Path("link.obj").symlink_to("sub/room.obj")
    names = ["sub/room.obj", "./sub/room.obj", "sub//room.obj", "sub/./room.obj", "link.obj"]
    scene = scene_of(None, *map(mesh_of, names))
    assert len(scene.meshes) == 5


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


def test_links_that_leave_the_folder() -> None:
    Path("../outside.obj").write_bytes(GOOD)
    Path("../outside").mkdir()
    Path("../outside/room.obj").write_bytes(GOOD)
    Path("sub").mkdir()
    for link, target in (
        ("a.obj", "../outside.obj"),
        ("b.obj", str(Path("../outside.obj").resolve())),
        ("folder", "../outside"),
        ("sub/c.obj", "../../outside.obj"),
        ("d.obj", "a.obj"),
        ("e.obj", "/dev/zero"),
        ("f.obj", "/etc/passwd"),
        ("up", ".."),
        ("root", "/"),
    ):
        Path(link).symlink_to(target)
    for name in ("a.obj", "b.obj", "folder/room.obj", "sub/c.obj", "d.obj", "e.obj", "f.obj", "up/outside.obj", "root/etc/passwd"):  # fmt: skip  # noqa: E501
        for surface, kind in ((mesh_of(name), "mesh"), (mesh_of("ok.obj", name), "texture")):
            Path("ok.obj").write_bytes(GOOD)
            said = refused(None, surface)
            assert len(said) == 1
            assert said[0].startswith(f"scene.xml:{LINE}: "), said
            assert f"{kind}: name " in said[0]


def test_links_that_stay_in_the_folder() -> None:
    Path("sub").mkdir()
    Path("sub/room.obj").write_bytes(GOOD)
    Path("link.obj").symlink_to("sub/room.obj")
    Path("folder").symlink_to("sub")
    Path("sub/up.obj").symlink_to("../link.obj")
    for name in ("link.obj", "folder/room.obj", "sub/up.obj", "sub/../link.obj"):
        with contextlib.suppress(SceneError):  # ".." may be refused even where it stays inside
            assert len(scene_of(None, mesh_of(name)).meshes) == 1
    Path("../linked").symlink_to("scene")
    write_scene()
    Path("room.obj").write_bytes(GOOD)
    assert len(read("../linked/scene.xml")[0].meshes) == 1
    Path("../scene.xml").symlink_to("scene/scene.xml")  # The folder is that of the name that is given, or of the file.
    with contextlib.suppress(SceneError):
        assert len(read("../scene.xml")[0].meshes) == 1


def test_links_that_go_round() -> None:
    Path("a.obj").symlink_to("b.obj")
    Path("b.obj").symlink_to("a.obj")
    Path("c.obj").symlink_to("c.obj/d")
    Path("none.obj").symlink_to("nothing")
    for name in ("a.obj", "c.obj", "none.obj"):
        assert len(refused(None, mesh_of(name))) == 1


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


def test_a_scene_in_another_folder() -> None:
    """Names start in the scene's folder, not in the current one, however the scene is named."""
    Path("room.obj").write_bytes(GOOD)
    write_scene()
    folder = Path.cwd()
    for cwd, name in (("..", "scene/scene.xml"), ("/", str(folder / "scene.xml")), (".", "./scene.xml"), ("..", "./scene/../scene/scene.xml")):  # fmt: skip  # noqa: E501
        with contextlib.chdir(folder / cwd if cwd != "/" else "/"):
            assert len(read(name)[0].meshes) == 1
    Path("../elsewhere").mkdir()
    Path("../elsewhere/room.obj").write_text("v oops\n")
    with contextlib.chdir("../elsewhere"):
        assert len(read("../scene/scene.xml")[0].meshes) == 1


def test_files_that_may_not_be_read() -> None:
    Path("room.obj").write_bytes(GOOD)
    Path("room.obj").chmod(0)
    Path("t.png").touch(0)
    if os.access("room.obj", os.R_OK):
        pytest.skip("this user may read everything")
    assert refused(None, mesh_of())[0].startswith(f"scene.xml:{LINE}: mesh")


# --- damaged files; many more are in test_fuzz.py


def outcome(*surfaces: str) -> str:
    """ "good", or what is wrong; everything but a SceneError is an error of the test, and so is any warning."""
    write_scene(*surfaces)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            read("scene.xml")
        except SceneError as error:
            return str(error)
    return "good"


# --- textures


def png(width: int, height: int, depth: int, color: int, rows: bytes, *chunks: bytes, interlaced: int = 0) -> bytes:
    """A PNG of these scan lines, each of which begins with its filter."""
    header = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, interlaced)
    parts = [chunk(b"IHDR", header), *chunks, chunk(b"IDAT", zlib.compress(rows, 9)), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def encoded(image: Picture.Image, kind: str = "PNG", **how: object) -> bytes:
    file = io.BytesIO()
    image.save(file, kind, **how)
    return file.getvalue()


def texture_of(data: bytes, name: str = "t.png") -> np.ndarray:
    Path(name).write_bytes(data)
    scene = scene_of(GOOD, mesh_of("room.obj", name))
    (texture,) = scene.textures
    assert scene.materials["texture"][scene.meshes[0].material] == 0
    return texture


RGB = np.random.default_rng(0).integers(0, 256, (5, 7, 3), np.uint8)
GREY16 = np.array([[0, 255, 256], [0x12FF, 32768, 65535]], np.uint16)


def test_colours_of_every_kind_of_png() -> None:
    picture = Picture.fromarray(RGB)
    assert np.array_equal(texture_of(encoded(picture)), RGB)
    alpha = picture.convert("RGBA")
    alpha.putalpha(Picture.fromarray(RGB[..., 0]))
    assert np.array_equal(texture_of(encoded(alpha)), RGB)
    grey = picture.convert("L")
    three = np.repeat(np.asarray(grey)[..., None], 3, axis=2)
    assert np.array_equal(texture_of(encoded(grey)), three)
    both = grey.convert("LA")
    both.putalpha(Picture.fromarray(RGB[..., 0]))
    assert np.array_equal(texture_of(encoded(both)), three)
    palette = picture.quantize(16)
    assert np.array_equal(texture_of(encoded(palette)), np.asarray(palette.convert("RGB")))
    assert np.array_equal(texture_of(encoded(palette, transparency=3)), np.asarray(palette.convert("RGB")))
    assert np.array_equal(
        texture_of(encoded(palette, transparency=bytes(range(16)))), np.asarray(palette.convert("RGB"))
    )
    assert np.array_equal(texture_of(encoded(grey, transparency=7)), three)
    assert np.array_equal(texture_of(encoded(picture, transparency=(1, 2, 3))), RGB)
    bits = picture.convert("1")
    assert np.array_equal(texture_of(encoded(bits)), np.repeat(np.asarray(bits)[..., None] * np.uint8(255), 3, axis=2))


def test_few_bits_of_grey_are_full_at_their_largest() -> None:
    for depth in (1, 2, 4):
        top = 2**depth - 1
        row = int("".join(f"{k:0{depth}b}" for k in range(top + 1)).ljust(8 * max(1, depth * (top + 1) // 8), "0"), 2)
        data = png(top + 1, 1, depth, 0, b"\0" + row.to_bytes(max(1, depth * (top + 1) // 8), "big"))
        assert texture_of(data)[0, :, 0].tolist() == [255 * k // top for k in range(top + 1)]


def test_sixteen_bits() -> None:
    """Grey keeps all of them and clips none; of colours, the upper byte at least."""
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in GREY16)
    grey = texture_of(png(3, 2, 16, 0, rows))
    assert grey.dtype == np.uint16
    assert np.array_equal(grey, np.repeat(GREY16[..., None], 3, axis=2))
    color = np.repeat(GREY16[..., None], 3, axis=2)
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in color)
    got = texture_of(png(3, 2, 16, 2, rows))
    full = 255.0 if got.dtype == np.uint8 else 65535.0
    assert np.abs(got / full - color / 65535).max() <= 1 / 255
    rows = b"".join(b"\0" + np.dstack([row[None], row[None]]).astype(">u2").tobytes() for row in GREY16)
    got = texture_of(png(3, 2, 16, 4, rows))
    full = 255.0 if got.dtype == np.uint8 else 65535.0
    assert np.abs(got / full - color / 65535).max() <= 1 / 255


def test_interlaced_png() -> None:
    """Adam7: the same pixels in seven passes."""
    rows = b""
    for x0, y0, dx, dy in (
        (0, 0, 8, 8),
        (4, 0, 8, 8),
        (0, 4, 4, 8),
        (2, 0, 4, 4),
        (0, 2, 2, 4),
        (1, 0, 2, 2),
        (0, 1, 1, 2),
    ):
        part = RGB[y0::dy, x0::dx]
        rows += b"".join(b"\0" + row.tobytes() for row in part if row.size)
    assert np.array_equal(texture_of(png(7, 5, 8, 2, rows, interlaced=1)), RGB)


def test_chunks_that_other_programs_obey_change_nothing() -> None:
    rows = b"".join(b"\0" + row.tobytes() for row in RGB)
    for extra in (
        chunk(b"gAMA", struct.pack(">I", 100_000)),
        chunk(b"sRGB", b"\0"),
        chunk(b"iCCP", b"x\0\0" + zlib.compress(b"nonsense")),
        chunk(b"tEXt", b"Comment\0hello"),
        chunk(b"pHYs", struct.pack(">IIB", 1, 2, 1)),
        chunk(b"cHRM", bytes(32)),
        chunk(b"bKGD", bytes(6)),
        chunk(b"eXIf", b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"),  # orientation 6
        chunk(b"eXIf", b"broken"),
        chunk(b"teSt", b"unknown"),
    ):
        assert np.array_equal(texture_of(png(7, 5, 8, 2, rows, extra)), RGB), extra


def test_jpeg_of_every_kind() -> None:
    flat = np.full((16, 24, 3), (200, 100, 50), np.uint8)
    picture = Picture.fromarray(flat)
    exif = Picture.Exif()
    exif[0x0112] = 6  # to be turned
    for data in (
        encoded(picture, "JPEG"),
        encoded(picture, "JPEG", progressive=True),
        encoded(picture, "JPEG", exif=exif),
        encoded(picture, "JPEG", icc_profile=b"nonsense"),
        encoded(picture, "JPEG", dpi=(1, 2), comment=b"\xff" * 100),
    ):
        got = texture_of(data, "t.jpg")
        assert got.shape == (16, 24, 3)
        assert np.abs(got.astype(int) - flat).max() <= 4
    grey = texture_of(encoded(picture.convert("L"), "JPEG"), "t.jpg")
    assert (grey[..., 0] == grey[..., 2]).all()
    ink = texture_of(encoded(picture.convert("CMYK"), "JPEG"), "t.jpg")
    assert np.abs(ink.astype(int) - flat).max() <= 40
    assert np.array_equal(texture_of(encoded(picture, "JPEG"), "t.png"), texture_of(encoded(picture, "JPEG"), "t.jpg"))


def test_other_formats_are_refused_whatever_their_names_are() -> None:
    picture = Picture.fromarray(RGB)
    files = [encoded(picture.convert("P"), kind) for kind in ("GIF", "BMP", "TIFF", "PCX")]
    files += [encoded(picture, kind) for kind in ("BMP", "PPM", "TIFF", "TGA", "ICO", "WEBP")]
    files += [b"", b"\0", b"P6 1 1 255\n", b"<svg/>", b"%!PS-Adobe\n", b"GIF89a", b"\x89PNG", b"\x89PNG\r\n\x1a\n", b"\xff\xd8", b"\xff\xd8\xff\xe0", b"v 1 2 3\n", bytes(10_000)]  # fmt: skip  # noqa: E501
    Path("room.obj").write_bytes(GOOD)
    for data in files:
        Path("t.png").write_bytes(data)
        said = refused(None, mesh_of("room.obj", "t.png"))
        assert len(said) == 1
        assert said[0].startswith(TEXTURE), said
        assert "t.png" in said[0]


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


def test_truncated_textures() -> None:
    """However many bytes are missing. Only what follows the pixels may be."""
    noise = Picture.fromarray(np.random.default_rng(0).integers(0, 256, (24, 24, 3), np.uint8))
    for kind in ("PNG", "JPEG"):
        data = encoded(noise, kind)
        Path("room.obj").write_bytes(GOOD)
        for size in [*range(0, len(data) - 40, 37), len(data) - 20, len(data) - 13]:
            Path("t.png").write_bytes(data[:size])
            said = outcome(mesh_of("room.obj", "t.png"))
            if size < len(data) - 40:
                assert said.startswith(TEXTURE), (kind, size, len(data))
                assert "\n" not in said


def test_a_texture_that_is_used_often_is_read_once() -> None:
    Path("t.png").write_bytes(encoded(Picture.fromarray(RGB)))
    scene = scene_of(GOOD, *[mesh_of("room.obj", "t.png")] * 400)
    assert len(scene.textures) == 1
    Path("t.png").write_bytes(b"no")
    assert len(faults_of(None, *[mesh_of("room.obj", "t.png")] * 400)) <= 2


@pytest.mark.slow
def test_many_textures_have_a_limit_together() -> None:
    """Ten files of 36 kilobytes that unfold to a gigabyte."""
    Path("room.obj").write_bytes(GOOD)
    data = encoded(Picture.new("L", (6000, 6000)))
    for k in range(10):
        Path(f"t{k}.png").write_bytes(data)
    write_scene(*(mesh_of("room.obj", f"t{k}.png") for k in range(10)))
    status, said = limited(2500)
    assert status == 2
    assert "texture" in said


def test_textures_without_coordinates_are_warned_of() -> None:
    Path("t.png").write_bytes(encoded(Picture.fromarray(RGB)))
    Path("room.obj").write_text(CORNERS + "f 1 2 3\nf 3 2 1\n")
    write_scene(mesh_of("room.obj", "t.png"))
    scene, told = read("scene.xml")
    assert scene.meshes[0].geometry.uv_of.tolist() == [[-1] * 3] * 2
    assert len(told) == 1
    assert told[0].startswith(("room.obj:4: ", f"scene.xml:{LINE}: "))

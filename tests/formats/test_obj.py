"""OBJ files: what the reader makes of valid ones, every message by its exact text, and files from strangers."""

from __future__ import annotations

import random
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cltrace.base.errors import SceneError
from cltrace.formats import obj
from cltrace.formats.obj import Obj, read_obj
from cltrace.scene import Geometry

pytestmark = pytest.mark.usefixtures("own_folder")

FIELDS = ("vertices", "faces", "normals", "normal_of", "uv", "uv_of")
CUBE_CORNER = """\
v 0 0 0
v 1 0 0.5
v 0 1 -2.25
v 1e-3 -.5 +7.
vt 0 0
vt 1 0.25
vn 0 0 1
vn 0 1 0
f 1/1/1 2/2/1 3/1/2
f 2/1/2 3/2/2 4/2/1
"""


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def read_text(text: str | bytes) -> Obj:
    Path("x.obj").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_obj("x.obj")


def geometry_of(text: str | bytes) -> Geometry:
    found = read_text(text)
    assert found.warnings == []
    return found.geometry


def warnings_of(text: str) -> list[str]:
    return [f"{w.line}: {w.message}" for w in read_text(text).warnings]


def faults_of(text: str | bytes) -> list[str]:
    with pytest.raises(SceneError) as caught:
        read_text(text)
    return [line.removeprefix("x.obj:") for line in str(caught.value).split("\n")]


def same(a: Geometry, b: Geometry) -> bool:
    return all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in FIELDS)


def each_alone(which: list[int], *how: Any, parts: Any = obj._parts) -> Any:
    """In place of `obj._parts`: reads every line by itself."""
    return [one for i in which for one in parts([i], *how)]


# --- Valid files


def test_everything_arrives() -> None:
    shape = geometry_of(CUBE_CORNER)
    assert shape.vertices.tolist() == [[0, 0, 0], [1, 0, 0.5], [0, 1, -2.25], [1e-3, -0.5, 7]]
    assert shape.uv.tolist() == [[0, 0], [1, 0.25]]
    assert shape.normals.tolist() == [[0, 0, 1], [0, 1, 0]]
    assert shape.faces.tolist() == [[0, 1, 2], [1, 2, 3]]
    assert shape.uv_of.tolist() == [[0, 1, 0], [0, 1, 1]]
    assert shape.normal_of.tolist() == [[0, 0, 1], [1, 1, 0]]


@pytest.mark.parametrize(
    "text",
    [
        CUBE_CORNER.replace("\n", "\r\n"),
        CUBE_CORNER.replace("\n", "\r"),
        CUBE_CORNER.replace("\n", "\n\n"),
        CUBE_CORNER.replace(" ", "\t"),
        CUBE_CORNER.replace(" ", "   "),
        CUBE_CORNER.replace("\n", " \n"),
        CUBE_CORNER.replace("\n", "\n  \t"),
        CUBE_CORNER.replace(" ", " \\\n"),
        CUBE_CORNER.replace(" ", " \\\r\n").replace("0\n", "0\r\n"),
        CUBE_CORNER.replace("\n", " # what it is\n"),
        CUBE_CORNER.replace("\n", "#\n"),
        "#\n# v 9 9 9\n" + CUBE_CORNER.replace("\nf", "\n# f 1 2 3\nf", 1),
        "# a folder such as C:\\meshes\\\n" + CUBE_CORNER,
        CUBE_CORNER.rstrip("\n"),
        CUBE_CORNER.rstrip("\n") + "\r",
        CUBE_CORNER.rstrip("\n") + " \\",
        CUBE_CORNER.rstrip("\n") + "# \\",
        "\ufeff" + CUBE_CORNER,
        "mtllib room.mtl\no room\n"
        + CUBE_CORNER.replace("\nf", "\ng a b\ns off\nusemtl B\xe4ume #1\nl 1 2\np 1\nvp 0\nf"),
        CUBE_CORNER.replace("v 0 0 0", "v -0 0e5 0.0000"),
        CUBE_CORNER.replace("0.25", "25E-2"),
        CUBE_CORNER.replace("0.25", "2.5e-01"),
        CUBE_CORNER.replace("0.25", "0.2500000000000000000000000000000000000000"),
        CUBE_CORNER.replace("0.25", "+000000000000000000000000000000000000000.25"),
        CUBE_CORNER.replace("vt 0 0\n", "vt 0\n"),
        CUBE_CORNER.replace("vt 0 0\n", "vt 0 0 0.5\n"),
        CUBE_CORNER.replace("v 0 0 0\n", "v 0 0 0 1.0\n"),
        CUBE_CORNER.replace(" 4/2/1", " -1/-1/-2"),
        CUBE_CORNER.replace("f 1/1/1 2/2/1 3/1/2", "f 1/-2/-2 -3/2/1 +3/1/-1"),
        CUBE_CORNER[CUBE_CORNER.index("f ") :] + CUBE_CORNER[: CUBE_CORNER.index("f ")],
        CUBE_CORNER.replace("1/1/1", "1/1/1 \\\n"),
        CUBE_CORNER.replace("f 1/1/1", "f 001/+1/1"),
    ],
)
def test_other_ways_to_write_the_same(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert same(geometry_of(text), geometry_of(CUBE_CORNER))
    monkeypatch.setattr(obj, "_parts", each_alone)
    assert same(geometry_of(text), geometry_of(CUBE_CORNER))


FOUR = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nvn 0 1 0\n"


@pytest.mark.parametrize(
    ("faces", "wanted"),
    [
        ("f 1 2 3", [(0, 1, 2)]),
        ("f 1 2 3 4", [(0, 1, 2), (0, 2, 3)]),
        ("f 2 3 4 1 5\nv 2 -3 0", [(1, 2, 3), (1, 3, 0), (1, 0, 4)]),
        ("f 1 2 3\nf 1 2 3 4\nf 2 3 4", [(0, 1, 2), (0, 1, 2), (0, 2, 3), (1, 2, 3)]),
        ("f -4 -3 -2\nv 9 9 9\nf -4 -3 -1", [(0, 1, 2), (1, 2, 4)]),
        ("f 1 2 5\nv 9 9 9", [(0, 1, 4)]),
        ("f 1// 2// 3//", [(0, 1, 2)]),
        ("f 1/ 2 3//", [(0, 1, 2)]),
    ],
)
def test_fans_and_relative_indices(faces: str, wanted: list[tuple[int, ...]]) -> None:
    shape = geometry_of(FOUR + faces + "\n")
    assert shape.faces.tolist() == [list(face) for face in wanted]
    assert (shape.uv_of == -1).all()
    assert (shape.normal_of == -1).all()


@pytest.mark.parametrize(
    ("face", "uv", "normal"),
    [
        ("1/1 2/1 3/1", 0, -1),
        ("1//2 2//2 3//2", -1, 1),
        ("1/1/1 2/1/1 3/1/1", 0, 0),
        ("1/1/ 2/1/ 3/1/", 0, -1),
        ("1/1/ 2/1 3/1/", 0, -1),
        ("1/-1/-1 2/1/2 3/1/+2", 0, 1),
    ],
)
def test_the_forms_of_a_corner(face: str, uv: int, normal: int) -> None:
    """Of one face, and of it among others."""
    for before in ("", "f 1 2 3\n", "f 4/1 2/1 3/1 1/1\n", "f 4//1 2//1 3//1\n", "f 4/1/1 2/1/1 3/1/1\n"):
        shape = geometry_of(FOUR + before + f"f {face}\n")
        assert shape.uv_of[-1].tolist() == [uv] * 3
        assert shape.normal_of[-1].tolist() == [normal] * 3
        assert shape.faces[-1].tolist() == [0, 1, 2]


# Whole numbers about 2^53 and beyond 2^63, those halfway between two doubles or nearly so, and other notations.
_WRITTEN = (
    "9007199254740993 9007199254740992.9999999999999999 0.1 0.30000000000000004 4.35 8.5e-23 123456789012345678 "
    "1.00000000000000011102230246251565404236316680908203125 12e-1 "
    "1.0000000000000001110223024625156540423631668090820312500001 "
    "1234567890123456789e-9 0.000000000000000000000000000000001234567890123456789 3.4028234663852886e38 +1 1. .5 1E5 "
    "1.4012984643248171e-45 9000000000000000001e-3 9223372036854775808 99999999999999999999999999 -.5e-3 1e+5 00012 "
    "5e0000000000000000000000000000000003 2.2250738585072011e-7"
)
NUMBERS = [*_WRITTEN.split(), "1" * 30]


def test_numbers_are_rounded_right() -> None:
    """Whole numbers below 2^53 and those that are halfway between two doubles, or nearly so; and what chance gives."""
    rng = random.Random(8)
    written = NUMBERS + [f"-{text.removeprefix('+')}" for text in NUMBERS if text[0] != "-"]
    for _ in range(20_000):
        number = rng.uniform(-1, 1) * 10.0 ** rng.randrange(-9, 9)
        written.append(
            rng.choice(["{!r}", "{:.17f}", "{:.20f}", "{:.25e}", "{:.18e}", "{:.9g}", "{:e}"]).format(number)
        )
        halfway = (2 * rng.randrange(2**52, 2**53) + 1) * 5 ** rng.randrange(3)
        digits = rng.randrange(1, 18)
        written.append(f"{halfway // 10**digits}.{halfway % 10**digits:0{digits}}")
    written += ["0"] * (-len(written) % 3)
    rows = "".join(f"v {' '.join(written[i : i + 3])}\n" for i in range(0, len(written), 3))
    found = geometry_of(rows + "f 1 2 3\n").vertices.ravel().tolist()
    assert found == list(map(float, written))


def number(rng: random.Random) -> str:
    x = rng.uniform(-1, 1) * 10 ** rng.randrange(-6, 6)
    return rng.choice([repr(x), f"{x:e}", f"{x:.6f}", str(rng.randrange(-99, 99)), f"{x:.25f}", ".5", "5.", "-0"])


def some_lines(rng: random.Random) -> list[str]:
    """Lines of all kinds, in any order, of which the faces have one form or several."""
    lines, count = [], {"v": 0, "vt": 0, "vn": 0}
    forms = rng.choice([["v"], ["v/t"], ["v//n"], ["v/t/n"], ["v", "v/t", "v//n", "v/t/n"]])
    sizes = rng.choice([[3], [4], [3, 3, 4, 5]])
    for _ in range(rng.randrange(5, 150)):
        kind = rng.choice(["v", "v", "v", "vt", "vn", "f", "f", "#"])
        if kind in count:
            widths = {"v": [3, 3, 3, 4, 6], "vt": [1, 2, 2, 3], "vn": [3]}[kind]
            lines.append(" ".join([kind, *(number(rng) for _ in range(rng.choice(widths)))]))
            count[kind] += 1
        elif kind == "#":
            lines.append(rng.choice(["", "# f 1 2", "g a", "usemtl b"]))
        elif all(count.values()):
            form, corners = rng.choice(forms), []
            for _ in range(rng.choice(sizes)):
                v, t, n = (str(rng.choice([1, -1]) * rng.randrange(1, many + 1)) for many in count.values())
                corners.append(form.replace("v", v).replace("t", t).replace("n", n))
            lines.append(" ".join(["f", *corners]))
    return [*lines, "v 0 0 0", "f -1 -1 -1"]


def read_plainly(lines: list[str]) -> tuple[list[Any], ...]:
    """Vertices, texture coordinates, normals and triangles of lines without faults."""
    rows: dict[str, list[Any]] = {"v": [], "vt": [], "vn": [], "f": []}
    for line in lines:
        kind, *words = line.split() or ["#"]
        if kind == "f":
            corners = []
            for word in words:
                parts = zip((word + "//").split("/"), ("v", "vt", "vn"), strict=False)
                corners.append([(int(x) - 1 if int(x) > 0 else len(rows[k]) + int(x)) if x else -1 for x, k in parts])
            rows["f"] += [[corners[0], *corners[i : i + 2]] for i in range(1, len(corners) - 1)]
        elif kind in rows:
            rows[kind].append([*map(float, words), 0.0][: 2 if kind == "vt" else 3])
    return tuple(rows.values())


@pytest.mark.slow
@pytest.mark.parametrize("block", [50, 700, 2**20])
def test_lines_of_all_kinds_in_any_order(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(obj, "BLOCK_BYTES", block)
    for seed in range(150):
        rng = random.Random(seed)
        lines = some_lines(rng)
        shape = read_text(rng.choice(["\n", "\r\n", " \\\n\n", "#\n"]).join(lines)).geometry
        *rows, triangles = read_plainly(lines)
        assert [shape.vertices.tolist(), shape.uv.tolist(), shape.normals.tolist()] == rows, seed
        for k, found in enumerate((shape.faces, shape.uv_of, shape.normal_of)):
            assert np.array_equal(found, np.array(triangles)[:, :, k]), seed


# --- Warnings

WARNINGS = {
    "weight": (TRIANGLE + "v 1 1 1 2\nf 1 2 3\n", ["4: vertex: weight w ignored"]),
    "colours": (
        "v 0 0 0 1 1 1\nv 1 0 0 1 0 0\nv 0 1 0 .5 0 1\nf 1 2 3\n",
        ["1: vertex: colour ignored (3 times, also in lines 2, 3)"],
    ),
    "keywords": (
        "curv 1\ncurv 2\n" + TRIANGLE + "f 1 2 3\nV 1 2 3\nvx\n\u00e4 #\n",
        [
            "1: unknown keyword 'curv' ignored (2 times, also in line 2)",
            "7: unknown keyword 'V' ignored",
            "8: unknown keyword 'vx' ignored",
            "9: unknown keyword '\u00e4' ignored",
        ],
    ),
    "no area": (
        TRIANGLE + "v 2 0 0\nv .1 .1 .1\nv .3 .3 .3\nf 1 2 1\nf 1 2 3 3\nf 1 2 4\nf 1 5 6\nf 1 2 3\n",
        ["7: face: a triangle without area, which is not seen (4 times, also in lines 8, 9, 10)"],
    ),
    "some normals": (
        TRIANGLE + "vn 0 0 1\nvt 0 0\nf 1//1 2//1 3\nf 1/1 2 3\nf 1/1/1 2/1 3//1\nf 1 2 3\n",
        [
            "6: face: normals at some corners only, which are ignored (2 times, also in line 8)",
            "7: face: texture coordinates at some corners only, which are ignored (2 times, also in line 8)",
        ],
    ),
}


@pytest.mark.parametrize("name", WARNINGS)
def test_warning(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    text, expected = WARNINGS[name]
    assert warnings_of(text) == expected
    monkeypatch.setattr(obj, "_parts", each_alone)
    assert warnings_of(text) == expected


def test_area_is_decided_exactly() -> None:
    """0.1, 0.2 and 0.3 are not in line as doubles, nor are points in which rounding hides the difference."""
    assert warnings_of("v 0 0 0\nv .1 .2 .3\nv .3 .6 .9\nf 1 2 3\n") == []
    assert warnings_of("v 1e16 0 0\nv 1 0 0\nv 2 1e-30 0\nf 1 2 3\nf 2 3 1\nf 3 1 2\n") == []
    assert warnings_of("v 1e16 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n") != []
    assert warnings_of("v .1 .1 .7\nv .2 .2 .7\nv .7 .7 .7\nf 1 2 3\n") != []


def test_ignored_corners_are_none() -> None:
    shape = read_text(TRIANGLE + "vn 0 0 1\nf 1//1 2//1 3\nf 1//1 2//1 3//1\n").geometry
    assert shape.normal_of.tolist() == [[-1] * 3, [0] * 3]


# --- Faults

NO_NUMBERS = (
    "abc 1,5 1_000 1e1_0 0x10 1e -e1 -.e1 1e+ 1e.5 e1 1e5e5 1e5. 1.2.3 . - --1 1\u00a0 \u0663 1\\x 1-2 .-2 + 1d5 1f 3j "
    "1/2 '1' \u2212 1\u20122 true"
)
NUMBER_FAULTS = {
    **{text: f"must be a number, got {text!r}" for text in NO_NUMBERS.split(" ")},
    "1" * 200 + "x": f"must be a number, got '{'1' * 37}...'",
    **{text: f"must be a finite number, got {text}" for text in ("nan", "-Inf", "1e999")},
    "1e39": "must not exceed 3.4e38 in magnitude, got 1e39",
    "9" * 60: f"must not exceed 3.4e38 in magnitude, got {'9' * 37}...",
    **{text: f"must be 0 or at least 1.4e-45 in magnitude, got {text}" for text in ("1e-46", "-1e-400")},
    "0." + "0" * 400 + "1": f"must be 0 or at least 1.4e-45 in magnitude, got 0.{'0' * 35}...",
}


@pytest.mark.parametrize(("written", "fault"), NUMBER_FAULTS.items())
def test_numbers(written: str, fault: str) -> None:
    """Of a vertex, among others that are right and with as many words, and of the others."""
    others = "v 1 2 3\n" * 50
    assert faults_of(f"{others}v 0 {written} 0\n{others}f 1 2 3\n") == [f"51: vertex: y {fault}"]
    assert faults_of(f"v 0 0 0 {written}\nf 1 1 1\n") == [f"1: vertex: w {fault}"]
    assert faults_of(f"v 0 0 0 1 1 {written}\nf 1 1 1\n") == [f"1: vertex: b {fault}"]
    assert faults_of(f"v 0 0 0\nvt {written}\nf 1 1 1\n") == [f"2: texture coordinate: u {fault}"]
    assert faults_of(f"v 0 0 0\nvn 0 0 {written}\nf 1 1 1\n") == [f"2: normal: z {fault}"]


CORNERS = "face: must have corners such as 1, 1/2, 1//3 and 1/2/3, got"
FAULTS = {
    "empty": ("", [" is empty"]),
    "blank": (" \n\n", [" has no faces"]),
    "another kind of file": ("<scene>\n  <camera/>\n</scene>\n# nothing", [" has no faces"]),
    "a byte order mark": ("\ufeff", [" has no faces"]),
    "no faces": (TRIANGLE, [" has no faces"]),
    "vertex of 2": ("v 0 0\nf 1 1 1\n", ["1: vertex: must be 3, 4 or 6 numbers, got 2"]),
    "vertex of 5": ("v 0 0 0 0 0\nf 1 1 1\n", ["1: vertex: must be 3, 4 or 6 numbers, got 5"]),
    "vt of 4": (TRIANGLE + "vt 0 0 0 0\nf 1 2 3\n", ["4: texture coordinate: must be 1, 2 or 3 numbers, got 4"]),
    "vn of 2": (TRIANGLE + "vn 0 0\nf 1 2 3\n", ["4: normal: must be 3 numbers, got 2"]),
    "two faults in a line": (
        "v a b 0\nf 1 1 1\n",
        ["1: vertex: x must be a number, got 'a'", "1: vertex: y must be a number, got 'b'"],
    ),
    "face of 2": (TRIANGLE + "f 1 2\n", ["4: face: must have at least 3 corners, got 2"]),
    "no such vertex": (TRIANGLE + "f 1 2 4\n", ["4: face: vertex 4 of 3"]),
    "no such normal": (TRIANGLE + "vn 0 0 1\nf 1//1 2//1 3//2\n", ["5: face: normal 2 of 1"]),
    "vertex 0": (TRIANGLE + "f 0 1 2\n", ["4: face: vertex 0 of 3 so far"]),
    "beyond 32 bits": (TRIANGLE + "f 1 2 4294967297\n", ["4: face: vertex 4294967297 of 3 so far"]),
    "beyond 64 bits": (TRIANGLE + f"f 1 2 {'9' * 99}\n", [f"4: face: vertex {'9' * 37}... of 3 so far"]),
    "far back": (TRIANGLE + "f 1 2 -4\nv 0 0 0\n", ["4: face: vertex -4 of 3 so far"]),
    "no index": (TRIANGLE + "f 1 2 x\n", [f"4: {CORNERS} 'x'"]),
    "a part of a number": (TRIANGLE + "f 1 2 3.0\n", [f"4: {CORNERS} '3.0'"]),
    "no vertex": (TRIANGLE + "vt 0 0\nf /1 1/1 2/1\n", [f"5: {CORNERS} '/1'"]),
    "no vertices": (TRIANGLE + "vn 0 0 1\nf //1 //1 //1\n", [f"5: {CORNERS} '//1' (3 times)"]),
    "four parts": (TRIANGLE + "f 1 2 3/1/1/1\n", [f"4: {CORNERS} '3/1/1/1'"]),
    "as many slashes elsewhere": (TRIANGLE + "f 1/1/1/1 2 3\n", [f"4: {CORNERS} '1/1/1/1'"]),
    "numbers that end elsewhere": (
        "v 1-2 e5 3\nv - 2 3 4\nv 1 2e 3-4\nf 1 1 1\n",
        [
            "1: vertex: x must be a number, got '1-2'",
            "1: vertex: y must be a number, got 'e5'",
            "2: vertex: x must be a number, got '-'",
            "3: vertex: y must be a number, got '2e'",
            "3: vertex: z must be a number, got '3-4'",
        ],
    ),
    "indices that end elsewhere": (
        TRIANGLE + "f - 1 2 3\nf 1-2 - 3\nf 1/-/-1 2/+/-1 3/-/-1\n",
        [
            f"4: {CORNERS} '-' (2 times, also in line 5)",
            f"5: {CORNERS} '1-2'",
            f"6: {CORNERS} '1/-/-1'",
            f"6: {CORNERS} '2/+/-1'",
            f"6: {CORNERS} '3/-/-1'",
        ],
    ),
    "of several blocks": (
        "v 0 0 0\r\nv 1 \\\r\n 0\r\n# x\r\nf 1 1 7\r\nv q \\\r\n 0 0\r\nvn 1\r\n",
        [
            "2: vertex: must be 3, 4 or 6 numbers, got 2",
            "5: face: vertex 7 of 3",
            "6: vertex: x must be a number, got 'q'",
            "8: normal: must be 3 numbers, got 1",
        ],
    ),
    "escapes": (TRIANGLE + "f 1 2 \x1b[31m\n", ["4: must be text, but has the byte 0x1b"]),
    "behind a keyword": (TRIANGLE + "f 1 2 3\nf\x1f 1 2 3\n", ["5: must be text, but has the byte 0x1f"]),
    "NUL": (TRIANGLE + "f 1 2\0 3\nv a", ["4: must be text, but has the byte 0x00"]),
}


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("block", [9, 2**20])
def test_fault(name: str, block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(obj, "BLOCK_BYTES", block)
    text, expected = FAULTS[name]
    assert faults_of(text) == expected


@pytest.mark.parametrize("name", FAULTS)
def test_fault_among_many_lines(name: str) -> None:
    """That are right, and are still read together."""
    text, expected = FAULTS[name]
    if expected[0].endswith(("is empty", "has no faces")):
        expected = []
    more = "" if text.endswith("\n") or not text else "\n"
    with pytest.raises(SceneError) as caught:
        read_text(text + more + "f 1 1 1\nf 1/ 1// 1\n" * 500 + "f q 1 1\n")
    assert [f"{f.line}: {f.message}" for f in caught.value.faults[: len(expected)]] == expected


def test_very_many_faults_and_unknown_keywords(monkeypatch: pytest.MonkeyPatch) -> None:
    faults = faults_of("v 0 0\n" * 5000 + "".join(f"f {i} 1\n" for i in range(5000)))
    assert faults[0] == "1: vertex: must be 3, 4 or 6 numbers, got 2 (5000 times, also in lines 2, 3, 4, …)"
    assert (
        faults[1] == "5001: face: must have at least 3 corners, got 2 (5000 times, also in lines 5002, 5003, 5004, …)"
    )
    monkeypatch.setattr(obj, "MAX_FAULTS", 10)
    assert faults_of("v 0 0\n" * 5000)[-1] == "11: more than 10 faults, the rest is not read"
    assert faults_of("v 0 0 0\n" + "f 1 1 0\n" * 5000)[-1] == "12: more than 10 faults, the rest is not read"
    assert warnings_of("x\n" * 99 + TRIANGLE + "f 1 2 3\n") == [
        "1: unknown keyword 'x' ignored (99 times, also in lines 2, 3, 4, …)"
    ]
    (fault,) = faults_of("".join(f"x{i}\n" for i in range(99)) + TRIANGLE + "f 1 2 3\n")
    assert fault.endswith(": more than 10 unknown keywords, the rest is not read")


def test_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(obj, "MAX_VERTICES", 3)
    assert faults_of(TRIANGLE + "f 1 2 3\nv 0 0 0\n") == ["5: vertex: must not be one of more than 3"]
    assert faults_of(TRIANGLE + "f 1 2 3\n" + "vn 0 0 1\n" * 4) == ["8: normal: must not be one of more than 3"]
    assert faults_of("vt 0\n" * 4) == ["4: texture coordinate: must not be one of more than 3"]
    monkeypatch.setattr(obj, "MAX_TRIANGLES", 3)
    assert len(geometry_of(TRIANGLE + "f 1 2 3\nf 1 2 3 1\n".replace(" 1\n", "\n")).faces) == 2
    assert faults_of(TRIANGLE + "f 1 2 3 1 2\nf 1 2 3\n") == ["5: face: must not be one of more than 3 triangles"]
    monkeypatch.setattr(obj, "MAX_LINE", 1000)
    monkeypatch.setattr(obj, "BLOCK_BYTES", 100)
    assert faults_of(TRIANGLE + "f" + " 1" * 1000) == ["4: must not be a line of more than 1000 bytes"]
    assert faults_of(TRIANGLE + "f" + " 1 \\\n" * 1000) == ["4: must not be a line of more than 1000 bytes"]


# --- Files from strangers


def test_comments_and_names_may_be_in_any_encoding() -> None:
    for text in ("# \xe4\xf6\n".encode("latin-1"), b"o \xff\xfe\x80\n", "g \u732b\n".encode(), b"usemtl \xc3\x28\n"):
        assert len(geometry_of(text + TRIANGLE.encode() + b"f 1 2 3\n" + text).faces) == 1


def test_a_face_of_a_hundred_thousand_corners() -> None:
    corners = np.arange(100_000) % 3 + 1
    shape = read_text(TRIANGLE + "f " + " ".join(map(str, corners.tolist())) + "\n").geometry
    assert shape.faces.shape == (99_998, 3)
    assert shape.faces[-1].tolist() == [0, int(corners[-2]) - 1, int(corners[-1]) - 1]


@pytest.mark.parametrize("line", ["v " + "9" * 2_000_000, "f 1 2 " + "x" * 2_000_000, "f " + "1 " * 400_000 + "9"])
def test_a_line_of_megabytes_is_not_repeated_in_its_message(line: str) -> None:
    (fault,) = faults_of(TRIANGLE + line + "\nf 1 2 3\n")
    assert fault.startswith("4: ")
    assert len(fault) < 200


def test_files_that_claim_to_be_huge() -> None:
    """Holes on the disk: zeros, with nothing and with something in front of them."""
    for start, fault in (("", "1: must be text, but has the byte 0x00"), (CUBE_CORNER, "11: must be text, but has")):
        with Path("x.obj").open("wb") as file:
            file.write(start.encode())
            file.truncate(3 * 2**30)
        with pytest.raises(SceneError, match=f"^x.obj:{fault}"):
            read_obj("x.obj")


def test_many_short_lines_take_little_memory(limited: Any) -> None:
    parts = "\n" * 5_000_000, "#\n" * 1_000_000, "v 0 0 0\n" * 300_000, "g\n" * 500_000
    names = [f"{k}.obj" for k in range(len(parts))]
    for name, text in zip(names, parts, strict=True):
        Path(name).write_text(text + TRIANGLE + "f -1 -2 -3\n")
    assert limited("obj", 1500, names) == ["read"] * 4


def test_alternating_lines_take_little_time() -> None:
    """No two lines of a kind in a row; every face has another form; every number needs care."""
    few = "".join(f"v {k} 0 0\nvt 0 {k}\nvn 0 {k} 1\ng {k}\n#\n" for k in range(1, 60_000))
    forms = ("{0} 2 3", "{0}/1 2/1 3/1", "{0}//1 2//1 3//1", "-1 -2 -3", "1/1/1 2/2/2 3/3/3 {0}/4/4")
    faces = "".join("f " + forms[k % 5].format(k) + "\n" for k in range(4, 60_000))
    start = time.process_time()
    assert len(read_text(few + faces).geometry.faces) == 59_996 + len(range(8, 60_000, 5)) + (4 % 5 == 4)
    assert time.process_time() - start < 30

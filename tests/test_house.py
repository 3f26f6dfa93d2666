"""What keeps the house simple: who may import whom, how long functions are, where kernels have conditions.

Exceptions carry their reason. One that is no longer needed fails the test, so the lists only get shorter.
"""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from mutations import MUTATIONS, pattern_of

from cltrace.run.program import SOURCES

ROOT = Path(__file__).parent.parent
MODULES = sorted((ROOT / "cltrace").rglob("*.py"))
KERNELS = sorted((ROOT / "kernels").rglob("*.cl"))

LINES, ARGUMENTS = 60, 7  # a function has at most so many
CONDITIONS = 99  # kernels have at most so many #if

# What each room may import, beside itself.
BELOW = {
    "base": set(),
    "numbers": set(),
    "process": {"base"},
    "scene": {"numbers", "base"},
    "formats": {"numbers", "scene", "base"},
    "plan": {"numbers", "scene", "base"},
    "run": {"plan", "scene", "base"},
    "picture": {"scene", "base"},
    "renderers": {"run", "plan", "picture", "scene", "base"},
    "reference": {"numbers", "scene", "base"},
    "explanation": {"reference", "numbers", "scene", "base"},
    "oracle": {"numbers", "scene"},
    "rays": {"numbers", "plan", "scene", "base"},
    "students": {"renderers", "explanation", "reference", "formats", "picture", "plan", "run", "scene", "base"},
    "movie": {"renderers", "run", "plan", "picture", "scene", "base"},
    "distributed": {"movie", "renderers", "run", "plan", "picture", "process", "scene", "base"},
    "viewer": {"movie", "students", "renderers", "explanation", "rays", "picture", "run", "plan", "scene", "base"},
    "cli": {"distributed", "movie", "students", "renderers", "explanation", "formats", "picture", "plan", "run"}
    | {"viewer", "process", "scene", "base"},
    "bench": {"cli", "oracle", "students", "renderers", "reference", "formats", "picture", "plan", "run"}
    | {"process", "numbers", "scene", "base"},
}


@cache
def tree_of(path: Path) -> ast.Module:
    """A module's syntax, which several tests look through."""
    return ast.parse(path.read_text("utf-8"))


def rooms() -> set[str]:
    return {path.relative_to(ROOT / "cltrace").parts[0] for path in MODULES if path.parent != ROOT / "cltrace"}


@pytest.mark.parametrize("room", BELOW)
def test_no_room_imports_what_is_above_it(room: str) -> None:
    for path in (ROOT / "cltrace" / room).rglob("*.py"):
        imported = set(re.findall(r"^\s*from cltrace\.(\w+)", path.read_text("utf-8"), re.MULTILINE))
        assert imported <= BELOW[room] | {room}, path.name


def test_all_rooms_have_their_place() -> None:
    assert rooms() == BELOW.keys()
    # A room that another one may import does not import that one, also not by way of a third.
    for room in BELOW:
        reached, left = set(), set(BELOW[room])
        while left:
            reached |= left
            left = {name for each in left for name in BELOW[each]} - reached
        assert room not in reached


def test_the_top_holds_the_doors_alone() -> None:
    assert {path.stem for path in (ROOT / "cltrace").glob("*.py")} == {"__init__", "__main__", "api"}


def test_the_project_holds_its_folders_and_papers_alone() -> None:
    """A trial of the reader once left its scene here, 430 kB, and it was committed."""
    if not (ROOT / ".git").exists() or not shutil.which("git"):
        pytest.skip("these files are no clone, or there is no git to tell which are the project's")
    tracked = subprocess.run(
        ["git", "-c", "safe.directory=*", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert {name.split("/")[0] for name in tracked.splitlines()} == {
        *("cltrace", "kernels", "scenes", "tests", "docs", "pyproject.toml", "README.md"),
        *("LICENSE", "CHANGELOG.md", "CITATION.cff", ".ci", ".clang-format", ".gitignore"),
    }


def test_the_map_names_all_rooms() -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    assert {room for room in rooms() if f"`cltrace/{room}/`" not in text} == set()


def test_a_wheel_has_all_packages() -> None:
    """A clone finds a package that pyproject.toml leaves out; what pip installs does not."""
    told = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["setuptools"]["packages"]
    there = {".".join(path.parent.relative_to(ROOT).parts) for path in MODULES}
    assert sorted(told) == sorted(there | {"cltrace.kernels"})


def test_tests_have_a_folder_for_each_room() -> None:
    folders = {path.parent.name for path in (ROOT / "tests").glob("*/test_*.py")}
    assert folders <= rooms() | {"kernels"}


def test_modules_say_what_they_hold() -> None:
    assert [path for path in MODULES if path.stat().st_size and not ast.get_docstring(tree_of(path))] == []


class Function(NamedTuple):
    """file: from the project's root; lines: from its first to its last one; arguments: without self; types: theirs, of
    kernels alone."""

    file: str
    name: str
    lines: int
    arguments: int
    types: tuple[str, ...] = ()


def python_functions() -> Iterator[Function]:
    for path in MODULES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                of = node.args
                names = [a.arg for a in (*of.posonlyargs, *of.args, *of.kwonlyargs) if a.arg not in ("self", "cls")]
                lines = (node.end_lineno or 0) - node.lineno + 1
                yield Function(path.relative_to(ROOT).as_posix(), node.name, lines, len(names))


def blank(match: re.Match[str]) -> str:
    """As many lines with nothing on them."""
    return re.sub(r"[^\n]", " ", match[0])


def code_of(path: Path) -> str:
    """A kernel's file without comments, with all its lines."""
    return re.sub(r"/\*.*?\*/", blank, path.read_text("utf-8"), flags=re.DOTALL)


DIRECTIVE = re.compile(r"^[ \t]*#(?:.*\\\n)*.*$", re.MULTILINE)
DEFINITION = re.compile(
    r"^(?:static|__kernel|inline|INLINE)\b[^;{}=]*?\b(\w+)\s*\(((?:[^(){};]|\([^()]*\))*)\)\s*\{", re.MULTILINE
)


def kernel_functions() -> Iterator[Function]:
    """Those of all kernels' files. Arguments of entry points are not counted: buffers cannot be in a struct."""
    for path in KERNELS:
        text = re.sub(r"__attribute__\s*\(\([^()]*\)\)", blank, DIRECTIVE.sub(blank, code_of(path)))
        for match in DEFINITION.finditer(text):
            depth, end = 1, match.end()
            while depth and end < len(text):
                depth += {"{": 1, "}": -1}.get(text[end], 0)
                end += 1
            own = [] if match[0].startswith("__kernel") or not match[2].strip() else match[2].split(",")
            types = tuple(" ".join(re.findall(r"\w+|\*", of)[:-1]).replace("const ", "") for of in own)
            lines = text.count("\n", match.start(), end) + 1
            yield Function(path.relative_to(ROOT).as_posix(), match[1], lines, len(own), types)


# Reasons for exceptions.
PUBLIC = "each argument is a keyword of what users call"
OPEN = "to be divided: it has no reason but that nobody has done it yet"
# Functions of more than LINES lines, with the reason.
LONG: dict[tuple[str, str], str] = {
    ("cltrace/scene/scene.py", "from_spheres"): PUBLIC,
}
# In each room of the kernels, at most so many functions with alike arguments. They are OPEN, all of them.
ALIKE_IN_KERNELS = {
    "shapes": 37,
    "average": 9,
    "find": 9,
    "render.cl": 4,
    "samples": 3,
    "shade": 3,
    "output.cl": 2,
    "textbook.cl": 1,
}
# Functions with more than ARGUMENTS arguments, with the reason.
WIDE: dict[tuple[str, str], str] = {
    ("cltrace/bench/regimes.py", "limbs"): OPEN,
    ("cltrace/movie/animate.py", "animate"): PUBLIC,
    ("cltrace/picture/image.py", "__init__"): PUBLIC,
    ("cltrace/renderers/renderer.py", "__init__"): PUBLIC,
    ("cltrace/renderers/all_devices.py", "render"): PUBLIC,
    ("cltrace/renderers/renderer.py", "update"): PUBLIC,
    ("cltrace/scene/camera.py", "__init__"): PUBLIC,
    ("cltrace/scene/camera.py", "fit"): PUBLIC,
    ("cltrace/scene/materials.py", "__init__"): PUBLIC,
    ("cltrace/scene/meshes.py", "__init__"): PUBLIC,
    ("cltrace/scene/meshes.py", "of"): PUBLIC,
    ("cltrace/scene/scene.py", "__init__"): PUBLIC,
    ("cltrace/scene/scene.py", "from_spheres"): PUBLIC,
    ("cltrace/viewer/view.py", "view"): PUBLIC,
}


def test_functions_fit_a_screen() -> None:
    functions = [*python_functions(), *kernel_functions()]
    assert len(functions) > 1500
    assert {f[:2] for f in functions if f.lines > LINES} == LONG.keys()


def test_functions_take_few_arguments() -> None:
    functions = [*python_functions(), *kernel_functions()]
    assert {f[:2] for f in functions if f.arguments > ARGUMENTS} == WIDE.keys()


def conditions(text: str) -> Iterator[tuple[int, int, int]]:
    """The line of each branch of an #if that is no whole: within parentheses, or with a brace of which one end is
    elsewhere. Lines are counted from 1, and with them come the depths of parentheses and braces there."""
    open_: list[tuple[int, int]] = []
    round_ = curly = 0
    for number, line in enumerate(text.split("\n"), 1):
        word = re.match(r"[ \t]*#[ \t]*(if|ifdef|ifndef|else|elif|endif)\b", line)
        if word:
            if word[1].startswith("if"):
                open_.append((round_, curly))
                if round_:
                    yield number, round_, curly
            else:
                if (round_, curly) != open_[-1]:
                    yield number, round_, curly
                round_, curly = open_[-1]
                if word[1] == "endif":
                    open_.pop()
        elif not re.match(r"[ \t]*#", line):
            round_ += line.count("(") - line.count(")")
            curly += line.count("{") - line.count("}")


def test_conditions_stand_around_wholes() -> None:
    """A variant is a whole function, a whole statement or a whole file."""
    found = {}
    for path in KERNELS:
        text = re.sub(r"^([ \t]*#define\b(?:.*\\\n)*.*)$", blank, code_of(path), flags=re.MULTILINE)
        if split := list(conditions(text)):
            found[path.relative_to(ROOT / "kernels").as_posix()] = len(split)
    assert found == {}


def test_kernels_have_few_conditions() -> None:
    count = sum(
        len(re.findall(r"^[ \t]*#[ \t]*(?:if|ifdef|ifndef)\b", path.read_text("utf-8"), re.M)) for path in KERNELS
    )
    assert count <= CONDITIONS


class Signature(NamedTuple):
    """What may be passed by position: types, without self; home: the module, from the project's root."""

    home: str
    types: list[str]


def fields_of(of: ast.ClassDef, classes: dict[str, ast.ClassDef]) -> list[ast.AnnAssign]:
    """A class's fields, those of its bases first."""
    bases = [classes[base.id] for base in of.bases if isinstance(base, ast.Name) and base.id in classes]
    own = [n for n in of.body if isinstance(n, ast.AnnAssign) and "ClassVar" not in ast.unparse(n.annotation)]
    return [field for base in bases if base is not of for field in fields_of(base, classes)] + own


def signatures() -> dict[str, list[Signature]]:
    """Those of all functions, methods and classes, by name."""
    found: dict[str, list[Signature]] = {}
    trees = {path.relative_to(ROOT).as_posix(): tree_of(path) for path in MODULES}
    classes = {n.name: n for tree in trees.values() for n in ast.walk(tree) if isinstance(n, ast.ClassDef)}
    for home, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                named = [a for a in (*node.args.posonlyargs, *node.args.args) if a.arg not in ("self", "cls")]
            elif isinstance(node, ast.ClassDef):
                named = fields_of(node, classes)
                for method in node.body:
                    if isinstance(method, ast.FunctionDef) and method.name == "__init__":
                        named = method.args.args[1:]
            else:
                continue
            types = [ast.unparse(a.annotation) if a.annotation else "" for a in named]
            found.setdefault(node.name, []).append(Signature(home, types))
    return found


def by_position(node: ast.Call, types: list[str]) -> list[str]:
    """The types of what a call passes by position. What has a star may be all that has no keyword."""
    starred = any(isinstance(argument, ast.Starred) for argument in node.args)
    return types[: len(types) - len(node.keywords) if starred else len(node.args)]


def test_alike_arguments_have_names() -> None:
    """Of more than four arguments by position, no two have one type: they could be interchanged, and nobody would see.

    A function is looked for by its name, in the same module first.
    """
    every, found = signatures(), []
    for path in MODULES:
        if "bench" in path.parts:  # which may have what it likes
            continue
        home = path.relative_to(ROOT).as_posix()
        tree = tree_of(path)
        classes = {id(n): of.name for of in ast.walk(tree) if isinstance(of, ast.ClassDef) for n in ast.walk(of)}
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call) or not isinstance(node.func, (ast.Name, ast.Attribute)):
                continue
            name = node.func.id if isinstance(node.func, ast.Name) else node.func.attr
            called = every.get(classes.get(id(node), "") if name == "cls" else name, [])
            called = [of for of in called if of.home == home] or called
            passed = [by_position(node, of.types) for of in called if len(of.types) >= len(node.args)]
            if passed and all(len(types) > 4 and len(set(types)) < len(types) for types in passed):
                found.append(f"{home}:{node.lineno}: {name}")
    assert found == []


def test_functions_of_kernels_take_unlike_arguments() -> None:
    found = Counter[str]()
    for function in kernel_functions():
        alike = len(function.types) > 4 and len(set(function.types)) < len(function.types)
        found[function.file.split("/")[1]] += alike
    assert {room: count for room, count in found.items() if count > ALIKE_IN_KERNELS.get(room, 0)} == {}


def test_kernel_and_reference_have_the_same_algorithm() -> None:
    """The same functions in the same order, so that the two can be read side by side. The kernel fits two screens."""
    kernel = ROOT / "kernels" / "trace.cl"
    ours = [match[1] for match in DEFINITION.finditer(DIRECTIVE.sub(blank, code_of(kernel)))]
    tree = tree_of(ROOT / "cltrace" / "reference" / "trace.py")
    assert ours == [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
    assert ours[0] == "primary_ray"
    assert ours[-1] == "trace"
    assert len(kernel.read_text("utf-8").splitlines()) <= 120


def test_mutations_find_their_text() -> None:
    texts = [path.read_text("utf-8") for path in (*KERNELS, *MODULES)]
    for mutation in MUTATIONS:
        assert sum(len(pattern_of(mutation.text).findall(text)) for text in texts) == 1, mutation.text


def test_the_reference_knows_shapes_by_its_table_alone() -> None:
    shapes = {"ball", "crossing", "cut", "cylinder", "ellipsoid", "equation", "face", "round", "sphere", "triangles"}
    # groups.py bounds the way of a ray, as crossing.py does.
    allowed = {"groups": {"crossing"}, "shapes": {"cut", "cylinder", "sphere", "triangles"}, "__init__": shapes}
    for path in (ROOT / "cltrace" / "reference").glob("*.py"):
        if path.stem not in shapes:
            imported = set(re.findall(r"^from cltrace\.reference\.(\w+)", path.read_text("utf-8"), re.MULTILINE))
            assert imported & shapes <= allowed.get(path.stem, set()), path.name


def test_types_of_a_program_stand_once() -> None:
    """Some programs alone have both files, and would not compile. Of the two outlines, a program has one: of spheres,
    or of ellipsoids, too."""
    texts = ((ROOT / "kernels" / name).read_text("utf-8") for name in SOURCES if name != "abi")
    names = Counter(name for text in texts for name in re.findall(r"^\} (\w+);", text, re.MULTILINE))
    assert [name for name, count in names.items() if count > 1] == ["Outline"]

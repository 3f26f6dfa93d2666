"""The layers of the package: which folder may import which, and that kernel and reference name their steps alike."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MODULES = sorted((ROOT / "cltrace").rglob("*.py"))

# What each folder may import, beside itself.
BELOW = {
    "base": set(),
    "process": {"base"},
    "scene": {"base"},
    "exact": {"scene", "base"},
    "formats": {"scene", "base"},
    "plan": {"scene", "base"},
    "run": {"plan", "scene", "base"},
    "picture": {"scene", "base"},
    "renderers": {"oracle", "reference", "exact", "run", "plan", "picture", "scene", "base"},
    "reference": {"exact", "scene", "base"},
    "explanation": {"reference", "exact", "scene", "base"},
    "oracle": {"reference", "exact", "scene", "base"},
    "students": {"renderers", "explanation", "reference", "formats", "picture", "plan", "run", "scene", "base"},
    "movie": {"renderers", "run", "plan", "picture", "scene", "base"},
    "distributed": {"movie", "renderers", "run", "plan", "picture", "process", "scene", "base"},
    "viewer": {"movie", "students", "renderers", "explanation", "picture", "run", "plan", "scene", "base"},
    "cli": {"distributed", "movie", "students", "renderers", "explanation", "formats", "picture", "plan", "run"}
    | {"viewer", "process", "scene", "base"},
    "bench": {"cli", "oracle", "students", "renderers", "reference", "formats", "picture", "plan", "run"}
    | {"process", "scene", "base"},
}


def folders() -> set[str]:
    return {path.relative_to(ROOT / "cltrace").parts[0] for path in MODULES if path.parent != ROOT / "cltrace"}


@pytest.mark.parametrize("folder", BELOW)
def test_no_folder_imports_one_above_it(folder: str) -> None:
    for path in (ROOT / "cltrace" / folder).rglob("*.py"):
        imported = set(re.findall(r"^\s*from cltrace\.(\w+)", path.read_text("utf-8"), re.MULTILINE))
        assert imported <= BELOW[folder] | {folder}, path.name


def test_no_cycles_between_folders() -> None:
    assert folders() == BELOW.keys()
    for folder in BELOW:
        reached, left = set(), set(BELOW[folder])
        while left:
            reached |= left
            left = {name for each in left for name in BELOW[each]} - reached
        assert folder not in reached


def test_a_wheel_has_all_packages() -> None:
    """A clone finds a package that pyproject.toml leaves out; what pip installs does not."""
    told = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["setuptools"]["packages"]
    there = {".".join(path.parent.relative_to(ROOT).parts) for path in MODULES}
    assert sorted(told) == sorted(there | {"cltrace.kernels"})


def test_kernel_and_reference_name_their_steps_alike() -> None:
    """The same functions in the same order, so that the two can be read side by side."""
    text = re.sub(r"/\*.*?\*/", "", (ROOT / "kernels" / "trace.cl").read_text("utf-8"), flags=re.DOTALL)
    text = re.sub(r"__attribute__\s*\(\([^()]*\)\)", "", text)
    kernel = re.findall(r"^(?:static|inline|INLINE)\b[^;{}=()]*?\b(\w+)\s*\([^;{}]*\)\s*\{", text, re.MULTILINE)
    tree = ast.parse((ROOT / "cltrace" / "reference" / "trace.py").read_text("utf-8"))
    assert kernel == [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
    assert (kernel[0], kernel[-1]) == ("primary_ray", "trace")

"""The README and the documentation agree with what is there. CI runs their commands; this is seen at once."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from readme import FILES, ROOT, blocks, commands, outputs

import cltrace
from cltrace import cli
from cltrace.base import limits
from cltrace.bench import cli as bench
from cltrace.formats import surfaces
from cltrace.students.check import DEFAULT_PIXELS, DEFAULT_TESTS

PROSE = [*FILES, ROOT / "CHANGELOG.md"]


@pytest.mark.parametrize("file", PROSE, ids=lambda file: file.name)
def test_links_lead_somewhere(file: Path) -> None:
    for link in re.findall(r"\]\(([^)#]+)", file.read_text("utf-8")):
        assert link.startswith("https://") or (file.parent / link).exists(), link


@pytest.mark.parametrize("file", PROSE, ids=lambda file: file.name)
def test_files_and_options_exist(file: Path) -> None:
    """Whatever is set as code and looks like a path of this repository, or like a long option of a command."""
    text = file.read_text("utf-8")
    tops = "cltrace|kernels|scenes|tests|docs"
    for path in re.findall(rf"`((?:{tops})/[\w./-]*)`", text):
        assert path.endswith("...") or (ROOT / path).exists(), path
    options = cli.parser().format_help() + bench.parser().format_help()
    for option in re.findall(r"`(?:cltrace[\w-]* )?(--[a-z-]+)", text):
        assert option in options, option


def test_limits_and_names_are_those_of_the_code() -> None:
    texts = {file.name: " ".join(file.read_text("utf-8").split()) for file in FILES}
    for name in ("README.md", "python.md"):
        assert f"{limits.MAX_LIGHTS:,} " in texts[name]
    for name in ("command.md", "python.md"):
        assert f"{limits.MAX_SIDE:,} pixels a side and 2^{limits.MAX_PIXELS.bit_length() - 1} " in texts[name]
    spheres = f"2^{limits.MAX_SPHERES.bit_length() - 1} ({limits.MAX_SPHERES // 10**6} million)"
    assert f"{spheres} spheres" in texts["python.md"]
    assert limits.MAX_TRIANGLES == limits.MAX_VERTICES
    for row in (
        f"a scene's file, a texture's | {limits.SCENE_BYTES // 2**30} GiB",
        f"a mesh's file | {limits.MESH_BYTES // 2**30} GiB",
        f"steps of a transform | {limits.MAX_STEPS:,}",
        f"lights | {limits.MAX_LIGHTS:,}",
        f"spheres | {spheres}",
        f"meshes | {limits.MAX_MESHES:,}",
        f"cylinders | 2^{limits.MAX_CYLINDERS.bit_length() - 1}",
        f"triangles and vertices of all meshes | 2^{limits.MAX_TRIANGLES.bit_length() - 1} each",
        f"triangles of meshes whose files are named again | 2^{limits.INSTANCES.bit_length() - 1}",
        f"pixels of all textures | 2^{limits.MAX_TEXELS.bit_length() - 1}",
        f"`max_bounces` | {limits.MAX_BOUNCES}",
        f"pixels a side | {limits.MAX_SIDE:,}",
        f"pixels of a picture | 2^{limits.MAX_PIXELS.bit_length() - 1}",
    ):
        assert f"| {row} |" in texts["format.md"]
    assert limits.SCENE_BYTES == limits.TEXTURE_BYTES
    assert f"after {limits.MAX_UNREADABLE:,} that cannot be read" in texts["format.md"]
    assert f"{1 / surfaces.MAX_SIZE:.2g}..{surfaces.MAX_SIZE:.2g}".replace("e+", "e") in texts["format.md"]
    assert f"{DEFAULT_PIXELS:,} pixels, but no more than {DEFAULT_TESTS:,} divided" in texts["command.md"]


def test_the_version_is_told_everywhere() -> None:
    assert f"\nversion: {cltrace.__version__}\n" in (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"\n## [{cltrace.__version__}]" in (ROOT / "CHANGELOG.md").read_text("utf-8")


def test_every_page_is_on_the_map() -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    for file in FILES[1:]:
        assert f"(docs/{file.name})" in readme


def test_there_is_something_to_run_and_it_is_python() -> None:
    for file in FILES:
        compile("\n".join(blocks(file, "python")), file.name, "exec")
    script = "\n".join(map(commands, FILES))
    assert ".venv/bin/cltrace scenes/room.xml\n" in script
    assert "cltrace.Scene.from_spheres(" in script
    assert "cltrace.Scene.from_meshes(" in script
    # What CI runs comes from fenced blocks: one that is spelt otherwise would be left out in silence.
    for file in FILES:
        fences = re.findall(r"^```(\w*)$", file.read_text("utf-8"), re.MULTILINE)
        assert set(fences[0::2]) <= {"bash", "python", "text"}
        assert set(fences[1::2]) <= {""}


@pytest.mark.slow
@pytest.mark.parametrize("file", [file for file in FILES if outputs(file)], ids=lambda file: file.name)
def test_outputs_are_what_the_commands_print(file: Path, tmp_path: Path) -> None:
    """A line of three dots stands for any number of lines."""
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    for name, module in (("python", ""), ("cltrace", "-m cltrace")):
        script = tmp_path / ".venv" / "bin" / name
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" {module} "$@"\n')
        script.chmod(0o755)
    for name in ("scenes", "tests"):
        (tmp_path / name).symlink_to(ROOT / name)
    assert len(outputs(file)) == len(blocks(file, "text"))
    for block, text in outputs(file):
        run = ["bash", "-euo", "pipefail", "-c", block]
        done = subprocess.run(run, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=True)
        pattern = re.escape(text.strip()).replace(re.escape("\n...\n"), "\n(?:.*\n)*")
        assert re.fullmatch(pattern, done.stdout.decode().strip()), f"{block}\n{done.stdout.decode()}"

"""What the kernel takes of GPUs, without one: registers, stack and code of programs that scenes/ need.

`python tests/gpu_offline.py [write]` compiles them for NVIDIA's sm_90 and AMD's gfx1030, prints what differs from
tests/kernels/gpu_offline.json, and writes that, if asked to. It takes Debian's clang-15, libclc-15 and
rocm-device-libs, and `pip install nvidia-cuda-nvcc-cu12==12.9.86`, whose ptxas is the one that counts registers.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import cltrace
from cltrace.plan.abi import Precision
from cltrace.plan.plan import Plan
from cltrace.plan.request import Request
from cltrace.plan.view import CameraView
from cltrace.plan.world import ScenePacking
from cltrace.run.executor import BOTH, FIRST, is_in_stages
from cltrace.run.program import source

ROOT = Path(__file__).parent.parent
TABLE = ROOT / "tests" / "kernels" / "gpu_offline.json"
COMPILER = "clang-15"
CLANG = (
    COMPILER,
    "-x",
    "cl",
    "-cl-std=CL1.2",
    "-cl-fp32-correctly-rounded-divide-sqrt",
    "-Xclang",
    "-finclude-default-header",
    "-O3",
    "-w",
    "-S",
)
BUILTINS, DEVICE_LIBS = Path("/usr/lib/clc/nvptx64--nvidiacl.bc"), Path("/usr/lib/x86_64-linux-gnu/amdgcn/bitcode")
FRONT = ("-target-feature", "+ptx75", "-target-cpu", "sm_80", "-mlink-builtin-bitcode", str(BUILTINS))
SM_90 = ("-target", "nvptx64-nvidia-nvcl", *(part for word in FRONT for part in ("-Xclang", word)))
GFX1030 = ("-target", "amdgcn-amd-amdhsa", "-mcpu=gfx1030", f"--rocm-device-lib-path={DEVICE_LIBS}")
Figures = dict[str, int]
# Spheres, meshes, mirrors, and nearly all that there is.
SCENES = ("first", "step4-meshes", "four-mirrors", "room")


class Program(NamedTuple):
    """One program. name: a scene that needs it, and the precision; options: the compiler's."""

    name: str
    options: tuple[str, ...]


def ptxas() -> Path | None:
    """NVIDIA's assembler, of its wheel."""
    package = find_spec("nvidia")
    folders = (package and package.submodule_search_locations) or ()
    beside = [Path(folder, "cuda_nvcc", "bin", "ptxas") for folder in folders]
    return next((path for path in beside if path.is_file()), None)


def missing() -> str:
    """What is not installed; nothing where all is there."""
    there = {
        COMPILER: shutil.which(COMPILER) is not None,
        "libclc-15": BUILTINS.is_file(),
        "rocm-device-libs": DEVICE_LIBS.is_dir(),
        "ptxas": ptxas() is not None,
    }
    return ", ".join(name for name, found in there.items() if not found)


def programs() -> Iterator[Program]:
    """Those of SCENES on a device that renders one pixel in each work-item, both where there are two."""
    for name in SCENES:
        scene = cltrace.load(ROOT / "scenes" / f"{name}.xml")
        precisions: tuple[Precision, ...] = ("single", "accurate")
        for precision in precisions:
            request = Request(precision, ("rgb8",))
            world = ScenePacking.of(scene, request)
            plan = Plan.of(world, CameraView.of(world, scene.camera, request), request)
            options = ("-DW=1", "-DRUN=1", *plan.options())
            if not is_in_stages(1, precision):
                yield Program(f"{name}, {precision}", options)
                continue
            yield Program(f"{name}, {precision}", (*options, f"-D{BOTH}", f"-D{FIRST}"))
            yield Program(f"{name}, {precision}, undecided pixels", (*options, f"-D{BOTH}"))


def compiled(program: Program, folder: Path) -> dict[str, Figures]:
    """What a program takes of both GPUs: registers and stack of a work-item, in bytes, and bytes of code."""
    text, result = folder / "kernel.cl", folder / "kernel.s"
    text.write_text(source(), "utf-8")

    def assembler(target: tuple[str, ...]) -> str:
        subprocess.run([*CLANG, *target, *program.options, "-o", result, text], check=True, capture_output=True)
        return result.read_text("utf-8")

    return {"sm_90": _of_nvidia(assembler(SM_90), folder), "gfx1030": _of_amd(assembler(GFX1030))}


def _of_nvidia(ptx: str, folder: Path) -> Figures:
    file, binary = folder / "kernel.ptx", folder / "kernel.cubin"
    file.write_text(re.sub(r"(?m)^(\.target \w+),.*", r"\1", ptx), "utf-8")
    tool = ptxas()
    assert tool is not None
    done = subprocess.run([tool, "-v", "-arch=sm_90", file, "-o", binary], check=True, capture_output=True, text=True)
    said = done.stderr
    stacks = [int(size) for size in re.findall(r"(\d+) bytes stack frame", said)]
    spills = [int(size) for size in re.findall(r"(\d+) bytes spill stores", said)]
    registers = max(int(count) for count in re.findall(r"Used (\d+) registers", said))
    return {"registers": registers, "stack": max(stacks), "spilled": sum(spills), "code": binary.stat().st_size}


def _of_amd(text: str) -> Figures:
    def largest(name: str) -> int:
        return max(int(value) for value in re.findall(rf"; {name}\s*[:=] (\d+)", text))

    code = sum(int(size) for size in re.findall(r"; codeLenInByte = (\d+)", text))
    return {"registers": largest("NumVgprs"), "stack": largest("ScratchSize"), "code": code}


def measured() -> dict[str, dict[str, Figures]]:
    """All programs, by their names."""
    with tempfile.TemporaryDirectory() as folder:
        return {program.name: compiled(program, Path(folder)) for program in programs()}


def main() -> int:
    """Compares with the table, or writes it."""
    if missing():
        raise SystemExit(f"not installed: {missing()}")
    found, before = measured(), json.loads(TABLE.read_text("utf-8")) if TABLE.exists() else {}
    for name in sorted({*found, *before}):
        if found.get(name) != before.get(name):
            print(f"{name}: {before.get(name)} -> {found.get(name)}")
    if "write" in sys.argv:
        TABLE.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", "utf-8")
    return 0 if found == before else 1


if __name__ == "__main__":
    raise SystemExit(main())

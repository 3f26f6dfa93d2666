"""What programs take of GPUs is as in the table, on machines that have the compilers: see tests/gpu_offline.py."""

from __future__ import annotations

import json
from pathlib import Path

import gpu_offline
import pytest


@pytest.mark.slow
@pytest.mark.skipif(bool(gpu_offline.missing()), reason=f"not installed: {gpu_offline.missing()}")
def test_programs_take_what_the_table_says(tmp_path: Path) -> None:
    """Three that compile soon; `python tests/gpu_offline.py` compares all."""
    table = json.loads(gpu_offline.TABLE.read_text("utf-8"))
    every = {program.name: program for program in gpu_offline.programs()}
    assert every.keys() == table.keys()
    for name in ("first, single", "first, accurate", "step4-meshes, single"):
        assert gpu_offline.compiled(every[name], tmp_path) == table[name]


def test_the_table_has_both_gpus() -> None:
    table = json.loads(gpu_offline.TABLE.read_text("utf-8"))
    assert len(table) == 12
    assert all(figures.keys() == {"sm_90", "gfx1030"} for figures in table.values())
    nvidia = {name: figures["sm_90"] for name, figures in table.items()}
    assert all(figures["spilled"] == 0 for name, figures in nvidia.items() if name.endswith("single"))
    # What decides the pixels of simple scenes takes no memory of its own.
    simple = [f"{name}, {precision}" for name in ("first", "step4-meshes") for precision in ("single", "accurate")]
    assert all(nvidia[name]["stack"] == table[name]["gfx1030"]["stack"] == 0 for name in simple)
    for name, registers, stack in (("first", 128, 256), ("step4-meshes", 168, 1024), ("four-mirrors", 168, 1024)):
        figures = nvidia[f"{name}, accurate"]
        assert figures["registers"] <= registers
        assert figures["stack"] <= stack

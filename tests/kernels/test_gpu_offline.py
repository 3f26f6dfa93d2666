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
    assert len(table) == 8
    assert all(figures.keys() == {"sm_90", "gfx1030"} for figures in table.values())
    # Nothing of a simple picture in single precision is spilled.
    assert table["first, single"]["sm_90"]["spilled"] == table["first, single"]["gfx1030"]["stack"] == 0

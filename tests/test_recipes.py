"""The recipes of docs/scientists.md for other packages, with stand-ins for these."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from readme import ROOT, blocks

RECIPES = blocks(ROOT / "docs" / "scientists.md", "text")
PLACES, NUMBERS = np.arange(12.0).reshape(4, 3), np.array([8, 1, 1, 6])


def module(name: str, **contents: Any) -> ModuleType:
    made = ModuleType(name)
    made.__dict__.update(contents)
    return made


def stand_ins() -> dict[str, ModuleType]:
    particles = SimpleNamespace(position=PLACES, diameter=np.ones(4), typeid=NUMBERS)
    hoomd = module("gsd.hoomd", open=lambda name: [None, SimpleNamespace(particles=particles)])
    atoms = SimpleNamespace(positions=PLACES, numbers=NUMBERS, elements=np.array(["O", "H", "H", "C"]))
    io = module("ase.io", read=lambda name, index, format: {-1: atoms}[index])
    data = module("ase.data", covalent_radii=np.full(119, 0.5))
    universe = SimpleNamespace(select_atoms=lambda words: {"not water": atoms}[words])
    return {
        "gsd": module("gsd", hoomd=hoomd),
        "gsd.hoomd": hoomd,
        "ase": module("ase", io=io, data=data),
        "ase.io": io,
        "ase.data": data,
        "MDAnalysis": module("MDAnalysis", Universe=lambda name: universe),
    }


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.split()[1])
def test_recipes_make_arrays(recipe: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, made in stand_ins().items():
        monkeypatch.setitem(sys.modules, name, made)
    found: dict[str, Any] = {}
    exec(recipe, found)
    assert np.array_equal(found["x"], PLACES)
    assert np.unique(found["kinds"]).size == 3
    assert found.get("radii", np.full(4, 0.5)).tolist() == [0.5] * 4


def test_there_are_recipes() -> None:
    assert len(RECIPES) == 3

"""What the scripts of figures share: a scene in a studio, and its picture."""

from __future__ import annotations

import sys
from pathlib import Path

import cltrace


def in_studio(bare: cltrace.Scene, view: tuple[float, float, float], resolution: tuple[int, int]) -> cltrace.Scene:
    """The same scene, all of it seen from somewhere, in the light of lights="studio"."""
    camera = cltrace.Camera.fit(bare, view=view, resolution=resolution)
    return bare.seen_by(camera).lit_by("studio")


def save(scene: cltrace.Scene) -> None:
    """Draws it as the file that the command names, else beside the script, by its name."""
    path = sys.argv[1] if len(sys.argv) > 1 else Path(sys.argv[0]).with_suffix(".png")
    cltrace.render(scene, antialias=True).save(path)

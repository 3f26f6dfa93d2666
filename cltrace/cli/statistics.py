"""What --stats prints: times and counts."""

from __future__ import annotations

import json
from typing import Any

from cltrace.picture.image import Image
from cltrace.process.console import tell
from cltrace.renderers.renderer import Renderer


def statistics(renderer: Renderer, image: Image) -> dict[str, Any]:
    """Times and counts of a picture, by name; seconds. Counting the work renders it once more."""
    scene = renderer.scene
    width, height = renderer.region[2:]
    work = renderer.work()
    names = ("read", "pack", "lists", "build", "upload", "kernel", "readback", "write", "total")
    return {
        "device": renderer.device.name,
        "precision": renderer.precision,
        "size": [width, height],
        "spheres": len(scene.columns),
        "triangles": scene.triangles,
        "cylinders": len(scene.cylinders),
        "features": sorted(renderer.plan.features),
        "seconds": {name: image.seconds[name] for name in names},
        "rays": {"primary": width * height, "shadow": work["shadow rays traced"]},
        "work": work,
        "skipped": renderer.skipped,
    }


def show_statistics(stats: dict[str, Any], form: str) -> None:
    """Prints them: as lines on stderr, or as one JSON object on stdout where the form is json."""
    if form == "json":
        print(json.dumps(stats), flush=True)
        return
    tell(f"device     {stats['device']}")
    tell(f"precision  {stats['precision']}")
    more = "".join(f", {stats[name]} {name}" for name in ("triangles", "cylinders") if stats[name])
    tell(f"size       {stats['size'][0]}x{stats['size'][1]}, {stats['spheres']} spheres{more}")
    tell(f"features   {' '.join(stats['features'])}")
    for name, value in stats["seconds"].items():
        tell(f"{name:<10} {value * 1e3:10.2f} ms")
    for name, value in stats["rays"].items():
        tell(f"rays       {value:10d} {name}")
    for name, value in stats["work"].items():
        tell(f"work       {value:10d} {name}")
    for name, value in stats["skipped"].items():
        tell(f"skipped    {value:10d} {name}")

"""Pictures of all of scenes/ and of random scenes, in all ways, as hashes: for changes that are to change no picture.

`python tests/hashes.py FILE` writes them as JSON. `python tests/hashes.py FILE OTHER` prints what differs between two
of these, of two commits or two drivers, and the exit status is 1 if that is anything. Within a file, widths of packets
are held against the first one, and bytes of `accurate` against those of `double`.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import itertools
import json
import math
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from random_scenes import fuzzed_scene, fuzzed_tree, random_scene, random_tree

import cltrace
from cltrace.picture.image import Output
from cltrace.plan.abi import Precision
from cltrace.run.devices import Device, choose

ROOT = Path(__file__).parent.parent
OUTPUTS: tuple[Output, ...] = ("rgb8", "color", "id", "depth", "normal")
PRECISIONS: tuple[Precision, ...] = ("accurate", "single", "double")
SMALLER = 3  # times as small as its file says, a side, is a scene of scenes/
Hashes = dict[str, dict[str, dict[str, Any]]]  # by the scene's name, the way and the output


def scenes(random: int) -> Iterator[tuple[str, cltrace.Scene]]:
    """Those of scenes/, then so many of each kind of random ones."""
    for path in sorted((ROOT / "scenes").glob("*.xml")):
        scene = cltrace.load(path)
        size = tuple(max(1, n // SMALLER) for n in scene.camera.resolution)
        yield path.stem, scene.seen_by(replace(scene.camera, resolution=cast(tuple[int, int], size)))
    for make, seed in itertools.product((random_scene, fuzzed_scene, random_tree, fuzzed_tree), range(random)):
        yield f"{make.__name__} {seed}", make(seed)


def parallel(scene: cltrace.Scene) -> cltrace.Scene:
    """The same by parallel rays, as large where the camera looks at. Raises ValueError if that is too far away."""
    camera = scene.camera
    assert isinstance(camera, cltrace.Camera)
    (wide, high), turn = camera.resolution, math.tan(math.radians(camera.horizontal_fov))
    height = 2 * math.dist(camera.position, camera.lookat) * turn * high / wide
    aside = cltrace.Orthographic(
        camera.position, camera.lookat, camera.up, height, camera.resolution, camera.max_bounces
    )
    return scene.seen_by(aside)


def drawn(scene: cltrace.Scene, device: Device, **asked: Any) -> cltrace.Image | str:
    """The picture, or the words that refuse it."""
    try:
        return cltrace.Renderer(scene, device, outputs=OUTPUTS, **asked).render()
    except (cltrace.CltraceError, ValueError) as error:
        return str(error)


def hashed(image: cltrace.Image | str) -> dict[str, Any]:
    if isinstance(image, str):
        return {"refused": image}
    arrays = {name: np.ascontiguousarray(getattr(image, name)) for name in OUTPUTS}
    return {name: hashlib.sha256(array.tobytes()).hexdigest()[:16] for name, array in arrays.items()}


def pictures(scene: cltrace.Scene, device: Device, widths: list[int]) -> dict[str, dict[str, Any]]:
    """The hashes of one scene in all ways, and in how many bytes `accurate` and `double` differ."""
    found, bytes_of = {}, {}
    for precision, width in itertools.product(PRECISIONS, widths):
        image = drawn(scene, device, precision=precision, width=width)
        found[f"{precision} {width}"] = hashed(image)
        if width == widths[0] and isinstance(image, cltrace.Image):
            bytes_of[precision] = image.rgb8
    if {"accurate", "double"} <= set(bytes_of):
        one, other = bytes_of["accurate"], bytes_of["double"]
        found["bytes"] = {"all": one.size, "differing": int((one != other).sum())}
    found[f"smooth {widths[0]}"] = hashed(drawn(scene, device, width=widths[0], antialias=True))
    with contextlib.suppress(ValueError):
        scene = parallel(scene)
        for precision, width in (("accurate", widths[0]), ("single", widths[0]), ("accurate", widths[-1])):
            found[f"parallel {precision} {width}"] = hashed(drawn(scene, device, precision=precision, width=width))
        found[f"parallel smooth {widths[0]}"] = hashed(drawn(scene, device, width=widths[0], antialias=True))
    return found


def compared(one: Hashes, other: Hashes) -> int:
    """Prints how many pictures of two files differ, and which; says how many."""
    keys = [(name, way) for name in one for way in one[name] if way != "bytes" and way in other.get(name, {})]
    differing = 0
    for name, way in keys:
        a, b = one[name][way], other[name][way]
        outputs = sorted(key for key in a.keys() | b.keys() if a.get(key) != b.get(key))
        if outputs:
            differing += 1
            print(f"{name}, {way}: {', '.join(outputs)}")
    print(f"{differing} of {len(keys)} pictures differ")
    return differing


def judged(found: Hashes) -> int:
    """Prints which widths differ from the first one, and `accurate` from `double`; says how many pictures differ."""
    count = differing = 0
    for name, ways in found.items():
        first: dict[str, str] = {}
        for way in ways:
            kind = way.rpartition(" ")[0]
            if way == "bytes" or first.setdefault(kind, way) == way:
                continue
            count += 1
            if ways[way] != ways[first[kind]]:
                differing += 1
                print(f"{name}: {way} is not as {first[kind]}")
    print(f"{differing} of {count} pictures differ from those of the first width")
    told: dict[str, list[dict[str, int]]] = {}
    for name, ways in found.items():
        kind, _, seed = name.rpartition(" ")
        told.setdefault(kind if seed.isdigit() else "scenes/", []).append(ways.get("bytes", {"all": 0, "differing": 0}))
    for kind, rows in told.items():
        differ, every = (sum(row[key] for row in rows) for key in ("differing", "all"))
        print(f"{kind}: {differ} of {every} bytes of accurate are not those of double")
    return differing


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("other", type=Path, nargs="?")
    parser.add_argument("--device")
    parser.add_argument("--widths", default="16,8,1", help="of packets, with commas between them")
    parser.add_argument("--random", type=int, default=50, help="random scenes of each of four kinds")
    args = parser.parse_args()
    if args.other:
        return 1 if compared(json.loads(args.file.read_text()), json.loads(args.other.read_text())) else 0
    warnings.simplefilter("ignore", cltrace.SceneWarning)
    device, widths = choose(args.device), [int(width) for width in args.widths.split(",")]
    found = {name: pictures(scene, device, widths) for name, scene in scenes(args.random)}
    args.file.write_text(json.dumps(found, indent=1))
    print(device)
    return 1 if judged(found) else 0


if __name__ == "__main__":
    raise SystemExit(main())

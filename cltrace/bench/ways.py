"""What a user waits for: whole ways to a picture, in processes of their own, with their memory and what they read."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cltrace.run.devices import Device
from cltrace.scene import Scene

from .peers import PeerError
from .points import Way
from .scenes import Case
from .tracers import Tracer

NEW, AGAIN, ARRAYS, CAMERA, PLACES = WAYS = (
    "process to file, nothing compiled",
    "process to file",
    "arrays to first picture",
    "next camera",
    "next places",
)
FRAMES = 9
SECONDS = 120

# Starts a program, and says how long it took, its memory at the peak and what it has read, in bytes. It is small and
# starts the program without a copy of itself, since Linux counts the memory of who starts a program as that of it.
LAUNCHER = f"""
import json, os, resource, sys, time
resource.setrlimit(resource.RLIMIT_CPU, ({SECONDS}, {SECONDS}))
start = time.perf_counter()
silent = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
pid = os.posix_spawnp(sys.argv[1], sys.argv[1:], os.environ, file_actions=silent)
os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
seconds = time.perf_counter() - start
try:
    read = int(open(f"/proc/{{pid}}/io").readline().split()[1])
except OSError:
    read = None
_, status, used = os.wait4(pid, 0)
memory = used.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
print(json.dumps({{"seconds": seconds, "memory": memory, "read": read}}))
sys.exit(os.waitstatus_to_exitcode(status) != 0)
"""


@dataclass(frozen=True)
class Process:
    """One run of a program: seconds, bytes at the peak, bytes that it read."""

    seconds: float
    memory: int
    read: int | None


def process(command: Sequence[str], **environment: str) -> Process:
    """Runs a program to its end. Raises PeerError if it fails."""
    launcher = [sys.executable, "-I", "-S", "-c", LAUNCHER, *command]
    done = subprocess.run(launcher, capture_output=True, text=True, env=os.environ | environment, check=False)
    if done.returncode:
        last = (done.stderr.strip() or "no message").splitlines()[-1]
        raise PeerError(f"{Path(command[0]).name} failed: {last}")
    return Process(**json.loads(done.stdout))


def measure(
    case: Case,
    device: Device,
    peers: Sequence[Tracer],
    rounds: int,
    ways: list[Way],
    say: Callable[[str], None],
    *,
    new: bool = False,
) -> None:
    """Measures all ways to one scene's picture, in turn, round by round, and adds them to `ways`.

    new: also with nothing compiled, which takes longest.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first = len(ways)
        takers = [*_own(case.scene, device, folder), *_of_peers(case.scene, peers)][not new :]
        surfaces = len(case.scene.spheres) + case.scene.triangles
        for tracer, version, of, _ in takers:
            for way in of:
                ways.append(Way(case.name, surfaces, case.scene.camera.resolution, tracer, way, version))
        for number in range(rounds):
            for tracer, _, of, take in takers:
                mine = {w.way: k for k, w in enumerate(ways) if k >= first and w.tracer == tracer and w.way in of}
                if any(ways[k].note for k in mine.values()):
                    continue
                say(f"{tracer}, {of[0]}: round {number + 1} of {rounds}")
                try:
                    for way, found in take().items():
                        ways[mine[way]] = _with(ways[mine[way]], found)
                except PeerError as error:
                    for k in mine.values():
                        ways[k] = replace(ways[k], note=str(error))


def _with(way: Way, found: Process | float) -> Way:
    """A way with one round more."""
    if isinstance(found, float):
        return replace(way, seconds=(*way.seconds, found))
    memory = max(found.memory, way.memory or 0)
    return replace(way, seconds=(*way.seconds, found.seconds), memory=memory, read=found.read)


# What is taken at once: the tracer, its version, the ways, and what takes one round of them.
Taker = tuple[str, str, tuple[str, ...], Callable[[], dict[str, Process | float]]]


def _own(scene: Scene, device: Device, folder: Path) -> Iterator[Taker]:
    """The command with a scene file, and a script with arrays."""
    xml, arrays, picture = folder / "scene.xml", folder / "scene.npz", str(folder / "out.png")
    write_xml(scene, xml)
    view = [scene.camera.image_plane()[0], *scene.camera.resolution]
    spheres, materials = scene.spheres, scene.materials[scene.spheres["material"]]
    np.savez(arrays, view=view, centers=spheres["center"], radii=spheres["radius"], colors=materials["color"])
    command = [sys.executable, "-m", "cltrace", str(xml), "-o", picture, "-d", device.spec]
    script = [sys.executable, "-m", "cltrace.bench.user", str(arrays), picture, device.spec]

    def new() -> dict[str, Process | float]:
        with tempfile.TemporaryDirectory() as empty:
            caches = {"POCL_CACHE_DIR": f"{empty}/pocl", "XDG_CACHE_HOME": empty}
            (Path(empty) / "pocl").mkdir()
            return {NEW: process(command, **caches)}

    def inner() -> dict[str, Process | float]:
        done = subprocess.run([*script, str(FRAMES)], capture_output=True, text=True, check=False)
        if done.returncode:
            raise PeerError((done.stderr.strip() or "no message").splitlines()[-1])
        seconds: dict[str, Any] = json.loads(done.stdout)
        names = {ARRAYS: "first", CAMERA: "camera", PLACES: "places"}
        return {way: statistics.median(seconds[name]) for way, name in names.items()}

    yield "cltrace, scene file", "", (NEW,), new
    yield "cltrace, scene file", "", (AGAIN,), lambda: {AGAIN: process(command)}
    yield "cltrace, arrays", "", (AGAIN,), lambda: {AGAIN: process([*script, "0"])}
    yield "cltrace, arrays", "", (ARRAYS, CAMERA, PLACES), inner


def _of_peers(scene: Scene, peers: Sequence[Tracer]) -> Iterator[Taker]:
    """What their interfaces can say: from their own file to a picture's, and from the scene in memory to a picture."""
    for peer in peers:
        if peer.variant or peer.task != "frame" or peer.refuses(scene):
            continue
        if command := peer.command(scene):
            yield peer.name, peer.version, (AGAIN,), lambda command=command: {AGAIN: process(command)}  # type: ignore[misc]
        yield peer.name, peer.version, (ARRAYS,), lambda peer=peer: {ARRAYS: peer.run(scene, 1).whole}  # type: ignore[misc]


def write_xml(scene: Scene, path: Path) -> None:
    """Writes a scene of spheres in the light of scenes.WHITE_LIGHTS, seen from the origin along -z, as a scene file."""
    tan, (width, height) = scene.camera.image_plane()[0], scene.camera.resolution

    def numbers(names: str, values: Sequence[float]) -> str:
        return " ".join(f'{name}="{value!r}"' for name, value in zip(names, values, strict=True))

    def color(values: Sequence[float]) -> str:
        return f"<color {numbers('rgb', values)}/>"

    with path.open("w", encoding="ascii") as file:
        file.write(
            f'<scene output_file="scene.png"><background_color {numbers("rgb", scene.background)}/>'
            '<camera><position x="0" y="0" z="0"/><lookat x="0" y="0" z="-1"/><up x="0" y="1" z="0"/>'
            f'<horizontal_fov angle="{np.degrees(np.arctan(tan))}"/>'
            f'<resolution horizontal="{width}" vertical="{height}"/><max_bounces n="8"/></camera><lights>'
            f"<ambient_light>{color((1, 1, 1))}</ambient_light>"
            f"<point_light>{color((1, 1, 1))}<position {numbers('xyz', (5, 8, 2))}/></point_light></lights><surfaces>\n"
        )
        for center, radius, m in zip(
            scene.spheres["center"].tolist(),
            scene.spheres["radius"].tolist(),
            scene.materials[scene.spheres["material"]],
            strict=True,
        ):
            phong = f'<phong ka="{m["ka"]}" kd="{m["kd"]}" ks="{m["ks"]}" exponent="{m["exponent"]}"/>'
            rest = '<reflectance r="0"/><transmittance t="0"/><refraction iof="1"/>'
            look = f"<material_solid>{color(m['color'].tolist())}{phong}{rest}</material_solid>"
            file.write(f'<sphere radius="{radius!r}"><position {numbers("xyz", center)}/>{look}</sphere>\n')
        file.write("</surfaces></scene>\n")

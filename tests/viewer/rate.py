"""How fast the viewer is: `python tests/viewer/rate.py [class ...]`, in Chromium, which playwright drives.

While the camera is turned, for each class of scenes: pictures a second, and how long it is from an event to the picture
that counts it, median and 95 of 100. Then, of the first class: memory before and after 10,000 pictures, and the seconds
from Ctrl-C to the end. It counts on a machine that does nothing else.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import sync_playwright

SIZE = (960, 540)
SECONDS, FRAMES = 10.0, 10_000
# Spheres of a class, or triangles of a mesh, about so many.
CLASSES = {"1e4": 10**4, "1e5": 10**5, "1e6": 10**6, "mesh": 10**5}
# In the page: an event each time that the browser paints, and when each picture is on the screen. A picture says how
# many events it counts.
TURN = """async ([seconds, most]) => {
  const told = [], found = { pictures: 0, late: [] };
  const end = performance.now() + 1000 * seconds, before = window.counted;
  const picture = document.querySelector('#picture');
  window.shown = (number) => {
    found.pictures++;
    requestAnimationFrame(() => found.late.push(performance.now() - told[number - before - 1]));
  };
  while (performance.now() < end && found.pictures < most) {
    await new Promise(requestAnimationFrame);
    told.push(performance.now());
    picture.dispatchEvent(new KeyboardEvent('keydown', { key: told.length % 400 < 200 ? 'ArrowLeft' : 'ArrowRight',
      bubbles: true }));
  }
  window.shown = () => {};
  return found;
}"""
# The page's `shown` events pass by here.
HEARD = """
window.shown = () => {}; window.counted = 0;
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (text) {
  const event = JSON.parse(text);
  if (event.kind === 'shown') { window.counted = event.x; window.shown(event.x); }
  send.call(this, text);
};
"""


def program(name: str) -> str:
    """What serves a scene of a class: spheres in a box, or one mesh."""
    count = CLASSES[name]
    camera = f"cltrace.Camera.fit({{}}, resolution={SIZE})"
    lights = "[cltrace.ambient_light(), cltrace.point_light((5, 9, 8))]"
    start = f"import cltrace, numpy as np; first = cltrace.Camera((0, 0, 9), resolution={SIZE}); "
    if name == "mesh":
        side = round((count / 2) ** 0.5)
        made = (
            f"u, v = np.meshgrid(np.linspace(-1, 1, {side + 1}), np.linspace(-1, 1, {side + 1})); "
            f"w = {side + 1}; k = (np.arange({side})[:, None] * w + np.arange({side})).ravel(); "
            "corners = np.stack([u, 0.1 * np.sin(9 * u) * np.cos(7 * v), v], axis=-1).reshape(-1, 3); "
            "faces = np.concatenate([np.stack([k, k + w, k + 1], 1), np.stack([k + 1, k + w, k + w + 1], 1)]); "
            f"scene = cltrace.Scene.from_meshes(first, {lights}, cltrace.Mesh(corners, faces)); "
        )
    else:
        radius = 0.4 * (8 / count) ** (1 / 3)
        made = (
            f"x = np.random.default_rng(0).uniform(-1, 1, ({count}, 3)); "
            f"scene = cltrace.Scene.from_spheres(first, {lights}, x, {radius}); "
        )
    return f"{start}{made}cltrace.view(scene.seen_by({camera.format('scene')}))"


@contextmanager
def served(name: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process and its address."""
    env = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    line = [sys.executable, "-u", "-c", program(name)]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True, env=env) as process:
        try:
            assert process.stdout
            match = re.search(r"http\S+/", process.stdout.readline())
            assert match
            yield process, match[0]
        finally:
            process.kill()


def memory(process: subprocess.Popen[str]) -> float:
    """What it has in memory now, MB."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    return int(re.findall(r"VmRSS:\s+(\d+)", status)[0]) / 1024


def measured(browser: Any, name: str, whole: bool) -> None:
    """Prints the figures of a class. whole: also of memory and Ctrl-C."""
    with served(name) as (process, address):
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.add_init_script(HEARD)
        page.goto(address)
        page.wait_for_selector("#picture[data-kind=smooth]", timeout=600_000)
        page.evaluate(TURN, [3, FRAMES])  # as kernels of smaller pictures are compiled once
        page.wait_for_timeout(2000)
        found = page.evaluate(TURN, [SECONDS, FRAMES])
        median, most = np.percentile(found["late"], (50, 95))
        print(f"{name}: {found['pictures'] / SECONDS:.1f} pictures a second, {median:.0f}, {most:.0f} ms", flush=True)
        if whole:
            before = memory(process)
            pictures = 0
            while pictures < FRAMES:
                pictures += page.evaluate(TURN, [30, FRAMES - pictures])["pictures"]
            print(f"{name}: {before:.0f} MB before {pictures} pictures, {memory(process):.0f} MB after", flush=True)
            start = time.perf_counter()
            process.send_signal(signal.SIGINT)
            process.wait()
            print(f"{name}: {time.perf_counter() - start:.2f} s from Ctrl-C to the end")
        page.close()


def main() -> None:
    names = sys.argv[1:] or list(CLASSES)
    with sync_playwright() as play:
        chromium = shutil.which("chromium") or shutil.which("google-chrome")
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for name in names:
            measured(browser, name, whole=name == names[0])
        browser.close()


if __name__ == "__main__":
    main()

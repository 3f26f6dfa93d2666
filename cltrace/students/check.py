"""The self-check: an image against the reference tracer, pixel by pixel."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.base.progress import bar
from cltrace.picture.image import Image
from cltrace.reference import world_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.scene import AMBIENT, Scene
from cltrace.scene.colors import encoded

# Of a sample: at most this share may differ in its bytes by more than rounding, and this share by more than one level.
# A surface's number may never differ but in precision single, where float32 decides.
CONTRACT = {"accurate": (1e-4, 0.0, 0.0), "double": (1e-4, 0.0, 0.0), "single": (1.0, 1e-3, 1e-3)}
# Levels: 64 roundings of a colour of 255 levels, each by up to 2^-24 of it in float32, move it by less. So a byte may
# be the next one where the reference's own colour is as near to it. How many pixels that are is luck.
ROUNDING = 64 * 255 * 2.0**-24
DEFAULT_PIXELS = 20_000
# The reference tries every sphere for every ray, at some microseconds each, and for every light there is a ray. Where
# the default sample would take more tests than this, as from 200 spheres and one light on, it shrinks, and the report
# says so. Most triangles it rules out many at once.
DEFAULT_TESTS = 10_000_000
TRIANGLES, RAY = 64, 40  # So many triangles take as long as a sphere; a ray alone takes as long as so many spheres.


@dataclass(frozen=True)
class Report:
    """What the comparison found.

    pixels: how many were compared, of how many; wrong_ids, differing, off_by_more: numbers of pixels; rounded: how many
    of those that differ do so by ROUNDING; largest, rms: error of the bytes of a channel, in levels; where: the pixels
    (x, y) that break the contract, or would if they were more, the worst first; shrunk: why there are fewer pixels than
    usual, "" if there are not; ok: whether all is within the contract of that precision.
    """

    precision: str
    pixels: int
    of: int
    wrong_ids: int
    differing: int
    rounded: int
    off_by_more: int
    largest: int
    rms: float
    where: list[tuple[int, int]]
    shrunk: str

    @property
    def ok(self) -> bool:
        # One pixel may always differ by one level: of a small sample it would be more than the share.
        share, share_more, share_ids = CONTRACT[self.precision]
        return (
            self.differing - self.rounded <= max(1, share * self.pixels)
            and self.off_by_more <= share_more * self.pixels
            and self.wrong_ids <= share_ids * self.pixels
        )

    def __str__(self) -> str:
        verdict = "ok" if self.ok else "FAILED"
        lines = [
            f"check {verdict}: {self.pixels} of {self.of} pixels against the reference, precision {self.precision}: "
            f"{self.wrong_ids} other ids, {self.differing} other bytes, of which {self.rounded} by rounding and "
            f"{self.off_by_more} by more than a level; "
            f"error at most {self.largest} levels, RMS {self.rms:.2g}"
        ]
        if self.shrunk:
            lines.append(self.shrunk)
        if self.where:
            lines.append("at pixels " + ", ".join(f"({x}, {y})" for x, y in self.where))
        return "\n".join(lines)


def sample(index: NDArray[np.int32], pixels: int) -> NDArray[np.intp]:
    """`pixels` flat positions of an id image, or all: those with a neighbour of another id first, then at random.

    Always the same ones for the same picture.
    """
    if pixels >= index.size:
        return np.arange(index.size)
    edge = np.zeros(index.shape, bool)
    for a, b in (((slice(1, None), slice(None)), (slice(None, -1), slice(None))),
                 ((slice(None), slice(1, None)), (slice(None), slice(None, -1)))):  # fmt: skip
        differs = index[a] != index[b]
        edge[a] |= differs
        edge[b] |= differs
    order = np.random.default_rng(0).permutation(index.size)
    order = order[np.argsort(~edge.ravel()[order], kind="stable")]
    # A quarter of the sample at least is taken at random, so that surfaces and shadows get their share.
    edges = min(int(edge.sum()), pixels - pixels // 4)
    rest = np.flatnonzero(~edge.ravel()[order])
    return np.sort(np.concatenate([order[:edges], order[rest[: pixels - edges]]]))


def _affordable(scene: Scene, lights: int) -> int:
    """How many pixels take DEFAULT_TESTS, one at least. lights: that send shadow rays."""
    surfaces = len(scene.columns) + len(scene.cylinders) + scene.triangles // TRIANGLES
    return max(1, DEFAULT_TESTS // ((1 + lights) * (RAY + surfaces)))


def _shrunk(scene: Scene, lights: int, pixels: int, seconds: float) -> str:
    """What the reference took, in words."""
    counts = {"sphere": len(scene.columns), "triangle": scene.triangles, "light": lights}
    many = " and ".join(f"{count:,} {name}{'s' * (count > 1)}" for name, count in counts.items() if count)
    told = f"only {pixels} {'pixel was' if pixels == 1 else 'pixels were'} compared, as the reference takes"
    return f"{told} {1e3 * seconds / pixels:,.1f} ms a pixel for {many}; --check=N compares more"


def _traced(
    scene: Scene, places: list[tuple[int, int]], progress: bool | None
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The colours (n, 3) of some pixels (x, y), as they are written, and the numbers of what they show."""
    world, colors, ids = world_of(scene), np.empty((len(places), 3)), np.empty(len(places), np.int64)
    with bar(len(places), "pixel", progress) as shown:
        for i, (x, y) in enumerate(places):
            color, at = trace(world, primary_ray(scene.camera, x, y))
            colors[i], ids[i] = encoded(color, scene.transfer), at.index if at else -1
            shown.update()
    return colors, ids


def check(
    scene: Scene,
    image: Image,
    precision: str,
    pixels: int | None = None,
    origin: tuple[int, int] | None = None,
    truncate: bool = False,
    progress: bool | None = None,
) -> Report:
    """Compares `pixels` pixels of an image with the reference. None: 20,000, but fewer of scenes with many surfaces or
    lights.

    image: needs rgb8 and id; origin: its top left pixel within the full picture, None for a picture that is whole;
    progress: whether tqdm shows it after a second, None for a terminal and notebooks, if tqdm is installed. Raises
    ValueError for an image of another size, or without these outputs, and for fewer than one pixel.
    """
    if not {"rgb8", "id"} <= set(image.outputs):
        raise ValueError("check: the image must have rgb8 and id")
    size, full = image.id.shape[::-1], scene.camera.resolution
    if origin is None and size != full:
        raise ValueError(f"check: the image has {size[0]}x{size[1]} pixels, the camera {full[0]}x{full[1]}; see origin")
    if pixels is not None and pixels < 1:
        raise ValueError(f"pixels: must be at least 1, got {pixels!r}")
    lights = int((scene.lamps["kind"] != AMBIENT).sum())
    affordable = _affordable(scene, lights)
    chosen = sample(image.id, min(DEFAULT_PIXELS, affordable) if pixels is None else pixels)
    start = time.perf_counter()
    x0, y0 = origin or (0, 0)
    places = [(x0 + flat % size[0], y0 + flat // size[0]) for flat in chosen.tolist()]
    colors, ids = _traced(scene, places, progress)
    seconds = time.perf_counter() - start
    is_shrunk = pixels is None and affordable < min(DEFAULT_PIXELS, image.id.size)
    wrong = ids != image.id.ravel()[chosen]
    levels = 255 * colors.clip(0, 1) + (0.0 if truncate else 0.5)
    drawn = image.rgb8.reshape(-1, 3)[chosen].astype(np.int64)
    away = np.maximum(drawn - levels, levels - (drawn + 1)).max(axis=1)  # from the levels that a byte stands for
    errors = levels.astype(np.int64) - drawn
    error = np.abs(errors).max(axis=1)
    unlike = (error > 0) & (away > ROUNDING)
    bad = np.flatnonzero(wrong | (unlike if CONTRACT[precision][0] < 1 else error > 1))
    worst = bad[np.argsort(-error[bad], kind="stable")][:10]
    return Report(
        precision=precision,
        pixels=len(chosen),
        of=image.id.size,
        wrong_ids=int(wrong.sum()),
        differing=int((error > 0).sum()),
        rounded=int((error > 0).sum() - unlike.sum()),
        off_by_more=int((error > 1).sum()),
        largest=int(error.max(initial=0)),
        rms=float(np.sqrt(np.mean(np.square(errors, dtype=np.float64)))) if len(chosen) else 0.0,
        where=[places[i] for i in worst],
        shrunk=_shrunk(scene, lights, len(chosen), seconds) if is_shrunk else "",
    )

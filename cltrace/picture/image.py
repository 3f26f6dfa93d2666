"""The picture that comes back, and how it is shown and stored."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture

from cltrace.picture.files import whole_file

SHOWS = ("color", "normal", "direction", "depth", "id")


@dataclass(eq=False, repr=False)
class Image:
    """A rendered picture. Row 0 is the top. What was not asked for is None.

    rgb8: (h, w, 3) uint8, linear, no gamma; color: (h, w, 3) float32, linear, not clamped; normal: (h, w, 3) float32,
    unit, in the world, facing the camera, 0 where nothing was hit; direction: (h, w, 3) float32, of the pixel's ray,
    unit, in the world; depth: (h, w) float64, distance from the eye in scene units, inf where nothing was hit; id:
    (h, w) int32, the sphere's index, -1 = nothing; shadow_rays: (h, w) int32, to how many lights that may shine there,
    0 where there is but one sphere;
    work: (h, w, 8) int32, how often was done what layout.WORK names; seconds: what took how long.
    """

    rgb8: NDArray[np.uint8] | None = None
    color: NDArray[np.float32] | None = None
    normal: NDArray[np.float32] | None = None
    direction: NDArray[np.float32] | None = None
    depth: NDArray[Any] | None = None
    id: NDArray[np.int32] | None = None
    shadow_rays: NDArray[np.int32] | None = None
    work: NDArray[np.int32] | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    frame: Any = field(default=None, repr=False)  # the buffers it lives in, for Renderer.render(out)

    def __repr__(self) -> str:
        names = [f.name for f in fields(self) if isinstance(getattr(self, f.name), np.ndarray)]
        shape = getattr(self, names[0]).shape if names else (0, 0)
        return f"<cltrace.Image {shape[1]}x{shape[0]}: {', '.join(names)}>"

    @property
    def frame_seconds(self) -> float:
        """Of the kernel and of reading the picture back."""
        return self.seconds["kernel"] + self.seconds["readback"]

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"frame": None}  # buffers stay with their process

    def as_rgb8(self, show: str = "color") -> NDArray[np.uint8]:
        """(h, w, 3) bytes that show one of the outputs: what the debugging hints of the course ask for.

        normal, direction: (v + 1)/2 as red, green, blue, black where nothing was hit; depth: near is white, far is
        black; id: a colour for each sphere. ValueError if that output was not rendered.
        """
        values = {
            "color": self.rgb8,
            "normal": self.normal,
            "direction": self.direction,
            "depth": self.depth,
            "id": self.id,
        }
        if show not in values:
            raise ValueError(f"show: must be one of {', '.join(SHOWS)}, got {show!r}")
        value = values[show]
        if value is None:
            raise ValueError(f"show: the image has no {show}")
        if show == "color":
            return np.asarray(value, np.uint8)
        if show in ("normal", "direction"):
            bytes_ = np.rint((np.asarray(value, np.float64) + 1) * 127.5)
            hit = np.any(value != 0, axis=-1, keepdims=True)
            return np.where(hit, bytes_, 0).astype(np.uint8)
        if show == "depth":
            return _grey(np.asarray(value, np.float64))
        return _distinct(np.asarray(value, np.int32))

    def save(self, path: str | os.PathLike[str], show: str = "color") -> None:
        """Writes a PNG: completely, or not at all. OSError if that fails; the old file is then untouched.

        ValueError if the name does not end in .png. A link is written through.
        """
        target = Path(path)
        if target.suffix.lower() != ".png":
            raise ValueError(f"path: the picture is a PNG and its name must end in .png, got {str(path)!r}")
        with whole_file(target) as file:
            self.write_png(file, show)

    def write_png(self, file: BinaryIO, show: str = "color") -> None:
        """Writes a PNG to an open binary file."""
        # Level 1: a third of the time of the default level, for files that are a few per cent larger.
        Picture.fromarray(np.ascontiguousarray(self.as_rgb8(show))).save(file, "PNG", compress_level=1)

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        show = next((s for s in SHOWS if getattr(self, "rgb8" if s == "color" else s) is not None), "color")
        self.write_png(buffer, show)
        return buffer.getvalue()


def _grey(depth: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Depths as grey: the nearest 255, the farthest 32, nothing 0; linear in 1/depth."""
    hit = np.isfinite(depth)
    if not hit.any():
        return np.zeros((*depth.shape, 3), np.uint8)
    # In the reciprocal, what is near keeps its contrast, however far the horizon is.
    near, far = 1 / depth[hit].min(), 1 / depth[hit].max()
    share = (1 / np.where(hit, depth, 1 / far) - far) / (near - far if near > far else 1.0)
    grey = np.where(hit, np.rint(32 + 223 * share), 0).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=-1)


def _distinct(index: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Indices as colours that differ for neighbours: the bits of index times an odd constant; -1 is black."""
    mixed = ((index.astype(np.uint64) + 1) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    colors = np.stack([(mixed >> np.uint64(s)) & np.uint64(255) for s in (16, 8, 0)], axis=-1)
    return np.where(index[..., None] < 0, 0, 64 + colors * 3 // 4).astype(np.uint8)

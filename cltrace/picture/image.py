"""The picture that comes back, and how it is shown and stored."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from cltrace.base.arrays import by_rows
from cltrace.picture import palettes
from cltrace.picture.files import is_named_as_folder, whole_file
from cltrace.picture.storing import CHANNELS, FORMATS, SIZED, Writer, check_format, write_pillow, writer
from cltrace.scene.colors import Transfer, encoded

Output = Literal[
    "rgb8",
    "color",
    "normal",
    "direction",
    "depth",
    "id",
    "primitive",
    "uv",
    "error",
    "coverage",
    "shadow_rays",
    "work",
    "rgba8",
    "alpha",
]
Show = Literal["color", "normal", "direction", "depth", "id", "primitive", "uv"]
OUTPUTS: tuple[Output, ...] = get_args(Output)
SHOWS: tuple[Show, ...] = get_args(Show)
LIT = "lit"  # what is shown beside these: which lights reach what, see cltrace/students/lit.py
# What the command writes into EXR and NPZ unless told otherwise.
USUAL: tuple[Output, ...] = ("color", "alpha", "depth", "normal", "id")
DIRECTED: tuple[Show, ...] = ("normal", "direction")


class Image:
    """A rendered picture of w x h pixels. Row 0 is the top.

    It has those outputs that were asked for, each a numpy array:

        rgb8         (h, w, 3) uint8    colour in bytes: linear, without gamma, or as sRGB, as transfer says
        color        (h, w, 3) float32  linear colour, 1 is full, not clamped
        normal       (h, w, 3) float32  unit vector in the world, facing the camera; 0 where nothing was hit
        direction    (h, w, 3) float32  unit vector of the pixel's ray, in the world
        depth        (h, w) float64     distance from the eye, or from an Orthographic camera's plane, in scene
                                        units; inf where nothing was hit
        id           (h, w) int32       number of the surface in the scene; -1 where nothing was hit
        primitive    (h, w) int32       number of the triangle within its mesh; -1 on spheres and where nothing was hit
        uv           (h, w, 2) float32  where the point is on a texture, not wrapped; 0 where nothing was hit
        error        (h, w) float32     an estimate of what the mean colour is off by, in levels of 255
        coverage     (h, w) float32     the share of the pixel that surfaces cover: see below
        shadow_rays  (h, w) int32       to how many lights a shadow ray was sent; 0 for a single sphere from outside
        work         (h, w, k) int32    how often the pixel did what each of COUNTERS in plan/abi.py names
        rgba8        (h, w, 4) uint8    rgb8, and straight alpha: 255 on surfaces, elsewhere the background's
        alpha        (h, w) float32     the same alpha, from 0 to 1

    Alpha is 1 wherever the pixel's ray meets a surface, also one of glass, and the background's where it meets none.
    Colours are those in front of an opaque background, and not multiplied by it.

    u and v, from the left and from the top, are 1 where a texture begins anew. On a sphere they are made of the unit
    normal n that it had before its transform: 1/2 + atan2(n.x, n.z) / (2 pi) and acos(n.y) / pi.

    error and coverage are there only with antialias. rgb8, color, rgba8 and alpha are then means over the pixel's
    square, in which each colour counts up to 1; a byte is rounded besides. error is an estimate from the differences
    between the colours of the pixel's rays: in 95 pixels of 100, no channel of color is further from the true mean
    than error / 255, and docs/accuracy.md says how the estimate is made. Where bytes are sRGB, error is about colours
    by that curve, times 255; and it is always about those in front of an opaque background. The other outputs are
    those of the ray through the pixel's middle.

    shadow_rays and work count what was done, also for rays of mirrors and glass. Faint ones of those may have been
    left out, or traced twice, where no picture shows it: how many depends on which outputs were asked for.

    Asking for an output that it has not raises AttributeError, so hasattr(image, "depth") tells whether there is one.
    Where numpy or a plotting library wants an array, as in plt.imshow(image) and np.asarray(image), an image counts as
    its rgba8, or else its rgb8.

    transfer: "linear", or "srgb" of a Scene that was made so; it is about rgb8, rgba8 and PNGs alone; seconds: what
    took how long, in seconds, by name; frame: the buffers that the arrays live in, for Renderer.render(out), None in a
    copy that was pickled.
    """

    rgb8: NDArray[np.uint8]
    color: NDArray[np.float32]
    normal: NDArray[np.float32]
    direction: NDArray[np.float32]
    depth: NDArray[np.float64]
    id: NDArray[np.int32]
    primitive: NDArray[np.int32]
    uv: NDArray[np.float32]
    error: NDArray[np.float32]
    coverage: NDArray[np.float32]
    shadow_rays: NDArray[np.int32]
    work: NDArray[np.int32]
    rgba8: NDArray[np.uint8]
    alpha: NDArray[np.float32]

    def __init__(
        self,
        *,
        seconds: dict[str, float] | None = None,
        frame: Any = None,
        transfer: Transfer = "linear",
        **outputs: NDArray[Any] | None,
    ) -> None:
        for name, array in outputs.items():
            if name not in OUTPUTS:
                raise TypeError(f"{name}: must be one of {', '.join(OUTPUTS)}")
            if array is not None:
                setattr(self, name, array)
        self.seconds = seconds or {}
        self.frame = frame
        self.transfer = transfer

    if not TYPE_CHECKING:  # a type checker would take any name for an attribute

        def __getattr__(self, name: str) -> Any:
            """Called only for what the image has not."""
            if name in OUTPUTS:
                has = ", ".join(self.outputs) or "nothing"
                advice = f"ask for it with outputs={(*self.outputs, name)}"
                raise AttributeError(f"the image has no {name}, only {has}; {advice}", name=name, obj=self)
            raise AttributeError(f"an Image has no attribute {name!r}", name=name, obj=self)

    @property
    def outputs(self) -> tuple[Output, ...]:
        """The names of the outputs that it has."""
        return tuple(name for name in OUTPUTS if name in vars(self))

    @property
    def _size(self) -> tuple[int, int]:
        """Height and width, in pixels."""
        height, width = getattr(self, self.outputs[0]).shape[:2] if self.outputs else (0, 0)
        return height, width

    def __repr__(self) -> str:
        height, width = self._size
        return f"<cltrace.Image {width}x{height}: {', '.join(self.outputs)}>"

    @property
    def _shows(self) -> list[Show]:
        """What it can show."""
        return [show for show in SHOWS if self._output_of(show) in self.outputs]

    def _output_of(self, show: Show) -> Output:
        """The output that a picture of this is made of."""
        if show != "color":
            return show
        return "rgba8" if "rgba8" in self.outputs and "rgb8" not in self.outputs else "rgb8"

    @property
    def frame_seconds(self) -> float:
        """Seconds that the kernel and reading the picture back took. KeyError if it was not a Renderer that made it."""
        return self.seconds["kernel"] + self.seconds["readback"]

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """rgba8 or rgb8, for numpy.asarray(). Raises ValueError without either, or if it takes a copy and may not."""
        pixels = self._pixels()
        array: NDArray[Any] = pixels.astype(pixels.dtype if dtype is None else dtype, copy=bool(copy))
        if copy is False and array is not pixels:
            raise ValueError(f"copy: its bytes are uint8, and cannot become {array.dtype} without a copy")
        return array

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"frame": None}  # buffers stay with their process

    def as_rgb8(self, show: Show = "color", axes: ArrayLike | None = None) -> NDArray[np.uint8]:
        """(h, w, 3) uint8 that show one of the outputs: what the debugging hints of the course ask for.

        color: the picture, which is rgb8; normal, direction: (v + 1)/2 as red, green and blue; depth: the nearest is
        white, the farthest dark; id, primitive: a colour for each surface and for each triangle; uv: u as red and
        v as green, without their whole parts. Where nothing was hit, all but color and direction are black. The
        formulas are those of cltrace.picture.palettes.

        axes: (3, 3), whose rows are the axes along which normal and direction are shown, such as a Camera's basis();
        None for those of the world. Raises ValueError if there is no such show, the image does not have that output, or
        axes are given to another.
        """
        if show not in SHOWS:
            raise ValueError(f"show: must be one of {', '.join(SHOWS)}, got {show!r}")
        output = self._output_of(show)
        if output not in self.outputs:
            advice = f"; show={self._shows[0]!r} shows what it has" if self._shows else ""
            raise ValueError(f"show: the image has no {output}, only {', '.join(self.outputs) or 'nothing'}{advice}")
        if axes is not None and show not in DIRECTED:
            raise ValueError(f"axes: must be None for {show}, only {' and '.join(DIRECTED)} have axes")
        value = getattr(self, output)
        if show == "color":
            return np.asarray(value if output == "rgb8" else value[..., :3], np.uint8)
        kind, shown = {"uv": (np.float64, palettes.wrapped)}.get(show, (np.int32, palettes.distinct))
        if show == "depth":
            kind, shown = np.float64, partial(palettes.grey, ends=palettes.depth_range(np.asarray(value, np.float64)))
        if show in DIRECTED:
            along = None if axes is None else np.asarray(axes, np.float64)
            kind, shown = np.float64, partial(palettes.directions, axes=along)
        return by_rows(lambda rows: shown(np.asarray(value[rows], kind)), (*value.shape[:2], 3), np.uint8)

    def _pixels(self, show: Show = "color", axes: ArrayLike | None = None) -> NDArray[np.uint8]:
        """rgba8 where that is the picture that is asked for, else as_rgb8()."""
        return self.rgba8 if show == "color" and "rgba8" in self.outputs else self.as_rgb8(show, axes)

    def save(
        self,
        path: str | os.PathLike[str],
        show: Show = "color",
        axes: ArrayLike | None = None,
        *,
        bits: int = 8,
        outputs: Sequence[Output] | None = None,
        dpi: float | None = None,
    ) -> None:
        """Writes a file, completely or not at all, in the format that its name ends in. A link is written through.

            .png    one output as colours, see as_rgb8(); with alpha if that is the picture and the image has rgba8
            .tif    the same as a TIFF, or .tiff
            .jpg    the same as a JPEG, with a loss and without alpha, or .jpeg
            .npy    the array of one output, such as depth; of color, rgba8 or else rgb8
            .npz    the arrays of outputs, by their names, not compressed
            .exr    outputs as channels of an OpenEXR file, see cltrace.picture.storing

        path: a name in a folder that is there; show: which output a picture or NPY has, and axes, along which it has
        normals and directions; bits: of a PNG's channels, 8 or 16; 16 are made of the outputs color and, if it is
        there, alpha; dpi: pixels an inch, by which programs for print know the picture's size, of PNG, TIFF and JPEG;
        outputs: which ones an EXR or NPZ has, None for all. An EXR of all leaves out bytes and counts,
        and the image must have color, if it has bytes.

        Raises TypeError if the path is neither a str nor a Path, ValueError if the name does not end so or the image
        does not have an output, and OSError if the file cannot be written.
        An old file of that name is then untouched.
        """
        if not isinstance(path, (str, os.PathLike)):
            raise TypeError(f"path: must be a str or a Path, got {path!r}")
        target = Path(path)
        try:
            check_format(target)
        except ValueError as error:
            raise ValueError(f"path: {error}") from None
        if is_named_as_folder(os.fspath(path)):
            raise ValueError(f"path: {str(path)!r} is the name of a folder")
        if not target.parent.is_dir():
            raise FileNotFoundError(f"path: there is no folder {str(target.parent)!r}; mkdir() of a Path makes one")
        with whole_file(target) as file:
            self.write(file, target.suffix.lower(), show, axes, bits=bits, outputs=outputs, dpi=dpi)

    def write(
        self, file: BinaryIO, suffix: str = ".png", show: Show = "color", axes: ArrayLike | None = None, **how: Any
    ) -> None:
        """Writes what save() writes into a file with this suffix to an open binary one. how: the others of save()."""
        rows = Rows(file, suffix, self._size[0], show=show, axes=axes, **how)
        rows.add(self)
        rows.close()

    def _part(
        self,
        suffix: str,
        show: Show = "color",
        axes: ArrayLike | None = None,
        bits: int = 8,
        outputs: Sequence[Output] | None = None,
    ) -> Any:
        """What of it is in a file with this suffix: an array, or some by their names. The others as of write()."""
        if bits not in (8, 16) or (bits == 16 and (suffix != ".png" or show != "color")):
            raise ValueError(f"bits: must be 8, or 16 in a PNG of color, got {bits!r}")
        if suffix == ".npy":
            return self._array(show, axes)
        if suffix == ".npz":
            return self._arrays(self.outputs if outputs is None else outputs)
        if suffix != ".exr":
            return self._levels16() if bits == 16 else self._pixels(show, axes)
        if outputs is None and not {"rgb8", "rgba8"}.isdisjoint(self.outputs):
            self._need("color")
        return self._arrays([name for name in self.outputs if name in CHANNELS] if outputs is None else outputs)

    def _need(self, name: Output) -> None:
        """Raises ValueError if it has no such output."""
        if name not in self.outputs:
            raise ValueError(f"outputs: the image has no {name}; ask for it with outputs={(*self.outputs, name)}")

    def _arrays(self, names: Sequence[Output]) -> dict[str, NDArray[Any]]:
        """Some of its outputs, at least one. Raises ValueError if it has not all of them."""
        if isinstance(names, str) or not names:
            raise ValueError(f"outputs: must be some of {', '.join(self.outputs)}, got {names!r}")
        for name in names:
            self._need(name)
        return {name: getattr(self, name) for name in names}

    def _array(self, show: Show, axes: ArrayLike | None) -> NDArray[Any]:
        """The array that is shown: bytes of colours, else the output itself, along the axes if there are some."""
        if show == "color" or axes is not None or show not in self.outputs:
            self.as_rgb8(show, axes)  # for its errors
        if show == "color":
            return self._pixels()
        value: NDArray[Any] = getattr(self, show)
        return value if axes is None else np.asarray(value @ np.asarray(axes, np.float64).T, value.dtype)

    def _levels16(self) -> NDArray[np.uint16]:
        """The picture with 16 bits for each channel: 65535 times its colours, by their curve, and alpha, rounded."""
        self._need("color")
        alpha: NDArray[Any] | None = self.alpha if "alpha" in self.outputs else None
        if alpha is None and "rgba8" in self.outputs:
            alpha = self.rgba8[..., 3] / np.float32(255)

        def levels(rows: slice) -> NDArray[Any]:
            values = encoded(np.clip(self.color[rows], 0.0, 1.0), self.transfer)
            if alpha is not None:
                values = np.concatenate([values, alpha[rows, :, None]], axis=-1)
            return np.asarray(np.rint(values * 65535))

        return by_rows(levels, (*self._size, 3 if alpha is None else 4), np.uint16)

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.write(buffer, show=self._shows[0] if self._shows else "color")
        return buffer.getvalue()


class Rows:
    """A file of a picture, written from the top.

    file: open and binary; suffix, dpi and `how`: as of Image.write(); height: of the whole picture. Where the suffix is
    none of storing.BY_ROWS, the first rows must be all.
    """

    def __init__(self, file: BinaryIO, suffix: str, height: int, dpi: float | None = None, **how: Any) -> None:
        if dpi is not None and (isinstance(dpi, bool) or not isinstance(dpi, (int, float)) or not 0.1 <= dpi <= 1e6):
            raise ValueError(f"dpi: must be a number within 0.1..1000000, got {dpi!r}")
        if dpi is not None and suffix not in SIZED:
            raise ValueError(f"dpi: goes with {', '.join(SIZED)}, got {suffix}")
        if dpi is not None and FORMATS.get(suffix) == "JPEG" and not 1 <= dpi < 2**16:
            raise ValueError(f"dpi: must be within 1..65535 in a JPEG, got {dpi:g}")
        self._file, self._suffix, self._height, self._dpi, self._how = file, suffix, height, dpi, how
        self._writer: Writer | None = None

    def add(self, image: Image) -> None:
        """The next rows: a multiple of 16, but for the last ones. Raises what Image.write() raises."""
        part = image._part(self._suffix, **self._how)
        if self._suffix in FORMATS:
            write_pillow(self._file, self._suffix, part, self._dpi)
        elif self._suffix == ".npz":
            np.savez(self._file, allow_pickle=False, **part)
        else:
            self._writer = self._writer or writer(self._file, self._suffix, part, self._height, self._dpi)
            self._writer.write(part)

    def close(self) -> None:
        """Writes the end."""
        if self._writer:
            self._writer.close()

"""What is asked for: typed options, one class for each kind of work, made once from the command line.

Options that do not go together are refused here, before anything is read; what depends on a scene or on files is
refused where that is known.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from cltrace.base.errors import UsageError
from cltrace.picture.image import DIRECTED, LIT, Image, Output, Show
from cltrace.plan.abi import Precision
from cltrace.plan.request import Crop
from cltrace.scene import AnyCamera

Kind = TypeVar("Kind")

# Options that ask for more than one picture, and those that go with one only.
MANY = ("orbit", "axis", "degrees", "frames", "fps", "skip_existing")
ONE = (
    "check",
    "explain",
    "trace",
    "compare",
    "tolerance",
    "json",
    "stats",
    "repeat",
    "bits",
    "outputs",
    "watch",
    "view",
    "tiles",
)
NOT_ON_CLUSTER = ("check", "stats", "repeat", "bits", "outputs", "watch")
# Options are neither compared nor printed. The methods of dataclasses are compiled when cltrace starts, and those for
# that took 3 ms, a hundredth of the time of a small picture.


@dataclass(frozen=True, eq=False, repr=False)
class SceneOptions:
    """Which scene, and what of it is other than its file says.

    size: (width, height) in pixels, None for the file's; instances: as of read() in cltrace/formats/reader.py.
    """

    path: str
    size: tuple[int, int] | None
    square_pixels: bool
    transparent: bool
    instances: int


@dataclass(frozen=True, eq=False, repr=False)
class Look:
    """What of an Image a picture shows. show: one of its outputs, or "color"; space: whose axes directions have."""

    show: Show
    space: str | None

    @property
    def outputs(self) -> tuple[Output, ...]:
        """The outputs that it is made of."""
        return ("rgb8",) if self.show == "color" else (self.show,)

    @property
    def scale(self) -> tuple[Output, ...]:
        """The output whose least and greatest values are said."""
        return ("depth",) if self.show == "depth" else ()

    def axes(self, camera: AnyCamera) -> Any:
        """Along which axes directions are shown, as Image.as_rgb8() has them."""
        return camera.basis() if self.space == "camera" else None

    def pixels(self, camera: AnyCamera) -> Callable[[Image], NDArray[np.uint8]]:
        """What makes the pixels that are shown. It can be sent to another process."""
        if self.show == "color":
            return np.asarray
        return partial(Image.as_rgb8, show=self.show, axes=self.axes(camera))


@dataclass(frozen=True, eq=False, repr=False)
class Drawing:
    """How pictures are drawn: a device as --device names it, and arguments of Renderer, by their names."""

    device: str | None
    precision: Precision | None
    crop: Crop | None
    truncate: bool
    antialias: bool
    samples: int | None
    outline: tuple[str, float] | None
    fog: tuple[str, float, float] | None
    width: int | None

    def renderer_options(self, outputs: tuple[Output, ...]) -> dict[str, Any]:
        """The arguments of Renderer, but for scene and device."""
        options = {**vars(self), "outputs": outputs}
        del options["device"]
        return options


@dataclass(frozen=True, eq=False, repr=False)
class Doctor:
    """--doctor. device: the only one that is tried, None for all; report: the file of --report, None for none."""

    device: str | None
    report: str | None


@dataclass(frozen=True, eq=False, repr=False)
class ListDevices:
    """--list-devices."""


@dataclass(frozen=True, eq=False, repr=False)
class OneScene:
    """What all works have that are about one scene. output: names of files, None for the scene's own."""

    scene: SceneOptions
    drawing: Drawing
    output: tuple[str, ...] | None


@dataclass(frozen=True, eq=False, repr=False)
class Picture(OneScene):
    """One picture. outputs: those of .exr and .npz, none for the usual ones."""

    look: Look
    bits: int
    outputs: tuple[Output, ...]
    check: str | int | None
    stats: str | None
    repeat: int


@dataclass(frozen=True, eq=False, repr=False)
class Tiles(OneScene):
    """One picture on a cluster, in tiles. tiles: how many, None for what is best."""

    look: Look
    cluster: str
    tiles: int | None


@dataclass(frozen=True, eq=False, repr=False)
class Explain(OneScene):
    """--explain. explain: the pixel, (x, y) from the top left; trace: whether as a table."""

    explain: tuple[int, int]
    json: bool
    trace: bool


@dataclass(frozen=True, eq=False, repr=False)
class Compare(OneScene):
    """--compare. compare: the file of the other tracer's picture; tolerance: levels of 255 that are the same; show:
    what the file has, "color" being a picture."""

    compare: str
    tolerance: int
    json: bool
    show: str


@dataclass(frozen=True, eq=False, repr=False)
class Lit(OneScene):
    """--show lit."""


@dataclass(frozen=True, eq=False, repr=False)
class View(OneScene):
    """--view. compare: the file of another tracer's picture, None for none; watch: whether files are followed; movie:
    frames around the scene, None for none."""

    compare: str | None
    watch: bool
    movie: Movie | None


@dataclass(frozen=True, eq=False, repr=False)
class Movie:
    """Many pictures: frames around a scene, several scenes, or both, here or on a cluster."""

    scenes: tuple[SceneOptions, ...]
    look: Look
    drawing: Drawing
    output: str | None
    orbit: int | None
    axis: str | tuple[float, ...] | None
    degrees: float | None
    frames: slice | None
    fps: float | None
    skip_existing: bool
    cluster: str | None


Work = Doctor | ListDevices | Picture | Tiles | Movie | Explain | Compare | Lit | View


class Options(NamedTuple):
    """What is asked for. quiet: whether only errors are told; watch: whether it is done again after each change."""

    work: Work
    quiet: bool
    watch: bool


def options_of(args: Namespace, parser: ArgumentParser) -> Options:
    """What a command line asks for. Raises UsageError for options that do not go together.

    args: as `parser` has made them.
    """
    return Options(_Given(args, parser).work(), args.quiet, args.watch)


class _Given:
    """What a command line says, until it is typed."""

    def __init__(self, args: Namespace, parser: ArgumentParser) -> None:
        self._args, self._default = args, parser.get_default

    def work(self) -> Work:
        """What is to be done."""
        args = self._args
        for option, given in (("--doctor", args.doctor), ("--list-devices", args.list_devices)):
            if given and args.scenes:
                raise UsageError(f"{option} takes no scene, got {args.scenes[0]!r}")
        if args.doctor:
            self._refuse_others("--doctor", {"device", "report"})
            if args.report is not None and not args.report.endswith(".txt"):  # else a scene's file might be lost
                raise UsageError(f"--report: must end in .txt, got {args.report!r}")
            return self._typed(Doctor)
        if args.report is not None:
            raise UsageError("--report goes with --doctor")
        if args.list_devices:
            if args.device is not None:
                raise UsageError("--list-devices lists all devices, so it takes no -d; --doctor -d SPEC tries one")
            return ListDevices()
        if not args.scenes:
            raise UsageError("which scene? Say cltrace SCENE.xml; see cltrace --help")
        if "-" in args.scenes and not Path("-").exists():
            raise UsageError("a scene is not read from stdin: say the name of its file")
        if self._first(["instances"]) and any(text.startswith("instances=") for text in args.limit):
            raise UsageError("--instances N is --limit instances=N, and two numbers are given")
        make = self._kind()
        if args.watch and args.output and "-" in args.output:
            raise UsageError("--watch takes no -o -")
        return make()

    def _kind(self) -> Callable[[], Work]:
        """What makes the options of the kind of work that is asked for."""
        args = self._args
        if args.view and len(args.scenes) == 1:
            return self._view
        if len(args.scenes) > 1 or self._first(MANY):
            if args.watch:
                raise UsageError("--watch is for one picture, of one scene")
            self._check_show()
            return self._movie
        if args.tiles is not None and args.cluster is None:
            raise UsageError("--tiles goes with --cluster")
        if args.explain is not None:
            return self._explain
        if args.trace:
            raise UsageError("--trace goes with --explain")
        self._check_show()
        if args.samples is not None and not args.antialias:
            raise UsageError("--samples goes with --antialias")
        if args.antialias and (args.show != "color" or args.check is not None):
            other = "--check" if args.check is not None else f"--show {args.show}"
            raise UsageError(f"--antialias does not go with {other}, which is about the rays of pixels' middles")
        if args.compare is not None:
            return self._compare
        if args.tolerance is not None:
            raise UsageError("--tolerance goes with --compare")
        if args.json:
            raise UsageError("--json goes with --explain and --compare; times and counts are --stats=json")
        if args.cluster is not None:
            return self._tiles
        return self._lit if args.show == LIT else partial(self._of_scenes, Picture, outputs=tuple(args.outputs or ()))

    def _check_show(self) -> None:
        """Raises UsageError for options that do not go with what is shown."""
        args = self._args
        if args.space and args.show not in DIRECTED:
            raise UsageError(f"--space goes with --show {' and --show '.join(DIRECTED)}")
        for name in ("transparent", "outline", "fog"):
            if getattr(args, name) and args.show != "color":
                raise UsageError(f"--{name} goes with --show color")
            if name != "transparent" and getattr(args, name) and args.check is not None:
                raise UsageError(f"--check does not go with --{name}, which the reference has not")

    def _first(self, names: Iterable[str]) -> str | None:
        """The first of these options that is given, as it is written."""
        for name in names:
            if getattr(self._args, name) != self._default(name):
                return {"device": "-d", "output": "-o"}.get(name, f"--{name.replace('_', '-')}")
        return None

    def _refuse_others(self, option: str, taken: set[str]) -> None:
        """Raises UsageError if an option is given that does not go with this one. taken: those that do."""
        own = {"scenes", "watch", "quiet", "verbose", "instances", "limit", option.removeprefix("--")} | taken
        if other := self._first(name for name in vars(self._args) if name not in own):
            raise UsageError(f"{option} takes no {other}")

    def _typed(self, kind: type[Kind], **others: Any) -> Kind:
        """Options of a kind, of which those that have an option's name have its value. others: values of other ones."""
        given = vars(self._args) | others
        return kind(**{f.name: given[f.name] for f in fields(kind)})  # type: ignore[arg-type]  # kinds are dataclasses

    def _of_scenes(self, kind: type[Kind], **others: Any) -> Kind:
        """Options of a kind of work on scenes."""
        args = self._args
        scenes = tuple(self._typed(SceneOptions, path=path) for path in args.scenes)
        drawing = self._typed(Drawing)
        output = None if args.output is None else tuple(args.output)
        common = {"scene": scenes[0], "scenes": scenes, "drawing": drawing, "look": self._typed(Look), "output": output}
        return self._typed(kind, **(common | others))

    def _tiles(self) -> Tiles:
        args = self._args
        if other := self._first(NOT_ON_CLUSTER):
            raise UsageError(f"{other} does not go with --cluster")
        if args.show in (LIT, "depth"):  # the greys of depths depend on the whole picture
            raise UsageError(f"--show {args.show} does not go with --cluster")
        if args.output and (len(args.output) > 1 or "-" in args.output):
            raise UsageError("--cluster takes one -o, of a file")
        return self._of_scenes(Tiles)

    def _movie(self) -> Movie:
        args = self._args
        if args.output and len(args.output) > 1:
            raise UsageError("-o is given once where there are many pictures")
        output = args.output[0] if args.output else None
        self._check_movie(output)
        return self._of_scenes(Movie, output=output)

    def _check_movie(self, output: str | None) -> None:
        """Raises UsageError for options that do not go with many pictures, or with each other."""
        from cltrace.movie.frames import MOVIES

        args = self._args
        single = None if args.view and len(args.scenes) == 1 else self._first(ONE)
        single = single or ("--show lit" if args.show == LIT else "-o -" if output == "-" else None)
        if single:
            raise UsageError(f"{single} is for one picture, of one scene")
        if args.orbit is None and (other := self._first(("axis", "degrees"))):
            raise UsageError(f"{other} goes with --orbit")
        if args.frames is not None and args.orbit is None and len(args.scenes) == 1:
            raise UsageError("--frames goes with --orbit, or with several scenes")
        one_file = args.orbit is not None and output is not None and Path(output).suffix.lower() in MOVIES
        if args.fps is not None and not one_file:
            raise UsageError(f"--fps goes with --orbit and a movie, whose name ends in {', '.join(MOVIES)}")
        if args.skip_existing and one_file:
            raise UsageError("--skip-existing goes with PNGs, as a movie is there as a whole or not at all")

    def _explain(self) -> Explain:
        self._refuse_others("--explain", {"size", "square_pixels", "truncate", "json", "trace"})
        if self._args.json and self._args.trace:
            raise UsageError("--json and --trace both say how --explain prints")
        return self._of_scenes(Explain)

    def _compare(self) -> Compare:
        taken = {"size", "square_pixels", "device", "precision", "show"}
        shows = self._args.show != "color" or self._args.compare.lower().endswith(".npy")
        taken |= set() if shows else {"output", "tolerance", "json", "truncate", "antialias"}
        self._refuse_others("--compare of numbers" if shows else "--compare", taken | {"compare"})
        if self._args.show == "primitive":
            raise UsageError("--compare takes no --show primitive; --show id compares surfaces")
        return self._of_scenes(Compare, tolerance=1 if self._args.tolerance is None else self._args.tolerance)

    def _view(self) -> View:
        taken = {"size", "square_pixels", "transparent", "outline", "fog", "antialias", "samples", "truncate"}
        taken |= {"compare", "device", "precision"} | ({*MANY, "output"} if self._args.orbit is not None else set())
        self._refuse_others("--view", taken)
        return self._of_scenes(View, movie=self._movie() if self._args.orbit is not None else None)

    def _lit(self) -> Lit:
        taken = {"show", "output", "size", "crop", "square_pixels", "device", "precision"}
        self._refuse_others("--show lit", taken)
        return self._of_scenes(Lit)

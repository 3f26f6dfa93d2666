"""What can be asked for: the options of the command, what their texts mean, and which of them go together.

The help has `usual` options, and `rare` ones, which only --help all shows: the former is to fit one screen, of 40 lines
and 100 columns. What depends on a scene or on files is refused where that is known.
"""

from __future__ import annotations

import argparse
import math
import re
from argparse import ArgumentTypeError
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace import __version__
from cltrace.base import limits
from cltrace.base.errors import UsageError
from cltrace.picture.effects import Effects
from cltrace.picture.image import DIRECTED, LIT, OUTPUTS, SHOWS, USUAL, Image, Output, Show
from cltrace.picture.storing import SUFFIXES
from cltrace.plan.abi import Precision
from cltrace.plan.request import LATTICES, PRECISIONS, WIDTHS, Crop
from cltrace.process.console import Parser, positive
from cltrace.scene import AnyCamera, check_resolution

EXAMPLES = """examples:
  cltrace scene.xml                                the picture that the scene names
  cltrace scene.xml --compare mine.png             what is wrong in another tracer's picture
  cltrace scene.xml -d cpu --check --stats         whether it is right, and how long it took"""
# Options that ask for more than one picture, those that go with one only, and those that do not go with a cluster.
MANY = ("orbit", "axis", "degrees", "frames", "fps", "skip_existing")
ONE = (
    *("check", "explain", "trace", "compare", "tolerance", "json", "stats", "repeat", "bits", "outputs", "watch"),
    *("view", "tiles"),
)
NOT_ON_CLUSTER = ("check", "stats", "repeat", "bits", "outputs", "watch")
# Options that go with all kinds of work on scenes.
ALWAYS = {"scenes", "watch", "quiet", "verbose", "limit"}


# Options are neither compared nor printed. The methods of dataclasses are compiled when cltrace starts, and those for
# that took 3 ms, a hundredth of the time of a small picture.
@dataclass(frozen=True, eq=False, repr=False)
class Options:
    """What the command line says, by the names of its options. None stands for what is not given."""

    scenes: list[str]
    output: list[str] | None
    bits: int
    outputs: list[Output] | None
    size: tuple[int, int] | None
    crop: Crop | None
    show: Show
    space: str | None
    square_pixels: bool
    transparent: bool
    antialias: bool
    samples: int | None
    outline: tuple[str, float] | None
    fog: tuple[str, float, float] | None
    truncate: bool
    limit: list[str]
    orbit: int | None
    axis: str | tuple[float, ...] | None
    degrees: float | None
    frames: slice | None
    fps: float | None
    skip_existing: bool
    view: bool
    watch: bool
    device: str | None
    precision: Precision | None
    width: int | None
    list_devices: bool
    doctor: bool
    report: str | None
    cluster: str | None
    tiles: int | None
    check: str | int | None
    explain: tuple[int, int] | None
    trace: bool
    compare: str | None
    tolerance: int | None
    json: bool
    stats: str | None
    repeat: int
    quiet: bool
    verbose: bool

    @property
    def many(self) -> bool:
        """Whether more than one picture is asked for."""
        asked = [getattr(self, name) for name in MANY]
        return len(self.scenes) > 1 or any(value is not None and value is not False for value in asked)

    @property
    def shown(self) -> tuple[Output, ...]:
        """The outputs that a picture is made of."""
        return ("rgb8",) if self.show == "color" else (self.show,)

    @property
    def scale(self) -> tuple[Output, ...]:
        """The output whose least and greatest values are said."""
        return ("depth",) if self.show == "depth" else ()

    def axes(self, camera: AnyCamera) -> Any:
        """Along which axes directions are shown, as Image.as_rgb8() has them."""
        return camera.basis() if self.space == "camera" else None

    def pixels(self, image: Image, camera: AnyCamera) -> NDArray[np.uint8]:
        """The pixels of an image that are shown."""
        return np.asarray(image) if self.show == "color" else image.as_rgb8(self.show, self.axes(camera))

    def renderer_options(self, outputs: tuple[Output, ...]) -> dict[str, Any]:
        """The arguments of Renderer, but for scene and device."""
        names = ("precision", "crop", "truncate", "antialias", "samples", "outline", "fog", "width")
        return {name: getattr(self, name) for name in names} | {"outputs": outputs}


def options_of(words: Sequence[str], namespace: argparse.Namespace | None = None) -> Options:
    """What a command line asks for. Raises UsageError for what makes no sense.

    namespace: has `verbose` as soon as that was read, also where another option is wrong.
    """
    given = ["--view", *words[1:]] if words[:1] == ["view"] and len(words) > 1 else list(words)
    cut = given.index("--") if "--" in given else len(given)
    p = parser()
    args = p.parse_intermixed_args(given[:cut], namespace)
    args.scenes += given[cut + 1 :]  # which argparse would take for options, here and there
    options = Options(**{field.name: getattr(args, field.name) for field in fields(Options)})
    check_options(options, [name for name in vars(args) if getattr(args, name) != p.get_default(name)])
    return options


def check_options(o: Options, given: Sequence[str]) -> None:
    """Raises UsageError for options that do not go together. given: the names of those that are not as they would be
    without a word."""

    def refuse(when: object, words: str) -> None:
        if when:
            raise UsageError(words)

    def first(names: Sequence[str]) -> str | None:
        """The first of these options that is given, as it is written."""
        name = next((name for name in names if name in given), None)
        return None if name is None else {"device": "-d", "output": "-o"}.get(name, f"--{name.replace('_', '-')}")

    def only(option: str, *taken: str) -> None:
        """Refuses all options but these."""
        other = first([name for name in given if name not in {*ALWAYS, *taken}])
        refuse(other, f"{option} takes no {other}")

    for option, asked in (("--doctor", o.doctor), ("--list-devices", o.list_devices)):
        refuse(asked and o.scenes, f"{option} takes no scene, got {o.scenes[0] if o.scenes else ''!r}")
    if o.doctor:
        only("--doctor", "doctor", "device", "report")
        # Else a scene's file might be lost.
        refuse(o.report and not o.report.endswith(".txt"), f"--report: must end in .txt, got {o.report!r}")
        return
    refuse(o.report is not None, "--report goes with --doctor")
    if o.list_devices:
        refuse(o.device, "--list-devices lists all devices, so it takes no -d; --doctor -d SPEC tries one")
        return
    refuse(not o.scenes, "which scene? Say cltrace SCENE.xml; see cltrace --help")
    stdin = "-" in o.scenes and not Path("-").exists()
    refuse(stdin, "a scene is not read from stdin: say the name of its file")
    refuse(o.watch and o.output and "-" in o.output, "--watch takes no -o -")
    viewed = o.view and len(o.scenes) == 1
    if viewed:
        drawing = ("size", "square_pixels", "transparent", "outline", "fog", "antialias", "samples", "truncate")
        movie = (*MANY, "output") if o.orbit is not None else ()
        only("--view", "view", *drawing, "compare", "device", "precision", *movie)
    if o.many:
        refuse(o.watch and not viewed, "--watch is for one picture, of one scene")
        _check_show(o, refuse)
        _check_many(o, refuse, None if viewed else first(ONE), first(("axis", "degrees")))
        return
    if viewed:
        return
    refuse(o.tiles is not None and o.cluster is None, "--tiles goes with --cluster")
    if o.explain is not None:
        only("--explain", "explain", "size", "square_pixels", "truncate", "json", "trace")
        refuse(o.json and o.trace, "--json and --trace both say how --explain prints")
        return
    refuse(o.trace, "--trace goes with --explain")
    _check_show(o, refuse)
    refuse(o.samples is not None and not o.antialias, "--samples goes with --antialias")
    other = "--check" if o.check is not None else f"--show {o.show}"
    middles = o.antialias and (o.show != "color" or o.check is not None)
    refuse(middles, f"--antialias does not go with {other}, which is about the rays of pixels' middles")
    if o.compare is not None:
        drawn = ("size", "square_pixels", "device", "precision", "truncate", "antialias")
        only("--compare", "compare", "output", "tolerance", "json", *drawn)
        return
    refuse(o.tolerance is not None, "--tolerance goes with --compare")
    refuse(o.json, "--json goes with --explain and --compare; times and counts are --stats=json")
    if o.cluster is not None:
        other = first(NOT_ON_CLUSTER) or ""
        # The greys of depths depend on the whole picture.
        other = other or (f"--show {o.show}" if o.show in (LIT, "depth") else "")
        refuse(other, f"{other} does not go with --cluster")
        refuse(o.output and (len(o.output) > 1 or "-" in o.output), "--cluster takes one -o, of a file")
    elif o.show == LIT:
        only("--show lit", "show", "output", "size", "crop", "square_pixels", "device", "precision")


def _check_show(o: Options, refuse: Callable[[object, str], None]) -> None:
    """Refuses options that do not go with what is shown."""
    refuse(o.space and o.show not in DIRECTED, f"--space goes with --show {' and --show '.join(DIRECTED)}")
    for name in ("transparent", "outline", "fog"):
        asked = getattr(o, name)
        refuse(asked and o.show != "color", f"--{name} goes with --show color")
        unknown = asked and name != "transparent" and o.check is not None
        refuse(unknown, f"--check does not go with --{name}, which the reference has not")


def _check_many(o: Options, refuse: Callable[[object, str], None], single: str | None, of_orbit: str | None) -> None:
    """Refuses options that do not go with many pictures, or with each other.

    single: an option that goes with one picture only; of_orbit: one that goes with --orbit only.
    """
    from cltrace.movie.frames import MOVIES

    refuse(o.output and len(o.output) > 1, "-o is given once where there are many pictures")
    output = o.output[0] if o.output else None
    single = single or ("--show lit" if o.show == LIT else "-o -" if output == "-" else None)
    refuse(single, f"{single} is for one picture, of one scene")
    refuse(o.orbit is None and of_orbit, f"{of_orbit} goes with --orbit")
    alone = o.frames is not None and o.orbit is None and len(o.scenes) == 1
    refuse(alone, "--frames goes with --orbit, or with several scenes")
    one_file = o.orbit is not None and output is not None and Path(output).suffix.lower() in MOVIES
    movies = f"--fps goes with --orbit and a movie, whose name ends in {', '.join(MOVIES)}"
    refuse(o.fps is not None and not one_file, movies)
    whole = "--skip-existing goes with PNGs, as a movie is there as a whole or not at all"
    refuse(o.skip_existing and one_file, whole)


def parser(whole: bool = True) -> argparse.ArgumentParser:
    """The command line. whole: whether its help has all options, not only the usual ones."""
    p = Parser(
        prog="cltrace",
        usage="cltrace [view] SCENE.xml ... [options]",
        description="Render a scene file of spheres and meshes with OpenCL, or view it in the browser.",
        epilog=EXAMPLES if whole else f"--help all shows all options.\n\n{EXAMPLES}",
        formatter_class=partial(argparse.RawDescriptionHelpFormatter, max_help_position=26),
        allow_abbrev=False,
        add_help=False,
    )
    p.add_argument("scenes", nargs="*", metavar="SCENE.xml", help=argparse.SUPPRESS)
    usual: Callable[..., Any]

    def group(title: str) -> Callable[..., Any]:
        return p.add_argument_group(title).add_argument

    def rare(*names: str, help: str, **settings: Any) -> None:
        usual(*names, help=help if whole else argparse.SUPPRESS, **settings)

    usual = group("the picture")
    where = f"where to: {', '.join(SUFFIXES)}; - is stdout; may be repeated (default: the scene's output_file)"
    usual("-o", "--output", action="append", metavar="FILE", help=where)
    rare("--bits", type=int, choices=(8, 16), default=8, metavar="8|16", help="of a PNG's channels (default: 8)")
    stored = f"what .exr and .npz have (default: {','.join(USUAL)}, with meshes primitive)"
    rare("--outputs", type=outputs, metavar="NAME,...", help=stored)
    usual("--size", type=picture_size, metavar="WxH", help="picture size instead of the scene's")
    usual("--crop", type=crop, metavar="X0,Y0,X1,Y1", help="only these pixels of it (X1, Y1 excluded)")
    shows = f"{', '.join(SHOWS)}, {LIT}: as colours"
    usual("--show", choices=(*SHOWS, LIT), default="color", metavar="WHAT", help=shows)
    axes = "axes of normal and direction: world or camera (default: world)"
    rare("--space", choices=("world", "camera"), metavar="NAME", help=axes)
    rare("--square-pixels", action="store_true", help="vertical half-angle by tan(angle)*H/W")
    usual("--transparent", action="store_true", help="nothing instead of the background: a PNG with alpha")
    usual("--antialias", action="store_true", help="colours are means over pixels")
    rare("--samples", type=int, choices=LATTICES, metavar="N", help="rays of --antialias (default: 32)")
    rare("--outline", type=outline, metavar="COLOR,WIDTH", help="lines of WIDTH pixels around surfaces")
    rare("--fog", type=fog, metavar="COLOR,NEAR,FAR", help="surfaces fade to a colour between these distances")
    usual("--truncate", action="store_true", help="bytes are trunc(255 c), as in the course's own pictures")
    more = "another limit: of lights, spheres, rays, instances and more"
    rare("--limit", type=limit, action="append", default=[], metavar="NAME=VALUE", help=more)

    usual = group("many pictures")
    usual(
        "--orbit", type=several, metavar="N", help="N frames around the scene: -o frame%%04d.png, .mp4, .gif or .apng"
    )
    rare("--axis", type=axis, metavar="x|y|z|X,Y,Z", help="of --orbit (default: the camera's up)")
    rare("--degrees", type=degrees, metavar="A", help="of --orbit (default: 360)")
    picked = "only these of the frames, or of the scenes, from 0 on, B excluded; or one number"
    rare("--frames", type=frames, metavar="A:B:S", help=picked)
    rare("--fps", type=fps, metavar="F", help="frames a second of a movie (default: 25)")
    rare("--skip-existing", action="store_true", help="keep PNGs that are there and show what they should")
    rare("--view", action="store_true", help="in the browser; the same as cltrace view")
    rare("--watch", action="store_true", help="do it again when the scene, a mesh or a texture is saved")

    usual = group("the device")
    usual("-d", "--device", metavar="SPEC", help="cpu, gpu, P:D, or part of a name (default: fastest CPU)")
    precisions = f"{', '.join(PRECISIONS)} (default: accurate, where there are doubles)"
    usual("--precision", choices=PRECISIONS, metavar="NAME", help=precisions)
    widths = f"pixels that are drawn together: {', '.join(map(str, WIDTHS))} (default: the driver's)"
    rare("--width", type=int, choices=WIDTHS, metavar="N", help=widths)
    usual("--list-devices", action="store_true", help="list the devices and stop")
    usual("--doctor", action="store_true", help="check the installation and each device, and stop")
    report = "of --doctor: a text file to send, with limits, checks and times (default: cltrace-report.txt)"
    rare("--report", nargs="?", const="cltrace-report.txt", metavar="FILE", help=report)

    usual = group("many machines")
    scheduler = "draw on a dask cluster: its scheduler's address or file, or local:N for N processes here"
    rare("--cluster", metavar="SCHEDULER", help=scheduler)
    rare("--tiles", type=positive, metavar="N", help="of one picture on a cluster (default: 8 for each worker)")

    usual = group("checking and measuring")
    compared = "compare N pixels with the reference (default 20000, or fewer)"
    usual("--check", nargs="?", const="default", type=count, metavar="N|all", help=compared)
    why = "print how the pixel in column X, row Y gets its colour"
    usual("--explain", type=pixel, metavar="X,Y", help=why)
    rare("--trace", action="store_true", help="with --explain: its numbers as a table, for diff")
    usual("--compare", metavar="MINE.png", help="say how a picture differs, and why; exit 1 if it does")
    rare("--tolerance", type=levels, metavar="N", help="with --compare: levels that are the same (default 1)")
    rare("--json", action="store_true", help="with --explain and --compare: one JSON object")
    text_or_json = {"const": "text", "type": form, "choices": ("text", "json"), "metavar": "text|json"}
    usual("--stats", nargs="?", **text_or_json, help="times and counts")
    rare("--repeat", type=repeats, default=1, metavar="N", help="render N times, report the fastest")

    usual = group("messages")
    usual("-q", "--quiet", action="store_true", help="only errors")
    rare("-v", "--verbose", action="store_true", help="with an error, also its traceback")
    usual("-h", "--help", action=_Help, nargs="?", metavar="all", help="show the usual options, or all, and stop")
    usual("--version", action="version", version=f"cltrace {__version__}", help="show the version and stop")
    return p


class _Help(argparse.Action):
    """--help, which shows the usual options, and --help all."""

    def __call__(self, asked: argparse.ArgumentParser, _: object, values: object, __: str | None = None) -> None:
        parser(whole=values == "all").print_help()
        asked.exit()


# The text of an argument -> its value. What is wrong with it is said in one line.


def _matched(pattern: str, text: str, what: str) -> None:
    if not re.fullmatch(pattern, text):
        raise ArgumentTypeError(f"must be {what}, got {text!r}")


def picture_size(text: str) -> tuple[int, int]:
    """WxH of --size."""
    _matched("[0-9]{1,9}[xX][0-9]{1,9}", text, "WIDTHxHEIGHT, such as 640x480")
    width, height = map(int, text.lower().split("x"))
    try:
        return check_resolution((width, height))
    except ValueError as error:
        raise ArgumentTypeError(str(error).removeprefix("camera.resolution: ")) from None


def crop(text: str) -> Crop:
    """X0,Y0,X1,Y1 of --crop."""
    sign = " without a sign" if "-" in text or "+" in text else ""
    _matched("[0-9]{1,9}(,[0-9]{1,9}){3}", text, f"X0,Y0,X1,Y1{sign}, such as 0,0,64,64")
    x0, y0, x1, y1 = map(int, text.split(","))
    return (x0, y0, x1, y1)


def pixel(text: str) -> tuple[int, int]:
    """X,Y of --explain."""
    _matched("[0-9]{1,9},[0-9]{1,9}", text, "X,Y from the top left, such as 320,200")
    x, y = map(int, text.split(","))
    return x, y


def levels(text: str) -> int:
    """N of --tolerance."""
    return int(_number(text if text.isdecimal() else "", "a whole number of levels within 0..255", 0, 255, text))


def several(text: str) -> int:
    """N of --orbit, which has as many digits as a frame's number."""
    return int(_number(text if text.isdecimal() else "", "a whole number within 1..999999", 1, 999_999, text))


def degrees(text: str) -> float:
    """A of --degrees."""
    return _number(text, "degrees, such as 360 or -90", -1e6, 1e6)


def fps(text: str) -> float:
    """F of --fps."""
    return _number(text, "frames a second, within 0.001..1000", 0.001, 1000)


def _number(text: str, what: str, least: float, most: float, said: str | None = None) -> float:
    """A number within limits. said: what the message quotes, if that is another text."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise ArgumentTypeError(f"must be {what}, got {text if said is None else said!r}")
    return value


def outline(text: str) -> tuple[str, float]:
    """COLOR,WIDTH of --outline."""
    color, (width,) = _effect("outline", text, 1)
    return color, width


def fog(text: str) -> tuple[str, float, float]:
    """COLOR,NEAR,FAR of --fog."""
    color, (near, far) = _effect("fog", text, 2)
    return color, near, far


def _effect(name: str, text: str, numbers: int) -> tuple[str, list[float]]:
    """A colour and so many numbers; the commas of rgb() do not count."""
    color, *parts = text.rsplit(",", numbers)
    try:
        found = [float(part) for part in parts]
        Effects.of(**{"outline": None, "fog": None, name: (color, *found)}, transfer="linear")
    except ValueError as error:
        fault = str(error).removeprefix(f"{name}: ")
        raise ArgumentTypeError(f"{fault}, got {text!r}" if "got" not in fault else fault) from None
    return color, found


def outputs(text: str) -> list[Output]:
    """NAME,... of --outputs, in the order of OUTPUTS."""
    named = text.split(",")
    for name in named:
        if name not in OUTPUTS:
            raise ArgumentTypeError(f"must be of {', '.join(OUTPUTS)}, got {name!r}")
    return [name for name in OUTPUTS if name in named]


def limit(text: str) -> str:
    """NAME=VALUE of --limit, which is in force already: entry.py has set it."""
    try:
        name, value = limits.limit_of(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from None
    if limits.current(name) != value:
        raise ArgumentTypeError(f"must be written out, and one for each name, got {text!r}")
    return text


def repeats(text: str) -> int:
    """N of --repeat."""
    if text.endswith(".xml"):
        raise ArgumentTypeError(f"put the scene first, or say --check=N; {text!r} is not a number")
    return positive(text)


def count(text: str) -> str | int:
    """N, all or default of --check."""
    return text if text in ("all", "default") else repeats(text)


def form(text: str) -> str:
    """text or json of --stats."""
    if text.endswith(".xml"):
        raise ArgumentTypeError(f"put the scene first, or say --stats=text; {text!r} is not a form")
    return text


def axis(text: str) -> str | tuple[float, ...]:
    """x, y, z or X,Y,Z of --axis."""
    try:
        numbers = tuple(map(float, text.split(",")))
    except ValueError:
        numbers = ()
    if text not in ("x", "y", "z") and (len(numbers) != 3 or not 0 < math.hypot(*numbers) < math.inf):
        raise ArgumentTypeError(f"must be x, y, z, or a direction X,Y,Z such as 0,1,0, got {text!r}")
    return numbers or text


def frames(text: str) -> slice:
    """A:B:S of --frames."""
    from cltrace.movie.frames import range_of

    try:
        return range_of(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from None

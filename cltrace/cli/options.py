"""What can be asked for: the options of the command, what their texts mean, and which of them go together.

The help has `usual` options, and `rare` ones, which only --help all shows: the former is to fit one screen, of 40 lines
and 100 columns. What depends on a scene or on files is refused where that is known.
"""

from __future__ import annotations

import argparse
import math
import re
from argparse import ArgumentTypeError
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace import __version__
from cltrace.base import limits
from cltrace.base.errors import UsageError
from cltrace.picture.effects import Effects
from cltrace.picture.image import DIRECTED, LIT, OUTPUTS, SHOWS, USUAL, Image, Output
from cltrace.picture.storing import SUFFIXES
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
# Options that say how another one does its work.
OF = {
    "tiles": "cluster", "trace": "explain", "tolerance": "compare", "samples": "antialias",
    "axis": "orbit", "degrees": "orbit",
}  # fmt: skip
NOT_ON_CLUSTER = ("check", "stats", "repeat", "bits", "outputs", "watch")
# Options that go with all kinds of work on scenes.
ALWAYS = {"scenes", "watch", "quiet", "verbose", "limit"}


class Options(argparse.Namespace):
    """What the command line says, by the names of the parser's options. None stands for what is not given."""

    @property
    def many(self) -> bool:
        """Whether more than one picture is asked for."""
        return len(self.scenes) > 1 or any(getattr(self, name) not in (None, False) for name in MANY)

    @property
    def shown(self) -> tuple[Output, ...]:
        """The outputs that a picture is made of."""
        return ("rgb8",) if self.show == "color" else (self.show,)

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


@contextmanager
def refusing(before: str = "", kind: type[Exception] = UsageError) -> Iterator[None]:
    """Makes an error of this kind of a ValueError, whose words are for the user, with others before them."""
    try:
        yield
    except ValueError as error:
        raise kind(f"{before}{error}") from None


def options_of(words: Sequence[str], options: Options | None = None) -> Options:
    """What a command line asks for. Raises UsageError for what makes no sense.

    options: where that goes, so that `verbose` is there as soon as it was read, also where another option is wrong.
    """
    given = ["--view", *words[1:]] if words[:1] == ["view"] and len(words) > 1 else list(words)
    cut = given.index("--") if "--" in given else len(given)
    p = parser()
    options = p.parse_intermixed_args(given[:cut], options or Options())
    options.scenes += given[cut + 1 :]  # which argparse would take for options, here and there
    check_options(options, [name for name, value in vars(options).items() if value != p.get_default(name)])
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
        more = first([name for name in given if name not in {*ALWAYS, *taken}])
        refuse(more, f"{option} takes no {more}")

    viewed = o.view and len(o.scenes) == 1
    for option, other in OF.items():
        refuse(option in given and other not in given and not viewed, f"--{option} goes with --{other}")
    for option, asked in (("--doctor", o.doctor), ("--list-devices", o.list_devices)):
        refuse(asked and o.scenes, f"{option} takes no scene, got {o.scenes[0] if o.scenes else ''!r}")
    if o.doctor:
        only("--doctor", "doctor", "device")
        return
    if o.list_devices:
        refuse(o.device, "--list-devices lists all devices, so it takes no -d; --doctor -d SPEC tries one")
        return
    refuse(not o.scenes, "which scene? Say cltrace SCENE.xml; see cltrace --help")
    stdin = "-" in o.scenes and not Path("-").exists()
    refuse(stdin, "a scene is not read from stdin: say the name of its file")
    refuse(o.watch and o.output and "-" in o.output, "--watch takes no -o -")
    if viewed:
        drawing = ("size", "square_pixels", "transparent", "outline", "fog", "antialias", "samples", "truncate")
        movie = (*MANY, "output") if o.orbit is not None else ()
        only("--view", "view", *drawing, "compare", "device", "precision", *movie)
    if o.many:
        refuse(o.watch and not viewed, "--watch is for one picture, of one scene")
        _check_show(o, refuse)
        _check_many(o, refuse, None if viewed else first(ONE))
        return
    if viewed:
        return
    if o.explain is not None:
        only("--explain", "explain", "size", "square_pixels", "truncate", "json", "trace")
        refuse(o.json and o.trace, "--json and --trace both say how --explain prints")
        return
    _check_show(o, refuse)
    middles = "--check" if o.check is not None else f"--show {o.show}" if o.show != "color" else ""
    refuse(
        o.antialias and middles, f"--antialias does not go with {middles}, which is about the rays of pixels' middles"
    )
    if o.compare is not None:
        drawn = ("size", "square_pixels", "device", "precision", "truncate", "antialias")
        refuse(len(o.output or ()) > 1, "--compare takes one -o")
        only("--compare", "compare", "output", "tolerance", "json", *drawn)
        return
    refuse(o.json, "--json goes with --explain and --compare; times and counts are --stats=json")
    if o.cluster is not None:
        # The greys of depths depend on the whole picture.
        refused = first(NOT_ON_CLUSTER) or (f"--show {o.show}" if o.show in (LIT, "depth") else "")
        refuse(refused, f"{refused} does not go with --cluster")
        refuse(o.output and (len(o.output) > 1 or "-" in o.output), "--cluster takes one -o, of a file")
    elif o.show == LIT:
        refuse(len(o.output or ()) > 1, "--show lit takes one -o")
        only("--show lit", "show", "output", "size", "crop", "square_pixels", "device", "precision")


def _check_show(o: Options, refuse: Callable[[object, str], None]) -> None:
    """Refuses options that do not go with what is shown."""
    refuse(o.space and o.show not in DIRECTED, f"--space goes with --show {' and --show '.join(DIRECTED)}")
    for name in ("transparent", "outline", "fog"):
        asked = getattr(o, name)
        refuse(asked and o.show != "color", f"--{name} goes with --show color")
        unknown = asked and name != "transparent" and o.check is not None
        refuse(unknown, f"--check does not go with --{name}, which the reference has not")


def _check_many(o: Options, refuse: Callable[[object, str], None], single: str | None) -> None:
    """Refuses options that do not go with many pictures. single: an option that goes with one picture only."""
    from cltrace.movie.frames import MOVIES

    refuse(o.output and len(o.output) > 1, "-o is given once where there are many pictures")
    output = o.output[0] if o.output else None
    single = single or ("--show lit" if o.show == LIT else "-o -" if output == "-" else None)
    refuse(single, f"{single} is for one picture, of one scene")
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
    around = "N frames around the scene: -o frame%%04d.png, .mp4, .gif or .apng"
    usual("--orbit", type=several, metavar="N", help=around)
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
    rare("--repeat", type=positive, default=1, metavar="N", help="render N times, report the fastest")

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


def number(what: str, least: float, most: float, text: str) -> float:
    """A number within limits, such as that of --degrees."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise ArgumentTypeError(f"must be {what}, got {text!r}")
    return value


def whole_number(what: str, least: int, most: int, text: str) -> int:
    """One without a sign, such as that of --tolerance."""
    if not re.fullmatch("[0-9]{1,9}", text) or not least <= int(text) <= most:
        raise ArgumentTypeError(f"must be {what} within {least}..{most}, got {text!r}")
    return int(text)


levels = partial(whole_number, "a whole number of levels", 0, 255)
several = partial(whole_number, "a whole number", 1, 999_999)
degrees = partial(number, "degrees, such as 360 or -90", -1e6, 1e6)
fps = partial(number, "frames a second, within 0.001..1000", 0.001, 1000)


def effect(name: str, numbers: int, text: str) -> tuple[Any, ...]:
    """COLOR,WIDTH of --outline and COLOR,NEAR,FAR of --fog; the commas of rgb() do not count."""
    color, *parts = text.rsplit(",", numbers)
    try:
        found = (color, *map(float, parts))
        Effects.of(**{"outline": None, "fog": None, name: found}, transfer="linear")
    except ValueError as error:
        fault = str(error).removeprefix(f"{name}: ")
        raise ArgumentTypeError(f"{fault}, got {text!r}" if "got" not in fault else fault) from None
    return found


outline, fog = partial(effect, "outline", 1), partial(effect, "fog", 2)


def outputs(text: str) -> list[Output]:
    """NAME,... of --outputs, in the order of OUTPUTS."""
    named = text.split(",")
    for name in named:
        if name not in OUTPUTS:
            raise ArgumentTypeError(f"must be of {', '.join(OUTPUTS)}, got {name!r}")
    return [name for name in OUTPUTS if name in named]


def limit(text: str) -> str:
    """NAME=VALUE of --limit, which is in force already: entry.py has set it."""
    with refusing(kind=ArgumentTypeError):
        name, value = limits.limit_of(text)
    if limits.current(name) != value:
        raise ArgumentTypeError(f"must be written out, and one for each name, got {text!r}")
    return text


def count(text: str) -> str | int:
    """N, all or default of --check."""
    if text.endswith(".xml"):
        raise ArgumentTypeError(f"put the scene first, or say --check=N; {text!r} is not a number")
    return text if text in ("all", "default") else positive(text)


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

    with refusing(kind=ArgumentTypeError):
        picked = range_of(text)
    return picked

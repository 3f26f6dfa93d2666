"""What can be asked for: the parser, with one function for each group of options.

A group has `usual` options, which --help shows, and `rare` ones, which only --help all shows: the former is to fit one
screen, of 40 lines and 100 columns. What an argument's text means is in cltrace.cli.arguments, and
what all of them ask for together in cltrace.cli.options.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from typing import Any

from cltrace import __version__
from cltrace.base.limits import INSTANCES
from cltrace.cli import arguments
from cltrace.picture.image import LIT, SHOWS, USUAL
from cltrace.picture.storing import SUFFIXES
from cltrace.plan.request import LATTICES, PRECISIONS, WIDTHS
from cltrace.process.console import Parser, positive

EXAMPLES = """examples:
  cltrace scene.xml                                the picture that the scene names
  cltrace scene.xml --compare mine.png             what is wrong in another tracer's picture
  cltrace scene.xml -d cpu --check --stats         whether it is right, and how long it took"""


class Group:
    """Options under one heading. whole: whether the help has those that are rare."""

    def __init__(self, p: argparse.ArgumentParser, title: str, whole: bool) -> None:
        self._group, self._whole = p.add_argument_group(title), whole

    def usual(self, *names: str, **settings: Any) -> None:
        """Adds an option as add_argument() does."""
        self._group.add_argument(*names, **settings)

    def rare(self, *names: str, help: str, **settings: Any) -> None:
        """Adds an option that only --help all shows."""
        self._group.add_argument(*names, help=help if self._whole else argparse.SUPPRESS, **settings)


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
    _picture(Group(p, "the picture", whole))
    _limits(Group(p, "how much a scene may have", whole))
    _movie(Group(p, "many pictures", whole))
    _device(Group(p, "the device", whole))
    _cluster(Group(p, "many machines", whole))
    _checks(Group(p, "checking and measuring", whole))
    _messages(Group(p, "messages", whole))
    return p


def _picture(group: Group) -> None:
    group.usual(
        "-o",
        "--output",
        action="append",
        metavar="FILE",
        help=f"where to: {', '.join(SUFFIXES)}; - is stdout; may be repeated (default: the scene's output_file)",
    )
    group.rare("--bits", type=int, choices=(8, 16), default=8, metavar="8|16", help="of a PNG's channels (default: 8)")
    group.rare(
        "--outputs",
        type=arguments.outputs,
        metavar="NAME,...",
        help=f"what .exr and .npz have (default: {','.join(USUAL)}, with meshes primitive)",
    )
    group.usual("--size", type=arguments.picture_size, metavar="WxH", help="picture size instead of the scene's")
    group.usual("--crop", type=arguments.crop, metavar="X0,Y0,X1,Y1", help="only these pixels of it (X1, Y1 excluded)")
    group.usual(
        "--show",
        choices=(*SHOWS, LIT),
        default="color",
        metavar="WHAT",
        help=f"{', '.join(SHOWS)}, {LIT}: as colours",
    )
    group.rare(
        "--space",
        choices=("world", "camera"),
        metavar="NAME",
        help="axes of normal and direction: world or camera (default: world)",
    )
    group.rare("--square-pixels", action="store_true", help="vertical half-angle by tan(angle)*H/W")
    group.usual("--transparent", action="store_true", help="nothing instead of the background: a PNG with alpha")
    group.usual("--antialias", action="store_true", help="colours are means over pixels")
    group.rare("--outline", type=arguments.outline, metavar="COLOR,WIDTH", help="lines of WIDTH pixels around surfaces")
    group.rare(
        "--fog", type=arguments.fog, metavar="COLOR,NEAR,FAR", help="surfaces fade to a colour between these distances"
    )
    group.rare("--samples", type=int, choices=LATTICES, metavar="N", help="rays of --antialias (default: 32)")
    group.usual("--truncate", action="store_true", help="bytes are trunc(255 c), as in the course's own pictures")


def _limits(group: Group) -> None:
    group.rare(
        "--instances",
        type=arguments.triangles,
        default=INSTANCES,
        metavar="N",
        help=f"triangles of meshes named again (default: up to {INSTANCES})",
    )
    group.rare(
        "--limit",
        type=arguments.limit,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="another limit: of lights, spheres, rays and more",
    )


def _movie(group: Group) -> None:
    group.usual(
        "--orbit",
        type=arguments.several,
        metavar="N",
        help="N frames around the scene: -o frame%%04d.png, .mp4, .gif or .apng",
    )
    group.rare("--axis", type=arguments.axis, metavar="x|y|z|X,Y,Z", help="of --orbit (default: the camera's up)")
    group.rare("--degrees", type=arguments.degrees, metavar="A", help="of --orbit (default: 360)")
    group.rare(
        "--frames",
        type=arguments.frames,
        metavar="A:B:S",
        help="only these of the frames, or of the scenes, from 0 on, B excluded; or one number",
    )
    group.rare("--fps", type=arguments.fps, metavar="F", help="frames a second of a movie (default: 25)")
    group.rare("--skip-existing", action="store_true", help="keep PNGs that are there and show what they should")
    group.rare("--view", action="store_true", help="in the browser; the same as cltrace view")
    group.rare("--watch", action="store_true", help="do it again when the scene, a mesh or a texture is saved")


def _device(group: Group) -> None:
    group.usual("-d", "--device", metavar="SPEC", help="cpu, gpu, P:D, or part of a name (default: fastest CPU)")
    group.usual(
        "--precision",
        choices=PRECISIONS,
        metavar="NAME",
        help=f"{', '.join(PRECISIONS)} (default: accurate, where there are doubles)",
    )
    group.rare(
        "--width",
        type=int,
        choices=WIDTHS,
        metavar="N",
        help=f"pixels that are drawn together: {', '.join(map(str, WIDTHS))} (default: the driver's)",
    )
    group.usual("--list-devices", action="store_true", help="list the devices and stop")
    group.usual("--doctor", action="store_true", help="check the installation and each device, and stop")
    group.rare(
        "--report",
        nargs="?",
        const="cltrace-report.txt",
        metavar="FILE",
        help="of --doctor: a text file to send, with limits, checks and times (default: cltrace-report.txt)",
    )


def _cluster(group: Group) -> None:
    group.rare(
        "--cluster",
        metavar="SCHEDULER",
        help="draw on a dask cluster: its scheduler's address or file, or local:N for N processes here",
    )
    group.rare("--tiles", type=positive, metavar="N", help="of one picture on a cluster (default: 8 for each worker)")


def _checks(group: Group) -> None:
    group.usual(
        "--check",
        nargs="?",
        const="default",
        type=arguments.count,
        metavar="N|all",
        help="compare N pixels with the reference (default 20000, or fewer)",
    )
    group.usual(
        "--explain",
        type=arguments.pixel,
        metavar="X,Y",
        help="print how the pixel in column X, row Y gets its colour",
    )
    group.rare("--trace", action="store_true", help="with --explain: its numbers as a table, for diff")
    group.usual("--compare", metavar="MINE.png", help="say how a picture differs, and why; exit 1 if it does")
    group.rare(
        "--tolerance",
        type=arguments.levels,
        metavar="N",
        help="with --compare: levels that are the same (default 1)",
    )
    group.rare("--json", action="store_true", help="with --explain and --compare: one JSON object")
    group.usual(
        "--stats",
        nargs="?",
        const="text",
        type=arguments.form,
        choices=("text", "json"),
        metavar="text|json",
        help="times and counts",
    )
    group.rare("--repeat", type=arguments.repeats, default=1, metavar="N", help="render N times, report the fastest")


def _messages(group: Group) -> None:
    group.usual("-q", "--quiet", action="store_true", help="only errors")
    group.rare("-v", "--verbose", action="store_true", help="with an error, also its traceback")
    group.usual("-h", "--help", action=_Help, nargs="?", metavar="all", help="show the usual options, or all, and stop")
    group.usual("--version", action="version", version=f"cltrace {__version__}", help="show the version and stop")


class _Help(argparse.Action):
    """--help, which shows the usual options, and --help all."""

    def __call__(
        self,
        asked: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        parser(whole=values == "all").print_help()
        asked.exit()

"""The command `cltrace`: options, messages, exit codes. What the tracer has to say is said here.

What only some options need is imported where they are followed: imports are half of a small picture's time.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import re
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from cltrace import __version__
from cltrace.comparison.pictures import compare
from cltrace.console import Parser, command, picture_size, positive, tell
from cltrace.errors import UsageError
from cltrace.formats.xml_reader import read
from cltrace.picture.files import is_named_as_folder
from cltrace.picture.image import DIRECTED, SHOWS, Image, Output, Show
from cltrace.picture.palettes import FAR, MAX_LIGHTS, NEAR, depth_range
from cltrace.plan.request import KEEPS, PRECISIONS, Crop, Keep
from cltrace.renderer import Renderer
from cltrace.run.devices import choose, devices, where_drivers_are
from cltrace.scene import AMBIENT, Scene

EXAMPLES = """examples:
  cltrace scene.xml                                the picture that the scene names
  cltrace scene.xml --compare mine.png             what is wrong in another tracer's picture
  cltrace scene.xml -d cpu --check --stats         whether it is right, and how long it took"""

LIT, SETS = "lit", 12  # what --show has beside an image's outputs, and of how many sets of lights it says the colours
STDOUT = ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(
        prog="cltrace",
        usage="cltrace SCENE.xml [options]",
        description="Render a scene file of spheres and meshes with OpenCL.",
        epilog=EXAMPLES,
        formatter_class=partial(argparse.RawDescriptionHelpFormatter, max_help_position=26),
        allow_abbrev=False,
        add_help=False,
    )
    p.add_argument("scene", nargs="?", metavar="SCENE.xml", help=argparse.SUPPRESS)

    group = p.add_argument_group("the picture").add_argument
    group("-o", "--output", metavar="PNG", help="where to; - is stdout (default: the scene's output_file)")
    group("--size", type=picture_size, metavar="WxH", help="picture size instead of the scene's")
    group("--crop", type=_crop, metavar="X0,Y0,X1,Y1", help="only these pixels of it (X1, Y1 excluded)")
    group("--show", choices=(*SHOWS, LIT), default="color", metavar="WHAT",
          help=f"{', '.join(SHOWS)}, {LIT}: as colours")  # fmt: skip
    group("--space", choices=("world", "camera"), metavar="NAME",
          help="axes of normal and direction: world or camera (default: world)")  # fmt: skip
    group("--square-pixels", action="store_true", help="vertical half-angle by tan(angle)*H/W")
    group("--truncate", action="store_true", help="bytes are trunc(255 c), as in the course's own pictures")

    group = p.add_argument_group("the device").add_argument
    group("-d", "--device", metavar="SPEC", help="cpu, gpu, P:D or part of a name (default: fastest CPU)")
    group("--precision", choices=PRECISIONS, metavar="NAME",
          help=f"{', '.join(PRECISIONS)} (default: accurate, where there are doubles)")  # fmt: skip
    group("--list-devices", action="store_true", help="list the devices and stop")
    group("--doctor", action="store_true", help="check the installation and each device, and stop")

    group = p.add_argument_group("checking and measuring").add_argument
    group("--check", nargs="?", const="default", type=_count, metavar="N|all",
          help="compare N pixels with the reference (default 20000, fewer of many spheres)")  # fmt: skip
    group("--explain", type=_pixel, metavar="X,Y", help="print how the pixel in column X, row Y gets its colour")
    group("--compare", metavar="MINE.png", help="say how a picture differs, and why; exit 1 if it does")
    group("--tolerance", type=_levels, metavar="N", help="with --compare: levels that are the same (default 1)")
    group("--json", action="store_true", help="with --explain and --compare: one JSON object")
    group("--stats", nargs="?", const="text", type=_form, choices=("text", "json"), metavar="text|json",
          help="times and counts")  # fmt: skip
    group("--repeat", type=_repeats, default=1, metavar="N", help="render N times, report the fastest")
    group(
        "--keep",
        metavar="NAME,...",
        action="extend",
        type=_keep,
        default=[],
        help="skip none of these, to measure that: lists, ... (docs/speed.md has them)",
    )

    group = p.add_argument_group("messages").add_argument
    group("-q", "--quiet", action="store_true", help="only errors")
    group("-v", "--verbose", action="store_true", help="with an error, also its traceback")
    group("-h", "--help", action="help", help="show this and stop")
    group("--version", action="version", version=f"cltrace {__version__}")
    return p


def _crop(text: str) -> Crop:
    if not re.fullmatch(r"[0-9]{1,9}(,[0-9]{1,9}){3}", text):
        sign = " without a sign" if "-" in text or "+" in text else ""
        raise argparse.ArgumentTypeError(f"must be X0,Y0,X1,Y1{sign}, such as 0,0,64,64, got {text!r}")
    x0, y0, x1, y1 = map(int, text.split(","))
    return (x0, y0, x1, y1)


def _pixel(text: str) -> tuple[int, int]:
    if not re.fullmatch(r"[0-9]{1,9},[0-9]{1,9}", text):
        raise argparse.ArgumentTypeError(f"must be X,Y from the top left, such as 320,200, got {text!r}")
    x, y = map(int, text.split(","))
    return x, y


def _levels(text: str) -> int:
    if not re.fullmatch(r"[0-9]{1,3}", text) or int(text) > 255:
        raise argparse.ArgumentTypeError(f"must be a whole number of levels within 0..255, got {text!r}")
    return int(text)


def _keep(text: str) -> list[Keep]:
    names = [name for name in KEEPS if name in text.split(",")]
    for name in text.split(","):
        if name not in KEEPS:
            raise argparse.ArgumentTypeError(f"must be of {', '.join(KEEPS)}, got {name!r}")
    return names


def _repeats(text: str) -> int:
    if text.endswith(".xml"):
        raise argparse.ArgumentTypeError(f"put the scene first, or say --check=N; {text!r} is not a number")
    return positive(text)


def _form(text: str) -> str:
    if text.endswith(".xml"):
        raise argparse.ArgumentTypeError(f"put the scene first, or say --stats=text; {text!r} is not a form")
    return text


def _count(text: str) -> str | int:
    return text if text in ("all", "default") else _repeats(text)


def main(argv: list[str] | None = None) -> int:
    """Runs the command. Returns its exit status: 0 ok, 1 check failed, 2 usage or scene, 3 device, 130 Ctrl-C."""
    args = argparse.Namespace(verbose=False)
    return command("cltrace", lambda: _run(parser().parse_args(argv, args)), verbose=lambda: args.verbose)


def _run(args: argparse.Namespace) -> int:
    started = time.perf_counter()
    if args.quiet:
        logging.getLogger("cltrace").setLevel(logging.WARNING)
    for option, given in (("--doctor", args.doctor), ("--list-devices", args.list_devices)):
        if given and args.scene is not None:
            raise UsageError(f"{option} takes no scene, got {args.scene!r}")
    if args.doctor:
        from cltrace.doctor import doctor

        return doctor(args.device)
    if args.list_devices:
        if args.device is not None:
            raise UsageError("--list-devices lists all devices, so it takes no -d; --doctor -d SPEC tries one")
        listing = [d.line() for d in devices()]
        print("\n".join(listing) if listing else f"no OpenCL device found\n{where_drivers_are()}")
        return 0 if listing else 3
    if args.scene is None:
        raise UsageError("which scene? Say cltrace SCENE.xml; see cltrace --help")
    if args.scene == "-" and not Path("-").exists():
        raise UsageError("a scene is not read from stdin: say the name of its file")

    say: Callable[[str], None] = (lambda text: None) if args.quiet else tell
    if args.explain is not None:
        return _explain(args, say)
    if args.space and args.show not in DIRECTED:
        raise UsageError(f"--space goes with --show {' and --show '.join(DIRECTED)}")
    if args.compare is not None:
        return _compare(args, say)
    if args.tolerance is not None:
        raise UsageError("--tolerance goes with --compare")
    if args.json:
        raise UsageError("--json goes with --explain and --compare; times and counts are --stats=json")
    start = time.perf_counter()
    scene, warnings = read(args.scene)
    read_seconds = time.perf_counter() - start
    for warning in warnings:
        say(warning)
    scene = _adapted(scene, args)
    target = _target(scene, args)
    if args.show == LIT:
        return _show_lit(scene, target, args, say)

    device = choose(args.device)
    outputs: list[Output] = ["rgb8"] if args.show == "color" else [args.show]
    if args.check is not None:
        outputs += ["rgb8", "id"]
    try:
        renderer = Renderer(
            scene, device, args.precision, tuple(outputs), args.crop, args.truncate, keep=tuple(args.keep)
        )
    except ValueError as error:
        raise UsageError(str(error)) from None
    image = best = renderer.render()
    for _ in range(args.repeat - 1):
        image = renderer.render(image)
        if image.frame_seconds < best.frame_seconds:
            best = image
    image.seconds = {"read": read_seconds, **best.seconds}

    start = time.perf_counter()
    _write(image, target, args.show, scene.camera.basis() if args.space == "camera" else None)
    image.seconds["write"] = time.perf_counter() - start
    image.seconds["total"] = time.perf_counter() - started
    if target != "-":
        width, height = renderer.region[2:]
        say(f"cltrace: wrote {target}, {width}x{height}, {renderer.precision} precision, on {device.name}")
    if args.show == "depth":
        say(f"cltrace: depth: {_depth_scale(image)}")
    if args.stats:
        _print_stats(_stats(scene, renderer, image), args.stats)
    if args.check is None:
        return 0
    from cltrace.reference.check import check

    pixels = {"all": renderer.region[2] * renderer.region[3], "default": None}.get(args.check, args.check)
    try:
        origin, progress = renderer.region[:2], _progress(args.quiet)
        report = check(scene, image, renderer.precision, pixels, origin, args.truncate, progress)
    except ValueError as error:  # the reference traces what the kernel proves to be too faint, and has the same ceiling
        raise UsageError(f"--check: {error}") from None
    (say if report.ok else tell)(f"cltrace: {report}")
    return 0 if report.ok else 1


def _explain(args: argparse.Namespace, say: Callable[[str], None]) -> int:
    """Prints why a pixel has its colour."""
    _refuse_others(args, "--explain", "size", "square_pixels", "truncate", "json")
    scene, warnings = read(args.scene, lines=True)
    for warning in warnings:
        say(warning)
    scene = _adapted(scene, args)
    (x, y), (width, height) = args.explain, scene.camera.resolution
    if not (x < width and y < height):
        raise UsageError(f"--explain: must be within 0,0 and {width - 1},{height - 1}, got {x},{y}")
    from cltrace.explanation.pixel import explain

    explanation = explain(scene, x, y, truncate=args.truncate)
    if sys.stdout is None:
        raise UsageError("stdout is closed")
    print(explanation.to_json() if args.json else explanation, flush=True)
    return 0


def _compare(args: argparse.Namespace, say: Callable[[str], None]) -> int:
    """Prints how a picture differs from the right one, and why. Returns 0 if it does not, and 1 if it does."""
    taken = "output", "tolerance", "json", "size", "square_pixels", "truncate", "device", "precision"
    _refuse_others(args, "--compare", *taken)
    scene, warnings = read(args.scene)
    for warning in warnings:
        say(warning)
    scene = _adapted(scene, args)
    target = None if args.output is None else _target(scene, args)
    if sys.stdout is None:
        raise UsageError("stdout is closed")
    if target == "-" and args.json:
        raise UsageError("-o - and --json both want stdout")
    own, other = Path(args.compare), Path(target or "-")
    if target not in (None, "-") and own.exists() and other.exists() and own.samefile(other):
        raise UsageError(f"-o: {target!r} is the picture itself, which the comparison would replace")
    device, tolerance = choose(args.device), 1 if args.tolerance is None else args.tolerance
    options = {"device": device, "precision": args.precision, "truncate": args.truncate}
    try:
        result = compare(scene, args.compare, tolerance=tolerance, **options)
    except ValueError as error:
        raise UsageError(str(error)) from None
    if target is not None:
        _write(Image(rgb8=result.side_by_side()), target, "color")
    (say if target == "-" else print)(result.to_json() if args.json else str(result))
    return 0 if result.same else 1


def _refuse_others(args: argparse.Namespace, option: str, *taken: str) -> None:
    """Raises UsageError if an option is given that does not go with this one. taken: those that do."""
    p, own = parser(), option.removeprefix("--")
    for name, value in vars(args).items():
        if name not in ("scene", "quiet", "verbose", own, *taken) and value != p.get_default(name):
            other = "-d" if name == "device" else "-o" if name == "output" else f"--{name.replace('_', '-')}"
            raise UsageError(f"{option} takes no {other}")


def _show_lit(scene: Scene, target: str, args: argparse.Namespace, say: Callable[[str], None]) -> int:
    """Writes a picture of which lights reach which pixels, and says what its colours are."""
    _refuse_others(args, "--show lit", "show", "output", "size", "crop", "square_pixels", "device", "precision")
    count = int((scene.lights["kind"] != AMBIENT).sum())
    if count > MAX_LIGHTS:
        raise UsageError(f"--show lit tells {MAX_LIGHTS} lights apart, and the scene has {count}")
    from cltrace.lighting import lighting

    device = choose(args.device)
    try:
        found = lighting(scene, device, args.precision, args.crop)
    except ValueError as error:
        raise UsageError(str(error)) from None
    colors = found.as_rgb8()
    _write(Image(rgb8=colors), target, "color")
    if target != "-":
        say(f"cltrace: wrote {target}, {colors.shape[1]}x{colors.shape[0]}, on {device.name}")
    legend = list(found.legend())
    for line in legend[:SETS]:
        say(f"cltrace: lit: {line}")
    if len(legend) > SETS:
        say(f"cltrace: lit: and {len(legend) - SETS} more sets of lights")
    return 0


def _adapted(scene: Scene, args: argparse.Namespace) -> Scene:
    """The scene with the camera that the command line asks for."""
    camera = scene.camera
    if args.size:
        camera = replace(camera, resolution=args.size)
    if args.square_pixels:
        camera = replace(camera, square_pixels=True)
    return scene.seen_by(camera)


def _target(scene: Scene, args: argparse.Namespace) -> str:
    """Where the picture goes; what can be known to fail is found before the work."""
    target: str = scene.output_file if args.output is None else args.output
    origin = "output_file" if args.output is None else "-o"
    if sys.stdout is None and (target == "-" or args.stats == "json"):
        raise UsageError("stdout is closed")
    if target == "-":
        if args.stats == "json":
            raise UsageError("-o - and --stats=json both want stdout")
        if sys.stdout.isatty():
            raise UsageError("-o - writes a PNG: send stdout to a file or a program")
        return target
    try:
        _check_target(target, origin, args.scene)
    except (OSError, ValueError) as error:  # too long a name, a locked folder, a null byte, a link to itself
        raise UsageError(f"{origin}: {getattr(error, 'strerror', None) or error}: {target!r}") from None
    return target


def _check_target(target: str, origin: str, scene: str) -> None:
    """Raises UsageError, OSError or ValueError if no picture can or should be written to a file of this name."""
    path = Path(target)
    if not target:
        raise UsageError("-o: must not be empty")
    if path.is_dir() or is_named_as_folder(target):
        raise UsageError(f"{origin}: {target!r} is a folder")
    if path.suffix.lower() != ".png":
        advice = "; -o - writes it to stdout" if target in STDOUT else ""
        raise UsageError(f"-o: the picture is a PNG and its name must end in .png, got {target!r}{advice}")
    if not path.parent.is_dir():
        raise UsageError(f"-o: there is no folder {str(path.parent)!r}")
    try:
        existing = path.stat()
    except FileNotFoundError:  # the usual case, or a link that is to be written through
        return
    if os.path.samestat(existing, Path(scene).stat()):
        raise UsageError(f"{origin}: {target!r} is the scene itself, which the picture would replace")


def _depth_scale(image: Image) -> str:
    """What the greys of a picture of depths stand for."""
    ends = depth_range(image.depth)
    if ends is None:
        return "no surface is seen, and all is black"
    near, far = (f"{depth:.6g}" for depth in ends)
    return (
        f"{near} is white ({NEAR}), {far} is dark ({FAR}), nothing is black; in between, a grey is "
        f"{FAR} + {NEAR - FAR} (1/depth - 1/{far}) / (1/{near} - 1/{far})"
    )


def _write(image: Image, target: str, show: Show, axes: ArrayLike | None = None) -> None:
    try:
        if target == "-":
            image.write_png(sys.stdout.buffer, show, axes)
            sys.stdout.buffer.flush()
        else:
            image.save(target, show, axes)
    except BrokenPipeError:
        raise
    except (OSError, UnicodeError) as error:
        raise UsageError(f"cannot write {target}: {getattr(error, 'strerror', None) or error}") from None


def _stats(scene: Scene, renderer: Renderer, image: Image) -> dict[str, Any]:
    width, height = renderer.region[2:]
    work = renderer.work()
    names = ("read", "pack", "lists", "build", "upload", "kernel", "readback", "write", "total")
    return {
        "device": renderer.device.name,
        "precision": renderer.precision,
        "size": [width, height],
        "spheres": len(scene.columns),
        "triangles": scene.triangles,
        "features": sorted(renderer.plan.features),
        "seconds": {name: image.seconds[name] for name in names},
        "rays": {"primary": width * height, "shadow": work["shadow rays traced"]},
        "work": work,
        "skipped": renderer.skipped,
    }


def _print_stats(stats: dict[str, Any], form: str) -> None:
    if form == "json":
        print(json.dumps(stats), flush=True)
        return
    tell(f"device     {stats['device']}")
    tell(f"precision  {stats['precision']}")
    triangles = f", {stats['triangles']} triangles" if stats["triangles"] else ""
    tell(f"size       {stats['size'][0]}x{stats['size'][1]}, {stats['spheres']} spheres{triangles}")
    tell(f"features   {' '.join(stats['features'])}")
    for name, value in stats["seconds"].items():
        tell(f"{name:<10} {value * 1e3:10.2f} ms")
    for name, value in stats["rays"].items():
        tell(f"rays       {value:10d} {name}")
    for name, value in stats["work"].items():
        tell(f"work       {value:10d} {name}")
    for name, value in stats["skipped"].items():
        tell(f"skipped    {value:10d} {name}")


def _progress(quiet: bool) -> Callable[[float], None]:
    """Shows the share done on a terminal, after the first second."""
    start = time.monotonic()

    def show(share: float) -> None:
        if not quiet and sys.stderr.isatty() and time.monotonic() - start > 1:
            print(f"\rcltrace: checking {100 * share:3.0f} %\r", end="", file=sys.stderr, flush=True)

    return show


if __name__ == "__main__":
    sys.exit(main())

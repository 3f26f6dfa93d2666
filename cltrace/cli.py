"""The command `cltrace`: options, messages, exit codes. The only module that prints."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any, NoReturn

from .check import check
from .device import choose, devices, where_drivers_are
from .errors import CltraceError, UsageError
from .image import SHOWS, Image
from .layout import KEEPS, PRECISIONS
from .reader import read
from .scene import Scene, check_resolution
from .tracer import Crop, Renderer


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see cltrace --help")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = _Parser(prog="cltrace", description="Render a scene file of spheres with OpenCL.", allow_abbrev=False)
    p.add_argument("scene", nargs="?", metavar="SCENE.xml", help="the scene to render")
    p.add_argument("-o", "--output", metavar="PNG", help="where to; - is stdout (default: the scene's output_file)")
    p.add_argument("-d", "--device", metavar="SPEC", help="cpu, gpu, P:D or part of a name (default: fastest CPU)")
    p.add_argument("--list-devices", action="store_true", help="list the devices and stop")
    p.add_argument("--size", type=_size, metavar="WxH", help="picture size instead of the scene's")
    p.add_argument("--crop", type=_crop, metavar="X0,Y0,X1,Y1", help="only these pixels of it (X1, Y1 excluded)")
    p.add_argument("--precision", choices=PRECISIONS, help="default: accurate; single on a device without doubles")
    p.add_argument("--show", choices=SHOWS, default="color", help="what the picture shows, encoded as colours")
    p.add_argument("--square-pixels", action="store_true", help="vertical half-angle by tan(angle)*H/W")
    p.add_argument("--truncate", action="store_true", help="bytes are trunc(255 c), as in the course's own pictures")
    p.add_argument("--check", nargs="?", const="default", type=_count, metavar="N|all",
                   help="compare N pixels (default 20000) with the reference; exit 1 if they differ")  # fmt: skip
    p.add_argument("--stats", nargs="?", const="text", choices=("text", "json"), help="times and counts")
    p.add_argument(
        "--keep",
        metavar="NAME",
        action="append",
        choices=KEEPS,
        default=[],
        help=f"do not skip this, to measure what it saves: {', '.join(KEEPS)}",
    )
    p.add_argument("--repeat", type=_positive, default=1, metavar="N", help="render N times, report the fastest")
    p.add_argument("-q", "--quiet", action="store_true", help="only errors")
    p.add_argument("-v", "--verbose", action="store_true", help="more, with tracebacks of errors")
    p.add_argument("--version", action="version", version=f"cltrace {metadata.version('cltrace')}")
    return p


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([0-9]{1,9})x([0-9]{1,9})", text)
    if not match:
        raise argparse.ArgumentTypeError(f"must be WIDTHxHEIGHT, such as 640x480, got {text!r}")
    try:
        return check_resolution((int(match[1]), int(match[2])))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error).removeprefix("camera.resolution: ")) from None


def _crop(text: str) -> Crop:
    if not re.fullmatch(r"[0-9]{1,9}(,[0-9]{1,9}){3}", text):
        raise argparse.ArgumentTypeError(f"must be X0,Y0,X1,Y1, such as 0,0,64,64, got {text!r}")
    x0, y0, x1, y1 = map(int, text.split(","))
    return (x0, y0, x1, y1)


def _positive(text: str) -> int:
    if text.endswith(".xml"):
        raise argparse.ArgumentTypeError(f"put the scene first, or say --check=N; {text!r} is not a number")
    if not re.fullmatch(r"[0-9]{1,9}", text) or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number >= 1, got {text!r}")
    return int(text)


def _count(text: str) -> str | int:
    return text if text in ("all", "default") else _positive(text)


def main(argv: list[str] | None = None) -> int:
    """Runs the command. Returns its exit status: 0 ok, 1 check failed, 2 usage or scene, 3 device, 130 Ctrl-C."""
    args = argparse.Namespace(verbose=False)
    # A closed stderr is None, and print() would then take stdout for it.
    if sys.stderr is None:
        sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _terminate)
    try:
        args = parser().parse_args(argv, args)
        status = _run(args)
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except CltraceError as error:
        if args.verbose:
            traceback.print_exc()
        return _fail(str(error), error.exit_code, prefixed=type(error).__name__ != "SceneError")
    except KeyboardInterrupt:
        return _fail("interrupted", 128 + signal.SIGINT)
    except BrokenPipeError:
        # The reader of stdout has gone; keep Python from failing once more when it flushes.
        _silence_stdout()
        return 128 + signal.SIGPIPE
    except OSError as error:
        _silence_stdout()
        return _fail(f"cannot write: {error.strerror or error}", 2)
    except MemoryError:
        return _fail("not enough memory", 2)


def _terminate(*_: object) -> NoReturn:
    """SIGTERM ends the command as an exception does, so that nothing half-written is left."""
    raise SystemExit(128 + signal.SIGTERM)


def _silence_stdout() -> None:
    """Keeps Python from failing once more when it flushes at its end."""
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _tell(message: str) -> None:
    """A message on stderr. Control characters of file names are shown, not sent; a full disk changes nothing."""
    shown = "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in message)
    with contextlib.suppress(OSError):
        print(shown, file=sys.stderr, flush=True)


def _fail(message: str, status: int, prefixed: bool = True) -> int:
    _tell(f"cltrace: {message}" if prefixed else message)
    return status


def _run(args: argparse.Namespace) -> int:
    started = time.perf_counter()
    if args.list_devices:
        listing = [d.line() for d in devices()]
        print("\n".join(listing) if listing else f"no OpenCL device found\n{where_drivers_are()}")
        return 0 if listing else 3
    if args.scene is None:
        raise UsageError("which scene? Say cltrace SCENE.xml; see cltrace --help")

    say: Callable[[str], None] = (lambda text: None) if args.quiet else _tell
    start = time.perf_counter()
    scene, warnings = read(args.scene)
    read_seconds = time.perf_counter() - start
    for warning in warnings:
        say(warning)
    scene = _adapted(scene, args)
    target = _target(scene, args)

    device = choose(args.device)
    outputs = ["rgb8"] if args.show == "color" else [args.show]
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
        if _frame_seconds(image) < _frame_seconds(best):
            best = image
    image.seconds = {"read": read_seconds, **best.seconds}

    start = time.perf_counter()
    _write(image, target, args.show)
    image.seconds["write"] = time.perf_counter() - start
    image.seconds["total"] = time.perf_counter() - started
    if target != "-":
        width, height = renderer.region[2:]
        say(f"cltrace: wrote {target}, {width}x{height}, {renderer.precision} precision, on {device.name}")
    if args.stats:
        _print_stats(_stats(scene, renderer, image), args.stats)
    if args.check is None:
        return 0
    pixels = {"all": renderer.region[2] * renderer.region[3], "default": None}.get(args.check, args.check)
    report = check(scene, image, renderer.precision, pixels, renderer.region[:2], args.truncate, _progress(args.quiet))
    if report.ok:
        say(f"cltrace: {report}")
        return 0
    return _fail(str(report), 1)


def _frame_seconds(image: Image) -> float:
    return image.seconds["kernel"] + image.seconds["readback"]


def _adapted(scene: Scene, args: argparse.Namespace) -> Scene:
    """The scene with the camera that the command line asks for."""
    camera = scene.camera
    if args.size:
        camera = replace(camera, resolution=args.size)
    if args.square_pixels:
        camera = replace(camera, square_pixels=True)
    return replace(scene, camera=camera)


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
    path = Path(target)
    try:
        if not target or path.is_dir():
            raise UsageError(f"{origin}: {target!r} is a folder" if target else "-o: must not be empty")
        if path.suffix.lower() != ".png":
            raise UsageError(f"-o: the picture is a PNG and its name must end in .png, got {target!r}")
        if not path.parent.is_dir():
            raise UsageError(f"-o: there is no folder {str(path.parent)!r}")
    except (OSError, ValueError) as error:  # too long a name, a locked folder, a null byte
        raise UsageError(f"{origin}: {getattr(error, 'strerror', None) or error}: {target!r}") from None
    return target


def _write(image: Image, target: str, show: str) -> None:
    try:
        if target == "-":
            image.write_png(sys.stdout.buffer, show)
            sys.stdout.buffer.flush()
        else:
            image.save(target, show)
    except BrokenPipeError:
        raise
    except (OSError, UnicodeError) as error:
        raise UsageError(f"cannot write {target}: {getattr(error, 'strerror', None) or error}") from None


def _stats(scene: Scene, renderer: Renderer, image: Image) -> dict[str, Any]:
    width, height = renderer.region[2:]
    work = renderer.work()
    names = ("read", "pack", "build", "upload", "kernel", "readback", "write", "total")
    return {
        "device": renderer.device.name,
        "precision": renderer.precision,
        "size": [width, height],
        "spheres": len(scene.spheres),
        "features": sorted(renderer.packed.features),
        "seconds": {name: image.seconds[name] for name in names},
        "rays": {"primary": width * height, "shadow": work["shadow rays traced"]},
        "work": work,
        "skipped": renderer.skipped,
    }


def _print_stats(stats: dict[str, Any], form: str) -> None:
    if form == "json":
        print(json.dumps(stats), flush=True)
        return
    _tell(f"device     {stats['device']}")
    _tell(f"precision  {stats['precision']}")
    _tell(f"size       {stats['size'][0]}x{stats['size'][1]}, {stats['spheres']} spheres")
    _tell(f"features   {' '.join(stats['features'])}")
    for name, value in stats["seconds"].items():
        _tell(f"{name:<10} {value * 1e3:10.2f} ms")
    for name, value in stats["rays"].items():
        _tell(f"rays       {value:10d} {name}")
    for name, value in stats["work"].items():
        _tell(f"work       {value:10d} {name}")
    for name, value in stats["skipped"].items():
        _tell(f"skipped    {value:10d} {name}")


def _progress(quiet: bool) -> Callable[[float], None]:
    """Shows the share done on a terminal, after the first second."""
    start = time.monotonic()

    def show(share: float) -> None:
        if not quiet and sys.stderr.isatty() and time.monotonic() - start > 1:
            print(f"\rcltrace: checking {100 * share:3.0f} %\r", end="", file=sys.stderr, flush=True)

    return show


if __name__ == "__main__":
    sys.exit(main())

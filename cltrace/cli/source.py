"""Which scene is drawn: that of the file, with the camera and background that the command line asks for."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from cltrace.formats.xml_reader import read
from cltrace.scene import Camera, Scene


def scene_of(args: argparse.Namespace, say: Callable[[str], None], lines: bool = False) -> Scene:
    """The scene to draw; its warnings are said. lines: whether surfaces and lights keep their lines in the file.

    The files that it names are in args.files from then on, for --watch.
    """
    scene, warnings = read(args.scene, lines=lines)
    args.files = _named(scene, Path(args.scene).parent)
    for warning in warnings:
        say(warning)
    return adapted(scene, args)


def _named(scene: Scene, folder: Path) -> list[Path]:
    """The files of its meshes and textures."""
    if scene.source is None:
        return []
    return [folder / name for name in (*(mesh.name for mesh in scene.source.meshes.values()), *scene.source.textures)]


def adapted(scene: Scene, args: argparse.Namespace) -> Scene:
    """The scene with the camera and the background that the command line asks for."""
    camera = scene.camera
    if args.size:
        camera = replace(camera, resolution=args.size)
    if args.square_pixels and isinstance(camera, Camera):  # no file has any other
        camera = replace(camera, square_pixels=True)
    seen = scene.seen_by(camera)
    return seen.in_front_of((*scene.background, 0.0)) if args.transparent else seen

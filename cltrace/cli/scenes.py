"""Which scene is drawn: that of the file, with the camera and background that the command line asks for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cltrace.base.errors import SceneError
from cltrace.base.waiting import SLOW, Announcement
from cltrace.cli.options import SceneOptions
from cltrace.cli.reporter import Reporter
from cltrace.formats.reader import read
from cltrace.scene import Camera, Scene


def files_of(scene: Scene) -> tuple[Path, ...]:
    """The files that a scene is made of."""
    return scene.source.files if scene.source else ()


def scene_of(asked: SceneOptions, reporter: Reporter, lines: bool = False) -> Scene:
    """The scene to draw; its warnings are said. lines: whether surfaces and lights keep their lines in the file."""
    try:
        with Announcement(f"reading {asked.path} ...", SLOW):
            scene, warnings = read(asked.path, lines, asked.instances)
    except SceneError as error:
        reporter.files |= set(error.files)
        raise
    reporter.files |= set(files_of(scene))
    for warning in warnings:
        reporter.say(warning)
    camera = scene.camera
    if asked.size:
        camera = replace(camera, resolution=asked.size)
    if asked.square_pixels and isinstance(camera, Camera):  # no file has any other
        camera = replace(camera, square_pixels=True)
    seen = scene.seen_by(camera)
    return seen.in_front_of((*scene.background, 0.0)) if asked.transparent else seen

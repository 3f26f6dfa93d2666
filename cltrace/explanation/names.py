"""Surfaces and lights in the words of the scene's file: kind, number and line."""

from __future__ import annotations

from cltrace.explanation.record import LightName, SurfaceName
from cltrace.reference import Surface
from cltrace.scene import AMBIENT, BALL, LAMBERT, PANEL, PARALLEL, POINT, SKY, SPOT, SUN, Scene

KINDS = {
    AMBIENT: "ambient_light",
    PARALLEL: "parallel_light",
    POINT: "point_light",
    SPOT: "spot_light",
    LAMBERT: "lambert_light",
    SKY: "sky_light",
    SUN: "sun_light",
    BALL: "ball_light",
    PANEL: "panel_light",
}


class Names:
    """What the surfaces, lights and textures of a scene are called."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.source = scene, scene.source

    def surface(self, surface: Surface) -> SurfaceName:
        number = surface.number
        line = int(self.source.surfaces[number]) if self.source else 0
        file = self.source.meshes.get(number) if self.source else None
        face_line = int(file.lines[surface.primitive]) if file and surface.primitive >= 0 else 0
        name = file.name if file else ""
        return SurfaceName(surface.kind, number, line, file=name, primitive=surface.primitive, face_line=face_line)

    def light(self, number: int) -> LightName:
        """number: among all lights of the scene."""
        line = int(self.source.lights[number]) if self.source else 0
        return LightName(KINDS[int(self.scene.lights[number]["kind"])], number, line)

    def texture(self, index: int) -> str:
        return self.source.textures[index] if self.source else ""

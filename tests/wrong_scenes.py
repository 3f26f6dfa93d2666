"""Five small scenes of which each has what every mistake of `wrong_tracers` needs to show.

That is lights of all kinds, things behind them, mirrors face to face, glass, textures, ellipsoids, smooth meshes of
which a scale differs from axis to axis, and a sheet that is lit from behind. None is square.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image as Picture

Step = tuple[str, float] | tuple[str, float, float, float]
Numbers = tuple[float, float, float]

SQUARE = """v -0.5 0 0.5
v 0.5 0 0.5
v 0.5 0 -0.5
v -0.5 0 -0.5
vt 0 1
vt 1 1
vt 1 0
vt 0 0
f 1/1 2/2 3/3 4/4
"""
# An octahedron with the normals of a ball.
GEM = """v 1 0 0
v -1 0 0
v 0 1 0
v 0 -1 0
v 0 0 1
v 0 0 -1
vn 1 0 0
vn -1 0 0
vn 0 1 0
vn 0 -1 0
vn 0 0 1
vn 0 0 -1
f 1//1 3//3 5//5
f 3//3 2//2 5//5
f 2//2 4//4 5//5
f 4//4 1//1 5//5
f 3//3 1//1 6//6
f 2//2 3//3 6//6
f 4//4 2//2 6//6
f 1//1 4//4 6//6
"""


def scenes(folder: Path) -> dict[str, Path]:
    """Writes the scenes with their meshes and textures into a folder. Returns the files by the scenes' names."""
    (folder / "square.obj").write_text(SQUARE)
    (folder / "gem.obj").write_text(GEM)
    random = np.random.default_rng(17)
    for name, shape in (("rug", (5, 7, 3)), ("globe", (6, 10, 3))):
        texels = random.integers(60, 256, shape, dtype=np.uint8)
        texels[random.random(shape[:2]) < 0.2] = 255
        Picture.fromarray(texels).save(folder / f"{name}.png")
    paths = {}
    for name, text in ((make.__name__, make()) for make in SCENES):
        paths[name] = folder / f"{name}.xml"
        paths[name].write_text(text)
    return paths


def _attributes(**values: float) -> str:
    return " ".join(f'{name}="{value:g}"' for name, value in values.items())


def _xyz(tag: str, v: Numbers) -> str:
    return f"<{tag} {_attributes(x=v[0], y=v[1], z=v[2])}/>"


def _color(c: Numbers) -> str:
    return f"<color {_attributes(r=c[0], g=c[1], b=c[2])}/>"


def _scene(camera: str, lights: list[str], surfaces: list[str]) -> str:
    parts = ["<lights>", *lights, "</lights>", "<surfaces>", *surfaces, "</surfaces>"]
    sky = '<background_color r="0.35" g="0.45" b="0.6"/>'
    return "\n".join(['<scene output_file="out.png">', sky, camera, *parts, "</scene>\n"])


def _camera(eye: Numbers, at: Numbers, fov: float, size: tuple[int, int], bounces: int) -> str:
    view = _xyz("position", eye) + _xyz("lookat", at) + _xyz("up", (0.1, 1, 0)) + f'<horizontal_fov angle="{fov}"/>'
    picture = f'<resolution horizontal="{size[0]}" vertical="{size[1]}"/><max_bounces n="{bounces}"/>'
    return f"<camera>{view}{picture}</camera>"


def _ambient(c: Numbers) -> str:
    return f"<ambient_light>{_color(c)}</ambient_light>"


def _parallel(c: Numbers, direction: Numbers) -> str:
    return f"<parallel_light>{_color(c)}{_xyz('direction', direction)}</parallel_light>"


def _point(c: Numbers, position: Numbers) -> str:
    return f"<point_light>{_color(c)}{_xyz('position', position)}</point_light>"


def _spot(c: Numbers, position: Numbers, direction: Numbers, angles: tuple[float, float]) -> str:
    falloff = f"<falloff {_attributes(alpha1=angles[0], alpha2=angles[1])}/>"
    return f"<spot_light>{_color(c)}{_xyz('position', position)}{_xyz('direction', direction)}{falloff}</spot_light>"


def _look(
    color: Numbers | str,
    phong: tuple[float, float, float, float] = (0.5, 0.7, 0.5, 20),
    mirror: float = 0,
    glass: float = 0,
    index: float = 0,
) -> str:
    """color: a colour, or the name of a texture; phong: ka, kd, ks and the exponent."""
    kind = "textured" if isinstance(color, str) else "solid"
    first = f'<texture name="{color}.png"/>' if isinstance(color, str) else _color(color)
    shading = _attributes(**dict(zip(("ka", "kd", "ks", "exponent"), phong, strict=True)))
    passed = f'<reflectance r="{mirror}"/><transmittance t="{glass}"/><refraction iof="{index}"/>'
    return f"<material_{kind}>{first}<phong {shading}/>{passed}</material_{kind}>"


def _transform(steps: tuple[Step, ...]) -> str:
    if not steps:
        return ""
    tags = [
        f'<{step[0]} theta="{step[1]:g}"/>' if len(step) == 2 else _xyz(step[0], (step[1], step[2], step[3]))
        for step in steps
    ]
    return f"<transform>{''.join(tags)}</transform>"


def _sphere(center: Numbers, radius: float, look: str, *steps: Step) -> str:
    return f'<sphere radius="{radius}">{_xyz("position", center)}{look}{_transform(steps)}</sphere>'


def _mesh(name: str, look: str, *steps: Step) -> str:
    return f'<mesh name="{name}.obj">{look}{_transform(steps)}</mesh>'


def _pebbles(*places: Numbers) -> list[str]:
    """Small balls, whose shadows begin right beside them."""
    return [_sphere(place, 0.2, _look((0.8, 0.75, 0.7), (0.4, 0.8, 0.3, 10))) for place in places]


def room() -> str:
    """A rug between two mirrors, balls of mirror and glass, an egg and a gem; the point light is below a lid."""
    lights = [
        _ambient((0.5, 0.5, 0.5)),
        _parallel((0.5, 0.45, 0.4), (-1, -2, -1.5)),
        _point((0.7, 0.7, 0.8), (1.6, 3.6, 2.6)),
        _spot((0.9, 0.8, 0.5), (-2.5, 4.5, 3.5), (2, -4, -3), (12, 28)),
    ]
    surfaces = [
        _mesh("square", _look("rug"), ("translate", 0, -0.02, -1), ("scale", 9, 1, 9)),
        _mesh(
            "square", _look((0.7, 0.8, 0.9), (0.1, 0.2, 0.6, 30), 0.8), ("translate", -3.2, 1.5, -0.5),
            ("rotateY", 8), ("rotateZ", -90), ("scale", 3, 1, 4),
        ),
        _mesh(
            "square", _look((0.9, 0.8, 0.7), (0.1, 0.2, 0.6, 30), 0.8), ("translate", 3.2, 1.5, -0.5),
            ("rotateY", -6), ("rotateZ", 90), ("scale", 3, 1, 4),
        ),
        _sphere((0.1, 0.9, -2.2), 0.9, _look((0.9, 0.5, 0.2), (0.4, 1.4, 0.7, 15), 0.4)),
        _sphere((-1.2, 0.7, 0.9), 0.7, _look((0.6, 0.9, 0.7), (0.1, 0.3, 0.5, 40), 0, 0.8, 1.5)),
        _sphere((0, 0, 0), 0.6, _look((0.9, 0.2, 0.4)), ("translate", 1.4, 0.8, 0.4), ("rotateZ", 35),
                ("scale", 1.6, 0.6, 1), ("rotateY", 20)),
        _sphere((0, 0, 0), 0.6, _look("globe"), ("translate", -1.9, 2.2, -1.2), ("rotateX", 25), ("rotateY", 50)),
        _mesh("gem", _look((0.3, 0.6, 0.95)), ("translate", 1.6, 2.2, -1.6), ("rotateZ", 25),
              ("scale", 0.8, 0.35, 0.5)),
        # Its front is lit by nothing but the spot light; the others shine on its back.
        _mesh("square", _look((0.95, 0.85, 0.3), (0.4, 0.8, 1, 6)), ("translate", 0, 2.9, 0.9), ("rotateX", 14),
              ("scale", 1.6, 1, 0.9)),
        _sphere((1.9, 5.2, 3), 1.1, _look((0.5, 0.5, 0.5))),
        *_pebbles((0.2, 0.17, 2.1), (0.9, 0.17, 2.6), (-0.6, 0.17, 3), (2, 0.15, 1.8)),
    ]  # fmt: skip
    return _scene(_camera((0.2, 2.1, 6.5), (0, 1.3, 0), 38, (40, 28), 2), lights, surfaces)


def tower() -> str:
    """A picture that is higher than it is wide: things one above the other, seen from below."""
    lights = [
        _ambient((0.4, 0.4, 0.5)),
        _parallel((0.6, 0.5, 0.5), (1, -1, -1.2)),
        _point((0.8, 0.8, 0.6), (-1.5, 1.6, 3)),
        _spot((0.6, 0.7, 0.9), (2, 5, 4), (-1.8, -3.5, -4), (20, 30)),
    ]
    surfaces = [
        _mesh("square", _look("rug", (0.6, 0.8, 0.3, 10)), ("translate", 0, 1.5, -3), ("rotateX", 80),
              ("scale", 7, 1, 10)),
        _sphere((0, 0.2, 0), 0.8, _look((0.8, 0.7, 0.3), (0.3, 1.2, 0.8, 12), 0.5)),
        _sphere((-0.9, 2, 0.4), 0.6, _look((0.7, 0.9, 0.9), (0.1, 0.2, 0.6, 30), 0.1, 0.8, 1.6)),
        _sphere((0.4, 0, 0), 0.5, _look((0.3, 0.9, 0.3)), ("translate", 0.7, 3.3, -0.2), ("rotateZ", 50),
                ("scale", 1.8, 0.7, 0.9)),
        _sphere((0, 0, 0), 0.7, _look("globe"), ("translate", 1, 1.7, -0.3), ("rotateZ", -35), ("rotateY", 120)),
        _mesh("gem", _look((0.9, 0.4, 0.6)), ("translate", -0.9, 3.6, 0), ("rotateX", 30), ("scale", 0.8, 0.3, 0.6)),
        _mesh("square", _look((0.8, 0.9, 0.8), (0.1, 0.3, 0.4, 20), 0.7), ("translate", -2, 1.5, -0.4),
              ("rotateY", 15), ("rotateZ", -90), ("scale", 6, 1, 3)),
        _mesh("square", _look((0.9, 0.8, 0.8), (0.1, 0.3, 0.4, 20), 0.7), ("translate", 2, 1.5, -0.4),
              ("rotateY", -12), ("rotateZ", 90), ("scale", 6, 1, 3)),
        _mesh("square", _look((0.9, 0.6, 0.3), (0.4, 0.8, 1, 5)), ("translate", 0, 4.4, 0.4), ("rotateX", -25),
              ("scale", 2.4, 1, 1.2)),
        _sphere((-2.1, 1.6, 5), 0.9, _look((0.5, 0.5, 0.5))),
        *_pebbles((0, 1.1, 0.2), (0.5, 0.85, 0.4), (-0.5, 0.3, 0.9), (-0.9, 2.7, 0.5)),
    ]  # fmt: skip
    return _scene(_camera((0, 1, 7), (0, 1.9, 0), 34, (27, 40), 1), lights, surfaces)


def cave() -> str:
    """The eye and all lights but one are inside a large ball, which the parallel light does not enter."""
    lights = [
        _ambient((0.3, 0.3, 0.3)),
        _parallel((0.5, 0.5, 0.5), (0.3, -1, -0.6)),
        _point((0.6, 0.5, 0.4), (0.5, 1.8, 1.2)),
        _point((0.3, 0.4, 0.6), (-2, 0.5, 3)),
        _spot((0.8, 0.8, 0.8), (0.5, 3, 4), (-0.2, -0.8, -1), (15, 40)),
    ]
    surfaces = [
        _sphere((0, 0, 0), 6, _look("globe", (0.6, 0.9, 0.4, 8)), ("rotateX", 40), ("rotateY", 30)),
        _sphere((-1.6, -0.4, -1), 1, _look((0.9, 0.9, 0.6), (0.2, 1.3, 0.5, 10), 0.6)),
        _sphere((1.5, -0.3, -1.4), 1.2, _look((0.5, 0.7, 0.9), (0.2, 1.1, 0.5, 10), 0.6)),
        _sphere((0.2, -0.9, 1.2), 0.8, _look((0.8, 0.9, 0.9), (0.1, 0.2, 0.5, 30), 0, 0.9, 1.4)),
        _sphere((0, 0, 0), 0.7, _look((0.9, 0.3, 0.3)), ("translate", 0.2, 1.3, -0.6), ("rotateZ", -30),
                ("scale", 1.7, 0.5, 0.8)),
        _mesh("gem", _look((0.4, 0.9, 0.5)), ("translate", 2.3, 1.4, 0.4), ("rotateZ", -40), ("scale", 0.9, 0.4, 0.5)),
        _mesh("square", _look("rug", (0.5, 0.8, 0.8, 6)), ("translate", -2.2, 1.8, 0.3), ("rotateZ", 12),
              ("rotateX", 10), ("scale", 1.8, 1, 1.8)),
        _sphere((0.6, 2.8, 1.3), 0.4, _look((0.6, 0.6, 0.6))),
        *_pebbles((-1.4, 0.7, -0.6), (1.2, 0.75, -0.8), (-2.1, 2, 0.5), (-2.4, 0.3, -0.3)),
    ]  # fmt: skip
    return _scene(_camera((0.3, 0.6, 5), (0, 0.3, 0), 36, (36, 26), 1), lights, surfaces)


def row() -> str:
    """A wide picture: a row of eggs before a mirror wall, which see themselves in a row of mirror balls."""
    lights = [
        _ambient((0.5, 0.5, 0.6)),
        _parallel((0.6, 0.6, 0.5), (-0.6, -1, -0.4)),
        _point((0.5, 0.6, 0.7), (-1, 1.5, 2)),
        _spot((0.8, 0.5, 0.5), (3, 3, 2), (-1, -2, -1.5), (10, 35)),
    ]
    colors = [(0.9, 0.3, 0.3), (0.3, 0.9, 0.4), (0.4, 0.4, 0.95)]
    surfaces = [
        _mesh("square", _look("rug", (0.5, 0.8, 0.4, 12)), ("translate", 0, -0.7, 0), ("scale", 11, 1, 7)),
        _mesh("square", _look((0.9, 0.9, 0.9), (0.1, 0.2, 0.4, 20), 0.75), ("translate", 0, 0.4, -2.4),
              ("rotateX", 90), ("scale", 9, 1, 3)),
        *(
            _sphere((0, 0, 0), 0.5, _look(color, (0.5, 1, 0.6, 15)), ("translate", -2.6 + 1.7 * i, 0.1, 0.2 * i),
                    ("rotateZ", 25 + 30 * i), ("scale", 1.5, 0.6, 0.9), ("rotateX", 40))
            for i, color in enumerate(colors)
        ),
        *(
            _sphere((-1.8 + 1.7 * i, 0, -1.2), 0.6, _look((0.9, 0.7, 0.5), (0.2, 1.1, 0.5, 10), 0.6))
            for i in range(3)
        ),
        _sphere((2.6, 0.1, 0.8), 0.75, _look((0.7, 0.9, 0.8), (0.1, 0.2, 0.5, 30), 0, 0.85, 1.5)),
        _sphere((0, 0, 0), 0.6, _look("globe"), ("translate", -3.6, 0.2, -0.6), ("rotateZ", 20), ("rotateY", 70)),
        _mesh("gem", _look((0.9, 0.8, 0.3)), ("translate", -0.4, 1.3, -0.4), ("rotateZ", 60), ("scale", 0.8, 0.4, 0.5)),
        _mesh("square", _look((0.5, 0.9, 0.9), (0.4, 0.8, 1, 5)), ("translate", 1.6, 1.25, 0.4), ("rotateX", 8),
              ("scale", 1.6, 1, 1.1)),
        _sphere((-1.1, 2.4, 2.2), 0.5, _look((0.5, 0.5, 0.5))),
        *_pebbles((-1.5, -0.52, 1.6), (0.3, -0.52, 2), (1.3, -0.52, 1.5), (-2.8, -0.52, 1.2)),
    ]  # fmt: skip
    return _scene(_camera((0, 0.9, 5.5), (0, 0.3, 0), 42, (48, 21), 2), lights, surfaces)


def bright() -> str:
    """Lights that together are more than white, on saturated colours, and a ball of glass in front."""
    lights = [
        _ambient((0.6, 0.6, 0.6)),
        _parallel((0.9, 0.9, 0.9), (-1, -1.4, -0.8)),
        _parallel((0.5, 0.5, 0.6), (1, -1, -1)),
        _point((0.9, 0.8, 0.7), (0.4, 1.9, 1.4)),
        _spot((0.9, 0.9, 0.9), (-1.5, 3, 4), (1, -2, -3), (15, 25)),
    ]
    surfaces = [
        _mesh("square", _look("rug", (0.4, 0.6, 0.2, 20)), ("translate", 0, -1, -1), ("rotateZ", 4),
              ("scale", 8, 1, 8)),
        _sphere((0, 0, -0.4), 0.9, _look((0.7, 0.2, 0.15), (0.4, 0.8, 0.5, 10), 0.2)),
        _sphere((0.9, 0.1, 1.8), 0.55, _look((0.9, 0.9, 0.9), (0.1, 0.2, 0.6, 40), 0, 0.9, 1.33)),
        _sphere((-1.7, -0.1, 0.6), 0.7, _look((0.2, 0.4, 0.8), (0.4, 1, 0.6, 25), 0.5)),
        _sphere((-0.1, 0.9, 0), 0.5, _look((0.2, 0.6, 0.3)), ("translate", 1.9, -0.5, -0.6), ("rotateZ", 30),
                ("scale", 0.7, 1.5, 1)),
        _sphere((0, 0, 0), 0.5, _look("globe"), ("translate", -0.6, -0.4, 1.7), ("rotateX", -20), ("rotateY", 200)),
        _mesh("gem", _look((0.6, 0.3, 0.7)), ("translate", -1.5, 1.3, -0.4), ("rotateX", 50), ("scale", 0.8, 0.3, 0.6)),
        _mesh("square", _look((0.7, 0.5, 0.2), (0.4, 0.8, 1, 6)), ("translate", 0.9, 1.25, 0.9), ("rotateX", 5),
              ("scale", 1.6, 1, 1)),
        _sphere((0.3, 2.7, 1.7), 0.45, _look((0.4, 0.4, 0.4))),
        *_pebbles((0.2, -0.82, 2), (-1.4, -0.9, 1.8), (1.6, -0.72, 1), (-0.4, 0.6, 0.3)),
    ]  # fmt: skip
    return _scene(_camera((0, 0.7, 5), (0, 0.1, 0), 32, (38, 27), 1), lights, surfaces)


SCENES: tuple[Callable[[], str], ...] = (room, tower, cave, row, bright)

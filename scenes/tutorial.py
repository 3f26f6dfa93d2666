"""A ray tracer to read in an hour: the course's tutorial in plain Python, for every scene file that cltrace reads.

    python scenes/tutorial.py scenes/step3-shadows.xml picture.png

It is slow, and takes no more care of rounding than the tutorial does. Start with trace(), near the end: what stands
above it is what it needs. tests/students/test_tutorial.py compares its pictures with those of cltrace.
"""

from __future__ import annotations

import math
import sys
from typing import NamedTuple, Self

from PIL import Image

import cltrace
from cltrace.scene import AMBIENT, PARALLEL, SPOT

Color = tuple[float, ...]  # red, green and blue, linear, 1 = full

# In scene units: a ray meets nothing so near to its start, nor what is nearer by less than this than what stands before
# it in the file. So no surface shadows itself, and of two in one place the first one is seen.
EPSILON = 1e-7


class Direction(NamedTuple):
    """A vector: it has a length and can be added. Where it begins does not matter."""

    x: float
    y: float
    z: float

    def __add__(self, way: Direction) -> Self:
        return type(self)(self.x + way.x, self.y + way.y, self.z + way.z)

    def __sub__(self, other: Self) -> Direction:
        return Direction(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, k: float) -> Direction:
        return Direction(self.x * k, self.y * k, self.z * k)

    def __neg__(self) -> Direction:
        return self * -1

    def dot(self, other: Direction) -> float:
        return self.x * other.x + self.y * other.y + self.z * other.z

    def cross(self, o: Direction) -> Direction:
        return Direction(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)

    def length(self) -> float:
        return math.sqrt(self.dot(self))

    def normalized(self) -> Direction:
        return self * (1 / self.length())

    def mapped(self, rows: list[list[float]]) -> Direction:
        """What the matrix of these rows makes of it."""
        return Direction(*(row[0] * self.x + row[1] * self.y + row[2] * self.z for row in rows))


class Point(Direction):
    """A place in the world. The difference of two places is a direction; a place plus a direction is a place."""


class Ray(NamedTuple):
    """The points origin + t direction with t_min < t < t_max. The direction is a unit vector, so t is a distance."""

    origin: Point
    direction: Direction
    t_min: float = EPSILON
    t_max: float = math.inf


class Material:
    """The colour or texture of a surface, its Phong coefficients, and what it mirrors and lets through."""

    def __init__(self, scene: cltrace.Scene, number: int) -> None:
        record = scene.materials[number]
        self.solid = record["color"].tolist()
        self.texture = scene.textures[record["texture"]] if record["texture"] >= 0 else None
        self.ka, self.kd, self.ks, self.exponent = (float(record[name]) for name in ("ka", "kd", "ks", "exponent"))
        self.reflectance, self.transmittance, self.index = record[["reflectance", "transmittance", "index"]].tolist()

    def color(self, u: float, v: float) -> Color:
        """The colour at (u, v). A texture repeats, begins at the top left, and is mixed of the four texels around."""
        if self.texture is None:
            return tuple(self.solid)
        height, width = self.texture.shape[:2]
        full = 255 if self.texture.itemsize == 1 else 65535
        x, y = (u % 1) * width, (v % 1) * height
        i, j = math.floor(x), math.floor(y)
        color = [0.0, 0.0, 0.0]
        for row, part in ((j, 1 - (y - j)), (j + 1, y - j)):
            for column, share in ((i, part * (1 - (x - i))), (i + 1, part * (x - i))):
                texel = self.texture[row % height, column % width].tolist()
                color = [c + share * solid * t / full for c, solid, t in zip(color, self.solid, texel, strict=True)]
        return tuple(color)


class Intersection(NamedTuple):
    """What a ray meets. Surfaces are what has intersect(ray), which gives one of these, or None."""

    point: Point
    t: float  # the distance
    normal: Direction  # a unit vector that faces the ray
    material: Material
    uv: tuple[float, float]  # where on the texture
    inside: bool  # whether the ray came from inside of the surface


class Sphere:
    """The points P with |K (P - center)| = radius, where K makes a stretched sphere round again."""

    def __init__(self, scene: cltrace.Scene, number: int) -> None:
        record = scene.spheres[number]
        self.center, self.radius = Point(*record["center"].tolist()), float(record["radius"])
        stretched = record["to_object"] >= 0
        self.K = scene.to_object[record["to_object"]].tolist() if stretched else [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
        self.material = Material(scene, record["material"])

    def intersect(self, ray: Ray) -> Intersection | None:
        """Solves (o + t d - C)^2 = R^2 for t, in the space where the sphere is round."""
        o, d = (ray.origin - self.center).mapped(self.K), ray.direction.mapped(self.K)
        a, b, c = d.dot(d), d.dot(o), o.dot(o) - self.radius**2
        disc = b * b - a * c
        if disc < 0:
            return None
        for t in ((-b - math.sqrt(disc)) / a, (-b + math.sqrt(disc)) / a):
            if ray.t_min < t < ray.t_max:
                n = (o + d * t).normalized()  # in the sphere's own axes, around which a texture is wound
                u = 0.5 + math.atan2(n.x, n.z) / (2 * math.pi)
                v = math.acos(max(-1.0, min(1.0, n.y))) / math.pi
                outward = n.mapped(list(zip(*self.K, strict=True))).normalized()  # by the transpose of K
                inside = outward.dot(ray.direction) > 0
                point = ray.origin + ray.direction * t
                return Intersection(point, t, -outward if inside else outward, self.material, (u, v), inside)
        return None


class Triangle:
    """A triangle of a mesh, which is seen from both sides."""

    def __init__(self, mesh: cltrace.scene.PlacedMesh, number: int, material: Material) -> None:
        shape = mesh.geometry
        self.a, b, c = (Point(*mesh.vertices[i].tolist()) for i in shape.faces[number])
        self.ab, self.ac = b - self.a, c - self.a
        self.flat = self.ab.cross(self.ac)
        self.outward = self.flat * int(mesh.front[number])  # to the side where the corners' normals point
        self.to_world, self.material = mesh.normal_to_world.tolist(), material
        self.normals = [Direction(*shape.normals[i].tolist()) for i in shape.normal_of[number] if i >= 0]
        self.uv = [shape.uv[i].tolist() if i >= 0 else (0.0, 0.0) for i in shape.uv_of[number]]

    def intersect(self, ray: Ray) -> Intersection | None:
        """Solves o + t d = a + y ab + z ac by Cramer's rule (Moeller and Trumbore, 1997)."""
        across = ray.direction.cross(self.ac)
        det = self.ab.dot(across)
        if det == 0:  # the ray is parallel to the triangle
            return None
        o = ray.origin - self.a
        turned = o.cross(self.ab)
        y, z, t = o.dot(across) / det, ray.direction.dot(turned) / det, self.ac.dot(turned) / det
        x = 1 - y - z
        if min(x, y, z) < 0 or not ray.t_min < t < ray.t_max:
            return None
        n = self.flat
        if self.normals:
            A, B, C = self.normals
            n = (A * x + B * y + C * z).mapped(self.to_world)
        n = (n if n.dot(ray.direction) < 0 else -n).normalized()
        u, v = (x * A + y * B + z * C for A, B, C in zip(*self.uv, strict=True))
        point = ray.origin + ray.direction * t
        return Intersection(point, t, n, self.material, (u, v), self.outward.dot(ray.direction) > 0)


class Mesh:
    """Triangles, and a ball around them: a ray that misses the ball misses them all."""

    def __init__(self, scene: cltrace.Scene, mesh: cltrace.scene.PlacedMesh) -> None:
        material = Material(scene, mesh.material)
        self.triangles = [Triangle(mesh, number, material) for number in range(len(mesh.geometry.faces))]
        self.middle = Point(*mesh.vertices.mean(axis=0).tolist())
        self.radius = max((Point(*corner) - self.middle).length() for corner in mesh.vertices.tolist()) + EPSILON

    def intersect(self, ray: Ray) -> Intersection | None:
        misses = (self.middle - ray.origin).cross(ray.direction).length() > self.radius
        return None if misses else closest_hit(self.triangles, ray)


class Light:
    """A parallel, point or spot light. Its colour does not fade with the distance."""

    def __init__(self, record) -> None:
        self.kind, self.color = record["kind"], record["color"].tolist()
        self.position, self.axis = Point(*record["position"].tolist()), Direction(*record["direction"].tolist())
        self.alpha1, self.alpha2 = math.radians(record["alpha1"]), math.radians(record["alpha2"])

    def seen_from(self, point: Point) -> tuple[Direction, float, float]:
        """The unit direction to the light, how far away it is, and how strong: 1, but of a spot less from alpha1 on."""
        if self.kind == PARALLEL:
            return -self.axis.normalized(), math.inf, 1.0
        to_light, distance = (self.position - point).normalized(), (self.position - point).length()
        if self.kind != SPOT:
            return to_light, distance, 1.0
        angle = math.acos(max(-1.0, min(1.0, -to_light.dot(self.axis.normalized()))))
        fading = self.alpha2 - self.alpha1
        F = max(0.0, min(1.0, (self.alpha2 - angle) / fading)) if fading else float(angle <= self.alpha2)
        return to_light, distance, F


class World:
    """What a scene file holds, in the types of this file. The surfaces are in the file's order."""

    def __init__(self, scene: cltrace.Scene) -> None:
        self.camera, self.background = scene.camera, tuple(scene.background)
        self.lights = [Light(record) for record in scene.lights if record["kind"] != AMBIENT]
        self.ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0).tolist()
        surfaces = {mesh.number: Mesh(scene, mesh) for mesh in scene.meshes}
        surfaces |= {number: Sphere(scene, i) for i, number in enumerate(scene.sphere_numbers.tolist())}
        self.surfaces = [surfaces[number] for number in sorted(surfaces)]


def primary_ray(camera: cltrace.Camera, column: int, row: int) -> Ray:
    """The ray through the middle of a pixel; row 0 is the top."""
    eye = Point(*camera.position)
    z = (eye - Point(*camera.lookat)).normalized()
    x = Direction(*camera.up).cross(z).normalized()
    y = z.cross(x)
    width, height = camera.resolution
    longer = math.radians(camera.horizontal_fov)  # half of the opening along the longer side
    shorter = longer * min(width, height) / max(width, height)
    fov_x, fov_y = (longer, shorter) if width >= height else (shorter, longer)
    x_i = (2 * (column + 0.5) / width - 1) * math.tan(fov_x)
    y_i = (1 - 2 * (row + 0.5) / height) * math.tan(fov_y)
    return Ray(eye, (x * x_i + y * y_i - z).normalized())


def closest_hit(surfaces: list, ray: Ray) -> Intersection | None:
    """The nearest of all intersections; of equally near ones, that with the first surface."""
    nearest = None
    for surface in surfaces:
        if at := surface.intersect(ray):
            nearest, ray = at, Ray(ray.origin, ray.direction, ray.t_min, at.t - EPSILON)
    return nearest


def illuminate(world: World, ray: Ray, at: Intersection) -> Color:
    """Phong's formula: ka C La, and of each light that reaches the point kd C L (n.l) + ks L (r.v)^exponent."""
    n, m, color = at.normal, at.material, at.material.color(*at.uv)
    parts = [tuple(m.ka * C * La for C, La in zip(color, world.ambient, strict=True))]
    for light in world.lights:
        to_light, distance, F = light.seen_from(at.point)
        n_l, shadow_ray = n.dot(to_light), Ray(at.point, to_light, t_max=distance)
        if n_l <= 0 or F == 0 or closest_hit(world.surfaces, shadow_ray) is not None:
            continue
        r, v = n * (2 * n_l) - to_light, -ray.direction
        highlight = m.ks * max(0.0, r.dot(v)) ** m.exponent
        parts.append(tuple(F * (m.kd * C * n_l + highlight) * L for C, L in zip(color, light.color, strict=True)))
    return tuple(map(sum, zip(*parts, strict=True)))


def refracted(d: Direction, n: Direction, eta: float) -> Direction | None:
    """Snell's law: the sine of the angle to the normal becomes eta times as large; None where it would exceed 1."""
    c = -n.dot(d)
    k = 1 - eta * eta * (1 - c * c)
    return None if k < 0 else (d * eta + n * (eta * c - math.sqrt(k))).normalized()


def trace(world: World, ray: Ray, depth: int = 0) -> Color:
    """The colour that is seen along a ray. depth: how many mirrors and sheets of glass lie behind it."""
    at = closest_hit(world.surfaces, ray)
    if at is None:
        return world.background
    m, parts = at.material, [(1.0, illuminate(world, ray, at))]
    if depth <= world.camera.max_bounces:
        eta = m.index if at.inside else 1 / m.index
        through = refracted(ray.direction, at.normal, eta) if m.transmittance else None
        mirror = m.reflectance if through else m.reflectance + m.transmittance  # total reflection
        parts = [(max(0.0, 1 - m.reflectance - m.transmittance), parts[0][1])]
        if through:
            parts.append((m.transmittance, trace(world, Ray(at.point, through), depth + 1)))
        if mirror > 0:
            mirrored = ray.direction - at.normal * (2 * at.normal.dot(ray.direction))  # the angle out is the angle in
            parts.append((mirror, trace(world, Ray(at.point, mirrored), depth + 1)))
    return tuple(sum(share * color[k] for share, color in parts) for k in range(3))


def render(scene: cltrace.Scene) -> Image.Image:
    """The whole picture. Colours are clamped to 1 and rounded to bytes at the very end."""
    world, picture = World(scene), Image.new("RGB", scene.camera.resolution)
    for row in range(picture.height):
        for column in range(picture.width):
            color = trace(world, primary_ray(world.camera, column, row))
            picture.putpixel((column, row), tuple(int(255 * min(1.0, c) + 0.5) for c in color))
    return picture


if __name__ == "__main__":
    render(cltrace.load(sys.argv[1])).save(sys.argv[2])

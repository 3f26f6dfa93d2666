"""The course's ray tracer in numpy, all rays of a picture at once. With what `wrong_tracers` replaces, it is wrong.

It shares nothing with the one of cltrace/students, which looks for the mistakes that are made in this one.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from cltrace.scene import AMBIENT, PARALLEL, SPOT

EPSILON = 1e-7


def dot(a, b):
    return (a * b).sum(axis=-1, keepdims=True)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


class Ball:
    def __init__(self, scene, record):
        self.center, self.radius, self.material = record["center"], record["radius"], record["material"]
        self.K = scene.to_object[record["to_object"]] if record["to_object"] >= 0 else np.eye(3)

    def meet(self, o, d):
        """Of each ray: how far the surface is, inf for never, its normal, texture coordinates, and if from inside."""
        p, w = (o - self.center) @ self.K.T, d @ self.K.T
        a, b, c = dot(w, w), dot(w, p), dot(p, p) - self.radius**2
        root = np.sqrt(b * b - a * c)
        near, far = (-b - root) / a, (-b + root) / a
        t = np.where(near > EPSILON, near, np.where(far > EPSILON, far, np.inf))
        q = (p + t * w) / self.radius
        n = unit(q @ self.K)
        inside = dot(n, d) > 0
        n = np.where(inside, -n, n)
        u, v = 0.5 + np.arctan2(q[:, 0], q[:, 2]) / (2 * np.pi), np.arccos(np.clip(q[:, 1], -1, 1)) / np.pi
        return np.where(np.isnan(t), np.inf, t)[:, 0], n, np.stack([u, v], axis=1), inside[:, 0]


class Net:
    def __init__(self, mesh):
        of = mesh.geometry
        self.corners, self.material, self.front = mesh.vertices[of.faces], mesh.material, mesh.front
        self.smooth, self.place = of.normal_of[:, 0] >= 0, of.uv_of[:, 0] >= 0
        self.normals = np.append(of.normals, np.zeros((1, 3)), axis=0)[of.normal_of]
        self.uv = np.append(of.uv, np.zeros((1, 2)), axis=0)[of.uv_of] * self.place[:, None, None]
        self.to_world = np.linalg.inv(mesh.to_world[:, :3]).T

    def meet(self, o, d):
        best, which = np.full(len(o), np.inf), np.zeros(len(o), int)
        weights = np.zeros((len(o), 3))
        for k, (a, b, c) in enumerate(self.corners):
            across = np.cross(d, c - a)
            det = across @ (b - a)
            x = ((o - a) * across).sum(axis=1) / det
            turned = np.cross(o - a, b - a)
            y = (d * turned).sum(axis=1) / det
            t = turned @ (c - a) / det
            met = (x >= 0) & (y >= 0) & (x + y <= 1) & (t > EPSILON) & (t < best - EPSILON)
            best[met], which[met] = t[met], k
            weights[met] = np.stack([1 - x - y, x, y], axis=1)[met]
        corners = self.corners[which]
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        outward = flat * self.front[which][:, None]
        n = np.einsum("nk,nkj->nj", weights, self.normals[which]) @ self.to_world.T
        n = np.where(self.smooth[which][:, None], n, flat)
        n = unit(np.where(dot(n, d) > 0, -n, n))
        uv = np.einsum("nk,nkj->nj", weights, self.uv[which])
        return best, n, uv, dot(outward, d)[:, 0] > 0


def closest(world, o, d):
    """What rays meet first."""
    t, n, uv = np.full(len(o), np.inf), np.zeros_like(d), np.zeros((len(o), 2))
    inside, surface = np.zeros(len(o), bool), np.full(len(o), -1)
    for k, thing in enumerate(world.things):
        far, *more = thing.meet(o, d)
        nearer = far < t - EPSILON
        for own, new in zip((t, n, uv, inside), (far, *more), strict=True):
            own[nearer] = new[nearer]
        surface[nearer] = k
    return t, n, uv, inside, surface


def stands_between(world, P, l, distance):  # noqa: E741
    """Whether anything is on the way to the light."""
    hidden = np.zeros(len(P), bool)
    for thing in world.things:
        hidden |= thing.meet(P, l)[0] < distance
    return hidden


def textured(image, uv):
    """The colours of an image at (u, v), mixed of four texels."""
    h, w = image.shape[:2]
    x, y = uv[:, 0] % 1 * w, uv[:, 1] % 1 * h
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    a, b = (x - i)[:, None], (y - j)[:, None]
    upper = image[j % h, i % w] * (1 - a) + image[j % h, (i + 1) % w] * a
    lower = image[(j + 1) % h, i % w] * (1 - a) + image[(j + 1) % h, (i + 1) % w] * a
    return upper * (1 - b) + lower * b


def local(world, d, P, n, m, C):
    """Phong's formula."""
    color = m["ka"][:, None] * world.ambient * C
    for light in world.lights:
        if light["kind"] == PARALLEL:
            way, distance = np.broadcast_to(-light["direction"], P.shape), np.full(len(P), np.inf)
        else:
            way = light["position"] - P
            distance = np.linalg.norm(way, axis=1)
        l = unit(way)  # noqa: E741
        strength = np.ones(len(P))
        if light["kind"] == SPOT:
            angle = np.degrees(np.arccos(np.clip(-l @ unit(light["direction"]), -1, 1)))
            fading = light["alpha2"] - light["alpha1"]
            ramp = (light["alpha2"] - angle) / fading if fading else angle <= light["alpha2"]
            strength = np.clip(ramp, 0, 1)
        n_l = dot(n, l)
        lit = np.flatnonzero((n_l[:, 0] > 0) & (strength > 0))
        lit = lit[~stands_between(world, P[lit], l[lit], distance[lit])]
        r = 2 * n_l * n - l
        r_v = np.clip(dot(r, -d), 0, None)
        diffuse = m["kd"][:, None] * C * n_l
        highlight = m["ks"][:, None] * r_v ** m["exponent"][:, None]
        color[lit] += (strength[:, None] * (diffuse + highlight) * light["color"])[lit]
    return color


def trace(world, o, d, depth=0):
    """The colours that rays see."""
    colors = np.tile(np.array(world.background, float), (len(o), 1))
    if not len(o):
        return colors
    t, n, uv, inside, surface = closest(world, o, d)
    hit = np.flatnonzero(surface >= 0)
    o, d, t, n, uv, inside = (a[hit] for a in (o, d, t, n, uv, inside))
    P = o + t[:, None] * d
    m = world.materials[world.material[surface[hit]]]
    C = m["color"].copy()
    for k, image in enumerate(world.images):
        C[m["texture"] == k] *= textured(image, uv[m["texture"] == k])
    color = local(world, d, P, n, m, C)
    if depth <= world.bounces and len(hit):
        r, t = m["reflectance"].copy(), m["transmittance"].copy()
        color *= np.maximum(1 - r - t, 0)[:, None]
        eta = np.where(inside, m["index"], 1 / np.where(t > 0, m["index"], 1))[:, None]
        c = -dot(n, d)
        k = 1 - eta * eta * (1 - c * c)
        total = (k[:, 0] < 0) & (t > 0)
        r, t = np.where(total, r + t, r), np.where(total, 0, t)
        through = unit(d * eta + n * (eta * c - np.sqrt(np.maximum(k, 0))))
        mirrored = d + 2 * c * n
        for part, further in ((r, mirrored), (t, through)):
            on = np.flatnonzero(part > 0)
            color[on] += part[on, None] * trace(world, P[on], further[on], depth + 1)
    colors[hit] = color
    return colors


def rays(camera):
    eye, (width, height) = np.array(camera.position), camera.resolution
    z = unit(eye - np.array(camera.lookat))
    x = unit(np.cross(np.array(camera.up), z))
    y = np.cross(z, x)
    half_x = half_y = np.radians(camera.horizontal_fov)
    if width >= height:
        half_y = half_x * height / width
    else:
        half_x = half_y * width / height
    v, u = np.mgrid[:height, :width]
    x_i = ((2 * (u + 0.5) / width - 1) * np.tan(half_x)).reshape(-1, 1)
    y_i = ((1 - 2 * (v + 0.5) / height) * np.tan(half_y)).reshape(-1, 1)
    d = unit(x_i * x + y_i * y - z)
    return np.broadcast_to(eye, d.shape), d


def render(scene):
    """(h, w, 3) uint8."""
    is_ambient = scene.lights["kind"] == AMBIENT
    things = {mesh.number: Net(mesh) for mesh in scene.meshes}
    things |= {int(i): Ball(scene, s) for i, s in zip(scene.sphere_numbers, scene.spheres, strict=True)}
    things = [things[i] for i in sorted(things)]
    world = SimpleNamespace(
        things=things, material=np.array([thing.material for thing in things], int), materials=scene.materials.copy(),
        images=[image / np.iinfo(image.dtype).max for image in scene.textures],
        lights=[light.copy() for light in scene.lights[~is_ambient]],
        ambient=scene.lights["color"][is_ambient].sum(axis=0),
        background=scene.background, bounces=scene.camera.max_bounces,
    )  # fmt: skip
    width, height = scene.camera.resolution
    with np.errstate(all="ignore"):
        colors = trace(world, *rays(scene.camera))
    picture = np.floor(np.clip(colors, 0, 1) * 255 + 0.5).astype(np.uint8)
    return picture.reshape(height, width, 3)

"""Spheres, and what makes a scene's spheres and ellipsoids."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction

from cltrace.reference.ball import Ball
from cltrace.reference.ellipsoid import Ellipsoid
from cltrace.reference.equation import AHEAD, FromEye, FromPlane, any_equation
from cltrace.reference.exact import Rows, between, rational
from cltrace.reference.rays import EYE, OnPlane, Ray
from cltrace.reference.round import Equation, Round
from cltrace.reference.surfaces import Setting
from cltrace.reference.vectors import Point


class Sphere(Round):
    """The points P with |P - C| = r.

    A ray o + t d meets it where |o + t d - C|^2 = r^2. Multiplied out, as in the tutorial but with b halved and turned,

        a t^2 - 2 b t + c = 0,    a = d.d,    b = d.(C - o),    c = (C - o).(C - o) - r^2
        t = (b -/+ sqrt(D)) / a,  D = b^2 - a c

    D < 0 is a miss, D = 0 touches, D > 0 gives the two ends of the way through the sphere. equation.py computes these
    numbers in such a form that they lose no digits, and says which of them doubles cannot decide; exact.py decides
    those.
    """

    shape = "sphere"

    def equation(self, ray: Ray) -> Equation:
        # Directions whose squares leave the range of double are for exact arithmetic.
        if ray.origin == EYE and 2.0**-900 < ray.direction.dot(ray.direction) < 2.0**900:
            return FromEye(self, ray)
        if isinstance(ray.origin, OnPlane) and ray.is_plain and ray.direction == AHEAD:
            return FromPlane(self, ray.origin, ray)
        return any_equation(self, ray)


def maker(setting: Setting) -> Callable[[int], Round]:
    """What makes the sphere or the ellipsoid at a place among a scene's spheres."""
    scene, eye = setting.scene, setting.eye
    maps: list[Rows] = [tuple(map(rational, rows)) for rows in scene.to_object.tolist()]  # type: ignore[misc]

    def made(i: int) -> Round:
        one = scene.spheres[i]
        kind, to_object = (Ellipsoid, maps[one["to_object"]]) if one["to_object"] >= 0 else (Sphere, None)
        center = one["center"].tolist()
        ball = Ball(between(eye, center), Fraction(float(one["radius"])), to_object)
        material = setting.material(int(one["material"]))
        return kind(Point(*center), ball, setting.frame, material, int(scene.sphere_numbers[i]))

    return made


def spheres(setting: Setting) -> Iterator[Round]:
    """Those of a scene, and its ellipsoids."""
    return map(maker(setting), range(len(setting.scene.spheres)))

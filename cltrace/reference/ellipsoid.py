"""Ellipsoids."""

from __future__ import annotations

import math

from cltrace.reference.ball import Ball
from cltrace.reference.equation import any_equation
from cltrace.reference.exact import Frame, Vector, rational
from cltrace.reference.rays import Ray
from cltrace.reference.round import Equation, Round
from cltrace.reference.surfaces import Material
from cltrace.reference.vectors import Direction, Matrix, Point


class Ellipsoid(Round):
    """The points P with |K (P - C)| = r: what a linear map L = K^-1 makes of a sphere.

    K leads from the world to the ellipsoid's own axes. There it is a sphere, and the ray K o + t K d is straight and
    has the same t, so all that has been said of spheres holds. Back in the world a normal is K^T q, not L q.

    K: of the scene; L: rounded from the exact inverse; stretch, spread: k and k l, the sizes of K and L (see
    vectors.Matrix), which bound what K and L may make of an error.
    """

    shape = "ellipsoid"

    def __init__(self, place: Point, ball: Ball, frame: Frame, material: Material, number: int) -> None:
        super().__init__(place, ball, frame, material, number)
        assert ball.to_object is not None
        assert ball.to_world is not None
        self.K = Matrix(*(Direction(*map(float, row)) for row in ball.to_object))
        self.L = Matrix(*(Direction(*map(float, row)) for row in ball.to_world))
        self.reach = self.radius * self.L.size
        self.stretch, self.spread = self.K.size, self.K.size * self.L.size

    def equation(self, ray: Ray) -> Equation:
        return any_equation(self, ray)

    def step(self, q: Direction) -> Direction:
        return (self.L @ q) * self.radius

    def from_center(self, q: Direction) -> Direction:
        return self.frame.B @ self.step(q)

    def exact_point(self, q: Direction) -> Vector:
        return self.ball.point(rational(q))

    def outward(self, q: Direction) -> Direction:
        n = self.K.T @ q
        return self.frame.B @ (n * (1 / math.sqrt(n.dot(n))))

    def support(self, q: Direction) -> float:
        n = self.K.T @ q
        return self.radius * (1 / math.sqrt(n.dot(n)))

    def own_axes(self, q: Direction) -> Direction:
        return q

    def seen(self, v: Direction) -> Direction:
        return self.K @ v

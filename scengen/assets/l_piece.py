"""L-shaped pieces: flat slabs that lie on their broad face, for packing and fitting."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..geometry import Outline, corners
from ..params import param
from .prop import Prop, Rgba, show, solid

CORNER_RELIEF = 0.0002
"""Distance of the five outer corners below the edges [m]: a piece that lies on five points instead of twelve takes half
the time to simulate."""
INNER_CORNER = 3
"""Index of the corner of the outline that points inwards."""
Point = tuple[float, float]
"""A point seen from above, in the axes of a piece [m]."""
Part = tuple[float, float, float, float]
"""A rectangle seen from above: x and y of its middle, its width along x and its length along y [m]."""


@dataclass(frozen=True, kw_only=True)
class LPiece(Prop):
    """A slab `width` along x by `length` along y without its corner towards +x and +y.

        +--+            y
        |  |            |     The upright arm is `upright` wide, the lying arm `lying` long.
        |  +-----+      +-x   The origin is the middle of the base of the whole rectangle.
        +--------+

    The paper gives no sizes (App. B, T33); an arm must be wide enough for a 27 mm suction cup.
    """

    width: float = param(0.080, "m", 0.03, 0.40)
    length: float = param(0.080, "m", 0.03, 0.40)
    upright: float = param(0.038, "m", 0.01, 0.20)
    lying: float = param(0.038, "m", 0.01, 0.20)
    thickness: float = param(0.020, "m", 0.006, 0.05)
    rounding: float = param(0.003, "m", 0.0005, 0.005)
    """Radius of the lower edges, which are round as on a moulded or sanded piece."""
    mass: float = param(0.060, "kg", 0.001, 10.0)
    friction: float = param(0.4, "1", 0.05, 1.5)
    rgba: Rgba = (0.86, 0.55, 0.24, 1.0)

    @classmethod
    def of(cls, sides: Sequence[float], thickness: float, density: float, rgba: Rgba) -> Self:
        """A piece with the mass that follows from its density.

        Args:
            sides: `width`, `length`, `upright` and `lying` [m].
            density: density [kg/m^3].
        """
        width, length, upright, lying = sides
        mass = density * (width * lying + upright * (length - lying)) * thickness
        return cls(width=width, length=length, upright=upright, lying=lying, thickness=thickness, mass=mass, rgba=rgba)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        """Add boxes above the rounding, capsules along the lower edges, and spheres at the corners."""
        half = (self.thickness - self.rounding) / 2
        for name, (x, y, width, length) in zip(("lying", "upright"), self.parts, strict=True):
            size, pos = [width / 2, length / 2, half], [x, y, self.rounding + half]
            mass = self.mass * width * length / self.area
            solid(body, name, size, pos, mass=mass, friction=self.friction, rgba=self.rgba)
        for i, (start, end) in enumerate(self.edges):
            edge = self._add_rounding(body, f"edge_{i}", mujoco.mjtGeom.mjGEOM_CAPSULE)
            height = self.rounding + CORNER_RELIEF
            edge.fromto = np.array([*start, height, *end, height])
            if i != INNER_CORNER:
                corner = self._add_rounding(body, f"corner_{i}", mujoco.mjtGeom.mjGEOM_SPHERE)
                corner.pos = np.array([*start, self.rounding])

    def _add_rounding(self, body: mujoco.MjsBody, name: str, type: mujoco.mjtGeom) -> mujoco.MjsGeom:
        """Add a round part of the lower edges, without mass: the boxes have the mass."""
        size, friction = [self.rounding], self.friction
        return solid(body, name, size, type=type, mass=0.0, friction=friction, condim=3, rgba=self.rgba)

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def area(self) -> float:
        """Area of the broad face [m^2]."""
        return self.width * self.lying + self.upright * (self.length - self.lying)

    @cached_property
    def parts(self) -> tuple[Part, Part]:
        """The lying arm over the whole width, and the upright arm beyond it."""
        return (
            (0.0, (self.lying - self.length) / 2, self.width, self.lying),
            ((self.upright - self.width) / 2, self.lying / 2, self.upright, self.length - self.lying),
        )

    def outlines(self, pos: ArrayLike, yaw: float) -> list[Outline]:
        """Outlines of both parts, seen from above, of a piece at `pos` [m] with a `yaw` [rad]."""
        return [corners(pos, yaw, part[2:], part[:2]) for part in self.parts]

    @cached_property
    def centroid(self) -> Point:
        """Centre of mass, seen from above [m]."""
        (xa, ya, *a), (xb, yb, *b) = self.parts
        share = a[0] * a[1] / (a[0] * a[1] + b[0] * b[1])
        return share * xa + (1 - share) * xb, share * ya + (1 - share) * yb

    def hold(self, cup: float) -> Point:
        """The point nearest to the centre of mass that is at least `cup` [m] away from the edges, seen from above [m].

        Raises:
            ValueError: no arm is wide enough.
        """
        arms = (self.parts[0], ((self.upright - self.width) / 2, 0.0, self.upright, self.length))
        points = [_nearest(self.centroid, arm, cup) for arm in arms if min(arm[2:]) >= 2 * cup]
        if not points:
            raise ValueError(f"no arm of the piece is {2000 * cup:.0f} mm wide, as the cup needs; give a smaller cup")
        return min(points, key=lambda p: math.dist(p, self.centroid))

    @cached_property
    def edges(self) -> list[tuple[Point, Point]]:
        """The six sides of the base's outline, moved inwards by the radius of the edges, seen from above [m]."""
        r, x, y = self.rounding, self.width / 2, self.length / 2
        left, right, beside = r - x, x - r, self.upright - x - r
        near, far, beyond = r - y, y - r, self.lying - y - r
        ring = [(left, near), (right, near), (right, beyond), (beside, beyond), (beside, far), (left, far)]
        return list(zip(ring, [*ring[1:], ring[0]], strict=True))


def _nearest(point: Point, part: Part, margin: float) -> Point:
    """The point of a part nearest to `point` that is at least `margin` [m] away from the edges of the part."""
    x, y, width, length = part
    return (
        min(max(point[0], x - width / 2 + margin), x + width / 2 - margin),
        min(max(point[1], y - length / 2 + margin), y + length / 2 - margin),
    )


if __name__ == "__main__":
    show(LPiece())

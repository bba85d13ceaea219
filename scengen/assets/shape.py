"""Wooden shapes to be stacked: cube, cylinder, hexagonal and triangular prism, and a cone frustum on a collar.

                                        __
       ____    ____      ____          /  \\       All stand on a flat underside. On the frustum nothing stands.
      |    |  |    |    |    |        /    \\
      |____|  |____|    |____|       |______|

Two convex bodies touch in one plane. Under the slope of the frustum that plane is inclined by `CONE_SLOPE`, more than friction
holds, and any flatter one touches nothing but the tip, on which a flat face balances and does not stand.

They stand on small spheres, their feet: MuJoCo gives two convex geoms one point of contact, and a flat face on one
point rocks. The ring of feet is so narrow that it bears what overhangs the face under it.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..params import param
from .prop import Prop, Rgba, show, solid
from .turned import FOOT_PROTRUSION, FOOT_RADIUS

KINDS = ("cube", "cylinder", "hexagonal prism", "triangular prism", "cone frustum")
CUBE, CYLINDER, HEXAGON, TRIANGLE, FRUSTUM = range(len(KINDS))
SIDES = (4, 24, 6, 3, 24)
"""Of the outlines; a round one has so many flat faces that it is 0.9 % wider over its corners."""
CONE_SLOPE = math.radians(50.0)
"""Inclination of the frustum's slope [rad]. Friction holds up to atan(friction), 35 deg for wood, MuJoCo's cone 1 deg
more."""
TIP_RADIUS = 0.0001
"""Radius of the face on a frustum that is high enough for its width [m]. On one of 3 mm stands what a jaw puts."""
MIN_COLLAR = 0.004
"""Least height of the frustum's foot, which is straight, so that a jaw can hold it [m]: a slope slips out of parallel
pads unless the friction exceeds the tangent of its angle to them."""
MAX_FEET = 4
"""In the ring at most; under a shape with corners there is one to each corner, or to every second one."""
FOOT_RING = 0.65
"""Radius of the ring, of the outline's."""
BEECH_DENSITY = 700.0
"""Density [kg/m^3]."""
COLOURS: tuple[Rgba, ...] = (
    (0.80, 0.25, 0.20, 1.0),
    (0.20, 0.45, 0.75, 1.0),
    (0.30, 0.62, 0.32, 1.0),
    (0.90, 0.70, 0.20, 1.0),
    (0.55, 0.32, 0.62, 1.0),
)
"""By kind."""

MESH, SPHERE, ROUND = mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CYLINDER


@dataclass(frozen=True, kw_only=True)
class Shape(Prop):
    """The origin is the middle of its foot, below the centre of mass. x is the normal of a side."""

    kind: int = param(CUBE, "", 0, len(KINDS) - 1)
    """Which of `KINDS`."""
    width: float = param(0.045, "m", 0.02, 0.07)
    """Along x: from side to side, or from a side to the opposite edge."""
    height: float = param(0.036, "m", 0.015, 0.08)
    friction: float = param(0.7, "1", 0.05, 1.5)

    @property
    def reach(self) -> float:
        """Distance of the outline's corners from the axis [m]."""
        if self.kind == CYLINDER:
            return self.width / 2
        return self.width / 1.5 if self.kind == TRIANGLE else self.width / 2 / math.cos(math.pi / SIDES[self.kind])

    @property
    def pointed(self) -> bool:
        """Whether it is a frustum that ends in a tip, on which nothing can stand."""
        return self.kind == FRUSTUM and self.top < 2 * TIP_RADIUS

    @property
    def collar(self) -> float:
        """How high a frustum is straight [m]."""
        return max(MIN_COLLAR, self.height - math.tan(CONE_SLOPE) * (self.width / 2 - TIP_RADIUS))

    @property
    def top(self) -> float:
        """Radius of a frustum's upper face [m], between its sides."""
        return self.width / 2 - (self.height - self.collar) / math.tan(CONE_SLOPE)

    @property
    def between(self) -> float:
        """Where a jaw that closes across a side has its middle, along that side's normal [m]."""
        return (self.width - 2 * self.reach) / 2 if self.kind == TRIANGLE else 0.0

    @property
    def sides(self) -> NDArray[np.float64]:
        """Directions of the sides' normals [rad]."""
        return 2 * math.pi * np.arange(SIDES[self.kind]) / SIDES[self.kind]

    @property
    def rays(self) -> NDArray[np.float64]:
        """Directions of the corners, shape (sides, 2)."""
        angles = 2 * math.pi * (np.arange(SIDES[self.kind]) + 0.5) / SIDES[self.kind]
        return np.column_stack([np.cos(angles), np.sin(angles)])

    @property
    def corners(self) -> NDArray[np.float64]:
        """Of the solid, shape (n, 3) [m]."""
        levels = [(FOOT_PROTRUSION, self.reach), (self.height, self.reach)]
        if self.kind == FRUSTUM:
            levels[1:] = [(self.collar, self.reach), (self.height, self.top * 2 * self.reach / self.width)]
        return np.vstack([np.column_stack([r * self.rays, np.full(len(self.rays), z)]) for z, r in levels])

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        look = {"friction": self.friction, "density": BEECH_DENSITY, "rgba": COLOURS[self.kind]}
        half, middle = (self.height - FOOT_PROTRUSION) / 2, [0.0, 0.0, (self.height + FOOT_PROTRUSION) / 2]
        if self.kind == CUBE:
            solid(body, "hull", [self.width / 2, self.width / 2, half], middle, **look)
        elif self.kind == CYLINDER:
            solid(body, "hull", [self.width / 2, half], middle, type=ROUND, **look)
        else:
            spec.add_mesh(name="hull", uservert=self.corners.ravel().tolist())
            solid(body, "hull", (), type=MESH, **look).meshname = "hull"
        feet = {"type": SPHERE, "friction": self.friction, "mass": 0.0, "condim": 3, "group": 3}
        for k, ray in enumerate(self.rays[:: math.ceil(len(self.rays) / MAX_FEET)]):
            solid(body, f"foot_{k}", [FOOT_RADIUS], [*FOOT_RING * self.reach * ray, FOOT_RADIUS], **feet)


if __name__ == "__main__":
    show(Shape(kind=FRUSTUM, width=0.042, height=0.041))

"""Wooden shapes for stacking: cube, cylinder, hexagonal and triangular prism, and a cone frustum on a collar.

                                        __
       ____    ____      ____          /  \\       All stand on a flat underside. No shape can stand on the frustum.
      |    |  |    |    |    |        /    \\
      |____|  |____|    |____|       |______|

Two convex bodies touch in one plane. At the slope of the frustum that plane is inclined by `CONE_SLOPE`, more than
friction can hold. Any flatter plane touches only the tip, on which a flat face balances and does not stand.

The shapes stand on small spheres, their feet: MuJoCo gives two convex geoms one point of contact, and a flat face on
one point rocks. The ring of feet is so narrow that all of them stand on any other shape of a similar width, whichever
way it is turned: where a foot hangs beside a face, the single contact of the two faces bears, and the pile trembles.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..params import param
from .prop import Prop, Rgba, show, solid
from .turned import FOOT_PROTRUSION, FOOT_RADIUS

KINDS = ("cube", "cylinder", "hexagonal prism", "triangular prism", "cone frustum")
"""Names of the kinds of shapes."""
CUBE = 0
"""Value of `kind` for a cube."""
CYLINDER = 1
"""Value of `kind` for a cylinder."""
HEXAGON = 2
"""Value of `kind` for a hexagonal prism."""
TRIANGLE = 3
"""Value of `kind` for a triangular prism."""
FRUSTUM = 4
"""Value of `kind` for a cone frustum."""
SIDES = (4, 24, 6, 3, 24)
"""Number of sides of each kind's outline. A round one is 0.9 % wider over its corners."""
CONE_SLOPE = math.radians(50.0)
"""Angle of the frustum's slope to the horizontal [rad]. Friction holds up to atan(friction), 35 deg for wood, MuJoCo's
cone 1 deg more."""
TIP_RADIUS = 0.0001
"""Radius of the upper face of a frustum that is high enough for its width [m]. On a face of 3 mm a shape can stand."""
MIN_COLLAR = 0.004
"""Smallest height of the collar, the straight foot of the frustum, by which a jaw holds it [m]. A slope slips out of
parallel pads unless the friction exceeds the tangent of its angle to them."""
MAX_FEET = 6
"""Largest number of feet. A shape with corners has one foot for each corner, a round one below every fourth."""
FOOT_RING = 0.45
"""Radius of the ring of feet, as a share of that of the outline. A triangular prism is half as wide across its sides as
over its corners, so that 0.5 is the most for two alike."""
BEECH_DENSITY = 700.0
"""Density of beech [kg/m^3]."""
COLOURS: tuple[Rgba, ...] = (
    (0.80, 0.25, 0.20, 1.0),
    (0.20, 0.45, 0.75, 1.0),
    (0.30, 0.62, 0.32, 1.0),
    (0.90, 0.70, 0.20, 1.0),
    (0.55, 0.32, 0.62, 1.0),
)
"""Colour of each kind."""

MESH_GEOM = mujoco.mjtGeom.mjGEOM_MESH
SPHERE_GEOM = mujoco.mjtGeom.mjGEOM_SPHERE
CYLINDER_GEOM = mujoco.mjtGeom.mjGEOM_CYLINDER


@dataclass(frozen=True, kw_only=True)
class Shape(Prop):
    """A wooden shape. The origin is the middle of the base, below the centre of mass. x is the normal of a side."""

    kind: int = param(CUBE, "", 0, len(KINDS) - 1)
    """Index of the kind in `KINDS`."""
    width: float = param(0.045, "m", 0.02, 0.07)
    """Width along x: from side to side, or from a side to the opposite edge."""
    height: float = param(0.036, "m", 0.015, 0.08)
    friction: float = param(0.7, "1", 0.05, 1.5)

    @cached_property
    def reach(self) -> float:
        """Distance of the outline's corners from the axis [m]."""
        if self.kind == CYLINDER:
            return self.width / 2
        return self.width / 1.5 if self.kind == TRIANGLE else self.width / 2 / math.cos(math.pi / SIDES[self.kind])

    @cached_property
    def pointed(self) -> bool:
        """Whether it is a frustum that ends in a tip, on which no shape can stand."""
        return self.kind == FRUSTUM and self.top < 2 * TIP_RADIUS

    @cached_property
    def collar(self) -> float:
        """Height of a frustum's collar [m]."""
        return max(MIN_COLLAR, self.height - math.tan(CONE_SLOPE) * (self.width / 2 - TIP_RADIUS))

    @cached_property
    def top(self) -> float:
        """Radius of a frustum's upper face, measured to its sides [m]."""
        return self.width / 2 - (self.height - self.collar) / math.tan(CONE_SLOPE)

    @cached_property
    def between(self) -> float:
        """Middle of a jaw that closes on a side, along the normal of that side [m]."""
        return (self.width - 2 * self.reach) / 2 if self.kind == TRIANGLE else 0.0

    @cached_property
    def sides(self) -> NDArray[np.float64]:
        """Directions of the sides' normals [rad]."""
        return 2 * math.pi * np.arange(SIDES[self.kind]) / SIDES[self.kind]

    @cached_property
    def rays(self) -> NDArray[np.float64]:
        """Directions of the corners, shape (sides, 2)."""
        angles = 2 * math.pi * (np.arange(SIDES[self.kind]) + 0.5) / SIDES[self.kind]
        return np.column_stack([np.cos(angles), np.sin(angles)])

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """Corners of the solid, shape (n, 3) [m]."""
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
            solid(body, "hull", [self.width / 2, half], middle, type=CYLINDER_GEOM, **look)
        else:
            spec.add_mesh(name="hull", uservert=self.corners.ravel().tolist())
            solid(body, "hull", (), type=MESH_GEOM, **look).meshname = "hull"
        feet = {"type": SPHERE_GEOM, "friction": self.friction, "mass": 0.0, "condim": 3, "group": 3}
        for k, ray in enumerate(self.rays[:: math.ceil(len(self.rays) / MAX_FEET)]):
            solid(body, f"foot_{k}", [FOOT_RADIUS], [*FOOT_RING * self.reach * ray, FOOT_RADIUS], **feet)


if __name__ == "__main__":
    show(Shape(kind=FRUSTUM, width=0.042, height=0.041))

"""Solid balls."""

import math
from dataclasses import dataclass

import mujoco

from ..params import check_bounds, param
from .prop import PRIORITY, STIFF, show

STEEL = 7850.0
"""Density of carbon steel [kg/m^3]."""


@dataclass(frozen=True, kw_only=True)
class Ball:
    """A solid ball, of steel unless told otherwise; the origin is its centre.

    The paper gives neither size nor mass. A ball of 36 mm leaves 22 mm of the open jaw on either side.
    """

    radius: float = param(0.018, "m", 0.008, 0.035)
    density: float = param(STEEL, "kg/m^3", 200.0, 12000.0)
    friction: float = param(0.4, "1", 0.05, 1.5)
    rgba: tuple[float, float, float, float] = (0.62, 0.65, 0.70, 1.0)

    def __post_init__(self) -> None:
        check_bounds(self)

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.density * 4.0 / 3.0 * math.pi * self.radius**3

    def spec(self) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="body")
        body.add_geom(
            name="ball",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[self.radius, 0, 0],
            mass=self.mass,
            friction=[self.friction, 0.005, 0.0001],
            condim=4,
            solref=STIFF,
            priority=PRIORITY,
            rgba=self.rgba,
        )
        return spec


if __name__ == "__main__":
    show(Ball())

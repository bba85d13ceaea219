"""Solid balls."""

import math
from dataclasses import dataclass
from functools import cached_property

import mujoco

from ..params import param
from .prop import Prop, Rgba, show, solid

STEEL_DENSITY = 7850.0
"""Density of carbon steel [kg/m^3]."""


@dataclass(frozen=True, kw_only=True)
class Ball(Prop):
    """A solid ball, of steel by default. The origin is its centre.

    The paper gives neither size nor mass. A ball of 36 mm leaves 22 mm of the open jaw on either side.
    """

    radius: float = param(0.018, "m", 0.008, 0.035)
    density: float = param(STEEL_DENSITY, "kg/m^3", 200.0, 12000.0)
    friction: float = param(0.4, "1", 0.05, 1.5)
    rolling: float | None = None
    """Rolling resistance, as a share of the load. Default: MuJoCo's, which is very small. Tasks in which it matters
    have their own parameter for it."""
    rgba: Rgba = (0.62, 0.65, 0.70, 1.0)

    @cached_property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.density * 4.0 / 3.0 * math.pi * self.radius**3

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        sphere = mujoco.mjtGeom.mjGEOM_SPHERE
        ball = solid(body, "ball", [self.radius], type=sphere, mass=self.mass, friction=self.friction, rgba=self.rgba)
        if self.rolling is not None:
            ball.condim, ball.friction[2] = 6, self.rolling * self.radius  # MuJoCo's coefficient is a length


if __name__ == "__main__":
    show(Ball())

"""A low stool: a plate on four legs, fixed to the table."""

from dataclasses import dataclass

import mujoco

from ..params import param
from .prop import Prop, Rgba, show, solid

PLATE_THICKNESS = 0.010
"""Thickness of the plate and of the legs [m]."""
BEECH_DENSITY = 700.0
"""Density of beech [kg/m^3]."""


@dataclass(frozen=True, kw_only=True)
class Stool(Prop):
    """A stool. x is the long axis, the origin the centre of the base. The paper gives no lengths ("a narrow stool")."""

    length: float = param(0.078, "m", 0.03, 0.25)
    width: float = param(0.040, "m", 0.03, 0.25)
    height: float = param(0.080, "m", 0.02, 0.20)
    friction: float = param(0.6, "1", 0.05, 1.5)
    rgba: Rgba = (0.45, 0.33, 0.22, 1.0)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half, leg = PLATE_THICKNESS / 2, (self.height - PLATE_THICKNESS) / 2
        parts = {"plate": ([self.length / 2, self.width / 2, half], [0, 0, self.height - half])}
        for i, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
            spot = [x * (self.length / 2 - half), y * (self.width / 2 - half), leg]
            parts[f"leg_{i}"] = ([half, half, leg], spot)
        for name, (size, pos) in parts.items():
            solid(body, name, size, pos, density=BEECH_DENSITY, friction=self.friction, rgba=self.rgba)


if __name__ == "__main__":
    show(Stool())

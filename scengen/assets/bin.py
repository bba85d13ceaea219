"""A shallow bin: a rectangular floor with four walls that are lower than the packed pieces."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import UP, Vec3
from ..params import param
from .prop import Prop, Rgba, show, solid

PLASTIC_DENSITY = 1000.0
"""Density of the bin [kg/m^3]; without effect while the bin is fixed."""


@dataclass(frozen=True, kw_only=True)
class Bin(Prop):
    """A bin whose inside is `width` along x by `length` along y. The origin is the middle of its base.

    The paper gives no sizes (App. B, T33).
    """

    width: float = param(0.12, "m", 0.04, 0.40)
    length: float = param(0.14, "m", 0.04, 0.40)
    depth: float = param(0.012, "m", 0.003, 0.10)
    wall: float = param(0.008, "m", 0.002, 0.02)
    floor: float = param(0.004, "m", 0.002, 0.02)
    friction: float = param(0.4, "1", 0.05, 1.5)
    rgba: Rgba = (0.30, 0.36, 0.44, 1.0)

    @cached_property
    def area(self) -> float:
        """Area of the floor inside [m^2]."""
        return self.width * self.length

    @cached_property
    def outer(self) -> tuple[float, float]:
        """Outer lengths along x and y, walls included [m]."""
        return self.width + 2 * self.wall, self.length + 2 * self.wall

    def floor_region(self, within: float) -> tuple[Vec3, Vec3]:
        """Opposite corners of the inside, from `within` below the floor to as much above it [m]."""
        middle, half = self.floor * UP, np.array([self.width / 2, self.length / 2, within])
        return middle - half, middle + half

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half_x, half_y = self.width / 2, self.length / 2
        rim, thick = (self.floor + self.depth) / 2, self.wall / 2
        parts = {
            "floor": ((half_x, half_y, self.floor / 2), (0.0, 0.0, self.floor / 2)),
            "left": ((half_x + self.wall, thick, rim), (0.0, half_y + thick, rim)),
            "right": ((half_x + self.wall, thick, rim), (0.0, -half_y - thick, rim)),
            "near": ((thick, half_y, rim), (-half_x - thick, 0.0, rim)),
            "far": ((thick, half_y, rim), (half_x + thick, 0.0, rim)),
        }
        for name, (size, pos) in parts.items():
            mass = PLASTIC_DENSITY * 8 * size[0] * size[1] * size[2]
            solid(body, name, size, pos, mass=mass, friction=self.friction, rgba=self.rgba)


if __name__ == "__main__":
    show(Bin())

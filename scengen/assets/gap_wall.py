"""A wall across the table with one gap, and a kerb, which stands behind the gap and stops a ball.

    _________________        ____________
   |                 |  gap |            |      seen from the front, along x
---+-----------------+------+------------+---
"""

from dataclasses import dataclass

import mujoco

from ..params import param
from .prop import Prop, Rgba, show, solid


@dataclass(frozen=True, kw_only=True)
class GapWall(Prop):
    """A wall with a gap. The origin is the middle of the gap, on the table; x leads through it."""

    gap: float = param(0.072, "m", 0.0, 0.15)
    """Width of the gap, along y."""
    height: float = param(0.080, "m", 0.02, 0.15)
    thickness: float = param(0.020, "m", 0.005, 0.05)
    left: float = param(0.36, "m", 0.01, 1.0)
    """Length of the part at positive y."""
    right: float = param(0.36, "m", 0.01, 1.0)
    """Length of the part at negative y."""
    rgba: Rgba = (0.45, 0.50, 0.58, 1.0)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        for name, side, length in (("left", 1.0, self.left), ("right", -1.0, self.right)):
            half = [self.thickness / 2, length / 2, self.height / 2]
            solid(body, name, half, [0.0, side * (self.gap + length) / 2, half[2]], rgba=self.rgba)


@dataclass(frozen=True, kw_only=True)
class Kerb(Prop):
    """A low bar along y. The origin is the middle of its base."""

    length: float = param(0.16, "m", 0.02, 0.80)
    width: float = param(0.010, "m", 0.004, 0.04)
    """Width along x."""
    height: float = param(0.012, "m", 0.002, 0.04)
    friction: float = param(0.6, "1", 0.05, 1.5)
    rgba: Rgba = (0.45, 0.50, 0.58, 1.0)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half = [self.width / 2, self.length / 2, self.height / 2]
        solid(body, "bar", half, [0.0, 0.0, half[2]], friction=self.friction, rgba=self.rgba)


if __name__ == "__main__":
    show(GapWall())

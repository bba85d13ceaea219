"""A barrier for the robot alone: it stops arm and hand, and lets selected bodies pass."""

from dataclasses import dataclass

import mujoco

from ..params import param
from .prop import Prop, Rgba, show, solid

STOPPED_BIT = 1
"""Bit of MuJoCo's contact filter for geoms that the barrier stops. Two geoms collide if a bit of the type of one is in
the affinity of the other. The barrier has this bit as its type and no affinity, so it collides with every geom that has
MuJoCo's default affinity, which is this bit."""
PASSING_BIT = 2
"""Bit of the contact filter for geoms that pass. They have both bits as their type and this one as their affinity, so
they collide with everything except the barrier, also with each other."""


@dataclass(frozen=True, kw_only=True)
class Barrier(Prop):
    """A block of glass. The origin is the middle of its base."""

    length: float = param(0.20, "m", 0.01, 0.60)
    """Length along x."""
    width: float = param(0.24, "m", 0.01, 0.60)
    """Width along y."""
    height: float = param(0.25, "m", 0.01, 0.60)
    rgba: Rgba = (0.55, 0.75, 0.95, 0.15)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half = [self.length / 2, self.width / 2, self.height / 2]
        block = solid(body, "block", half, [0.0, 0.0, half[2]], rgba=self.rgba)
        block.contype, block.conaffinity = STOPPED_BIT, 0


def let_pass(body: mujoco.MjsBody) -> None:
    """Let the geoms of a body pass through barriers."""
    for geom in body.geoms:
        geom.contype, geom.conaffinity = STOPPED_BIT | PASSING_BIT, PASSING_BIT


if __name__ == "__main__":
    show(Barrier())

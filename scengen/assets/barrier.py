"""A barrier for the robot alone: it stops arm and hand, and lets pass what is told to pass."""

from dataclasses import dataclass

import mujoco

from ..params import param
from .prop import Prop, Rgba, show, solid

STOPS, PASSES = 1, 2
"""Bits of MuJoCo's contact filter. Two geoms collide if a bit of the type of one is in the affinity of the other. The
barrier has type `STOPS` and no affinity: it meets everything with MuJoCo's default affinity, which is `STOPS`. What
passes has both types and the affinity `PASSES` alone: it meets everything but the barrier, and its own kind."""


@dataclass(frozen=True, kw_only=True)
class Barrier(Prop):
    """A block of glass. The origin is the middle of its foot."""

    length: float = param(0.20, "m", 0.01, 0.60)
    """Along x."""
    width: float = param(0.24, "m", 0.01, 0.60)
    """Along y."""
    height: float = param(0.25, "m", 0.01, 0.60)
    rgba: Rgba = (0.55, 0.75, 0.95, 0.15)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half = [self.length / 2, self.width / 2, self.height / 2]
        block = solid(body, "block", half, [0.0, 0.0, half[2]], rgba=self.rgba)
        block.contype, block.conaffinity = STOPS, 0


def let_pass(body: mujoco.MjsBody) -> None:
    """Let the geoms of a body pass through barriers."""
    for geom in body.geoms:
        geom.contype, geom.conaffinity = STOPS | PASSES, PASSES


if __name__ == "__main__":
    show(Barrier())

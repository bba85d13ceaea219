"""A rack for one round thing: a ring on a plinth, as high as the part of the thing that stands in it."""

import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import quat
from ..params import param
from .prop import Prop, Rgba, show, solid

RING_BOARDS = 24
"""Number of straight boards that form the ring. They touch it from outside, so it is nowhere narrower than nominal."""


@dataclass(frozen=True, kw_only=True)
class RingRack(Prop):
    """A ring that a thing can leave upwards only. The origin is the middle of the base.

    |_    _|
    | |__| |    The floor is the top of the plinth.
    |______|
    """

    radius: float = param(0.079, "m", 0.03, 0.12)
    """Inner radius of the ring."""
    height: float = param(0.035, "m", 0.005, 0.08)
    """Height of the ring above the floor."""
    plinth: float = param(0.020, "m", 0.005, 0.20)
    """Height of the floor above the ground."""
    board: float = param(0.008, "m", 0.004, 0.02)
    """Thickness of the ring."""
    friction: float = param(0.4, "1", 0.05, 1.5)
    rgba: Rgba = (0.60, 0.48, 0.36, 1.0)

    @cached_property
    def outer(self) -> float:
        """Radius of the circle around the whole rack [m]."""
        return (self.radius + self.board) / math.cos(math.pi / RING_BOARDS)

    @cached_property
    def top(self) -> float:
        """Height of the ring's upper edge above the ground [m]."""
        return self.plinth + self.height

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        look = {"friction": self.friction, "rgba": self.rgba}
        half = self.radius + self.board
        solid(body, "plinth", [half, half, self.plinth / 2], [0.0, 0.0, self.plinth / 2], **look)
        middle, length = self.radius + self.board / 2, half * math.tan(math.pi / RING_BOARDS)
        for i in range(RING_BOARDS):
            turn = math.tau * i / RING_BOARDS
            pos = [middle * np.cos(turn), middle * np.sin(turn), self.plinth + self.height / 2]
            solid(body, f"ring_{i}", [self.board / 2, length, self.height / 2], pos, quat=quat("z", turn), **look)


if __name__ == "__main__":
    show(RingRack())

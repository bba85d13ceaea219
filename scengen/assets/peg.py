"""Peg: a square bar that stands on one end, and the plinth below it."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..geometry import Vec3
from ..params import param
from .box import Box
from .prop import Rgba, show


@dataclass(frozen=True, kw_only=True)
class Peg(Box):
    """A peg along z; the origin is the middle of its base.

    The paper gives no lengths and no mass. The nominal density is 1100 kg/m^3: beech, bored out and filled. The width
    leaves 26 mm of the jaw on either side.
    """

    width: float = param(0.024, "m", 0.012, 0.04)
    length: float = param(0.120, "m", 0.06, 0.20)
    mass: float = param(0.080, "kg", 0.01, 0.3, hidden=True)
    friction: float = param(0.6, "1", 0.05, 1.5, hidden=True)
    rgba: Rgba = (0.80, 0.20, 0.15, 1.0)

    @property
    def size(self) -> Vec3:
        return np.array([self.width, self.width, self.length])

    @cached_property
    def tipping_angle(self) -> float:
        """Tilt at which the centre of mass passes over an edge of the base [rad]."""
        return math.atan2(self.width, self.length)


@dataclass(frozen=True, kw_only=True)
class Plinth(Box):
    """A square block, fixed to the table, under a peg, so that a level hand can grip the peg near its base."""

    width: float = param(0.030, "m", 0.01, 0.10)
    height: float = param(0.030, "m", 0.005, 0.10)
    mass: float = param(0.020, "kg", 0.001, 1.0)
    friction: float = param(0.6, "1", 0.05, 1.5)
    rgba: Rgba = (0.45, 0.33, 0.22, 1.0)

    @property
    def size(self) -> Vec3:
        return np.array([self.width, self.width, self.height])


if __name__ == "__main__":
    for box in (Peg(), Plinth()):
        show(box)

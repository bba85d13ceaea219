"""A ramp with a crown: two planes that lean away from each other along a ridge, so that balls roll to one side.

      high  ________________           seen from above and from the low end; balls roll in the direction of x
           |   left         |
           |- - - ridge - - ====       divider            _--^--_
           |   right        |                            /       \\
            ----------------

"""

import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..geometry import Mat3, Vec3
from ..params import param
from .prop import Prop, Rgba, show, solid

BOARD_THICKNESS = 0.010
"""Thickness of the two slabs, the rails and the divider [m]."""
RAIL_HEIGHT = 0.025
"""Height of rails and divider above the slabs [m]: more than the radius of the balls."""
DIVIDER_LENGTH = 0.06
"""Length of the divider at the low end [m]."""
SIDES = {"left": 1, "right": -1}
"""Sign of y of each slab, seen from the ridge."""
CONTACT_PRIORITY = 3
"""Contact priority, above that of other props: only the friction of the ramp counts, not that of the ball."""


@dataclass(frozen=True, kw_only=True)
class CrownedRamp(Prop):
    """Two slabs that meet in a ridge, with rails outside. The origin is on the ground, below the middle of the ramp.

    The paper gives neither sizes nor angles (App. B, T16).
    """

    length: float = param(0.24, "m", 0.10, 0.40)
    """Horizontal length from the high to the low end."""
    width: float = param(0.24, "m", 0.10, 0.40)
    """Horizontal distance between the rails."""
    pitch: float = param(12.0, "deg", 4.0, 25.0)
    """Slope along the ridge."""
    lean: float = param(4.0, "deg", 0.3, 10.0)
    """Slope of either slab across the ridge."""
    ridge: float = param(0.0, "m", -0.08, 0.08)
    """Position of the ridge along y."""
    low: float = param(0.065, "m", 0.03, 0.15)
    """Height of the ridge at the low end."""
    friction: float = param(0.6, "1", 0.05, 1.5)
    rgba: Rgba = (0.72, 0.70, 0.64, 1.0)

    @cached_property
    def fall(self) -> float:
        """Descent along the ridge per length [1]."""
        return math.tan(math.radians(self.pitch))

    @cached_property
    def aside(self) -> float:
        """Descent away from the ridge per length [1]."""
        return math.tan(math.radians(self.lean))

    @cached_property
    def drift(self) -> float:
        """Sideways distance by which a ball drifts as it rolls from one end to the other [m].

        If no rail is in its way, a ball follows the slab's steepest descent, whose direction has the two slopes as
        components. That holds for balls of any mass, rolling or sliding.
        """
        return self.length * self.aside / self.fall

    def side(self, name: str) -> int:
        """Sign of y of a slab: 1 for the left one, -1 for the right one."""
        return SIDES[name]

    def surface(self, x: float, y: float) -> Vec3:
        """Point of the surface above a point of the ground, in the ramp's axes [m]."""
        return np.array([x, y, self.low + (self.length / 2 - x) * self.fall - abs(y - self.ridge) * self.aside])

    def axes(self, side: int) -> Mat3:
        """Axes of a slab, as columns: down along the ridge, across it to the left, out of the surface."""
        down = np.array([1.0, 0.0, -self.fall]) / math.hypot(1.0, self.fall)
        normal = np.array([self.fall, side * self.aside, 1.0])
        normal = normal / np.linalg.norm(normal)
        return np.stack([down, np.cross(normal, down), normal], axis=1)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        for name, side in SIDES.items():
            self._add_slab(body, name, side)
        start, end = (
            self.surface(self.length / 2 - DIVIDER_LENGTH, self.ridge),
            self.surface(self.length / 2, self.ridge),
        )
        half = [float(np.linalg.norm(end - start)) / 2, BOARD_THICKNESS / 4, RAIL_HEIGHT / 2]
        upright = np.stack([self.axes(1)[:, 0], [0.0, 1.0, 0.0], np.cross(self.axes(1)[:, 0], [0.0, 1.0, 0.0])], axis=1)
        self._add_board(body, "divider", (start + end) / 2 + RAIL_HEIGHT / 2 * upright[:, 2], half, upright)

    def _add_slab(self, body: mujoco.MjsBody, name: str, side: int) -> None:
        """Add a slab from the ridge to its rail, the rail, and posts under both ends."""
        axes, outside = self.axes(side), side * self.width / 2
        ridge = (self.surface(-self.length / 2, self.ridge) + self.surface(self.length / 2, self.ridge)) / 2
        rim = (self.surface(-self.length / 2, outside) + self.surface(self.length / 2, outside)) / 2
        long = self.length * math.hypot(1.0, self.fall) / 2
        wide = float(abs((rim - ridge) @ axes[:, 1])) / 2
        middle = ridge + side * wide * axes[:, 1]
        self._add_board(body, name, middle - BOARD_THICKNESS / 2 * axes[:, 2], [long, wide, BOARD_THICKNESS / 2], axes)
        above = (
            middle + side * (wide + BOARD_THICKNESS / 2) * axes[:, 1] + (RAIL_HEIGHT - BOARD_THICKNESS) / 2 * axes[:, 2]
        )
        self._add_board(
            body, f"{name}_rail", above, [long, BOARD_THICKNESS / 2, (RAIL_HEIGHT + BOARD_THICKNESS) / 2], axes
        )
        for end, x in (("high", -self.length / 2 + BOARD_THICKNESS), ("low", self.length / 2 - BOARD_THICKNESS)):
            foot = self.surface(x, outside - side * BOARD_THICKNESS)
            tall = (foot[2] - BOARD_THICKNESS) / 2
            self._add_board(
                body,
                f"{name}_{end}",
                [foot[0], foot[1], tall],
                [BOARD_THICKNESS / 2, BOARD_THICKNESS / 2, tall],
                np.eye(3),
            )

    def _add_board(self, body: mujoco.MjsBody, name: str, pos: ArrayLike, size: ArrayLike, axes: Mat3) -> None:
        turn = np.empty(4)
        mujoco.mju_mat2Quat(turn, axes.ravel())
        solid(body, name, size, pos, quat=turn, friction=self.friction, rgba=self.rgba, priority=CONTACT_PRIORITY)


if __name__ == "__main__":
    show(CrownedRamp())

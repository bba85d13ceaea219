"""A rack with two covered storeys, open on one side: things in it can be reached through that side only.

 __________
|  _____   |      seen from the open side, which faces -y; both ends, the back and the roof are closed
| |     |  |
| |_[]__|  |      storey 1
| |_____|  |      storey 0
|__________|
"""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import Vec3
from ..params import param
from .prop import Prop, Rgba, show, solid

STOREYS = 2
"""Number of storeys."""


@dataclass(frozen=True, kw_only=True)
class TierRack(Prop):
    """Two storeys of equal height on a plinth. The origin is the middle of the base.

    The paper gives no sizes (App. B, T03). The Panda's hand fits in, whose palm is 63 mm high and 208 mm wide when the
    fingers close along x.
    """

    width: float = param(0.36, "m", 0.10, 0.50)
    """Inner width along x."""
    depth: float = param(0.185, "m", 0.08, 0.25)
    """Inner depth along y."""
    height: float = param(0.105, "m", 0.06, 0.20)
    """Inner height of a storey."""
    plinth: float = param(0.045, "m", 0.005, 0.15)
    """Height of the plinth below the rack."""
    board: float = param(0.010, "m", 0.004, 0.02)
    """Thickness of floors, roof and walls."""
    closed: bool = False
    """Whether the open side is closed: the same rack without an entrance."""
    friction: float = param(0.4, "1", 0.05, 1.5)
    rgba: Rgba = (0.60, 0.48, 0.36, 1.0)

    @cached_property
    def outer(self) -> tuple[float, float]:
        """Outer lengths along x and y, walls included [m]."""
        return self.width + 2 * self.board, self.depth + self.board

    @cached_property
    def mouth(self) -> float:
        """Position of the open side along y [m]."""
        return -self.outer[1] / 2

    @cached_property
    def top(self) -> float:
        """Height of the roof's upper side above the ground [m]."""
        return self.floor(STOREYS)

    def floor(self, storey: int) -> float:
        """Height of a storey's floor above the ground [m]."""
        return self.plinth + self.board + storey * (self.height + self.board)

    def inside(self, storey: int, along: float, depth: float) -> Vec3:
        """A point on the floor of a storey, in the axes of the rack [m].

        Args:
            along: distance from the middle along x [m].
            depth: distance behind the open side [m].
        """
        return np.array([along, self.mouth + depth, self.floor(storey)])

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        (x, y), thick = np.array(self.outer) / 2, self.board / 2
        look = {"friction": self.friction, "rgba": self.rgba}
        solid(body, "plinth", [x, y, self.plinth / 2], [0.0, 0.0, self.plinth / 2], **look)
        for level in range(STOREYS + 1):
            solid(body, f"floor_{level}", [x, y, thick], [0.0, 0.0, self.floor(level) - thick], **look)
        walls, half = (self.plinth + self.top) / 2, (self.top - self.plinth) / 2
        for name, side in (("left", -1), ("right", 1)):
            solid(body, name, [thick, y, half], [side * (x - thick), 0.0, walls], **look)
        solid(body, "back", [x, thick, half], [0.0, y - thick, walls], **look)
        if self.closed:
            solid(body, "front", [x, thick, half], [0.0, -y - thick, walls], **look)


if __name__ == "__main__":
    show(TierRack())

"""A bin with a handle: deep, so that balls that fall in stay in; light, so that a jaw can pull it over the table."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import UP, Vec3
from ..params import param
from .prop import Prop, Rgba, show, solid

GRASP_DEPTH = 0.010
"""Depth of the grasp below the top of the handle [m]. The palm, 31 mm above the grasp, stays above the rim."""
PLASTIC_DENSITY = 1000.0
"""Density of the bin [kg/m^3]."""
HANDLE_DENSITY = 500.0
"""Density of the handle, which is hollow [kg/m^3]."""
HANDLE_HEIGHT = 0.03
"""Height of the lower side of the handle above the ground [m]."""
HANDLE_FRICTION = 1.0
"""Sliding friction of the handle, which is covered with rubber."""


@dataclass(frozen=True, kw_only=True)
class CatchBin(Prop):
    """A bin whose handle protrudes at -x. The origin is the middle of the bin's base.

    The paper gives no sizes (App. B, T15). The handle is so narrow that a jaw holds it with 20 N, and so long that the
    palm, which reaches 32 mm across, is not in the way of things that fall into the bin.
    """

    width: float = param(0.100, "m", 0.04, 0.20)
    """Inner length along x."""
    length: float = param(0.060, "m", 0.03, 0.20)
    """Inner length along y."""
    depth: float = param(0.082, "m", 0.02, 0.15)
    wall: float = param(0.005, "m", 0.002, 0.02)
    floor: float = param(0.004, "m", 0.002, 0.02)
    friction: float = param(0.25, "1", 0.05, 1.0)
    reach: float = param(0.050, "m", 0.03, 0.10)
    """Length by which the handle protrudes."""
    grip: float = param(0.020, "m", 0.005, 0.06)
    """Width of the handle, which the jaw grips."""
    rgba: Rgba = (0.85, 0.55, 0.15, 1.0)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half_x, half_y, deep = self.width / 2, self.length / 2, self.depth / 2
        outer_x, outer_y, thick = half_x + self.wall, half_y + self.wall, self.wall / 2
        middle = self.floor + deep
        parts = {  # it stands on its floor only: walls that reach the ground would add contacts
            "floor": ((outer_x, outer_y, self.floor / 2), (0.0, 0.0, self.floor / 2)),
            "left": ((outer_x, thick, deep), (0.0, half_y + thick, middle)),
            "right": ((outer_x, thick, deep), (0.0, -half_y - thick, middle)),
            "near": ((thick, half_y, deep), (-half_x - thick, 0.0, middle)),
            "far": ((thick, half_y, deep), (half_x + thick, 0.0, middle)),
        }
        for name, (size, pos) in parts.items():
            solid(body, name, size, pos, density=PLASTIC_DENSITY, friction=self.friction, condim=3, rgba=self.rgba)
        size = np.array([self.reach, self.grip, self.rim - HANDLE_HEIGHT])
        pos = [-outer_x - self.reach / 2, 0.0, (self.rim + HANDLE_HEIGHT) / 2]
        solid(body, "handle", size / 2, pos, density=HANDLE_DENSITY, friction=HANDLE_FRICTION, rgba=self.rgba)

    @cached_property
    def outer(self) -> tuple[float, float]:
        """Outer lengths of the bin along x and y, walls included, without the handle [m]."""
        return self.width + 2 * self.wall, self.length + 2 * self.wall

    @cached_property
    def rim(self) -> float:
        """Height of the rim [m]."""
        return self.floor + self.depth

    def holds(self, place: Vec3, depth: float = 0.0) -> bool:
        """Whether a place in the bin's axes [m] is between its walls, at least `depth` below its rim [m]."""
        x, y, z = np.abs(place)
        return bool(x < self.width / 2 and y < self.length / 2 and z < self.rim - depth)

    @cached_property
    def handle(self) -> Vec3:
        """Grasp point on the handle, in the bin's axes [m]."""
        return np.array([-self.outer[0] / 2 - 0.6 * self.reach, 0.0, 0.0]) + (self.rim - GRASP_DEPTH) * UP


if __name__ == "__main__":
    show(CatchBin())

"""A bin with a handle: deep enough that what falls in stays in, and light enough to be drawn over the table by a jaw."""

from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import UP, Vec3
from ..params import param
from .bin import PLASTIC, Bin
from .prop import Prop, Rgba, show, solid

TAKEN = 0.010
"""How far below the top of the handle it is taken hold of [m]: the palm, 31 mm above that, stays over the rim."""


CLEAR = 0.03
"""From the ground to the handle [m]."""
RUBBER = 1.0
"""Friction of the handle."""


@dataclass(frozen=True, kw_only=True)
class CatchBin(Prop):
    """The handle stands out at the side of -x. The origin is the middle of the bin's foot.

    The paper gives no sizes (App. B, T15). The handle is as narrow as a jaw needs to hold it by 20 N, and as long as
    keeps the palm, which reaches 32 mm across, out of what falls into the bin.
    """

    bin: Bin = Bin(width=0.10, length=0.060, depth=0.082, wall=0.005, floor=0.004, friction=0.25)
    reach: float = param(0.050, "m", 0.03, 0.10)
    """How far the handle stands out."""
    grip: float = param(0.020, "m", 0.005, 0.06)
    """Its width, which the jaw takes."""
    rgba: Rgba = (0.85, 0.55, 0.15, 1.0)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        self.bin.fill(body, spec)
        size = np.array([self.reach, self.grip, self.rim - CLEAR])
        middle = [-self.bin.outer[0] / 2 - self.reach / 2, 0.0, (self.rim + CLEAR) / 2]
        mass = PLASTIC * float(np.prod(size)) / 2  # hollow
        solid(body, "handle", size / 2, middle, mass=mass, friction=RUBBER, rgba=self.rgba)

    @property
    def rim(self) -> float:
        """Height of the rim [m]."""
        return self.bin.floor + self.bin.depth

    @property
    def handle(self) -> Vec3:
        """Where the handle is taken hold of, in the bin's axes [m]."""
        return np.array([-self.bin.outer[0] / 2 - 0.6 * self.reach, 0.0, 0.0]) + (self.rim - TAKEN) * UP


if __name__ == "__main__":
    show(CatchBin())

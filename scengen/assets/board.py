"""Board: a rectangular plate, flat on the table, with a strip along one side that may be of a heavier stuff.

        y  ________________
        ^ |################|  strip      x along the strip, y across it; the origin under the middle
        | |                |
        | |                |
        | |________________|

It stays on a table's edge as long as its centre of mass does, whatever overhangs.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import Vec3
from ..params import param
from .prop import Prop, Rgba, show, solid

STRIP_WIDTH = 0.020
"""Width of the strip [m]."""
STRIP_COLOUR: Rgba = (0.30, 0.32, 0.36, 1.0)
"""Colour of a strip that is heavier than the rest."""


@dataclass(frozen=True, kw_only=True)
class Board(Prop):
    """Two boxes side by side, the strip at the far side in y.

    Thickness: paper, App. D.1 ("3 thicknesses: 2, 3, 5 mm"), which gives no other length and no mass. The mass is
    that of plywood, 530 kg/m^3; both sides are longer than the jaw opens.
    """

    length: float = param(0.100, "m", 0.06, 0.20)
    """Along the strip."""
    width: float = param(0.150, "m", 0.09, 0.25)
    """Across it."""
    thickness: float = param(0.005, "m", 0.002, 0.020)
    mass: float = param(0.040, "kg", 0.005, 0.3)
    off_centre: float = param(0.0, "m", 0.0, 0.03)
    """How far the centre of mass is from the middle, towards the strip; at 0 all is of one density."""
    friction: float = param(0.35, "1", 0.05, 1.5, hidden=True)
    rgba: Rgba = (0.86, 0.70, 0.45, 1.0)

    @property
    def size(self) -> Vec3:
        """Edges along x, y and z [m]."""
        return np.array([self.length, self.width, self.thickness])

    @property
    def strip_mass(self) -> float:
        """Of the strip [kg], such that the centre of mass is where it is said to be."""
        return self.mass * (2 * self.off_centre + STRIP_WIDTH) / self.width

    @property
    def tipping_overhang(self) -> float:
        """How far the strip's side may stand out over an edge that is parallel to it [m]: then it tips."""
        return self.width / 2 - self.off_centre

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        x, y, z = self.size / 2
        parts = (
            ("board", y - STRIP_WIDTH / 2, -STRIP_WIDTH / 2, self.mass - self.strip_mass, self.rgba),
            (
                "strip",
                STRIP_WIDTH / 2,
                y - STRIP_WIDTH / 2,
                self.strip_mass,
                STRIP_COLOUR if self.off_centre > 0.0 else self.rgba,
            ),
        )
        for name, half, at, mass, rgba in parts:
            solid(body, name, [x, half, z], [0.0, at, z], mass=mass, friction=self.friction, rgba=rgba)


if __name__ == "__main__":
    for board in (Board(), Board(off_centre=0.02)):
        show(board)

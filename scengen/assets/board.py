"""Board: a rectangular plate, flat on the table, with a strip along one side that may be of a heavier material.

        y  ________________
        ^ |################|  strip      x along the strip, y across it; the origin below the middle
        | |                |
        | |                |
        | |________________|

At an edge of the table the board stays as long as its centre of mass is over the table.
"""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import Vec3
from ..params import param
from .prop import Prop, Rgba, show, solid

STRIP_WIDTH = 0.020
"""Width of the strip [m]."""
STRIP_COLOUR: Rgba = (0.30, 0.32, 0.36, 1.0)
"""Colour of a strip that is heavier than the rest of the board."""


@dataclass(frozen=True, kw_only=True)
class Board(Prop):
    """Two boxes side by side; the strip is at +y.

    Thickness: paper, App. D.1 ("3 thicknesses: 2, 3, 5 mm"), which gives no other length and no mass. The mass is
    that of plywood, 530 kg/m^3. Both sides are longer than the opening of the jaw.
    """

    length: float = param(0.100, "m", 0.06, 0.20)
    """Length along the strip."""
    width: float = param(0.150, "m", 0.09, 0.25)
    """Width across the strip."""
    thickness: float = param(0.005, "m", 0.002, 0.020)
    mass: float = param(0.040, "kg", 0.005, 0.3)
    off_centre: float = param(0.0, "m", 0.0, 0.03)
    """Distance of the centre of mass from the middle, towards the strip. At 0 the density is uniform."""
    friction: float = param(0.35, "1", 0.05, 1.5, hidden=True)
    rgba: Rgba = (0.86, 0.70, 0.45, 1.0)

    @cached_property
    def size(self) -> Vec3:
        """Edges along x, y and z [m]."""
        return np.array([self.length, self.width, self.thickness])

    @cached_property
    def strip_mass(self) -> float:
        """Mass of the strip that puts the centre of mass at `off_centre` [kg]."""
        return self.mass * (2 * self.off_centre + STRIP_WIDTH) / self.width

    @cached_property
    def tipping_overhang(self) -> float:
        """Overhang at which the board tips, if the strip's side overhangs a parallel edge [m]."""
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

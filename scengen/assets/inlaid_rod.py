"""Inlaid rod: a square rod of light wood that stands on its end; a plate of lead in one long side makes it lopsided.

 _____________
|           |#|      seen from above: x to the right along the foot, y up the page in the drawing's plane turned
|   wood    |#|      by 90 deg; the lead lies at +y or -y, is dark and as thick as its effect requires
|___________|#|
"""

import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import Vec3
from ..params import param
from .box import LEAD_DENSITY, Box
from .prop import Rgba, show, shown

WOOD_DENSITY = 400.0
"""Density of poplar [kg/m^3]."""
LEAD_COLOUR = (0.14, 0.14, 0.17, 1.0)
"""Colour of the inlay."""
SKIN = 0.0003
"""Distance by which the inlay stands out in pictures, so that its faces do not flicker [m]."""


@dataclass(frozen=True, kw_only=True)
class InlaidRod(Box):
    """A rod whose mass and inlay follow from its size and its centre of mass. Nothing about it is hidden.

    The paper gives no numbers. The width leaves 25 mm of the 80 mm jaw on either side.
    """

    height: float = param(0.20, "m", 0.08, 0.40)
    width: float = param(0.028, "m", 0.012, 0.06)
    """Edge of the square section."""
    com: float = param(0.0, "m", -0.02, 0.02)
    """Position of the centre of mass along y, from the middle. The inlay is on this side."""
    friction: float = param(0.8, "1", 0.05, 1.5)
    rgba: Rgba = (0.86, 0.70, 0.42, 1.0)

    @property
    def size(self) -> Vec3:
        return np.array([self.width, self.width, self.height])

    @cached_property
    def _discriminant(self) -> float:
        """Discriminant of the equation for the thickness of the inlay [m^2]; negative if no inlay suffices."""
        c, w = abs(self.com), self.width
        return (w - 2 * c) ** 2 - 8 * c * w * WOOD_DENSITY / (LEAD_DENSITY - WOOD_DENSITY)

    @cached_property
    def possible(self) -> bool:
        """Whether an inlay can move the centre of mass that far."""
        return 2 * abs(self.com) < self.width and self._discriminant >= 0.0

    @cached_property
    def inlay(self) -> float:
        """Thickness of the inlay [m]."""
        return (self.width - 2 * abs(self.com) - math.sqrt(max(self._discriminant, 0.0))) / 2

    @cached_property
    def mass(self) -> float:  # type: ignore[override]
        """Mass [kg]."""
        return sum(mass for mass, _, _ in self._parts)

    @cached_property
    def _parts(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Mass [kg], thickness along y [m] and place along y [m] of wood and lead."""
        side, thick = math.copysign(1.0, self.com), self.inlay
        face = self.width * self.height
        wood = self.width - thick
        return (
            (WOOD_DENSITY * face * wood, wood, -side * thick / 2),
            (LEAD_DENSITY * face * thick, thick, side * wood / 2),
        )

    @cached_property
    def inertia(self) -> Vec3:
        """Principal moments of inertia at the centre of mass, about x, y and z [kg m^2]."""
        total = np.zeros(3)
        for mass, thick, place in self._parts:
            x, y, z, off = self.width**2, thick**2, self.height**2, (place - self.com) ** 2
            total += mass * (np.array([y + z, x + z, x + y]) / 12 + np.array([off, 0.0, off]))
        return total

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        """Add one box for contacts and the inlay for pictures. The body, not its geoms, defines mass and inertia."""
        super().fill(body, spec)
        body.explicitinertial = True
        body.mass, body.inertia = self.mass, self.inertia
        body.ipos = np.array([0.0, self.com, self.height / 2])
        if self.inlay > 0.0:
            half, thick = np.array([self.width, self.inlay, self.height]) / 2, self.inlay / 2
            middle = math.copysign(self.width / 2 - thick, self.com)
            shown(body, "inlay", LEAD_COLOUR, size=half + SKIN, pos=[0.0, middle, self.height / 2])


if __name__ == "__main__":
    show(InlaidRod(com=0.008))

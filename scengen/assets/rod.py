"""Rod: a square tube with a heavy slug inside, which is not visible from outside.

        ____________________________________
       |                        [#]         |      x across, y along the rod, the origin below its middle
       |____________________________________|

It balances on an edge below its centre of mass, which is SLUG_SHARE times as far from the middle as the slug.
"""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import Vec3
from ..params import param
from .box import Box
from .prop import Rgba, show

SLUG_SHARE = 2 / 3
"""Share of the mass that is in the slug. At 0.15 kg that is 9 cm^3 of lead, a cube of 21 mm, which fits the tube."""
SLUG_EDGE = 0.020
"""Edge of the slug [m]."""


@dataclass(frozen=True, kw_only=True)
class Rod(Box):
    """A rod along y. The 80 mm jaw spans its width; the paper gives no lengths and no mass."""

    length: float = param(0.36, "m", 0.20, 0.60)
    width: float = param(0.024, "m", 0.015, 0.06)
    """Width and height: the cross section is a square."""
    mass: float = param(0.15, "kg", 0.05, 0.5, hidden=True)
    com: float = param(0.0, "m", -0.12, 0.12, hidden=True)
    """Position of the centre of mass along y, from the middle."""
    friction: float = param(0.9, "1", 0.05, 1.5)
    rgba: Rgba = (0.86, 0.62, 0.20, 1.0)

    @property
    def size(self) -> Vec3:
        return np.array([self.width, self.length, self.width])

    @cached_property
    def slug(self) -> float:
        """Position of the slug along y, from the middle [m]."""
        return self.com / SLUG_SHARE

    @cached_property
    def inertia(self) -> Vec3:
        """Principal moments of inertia at the centre of mass, about x, y and z [kg m^2]."""
        tube, slug = (1 - SLUG_SHARE) * self.mass, SLUG_SHARE * self.mass
        across, along = self.width**2, self.length**2
        apart = tube * self.com**2 + slug * (self.slug - self.com) ** 2
        turned = (tube * (across + along) + 2 * slug * SLUG_EDGE**2) / 12 + apart
        return np.array([turned, (2 * tube * across + 2 * slug * SLUG_EDGE**2) / 12, turned])

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        """Add one box for pictures and contacts. The body, not its geom, defines mass and inertia."""
        super().fill(body, spec)
        body.explicitinertial = True
        body.mass, body.inertia = self.mass, self.inertia
        body.ipos = np.array([0.0, self.com, self.width / 2])


if __name__ == "__main__":
    show(Rod(com=0.06))

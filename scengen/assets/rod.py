"""Rod: a square tube with a heavy slug somewhere inside, which from outside nobody sees.

        ____________________________________
       |                        [#]         |      x across, y along the rod, the origin under its middle
       |____________________________________|

It balances on an edge under its centre of mass, which lies SLUG_SHARE times as far from the middle as the slug does.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import Vec3
from ..params import param
from .box import Box
from .prop import Rgba, show

SLUG_SHARE = 2 / 3
"""Share of the mass that is in the slug. At 0.15 kg it is 9 cm^3 of lead, a cube of 21 mm: it fits the tube."""
SLUG_EDGE = 0.020
"""Edge of the slug [m]."""


@dataclass(frozen=True, kw_only=True)
class Rod(Box):
    """Lies along y. Width for the jaw of 80 mm; the paper gives no lengths and no mass."""

    length: float = param(0.36, "m", 0.20, 0.60)
    width: float = param(0.024, "m", 0.015, 0.06)
    """And height: the section is a square."""
    mass: float = param(0.15, "kg", 0.05, 0.5, hidden=True)
    com: float = param(0.0, "m", -0.12, 0.12, hidden=True)
    """How far from the middle the centre of mass is, along y."""
    friction: float = param(0.9, "1", 0.05, 1.5)
    rgba: Rgba = (0.86, 0.62, 0.20, 1.0)

    @property
    def size(self) -> Vec3:
        return np.array([self.width, self.length, self.width])

    @property
    def slug(self) -> float:
        """How far from the middle the slug is [m]."""
        return self.com / SLUG_SHARE

    @property
    def inertia(self) -> Vec3:
        """Principal moments of inertia at the centre of mass, about x, y and z [kg m^2]."""
        tube, slug = (1 - SLUG_SHARE) * self.mass, SLUG_SHARE * self.mass
        across, along = self.width**2, self.length**2
        apart = tube * self.com**2 + slug * (self.slug - self.com) ** 2
        turned = (tube * (across + along) + 2 * slug * SLUG_EDGE**2) / 12 + apart
        return np.array([turned, (2 * tube * across + 2 * slug * SLUG_EDGE**2) / 12, turned])

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        """One box to eye and touch; how its mass is spread is told to the body and not by its parts."""
        super().fill(body, spec)
        body.explicitinertial = True
        body.mass, body.inertia = self.mass, self.inertia
        body.ipos = np.array([0.0, self.com, self.width / 2])


if __name__ == "__main__":
    show(Rod(com=0.06))

"""Shallow dishes: a wide flat foot, and a rim with a small slope."""

import math
from dataclasses import dataclass
from functools import cached_property

from ..params import param
from .prop import Rgba, show
from .turned import FOOT_PROTRUSION, Section, Turned


@dataclass(frozen=True, kw_only=True)
class Dish(Turned):
    """A dish whose origin is the middle of its foot.

         \\__                                __/   rim
            \\______________________________/
                          foot

    A dish whose rim is pressed down turns about the edge of its foot by its incline, until the rim lies on the ground.
    Thickness: paper, App. C ("3 thicknesses: 2, 3, 5 mm; 4 diameters"), which gives no other length and no mass. Salad,
    dinner and large dinner plates are 0.20, 0.22 and 0.25 m wide; 0.050 kg is moulded fibre.
    """

    radius: float = param(0.110, "m", 0.080, 0.130)
    """Outer radius."""
    rim: float = param(0.033, "m", 0.020, 0.045)
    """Horizontal width of the sloping part."""
    incline: float = param(20.0, "deg", 0.0, 35.0)
    """Slope of the rim."""
    thickness: float = param(0.005, "m", 0.0015, 0.008)
    """Vertical thickness of the whole dish."""
    mass: float = param(0.050, "kg", 0.01, 1.0)
    friction: float = param(0.3, "1", 0.05, 1.5)
    """Sliding friction of the glaze."""
    rgba: Rgba = (0.88, 0.86, 0.80, 1.0)

    @property
    def stance(self) -> tuple[float, float]:
        return self.foot, self.thickness

    @cached_property
    def foot(self) -> float:
        """Radius of the flat part on which the dish stands [m]."""
        return self.radius - self.rim

    @cached_property
    def slope(self) -> float:
        """Slope of the rim [rad]; also the tilt of the dish when its rim is pressed to the ground."""
        return math.radians(self.incline)

    @cached_property
    def rise(self) -> float:
        """Height of the rim's lower edge above the ground [m]."""
        return self.rim * math.tan(self.slope)

    @cached_property
    def height(self) -> float:
        """Height of the rim's upper edge above the ground [m]."""
        return self.rise + self.thickness

    @cached_property
    def raised(self) -> float:
        """Height of the rim's lower edge while the opposite side is pressed to the ground [m]."""
        return self.rise * math.cos(self.slope) + (self.radius + self.foot) * math.sin(self.slope)

    @property
    def sections(self) -> list[Section]:
        r, f, t = self.radius, self.foot, self.thickness
        bottom = ((0.0, FOOT_PROTRUSION), (f, FOOT_PROTRUSION), (f, t), (0.0, t))
        rim = ((f, FOOT_PROTRUSION), (r, self.rise + FOOT_PROTRUSION), (r, self.height), (f, t))
        return [Section("bottom", bottom), Section("rim", rim)]


if __name__ == "__main__":
    show(Dish())

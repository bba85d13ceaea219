"""Shallow dishes: a wide flat foot, and a rim that slopes up a little."""

import math
from dataclasses import dataclass

from ..params import param
from .prop import Rgba, show
from .turned import FOOT_PROTRUSION, Section, Turned


@dataclass(frozen=True, kw_only=True)
class Dish(Turned):
    """A dish that stands on the middle of its foot.

         \\__                                __/   rim
            \\______________________________/
                          foot

    Pressed on its rim it turns about the edge of its foot until the rim lies on the ground: by its incline. Thickness:
    paper, App. C ("3 thicknesses: 2, 3, 5 mm; 4 diameters"), which gives no other length and no mass. Salad, dinner and
    large dinner plates are 0.20, 0.22 and 0.25 m wide; 0.050 kg is moulded fibre.
    """

    radius: float = param(0.110, "m", 0.080, 0.130)
    """Outer one."""
    rim: float = param(0.033, "m", 0.020, 0.045)
    """Width of the sloping part, along the ground."""
    incline: float = param(20.0, "deg", 0.0, 35.0)
    """Of the rim to the level."""
    thickness: float = param(0.005, "m", 0.0015, 0.008)
    """Along the vertical, everywhere."""
    mass: float = param(0.050, "kg", 0.01, 1.0)
    friction: float = param(0.3, "1", 0.05, 1.5)
    """Glazed."""
    rgba: Rgba = (0.88, 0.86, 0.80, 1.0)

    @property
    def stance(self) -> tuple[float, float]:
        return self.foot, self.thickness

    @property
    def foot(self) -> float:
        """Radius of the flat part, on which the dish stands [m]."""
        return self.radius - self.rim

    @property
    def slope(self) -> float:
        """Of the rim to the level [rad]; also the tilt at which the rim, pressed down, lies on the ground."""
        return math.radians(self.incline)

    @property
    def rise(self) -> float:
        """Height of the rim's lower edge above the ground [m]."""
        return self.rim * math.tan(self.slope)

    @property
    def height(self) -> float:
        """Of the rim's upper edge above the ground [m]."""
        return self.rise + self.thickness

    @property
    def raised(self) -> float:
        """Height of the rim's lower edge, while the opposite one is pressed to the ground [m]."""
        return self.rise * math.cos(self.slope) + (self.radius + self.foot) * math.sin(self.slope)

    @property
    def sections(self) -> list[Section]:
        r, f, t = self.radius, self.foot, self.thickness
        bottom = ((0.0, FOOT_PROTRUSION), (f, FOOT_PROTRUSION), (f, t), (0.0, t))
        rim = ((f, FOOT_PROTRUSION), (r, self.rise + FOOT_PROTRUSION), (r, self.height), (f, t))
        return [Section("bottom", bottom), Section("rim", rim)]


if __name__ == "__main__":
    show(Dish())

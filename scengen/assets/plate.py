"""Plates with a raised rim: a flat foot, a wall that slopes upwards, and a horizontal lip."""

import math
from dataclasses import dataclass
from functools import cached_property

from ..params import param
from .prop import Rgba, show
from .turned import FOOT_PROTRUSION, MIN_DETAIL, Section, Turned


@dataclass(frozen=True, kw_only=True)
class Plate(Turned):
    """A plate whose origin is the middle of its foot. Without `rise` it is a disc.

              ______                            ______   lip
                    \\__                    __//
                       \\__________________//   wall
                           foot

    Thickness: paper, App. C ("3 thicknesses: 2, 3, 5 mm; 4 diameters"), which gives no other length and no mass.
    Dessert, salad, dinner and large dinner plates are 0.16, 0.20, 0.24 and 0.26 m wide; 0.050 kg is moulded fibre.
    """

    radius: float = param(0.110, "m", 0.080, 0.135)
    """Outer radius."""
    foot: float = param(0.050, "m", 0.025, 0.052)
    """Radius of the flat part on which the plate stands."""
    lip: float = param(0.022, "m", 0.0, 0.025)
    """Width of the horizontal part at the rim."""
    rise: float = param(0.030, "m", 0.0, 0.040)
    """Height of the lip's underside above the ground."""
    thickness: float = param(0.005, "m", 0.0015, 0.008)
    """Vertical thickness of the whole plate."""
    hole: float = param(0.0, "m", 0.0, 0.020)
    """Radius of a round hole in the middle of the foot; 0 for no hole."""
    mass: float = param(0.050, "kg", 0.01, 1.0)
    friction: float = param(0.6, "1", 0.05, 1.5)
    rgba: Rgba = (0.88, 0.86, 0.80, 1.0)

    @property
    def stance(self) -> tuple[float, float]:
        return self.foot, self.thickness

    @cached_property
    def height(self) -> float:
        """Height of the lip's upper side above the ground [m]."""
        return self.rise + self.thickness

    @cached_property
    def pressed_tilt(self) -> float:
        """Tilt of the plate when its lip is pressed to the ground [rad]. It turns about the edge of its foot."""
        return math.atan2(self.rise, self.radius - self.foot)

    @property
    def sections(self) -> list[Section]:
        hole = self.hole if self.hole >= MIN_DETAIL else 0.0
        lip = self.lip if self.lip >= MIN_DETAIL else 0.0
        ends = [("bottom", hole, 0.0, self.foot, 0.0), ("wall", self.foot, 0.0, self.radius - lip, self.rise)]
        if lip:
            ends.append(("lip", self.radius - lip, self.rise, self.radius, self.rise))
        return [self._strip(*end) for end in ends]

    def _strip(self, name: str, inner: float, start: float, outer: float, stop: float) -> Section:
        """Section between two radii, whose underside rises from height `start` to `stop` [m]."""
        t = self.thickness
        return Section(
            name,
            ((inner, start + FOOT_PROTRUSION), (outer, stop + FOOT_PROTRUSION), (outer, stop + t), (inner, start + t)),
        )


if __name__ == "__main__":
    for plate in (Plate(), Plate(lip=0.0, rise=0.012), Plate(rise=0.0)):
        show(plate)

"""A box of crackers in several sizes, with a slippery surface."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..geometry import Vec3
from ..params import param
from .bin import Bin
from .box import Box
from .prop import Rgba, show

REAL_EDGES = (0.0717, 0.1636, 0.2138)
"""Edges of the real box [m], measured on the scan of number 003 of the YCB set."""
REAL_MASS = 0.411
"""Mass of the real box [kg]: object list of the YCB set."""


@dataclass(frozen=True, kw_only=True)
class CrackerBox(Box):
    """A box that stands on its smallest face, with its broad face towards x.

    Paper, App. C: "4 size variants, low-friction surface", without numbers. Ours are 0.75, 0.85, 1.0 and 1.15 times the
    real box. The friction of varnish on varnish is 0.15 to 0.25.
    """

    scale: float = param(1.0, "1", 0.75, 1.15)
    """Scale of all edges."""
    friction: float = param(0.20, "1", 0.02, 0.60)
    rgba: Rgba = (0.75, 0.16, 0.14, 1.0)

    @cached_property
    def mass(self) -> float:  # type: ignore[override]  # follows from the size, as the filling is always the same
        """Mass of the box, full of the same filling [kg]."""
        return REAL_MASS * self.scale**3

    @property
    def size(self) -> Vec3:
        return self.scale * np.array(REAL_EDGES)


SLOT_DEPTH = 0.8
"""Depth of the slot for a lying box, as a share of the thickness of the box."""


def slot_for(box: CrackerBox, clearance: float) -> Bin:
    """A slot in which the box lies on its broad face, its long side along y, with `clearance` to every wall [m].

    The paper says "a horizontal slot fixture" (App. B, T08) with a "tight slot outline" (T09), and gives no numbers.
    """
    thickness, width, height = box.size
    return Bin(width=width + 2 * clearance, length=height + 2 * clearance, depth=SLOT_DEPTH * thickness)


if __name__ == "__main__":
    for scale in (0.75, 0.85, 1.0, 1.15):
        show(CrackerBox(scale=scale))

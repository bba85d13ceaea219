"""A square zone on the table with one, two or three bars beside it. It has no collisions."""

from dataclasses import dataclass

import mujoco

from ..params import param
from .prop import Prop, Rgba, show, shown

SHEET_THICKNESS = 0.001
"""Thickness of the zone [m]: enough to be drawn in front of the table."""
BAR_SIZE = (0.006, 0.024)
"""Width and length of a bar [m]. The gaps between bars are as wide as the bars."""
BAR_DISTANCE = 0.020
"""Distance from the edge of the zone to the middle of the bars [m]."""


@dataclass(frozen=True, kw_only=True)
class Zone(Prop):
    """A zone. The origin is its middle; the bars are beyond it along x, away from the robot."""

    size: float = param(0.10, "m", 0.04, 0.20)
    """Length of a side."""
    label: int = 1
    """Number of bars. The family sets it, as it decides the purpose of a zone."""
    rgba: Rgba = (0.86, 0.88, 0.92, 1.0)
    ink: Rgba = (0.12, 0.14, 0.20, 1.0)
    """Colour of the bars."""

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half = self.size / 2
        shown(body, "square", self.rgba, size=[half, half, SHEET_THICKNESS / 2], pos=[0.0, 0.0, SHEET_THICKNESS / 2])
        width, length = BAR_SIZE
        for k in range(self.label):
            at = [half + BAR_DISTANCE, (2 * k - self.label + 1) * width, SHEET_THICKNESS / 2]
            shown(body, f"bar_{k}", self.ink, size=[length / 2, width / 2, SHEET_THICKNESS / 2], pos=at)


if __name__ == "__main__":
    show(Zone(label=3))

"""A square zone on the table with one, two or three bars beside it. Nothing collides with it."""

from dataclasses import dataclass

import mujoco

from ..params import param
from .prop import Prop, Rgba, show, shown

SHEET_THICKNESS = 0.001
"""Thickness [m]: enough to be drawn before the table."""
BAR_SIZE = (0.006, 0.024)
"""Width and length of a bar [m]; they stand as far apart as they are wide."""
BAR_DISTANCE = 0.020
"""From the edge of the zone to the middle of the bars [m]."""


@dataclass(frozen=True, kw_only=True)
class Zone(Prop):
    """The origin is its middle; the bars stand beyond it along x, away from the robot."""

    size: float = param(0.10, "m", 0.04, 0.20)
    """Length of a side."""
    label: int = 1
    """How many bars; no parameter: the family decides what a zone is for."""
    rgba: Rgba = (0.86, 0.88, 0.92, 1.0)
    ink: Rgba = (0.12, 0.14, 0.20, 1.0)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half = self.size / 2
        shown(body, "square", self.rgba, size=[half, half, SHEET_THICKNESS / 2], pos=[0.0, 0.0, SHEET_THICKNESS / 2])
        width, length = BAR_SIZE
        for k in range(self.label):
            at = [half + BAR_DISTANCE, (2 * k - self.label + 1) * width, SHEET_THICKNESS / 2]
            shown(body, f"bar_{k}", self.ink, size=[length / 2, width / 2, SHEET_THICKNESS / 2], pos=at)


if __name__ == "__main__":
    show(Zone(label=3))

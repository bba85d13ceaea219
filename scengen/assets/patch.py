"""A square mark on the table, the goal of a placement. It has no collisions."""

import math
from dataclasses import dataclass

import mujoco

from ..geometry import quat
from ..params import param
from .prop import Prop, Rgba, show, shown

SHEET_THICKNESS = 0.001
"""Thickness of each of the two sheets [m]: enough to be drawn in front of the table."""
TURNED_OVER = quat("x", math.pi)
"""Orientation of a patch with its lower side up (wxyz)."""


@dataclass(frozen=True, kw_only=True)
class Patch(Prop):
    """Two sheets back to back: the upper one lies on the table and is visible, the lower one is hidden in the table.

    An event changes the colour of a patch by turning it over. So the colour is part of the state, and every renderer
    shows it.
    """

    size: float = param(0.14, "m", 0.02, 0.4)
    """Length of a side."""
    rgba: Rgba = (0.30, 0.78, 0.36, 1.0)
    below: Rgba = (0.05, 0.36, 0.12, 1.0)
    """Colour of the lower side."""

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half = [self.size / 2, self.size / 2, SHEET_THICKNESS / 2]
        shown(body, "upper", self.rgba, size=half, pos=[0.0, 0.0, SHEET_THICKNESS / 2])
        shown(body, "lower", self.below, size=half, pos=[0.0, 0.0, -SHEET_THICKNESS / 2])


if __name__ == "__main__":
    show(Patch())

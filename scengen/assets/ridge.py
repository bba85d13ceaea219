"""A narrow ridge with a flat top on a plate: a thing across it stays if its centre of mass is over the top."""

from dataclasses import dataclass

import mujoco

from ..params import param
from .prop import Prop, Rgba, show, solid

PLATE_THICKNESS = 0.010
"""Thickness of the plate [m]."""
PLATE_MARGIN = 0.010
"""Length of the plate beyond each end of the ridge [m]."""


@dataclass(frozen=True, kw_only=True)
class Ridge(Prop):
    """A ridge along x. The origin is the middle of the base. The ridge is a separate body, which goals can name."""

    width: float = param(0.012, "m", 0.003, 0.04)
    """Width of the flat top, along y."""
    length: float = param(0.10, "m", 0.04, 0.20)
    height: float = param(0.06, "m", 0.02, 0.15)
    """Height of the top above the ground."""
    plate: float = param(0.10, "m", 0.04, 0.20)
    """Width of the plate, along y."""
    rgba: Rgba = (0.45, 0.47, 0.50, 1.0)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        foot, wall = (
            [self.length / 2 + PLATE_MARGIN, self.plate / 2, PLATE_THICKNESS / 2],
            (self.height - PLATE_THICKNESS) / 2,
        )
        solid(body, "plate", foot, [0, 0, PLATE_THICKNESS / 2], rgba=self.rgba)
        ridge = body.add_body(name="ridge")
        solid(ridge, "wall", [self.length / 2, self.width / 2, wall], [0, 0, PLATE_THICKNESS + wall], rgba=self.rgba)


if __name__ == "__main__":
    show(Ridge())

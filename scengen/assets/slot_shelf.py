"""A shelf with one slot: two upright dividers on a base, chamfered at the mouth. The ends may be closed."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..params import param
from .prop import PRIORITY, Prop, Rgba, show, solid

MESH = mujoco.mjtGeom.mjGEOM_MESH
MIN_END = 1e-6
"""Thickness below which closed ends are left out [m]: MuJoCo refuses boxes without extent."""


@dataclass(frozen=True, kw_only=True)
class SlotShelf(Prop):
    """A slot across x, between two dividers. The origin is the middle of the base.

    \\  | . |  /        The mouth is wider than the gap by a chamfer on each side, which guides a thing that comes
     | |   | |         down beside the middle.
     |_|___|_|
    |__base___|
    """

    gap: float = param(0.046, "m", 0.010, 0.10)
    """Distance between the dividers."""
    height: float = param(0.140, "m", 0.02, 0.28)
    """Height of the dividers above the base, on which a thing in the slot stands."""
    length: float = param(0.200, "m", 0.05, 0.32)
    """Length of the slot, along y."""
    divider: float = param(0.018, "m", 0.012, 0.04)
    """Thickness of a divider."""
    chamfer: float = param(0.010, "m", 0.0, 0.012)
    """Chamfer of the dividers' upper inner edges, at 45 deg."""
    base: float = param(0.020, "m", 0.005, 0.04)
    """Thickness of the base."""
    ends: float = param(0.0, "m", 0.0, 0.04)
    """Thickness of the walls that close the slot at both ends, as high as the dividers; 0 for open ends."""
    friction: float = param(0.1, "1", 0.02, 1.5)
    """Sliding friction of the polished surface. Only this friction counts, so that things do not jam in the slot."""
    rgba: Rgba = (0.55, 0.42, 0.30, 1.0)

    @cached_property
    def width(self) -> float:
        """Width along x [m]."""
        return self.gap + 2 * self.divider

    @cached_property
    def top(self) -> float:
        """Height of the dividers' upper edges above the ground [m]."""
        return self.base + self.height

    @cached_property
    def long(self) -> float:
        """Length along y, closed ends included [m]."""
        return self.length + 2 * self.ends

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half, foot = self.length / 2, [self.width / 2, self.long / 2, self.base / 2]
        look = {"friction": self.friction, "rgba": self.rgba, "priority": PRIORITY + 1}
        solid(body, "base", foot, [0.0, 0.0, self.base / 2], **look)
        inner, outer = self.gap / 2, self.width / 2
        profile = [
            (inner, self.base),
            (outer, self.base),
            (outer, self.top),
            (inner + self.chamfer, self.top),
            (inner, self.top - self.chamfer),
        ]
        for name, side in (("near", -1.0), ("far", 1.0)):
            corners = [[side * x, y, z] for x, z in profile for y in (-half, half)]
            spec.add_mesh(name=name, uservert=np.array(corners).ravel().tolist())
            wall = solid(body, name, (), type=MESH, **look)
            wall.meshname = name
        if self.ends >= MIN_END:
            end = [self.width / 2, self.ends / 2, self.height / 2]
            for name, side in (("right", -1.0), ("left", 1.0)):
                at = [0.0, side * (half + self.ends / 2), self.base + self.height / 2]
                solid(body, f"{name}_end", end, at, **look)


if __name__ == "__main__":
    show(SlotShelf())
    show(SlotShelf(ends=0.018))

"""A board with a level square slot right through it, on an arm that a servo turns about a pin behind it.

          pin                     seen from above; x leads from the mouth through the slot,
           o                      the origin is the pin's foot
          | |  arm
      ____|_|____
     |    | |    |
     |    | |    |  depth         the mouth is chamfered on all four sides
     |____/ \\____|
         mouth

What is w wide fits a slot of the width W and the depth D, turned by psi against its axis and all the way through, if
w cos psi + D sin psi <= W: a rectangle in a strip.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.optimize import brentq

from ..params import param
from .prop import PRIORITY, Prop, Rgba, shown, solid, table

MESH = mujoco.mjtGeom.mjGEOM_MESH
LIFT = 0.002
"""Height of the lowest face above the ground [m]: nothing rubs."""
ARM, PIN = 0.006, 0.012
"""Thickness of the arm and radius of the pin [m]."""
DAMPING, ARMATURE = 8.0, 0.05
"""Of the hinge [N m s/rad, kg m^2]: with a servo of `STIFFNESS` a turn is over, but for 2 %, after 0.2 s."""
STIFFNESS = 200.0
"""Of the servo [N m/rad]: at the strongest push of the arm, 30 N at 5 cm from the axis, it gives way by 0.4 deg."""
STEEL: Rgba = (0.30, 0.32, 0.36, 1.0)


@dataclass(frozen=True, kw_only=True)
class SlotBoard(Prop):
    """Four convex walls around a slot, whose chamfered mouth is wider by `chamfer` on each side."""

    slot: float = param(0.030, "m", 0.012, 0.06)
    """Width and height of the slot."""
    depth: float = param(0.080, "m", 0.02, 0.12)
    """Length of the slot, along x."""
    centre: float = param(0.070, "m", 0.04, 0.15)
    """Height of the slot's axis above the ground."""
    roof: float = param(0.008, "m", 0.004, 0.03)
    """Thickness of what is above the slot. So thin that the palm of a hand that points down passes over it."""
    width: float = param(0.120, "m", 0.05, 0.30)
    """Along y."""
    chamfer: float = param(0.004, "m", 0.0, 0.006)
    pivot: float = param(0.100, "m", -0.10, 0.20)
    """How far the pin is behind the mouth; negative before it."""
    mass: float = param(0.40, "kg", 0.05, 2.0)
    friction: float = param(0.2, "1", 0.02, 1.5, hidden=True)
    """Of waxed wood, whatever touches it."""
    plugged: bool = False
    """Whether the slot is filled: the same board without the way through."""
    rgba: Rgba = (0.48, 0.52, 0.60, 1.0)

    @property
    def top(self) -> float:
        """Height of the upper face above the ground [m]."""
        return self.centre + self.slot / 2 + self.roof

    def steepest(self, width: float) -> float:
        """Largest angle to the slot's axis at which a bar of a width [m] passes through it [rad]; 0 if it never fits."""
        if width >= self.slot:
            return 0.0
        spare = lambda angle: self.slot - width * math.cos(angle) - self.depth * math.sin(angle)  # noqa: E731
        return float(brentq(spare, 0.0, math.pi / 2 - 1e-9)) if spare(math.pi / 2 - 1e-9) < 0.0 else math.pi / 2

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        body.add_joint(name="hinge", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], damping=DAMPING, armature=ARMATURE)
        half, side, end, cut = self.slot / 2, self.width / 2, self.slot / 2 + self.chamfer, self.chamfer
        low, high = self.centre - half, self.centre + half
        for name, sign in (("left", 1.0), ("right", -1.0)):
            outline = self._wall(sign * half, sign * side, sign * cut)
            self._piece(body, spec, name, [(x, y, z) for x, y in outline for z in (LIFT, self.top)])
        for name, outline in (
            ("bottom", self._wall(low, LIFT, -cut)),
            ("roof", self._wall(high, self.top, min(cut, self.roof / 2))),
        ):
            self._piece(body, spec, name, [(x, y, z) for x, z in outline for y in (-end, end)])
        if self.plugged:
            self._solid(body, "plug", [self.depth / 2, half, half], [self.depth / 2 - self.pivot, 0.0, self.centre])
        reach = abs(self.depth / 2 - self.pivot)
        shown(body, "arm", STEEL, size=[reach / 2, PIN, ARM / 2], pos=[(self.depth / 2 - self.pivot) / 2, 0, LIFT + ARM / 2])
        cylinder = mujoco.mjtGeom.mjGEOM_CYLINDER
        shown(body, "pin", STEEL, type=cylinder, size=[PIN, ARM, 0.0], pos=[0, 0, LIFT + ARM])

    def _wall(self, inner: float, outer: float, cut: float) -> list[tuple[float, float]]:
        """Profile of a wall: x, and y or z from the slot to the outside, chamfered at the mouth [m]."""
        front, back = -self.pivot, self.depth - self.pivot
        return [(back, inner), (back, outer), (front, outer), (front, inner + cut), (front + abs(cut), inner)]

    def _piece(
        self, body: mujoco.MjsBody, spec: mujoco.MjSpec, name: str, corners: Sequence[tuple[float, float, float]]
    ) -> None:
        spec.add_mesh(name=name, uservert=np.array(corners).ravel().tolist())
        self._solid(body, name, (), (), MESH).meshname = name

    def _solid(
        self,
        body: mujoco.MjsBody,
        name: str,
        size: Sequence[float],
        pos: Sequence[float],
        type: mujoco.mjtGeom = mujoco.mjtGeom.mjGEOM_BOX,
    ) -> mujoco.MjsGeom:
        look = {"friction": self.friction, "rgba": self.rgba, "priority": PRIORITY + 1}
        return solid(body, name, size, pos or (0.0, 0.0, 0.0), type=type, mass=self.mass / 4, **look)


if __name__ == "__main__":
    import mujoco.viewer

    from .prop import TABLE_TOP, place

    scene = table()
    place(scene, SlotBoard(), "asset", [0, 0, TABLE_TOP], free=False)
    mujoco.viewer.launch(scene.compile())

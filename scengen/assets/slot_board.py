"""A board with a horizontal square slot through it, on an arm that a servo turns about a pin behind it.

            o  pin
            |  arm                   seen from above; x leads from the mouth through the slot,
      ___   |   ___                  the origin is the base of the pin
     |   ---'---   |
     |____     ____|  back window
     |             |
     |             |  depth          hollow between the windows, open below, covered above;
     |____     ____|                 both windows are chamfered in front, on all four sides
     |____\\   //____|  front window
           mouth

A bar of the width w, turned by psi, passes two windows of the width W whose farthest edges are D apart if it fits into
the strip of that direction between them, w <= W cos psi - D sin psi. A bar that is turned farther passes the first
window and hits the second plate. In a channel the walls would align a bar, as the arm yields.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import Outline, Vec3, corners
from ..params import param
from .prop import PRIORITY, Prop, Rgba, shown, solid, table

PLATE_THICKNESS = 0.012
"""Thickness of the front and of the back plate [m]."""
BACK_CHAMFER = 0.002
"""Chamfer of the back window [m]."""
SIDE_THICKNESS = 0.004
"""Thickness of the sides [m]."""
BEECH_DENSITY = 700.0
"""Density of beech [kg/m^3]."""
GROUND_CLEARANCE = 0.002
"""Height of the lowest face above the ground, so that the board does not rub [m]."""
ARM_THICKNESS = 0.006
"""Thickness of the arm [m]."""
PIN_RADIUS = 0.012
"""Radius of the pin, and half the width of the arm [m]."""
DAMPING = 8.0
"""Damping of the hinge [N m s/rad]: with a servo of `STIFFNESS` a turn is complete to 2 % after 0.2 s."""
ARMATURE = 0.05
"""Armature of the hinge [kg m^2]."""
STIFFNESS = 200.0
"""Stiffness of the servo [N m/rad]: at the strongest push of the robot, 30 N at 5 cm from the axis, it yields by
0.4 deg."""
ARM_COLOUR: Rgba = (0.30, 0.32, 0.36, 1.0)
"""Colour of arm and pin."""


@dataclass(frozen=True, kw_only=True)
class SlotBoard(Prop):
    """Two plates with one window each; the mouth is wider by `chamfer` on every side. The paper gives no sizes."""

    slot: float = param(0.030, "m", 0.012, 0.06)
    """Width and height of the slot."""
    depth: float = param(0.070, "m", 0.03, 0.12)
    """Distance from the mouth to the back, along x."""
    centre: float = param(0.070, "m", 0.04, 0.15)
    """Height of the slot's axis above the ground."""
    roof: float = param(0.008, "m", 0.004, 0.03)
    """Thickness of the board above the slot, so small that the palm of a hand that points down passes over it."""
    width: float = param(0.120, "m", 0.05, 0.30)
    """Width along y."""
    chamfer: float = param(0.004, "m", 0.0, 0.0075)
    """Chamfer of the front window, at 45 deg."""
    pivot: float = param(0.100, "m", -0.10, 0.20)
    """Distance of the pin behind the mouth; negative in front of it."""
    friction: float = param(0.2, "1", 0.02, 1.5, hidden=True)
    """Sliding friction of waxed wood, against all things that touch it."""
    plugged: bool = False
    """Whether the slot is filled: the same board without a passage."""
    rgba: Rgba = (0.48, 0.52, 0.60, 1.0)

    @cached_property
    def top(self) -> float:
        """Height of the upper face above the ground [m]."""
        return self.centre + self.slot / 2 + self.roof

    def steepest(self, width: float) -> float:
        """Largest angle to the slot's axis at which a bar of the given width [m] passes [rad]; 0 if it never fits."""
        long = self.depth - self.chamfer
        diagonal = math.hypot(self.slot, long)
        return max(0.0, math.acos(min(1.0, width / diagonal)) - math.atan2(long, self.slot))

    def outline(self, pin: Vec3, yaw: float) -> Outline:
        """Outline of the board without its arm, seen from above.

        Args:
            pin: position of the pin [m].
            yaw: direction of the slot [rad].
        """
        return corners(pin, yaw, [self.depth, self.width], [self.depth / 2 - self.pivot, 0.0])

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        hinge = mujoco.mjtJoint.mjJNT_HINGE
        body.add_joint(name="hinge", type=hinge, axis=[0, 0, 1], damping=DAMPING, armature=ARMATURE)
        front, back, half = -self.pivot, self.depth - self.pivot, self.width / 2
        self._add_window(body, spec, "front", front, self.chamfer)
        self._add_window(body, spec, "back", back - PLATE_THICKNESS, BACK_CHAMFER)
        middle, long = (front + back) / 2, self.depth / 2 - PLATE_THICKNESS
        for name, side in (("left", 1.0), ("right", -1.0)):
            at = [middle, side * (half - SIDE_THICKNESS / 2), (GROUND_CLEARANCE + self.top) / 2]
            self._add_solid(body, f"side_{name}", [long, SIDE_THICKNESS / 2, (self.top - GROUND_CLEARANCE) / 2], at)
        thick = self.roof / 4
        self._add_solid(body, "top", [long, half - SIDE_THICKNESS, thick], [middle, 0.0, self.top - thick])
        if self.plugged:
            self._add_solid(body, "plug", [self.depth / 2, self.slot / 2, self.slot / 2], [middle, 0.0, self.centre])
        arm = [middle / 2, 0.0, GROUND_CLEARANCE + ARM_THICKNESS / 2]
        shown(body, "arm", ARM_COLOUR, size=[abs(middle) / 2, PIN_RADIUS, ARM_THICKNESS / 2], pos=arm)
        cylinder = mujoco.mjtGeom.mjGEOM_CYLINDER
        shown(
            body,
            "pin",
            ARM_COLOUR,
            type=cylinder,
            size=[PIN_RADIUS, ARM_THICKNESS, 0.0],
            pos=[0, 0, GROUND_CLEARANCE + ARM_THICKNESS],
        )

    def _add_window(self, body: mujoco.MjsBody, spec: mujoco.MjSpec, name: str, front: float, cut: float) -> None:
        """Add a plate with a square window: four convex walls, chamfered in front."""
        half, side, end = self.slot / 2, self.width / 2, self.slot / 2 + cut
        low, high = self.centre - half, self.centre + half

        def profile(inner: float, outer: float) -> list[tuple[float, float]]:
            """Profile of a wall: x, and y or z from the window to the outside [m]."""
            off, back = math.copysign(cut, outer - inner), front + PLATE_THICKNESS
            return [(back, inner), (back, outer), (front, outer), (front, inner + off), (front + cut, inner)]

        for wall, sign in (("left", 1.0), ("right", -1.0)):
            points = [(x, y, z) for x, y in profile(sign * half, sign * side) for z in (GROUND_CLEARANCE, self.top)]
            self._add_mesh(body, spec, f"{name}_{wall}", points)
        for wall, inner, outer in (("bottom", low, GROUND_CLEARANCE), ("roof", high, self.top)):
            points = [(x, y, z) for x, z in profile(inner, outer) for y in (-end, end)]
            self._add_mesh(body, spec, f"{name}_{wall}", points)

    def _add_mesh(
        self, body: mujoco.MjsBody, spec: mujoco.MjSpec, name: str, points: Sequence[Sequence[float]]
    ) -> None:
        spec.add_mesh(name=name, uservert=np.array(points).ravel().tolist())
        self._add_solid(body, name, (), type=mujoco.mjtGeom.mjGEOM_MESH).meshname = name

    def _add_solid(
        self,
        body: mujoco.MjsBody,
        name: str,
        size: Sequence[float],
        pos: Sequence[float] = (0.0, 0.0, 0.0),
        type: mujoco.mjtGeom = mujoco.mjtGeom.mjGEOM_BOX,
    ) -> mujoco.MjsGeom:
        look = {"friction": self.friction, "rgba": self.rgba, "priority": PRIORITY + 1}
        return solid(body, name, size, pos, type=type, density=BEECH_DENSITY, **look)


if __name__ == "__main__":
    import mujoco.viewer

    from .prop import TABLE_TOP, place

    scene = table()
    place(scene, SlotBoard(), "asset", [0, 0, TABLE_TOP], free=False)
    mujoco.viewer.launch(scene.compile())

"""Base of the two tasks with a cracker box and a slot (T08, T09): the scene, its tolerances, and positions in it."""

import math
from collections.abc import Mapping
from functools import cached_property

import mujoco
import numpy as np

from ..assets.bin import Bin
from ..assets.cracker_box import CrackerBox, slot_for
from ..assets.prop import TABLE_TOP, place, table
from ..decisions import Decision, choice, near, side_of
from ..geometry import UP, Outline, Vec3, corners
from ..scenario import Scenario

FLAT_TOLERANCE = math.radians(3.0)  # largest angle between the box' thin axis and the vertical [rad]
HEIGHT_TOLERANCE = 0.003  # largest difference between the heights of the box' middle and of its seat [m]


class BoxAndSlot(Scenario):
    """A box of crackers that stands on the table, and a slot. Subclasses are dataclasses with these parameters."""

    box_x: float
    box_y: float
    box_yaw: float
    slot_x: float
    slot_y: float
    slot_yaw: float
    clearance: float
    box: CrackerBox

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.box, self.slot)

    def _scene(self, box: CrackerBox, slot: Bin) -> mujoco.MjSpec:
        scene = table()
        place(scene, slot, "slot", self.foot, math.radians(self.slot_yaw), free=False)
        place(scene, box, "box", self.start, math.radians(self.box_yaw + 90.0))
        return scene

    def decisions(self) -> Mapping[str, Decision]:
        turn = math.remainder(self.slot_yaw - self.box_yaw, 180.0)
        return {
            "box_turns": choice(side_of(turn), "box_yaw", "slot_yaw"),
            "seat": near(self.foot, 0.006, "slot_x", "slot_y"),
            "size": choice(round(self.box.scale, 2), "box"),
        }

    @cached_property
    def slot(self) -> Bin:
        """Slot that fits the box."""
        return slot_for(self.box, self.clearance)

    @cached_property
    def start(self) -> Vec3:
        """Initial position of the box [m]."""
        return np.array([self.box_x, self.box_y, TABLE_TOP])

    @cached_property
    def foot(self) -> Vec3:
        """Position of the slot on the table [m]."""
        return np.array([self.slot_x, self.slot_y, TABLE_TOP])

    @cached_property
    def seat(self) -> Vec3:
        """Position of the middle of a box that lies in the middle of the slot [m]."""
        return self.foot + (self.slot.floor + self.box.size[0] / 2) * UP

    @cached_property
    def _box_outline(self) -> Outline:
        return corners(self.start, math.radians(self.box_yaw + 90.0), self.box.size)

    @cached_property
    def _slot_outline(self) -> Outline:
        return corners(self.foot, math.radians(self.slot_yaw), self.slot.outer)

"""Base of the tasks with a rod and a ridge (T31, T32 and X1): the scene, and where things stand in it."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Generic, TypeVar

import mujoco
import numpy as np

from ..assets.inlaid_rod import InlaidRod
from ..assets.prop import TABLE_TOP, place, table
from ..assets.ridge import PLATE_MARGIN, Ridge
from ..assets.rod import Rod
from ..geometry import UP, Outline, Vec3, corners, heading
from ..means import Condition, Mean, throughout, when
from ..robots.jaw import PALM_ACROSS, PALM_ALONG
from ..scenario import Scenario
from ..sim.arm import ROBOT
from ..sim.world import World

MAX_TILT = math.radians(10.0)
"""Largest tilt of the rod, from the vertical or from the level [rad] (paper, App. B, T31 and T32)."""
RIDGE = "stand/ridge"
"""Name of the body of the ridge."""

LOOSE_ROOM = 0.0005
"""Room between an opening jaw and the rod from which the rod may tip [m]. Pads that hold a rod are 0.4 mm closer."""
SHUT_ROOM = 0.00025  # room below which a jaw that touches the rod holds it again [m]
MAX_RATTLE_ROOM = 0.008  # room up to which fingers that open touch the rod [m]; up to 4 mm in jittered runs

RodT = TypeVar("RodT", bound=Rod | InlaidRod)


class RodAndRidge(Scenario, Generic[RodT]):
    """A rod on the table, and a ridge on a plate. Subclasses are dataclasses with these parameters."""

    rod_x: float
    rod_y: float
    rod_yaw: float
    ridge_x: float
    ridge_y: float
    ridge_yaw: float
    rod: RodT
    ridge: Ridge

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.ridge, "stand", self.foot, math.radians(self.ridge_yaw), free=False)
        place(scene, self.rod, "rod", self.start, math.radians(self.rod_yaw))
        return scene

    def release(self, steady: str, holds: Condition) -> Mapping[str, Mean]:
        """Means of a rod that the jaw brings to the ridge and releases there once.

        Args:
            steady: name of the fact that must be true when the jaw opens on the ridge.
            holds: that fact.
        """

        def opens(world: World) -> bool:
            return world.touching("rod", RIDGE) and self.room(world) > LOOSE_ROOM

        def left_alone(world: World) -> bool:
            return not world.touching(ROBOT, "rod") or SHUT_ROOM < self.room(world) < MAX_RATTLE_ROOM

        def tipped(world: World) -> bool:
            return world.tilt("rod") > MAX_TILT and not world.touching(ROBOT, "rod")

        return {
            "the jaw brought the rod to the ridge": when(
                lambda world: world.touching("rod", RIDGE), lambda world: world.arm.grips("rod")
            ),
            steady: when(opens, holds),
            "the jaw that had opened left the rod alone": throughout(left_alone, after=steady),
            "the rod did not tip once let go": throughout(lambda world: not tipped(world)),
        }

    def room(self, world: World) -> float:
        """Room between the pads of the jaw beyond the width of the rod [m]."""
        return world.arm.gap - self.rod.width

    @cached_property
    def start(self) -> Vec3:
        """Point of the table under the middle of the rod at the start [m]."""
        return np.array([self.rod_x, self.rod_y, TABLE_TOP])

    @cached_property
    def foot(self) -> Vec3:
        """Point under the middle of the ridge [m]."""
        return np.array([self.ridge_x, self.ridge_y, TABLE_TOP])

    @cached_property
    def top(self) -> Vec3:
        """Middle of the ridge's upper face [m]."""
        return self.foot + self.ridge.height * UP

    @cached_property
    def normal(self) -> Vec3:
        """Level unit vector across the ridge."""
        return heading(self.ridge_yaw + 90.0)

    @cached_property
    def outline(self) -> Outline:
        """Outline of the rod on the table [m]."""
        return corners(self.start, math.radians(self.rod_yaw), self.rod.size)

    @cached_property
    def hand_over_rod(self) -> Outline:
        """Outline of the palm over the rod, before it is lifted [m]."""
        return corners(self.start, math.radians(self.rod_yaw), [2 * PALM_ALONG, 2 * PALM_ACROSS])

    @cached_property
    def stand_outline(self) -> Outline:
        """Outline of the plate under the ridge [m]."""
        size = [self.ridge.length + 2 * PLATE_MARGIN, self.ridge.plate]
        return corners(self.foot, math.radians(self.ridge_yaw), size)

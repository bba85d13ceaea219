"""Paces of moves, and the manner in which a style (`scengen.sim.style`) carries one move out."""

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..control.loop import Loop
from ..geometry import Vec3
from ..sim.arm import Arm

CONTACT_DISTANCE = 0.03
"""Distance from both ends of a move, where contact may begin or end, within which it is not displaced [m]."""
MIN_DETOUR_LENGTH = 0.10
"""Length of the shortest move through free space that is displaced [m]."""
DISPLACED_TIME = 0.3
"""Time for which the commanded position is displaced [s]."""
APPROACH_RATE = 4.0
"""Speed limit of a setpoint per metre of remaining distance [1/s]."""


@dataclass(frozen=True)
class Pace:
    """Speed, accuracy and time limit of a move."""

    speed: float
    """Largest speed of the hand [m/s]."""
    within: float
    """Distance from the target at which the hand has arrived [m]."""
    give_up: float = 6.0
    """Time after which the move gives up [s]."""

    @property
    def free(self) -> bool:
        """Whether a move at this pace goes through free space: it may end as far from its target as one of `COARSE`."""
        return self.within >= COARSE.within


COARSE = Pace(0.30, 0.02)
"""Pace of transit through free space, as fast as an action of 1."""
STEADY = Pace(0.25, 0.005)
"""Pace of a move to a place beside objects."""
FINE = Pace(0.15, 0.003)
"""Pace of a move up to an object that is to be grasped, put down or touched."""


def approach(ahead: Vec3, speed: float, share: float = 1.0, rate: float = APPROACH_RATE) -> Vec3:
    """Velocity of a setpoint that goes straight to its target and slows down before it [m/s].

    Args:
        ahead: way from the setpoint to its target [m].
        speed: largest speed [m/s].
        share: share of the speed at which it goes now.
        rate: speed limit per metre of remaining distance [1/s].
    """
    distance = math.sqrt(ahead @ ahead)
    return ahead * (share * min(speed, rate * distance) / max(distance, 1e-9))


@dataclass(frozen=True)
class Manner:
    """Parameters of one straight move. Without a style: at its pace, at once, and straight."""

    pace: Pace
    """Pace of the move."""
    styled: bool = False
    """Whether there is a style."""
    pause: float = 0.0
    """Time before the move starts [s]."""
    length: float = 0.0
    """Length of the move [m]."""
    detour: Vec3 | None = None
    """Displacement of the middle of the move [m]; None for a straight one."""
    displacement: Vec3 | None = None
    """Displacement of the commanded position for `DISPLACED_TIME` in the middle of the move [m]; None for none."""

    @classmethod
    def of(cls, arm: Arm, goal: Vec3, pace: Pace) -> Self:
        """The manner of a move that starts now. Its numbers depend on the style, the arm and the time."""
        style = arm.world.style
        if style is None:
            return cls(pace)
        key = ("move", arm.number, round(arm.world.time / Loop.PERIOD))
        fastest = max(pace.speed, COARSE.speed)  # an action of 1 is not faster
        paced = replace(pace, speed=min(fastest, style.pace * pace.speed)) if pace.within else pace
        if not pace.free:
            return cls(paced, True)
        pause, way = style.pause * style.number(*key, "pause"), goal - arm.hand
        length = math.sqrt(way @ way)
        if length < MIN_DETOUR_LENGTH:
            return cls(paced, True, pause)
        x, y, z = (style.number(*key, axis) for axis in "xyz")
        detour = style.detour * np.array([2.0 * x - 1.0, 2.0 * y - 1.0, z])  # never towards the table
        angle = math.tau * style.number(*key, "angle")
        aside = style.displacement * np.array([math.cos(angle), math.sin(angle), 0.0])
        return cls(paced, True, pause, length, detour, aside)

    def detour_at(self, left: float) -> Vec3:
        """Displacement of the path [m] where `left` [m] of the straight line is left; none near its ends."""
        if self.detour is None:
            return np.zeros(3)
        share = (self.length - left - CONTACT_DISTANCE) / (self.length - 2 * CONTACT_DISTANCE)
        return math.sin(math.pi * min(1.0, max(0.0, share))) ** 2 * self.detour

    def displacement_at(self, left: float) -> Vec3:
        """Displacement of the commanded position [m] where `left` [m] of the straight line is left."""
        half = min(self.pace.speed * DISPLACED_TIME, self.length - 2 * CONTACT_DISTANCE) / 2
        if self.displacement is None or abs(left - self.length / 2) > half:
            return np.zeros(3)
        return self.displacement

"""Seesaw: a deck that hangs below its axle, so that it has an angle of rest for every load, like a balance.

              axle
    ___________o___________     the cheeks carry the deck, the posts carry the axle
    -----------|-----------
               |  |
            ===========

A plank that turns about a point at or below the loads is either level or tipped: its range of balancing loads has no
width. With the axle at height `drop` above the deck, everything hangs below the axle, and gravity restores. With s_i
the position of mass m_i along the deck and u_i its height over the axle, the moments about the axle vanish where

    tan(tilt) = sum(m_i s_i) / -sum(m_i u_i) = moment / stiffness,

positive where +s goes down. Multiplied by g, moment is the torque on the level deck and stiffness a torque per small
angle.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import UP, Vec3, about_y, quat
from ..params import param
from .box import Box
from .prop import STIFF, Prop, Rgba, show, shown, solid

CHEEK_THICKNESS = 0.004
"""Thickness of the plates that join deck and axle [m]. They have no mass."""
POST_WIDTH = 0.014
"""Width of the posts [m]."""
CHEEK_GAP = 0.003
"""Gap between cheek and post [m]."""
AXLE_RADIUS = 0.004
"""Radius of the axle [m]."""
FRAME_COLOUR = (0.35, 0.37, 0.40, 1.0)
"""Colour of foot and posts."""
AXLE_COLOUR = (0.2, 0.2, 0.22, 1.0)
"""Colour of the axle."""

Load = tuple[float, float, float]
"""Mass of a load [kg], and position along the deck from the axle and height over the deck of its centre of mass [m]."""


def standing(box: Box, along: float) -> Load:
    """The load of a box that stands on the deck at `along` [m]."""
    return box.mass, along, box.size[2] / 2


@dataclass(frozen=True, kw_only=True)
class Seesaw(Prop):
    """A seesaw. x runs along the level deck, y along the axle; the origin is on the ground below the axle.

    Pivot offset and beam mass: paper, App. C ("pivot offset +-0.10 m; beam mass 0.20-0.80 kg"); it gives nothing else.
    """

    length: float = param(0.60, "m", 0.2, 0.8)
    width: float = param(0.050, "m", 0.02, 0.10)
    thickness: float = param(0.012, "m", 0.004, 0.03)
    height: float = param(0.095, "m", 0.04, 0.20)
    """Height of the level deck's upper face. An arm of 0.40 m dips by 69 mm at the stop and must not hit the ground."""
    drop: float = param(0.060, "m", 0.03, 0.12)
    """Distance of the deck's upper face below the axle."""
    pivot_offset: float = param(0.0, "m", -0.10, 0.10)
    """Position of the axle along x, from the middle of the deck."""
    mass: float = param(0.35, "kg", 0.2, 0.8, hidden=True)
    friction: float = param(0.8, "1", 0.05, 1.5)
    damping: float = param(0.16, "N m s/rad", 0.0, 1.0)
    """Damping of an air dashpot, as in laboratory balances: about 0.8 of critical, 2 sqrt(0.4 N m x 0.03 kg m^2)."""
    rubbing: float = param(0.002, "N m", 0.0, 0.05)
    """Dry friction of the bearing: mu r N = 0.1 x 2 mm x 10 N for a steel axle of 4 mm that carries 1 kg."""
    stop: float = param(10.0, "deg", 6.0, 25.0)
    """Tilt at which the deck rests on its stops, to either side."""
    tilt: float = 0.0
    """Initial tilt, positive where +x is down [rad]. The loads determine it."""
    rgba: Rgba = (0.80, 0.66, 0.44, 1.0)

    # --- parts ----------------------------------------------------------------------------

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        side = self.width / 2 + CHEEK_THICKNESS + CHEEK_GAP + POST_WIDTH / 2
        solid(body, "foot", [0.04, side + POST_WIDTH / 2, 0.004], [0, 0, 0.004], condim=3, rgba=FRAME_COLOUR)
        for y in (-side, side):
            solid(
                body,
                "",
                [POST_WIDTH / 2, POST_WIDTH / 2, self.axle / 2],
                [0, y, self.axle / 2],
                condim=3,
                rgba=FRAME_COLOUR,
            )
        self._fill_beam(body.add_body(name="beam", pos=[0, 0, self.axle], quat=quat("y", self.tilt)), side)

    def _fill_beam(self, beam: mujoco.MjsBody, side: float) -> None:
        """Fill the body of the beam, whose origin is on the axle. Its joint reads 0 where the deck is level."""
        beam.add_joint(
            name="axle",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 1, 0],
            ref=self.tilt,
            range=[-self.steepest, self.steepest],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            solref_limit=STIFF,
            damping=self.damping,
            frictionloss=self.rubbing,
        )
        deck, at = np.array([self.length, self.width, self.thickness]) / 2, -self.drop - self.thickness / 2
        middle = [-self.pivot_offset, 0, at]
        solid(beam, "deck", deck, middle, mass=self.mass, friction=self.friction, rgba=self.rgba)
        tall = self.drop + self.thickness
        for y in (-(self.width + CHEEK_THICKNESS) / 2, (self.width + CHEEK_THICKNESS) / 2):
            solid(
                beam, "", [0.010, CHEEK_THICKNESS / 2, tall / 2], [0, y, -tall / 2], mass=0.0, condim=3, rgba=self.rgba
            )
        size, cylinder = [AXLE_RADIUS, side + POST_WIDTH / 2, 0], mujoco.mjtGeom.mjGEOM_CYLINDER
        shown(beam, "", AXLE_COLOUR, type=cylinder, size=size, quat=quat("x", math.pi / 2))

    # --- statics --------------------------------------------------------------------------

    def moment(self, loads: Sequence[Load]) -> float:
        """First moment of deck and loads about the axle, positive where +x is heavier [kg m]."""
        return sum(mass * along for mass, along, _ in [self._deck, *loads])

    def stiffness(self, loads: Sequence[Load]) -> float:
        """Sum of mass times depth below the axle over deck and loads [kg m]."""
        return sum(mass * (self.drop - height) for mass, _, height in [self._deck, *loads])

    def rest(self, loads: Sequence[Load]) -> float:
        """Tilt at which the deck rests with these loads, in equilibrium or on a stop [rad]."""
        tilt = math.atan(self.moment(loads) / self.stiffness(loads))
        return min(max(tilt, -self.steepest), self.steepest)

    @cached_property
    def _deck(self) -> Load:
        return self.mass, -self.pivot_offset, -self.thickness / 2

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def axle(self) -> float:
        """Height of the axle over the ground [m]."""
        return self.height + self.drop

    @cached_property
    def steepest(self) -> float:
        """Tilt on a stop [rad]."""
        return math.radians(self.stop)

    @cached_property
    def dip(self) -> float:
        """Distance by which the end of the longer arm goes down from level to its stop [m]."""
        return max(self.arm(-1), self.arm(1)) * math.sin(self.steepest)

    def arm(self, side: int) -> float:
        """Length of the deck on one side of the axle, -1 or 1 [m]."""
        return self.length / 2 - side * self.pivot_offset

    def on_deck(self, along: float, tilt: float) -> Vec3:
        """Point of the deck's upper face at `along` [m] when it is tilted by `tilt` [rad], in the seesaw's axes [m]."""
        return self.axle * UP + about_y(tilt) @ np.array([along, 0.0, -self.drop])

    def stretches(self, side: int, inner: float, rim: float, taken: float, apart: float) -> list[tuple[float, float]]:
        """Free intervals along the deck where another load can stand on one arm, -1 or 1 [m].

        Args:
            inner: smallest distance from the axle [m].
            rim: smallest distance from the end of the deck [m].
            taken: position of the load that already stands on the deck [m].
            apart: smallest distance from that load [m].
        """
        outer, away = self.arm(side) - rim, side * taken
        parts = [(inner, away - apart), (away + apart, outer)] if away > 0 else [(inner, outer)]
        parts = [(near, far) for near, far in parts if near <= far]
        return parts if side > 0 else [(-far, -near) for near, far in reversed(parts)]


if __name__ == "__main__":
    show(Seesaw())

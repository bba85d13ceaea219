"""Seesaw: a deck that hangs below its axle, so that it has an angle of rest for every load, as a balance has.

              axle
    ___________o___________     the cheeks carry the deck, the posts carry the axle
    -----------|-----------
               |  |
            ===========

A plank that turns about a point at or below the loads is level or tipped, with nothing in between: its range of
balancing loads has no width. With the axle at height `drop` above the deck everything hangs below it and gravity
restores. With s_i the place of mass m_i along the deck and u_i its height over the axle, the moments about the axle
vanish where

    tan(tilt) = sum(m_i s_i) / -sum(m_i u_i),

positive where +s goes down. The denominator times g is the stiffness of the seesaw against small turns.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import mujoco

from ..params import check_bounds, param
from .prop import PRIORITY, STIFF, show

CHEEK = 0.004
"""Thickness of the plates that join deck and axle [m]; they count as weightless beside the deck."""
POST = 0.014
"""Width of the posts [m]."""
SLACK = 0.003
"""Air between cheek and post [m]."""
AXLE = 0.004
"""Radius of the axle [m]."""


@dataclass(frozen=True, kw_only=True)
class Seesaw:
    """x runs along the level deck, y along the axle; the origin is on the ground below the axle.

    Pivot offset and beam mass: paper, App. C ("pivot offset +-0.10 m; beam mass 0.20-0.80 kg"); it gives nothing else.
    """

    length: float = param(0.60, "m", 0.2, 0.8)
    width: float = param(0.050, "m", 0.02, 0.10)
    thickness: float = param(0.012, "m", 0.004, 0.03)
    height: float = param(0.095, "m", 0.04, 0.20)
    """Of the level deck's upper face. An arm of 0.40 m dips by 69 mm at the stop and must not strike the ground."""
    drop: float = param(0.060, "m", 0.03, 0.12)
    """Of the deck's upper face below the axle."""
    pivot_offset: float = param(0.0, "m", -0.10, 0.10)
    """Of the axle from the middle of the deck."""
    mass: float = param(0.35, "kg", 0.2, 0.8, hidden=True)
    friction: float = param(0.8, "1", 0.05, 1.5)
    damping: float = param(0.16, "N m s/rad", 0.0, 1.0)
    """Of an air dashpot, as laboratory balances have: about 0.8 of critical, 2 sqrt(0.4 N m x 0.03 kg m^2)."""
    rubbing: float = param(0.002, "N m", 0.0, 0.05)
    """Dry friction of the bearing: mu r N = 0.1 x 2 mm x 10 N for a steel axle of 4 mm that carries 1 kg."""
    stop: float = param(10.0, "deg", 6.0, 25.0)
    """Tilt at which the deck comes to rest on its stops, to either side."""
    tilt: float = 0.0
    """Where it starts [rad], positive where +x is down; no parameter: the loads decide."""
    rgba: tuple[float, float, float, float] = (0.80, 0.66, 0.44, 1.0)

    def __post_init__(self) -> None:
        check_bounds(self)

    @property
    def axle(self) -> float:
        """Height of the axle over the ground [m]."""
        return self.height + self.drop

    @property
    def ends(self) -> tuple[float, float]:
        """Where the deck ends, along itself and from the axle: the negative and the positive one [m]."""
        return -self.length / 2 - self.pivot_offset, self.length / 2 - self.pivot_offset

    def slope(self, loads: Iterable[tuple[float, float, float]]) -> float:
        """tan(tilt) at which the seesaw is in equilibrium, were there no stops.

        Args:
            loads: mass [kg], place along the deck [m] and height over the deck [m] of each centre of mass.
        """
        masses = [(self.mass, -self.pivot_offset, -self.thickness / 2), *loads]
        return sum(m * s for m, s, _ in masses) / sum(m * (self.drop - h) for m, _, h in masses)

    def spec(self) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        stand = spec.worldbody.add_body(name="body")
        box, grey = mujoco.mjtGeom.mjGEOM_BOX, [0.35, 0.37, 0.40, 1]
        side = self.width / 2 + CHEEK + SLACK + POST / 2
        foot = [0.04, side + POST / 2, 0.004]
        stand.add_geom(name="foot", type=box, size=foot, pos=[0, 0, 0.004], rgba=grey, solref=STIFF, priority=PRIORITY)
        for y in (-side, side):
            size, pos = [POST / 2, POST / 2, self.axle / 2], [0, y, self.axle / 2]
            stand.add_geom(type=box, size=size, pos=pos, rgba=grey, solref=STIFF, priority=PRIORITY)
        self._hang(stand.add_body(name="beam", pos=[0, 0, self.axle], quat=_about_y(self.tilt)), side)
        return spec

    def _hang(self, beam: mujoco.MjsBody, side: float) -> None:
        """Fill the body of the beam, whose origin is on the axle. Its joint reads 0 where the deck is level."""
        stop = math.radians(self.stop)
        beam.add_joint(
            name="axle",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 1, 0],
            ref=self.tilt,
            range=[-stop, stop],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            solref_limit=STIFF,
            damping=self.damping,
            frictionloss=self.rubbing,
        )
        beam.add_geom(
            name="deck",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[self.length / 2, self.width / 2, self.thickness / 2],
            pos=[-self.pivot_offset, 0, -self.drop - self.thickness / 2],
            mass=self.mass,
            friction=[self.friction, 0.005, 0.0001],
            condim=4,
            solref=STIFF,
            priority=PRIORITY,
            rgba=self.rgba,
        )
        tall = self.drop + self.thickness
        for y in (-1, 1):
            beam.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[0.010, CHEEK / 2, tall / 2],
                pos=[0, y * (self.width + CHEEK) / 2, -tall / 2],
                mass=0,
                solref=STIFF,
                priority=PRIORITY,
                rgba=self.rgba,
            )
        beam.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[AXLE, side + POST / 2, 0],
            quat=[math.sqrt(0.5), math.sqrt(0.5), 0, 0],
            mass=0,
            group=1,
            contype=0,
            conaffinity=0,
            rgba=[0.2, 0.2, 0.22, 1],
        )


def _about_y(angle: float) -> list[float]:
    """The turn by `angle` [rad] about y, as a quaternion (wxyz)."""
    return [math.cos(angle / 2), 0, math.sin(angle / 2), 0]


if __name__ == "__main__":
    show(Seesaw())

"""Incline: a slab on a hinge at its lower edge, which a servo tilts. Things on it slide down over that edge.

              ___---
        ___---              seen from the side; the lower edge, the lip, is towards the robot
lip  o--
     | posts at both ends    x goes up the slope, the origin is on the ground below the lip
"""

import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..geometry import UP, Mat3, Vec3, about_y, quat
from ..params import Bounded, param
from ..physics import slid, slip_angle
from .prop import Prop, Rgba, servo, show, shown, solid

POST_WIDTH = 0.016
"""Width of the posts [m]."""
POST_GAP = 0.004
"""Gap between the posts and the slab [m]."""
SLAB_THICKNESS = 0.010
"""Thickness of the slab [m]."""
STIFFNESS = 1000.0
"""Stiffness of the servo [N m/rad]: 20 N at the far end turn it by 0.2 degrees."""
DAMPING = 20.0
"""Damping of the hinge [N m s/rad]: with this stiffness the slab follows its goal 20 ms late."""
ARMATURE = 0.05
"""Inertia of the servo's rotor [kg m^2]."""
SLAB_FRICTION = 0.05
"""Sliding friction of the slab, less than that of all things on it: MuJoCo takes the larger of two frictions."""
TIPPING_SHARE = 0.9
"""Time in which a cube slides a distance, as a share of that by the law of sliding: it leans on its lower edge and tips
early. Measured: 0.86 to 0.93."""
FRAME_COLOUR: Rgba = (0.35, 0.37, 0.40, 1.0)
"""Colour of posts and axle."""


@dataclass(frozen=True, kw_only=True)
class Incline(Prop):
    """A slab between two posts. Its joint `hinge` reads 0 at the smallest angle, where it starts.

    Angles: paper, App. B, T15 ("an incline tilts from 10 to 55 deg"); it gives nothing else.
    """

    length: float = param(0.18, "m", 0.10, 0.30)
    """Length along the slope."""
    width: float = param(0.40, "m", 0.10, 0.60)
    """Width along the lip."""
    lip: float = param(0.125, "m", 0.05, 0.20)
    """Height of the lip."""
    least: float = param(10.0, "deg", 0.0, 20.0)
    """Smallest angle of the slab."""
    most: float = param(55.0, "deg", 30.0, 70.0)
    """Largest angle of the slab."""
    mass: float = param(0.5, "kg", 0.1, 2.0)
    rgba: Rgba = (0.36, 0.50, 0.66, 1.0)

    @cached_property
    def turns(self) -> float:
        """Range of the hinge [rad]."""
        return math.radians(self.most - self.least)

    def axes(self, turned: float = 0.0) -> Mat3:
        """Axes of the slab, as columns: up the slope, along the lip, out of the slab.

        Args:
            turned: angle of the hinge [rad].
        """
        return about_y(-math.radians(self.least) - turned)

    @cached_property
    def resting(self) -> NDArray[np.float64]:
        """Orientation of a block that lies on the slab at the start (wxyz)."""
        turn = np.empty(4)
        mujoco.mju_mat2Quat(turn, self.axes().ravel())
        return turn

    def on_slab(self, away: float, along: float, turned: float = 0.0) -> Vec3:
        """A point on the slab's face, in the axes of the incline [m].

        Args:
            away: distance from the lip, up the slope [m].
            along: position along the lip [m].
            turned: angle of the hinge [rad].
        """
        return self.lip * UP + self.axes(turned) @ np.array([away, along, 0.0])

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        beside = self.width / 2 + POST_GAP + POST_WIDTH / 2
        for y in (-beside, beside):
            solid(
                body,
                "",
                [POST_WIDTH / 2, POST_WIDTH / 2, self.lip / 2],
                [0, y, self.lip / 2],
                condim=3,
                rgba=FRAME_COLOUR,
            )
        slab = body.add_body(name="slab", pos=[0, 0, self.lip], quat=quat("y", -math.radians(self.least)))
        slab.add_joint(
            name="hinge",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, -1, 0],
            damping=DAMPING,
            armature=ARMATURE,
            range=[-0.01, self.turns + 0.01],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        )
        half = np.array([self.length, self.width, SLAB_THICKNESS]) / 2
        solid(slab, "slab", half, [half[0], 0, -half[2]], mass=self.mass, friction=SLAB_FRICTION, rgba=self.rgba)
        axle = mujoco.mjtGeom.mjGEOM_CYLINDER
        pos, turn = [0, 0, -SLAB_THICKNESS / 2], quat("x", math.pi / 2)
        shown(slab, "", FRAME_COLOUR, type=axle, size=[SLAB_THICKNESS / 2, beside, 0], pos=pos, quat=turn)


@dataclass(frozen=True, kw_only=True)
class Load(Bounded):
    """A block on an incline."""

    friction: float = param(0.6, "1", 0.15, 1.0, hidden=True)
    away: float = param(0.04, "m", 0.02, 0.12)  # distance of its middle from the lip

    @cached_property
    def colour(self) -> Rgba:
        """Colour that shows the friction, in proportion: pale at 0, dark at 1."""
        pale, dark = np.array([0.96, 0.93, 0.86]), np.array([0.10, 0.08, 0.12])
        return *(pale + self.friction * (dark - pale)).tolist(), 1.0


@dataclass(frozen=True)
class LoadedIncline:
    """An incline at its place that tilts from its smallest to its largest angle, with a block in each of its lanes."""

    incline: Incline
    foot: Vec3
    """Position of the middle of the lip, on the ground [m]."""
    lane: float
    """Distance between neighbouring lanes [m]."""
    loads: tuple[Load, ...]
    """Blocks by lane, from the left."""
    start: float
    """Time at which the tilt starts [s]."""
    rate: float
    """Rate of the tilt [rad/s]."""

    @cached_property
    def lip(self) -> Vec3:
        """Middle of the lip [m]."""
        return self.foot + self.incline.lip * UP

    def spot(self, lane: int) -> Vec3:
        """Place of the block of a lane at the start [m]."""
        along = (len(self.loads) // 2 - lane) * self.lane
        return self.foot + self.incline.on_slab(self.loads[lane].away, along)

    def under(self, place: Vec3) -> bool:
        """Whether a place is over the incline, not before its lip [m]."""
        x, _, z = place - self.lip
        return bool(x > 0.0 and z > 0.0)

    # --- mechanics ------------------------------------------------------------------------

    @cached_property
    def sequence(self) -> tuple[int, ...]:
        """Lanes in the order in which their blocks slide."""
        return tuple(sorted(range(len(self.loads)), key=lambda lane: self.loads[lane].friction))

    @cached_property
    def end(self) -> float:
        """Time at which the incline is at its largest angle [s]."""
        return self.start + self.incline.turns / self.rate

    def turned(self, time: float) -> float:
        """Angle of the hinge that is commanded at a time [rad]."""
        return min(self.rate * max(0.0, time - self.start), self.incline.turns)

    def slips(self, lane: int, error: float = 0.0) -> float:
        """Slope at which the block of a lane starts to slide [rad], its friction being larger by a share `error`."""
        return slip_angle(self.loads[lane].friction * (1.0 + error))

    def slide_start(self, lane: int, error: float = 0.0) -> float:
        """Time at which it starts to slide [s]."""
        return self.start + (self.slips(lane, error) - math.radians(self.incline.least)) / self.rate

    def slide_time(self, lane: int, way: float) -> float:
        """Time that it takes to slide a distance [s]."""
        return TIPPING_SHARE * (way / slid(self.loads[lane].friction, self.rate, 1.0)[0]) ** (1 / 3)

    def lip_time(self, lane: int, error: float = 0.0) -> float:
        """Time at which its middle is over the lip [s]."""
        return self.slide_start(lane, error) + self.slide_time(lane, self.loads[lane].away)

    def time_between(self, one: int, other: int, error: float) -> float:
        """Least time from one block over the lip to another one [s], both frictions being off by a share `error`."""
        return self.lip_time(other, -error) - self.lip_time(one, error)

    def time_left(self, lane: int, way: float) -> float:
        """Time from when the block of a lane has slid some way [m] until its middle is over the lip [s]."""
        return self.slide_time(lane, self.loads[lane].away) - self.slide_time(lane, way)


def driven(scene: mujoco.MjSpec, name: str) -> str:
    """Add the servo of an incline to a scene.

    Returns:
        Name of the joint that events drive.
    """
    hinge = f"{name}/hinge"
    servo(scene, hinge, STIFFNESS)
    return hinge


if __name__ == "__main__":
    show(Incline())

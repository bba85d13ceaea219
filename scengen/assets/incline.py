"""Incline: a slab on a hinge at its lower edge, which a servo tilts. Things on it slide down over that edge.

              ___---
        ___---              seen from the side; the lower edge, the lip, is towards the robot
lip  o--
     | posts at both ends    x goes up the slope, the origin is on the ground below the lip
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import UP, Mat3, Vec3, about_y, quat
from ..params import param
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

    @property
    def turns(self) -> float:
        """Range of the hinge [rad]."""
        return math.radians(self.most - self.least)

    def axes(self, turned: float = 0.0) -> Mat3:
        """Axes of the slab, as columns: up the slope, along the lip, out of the slab.

        Args:
            turned: angle of the hinge [rad].
        """
        return about_y(-math.radians(self.least) - turned)

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

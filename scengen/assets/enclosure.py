"""Three walls from which a ball bounces back: a U that is open on one side."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from ..geometry import Vec3
from ..params import param
from ..physics import contact, reflected
from .prop import PRIORITY, Prop, Rgba, show, solid

WALL_STIFFNESS = 2e4
"""Contact stiffness of the walls per mass [1/s^2]. A bounce takes 22 ms, 11 steps of the simulation, and a ball at
0.5 m/s goes 3.5 mm into the wall. With stiffer walls the restitution depends on the time step."""
BOUNCE_TIME = math.pi / math.sqrt(WALL_STIFFNESS)
"""Duration of a bounce [s]."""
MAX_WAYS = 10
"""Largest number of straight ways that are predicted."""


@dataclass(frozen=True, kw_only=True)
class Enclosure(Prop):
    """A back wall and two side walls without friction. The origin is on the ground in the middle of the opening.

    x leads in.
    """

    width: float = param(0.52, "m", 0.1, 0.7)
    """Distance between the side walls."""
    depth: float = param(0.38, "m", 0.1, 0.7)
    """Distance from the opening to the back wall."""
    height: float = param(0.050, "m", 0.02, 0.15)
    thickness: float = param(0.020, "m", 0.01, 0.05)
    restitution: float = param(0.84, "1", 0.3, 0.95)
    """Speed of a ball after a bounce over its speed before, along the normal. Billiard cushions have 0.6 to 0.9."""
    rgba: Rgba = (0.24, 0.42, 0.36, 1.0)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        out, half = self.thickness / 2, self.height / 2
        walls = {
            "back": ([out, self.width / 2 + self.thickness, half], [self.depth + out, 0.0, half]),
            "left": ([self.depth / 2, out, half], [self.depth / 2, self.width / 2 + out, half]),
            "right": ([self.depth / 2, out, half], [self.depth / 2, -self.width / 2 - out, half]),
        }
        bouncy = contact(self.restitution, WALL_STIFFNESS)
        for name, (size, pos) in walls.items():
            wall = {"friction": 0.0, "condim": 1, "solref": bouncy, "priority": PRIORITY + 1, "rgba": self.rgba}
            solid(body, name, size, pos, **wall)

    @property
    def size(self) -> tuple[float, float]:
        """Lengths of its outline on the ground along x and y [m]. The middle of the outline is at x = `depth` / 2."""
        return self.depth + self.thickness, self.width + 2 * self.thickness

    # --- mechanics ------------------------------------------------------------------------

    def ways(self, at: Vec3, velocity: Vec3, radius: float, restitution: float | None = None) -> list["Way"]:
        """The straight ways of a ball that slides without friction, from now on; the last one has no end.

        Args:
            at: position of the ball in the axes of the enclosure [m].
            velocity: velocity of the ball in these axes [m/s].
            radius: radius of the ball [m].
            restitution: another restitution of the walls, such as 1 for mirror images.
        """
        found, seconds = [], 0.0
        while len(found) < MAX_WAYS:
            found.append(Way(seconds, at, velocity))
            if (hit := self._hit(at, velocity, radius)) is None:
                break
            normal, wait = hit
            at, seconds = at + wait * velocity, seconds + wait
            velocity = reflected(velocity, normal, self.restitution if restitution is None else restitution)
        return found

    def _hit(self, at: Vec3, velocity: Vec3, radius: float) -> tuple[Vec3, float] | None:
        """Inward normal of the first wall that the ball hits, and time until then [s]."""
        found = []
        if velocity[0] > 0.0:
            found.append((np.array([-1.0, 0.0, 0.0]), (self.depth - radius - at[0]) / velocity[0]))
        if velocity[1] != 0.0:
            side = math.copysign(1.0, velocity[1])
            wait = (self.width / 2 - radius - side * at[1]) / abs(velocity[1])
            if at[0] + wait * velocity[0] > 0.0:
                found.append((np.array([0.0, -side, 0.0]), wait))
        found = [(normal, wait) for normal, wait in found if wait > 1e-9]
        return min(found, key=lambda hit: hit[1]) if found else None


class Way(NamedTuple):
    """A straight way of a ball between two bounces."""

    begins: float
    """Time at which it begins [s]."""
    at: Vec3
    """Position at which it begins [m]."""
    velocity: Vec3
    """Velocity of the ball on it [m/s]."""


if __name__ == "__main__":
    show(Enclosure())

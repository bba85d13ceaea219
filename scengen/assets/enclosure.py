"""Three walls from which a ball bounces back: a U that is open on one side."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import mujoco
import numpy as np

from ..geometry import Outline, Vec3, about_z, corners
from ..params import param
from ..physics import GRAVITY, SPIN, as_if_rolling, contact, reflected
from .prop import PRIORITY, TABLE_TOP, Prop, Rgba, show, solid

WALL_STIFFNESS = 2e4
"""Contact stiffness of the walls per mass [1/s^2]. A bounce takes 22 ms, 11 steps of the simulation, and a ball at
0.5 m/s goes 3.5 mm into the wall. With stiffer walls the restitution depends on the time step."""
BOUNCE_TIME = math.pi / math.sqrt(WALL_STIFFNESS)
"""Duration of a bounce [s]."""
MAT_SIZE = (0.39, 0.39, 0.002)
"""Half length, half width and height of the mat [m]."""
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

    @cached_property
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


def lay_mat(scene: mujoco.MjSpec, friction: float) -> None:
    """Cover the table with a mat, on which a ball slides without turning if its friction is 0, and else rolls."""
    mat = scene.worldbody.add_body(name="mat", pos=[0.0, 0.0, TABLE_TOP + MAT_SIZE[2] / 2])
    size = [MAT_SIZE[0], MAT_SIZE[1], MAT_SIZE[2] / 2]
    smooth = {"friction": friction, "condim": 3 if friction else 1, "priority": PRIORITY + 1}
    solid(mat, "mat", size, rgba=(0.30, 0.33, 0.38, 1.0), **smooth)


class Way(NamedTuple):
    """A straight way of a ball between two bounces."""

    starts: float
    """Time at which it starts [s]."""
    at: Vec3
    """Position at which it starts [m]."""
    velocity: Vec3
    """Velocity of the ball on it [m/s]."""


@dataclass(frozen=True)
class PlacedEnclosure:
    """An enclosure at its place in the world."""

    enclosure: Enclosure
    mouth: Vec3
    """Position of the middle of the opening [m]."""
    yaw: float
    """Direction that leads in [rad]."""

    @classmethod
    def about(cls, enclosure: Enclosure, middle: Vec3, yaw: float) -> Self:
        """An enclosure around a place [m], open against the direction `yaw` [rad]."""
        return cls(enclosure, middle - enclosure.depth / 2 * about_z(yaw)[:, 0], yaw)

    @cached_property
    def outline(self) -> Outline:
        """Outline of the enclosure, seen from above."""
        middle = self.mouth + self.enclosure.depth / 2 * about_z(self.yaw)[:, 0]
        return corners(middle, self.yaw, self.enclosure.size)

    def inside(self, at: Vec3) -> Vec3:
        """A place in the axes of the enclosure [m]."""
        return about_z(self.yaw).T @ (at - self.mouth)

    def wall_distance(self, at: Vec3) -> float:
        """Distance of a place from the nearest wall [m]."""
        (along, across, _), wall = self.inside(at), self.enclosure
        beside = math.hypot(max(0.0, -along), wall.width / 2 - abs(across))
        return min(beside, wall.depth - along)

    def end_distance(self, way: Way) -> float:
        """Distance from the ends of the side walls at which a way enters [m]; inf if it does not."""
        at, velocity = self.inside(way.at), about_z(self.yaw).T @ way.velocity
        if at[0] >= 0.0 or velocity[0] <= 0.0:
            return math.inf
        return self.enclosure.width / 2 - abs(float(at[1] - at[0] / velocity[0] * velocity[1]))

    def ways(
        self,
        at: Vec3,
        velocity: Vec3,
        surface: Vec3,
        radius: float,
        friction: float = 0.0,
        restitution: float | None = None,
    ) -> list[Way]:
        """The ways of a ball from a state on, in the world; curved ones as if the ball rolled from their start.

        Args:
            at: place of the ball [m].
            velocity: level velocity of the ball [m/s].
            surface: velocity of its surface about its centre [m/s]: `velocity` if it rolls, 0 if it does not turn.
            radius: radius of the ball [m].
            friction: friction between ball and floor.
            restitution: another restitution of the walls, such as 1 for mirror images.
        """
        axes, found, starts = about_z(self.yaw), [], 0.0
        while True:
            if friction:
                at, velocity, surface = as_if_rolling(at, velocity, surface, friction)
            ways = self.enclosure.ways(axes.T @ (at - self.mouth), axes.T @ velocity, radius, restitution)
            ways = [Way(starts + w.starts, self.mouth + axes @ w.at, axes @ w.velocity) for w in ways]
            if not friction or len(ways) == 1:
                return found + ways
            found.append(ways[0])
            starts, at, velocity = ways[1]
            surface = _spin_after_bounce(velocity, surface, friction)


def _spin_after_bounce(velocity: Vec3, surface: Vec3, friction: float) -> Vec3:
    """Velocity of the surface after a bounce [m/s]: the wall is smooth, but the floor brakes it meanwhile."""
    slip = velocity - surface
    speed = math.sqrt(slip @ slip)
    return surface + min(1.0, friction * GRAVITY * BOUNCE_TIME / (SPIN * max(speed, 1e-9))) * slip


if __name__ == "__main__":
    show(Enclosure())

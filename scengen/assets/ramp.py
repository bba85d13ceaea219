"""Galileo's ramp: two equal inclines that face each other, joined by a round valley, with a goal patch on one of them.

    near                    far
     \\                     //      s < 0 on the near incline, s > 0 on the far one; s = 0 in the middle of the
      \\                   //       valley. A ball let go at the one side climbs the other one, as high as it
       \\__             __//  patch came from if nothing is lost.
          ``--.......--``

The paper's asset (App. C: "Galileo ramp, parametric angle 10 to 60 deg, mu in [0.10, 0.50]"); its task T14 calls the
ramp frictionless, so that friction may go down to 0 here.

Losses. A ball that rolls into a sharp V is stopped by half its speed at once: there a height of release says nothing
about the height on the other side. So the valley is an arc, of flat facets of 1 deg, because a convex geom cannot be
hollow. The facets are tangents of the arc and may overlap, as each continues below the surface of its neighbours: no
seam stands out. What a facet takes is the normal part of the speed, as far as the contact is inelastic, and a soft
contact touches several facets at once and is braked by those ahead. With the time constant and damping of the other
props (0.005 s, critical) that is 4 to 9 % of the height per pass, and a fifth more at half the time step. Steel on
steel is elastic; with `FLOOR_SOLREF` it is 0.5 to 2 % for a ball that slides, and half a time step shifts it by 0.1 %.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import Vec3, about_y, quat
from ..params import param
from ..physics import GRAVITY
from .prop import PRIORITY, Prop, Rgba, show, solid

FLOOR_SOLREF = (-2e5, -50.0)
"""Contact stiffness [1/s^2] and damping [1/s] of the floor, per mass. Natural frequency sqrt(2e5) = 447 /s, 3.5 time
steps of 2 ms to half an oscillation; damping ratio 50 / (2 * 447) = 0.06: a bounce returns 84 % of the speed."""
CONTACT_PRIORITY = PRIORITY + 1
"""Contact priority. The friction of the floor is the floor's own, whatever lies on it: the ball must be slippery here
and firm between the fingers."""
FACET_ANGLE = math.radians(1.0)
"""Angle between neighbouring facets of the valley [rad]. Scatter of the loss between radii and heights, angles of 12 to
40 deg: 0.4 to 2.1 % with facets of 1 deg, 0.3 to 2.6 % with 3 deg, which run three times as fast."""
FLOOR_THICKNESS = 0.012
"""Thickness of the floor, and height of its lowest point above the table [m]."""
WALL_RISE = 0.015
"""How far the side walls rise above the floor [m]: most of a ball's radius, far below the palm of the hand."""
WALL_THICKNESS = 0.005
"""Thickness of the side walls [m]."""
HEIGHT_LOSSES = (0.0030, 0.0058)
"""What the valley's facets take of the height per pass, per radian of slope and 1/m of curvature [m]: from a ball that
slides and from one that rolls. Fitted to 200 and 60 runs at 12 to 40 deg, bends of 80 to 140 mm: what is left is
0.14 mm and 0.5 mm (standard deviation), 0.6 mm and 1.3 mm at most."""
CLIMB_STEP = 0.001
"""Time step of `climb` [s]."""

FLOOR_COLOUR = (0.62, 0.60, 0.57, 1.0)
GOAL_COLOUR = (0.20, 0.70, 0.30, 1.0)
WALL_COLOUR = (0.55, 0.70, 0.80, 0.35)


@dataclass(frozen=True, kw_only=True)
class Ramp(Prop):
    """The whole ramp. x points from the near side to the far one; the origin is on the table, below the valley.

    Points and directions are in its axes: x along the ramp, y across, z up from the table [m].
    """

    angle: float = param(24.0, "deg", 10.0, 60.0)
    """Slope of both inclines."""
    friction: float = param(0.0, "1", 0.0, 0.5)
    """Of the whole floor, against anything that lies on it."""
    span: float = param(0.52, "m", 0.2, 0.76)
    """Length along the table, from the one top to the other."""
    bend: float = param(0.12, "m", 0.04, 0.3)
    """Radius of the valley."""
    width: float = param(0.15, "m", 0.03, 0.3)
    """Distance between the side walls. An open jaw is 0.13 m wide with its fingers."""
    level: float = param(0.6, "ramp heights", 0.0, 1.0)
    """Height of the patch's middle above the valley, relative to the top of the ramp."""
    band: float = param(0.003, "m", 0.002, 0.05)
    """How much higher the patch's upper edge lies than its lower edge."""

    # --- geometry of the floor, by the distance s from the middle of the valley -----------

    @property
    def slope(self) -> float:
        """Slope of the inclines [rad]."""
        return math.radians(self.angle)

    @property
    def foot(self) -> float:
        """Where the far incline begins: half the length of the arc [m]."""
        return self.bend * self.slope

    @property
    def top(self) -> float:
        """Where the far incline ends [m]."""
        return self.foot + (self.span / 2 - self.bend * math.sin(self.slope)) / math.cos(self.slope)

    def height(self, s: float) -> float:
        """Height of the floor above the middle of the valley [m]."""
        arc = min(abs(s), self.foot)
        return self.bend * (1 - math.cos(arc / self.bend)) + (abs(s) - arc) * math.sin(self.slope)

    def at_height(self, height: float) -> float:
        """Where on the far side the floor is that high [m]: 0 below the valley, and as if the incline were endless."""
        foot = self.height(self.foot)
        if height < foot:
            return self.bend * math.acos(1.0 - max(0.0, height) / self.bend)
        return self.foot + (height - foot) / math.sin(self.slope)

    @property
    def goal(self) -> float:
        """Height of the patch's middle above the middle of the valley [m]."""
        return self.level * self.height(self.top)

    @property
    def patch(self) -> tuple[float, float]:
        """Lower and upper edge of the patch [m]."""
        return self.at_height(self.goal - self.band / 2), self.at_height(self.goal + self.band / 2)

    def tilt(self, s: float) -> float:
        """Slope of the floor, negative on the near side [rad]."""
        return max(-self.foot, min(self.foot, s)) / self.bend

    def normal(self, s: float) -> Vec3:
        """Unit vector out of the floor."""
        return np.array([-math.sin(self.tilt(s)), 0.0, math.cos(self.tilt(s))])

    def floor(self, s: float) -> Vec3:
        """A point on the middle line of the floor."""
        arc = max(-self.foot, min(self.foot, s))
        x = self.bend * math.sin(arc / self.bend) + (s - arc) * math.cos(self.slope)
        return np.array([x, 0.0, FLOOR_THICKNESS + self.height(s)])

    def below(self, x: float) -> float:
        """Where on the floor a point is that is `x` along the ramp, level, from the middle of the valley [m]."""
        level = self.bend * math.sin(self.slope)
        if abs(x) <= level:
            return self.bend * math.asin(x / self.bend)
        return math.copysign(self.foot + (abs(x) - level) / math.cos(self.slope), x)

    def part(self, s: float) -> str:
        """The part of the floor at s, by the name of its body."""
        low, high = self.patch
        for name, end in (("near", -self.foot), ("valley", self.foot), ("far", low), ("patch", high)):
            if s < end:
                return name
        return "beyond"

    # --- motion of a ball -----------------------------------------------------------------

    @property
    def arrival(self) -> float:
        """Highest speed at the patch's lower edge with which a sliding ball turns back on the patch [m/s]."""
        return math.sqrt(2 * GRAVITY * self.band)

    @property
    def rolls(self) -> bool:
        """Whether a solid ball rolls on the inclines without slipping: mu > 2/7 tan(slope)."""
        return self.friction > 2.0 / 7.0 * math.tan(self.slope)

    def climb(self, start: float, radius: float) -> float:
        """Height of the floor [m] where a ball turns back on the far side, let go on the near side at `start` < 0 [m].

        Newton's law for the centre, and for the spin of a solid ball (2/5 m r^2), with Coulomb friction that acts
        until the ball rolls; the valley presses with v^2 / (bend - radius) in addition. The far incline is taken as
        endless. Without friction, and where the ball rolls all along, that gives the height of the start.
        """
        foot, bend, within = self.foot, self.bend, self.bend - radius
        s, speed, spin = start, 0.0, 0.0
        while s < 0.0 or speed > 0.0:
            tilt = max(-foot, min(foot, s)) / bend  # `self.tilt(s)`, which would work out the foot thousands of times
            inside = abs(s) < foot
            pull = GRAVITY * math.sin(tilt)
            press = GRAVITY * math.cos(tilt) + (speed**2 / within if inside else 0.0)
            rolling = (pull - (speed - spin) / CLIMB_STEP) / 3.5
            rub = max(-self.friction * press, min(self.friction * press, rolling))
            speed += CLIMB_STEP * (rub - pull)
            spin -= CLIMB_STEP * 2.5 * rub
            s += CLIMB_STEP * speed * (bend / within if inside else 1.0)
        return self.height(s) - HEIGHT_LOSSES[self.rolls] * self.slope / self.bend * self.height(start)

    def release(self, radius: float) -> float:
        """Height of the floor [m] on the near side from which a ball turns back in the middle of the patch.

        Raises nothing: a height above the top of the ramp is an answer too.
        """
        goal = self.goal
        low, high = goal, 4.0 * goal
        while high - low > 1e-4:
            middle = (low + high) / 2
            enough = self.climb(-self.at_height(middle), radius) >= goal
            low, high = (low, middle) if enough else (middle, high)
        return (low + high) / 2

    # --- scene ----------------------------------------------------------------------------

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        for name, rgba, stretches in self._floors():
            part = body.add_body(name=name)
            for i, (start, end) in enumerate(stretches):
                self._slab(part, f"{name}_{i}", start, end, rgba)
        for side in (-1, 1):
            self._walls(body, side)

    def lay_down(self, patch: mujoco.MjsBody) -> None:
        """Put the patch, which has lost its support, flat below its place, flush with the ground."""
        middle = self.floor(self.at_height(self.goal))
        patch.quat = np.array(quat("y", self.slope))
        patch.pos = np.array([middle[0], 0.0, 0.0]) - about_y(self.slope) @ middle

    def _floors(self) -> Iterator[tuple[str, Rgba, list[tuple[Vec3, Vec3]]]]:
        """Name, colour and stretches of each part of the floor: the ends of every slab's surface."""
        low, high = self.patch
        facets = max(2, math.ceil(2 * self.slope / FACET_ANGLE))
        turn = 2 * self.slope / facets
        half = self.bend * math.tan(turn / 2) + WALL_THICKNESS
        middles = [self.bend * (-self.slope + i * turn) for i in range(1, facets)]
        yield "near", FLOOR_COLOUR, [(self.floor(-self.top), self._along(-self.foot, half))]
        yield "valley", FLOOR_COLOUR, [(self._along(s, -half), self._along(s, half)) for s in middles]
        yield "far", FLOOR_COLOUR, [(self._along(self.foot, -half), self.floor(low))]
        yield "patch", GOAL_COLOUR, [(self.floor(low), self.floor(high))]
        yield "beyond", FLOOR_COLOUR, [(self.floor(high), self.floor(self.top))]

    def _along(self, s: float, further: float) -> Vec3:
        """A point on the tangent of the floor at s."""
        tilt = self.tilt(s)
        return self.floor(s) + further * np.array([math.cos(tilt), 0.0, math.sin(tilt)])

    def _slab(self, body: mujoco.MjsBody, name: str, start: Vec3, end: Vec3, rgba: Rgba) -> None:
        """A slab whose upper side runs from `start` to `end`."""
        run = end - start
        tilt = math.atan2(run[2], run[0])
        down = FLOOR_THICKNESS / 2 * np.array([math.sin(tilt), 0.0, -math.cos(tilt)])
        size = [float(np.linalg.norm(run)) / 2, self.width / 2, FLOOR_THICKNESS / 2]
        self._board(body, name, (start + end) / 2 + down, size, tilt, rgba)

    def _walls(self, body: mujoco.MjsBody, side: int) -> None:
        """A side wall along each incline and across the valley, and a post under each top."""
        y = side * (self.width + WALL_THICKNESS) / 2
        shift, tall = np.array([0.0, y, 0.0]), (FLOOR_THICKNESS + WALL_RISE) / 2
        for end in (-1, 1):
            foot, top, up = self.floor(end * self.foot), self.floor(end * self.top), self.normal(end * self.top)
            middle = (foot + top) / 2 + (WALL_RISE - tall) * up + shift
            size = [float(np.linalg.norm(top - foot)) / 2, WALL_THICKNESS / 2, tall]
            self._board(body, f"wall_{side}_{end}", middle, size, end * self.slope, WALL_COLOUR)
            post = np.array([end * (self.span / 2 - WALL_THICKNESS), y, top[2] / 2])
            self._board(
                body, f"post_{side}_{end}", post, [WALL_THICKNESS, WALL_THICKNESS / 2, top[2] / 2], 0.0, FLOOR_COLOUR
            )
        foot = self.floor(self.foot)
        middle = np.array([0.0, y, (foot[2] + WALL_RISE) / 2])
        self._board(
            body,
            f"wall_{side}_0",
            middle,
            [foot[0] + WALL_THICKNESS, WALL_THICKNESS / 2, (foot[2] + WALL_RISE) / 2],
            0.0,
            WALL_COLOUR,
        )

    def _board(self, body: mujoco.MjsBody, name: str, pos: Vec3, size: list[float], tilt: float, rgba: Rgba) -> None:
        solid(
            body,
            name,
            size,
            pos,
            quat=quat("y", -tilt),
            friction=self.friction,
            mass=0.1,
            rgba=rgba,
            condim=3,
            solref=FLOOR_SOLREF,
            priority=CONTACT_PRIORITY,
        )


if __name__ == "__main__":
    show(Ramp())

"""Galileo's ramp: two equal inclines that face each other, joined by a round valley, with a goal patch on one of them.

    near                    far
     \\                     //      s < 0 on the near incline, s > 0 on the far one; s = 0 in the middle of the
      \\                   //       valley. A ball released on one side climbs the other one, to the height of
       \\__             __//  patch its release if there are no losses.
          ``--.......--``

The paper's asset (App. C: "Galileo ramp, parametric angle 10 to 60 deg, mu in [0.10, 0.50]"). Its task T14 calls the
ramp frictionless, so the friction may be as low as 0 here.

Losses. A ball that rolls into a sharp V loses half its speed at once, and its height of release does not determine the
height on the other side. So the valley is an arc, made of flat facets of 1 deg, because a convex geom cannot be hollow.
The facets are tangents of the arc and may overlap, as each continues below the surface of its neighbours: no seam
protrudes. A facet takes the normal part of the speed, as far as the contact is inelastic; and a soft contact touches
several facets at once, and those ahead slow the ball down. With the time constant and damping of the other props
(0.005 s, critical) the loss is 4 to 9 % of the height per pass, and a fifth more at half the time step. Steel on steel
is elastic: with `FLOOR_SOLREF` the loss is 0.5 to 2 % for a ball that slides, and changes by 0.1 % at half the time
step.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import Vec3, about_y, quat
from ..params import param
from ..physics import GRAVITY
from .prop import PRIORITY, Prop, Rgba, show, solid

FLOOR_SOLREF = (-2e5, -50.0)
"""Contact stiffness [1/s^2] and damping [1/s] of the floor, per mass. The natural frequency is sqrt(2e5) = 447 /s, with
3.5 time steps of 2 ms in half an oscillation. The damping ratio is 50 / (2 * 447) = 0.06: a bounce returns 84 % of the
speed."""
CONTACT_PRIORITY = PRIORITY + 1
"""Contact priority of the ramp. Only the friction of the floor counts, not that of the ball: the ball must be slippery
here and firm between the fingers."""
FACET_ANGLE = math.radians(1.0)
"""Angle between neighbouring facets of the valley [rad]. Over radii, heights and angles of 12 to 40 deg the loss
scatters between 0.4 and 2.1 % with facets of 1 deg, and between 0.3 and 2.6 % with 3 deg, which run three times as
fast."""
FLOOR_THICKNESS = 0.012
"""Thickness of the floor, and height of its lowest point above the table [m]."""
WALL_RISE = 0.015
"""Height of the side walls above the floor [m]: most of a ball's radius, far below the palm of the hand."""
WALL_THICKNESS = 0.005
"""Thickness of the side walls [m]."""
HEIGHT_LOSSES = (0.0030, 0.0058)
"""Share of the height that a ball loses at the valley's facets per pass, per radian of slope and 1/m of curvature [m]:
for a ball that slides and for one that rolls. Fitted to 200 and 60 runs at 12 to 40 deg, bends of 80 to 140 mm. The
residuals are 0.14 mm and 0.5 mm (standard deviation), 0.6 mm and 1.3 mm at most."""
CLIMB_STEP = 0.001
"""Time step of `climb` [s]."""

FLOOR_COLOUR = (0.62, 0.60, 0.57, 1.0)
"""Colour of the floor and the posts."""
GOAL_COLOUR = (0.20, 0.70, 0.30, 1.0)
"""Colour of the goal patch."""
WALL_COLOUR = (0.55, 0.70, 0.80, 0.35)
"""Colour of the side walls, which look like glass."""


@dataclass(frozen=True, kw_only=True)
class Ramp(Prop):
    """The whole ramp. x points from the near side to the far one; the origin is on the table, below the valley.

    Points and directions are in the axes of the ramp: x along it, y across, z up from the table [m].
    """

    angle: float = param(24.0, "deg", 10.0, 60.0)
    """Slope of both inclines."""
    friction: float = param(0.0, "1", 0.0, 0.5)
    """Sliding friction of the whole floor against all things on it."""
    span: float = param(0.52, "m", 0.2, 0.76)
    """Horizontal length from one top to the other."""
    bend: float = param(0.12, "m", 0.04, 0.3)
    """Radius of the valley."""
    width: float = param(0.15, "m", 0.03, 0.3)
    """Distance between the side walls. An open jaw is 0.13 m wide with its fingers."""
    level: float = param(0.6, "ramp heights", 0.0, 1.0)
    """Height of the patch's middle above the valley, relative to the top of the ramp."""
    band: float = param(0.003, "m", 0.002, 0.05)
    """Difference in height between the patch's upper and lower edge."""

    # --- geometry of the floor, by the distance s from the middle of the valley -----------

    @cached_property
    def slope(self) -> float:
        """Slope of the inclines [rad]."""
        return math.radians(self.angle)

    @cached_property
    def foot(self) -> float:
        """Position s at which the far incline starts: half the length of the arc [m]."""
        return self.bend * self.slope

    @cached_property
    def top(self) -> float:
        """Position s at which the far incline ends [m]."""
        return self.foot + (self.span / 2 - self.bend * math.sin(self.slope)) / math.cos(self.slope)

    def height(self, s: float) -> float:
        """Height of the floor above the middle of the valley [m]."""
        arc = min(abs(s), self.foot)
        return self.bend * (1 - math.cos(arc / self.bend)) + (abs(s) - arc) * math.sin(self.slope)

    def at_height(self, height: float) -> float:
        """Position s on the far side where the floor has a height [m]; 0 below the valley. The incline is endless."""
        foot = self.height(self.foot)
        if height < foot:
            return self.bend * math.acos(1.0 - max(0.0, height) / self.bend)
        return self.foot + (height - foot) / math.sin(self.slope)

    @cached_property
    def goal(self) -> float:
        """Height of the patch's middle above the middle of the valley [m]."""
        return self.level * self.height(self.top)

    @cached_property
    def patch(self) -> tuple[float, float]:
        """Positions s of the lower and upper edge of the patch [m]."""
        return self.at_height(self.goal - self.band / 2), self.at_height(self.goal + self.band / 2)

    def tilt(self, s: float) -> float:
        """Slope of the floor at s, negative on the near side [rad]."""
        return max(-self.foot, min(self.foot, s)) / self.bend

    def normal(self, s: float) -> Vec3:
        """Unit normal of the floor at s, upwards."""
        return np.array([-math.sin(self.tilt(s)), 0.0, math.cos(self.tilt(s))])

    def floor(self, s: float) -> Vec3:
        """Point on the middle line of the floor at s."""
        arc = max(-self.foot, min(self.foot, s))
        x = self.bend * math.sin(arc / self.bend) + (s - arc) * math.cos(self.slope)
        return np.array([x, 0.0, FLOOR_THICKNESS + self.height(s)])

    def below(self, x: float) -> float:
        """Position s of the point of the floor at horizontal distance `x` from the middle of the valley [m]."""
        level = self.bend * math.sin(self.slope)
        if abs(x) <= level:
            return self.bend * math.asin(x / self.bend)
        return math.copysign(self.foot + (abs(x) - level) / math.cos(self.slope), x)

    def part(self, s: float) -> str:
        """Name of the body of the part of the floor at s."""
        low, high = self.patch
        for name, end in (("near", -self.foot), ("valley", self.foot), ("far", low), ("patch", high)):
            if s < end:
                return name
        return "beyond"

    # --- motion of a ball -----------------------------------------------------------------

    @cached_property
    def arrival(self) -> float:
        """Highest speed at the patch's lower edge at which a sliding ball still turns back on the patch [m/s]."""
        return math.sqrt(2 * GRAVITY * self.band)

    @cached_property
    def rolls(self) -> bool:
        """Whether a solid ball rolls on the inclines without slipping: mu > 2/7 tan(slope)."""
        return self.friction > 2.0 / 7.0 * math.tan(self.slope)

    def climb(self, start: float, radius: float) -> float:
        """Height of the floor where a ball turns back on the far side, released on the near side at `start` < 0 [m].

        Newton's law for the centre, and for the spin of a solid ball (2/5 m r^2), with Coulomb friction that acts
        until the ball rolls. The valley adds v^2 / (bend - radius) to the normal acceleration. The far incline counts
        as endless. Without friction, and if the ball rolls all the way, the result is the height of the start, less
        the losses at the facets.
        """
        foot, bend, within = self.foot, self.bend, self.bend - radius
        s, speed, spin = start, 0.0, 0.0
        while s < 0.0 or speed > 0.0:
            tilt = max(-foot, min(foot, s)) / bend  # `self.tilt(s)` would compute the foot thousands of times
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
        """Height of the floor on the near side from which a ball turns back in the middle of the patch [m].

        The result may be above the top of the ramp.
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
        for name, rgba, slabs in self._floor_parts():
            part = body.add_body(name=name)
            for i, (start, end) in enumerate(slabs):
                self._add_slab(part, f"{name}_{i}", start, end, rgba)
        for side in (-1, 1):
            self._add_walls(body, side)

    def lay_down(self, patch: mujoco.MjsBody) -> None:
        """Lay the patch, which has lost its support, flat below its place, flush with the ground."""
        middle = self.floor(self.at_height(self.goal))
        patch.quat = np.array(quat("y", self.slope))
        patch.pos = np.array([middle[0], 0.0, 0.0]) - about_y(self.slope) @ middle

    def _floor_parts(self) -> Iterator[tuple[str, Rgba, list[tuple[Vec3, Vec3]]]]:
        """Name, colour and slabs of each part of the floor; of each slab both ends of its surface."""
        low, high = self.patch
        facets = max(2, math.ceil(2 * self.slope / FACET_ANGLE))
        turn = 2 * self.slope / facets
        half = self.bend * math.tan(turn / 2) + WALL_THICKNESS
        middles = [self.bend * (-self.slope + i * turn) for i in range(1, facets)]
        yield "near", FLOOR_COLOUR, [(self.floor(-self.top), self._on_tangent(-self.foot, half))]
        yield "valley", FLOOR_COLOUR, [(self._on_tangent(s, -half), self._on_tangent(s, half)) for s in middles]
        yield "far", FLOOR_COLOUR, [(self._on_tangent(self.foot, -half), self.floor(low))]
        yield "patch", GOAL_COLOUR, [(self.floor(low), self.floor(high))]
        yield "beyond", FLOOR_COLOUR, [(self.floor(high), self.floor(self.top))]

    def _on_tangent(self, s: float, further: float) -> Vec3:
        """Point on the tangent of the floor at s, `further` along it [m]."""
        tilt = self.tilt(s)
        return self.floor(s) + further * np.array([math.cos(tilt), 0.0, math.sin(tilt)])

    def _add_slab(self, body: mujoco.MjsBody, name: str, start: Vec3, end: Vec3, rgba: Rgba) -> None:
        """Add a slab whose upper side runs from `start` to `end`."""
        run = end - start
        tilt = math.atan2(run[2], run[0])
        down = FLOOR_THICKNESS / 2 * np.array([math.sin(tilt), 0.0, -math.cos(tilt)])
        size = [float(np.linalg.norm(run)) / 2, self.width / 2, FLOOR_THICKNESS / 2]
        self._add_board(body, name, (start + end) / 2 + down, size, tilt, rgba)

    def _add_walls(self, body: mujoco.MjsBody, side: int) -> None:
        """Add a side wall along each incline and across the valley, and a post under each top."""
        y = side * (self.width + WALL_THICKNESS) / 2
        shift, tall = np.array([0.0, y, 0.0]), (FLOOR_THICKNESS + WALL_RISE) / 2
        for end in (-1, 1):
            foot, top, up = self.floor(end * self.foot), self.floor(end * self.top), self.normal(end * self.top)
            middle = (foot + top) / 2 + (WALL_RISE - tall) * up + shift
            size = [float(np.linalg.norm(top - foot)) / 2, WALL_THICKNESS / 2, tall]
            self._add_board(body, f"wall_{side}_{end}", middle, size, end * self.slope, WALL_COLOUR)
            post = np.array([end * (self.span / 2 - WALL_THICKNESS), y, top[2] / 2])
            self._add_board(
                body, f"post_{side}_{end}", post, [WALL_THICKNESS, WALL_THICKNESS / 2, top[2] / 2], 0.0, FLOOR_COLOUR
            )
        foot = self.floor(self.foot)
        middle = np.array([0.0, y, (foot[2] + WALL_RISE) / 2])
        self._add_board(
            body,
            f"wall_{side}_0",
            middle,
            [foot[0] + WALL_THICKNESS, WALL_THICKNESS / 2, (foot[2] + WALL_RISE) / 2],
            0.0,
            WALL_COLOUR,
        )

    def _add_board(
        self, body: mujoco.MjsBody, name: str, pos: Vec3, size: list[float], tilt: float, rgba: Rgba
    ) -> None:
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

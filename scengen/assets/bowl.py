"""Bowls: a spherical shell on a flat foot, with a bead along the rim as a grip."""

import math
from dataclasses import dataclass
from functools import cached_property

import mujoco

from ..geometry import UP, Mat3, Vec3
from ..params import param
from .prop import Rgba, show, solid
from .turned import FOOT_PROTRUSION, MIN_DETAIL, Section, Turned

SHELL_BANDS = 6
"""Number of cones that replace the shell. They are tangents of the inner sphere and chords of the outer one, which
removes 0.25 mm of 3 mm."""
BEAD_HEIGHT = 0.012
"""Height of the bead [m]."""


@dataclass(frozen=True, kw_only=True)
class Bowl(Turned):
    """A bowl with a foot that is flush with the shell, so that there is no ring to grip. The origin is below the foot.

    Suction cups hold only the flat of the foot, inside or outside: on a sphere of 77 mm the edge of a flat lip 27 mm
    wide is 1.2 mm away from the surface.

    Radius: paper, App. C ("2 sizes", no lengths): 0.065 and 0.080 m are a cereal and a soup bowl.
    """

    radius: float = param(0.075, "m", 0.060, 0.095)
    """Outer radius at the rim."""
    depth: float = param(0.055, "m", 0.035, 0.060)
    """Height of the rim above the ground."""
    foot: float = param(0.028, "m", 0.015, 0.045)
    """Radius of the flat underside."""
    wall: float = param(0.003, "m", 0.002, 0.004)
    bead: float = param(0.005, "m", 0.004, 0.008)
    """Thickness of the rim over its uppermost 12 mm; the additional thickness is on the inside."""
    hole: float = param(0.0, "m", 0.0, 0.020)
    """Radius of a round hole in the middle of the foot; 0 for no hole."""
    mass: float = param(0.050, "kg", 0.01, 0.5)
    friction: float = param(0.6, "1", 0.05, 1.5)
    rgba: Rgba = (0.36, 0.52, 0.62, 1.0)

    @cached_property
    def height(self) -> float:
        """Height of the rim above the ground [m]."""
        return self.depth

    @cached_property
    def centre(self) -> float:
        """Height of the centre of both spheres, which is equally far from the edge of the foot and from the rim [m]."""
        return ((self.radius**2 - self.foot**2) / (self.depth - FOOT_PROTRUSION) + self.depth + FOOT_PROTRUSION) / 2

    @cached_property
    def outer(self) -> float:
        """Radius of the outer sphere [m]."""
        return math.hypot(self.foot, self.centre - FOOT_PROTRUSION)

    @cached_property
    def inner(self) -> float:
        """Radius of the inner sphere [m]. Only floor and bead reach into it, no other part of the shell."""
        return self.outer - self.wall

    def dome_height(self, radius: float) -> float:
        """Height of the dome of a bowl that is upside down over its rim, at a distance from the axis [m]."""
        return self.depth - self.centre + math.sqrt(self.outer**2 - radius**2)

    @cached_property
    def bead_slope(self) -> float:
        """Angle by which the bead, at half its height, leans outwards [rad]."""
        (low, foot), (out, top) = self.sections[-1].corners[:2]
        return math.atan2(out - low, top - foot)

    def rim_distance(self, place: Vec3) -> float:
        """Distance of a place in the bowl's axes from the middle of the rim's thickness [m]."""
        x, y, z = place
        return math.hypot(math.hypot(x, y) - self.radius + self.bead / 2, z - self.depth)

    def rim_top(self, pos: Vec3, rot: Mat3) -> Vec3:
        """Uppermost point of the rim of a bowl in a pose, not upright, at half the rim's thickness [m]."""
        axis = rot[:, 2]
        up = (UP - axis[2] * axis) / math.hypot(axis[0], axis[1])
        return pos + self.depth * axis + (self.radius - self.bead / 2) * up

    @cached_property
    def floor(self) -> float:
        """Height of the floor inside [m]."""
        return self._corner(self.inner / math.cos(self._band_angle / 2), self._foot_angle)[1]

    @property
    def stance(self) -> tuple[float, float]:
        return self.foot, self.floor

    @property
    def sections(self) -> list[Section]:
        angles = [self._foot_angle + i * self._band_angle for i in range(SHELL_BANDS + 1)]
        outside = [self._corner(self.outer, a) for a in angles]
        inside = [self._corner(self.inner / math.cos(self._band_angle / 2), a) for a in angles]
        hole = min(self.hole, 0.8 * self.foot) if self.hole >= MIN_DETAIL else 0.0
        bottom = [(hole, FOOT_PROTRUSION), outside[0], inside[0], (hole, inside[0][1])]
        shell = [(outside[i], outside[i + 1], inside[i + 1], inside[i]) for i in range(SHELL_BANDS)]
        edge = [(self.radius, self.depth), (self.radius - self.bead, self.depth)]
        bead = [outside[-1], *edge, self._corner(self.outer - self.bead, angles[-1])]
        walls = [Section(f"shell_{i}", corners, leaky=True) for i, corners in enumerate(shell)]
        return [Section("bottom", tuple(bottom)), *walls, Section("bead", tuple(bead), leaky=True)]

    @cached_property
    def _foot_angle(self) -> float:
        """Angle at the centre of the spheres between the axis and the edge of the foot [rad]."""
        return math.atan2(self.foot, self.centre - FOOT_PROTRUSION)

    @cached_property
    def _band_angle(self) -> float:
        """Angle of one band [rad]: the bands divide the shell between the edge of the foot and the bead."""
        return (math.acos((self.centre - self.depth + BEAD_HEIGHT) / self.outer) - self._foot_angle) / SHELL_BANDS

    def _corner(self, distance: float, angle: float) -> tuple[float, float]:
        """Radius and height of the point at a distance [m] from the spheres' centre, at an angle from straight down."""
        return distance * math.sin(angle), self.centre - distance * math.cos(angle)


def closed(scene: mujoco.MjSpec, body: str, bowl: Bowl) -> mujoco.MjSpec:
    """A scene in which the opening of a bowl is closed with a lid without mass."""
    size, pos = [bowl.radius - bowl.bead, 0.001], [0.0, 0.0, bowl.depth - 0.001]
    solid(scene.body(body), "lid", size, pos, type=mujoco.mjtGeom.mjGEOM_CYLINDER, mass=0.0)
    return scene


if __name__ == "__main__":
    show(Bowl())

"""Solids of revolution: sections of a profile, turned about the vertical and cut into convex wedges.

        z
        |      __     A section is a convex polygon of radii and heights. Turned about the axis and cut by `SECTORS`
        |    _/ /     planes through the axis, it leaves the wedges
        |___/ _/
        |____/            { (x, y, z): (x, z) in the section, |y| <= x tan(pi / SECTORS) }.
        +---------- r
                      Only planes cut them, so that each wedge is the convex hull of its corners. A section that
                      reaches the axis is not cut: its solid of revolution is already convex.

Flat faces replace round walls and touch them from outside, in the middle of each sector. So no cavity is narrower than
nominal, and no surface protrudes by more than 1 / cos(pi / SECTORS) - 1 = 0.9 % of its radius. All sectors share the
mesh of one wedge. Mass and inertia are those of the round solid.

Such a solid stands on a ring of small spheres, its feet. MuJoCo gives two convex geoms one point of contact, and a disc
on one point rocks.
"""

import abc
import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..geometry import UP, Mat3, Vec3, heading, quat
from .prop import PRIORITY, Prop, Rgba, solid

SECTORS = 24
"""Number of wedges in a full turn."""
FOOT_COUNT = 8
"""Number of feet."""
FOOT_RADIUS = 0.001
"""Largest radius of a foot [m]. Under a thin floor it is half the thickness of the floor."""
FOOT_PROTRUSION = 0.0002
"""Height of the underside above the lowest points of the feet [m]. At a tilt of 0.2 rad the edge of the underside bears
the load instead of the feet."""
MIN_DETAIL = 1e-4
"""Size below which a detail is left out [m]."""

MESH = mujoco.mjtGeom.mjGEOM_MESH
SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE


@dataclass(frozen=True)
class Section:
    """A convex polygon of the profile."""

    name: str
    corners: tuple[tuple[float, float], ...]
    """Radius and height of each corner [m], counterclockwise with the radius to the right and the height upwards."""
    friction: float | None = None
    """Sliding friction of the surface. Default: that of the whole solid."""
    priority: int = PRIORITY
    """Priority of the contacts, see `prop.PRIORITY`."""
    leaky: bool = False
    """Whether no suction cup can hold the surface."""

    @cached_property
    def reaches_axis(self) -> bool:
        return min(radius for radius, _ in self.corners) == 0.0

    def moments(self) -> NDArray[np.float64]:
        """Integrals of r, r z, r z^2 and r^3 over the polygon [m^3, m^4, m^5, m^5].

        The polygon is a fan of triangles. On each the rule of four points is exact for polynomials of degree 3 (Strang
        and Fix).
        """
        points = np.array(self.corners)
        rule = np.array([[1 / 3, 1 / 3, 1 / 3], [0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]])
        weights = np.array([-27, 25, 25, 25]) / 48
        total = np.zeros(4)
        for second, third in itertools.pairwise(points[1:]):
            (a, b), (c, d) = second - points[0], third - points[0]
            r, z = (rule @ np.array([points[0], second, third])).T
            total += (a * d - b * c) / 2 * np.array([r, r * z, r * z**2, r**3]) @ weights
        return total

    def wedge(self) -> NDArray[np.float64]:
        """Corners of the wedge around the x axis, or of the whole solid if the section reaches the axis, (n, 3) [m]."""
        half = math.pi / SECTORS
        angles = half * (2 * np.arange(SECTORS) + 1) if self.reaches_axis else np.array([-half, half])
        rays = np.stack([np.cos(angles), np.sin(angles)], axis=1) / math.cos(half)
        return np.vstack([np.column_stack([r * rays, np.full(len(rays), z)]) for r, z in self.corners])


class Turned(Prop):
    """Base class of solids of revolution. Subclasses are dataclasses whose fields are the lengths of the profile."""

    mass: float
    friction: float
    rgba: Rgba

    @property
    @abc.abstractmethod
    def sections(self) -> list[Section]:
        """Sections of the profile. They touch and do not overlap: overlapping parts would count twice in the mass."""

    @property
    @abc.abstractmethod
    def stance(self) -> tuple[float, float]:
        """Radius of the flat underside, at height `FOOT_PROTRUSION`, and thickness of the floor above it [m]."""

    def round_body(self) -> tuple[float, Vec3, Mat3]:
        """Volume [m^3] and centre [m] of the round solid, and its inertia about the centre at a density of 1 [m^5]."""
        total = np.sum([section.moments() for section in self.sections], axis=0)
        volume, first, second, cubed = 2 * math.pi * total
        across = cubed / 2 + second - first**2 / volume
        return volume, np.array([0.0, 0.0, first / volume]), np.diag([across, across, cubed])

    def inertial(self) -> tuple[Vec3, Mat3]:
        """Centre of mass [m] and inertia about it [kg m^2], at uniform density."""
        volume, centre, inertia = self.round_body()
        return centre, self.mass / volume * inertia

    @cached_property
    def tipping_angle(self) -> float:
        """Tilt at which the centre of mass passes over the nearest edge of the underside [rad]."""
        com, _ = self.inertial()
        return math.atan2(self.stance[0] - math.hypot(com[0], com[1]), com[2])

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        com, inertia = self.inertial()
        body.explicitinertial, body.mass, body.ipos = True, self.mass, com
        body.fullinertia = np.array([*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]])
        for section in self.sections:
            self._add_wedges(section, body, spec)
        edge, floor = self.stance
        radius = min(FOOT_RADIUS, floor / 2)
        for i in range(FOOT_COUNT):
            pos = (edge - radius) * heading(360.0 * i / FOOT_COUNT) + radius * UP
            solid(body, f"foot_{i}", [radius], pos, type=SPHERE, friction=self.friction, mass=0.0, group=3)

    def _add_wedges(self, section: Section, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        """Add the wedges of a section, which share one mesh."""
        spec.add_mesh(name=section.name, uservert=section.wedge().ravel().tolist())
        friction = self.friction if section.friction is None else section.friction
        for i in range(1 if section.reaches_axis else SECTORS):
            turn = quat("z", 2 * math.pi * i / SECTORS)
            name, leaky = f"{section.name}_{i}", section.leaky
            wedge = solid(body, name, (), type=MESH, quat=turn, friction=friction, mass=0.0, leaky=leaky)
            wedge.meshname, wedge.priority = section.name, section.priority
            wedge.rgba = np.array(self.rgba, np.float32)

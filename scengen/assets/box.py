"""Boxes, whose origin is the middle of the base: dominoes, blocks with an unknown filling, cubes, lids."""

import abc
import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import Vec3
from ..params import param
from .prop import Prop, Rgba, show, shown, solid

DARK_COLOUR = (0.16, 0.10, 0.10, 1.0)
"""Colour of the loaded side of a cube."""


class Box(Prop):
    """Base class of boxes. Subclasses are dataclasses that name the edges as their tasks do."""

    mass: float
    friction: float
    rgba: Rgba

    @property
    @abc.abstractmethod
    def size(self) -> Vec3:
        """Edges along x, y and z [m]."""

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half = self.size / 2
        solid(body, "box", half, [0, 0, half[2]], mass=self.mass, friction=self.friction, rgba=self.rgba)


@dataclass(frozen=True, kw_only=True)
class Domino(Box):
    """One tile, which stands on its smallest face. It falls along x, the thin axis.

    Mass range: paper, App. D.1 ("tile mass 0.02-0.08 kg"); the paper gives no lengths.
    """

    height: float = param(0.080, "m", 0.03, 0.20)
    width: float = param(0.040, "m", 0.01, 0.60)
    thickness: float = param(0.012, "m", 0.006, 0.04)
    mass: float = param(0.050, "kg", 0.005, 0.5)
    friction: float = param(0.5, "1", 0.05, 1.5)
    rgba: Rgba = (0.90, 0.86, 0.76, 1.0)

    @property
    def size(self) -> Vec3:
        return np.array([self.thickness, self.width, self.height])

    @cached_property
    def tipping_angle(self) -> float:
        """Tilt at which the centre of mass passes over the edge of the foot [rad]."""
        return math.atan2(self.thickness, self.height)


@dataclass(frozen=True, kw_only=True)
class Block(Box):
    """A painted box with a square base and an unknown filling: blocks of different masses look alike.

    The paper gives no lengths. The width leaves 20 mm of the 80 mm jaw on either side. The nominal mass gives a density
    of 3100 kg/m^3, between glass and a steel-filled shell.
    """

    width: float = param(0.040, "m", 0.02, 0.07)
    height: float = param(0.050, "m", 0.02, 0.12)
    mass: float = param(0.25, "kg", 0.02, 1.0, hidden=True)
    friction: float = param(0.8, "1", 0.05, 1.5)
    """Sliding friction: rubber on painted wood has 0.7 to 0.9."""
    rgba: Rgba = (0.20, 0.36, 0.66, 1.0)

    @property
    def size(self) -> Vec3:
        return np.array([self.width, self.width, self.height])


@dataclass(frozen=True, kw_only=True)
class Cube(Box):
    """A solid cube, to be picked up.

    The paper gives no numbers. The edge leaves 15 mm of the 80 mm jaw on either side. The mass is that of soft plastic
    foam to hardwood at this size (125 cm^3: 0.06 kg for pine, 0.09 kg for beech, 0.14 kg for nylon).
    """

    edge: float = param(0.050, "m", 0.02, 0.07)
    mass: float = param(0.08, "kg", 0.01, 1.0, hidden=True)
    friction: float = param(0.5, "1", 0.05, 1.5, hidden=True)
    rgba: Rgba = (0.82, 0.20, 0.15, 1.0)

    @property
    def size(self) -> Vec3:
        return np.array([self.edge] * 3)


LEAD_DENSITY = 11340.0
"""Density of lead [kg/m^3]."""
SLUG_SHARE = 0.9
"""Share of a loaded cube's mass that is in its slug. The rest is foam, 35 kg/m^3 at 52 mm and 0.05 kg."""


@dataclass(frozen=True, kw_only=True)
class LoadedCube(Box):
    """A cube of foam with a slug of lead behind its dark side, at +x.

    A heavier cube has a larger slug, whose centre cannot come as close to the side.
    """

    edge: float = param(0.040, "m", 0.02, 0.07)
    mass: float = param(0.04, "kg", 0.01, 0.5, hidden=True)
    lean: float = param(0.0, "1", 0.0, 0.35, hidden=True)
    """Distance of the centre of mass from the middle, as a share of the edge. At 0 no side is dark."""
    friction: float = param(0.45, "1", 0.05, 1.5, hidden=True)
    rgba: Rgba = (0.82, 0.20, 0.15, 1.0)

    @property
    def size(self) -> Vec3:
        return np.array([self.edge] * 3)

    @cached_property
    def com(self) -> float:
        """Distance of the centre of mass from the middle, along x [m]."""
        return self.lean * self.edge

    @cached_property
    def slug(self) -> float:
        """Edge of the slug, which is a cube [m]."""
        return (SLUG_SHARE * self.mass / LEAD_DENSITY) ** (1 / 3)

    @cached_property
    def steepest(self) -> float:
        """Largest possible `lean`: the slug touches the side from inside."""
        return SLUG_SHARE * (self.edge - self.slug) / (2 * self.edge)

    @cached_property
    def inertia(self) -> Vec3:
        """Principal moments of inertia at the centre of mass, about x, y and z [kg m^2]."""
        foam, slug = (1 - SLUG_SHARE) * self.mass, SLUG_SHARE * self.mass
        own = (foam * self.edge**2 + slug * self.slug**2) / 6
        across = own + foam * self.com**2 + slug * (self.com / SLUG_SHARE - self.com) ** 2
        return np.array([own, across, across])

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        """Add one box for contacts and a dark side for pictures. The body, not its geoms, defines mass and inertia."""
        super().fill(body, spec)
        if not self.lean:
            return
        half, skin = self.edge / 2, 0.0002
        shown(body, "dark_side", DARK_COLOUR, size=[skin, 0.9 * half, 0.9 * half], pos=[half, 0, half])
        body.explicitinertial = True
        body.mass, body.inertia = self.mass, self.inertia
        body.ipos = np.array([self.com, 0.0, half])


@dataclass(frozen=True, kw_only=True)
class Lid(Box):
    """A flat square lid without a knob, twice as wide as the opening of the jaw. It lies on what it covers.

    The paper gives no numbers and calls it lightweight (App. B, T26). The density is that of balsa wood, 260 kg/m^3.
    """

    width: float = param(0.160, "m", 0.08, 0.30)
    thickness: float = param(0.006, "m", 0.003, 0.02)
    mass: float = param(0.040, "kg", 0.005, 0.5)
    friction: float = param(0.3, "1", 0.05, 1.5)
    rgba: Rgba = (0.72, 0.70, 0.66, 1.0)

    @property
    def size(self) -> Vec3:
        return np.array([self.width, self.width, self.thickness])


if __name__ == "__main__":
    for box in (Domino(), Block(), Cube(), LoadedCube(lean=0.25), Lid()):
        show(box)

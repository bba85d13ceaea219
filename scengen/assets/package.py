"""Packages of groceries, with printed labels: cartons, cans, tins and bottles. The origin is the middle of the base."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import UP, Vec3, heading
from ..params import param
from .box import Box
from .label import Label, label_box, label_can
from .prop import Prop, Rgba, show, solid
from .turned import FOOT_COUNT, FOOT_PROTRUSION, FOOT_RADIUS

CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER
SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE

SEAM_HEIGHT = 0.004
"""Height of a can's seams [m]."""


@dataclass(frozen=True, kw_only=True)
class Carton(Box):
    """A box of any size with uniform density."""

    length: float = param(0.072, "m", 0.02, 0.25)
    width: float = param(0.164, "m", 0.02, 0.25)
    height: float = param(0.214, "m", 0.02, 0.25)
    mass: float = param(0.411, "kg", 0.01, 2.0)
    friction: float = param(0.45, "1", 0.05, 1.5)
    rgba: Rgba = (0.75, 0.22, 0.16, 1.0)
    label: Label | None = None

    @property
    def size(self) -> Vec3:
        return np.array([self.length, self.width, self.height])

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        super().fill(body, spec)
        if self.label:
            label_box(body, self.size, self.label)


@dataclass(frozen=True, kw_only=True)
class Can(Prop):
    """A full can, which stands on a ring of feet and lies on its two seams. The origin is the middle of the base.

    MuJoCo gives a lying cylinder one contact, on which it would rock and wander; two seams give it two.
    """

    radius: float = param(0.0339, "m", 0.015, 0.06)
    """Radius of the seams. That of the wall between them is 0.2 mm smaller."""
    height: float = param(0.1019, "m", 0.02, 0.20)
    mass: float = param(0.349, "kg", 0.02, 1.0)
    friction: float = param(0.35, "1", 0.05, 1.5)
    rolling: float = param(0.01, "1", 0.0, 0.05)
    """Rolling resistance, as a share of the load: steel with a paper label on wood."""
    rgba: Rgba = (0.78, 0.16, 0.14, 1.0)
    label: Label | None = None

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        if self.label:
            label_can(body, self.radius - FOOT_PROTRUSION, self.height, self.label)
        squares = 3 * self.radius**2 + self.height**2
        weigh(body, self.mass, [0.0, 0.0, self.height / 2], np.array([squares, squares, 6 * self.radius**2]) / 12)
        # the ends of the wall and of the seams do not coincide
        wall = [self.radius - FOOT_PROTRUSION, self.height / 2 - 2 * FOOT_PROTRUSION]
        self._add_cylinder("wall", body, wall, self.height / 2)
        for end, middle, low in (
            ("foot", SEAM_HEIGHT / 2 + FOOT_PROTRUSION, FOOT_RADIUS),
            ("top", -SEAM_HEIGHT / 2 - FOOT_PROTRUSION, -FOOT_RADIUS),
        ):
            above = 0.0 if end == "foot" else self.height
            self._add_cylinder(f"{end}_seam", body, [self.radius, SEAM_HEIGHT / 2], above + middle)
            for i in range(FOOT_COUNT):
                spot = (self.radius - FOOT_RADIUS - FOOT_PROTRUSION) * heading(360.0 * i / FOOT_COUNT) + (
                    above + low
                ) * UP
                solid(body, f"{end}_{i}", [FOOT_RADIUS], spot, type=SPHERE, friction=self.friction, mass=0.0, group=3)

    def _add_cylinder(self, name: str, body: mujoco.MjsBody, size: list[float], height: float) -> None:
        part = solid(
            body, name, size, [0, 0, height], type=CYLINDER, mass=0.0, friction=self.friction, rgba=self.rgba, condim=6
        )
        part.friction[2] = self.rolling * self.radius  # MuJoCo's coefficient is a length


@dataclass(frozen=True, kw_only=True)
class Tin(Prop):
    """A full tin with an oblong base and round corners."""

    length: float = param(0.052, "m", 0.03, 0.10)
    width: float = param(0.097, "m", 0.03, 0.15)
    height: float = param(0.0835, "m", 0.02, 0.15)
    corner: float = param(0.008, "m", 0.002, 0.014)
    """Radius of the upright edges."""
    mass: float = param(0.370, "kg", 0.02, 1.0)
    friction: float = param(0.35, "1", 0.05, 1.5)
    rgba: Rgba = (0.16, 0.26, 0.60, 1.0)
    label: Label | None = None

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        if self.label:
            label_box(body, np.array([self.length, self.width - 2 * self.corner, self.height]), self.label)
        r, x, y, up = self.corner, self.length / 2, self.width / 2, self.height / 2
        across, along = self._mean_square(x, y), self._mean_square(y, x)
        tall = self.height**2 / 12
        weigh(body, self.mass, [0.0, 0.0, up], np.array([along + tall, across + tall, along + across]))
        parts = [("middle", [x, y - r, up], [0, 0])]
        parts += [(f"side_{s}", [x - r, r / 2, up], [0, s * (y - r / 2)]) for s in (-1, 1)]
        for name, size, (px, py) in parts:
            solid(body, name, size, [px, py, up], mass=0.0, friction=self.friction, rgba=self.rgba)
        for i, (a, b) in enumerate(((-1, -1), (-1, 1), (1, -1), (1, 1))):
            # the cylinders do not touch the table: flat faces stand better
            name, size = f"corner_{i}", [r, up - FOOT_PROTRUSION]
            spot = [a * (x - r), b * (y - r), up]
            solid(body, name, size, spot, type=CYLINDER, mass=0.0, friction=self.friction, rgba=self.rgba)

    def _mean_square(self, x: float, y: float) -> float:
        """Mean of x^2 over the base, which is 2 `x` by 2 `y` [m^2]: two rectangles across, four quarters of a disc.

        A quarter of a disc has its centroid at 4 r / (3 pi), and the moment pi r^4 / 16 about its straight sides.
        """
        r, area = self.corner, 4 * x * y - (4 - math.pi) * self.corner**2
        quarter, centroid = math.pi * r**2 / 4, 4 * r / (3 * math.pi)
        own = math.pi * r**4 / 16 - quarter * centroid**2
        squares = 4 / 3 * ((y - r) * x**3 + r * (x - r) ** 3) + 4 * (own + quarter * (x - r + centroid) ** 2)
        return squares / area


def weigh(body: mujoco.MjsBody, mass: float, com: list[float], spread: Vec3) -> None:
    """Set the mass [kg], centre of mass [m], and inertia about it per mass [m^2] of a body."""
    body.explicitinertial, body.mass, body.ipos, body.inertia = True, mass, np.array(com), mass * spread


@dataclass(frozen=True, kw_only=True)
class Bottle(Prop):
    """A full bottle: an oblong body, shoulders and a round cap."""

    length: float = param(0.056, "m", 0.03, 0.08)
    width: float = param(0.096, "m", 0.05, 0.12)
    height: float = param(0.191, "m", 0.12, 0.25)
    mass: float = param(0.603, "kg", 0.05, 1.5)
    friction: float = param(0.40, "1", 0.05, 1.5)
    rgba: Rgba = (0.92, 0.78, 0.12, 1.0)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        """Add the three parts. As measured, the body ends at 0.73 of the height, the shoulders at 0.82."""
        top, neck, h = 0.73 * self.height, 0.82 * self.height, self.height
        cap = 0.37 * self.length
        lower = [self.length / 2, self.width / 2, top / 2]
        upper = [self.length / 2, self.width / 3, (neck - top) / 2]
        volumes = np.array([8 * np.prod(lower), 8 * np.prod(upper), math.pi * cap**2 * (h - neck)])
        masses = self.mass * volumes / volumes.sum()
        for name, size, z, mass in (
            ("body", lower, top / 2, masses[0]),
            ("shoulders", upper, (top + neck) / 2, masses[1]),
        ):
            solid(body, name, size, [0, 0, z], mass=mass, friction=self.friction, rgba=self.rgba)
        solid(
            body,
            "cap",
            [cap, (h - neck) / 2],
            [0, 0, (neck + h) / 2],
            type=CYLINDER,
            mass=masses[2],
            friction=self.friction,
            rgba=self.rgba,
        )


if __name__ == "__main__":
    for package in (Carton(), Can(), Tin(), Bottle()):
        show(package)

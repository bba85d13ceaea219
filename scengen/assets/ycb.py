"""Sixteen objects of the YCB Object and Model Set as simple solids with their real dimensions and masses.

Masses are those of the set's object list (B. Calli et al., "The YCB object and model set", 2015). If `Item.scanned` is
true, dimensions were measured on the scan, else they are those of that list. Friction is not published; ours is an
estimate by material. The solids are proxies: they have the size, mass and balance of an object, and the few faces that
a hand or a table touches. `mesh_of` finds the scan of an object in a folder, and `Ycb.scans` replaces the proxy by it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco
import numpy as np

from ..errors import BadConfig, cut, nearest
from ..geometry import UP, Vec3, heading
from ..params import param
from .ball import Ball
from .bowl import Bowl
from .box import Box
from .cup import Cup
from .plate import Plate
from .prop import Prop, Rgba, show, solid
from .turned import FOOT_COUNT, FOOT_PROTRUSION, FOOT_RADIUS

CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE
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

    @property
    def size(self) -> Vec3:
        return np.array([self.length, self.width, self.height])


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

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
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

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
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


@dataclass(frozen=True, kw_only=True)
class Banana(Prop):
    """A banana that lies flat: capsules along an arc in the plane of the table, and a stem."""

    span: float = param(0.160, "m", 0.10, 0.20)
    """Distance between the middles of both ends."""
    bend: float = param(0.150, "m", 0.12, 0.40)
    """Radius of the arc."""
    radius: float = param(0.018, "m", 0.010, 0.025)
    mass: float = param(0.066, "kg", 0.02, 0.3)
    friction: float = param(0.50, "1", 0.05, 1.5)
    rgba: Rgba = (0.93, 0.80, 0.20, 1.0)

    PARTS = 4

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        half = math.asin(self.span / 2 / self.bend)
        angles = half * (2 * np.arange(self.PARTS + 1) / self.PARTS - 1)
        arc = np.column_stack(
            [self.bend * np.sin(angles), self.bend * (np.cos(angles) - 1), np.full(len(angles), self.radius)]
        )
        arc[:, 1] -= arc[:, 1].mean()
        thin = self.radius / 3
        stem = arc[-1] + [0.012, -0.023, thin + 0.001 - self.radius]
        lengths = np.linalg.norm(np.diff(arc, axis=0), axis=1)
        bars = [
            (arc[i], arc[i + 1], self.radius, 0.97 * self.mass * lengths[i] / lengths.sum()) for i in range(self.PARTS)
        ]
        for i, (start, end, radius, mass) in enumerate([*bars, (arc[-1], stem, thin, 0.03 * self.mass)]):
            along, turn = end - start, np.empty(4)
            mujoco.mju_quatZ2Vec(turn, along / np.linalg.norm(along))
            size, middle = [radius, float(np.linalg.norm(along)) / 2], (start + end) / 2
            name, rub = f"part_{i}", self.friction
            solid(body, name, size, middle, type=CAPSULE, quat=turn, mass=mass, friction=rub, rgba=self.rgba)


@dataclass(frozen=True, kw_only=True)
class DinnerPlate(Plate):
    """A plate with a wide foot and a rim that slopes up to its edge."""

    radius: float = param(0.130, "m", 0.115, 0.150)
    foot: float = param(0.082, "m", 0.060, 0.090)
    lip: float = param(0.0, "m", 0.0, 0.015)
    rise: float = param(0.0215, "m", 0.005, 0.030)
    thickness: float = param(0.0045, "m", 0.002, 0.008)
    mass: float = param(0.279, "kg", 0.05, 1.0)
    friction: float = param(0.35, "1", 0.05, 1.5)
    rgba: Rgba = (0.80, 0.16, 0.14, 1.0)


@dataclass(frozen=True, kw_only=True)
class RestingBall(Ball):
    """A ball whose origin is its point of contact with the ground."""

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        super().fill(body, spec)
        body.geoms[0].pos = self.radius * UP


@dataclass(frozen=True)
class Item:
    """One object of the set."""

    number: int
    """Number in the set."""
    name: str
    """Name in the set."""
    prop: Prop
    """Proxy of the object."""
    width: float | None
    """Smallest width that a jaw must span [m]. None if the Panda's jaw cannot span it, or only a rim can be gripped."""
    scanned: bool
    """Whether its dimensions were measured on the scan."""

    @property
    def folder(self) -> str:
        """Name of the object's folder in the set."""
        return f"{self.number:03d}_{self.name.replace(' ', '_')}"


def _carton(x: float, y: float, z: float, mass: float, friction: float, rgba: Rgba) -> Carton:
    """A carton, with lengths in millimetres."""
    return Carton(length=x / 1000, width=y / 1000, height=z / 1000, mass=mass, friction=friction, rgba=rgba)


def _can(radius: float, height: float, mass: float) -> Can:
    """A can, with lengths in millimetres."""
    return Can(radius=radius / 1000, height=height / 1000, mass=mass)


BROWN = (0.55, 0.33, 0.18, 1.0)
RED = (0.75, 0.16, 0.14, 1.0)
TENNIS_BALL_RADIUS = 0.03235
"""Radius of a tennis ball [m]."""
ITEMS = (
    Item(2, "master chef can", _can(51.2, 140.2, 0.414), None, True),
    Item(3, "cracker box", _carton(71.7, 163.6, 213.8, 0.411, 0.45, RED), 0.0717, True),
    Item(4, "sugar box", _carton(45.2, 92.1, 176.2, 0.514, 0.45, (0.92, 0.80, 0.15, 1.0)), 0.0452, True),
    Item(5, "tomato soup can", _can(33.9, 101.9, 0.349), 0.0678, True),
    Item(6, "mustard bottle", Bottle(), 0.056, True),
    Item(7, "tuna fish can", _can(42.5, 33.0, 0.171), None, False),
    Item(8, "pudding box", _carton(38.3, 89.7, 113.0, 0.187, 0.45, BROWN), 0.0383, True),
    Item(9, "gelatin box", _carton(28.0, 73.0, 85.0, 0.097, 0.45, RED), 0.028, False),
    Item(10, "potted meat can", Tin(), 0.052, True),
    Item(11, "banana", Banana(), 0.036, True),
    Item(24, "bowl", Bowl(radius=0.0803, depth=0.055, foot=0.043, mass=0.147, friction=0.40, rgba=RED), None, True),
    Item(
        25,
        "mug",
        Cup(
            base=0.0407,
            rim=0.0407,
            height=0.0813,
            bead=0.0,
            handle=0.029,
            curve=1.0,
            mass=0.118,
            friction=0.40,
            rgba=RED,
        ),
        0.012,
        True,
    ),
    Item(29, "plate", DinnerPlate(), None, True),
    Item(36, "wood block", _carton(85.0, 85.0, 200.0, 0.729, 0.50, BROWN), None, False),
    Item(
        56,
        "tennis ball",
        RestingBall(
            radius=TENNIS_BALL_RADIUS,
            density=0.058 / (4 / 3 * math.pi * TENNIS_BALL_RADIUS**3),
            friction=0.6,
            rolling=0.03,
            rgba=(0.75, 0.90, 0.20, 1.0),
        ),
        2 * TENNIS_BALL_RADIUS,
        False,
    ),
    Item(61, "foam brick", _carton(50.0, 75.0, 50.0, 0.028, 0.70, RED), 0.05, False),
)
"""The sixteen objects, by their numbers in the set."""


@dataclass(frozen=True)
class Scan:
    """Solid of a scanned object, as it stands or lies."""

    sha256: str
    """Hash of the solid's data in a manifest."""
    prop: Prop


@dataclass(frozen=True, kw_only=True)
class Ycb(Prop):
    """One of `ITEMS`, standing or lying, with the origin of its prop."""

    item: int = param(0, "index", 0, len(ITEMS) - 1)
    low: int = param(0, "1", 0, 1)
    """1 for a carton that lies on its narrow side, if that is lower than standing. Other objects ignore it."""

    scans: Mapping[str, Scan] = field(default_factory=dict, compare=False, repr=False)
    """Solids made of scans, by `called`. If there are any, no proxy is used."""

    @property
    def called(self) -> str:
        """Key of the object in `scans`: its folder in the set, with `/low` for a lying carton."""
        return f"{self.row.folder}/low" if self.lies else self.row.folder

    @property
    def scan(self) -> Scan | None:
        """Scan that replaces the proxy, or None.

        Raises:
            BadConfig: there are scans, but none of this object.
        """
        if self.scans and self.called not in self.scans:
            known = ", ".join(self.scans)
            raise BadConfig(f"there is no scan of {self.called}; known: {known}; name a folder with its scan in ycb=")
        return self.scans.get(self.called)

    @property
    def row(self) -> Item:
        """Entry of the object in `ITEMS`."""
        return ITEMS[self.item]

    @property
    def lies(self) -> bool:
        """Whether it is a carton that lies on its narrow side."""
        prop = self.row.prop
        return bool(self.low) and isinstance(prop, Carton) and prop.height > prop.width

    @property
    def prop(self) -> Prop:
        """Proxy of the object, standing or lying."""
        prop = self.row.prop
        if self.lies and isinstance(prop, Carton):
            return replace(prop, width=prop.height, height=prop.width)
        return prop

    @property
    def told(self) -> dict[str, float]:
        """Features for scenarios: `scanned` if a scan replaces the proxy, else none."""
        return {"scanned": 1.0} if self.scan else {}

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return float(self.spec().compile().body_mass.sum())

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        (self.scan.prop if self.scan else self.prop).fill(body, spec)


def by_name() -> dict[str, Ycb]:
    """Every object by its key in `Ycb.scans`."""
    every = (Ycb(item=item, low=low) for low in (0, 1) for item in range(len(ITEMS)))
    return {thing.called: thing for thing in every}


SCAN_FILES = ("google_16k/textured.obj", "textured.obj", "google_16k/nontextured.stl", "google_16k/nontextured.ply")
"""Files in an object's folder that may hold its scan, best first."""


def mesh_of(folder: Path | str, item: Item) -> Path:
    """File of an object's scan in a folder that holds the set, or a part of it.

    Raises:
        BadConfig: there is no such folder or scan.
    """
    place = Path(folder)
    if not place.is_dir():
        raise BadConfig(f"ycb = {cut(str(folder))} is not a folder; name the one that holds {item.folder}")
    for name in SCAN_FILES:
        if (place / item.folder / name).is_file():
            return place / item.folder / name
    there = sorted(p.name for p in place.iterdir() if p.is_dir())
    if item.folder in there:
        raise BadConfig(f"{cut(str(place / item.folder))} holds no scan; expected one of {', '.join(SCAN_FILES)}")
    known = ", ".join(there[:20]) or "nothing"
    raise BadConfig(f"no folder {item.folder} in {cut(str(folder))}{nearest(item.folder, there)}; known: {known}")


if __name__ == "__main__":
    for index in range(len(ITEMS)):
        show(Ycb(item=index))

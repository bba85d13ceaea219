"""Sixteen objects of the YCB Object and Model Set as simple solids with their real dimensions and masses.

Masses are those of the set's object list (B. Calli et al., "The YCB object and model set", 2015). If `Item.scanned` is
true, dimensions were measured on the scan, else they are those of that list. Friction is not published; ours is an
estimate by material. The solids are proxies: they have the size, mass and balance of an object, and the few faces that
a hand or a table touches. Colours and printed words (`label`) show what they are. `mesh_of` finds the scan of an object
in a folder, and `Ycb.scans` replaces the proxy by it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from ..errors import BadConfig, cut, nearest
from ..geometry import UP
from ..params import param
from .ball import Ball
from .bowl import Bowl
from .cup import Cup
from .label import Label
from .package import Bottle, Can, Carton, Tin
from .plate import Plate
from .prop import Prop, Rgba, show, shown, solid

CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE
SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE

STEM = (0.30, 0.22, 0.08, 1.0)
"""Colour of both ends of a banana."""


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
            name, rub, rgba = f"part_{i}", self.friction, self.rgba if i < self.PARTS else STEM
            solid(body, name, size, middle, type=CAPSULE, quat=turn, mass=mass, friction=rub, rgba=rgba)
        tip = arc[0] + 0.45 * self.radius * (arc[0] - arc[1]) / lengths[0]
        shown(body, "tip", STEM, type=SPHERE, size=[0.6 * self.radius, 0.0, 0.0], pos=tip)


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

    @cached_property
    def folder(self) -> str:
        """Name of the object's folder in the set."""
        return f"{self.number:03d}_{self.name.replace(' ', '_')}"


def _carton(
    x: float, y: float, z: float, mass: float, friction: float, rgba: Rgba, label: Label | None = None
) -> Carton:
    """A carton, with lengths in millimetres."""
    size = {"length": x / 1000, "width": y / 1000, "height": z / 1000}
    return Carton(**size, mass=mass, friction=friction, rgba=rgba, label=label)


def _can(radius: float, height: float, mass: float, rgba: Rgba, label: Label) -> Can:
    """A can, with lengths in millimetres."""
    return Can(radius=radius / 1000, height=height / 1000, mass=mass, rgba=rgba, label=label)


WHITE = (0.95, 0.94, 0.90, 1.0)
YELLOW = (0.92, 0.80, 0.15, 1.0)
NAVY = (0.10, 0.16, 0.45, 1.0)
TINPLATE = (0.70, 0.71, 0.73, 1.0)
BROWN = (0.55, 0.33, 0.18, 1.0)
RED = (0.75, 0.16, 0.14, 1.0)
TENNIS_BALL_RADIUS = 0.03235
"""Radius of a tennis ball [m]."""
ITEMS = (
    Item(2, "master chef can", _can(51.2, 140.2, 0.414, NAVY, Label("COFFEE", NAVY, WHITE)), None, True),
    Item(3, "cracker box", _carton(71.7, 163.6, 213.8, 0.411, 0.45, RED, Label("CRACKER", NAVY, YELLOW)), 0.0717, True),
    Item(4, "sugar box", _carton(45.2, 92.1, 176.2, 0.514, 0.45, YELLOW, Label("SUGAR", NAVY, WHITE)), 0.0452, True),
    Item(5, "tomato soup can", _can(33.9, 101.9, 0.349, TINPLATE, Label("SOUP", RED, WHITE)), 0.0678, True),
    Item(6, "mustard bottle", Bottle(), 0.056, True),
    Item(7, "tuna fish can", _can(42.5, 33.0, 0.171, TINPLATE, Label("TUNA", NAVY, YELLOW)), None, False),
    Item(
        8, "pudding box", _carton(38.3, 89.7, 113.0, 0.187, 0.45, BROWN, Label("PUDDING", BROWN, WHITE)), 0.0383, True
    ),
    Item(9, "gelatin box", _carton(28.0, 73.0, 85.0, 0.097, 0.45, RED, Label("GELATIN", RED, WHITE)), 0.028, False),
    Item(10, "potted meat can", Tin(label=Label("MEAT", YELLOW, RED)), 0.052, True),
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

    @cached_property
    def called(self) -> str:
        """Key of the object in `scans`: its folder in the set, with `/low` for a lying carton."""
        return f"{self.row.folder}/low" if self.lies else self.row.folder

    @cached_property
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
    def material(self) -> str:
        return self.scan.sha256 if self.scan else ""

    @cached_property
    def row(self) -> Item:
        """Entry of the object in `ITEMS`."""
        return ITEMS[self.item]

    @cached_property
    def lies(self) -> bool:
        """Whether it is a carton that lies on its narrow side."""
        prop = self.row.prop
        return bool(self.low) and isinstance(prop, Carton) and prop.height > prop.width

    @cached_property
    def prop(self) -> Prop:
        """Proxy of the object, standing or lying."""
        prop = self.row.prop
        if self.lies and isinstance(prop, Carton):
            return replace(prop, width=prop.height, height=prop.width)
        return prop

    @cached_property
    def features(self) -> dict[str, float]:
        """Features for scenarios: `scanned` if a scan replaces the proxy, else none."""
        return {"scanned": 1.0} if self.scan else {}

    @cached_property
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

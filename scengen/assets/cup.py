"""Cups with or without a handle: a wall that may widen towards the rim, a floor, a bead along the rim."""

import itertools
import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import Mat3, Vec3, quat
from ..params import param
from .prop import BOX, PRIORITY, Rgba, show, solid
from .turned import FOOT_PROTRUSION, MIN_DETAIL, Section, Turned

CAPSULE, CYLINDER = mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER

BEAD_HEIGHT = 0.012
"""Height of the bead [m]."""
RIM_HEIGHT = 0.001
"""Height of the uppermost part of the wall [m], whose end face a cup upside down stands on."""
MIN_HANDLE = 0.020
"""A handle that stands out less is none [m]."""
HANDLE_BOTTOM, HANDLE_TOP = 0.26, 0.84
"""Where the handle's outer faces are, as shares of the height."""
BEND_PARTS = 4
"""Straight parts of a quarter of a bend."""


@dataclass(frozen=True, kw_only=True)
class Cup(Turned):
    """A cup that stands on the middle of its floor; the handle is on the side of +x.

    Radii: 86 and 94 mm of width, so that the 80 mm jaw spans it nowhere. The paper gives no lengths (App. C, "handled
    cup, rigid handle, variable curvature"). 0.050 kg is a cup of melamine with walls of 3 mm.
    """

    height: float = param(0.095, "m", 0.07, 0.14)
    base: float = param(0.043, "m", 0.030, 0.050)
    """Outer radius at the ground."""
    rim: float = param(0.047, "m", 0.030, 0.055)
    """Outer radius at the top."""
    wall: float = param(0.003, "m", 0.0015, 0.006)
    """Its thickness, level."""
    floor: float = param(0.004, "m", 0.002, 0.008)
    """Height of the floor inside, whose middle is the top of a box."""
    bead: float = param(0.005, "m", 0.0, 0.008)
    """Thickness of the last 12 mm of the wall, thicker towards the inside; as thick as the wall where that is more."""
    handle: float = param(0.0, "m", 0.0, 0.06)
    """How far it stands out from the wall; below 20 mm, where nothing fits behind it, there is none."""
    bar: float = param(0.012, "m", 0.008, 0.020)
    """Thickness of the handle: the jaw presses harder on a thicker one, and the more of its pads holds it."""
    curve: float = param(0.0, "1", 0.0, 1.0)
    """From 0, a handle of three straight bars, to 1, its outer half a half ring."""
    mass: float = param(0.050, "kg", 0.01, 0.5)
    friction: float = param(0.7, "1", 0.05, 1.5)
    """Of floor and wall. On the wall it counts against whatever slides there, also against a rougher thing."""
    rim_friction: float = param(0.25, "1", 0.05, 1.5)
    """Of the end face of the rim, on which the cup stands upside down."""
    handle_friction: float = param(0.8, "1", 0.05, 1.5)
    """Of handle and bead, by which a cup is meant to be held."""
    ribbed: bool = False
    """Whether no suction cup holds on to the wall, for ribs too fine to be modelled; no parameter: a family decides."""
    rgba: Rgba = (0.80, 0.45, 0.32, 1.0)

    @property
    def stance(self) -> tuple[float, float]:
        return self.base, self.floor

    def outer(self, height: float) -> float:
        """Outer radius at a height above the ground [m]."""
        return self.base + (self.rim - self.base) * height / self.height

    @property
    def sections(self) -> list[Section]:
        top, end = self.height - RIM_HEIGHT, self.height
        flat = self.floor - FOOT_PROTRUSION
        below = top if self.bead <= self.wall + MIN_DETAIL else end - BEAD_HEIGHT
        edge = max(self.wall, self.bead)
        parts = [
            self._ring("bottom", FOOT_PROTRUSION, flat, None, self.friction, PRIORITY),
            self._ring("wall", flat, below, self.wall, self.friction, PRIORITY + 1),
            self._ring("rim", top, end, edge, self.rim_friction, PRIORITY),
        ]
        if below < top:
            parts.append(self._ring("bead", below, top, edge, self.handle_friction, PRIORITY))
        return parts

    def _ring(self, name: str, low: float, high: float, wall: float | None, friction: float, priority: int) -> Section:
        """What lies between two heights, `wall` thick; None: a disc [m]."""
        a, b = self.outer(low), self.outer(high)
        inner = (0.0, 0.0) if wall is None else (a - wall, b - wall)
        corners = ((inner[0], low), (a, low), (b, high), (inner[1], high))
        return Section(name, corners, friction, priority, leaky=self.ribbed and wall is not None)

    # --- handle ---------------------------------------------------------------------------

    @property
    def has_handle(self) -> bool:
        return self.handle >= MIN_HANDLE

    @property
    def grip(self) -> Vec3:
        """Middle of the handle's upright [m], in the cup's axes."""
        return np.array([self._reach, 0.0, (HANDLE_BOTTOM + HANDLE_TOP) / 2 * self.height])

    @property
    def _reach(self) -> float:
        """Distance of the upright's middle line from the cup's axis [m]."""
        return self.outer((HANDLE_BOTTOM + HANDLE_TOP) / 2 * self.height) + self.handle - self.bar / 2

    def _bars(self) -> list[tuple[mujoco.mjtGeom, Vec3, Vec3]]:
        """The handle: kind of geom and both ends of its middle line for each straight part [m]."""
        if not self.has_handle:
            return []
        low, high = HANDLE_BOTTOM * self.height + self.bar / 2, HANDLE_TOP * self.height - self.bar / 2
        bend = self.curve * min((high - low) / 2, self.handle - self.bar)
        parts = []
        path = []
        for z, side in ((low, 1.0), (high, -1.0)):
            # where the cup is wider, or else the bar's end would reach into the hollow of one with a leaning wall
            widest = max(self.outer(z - self.bar / 2), self.outer(z + self.bar / 2))
            wall = np.array([widest - self.wall / 2, 0.0, z])
            centre = np.array([self._reach - bend, 0.0, z + side * bend])
            turns = [math.pi / 2 * i / BEND_PARTS for i in range(BEND_PARTS + 1)] if bend >= MIN_DETAIL else [0.0]
            arc = [centre + bend * np.array([math.sin(a), 0.0, -side * math.cos(a)]) for a in turns]
            parts.append((CYLINDER, wall, arc[0]))
            parts += [(CAPSULE, start, end) for start, end in itertools.pairwise(arc)]
            path.append(arc[-1])
        lower, upper = path
        more = np.array([0.0, 0.0, max(0.0, self.bar / 2 - bend)])
        if upper[2] - lower[2] > MIN_DETAIL:
            parts.append((BOX, lower - more, upper + more))
        return parts

    def inertial(self) -> tuple[Vec3, Mat3]:
        """Centre of mass [m] and inertia about it [kg m^2], of one density; each bar of the handle as a thin rod."""
        bodies = [self.round_body()]
        for kind, start, end in self._bars():
            along, area = end - start, self.bar**2 * (1.0 if kind == BOX else math.pi / 4)
            volume = area * float(np.linalg.norm(along))
            own = volume * (along @ along * np.eye(3) - np.outer(along, along)) / 12
            bodies.append((volume, (start + end) / 2, own))
        total = sum(volume for volume, _, _ in bodies)
        com = sum((volume * centre for volume, centre, _ in bodies), np.zeros(3)) / total
        inertia = np.zeros((3, 3))
        for volume, centre, own in bodies:
            d = centre - com
            inertia += own + volume * (d @ d * np.eye(3) - np.outer(d, d))
        return com, self.mass / total * inertia

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        super().fill(body, spec)
        # On the mesh of the floor a box would stand on one point and rock; MuJoCo gives two boxes four. This one's top
        # is the floor, and the mesh lies a little lower. It is not shown: underneath, both lie in one plane.
        flat, half = (self.outer(self.floor) - self.wall) / math.sqrt(2), (self.floor - FOOT_PROTRUSION) / 2
        size, pos = [flat, flat, half], [0.0, 0.0, self.floor - half]
        solid(body, "floor", size, pos, friction=self.friction, mass=0.0, group=3)
        for i, (kind, start, end) in enumerate(self._bars()):
            along = end - start
            half = float(np.linalg.norm(along)) / 2
            size = [self.bar / 2, self.bar / 2, half] if kind == BOX else [self.bar / 2, half]
            turn = quat("y", math.atan2(along[0], along[2]))
            middle = (start + end) / 2
            name, rub = f"handle_{i}", self.handle_friction
            solid(body, name, size, middle, type=kind, quat=turn, friction=rub, mass=0.0, rgba=self.rgba)


if __name__ == "__main__":
    for cup in (Cup(), Cup(handle=0.045), Cup(handle=0.045, curve=1.0)):
        show(cup)

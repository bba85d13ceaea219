"""Cups with or without a handle: a wall that may widen towards the rim, a floor, and a bead along the rim."""

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import Mat3, Vec3, quat
from ..params import param
from .prop import BOX, PRIORITY, Rgba, show, solid
from .turned import FOOT_PROTRUSION, MIN_DETAIL, Section, Turned

CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE
CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER

BEAD_HEIGHT = 0.012
"""Height of the bead [m]."""
RIM_HEIGHT = 0.001
"""Height of the uppermost part of the wall [m]. A cup upside down stands on its end face."""
MIN_HANDLE = 0.020
"""Shortest handle [m]: a cup with a smaller value of `handle` has none."""
HANDLE_BOTTOM = 0.26
"""Height of the handle's lower outer face, as a share of the cup's height."""
HANDLE_TOP = 0.84
"""Height of the handle's upper outer face, as a share of the cup's height."""
BEND_PARTS = 4
"""Number of straight parts in a quarter of a bend."""


@dataclass(frozen=True, kw_only=True)
class Cup(Turned):
    """A cup whose origin is the middle of its base; the handle is at +x.

    The radii give widths of 86 and 94 mm, so that the 80 mm jaw cannot span the cup. The paper gives no lengths
    (App. C, "handled cup, rigid handle, variable curvature"). 0.050 kg is a cup of melamine with walls of 3 mm.
    """

    height: float = param(0.095, "m", 0.07, 0.14)
    base: float = param(0.043, "m", 0.030, 0.050)
    """Outer radius at the ground."""
    rim: float = param(0.047, "m", 0.030, 0.055)
    """Outer radius at the top."""
    wall: float = param(0.003, "m", 0.0015, 0.006)
    """Horizontal thickness of the wall."""
    floor: float = param(0.004, "m", 0.002, 0.008)
    """Height of the floor inside. Its middle is the top of a box."""
    bead: float = param(0.005, "m", 0.0, 0.008)
    """Thickness of the uppermost 12 mm of the wall, at least that of the wall. The additional thickness is inside."""
    handle: float = param(0.0, "m", 0.0, 0.06)
    """Distance by which the handle protrudes from the wall. Below 20 mm nothing fits behind it, and there is none."""
    bar: float = param(0.012, "m", 0.008, 0.020)
    """Thickness of the handle. On a thicker handle the jaw presses harder, and more of its pads are in contact."""
    curve: float = param(0.0, "1", 0.0, 1.0)
    """Roundness of the handle: 0 gives three straight bars, 1 gives a half ring as its outer half."""
    mass: float = param(0.050, "kg", 0.01, 0.5)
    friction: float = param(0.7, "1", 0.05, 1.5)
    """Sliding friction of floor and wall. On the wall it also counts against things that are rougher."""
    rim_friction: float = param(0.25, "1", 0.05, 1.5)
    """Sliding friction of the end face of the rim, on which the cup stands upside down."""
    handle_friction: float = param(0.8, "1", 0.05, 1.5)
    """Sliding friction of handle and bead, the grips of the cup."""
    ribbed: bool = False
    """Whether no suction cup can hold the wall, because of ribs that are too fine to model. The family sets it."""
    smooth_outside: bool = False
    """Whether the bead is a grip on its inside only, and the wall goes on outside of it. The family sets it."""
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
            skin = self.wall if self.smooth_outside else 0.0
            parts.append(self._ring("bead", below, top, edge - skin, self.handle_friction, PRIORITY, skin))
            if skin:
                parts.append(self._ring("skin", below, top, skin, self.friction, PRIORITY + 1))
        return parts

    def _ring(
        self,
        name: str,
        low: float,
        high: float,
        wall: float | None,
        friction: float,
        priority: int,
        inset: float = 0.0,
    ) -> Section:
        """Section between two heights [m]: a ring of thickness `wall` [m], or a disc for None.

        Args:
            inset: distance of the ring's outer face from that of the cup [m].
        """
        a, b = self.outer(low) - inset, self.outer(high) - inset
        inner = (0.0, 0.0) if wall is None else (a - wall, b - wall)
        corners = ((inner[0], low), (a, low), (b, high), (inner[1], high))
        return Section(name, corners, friction, priority, leaky=self.ribbed and wall is not None)

    # --- handle ---------------------------------------------------------------------------

    @cached_property
    def has_handle(self) -> bool:
        return self.handle >= MIN_HANDLE

    @cached_property
    def grip(self) -> Vec3:
        """Middle of the handle's upright bar, in the cup's axes [m]."""
        return np.array([self._upright_distance, 0.0, (HANDLE_BOTTOM + HANDLE_TOP) / 2 * self.height])

    @cached_property
    def _upright_distance(self) -> float:
        """Distance of the upright bar's middle line from the cup's axis [m]."""
        return self.outer((HANDLE_BOTTOM + HANDLE_TOP) / 2 * self.height) + self.handle - self.bar / 2

    def _bars(self) -> list[tuple[mujoco.mjtGeom, Vec3, Vec3]]:
        """Straight parts of the handle: kind of geom, and both ends of its middle line [m]."""
        if not self.has_handle:
            return []
        low, high = HANDLE_BOTTOM * self.height + self.bar / 2, HANDLE_TOP * self.height - self.bar / 2
        bend = self.curve * min((high - low) / 2, self.handle - self.bar)
        parts = []
        path = []
        for z, side in ((low, 1.0), (high, -1.0)):
            # where the cup is wider; otherwise the end of the bar would reach into a cup with a sloping wall
            widest = max(self.outer(z - self.bar / 2), self.outer(z + self.bar / 2))
            wall = np.array([widest - self.wall / 2, 0.0, z])
            centre = np.array([self._upright_distance - bend, 0.0, z + side * bend])
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
        """Centre of mass [m] and inertia about it [kg m^2], at uniform density; bars of the handle are thin rods."""
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
        # A box on the mesh of the floor would have one point of contact and rock; MuJoCo gives two boxes four points.
        # The top of this box is the floor, and the mesh lies a little lower. The box is not drawn: the undersides of
        # both lie in one plane.
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

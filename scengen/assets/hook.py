"""Hooks for pulling: an L, a J whose bend is a half circle, and a T, all lying flat.

The paper has "J-shape (two variants) and T-shape, parametric handle length and hook radius" (App. C), and an "L-shaped
hook" in T23; it gives no numbers. Ours fit the Panda's jaw, which opens to 80 mm, and a cube of 40 mm.

Every hook is a set of boxes in one plane. The bars of the bend touch the inner circle from outside, so that everything
that fits into the circle fits into the hook. The mass of each bar is proportional to its length along the middle line;
overlaps at the corners count once.

The handle starts at x = -length / 2, where a hand holds it, and ends at x = length / 2. The origin is the middle of its
underside. The tip points to +y, or to -y if the hook is mirrored.
"""

import abc
import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..geometry import quat
from ..params import param
from .prop import Prop, Rgba, show, solid

Bar = tuple[NDArray[np.float64], NDArray[np.float64], float]
"""Two ends of a straight part in the plane, shape (2,) each, and length of the box beyond both ends [m]."""
BEND_PARTS = 16
"""Number of bars in a half circle. Its outside exceeds the circle by at most 1 / cos(5.6 deg) - 1 = 0.5 % of the outer
radius, 0.46 mm for the widest bend."""
MIN_SIZE = 1e-6
"""Length below which a barb is left out [m]: MuJoCo refuses boxes without extent."""


class Hook(Prop):
    """Base class of hooks: bars of one cross section that lie on z = 0. Subclasses are dataclasses."""

    length: float
    width: float
    height: float
    mass: float
    friction: float
    rgba: Rgba

    @property
    @abc.abstractmethod
    def bars(self) -> list[Bar]:
        """Its straight parts, in the plane."""

    @property
    @abc.abstractmethod
    def inside(self) -> float:
        """x of the pulling face, or of its innermost point [m]."""

    @property
    @abc.abstractmethod
    def aside(self) -> float:
        """Distance by which it protrudes beside the handle's face, on the side of the tip [m]."""

    @cached_property
    def depth(self) -> float:
        """Distance that the handle must advance for the tip to pass a thing that touches the pulling face [m]."""
        return 0.0

    @cached_property
    def side(self) -> float:
        """Sign of y of the tip: 1 or -1."""
        return 1.0

    @property
    @abc.abstractmethod
    def engaging(self) -> float:
        """Width of the pulling face beside the handle, or of the opening of the bend [m]."""

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """Corners of its bars on the ground [m], shape (n, 3)."""
        corners = []
        for start, end, more in self.bars:
            along = (end - start) / np.linalg.norm(end - start)
            left = self.width / 2 * np.array([-along[1], along[0]])
            corners += [spot + side * left for spot in (start - more * along, end + more * along) for side in (1, -1)]
        return np.pad(np.array(corners), ((0, 0), (0, 1)))

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        lengths = [float(np.linalg.norm(end - start)) for start, end, _ in self.bars]
        for i, ((start, end, more), length) in enumerate(zip(self.bars, lengths, strict=True)):
            along, middle = end - start, (start + end) / 2
            solid(
                body,
                f"bar_{i}",
                [length / 2 + more, self.width / 2, self.height / 2],
                [*middle, self.height / 2],
                quat=quat("z", math.atan2(along[1], along[0])),
                mass=self.mass * length / sum(lengths),
                friction=self.friction,
                rgba=self.rgba,
            )


class StraightHook(Hook):
    """Base class of hooks with a straight tip at a right angle to the end of the handle. Subclasses are dataclasses."""

    tip: float

    @property
    def inside(self) -> float:
        return self.length / 2 - self.width

    @property
    def aside(self) -> float:
        return self.tip

    @property
    def engaging(self) -> float:
        return self.tip


@dataclass(frozen=True, kw_only=True)
class LHook(StraightHook):
    """A handle with a straight tip at a right angle to its end, on one side."""

    length: float = param(0.37, "m", 0.20, 0.50)
    """Length of the handle, the width of the tip included."""
    tip: float = param(0.07, "m", 0.02, 0.12)
    """Distance by which the tip protrudes beside the handle's face."""
    width: float = param(0.032, "m", 0.010, 0.040)
    height: float = param(0.025, "m", 0.015, 0.040)
    mass: float = param(0.10, "kg", 0.02, 0.5)
    friction: float = param(0.8, "1", 0.05, 1.5)
    mirrored: int = param(0, "1 = tip to the right", 0, 1)
    rgba: Rgba = (0.20, 0.45, 0.70, 1.0)

    @cached_property
    def side(self) -> float:
        return -1.0 if self.mirrored else 1.0

    @property
    def bars(self) -> list[Bar]:
        half, middle = self.width / 2, self.length / 2 - self.width / 2
        corner = _point(middle, self.side * half)
        return [
            (_point(-self.length / 2, 0), _point(self.length / 2, 0), 0.0),
            (corner, corner + _point(0, self.side * self.tip), 0.0),
        ]


@dataclass(frozen=True, kw_only=True)
class JHook(Hook):
    """A handle that ends in a half circle. The variants differ in the barb, a straight end that leads back."""

    length: float = param(0.30, "m", 0.15, 0.50)
    """Length of the straight handle, up to the bend."""
    radius: float = param(0.045, "m", 0.02, 0.10)
    """Radius of the middle line of the bend."""
    barb: float = param(0.0, "m", 0.0, 0.08)
    """Length of the barb, which runs back parallel to the handle."""
    width: float = param(0.016, "m", 0.010, 0.040)
    height: float = param(0.025, "m", 0.015, 0.040)
    mass: float = param(0.12, "kg", 0.02, 0.5)
    friction: float = param(0.8, "1", 0.05, 1.5)
    mirrored: int = param(0, "1 = tip to the right", 0, 1)
    rgba: Rgba = (0.20, 0.45, 0.70, 1.0)

    @cached_property
    def side(self) -> float:
        return -1.0 if self.mirrored else 1.0

    @property
    def inside(self) -> float:
        return self.length / 2 + self.radius - self.width / 2

    @property
    def aside(self) -> float:
        return 2 * self.radius

    @cached_property
    def depth(self) -> float:
        return self.radius + self.barb

    @property
    def engaging(self) -> float:
        return 2 * self.radius - self.width

    @property
    def bars(self) -> list[Bar]:
        start = self.length / 2
        straight = [(_point(-start, 0), _point(start, 0), 0.0)]
        back = self.side * 2 * self.radius
        barb = [(_point(start, back), _point(start - self.barb, back), 0.0)] if self.barb > MIN_SIZE else []
        return straight + self._bend() + barb

    def _bend(self) -> list[Bar]:
        """Bars whose inner faces touch the inner circle in their middle, and whose outer corners meet."""
        step = math.pi / BEND_PARTS
        centre = _point(self.length / 2, self.side * self.radius)
        bars: list[Bar] = []
        for i in range(BEND_PARTS):
            angle = (i + 0.5) * step
            out = _point(math.sin(angle), -self.side * math.cos(angle))
            along = _point(math.cos(angle), self.side * math.sin(angle))
            half = self.radius * math.tan(step / 2)
            more = self.width / 2 * math.tan(step / 2)
            foot = centre + self.radius * out
            bars.append((foot - half * along, foot + half * along, more))
        return bars


ROUND_J = JHook()
"""First variant: the bend alone."""
BARBED_J = JHook(barb=0.05, rgba=(0.15, 0.55, 0.55, 1.0))
"""Second variant: the end leads back along the handle, so that things cannot slip out sideways."""


@dataclass(frozen=True, kw_only=True)
class THook(StraightHook):
    """A handle with a crossbar at its end, which pulls on either side."""

    length: float = param(0.34, "m", 0.20, 0.50)
    """Length of the handle, the width of the crossbar included."""
    tip: float = param(0.06, "m", 0.02, 0.12)
    """Distance by which the crossbar protrudes beside each face of the handle."""
    width: float = param(0.020, "m", 0.010, 0.040)
    height: float = param(0.025, "m", 0.015, 0.040)
    mass: float = param(0.14, "kg", 0.02, 0.5)
    friction: float = param(0.8, "1", 0.05, 1.5)
    rgba: Rgba = (0.45, 0.35, 0.65, 1.0)

    @property
    def bars(self) -> list[Bar]:
        half, middle = self.width / 2, self.length / 2 - self.width / 2
        return [
            (_point(-self.length / 2, 0), _point(self.length / 2 - self.width, 0), 0.0),
            (_point(middle, -half - self.tip), _point(middle, half + self.tip), 0.0),
        ]


def _point(x: float, y: float) -> NDArray[np.float64]:
    return np.array([x, y])


if __name__ == "__main__":
    for hook in (LHook(), ROUND_J, BARBED_J, THook()):
        show(hook)

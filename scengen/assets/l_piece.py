"""L-shaped pieces: flat slabs that lie on their broad face, for packing and fitting."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ..params import check_bounds, param
from .prop import PRIORITY, STIFF, show

PROUD = 0.0002
"""How far the five outer corners stand out below the edges [m]: a piece that lies on five points instead of twelve
costs half the time to simulate."""
INNER = 3
"""The corner of the outline that points inwards."""
Point = tuple[float, float]
"""A place seen from above [m], in the axes of a piece."""
Box = tuple[float, float, float, float]
"""Middle x and y, half width and half height [m], in the axes of a piece."""


@dataclass(frozen=True, kw_only=True)
class LPiece:
    """A rectangle `width` by `height` without its upper right corner. The origin is the middle of its foot.

        +--+            y
        |  |            |     The upright arm is `upright` wide,
        |  +-----+      +-x   the lying arm `lying` high.
        +--------+

    The paper gives no sizes (App. B, T33); an arm must be wide enough for a 27 mm suction cup.
    """

    width: float = param(0.080, "m", 0.03, 0.30)
    height: float = param(0.080, "m", 0.03, 0.30)
    upright: float = param(0.038, "m", 0.01, 0.20)
    lying: float = param(0.038, "m", 0.01, 0.20)
    thickness: float = param(0.020, "m", 0.006, 0.05)
    rounding: float = param(0.003, "m", 0.0005, 0.005)
    """Radius of the lower edges, as a moulded or sanded piece has them."""
    mass: float = param(0.060, "kg", 0.005, 1.0)
    friction: float = param(0.4, "1", 0.05, 1.5)
    rgba: tuple[float, float, float, float] = (0.86, 0.55, 0.24, 1.0)

    def __post_init__(self) -> None:
        check_bounds(self)

    @property
    def area(self) -> float:
        """Of the broad face [m^2]."""
        return self.width * self.lying + self.upright * (self.height - self.lying)

    @property
    def boxes(self) -> tuple[Box, Box]:
        """The lying arm over the whole width, and the rest of the upright arm on top of it."""
        rest = self.height - self.lying
        return (
            (0.0, (self.lying - self.height) / 2, self.width / 2, self.lying / 2),
            ((self.upright - self.width) / 2, self.lying / 2, self.upright / 2, rest / 2),
        )

    @property
    def centroid(self) -> tuple[float, float]:
        """Centre of mass, seen from above [m]."""
        (xa, ya, *a), (xb, yb, *b) = self.boxes
        share = a[0] * a[1] / (a[0] * a[1] + b[0] * b[1])
        return share * xa + (1 - share) * xb, share * ya + (1 - share) * yb

    def hold(self, cup: float) -> tuple[float, float]:
        """The point [m], seen from above, nearest to the centre of mass with `cup` [m] of face to each of its sides."""
        whole = (
            self.boxes[0],
            ((self.upright - self.width) / 2, 0.0, self.upright / 2, self.height / 2),
        )
        points = [_nearest(self.centroid, arm, cup) for arm in whole if min(arm[2:]) >= cup]
        if not points:
            raise ValueError(f"no arm of the piece is {2000 * cup:.0f} mm wide; a cup of that size finds no face")
        return min(points, key=lambda p: math.dist(p, self.centroid))

    @property
    def edges(self) -> list[tuple[Point, Point]]:
        """The outline of the foot, further in by the radius of the edges: six stretches, seen from above [m]."""
        r, x, y = self.rounding, self.width / 2, self.height / 2
        left, right, beside = r - x, x - r, self.upright - x - r
        near, far, above = r - y, y - r, self.lying - y - r
        ring = [(left, near), (right, near), (right, above), (beside, above), (beside, far), (left, far)]
        return list(zip(ring, [*ring[1:], ring[0]], strict=True))

    def spec(self) -> mujoco.MjSpec:
        """Boxes from the height of the rounding upwards, capsules along the lower edges, spheres at the corners."""
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="body")
        half = (self.thickness - self.rounding) / 2
        for name, (x, y, half_width, half_height) in zip(("lying", "upright"), self.boxes, strict=True):
            body.add_geom(
                name=name,
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[half_width, half_height, half],
                pos=[x, y, self.rounding + half],
                mass=self.mass * 4 * half_width * half_height / self.area,
                friction=[self.friction, 0.005, 0.0001],
                condim=4,
                solref=STIFF,
                priority=PRIORITY,
                rgba=self.rgba,
            )
        for i, (start, end) in enumerate(self.edges):
            edge = body.add_geom(name=f"edge_{i}", type=mujoco.mjtGeom.mjGEOM_CAPSULE)
            edge.fromto = np.array([*start, self.rounding + PROUD, *end, self.rounding + PROUD])
            self._finish(edge)
            if i != INNER:
                corner = body.add_geom(name=f"corner_{i}", type=mujoco.mjtGeom.mjGEOM_SPHERE)
                corner.pos = np.array([*start, self.rounding])
                self._finish(corner)
        return spec

    def _finish(self, geom: mujoco.MjsGeom) -> None:
        """What all round parts have in common. The boxes carry the mass."""
        geom.size = np.array([self.rounding, 0.0, 0.0])
        geom.mass, geom.priority = 0.0, PRIORITY
        geom.friction = np.array([self.friction, 0.005, 0.0001])
        geom.solref, geom.rgba = np.array(STIFF), np.array(self.rgba, np.float32)


def _nearest(point: tuple[float, float], box: Box, margin: float) -> tuple[float, float]:
    """The point of `box`, `margin` away from its edges, that is nearest to `point`."""
    x, y, half_width, half_height = box
    return (
        min(max(point[0], x - half_width + margin), x + half_width - margin),
        min(max(point[1], y - half_height + margin), y + half_height - margin),
    )


if __name__ == "__main__":
    show(LPiece())

"""Holed cuboid cage: a thin-walled box with one round hole in one of its faces.

       ________________
      |    _           |      side view; the hole is where the floor ends near +x
      |___(_)_____   __|

Collision geometry is an exact convex decomposition. Plates are boxes. Rays from the hole's centre cut the part of the
holed plate around the hole into wedges, whose inner faces touch the circle from outside. So the hole is a regular
polygon that contains the nominal circle, and the cavity is the nominal cuboid: a ball narrower than the hole does not
stick, and a wider one does not pass.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..geometry import Mat3, Vec3
from ..params import param
from .prop import BOX, Prop, Rgba, show, shown, solid

if TYPE_CHECKING:
    from manifold3d import Manifold

WEDGES = 20
"""Number of sides of the polygon. Its corners lie radius * (1 / cos(pi / 20) - 1) outside the circle: 1.2 % of the
radius, 0.37 mm for the largest hole within the bounds."""
SEGMENTS = 64
"""Number of sides of the circle in pictures, which is within 0.02 mm of the true one at the nominal radius."""

MIN_SIZE = 1e-6
"""Size below which strips of plate are left out [m]: MuJoCo refuses boxes without extent."""

BOTTOM = 0
"""Value of `face` for a hole in the bottom."""
END = 1
"""Value of `face` for a hole in the end at +x. For the other end, turn the cage round."""
SIDE = 2
"""Value of `face` for a hole in the side at +y. For the other side, turn the cage round."""
TOP = 3
"""Value of `face` for a hole in the top."""
FACES = {BOTTOM: (2, -1, 0), END: (0, 1, 1), SIDE: (1, 1, 0), TOP: (2, 1, 0)}
"""Axis and sign of the outward normal of each face, and the axis of `offset`."""

MESH = mujoco.mjtGeom.mjGEOM_MESH
Box = tuple[Vec3, Vec3]
"""Centre and full size of a cuboid [m]."""


@dataclass(frozen=True, kw_only=True)
class HoledCage(Prop):
    """A closed box with one round hole. x is the long axis; the origin is the centre of the base.

    The paper gives no lengths (App. C: "one circular hole on a configurable face"). Ours fit the task's hand: the
    width leaves 30 mm of the Panda's 80 mm jaw. The mass is that of the box in 3 mm acrylic (86 cm^3 at 1.19 g/cm^3).
    """

    length: float = param(0.130, "m", 0.08, 0.20)
    width: float = param(0.050, "m", 0.03, 0.075)
    height: float = param(0.050, "m", 0.03, 0.10)
    wall: float = param(0.003, "m", 0.002, 0.008)
    face: int = param(BOTTOM, "0 bottom, 1 end, 2 side, 3 top", BOTTOM, TOP)
    hole: float = param(0.0175, "m", 0.005, 0.03)
    """Radius of the hole."""
    offset: float = param(0.043, "m", -0.08, 0.08)
    """Position of the hole's centre, from the middle of its face, along x (on an end: along y)."""
    mass: float = param(0.100, "kg", 0.02, 0.5)
    friction: float = param(0.6, "1", 0.05, 1.5)
    closed: bool = False
    """Whether the hole is closed: the same cage without an exit."""
    rgba: Rgba = (0.35, 0.62, 0.85, 0.25)

    # --- geometry, in the cage's own axes -------------------------------------------------

    @cached_property
    def size(self) -> Vec3:
        """Outer edges along x, y and z [m]."""
        return np.array([self.length, self.width, self.height])

    @cached_property
    def middle(self) -> Vec3:
        """Centre of the cuboid [m]."""
        return np.array([0.0, 0.0, self.height / 2])

    @cached_property
    def cavity(self) -> Vec3:
        """Inner edges along x, y and z [m]."""
        return self.size - 2 * self.wall

    @cached_property
    def normal(self) -> Vec3:
        """Unit vector out of the holed face."""
        axis, sign, _ = FACES[self.face]
        return sign * np.eye(3)[axis]

    @cached_property
    def hole_centre(self) -> Vec3:
        """Centre of the hole, halfway through the wall [m]."""
        axis, _, along = FACES[self.face]
        return self.middle + (self.size[axis] - self.wall) / 2 * self.normal + self.offset * np.eye(3)[along]

    @cached_property
    def margin(self) -> float:
        """Smallest distance from the rim of the hole to the walls beside its face [m]; negative: it does not fit."""
        axis, _, along = FACES[self.face]
        return min(self.cavity[along] / 2 - abs(self.offset), self.cavity[3 - axis - along] / 2) - self.hole

    def rim_tilt(self, radius: float) -> float:
        """Tilt at which a ball rolls over the rim of a hole in an upright wall [rad]; 0 for holes in bottom and top.

        The ball lies against the wall and turns about the lowest point of the rim, once the vertical through its centre
        passes that point: cos(tilt) = 1 - height / radius. If the rim is as high as the centre, it is a right angle.
        """
        height = self.cavity[2] / 2 - self.hole if self.face in (END, SIDE) else 0.0
        return math.acos(min(1.0, max(0.0, 1 - height / radius)))

    def passes(self, place: Vec3, radius: float) -> bool:
        """Whether a ball with its centre at `place` is on its way out: in the hole, with its centre beyond the wall's.

        A ball slower than 1.5 m/s is there for at least 10 ms.
        """
        away = place - self.hole_centre
        depth = float(away @ self.normal)
        return 0.0 <= depth < radius and float(away @ away) - depth**2 < self.hole**2

    # --- mass -----------------------------------------------------------------------------

    def inertial(self) -> tuple[Vec3, Mat3]:
        """Centre of mass [m] and inertia about it [kg m^2].

        The body is cuboid - cavity - hole at uniform density:
        inertia = density * sum over the parts of +-(own + volume * (|d|^2 - d d^T)), d from the common centre of mass.
        For a cuboid with edges e, own = volume / 12 * (|e|^2 - e e^T, diagonal only). For the hole, a disc of radius R
        and thickness w, own is volume * R^2 / 2 about its axis and volume * (3 R^2 + w^2) / 12 across it.
        """
        parts = [_cuboid(self.middle, self.size, 1.0), _cuboid(self.middle, self.cavity, -1.0)]
        if not self.closed:
            axis = FACES[self.face][0]
            own = np.full(3, (3 * self.hole**2 + self.wall**2) / 12)
            own[axis] = self.hole**2 / 2
            parts.append((-math.pi * self.hole**2 * self.wall, self.hole_centre, np.diag(own)))
        volume = sum(v for v, _, _ in parts)
        com = sum((v * centre for v, centre, _ in parts), np.zeros(3)) / volume
        inertia = np.zeros((3, 3))
        for v, centre, own in parts:
            d = centre - com
            inertia += v * (own + d @ d * np.eye(3) - np.outer(d, d))
        return com, self.mass / volume * inertia

    # --- collision geometry ---------------------------------------------------------------

    def boxes(self) -> list[Box]:
        """Cuboids that form the cage together with the wedges. Plates overlap at the edges of the cage."""
        plates = []
        for axis in range(3):
            for sign in (-1, 1):
                if self.closed or FACES[self.face][:2] != (axis, sign):
                    low, high = -self.size / 2, self.size / 2
                    low[axis], high[axis] = sorted((sign * self.size[axis] / 2, sign * self.cavity[axis] / 2))
                    plates.append(_box(self.middle + low, self.middle + high))
        return plates + ([] if self.closed else self._beside_patch())

    def wedges(self) -> list[NDArray[np.float64]]:
        """Corners of the convex prisms around the hole [m], each of shape (n, 3)."""
        if self.closed:
            return []
        axis, _, along = FACES[self.face]
        across = 3 - axis - along
        prisms = []
        for flat in self._wedges_in_plane():
            points = np.tile(self.hole_centre, (2 * len(flat), 1))
            points[:, along] += np.tile(flat[:, 0], 2)
            points[:, across] += np.tile(flat[:, 1], 2)
            points[:, axis] += np.repeat([-self.wall / 2, self.wall / 2], len(flat))
            prisms.append(points)
        return prisms

    def _patch(self) -> tuple[float, float, float]:
        """Both ends and half width of the rectangle that is cut into wedges, from the hole's centre [m]."""
        axis, _, along = FACES[self.face]
        half, reach = self.size[along] / 2, self.hole / math.cos(math.pi / WEDGES) + self.wall
        ends = max(-half - self.offset, -reach), min(half - self.offset, reach)
        return *ends, self.size[3 - axis - along] / 2

    def _beside_patch(self) -> list[Box]:
        """Parts of the holed plate beside the patch."""
        axis, _, along = FACES[self.face]
        start, stop, _ = self._patch()
        half, boxes = self.size[along] / 2, []
        for low, high in ((-half - self.offset, start), (stop, half - self.offset)):
            if high - low > MIN_SIZE:
                centre, size = self.hole_centre.copy(), self.size.copy()
                centre[along] += (low + high) / 2
                size[axis], size[along] = self.wall, high - low
                boxes.append((centre, size))
        return boxes

    def _wedges_in_plane(self) -> list[NDArray[np.float64]]:
        """Convex polygons around the hole's centre, each between two rays, the circle and the patch's border."""
        start, stop, half = self._patch()
        corners = [np.array([x, y]) for x in (start, stop) for y in (-half, half)]
        step = 2 * math.pi / WEDGES
        polygons = []
        for middle in step * np.arange(WEDGES):
            mid = np.array([math.cos(middle), math.sin(middle)])
            rays = [np.array([math.cos(middle + s), math.sin(middle + s)]) for s in (-step / 2, step / 2)]
            inner = [self.hole / math.cos(step / 2) * ray for ray in rays]
            outer = [_exit_distance(ray, start, stop, half) * ray for ray in rays]
            outer += [c for c in corners if c @ mid > math.cos(step / 2) * math.hypot(*c)]
            polygons.append(np.array(inner + outer))
        return polygons

    # --- body -----------------------------------------------------------------------------

    def manifold(self) -> "Manifold":
        """The exact body by constructive solid geometry, for pictures and as the reference for the decomposition."""
        from manifold3d import Manifold

        def block(centre: Vec3, size: Vec3) -> Manifold:
            return Manifold.cube(size.tolist(), True).translate(centre.tolist())

        body = block(self.middle, self.size) - block(self.middle, self.cavity)
        if self.closed:
            return body
        bore = Manifold.cylinder(2 * self.wall, self.hole, circular_segments=SEGMENTS, center=True)
        turn = {BOTTOM: (0, 0, 0), END: (0, 90, 0), SIDE: (90, 0, 0), TOP: (0, 0, 0)}[self.face]
        return body - bore.rotate(turn).translate(self.hole_centre.tolist())

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        com, inertia = self.inertial()
        body.explicitinertial, body.mass, body.ipos = True, self.mass, com
        body.fullinertia = np.array([*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]])
        for i, (centre, size) in enumerate(self.boxes()):
            self._add_collider(body, f"box_{i}", BOX, size / 2, centre)
        for i, corners in enumerate(self.wedges()):
            spec.add_mesh(name=f"wedge_{i}", uservert=corners.ravel().tolist())
            self._add_collider(body, f"wedge_{i}", MESH).meshname = f"wedge_{i}"
        look = self.manifold().to_mesh()
        spec.add_mesh(
            name="look",
            uservert=np.asarray(look.vert_properties, float)[:, :3].ravel().tolist(),
            userface=np.asarray(look.tri_verts).ravel().tolist(),
        )
        shown(body, "look", self.rgba, type=MESH).meshname = "look"

    def _add_collider(
        self, body: mujoco.MjsBody, name: str, type: mujoco.mjtGeom, size: ArrayLike = (), pos: ArrayLike = (0, 0, 0)
    ) -> mujoco.MjsGeom:
        """Add a geom of the decomposition. Group 3 is not drawn; pictures show the mesh."""
        return solid(body, name, size, pos, type=type, friction=self.friction, mass=0.0, group=3)


def lowered(tilt: float) -> Vec3:
    """Unit vector down, in the axes of a cage whose end at +x is lowered by `tilt` [rad]."""
    return np.array([math.sin(tilt), 0.0, -math.cos(tilt)])


def _box(low: ArrayLike, high: ArrayLike) -> Box:
    """A cuboid between two corners."""
    first, last = np.asarray(low, float), np.asarray(high, float)
    return (first + last) / 2, last - first


def _cuboid(centre: Vec3, size: Vec3, sign: float) -> tuple[float, Vec3, Mat3]:
    """Signed volume [m^3], centre [m], and inertia about it per volume [m^2]."""
    own = (size @ size - size**2) / 12
    return sign * float(np.prod(size)), centre, np.diag(own)


def _exit_distance(ray: NDArray[np.float64], start: float, stop: float, half: float) -> float:
    """Distance from the hole's centre at which a ray leaves the patch [m]."""
    ends = [(stop if ray[0] > 0 else start) / ray[0]] if ray[0] else []
    return min([*ends, *([half / abs(ray[1])] if ray[1] else [])])


if __name__ == "__main__":
    show(HoledCage())

"""A body of convex pieces."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..assets.prop import Prop, Rgba, shown, solid
from ..assets.turned import FOOT
from ..geometry import Mat3, Vec3

Points = NDArray[np.float64]
"""Shape (n, 3) [m]."""

MESH, SPHERE = mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SPHERE
HUES: tuple[Rgba, ...] = (
    (0.90, 0.62, 0.00, 1.0),
    (0.34, 0.71, 0.91, 1.0),
    (0.00, 0.62, 0.45, 1.0),
    (0.94, 0.89, 0.26, 1.0),
    (0.00, 0.45, 0.70, 1.0),
    (0.84, 0.37, 0.00, 1.0),
    (0.80, 0.47, 0.65, 1.0),
)
"""Colours that neighbouring pieces are told apart by (Okabe and Ito)."""


@dataclass(frozen=True, kw_only=True)
class MeshProp(Prop):
    """A body of convex pieces, with the mesh that they stand for to be looked at. It stands on z = 0.

    Points are in axes that are parallel to the mesh file's; the origin is below the centre of mass.
    """

    corners: tuple[Points, ...]
    """Vertices of each piece."""
    feet: Points
    """Centres of the spheres that it stands on."""
    vertices: Points
    faces: NDArray[np.int64]
    """What is shown: vertices [m], and triangles, shape (n, 3)."""
    mass: float
    com: Vec3
    inertia: Mat3
    """About the centre of mass [kg m^2]."""
    friction: float = 0.6
    rgba: Rgba = (0.72, 0.66, 0.55, 1.0)
    bare: bool = False
    """Whether its pieces are shown instead of the mesh."""

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        body.explicitinertial, body.mass, body.ipos = True, self.mass, self.com
        i = self.inertia
        body.fullinertia = np.array([*np.diag(i), i[0, 1], i[0, 2], i[1, 2]])
        for k, points in enumerate(self.corners):
            spec.add_mesh(name=f"piece_{k}", uservert=points.ravel().tolist())
            piece = solid(body, f"piece_{k}", (), type=MESH, friction=self.friction, mass=0.0, rgba=HUES[k % len(HUES)])
            piece.meshname, piece.group = f"piece_{k}", 0 if self.bare else 3
        for k, foot in enumerate(self.feet):
            solid(body, f"foot_{k}", [FOOT], foot, type=SPHERE, friction=self.friction, mass=0.0, group=3)
        if self.bare:
            return
        spec.add_mesh(name="look", uservert=self.vertices.ravel().tolist(), userface=self.faces.ravel().tolist())
        shown(body, "look", self.rgba, type=MESH).meshname = "look"

"""A body of convex pieces, and its representation as plain data in a manifest."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..geometry import Mat3, Vec3
from .prop import Prop, Rgba, shown, solid
from .turned import FOOT_RADIUS

Points = NDArray[np.float64]
"""Points, shape (n, 3) [m]."""
Palette = tuple[Rgba, ...]
"""Colours."""

DIGITS = 7
"""Number of decimals of a length in a manifest [m]. Simulations always use the rounded lengths."""
MAX_NUMBERS = 100_000
"""Largest number of entries in an array of a manifest."""
ARRAY_SHAPES = {"feet": (-1, 3), "vertices": (-1, 3), "com": (3,), "inertia": (3, 3)}
"""Shapes of the arrays in a manifest; -1 stands for any length."""

MESH = mujoco.mjtGeom.mjGEOM_MESH
SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE
PIECE_COLOURS: tuple[Rgba, ...] = (
    (0.90, 0.62, 0.00, 1.0),
    (0.34, 0.71, 0.91, 1.0),
    (0.00, 0.62, 0.45, 1.0),
    (0.94, 0.89, 0.26, 1.0),
    (0.00, 0.45, 0.70, 1.0),
    (0.84, 0.37, 0.00, 1.0),
    (0.80, 0.47, 0.65, 1.0),
)
"""Colours of the pieces, which make neighbouring pieces distinguishable (Okabe and Ito)."""


@dataclass(frozen=True, kw_only=True)
class MeshProp(Prop):
    """A body of convex pieces for collisions, and the original mesh for pictures. It stands on z = 0.

    The axes of all points are those of the mesh file after it was turned upright. The origin is below the centre of
    mass.
    """

    corners: tuple[Points, ...]
    """Vertices of each piece."""
    feet: Points
    """Centres of the spheres on which it stands."""
    vertices: Points
    """Vertices of the mesh that pictures show [m]."""
    faces: NDArray[np.int64]
    """Triangles of the mesh that pictures show, as indices of vertices, shape (n, 3)."""
    mass: float
    """Mass [kg]."""
    com: Vec3
    """Centre of mass [m]."""
    inertia: Mat3
    """Inertia about the centre of mass [kg m^2]."""
    friction: float = 0.6
    rgba: Rgba = (0.72, 0.66, 0.55, 1.0)
    palette: Palette = ()
    """Colours of the mesh that pictures show; none for `rgba` alone. Manifests do not hold them."""
    painted: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Index in the palette of each triangle, shape (n,)."""
    bare: bool = False
    """Whether pictures show the pieces instead of the mesh."""

    def looks(self) -> Iterator[tuple[Rgba, Points, NDArray[np.int64]]]:
        """Colour, vertices and triangles of each part of the mesh that pictures show."""
        if not self.palette:
            yield self.rgba, self.vertices, self.faces
        for k, rgba in enumerate(self.palette):
            used, faces = np.unique(self.faces[self.painted == k], return_inverse=True)
            yield rgba, self.vertices[used], faces.reshape(-1, 3)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        body.explicitinertial, body.mass, body.ipos = True, self.mass, self.com
        i = self.inertia
        body.fullinertia = np.array([*np.diag(i), i[0, 1], i[0, 2], i[1, 2]])
        for k, points in enumerate(self.corners):
            spec.add_mesh(name=f"piece_{k}", uservert=points.ravel().tolist())
            piece = solid(
                body,
                f"piece_{k}",
                (),
                type=MESH,
                friction=self.friction,
                mass=0.0,
                rgba=PIECE_COLOURS[k % len(PIECE_COLOURS)],
            )
            piece.meshname, piece.group = f"piece_{k}", 0 if self.bare else 3
        for k, foot in enumerate(self.feet):
            solid(body, f"foot_{k}", [FOOT_RADIUS], foot, type=SPHERE, friction=self.friction, mass=0.0, group=3)
        if self.bare:
            return
        for k, (rgba, vertices, faces) in enumerate(self.looks()):
            name = f"look_{k}" if k else "look"
            look = spec.add_mesh(name=name, uservert=vertices.ravel().tolist(), userface=faces.ravel().tolist())
            if self.palette:
                look.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # a patch encloses no volume
            shown(body, name, rgba, type=MESH).meshname = name

    def written(self) -> dict[str, Any]:
        """The body as plain data. Lengths are rounded to `DIGITS`; masses and inertias keep all digits."""
        return {
            "corners": [np.round(points, DIGITS).tolist() for points in self.corners],
            "faces": self.faces.tolist(),
            **{name: np.round(getattr(self, name), DIGITS).tolist() for name in ("feet", "vertices", "com")},
            **{name: np.asarray(getattr(self, name)).tolist() for name in ("inertia", "mass", "friction")},
        }

    @classmethod
    def read(cls, data: Mapping[str, Any]) -> Self:
        """The body of which `written` gave the data.

        Raises:
            ValueError: the data do not describe a body.
        """
        known = {field.name for field in fields(cls)} - {"rgba", "bare", "palette", "painted"}
        if not isinstance(data, Mapping) or set(data) != known:
            raise ValueError(f"expected {', '.join(sorted(known))}")
        corners = tuple(_numbers("corners", points, (-1, 3)) for points in data["corners"])
        arrays: dict[str, Any] = {name: _numbers(name, data[name], shape) for name, shape in ARRAY_SHAPES.items()}
        faces = _numbers("faces", data["faces"], (-1, 3)).astype(np.int64)
        if not corners or not len(faces) or faces.min() < 0 or faces.max() >= len(arrays["vertices"]):
            raise ValueError("its pieces or triangles are missing, or refer to vertices that do not exist")
        mass, friction = (float(_numbers(name, data[name], ())) for name in ("mass", "friction"))
        return cls(corners=corners, faces=faces, mass=mass, friction=friction, **arrays)


def _numbers(name: str, data: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Finite numbers as an array of a shape, in which -1 stands for any length."""
    found = np.asarray(data, np.float64)
    if not len(shape) and found.ndim == 0 and np.isfinite(found):
        return found
    fits = found.ndim == len(shape) and all(want in (-1, have) for want, have in zip(shape, found.shape, strict=True))
    if not fits or not shape or found.size > MAX_NUMBERS or not np.isfinite(found).all():
        raise ValueError(f"its {name} must be finite numbers of shape {shape}")
    return found

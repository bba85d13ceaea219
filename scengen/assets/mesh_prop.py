"""A body of convex pieces, and its representation as plain data: in a manifest, or in a file that a task names."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import BadConfig, ScengenError, cut
from ..geometry import Mat3, Vec3
from ..params import param
from .prop import Prop, Rgba, shown, solid
from .turned import FOOT_RADIUS

Points = NDArray[np.float64]
"""Points, shape (n, 3) [m]."""
Palette = tuple[Rgba, ...]
"""Colours."""

DIGITS = 7
"""Number of decimals of a length in a manifest [m]. Simulations always use the rounded lengths."""
MAX_NUMBERS = 300_000
"""Largest number of entries in an array: a mesh of several colours has up to some 50 000 triangles."""
ARRAY_SHAPES = {"feet": (-1, 3), "vertices": (-1, 3), "com": (3,), "inertia": (3, 3)}
"""Shapes of the arrays; -1 stands for any length."""
COLOURING = ("palette", "painted")
"""Parts of the data that a mesh of one colour lacks."""
FILE = "prop.json"
"""Name of the file in the folder that `scengen asset mesh=` writes."""

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
    mass. A task uses one that `load` reads, as a field or in `build`.
    """

    corners: tuple[Points, ...] = field(compare=False, repr=False)
    """Vertices of each piece."""
    feet: Points = field(compare=False, repr=False)
    """Centres of the spheres on which it stands."""
    vertices: Points = field(compare=False, repr=False)
    """Vertices of the mesh that pictures show [m]."""
    faces: NDArray[np.int64] = field(compare=False, repr=False)
    """Triangles of the mesh that pictures show, as indices of vertices, shape (n, 3)."""
    mass: float = param(1.0, "kg", 1e-5, 1e4)
    friction: float = param(0.6, "1", 0.0, 2.0)
    com: Vec3 = field(compare=False, repr=False)
    """Centre of mass [m]."""
    inertia: Mat3 = field(compare=False, repr=False)
    """Inertia about the centre of mass at the mass `weighed` [kg m^2]."""
    weighed: float = field(compare=False, repr=False)
    """Mass with which the body was made [kg]."""
    rgba: Rgba = (0.72, 0.66, 0.55, 1.0)
    palette: Palette = field(default=(), compare=False, repr=False)
    """Colours of the mesh that pictures show; none for `rgba` alone."""
    painted: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64), compare=False, repr=False)
    """Index in the palette of each triangle, shape (n,)."""
    bare: bool = False
    """Whether pictures show the pieces instead of the mesh."""
    made: str = field(init=False, repr=False)
    """Hash of the body as it was made, without `mass` and `friction`."""

    def __post_init__(self) -> None:
        parts = (*self.corners, self.feet, self.vertices, self.faces, self.com, self.inertia, self.painted)
        told = [np.ascontiguousarray(part).tobytes() for part in parts]
        told.append(repr((list(map(len, self.corners)), self.weighed, self.palette)).encode())
        object.__setattr__(self, "made", hashlib.sha256(b"".join(told)).hexdigest())
        super().__post_init__()

    @property
    def material(self) -> str:
        return self.made

    @cached_property
    def size(self) -> Vec3:
        """Outer size along its own axes, shape (3,) [m]."""
        return np.ptp(np.vstack(self.corners), axis=0)

    def looks(self) -> Iterator[tuple[Rgba, Points, NDArray[np.int64]]]:
        """Colour, vertices and triangles of each part of the mesh that pictures show."""
        if not self.palette:
            yield self.rgba, self.vertices, self.faces
        for k, rgba in enumerate(self.palette):
            used, faces = np.unique(self.faces[self.painted == k], return_inverse=True)
            yield rgba, self.vertices[used], faces.reshape(-1, 3)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        body.explicitinertial, body.mass, body.ipos = True, self.mass, self.com
        i = self.inertia * (self.mass / self.weighed)
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
        inertia = self.inertia * (self.mass / self.weighed)
        colouring = {"palette": [list(rgba) for rgba in self.palette], "painted": self.painted.tolist()}
        return {
            "corners": [np.round(points, DIGITS).tolist() for points in self.corners],
            "faces": self.faces.tolist(),
            **{name: np.round(getattr(self, name), DIGITS).tolist() for name in ("feet", "vertices", "com")},
            "inertia": inertia.tolist(),
            "mass": float(self.mass),
            "friction": float(self.friction),
            **(colouring if self.palette else {}),
        }

    @classmethod
    def read(cls, data: Mapping[str, Any]) -> Self:
        """The body of which `written` gave the data.

        Raises:
            ValueError: the data do not describe a body.
        """
        known = {"corners", "faces", "mass", "friction", *ARRAY_SHAPES}
        if not isinstance(data, Mapping) or set(data) not in (known, known.union(COLOURING)):
            raise ValueError(f"expected {', '.join(sorted(known))}")
        corners = tuple(_numbers("corners", points, (-1, 3)) for points in data["corners"])
        arrays: dict[str, Any] = {name: _numbers(name, data[name], shape) for name, shape in ARRAY_SHAPES.items()}
        faces = _numbers("faces", data["faces"], (-1, 3)).astype(np.int64)
        if not corners or not len(faces) or faces.min() < 0 or faces.max() >= len(arrays["vertices"]):
            raise ValueError("its pieces or triangles are missing, or refer to vertices that do not exist")
        mass, friction = (float(_numbers(name, data[name], ())) for name in ("mass", "friction"))
        colours = _colouring(data, len(faces)) if "palette" in data else {}
        return cls(corners=corners, faces=faces, mass=mass, weighed=mass, friction=friction, **arrays, **colours)

    @classmethod
    def load(cls, folder: str | Path, beside: str | Path | None = None) -> Self:
        """The body in a folder that `scengen asset mesh=FILE to=FOLDER` has written.

        A module of a package names a folder of the package: `MeshProp.load("assets/can", __file__)`. The mesh is then
        part of the package, and of the ids of scenarios that have the body as a field.

        Args:
            folder: the folder.
            beside: file next to which a relative path lies. Default: the path starts in the working folder.

        Raises:
            BadConfig: there is no such folder, or its file is not that of a body.
        """
        place = Path(folder) if beside is None else Path(beside).resolve().parent / folder
        if not (place / FILE).is_file():
            what = "has no" if place.is_dir() else "is not a folder with"
            raise BadConfig(
                f"{cut(str(place))} {what} {FILE}; write it with scengen asset mesh=FILE to={cut(str(folder))}"
            )
        try:
            return cls.read(json.loads((place / FILE).read_text()))
        except (ValueError, TypeError, OSError, RecursionError, ScengenError) as error:
            raise BadConfig(
                f"{cut(str(place / FILE))} is not the file of a body ({cut(str(error))}); write it again with scengen "
                "asset mesh=FILE"
            ) from None


def _colouring(data: Mapping[str, Any], triangles: int) -> dict[str, Any]:
    """Palette and colour of each triangle, from the data of a body."""
    palette = _numbers("palette", data["palette"], (-1, 4))
    painted = _numbers("painted", data["painted"], (-1,)).astype(np.int64)
    if len(painted) != triangles or palette.min() < 0.0 or palette.max() > 1.0:
        raise ValueError("its colours must lie in [0, 1], one for each triangle")
    if set(painted.tolist()) != set(range(len(palette))):
        raise ValueError("its palette must hold the colours of its triangles, and no others")
    return {"palette": tuple(map(tuple, palette.tolist())), "painted": painted}


def _numbers(name: str, data: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Finite numbers as an array of a shape, in which -1 stands for any length."""
    found = np.asarray(data, np.float64)
    if not len(shape) and found.ndim == 0 and np.isfinite(found):
        return found
    if found.shape == (0,) and shape[:1] == (-1,):
        return np.zeros((0, *shape[1:]))
    fits = found.ndim == len(shape) and all(want in (-1, have) for want, have in zip(shape, found.shape, strict=True))
    if not fits or not shape or found.size > MAX_NUMBERS or not np.isfinite(found).all():
        raise ValueError(f"its {name} must be finite numbers of shape {shape}")
    return found

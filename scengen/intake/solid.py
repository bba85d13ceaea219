"""Reads a mesh file as a solid: repairs it if that does not change the shape, and refuses it if it is not a solid."""

import hashlib
import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import Error, Manifold, Mesh64
from numpy.typing import NDArray

from ..assets.mesh_prop import Points
from ..errors import BadConfig, UnknownName, cut, nearest
from ..work.targets import remedy

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Length of each unit [m]."""
FORMATS = ("glb", "obj", "off", "ply", "stl")
"""Endings of the names of mesh files."""
MIN_EXTENT = 0.005
"""Smallest accepted extent of a thing for a Panda [m]; the extent is the longest edge of the bounding box."""
MAX_EXTENT = 1.0
"""Largest accepted extent of a thing for a Panda, whose reach is 0.855 m [m]."""
MIN_WALL = 0.0015
"""Smallest thickness of walls [m]: thinner walls let small balls through at moderate speed."""
MAX_THIN_SHARE = 0.1
"""Largest share of the surface that may be thinner, as scans have fringes."""
MAX_BYTES = 200_000_000
"""Largest size of a mesh file [bytes]."""
RAYS = 2000
"""Number of points at which the thickness is measured."""


@dataclass(frozen=True)
class MeshSolid:
    """A closed body in one part, in metres."""

    file: str
    """Name of the mesh file."""
    sha256: str
    """Hash of the content of the file."""
    manifold: Manifold
    merged: int
    """Number of vertices that were merged with another one at the same position."""
    dropped: int
    """Number of triangles without area that were removed by the merging."""
    thin: float
    """Share of the surface under which the solid is thinner than `MIN_WALL`."""

    @property
    def mesh(self) -> trimesh.Trimesh:
        """Its surface as triangles."""
        return as_mesh(self.manifold)


def as_mesh(manifold: Manifold) -> trimesh.Trimesh:
    """The surface of a solid as triangles."""
    found = manifold.to_mesh64()
    points = np.asarray(found.vert_properties)[:, :3]
    return trimesh.Trimesh(points, np.asarray(found.tri_verts, np.int64), process=False)


def sampled(mesh: trimesh.Trimesh, count: int, rng: np.random.Generator) -> tuple[Points, NDArray[np.int64]]:
    """Points with uniform distribution over a surface, and the index of the triangle of each."""
    areas = mesh.area_faces
    faces = rng.choice(len(areas), count, p=areas / areas.sum())
    root, share = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    a, b, c = np.moveaxis(mesh.triangles[faces], 1, 0)
    return (1 - root) * a + root * (1 - share) * b + root * share * c, faces


def read(path: str, units: str | None = None, seed: int = 0) -> MeshSolid:
    """Read a mesh file.

    Args:
        units: unit of the numbers in the file, one of `UNITS`. Default: metres.
        seed: seed of the points at which the thickness is measured.

    Raises:
        BadConfig: there is no such file, it cannot be read, or it does not hold a solid that a scene can use.
        UnknownName: there is no such unit.
    """
    if units is not None and units not in UNITS:
        raise UnknownName("unit", units, UNITS)
    data = content(path)
    points, faces = _triangles(path, data)
    points = points * UNITS[units or "m"]
    whole, inverse = np.unique(points, axis=0, return_inverse=True)
    joined = inverse.reshape(-1)[faces]
    kept = joined[(joined != np.roll(joined, 1, axis=1)).all(axis=1)]
    manifold = _manifold(path, whole, kept)
    _check_size(path, whole, units)
    thin, median = _thinness(manifold, seed)
    if thin > MAX_THIN_SHARE:
        raise BadConfig(
            f"{cut(path)} is thinner than {1000 * MIN_WALL:g} mm under {thin:.0%} of its surface (half of it is "
            f"thinner than {1000 * median:.1f} mm), and thin walls let things through; "
            f"give it walls of {1000 * MIN_WALL:g} mm"
        )
    sha256 = hashlib.sha256(data).hexdigest()
    return MeshSolid(Path(path).name, sha256, manifold, len(points) - len(whole), len(faces) - len(kept), thin)


def content(path: str) -> bytes:
    """The bytes of a mesh file.

    Raises:
        BadConfig: there is no such file, or it is not a mesh file.
    """
    file = Path(path)
    ending = file.suffix[1:].lower()
    try:
        if file.is_dir():
            raise BadConfig(f"{cut(path)} is a folder; name a mesh file")
        if not file.is_file():
            siblings = [p.name for p in file.parent.iterdir()] if file.parent.is_dir() else []
            raise BadConfig(f"there is no file {cut(path)}{nearest(file.name, siblings)}; name a mesh file")
        if ending not in FORMATS:
            known = ", ".join(f".{form}" for form in FORMATS)
            raise BadConfig(f"{cut(path)}: no mesh format named {cut(repr(file.suffix))}; known: {known}")
        if file.stat().st_size > MAX_BYTES:
            raise BadConfig(f"{cut(path)} has more than {MAX_BYTES // 10**6} MB; give a mesh with fewer triangles")
        return file.read_bytes()
    except OSError as error:
        raise BadConfig(f"{cut(path)} cannot be read: {remedy(error) or 'choose another file'}") from None


def _triangles(path: str, data: bytes) -> tuple[Points, NDArray[np.int64]]:
    """Vertices and triangles of a file, with the parts of a scene merged."""
    ending = Path(path).suffix[1:].lower()
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # it logs problems to standard error
    try:
        found = trimesh.load(
            trimesh.util.wrap_as_stream(data), file_type=ending, force="mesh", process=False, skip_materials=True
        )
        points = np.asarray(getattr(found, "vertices", np.zeros((0, 3))), np.float64)
        faces = np.asarray(getattr(found, "faces", np.zeros((0, 3))), np.int64)
    except Exception as error:  # the type of the error for a damaged file depends on the format
        what = cut(" ".join(str(error).split()), 80) or type(error).__name__
        raise BadConfig(
            f"{cut(path)} cannot be read as a .{ending} file ({what}); see the program that made it"
        ) from None
    if not len(faces):
        raise BadConfig(f"{cut(path)} holds no triangles; expected a mesh, not points or lines")
    if not np.isfinite(points).all() or faces.min() < 0 or faces.max() >= len(points):
        raise BadConfig(f"{cut(path)} has vertices that are not numbers or do not exist; expected a valid mesh")
    return points, faces


def _manifold(path: str, points: Points, faces: NDArray[np.int64]) -> Manifold:
    mesh = Mesh64(np.ascontiguousarray(points), np.ascontiguousarray(faces.astype(np.uint64)))
    manifold = Manifold(mesh)
    if manifold.status() != Error.NoError:
        mesh.merge()  # closes seams whose two sides differ by rounding
        manifold = Manifold(mesh)
    if manifold.status() != Error.NoError:
        directed = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, uses = np.unique(directed, axis=0, return_counts=True)
        if open_edges := int((uses % 2).sum()):
            raise BadConfig(
                f"{cut(path)} is open: {open_edges} edges have a triangle on one side only; close its holes"
            )
        raise BadConfig(f"{cut(path)} has triangles that face both ways; make all of them face outwards")
    parts = manifold.decompose()
    volumes = sorted((part.volume() for part in parts), reverse=True)
    if not volumes or manifold.volume() == 0.0:
        raise BadConfig(f"{cut(path)} is flat: it encloses no volume; give it walls of {1000 * MIN_WALL:g} mm")
    if volumes[0] <= 0.0:
        raise BadConfig(f"{cut(path)} is inside out: its triangles face inwards; make all of them face outwards")
    if len(parts) > 1:
        sizes = ", ".join(f"{1e6 * volume:.3g}" for volume in volumes[:5])
        raise BadConfig(f"{cut(path)} holds {len(parts)} parts (of {sizes} cm3); give one file for each, or join them")
    return manifold


def _check_size(path: str, points: Points, units: str | None) -> None:
    extent = float(np.ptp(points, axis=0).max())
    if MIN_EXTENT <= extent <= MAX_EXTENT:
        return
    given = extent / UNITS[units or "m"]
    fitting = [unit for unit, metres in UNITS.items() if MIN_EXTENT <= given * metres <= MAX_EXTENT]
    likely = "mm" if "mm" in fitting and extent > MAX_EXTENT else next(iter(fitting), "")
    hint = f"; give units={likely} if they are" if likely else "; give it its true size"
    raise BadConfig(
        f"{cut(path)} is {extent:.3g} m long if its numbers are in {units or 'm'}; "
        f"it must be {MIN_EXTENT:g} to {MAX_EXTENT:g} m long{hint}"
    )


def _thinness(manifold: Manifold, seed: int) -> tuple[float, float]:
    """Share of the surface under which the solid is thinner than `MIN_WALL`, and median thickness [m].

    The thickness is the length of the ray from a point of the surface straight inwards to the point where it leaves
    the solid, at most the size of the solid.
    """
    mesh = as_mesh(manifold)
    points, faces = sampled(mesh, RAYS, np.random.default_rng(seed))
    normals, longest = mesh.face_normals[faces], float(np.linalg.norm(mesh.extents))
    skin = 1e-5 * longest
    thickness = np.full(len(points), longest)
    for i, (start, end) in enumerate(zip(points - skin * normals, points - longest * normals, strict=True)):
        if hits := manifold.ray_cast(start.tolist(), end.tolist()):
            thickness[i] = skin + hits[0].distance * (longest - skin)
    return float((thickness < MIN_WALL).mean()), float(np.median(thickness))

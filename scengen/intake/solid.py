"""A mesh file read as a solid: repaired where that changes nothing, refused in one line where it is none."""

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
"""Metres in a unit."""
FORMATS = ("glb", "obj", "off", "ply", "stl")
SMALLEST, LARGEST = 0.005, 1.0
"""Largest extent of a thing that a Panda, whose reach is 0.855 m, can have to do with [m]."""
THIN = 0.0015
"""Walls that are thinner let small balls through at moderate speed [m]."""
THIN_SHARE = 0.1
"""Share of the surface that may be thinner: scans have fringes."""
MOST_BYTES = 200_000_000
RAYS = 2000
"""Places at which thickness is measured."""


@dataclass(frozen=True)
class MeshSolid:
    """A closed body in one part, in metres."""

    file: str
    sha256: str
    manifold: Manifold
    merged: int
    """Vertices that stood in the same place as another one."""
    dropped: int
    """Triangles without area that have gone with them."""
    thin: float
    """Share of the surface under which the solid is thinner than `THIN`."""

    @property
    def mesh(self) -> trimesh.Trimesh:
        return as_mesh(self.manifold)


def as_mesh(manifold: Manifold) -> trimesh.Trimesh:
    """The surface of a solid as triangles."""
    found = manifold.to_mesh64()
    points = np.asarray(found.vert_properties)[:, :3]
    return trimesh.Trimesh(points, np.asarray(found.tri_verts, np.int64), process=False)


def sampled(mesh: trimesh.Trimesh, count: int, rng: np.random.Generator) -> tuple[Points, NDArray[np.int64]]:
    """Points spread evenly over a surface, and the triangle that each lies in."""
    areas = mesh.area_faces
    faces = rng.choice(len(areas), count, p=areas / areas.sum())
    root, share = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    a, b, c = np.moveaxis(mesh.triangles[faces], 1, 0)
    return (1 - root) * a + root * (1 - share) * b + root * share * c, faces


def read(path: str, units: str | None = None, seed: int = 0) -> MeshSolid:
    """Read a mesh file.

    Args:
        units: of the numbers in the file, one of `UNITS`; None: metres.
        seed: of the places at which thickness is measured.

    Raises:
        BadConfig: there is no such file, it cannot be read, or what it holds is no solid that a scene can use.
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
    if thin > THIN_SHARE:
        raise BadConfig(
            f"{cut(path)} is thinner than {1000 * THIN:g} mm under {thin:.0%} of its surface (half of it is thinner "
            f"than {1000 * median:.1f} mm), and thin walls let things through; give it walls of {1000 * THIN:g} mm"
        )
    sha256 = hashlib.sha256(data).hexdigest()
    return MeshSolid(Path(path).name, sha256, manifold, len(points) - len(whole), len(faces) - len(kept), thin)


def content(path: str) -> bytes:
    """The bytes of a mesh file.

    Raises:
        BadConfig: there is no such file, or it cannot be a mesh.
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
        if file.stat().st_size > MOST_BYTES:
            raise BadConfig(f"{cut(path)} has more than {MOST_BYTES // 10**6} MB; give a mesh with fewer triangles")
        return file.read_bytes()
    except OSError as error:
        raise BadConfig(f"{cut(path)} cannot be read: {remedy(error) or 'choose another file'}") from None


def _triangles(path: str, data: bytes) -> tuple[Points, NDArray[np.int64]]:
    """Vertices and triangles of a file, whatever scene they are arranged in."""
    ending = Path(path).suffix[1:].lower()
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # it writes what it stumbles over to standard error
    try:
        found = trimesh.load(
            trimesh.util.wrap_as_stream(data), file_type=ending, force="mesh", process=False, skip_materials=True
        )
        points = np.asarray(getattr(found, "vertices", np.zeros((0, 3))), np.float64)
        faces = np.asarray(getattr(found, "faces", np.zeros((0, 3))), np.int64)
    except Exception as error:  # what a reader raises on a damaged file differs by format
        what = cut(" ".join(str(error).split()), 80) or type(error).__name__
        raise BadConfig(
            f"{cut(path)} is no .{ending} file that can be read ({what}); see the program that made it"
        ) from None
    if not len(faces):
        raise BadConfig(f"{cut(path)} holds no triangles; expected a mesh, not points or lines")
    if not np.isfinite(points).all() or faces.min() < 0 or faces.max() >= len(points):
        raise BadConfig(f"{cut(path)} has vertices that are no numbers or do not exist; expected a sound mesh")
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
        raise BadConfig(f"{cut(path)} is flat: it encloses no volume; give it walls of {1000 * THIN:g} mm")
    if volumes[0] <= 0.0:
        raise BadConfig(f"{cut(path)} is inside out: its triangles face inwards; make all of them face outwards")
    if len(parts) > 1:
        told = ", ".join(f"{1e6 * volume:.3g}" for volume in volumes[:5])
        raise BadConfig(f"{cut(path)} holds {len(parts)} parts (of {told} cm3); give one file for each, or join them")
    return manifold


def _check_size(path: str, points: Points, units: str | None) -> None:
    extent = float(np.ptp(points, axis=0).max())
    if SMALLEST <= extent <= LARGEST:
        return
    given = extent / UNITS[units or "m"]
    fitting = [unit for unit, metres in UNITS.items() if SMALLEST <= given * metres <= LARGEST]
    likely = "mm" if "mm" in fitting and extent > LARGEST else next(iter(fitting), "")
    told = f"; say units={likely} if they are" if likely else "; give it its true size"
    raise BadConfig(
        f"{cut(path)} is {extent:.3g} m long if its numbers are in {units or 'm'}; "
        f"it must be {SMALLEST:g} to {LARGEST:g} m long{told}"
    )


def _thinness(manifold: Manifold, seed: int) -> tuple[float, float]:
    """Share of the surface under which the solid is thinner than `THIN`, and median thickness, at most the solid's own.

    Thickness is the length of the ray from a place on the surface straight inwards to where it leaves the solid [m].
    """
    mesh = as_mesh(manifold)
    points, faces = sampled(mesh, RAYS, np.random.default_rng(seed))
    normals, longest = mesh.face_normals[faces], float(np.linalg.norm(mesh.extents))
    skin = 1e-5 * longest
    thickness = np.full(len(points), longest)
    for i, (start, end) in enumerate(zip(points - skin * normals, points - longest * normals, strict=True)):
        if hits := manifold.ray_cast(start.tolist(), end.tolist()):
            thickness[i] = skin + hits[0].distance * (longest - skin)
    return float((thickness < THIN).mean()), float(np.median(thickness))

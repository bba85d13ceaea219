"""Reads a mesh file as a solid: repairs it if that does not change the shape, and refuses it if it is not a solid."""

import copyreg
import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import Error, Manifold, Mesh64
from numpy.typing import NDArray

from ..assets.mesh_prop import Points
from ..errors import BadConfig, UnknownName, cut, nearest
from ..geometry import Mat3
from ..work.plain import read_plain
from ..work.targets import remedy
from .crossing import longest_crossing
from .mesh_file import load
from .polygons import CrossesItself, Indices, Polygons

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Length of each unit [m]."""
FORMATS = ("glb", "obj", "off", "ply", "stl")
"""Endings of the names of mesh files."""
UPRIGHT: dict[str, Mat3] = {
    "x": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "-x": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "-y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "z": np.eye(3),
    "-z": np.diag([1.0, -1.0, -1.0]),
}
"""Rotation from the axes of a file to those of scenes, in which z points up, by the axis of the file that does."""
MIN_EXTENT = 0.005
"""Smallest accepted extent of a thing for a Panda [m]; the extent is the longest edge of the bounding box."""
MAX_EXTENT = 1.0
"""Largest accepted extent of a thing for a Panda, whose reach is 0.855 m [m]."""
MIN_WALL = 0.0015
"""Smallest thickness of walls [m]: thinner walls let small balls through at moderate speed."""
MAX_THIN_SHARE = 0.1
"""Largest share of the surface that may be thinner, as scans have fringes."""
MAX_CROSSING = 0.05
"""Largest length of a curve along which a surface may cross itself, over the extent. Scans have folds: those of one
vertex, where edges are 2 mm long, are 2 to 5 mm long."""
MAX_CROSSING_LENGTH = 0.01
"""Largest length of such a curve [m], which is then at most 5 mm wide."""
MIN_VOLUME = 1e-10
"""Smallest volume of a solid [m^3]: less than a thousandth of the smallest cube."""
MAX_BYTES = 200_000_000
"""Largest size of a mesh file [bytes]."""
RAYS = 2000
"""Number of points at which the thickness is measured."""


@dataclass(frozen=True)
class MeshSolid:
    """A closed body in one part, in metres. The z axis points up, and the middle of its bounding box is the origin."""

    file: str
    """Name of the mesh file."""
    sha256: str
    """Hash of the content of the file."""
    up: str
    """Axis of the file that points up, one of `UPRIGHT`."""
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
    return trimesh.Trimesh(*_arrays(manifold), process=False)


def as_manifold(points: Points, faces: Indices) -> Manifold:
    """The solid that triangles enclose."""
    return Manifold(Mesh64(np.array(points, np.float64, order="C"), np.array(faces, np.uint64, order="C")))


def _arrays(manifold: Manifold) -> tuple[Points, Indices]:
    """Vertices and triangles of a solid."""
    found = manifold.to_mesh64()
    return np.asarray(found.vert_properties)[:, :3], np.asarray(found.tri_verts, np.int64)


copyreg.pickle(Manifold, lambda manifold: (as_manifold, _arrays(manifold)))


def sampled(mesh: trimesh.Trimesh, count: int, rng: np.random.Generator) -> tuple[Points, NDArray[np.int64]]:
    """Points with uniform distribution over a surface, and the index of the triangle of each."""
    areas = mesh.area_faces
    faces = rng.choice(len(areas), count, p=areas / areas.sum())
    root, share = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    a, b, c = np.moveaxis(mesh.triangles[faces], 1, 0)
    return (1 - root) * a + root * (1 - share) * b + root * share * c, faces


def read(path: str, units: str | None = None, seed: int = 0, up: str | None = None) -> MeshSolid:
    """Read a mesh file. Its solid is turned upright, and moved so that the middle of its bounding box is the origin.

    Args:
        units: unit of the numbers in the file, one of `UNITS`. Default: metres.
        seed: seed of the points at which the thickness is measured.
        up: axis of the file that points up, one of `UPRIGHT`. Default: that of the format, see `up_axis`.

    Raises:
        BadConfig: there is no such file, it cannot be read, or it does not hold a solid that a scene can use.
        UnknownName: there is no such unit or axis.
    """
    if units is not None and units not in UNITS:
        raise UnknownName("unit", units, UNITS)
    if up is not None and up not in UPRIGHT:
        raise UnknownName("axis", up, UPRIGHT)
    data = content(path)
    given, polygons = _polygons(path, data)
    up = up or up_axis(path)
    given = given @ UPRIGHT[up].T * UNITS[units or "m"]
    whole, names = np.unique(given, axis=0, return_inverse=True)
    _check_size(path, whole, units)
    rounding = float(np.finfo(np.float32).eps * np.abs(whole).max())
    # Products of coordinates far from the origin, as in a moment of inertia, would lose their digits.
    whole -= (whole.min(axis=0) + whole.max(axis=0)) / 2
    joined = polygons.joined(names.reshape(-1))
    try:
        triangles = joined.triangles(whole)
    except CrossesItself:
        raise BadConfig(f"{cut(path)} crosses itself: the outline of a polygon does; untangle it") from None
    manifold = _manifold(path, whole, triangles)
    thin, median = _thinness(manifold, seed, rounding)
    if thin > MAX_THIN_SHARE:
        raise BadConfig(
            f"{cut(path)} is thinner than {1000 * MIN_WALL:g} mm under {thin:.0%} of its surface (half of it is "
            f"thinner than {1000 * median:.1f} mm), and thin walls let things through; "
            f"give it walls of {1000 * MIN_WALL:g} mm"
        )
    return MeshSolid(
        file=Path(path).name,
        sha256=hashlib.sha256(data).hexdigest(),
        up=up,
        manifold=manifold,
        merged=len(given) - len(whole),
        dropped=len(polygons.sizes) - len(joined.sizes),
        thin=thin,
    )


def up_axis(path: str) -> str:
    """Axis of a mesh file that points up, one of `UPRIGHT`, unless the user names another one.

    Only glTF defines it: y. In all other formats it is z.
    """
    return "y" if Path(path).suffix.lower() == ".glb" else "z"


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
        if not file.exists():
            siblings = [p.name for p in file.parent.iterdir()] if file.parent.is_dir() else []
            raise BadConfig(f"there is no file {cut(path)}{nearest(file.name, siblings)}; name a mesh file")
        if ending not in FORMATS:
            known = ", ".join(f".{form}" for form in FORMATS)
            raise BadConfig(f"{cut(path)}: no mesh format named {cut(repr(file.suffix))}; known: {known}")
        if file.stat().st_size > MAX_BYTES:
            raise BadConfig(f"{cut(path)} has more than {MAX_BYTES // 10**6} MB; give a mesh with fewer triangles")
        return read_plain(file, MAX_BYTES)
    except ValueError as error:
        raise BadConfig(f"{cut(path)} {str(error).removeprefix('it ')}") from None
    except OSError as error:
        raise BadConfig(f"{cut(path)} cannot be read: {remedy(error) or 'choose another file'}") from None


def _polygons(path: str, data: bytes) -> tuple[Points, Polygons]:
    """Vertices and polygons of a file."""
    ending = Path(path).suffix[1:].lower()
    try:
        points, polygons = load(data, ending)
    except Exception as error:  # the type of the error for a damaged file depends on the format
        what = cut(" ".join(str(error).split()), 80) or type(error).__name__
        raise BadConfig(
            f"{cut(path)} cannot be read as a .{ending} file ({what}); see the program that made it"
        ) from None
    if not len(polygons.sizes):
        raise BadConfig(f"{cut(path)} holds no triangles; expected a mesh, not points or lines")
    if not np.isfinite(points).all():
        raise BadConfig(f"{cut(path)} has vertices that are not numbers; expected a valid mesh")
    if polygons.corners.min() < 0 or polygons.corners.max() >= len(points):
        raise BadConfig(f"{cut(path)} has corners that are none of its {len(points)} vertices; expected a valid mesh")
    return points, polygons


def _manifold(path: str, points: Points, faces: Indices) -> Manifold:
    """The solid that triangles enclose: one part without cavities."""
    mesh = Mesh64(np.ascontiguousarray(points), np.ascontiguousarray(faces.astype(np.uint64)))
    manifold = Manifold(mesh)
    if manifold.status() != Error.NoError:
        mesh.merge()  # closes seams whose two sides differ by rounding
        manifold = Manifold(mesh)
    if manifold.status() != Error.NoError:
        directed = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, uses = np.unique(directed, axis=0, return_counts=True)
        if open_edges := int((uses == 1).sum()):
            raise BadConfig(
                f"{cut(path)} is open: {open_edges} edges have a triangle on one side only; close its holes"
            )
        if crowded := int((uses > 2).sum()):
            told = f"{crowded} edges have three or more triangles"
            raise BadConfig(f"{cut(path)} has doubled or inner faces: {told}; remove them")
        raise BadConfig(f"{cut(path)} has triangles that face both ways; make all of them face outwards")
    parts = sorted(manifold.decompose(), key=lambda part: part.volume(), reverse=True)
    for part in parts:
        triangulated = _arrays(part)
        allowed = min(MAX_CROSSING * float(np.ptp(triangulated[0], axis=0).max()), MAX_CROSSING_LENGTH)
        if (length := longest_crossing(*triangulated)) > allowed:
            raise BadConfig(f"{cut(path)} crosses itself along {1000 * length:.3g} mm; untangle it")
    volume = manifold.volume()
    if not parts or abs(volume) < MIN_VOLUME:
        raise BadConfig(f"{cut(path)} is flat: it encloses no volume; give it walls of {1000 * MIN_WALL:g} mm")
    if volume < 0.0:
        raise BadConfig(f"{cut(path)} is inside out: its triangles face inwards; make all of them face outwards")
    if len(parts) > 1:
        raise BadConfig(f"{cut(path)} {_about(parts)}")
    return manifold


def _about(parts: list[Manifold]) -> str:
    """Parts of a file as text, with a remedy."""
    volumes = [1e6 * part.volume() for part in parts]
    sizes = ", ".join(f"{abs(volume):.3g}" for volume in volumes[:5])
    cavities = [part for part in parts if part.volume() < 0.0]
    if len(parts) - len(cavities) == 1 and all(_encloses(parts[0], cavity) for cavity in cavities):
        sizes = ", ".join(f"{abs(volume):.3g}" for volume in volumes[1:6])
        if len(cavities) == 1:
            return f"has a closed cavity of {sizes} cm3; fill it, or open it to the outside"
        return f"has {len(cavities)} closed cavities (of {sizes} cm3); fill them, or open them to the outside"
    if cavities:
        return f"holds {len(parts)} parts (of {sizes} cm3), {len(cavities)} of them inside out; give one part"
    return f"holds {len(parts)} parts (of {sizes} cm3); give one file for each, or join them"


def _encloses(solid: Manifold, cavity: Manifold) -> bool:
    """Whether a part lies in the solid that another one encloses; a cavity is turned inside out for that."""
    points, faces = _arrays(cavity)
    filled = as_manifold(points, faces[:, ::-1])
    return (filled - solid).volume() < 1e-3 * filled.volume()


def _check_size(path: str, points: Points, units: str | None) -> None:
    extent, rounding = float(np.ptp(points, axis=0).max()), float(np.finfo(np.float32).eps * np.abs(points).max())
    if MIN_EXTENT - rounding <= extent <= MAX_EXTENT + rounding:
        return
    given = extent / UNITS[units or "m"]
    fitting = [unit for unit, metres in UNITS.items() if MIN_EXTENT <= given * metres <= MAX_EXTENT]
    likely = "mm" if "mm" in fitting and extent > MAX_EXTENT else next(iter(fitting), "")
    hint = f"; give units={likely} if they are" if likely else "; give it its true size"
    raise BadConfig(
        f"{cut(path)} is {extent:.3g} m long if its numbers are in {units or 'm'}; "
        f"it must be {MIN_EXTENT:g} to {MAX_EXTENT:g} m long{hint}"
    )


def _thinness(manifold: Manifold, seed: int, rounding: float) -> tuple[float, float]:
    """Share of the surface under which the solid is thinner than `MIN_WALL`, and median thickness [m].

    The thickness is the length of the ray from a point of the surface straight inwards to the point where it leaves
    the solid, at most the size of the solid. A wall may be thinner by what 32-bit coordinates are rounded by.
    """
    mesh = as_mesh(manifold)
    points, faces = sampled(mesh, RAYS, np.random.default_rng(seed))
    normals, longest = mesh.face_normals[faces], float(np.linalg.norm(mesh.extents))
    skin = 1e-5 * longest
    thickness = np.full(len(points), longest)
    for i, (start, end) in enumerate(zip(points - skin * normals, points - longest * normals, strict=True)):
        if hits := manifold.ray_cast(start.tolist(), end.tolist()):
            thickness[i] = skin + hits[0].distance * (longest - skin)
    return float((thickness < MIN_WALL - rounding).mean()), float(np.median(thickness))

"""Colours of a mesh file, of its materials, textures, vertices or faces, as few colours of the mesh that pictures show.

Scenes refer to no files and MuJoCo's text holds no texture, so that each colour becomes a separate mesh.
"""

import logging
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import trimesh.remesh
import trimesh.resolvers
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2
from scipy.spatial import KDTree

from ..assets.mesh_prop import Palette, Points
from ..work.plain import read_plain
from .polygons import Indices
from .solid import UNITS, UPRIGHT, content, sampled

MAX_COLOURS = 8
"""Largest number of colours: each is a mesh in the scene."""
SAMPLES = 20_000
"""Number of points of the surface whose colours are read."""
PATCHES = 24
"""Number of triangles along the longest edge of a mesh of several colours, so that a picture on a large triangle stays
recognizable."""
SAME = 6
"""Largest difference of two colours that count as one, of 255 in each channel."""

MAX_TEXTURE = 100_000_000
"""Largest size of a file of materials or of a texture [bytes]."""

Colours = tuple[Points, NDArray[np.uint8]]
"""Points of the surface [m], shape (n, 3), and their colours, shape (n, 3)."""


class _Beside(trimesh.resolvers.Resolver):
    """Reads the materials and textures that a file names: plain files next to it, and no others."""

    def __init__(self, folder: Path):
        self.folder = folder

    def get(self, name: str) -> bytes:  # type: ignore[override]
        """Content of a file next to the mesh."""
        return read_plain(self.folder / Path(name.replace("\\", "/")).name, MAX_TEXTURE)

    def keys(self) -> list[str]:
        """Names of the files; none, as files are requested by their names."""
        return []

    def namespaced(self, namespace: str) -> "_Beside":
        """The same folder: there are no others."""
        return self

    def write(self, name: str, data: bytes) -> None:
        """Nothing is written."""
        raise NotImplementedError


def colours_of(path: str, units: str | None, up: str, seed: int) -> Colours | None:
    """Colours of the surface in a file, in the axes in which `solid.read` gives it.

    None if the file has none, or if trimesh cannot read them: it does not accept all that the formats allow, and a mesh
    is as good without its colours.

    Args:
        units: unit of the numbers in the file, one of `UNITS`. Default: metres.
        up: axis of the file that points up, one of `UPRIGHT`.
        seed: seed of the points.
    """
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # it logs problems to standard error
    try:
        return _read(path, units, up, seed)
    except Exception:  # its type depends on the format and on what is damaged
        return None


def _read(path: str, units: str | None, up: str, seed: int) -> Colours | None:
    data, ending = trimesh.util.wrap_as_stream(content(path)), Path(path).suffix[1:].lower()
    beside = _Beside(Path(path).parent)
    mesh: Any = trimesh.load(data, file_type=ending, resolver=beside, force="mesh", process=False)
    visual = getattr(mesh, "visual", None)
    if visual is None or not visual.defined or not len(getattr(mesh, "faces", ())):
        return None
    points, faces = sampled(mesh, SAMPLES, np.random.default_rng(seed))
    if visual.kind == "texture" and visual.uv is not None:
        weights = trimesh.triangles.points_to_barycentric(mesh.triangles[faces], points)
        uv = np.einsum("ij,ijk->ik", weights, visual.uv[mesh.faces[faces]])
        found = visual.material.to_color(uv)
    elif visual.kind == "texture":
        found = np.tile(visual.material.main_color, (len(points), 1))
    else:
        found = visual.face_colors[faces]
    whole = np.asarray(mesh.vertices) @ UPRIGHT[up].T * UNITS[units or "m"]
    middle = (whole.min(axis=0) + whole.max(axis=0)) / 2
    return points @ UPRIGHT[up].T * UNITS[units or "m"] - middle, np.asarray(found, np.uint8)[:, :3]


def painted(
    vertices: Points, faces: Indices, colours: Colours, seed: int
) -> tuple[Points, Indices, Palette, NDArray[np.int64]]:
    """A mesh with a colour of a palette for each triangle: vertices, triangles, palette, and the colour of each.

    Args:
        seed: seed of the choice of the palette.
    """
    where, found = colours
    if (np.ptp(found.astype(int), axis=0) <= SAME).all():
        return vertices, faces, (_rgba(found.mean(axis=0)),), np.zeros(len(faces), np.int64)
    longest = float(np.ptp(vertices, axis=0).max()) / PATCHES
    vertices, faces, *_ = trimesh.remesh.subdivide_to_size(vertices, faces, longest, max_iter=20)
    centres = vertices[faces].mean(axis=1)
    seen = found[KDTree(where).query(centres)[1]].astype(float)
    count = min(MAX_COLOURS, len(np.unique(seen, axis=0)))
    palette, chosen = kmeans2(seen, count, minit="++", rng=np.random.default_rng(seed))
    used, chosen = np.unique(chosen, return_inverse=True)
    return vertices, faces, tuple(_rgba(palette[k]) for k in used), chosen.reshape(-1).astype(np.int64)


def _rgba(colour: NDArray[np.float64]) -> tuple[float, float, float, float]:
    r, g, b = (round(float(each) / 255.0, 3) for each in colour)
    return r, g, b, 1.0

"""Decomposition of a solid into convex pieces, and the error of the pieces."""

from dataclasses import dataclass
from typing import Self

import coacd
import numpy as np
import trimesh
from manifold3d import Manifold, OpType
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..assets.mesh_prop import Points
from .solid import MeshSolid, as_mesh, sampled

SIMPLIFICATION = 0.1
"""Share of the permitted error by which a surface is simplified before the decomposition. A scan of a bottle with
16 000 triangles then takes 9 s and 15 pieces at 3 mm. With a tenth of that share it takes 24 s, and 26 pieces because
of its roughness."""
SAMPLE_POINTS = 60_000
"""Number of points at which distances are measured."""
NEIGHBOURS = 16
"""Number of nearest points whose triangles are candidates for the nearest triangle."""
BATCH = 4096
"""Number of points that are compared with all planes at once; all points would need a gigabyte."""
ITERATIONS = 60
"""Iterations of CoACD's search for cuts. With its defaults of 150 iterations, 20 nodes and a resolution of 2000 the
same bottle takes 14 s and 13 pieces."""
NODES = 15
"""Nodes of CoACD's search."""
RESOLUTION = 1000
"""Sampling resolution of CoACD's search."""


@dataclass(frozen=True)
class PieceError:
    """Error of convex pieces that replace a solid."""

    outward: float
    """Largest distance of a point of the pieces outside the solid from the solid [m]."""
    inward: float
    """Largest distance of a point of the solid outside the pieces from the planes of its nearest piece [m]."""
    volume: float
    """Volume of the pieces' union over that of the solid."""

    @property
    def worst(self) -> float:
        return max(self.outward, self.inward)


class Surface:
    """The surface of a solid, to measure distances from it.

    Args:
        seed: seed of the points that represent the surface.
    """

    def __init__(self, manifold: Manifold, seed: int):
        self.manifold, self.mesh = manifold, as_mesh(manifold)
        points, faces = sampled(self.mesh, SAMPLE_POINTS, np.random.default_rng(seed))
        self.points = np.vstack([points, self.mesh.triangles_center])
        self._faces = np.concatenate([faces, np.arange(len(self.mesh.faces))])
        self._tree = KDTree(self.points)

    def distance(self, points: Points) -> NDArray[np.float64]:
        """Distances from the surface, shape (n,) [m]; slightly too large if the nearest triangle is not a candidate."""
        _, near = self._tree.query(points, NEIGHBOURS)
        triangles = self.mesh.triangles[self._faces[near].ravel()]
        again = np.repeat(points, NEIGHBOURS, axis=0)
        away = np.linalg.norm(again - trimesh.triangles.closest_point(triangles, again), axis=1)
        return away.reshape(near.shape).min(axis=1)


@dataclass(frozen=True)
class Pieces:
    """Convex pieces that replace a solid."""

    hulls: tuple[Manifold, ...]
    error: PieceError

    @classmethod
    def of(cls, hulls: list[Manifold], surface: Surface, seed: int) -> Self:
        """Measure pieces against the solid that they replace, with exact boolean operations."""
        union = Manifold.batch_boolean(hulls, OpType.Add)
        outward = 0.0
        if (beyond := as_mesh(union - surface.manifold)).area > 0.0:
            points, _ = sampled(beyond, SAMPLE_POINTS, np.random.default_rng(seed))
            outward = float(surface.distance(np.vstack([points, beyond.vertices])).max())
        lowest = np.full(len(surface.points), np.inf)
        for hull in hulls:
            lowest = np.minimum(lowest, _heights_above(surface.points, as_mesh(hull)))
        inward = max(0.0, round(float(lowest.max()), 9))
        return cls(tuple(hulls), PieceError(outward, inward, union.volume() / surface.manifold.volume()))

    @property
    def corners(self) -> list[Points]:
        """Vertices of each piece."""
        return [as_mesh(hull).vertices.view(np.ndarray) for hull in self.hulls]


def one_hull(solid: MeshSolid, surface: Surface, seed: int) -> Pieces:
    """The convex hull, with which MuJoCo by default replaces a mesh."""
    return Pieces.of([solid.manifold.hull()], surface, seed)


def cut_up(solid: MeshSolid, surface: Surface, error: float, most: int, seed: int) -> Pieces:
    """Convex pieces by CoACD.

    Args:
        error: largest concavity of a piece, the distance of its hull from the solid [m].
        most: largest number of pieces, also if the error is then larger.
        seed: seed of CoACD's search.
    """
    mesh = as_mesh(solid.manifold.simplify(SIMPLIFICATION * error))
    coacd.set_log_level("error")
    found = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=(1 - SIMPLIFICATION) * error,
        max_convex_hull=most,
        preprocess_mode="off",  # it closes open surfaces; this one is closed
        real_metric=True,
        mcts_iterations=ITERATIONS,
        mcts_nodes=NODES,
        resolution=RESOLUTION,
        seed=seed,
    )
    hulls = [Manifold.hull_points(np.ascontiguousarray(points)) for points, _ in found]
    return Pieces.of([hull for hull in hulls if not hull.is_empty()], surface, seed)


def _heights_above(points: Points, convex: trimesh.Trimesh) -> NDArray[np.float64]:
    """Largest height of each point above the planes of a convex body [m]; negative for points inside."""
    offsets = np.einsum("ij,ij->i", convex.face_normals, convex.triangles[:, 0])
    highest = np.empty(len(points))
    for start in range(0, len(points), BATCH):
        part = slice(start, start + BATCH)
        highest[part] = (points[part] @ convex.face_normals.T - offsets).max(axis=1)
    return highest

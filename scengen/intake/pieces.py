"""A solid as convex pieces, and how far the pieces are from it."""

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

DETAIL = 0.1
"""Share of the permitted error by which a surface is simplified before it is cut up. A scan of a bottle with 16 000
triangles then takes 9 s and 15 pieces at 3 mm; with a tenth of that share 24 s, and 26 pieces around its roughness."""
POINTS = 60_000
"""At which distances are measured."""
NEIGHBOURS = 8
"""Triangles among which the nearest one is looked for: those of the nearest points."""
BATCH = 4096
"""Points that are compared with all planes at once; all of them would take a gigabyte."""
ITERATIONS, NODES, RESOLUTION = 60, 15, 1000
"""CoACD's search for cuts. With its own 150, 20 and 2000 the same bottle takes 14 s and 13 pieces."""


@dataclass(frozen=True)
class PieceError:
    """How far convex pieces are from a solid [m]."""

    outward: float
    """Farthest point of the pieces outside the solid, from the solid."""
    inward: float
    """Farthest point of the solid outside the pieces, from the planes of that piece to which it is least outside."""
    volume: float
    """Volume of the pieces' union over that of the solid."""

    @property
    def worst(self) -> float:
        return max(self.outward, self.inward)


class Surface:
    """The surface of a solid, asked how far away points are.

    Args:
        seed: of the points that stand for it.
    """

    def __init__(self, manifold: Manifold, seed: int):
        self.manifold, self.mesh = manifold, as_mesh(manifold)
        points, faces = sampled(self.mesh, POINTS, np.random.default_rng(seed))
        self.points = np.vstack([points, self.mesh.triangles_center])
        self._faces = np.concatenate([faces, np.arange(len(self.mesh.faces))])
        self._tree = KDTree(self.points)

    def distance(self, points: Points) -> NDArray[np.float64]:
        """From the surface [m], shape (n,): or slightly more where the nearest triangle is not among those asked."""
        _, near = self._tree.query(points, NEIGHBOURS)
        triangles = self.mesh.triangles[self._faces[near].ravel()]
        again = np.repeat(points, NEIGHBOURS, axis=0)
        away = np.linalg.norm(again - trimesh.triangles.closest_point(triangles, again), axis=1)
        return away.reshape(near.shape).min(axis=1)


@dataclass(frozen=True)
class Pieces:
    """Convex pieces in place of a solid."""

    hulls: tuple[Manifold, ...]
    error: PieceError

    @classmethod
    def of(cls, hulls: list[Manifold], surface: Surface, seed: int) -> Self:
        """Measure pieces against the solid that they stand for: what of one is not in the other, by exact booleans."""
        union = Manifold.batch_boolean(hulls, OpType.Add)
        outward = 0.0
        if (beyond := as_mesh(union - surface.manifold)).area > 0.0:
            points, _ = sampled(beyond, POINTS, np.random.default_rng(seed))
            outward = float(surface.distance(np.vstack([points, beyond.vertices])).max())
        lowest = np.full(len(surface.points), np.inf)
        for hull in hulls:
            lowest = np.minimum(lowest, _highest(surface.points, as_mesh(hull)))
        inward = max(0.0, round(float(lowest.max()), 9))
        return cls(tuple(hulls), PieceError(outward, inward, union.volume() / surface.manifold.volume()))

    @property
    def corners(self) -> list[Points]:
        """Vertices of each piece."""
        return [as_mesh(hull).vertices.view(np.ndarray) for hull in self.hulls]


def one_hull(solid: MeshSolid, surface: Surface, seed: int) -> Pieces:
    """The convex hull: what MuJoCo makes of a mesh by itself."""
    return Pieces.of([solid.manifold.hull()], surface, seed)


def cut_up(solid: MeshSolid, surface: Surface, error: float, most: int, seed: int) -> Pieces:
    """Convex pieces by CoACD, of which no more than `most` are made, whatever the error is then.

    Args:
        error: largest concavity of a piece [m], the distance of its hull from the solid.
        seed: of CoACD's search.
    """
    mesh = as_mesh(solid.manifold.simplify(DETAIL * error))
    coacd.set_log_level("error")
    found = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=(1 - DETAIL) * error,
        max_convex_hull=most,
        preprocess_mode="off",  # it makes a closed surface of an open one; this one is closed
        real_metric=True,
        mcts_iterations=ITERATIONS,
        mcts_nodes=NODES,
        resolution=RESOLUTION,
        seed=seed,
    )
    hulls = [Manifold.hull_points(np.ascontiguousarray(points)) for points, _ in found]
    return Pieces.of([hull for hull in hulls if not hull.is_empty()], surface, seed)


def _highest(points: Points, convex: trimesh.Trimesh) -> NDArray[np.float64]:
    """How far each point is above that plane of a convex body that it is farthest above [m]; negative: inside."""
    offsets = np.einsum("ij,ij->i", convex.face_normals, convex.triangles[:, 0])
    highest = np.empty(len(points))
    for start in range(0, len(points), BATCH):
        part = slice(start, start + BATCH)
        highest[part] = (points[part] @ convex.face_normals.T - offsets).max(axis=1)
    return highest

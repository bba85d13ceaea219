"""An asset as one closed mesh: the union of its collision geometry."""

import mujoco
import numpy as np
from manifold3d import Manifold, Mesh64, OpType
from numpy.typing import NDArray

from ..assets.prop import Prop
from ..errors import BadConfig
from ..geometry import Mat3

FORMATS = (".glb", ".obj", ".off", ".ply", ".stl")
"""Endings of the names of mesh files."""
SEGMENTS = 48
"""Number of corners that replace a full circle; all lie on the circle."""
OVERLAP = 1e-5
"""Distance by which parts are enlarged on all sides [m], so that parts that only touch become one."""


GRID = 1e-6
"""Grid of the vertices in mesh files [m]. It is coarser than the rounding of 32-bit numbers and of printed digits, so
that programs which merge equal vertices find the same triangles in every format."""
CLEANING_ROUNDS = 8
"""Largest number of attempts to put a mesh on the grid; the bowl needs 2, all other assets 1."""
GLTF_AXES: Mat3 = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation from the axes of scenes to those of glTF, whose y axis points up."""


def united(prop: Prop) -> Manifold:
    """The solid of an asset in the simulation, with joints at their reference, in the asset's axes.

    Raises:
        BadConfig: the asset has no collision geometry, such as a mark on the table.
    """
    model = prop.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    parts = []
    for g in np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0)):
        turned = np.column_stack([data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g]])
        part = _geom(model, int(g)).transform(turned)
        low, high = np.split(np.array(part.bounding_box()), 2)
        middle, edges = (low + high) / 2, high - low
        grown = part.translate((-middle).tolist()).scale((1 + 2 * OVERLAP / edges).tolist())
        parts.append(grown.translate(middle.tolist()))
    if not parts:
        raise BadConfig(
            f"{type(prop).__name__} is a visual mark without collision geometry, so it has no mesh; name another asset"
        )
    return Manifold.batch_boolean(parts, OpType.Add)


def encode(prop: Prop, ending: str) -> bytes:
    """The union as a mesh file [m]: closed, with the z axis upwards, in glTF with the y axis as it defines.

    Raises:
        BadConfig: no such format, no collision geometry, no closed mesh, or trimesh is missing.
    """
    if ending not in FORMATS:
        raise BadConfig(f"no mesh format named {ending!r}; known: {', '.join(FORMATS)}")
    try:
        import trimesh
    except ImportError:
        raise BadConfig("no trimesh for mesh files; run pip install 'scengen[mesh]'") from None
    points, faces = _on_grid(united(prop))
    points = points @ GLTF_AXES.T if ending == ".glb" else points
    written = trimesh.Trimesh(points, faces, process=False).export(file_type=ending[1:])
    return written.encode() if isinstance(written, str) else bytes(written)


def _on_grid(found: Manifold) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices on a grid, and triangles of which two meet at every edge.

    Parts that touch at an edge come apart in the next round, where edges up to a larger tolerance vanish.
    """
    for attempt in range(CLEANING_ROUNDS):
        mesh = found.simplify(GRID * 2**attempt).to_mesh64()
        cells = np.round(np.asarray(mesh.vert_properties)[:, :3] / GRID)
        cells, names = np.unique(cells, axis=0, return_inverse=True)
        faces = names.reshape(-1)[np.asarray(mesh.tri_verts, np.int64)]
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        _, same, sides = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
        faces = faces[sides[same.reshape(-1)] == 1]  # two sides of a sheet without thickness cancel
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        points = np.ascontiguousarray(cells * GRID)
        if (np.unique(edges, axis=0, return_counts=True)[1] == 2).all():
            return points, faces
        found = Manifold(Mesh64(points, np.ascontiguousarray(faces.astype(np.uint64))))
    raise BadConfig(f"no closed mesh on a grid of {1e6 * GRID:g} um; name another asset, or change its parameters")


def _geom(model: mujoco.MjModel, g: int) -> Manifold:
    """One geom as a solid, in its own axes."""
    a, b, c = model.geom_size[g]
    match mujoco.mjtGeom(model.geom_type[g]):
        case mujoco.mjtGeom.mjGEOM_BOX:
            return Manifold.cube((2 * a, 2 * b, 2 * c), True)
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return Manifold.sphere(a, SEGMENTS)
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return Manifold.cylinder(2 * b, a, circular_segments=SEGMENTS, center=True)
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            ball = Manifold.sphere(a, SEGMENTS)
            return Manifold.batch_hull([ball.translate((0, 0, -b)), ball.translate((0, 0, b))])
        case mujoco.mjtGeom.mjGEOM_MESH:
            return Manifold.hull_points(_vertices(model, int(model.geom_dataid[g])))
        case other:
            raise NotImplementedError(f"a geom of type {other.name} as a mesh")


def _vertices(model: mujoco.MjModel, mesh: int) -> NDArray[np.float64]:
    start = model.mesh_vertadr[mesh]
    return np.ascontiguousarray(model.mesh_vert[start : start + model.mesh_vertnum[mesh]], float)

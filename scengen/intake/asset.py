"""Convex pieces as an asset: MJCF without references to files, its figures, and a test whether it comes to rest."""

import hashlib
import importlib.metadata
import json
import os
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn

import mujoco
import numpy as np

from ..assets.mesh_prop import FILE, MeshProp, Points
from ..assets.prop import TABLE_TOP, Prop, place, table
from ..assets.turned import FOOT_RADIUS
from ..errors import BadConfig, UnknownName, cut
from ..geometry import Mat3
from ..sim.scene_text import emit
from ..work.parallel import Limits, each
from ..work.plain import read_plain
from .colours import colours_of, painted
from .feet import MAX_LEAN, feet
from .pieces import Pieces, Surface, cut_up, one_hull
from .polygons import Indices
from .solid import UNITS, UPRIGHT, MeshSolid, as_mesh, content, read

CUTTING_LIMITS = Limits(600.0, 8000)
"""Limits on making an asset. A scan with 16 000 triangles takes some 10 s and 300 MB."""
REVISION = "3"
"""Revision of this package: assets of an earlier one may differ although all versions are the same."""
DEFAULT_DENSITY = 1000.0
"""Density if neither mass nor density is given [kg/m^3]: that of water."""
MAX_VISUAL_FACES = 2000
"""Largest number of triangles of the visual mesh."""
DROP_HEIGHT = 0.005
"""Height above the table from which the asset is dropped [m]."""
SETTLING_TIME = 3.0
"""Time from the drop to the start of the test [s]."""
TEST_TIME = 2.0
"""Duration of the test [s]."""
MAX_CREEP = 0.001
"""Largest motion during the test [m], which is what a certificate allows in the same time."""
MAX_SPEED = 0.001
"""Largest speed during the test [m/s]; a thing that rocks on one contact is faster."""


@dataclass(frozen=True)
class IntakeRequest:
    """A mesh file and the settings of its conversion, which are the settings of `scengen asset` of these names."""

    mesh: str
    """Path of the mesh file."""
    units: str | None = None
    """Unit of the numbers in the file, one of `UNITS`. Default: metres."""
    up: str | None = None
    """Axis of the file that points up, one of `UPRIGHT`. Default: y for glTF, which defines it, else z."""
    mass: float | None = None
    """Mass [kg]."""
    density: float | None = None
    """Density [kg/m^3]. Default: 1000, unless a mass is given."""
    friction: float = 0.6
    """Sliding friction."""
    error: float = 0.003
    """Largest distance of the pieces from the mesh [m]."""
    pieces: int = 64
    """Largest number of pieces."""
    seed: int = 0
    """Seed of sampled points and of the decomposition."""

    def check(self) -> None:
        """Raise `BadConfig` or `UnknownName` for an invalid value."""
        if self.units is not None and self.units not in UNITS:
            raise UnknownName("unit", self.units, UNITS)
        if self.up is not None and self.up not in UPRIGHT:
            raise UnknownName("axis", self.up, UPRIGHT)
        if self.mass is not None and self.density is not None:
            raise BadConfig(f"mass = {self.mass:g} and density = {self.density:g}; give one of them")
        ranges = {
            "mass": (1e-3, 100.0, "kg"),
            "density": (1.0, 25_000.0, "kg/m^3"),
            "friction": (0.0, 2.0, ""),
            "error": (2e-4, 0.05, "m"),
            "pieces": (1, 512, ""),
            "seed": (0, 2**31 - 1, ""),
        }
        for name, (low, high, unit) in ranges.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise BadConfig(f"{name} = {cut(str(value))}; it must lie in [{low:g}, {high:g}] {unit}".rstrip())


@dataclass(frozen=True)
class DropResult:
    """Motion of an asset after it was dropped from just above the table."""

    creep: float
    """Distance that its centre of mass moved during the test [m]."""
    speed: float
    """Largest speed of its origin during the test [m/s]."""
    turn: float
    """Angle between its orientations at the drop and at the end [rad]."""
    contacts: int
    """Number of contacts at the end."""
    down: tuple[float, float, float]
    """Direction that points down at the end, in the asset's axes."""

    @property
    def rests(self) -> bool:
        """Whether it has come to rest."""
        return self.creep <= MAX_CREEP and self.speed <= MAX_SPEED


def drop(prop: Prop) -> DropResult:
    """Drop a prop upright above the middle of the table, and test whether it comes to rest."""
    scene = table()
    place(scene, prop, "asset", [0.0, 0.0, TABLE_TOP + DROP_HEIGHT])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(SETTLING_TIME / model.opt.timestep))
    before, speed = data.body("asset").xipos.copy(), 0.0
    for _ in range(round(TEST_TIME / model.opt.timestep)):
        mujoco.mj_step(model, data)
        speed = max(speed, float(np.linalg.norm(data.qvel[:3])))
    mujoco.mj_forward(model, data)
    creep = float(np.linalg.norm(data.body("asset").xipos - before))
    turn = 2 * float(np.arccos(np.clip(abs(data.qpos[3]), 0.0, 1.0)))
    x, y, z = -data.body("asset").xmat.reshape(3, 3)[2]
    return DropResult(creep, speed, turn, int(data.ncon), (float(x), float(y), float(z)))


@dataclass(frozen=True)
class MeshAsset:
    """An asset made of a mesh."""

    request: IntakeRequest
    solid: MeshSolid
    """Solid that the mesh encloses."""
    pieces: Pieces
    """Convex pieces that replace the solid."""
    hull: Pieces
    """Convex hull of the solid, for comparison."""
    visual: tuple[Points, Indices]
    """Vertices and triangles of the mesh that pictures show."""
    prop: MeshProp
    """Asset as its file stands, with the up axis upwards."""

    def turned(self, rot: Mat3) -> MeshProp:
        """The asset rotated by `rot` from the way its file stands, with feet below."""
        return _prop(self.request, self.solid, self.pieces, self.visual, rot)

    @cached_property
    def rest(self) -> DropResult:
        """Result of dropping the asset on the table."""
        return drop(self.prop)

    @property
    def side_below(self) -> tuple[str, float]:
        """Side of the file that is below after the drop, such as `-z`, and its angle to the table [rad]."""
        down = UPRIGHT[self.solid.up].T @ np.array(self.rest.down)
        axis = int(np.argmax(np.abs(down)))
        lean = float(np.arccos(min(1.0, abs(down[axis]))))
        return f"{'-' if down[axis] < 0.0 else '+'}{'xyz'[axis]}", lean

    @cached_property
    def xml(self) -> str:
        """MJCF of a model with one body, "body", without references to files."""
        return emit(self.prop.spec())[0]

    @cached_property
    def files(self) -> dict[str, str]:
        """Files that represent the asset: MJCF, and the body as data for `MeshProp.load`."""
        return {"asset.xml": self.xml, FILE: json.dumps(self.prop.written()) + "\n"}

    def figures(self) -> dict[str, Any]:
        """Figures of the asset, as plain data."""
        extents = self.solid.mesh.extents
        side, lean = self.side_below
        return {
            "key": key(self.request, self.solid.sha256),
            "input": {"file": self.solid.file, "sha256": self.solid.sha256},
            "settings": _settings(self.request),
            "versions": versions(),
            "solid": {
                "triangles": self.solid.manifold.num_tri(),
                "merged_vertices": self.solid.merged,
                "dropped_triangles": self.solid.dropped,
                "extents": extents.tolist(),
                "volume": self.solid.manifold.volume(),
                "thin_share": self.solid.thin,
            },
            "mass": self.prop.mass,
            "centre_of_mass": self.prop.com.tolist(),
            "inertia": self.prop.inertia.tolist(),
            "pieces": len(self.pieces.hulls),
            "colours": len(self.prop.palette),
            "feet": len(self.prop.feet),
            "error": asdict(self.pieces.error),
            "error_of_one_hull": asdict(self.hull.error),
            "up": self.solid.up,
            "rest": {
                **asdict(self.rest),
                "rests": self.rest.rests,
                "fell": self.rest.turn > MAX_LEAN,
                "side_below": side,
                "lean": lean,
            },
            "sha256": {name: hashlib.sha256(text.encode()).hexdigest() for name, text in self.files.items()},
        }


def make_asset(request: IntakeRequest) -> MeshAsset:
    """Read a mesh and make an asset of it: one convex hull if that is near enough, else convex pieces.

    The work is done in a separate process, as native code may crash on a mesh, or not end.

    Raises:
        BadConfig, UnknownName: the settings or the file are invalid, or the process crashed or reached a limit.
    """
    request.check()
    (asset,) = each(_make_asset, [request], 1, CUTTING_LIMITS, _lost, fork=False)  # the native code has threads
    return asset


def _lost(request: IntakeRequest, reason: str) -> NoReturn:
    raise BadConfig(
        f"{cut(request.mesh)} cannot be cut into convex pieces: the process {reason}; repair it, or simplify it"
    )


def _make_asset(request: IntakeRequest) -> MeshAsset:
    """Make an asset, in a separate process."""
    with open(os.devnull, "wb") as null:  # native code that crashes prints lines of its own
        os.dup2(null.fileno(), 1)
        os.dup2(null.fileno(), 2)
    found = read(request.mesh, request.units, request.seed, request.up)
    surface = Surface(found.manifold, request.seed)
    hull = one_hull(found, surface, request.seed)
    near = hull.error.worst <= request.error
    pieces = hull if near else cut_up(found, surface, request.error, request.pieces, request.seed)
    visual = _visual(found)
    prop = _prop(request, found, pieces, visual)
    if colours := colours_of(request.mesh, request.units, found.up, request.seed):
        vertices, faces, palette, chosen = painted(*visual, colours, request.seed)
        origin = visual[0][0] - prop.vertices[0]
        prop = replace(prop, vertices=vertices - origin, faces=faces, palette=palette, painted=chosen)
    prop = MeshProp.read(prop.written())  # what a task loads is what is dropped
    asset = MeshAsset(request, found, pieces, hull, visual, prop)
    asset.figures()  # the drop and the MJCF are kept in the asset
    return asset


def _visual(found: MeshSolid) -> tuple[Points, Indices]:
    tolerance, simplified = 1e-4, found.manifold
    while simplified.num_tri() > MAX_VISUAL_FACES:
        simplified, tolerance = found.manifold.simplify(tolerance), 1.5 * tolerance
    mesh = as_mesh(simplified)
    return np.array(mesh.vertices), np.array(mesh.faces)


def _prop(
    request: IntakeRequest, found: MeshSolid, pieces: Pieces, visual: tuple[Points, Indices], rot: Mat3 | None = None
) -> MeshProp:
    mesh = found.mesh
    mesh.density = request.mass / mesh.volume if request.mass else (request.density or DEFAULT_DENSITY)
    turn = np.eye(3) if rot is None else rot
    parts = [points if rot is None else points @ rot.T for points in pieces.corners]
    com, corners = turn @ np.asarray(mesh.center_mass), np.vstack(parts)
    stands = feet(corners, com)
    lowest = np.concatenate([corners[:, 2], stands[:, 2] - FOOT_RADIUS]).min()
    origin = np.array([com[0], com[1], lowest])
    vertices, faces = visual
    return MeshProp(
        corners=tuple(points - origin for points in parts),
        feet=stands - origin,
        vertices=vertices @ turn.T - origin,
        faces=faces,
        mass=float(mesh.mass),
        weighed=float(mesh.mass),
        com=com - origin,
        inertia=turn @ np.asarray(mesh.moment_inertia) @ turn.T,
        friction=request.friction,
    )


def versions() -> dict[str, str]:
    """Versions of the packages on which pieces and figures depend."""
    packages = ("scengen", "coacd", "manifold3d", "mujoco", "trimesh")
    return {**{name: importlib.metadata.version(name) for name in packages}, "intake": REVISION}


def _settings(request: IntakeRequest) -> dict[str, Any]:
    return {name: value for name, value in asdict(request).items() if name != "mesh"}


def key(request: IntakeRequest, sha256: str) -> str:
    """Key of an asset: a hash of the content of the file, the settings and the versions, but not the file's path."""
    identity = json.dumps([sha256, _settings(request), versions()], sort_keys=True)
    return hashlib.sha256(identity.encode()).hexdigest()


def stored_figures(request: IntakeRequest, folder: Path) -> dict[str, Any] | None:
    """The figures of an asset in a folder, if it was made of the same file content, settings and versions; else None.

    Raises:
        BadConfig: the mesh file cannot be read.
    """
    wanted = key(request, hashlib.sha256(content(request.mesh)).hexdigest())
    try:
        figures = json.loads(read_plain(folder / "asset.json"))
        sha256 = {name: hashlib.sha256(read_plain(folder / name)).hexdigest() for name in ("asset.xml", FILE)}
        same = figures["key"] == wanted and figures["sha256"] == sha256
    except (OSError, ValueError, KeyError, TypeError, RecursionError):  # there is no asset, or the files are not ours
        return None
    return figures if same else None

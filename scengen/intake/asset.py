"""Convex pieces as an asset: MJCF that stands alone, the figures behind it, and whether it comes to rest."""

import hashlib
import importlib.metadata
import json
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ..assets.mesh_prop import MeshProp
from ..assets.prop import TABLE_TOP, Prop, place, table
from ..assets.turned import FOOT_RADIUS
from ..errors import BadConfig, UnknownName, cut
from ..geometry import Mat3
from ..sim.scene_text import emit
from .feet import feet
from .pieces import Pieces, Surface, cut_up, one_hull
from .solid import UNITS, MeshSolid, as_mesh, content, read

WATER = 1000.0
"""Density where neither mass nor density is given [kg/m^3]."""
FACES = 2000
"""Most triangles of the mesh that is only looked at."""
DROP, FALL, WATCH = 0.005, 3.0, 2.0
"""The asset is let go at this height above the table [m], left alone for some time, and then watched [s]."""
CREEP = 0.001
"""How far it may move while it is watched [m]: what a certificate allows in the same time."""
SPEED = 0.001
"""How fast [m/s]: what rocks on one contact is faster."""


@dataclass(frozen=True)
class IntakeRequest:
    """What a mesh is taken in with; the settings of `scengen asset` of these names."""

    mesh: str
    units: str | None = None
    mass: float | None = None
    """[kg]."""
    density: float | None = None
    """[kg/m^3]; 1000 where no mass is given either."""
    friction: float = 0.6
    error: float = 0.003
    """How far the pieces may be from the mesh [m]."""
    pieces: int = 64
    """How many there may be."""
    seed: int = 0

    def check(self) -> None:
        """Raise `BadConfig` or `UnknownName` for a value that means nothing."""
        if self.units is not None and self.units not in UNITS:
            raise UnknownName("unit", self.units, UNITS)
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
    """How an asset behaves that was let go just above the table."""

    creep: float
    """Distance that its centre of mass goes while it is watched [m]."""
    speed: float
    """Largest speed of its origin meanwhile [m/s]."""
    turn: float
    """Angle by which it is turned from how it was let go [rad]."""
    contacts: int

    @property
    def rests(self) -> bool:
        return self.creep <= CREEP and self.speed <= SPEED


def dropped(prop: Prop) -> DropResult:
    """Let a prop go above the middle of the table, upright, and watch it once it has had time to come to rest."""
    scene = table()
    place(scene, prop, "asset", [0.0, 0.0, TABLE_TOP + DROP])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(FALL / model.opt.timestep))
    before, speed = data.body("asset").xipos.copy(), 0.0
    for _ in range(round(WATCH / model.opt.timestep)):
        mujoco.mj_step(model, data)
        speed = max(speed, float(np.linalg.norm(data.qvel[:3])))
    mujoco.mj_forward(model, data)
    creep = float(np.linalg.norm(data.body("asset").xipos - before))
    turn = 2 * float(np.arccos(np.clip(abs(data.qpos[3]), 0.0, 1.0)))
    return DropResult(creep, speed, turn, int(data.ncon))


@dataclass(frozen=True)
class MeshAsset:
    """A mesh that was taken in."""

    request: IntakeRequest
    solid: MeshSolid
    pieces: Pieces
    hull: Pieces
    """The convex hull alone, for comparison."""
    prop: MeshProp

    def turned(self, rot: Mat3) -> MeshProp:
        """The asset turned from how its file shows it, to stand on what is then below."""
        return _prop(self.request, self.solid, self.pieces, rot)

    @cached_property
    def rest(self) -> DropResult:
        return dropped(self.prop)

    @cached_property
    def xml(self) -> str:
        """A model with one body, "body", that refers to no files."""
        return emit(self.prop.spec())[0]

    def figures(self) -> dict[str, Any]:
        """What is known about the asset, as plain data."""
        extents = self.solid.mesh.extents
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
            "feet": len(self.prop.feet),
            "error": asdict(self.pieces.error),
            "error_of_one_hull": asdict(self.hull.error),
            "rest": {**asdict(self.rest), "rests": self.rest.rests},
            "sha256": {"asset.xml": hashlib.sha256(self.xml.encode()).hexdigest()},
        }


def take_in(request: IntakeRequest) -> MeshAsset:
    """Read a mesh, cut it into convex pieces unless its hull is near enough, and weigh it.

    Raises:
        BadConfig, UnknownName: one line that says what is wrong with the settings or the file.
    """
    request.check()
    found = read(request.mesh, request.units, request.seed)
    surface = Surface(found.manifold, request.seed)
    hull = one_hull(found, surface, request.seed)
    near = hull.error.worst <= request.error
    pieces = hull if near else cut_up(found, surface, request.error, request.pieces, request.seed)
    return MeshAsset(request, found, pieces, hull, _prop(request, found, pieces))


def _prop(request: IntakeRequest, found: MeshSolid, pieces: Pieces, rot: Mat3 | None = None) -> MeshProp:
    mesh = found.mesh
    mesh.density = request.mass / mesh.volume if request.mass else (request.density or WATER)
    turn = np.eye(3) if rot is None else rot
    parts = [points if rot is None else points @ rot.T for points in pieces.corners]
    com, corners = turn @ np.asarray(mesh.center_mass), np.vstack(parts)
    stands = feet(corners, com)
    lowest = np.concatenate([corners[:, 2], stands[:, 2] - FOOT_RADIUS]).min()
    origin = np.array([com[0], com[1], lowest])
    tolerance, look = 1e-4, found.manifold
    while look.num_tri() > FACES:
        look, tolerance = found.manifold.simplify(tolerance), 1.5 * tolerance
    seen = as_mesh(look)
    return MeshProp(
        corners=tuple(points - origin for points in parts),
        feet=stands - origin,
        vertices=np.asarray(seen.vertices) @ turn.T - origin,
        faces=np.asarray(seen.faces),
        mass=float(mesh.mass),
        com=com - origin,
        inertia=turn @ np.asarray(mesh.moment_inertia) @ turn.T,
        friction=request.friction,
    )


def versions() -> dict[str, str]:
    """Versions of what the pieces and figures depend on."""
    return {name: importlib.metadata.version(name) for name in ("scengen", "coacd", "manifold3d", "mujoco", "trimesh")}


def _settings(request: IntakeRequest) -> dict[str, Any]:
    return {name: value for name, value in asdict(request).items() if name != "mesh"}


def key(request: IntakeRequest, sha256: str) -> str:
    """What an asset is known by: the content of the file, the settings and the versions, not where the file is."""
    told = json.dumps([sha256, _settings(request), versions()], sort_keys=True)
    return hashlib.sha256(told.encode()).hexdigest()


def kept(request: IntakeRequest, folder: Path) -> dict[str, Any] | None:
    """The figures of an asset in a folder, if it was made of this very file with these settings and versions.

    Raises:
        BadConfig: the mesh file cannot be read.
    """
    wanted = key(request, hashlib.sha256(content(request.mesh)).hexdigest())
    try:
        figures = json.loads((folder / "asset.json").read_text())
        sha256 = hashlib.sha256((folder / "asset.xml").read_bytes()).hexdigest()
        same = figures["key"] == wanted and figures["sha256"]["asset.xml"] == sha256
    except (OSError, ValueError, KeyError, TypeError):  # there is none, or what is there is none of ours
        return None
    return figures if same else None

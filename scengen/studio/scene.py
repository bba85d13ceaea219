"""Scenes in three dimensions: bodies of MuJoCo as meshes in the browser, moved by their poses."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import cast

import mujoco
import numpy as np
import trimesh
import viser
from numpy.typing import NDArray
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from ..control.loop import Loop
from ..episode import STRICT, Actions, Episode, Rules
from ..errors import PoolError, ScengenError, cut
from ..look import room as room_look
from ..pictures.render import hide_hulls
from ..scenario import Scenario
from ..sim.world import World

MAX_FACES = 2_000_000
"""Largest number of triangles of a scene that is sent; a robot has 130 000."""
FACES = {
    int(mujoco.mjtGeom.mjGEOM_BOX): 12,
    int(mujoco.mjtGeom.mjGEOM_SPHERE): 1280,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): 128,
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): 480,
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): 1280,
    int(mujoco.mjtGeom.mjGEOM_PLANE): 2,
}
"""Numbers of triangles of geoms that are not meshes, by type."""
NO_COLOUR = (0.5, 0.5, 0.5, 1.0)
"""Colour of geoms that take the colour of their material."""
SHOWN_GROUPS = 3
"""Number of MuJoCo's geom groups that are shown, from 0: those of pictures."""
GRID = 2.0**-12
"""Distance of the places that vertices of meshes can have [m]: 0.24 mm, which is not visible."""
ROBOT_SHARE = 0.05
"""Share of the triangles of large parts of the robot that is shown. 95 % of the surface moves by less than 2 mm, and a
browser that draws in software gets through four times as many pictures."""
SMALL_PART = 400
"""Number of triangles up to which a part of the robot is shown as it is, and least number of those of a larger one."""
PEDESTAL = "pedestal"
"""Part of the name of the body that is a pedestal."""
PEDESTAL_GRID = 2.0**-6
"""The same as `GRID` for a pedestal [m]: 16 mm. Its plates have gaps, over which edges cannot be collapsed."""
STILL = 1e-5
"""Smallest change of a pose that is sent [m, and of a quaternion]."""
SKY = 2.2
"""Intensity of the light from everywhere. A lamp has 3."""
GROUND_LIGHT = (190, 185, 180)
"""Colour of this light from below, which walls and the floor reflect."""
EXPOSURE = 0.85
"""Factor on colours, under which light things keep them."""
ROOM_BODY = 0
"""MuJoCo's world body, which holds the floor and the walls: they throw no shadows on the table."""
BOARDS = (room_look.TABLE.name, room_look.FLOOR.name)
"""Materials of the room whose textures are shown; others have their mean colour."""
FRAME_PERIODS = 4
"""Number of control periods between two frames: 25 frames a second."""
FAULTS = (ScengenError, ValueError, KeyError, TypeError, IndexError, ArithmeticError, RecursionError)
"""Errors that untrusted data may cause; the page shows them."""
Poses = NDArray[np.float32]
"""Poses of all bodies, shape (bodies, 7): position [m], orientation wxyz."""


@dataclass(frozen=True)
class Film:
    """Poses of a rollout over time."""

    frames: NDArray[np.float32]
    """Poses, shape (frames, bodies, 7)."""
    outcome: str
    """Result of the episode, as text."""

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return (len(self.frames) - 1) * FRAME_PERIODS * Loop.PERIOD


def one_line(error: Exception) -> str:
    """An error in one line."""
    return cut(" ".join(str(error).split()) or type(error).__name__, 500)


def poses_of(world: World) -> Poses:
    """Poses of all bodies now."""
    return np.concatenate([world.data.xpos, world.data.xquat], axis=1).astype(np.float32)


def filmed(world: World, scenario: Scenario, actions: Actions, horizon: float, rules: Rules = STRICT) -> Film:
    """Replay actions in a world, and keep the poses."""
    world.reset()
    episode, frames, told = Episode(scenario, world, horizon, rules), [poses_of(world)], "no outcome"
    for period, action in enumerate(actions, 1):
        before = episode.outcome
        if episode.step(action) != before:
            told = f"{episode.outcome} at {world.time:.2f} s" + (f": {episode.reason}" if episode.reason else "")
        if period % FRAME_PERIODS == 0:
            frames.append(poses_of(world))
    return Film(np.array(frames), told)


def light(api: viser.SceneApi) -> None:
    """Light a scene with viser's lamps, which throw shadows, and with light from everywhere, for which shadows are not
    black. `EXPOSURE` keeps light things from becoming white.

    Shadows cost browsers that draw in software half of their pictures: 0.6 a second instead of 1.3 with Chromium's
    SwiftShader on two busy cores, 876 x 800 pixels. They stay because almost all browsers draw on a graphics card.
    """
    api.configure_default_lights(cast_shadow=True)
    api.configure_environment_map(hdri=None)
    api.add_light_hemisphere("/sky", ground_color=GROUND_LIGHT, intensity=SKY)


class SceneView:
    """The bodies of a world in the browser."""

    def __init__(self, api: viser.SceneApi, root: str):
        """
        Args:
            root: name of the node that holds everything, such as `/scene`.
        """
        self._api, self._root = api, root
        self._frames: dict[int, viser.FrameHandle] = {}
        self._sent: Poses | None = None

    def show(
        self,
        world: World,
        offset: Iterable[float] = (0.0, 0.0, 0.0),
        robot: bool = True,
        room: bool = True,
        exposure: float = EXPOSURE,
    ) -> None:
        """Show a world in place of what was shown.

        Args:
            world: a world with visual geoms.
            offset: position of its origin [m].
            robot: whether to show the robot.
            room: whether to show floor and walls. Walls are seen from inside alone.
            exposure: factor on all colours, for lights other than those of `light`.

        Raises:
            PoolError: it has too many triangles.
        """
        hide_hulls(world.model)
        bodies = [body for body in range(world.model.nbody) if robot or body not in world.own]
        if (
            faces := sum(_faces(world.model, geom) for body in bodies for geom in _shown(world.model, body))
        ) > MAX_FACES:
            raise PoolError(f"the scene has {faces} triangles; at most {MAX_FACES} are shown")
        meshes = {body: _meshes(world.model, body, _simplification(world, body), room) for body in bodies}
        self.clear()
        self._api.add_frame(self._root, show_axes=False, position=np.array(list(offset)))
        poses = poses_of(world)
        for body, parts in meshes.items():
            if not parts and not any(_is_board(world.model, geom) for geom in _shown(world.model, body)):
                continue
            # Nodes have numbers for names: those of untrusted bodies could hold anything, such as slashes.
            self._frames[body] = self._api.add_frame(
                f"{self._root}/{body}", show_axes=False, position=poses[body, :3], wxyz=poses[body, 3:]
            )
            for number, (mesh, colour) in enumerate(parts):
                self._api.add_mesh_simple(
                    f"{self._root}/{body}/{number}",
                    np.asarray(mesh.vertices, np.float32),
                    np.asarray(mesh.faces, np.uint32),
                    color=np.round(255 * exposure * colour[:3]).astype(np.uint8),
                    opacity=None if colour[3] >= 1.0 else float(colour[3]),
                    flat_shading=True,
                    cast_shadow=body != ROOM_BODY,
                )
            for number, mesh in enumerate(_boards(world.model, body, exposure, room)):
                self._api.add_mesh_trimesh(f"{self._root}/{body}/board_{number}", mesh, cast_shadow=body != ROOM_BODY)
        self._sent = poses

    def move(self, poses: Poses) -> None:
        """Move the bodies; those that stay are not sent."""
        if self._sent is None or len(poses) != len(self._sent):
            return
        moved = np.flatnonzero(np.abs(poses - self._sent).max(axis=1) > STILL)
        for body in moved.tolist():
            if (frame := self._frames.get(body)) is not None:
                frame.position, frame.wxyz = poses[body, :3], poses[body, 3:]
        self._sent = poses.copy()

    def clear(self) -> None:
        """Show nothing."""
        if self._sent is not None:
            self._api.remove_by_name(self._root)
        self._frames, self._sent = {}, None


Simplification = Callable[[trimesh.Trimesh], trimesh.Trimesh]


def _simplification(world: World, body: int) -> Simplification:
    """Method that simplifies the meshes of a body: things keep their shapes."""
    if body not in world.own:
        return partial(_rounded, grid=GRID)
    return partial(_rounded, grid=PEDESTAL_GRID) if PEDESTAL in world.model.body(body).name else _with_fewer_triangles


def _meshes(
    model: mujoco.MjModel, body: int, simplification: Simplification, planes: bool = True
) -> list[tuple[trimesh.Trimesh, NDArray[np.float32]]]:
    """The visible geoms of a body in its axes, joined by colour."""
    found: dict[bytes, list[trimesh.Trimesh]] = {}
    for geom in _shown(model, body):
        if _is_board(model, geom) or (not planes and model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE):
            continue
        if (mesh := _mesh(model, geom)) is not None:
            mesh.apply_transform(_pose(model, geom))
            found.setdefault(np.round(_colour(model, geom), 3).astype(np.float32).tobytes(), []).append(mesh)
    joined = ((trimesh.util.concatenate(parts), np.frombuffer(key, np.float32)) for key, parts in found.items())
    return [(simplification(mesh), colour) for mesh, colour in joined if isinstance(mesh, trimesh.Trimesh)]


def _pose(model: mujoco.MjModel, geom: int) -> NDArray[np.float64]:
    """Pose of a geom in the axes of its body, shape (4, 4)."""
    transform, turn = np.eye(4), np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    transform[:3, :3], transform[:3, 3] = turn.reshape(3, 3), model.geom_pos[geom]
    return transform


def _is_board(model: mujoco.MjModel, geom: int) -> bool:
    """Whether a geom is the table top or the floor of the room, whose texture is shown."""
    kind, material = model.geom_type[geom], int(model.geom_matid[geom])
    flat = kind in (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_PLANE)
    return bool(flat and material >= 0 and model.mat(material).name in BOARDS)


def _boards(model: mujoco.MjModel, body: int, exposure: float, room: bool) -> Iterator[trimesh.Trimesh]:
    """The boards of a body in its axes, with their textures."""
    for geom in _shown(model, body):
        plane = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE
        if not _is_board(model, geom) or (plane and not room) or (mesh := _mesh(model, geom)) is None:
            continue
        triangles, normals = mesh.triangles, np.repeat(mesh.face_normals, 3, axis=0)
        vertices = triangles.reshape(-1, 3)
        along = np.argsort(np.abs(normals), axis=1, kind="stable")[:, :2]
        places = np.take_along_axis(vertices, np.sort(along, axis=1), axis=1)
        material = int(model.geom_matid[geom])
        visual = TextureVisuals(
            uv=places * model.mat_texrepeat[material],
            material=PBRMaterial(
                baseColorTexture=_tinted(model, geom, exposure), metallicFactor=0.0, roughnessFactor=1.0
            ),
        )
        made = trimesh.Trimesh(vertices, np.arange(len(vertices)).reshape(-1, 3), visual=visual, process=False)
        yield made.apply_transform(_pose(model, geom))


def _tinted(model: mujoco.MjModel, geom: int, exposure: float) -> Image.Image:
    """Texture of a geom in its colour."""
    texture = model.mat_texid[model.geom_matid[geom], mujoco.mjtTextureRole.mjTEXROLE_RGB]
    start, height, width = (int(each[texture]) for each in (model.tex_adr, model.tex_height, model.tex_width))
    pixels = model.tex_data[start : start + height * width * 3].reshape(height, width, 3)
    return Image.fromarray(np.clip(exposure * model.geom_rgba[geom][:3] * pixels, 0, 255).astype(np.uint8))


def _rounded(mesh: trimesh.Trimesh, grid: float) -> trimesh.Trimesh:
    """A mesh with vertices on a grid, each once, and without the triangles that vanish.

    MuJoCo repeats a vertex for each of its normals, which flat shading does not need. A robot becomes half as large,
    and on a grid of binary fractions it compresses to 0.55 of what it would otherwise.
    """
    mesh = trimesh.Trimesh(np.round(mesh.vertices / grid) * grid, mesh.faces, process=False)
    mesh.merge_vertices()
    mesh.update_faces(mesh.nondegenerate_faces())
    return mesh


def _with_fewer_triangles(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A mesh of the robot, its large parts by collapsed edges."""
    parts = [
        part
        if len(part.faces) <= SMALL_PART
        else part.simplify_quadric_decimation(
            face_count=max(SMALL_PART, int(ROBOT_SHARE * len(part.faces))), aggression=4
        )
        for part in _rounded(mesh, GRID).split(only_watertight=False, repair=False)
    ]
    return _rounded(cast(trimesh.Trimesh, trimesh.util.concatenate(parts)), GRID)


def _shown(model: mujoco.MjModel, body: int) -> Iterator[int]:
    """The visible geoms of a body."""
    for geom in range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]):
        transparent = _colour(model, geom)[3] == 0.0 or model.geom_rgba[geom][3] == 0.0
        if model.geom_group[geom] < SHOWN_GROUPS and not transparent:
            yield geom


def _colour(model: mujoco.MjModel, geom: int) -> NDArray[np.float32]:
    """Colour of a geom as MuJoCo shows it, with the mean of its texture, RGBA."""
    material, colour = int(model.geom_matid[geom]), model.geom_rgba[geom].copy()
    if material < 0:
        return colour
    if (colour == NO_COLOUR).all():
        colour = model.mat_rgba[material].copy()
    if (texture := model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]) >= 0:
        start, channels = model.tex_adr[texture], model.tex_nchannel[texture]
        size = model.tex_height[texture] * model.tex_width[texture] * channels
        colour[:3] *= model.tex_data[start : start + size].reshape(-1, channels)[:, :3].mean(axis=0) / 255.0
    return colour


def _faces(model: mujoco.MjModel, geom: int) -> int:
    """Number of triangles of a geom, known before they are made."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        return int(model.mesh_facenum[model.geom_dataid[geom]])
    return FACES.get(int(model.geom_type[geom]), 0)


def _mesh(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh | None:
    """A geom in its own axes; None for one that cannot be shown, such as an endless plane."""
    kinds, (a, b, c) = mujoco.mjtGeom, model.geom_size[geom]
    match kinds(model.geom_type[geom]):
        case kinds.mjGEOM_BOX:
            return trimesh.creation.box((2 * a, 2 * b, 2 * c))
        case kinds.mjGEOM_SPHERE:
            return trimesh.creation.icosphere(3, a)
        case kinds.mjGEOM_CYLINDER:
            return trimesh.creation.cylinder(a, 2 * b, sections=32)
        case kinds.mjGEOM_CAPSULE:
            return trimesh.creation.capsule(2 * b, a, count=(16, 16))
        case kinds.mjGEOM_ELLIPSOID:
            return trimesh.creation.icosphere(3, 1.0).apply_scale((a, b, c))
        case kinds.mjGEOM_PLANE if a > 0 and b > 0:
            corners = [[x * a, y * b, 0.0] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
        case kinds.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
            faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]]
            return trimesh.Trimesh(vertices.copy(), faces.copy(), process=False)
        case _:
            return None

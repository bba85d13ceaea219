"""Pictures of scenes and film strips of rollouts. Needs OpenGL: EGL or OSMesa without a display."""

import base64
import io
import itertools
import math
import os
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import mujoco
import numpy as np
from mujoco import MjvCamera, gl_context
from numpy.typing import NDArray
from PIL import Image

from ..assets.prop import TABLE_TOP
from ..errors import ScengenError, UnknownName
from ..geometry import Vec3
from ..robots.panda import arms
from ..sim.world import World

Picture = NDArray[np.uint8]
"""Shape (height, width, 3), RGB."""
Where = tuple[float, float]
"""Azimuth and elevation of a view [deg]."""
State = NDArray[np.float64]
"""Of a world, see `World.state`."""


SHADOW = 1024
"""Edge of the shadow map [pixels]. MuJoCo's 4096 looks hardly better and makes a picture cost 1.6 times as much
without a graphics card."""


class NoPictures(ScengenError):
    """OpenGL is missing on this machine."""


class Camera:
    """A renderer that stays with one world."""

    def __init__(self, world: World, width: int = 320, height: int = 240, where: Where | None = None):
        """Begin with the fitted view of the scene, from `where` or from where least of it is hidden.

        Raises:
            NoPictures: OpenGL is missing.
        """
        self.world = world
        _check_backend()
        world.model.vis.quality.shadowsize = SHADOW
        try:
            self._renderer = mujoco.Renderer(world.model, height, width)
        except Exception as error:  # what fails differs by platform and back end: ImportError, AttributeError, GLError
            raise NoPictures(
                f"no OpenGL for pictures ({' '.join(str(error).split())[:80]}); on Debian install libegl1 libgl1 "
                "libosmesa6, and set MUJOCO_GL=egl or osmesa"
            ) from None
        self._aspect = width / height
        self._view = fitted(world, self._aspect, *where) if where else clearest(world, self._aspect)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = [1, 1, 1, 0, 0, 0]
        self._options.sitegroup[:] = 0
        hide_hulls(world.model)

    def look(self, states: Sequence[State]) -> None:
        """Choose the view that hides least over several states of the world, which is left in the last."""
        self._view = clearest(self.world, self._aspect, states)

    def take(self, name: str | None = None) -> Picture:
        """A picture of the world as it is now, from a named camera or in the view that was chosen last.

        Raises:
            UnknownName: there is no such camera.
        """
        cameras = [self.world.model.camera(i).name for i in range(self.world.model.ncam)]
        if name is not None and name not in cameras:
            raise UnknownName("camera", name, cameras)
        mujoco.mj_camlight(self.world.model, self.world.data)  # the control loop leaves them one physics step behind
        self._renderer.update_scene(self.world.data, camera=name or self._view, scene_option=self._options)
        return self._renderer.render()

    @property
    def where(self) -> Where:
        """From where the fitted view looks."""
        return self._view.azimuth, self._view.elevation

    def close(self) -> None:
        self._renderer.close()


VIEWS = ((140.0, -28.0), (220.0, -28.0), (180.0, -35.0), (100.0, -28.0), (260.0, -28.0), (140.0, -55.0), (220.0, -55.0))
"""Azimuths and elevations from which the fitted view looks [deg]: the first from the free corner of the table to the
robot, so that the arm hides little."""
WORTH = 0.05
"""Another view than the first one has to show so much more, as a share of what there is to see."""
MARGIN = 1.12
"""How much farther away the fitted view stands than it would have to."""
CLOSEST = 0.55
"""It does not come closer than this [m], or one could not tell where on the table things are."""
FALLEN = 0.1
"""What is so far below the table top is not followed [m], unless something stands fast down there."""
SIGNS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
"""Of the corners of a box, shape (8, 3)."""
INSIDE = 0.8
"""How far out the points of a box lie that are looked for: its corners themselves touch what stands beside it."""
THROUGH = 1e-6
"""How far behind a transparent surface one looks on, as a share of the way."""


def hide_hulls(model: mujoco.MjModel) -> None:
    """Make the collision hulls of all arms invisible; their visual meshes lie in the same places."""
    robots = np.isin(model.body_rootid, [model.body(names.base).id for names in arms(model)])
    hulls = robots[model.geom_bodyid] & (model.geom_group == 0)
    model.geom_rgba[hulls, 3] = 0.0


def fitted(
    world: World,
    aspect: float,
    azimuth: float = VIEWS[0][0],
    elevation: float = VIEWS[0][1],
    points: NDArray[np.float64] | None = None,
) -> MjvCamera:
    """A view that just holds the scene's things and the robot's hand; the table and the floor go on beyond it.

    Args:
        aspect: width of the picture over its height.
        azimuth, elevation: where it looks [deg].
        points: what it holds instead, shape (n, 3) [m].
    """
    view = MjvCamera()
    view.azimuth, view.elevation = azimuth, elevation
    ahead, right, up = _axes(view)
    axes = np.array([right, up, ahead])
    seen = (_corners(world) if points is None else points) @ axes.T
    centre = (seen.min(axis=0) + seen.max(axis=0)) / 2
    away = seen - centre
    half = np.tan(np.radians(world.model.vis.global_.fovy) / 2)
    room = np.abs(away[:, :2]) / [half * aspect, half]  # at this distance from the eye a point stands on the rim
    view.lookat = axes.T @ centre
    view.distance = max(CLOSEST, MARGIN * float((room.max(axis=1) - away[:, 2]).max()))
    return view


def clearest(world: World, aspect: float, states: Sequence[State] = ()) -> MjvCamera:
    """The view in which least is hidden, behind the robot or behind other things.

    It holds the hand as it is at first, and the scene's things wherever they get to, unless they fall off the table.

    Args:
        aspect: width of the picture over its height.
        states: of the world, at which one looks; default as it is now. The world is left in the last.
    """
    held = [_corners(world) if number == 0 else _things(world) for number, _ in enumerate(_visited(world, states))]
    points = np.vstack(held)
    points = points[points[:, 2] > min(TABLE_TOP - FALLEN, _foot(world))]
    views = [fitted(world, aspect, *where, points) for where in VIEWS]
    shown = np.array([[_shown(world, view) for view in views] for _ in _visited(world, states)]).mean(axis=0)
    best = int(shown.argmax())
    return views[best if shown[best] > shown[0] + WORTH else 0]


def _visited(world: World, states: Sequence[State]) -> Iterator[None]:
    """Bring the world into one state after the other; without any it stays as it is."""
    if not states:
        yield
    for state in states:
        world.restore(state)
        yield


def _axes(view: MjvCamera) -> tuple[Vec3, Vec3, Vec3]:
    """Where a view looks, and what is right and up for it: unit vectors."""
    turn, dip = np.radians(view.azimuth), np.radians(view.elevation)
    ahead = np.array([np.cos(dip) * np.cos(turn), np.cos(dip) * np.sin(turn), np.sin(dip)])
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    return ahead, right, np.cross(right, ahead)


def _shown(world: World, view: MjvCamera) -> float:
    """Share of the scene that a view shows: of the corners of the boxes around a body's geoms, averaged over bodies.

    What is transparent hides nothing.
    """
    eye = view.lookat - view.distance * _axes(view)[0]
    shown = defaultdict(list)
    for geom in _geoms(world):
        body = world.model.geom_bodyid[geom]
        shown[body] += [_sees(world, eye, corner, body) for corner in _box(world, geom, INSIDE)]
    return float(np.mean([np.mean(each) for each in shown.values()]))


def _sees(world: World, eye: Vec3, point: Vec3, body: int) -> bool:
    """Whether nothing opaque stands between the eye and a point but the body that the point belongs to."""
    model, hit = world.model, np.array([-1], np.int32)
    while True:
        ahead = point - eye
        share = mujoco.mj_ray(model, world.data, eye, ahead, None, 1, -1, hit, None)
        if not 0 <= share < 1 or model.geom_bodyid[hit[0]] == body:
            return True
        material = model.geom_matid[hit[0]]
        if (model.geom_rgba[hit[0], 3] if material < 0 else model.mat_rgba[material, 3]) == 1.0:
            return False
        eye = eye + (share + THROUGH) * ahead


def _corners(world: World) -> NDArray[np.float64]:
    """Corners of the boxes around all geoms of the scene but table and floor, and the hand, shape (n, 3) [m]."""
    return np.vstack([_things(world), *(arm.hand for arm in world.arms)])


def _things(world: World) -> NDArray[np.float64]:
    """The same without the hand."""
    return np.vstack([_box(world, geom) for geom in _geoms(world)])


def _foot(world: World) -> float:
    """A little below everything that stands fast in the scene [m]; inf if nothing does."""
    fast = [geom for geom in _geoms(world) if world.model.body_weldid[world.model.geom_bodyid[geom]] == 0]
    return min((float(_box(world, geom)[:, 2].min()) for geom in fast), default=math.inf) - 0.001


def _geoms(world: World) -> list[int]:
    """All geoms of the scene but table and floor."""
    model = world.model
    apart = {model.body(name).id for name in ("world", "table", *(names.base for names in arms(model)))}
    return [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] not in apart]


def _box(world: World, geom: int, scale: float = 1.0) -> NDArray[np.float64]:
    """Corners of the box around a geom, shape (8, 3) [m]; a smaller one of the same middle with `scale` below 1."""
    centre, half = world.model.geom_aabb[geom].reshape(2, 3)
    frame = world.data.geom_xmat[geom].reshape(3, 3)
    return world.data.geom_xpos[geom] + (centre + scale * half * SIGNS) @ frame.T


def _check_backend() -> None:
    """Refuse the back end that needs a display where there is none: trying it twice ends the process."""
    if "glfw" in gl_context.GLContext.__module__ and sys.platform == "linux" and not os.environ.get("DISPLAY"):
        raise NoPictures(
            "no OpenGL for pictures without a display; on Debian install libegl1 libgl1 libosmesa6, and set "
            "MUJOCO_GL=egl or import scengen before mujoco"
        )


@contextmanager
def camera(
    scene_xml: str, embodiment: str, width: int = 320, height: int = 240, where: Where | None = None
) -> Iterator[Camera]:
    """A camera on the start of a scene, with the robot's visual meshes; see `Camera`.

    Raises:
        NoPictures: OpenGL is missing.
    """
    view = Camera(World.load(scene_xml, embodiment, visual=True), width, height, where)
    try:
        yield view
    finally:
        view.close()


def encode(picture: Picture, kind: str = "webp") -> bytes:
    """The picture as a file of that kind."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, kind, quality=85)
    return buffer.getvalue()


def address(content: bytes, kind: str) -> str:
    """A picture as a data address, text that stands in an HTML file."""
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"

"""Pictures of scenes and film strips of rollouts. Needs OpenGL: EGL or OSMesa without a display."""

import base64
import io
import itertools
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
from mujoco import gl_context
from numpy.typing import NDArray
from PIL import Image

from ..errors import ScengenError, UnknownName
from ..robots.panda import arms
from ..sim.world import World

Picture = NDArray[np.uint8]
"""Shape (height, width, 3), RGB."""


SHADOW = 1024
"""Edge of the shadow map [pixels]. MuJoCo's 4096 looks hardly better and makes a picture cost 1.6 times as much
without a graphics card."""


class NoPictures(ScengenError):
    """OpenGL is missing on this machine."""


class Camera:
    """A renderer that stays with one world."""

    def __init__(self, world: World, width: int = 320, height: int = 240):
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
        self._view = fitted(world, width / height)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = [1, 1, 1, 0, 0, 0]
        self._options.sitegroup[:] = 0
        hide_hulls(world.model)

    def take(self, name: str | None = None) -> Picture:
        """A picture of the world as it is now, from a named camera or in a view fitted to the scene as it began.

        Raises:
            UnknownName: there is no such camera.
        """
        cameras = [self.world.model.camera(i).name for i in range(self.world.model.ncam)]
        if name is not None and name not in cameras:
            raise UnknownName("camera", name, cameras)
        mujoco.mj_camlight(self.world.model, self.world.data)  # the control loop leaves them one physics step behind
        self._renderer.update_scene(self.world.data, camera=name or self._view, scene_option=self._options)
        return self._renderer.render()

    def close(self) -> None:
        self._renderer.close()


AZIMUTH, ELEVATION = 140.0, -28.0
"""Where the fitted view looks [deg]: from the free corner of the table to the robot, so that the arm hides little."""
MARGIN = 1.12
"""How much farther away the fitted view stands than it would have to."""
CLOSEST = 0.55
"""It does not come closer than this [m], or one could not tell where on the table things are."""


def hide_hulls(model: mujoco.MjModel) -> None:
    """Make the robot's collision hulls invisible; its visual meshes lie in the same places."""
    robot = model.body_rootid == model.body("robot0_base").id
    hulls = robot[model.geom_bodyid] & (model.geom_group == 0)
    model.geom_rgba[hulls, 3] = 0.0


def fitted(world: World, aspect: float) -> mujoco.MjvCamera:
    """A view that just holds the scene's things and the robot's hand; the table and the floor go on beyond it.

    Args:
        aspect: width of the picture over its height.
    """
    view = mujoco.MjvCamera()
    view.azimuth, view.elevation = AZIMUTH, ELEVATION
    turn, dip = np.radians(AZIMUTH), np.radians(ELEVATION)
    ahead = np.array([np.cos(dip) * np.cos(turn), np.cos(dip) * np.sin(turn), np.sin(dip)])
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    axes = np.array([right, np.cross(right, ahead), ahead])
    points = _corners(world) @ axes.T
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    away = points - centre
    half = np.tan(np.radians(world.model.vis.global_.fovy) / 2)
    room = np.abs(away[:, :2]) / [half * aspect, half]  # at this distance from the eye a point stands on the rim
    view.lookat = axes.T @ centre
    view.distance = max(CLOSEST, MARGIN * float((room.max(axis=1) - away[:, 2]).max()))
    return view


def _corners(world: World) -> NDArray[np.float64]:
    """Corners of the boxes around all geoms of the scene but table and floor, and the hand, shape (n, 3) [m]."""
    model, data = world.model, world.data
    apart = {model.body(name).id for name in ("world", "table", *(names.base for names in arms(model)))}
    geoms = [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] not in apart]
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    boxes = [
        data.geom_xpos[g]
        + (model.geom_aabb[g, :3] + signs * model.geom_aabb[g, 3:]) @ data.geom_xmat[g].reshape(3, 3).T
        for g in geoms
    ]
    return np.vstack([*boxes, *(arm.hand for arm in world.arms)])


def _check_backend() -> None:
    """Refuse the back end that needs a display where there is none: trying it twice ends the process."""
    if "glfw" in gl_context.GLContext.__module__ and sys.platform == "linux" and not os.environ.get("DISPLAY"):
        raise NoPictures(
            "no OpenGL for pictures without a display; on Debian install libegl1 libgl1 libosmesa6, and set "
            "MUJOCO_GL=egl or import scengen before mujoco"
        )


@contextmanager
def camera(scene_xml: str, embodiment: str, width: int = 320, height: int = 240) -> Iterator[Camera]:
    """A camera on the start of a scene, with the robot's visual meshes.

    Raises:
        NoPictures: OpenGL is missing.
    """
    view = Camera(World.load(scene_xml, embodiment, visual=True), width, height)
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

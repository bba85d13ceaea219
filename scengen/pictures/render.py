"""Pictures of scenes and film strips of rollouts. Needs OpenGL: EGL or OSMesa without a display."""

import base64
import io
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NoReturn

import mujoco
import numpy as np
from mujoco import MjvCamera
from numpy.typing import NDArray
from PIL import Image

from ..errors import ScengenError, UnknownName
from ..look.looks import ROOM, Look, look_of
from ..robots.panda import arms
from ..sim.world import World
from ..work.machine import free_address_space
from . import opengl
from .views import SHOWN_GROUPS, VIEWS, Directions, State, clearest

Picture = NDArray[np.uint8]
"""Shape (height, width, 3), RGB."""

MIN_ADDRESS_SPACE = 2.5e9
"""Address space that a process needs for its first picture [bytes]: OpenGL in software takes 2.2 GB, most of it for the
stacks of its threads."""


class NoPictures(ScengenError):
    """OpenGL is missing on this machine."""


class Camera:
    """A renderer for one world. Any thread may take pictures."""

    def __reduce__(self) -> NoReturn:
        raise TypeError("a Camera holds a context of OpenGL and cannot be copied or pickled; make a new Camera(world)")

    def __init__(self, world: World, width: int = 320, height: int = 240, view: MjvCamera | None = None):
        """Start with a view, by default that of `clearest` at the first picture that names no camera.

        Args:
            width: width of the pictures [pixels], at most `opengl.LARGEST_EDGE`.
            height: height of the pictures [pixels], likewise.
            view: such as that of `fitted` or of `twins.comparison_view`.

        Raises:
            BadConfig: pictures cannot have this size.
            NoPictures: OpenGL is missing.
        """
        opengl.check_size(width=width, height=height)
        self.world, self._lock = world, threading.Lock()
        check_pictures()
        look = look_of(world.model)
        world.model.vis.quality.shadowsize = look.shadow_map_of(width, height)
        try:
            self._renderer = opengl.Renderer(world.model, height, width, look.smooth_shadows)
        except Exception as error:  # its type depends on platform and back end: ImportError, AttributeError, GLError
            raise NoPictures(
                f"no OpenGL for pictures ({' '.join(str(error).split())[:80]}); on Debian install libegl1 libgl1 "
                "libosmesa6, and set MUJOCO_GL=egl or osmesa"
            ) from None
        self._aspect = width / height
        self._view = view
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = SHOWN_GROUPS
        self._options.sitegroup[:] = 0
        hide_hulls(world.model)

    @property
    def device(self) -> str:
        """Name of the renderer that OpenGL uses on this machine."""
        return self._renderer.device

    def frame(self, states: Sequence[State] = (), directions: Directions = VIEWS) -> None:
        """Choose the view that hides least over several states of the world, which ends in the last one."""
        self._view = clearest(self.world, self._aspect, states, directions)

    def _eye(self, name: str | None) -> str | MjvCamera:
        """A named camera, or the view."""
        if name is None and self._view is None:
            self.frame()
        return name or self._view  # type: ignore[return-value]

    def take(self, name: str | None = None, data: mujoco.MjData | None = None) -> Picture:
        """A picture from a named camera, or in the view that was chosen last.

        Args:
            data: a copy of the world's data at an earlier moment; None for the present world.

        Raises:
            UnknownName: there is no such camera.
        """
        cameras = [self.world.model.camera(i).name for i in range(self.world.model.ncam)]
        if name is not None and name not in cameras:
            raise UnknownName("camera", name, cameras)
        model, data, eye = self.world.model, data or self.world.data, self._eye(name)
        with self._lock:
            mujoco.mj_camlight(model, data)  # after the control loop they are one physics step late
            self._renderer.update_scene(data, camera=eye, scene_option=self._options)
            return self._renderer.render()

    def refresh(self) -> None:
        """Take over textures that have changed."""
        with self._lock:
            self._renderer.refresh()

    def geoms(self, name: str | None = None) -> NDArray[np.int32]:
        """Number of the geom that each pixel shows, shape (height, width); -1 for none. Cameras as in `take`."""
        eye = self._eye(name)
        with self._lock:
            self._renderer.enable_segmentation_rendering()
            try:
                self._renderer.update_scene(self.world.data, camera=eye, scene_option=self._options)
                shown = self._renderer.render()
            finally:
                self._renderer.disable_segmentation_rendering()
        return np.where(shown[..., 1] == mujoco.mjtObj.mjOBJ_GEOM, shown[..., 0], -1)

    def bodies(self, name: str | None = None) -> NDArray[np.int32]:
        """Number of the body that each pixel shows, shape (height, width); -1 for none. Cameras as in `take`."""
        geoms = self.geoms(name)
        return np.where(geoms >= 0, self.world.model.geom_bodyid[geoms], -1)

    def close(self) -> None:
        with self._lock:
            self._renderer.close()


def hide_hulls(model: mujoco.MjModel) -> None:
    """Make the collision hulls of all arms invisible; their visual meshes lie in the same places."""
    robots = np.isin(model.body_rootid, [model.body(names.base).id for names in arms(model)])
    hulls = robots[model.geom_bodyid] & (model.geom_group == 0)
    model.geom_rgba[hulls, 3] = 0.0


def check_pictures() -> None:
    """Raise `NoPictures` if OpenGL would end the process: without a display, or with too little address space; `Forked`
    if it would not answer."""
    opengl.check_process()
    if not opengl.has_display():
        raise NoPictures(
            "no OpenGL for pictures without a display; on Debian install libegl1 libgl1 libosmesa6, and set "
            "MUJOCO_GL=egl or osmesa"
        )
    if (free := free_address_space()) < MIN_ADDRESS_SPACE:  # OpenGL would end the process without a message
        raise NoPictures(
            f"pictures need {MIN_ADDRESS_SPACE / 1e9:g} GB of address space, and the limit (ulimit -v) leaves "
            f"{free / 1e9:.1f} GB; raise it"
        )


@contextmanager
def camera(scene_xml: str, embodiment: str, width: int = 320, height: int = 240, look: Look = ROOM) -> Iterator[Camera]:
    """A camera at the start of a scene, with the robot's visual meshes; see `Camera`.

    Raises:
        NoPictures: OpenGL is missing.
    """
    check_pictures()  # before the meshes of the robot, which take a part of the address space
    view = Camera(World.load(scene_xml, embodiment, look), width, height)
    try:
        yield view
    finally:
        view.close()


def encode(picture: Picture, kind: str = "webp") -> bytes:
    """The picture as the content of a file of this kind."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, kind, quality=85)
    return buffer.getvalue()


def address(content: bytes, kind: str) -> str:
    """A picture as a data address for HTML."""
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"

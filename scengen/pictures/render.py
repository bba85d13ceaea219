"""Pictures of scenes and film strips of rollouts. Needs OpenGL: EGL or OSMesa without a display."""

import base64
import io
import itertools
import math
import os
import sys
import threading
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NoReturn

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
from ..work.machine import free_address_space
from . import opengl

Picture = NDArray[np.uint8]
"""Shape (height, width, 3), RGB."""
State = NDArray[np.float64]
"""State of a world, see `World.state`."""

SHADOW_MAP_SIZE = 1024
"""Edge of the shadow map [pixels]. MuJoCo's 4096 gives almost the same picture, which takes 1.6 times as long without a
graphics card."""
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
        """Start with a view, by default the fitted one of the scene from the direction that hides least of it.

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
        world.model.vis.quality.shadowsize = SHADOW_MAP_SIZE
        try:
            self._renderer = opengl.Renderer(world.model, height, width)
        except Exception as error:  # its type depends on platform and back end: ImportError, AttributeError, GLError
            raise NoPictures(
                f"no OpenGL for pictures ({' '.join(str(error).split())[:80]}); on Debian install libegl1 libgl1 "
                "libosmesa6, and set MUJOCO_GL=egl or osmesa"
            ) from None
        self._aspect = width / height
        self._view = clearest(world, self._aspect) if view is None else view
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = [1, 1, 1, 0, 0, 0]
        self._options.sitegroup[:] = 0
        hide_hulls(world.model)

    @property
    def device(self) -> str:
        """Name of the renderer that OpenGL uses on this machine."""
        return self._renderer.device

    def look(self, states: Sequence[State]) -> None:
        """Choose the view that hides least over several states of the world, which ends in the last one."""
        self._view = clearest(self.world, self._aspect, states)

    def take(self, name: str | None = None) -> Picture:
        """A picture of the present world, from a named camera or in the view that was chosen last.

        Raises:
            UnknownName: there is no such camera.
        """
        cameras = [self.world.model.camera(i).name for i in range(self.world.model.ncam)]
        if name is not None and name not in cameras:
            raise UnknownName("camera", name, cameras)
        model, data = self.world.model, self.world.data
        with self._lock:
            mujoco.mj_camlight(model, data)  # after the control loop they are one physics step late
            self._renderer.update_scene(data, camera=name or self._view, scene_option=self._options)
            return self._renderer.render()

    def bodies(self, name: str) -> NDArray[np.int32]:
        """Number of the body that each pixel of a named camera shows, shape (height, width); -1 for none."""
        model, data = self.world.model, self.world.data
        with self._lock:
            self._renderer.enable_segmentation_rendering()
            try:
                self._renderer.update_scene(data, camera=name, scene_option=self._options)
                shown = self._renderer.render()
            finally:
                self._renderer.disable_segmentation_rendering()
        geoms = (shown[..., 1] == mujoco.mjtObj.mjOBJ_GEOM) & (shown[..., 0] >= 0)
        return np.where(geoms, model.geom_bodyid[np.where(geoms, shown[..., 0], 0)], -1)

    def look_by(self, view: MjvCamera) -> None:
        """Choose a view."""
        self._view = view

    def close(self) -> None:
        with self._lock:
            self._renderer.close()


VIEWS = ((140.0, -28.0), (220.0, -28.0), (180.0, -35.0), (100.0, -28.0), (260.0, -28.0), (140.0, -55.0), (220.0, -55.0))
"""Azimuths and elevations of the fitted views [deg]. The first looks from the free corner of the table to the robot, so
that the arm hides little."""
MIN_GAIN = 0.05
"""Smallest share of the scene by which another view must show more than the first one to be chosen."""
DISTANCE_MARGIN = 1.12
"""Factor on the smallest distance at which the fitted view holds all points."""
CLOSEST = 0.55
"""Smallest distance of the fitted view [m]: a closer one would not show where on the table things are."""
FALL_DEPTH = 0.1
"""Depth below the table top at which things are not followed [m], unless a fixed body is as low."""
CORNER_SIGNS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
"""Signs of the corners of a box, shape (8, 3)."""
CORNER_SHRINKAGE = 0.8
"""Scale of the boxes whose corners must be visible: the corners of the full boxes touch neighbouring things."""
RAY_STEP = 1e-6
"""Distance behind a transparent surface at which a ray continues, as a share of the ray."""


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
    """The closest view that contains the things of the scene and the robot's hand, but not all of table and floor.

    Args:
        aspect: width of the picture over its height.
        azimuth, elevation: direction of the view [deg].
        points: points that it must contain instead, shape (n, 3) [m].
    """
    view = MjvCamera()
    view.azimuth, view.elevation = azimuth, elevation
    ahead, right, up = view_axes(view)
    axes = np.array([right, up, ahead])
    seen = (scene_corners(world) if points is None else points) @ axes.T
    centre = (seen.min(axis=0) + seen.max(axis=0)) / 2
    away = seen - centre
    half = np.tan(np.radians(world.model.vis.global_.fovy) / 2)
    needed = np.abs(away[:, :2]) / [half * aspect, half]  # at this distance from the eye a point is on the rim
    view.lookat = axes.T @ centre
    view.distance = max(CLOSEST, DISTANCE_MARGIN * float((needed.max(axis=1) - away[:, 2]).max()))
    return view


def clearest(world: World, aspect: float, states: Sequence[State] = ()) -> MjvCamera:
    """The view in which the robot and other things hide least of the scene.

    It contains the initial position of the hand, and the things of the scene in all states, unless they fall off the
    table.

    Args:
        aspect: width of the picture over its height.
        states: states of the world. Default: the present one. The world ends in the last one.
    """
    corners = [
        scene_corners(world) if number == 0 else _thing_corners(world) for number, _ in enumerate(_visit(world, states))
    ]
    points = np.vstack(corners)
    points = points[points[:, 2] > min(TABLE_TOP - FALL_DEPTH, _lowest_fixed(world))]
    views = [fitted(world, aspect, *where, points) for where in VIEWS]
    shares = np.array([[visible_share(world, view) for view in views] for _ in _visit(world, states)]).mean(axis=0)
    best = int(shares.argmax())
    return views[best if shares[best] > shares[0] + MIN_GAIN else 0]


def _visit(world: World, states: Sequence[State]) -> Iterator[None]:
    """Bring the world into one state after the other. Without states it stays as it is."""
    if not states:
        yield
    for state in states:
        world.restore(state)
        yield


def view_axes(view: MjvCamera) -> tuple[Vec3, Vec3, Vec3]:
    """Unit vectors ahead, right and up of a view."""
    turn, dip = np.radians(view.azimuth), np.radians(view.elevation)
    ahead = np.array([np.cos(dip) * np.cos(turn), np.cos(dip) * np.sin(turn), np.sin(dip)])
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    return ahead, right, np.cross(right, ahead)


def visible_share(world: World, view: MjvCamera) -> float:
    """Visible share of the corners of the boxes around the geoms of a body, averaged over bodies.

    Transparent things hide nothing.
    """
    eye = view.lookat - view.distance * view_axes(view)[0]
    visible = defaultdict(list)
    for geom in things(world):
        body = world.model.geom_bodyid[geom]
        visible[body] += [_is_visible(world, eye, corner, body) for corner in box_of(world, geom, CORNER_SHRINKAGE)]
    return float(np.mean([np.mean(each) for each in visible.values()]))


def _is_visible(world: World, eye: Vec3, point: Vec3, body: int) -> bool:
    """Whether no opaque thing is between the eye and a point, apart from the body of the point."""
    model, hit = world.model, np.array([-1], np.int32)
    while True:
        ahead = point - eye
        share = mujoco.mj_ray(model, world.data, eye, ahead, None, 1, -1, hit, None)
        if not 0 <= share < 1 or model.geom_bodyid[hit[0]] == body:
            return True
        material = model.geom_matid[hit[0]]
        if (model.geom_rgba[hit[0], 3] if material < 0 else model.mat_rgba[material, 3]) == 1.0:
            return False
        eye = eye + (share + RAY_STEP) * ahead


def scene_corners(world: World) -> NDArray[np.float64]:
    """Corners of the boxes around the geoms of all things, and the hands, shape (n, 3) [m]."""
    return np.vstack([_thing_corners(world), *(arm.hand for arm in world.arms)])


def _thing_corners(world: World) -> NDArray[np.float64]:
    """Corners of the boxes around the geoms of all things, shape (n, 3) [m]."""
    return np.vstack([box_of(world, geom) for geom in things(world)])


def _lowest_fixed(world: World) -> float:
    """Height of a millimetre below all fixed things of the scene [m]; inf if there are none."""
    fixed = [geom for geom in things(world) if world.model.body_weldid[world.model.geom_bodyid[geom]] == 0]
    return min((float(box_of(world, geom)[:, 2].min()) for geom in fixed), default=math.inf) - 0.001


def things(world: World) -> list[int]:
    """All geoms of the scene without table and floor."""
    model = world.model
    apart = {model.body(name).id for name in ("world", "table", *(names.base for names in arms(model)))}
    return [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] not in apart]


def box_of(world: World, geom: int, scale: float = 1.0) -> NDArray[np.float64]:
    """Corners of the box around a geom, scaled about its middle, shape (8, 3) [m]."""
    centre, half = world.model.geom_aabb[geom].reshape(2, 3)
    frame = world.data.geom_xmat[geom].reshape(3, 3)
    return world.data.geom_xpos[geom] + (centre + scale * half * CORNER_SIGNS) @ frame.T


def check_pictures() -> None:
    """Raise `NoPictures` if OpenGL would end the process: without a display, or with too little address space; `Forked`
    if it would not answer."""
    opengl.check_process()
    if "glfw" in gl_context.GLContext.__module__ and sys.platform == "linux" and not os.environ.get("DISPLAY"):
        raise NoPictures(
            "no OpenGL for pictures without a display; on Debian install libegl1 libgl1 libosmesa6, and set "
            "MUJOCO_GL=egl or import scengen before mujoco"
        )
    if (free := free_address_space()) < MIN_ADDRESS_SPACE:  # OpenGL would end the process without a message
        raise NoPictures(
            f"pictures need {MIN_ADDRESS_SPACE / 1e9:g} GB of address space, and the limit (ulimit -v) leaves "
            f"{free / 1e9:.1f} GB; raise it"
        )


@contextmanager
def camera(scene_xml: str, embodiment: str, width: int = 320, height: int = 240) -> Iterator[Camera]:
    """A camera at the start of a scene, with the robot's visual meshes; see `Camera`.

    Raises:
        NoPictures: OpenGL is missing.
    """
    check_pictures()  # before the meshes of the robot, which take a part of the address space
    view = Camera(World.load(scene_xml, embodiment, visual=True), width, height)
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

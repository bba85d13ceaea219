"""Pictures of scenes and film strips of rollouts. Needs OpenGL: EGL or OSMesa without a display."""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
from mujoco import gl_context
from numpy.typing import NDArray
from PIL import Image

from .errors import ScengenError
from .sim.world import World
from .validate.rollout import Tape

Picture = NDArray[np.uint8]
"""Shape (height, width, 3), RGB."""


class NoPictures(ScengenError):
    """OpenGL is missing on this machine."""


class Camera:
    """A renderer that stays with one world."""

    def __init__(self, world: World, width: int = 320, height: int = 240):
        self.world = world
        _check_backend()
        try:
            self._renderer = mujoco.Renderer(world.model, height, width)
        except Exception as error:  # what fails differs by platform and back end: ImportError, AttributeError, GLError
            raise NoPictures(
                f"no OpenGL for pictures ({' '.join(str(error).split())[:80]}); on Debian install libegl1 libgl1 "
                "libosmesa6, and set MUJOCO_GL=egl or osmesa"
            ) from None
        self._view = mujoco.MjvCamera()
        self._view.lookat = [-0.05, 0.0, 0.92]
        self._view.distance, self._view.azimuth, self._view.elevation = 1.15, 140.0, -28.0
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = [1, 1, 1, 0, 0, 0]
        self._options.sitegroup[:] = 0
        self._hide_hulls()

    def take(self, name: str | None = None) -> Picture:
        """A picture of the world as it is now, from a named camera or from a corner of the table."""
        self._renderer.update_scene(self.world.data, camera=name or self._view, scene_option=self._options)
        return self._renderer.render()

    def close(self) -> None:
        self._renderer.close()

    def _hide_hulls(self) -> None:
        """Make the robot's collision hulls invisible; its visual meshes lie in the same places."""
        model = self.world.model
        robot = model.body_rootid == model.body("robot0_base").id
        hulls = robot[model.geom_bodyid] & (model.geom_group == 0)
        model.geom_rgba[hulls, 3] = 0.0


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


def strip(scene_xml: str, embodiment: str, tape: Tape, frames: int = 8, width: int = 320, height: int = 240) -> Picture:
    """A film strip: pictures at equal times from the start to the end of a tape, in rows of four."""
    with camera(scene_xml, embodiment, width, height) as view:
        times = np.linspace(0, len(tape), frames).round().astype(int)
        pictures, done = [], 0
        for time in times:
            for action in tape[done:time]:
                view.world.follow(action)
            done = time
            pictures.append(view.take())
    rows = [np.hstack(pictures[i : i + 4]) for i in range(0, frames - frames % 4, 4)]
    return np.vstack(rows)


def encode(picture: Picture, kind: str = "webp") -> bytes:
    """The picture as a file of that kind."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, kind, quality=85)
    return buffer.getvalue()

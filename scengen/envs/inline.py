"""Pictures that a notebook shows if they are the last line of a cell."""

from contextlib import closing

from PIL import Image

from .. import compose
from ..look.looks import ROOM
from ..pictures.render import Camera
from ..pool.row import SceneRow
from ..samplers.task import Draw
from ..sim.world import World
from ..validate.playable import stored_world
from ..validate.rebuilt import rebuild


def picture(of: Draw | SceneRow | World, camera: str | None = None, width: int = 480, height: int = 360) -> Image.Image:
    """A picture of a draw or a stored scenario at its start, or of a world as it is.

    Args:
        of: a world without visual geometry (`World.load` without a look) shows the bodies that collide.
        camera: one of the model's cameras, such as `agentview`. Default: the clearest view.

    Raises:
        ScengenError: OpenGL or the camera is missing, or the scene cannot be built.
    """
    with closing(Camera(_world(of), width, height)) as eye:
        return Image.fromarray(eye.take(camera))


def _world(of: Draw | SceneRow | World) -> World:
    if isinstance(of, World):
        return of
    if isinstance(of, SceneRow):
        return stored_world(of, ROOM)
    return World.load(rebuild(of.scenario), compose.load_task(of.task).embodiment, ROOM)

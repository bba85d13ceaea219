"""What robosuite composes a scenario of: the scene, the suction cup, and both with the robot under one physics."""

import logging
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from ..robots import panda, suction
from ..sim import scene_text

_log = logging.getLogger("robosuite_logs")
_log.disabled = True  # on import, robosuite advises to install what nothing here needs
from robosuite.models.base import MujocoXML  # noqa: E402
from robosuite.models.grippers import register_gripper  # noqa: E402
from robosuite.models.grippers.gripper_model import GripperModel  # noqa: E402
from robosuite.models.robots import RobotModel  # noqa: E402
from robosuite.models.tasks import ManipulationTask  # noqa: E402

_log.disabled = False
_log.setLevel(
    logging.WARNING
)  # at INFO it tells, for every environment, where on this machine a controller's file lies

TEXT = ("compiler", "option", "size", "visual", "custom")
"""What the scene says about physics, memory and light, in place of what robosuite puts into every model."""


@register_gripper
class SuctionGripper(GripperModel):
    """The suction cup of `scengen.robots.suction`: one action, suction on where it is positive.

    Its command is what is asked for. Whether the cup pulls is decided in every physics step by `Loop.watch`.
    """

    def __init__(self, idn: Any = 0):
        with _file(suction.xml()) as path:
            super().__init__(path, idn=idn)

    def format_action(self, action: NDArray[np.float64]) -> NDArray[np.float64]:
        """-1 for off, 1 for on, which robosuite scales to the actuator's range of 0 to 1."""
        self.current_action = np.where(np.asarray(action) > 0.0, 1.0, -1.0)
        return self.current_action

    @property
    def init_qpos(self) -> NDArray[np.float64]:
        """No joints."""
        return np.zeros(0)


class SceneModel(MujocoXML):
    """The text of a scene, as robosuite holds models. Names stay as they are."""

    def __init__(self, text: str):
        scene_text.check(text)
        with _file(text) as path:
            super().__init__(path)
        for geom in self.worldbody.iter("geom"):
            # robosuite draws group 1 only; ours is drawn whole. A group has no effect on the physics.
            if geom.get("group", "0") == "0":
                geom.set("group", "1")


class SceneTask(ManipulationTask):
    """A scene and the robots, under the scene's own physics options and without contacts that cannot come about."""

    def __init__(self, scene: SceneModel, robots: list[RobotModel]):
        super().__init__(mujoco_arena=scene, mujoco_robots=robots)
        for tag in TEXT:
            for theirs in self.root.findall(tag):
                self.root.remove(theirs)
            self.root.extend(scene.root.findall(tag))
        for robot in robots:
            for one, other in panda.CONTACT_FREE_LINKS:
                names = {"body1": str(robot.correct_naming(one)), "body2": str(robot.correct_naming(other))}
                self.contact.append(Element("exclude", names))


@contextmanager
def _file(text: str) -> Iterator[str]:
    """Path of a file of that content for a moment: robosuite reads models from files only."""
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as file:
        file.write(text)
        file.flush()
        yield file.name

"""Models from which robosuite composes a scenario: the scene, the suction cup, and both with the robot as one task."""

import logging
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from typing import Any
from xml.etree.ElementTree import Element

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..compat import ROBOSUITE_RUNS
from ..errors import ScengenError
from ..installation import ROBOSUITE
from ..perturb.distractors import spare_elements
from ..robots import panda, suction
from ..sim import scene_text

REMEDY = "run pip install 'scengen[robosuite]', in a separate environment"
"""Remedy for every fault that keeps robosuite's environments from running."""


class NoRobosuite(ScengenError, ImportError):
    """robosuite's Python code or one of its requirements is missing, is another release, or does not run with the
    installed MuJoCo."""


def _check_installed() -> None:
    """Raise `NoRobosuite` unless robosuite's environments can run here."""
    try:
        found = version("robosuite")
    except PackageNotFoundError:
        raise NoRobosuite(f"no robosuite for its environments; {REMEDY}") from None
    if found != ROBOSUITE:
        raise NoRobosuite(f"certified scenarios run in robosuite {ROBOSUITE}, this is {found}; {REMEDY}")
    if not ROBOSUITE_RUNS:
        raise NoRobosuite(f"robosuite {found} does not run with mujoco {mujoco.__version__}; {REMEDY}")


_check_installed()
_log = logging.getLogger("robosuite_logs")
_log.disabled = True  # on import, robosuite recommends packages that are not needed here
try:
    from robosuite.models.base import MujocoXML
    from robosuite.models.grippers import register_gripper
    from robosuite.models.grippers.gripper_model import GripperModel
    from robosuite.models.robots import RobotModel
    from robosuite.models.tasks import ManipulationTask
except ModuleNotFoundError as error:  # installed for the robot's files alone
    raise NoRobosuite(f"robosuite {ROBOSUITE} is here without its requirement {error.name}; {REMEDY}") from None

_log.disabled = False
_log.setLevel(logging.WARNING)  # at INFO it logs the path of a controller's file for every environment

SCENE_SECTIONS = ("compiler", "option", "size", "visual", "custom")
"""MJCF sections about physics, memory and light, in which the scene replaces robosuite's defaults."""


@register_gripper
class SuctionGripper(GripperModel):
    """The suction cup of `scengen.robots.suction`: one action, suction on if it is positive.

    The action is the command. In every physics step `Loop.watch` decides whether the cup pulls.
    """

    def __init__(self, idn: Any = 0):
        with _temporary_file(suction.xml()) as path:
            super().__init__(path, idn=idn)

    def format_action(self, action: NDArray[np.float64]) -> NDArray[np.float64]:
        """-1 for off and 1 for on, which robosuite scales to the actuator's range of 0 to 1."""
        self.current_action = np.where(np.asarray(action) > 0.0, 1.0, -1.0)
        return self.current_action

    @property
    def init_qpos(self) -> NDArray[np.float64]:
        """Empty: the cup has no joints."""
        return np.zeros(0)


class SceneModel(MujocoXML):
    """A scene as a model of robosuite, with unchanged names."""

    def __init__(self, text: str, spare: bool = False):
        """
        Args:
            spare: whether to add the spare geoms of distractors.
        """
        scene_text.check(text)
        with _temporary_file(text) as path:
            super().__init__(path)
        for geom in self.worldbody.iter("geom"):
            # robosuite draws group 1 only, so that all geoms of the scene must be in it. Groups do not affect physics.
            if geom.get("group", "0") == "0":
                geom.set("group", "1")
        if spare:
            self.worldbody.extend(Element("geom", each) for each in spare_elements())


class SceneTask(ManipulationTask):
    """A scene and the robots, with the scene's physics options, without contacts that cannot occur."""

    def __init__(self, scene: SceneModel, robots: list[RobotModel]):
        super().__init__(mujoco_arena=scene, mujoco_robots=robots)
        for tag in SCENE_SECTIONS:
            for theirs in self.root.findall(tag):
                self.root.remove(theirs)
            self.root.extend(scene.root.findall(tag))
        for robot in robots:
            for one, other in panda.CONTACT_FREE_LINKS:
                names = {"body1": str(robot.correct_naming(one)), "body2": str(robot.correct_naming(other))}
                self.contact.append(Element("exclude", names))


@contextmanager
def _temporary_file(text: str) -> Iterator[str]:
    """Path of a temporary file with this content: robosuite reads models from files only."""
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as file:
        file.write(text)
        file.flush()
        yield file.name

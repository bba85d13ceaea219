"""MuJoCo's passive viewer for a scenario of a pool."""

import os
import sys
import time
from itertools import chain, repeat

import mujoco.viewer
import numpy as np

from ..control.loop import Loop
from ..episode import Episode
from ..errors import ScengenError
from ..pool import PoolRow
from ..scenario import Scenario
from ..sim.world import World
from .film import Take
from .render import hide_hulls
from .views import fitted


class NoDisplay(ScengenError):
    """There is no display for a window."""


def check_display() -> None:
    """Raise `NoDisplay` if no window can be opened: the attempt would end the process."""
    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
        raise NoDisplay("no display to open a window on; use scengen show film, which draws the same into a file")


def view(row: PoolRow, scenario: Scenario, replay: bool) -> None:
    """Show a scenario in real time until the window is closed. After the witness, or without it, the robot is idle.

    Raises:
        NoDisplay: there is no display for a window.
    """
    check_display()
    world = Take.witness(row, scenario).world()
    hide_hulls(world.model)
    episode, actions = Episode(scenario, world), row.witness if replay else []
    with mujoco.viewer.launch_passive(world.model, world.data, show_left_ui=False, show_right_ui=False) as window:
        _set_view(window, world)
        due = time.monotonic()
        for action in chain(actions, repeat(None)):
            if not window.is_running():
                return
            with window.lock():
                episode.step(world.idle.astype(np.float32) if action is None else action)
            window.sync()
            due += Loop.PERIOD
            time.sleep(max(0.0, due - time.monotonic()))


def _set_view(window: mujoco.viewer.Handle, world: World) -> None:
    """Start with the view of the pictures, without sites."""
    eye = fitted(world, 4 / 3)
    with window.lock():
        window.cam.lookat[:] = eye.lookat
        window.cam.distance, window.cam.azimuth, window.cam.elevation = eye.distance, eye.azimuth, eye.elevation
        window.opt.sitegroup[:] = 0

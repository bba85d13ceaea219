"""Styles of demonstrations: how they are chosen, and how a plan is played in one."""

import math
from collections.abc import Sequence

import numpy as np

from ..control.loop import ACTION, Loop
from ..control.teleop import MOTION
from ..errors import UnknownName
from ..samplers.keyed import normals, unit
from ..scenario import Plan, Planner
from ..sim.arm import ROBOT
from ..sim.style import Style
from ..sim.world import World

NOMINAL = "nominal"
"""Style of certificates: straight moves, no noise."""
VARIED = "varied"
"""Style with another pace, detours, pauses, equivalent grasps and noise."""
RECOVER = "recover"
"""Style as `VARIED`, in which the hand is displaced in moves through free space and recovers."""
WEIGHTS = {NOMINAL: 1, VARIED: 3, RECOVER: 1}
"""Weights with which the requested styles are chosen: of all three, a fifth of the runs shows recoveries."""

SLOWEST = 0.8
"""Smallest factor on the pace. A person is slower than a script: the paper's demonstrations take up to twice the
oracle's time."""
FASTEST = 1.1
"""Largest factor on the pace."""
DETOUR = 0.03
"""Largest displacement of the middle of a move through free space [m]: a third of the shortest such move."""
PAUSE = 0.4
"""Longest pause before a move through free space [s]."""
HESITATES = 1 / 3
"""Share of the moves through free space that start with a pause. With a pause before each of them a plan of twenty such
moves took five seconds longer, and one run of six of `seesaw_balance` exceeded the time limit."""
DISPLACEMENT = 0.015
"""Displacement of the commanded position from which a run recovers [m]."""
GRASP_SLACK = 0.1
"""Relative excess in width of equivalent grasps."""
NOISE = 0.02
"""Standard deviation of the noise on the motion channels of an action; certificates survive 0.03 of white noise."""
NOISE_TIME = 0.2
"""Correlation time of the noise [s]. White noise would not pass the teleoperation filter."""
CONTACT_NOISE = 0.25
"""Share of the noise while the arm touches something: at full noise a rod that is let go on a ridge tips in three runs
of eight, and a suction cup does not get a piece into its place within the time limit in one of eight."""


def check_styles(names: Sequence[str]) -> None:
    """Raise `UnknownName` for a name that is not a style."""
    for name in names:
        if name not in WEIGHTS:
            raise UnknownName("style", name, WEIGHTS)


def chosen(names: Sequence[str], *key: str | int) -> str:
    """The style of one run.

    Args:
        names: styles to choose from, each with its weight.
        key: identity of the run: task, scenario and number of the run.
    """
    ordered = [name for name in WEIGHTS if name in names]
    place = unit("style", *key) * sum(WEIGHTS[name] for name in ordered)
    for name in ordered:
        place -= WEIGHTS[name]
        if place < 0:
            return name
    return ordered[-1]


def style_of(name: str, *key: str | int) -> Style | None:
    """The style of one run, with its own pace; None for `NOMINAL`."""
    if name == NOMINAL:
        return None

    def number(*what: str | int) -> float:
        drawn = unit("style", *key, *what)
        return max(0.0, 1.0 - (1.0 - drawn) / HESITATES) if what[-1] == "pause" else drawn

    pace = SLOWEST + (FASTEST - SLOWEST) * number("pace")
    displacement = DISPLACEMENT if name == RECOVER else 0.0
    return Style(name, number, pace, DETOUR, PAUSE, displacement, GRASP_SLACK)


def in_style(planner: Planner, name: str, *key: str | int) -> Planner:
    """The same plan in a style, with noise unless the style is `NOMINAL`.

    Args:
        planner: function that starts the plan.
        name: name of the style.
        key: identity of the run.
    """
    style = style_of(name, *key)
    if style is None:
        return planner

    def plan(world: World) -> Plan:
        world.style = style
        kept = math.exp(-Loop.PERIOD / NOISE_TIME)
        fresh, noise = NOISE * math.sqrt(1.0 - kept**2), np.zeros((len(world.arms), ACTION))
        for period, action in enumerate(planner(world)):
            shares = np.ones((len(noise), 1))
            for arm in world.arms:
                drawn = np.array(normals(MOTION, "noise", *key, period, arm.number))
                noise[arm.number, :MOTION] = kept * noise[arm.number, :MOTION] + fresh * drawn
                if world.touching_bodies(arm.label) - {ROBOT}:
                    shares[arm.number] = CONTACT_NOISE
            yield np.clip(action + (shares * noise).ravel(), -1.0, 1.0)

    return plan

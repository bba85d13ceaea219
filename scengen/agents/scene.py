"""Description of a scene for a model: words, frames and readings, and nothing that names the scenario."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import jinja2
import numpy as np

from ..assets.prop import TABLE_TOP
from ..control.loop import Loop
from ..control.osc import STEP, TURN
from ..envs.gym import Observation, PoolEnv
from ..envs.observations import cameras_of, streams_of, turns_pictures
from ..pictures.render import encode
from ..pool import PoolRow
from ..robots.jaw import OPENING
from ..sim.embodiment import JAW, SUCTION, hands
from .facts import Sheet

READINGS = ("eef_pos", "eef_quat", "gripper_qpos", "force_torque")
"""Streams whose readings are given to the model, as endings of their names."""
ARMS = {1: "one Franka Panda arm", 2: "two Franka Panda arms, the right one first"}
"""Arms as text, by their number."""
HANDS = {JAW: f"a parallel jaw that opens {1000 * OPENING:.0f} mm wide", SUCTION: "a suction cup"}
"""Hands as text, by their names."""


MOUNTED = {
    "rgb_exo_right_cam": "stands beyond the table, above it, and looks down at the robot. Right in its picture is the "
    "robot's left (+y), up is towards the robot (-x).",
    "rgb_exo_left_cam": "stands at the robot's left (y = 1.3 m) and looks along -y. Right in its picture is towards "
    "the robot (-x), up is +z.",
    "rgb_gripper_cam": "is on the hand, which points down at the start, and looks along the fingers. Right in its "
    "picture is then the robot's right (-y), up is away from the robot (+x).",
    "robot1_rgb_gripper_cam": "is on the left hand in the same way.",
}
"""Cameras that a model gets, by the paper's names, and where they stand. The paper's rgb_ego_cam is left out: it
shows nearly what rgb_exo_right_cam shows."""


@dataclass(frozen=True)
class View:
    """Pictures and readings of a scene: the slots of a prompt that depend on the scenario."""

    frames: Mapping[str, bytes]
    """JPEG pictures by name, such as `rgb_exo_left_cam at 0.0 s`; none for a model without pictures."""
    readings: tuple[str, ...]
    """Readings of the sensors, one line for each moment."""
    cameras: str = ""
    """Places of the cameras as text; empty without pictures."""


def observe(env: PoolEnv, scenario: str, moments: int, spacing: float) -> View:
    """Look at a scenario at some moments, while the robot does nothing.

    Args:
        env: environment of the task, with the cameras that the model gets.
        scenario: id of the scenario.
        moments: number of moments, from the start on.
        spacing: time between two of them [s].
    """
    observation, _ = env.reset(options={"scenario": scenario})
    frames, readings = dict[str, bytes](), list[str]()
    for moment in range(moments):
        for _ in range(round(spacing / Loop.PERIOD) if moment else 0):
            observation, *_ = env.step(env.world.idle)
        when = f"{moment * spacing:.1f} s"
        frames |= pictures(env, observation, when)
        readings.append(f"{when}: {told(observation)}")
    return View(frames, tuple(readings), cameras(env))


def pictures(env: PoolEnv, observation: Observation, when: str) -> dict[str, bytes]:
    """The cameras' pictures of an observation as JPEG, by names such as `rgb_exo_left_cam at 0.0 s`."""
    return {f"{name} at {when}": encode(observation[name].astype(np.uint8), "jpeg") for name in env.cameras}


def cameras(env: PoolEnv) -> str:
    """Where the cameras of an environment stand, as text; empty if it has none."""
    if not env.cameras:
        return ""
    return prompt("cameras", names=env.cameras, told=MOUNTED, turned=turns_pictures(env.task.family)).strip()


def rules(horizon: float, further: Sequence[str]) -> str:
    """The rules of a task as text: its time limit [s], and what its sheet adds."""
    return prompt("rules", horizon=horizon, rules=further).strip()


def told(observation: Observation) -> str:
    """The robot's readings as text, rounded to what sensors resolve."""
    named = {name: value for name, value in observation.items() if name.endswith(READINGS)}
    return "; ".join(
        f"{name} {np.array2string(np.asarray(v), precision=3, suppress_small=True)}" for name, v in named.items()
    )


def streams(embodiment: str, seeing: bool) -> list[str]:
    """Names of the streams and cameras that a model gets."""
    found = [name for name in streams_of(embodiment) if name.endswith(READINGS)]
    return [*found, *(name for name in cameras_of(embodiment) if name in MOUNTED)] if seeing else found


def robot(embodiment: str) -> str:
    """The robot as text."""
    names = hands(embodiment)
    return f"{ARMS[len(names)]} with {' and '.join(HANDS[name] for name in names)}."


def controller(embodiment: str) -> str:
    """The controller as text."""
    count = len(hands(embodiment))
    per = "" if count == 1 else " for each arm"
    return (
        f"At {1 / Loop.PERIOD:.0f} Hz an action of seven numbers in [-1, 1]{per}: displacement of the hand along x, y "
        f"and z (1 is {STEP:g} m), rotation vector (1 is {TURN:g} rad), gripper (-1 open or off, 1 closed or on). "
        "Contact forces are felt at the wrist."
    )


@cache
def _templates() -> jinja2.Environment:
    loader = jinja2.PackageLoader("scengen", "agents/prompts")
    return jinja2.Environment(
        loader=loader, autoescape=False, keep_trailing_newline=False, undefined=jinja2.StrictUndefined
    )


def prompt(name: str, **slots: object) -> str:
    """The text of a prompt with its slots filled; every slot must be given."""
    return _templates().get_template(f"{name}.txt").render(**slots)


def scene_text(instruction: str, row: PoolRow, sheet: Sheet, view: View) -> str:
    """The part of all prompts that describes task, robot and scene."""
    embodiment = row.embodiment
    return prompt(
        "scene",
        instruction=" ".join(instruction.split()),
        robot=robot(embodiment),
        controller=controller(embodiment),
        table=TABLE_TOP,
        objects=sheet.objects,
        rules=rules(row.horizon, sheet.rules),
        cameras=view.cameras,
        frames=list(view.frames),
        readings=view.readings,
    )

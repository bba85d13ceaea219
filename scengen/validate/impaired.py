"""Scenes under conditions of control: what a scenario draws for them, and the scene's text with it."""

import dataclasses

import mujoco
import numpy as np

from ..compat import from_mjcf
from ..control.impairment import Impairment
from ..errors import BadConfig
from ..robots.panda import Names, width_in_hand
from ..samplers.conditions import impairment, start
from ..scenario import Conditions
from ..sim import scene_text
from ..sim.embodiment import hands
from ..sim.world import World

TRIES = 20
"""Number of starts that are drawn until one is free of contact."""


def posed(text: str, conditions: Conditions | None, scenario: str, seed: int = 0) -> str:
    """The text of a scene under conditions.

    Another start is the first one drawn in which the robot touches nothing new.

    Args:
        text: the scene under the usual conditions, MJCF.
        conditions: None for the usual ones.
        scenario: id of the scenario under the usual conditions.
        seed: another number draws other values.

    Raises:
        BadConfig: no start is free of contact, or the scene has conditions already.
    """
    if conditions is None:
        return text
    if Impairment.of_spec(from_mjcf(text)):
        raise BadConfig(f"{conditions}: the scene has conditions of control already; give a pool without them")
    robot = conditions.embodiment
    drawn, arms = impairment(conditions, scenario, seed), len(hands(robot))
    if not start(conditions, arms, scenario, seed, 0):
        return impaired(text, drawn, robot)
    usual = _contacts(World.load(text, robot))
    for attempt in range(TRIES):
        moved = dataclasses.replace(drawn, start=start(conditions, arms, scenario, seed, attempt))
        world = World.load(found := impaired(text, moved, robot), robot)
        if _in_range(world) and not _contacts(world) - usual:
            return found
    raise BadConfig(f"{conditions}: none of {TRIES} starts is free of contact; ask for a lower level")


def impaired(text: str, impairment: Impairment, embodiment: str) -> str:
    """The text of a scene under an impairment. What a jaw holds at the start moves with the hand."""
    scene = from_mjcf(text)
    if impairment.start and (found := held(world := World.load(text, embodiment))):
        impairment.write(moved := from_mjcf(text))
        there = World.load(scene_text.emit(moved)[0], embodiment)
        turn = there.arms[0].hand_rot @ world.arms[0].hand_rot.T
        body, quat = scene.body(found), np.empty(4)
        body.pos = there.arms[0].hand + turn @ (world.pos(found) - world.arms[0].hand)
        mujoco.mju_mat2Quat(quat, (turn @ world.rot(found)).ravel())
        body.quat = quat
    impairment.write(scene)
    return scene_text.emit(scene)[0]


def held(world: World) -> str:
    """The free body between the fingers of the first arm at the start; empty if there is none."""
    if width_in_hand(world.model) is None:
        return ""
    touched = {name for pair in _contacts(world) for name in pair}
    return next((name for name in world.free_bodies if name in touched), "")


def _contacts(world: World) -> set[tuple[str, str]]:
    """Names of the bodies in contact at the start, at least one of them the robot's."""
    pairs = [world.model.geom_bodyid[contact.geom] for contact in world.data.contact[: world.data.ncon]]
    mine = [pair for pair in pairs if world.own & {*pair.tolist()}]
    return {(world.model.body(int(a)).name, world.model.body(int(b)).name) for a, b in mine}


def _in_range(world: World) -> bool:
    """Whether all joints of the driven arms are within their ranges."""
    joints = [world.model.joint(name) for arm in world.arms for name in Names(arm.number).joints]
    return all(low <= world.data.qpos[joint.qposadr[0]] <= high for joint in joints for low, high in [joint.range])

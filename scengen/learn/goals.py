"""Actions as goals of the hands, which policies predict, and back.

An action moves the goal of a hand relative to its pose at that moment. The second action of a chunk therefore leads
somewhere else than in the demonstration if the hand has left the demonstrated path by then. Policies predict where the
goals of the next rows lie, seen from the present pose of the hand; an action is the way to such a goal from the pose
that the hand has when it is played.

A goal has seven numbers for each arm, in units of an action: a translation divided by `STEP`, a rotation vector divided
by `TURN`, both in the axes of the hand, and the command of the gripper. A pose has seven numbers for each arm, too: a
position [m] and a quaternion xyzw.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..control.loop import ACTION
from ..control.osc import STEP, TURN
from ..robots.panda import Names
from ..sim.embodiment import hands


def pose_streams(embodiment: str) -> tuple[str, ...]:
    """Names of the streams that hold the poses of the hands, one after the other."""
    return tuple(f"{Names(arm).arm}{part}" for arm in range(len(hands(embodiment))) for part in ("eef_pos", "eef_quat"))


def goals_of(poses: NDArray[np.float32], actions: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    """Goals of the next `count` rows, seen from the poses at each row, shape (rows, count * 7 * arms).

    After the end the hands rest where they are, as gripped.

    Args:
        poses: poses of the hands at each row, shape (rows, 7 * arms).
        actions: shape (rows, 7 * arms).
    """
    rest = np.zeros((count, actions.shape[1]), np.float32)
    rest[:, ACTION - 1 :: ACTION] = actions[-1, ACTION - 1 :: ACTION]
    actions, poses = np.concatenate([actions, rest]), np.concatenate([poses, np.repeat(poses[-1:], count, axis=0)])
    rows = len(actions) - count
    found = np.empty((rows, count, actions.shape[1]), np.float32)
    for k in range(count):
        for arm in _arms(actions):
            here, then, action = poses[:rows, arm], poses[k : rows + k, arm], actions[k : rows + k, arm]
            found[:, k, arm] = _turned(_moved(action, then, here), _rot(here).inv())
    return found.reshape(rows, -1)


def action_to(goal: NDArray[np.float32], then: NDArray[np.float32], now: NDArray[np.float32]) -> NDArray[np.float32]:
    """The action to a goal, shape (7 * arms,), not limited to [-1, 1].

    Args:
        goal: goal of each hand, shape (7 * arms,).
        then: poses of the hands from which the goal is seen, shape (7 * arms,).
        now: their present poses, shape (7 * arms,).
    """
    found = np.empty_like(goal, np.float32)
    for arm in _arms(goal):
        found[arm] = _moved(_turned(goal[arm], _rot(then[arm])), then[arm], now[arm])
    return found


def _arms(actions: NDArray[np.float32]) -> list[slice]:
    """Places of each arm's numbers in an action, and in the poses of the hands."""
    return [slice(first, first + ACTION) for first in range(0, actions.shape[-1], ACTION)]


def _moved(action: NDArray[Any], then: NDArray[np.float32], now: NDArray[np.float32]) -> NDArray[np.float64]:
    """An action at a pose as the action at another pose that leads to the same place; all of shape (..., 7)."""
    move = action[..., :3] + (then[..., :3].astype(np.float64) - now[..., :3]) / STEP
    goal = Rotation.from_rotvec(TURN * action[..., 3:6].astype(np.float64)) * _rot(then)
    return np.concatenate([move, (goal * _rot(now).inv()).as_rotvec() / TURN, action[..., 6:]], axis=-1)


def _turned(action: NDArray[Any], rot: Rotation) -> NDArray[np.float64]:
    """An action in axes that are turned by `rot` as the same action in fixed axes, shape (..., 7)."""
    return np.concatenate([rot.apply(action[..., :3]), rot.apply(action[..., 3:6]), action[..., 6:]], axis=-1)


def _rot(pose: NDArray[np.float32]) -> Rotation:
    return Rotation.from_quat(pose[..., 3:])

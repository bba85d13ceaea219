"""Goals of the hands: where actions lead, wherever the hand is when they are played."""

import numpy as np
import pytest
from helpers import REFERENCE
from scipy.spatial.transform import Rotation

from scengen.control.osc import STEP, TURN
from scengen.envs.gym import PoolEnv
from scengen.learn.goals import action_to, goals_of, pose_streams


def walk(rows, arms, seed=1):
    """Poses of hands that wander, and actions."""
    random = np.random.default_rng(seed)
    poses = np.concatenate(
        [
            np.hstack([random.uniform(-0.3, 0.3, (rows, 3)), Rotation.random(rows, random_state=seed + arm).as_quat()])
            for arm in range(arms)
        ],
        axis=1,
    )
    return poses.astype(np.float32), random.uniform(-0.4, 0.4, (rows, 7 * arms)).astype(np.float32)


@pytest.mark.parametrize("arms", [1, 2])
def test_on_the_demonstrated_path_the_actions_are_those_of_the_demonstration(arms):
    poses, actions = walk(12, arms)
    goals = goals_of(poses, actions, 3).reshape(12, 3, 7 * arms)
    for row in range(9):
        for k in range(3):
            assert action_to(goals[row, k], poses[row], poses[row + k]) == pytest.approx(actions[row + k], abs=1e-4)


def test_a_hand_beside_the_path_is_led_to_the_same_place():
    """1 cm off along x, the action goes back by 1 cm, a fifth of its range; a quarter turn is turned back."""
    poses, actions = walk(2, 1)
    goals = goals_of(poses, actions, 2).reshape(2, 2, 7)
    aside = poses[1] + np.array([0.01, 0, 0, 0, 0, 0, 0], np.float32)
    assert action_to(goals[0, 1], poses[0], aside) - actions[1] == pytest.approx([-0.2, 0, 0, 0, 0, 0, 0], abs=1e-4)
    turned = poses[0].copy()
    turned[3:] = (Rotation.from_rotvec([0, 0, 0.25]) * Rotation.from_quat(poses[0, 3:])).as_quat()
    rest = np.array([0, 0, 0, 0, 0, 0, 1], np.float32)
    assert action_to(rest, poses[0], turned) == pytest.approx([0, 0, 0, 0, 0, -0.5, 1], abs=1e-5)


def test_after_the_end_the_hand_rests_as_gripped():
    poses, actions = walk(4, 1)
    last = goals_of(poses, actions, 3).reshape(4, 3, 7)[-1]
    assert np.allclose(last[1:, :6], 0, atol=1e-6) and np.all(last[1:, 6] == actions[-1, 6])


@pytest.mark.parametrize(
    "action", [[0.4, -0.2, 0.6, 0, 0, 0, -1], [0, 0, 0, 0.3, -0.2, 0.5, -1]], ids=["moved", "turned"]
)
def test_the_hand_arrives_at_its_goal(action):
    """The controller goes where a goal is said to lie. A turn ends 2 deg short: the pull to the posture opposes it."""
    streams = pose_streams("panda_jaw")
    env = PoolEnv("domino_single", REFERENCE, list(streams), settle=False)
    observation, _ = env.reset(seed=0)
    first = here = np.concatenate([observation[name] for name in streams])
    goal = goals_of(first[None], np.array([action], np.float32), 1)[0]
    for _ in range(200):
        observation, *_ = env.step(action_to(goal, first, here).clip(-1, 1))
        here = np.concatenate([observation[name] for name in streams])
    left = (
        Rotation.from_quat(here[3:]).inv()
        * Rotation.from_rotvec(TURN * np.array(action[3:6]))
        * Rotation.from_quat(first[3:])
    )
    assert left.magnitude() < 0.05
    if any(action[:3]):
        assert here[:3] - first[:3] == pytest.approx(STEP * np.array(action[:3]), abs=1e-3)


def test_goals_turn_with_the_whole_scene():
    """Seen from the hand, a demonstration that is turned about the vertical is the same demonstration."""
    poses, actions = walk(6, 1)
    about = Rotation.from_rotvec([0, 0, 1.2])
    other = np.hstack([about.apply(poses[:, :3]), (about * Rotation.from_quat(poses[:, 3:])).as_quat()])
    acted = np.hstack([about.apply(actions[:, :3]), about.apply(actions[:, 3:6]), actions[:, 6:]])
    turned = goals_of(other.astype(np.float32), acted.astype(np.float32), 2)
    assert np.allclose(turned, goals_of(poses, actions, 2), atol=1e-4)

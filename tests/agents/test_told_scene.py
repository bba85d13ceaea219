"""What a prompt says about rules, cameras and positions holds in the scene."""

import helpers
import numpy as np
import pytest

from scengen import load_task
from scengen.agents import facts
from scengen.agents.scene import MOUNTED, cameras, rules, streams
from scengen.envs.gym import PoolEnv
from scengen.envs.observations import cameras_of

AXES = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1)}


@pytest.fixture(scope="module")
def env():
    made = PoolEnv("domino_single", helpers.REFERENCE, streams("panda_jaw", True), width=32, height=32)
    made._load(made._rows[0])  # a reset would take pictures
    return made


@pytest.mark.parametrize("name", [name for name in MOUNTED if name in cameras_of("panda_jaw")])
def test_left_and_right_of_a_picture_are_where_the_prompt_says(env, name):
    model, data = env.world.model, env.world.data
    axes = data.cam_xmat[model.camera(cameras_of("panda_jaw")[name]).id].reshape(3, 3)
    right, up = (
        text.partition("(")[2].partition(")")[0] for text in MOUNTED[name].partition("Right in")[2].split(", up")
    )
    up = up or "+z"
    assert axes[:, 0] @ AXES[right] > 0.9 and axes[:, 1] @ AXES[up] > 0.6, (right, up)


def test_no_two_cameras_show_nearly_the_same(env):
    model, data = env.world.model, env.world.data
    places = [data.cam_xpos[model.camera(camera).id] for camera in env.observed.cameras.values()]
    apart = [np.linalg.norm(a - b) for k, a in enumerate(places) for b in places[:k]]
    assert len(places) == 3 and min(apart) > 0.3


def test_only_tasks_that_turn_pictures_say_so(env):
    assert "mirrored" not in cameras(env) and all(name in cameras(env) for name in env.cameras)
    turning = PoolEnv("mirror_pick_place", None, streams("panda_jaw", True), width=32, height=32)
    assert "may be turned or mirrored" in cameras(turning)


def test_without_pictures_nothing_is_said_of_cameras():
    assert cameras(PoolEnv("domino_single", helpers.REFERENCE, streams("panda_jaw", False))) == ""


def test_the_time_limit_and_the_rules_that_questions_ask_about_are_stated():
    told = rules(12.0, ["Wait."])
    assert "The time limit is 12 s" in told and told.endswith("Wait.")
    for name in ("shape_stack", "plate_shelf_hobi", "cracker_box_suction"):
        sheet = facts.load(load_task(name))
        asked = [q for q in sheet.facts.values() if any("task is lost" in right for right in q.rights)]
        assert asked and any("task is lost" in rule for rule in sheet.rules), name

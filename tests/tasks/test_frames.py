"""A scene that is moved or turned is judged as before: where that is asked, what it catches, which parameters do it."""

import numpy as np
import pytest
from controls import load
from foreign.push_block import PushBlock
from foreign.push_pair import PushPair

from scengen import load_task
from scengen.conformance import frames
from scengen.tasks.domino_single import DominoSingle
from scengen.validate.rollout import run

DOMINO = load_task("domino_single")


class OnTheTable(PushBlock):
    """A line that stays where it is on the table when the scene is moved."""

    def success(self, world):
        return bool(world.com("block")[1] >= 0.02 and world.tilt("block") < 0.1)


class NearTheMiddle(PushBlock):
    """A failure that asks where on the table the block is."""

    def failure(self, world):
        return "the block has left its half" if world.com("block")[1] > 0.0 else None


def solution(scenario):
    world = load(DOMINO, scenario)
    return run(PushBlock(), world, PushBlock().oracle, 10.0).actions


def told(scenario):
    (other,) = frames.moved(scenario, "test")
    assert other.parameter == "y"
    return frames.difference(scenario, other, solution(scenario), DOMINO.embodiment)


def test_a_goal_in_the_axes_of_the_scene_is_judged_alike_everywhere():
    assert told(PushBlock()) == ""


@pytest.mark.parametrize(("family", "what"), [(OnTheTable, "success"), (NearTheMiddle, "failure")])
def test_a_verdict_in_the_axes_of_the_table_is_caught(family, what):
    assert f"{what} is " in told(family()) and "in the moved scene" in told(family())


@pytest.mark.parametrize(
    ("scenario", "names"), [(DominoSingle(), {"heading", "x", "y"}), (PushBlock(), {"y"}), (PushPair(), {"x"})]
)
def test_parameters_that_move_the_whole_scene_are_found(scenario, names):
    assert {other.parameter for other in frames.moved(scenario, "test")} == names


def test_the_motion_takes_every_body_to_where_the_other_scene_has_it():
    scenario = DominoSingle()
    turned = next(other for other in frames.moved(scenario, "test") if other.parameter == "heading")
    here, there = load(DOMINO, scenario), load(DOMINO, turned.scenario)
    for body in here.free_bodies:
        np.testing.assert_allclose(turned.motion(here.pos(body)), there.pos(body), atol=1e-6)  # a text has six digits
        np.testing.assert_allclose(
            turned.motion.rot @ here.rot(body), there.rot(body), atol=1e-6
        )  # a text has six digits

"""push_off satisfies the rules of every task, and its own rules stop its shortcuts."""

from pathlib import Path

import pytest
import scengen
from scengen import conformance
from scengen.sim import scene_text
from scengen.validate.rollout import Rollout, try_shortcut

import my_tasks
from my_tasks.push_off import PushOff

CONF = Path(my_tasks.__file__).parent / "conf"
TASK = scengen.load_task("push_off", conformance.search(CONF))


@pytest.mark.parametrize("check", conformance.checks("push_off", conf=CONF, scenarios=1), ids=str)
def test_push_off_satisfies_the_rules(check):
    """Draws, axes, names, and a full certificate of the first scenario of every split: some 4 CPU seconds each."""
    check()


class Lenient(PushOff):
    """The same scene without failures."""

    def failure(self, world: scengen.World) -> str | None:
        return None


def tried(scenario: PushOff, shortcut: str) -> Rollout:
    """The rollout of a shortcut."""
    world = scengen.World.load(scene_text.emit(scenario.build())[0], TASK.embodiment)
    return try_shortcut(scenario, world, scenario.shortcuts()[shortcut], TASK.horizon)


def test_only_the_rule_stops_carrying_the_cube():
    """A shortcut that fails by lack of skill proves nothing: without the rule this one reaches the goal."""
    assert tried(Lenient(), "carry_the_cube").solved
    assert tried(PushOff(), "carry_the_cube").reason == "the robot touched the cube"


def test_a_zone_under_the_cube_is_refuted_without_simulation():
    refutation = PushOff(distance=0.05).infeasible()
    assert refutation is not None and refutation.reason == "the cube stands on the zone at the start"
    assert PushOff(distance=0.10).infeasible() is None

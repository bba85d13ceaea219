"""Cheats found by hand: each reaches the goal where its mend is taken out, and does not in the task as it is."""

from importlib import import_module
from pathlib import Path

import pytest

from scengen.compose import load_task
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.validate.rollout import run

HANDS = {
    (path.stem, name): hand
    for path in sorted((Path(__file__).parent / "hands").glob("[a-z]*.py"))
    for name, hand in import_module(f"hands.{path.stem}").HANDS.items()
}
"""Cheats by task and name."""
CASES = [pytest.param(*case, id="-".join(case)) for case in HANDS]
SEED = 11
"""Seed of the draws: no pool of the repository has it."""


def outcome(task, name, index, mended):
    """Outcome of a cheat in a training draw, with or without its mend."""
    found, hand = load_task(task), HANDS[task, name]
    scenario = found.draw("id", SEED, index).scenario
    scenario = scenario if mended else hand.unmended(scenario)
    world = World.load(scene_text.emit(scenario.build())[0], found.embodiment)
    return run(scenario, world, lambda world: hand.plan(scenario, world), found.horizon, raw=hand.raw).outcome


@pytest.mark.slow
@pytest.mark.parametrize(("task", "name"), CASES)
def test_a_cheat_was_one_and_stays_closed_on_twelve_draws(task, name):
    assert any(outcome(task, name, index, mended=False) == "success" for index in range(3))
    assert "success" not in [outcome(task, name, index, mended=True) for index in range(12)]

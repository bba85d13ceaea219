"""Memories of training, played within training and out of it, and the card that tells of it."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from scengen import cli, load_task
from scengen.attack.solution_memory import remember
from scengen.ood import behaviour, features
from scengen.ood.behaviour import Trials, measure
from scengen.samplers.split import ID
from scengen.validate.rebuilt import world_of
from scengen.validate.rollout import run

TASK = load_task("domino_single")


def solved(split, index):
    """A scenario of a split, its world, and the oracle's actions."""
    scenario = TASK.draw(split, 0, index).scenario
    world = world_of(scenario, TASK.embodiment)
    return scenario, world, run(scenario, world, scenario.oracle, TASK.horizon).actions


def test_an_object_centric_memory_follows_its_body():
    scenario, world, actions = solved(ID, 0)
    memory = remember(scenario, world, actions)
    assert [part.body for part in memory.paths[0].parts] == ["tile_0"] and memory.paths[0].parts[0].first == 0
    again, there, _ = solved("diagonal", 0)
    assert run(again, there, memory.follow, TASK.horizon, raw=True).solved


def test_the_cuts_of_a_memory_are_where_the_hand_turns_to_another_body():
    task = load_task("tool_retrieve")
    scenario = task.draw(ID, 0, 0).scenario
    world = world_of(scenario, task.embodiment)
    memory = remember(scenario, world, run(scenario, world, scenario.oracle, task.horizon).actions)
    assert [part.body for part in memory.paths[0].parts] == ["hook", "cube"]
    assert run(scenario, world, memory.follow, task.horizon, raw=True).solved, "its own scenario again"


@pytest.mark.slow
def test_a_stout_first_tile_breaks_replay_and_a_light_one_does_not(tmp_path):
    baselines, oracle = measure(TASK, "stout_starter", tmp_path / "stout", tmp_path / ID, Trials(4, 0))
    assert oracle.value == 1.0 and (baselines[0].training.value, baselines[0].here.value) == (1.0, 0.0)
    assert [r.finding for r in baselines if r.name.startswith("any")] == ["not tried", "not tried"]
    baselines, _ = measure(TASK, "light_tiles", tmp_path / "light", tmp_path / ID, Trials(2, 1))
    assert baselines[0].here.value == 1.0 and {r.name: r.excess.twins for r in baselines}["any_object_centric"] == 1


def test_twins_are_not_tried_twice(tmp_path, monkeypatch):
    first = measure(TASK, "light_tiles", tmp_path, tmp_path / ID, Trials(1, 0))

    def never(*_):
        raise AssertionError

    monkeypatch.setattr(behaviour, "_library", never)
    assert measure(TASK, "light_tiles", tmp_path, tmp_path / ID, Trials(1, 0)) == first


@pytest.mark.slow
def test_an_axis_card_holds_all_the_evidence(tmp_path, capsys):
    far = "task.id.x=[uniform,0.0,0.2]"  # with a stout first tile the chain of index 1 leaves the table
    argv = (
        "axis",
        "card",
        "task=domino_single",
        "axis=stout_starter",
        "n=2",
        "any_n=0",
        "rounds=1",
        far,
        f"to={tmp_path}",
    )
    assert cli.run((*argv, "certify.robust.runs=1", "certify.robust.bound=0.04")) == 0
    card = json.loads((tmp_path / "card.json").read_text())
    assert card["proofs"][0]["parameter"] == "starter.thickness" and card["proofs"][0]["gap"] == pytest.approx(0.014)
    assert card["funnel"]["certified"] == 2 and card["oracle"]["scenarios"] == 1
    assert [r["finding"] for r in card["baselines"]][1:4:2] == ["not tried", "not tried"]
    assert card["reasons"]["feasible: the chain leaves the table"] == card["funnel"]["proposed"] - 2
    assert [r["name"] for r in card["baselines"]][-3:] == ["hidden_belief", "belief", "nearest_belief"]
    assert card["boundaries"]["replay"]["trials"] == 4 and card["energy"]["distance"] > 1
    page = (tmp_path / "card.html").read_text()
    assert card["verdict"] in page and 'src="http' not in page and "<script" not in page
    longer = [a.replace("rounds=1", "rounds=2") for a in argv]
    assert cli.run((*longer, "certify.robust.runs=1", "certify.robust.bound=0.04")) == 0, "a card can be continued"
    assert json.loads((tmp_path / "card.json").read_text())["boundaries"]["replay"]["trials"] > 4


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (("axis=wide_gap",), "did you mean 'wide_gaps'"),
        (("axis=id",), "no axis of domino_single named 'id'"),
        (("axis=diagonal", "n=1"), "n = 1; it must be at least 2"),
        (("axis=diagonal", "belief_n=51"), "belief_n = 51; it must be from 0 to n = 50"),
        (("axis=diagonal", "any_n=-1"), "any_n = -1; it must be from 0 to n = 50"),
        (("axis=diagonal", "n=10", "certify_n=20"), "certify_n = 20; it must be from 0 to n = 10"),
        ((), "axis card needs axis=..."),
    ],
)
def test_bad_input_is_told_in_one_line(argv, says, capsys, tmp_path):
    status = cli.run(("axis", "card", "task=domino_single", f"to={tmp_path}", *argv))
    told = capsys.readouterr().err
    assert status == 2 and says in told and told.count("\n") == 1


def test_features_of_numpys_kinds_are_told_as_plain_numbers():
    """A family's features may be numpy's numbers, whose comparisons count as numpy's integers: JSON knows neither."""
    task = load_task("cracker_box_suction")
    found = features.sampled(task, "slot_across", draws=5)
    assert any(isinstance(value, np.floating) for value in task.family().features().values())
    assert json.dumps([asdict(departure) for departure in found.departures])

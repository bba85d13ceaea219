"""The cue audit finds what was found by hand, reveals intended from unintended, and CI fails on new cues alone."""

import json
from functools import cache

import numpy as np
import pytest

from scengen import cli, list_tasks, load_task
from scengen.decisions import Choice, around, choice, near
from scengen.errors import BadConfig, UnknownName
from scengen.ood.cues import audit, rules
from scengen.ood.cues.quantities import Sample, visible
from scengen.ood.cues.stated import compared, stated
from scengen.params import with_values
from scengen.samplers.split import ID

DRAWS = 240
FOUND = {
    ("shape_stack", "last"): ("most z of shape", "least width of shape", "the one with redness"),
    ("ball_cage_escape", "lowered_end"): ("cage-stool.dx", "ball-cage.dx"),
    ("packing", "arrangement"): ("piece_1.yaw", "all "),
    ("balance_medium", "foot_beside_ridge"): ("always",),
    ("balance_hard", "foot_beside_ridge"): ("always",),
    ("linear_intercept", "drifts"): ("ball.x",),
    ("seesaw_balance", "arm_beside_the_target"): ("always other",),
    ("ramp_sort", "release_to_the_left"): ("always",),
    ("indirect_push", "bearing"): ("always 19",),
    ("sheltered_grasp", "tray"): ("always",),
    ("keyboard_typing", "word"): ("all ",),
    ("slide_catch", "sequence"): ("all ",),
}
"""Beginnings of rules that an audit must find, by task and decision. All but the last were found by hand."""


@cache
def audited(task):
    loaded = load_task(task)
    return audit.audit(loaded, audit.draws(loaded, ID, 0, DRAWS), {}, widen=False)


def rules_of(found):
    return [name for cue in (found.fixed, *found.cues) for name in (cue.rule, *cue.equal)]


@pytest.mark.slow(each_change=True)
@pytest.mark.parametrize("task", list_tasks())
def test_no_cue_is_new_and_those_found_by_hand_are_found(task):
    found = {one.decision: one for one in audited(task)}
    assert not compared([*found.values()], stated(task)).new
    for (where, decision), expected in FOUND.items():
        if where == task:
            assert found[decision].revealed
            assert all(any(rule.startswith(begin) for rule in rules_of(found[decision])) for begin in expected)


def test_every_stated_decision_exists():
    for task in list_tasks():
        known = load_task(task).draw(ID, 0, 0).scenario.decisions()
        assert set(stated(task)) <= set(known)


def test_an_intended_quantity_is_no_cue():
    found = {one.decision: one for one in audited("mirror_pick_place")}
    assert found["side"].intended and found["side"].intended.share == 1.0 and not found["side"].revealed
    assert "cube" in found["cube"].intended.rule and found["cube"].fixed.share < 0.1


def test_an_axis_breaks_a_cue_and_a_constraint_protects_one():
    task = load_task("ball_cage_escape")
    axes = {"ball_beyond": audit.draws(task, "ball_beyond", 0, 12)}
    found = {one.decision: one for one in audit.audit(task, audit.draws(task, ID, 0, 100), axes)}
    assert found["lowered_end"].best.breaks == ["ball_beyond"]
    assert "stool_x" in found["lowered_end"].protected and not found["lowered_end"].widen


def test_an_answer_that_training_never_shows_is_no_break():
    task = load_task("tool_retrieve")
    sample = Sample.of(audit.draws(task, ID, 0, 40))
    mirrored = Sample.of(audit.draws(task, "mirrored_hook", 0, 12))
    fixed = rules.Search(sample, "tip_to", []).fixed()
    assert not fixed.right(mirrored).any() and audit._shares(fixed, "tip_to", sample, {"axis": mirrored}) == {}


def test_nothing_is_told_by_chance():
    """The negative control: decisions at random among the quantities of a real scene."""
    scenarios, random = audit.draws(load_task("domino_single"), ID, 0, 100), np.random.default_rng(0)
    sample = Sample.of(scenarios)
    coins = [{"coin": choice(int(random.integers(2)))} for _ in scenarios]
    sample = Sample(scenarios, sample.quantities, sample.poses, coins)
    found = audit._judged("coin", sample, dict.fromkeys(sample.names(), False), {}, None)
    assert not found.revealed and not found.cues


def test_what_is_concealed_is_not_seen_and_hidden_parameters_change_nothing():
    scenario = load_task("occluder_push").draw(ID, 0, 0).scenario
    assert not any(name.startswith("cube_") for name in visible(scenario)[0])
    scenario = load_task("rod_across").draw(ID, 0, 0).scenario
    assert visible(scenario)[0] == visible(with_values(scenario, {"rod.com": -0.03}))[0]


def test_sources_are_checked():
    known = load_task("packing").known
    assert audit.named("spot_0", known) == ["spot_0.x", "spot_0.y", "spot_0.turn"]
    with pytest.raises(UnknownName, match="nothing"):
        audit.named("nothing", known)
    with pytest.raises(BadConfig, match="deal states an answer"):
        audit.named("deal", known)


def test_the_answer_in_most_intervals_is_found():
    spans = rules.Spans([around(middle, 0.15) for middle in (0.0, 0.1, 0.2, 0.9)])
    assert spans.best(np.arange(3)) == pytest.approx(0.1) and list(spans.right([0.1] * 4)) == [True, True, True, False]
    at = np.array([[0.0, 0.0], [0.01, 0.0], [1.0, 1.0]])
    nears = rules.Nears(at, np.full(3, 0.02))
    assert nears.right([nears.best(np.arange(3))] * 3).tolist() == [True, True, False]
    mixed = Sample([None] * 2, [{}] * 2, [{}] * 2, [{"a": Choice(value=1)}, {"a": near((0, 0), 1.0)}])
    with pytest.raises(BadConfig, match="different kinds"):
        rules.answers(mixed, "a")


def test_the_command_fails_on_new_cues_alone(tmp_path, monkeypatch, capsys):
    words = ["axis", "cues", "task=balance_medium", "n=60", "axis_n=0", "widen=false", f"json={tmp_path / 'a.json'}"]
    assert cli.run(words) == 0
    shown = capsys.readouterr().out
    assert "foot_beside_ridge is revealed by always" in shown and "(known: " in shown
    assert max(map(len, shown.split("foot_beside_ridge is")[0].splitlines())) <= 80
    revealed = {one["decision"]: one["revealed"] for one in json.loads((tmp_path / "a.json").read_text())["decisions"]}
    assert revealed == {"foot_beside_ridge": True, "hand_turns": False, "ridge": False}
    monkeypatch.setattr("scengen.cli.commands.axis_cues.stated", lambda *_: {})
    assert cli.run(words) == 1 and "(new)" in capsys.readouterr().out


def test_a_family_without_decisions_is_told_what_to_add(monkeypatch, capsys):
    monkeypatch.setattr(load_task("balance_medium").family, "decisions", lambda self: {})
    assert cli.run(["axis", "cues", "task=balance_medium", "n=40", "axis_n=0"]) == 2
    assert "add a method decisions(), see docs/cues.md" in capsys.readouterr().err


def test_a_pool_of_too_few_scenarios_or_of_another_task_is_refused(capsys):
    from helpers import REFERENCE

    assert cli.run(["axis", "cues", "task=domino_single", f"pool={REFERENCE}"]) == 2
    assert "the audit needs 40 or more" in capsys.readouterr().err
    assert cli.run(["axis", "cues", "task=packing", f"pool={REFERENCE}"]) == 2
    assert "is a pool of domino_single; give task=domino_single" in capsys.readouterr().err


@pytest.mark.each_change  # 9 rollouts: 20 s
def test_a_fixed_bearing_within_the_tolerance_solves_and_the_control_does_not(capsys):
    assert cli.run(["axis", "cues", "task=indirect_push", "blind=bearing", "axis_n=3"]) == 0
    shown = capsys.readouterr().out
    assert "bearing = 19.5, the middle of training, solves 3 of 3" in shown and "solves 0 of 3" in shown
    assert cli.run(["axis", "cues", "task=indirect_push", "blind=nothing"]) == 2

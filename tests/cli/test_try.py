"""`scengen try` plays one plan in one scenario, certified or not, and says how it ends."""

import importlib

import pytest
from helpers import REFERENCE

from scengen import cli, load_task
from scengen.pool import Pool
from scengen.validate.rebuilt import world_of
from scengen.validate.rollout import Jitter, run
from scengen.validate.settings import Robust

attempt = importlib.import_module("scengen.cli.commands.try")


def told(capsys, *argv):
    """Exit status, and lines on standard output."""
    status = cli.run(["try", *argv])
    return status, capsys.readouterr().out.splitlines()


def test_the_oracle_of_a_draw_is_that_of_its_certificate(capsys):
    status, lines = told(capsys, "task=domino_single", "index=3")
    task = load_task("domino_single")
    scenario = task.draw("id", 0, 3).scenario
    expected = run(scenario, world_of(scenario), scenario.oracle, task.horizon)
    assert (status, lines) == (0, [f"domino_single/id@3/{scenario.id}, oracle: success after {expected.seconds:g} s"])


def test_a_jittered_run_is_that_of_the_check_and_its_film_shows_the_same_episode(capsys, tmp_path, monkeypatch):
    filmed = []
    monkeypatch.setattr(attempt, "_film", lambda take, target, settings: filmed.append(take))
    status, lines = told(capsys, "task=domino_single", "what=jitter:1", f"film={tmp_path / 'x.mp4'}")
    task = load_task("domino_single")
    scenario = task.draw("id", 0, 0).scenario
    jitter = Jitter.within(Robust(), scenario.id, 1)
    expected = run(scenario, jitter.disturbed(world_of(scenario)), scenario.oracle, task.horizon, jitter=jitter)
    assert status == 0 and lines[0].endswith(f"jitter:1: success after {expected.seconds:g} s")
    (take,) = filmed
    assert (take.actions == expected.actions).all()
    world = take.world()
    (*_, last) = take.moments(world, take.even(2))
    assert f"success at {expected.seconds:.2f} s" in last
    undisturbed = attempt.Take(scenario, take.scene_xml, take.embodiment, take.actions).world()
    assert (world.model.body_mass != undisturbed.model.body_mass).any()


def test_a_plan_that_gives_up_tells_move_place_contact_and_target(capsys):
    status, (first, second) = told(capsys, "task=edge_slide", "what=pinch_where_it_lies")
    assert status == 1 and "pinch_where_it_lies: timeout after " in first and "short of its target" in first
    assert " s in pinch > _reach_lip > go_to; the hand was at (" in second and "touched table" in second
    assert second.endswith(" m") and "the target was (" in second


def test_what_ends_without_the_goal_tells_where_the_hand_is(capsys):
    status, lines = told(capsys, "task=edge_slide", "task.horizon=1")
    assert status == 1 and lines[0].endswith("the goal was not reached in 1 s")
    assert lines[1].startswith("at the end the hand was at (")


def test_a_draw_that_is_infeasible_is_played_with_a_remark(capsys, monkeypatch):
    family = type(load_task("domino_single").family())
    monkeypatch.setattr(family, "constraints", lambda self: iter([attempt_refutation()]))
    assert cli.run(["try", "task=domino_single"]) in (0, 1)
    assert "is infeasible, like all " in capsys.readouterr().err


def attempt_refutation():
    from scengen.scenario import require

    return require(False, "made infeasible for this test")


def test_the_witness_and_a_shortcut_of_a_pool(capsys):
    pool = f"pool={REFERENCE}"
    checks = Pool.open(REFERENCE).row("8ed4").certificate.checks
    (seconds,) = (check.numbers["seconds"] for check in checks if check.name == "witness")
    assert told(capsys, pool, "id=8ed4", "what=witness") == (
        0, [f"domino_single/id@0/8ed4a4577fe0, witness: success after {seconds} s"],
    )  # fmt: skip
    status, lines = told(capsys, pool, "id=8ed4", "what=push_the_slab", "raw=true")
    assert status == 1 and "push_the_slab: " in lines[0]


@pytest.mark.parametrize(
    ("argv", "told"),
    [
        ((), "either task=NAME, or pool=FOLDER and id=ID"),
        (("task=domino_single", "pool=x", "id=y"), "either task=NAME, or pool=FOLDER and id=ID"),
        ((f"pool={REFERENCE}",), "either task=NAME, or pool=FOLDER and id=ID"),
        (("task=domino_single", "what=push_the_slap"), "did you mean 'push_the_slab'?"),
        (("task=domino_single", "what=jitter:"), "jitter:0 to jitter:999"),
        (("task=domino_single", "what=jitter:1000"), "jitter:0 to jitter:999"),
        (("task=domino_single", "what=witness"), "a drawn scenario has none"),
        (("task=domino_single", "raw=true"), "only shortcuts can be played raw"),
        (("task=domino_single", "film=x.gif"), "give a .png file"),
        (("task=domino_single", "film=x.mp4", "fps=7"), "fps that divides the control rate"),
        (("task=domino_single", "split=diagnal"), "did you mean 'diagonal'?"),
        (("task=domino_single", "index=-1"), "index = -1; it must be at least 0"),
    ],
)
def test_what_cannot_be_tried_is_one_line(argv, told, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.run(["try", *argv]) == 2
    shown = capsys.readouterr()
    assert told in shown.err and shown.err.count("\n") == 1 and not shown.out and not list(tmp_path.iterdir())

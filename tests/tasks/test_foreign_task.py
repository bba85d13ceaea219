"""A task and an axis of another package, tested as their authors would; and what the checks catch."""

from dataclasses import replace
from pathlib import Path

import pytest
from foreign.push_block import PushBlock

from scengen import cli, conformance, list_tasks, load_task
from scengen.conformance import rules
from scengen.conformance.rules import Nonconformity
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig, UnknownName
from scengen.samplers import task_files
from scengen.samplers.dists import Fixed
from scengen.scenario import Scenario, Shortcut

CONF = Path(__file__).parents[1] / "foreign" / "conf"
SEARCH = conformance.search(CONF)


@pytest.mark.parametrize("check", conformance.checks("push_block", conf=CONF, scenarios=1), ids=str)
def test_push_block_keeps_to_the_rules(check):
    check()


def test_a_foreign_task_and_its_severities_go_through_the_command_line(tmp_path):
    argv = ("task=push_block", "split=far@1", "n=1", f"pool={tmp_path / 'pool'}", *SEARCH)
    assert cli.run(("generate", *argv, "certify.robust.runs=1", "certify.robust.bound=0.04")) == 0
    assert cli.run(("verify", f"pool={tmp_path / 'pool'}", *SEARCH)) == 0


def test_a_foreign_axis_that_touches_training_is_refused_with_the_remedy():
    with pytest.raises(BadConfig, match="touches or overlaps its training range"):
        load_task("push_block", (*SEARCH, "task.axes.far.replace.distance=[uniform,0.13,0.2]"))


def broken(rule, task, split="id"):
    with pytest.raises(Nonconformity) as raised:
        rule(task, split, 1, 0)
    return str(raised.value)


def test_what_does_not_vary_is_caught():
    task = load_task("push_block", SEARCH)
    still = replace(
        task, training={name: Fixed(0.12 if name == "distance" else p.nominal) for name, p in task.known.items()}
    )
    assert "gave the same scenario" in broken(rules._draws_are_keyed, still)


def test_an_axis_whose_value_twins_share_is_caught():
    task = load_task("push_block", SEARCH)
    same = replace(task.axes["far"], replace={"distance": Fixed(0.12)})
    here = replace(task, training={**task.training, "distance": Fixed(0.12)}, axes={"far": same})
    told = broken(rules._twins_differ_in_the_axis_alone, here, "far")
    assert "the axis names distance, but twins do not differ in them" in told


def test_a_task_whose_shortcut_works_is_caught(monkeypatch):
    monkeypatch.setattr(PushBlock, "shortcuts", lambda self: {"the_oracle_itself": Shortcut(self.oracle)})
    told = broken(rules._scenarios_are_certified, load_task("push_block", SEARCH))
    assert "is refuted" in told and "the_oracle_itself" in told


def test_a_feature_with_the_name_of_a_parameter_is_caught(monkeypatch):
    monkeypatch.setattr(PushBlock, "features", lambda self: {"distance": self.distance})
    told = broken(rules._scenes_have_controls, load_task("push_block", SEARCH))
    assert "distance name both parameters and features" in told


def test_a_version_that_is_not_in_the_class_itself_is_caught(monkeypatch):
    monkeypatch.setattr(PushBlock, "VERSION", 2)
    with pytest.raises(Nonconformity, match="has version 2; state it in the class"):
        rules._states_version(load_task("push_block", SEARCH), SEARCH)


def test_a_task_without_an_oracle_is_told_at_sight(monkeypatch, capsys):
    assert not rules.at_sight("push_block", SEARCH)
    monkeypatch.setattr(PushBlock, "oracle", Scenario.oracle)
    told = "PushBlock has no oracle; write its method oracle(world), see CONTRIBUTING.md"
    assert rules.at_sight("push_block", SEARCH) == [told]
    assert cli.run(["tasks", "task=push_block", *SEARCH]) == 1 and told in capsys.readouterr().err


def test_a_misspelt_method_is_told_at_sight(monkeypatch):
    monkeypatch.setattr(PushBlock, "oracles", PushBlock.oracle, raising=False)
    assert not rules.at_sight("push_block", SEARCH), "both are there"
    monkeypatch.setattr(PushBlock, "stebs", PushBlock.oracle, raising=False)
    assert rules.at_sight("push_block", SEARCH) == ["PushBlock has stebs, and scengen calls steps; rename it"]


def test_a_misspelt_class_of_a_family_is_told_with_the_nearest_one():
    with pytest.raises(UnknownName, match=r"push_block.family\) named 'PushBlok' \(did you mean 'PushBlock'"):
        load_task("push_block", [*SEARCH, "task.family=foreign.push_block.PushBlok"])


@pytest.mark.parametrize("version", [0, -1, True, "2", 1.0])
def test_a_version_that_is_no_number_from_one_on_is_refused(monkeypatch, version):
    monkeypatch.setattr(PushBlock, "VERSION", version)
    with pytest.raises(BadConfig, match=r"PushBlock.VERSION = .*; it must be a whole number, 1 or more"):
        load_task("push_block", SEARCH)


def test_an_instruction_that_names_its_axis_is_caught():
    task = replace(load_task("push_block", SEARCH), instruction="Push the block far.")
    with pytest.raises(Nonconformity, match="names the axis far"):
        rules._describes_axes(task)


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The package `foreign`, as if it were installed and offered its tasks."""
    about = tmp_path / "foreign-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: foreign\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[scengen.tasks]\nours = foreign.conf\n")
    monkeypatch.syspath_prepend(tmp_path)
    task_files.packages.cache_clear()
    yield about
    monkeypatch.undo()
    task_files.packages.cache_clear()


def test_an_installed_package_offers_its_tasks_to_every_command(installed, tmp_path, capsys):
    assert {"push_block", "domino_single"} < set(list_tasks()) == set(list_tasks(SEARCH))
    assert load_task("push_block").family is PushBlock
    assert cli.run(("tasks",)) == 0 and "push_block" in capsys.readouterr().out
    assert cli.run(("tasks", "task=push_bloc")) == 2 and "did you mean 'push_block'" in capsys.readouterr().err
    (installed / "entry_points.txt").write_text("[scengen.tasks]\nours = foreign.config\n")
    task_files.packages.cache_clear()
    assert cli.run(("tasks",)) == 2
    assert "package foreign offers tasks in foreign.config/task, which does not exist" in capsys.readouterr().err


def test_policies_play_foreign_tasks(tmp_path):
    pool = tmp_path / "pool"
    quickly = ("certify.robust.runs=1", "certify.robust.bound=0.04")
    assert cli.run(("generate", "task=push_block", "n=1", f"pool={pool}", *SEARCH, *quickly)) == 0
    env = PoolEnv("push_block", pool, search=SEARCH)
    _, info = env.reset(seed=0, options={"labels": True})
    assert info["split"] == "id"
    with pytest.raises(UnknownName, match="no task named 'push_block'"):
        PoolEnv("push_block", pool)
    argv = ("evaluate", "policy=oracle", f"pool={pool}", "seeds=1", "rollouts=1", f"to={tmp_path / 'table'}")
    assert cli.run((*argv, *SEARCH)) == 0 and "100.0" in (tmp_path / "table" / "table.md").read_text()

"""A task and an axis of another package, tested as their authors would; and what the checks catch."""

from dataclasses import replace
from pathlib import Path

import pytest
from foreign.push_block import PushBlock

from scengen import cli, config, conformance
from scengen.conformance import Nonconformity
from scengen.errors import BadConfig
from scengen.samplers.dists import Fixed
from scengen.scenario import Shortcut

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
        config.task("push_block", (*SEARCH, "task.axes.far.replace.distance=[uniform,0.13,0.2]"))


def broken(rule, task, split="id"):
    with pytest.raises(Nonconformity) as raised:
        rule(task, split, 1, 0)
    return str(raised.value)


def test_what_does_not_vary_is_caught():
    task = config.task("push_block", SEARCH)
    still = replace(
        task, training={name: Fixed(0.12 if name == "distance" else p.nominal) for name, p in task.known.items()}
    )
    assert "nothing varies" in broken(conformance._draws_are_keyed, still)


def test_a_task_whose_shortcut_works_is_caught(monkeypatch):
    monkeypatch.setattr(PushBlock, "shortcuts", lambda self: {"the_oracle_itself": Shortcut(self.oracle)})
    told = broken(conformance._scenarios_are_certified, config.task("push_block", SEARCH))
    assert "is refuted" in told and "the_oracle_itself" in told


def test_an_instruction_that_names_its_axis_is_caught():
    task = replace(config.task("push_block", SEARCH), instruction="Push the block far.")
    with pytest.raises(Nonconformity, match="names the axis far"):
        conformance._told_well(task)

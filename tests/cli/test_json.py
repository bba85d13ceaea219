"""json= of commands that print tables: the same as data, and in the spelling that commands accept."""

import json
import re

import pytest
from helpers import REFERENCE

from scengen import cli, compose
from scengen.cli.verbs import VERBS, file_stem
from scengen.pool import Pool
from scengen.samplers import task_files

FILES = {
    "agent": "results.json",
    "axis card": "card.json",
    "axis discover": "discover.json",
    "curate": "scores and reports in its folder",
    "evaluate": "table.json",
    "evaluate threshold": "threshold.json",
    "train": "policy.json",
}
"""Commands that print tables and write the same into a file of their folder."""


def written(tmp_path, *argv):
    """What a command writes to json=."""
    assert cli.run([*argv, f"json={tmp_path / 'data.json'}"]) == 0
    return json.loads((tmp_path / "data.json").read_text())


@pytest.mark.parametrize("verb", VERBS)
def test_every_command_that_prints_a_table_gives_it_as_data(verb):
    source = task_files.conf_dir().parent / "scengen" / "cli" / "commands" / f"{file_stem(verb)}.py"
    prints = re.search(r"out\.print\(", source.read_text())
    takes = re.search(r"^json:", task_files.command_file(verb).read_text(), re.M)
    assert not prints or takes or verb in FILES


def test_axes_are_spelled_as_commands_take_them(tmp_path):
    told = written(tmp_path, "tasks", "task=domino_single")
    mass = next(p for p in told["parameters"] if p["name"] == "tile.mass")
    assert mass["unit"] == "kg" and mass["training"][0] == "uniform"
    spelled = f"task.id.tile.mass=[{','.join(map(str, mass['training']))}]"
    task, same = compose.load_task("domino_single"), compose.load_task("domino_single", [spelled])
    assert same.training == task.training
    (wide,) = (axis for axis in told["axes"] if axis["axis"] == "wide_gaps")
    assert wide["why"] and [proof["parameter"] for proof in wide["proofs"]] == ["gap_ratio"]
    assert wide["proofs"][0]["goes_to"][0] == "uniform" and wide["proofs"][0]["gap"] == pytest.approx(0.05)


def test_tasks_and_assets_are_listed(tmp_path, capsys):
    assert [each["name"] for each in written(tmp_path, "tasks")] != []
    assert {each["name"] for each in written(tmp_path, "tasks")} == set(task_files.tasks())
    assert written(tmp_path, "asset")["ball"][0]["unit"] == "m"
    assert all(each["axis"] for each in written(tmp_path, "tasks", "axes=paper"))


def test_a_pool_and_a_scenario_are_data(tmp_path):
    pool = Pool.open(REFERENCE)
    (told,) = written(tmp_path, "show", f"pool={REFERENCE}")
    assert told["sha256"] == pool.sha256 and list(told["scenarios"]) == [str(name) for name in pool.names()]
    one = next(pool.rows())
    row = written(tmp_path, "show", f"pool={REFERENCE}", f"id={one.id}")
    assert row["params"] == dict(one.params) and row["certificate"]["verdict"] == "certified"

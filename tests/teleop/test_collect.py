"""Driven episodes are demonstrations: they are verified, recorded, curated; programs at the pad solve three tasks."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.cli import BAD_INPUT
from scengen.cli.commands import FAILED, OK
from scengen.demos.teleop.pad import read_events
from scengen.means import throughout
from scengen.pool.demonstrations import DEMONSTRATIONS, Demonstrations, write_demonstrations
from scengen.pool.files import sha256
from scengen.tasks.domino_single import DominoSingle


def teleop(folder, *given, **changed):
    """Drive `domino_single` with a program; return the exit status."""
    asked = {"task": "domino_single", "device": "pads:Domino", "n": 3, "operator": "op7", **changed, "to": folder}
    return cli.run(["demos", "pad", *(f"{name}={value}" for name, value in asked.items() if value is not None), *given])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("teleop") / "made"
    assert teleop(folder) == OK
    return folder


@pytest.fixture
def mine(made, tmp_path):
    """A copy to damage."""
    return Path(shutil.copytree(made, tmp_path / "mine"))


def test_a_driven_episode_is_a_demonstration_with_source_operator_and_seed(made):
    found = Demonstrations.open(made).check()
    assert (found.manifest.source, found.manifest.operator, len(found)) == ("teleop", "op7", 3)
    for row in found.rows():
        assert (row.style, row.outcome, row.seed, row.run) == ("teleop", "success", 2000, 0)


def test_takes_are_judged_by_the_rules_that_were_asked_for(tmp_path, monkeypatch):
    early = {"it took 0.3 s at most": throughout(lambda world: world.time <= 0.3)}
    monkeypatch.setattr(DominoSingle, "means", lambda self: early)
    assert teleop(tmp_path / "strict", n=1, takes=1, limit=1) == FAILED
    assert teleop(tmp_path / "paper", n=1, rules="paper") == OK
    found = Demonstrations.open(tmp_path / "paper")
    assert found.manifest.config.rules == "paper" and cli.run(["verify", f"pool={tmp_path / 'paper'}"]) == OK


def test_driven_verified_recorded_curated(made, tmp_path, capsys):
    assert cli.run(["verify", f"pool={made}", "level=full"]) == OK
    shown = capsys.readouterr().out
    assert "sound: 3 of 3 replay bit for bit" in shown and "there is no oracle to play them again" in shown
    data = tmp_path / "data"
    assert cli.run(["record", f"pool={made}", f"to={data}", "cameras=none"]) == OK
    table = pq.read_table(data / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    assert table["scengen/source"].to_pylist() == ["teleop"] * 3
    assert table["scengen/operator"].to_pylist() == ["op7"] * 3
    assert cli.run(["curate", f"data={data}"]) == OK
    assert json.loads((data / "curation" / "kept.json").read_text()) == [0, 1, 2]
    assert cli.run(["curate", "stats", f"data={data}"]) == OK


@pytest.mark.slow
def test_a_policy_that_is_trained_on_driven_episodes_solves_scenarios_that_were_driven(tmp_path):
    driven, data, policy, results = (tmp_path / name for name in ("driven", "data", "policy", "results"))
    assert teleop(driven, task=None, pool=REFERENCE, n=6) == OK
    assert cli.run(["record", f"pool={driven}", f"to={data}", "cameras=none"]) == OK
    assert cli.run(["curate", f"data={data}"]) == OK
    assert cli.run(["train", "policy=knn", f"data={data}", f"to={policy}"]) == OK
    assert (
        cli.run(["evaluate", f"policy={policy}", f"pool={REFERENCE}", "seeds=6", "rollouts=1", f"to={results}"]) == OK
    )
    episodes = [json.loads(line) for line in (results / "episodes.jsonl").read_text().splitlines()]
    assert len(episodes) == 6 and sum(episode["success"] for episode in episodes) >= 3


def test_the_log_of_a_take_drives_the_same_episode_again(made, tmp_path):
    logs = sorted((made / "raw").iterdir())
    assert [path.name for path in logs] == ["00000-00.jsonl", "00001-00.jsonl", "00002-00.jsonl"]
    begin, *_, end = (json.loads(line) for line in logs[1].read_text().splitlines())
    assert begin["operator"] == "op7" and begin["device"] == "program" and begin["seed"] == 2000
    assert read_events(logs[1]) and end["outcome"] == "success"
    assert teleop(tmp_path / "again", device=f"script:{logs[1]}", n=1, index=1) == OK
    (row,) = Demonstrations.open(tmp_path / "again").rows()
    assert (row.witness_sha256, row.final_state) == (end["witness_sha256"], end["final_state"])


def test_a_run_continues_and_refuses_other_settings(made, tmp_path, capsys):
    folder = tmp_path / "part"
    assert teleop(folder, n=1) == OK
    assert teleop(folder, n=3) == OK
    ends = [[row.final_state for row in Demonstrations.open(each).rows()] for each in (folder, made)]
    assert ends[0] == ends[1]
    capsys.readouterr()
    assert teleop(folder, operator="op8") == BAD_INPUT
    assert "was started with other settings (operator" in capsys.readouterr().err


def test_failed_takes_are_kept_counted_and_driven_again(tmp_path):
    script = tmp_path / "nothing.jsonl"
    script.write_text('{"t": 0, "control": "lefty", "value": -1}\n{"t": 0.5, "control": "lefty", "value": 0}\n')
    folder = tmp_path / "failed"
    given = {"device": f"script:{script}", "n": 1, "takes": 2, "limit": 3}
    assert teleop(folder, "task.horizon=2.0", **given) == FAILED
    found = Demonstrations.open(folder)
    failures = list(found.failures())
    assert not len(found) and {row.outcome for row in failures} == {"timeout"}
    assert [(row.index, row.run) for row in failures] == [(0, 0), (0, 1), (1, 0)]
    assert found.manifest.outcomes == {"timeout": 3} and found.manifest.funnel["attempted"] == 3
    assert cli.run(["verify", f"pool={folder}"]) == OK


def test_a_take_that_is_given_up_has_a_log_and_no_row(tmp_path):
    script = tmp_path / "back.jsonl"
    script.write_text('{"t": 0, "control": "lefty", "value": -1}\n{"t": 0.3, "control": "back", "value": 1}\n')
    folder = tmp_path / "given_up"
    assert teleop(folder, device=f"script:{script}", n=1, takes=1, pool=REFERENCE, task=None, operator="p1") == (FAILED)
    found = Demonstrations.open(folder)
    assert not [*found.rows(), *found.failures()]
    assert set(found.manifest.reasons) == {"solved: given up"}
    assert '"outcome": "given up"' in min((folder / "raw").iterdir()).read_text()


def test_scenarios_of_a_pool_are_driven(tmp_path):
    assert teleop(tmp_path / "pool", task=None, pool=REFERENCE, n=1) == OK
    (row,) = Demonstrations.open(tmp_path / "pool").rows()
    assert row.seed == 0
    assert cli.run(["verify", f"pool={tmp_path / 'pool'}"]) == OK


def test_a_row_with_the_style_of_a_script_is_refused(mine, capsys):
    found = Demonstrations.open(mine)
    rows = [replace(row, style="nominal") for row in found.rows()]
    write_demonstrations(mine, found.manifest, rows, [])
    assert cli.run(["verify", f"pool={mine}"]) == FAILED
    assert "the style is nominal, that of this run is teleop" in capsys.readouterr().err


def test_an_action_that_was_changed_is_found(mine, capsys):
    found = Demonstrations.open(mine)

    def change(row):
        actions = row.witness.copy()
        actions[100, 0] += 0.01
        return replace(row, witness=actions, witness_sha256=sha256(actions.tobytes()))

    write_demonstrations(mine, found.manifest, [change(row) for row in found.rows()], [])
    assert cli.run(["verify", f"pool={mine}"]) == FAILED
    assert "the replay ends in other bits" in capsys.readouterr().err


@pytest.mark.parametrize("operator", ['"anna smith"', '"<script>"', "null"])
def test_a_manifest_with_another_operator_than_a_code_is_refused(mine, operator, capsys):
    path = mine / DEMONSTRATIONS
    path.write_text(path.read_text().replace('"operator": "op7"', f'"operator": {operator}'))
    assert cli.run(["verify", f"pool={mine}"]) == BAD_INPUT
    assert "is damaged" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"operator": "anna"}, "operator = anna; give a code such as op7, not a name"),
        ({"device": "gamepda"}, "no device named 'gamepda' (did you mean 'gamepad'?); known: gamepad, keyboard"),
        ({"device": "script:none.jsonl"}, "none.jsonl cannot be read: it is missing"),
        ({"device": "no_module:Pad"}, "device = no_module:Pad; there is no module 'no_module' on the path"),
        ({"device": "pads:Nobody"}, "device = pads:Nobody; pads has no function or class named 'Nobody'"),
        (
            {"device": "pads:Hands", "n": 1},
            "in plan); the fault is the device's",
        ),
        ({"task": None}, "demos pad needs either task=NAME or pool=FOLDER"),
        ({"id": "8ed4"}, "id = 8ed4 names a scenario of a pool; give pool=FOLDER, or index= with task="),
        ({"takes": 0}, "takes = 0; it must lie in [1, 1000]"),
        ({"view": "true"}, "view = true, but there is no display"),
        ({"device": "keyboard"}, "device = keyboard needs a window, and there is no display"),
    ],
)
def test_bad_input_is_one_line_with_its_remedy(tmp_path, monkeypatch, given, says, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert teleop(tmp_path / "bad", **given) == BAD_INPUT
    told = capsys.readouterr().err
    assert says in told and "Traceback" not in told
    assert not (tmp_path / "bad").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "program"),
    [("domino_single", "Domino"), ("mirror_pick_place", "MirroredCube"), ("pick_place_ycb", "Follower")],
)
def test_programs_that_see_only_the_state_line_solve_three_of_five(tmp_path, task, program):
    teleop(tmp_path / "five", task=task, device=f"pads:{program}", n=5, takes=1)
    rows = [row for row in Demonstrations.open(tmp_path / "five").rows() if row.index < 5]
    assert len(rows) >= 3

"""Training reads recordings: the right episodes, streams and rates, and one line about anything else."""

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.errors import BadConfig, PoolError, UnknownName
from scengen.learn.data import TrainingData
from scengen.learn.store import read_settings

NOTHING = {"of another task": 0, "failed": 0, "not kept by the curation": 0}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The witnesses of the reference pool's first three scenarios."""
    folder = tmp_path_factory.mktemp("recorded") / "data"
    assert cli.run(["record", f"pool={REFERENCE}", f"to={folder}", "cameras=none", "n=3"]) == 0
    return folder


@pytest.fixture
def mine(recorded, tmp_path):
    """A copy to change."""
    return Path(shutil.copytree(recorded, tmp_path / "mine"))


def change_episode(folder, number, **columns):
    path = folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    table = pq.read_table(path)
    for name, value in columns.items():
        name = f"scengen/{name}"
        values = table[name].to_pylist()
        values[number] = value
        table = table.set_column(table.column_names.index(name), name, [values])
    pq.write_table(table, path)


def test_rows_are_those_of_the_recording(recorded):
    data = TrainingData.read(recorded)
    table = pq.read_table(recorded / "data" / "chunk-000" / "file-000.parquet")
    assert (data.task, data.embodiment, data.rate, len(data.trajectories)) == ("domino_single", "panda_jaw", 25, 3)
    actions = np.concatenate([one.actions for one in data.trajectories])
    assert np.array_equal(actions, np.array(table["action"].to_pylist(), np.float32))
    seen = np.concatenate([one.observations for one in data.trajectories])
    assert seen.shape[1] == len(data.entries)
    where = data.entries.index("robot0_eef_pos.z")
    assert np.array_equal(seen[:, where], np.array(table["robot0_eef_pos"].to_pylist(), np.float32)[:, 2])
    state = np.array(table["observation.environment_state"].to_pylist(), np.float32)
    assert np.array_equal(seen[:, -state.shape[1] :], state)


def test_streams_can_be_chosen(recorded):
    data = TrainingData.read(recorded, ["force_torque", "robot0_tactile_left"])
    assert data.entries[:2] == ("force_torque.force_x", "force_torque.force_y") and len(data.entries) == 6 + 64


def test_the_first_demonstrations_are_data_of_their_own(recorded):
    whole, first = TrainingData.read(recorded), TrainingData.read(recorded, demonstrations=2)
    assert [one.scenario for one in first.trajectories] == [one.scenario for one in whole.trajectories[:2]]
    assert first.sha256 != whole.sha256 == TrainingData.read(recorded, demonstrations=3).sha256
    with pytest.raises(BadConfig, match="demonstrations = 4; .* has 3 to learn from"):
        TrainingData.read(recorded, demonstrations=4)


def test_other_data_have_another_hash(mine):
    first = TrainingData.read(mine)
    change_episode(mine, 1, success=False)
    assert TrainingData.read(mine).sha256 != first.sha256


def test_failures_and_what_a_curation_left_out_are_not_learned_from(mine):
    (mine / "curation").mkdir()
    (mine / "curation" / "kept.json").write_text("[0, 2]")
    data = TrainingData.read(mine)
    assert len(data.trajectories) == 2 and data.left_out == {**NOTHING, "not kept by the curation": 1}
    change_episode(mine, 0, success=False)
    with pytest.raises(BadConfig, match=r"1 demonstrations to learn from \(1 failed, 1 not kept by the curation\)"):
        TrainingData.read(mine)


def test_a_damaged_list_of_kept_episodes_is_one_line(mine):
    (mine / "curation").mkdir()
    (mine / "curation" / "kept.json").write_text('{"0": true}')
    with pytest.raises(PoolError, match=r"kept\.json is damaged \(not a list of numbers\); repeat scengen curate"):
        TrainingData.read(mine)


def test_of_several_tasks_one_is_chosen(mine):
    change_episode(mine, 1, task="packing")
    with pytest.raises(BadConfig, match="demonstrations of domino_single and packing; pass task="):
        TrainingData.read(mine)
    data = TrainingData.read(mine, task="domino_single")
    assert (data.task, len(data.trajectories)) == ("domino_single", 2)
    assert data.left_out == {**NOTHING, "of another task": 1}
    with pytest.raises(BadConfig, match=r"1 demonstrations to learn from \(2 of another task\)"):
        TrainingData.read(mine, task="packing")
    with pytest.raises(UnknownName, match="no task in .* named 'packin' .did you mean 'packing'"):
        TrainingData.read(mine, task="packin")


def test_a_recording_that_was_not_curated_is_called_claimed(mine, tmp_path, capsys):
    words = ["train", "policy=knn", f"data={mine}", f"to={tmp_path / 'policy'}"]
    assert cli.run(words) == 0
    assert "was not curated: what it says is claimed; scengen curate" in capsys.readouterr().err
    assert cli.run(["curate", f"data={mine}", "replay=false"]) == 0
    cli.run(words)
    assert "was not curated" not in capsys.readouterr().err


def test_what_cannot_be_learned_is_one_line_without_remarks(mine, tmp_path, capsys):
    assert cli.run(["train", "task=packin", f"data={mine}", f"to={tmp_path / 'policy'}"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("told", [[2, 1, 2], [2, None, 2], [0, 0, 0], ["2", "2", "2"]])
def test_a_recording_has_one_version_of_its_task(mine, told):
    assert TrainingData.read(mine).task_version == 2
    rewrite_versions(mine, told)
    with pytest.raises(PoolError, match="scengen/task_version of domino_single is not one number"):
        TrainingData.read(mine)


def test_a_recording_of_an_earlier_release_has_an_unknown_version(mine, tmp_path, capsys):
    rewrite_versions(mine, None)
    assert TrainingData.read(mine).task_version is None
    assert cli.run(["train", "policy=knn", f"data={mine}", f"to={tmp_path / 'policy'}"]) == 0
    assert "recorded with an unknown version of domino_single; installed: 2" in capsys.readouterr().err
    assert read_settings(tmp_path / "policy").task_version is None


def rewrite_versions(folder, told):
    """Other values in the column of versions, or no such column."""
    path = folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    table = pq.read_table(path).drop_columns(["scengen/task_version"])
    pq.write_table(table if told is None else table.append_column("scengen/task_version", [told]), path)


def test_streams_that_were_not_recorded_are_refused(mine):
    with pytest.raises(UnknownName, match=r"no recorded stream named 'robot0_eef_poz' \(did you mean 'robot0_eef_pos'"):
        TrainingData.read(mine, ["robot0_eef_poz"])
    info = json.loads((mine / "meta" / "info.json").read_text())
    del info["features"]["observation.environment_state"]
    (mine / "meta" / "info.json").write_text(json.dumps(info))
    with pytest.raises(BadConfig, match="holds no object-state: record with environment_state=true"):
        TrainingData.read(mine)


@pytest.mark.parametrize(
    ("value", "said"),
    [(float("nan"), "has numbers that are not finite"), (0.0, "has no pose of a hand for each action")],
)
def test_a_hand_without_a_pose_is_refused(mine, value, said):
    """The first row of the second episode has no orientation."""
    path = mine / "data" / "chunk-000" / "file-000.parquet"
    table = pq.read_table(path)
    quats = table["robot0_eef_quat"].to_pylist()
    quats[table["episode_index"].to_pylist().index(1)] = [value] * 4
    place = table.column_names.index("robot0_eef_quat")
    values = pa.array(quats, table.schema.field(place).type)
    pq.write_table(table.set_column(place, table.schema.field(place), values), path)
    with pytest.raises(PoolError, match=f"episode 1 {said}"):
        TrainingData.read(mine, ["force_torque"])


def test_what_is_no_recording_is_one_line(tmp_path, capsys):
    assert cli.run(["train", f"data={tmp_path}", f"to={tmp_path / 'policy'}"]) == 2
    assert "no recording at" in capsys.readouterr().err
    assert cli.run(["train", f"data={REFERENCE}", f"to={tmp_path / 'policy'}"]) == 2
    assert "is a pool; make demonstrations with scengen demos" in capsys.readouterr().err

"""Recordings of demonstrations say what trainers need: styles, absent bodies, and spreads that nothing divides by 0."""

import json

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from helpers import REFERENCE, needs_robosuite

from scengen import cli
from scengen.cli.commands.settings import read_task
from scengen.demos.generate import DemosSettings, generate_demonstrations
from scengen.export.floors import BY_WORD, PAIRS, floor_of, with_floors
from scengen.export.stats import describe
from scengen.pool.demonstrations import Demonstrations


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Demonstrations of a task some of whose bodies are absent in some scenarios, and their recording."""
    folder = tmp_path_factory.mktemp("recorded")
    given = ["task=domino_single", "n=2", f"to={folder / 'demos'}"]
    settings, task, checks = read_task("demos", given, DemosSettings)
    generate_demonstrations(task, checks, settings, lambda *_: None)
    assert cli.run(["record", f"pool={folder / 'demos'}", f"to={folder / 'data'}", "cameras=none"]) == 0
    return folder


def read(folder, name):
    return json.loads((folder / "data" / "meta" / name).read_text())


def table(folder):
    return pq.read_table(folder / "data" / "data" / "chunk-000" / "file-000.parquet")


def episodes(folder):
    return pq.read_table(folder / "data" / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()


def test_episodes_say_their_run_and_style(recorded):
    rows = list(Demonstrations.open(recorded / "demos").rows())
    for episode, row in zip(episodes(recorded), rows, strict=True):
        assert (episode["scengen/run"], episode["scengen/style"]) == (row.run, row.style)
        assert episode["scengen/seconds"] == row.seconds and episode["scengen/success"]
    assert sum(read(recorded, "scengen.json")["styles"].values()) == len(rows)


def test_the_recorded_actions_are_those_of_the_demonstration(recorded):
    rows = list(Demonstrations.open(recorded / "demos").rows())
    actions = np.array(table(recorded)["control.actions"].to_pylist(), np.float32)
    for episode, row in zip(episodes(recorded), rows, strict=True):
        played = actions[episode["dataset_from_index"] : episode["dataset_to_index"]].reshape(-1, 7)
        assert played.tobytes() == row.witness[: len(played)].tobytes()


def test_one_column_alone_is_an_action_for_lerobot(recorded):
    assert [name for name in table(recorded).schema.names if name.startswith("action")] == ["action"]


def test_bodies_that_a_scene_lacks_are_told_and_read_zero(recorded):
    names = read(recorded, "info.json")["features"]["observation.environment_state"]["names"]
    state = np.array(table(recorded)["observation.environment_state"].to_pylist())
    told = [episode["scengen/absent"].split(",") for episode in episodes(recorded)]
    assert any(absent != [""] for absent in told), "scenarios have different numbers of tiles"
    for episode, absent in zip(episodes(recorded), told, strict=True):
        own = state[episode["dataset_from_index"] : episode["dataset_to_index"]]
        zero = {name.partition("_pos.")[0] for name, column in zip(names, own.T, strict=True) if not column.any()}
        assert {body for body in absent if body} <= zero
        lacking = [name for name in names if name.endswith("_quat.w") and name.partition("_quat")[0] in absent]
        assert all(not own[:, names.index(name)].any() for name in lacking)


def test_a_shift_of_a_constant_dimension_stays_small_after_normalisation(recorded):
    """The normalisations of LeRobot: mean and deviation, minimum and maximum, quantiles."""
    stats, features = read(recorded, "stats.json"), read(recorded, "info.json")["features"]
    constant, whole = 0, table(recorded)
    for name, feature in features.items():
        if feature["dtype"] != "float32" or name in ("reward", "next.reward", "timestamp"):
            continue
        values = np.array(whole[name].to_pylist(), float).reshape(len(whole), -1)
        still = np.ptp(values, axis=0) == 0
        found = {kind: np.array(value, float).ravel() for kind, value in stats[name].items() if kind != "count"}
        shifted = values.max(axis=0) + 1e-3
        assert (np.abs(shifted - found["mean"]) / (found["std"] + 1e-8) < 10)[still].all(), name
        for low, high in PAIRS:
            normal = 2 * (shifted - found[low]) / (found[high] - found[low] + 1e-8) - 1
            assert (np.abs(normal) < 10)[still].all(), name
        constant += still.sum()
    assert constant > 20, "absent bodies and untouched taxels"


def test_floors_change_narrow_columns_alone_and_have_units():
    values = np.column_stack([np.full(50, 0.2), np.linspace(-1.0, 1.0, 50)])
    plain = describe(values)
    wide = with_floors(plain, np.array([1e-3, 1e-3]))
    for name in ("std", "min", "max", "q01", "q99", "q10", "q90"):
        assert wide[name][1] == plain[name][1]
    assert wide["std"][0] == 1e-3 and wide["min"][0] == pytest.approx(0.199) and wide["max"][0] == pytest.approx(0.201)
    assert plain["std"][0] == pytest.approx(0.0, abs=1e-12), "the negative control"
    assert floor_of("force_torque.torque_x") == 0.1 and floor_of("force_torque.force_x") == 1.0
    assert floor_of("robot0_joint_pos.joint1") == BY_WORD["joint_pos"] != floor_of("robot0_eef_pos.x") == 1e-3
    assert floor_of("cube_to_robot0_eef_vel_ang.x") == BY_WORD["vel_ang"]


def test_the_card_has_what_the_hub_reads(recorded):
    text = (recorded / "data" / "README.md").read_text()
    assert text.startswith("---\n") and "- LeRobot\n" in text and "data_files: data/*/*.parquet" in text
    assert read(recorded, "info.json")["robot_type"] in text and "Styles: " in text


def test_pools_and_demonstrations_are_recorded_separately(recorded, tmp_path, capsys):
    given = [f"pool={recorded / 'demos'},{REFERENCE}", f"to={tmp_path / 'new'}", "cameras=none"]
    assert cli.run(["record", *given]) == 2
    assert "record them separately" in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_robomimic_gets_every_run_and_its_environment_plays_it(recorded, tmp_path):
    """As robomimic's environment does: make from `env_args`, restore `ep_meta`, model and state, then act."""
    needs_robosuite()
    from robosuite.environments.base import REGISTERED_ENVS

    path, rows = tmp_path / "demos.hdf5", list(Demonstrations.open(recorded / "demos").rows())
    assert cli.run(["record", f"pool={recorded / 'demos'}", f"to={path}", "cameras=none", "format=robomimic"]) == 0
    with h5py.File(path) as file:
        demo, row = file["data/demo_1"], rows[1]
        meta, told = json.loads(demo.attrs["ep_meta"]), json.loads(file["data"].attrs["env_args"])
        assert (meta["scenario"], meta["run"], meta["style"]) == (row.id, row.run, row.style)
        assert b"demo_1" in file[f"mask/style_{row.style}"][()] and len(file["mask/success"]) == len(rows)
        actions, last = demo["actions"][()], demo["next_obs/robot0_eef_pos"][49]
        assert actions.tobytes() == row.witness[: len(actions)].tobytes()
        env = REGISTERED_ENVS[told["env_name"]](**told["env_kwargs"])
        env.set_ep_meta(meta)
        env.reset()
        env.reset_from_xml_string(env.edit_model_xml(demo.attrs["model_file"]))
        env.sim.reset()
        env.sim.set_state_from_flattened(demo["states"][0])
        env.sim.forward()
    for action in actions[:50]:
        seen, *_ = env.step(action)
    assert env.row.id == row.id
    np.testing.assert_allclose(last, seen["robot0_eef_pos"], atol=1e-3)

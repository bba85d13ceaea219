"""Recordings at the paper's rates, and recordings of chosen streams."""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from helpers import REFERENCE, certified_here, pictures_are_possible

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.envs.observations import proprioception
from scengen.pool import Pool
from scengen.sim.embodiment import JAW

TABLES = {100: "native/100hz", 50: "native/50hz"}
MIRRORED = Path(__file__).parents[1] / "checker" / "base" / "mirror_id"
CAMERA = "rgb_gripper_cam"


def record(to, *words):
    return cli.run(["record", f"pool={REFERENCE}", f"to={to}", "cameras=none", *words])


def columns(folder, below):
    table = pq.read_table(folder / below / "chunk-000" / "file-000.parquet")
    return {name: np.array(table[name].to_pylist()) for name in table.column_names}


@pytest.fixture(scope="module")
def native(tmp_path_factory):
    """Two witnesses at the paper's rates."""
    folder = tmp_path_factory.mktemp("native") / "data"
    assert record(folder, "n=2", "rates=native") == 0
    return folder


def test_actions_and_pose_have_100_rows_a_second_and_forces_50(native):
    fast, slow, rows = columns(native, TABLES[100]), columns(native, TABLES[50]), columns(native, "data")
    witnesses = [row.witness for row in Pool.open(REFERENCE).rows()][:2]
    for number, witness in enumerate(witnesses):
        own = fast["episode_index"] == number
        periods = 4 * (rows["episode_index"] == number).sum()
        assert own.sum() == periods and (slow["episode_index"] == number).sum() == periods // 2
        actions = fast["action"][own].astype(np.float32)
        assert actions.tobytes() == witness[: len(actions)].tobytes()
        assert np.allclose(fast["timestamp"][own], np.arange(periods) / 100) and fast["reward"][own].sum() == 1
    assert set(proprioception(JAW)) <= set(fast) and not set(proprioception(JAW)) & set(slow)
    assert {"force_torque", "force_torque_world"} <= set(slow) - set(fast)
    assert slow["robot0_tactile_left"].shape[1:] == (8, 8), "the paper's grid"


def test_the_tables_agree_with_the_rows_that_they_point_to(native):
    rows = columns(native, "data")
    for rate, names in ((100, ("robot0_eef_pos", "robot0_joint_vel")), (50, ("force_torque",))):
        table = columns(native, TABLES[rate])
        first = table["period"] % 4 == 0
        place = {key: k for k, key in enumerate(zip(rows["episode_index"], rows["frame_index"], strict=True))}
        at = [place[key] for key in zip(table["episode_index"][first], table["frame_index"][first], strict=True)]
        for name in names:
            assert (table[name][first] == rows[name][at]).all()
    assert json.loads((native / "meta" / "scengen.json").read_text())["native"]["50 Hz"].startswith("native/50hz/")


@pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL on this machine")
def test_rows_point_to_the_latest_picture(tmp_path):
    small = ["n=1", "rates=native", f"cameras={CAMERA}", "width=32", "height=24", "fps=5"]
    assert record(tmp_path / "data", *small) == 0
    table, rows = columns(tmp_path / "data", TABLES[50]), columns(tmp_path / "data", "data")
    pointers = table[f"frame_index.{CAMERA}"]
    assert (pointers == table["period"] // 20).all() and pointers.max() == rows["frame_index"].max()


def test_chosen_streams_stand_beside_the_robots_own_pose_and_no_others(tmp_path):
    assert record(tmp_path / "data", "n=1", "observations=[force_torque,tile_0_pos]") == 0
    names = set(columns(tmp_path / "data", "data"))
    assert {"force_torque", "tile_0_pos", "observation.state", *proprioception(JAW)} <= names
    assert not {"force_torque_world", "robot0_tactile_left", "observation.environment_state"} & names


def test_positions_as_pictures_show_them_are_those_of_the_environment(tmp_path):
    task = "mirror_pick_place"
    certified_here(MIRRORED)
    assert cli.run(["demos", f"task={task}", "n=1", f"to={tmp_path / 'demos'}"]) == 0
    assert record(tmp_path / "data", f"pool={tmp_path / 'demos'}", "observations=[seen_cube_pos,cube_pos]") == 0
    rows = columns(tmp_path / "data", "data")
    assert not np.allclose(rows["seen_cube_pos"], rows["cube_pos"], atol=0.01), "pictures of this task are turned"
    env = PoolEnv(task, MIRRORED, ["seen_cube_pos", "cube_pos"])
    seen, _ = env.reset()
    middle = (seen["seen_cube_pos"] + seen["cube_pos"])[:2]
    assert np.allclose((rows["seen_cube_pos"] + rows["cube_pos"])[0, :2], middle, atol=1e-3), "the same centre"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["observations=[force_torqe]"], "no observation named 'force_torqe' (did you mean 'force_torque'?)"),
        ([f"observations={CAMERA}"], f"it is a camera: pass cameras={CAMERA}"),
        (["rates=fast"], "no rates named 'fast'; known: native, one"),
        (
            ["rates=native", "format=robomimic", "to={}.hdf5"],
            "robomimic's data have 100 rows",
        ),
    ],
)
def test_bad_streams_and_rates_are_one_line_and_write_nothing(tmp_path, capsys, words, says):
    target = tmp_path / "data"
    assert record(target, *(word.format(target) for word in words)) == 2
    err = capsys.readouterr().err
    assert says in err and err.count("\n") == 1 and not list(tmp_path.iterdir())

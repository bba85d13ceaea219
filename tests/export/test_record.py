"""Recordings are LeRobot data sets of format v3.0 that hold what happened, and nothing half done is left behind."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from helpers import REFERENCE, pictures_are_possible

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.envs.observations import streams_of
from scengen.export import recording
from scengen.export.cameras import calibration
from scengen.export.floors import floors_of
from scengen.export.lerobot import DatasetWriter, Feature
from scengen.export.recording import RecordSettings, record
from scengen.export.stats import QUANTILES, Shades
from scengen.pool import Pool
from scengen.pool.writing import write_pool
from scengen.sim.arm import IDLE
from scengen.sim.embodiment import SUCTION
from scengen.sim.world import World
from scengen.tasks.domino_single import DominoSingle

PAPER = {
    "robot0_eef_pos": (3,),
    "robot0_eef_quat": (4,),
    "robot0_joint_pos": (7,),
    "robot0_joint_vel": (7,),
    "robot0_gripper_qpos": (2,),
    "force_torque": (6,),
    "force_torque_world": (3,),
    "robot0_tactile_left": (64,),
    "robot0_tactile_right": (64,),
    "action": (7,),
    "reward": (),
}
"""The paper's table of modalities, cameras apart: name and shape per frame, all float32. Grids of 8 x 8 are vectors
here, because readers of LeRobot's data sets stop at grids."""
CAMERA = "rgb_exo_right_cam"
WIDTH, HEIGHT = 96, 72


def recorded(folder, **changed):
    settings = RecordSettings(pool=str(REFERENCE), to=str(folder), **{"cameras": "none", **changed})
    return record(settings, lambda *_: None)


def rows_of(folder):
    return pq.read_table(folder / "data" / "chunk-000" / "file-000.parquet")


def column(folder, name):
    return np.array(rows_of(folder)[name].to_pylist())


def episodes_of(folder):
    return pq.read_table(folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()


def read_json(folder, name):
    return json.loads((folder / "meta" / name).read_text())


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The first three scenarios, without pictures."""
    folder = tmp_path_factory.mktemp("record") / "made"
    recorded(folder, n=3)
    return folder


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    """The first two scenarios, five pictures a second."""
    if not pictures_are_possible():
        pytest.skip("no OpenGL")
    folder = tmp_path_factory.mktemp("record") / "filmed"
    recorded(folder, n=2, fps=5, cameras=CAMERA, width=WIDTH, height=HEIGHT)
    return folder


@pytest.fixture(scope="module")
def witnesses():
    return list(Pool.open(REFERENCE).rows())


# --- what is in it ------------------------------------------------------------------------------


def test_columns_have_the_papers_names_shapes_and_types(made):
    features, schema = read_json(made, "info.json")["features"], rows_of(made).schema
    for name, shape in PAPER.items():
        assert features[name]["dtype"] == "float32" and tuple(features[name]["shape"]) == (shape or (1,))
        assert column(made, name).shape[1:] == shape
    assert schema.field("robot0_joint_pos").type == pa.list_(pa.float32(), 7)
    assert schema.field("control.actions").type == pa.list_(pa.list_(pa.float32()))
    assert set(schema.names) == set(features), "without cameras every feature is a column"


def test_the_schema_tells_hugging_face_every_column(made):
    schema = rows_of(made).schema
    told = json.loads(schema.metadata[b"huggingface"])["info"]["features"]
    assert list(told) == schema.names
    assert told["control.actions"] == {"shape": [4, 7], "dtype": "float32", "_type": "Array2D"}


def test_rows_are_numbered_and_timed_within_their_episode(made):
    fps = read_json(made, "info.json")["fps"]
    assert (column(made, "index") == np.arange(len(column(made, "index")))).all()
    for number, episode in enumerate(episodes_of(made)):
        own = slice(episode["dataset_from_index"], episode["dataset_to_index"])
        frames = np.arange(episode["length"])
        assert (column(made, "episode_index")[own] == number).all()
        assert (column(made, "frame_index")[own] == frames).all()
        assert np.allclose(column(made, "timestamp")[own], frames / fps, atol=1e-4)


def test_counts_agree_everywhere(made):
    info, episodes = read_json(made, "info.json"), episodes_of(made)
    assert info["codebase_version"] == "v3.0" and info["splits"] == {"train": "0:3"}
    assert info["total_episodes"] == len(episodes) == 3
    assert info["total_frames"] == sum(e["length"] for e in episodes) == rows_of(made).num_rows
    assert info["total_tasks"] == 1 and (column(made, "task_index") == 0).all()


def test_rewards_are_zero_until_the_last_row_and_one_there(made):
    for episode in episodes_of(made):
        own = slice(episode["dataset_from_index"], episode["dataset_to_index"])
        for name in ("reward", "next.reward", "next.done", "next.success"):
            values = column(made, name)[own]
            assert not values[:-1].any() and values[-1] == 1


def test_episodes_name_their_scenario_and_nothing_else_does(made, witnesses):
    for episode, row in zip(episodes_of(made), witnesses, strict=False):
        for name in ("id", "split", "scene_sha256", "witness_sha256", "seed", "index", "id_twin", "horizon"):
            assert episode[f"scengen/{name}"] == getattr(row, name)
        assert json.loads(episode["scengen/params"]) == row.params
        assert episode["scengen/success"] and episode["tasks"] == [row.instruction]
    tasks = pq.read_table(made / "meta" / "tasks.parquet")
    assert tasks.to_pylist() == [{"task_index": 0, "task": witnesses[0].instruction}]
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]


def test_a_recording_names_the_version_of_its_task(tmp_path, monkeypatch):
    monkeypatch.setattr(DominoSingle, "VERSION", 2)
    recorded(tmp_path / "made", n=1)
    assert [episode["scengen/task_version"] for episode in episodes_of(tmp_path / "made")] == [2]
    assert read_json(tmp_path / "made", "scengen.json")["task_versions"] == {"domino_single": 2}
    assert "Versions of the tasks: domino_single 2" in (tmp_path / "made" / "README.md").read_text()


def test_the_actions_are_the_witness_bit_by_bit(made, witnesses):
    for episode, row in zip(episodes_of(made), witnesses, strict=False):
        actions = column(made, "control.actions")[episode["dataset_from_index"] : episode["dataset_to_index"]]
        played = actions.astype(np.float32).reshape(-1, 7)
        assert played.tobytes() == row.witness[: len(played)].tobytes()
        assert len(played) <= len(row.witness) - 90, "the second after the goal is not recorded"


def test_the_action_of_a_row_asks_for_the_motion_of_its_control_periods(made):
    actions, action = column(made, "control.actions"), column(made, "action")
    assert actions.shape[1:] == (4, 7)
    assert np.allclose(4 * action[:, :6], actions[:, :, :6].sum(axis=1), atol=1e-5)
    assert (action[:, 6] == actions[:, -1, 6]).all()


def test_a_row_shows_the_moment_before_its_actions(made, witnesses):
    world = World.load(witnesses[0].scene_xml, witnesses[0].embodiment)
    for number in range(30):
        assert np.allclose(column(made, "robot0_eef_pos")[number], world.arm.hand, atol=1e-6)
        for action in witnesses[0].witness[4 * number : 4 * number + 4]:
            world.step_filtered(action)


def test_the_state_is_all_proprioception(made):
    names = ("robot0_eef_pos", "robot0_eef_quat", "robot0_joint_pos", "robot0_joint_vel", "robot0_gripper_qpos")
    assert (column(made, "observation.state") == np.hstack([column(made, name) for name in names])).all()


def test_every_entry_of_a_vector_has_a_name(made):
    features = read_json(made, "info.json")["features"]
    for name, feature in features.items():
        if feature["shape"] != [1]:
            wanted = len(feature["shape"]) if len(feature["shape"]) > 1 else feature["shape"][0]
            assert len(feature["names"]) == len(set(feature["names"])) == wanted, name
    assert features["action"]["names"][0] == "robot0_move_x" and features["action"]["names"][-1] == "robot0_gripper"
    assert features["observation.state"]["names"][3:5] == ["robot0_eef_quat.x", "robot0_eef_quat.y"]
    taxels = features["robot0_tactile_left"]["names"]
    assert taxels[:2] == ["robot0_tactile_left.row0_column0", "robot0_tactile_left.row0_column1"]


def test_the_environment_state_is_object_state_as_gymnasium_has_it(made, witnesses):
    names = read_json(made, "info.json")["features"]["observation.environment_state"]["names"]
    env = PoolEnv("domino_single", REFERENCE, ["object-state"])
    assert tuple(names) == env.metadata["names"]["object-state"]
    for episode, row in zip(episodes_of(made)[:2], witnesses, strict=False):
        seen, _ = env.reset(options={"scenario": row.id})
        for number in range(30):
            there = column(made, "observation.environment_state")[episode["dataset_from_index"] + number]
            assert (there.astype(np.float32) == seen["object-state"]).all()
            for action in row.witness[4 * number : 4 * number + 4]:
                seen, *_ = env.step(action)


@pytest.mark.parametrize(
    ("asked", "cameras", "there"),
    [(None, "none", True), (None, CAMERA, False), (True, CAMERA, True), (False, "none", False)],
)
def test_where_there_are_cameras_rows_do_not_tell_where_everything_is(asked, cameras, there):
    """LeRobot's policies read `observation.environment_state` wherever it is."""
    assert RecordSettings(cameras=cameras, environment_state=asked).privileged is there


def test_the_rows_actions_held_for_four_control_periods_reach_the_goal(made, witnesses):
    """What a policy of 25 Hz that had learnt them by heart would do."""
    env = PoolEnv("domino_single", REFERENCE, action_repeat=4)
    for episode, row in zip(episodes_of(made), witnesses, strict=False):
        env.reset(options={"scenario": row.id})
        actions = column(made, "action")[episode["dataset_from_index"] : episode["dataset_to_index"]]
        for action in (*actions, *[IDLE] * 25):  # the chain may fall a little later than recorded
            _, _, terminated, _, info = env.step(action)
            if terminated:
                break
        assert info["success"]


def test_at_100_rows_a_second_every_action_has_its_row(tmp_path, witnesses):
    recorded(tmp_path / "fast", n=1, fps=100)
    actions = column(tmp_path / "fast", "action").astype(np.float32)
    assert actions.tobytes() == witnesses[0].witness[: len(actions)].tobytes()


def test_a_suction_cup_has_no_jaw_streams():
    names = set(recording._features(RecordSettings(), SUCTION, streams_of(SUCTION)))
    assert set(PAPER) - names == {"robot0_gripper_qpos", "robot0_tactile_left", "robot0_tactile_right"}


# --- statistics -----------------------------------------------------------------------------------


def test_statistics_are_those_of_the_columns(made):
    stats = read_json(made, "stats.json")
    assert set(stats) == set(read_json(made, "info.json")["features"])
    for name in ("action", "robot0_tactile_left", "reward"):
        values = column(made, name)
        floors = floors_of(name, read_json(made, "info.json")["features"][name]["names"], values.shape[1:])
        wide = np.broadcast_to((values.max(axis=0) - values.min(axis=0)) >= 2 * floors, np.shape(stats[name]["std"]))
        assert wide.any() or name != "action"  # what the fingers feel here is less than the smallest spread
        assert np.allclose(stats[name]["mean"], values.mean(axis=0), atol=1e-6)
        assert np.allclose(stats[name]["std"], np.maximum(values.std(axis=0), floors), atol=1e-6)
        for kind, of in (("min", np.min), ("max", np.max)):
            found, there = np.array(stats[name][kind]), np.broadcast_to(of(values, axis=0), wide.shape)
            assert np.allclose(found[wide], there[wide], atol=1e-6)
        assert stats[name]["count"] == [len(values)]
        assert np.allclose(stats[name]["q50"], np.quantile(values, 0.5, axis=0), atol=1e-6)
    first = episodes_of(made)[0]
    assert np.allclose(first["stats/action/mean"], column(made, "action")[: first["length"]].mean(axis=0), atol=1e-6)


def test_picture_statistics_are_those_of_the_pixels():
    rng = np.random.default_rng(0)
    pictures = rng.integers(0, 256, (3, 64, 64, 3)).astype(np.uint8)
    shades = Shades()
    for picture in pictures:
        shades.add(picture)
    pixels = (pictures[:, ::4, ::4] / 255).reshape(-1, 3)
    found = shades.describe()
    wanted = {
        "min": pixels.min(axis=0),
        "max": pixels.max(axis=0),
        "mean": pixels.mean(axis=0),
        "std": pixels.std(axis=0),
    }
    for name, share in QUANTILES.items():
        wanted[name] = np.quantile(pixels, share, axis=0, method="lower")
    assert found["count"] == [3] and set(found) == {*wanted, "count"}
    for kind, value in wanted.items():
        assert np.shape(found[kind]) == (3, 1, 1) and np.allclose(np.ravel(found[kind]), value), kind


# --- pictures ------------------------------------------------------------------------------------


def frames_of(folder):
    import av

    path = folder / "videos" / f"observation.images.{CAMERA}" / "chunk-000" / "file-000.mp4"
    with av.open(str(path)) as file:
        return [(frame.time, frame.to_ndarray(format="rgb24")) for frame in file.decode(video=0)]


@pytest.mark.slow
def test_videos_have_one_frame_a_row_at_the_rows_time(filmed):
    frames, fps = frames_of(filmed), read_json(filmed, "info.json")["fps"]
    assert len(frames) == rows_of(filmed).num_rows
    assert np.allclose([t for t, _ in frames], np.arange(len(frames)) / fps, atol=1e-4)
    key = f"videos/observation.images.{CAMERA}"
    for episode in episodes_of(filmed):
        assert episode[f"{key}/from_timestamp"] * fps == pytest.approx(episode["dataset_from_index"])
        assert episode[f"{key}/to_timestamp"] * fps == pytest.approx(episode["dataset_to_index"])
    info = read_json(filmed, "info.json")["features"][f"observation.images.{CAMERA}"]
    assert info["dtype"] == "video" and info["shape"] == [HEIGHT, WIDTH, 3] and frames[0][1].shape == (HEIGHT, WIDTH, 3)
    assert "observation.images" not in "".join(rows_of(filmed).schema.names)


def test_calibration_says_where_the_slab_is_in_the_picture(filmed, witnesses):
    calibration = read_json(filmed, f"cameras/{CAMERA}.json")
    starts = [episode["dataset_from_index"] for episode in episodes_of(filmed)]
    assert calibration["frame"] == "world" and len(starts) == 2
    for start, row in zip(starts, witnesses, strict=False):
        picture = frames_of(filmed)[start][1].astype(int)
        red = picture[:, :, 0] - picture[:, :, 1:].max(axis=2) > 60
        seen = np.argwhere(red).mean(axis=0)[::-1] + 0.5
        slab = World.load(row.scene_xml).com("slab")
        in_camera = np.linalg.inv(calibration["extrinsics"]) @ [*slab, 1.0]
        pixel = np.array(calibration["intrinsics"]) @ (in_camera[:3] / in_camera[2])
        assert np.linalg.norm(pixel[:2] - seen) < 2.0, (
            "the middle of the red pixels, the first episode's and the next's"
        )


def test_the_wrist_camera_is_given_in_the_hands_frame(witnesses):
    world = World.load(witnesses[0].scene_xml)
    before = calibration(world, "robot0_eye_in_hand", WIDTH, HEIGHT)
    for action in witnesses[0].witness[:200]:
        world.step_filtered(action)
    assert before == calibration(world, "robot0_eye_in_hand", WIDTH, HEIGHT) and before["frame"] == "robot0_eef"
    assert before["extrinsics"][2][2] == pytest.approx(1.0, abs=0.01), "it looks where the hand points"


# --- reliability ---------------------------------------------------------------------------------


def test_a_killed_recording_leaves_nothing_that_looks_finished_and_starts_over(tmp_path):
    target = tmp_path / "killed"
    command = [sys.executable, "-m", "scengen", "record", f"pool={REFERENCE}", f"to={target}", "cameras=none"]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL, env=os.environ)
    unfinished = Path(f"{target}.unfinished")
    while process.poll() is None and not (unfinished / "data").exists():
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL and unfinished.exists()
    assert not target.exists() and not (unfinished / "meta" / "info.json").exists()
    assert cli.run([*command[3:], "n=1"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["killed"]


def test_a_folder_that_no_command_has_left_is_not_discarded(tmp_path, capsys):
    (tmp_path / "new.unfinished").mkdir()
    assert cli.run(["record", f"pool={REFERENCE}", f"to={tmp_path / 'new'}", "cameras=none"]) == 2
    assert "new.unfinished is in the way" in capsys.readouterr().err
    assert (tmp_path / "new.unfinished").is_dir()


def test_a_recording_that_is_being_written_is_left_alone(tmp_path, capsys):
    """A lock tells it from what a killed command has left."""
    target = tmp_path / "busy"
    command = ["record", f"pool={REFERENCE}", f"to={target}", "cameras=none"]
    process = subprocess.Popen(
        [sys.executable, "-m", "scengen", *command], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
    )
    while process.poll() is None and not Path(f"{target}.unfinished", "data").exists():
        time.sleep(0.005)
    assert cli.run(command) == 2
    assert "busy.unfinished is being written by another command; wait for it" in capsys.readouterr().err
    assert process.wait() == 0 and [path.name for path in tmp_path.iterdir()] == ["busy"]


def test_an_interrupted_recording_leaves_nothing_at_all(tmp_path):
    def interrupt(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record(RecordSettings(pool=str(REFERENCE), to=str(tmp_path / "new"), cameras="none"), interrupt)
    assert not list(tmp_path.iterdir())


def test_a_witness_that_fails_is_recorded_as_a_failure(tmp_path, capsys, witnesses):
    cut = replace(witnesses[0], witness=witnesses[0].witness[:50])
    write_pool(tmp_path / "cut", Pool.open(REFERENCE).manifest.without_files(), [cut])
    target = tmp_path / "out"
    assert cli.run(["record", f"pool={tmp_path / 'cut'}", f"to={target}", "cameras=none", "fps=5"]) == 1
    assert f"FAILED {cut.name}" in capsys.readouterr().err
    (episode,) = episodes_of(target)
    assert not episode["scengen/success"] and not column(target, "reward").any() and column(target, "next.done")[-1]


def test_a_full_file_is_followed_by_another(tmp_path, monkeypatch):
    monkeypatch.setattr("scengen.export.lerobot.DATA_FILE_SIZE", 0)
    monkeypatch.setattr("scengen.export.lerobot.FILES_PER_CHUNK", 2)
    with DatasetWriter(tmp_path, 25, "robot", {"x": Feature("float32")}, [], (0, 0)) as data:
        for episode in range(3):
            data.add({"x": float(episode)}, {})
            data.end_episode("do it", {})
        data.finish({})
    files = sorted(str(path.relative_to(tmp_path / "data")) for path in (tmp_path / "data").rglob("*.parquet"))
    assert files == ["chunk-000/file-000.parquet", "chunk-000/file-001.parquet", "chunk-001/file-000.parquet"]
    assert [(e["data/chunk_index"], e["data/file_index"]) for e in episodes_of(tmp_path)] == [(0, 0), (0, 1), (1, 0)]
    assert read_json(tmp_path, "stats.json")["x"]["mean"] == [1.0]


def test_without_cameras_neither_opengl_nor_pyav_is_needed(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "Camera", None)
    monkeypatch.setitem(sys.modules, "av", None)
    assert recorded(tmp_path / "blind", n=1, fps=5).episodes == 1


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["format=robomimc"], "no format of recordings named 'robomimc' (did you mean 'robomimic'?)"),
        (["format=robomimic"], "robomimic's format is one file: name one that ends in .hdf5 or .h5"),
        (["fps=30"], "no fps that divides the control rate of 100 Hz named '30'"),
        (["cameras=rgb_griper_cam"], "no camera named 'rgb_griper_cam' (did you mean 'rgb_gripper_cam'?)"),
        (["cameras=rgb_ego_cam,rgb_griper_cam"], "no camera named 'rgb_griper_cam'"),
        (["width=641"], "width = 641; the width and height of a video must be even numbers"),
        (["n=0"], "n = 0; it must be at least 1"),
        ([f"to={REFERENCE}"], "is a pool already (manifest.json); choose another to="),
        ([f"to={Path(__file__).parent}"], "exists already and is not a recording; delete it, or give another name"),
        (["to=/dev/null/out"], "cannot be written"),
        (["pool=nowhere"], "no pool at nowhere"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(tmp_path, capsys, arguments, says):
    given = ["record", f"pool={REFERENCE}", f"to={tmp_path / 'out'}", *arguments]
    assert cli.run(given) == 2
    err = capsys.readouterr().err
    assert says in err and err.count("\n") == 1 and not list(tmp_path.iterdir())


def written(target):
    return {path: path.stat().st_mtime_ns for path in (target, *target.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("format_", ["lerobot", "robomimic"])
def test_a_repeated_recording_is_there_already_and_another_one_is_refused(tmp_path, capsys, format_):
    target = tmp_path / "made.hdf5"
    command = ["record", f"pool={REFERENCE}", f"to={target}", "cameras=none", "n=1", f"format={format_}"]
    assert cli.run(command) == 0
    before = written(target)
    lock = Path(f"{target}.unfinished.lock")
    lock.touch()  # left by a command that was killed after its last step
    assert cli.run(command) == 0
    assert "made.hdf5 holds this recording already: 1 episodes" in capsys.readouterr().out and not lock.exists()
    assert written(target) == before
    assert cli.run([*command, "environment_state=false"]) == 2
    assert "exists already and has other settings.environment_state; delete it" in capsys.readouterr().err


def test_a_repeated_recording_tells_again_what_failed(tmp_path, capsys, witnesses):
    cut = replace(witnesses[0], witness=witnesses[0].witness[:50])
    write_pool(tmp_path / "cut", Pool.open(REFERENCE).manifest.without_files(), [cut])
    command = ["record", f"pool={tmp_path / 'cut'}", f"to={tmp_path / 'out'}", "cameras=none", "fps=5"]
    assert [cli.run(command), cli.run(command)] == [1, 1]
    assert capsys.readouterr().err.count(f"FAILED {cut.name}") == 2

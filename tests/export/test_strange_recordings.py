"""Recordings of strangers: what leads elsewhere, never ends or unpacks without end is one line; nothing is opened."""

import json
import os
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scengen.errors import PoolError
from scengen.export import dataset
from scengen.export.dataset import EpisodeData, Recording

CAMERA = "observation.images.agentview"
INFO = {
    "fps": 10,
    "features": {"action": {"dtype": "float32", "shape": [2]}, CAMERA: {"dtype": "video", "shape": [4, 4, 3]}},
    "total_episodes": 1,
    "robot_type": "panda_jaw",
}
ABOUT = {
    "scengen/task": "domino_single",
    "scengen/id": "0123456789ab",
    "scengen/params": "{}",
    "scengen/horizon": 12.0,
    "scengen/success": True,
    "length": 3,
    "dataset_from_index": 0,
    "dataset_to_index": 3,
    f"videos/{CAMERA}/chunk_index": 0,
    f"videos/{CAMERA}/file_index": 0,
    f"videos/{CAMERA}/from_timestamp": 0.0,
    f"videos/{CAMERA}/to_timestamp": 0.3,
}


@pytest.fixture
def folder(tmp_path):
    """A small recording, without its videos."""
    here = tmp_path / "recording"
    for path in ("meta/episodes/chunk-000", "data/chunk-000", f"videos/{CAMERA}/chunk-000"):
        (here / path).mkdir(parents=True)
    (here / "meta/info.json").write_text(json.dumps(INFO))
    pq.write_table(pa.Table.from_pylist([ABOUT]), here / "meta/episodes/chunk-000/file-000.parquet")
    rows = {"frame_index": pa.array(range(3)), "action": pa.array([[0.0, np.nan]] * 3, pa.list_(pa.float32(), 2))}
    pq.write_table(pa.table(rows), here / "data/chunk-000/file-000.parquet")
    return here


def described(folder, **changed):
    (folder / "meta/info.json").write_text(json.dumps({**INFO, **changed}))
    return folder


def refused(work, says):
    with pytest.raises(PoolError, match=says) as raised:
        work()
    assert "\n" not in str(raised.value)


def test_the_small_recording_is_read(folder):
    """The negative control."""
    (episode,) = Recording.open(folder).read()
    assert len(episode) == 3 and episode.columns["action"].shape == (3, 2)


@pytest.mark.parametrize(
    "table", ["meta/info.json", "meta/episodes/chunk-000/file-000.parquet", "data/chunk-000/file-000.parquet"]
)
@pytest.mark.parametrize("kind", ["link", "pipe"])
def test_links_and_pipes_are_not_opened(folder, tmp_path, table, kind):
    target = folder / table
    moved = shutil.move(target, tmp_path / "elsewhere")
    os.symlink(moved, target) if kind == "link" else os.mkfifo(target)
    refused(lambda: [*Recording.open(folder).read()], "outside the folder|plain file|meta/info.json is missing")


FLAT = pa.list_(pa.float32(), 2)


@pytest.mark.parametrize(
    ("column", "says"),
    [
        (pa.array(["a", "b", "c"]), "column action holds string, meta/info.json says float32"),
        (pa.array([0.0, 1.0, 2.0]), "has not the shape"),
        (pa.array([[0, 1]] * 3), "column action holds int64, meta/info.json says float32"),
        (pa.array([[0.0, 1.0], None, [0.0, 1.0]], FLAT), "lists to be of size=2"),
        (pa.nulls(3), "column action holds null"),
    ],
)
def test_a_column_has_the_kind_and_the_shape_that_are_announced(folder, column, says):
    rows = {"frame_index": pa.array(range(3)), "action": column}
    pq.write_table(pa.table(rows), folder / "data/chunk-000/file-000.parquet")
    refused(lambda: [*Recording.open(folder).read()], says)


def test_a_column_of_texts_is_left_out_if_it_is_announced(folder):
    rows = {"frame_index": pa.array(range(3)), "note": pa.array(["a", "b", None])}
    pq.write_table(pa.table(rows), folder / "data/chunk-000/file-000.parquet")
    refused(lambda: [*Recording.open(folder).read()], "only numbers are read")
    features = {**INFO["features"], "note": {"dtype": "string", "shape": [1]}}
    (episode,) = Recording.open(described(folder, features=features)).read()
    assert [*episode.columns] == ["frame_index"]


def test_tables_have_each_column_once_and_all_files_the_same(folder):
    table = pq.read_table(folder / "data/chunk-000/file-000.parquet")
    pq.write_table(table.select(["action"]), folder / "data/chunk-000/file-001.parquet")
    refused(lambda: [*Recording.open(folder).read()], "the files have different columns")
    (folder / "data/chunk-000/file-001.parquet").unlink()
    table = table.append_column("action", table["action"])
    pq.write_table(table, folder / "data/chunk-000/file-000.parquet")
    refused(lambda: [*Recording.open(folder).read()], "it has two columns action")


@pytest.mark.parametrize("rows", [{"task_index": [[1]], "task": ["a"]}, {"task_index": [0, 0], "task": ["a", "b"]}, {}])
def test_every_instruction_has_a_separate_number(folder, rows):
    pq.write_table(pa.table(rows or {"other": [1]}), folder / "meta/tasks.parquet")
    refused(lambda: Recording.open(folder).tasks, "a separate task_index")


@pytest.mark.parametrize("told", [{"shape": [-2]}, {"shape": [2**40]}, {"names": ["x", "y", "z"]}])
def test_shapes_and_names_that_cannot_be_are_refused(folder, told):
    features = {"action": {**INFO["features"]["action"], **told}}
    refused(lambda: Recording.open(described(folder, features=features)), "features.action")


def test_a_folder_that_leads_elsewhere_is_not_read(folder, tmp_path):
    shutil.move(folder / "data", tmp_path / "data")
    os.symlink(tmp_path / "data", folder / "data")
    refused(lambda: [*Recording.open(folder).read()], "lies outside the folder; restore it, with cp -rL")


@pytest.mark.parametrize("camera", ["../../../../etc", "/etc", CAMERA])
@pytest.mark.parametrize(
    "pattern", ["/etc/passwd", "../../{video_key}", "{chunk_index:>9999999999}", "{video_key.__class__}"]
)
def test_paths_of_videos_stay_in_the_folder_whatever_the_recording_says(folder, camera, pattern):
    features = {**INFO["features"], camera: {"dtype": "video", "shape": [4, 4, 3]}}
    about = {f"videos/{camera}/{name}": value for name, value in (("chunk_index", 0), ("file_index", 0))}
    about |= {f"videos/{camera}/from_timestamp": 0.0, f"videos/{camera}/to_timestamp": 0.3}
    pq.write_table(pa.Table.from_pylist([{**ABOUT, **about}]), folder / "meta/episodes/chunk-000/file-000.parquet")
    recording = Recording.open(described(folder, video_path=pattern, features=features))
    episode = EpisodeData(0, about, {})
    refused(lambda: [*recording.frames(episode, camera)], "outside the folder|is missing")


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"no video",
        b"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nfile:///etc/passwd\n",
        b"ffconcat version 1.0\nfile /etc/passwd\n",
        b"\x00\x00\x00\x18ftypisom" + b"\xff" * 4000,
    ],
)
def test_a_video_that_is_none_is_one_line_and_a_playlist_opens_nothing(folder, content):
    pytest.importorskip("av")
    (folder / f"videos/{CAMERA}/chunk-000/file-000.mp4").write_bytes(content)
    recording = Recording.open(folder)
    (episode,) = recording.read()
    refused(lambda: [*recording.frames(episode, CAMERA)], "cannot be decoded")


def test_pictures_have_a_largest_size(folder, monkeypatch):
    pytest.importorskip("av")
    from scengen.pictures.video import Movie

    with Movie(folder / f"videos/{CAMERA}/chunk-000/file-000.mp4", 10, 64, 48) as film:
        for _ in range(3):
            film.add(np.zeros((48, 64, 3), np.uint8))
    recording = Recording.open(folder)
    (episode,) = recording.read()
    assert [picture.shape for picture in recording.frames(episode, CAMERA)] == [(48, 64, 3)] * 3
    monkeypatch.setattr(dataset, "MAX_PIXELS", 1000)
    refused(lambda: [*recording.frames(episode, CAMERA)], "has pictures of 64 x 48; at most 1000 pixels")


def test_a_table_that_unpacks_to_too_much_is_refused(folder, monkeypatch):
    monkeypatch.setattr(dataset, "MAX_ROWS", 2)
    refused(lambda: [*Recording.open(folder).read()], "it has 3 rows; at most 2 are read")


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"fps": "10"}, "fps = '10'; it must be a number"),
        ({"fps": 0}, "fps = 0; it must lie in"),
        ({"fps": 1e9}, r"fps = 1e\+09; it must lie in"),
        ({"features": []}, "features = .*; it must be a mapping"),
        ({"features": {"action": "float32"}}, "features.action = 'float32'; it must be a group"),
        ({"fps": None}, "fps is missing"),
        ({"robot_type": "r2d2"}, "robot_type = 'r2d2'; it must be"),
    ],
    ids=str,
)
def test_a_description_of_other_types_names_file_field_and_value(folder, changed, says):
    refused(lambda: Recording.open(described(folder, **changed)), f"not a recording of scengen: meta/info.json: {says}")


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("scengen/success", "yes", "scengen/success of episode 0 is 'yes'"),
        ("dataset_to_index", -1, "dataset_to_index of episode 0 is -1"),
        ("scengen/horizon", float("nan"), "scengen/horizon of episode 0 is nan"),
        (f"videos/{CAMERA}/from_timestamp", None, f"videos/{CAMERA}/from_timestamp of episode 0 is None"),
        (f"videos/{CAMERA}/to_timestamp", float("inf"), f"videos/{CAMERA}/to_timestamp of episode 0 is inf"),
        (f"videos/{CAMERA}/file_index", "", f"the column videos/{CAMERA}/file_index is missing"),
        ("scengen/id", "", "the column scengen/id is missing"),
    ],
)
def test_a_table_of_other_types_names_file_field_and_value(folder, name, value, says):
    row = {key: told for key, told in {**ABOUT, name: value}.items() if told != ""}
    pq.write_table(pa.Table.from_pylist([row]), folder / "meta/episodes/chunk-000/file-000.parquet")
    refused(lambda: [[*r.frames(e, CAMERA)] for r in [Recording.open(folder)] for e in r.read()], f"episodes: {says}")


@pytest.mark.parametrize("shape", [[-1], [10**9, 10**9], ["x"], "2"], ids=str)
def test_shapes_that_do_not_fit_are_told(folder, shape):
    features = {**INFO["features"], "action": {"dtype": "float32", "shape": shape}}
    with pytest.raises((PoolError, ValueError, TypeError)):
        [*Recording.open(described(folder, features=features)).read()]

"""What people and strangers put into a recording: contradictions are refused, and no link leads out of it."""

import os
import shutil
from pathlib import Path

import pytest
from others import honest

from scengen import cli
from scengen.demos.curate.curation import CurateSettings, curate
from scengen.demos.curate.people import decisions_of_people, scores_by_people
from scengen.errors import BadConfig, PoolError, ScengenError
from scengen.export.dataset import Recording
from scengen.learn.data import TrainingData
from scengen.pool.files import replace_file
from scengen.work.targets import appearing, write


@pytest.fixture
def mine(tmp_path):
    return honest("recording", tmp_path / "mine")


@pytest.mark.parametrize("score", ["12", "234", "12345", "0", "6", "", "1.0", "five", "\u0661"])
def test_a_score_is_one_of_five_texts(tmp_path, score):
    path = tmp_path / "scores.csv"
    path.write_text(f"episode,score\n0,{score}\n")
    with pytest.raises(BadConfig, match="it must be 1 to 5"):
        scores_by_people(path, 1)


@pytest.mark.parametrize("episode", ["2", "0000000009", "0" * 5000 + "7", "9" * 5000, "-1", "1.0", "\u0661", ""])
def test_a_line_names_an_episode_that_exists(tmp_path, episode):
    (tmp_path / "scores.csv").write_text(f"episode,score\n{episode},5\n")
    with pytest.raises(BadConfig, match="it must be 0 to 1"):
        scores_by_people(tmp_path / "scores.csv", 2)


def test_zeros_before_a_number_are_no_other_episode(tmp_path):
    (tmp_path / "scores.csv").write_text(f"episode,score\n{'0' * 5000}1,5\n1,4\n")
    with pytest.raises(BadConfig, match="line 3: 4, an earlier line of this episode says 5"):
        scores_by_people(tmp_path / "scores.csv", 2)


def test_lines_that_contradict_each_other_are_refused(tmp_path):
    scores, decisions = tmp_path / "scores.csv", tmp_path / "decisions.csv"
    scores.write_text("episode,score\n0,5\n0,5\n")
    assert scores_by_people(scores, 1) == {0: 5}
    scores.write_text("episode,score\n0,5\n0,1\n")
    with pytest.raises(BadConfig, match="line 3: 1, an earlier line of this episode says 5"):
        scores_by_people(scores, 1)
    decisions.write_text("episode,verdict,who,why\n0,reject,a,b\n0,accept,a,b\n")
    with pytest.raises(BadConfig, match="line 3: accept, an earlier line of this episode says reject"):
        decisions_of_people(decisions, 1)


@pytest.mark.parametrize(
    "name", ["curation", "curation/kept.json", "curation/scores.lock", "curation/remarks.jsonl", "meta/scengen.json"]
)
@pytest.mark.parametrize("kind", ["link", "dangling", "pipe"])
def test_nothing_is_read_or_written_through_a_link(mine, tmp_path, name, kind):
    outside, path = tmp_path / "outside", mine / name
    outside.mkdir() if name == "curation" else outside.write_text("mine")
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    os.mkfifo(path) if kind == "pipe" else path.symlink_to(outside if kind == "link" else tmp_path / "nowhere")
    for command in (lambda: curate(CurateSettings(data=str(mine)), lambda *_: None), lambda: TrainingData.read(mine)):
        with pytest.raises(PoolError, match="is a link, or no plain file"):
            command()
    assert not (tmp_path / "nowhere").exists()
    assert name == "curation" or outside.read_text() == "mine"


def test_a_list_of_kept_episodes_that_is_none_is_refused(mine):
    (mine / "curation" / "kept.json").mkdir(parents=True)
    with pytest.raises(PoolError, match="kept.json is damaged"):
        TrainingData.read(mine)
    (mine / "curation" / "kept.json").rmdir()
    (mine / "curation" / "kept.json").write_text("[0, 7]")
    with pytest.raises(PoolError, match="there is no episode 7"):
        TrainingData.read(mine)


def test_nothing_is_learned_from_episodes_that_people_have_rejected_since(mine, tmp_path, capsys):
    (mine / "curation").mkdir()
    (mine / "curation" / "decisions.csv").write_text("episode,verdict,who,why\n0,reject,op1,slips\n")
    for kept in (None, "[0]"):
        if kept:
            (mine / "curation" / "kept.json").write_text(kept)
        assert cli.run(["train", f"data={mine}", f"to={tmp_path / 'policy'}"]) == 2
        assert "a verdict about episode 0 that curation/kept.json does not follow; repeat" in capsys.readouterr().err


@pytest.mark.parametrize("writer", [replace_file, write])
def test_a_file_is_not_written_through_a_link_at_its_temporary_name(tmp_path, writer):
    (tmp_path / "outside").write_text("mine")
    (tmp_path / "file.part").symlink_to(tmp_path / "outside")
    writer(tmp_path / "file", b"new")
    assert (tmp_path / "outside").read_text() == "mine" and (tmp_path / "file").read_bytes() == b"new"


def test_a_place_that_cannot_be_written_is_found_before_the_work(mine, monkeypatch):
    (mine / "curation").write_text("in the way")
    with pytest.raises(ScengenError, match="curation"):
        curate(CurateSettings(data=str(mine)), lambda *_: pytest.fail("it has begun"))


def test_two_writers_to_one_place_exclude_each_other(tmp_path):
    with appearing(tmp_path / "new", folder=True) as part, pytest.raises(BadConfig, match="is being written"):
        (part / "file").touch()
        with appearing(tmp_path / "new", folder=True):
            pass
    assert (tmp_path / "new" / "file").exists()


def test_what_a_killed_command_has_left_is_discarded_and_nothing_else(tmp_path):
    part = Path(f"{tmp_path / 'new'}.unfinished")
    shutil.copytree(tmp_path, part)
    with pytest.raises(BadConfig, match="is in the way"), appearing(tmp_path / "new", folder=True):
        pass
    Path(f"{part}.lock").touch()
    (part / "rest").touch()
    with appearing(tmp_path / "new", folder=True) as path:
        assert not list(path.iterdir())


def test_recordings_are_opened_as_before(mine):
    assert len(Recording.open(mine).episodes) == 1

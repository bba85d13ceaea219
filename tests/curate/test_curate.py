"""Injected faults are found, clean episodes are not flagged, and people decide."""

import csv
import json
import shutil
import sys
import types
from pathlib import Path

import jsonschema
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scengen import cli
from scengen.agents.models import Reply
from scengen.cli.commands.settings import read_task
from scengen.demos.curate.curation import CurateSettings, curate
from scengen.demos.curate.findings import SCHEMA
from scengen.demos.curate.replays import MAX_REPLAY_ERROR, difference
from scengen.demos.curate.score import scores_of
from scengen.demos.curate.videos import PROBES, Prober, check_video, compared, stands_still
from scengen.demos.generate import DemosSettings, generate_demonstrations
from scengen.errors import BadConfig, PoolError
from scengen.export.dataset import Recording
from scengen.measures import policies


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    """A recording of four demonstrations without pictures."""
    folder = tmp_path_factory.mktemp("clean")
    given = ["task=domino_single", "n=4", f"to={folder / 'demos'}"]
    settings, task, checks = read_task("demos", given, DemosSettings)
    generate_demonstrations(task, checks, settings, lambda *_: None)
    assert cli.run(["record", f"pool={folder / 'demos'}", f"to={folder / 'data'}", "cameras=none"]) == 0
    return folder / "data"


@pytest.fixture
def mine(clean, tmp_path):
    """A copy to damage."""
    return Path(shutil.copytree(clean, tmp_path / "mine"))


def curated(folder, replay=True):
    return curate(CurateSettings(data=str(folder), replay=replay), lambda *_: None)


def test_the_episodes_that_the_measurement_of_curation_spoils_are_all_left_out(mine, monkeypatch):
    monkeypatch.setattr(policies, "EVERY", 1)
    policies.spoil(mine)
    reports = curated(mine).reports
    assert [report.flagged for report in reports] == [True, True, True, False], "late, frozen, of the next, sound"
    found = [{finding.check for finding in report.findings} for report in reports]
    assert "REPLAY" in found[0] & found[2]


def checks_of(folder, episode=1, replay=True):
    """Names of the checks that have found something in an episode."""
    return {finding.check for finding in curated(folder, replay).reports[episode].findings}


def rows_of(folder):
    return folder / "data" / "chunk-000" / "file-000.parquet"


def change(folder, name, fault, episode=1):
    """Change a column of one episode: `fault` gets its values and returns others."""
    table = pq.read_table(rows_of(folder))
    about = pq.read_table(folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()[episode]
    start, end = about["dataset_from_index"], about["dataset_to_index"]
    values = np.array(table[name].to_pylist())
    values[start:end] = fault(values[start:end].copy())
    place = table.schema.get_field_index(name)
    column = pa.array(values.tolist(), table.schema.field(name).type)
    pq.write_table(table.set_column(place, table.schema.field(place), column), rows_of(folder))


def add(rows, amount):
    def fault(values):
        values[rows] += amount
        return values

    return fault


def put(rows, amount):
    def fault(values):
        values[rows] = amount
        return values

    return fault


def frozen(values):
    values[4:28] = values[4]
    return values


def swapped(values):
    values[..., [0, 1]] = values[..., [1, 0]]
    return values


def gripper_sign(values):
    values[..., 6] *= -1
    return values


FAULTS = {
    "a row is missing": ("timestamp", add(slice(30, None), 0.04), "FRAME_DROPS"),
    "a time stamp is late": ("timestamp", add(30, 0.01), "TIMESTAMP"),
    "the rate is another one": ("timestamp", lambda v: v * 2, "FPS"),
    "rows are numbered wrongly": ("frame_index", put(30, 7), "INDEX"),
    "the index restarts": ("index", lambda v: v - v[0], "INDEX"),
    "the episode has another number": ("episode_index", put(slice(None), 3), "INDEX"),
    "a number is not finite": ("robot0_joint_pos", put(30, np.nan), "NAN"),
    "the hand jumps": ("robot0_eef_pos", add(30, 0.1), "DISCONTINUITY"),
    "the hand is in millimetres": ("robot0_eef_pos", lambda v: 1000 * v, "DISCONTINUITY"),
    "the state alone differs": ("observation.state", add(30, 0.01), "STATE_MISMATCH"),
    "joints are in degrees": ("robot0_joint_pos", np.degrees, "STATE_MISMATCH"),
    "speeds are dead": ("robot0_joint_vel", put(slice(None), 0.0), "DEAD_JOINT"),
    "the force sensor is dead": ("force_torque", put(slice(None), 0.0), "DEAD_STREAM"),
    "actions have swapped channels": ("action", swapped, "ACTION_MISMATCH"),
    "all actions have swapped channels": ("control.actions", swapped, "REPLAY"),
    "the gripper has another sign": ("action", gripper_sign, "ACTION_MISMATCH"),
    "all grips have another sign": ("control.actions", gripper_sign, "REPLAY"),
    "actions are scaled": ("control.actions", lambda v: 2 * v, "ACTION_RANGE"),
    "an action jumps": ("control.actions", put((30, 2, 0), 0.9), "ACTION_JUMP"),
    "the hand is a little off": ("robot0_eef_pos", add(slice(None), 1e-4), "REPLAY"),
    "the success is lost": ("next.success", put(slice(None), False), ""),
}
"""Injected faults: column, change, and the check that must find it; none for one that costs the score."""


def test_clean_episodes_are_not_flagged_and_all_are_kept(clean, tmp_path):
    folder = Path(shutil.copytree(clean, tmp_path / "copy"))
    found = curated(folder)
    assert [report.findings for report in found.reports] == [()] * 4
    assert found.kept == (0, 1, 2, 3) and all("replay" in report.checks for report in found.reports)
    assert found.funnel == {"recorded": 4, "scored": 4, "without errors": 4, "kept": 4}
    told = json.loads((folder / "meta" / "scengen.json").read_text())
    assert told["curation"]["funnel"]["kept"] == 4 and told["versions"], "what stood there is kept"


@pytest.mark.parametrize("name", FAULTS)
def test_an_injected_fault_is_found_in_its_episode_alone(mine, name):
    column, fault, check = FAULTS[name]
    change(mine, column, fault)
    found = curated(mine)
    faulty = found.reports[1]
    assert check in {finding.check for finding in faulty.findings} if check else faulty.score == 1
    assert 1 not in found.kept and {0, 2, 3} <= set(found.kept)


def test_a_stored_speed_of_a_fast_ball_is_rounded_and_no_fault():
    speeds = np.random.default_rng(0).uniform(
        -40.0, 40.0, 1000
    )  # a ball of 15 mm that rolls at 0.6 m/s turns at 40 rad/s
    stored = speeds.astype(np.float32)
    assert np.abs(speeds - stored).max() > MAX_REPLAY_ERROR > difference(speeds, stored)
    assert difference(speeds + 1e-4, stored) > MAX_REPLAY_ERROR
    assert difference(np.array([0.5 + 2e-6]), np.array([0.5], np.float32)) > MAX_REPLAY_ERROR


def test_a_frozen_state_is_found_where_the_arm_moves(mine):
    for column in ("robot0_eef_pos", "robot0_joint_pos"):
        change(mine, column, frozen)
    found = curated(mine, replay=False).reports[1]
    (finding,) = [one for one in found.findings if one.check == "FROZEN_STATE"]
    assert 4 <= finding.frames[0] < finding.frames[1] <= 28


def test_a_body_that_is_moved_by_hand_is_found(mine):
    names = json.loads((mine / "meta" / "info.json").read_text())["features"]["observation.environment_state"]["names"]
    body = next(name for name in names if name == "tile_0_pos.x")
    change(mine, "observation.environment_state", add((slice(30, None), names.index(body)), 0.2))
    assert {"TELEPORT", "REPLAY"} <= checks_of(mine)


def test_a_repeated_episode_is_found(mine):
    about = pq.read_table(mine / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    rows = about.to_pylist()
    for key in ("scengen/id", "dataset_from_index", "dataset_to_index", "length"):
        rows[2][key] = rows[1][key]
    pq.write_table(
        pa.Table.from_pylist(rows, about.schema), mine / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    )
    assert {"DUPLICATE", "INDEX"} <= checks_of(mine, 2)


def test_a_missing_column_is_found_and_ends_the_checks(mine):
    pq.write_table(pq.read_table(rows_of(mine)).drop_columns(["force_torque"]), rows_of(mine))
    report = curated(mine).reports[1]
    assert [finding.check for finding in report.findings] == ["MISSING_FIELD"]
    assert report.checks == ("fields",) and report.score == 1


# --- pictures ---------------------------------------------------------------------------------


def pictures(count=40):
    """A square that moves over a textured ground."""
    ground = np.random.default_rng(0).integers(60, 200, (48, 64, 1)).repeat(3, axis=2).astype(np.uint8)
    for k in range(count):
        picture = ground.copy()
        picture[8:24, k : k + 16] = 250
        yield picture


VIDEO_FAULTS = {
    "FRAME_COUNT": lambda film: film[:-1],
    "FROZEN_CAMERA": lambda film: film[:10] + [film[10]] * 20 + film[30:],
    "BLACK": lambda film: [*film[:10], 0 * film[10], *film[11:]],
    "WHITE": lambda film: [*film[:10], 0 * film[10] + 255, *film[11:]],
    "BLUR": lambda film: [*film[:10], 0 * film[10] + 100, *film[11:]],
    "SCENE_CHANGE": lambda film: [*film[:10], film[10][::-1, ::-1], *film[11:]],
}


def test_a_clean_film_has_no_findings():
    assert not list(check_video("camera", pictures(), 40, np.ones(40, bool)))


@pytest.mark.parametrize("check", VIDEO_FAULTS)
def test_a_fault_of_a_film_is_found(check):
    film = VIDEO_FAULTS[check](list(pictures()))
    assert check in {finding.check for finding in check_video("camera", film, 40, np.ones(40, bool))}


def test_a_camera_may_stand_still_while_the_arm_does():
    still = [next(pictures())] * 40
    assert not list(check_video("camera", still, 40, np.zeros(40, bool)))


def probed(film, replay):
    """Findings of a film beside pictures of its replay."""
    prober = Prober(len(film))
    assert len(list(prober.watched(film))) == len(film)
    assert len(prober.probes) == PROBES
    return list(compared("camera", [probe.differences(replay[probe.row]) for probe in prober.probes]))


def test_a_film_of_the_replay_has_no_findings():
    assert not probed(list(pictures()), list(pictures()))
    assert not probed(list(noisy(pictures())), list(pictures()))


def noisy(film):
    """The same film after compression."""
    pick = np.random.default_rng(1)
    for picture in film:
        yield np.clip(picture + pick.normal(0.0, 6.0, picture.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("rows", [-5, -1, 1, 3])
def test_a_film_that_is_late_or_early_is_found(rows):
    film, shown = list(pictures(60)), list(pictures(60))
    late = [*film[:1] * rows, *film[:-rows]] if rows > 0 else [*film[-rows:], *film[-1:] * -rows]
    (finding,) = probed(list(noisy(late)), shown)
    assert finding.check == "VIDEO_SHIFT" and finding.numbers["rows"] == rows
    assert ("late" if rows > 0 else "early") in finding.explanation


def test_a_film_of_something_else_is_found():
    (finding,) = probed([255 - picture for picture in pictures()], list(pictures()))
    assert finding.check == "VIDEO_MISMATCH"


def test_what_stands_still_in_the_replay_may_stand_still_in_the_film():
    first, *_, last = pictures()
    assert stands_still(first, first) and not stands_still(first, last)


def test_films_are_compared_with_the_replay(tmp_path, capsys, monkeypatch):
    made = (
        ["demos", "task=domino_single", "n=1", f"to={tmp_path / 'demos'}"],
        [
            "record",
            f"pool={tmp_path / 'demos'}",
            f"to={tmp_path / 'data'}",
            "cameras=[rgb_exo_right_cam]",
            "width=96",
            "height=72",
        ],
    )
    assert [cli.run(words) for words in made] == [0, 0]
    film = "observation.images.rgb_exo_right_cam"
    clean = curated(tmp_path / "data").reports[0]
    assert not clean.findings and clean.checks[-2:] == ("replay", f"pictures {film}")
    file = tmp_path / "data" / "meta" / "cameras" / "rgb_exo_right_cam.json"
    honest = file.read_text()
    told = json.loads(honest)
    told["extrinsics"][0][3] += 0.02
    file.write_text(json.dumps(told))
    (finding,) = curated(tmp_path / "data").reports[0].findings
    assert finding.check == "CAMERA" and "rgb_exo_right_cam.json has another calibration" in finding.explanation
    file.write_text(honest)
    whole = Recording.frames

    def late(self, episode, camera):
        pictures = list(whole(self, episode, camera))
        return iter([*pictures[:1] * 4, *pictures[:-4]])

    monkeypatch.setattr(Recording, "frames", late)
    (finding,) = curated(tmp_path / "data").reports[0].findings
    assert finding.check == "VIDEO_SHIFT" and finding.numbers["rows"] == 4

    def frozen(self, episode, camera):
        pictures = list(whole(self, episode, camera))
        return iter([*pictures[:5], *pictures[5:6] * 25, *pictures[30:]])

    monkeypatch.setattr(Recording, "frames", frozen)
    assert "FROZEN_CAMERA" in {finding.check for finding in curated(tmp_path / "data").reports[0].findings}
    monkeypatch.setattr(Recording, "frames", whole)
    monkeypatch.setenv("MUJOCO_GL", "glfw")  # which needs a display
    monkeypatch.delenv("DISPLAY", raising=False)
    report = curated(tmp_path / "data").reports[0]
    assert not report.findings and report.checks[-1] == "replay", "what was not compared is not said to be"
    assert cli.run(["curate", f"data={tmp_path / 'data'}"]) == 0
    assert "pictures were not compared with the replay: no OpenGL" in capsys.readouterr().err


# --- scores -----------------------------------------------------------------------------------


def test_scores_follow_from_the_terms():
    usual = [{"seconds": 3.0 + 0.01 * k, "jerk": 10.0} for k in range(20)]
    strange = [
        {"seconds": 4.0, "jerk": 10.0},
        {"seconds": 5.0, "jerk": 10.0},
        {"seconds": 5.0, "jerk": 99.0},
        {"seconds": 3.0, "jerk": 10.0},
    ]
    scores = scores_of([*usual, *strange], ["task"] * 24, [True] * 23 + [False])
    assert scores == [5] * 20 + [4, 3, 2, 1]


def test_a_retry_is_seen_where_no_other_episode_has_one():
    grips = [0.0] * 9
    assert scores_of([{"grips": each} for each in [*grips, 1.0]], ["task"] * 10, [True] * 10)[-1] == 5
    assert scores_of([{"grips": each} for each in [*grips, 2.0]], ["task"] * 10, [True] * 10)[-1] == 4
    assert scores_of([{"grips": each} for each in [*grips, 4.0]], ["task"] * 10, [True] * 10)[-1] == 3


# --- models -----------------------------------------------------------------------------------


class Reviewer:
    """A model that remarks on every episode with findings, tries to clear it, and once answers nonsense."""

    asked = 0

    def reply(self, turns, tools, schema, temperature, seed):
        type(self).asked += 1
        report = json.loads(turns[1].text)
        assert schema["title"] == "remarks" and report["frames"] > 0
        if report["episode"] == 3:
            return Reply('{"remarks": [{"first": 0, "last": 99999, "text": "beyond the end"}]}')
        told = [{"first": 2, "last": 5, "text": "no fault, ignore it"}] if report["findings"] else []
        return Reply(json.dumps({"remarks": told}))


def test_a_model_adds_remarks_and_removes_no_finding_and_is_asked_once(mine, monkeypatch):
    change(mine, "observation.state", add(30, 0.1))
    before = curated(mine, replay=False)
    module = types.SimpleNamespace(reviewer=Reviewer)
    monkeypatch.setitem(sys.modules, "reviewers", module)
    settings = CurateSettings(data=str(mine), replay=False, model="reviewers:reviewer")
    for _ in range(2):
        found = curate(settings, lambda *_: None)
        assert found.kept == before.kept and found.unread == 1 and Reviewer.asked == 4
        for old, new in zip(before.reports, found.reports, strict=True):
            assert new.findings[: len(old.findings)] == old.findings
        (remark,) = found.reports[1].findings[len(before.reports[1].findings) :]
        assert (remark.check, remark.severity, remark.frames) == ("REMARK", "warning", (2, 5))


# --- people -----------------------------------------------------------------------------------


def write(folder, name, *lines):
    (folder / "curation").mkdir(exist_ok=True)
    (folder / "curation" / name).write_text("\n".join(lines) + "\n")


def test_people_decide_both_ways_and_undecided_episodes_stay_out(mine):
    change(mine, "robot0_eef_pos", add(30, 0.1))
    change(mine, "robot0_eef_pos", add(30, 0.1), episode=2)
    found = curated(mine)
    assert found.kept == (0, 3) and [report.episode for report in found.undecided] == [1, 2]
    write(mine, "decisions.csv", "episode,verdict,who,why", '1,accept,ab,"fine, I looked"', "0,reject,ab,ugly", "2,,,")
    found = curated(mine)
    assert found.kept == (1, 3) and [report.episode for report in found.undecided] == [2]
    assert found.decisions[1].why == "fine, I looked"
    assert json.loads((mine / "curation" / "kept.json").read_text()) == [1, 3]


def test_the_score_of_a_person_wins(mine):
    write(mine, "scores.csv", "episode,score", "3,2")
    found = curated(mine, replay=False)
    assert 3 not in found.kept and (found.reports[3].score, found.reports[3].scored_by) == (2, "person")


@pytest.mark.parametrize(
    ("name", "lines", "says"),
    [
        ("scores.csv", ["episode,score", "1,9"], "line 2: score = '9'; it must be 1 to 5"),
        ("scores.csv", ["episode,score", "1,12"], "line 2: score = '12'; it must be 1 to 5"),
        ("scores.csv", ["episode,score", "1,12345"], "score = '12345'; it must be 1 to 5"),
        ("scores.csv", ["episode,score", "0000000001234,3"], "episode = '0000000001234'; it must be 0 to 3"),
        ("scores.csv", ["episode,score", "1,4", "01,5"], "line 3"),
        ("decisions.csv", ["episode,verdict,who,why", "1,accept,,", "1,reject,,"], "line 3"),
        ("scores.csv", ["episode,points", "1,5"], "lacks the column score"),
        ("decisions.csv", ["episode,verdict,who,why", "1,maybe,,"], "it must be accept or reject"),
        ("decisions.csv", ["episode,verdict,who,why", "44,accept,,"], "episode = '44'; it must be 0 to 3"),
    ],
)
def test_a_table_without_a_meaning_is_one_line(mine, name, lines, says):
    write(mine, name, *lines)
    with pytest.raises(BadConfig, match=says):
        curated(mine, replay=False)


def test_reports_follow_their_schema(mine):
    change(mine, "robot0_eef_pos", add(30, 0.1))
    curated(mine)
    lines = (mine / "curation" / "reports.jsonl").read_text().splitlines()
    validator = jsonschema.Draft202012Validator(json.loads((mine / "curation" / "report.schema.json").read_text()))
    assert json.loads(json.dumps(SCHEMA)) == validator.schema and len(lines) == 4
    for line in lines:
        validator.validate(json.loads(line))
    with pytest.raises(jsonschema.ValidationError):
        validator.validate({**json.loads(lines[0]), "score": 9})


def test_the_command_writes_a_page_whose_texts_are_escaped(mine, capsys):
    change(mine, "observation.state", add(30, 0.1))
    write(mine, "decisions.csv", "episode,verdict,who,why", '0,reject,"<script>","</script><b>"')
    assert cli.run(["curate", f"data={mine}"]) == 0
    told = capsys.readouterr().out
    assert "STATE_MISMATCH (error)" in told and "1 flagged episodes wait for a decision" in told
    page = (mine / "curation" / "index.html").read_text()
    assert 'data-episode="1"' in page and "data:image/svg+xml" in page and "</script><b>" not in page
    assert 'data-episode="0"' not in page, "episode 0 has no findings"
    others = json.loads(page[page.index("const others = ") + 15 :].partition(";\n")[0])
    assert next(csv.reader(others)) == ["0", "reject", "<script>", "</script><b>"]


def test_what_is_no_recording_is_one_line(tmp_path, clean):
    with pytest.raises(PoolError, match="no recording at .*; see scengen record"):
        curated(tmp_path)
    folder = Path(shutil.copytree(clean, tmp_path / "cut"))
    rows_of(folder).write_bytes(rows_of(folder).read_bytes()[:-9])
    with pytest.raises(PoolError, match="cannot be read .*; restore it"):
        curated(folder)

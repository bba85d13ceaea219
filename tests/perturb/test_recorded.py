"""Recordings of several looks: actions stay, what is perceived differs, and curation finds what is told wrongly."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from helpers import REFERENCE, pictures_are_possible

from scengen import cli
from scengen.export.recording import RecordSettings, record
from scengen.perturb.language import Words

LOOKS = {"perturb": "proprioception_noise@2+reworded@4", "looks": 2}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Two looks of a scenario, without pictures."""
    to = tmp_path_factory.mktemp("recorded") / "looks"
    record(RecordSettings(str(REFERENCE), str(to), n=1, cameras="none", **LOOKS), lambda done, total: None)
    return to


def episodes(folder):
    return pq.read_table(next(folder.glob("meta/episodes/*/*.parquet"))).to_pylist()


def test_actions_and_states_are_those_of_the_clean_recording(recorded, tmp_path):
    clean = tmp_path / "clean"
    record(RecordSettings(str(REFERENCE), str(clean), n=1, cameras="none"), lambda done, total: None)
    rows, plain = (pq.read_table(next(each.glob("data/*/*.parquet"))) for each in (recorded, clean))
    one, two = (rows.filter(pa.compute.equal(rows["episode_index"], number)) for number in (0, 1))
    for look in (one, two):
        for name in ("control.actions", "next.success", "observation.environment_state"):
            assert look[name].combine_chunks().equals(plain[name].combine_chunks())
    states = [np.array(each["observation.state"].to_pylist()) for each in (one, two, plain)]
    assert all(0 < np.abs(states[a] - states[b]).max() < 0.1 for a, b in ((0, 1), (0, 2), (1, 2)))


def test_the_table_tells_what_was_perturbed(recorded):
    told = episodes(recorded)
    assert [(each["scengen/perturb"], each["scengen/perturb_seed"]) for each in told] == [
        (LOOKS["perturb"], 0),
        (LOOKS["perturb"], 1),
    ]
    text = Words.of("domino_single", "").wordings["reworded"][3]
    assert all(each["tasks"] == [text] for each in told)


def curated(folder):
    """Checks that failed, by episode."""
    cli.run(["curate", f"data={folder}"])
    reports = (json.loads(line) for line in (folder / "curation" / "reports.jsonl").read_text().splitlines())
    return [{each["check"] for each in report["findings"]} - {"SATURATED"} for report in reports]


def test_curation_plays_what_was_perturbed_again(recorded, capsys):
    assert curated(recorded) == [set(), set()]


def test_curation_finds_another_seed(recorded, capsys):
    file = next(recorded.glob("meta/episodes/*/*.parquet"))
    before, table = file.read_bytes(), pq.read_table(file)
    at = table.column_names.index("scengen/perturb_seed")
    pq.write_table(table.set_column(at, "scengen/perturb_seed", pa.array([5, 1])), file)
    assert "REPLAY" in curated(recorded)[0]
    file.write_bytes(before)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["looks=3", "cameras=none"], "perturb= makes them differ: give it, or leave looks out"),
        (["perturb=noise@1", "cameras=none"], "affects all cameras, and none is observed"),
        (["perturb=wrench_noise@1", "format=robomimic", "cameras=none"], "use format=lerobot"),
        (["perturb=table_texture@1", "look=plain"], "shows in look=room, not in plain"),
    ],
)
def test_what_cannot_be_recorded_is_refused(words, says, tmp_path, capsys):
    name = "x.hdf5" if "format=robomimic" in words else "x"
    assert cli.run(["record", f"pool={REFERENCE}", f"to={tmp_path / name}", *words]) == 2
    assert says in " ".join(capsys.readouterr().err.split())


@pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")
def test_films_of_several_looks_pass_the_comparison_with_pictures(tmp_path, capsys):
    to = tmp_path / "films"
    settings = {"perturb": "light_colour@5+late@2", "looks": 2, "cameras": "rgb_gripper_cam", "width": 64, "height": 48}
    record(RecordSettings(str(REFERENCE), str(to), n=1, fps=10, **settings), lambda done, total: None)
    assert curated(to) == [set(), set()]

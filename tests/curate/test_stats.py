"""Statistics of recordings are those of their rows, computed in another way."""

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from helpers import REFERENCE

from scengen import cli, list_tasks
from scengen.demos.curate.stats import PHASES, at_phases, paths_of, statistics_of
from scengen.errors import BadConfig, PoolError
from scengen.export.dataset import Recording
from scengen.samplers.task_files import conf_dir, paper_lengths


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The witnesses of the reference pool's first three scenarios."""
    folder = tmp_path_factory.mktemp("stats") / "data"
    assert cli.run(["record", f"pool={REFERENCE}", f"to={folder}", "cameras=none", "n=3"]) == 0
    return folder


def test_numbers_are_those_of_the_rows(made):
    (own,) = statistics_of([Recording.open(made)])
    table = pq.read_table(made / "data" / "chunk-000" / "file-000.parquet")
    actions = np.array(table["control.actions"].to_pylist()).reshape(-1, 7)
    assert (own.task, own.episodes, own.solved, own.styles) == ("domino_single", 3, 3, {})
    assert own.seconds == pytest.approx(len(table) / 25 / 3)
    assert own.channels[0].name == "robot0_move_x" and own.channels[0].mean == pytest.approx(actions[:, 0].mean())
    assert own.channels[6].at_limit == pytest.approx((np.abs(actions[:, 6]) == 1.0).mean())
    action = np.array(table["action"].to_pylist())[:, :6]
    assert own.idle == pytest.approx((np.abs(action).max(axis=1) <= 0.1).mean())
    assert own.paper_seconds == 6.3


def test_the_nearest_path_and_the_spread_are_root_mean_squares_over_the_phases(made):
    recording = Recording.open(made)
    (own,), paths = statistics_of([recording]), [at_phases(path) for path in paths_of([recording])["domino_single"]]
    apart = [
        min(np.sqrt(((a - b) ** 2).sum(axis=1).mean()) for j, b in enumerate(paths) if j != i)
        for i, a in enumerate(paths)
    ]
    assert own.nearest == pytest.approx(np.median(apart)) and own.least == pytest.approx(min(apart))
    away = np.sqrt(np.mean([((path - np.mean(paths, axis=0)) ** 2).sum(axis=1) for path in paths], axis=0))
    assert np.mean(own.spread) == pytest.approx(away.mean()) and len(away) == PHASES


def test_a_repeated_recording_has_distance_zero(made):
    (twice,) = statistics_of([Recording.open(made), Recording.open(made)])
    assert twice.episodes == 6 and twice.nearest == twice.least == 0.0


def test_a_path_has_its_ends_at_its_ends():
    path = np.column_stack([np.linspace(0, 1, 7), np.arange(7.0)])
    assert np.allclose(at_phases(path)[[0, -1]], path[[0, -1]]) and at_phases(path).shape == (PHASES, 2)


def test_every_task_of_the_paper_has_a_length():
    told = yaml.safe_load((conf_dir() / "paper_lengths.yaml").read_text())
    assert told == paper_lengths() and len(told) == 35 and set(told) <= set(list_tasks())
    assert set(list_tasks()) - set(told) == {"rod_across"}


def test_the_command_writes_a_page_and_json(made, tmp_path, capsys):
    given = ["curate", "stats", f"data={made}", f"to={tmp_path / 'page.html'}", f"json={tmp_path / 'stats.json'}"]
    assert cli.run(given) == 0
    assert "domino_single" in capsys.readouterr().out
    (own,) = json.loads((tmp_path / "stats.json").read_text())
    assert own["episodes"] == 3 and len(own["channels"]) == 7
    assert "data:image/svg+xml" in (tmp_path / "page.html").read_text()


def test_what_cannot_be_measured_is_one_line(made, tmp_path):
    with pytest.raises(PoolError, match="no recording at"):
        Recording.open(tmp_path)
    folder = Path(shutil.copytree(made, tmp_path / "cut"))
    path = folder / "data" / "chunk-000" / "file-000.parquet"
    pq.write_table(pq.read_table(path).drop_columns(["robot0_eef_pos"]), path)
    with pytest.raises(BadConfig, match="are missing: robot0_eef_pos; see scengen curate"):
        statistics_of([Recording.open(folder)])
    assert cli.run(["curate", "stats", f"data={made}", f"to={tmp_path / 'page.pdf'}"]) == 2

"""Pools of any size: what is requested is read, and nothing else."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from helpers import REFERENCE
from hypothesis import given
from hypothesis import strategies as st
from large_pools import synthetic

from scengen import cli
from scengen.cli import tables as report
from scengen.envs.gym import PoolEnv
from scengen.errors import PoolError
from scengen.ood.analysis import redraw
from scengen.ood.analysis.distance import MAX_PAIRS, near_duplicates
from scengen.ood.analysis.space import Batch
from scengen.pictures import sheet
from scengen.pool import Pool, shards, writing
from scengen.pool.directory import Directory
from scengen.pool.library import Library
from scengen.pool.names import NoScenario
from scengen.pool.writing import write_pool, write_rows

N = 1000
SHARD = 400


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    """A thousand scenarios in three shards of ten small groups of rows each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(writing, "SHARD_ROWS", SHARD)
        patch.setattr(writing, "GROUP_ROWS", 40)
        return synthetic(Pool.open(REFERENCE), N, tmp_path_factory.mktemp("large") / "pool").folder


class Touched(list):
    """Columns and number of the rows that are unpacked, batch by batch."""

    def rows(self, *names):
        """Rows of which all these columns were unpacked."""
        return sum(count for columns, count in self if columns >= {*names})


@pytest.fixture
def touched(monkeypatch):
    seen, plain = Touched(), shards._batches

    def batches(file, names, *others):
        for batch in plain(file, names, *others):
            seen.append((frozenset(names), len(batch)))
            yield batch

    monkeypatch.setattr(shards, "_batches", batches)
    return seen


# --- one of many ------------------------------------------------------------------------------------------


def test_every_row_is_found_by_place_id_index_and_name(large):
    of, rows = Pool.open(large), list(Pool.open(large).rows())
    assert len(rows) == len(of) == N and [entry.rows for entry in of.manifest.shards] == [SHARD, SHARD, N - 2 * SHARD]
    for place in (0, 39, 40, 399, 400, 401, 799, 800, N - 1):
        row = rows[place]
        assert of.at(place) == of.row(row.id) == of.row(str(row.name)) == of.of_index(row.index) == row
        np.testing.assert_array_equal(of.at(place).witness, row.witness)
        assert len(of.at(place, witness=False).witness) == 0 and of.name_at(place) == row.name
    assert list(of.some([3, 4, 90, 850])) == [rows[place] for place in (3, 4, 90, 850)]
    assert list(of.columns("id", places=[7, 500])) == [(rows[7].id,), (rows[500].id,)]
    for ask, error in ((lambda: of.at(N), IndexError), (lambda: of.of_index(10**6), PoolError)):
        with pytest.raises(error, match="holds"):
            ask()


def test_one_row_unpacks_one_group_and_no_other(large, touched):
    of = Pool.open(large)
    row = of.at(777)
    assert touched.rows() == touched.rows("witness") == 20  # the 18th of its group: one batch
    _ = of.directory
    touched.clear()
    assert of.row(row.id) == row and of.of_index(row.index) == row and touched.rows() == 40


def test_ids_and_indices_are_read_without_anything_else(large, touched):
    directory = Pool.open(large).directory
    assert len(directory) == N and {names for names, _ in touched} == {frozenset({"id", "index"})}
    assert directory.repeated == ""
    Pool.open(large).kinds("split")
    assert touched[-1][0] == {"split"}


def test_a_mistyped_id_is_told_the_nearest_of_a_thousand(large):
    of = Pool.open(large)
    id_ = of.directory.id(500)
    with pytest.raises(NoScenario, match=f"did you mean '{id_}'"):
        of.row(id_[:6] + "x" + id_[7:])


@given(st.lists(st.text("0123abf", min_size=12, max_size=12), min_size=1, max_size=30), st.text("0123abf", max_size=4))
def test_the_beginning_of_an_id_finds_what_a_scan_finds(ids, start):
    directory = Directory(np.array(ids, "S12"), np.arange(len(ids)))
    first = {id_: place for place, id_ in reversed(list(enumerate(ids)))}
    assert directory.beginning(start) == sorted(place for id_, place in first.items() if id_.startswith(start))
    assert bool(directory.repeated) == (len(first) < len(ids))


def test_a_shard_with_other_rows_than_the_manifest_says_is_told(large, tmp_path):
    other = write_pool(tmp_path / "other", Pool.open(large).manifest.without_files(), Pool.open(large).some(range(5)))
    manifest = other.manifest
    for rows, says in ((4, "more than 4 rows"), (6, "holds 5 rows")):
        told = Pool(other.folder, replace(manifest, shards=(replace(manifest.shards[0], rows=rows),)))
        with pytest.raises(PoolError, match=says):
            _ = told.directory
        with pytest.raises(PoolError, match="5 rows, and the manifest promises"):
            told.at(0)


# --- commands ----------------------------------------------------------------------------------------------


def test_showing_one_scenario_reads_one_witness(large, touched, capsys):
    assert cli.run(["show", f"pool={large}", f"id={Pool.open(large).directory.id(600)}"]) == 0
    assert touched.rows("witness") <= 40 and touched.rows("scene_xml") <= 40


def test_showing_a_pool_reads_no_witness_and_says_what_it_leaves_out(large, touched, capsys, monkeypatch):
    monkeypatch.setattr(report, "LINES", 30)
    assert cli.run(["show", f"pool={large}"]) == 0
    told = " ".join(capsys.readouterr().out.split())  # the title has as many lines as the folder's name needs
    assert f"the first 30 of {N} scenarios" in told and told.count("domino_single/id@") == 30
    assert not touched.rows("witness")


def test_statistics_read_no_witness_and_say_of_what_they_are(large, touched, capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(redraw, "MAX_REDRAWN", 100)
    commands = (["report", "compare"], ["report", "audit"], ["report", f"to={tmp_path / 'r.html'}"])
    for command in commands:
        assert cli.run([*command, f"pool={large}"]) == 0, capsys.readouterr().err
    told = capsys.readouterr().out
    assert told.count("of the first 100 of ") == 2 and "of the first 100 of " in (tmp_path / "r.html").read_text()
    assert not touched.rows("witness")


def test_a_subset_reads_the_witnesses_that_it_takes(large, touched, capsys, tmp_path):
    assert cli.run(["subset", f"pool={large}", "n=3", f"to={tmp_path / 'few'}"]) == 0
    assert 0 < touched.rows("witness") <= 3 * 40 and len(Pool.open(tmp_path / "few").check()) == 3


def test_an_environment_reads_scenes_when_they_are_played(large, touched):
    env = PoolEnv("domino_single", large)
    assert touched.rows("scene_xml") == 20  # those of the first
    ids = env.scenarios
    asked = ({"seed": N + 500}, {}, {"options": {"scenario": ids[3]}})
    for arguments, expected in zip(asked, (ids[500], ids[501], ids[3]), strict=True):
        env.reset(**arguments)
        assert env.row.id == expected
    assert not touched.rows("witness") and touched.rows("scene_xml") <= 4 * 40


def test_an_evaluation_reads_the_scenarios_that_it_plays(large, touched, capsys, tmp_path):
    asked = ["policy=idle", "seeds=2", "rollouts=1", f"to={tmp_path}"]
    assert cli.run(["evaluate", f"pool={large}", *asked]) == 0, capsys.readouterr().err
    assert touched.rows("witness") <= 40 and touched.rows("scene_xml") <= 4 * 40


def test_a_sample_is_verified_without_the_others(large, touched, capsys):
    asked = ["level=replay", "sample=3", "others=skip", "seed=1"]
    assert cli.run(["verify", f"pool={large}", *asked]) == 1  # its scenes are borrowed
    told = capsys.readouterr()
    assert touched.rows("witness") <= 3 * 40 and touched.rows("scene_xml") <= 3 * 40
    assert told.err.count("the scene") == 3 and "0 sound, 3 refuted" in told.out and "author's word" in told.out
    assert cli.run(["verify", f"pool={large}", "others=skip"]) == 2
    assert "give sample=N, too" in capsys.readouterr().err


# --- libraries -----------------------------------------------------------------------------------------------


def test_a_library_holds_every_scenario_once(large):
    of = Pool.open(large)
    both = Library([of, Pool.open(REFERENCE), of])
    assert len(both) == len({*both.directory.ids.tolist()})
    assert both[600] == of.at(600, witness=False) and both.name(600) == of.name_at(600)
    assert [row.id for row in both][:3] == [both.directory.id(k) for k in range(3)]
    assert list(both.of_split("id").columns("index"))[:2] == [(0,), (1,)]


# --- pages ---------------------------------------------------------------------------------------------------


def test_a_page_has_a_limit_and_says_what_it_shows(large, tmp_path, monkeypatch):
    monkeypatch.setattr(sheet, "LARGEST_PAGE", 30_000)
    monkeypatch.setattr(sheet, "thumbnail", lambda *_: "data:," + "x" * 3000)
    of = Pool.open(large)
    sheet.contact_sheet([(of, redraw.task_of(of)), (of, redraw.task_of(of))], tmp_path / "page.html", 500, False)
    text = (tmp_path / "page.html").read_text()
    shown = [int(count) for count in re.findall(r"a sample is shown, the first (\d+)", text)]
    assert len(shown) == 2 and all(2 < count < 10 for count in shown) and text.count("<figure") == sum(shown)
    assert 20_000 < len(text) < 40_000


# --- many near duplicates --------------------------------------------------------------------------------------


def test_near_duplicates_of_a_crowd_come_to_an_end():
    task = redraw.task_of(Pool.open(REFERENCE))
    values = dict(next(Pool.open(REFERENCE).columns("params"))[0])
    rows = ({**values, "x": values["x"] + 1e-9 * k} for k in range(300))
    found = near_duplicates(task, Batch.read(np.array([f"{k:012x}" for k in range(300)], "S12"), rows))
    assert len(found) == MAX_PAIRS


# --- memory ----------------------------------------------------------------------------------------------------


def test_rows_are_written_while_they_come(tmp_path):
    """A file is on disk, but for its last group, before the last row is made."""
    source, seen = Pool.open(REFERENCE).at(0), []

    def rows():
        for k in range(5 * writing.GROUP_ROWS):
            seen.append(sum(path.stat().st_size for path in tmp_path.iterdir()))
            yield replace(source, index=k)

    entry = write_rows(tmp_path / "some.parquet", rows())
    assert seen[-1] > entry.bytes / 2 and [path.name for path in tmp_path.iterdir()] == ["some.parquet"]
    assert pq.read_metadata(tmp_path / "some.parquet").num_row_groups == 5


MEASURED = """
import runpy, sys
try:
    if sys.argv[1] == "-m":
        del sys.argv[:2]
        runpy.run_module(sys.argv[0], run_name="__main__")
    else:
        del sys.argv[0]
        runpy.run_path(sys.argv[0], run_name="__main__")
finally:
    status = open("/proc/self/status").read()
    print("kB at most:", status.partition("VmHWM:")[2].split()[0], file=sys.stderr)
"""
"""Runs a module or a file, and tells the largest memory: that of its own, not of the process that started it."""


@pytest.mark.slow
def test_thirty_thousand_rows_stay_within_memory(tmp_path):
    """Written, looked at and played. Rows that are kept would take 60 kB each: 1800 MB."""
    tool, folder, played = Path(__file__).parents[1] / "tools" / "large_pools.py", tmp_path / "pool", tmp_path / "e"
    for command in (
        [str(tool), "write", str(REFERENCE), "30000", str(folder)],
        ["-m", "scengen", "show", f"pool={folder}"],
        ["-m", "scengen", "compare", f"pool={folder}"],
        ["-m", "scengen", "evaluate", f"pool={folder}", "policy=idle", "seeds=1", "rollouts=1", f"to={played}"],
    ):
        done = subprocess.run([sys.executable, "-c", MEASURED, *command], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert int(re.search(r"kB at most: (\d+)", done.stderr)[1]) < 450_000, command

"""Shards are written while a run goes on, and nothing of them is lost or written twice."""

from dataclasses import replace

import pytest
from helpers import REFERENCE

from scengen.pool import Pool, writing
from scengen.pool.writing import write_pool
from scengen.runs.filling import Filling, moved_shards
from scengen.runs.journal import Journal, Record

SOURCE = Pool.open(REFERENCE)


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A journal, what is known of its indices, and what adds to both."""
    monkeypatch.setattr(writing, "SHARD_ROWS", 2)
    journal, records = Journal(tmp_path / "pool", {}), {}

    def add(index, verdict="certified"):
        row = replace(SOURCE.at(index % len(SOURCE)), index=index)
        record = Record(index, verdict, "", "", 1, {}, row if verdict == "certified" else None, 0.0)
        journal.add(record)
        records[index] = record.light()

    yield journal, records, add
    journal.close()


def written(journal):
    return sorted(path.name for path in journal.folder.glob("*.parquet"))


def test_a_shard_is_written_as_soon_as_no_earlier_index_is_open(run):
    journal, records, add = run
    filling = Filling(journal, n=5)
    for index, count in ((1, 0), (3, 0), (0, 1), (4, 1)):
        add(index)
        filling.follow(records)
        assert len(written(journal)) == count
    add(2, "refuted")
    filling.follow(records)
    assert written(journal) == ["scenarios-00000.parquet", "scenarios-00001.parquet"]
    assert not (journal.folder.parent / "pool").exists()
    for index in (5, 6, 7):  # the pool has five: the last one starts a shard that is never full
        add(index)
        filling.follow(records)
    assert len(written(journal)) == 2


def test_the_pool_is_that_of_a_run_that_writes_all_at_the_end(run, tmp_path):
    journal, records, add = run
    filling = Filling(journal, n=5)
    for index in range(5):
        add(index)
        filling.follow(records)
    folder, certified = tmp_path / "pool", list(range(5))
    ready = moved_shards(journal, certified, folder)
    assert len(ready) == 2 and not written(journal)
    made = write_pool(folder, SOURCE.manifest.without_files(), journal.rows(certified[4:]), (), ready)
    whole = write_pool(tmp_path / "whole", SOURCE.manifest.without_files(), journal.rows(certified))
    assert made.check().sha256 == whole.sha256
    assert moved_shards(journal, certified, folder) == ready  # the run was killed before the manifest was written


def test_what_stands_there_already_is_not_written_again_and_what_is_damaged_is_left_out(run, tmp_path):
    journal, records, add = run
    for index in range(4):
        add(index)
    Filling(journal, n=4).follow(records)
    times = [(journal.folder / name).stat().st_mtime_ns for name in written(journal)]
    Filling(journal, n=4).follow(records)
    assert [(journal.folder / name).stat().st_mtime_ns for name in written(journal)] == times
    last = journal.folder / "scenarios-00001.parquet"
    last.write_bytes(last.read_bytes()[:-1])
    assert [entry.file for entry in moved_shards(journal, [0, 1, 2, 3], tmp_path / "pool")] == [
        "scenarios-00000.parquet"
    ]
    assert moved_shards(journal, [0, 2, 3], tmp_path / "pool") == []  # other scenarios than were written


def test_a_record_takes_little_memory():
    record = Record(7, "certified", "", "", 1, {}, None, 0.0)
    assert not hasattr(record, "__dict__") and record.light().infeasible is replace(record, index=8).light().infeasible

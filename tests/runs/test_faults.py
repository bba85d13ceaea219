"""Faults of the machine: a disk that is full, read-only, locked or damaged, and being told to stop."""

import errno
import json
import os
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest
from pools import QUICKLY, make

from scengen import cli
from scengen.cli import program
from scengen.errors import ScengenError
from scengen.pool import Pool
from scengen.runs import attempts, generate
from scengen.runs.journal import Journal, Record
from scengen.work.log import Log
from scengen.work.targets import try_folder

RECORD = Record(0, "refuted", "rest", "it falls", 1, {}, None, 0.1)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A pool of one scenario and its run."""
    folder = tmp_path_factory.mktemp("faults") / "pool"
    make(folder, n=1)
    return folder


def command(folder, *more):
    return ("generate", "task=domino_single", *QUICKLY, "n=1", f"pool={folder}", *more)


def said(capsys, *argv):
    status = cli.run(argv)
    return status, capsys.readouterr().err


class Refusing:
    """A connection to SQLite that fails at a statement as SQLite itself would."""

    def __init__(self, db, code):
        self.db, self.code = db, code

    def execute(self, query, *values):
        if query.startswith(("INSERT", "SELECT")):
            error = sqlite3.OperationalError("as told")
            error.sqlite_errorcode = self.code
            raise error
        return self.db.execute(query, *values)

    def __enter__(self):
        return self.db.__enter__()

    def __exit__(self, *what):
        return self.db.__exit__(*what)

    def close(self):
        self.db.close()


TOLD = {
    sqlite3.SQLITE_FULL: "the disk is full; make room",
    sqlite3.SQLITE_IOERR_WRITE: "the disk is full or faulty",
    sqlite3.SQLITE_READONLY_DBMOVED: "is read-only; make it and its folder writable",
    sqlite3.SQLITE_BUSY_SNAPSHOT: "is in use by another program; wait",
    sqlite3.SQLITE_CORRUPT_INDEX: "is damaged; move its folder aside (do not delete it)",
    sqlite3.SQLITE_NOTADB: "is damaged; move its folder aside (do not delete it)",
}


@pytest.mark.parametrize("code", TOLD)
def test_every_fault_of_a_journal_has_its_own_remedy(tmp_path, code):
    journal = Journal(tmp_path / "pool", {"config": 1})
    journal.add(RECORD)
    journal._db = Refusing(journal._db, code)
    for ask in (lambda: journal.add(RECORD), journal.records, lambda: list(journal.rows([0]))):
        with pytest.raises(ScengenError) as caught:
            ask()
        text = str(caught.value)
        assert TOLD[code] in text and ("damaged" in text) == ("damaged" in TOLD[code]) and "\n" not in text
        assert "remove" not in text and ("is kept" in text) != ("damaged" in text)
    journal.close()


def test_a_locked_journal_is_told_and_left_alone(finished, tmp_path, capsys, monkeypatch):
    folder = tmp_path / "pool"
    shutil.copytree(finished.with_name("pool.run"), tmp_path / "pool.run")
    connect = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", lambda path: connect(path, timeout=0.05))
    other = connect(tmp_path / "pool.run" / "journal.sqlite")
    other.execute("PRAGMA locking_mode=EXCLUSIVE")
    other.execute("BEGIN EXCLUSIVE")
    status, err = said(capsys, *command(folder))
    other.close()
    assert status == 2 and "in use by another program" in err and err.count("\n") == 1
    assert cli.run(command(folder)) == 0 and Pool.open(folder).sha256 == Pool.open(finished).sha256


@pytest.mark.parametrize("how", ["cut", "noise", "a page", "no JSON", "a record"])
def test_a_damaged_journal_is_told_and_kept(finished, tmp_path, capsys, how):
    run = tmp_path / "pool.run"
    shutil.copytree(finished.with_name("pool.run"), run)
    path = run / "journal.sqlite"
    content = path.read_bytes()
    if how == "cut":
        path.write_bytes(content[:5000])
    elif how == "noise":
        path.write_bytes(b"\x07" * len(content))
    elif how == "a page":
        path.write_bytes(content[:4096] + b"\xff" * (len(content) - 4096))
    else:
        change = "UPDATE run SET identity = '{'" if how == "no JSON" else "UPDATE record SET body = '[1]'"
        with sqlite3.connect(path) as db:
            db.execute(change)
        db.close()
    before = path.read_bytes()
    status, err = said(capsys, *command(tmp_path / "pool"))
    assert status == 2 and "is damaged; move its folder aside (do not delete it)" in err and err.count("\n") == 1
    assert path.read_bytes() == before and not (tmp_path / "pool").exists()


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (errno.ENOSPC, "make room"),
        (errno.EROFS, "the place is read-only"),
        (errno.EACCES, "make it writable"),
        (errno.EIO, "the disk has a fault"),
        (errno.EDQUOT, "make room"),
    ],
)
def test_a_pool_that_cannot_be_finished_keeps_its_run(finished, tmp_path, capsys, monkeypatch, code, says):
    shutil.copytree(finished.with_name("pool.run"), tmp_path / "pool.run")
    with monkeypatch.context() as patch:

        def fail(*_):
            raise OSError(code, os.strerror(code))

        patch.setattr(generate.writing, "write_pool", fail)
        status, err = said(capsys, *command(tmp_path / "pool"))
    assert status == 2 and says in err and "finished work is kept" in err and err.count("\n") == 1
    assert cli.run(command(tmp_path / "pool")) == 0
    assert Pool.open(tmp_path / "pool").sha256 == Pool.open(finished).sha256


def test_a_place_that_cannot_be_written_is_told_before_the_work(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(attempts, "each", None)  # nothing is certified
    (tmp_path / "file").write_text("")
    for pool in (
        tmp_path / "file",
        tmp_path / "file" / "pool",
        Path("/dev/full"),
        Path("/proc/pool"),
        tmp_path / ("p" * 300),
        Path("."),
    ):
        status, err = said(capsys, *command(pool))
        assert status == 2 and err.startswith("scengen: ") and err.count("\n") == 1 and "unforeseen" not in err
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_runs_that_begin_in_the_same_new_folder_do_not_disturb_each_other(tmp_path):
    def begin(pool):
        together.wait()
        try_folder(pool)
        pool.mkdir(parents=True, exist_ok=True)

    for k in range(20):
        together = threading.Barrier(2)
        with ThreadPoolExecutor(2) as threads:
            list(threads.map(begin, [tmp_path / f"{k}" / "a", tmp_path / f"{k}" / "b"]))
        assert sorted(path.name for path in (tmp_path / f"{k}").iterdir()) == ["a", "b"]
    assert len(list(tmp_path.iterdir())) == 20


def test_a_refused_run_leaves_no_folder(finished, tmp_path, capsys):
    shutil.copytree(finished, tmp_path / "pool")
    status, err = said(capsys, *command(tmp_path / "pool"))
    assert status == 2 and "journal is gone" in err and not (tmp_path / "pool.run").exists()


def test_a_log_loses_nothing_to_a_full_disk(tmp_path):
    path = tmp_path / "log.jsonl"
    with Log(path, {"a": 1}) as log:
        log.add({"n": 0})
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 10, hard))
        try:
            with pytest.raises(ScengenError, match="cannot be written: file too large"):
                log.add({"n": 1, "text": "x" * 100})
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    with Log(path, {"a": 1}) as log:
        assert log.records == [{"n": 0}]
        log.add({"n": 1})
    assert [json.loads(line) for line in path.read_text().splitlines()] == [{"a": 1}, {"n": 0}, {"n": 1}]


def test_a_damaged_log_is_kept(tmp_path):
    path = tmp_path / "log.jsonl"
    for content in ('{"a": 1}\n{"n": \n', "[1]\n", "\x00\n"):
        path.write_text(content)
        with pytest.raises(ScengenError, match="is damaged; move it aside"), Log(path, {"a": 1}):
            pass
        assert path.read_text() == content


def started(folder, *more, limit=None):
    """A run in a process group of its own."""

    def prepare():
        os.setsid()
        if limit:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    argv = [sys.executable, "-m", "scengen", *command(folder, *more)]
    return subprocess.Popen(argv, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=prepare)


def alive(group):
    """Processes of a group that still run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, pgrp = stat.read_text().rpartition(")")[2].split()[:3]
            if int(pgrp) == group and state != "Z":
                found.append((stat.parent / "cmdline").read_text().replace("\0", " "))
    return found


def begun(folder, seconds=60.0):
    """Wait until a run has opened its journal."""
    end = time.monotonic() + seconds
    while not folder.with_name(folder.name + ".run").joinpath("journal.sqlite-wal").exists():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_run_in_time_and_in_one_line(tmp_path, number, status):
    process = started(tmp_path / "pool", "workers=2")
    begun(tmp_path / "pool")
    time.sleep(0.3)
    start = time.monotonic()
    os.killpg(process.pid, number)
    _, err = process.communicate(timeout=30)
    assert time.monotonic() - start < 3.0  # of which 2 s are promised, on a machine that does nothing else
    assert process.returncode == status and "Traceback" not in err
    assert [line for line in err.splitlines() if "interrupted" in line] == err.splitlines()
    time.sleep(0.5)
    assert not alive(process.pid)


def test_two_signals_end_it_at_once(tmp_path):
    process = started(tmp_path / "pool", "workers=2")
    begun(tmp_path / "pool")
    os.kill(process.pid, signal.SIGINT)
    time.sleep(0.1)
    if process.poll() is None:
        os.kill(process.pid, signal.SIGINT)
    start = time.monotonic()
    _, err = process.communicate(timeout=30)
    assert process.returncode in (130, -signal.SIGINT) and time.monotonic() - start < 2.0 and "Traceback" not in err
    assert not alive(process.pid)


@pytest.mark.parametrize("after", [0.3, 0.7])
def test_an_interrupt_during_the_imports_is_no_traceback(tmp_path, after):
    process = started(tmp_path / "pool")
    time.sleep(after)
    while process.poll() is None:  # Python itself swallows one that comes while it starts; people press again
        process.send_signal(signal.SIGINT)
        time.sleep(0.5)
    _, err = process.communicate(timeout=30)
    assert process.returncode in (130, -signal.SIGINT) and err.count("Traceback") <= (process.returncode < 0)


def test_an_error_in_the_cleaning_up_after_an_interrupt_is_told_as_the_interrupt(monkeypatch, capsys):
    def broken(*_):
        raise AttributeError("'NoneType' object has no attribute '_invalidate_flags_cache'")

    monkeypatch.setattr(program, "_run", broken)
    told = [cli.run(["generate"], SimpleNamespace(received=received)) for received in (True, False)]
    lines = capsys.readouterr().err.splitlines()
    assert told == [130, 2] and "interrupted; finished work is kept" in lines[0] and "unforeseen" in lines[1]


@pytest.mark.slow
def test_a_limit_on_files_is_one_line_and_the_run_goes_on_afterwards(finished, tmp_path):
    folder = tmp_path / "pool"
    process = started(folder, limit=36_000)
    _, err = process.communicate(timeout=120)
    told = [line for line in err.splitlines() if line.startswith("scengen:")]
    assert process.returncode == 2 and len(told) == 1 and "Traceback" not in err and "damaged" not in err
    assert not list(tmp_path.rglob("*.part"))
    assert cli.run(command(folder)) == 0 and Pool.open(folder).sha256 == Pool.open(finished).sha256


def test_a_run_that_loses_every_scenario_ends_and_says_why(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(attempts, "MAX_LOST", 2)
    slow = ("limit_seconds=1", "certify.robust.runs=500")
    assert cli.run(["generate", "task=domino_single", "n=3", *slow, f"pool={tmp_path / 'pool'}"]) == 2
    told = "2 scenarios in a row have no verdict, the last because it took longer than 1 s"
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("separate", [False, True])
def test_a_sorted_log_does_not_tell_when_records_were_added(tmp_path, separate):
    contents = []
    for name, numbers in (("a", (2, 1, 3)), ("b", (3, 2, 1))):
        head = tmp_path / f"{name}.json" if separate else None
        with Log(tmp_path / f"{name}.jsonl", {"of": 3}, head=head) as log:
            for number in numbers:
                log.add({"number": number})
            log.sort(lambda record: record["number"])
            log.add({"number": 4})
        contents.append((tmp_path / f"{name}.jsonl").read_text().splitlines())
    assert contents[0] == contents[1] and len(contents[0]) == 4 + (not separate)
    with Log(tmp_path / "a.jsonl", {"of": 3}, head=tmp_path / "a.json" if separate else None) as log:
        assert [record["number"] for record in log.records] == [1, 2, 3, 4]

"""The journal of a run: a record for every index. A run may be killed at any moment and continued."""

import json
import shutil
import sqlite3
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, nullcontext
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from ..errors import PoolError
from ..pool import PoolRow
from ..pool.kinds import check_target
from ..pool.manifest import MANIFEST, FileEntry
from ..pool.row import SceneRow
from ..sim.embodiment import action_size
from ..work.log import different
from ..work.targets import move_aside, refused, try_folder


@dataclass(frozen=True, slots=True)
class Record:
    """Result of one index, or of one attempt at a demonstration."""

    index: int
    verdict: str
    check: str
    """The first check that failed; empty if there is none."""
    reason: str
    proposals: int
    """Number of draws for this index, infeasible ones included."""
    infeasible: dict[str, int]
    """Number of infeasible draws by reason."""
    row: SceneRow | None
    """The scenario or demonstration, if it goes into the pool or is kept on request; None in the records of
    `Journal.records`."""
    cpu: float
    """Processor time spent [s]; differs from run to run and stays out of the pool."""

    def light(self) -> "Record":
        """The record without its row, its words shared with all other records: a million of them take 400 MB."""
        words = {name: sys.intern(getattr(self, name)) for name in ("verdict", "check", "reason")}
        return replace(self, row=None, infeasible=self.infeasible or NONE_INFEASIBLE, **words)


NONE_INFEASIBLE: dict[str, int] = {}
"""Infeasible draws of an index that had none, shared by all such records."""


class Journal:
    """Records of one run in an SQLite file next to the pool, or another folder of rows. One writer at a time."""

    def __init__(
        self,
        pool: Path,
        identity: Mapping[str, Any],
        manifest: str = MANIFEST,
        kind: type[SceneRow] = PoolRow,
        setting: str = "pool",
    ):
        """Start or continue the run that makes `pool`.

        Args:
            identity: all settings that the scenarios depend on.
            manifest: name of the file that a finished folder has.
            kind: class of the rows.
            setting: name of the setting that names the folder, for errors.

        Raises:
            ScengenError: the pool cannot be written, another run is writing it, or a run of another identity was
                started.
        """
        if not pool.name or pool.name == "..":
            raise PoolError(f"{pool} cannot become a pool; name a folder of its own with {setting}=")
        check_target(pool, manifest, setting)
        try_folder(pool)
        self.folder, self._kind, self._setting = _run_of(pool), kind, setting
        self._path = self.folder / JOURNAL
        if (pool / manifest).exists() and not self._path.exists():
            raise PoolError(f"{pool} is finished and its run's journal is gone; choose another {setting}=")
        new = not self.folder.exists()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = FileLock(self.folder / "lock")
            self._lock.acquire(timeout=0)
        except Timeout:
            raise PoolError(f"another run is writing {pool}; wait for it or choose another {setting}=") from None
        except OSError as error:
            raise refused(self.folder, error) from None
        try:
            self._open(pool, identity)
        except BaseException:
            self._lock.release()
            if new:
                shutil.rmtree(self.folder, ignore_errors=True)
            raise

    def _open(self, pool: Path, identity: Mapping[str, Any]) -> None:
        text = json.dumps(identity, sort_keys=True)
        with self._reported_faults():
            self._db = sqlite3.connect(self._path)
            self._db.execute("PRAGMA journal_mode=WAL")
            self._db.execute("CREATE TABLE IF NOT EXISTS run (identity TEXT)")
            self._db.execute("CREATE TABLE IF NOT EXISTS shard (number INTEGER PRIMARY KEY, key TEXT, entry TEXT)")
            self._db.execute(
                "CREATE TABLE IF NOT EXISTS record"
                " (idx INTEGER PRIMARY KEY, body TEXT, scene TEXT, actions BLOB, cpu REAL)"
            )
            begun = self._db.execute("SELECT identity FROM run").fetchone()
            before = json.loads(begun[0]) if begun else None
            if before is None:
                with self._db:
                    self._db.execute("INSERT INTO run VALUES (?)", (text,))
        if before is not None and begun[0] != text:
            differs = ", ".join(different(before, json.loads(text)))
            raise PoolError(
                f"{pool} was started with other settings ({differs}); give fresh=true to move it aside and start over, "
                f"or choose another {self._setting}="
            )

    def records(self) -> dict[int, Record]:
        """All records so far by index, without their rows, which do not fit into memory in a large run."""
        with self._reported_faults():
            found = self._db.execute("SELECT body, cpu FROM record ORDER BY idx")
            return {r.index: r for r in (Record(**json.loads(body), row=None, cpu=cpu).light() for body, cpu in found)}

    def rows(self, indices: Iterable[int]) -> Iterator[Any]:
        """The stored rows of some indices, one after the other."""
        for index in indices:
            with self._reported_faults():
                query = "SELECT scene, actions FROM record WHERE idx = ?"
                scene, actions = self._db.execute(query, (index,)).fetchone()
                plain = json.loads(scene)
                size = action_size(plain["embodiment"])
                row = self._kind.of(plain, np.frombuffer(actions, np.float32).reshape(-1, size))
            yield row

    def add(self, record: Record) -> None:
        """Store one record. It is on disk when this returns."""
        body = {f.name: getattr(record, f.name) for f in fields(record) if f.name not in ("row", "cpu")}
        scene, actions = None, None
        if record.row is not None:
            scene = json.dumps(record.row.plain())
            actions = np.asarray(record.row.witness, np.float32).tobytes()
        with self._reported_faults(), self._db:
            self._db.execute(
                "INSERT OR REPLACE INTO record VALUES (?, ?, ?, ?, ?)",
                (record.index, json.dumps(body), scene, actions, record.cpu),
            )

    def add_shard(self, number: int, key: str, entry: FileEntry) -> None:
        """Remember that a shard was written.

        Args:
            key: hash of its scenarios.
            entry: entry of the shard in a manifest.
        """
        with self._reported_faults(), self._db:
            self._db.execute("INSERT OR REPLACE INTO shard VALUES (?, ?, ?)", (number, key, json.dumps(asdict(entry))))

    def shard(self, number: int, key: str) -> FileEntry | None:
        """Entry of a shard that was written; None if there is none with these scenarios."""
        with self._reported_faults():
            found = self._db.execute("SELECT entry FROM shard WHERE number = ? AND key = ?", (number, key)).fetchone()
            return FileEntry(**json.loads(found[0])) if found else None

    @contextmanager
    def _reported_faults(self) -> Iterator[None]:
        """Report faults, and distinguish a damaged journal, which is useless, from one that cannot be reached.

        Raises:
            PoolError: one line with the remedy.
        """
        try:
            yield
        except sqlite3.Error as error:
            code = getattr(error, "sqlite_errorcode", 0) & 0xFF  # the other bits are details
            raise PoolError(f"{self._path} {_FAULT.get(code) or f'gives an error ({error}); {_KEPT}'}") from None
        except (ValueError, TypeError, KeyError):
            raise PoolError(f"{self._path} {_DAMAGED}") from None

    def close(self) -> None:
        self._db.close()
        self._lock.release()


_KEPT = "finished work is kept, repeat the command to continue"
_DAMAGED = "is damaged; move its folder aside (do not delete it) and repeat the command to start again"
_READ_ONLY = f"is read-only; make it and its folder writable, {_KEPT}"
_IN_USE = f"is in use by another program; wait for it, {_KEPT}"
_FAULT = {
    sqlite3.SQLITE_FULL: f"cannot grow, the disk is full; make room, {_KEPT}",
    sqlite3.SQLITE_IOERR: f"cannot be read or written, the disk is full or faulty; make room or repair it, {_KEPT}",
    sqlite3.SQLITE_READONLY: _READ_ONLY,
    sqlite3.SQLITE_PERM: _READ_ONLY,
    sqlite3.SQLITE_CANTOPEN: f"cannot be opened; see that its folder is writable and the disk has room, {_KEPT}",
    sqlite3.SQLITE_BUSY: _IN_USE,
    sqlite3.SQLITE_LOCKED: _IN_USE,
    sqlite3.SQLITE_CORRUPT: _DAMAGED,
    sqlite3.SQLITE_NOTADB: _DAMAGED,
}
"""Fault of a journal and its remedy, by SQLite's primary result code."""


def begun(pool: Path) -> int:
    """Number of indices, or attempts, that earlier runs have finished for a pool."""
    path = _run_of(pool) / JOURNAL
    if not path.is_file():
        return 0
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as db:
            return db.execute("SELECT count(*) FROM record").fetchone()[0]
    except sqlite3.Error:
        return 0  # opening it to write says what is wrong


def start_over(pool: Path, manifest: str = MANIFEST, setting: str = "pool") -> list[Path]:
    """Move a pool, and the run that made it, aside, so that another run can start in their place.

    Args:
        manifest: see `Journal`.
        setting: see `Journal`.

    Returns:
        New names of what was moved.

    Raises:
        ScengenError: the folder is something else, or a run is writing it.
    """
    check_target(pool, manifest, setting)
    run = _run_of(pool)
    try:
        with FileLock(run / "lock", timeout=0) if run.exists() else nullcontext():
            pass
    except Timeout:
        raise PoolError(f"another run is writing {pool}; wait for it, and start over then") from None
    except OSError as error:
        raise refused(run, error) from None
    return move_aside(*(path for path, mark in ((pool, manifest), (run, JOURNAL)) if (path / mark).exists()))


def _run_of(pool: Path) -> Path:
    """Folder of the run that makes a pool."""
    return pool.with_name(pool.name + ".run")


JOURNAL = "journal.sqlite"
"""Name of the journal in the folder of a run."""

"""The memory of a run: what became of every index, kept safe against being killed at any moment."""

import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from ..errors import PoolError
from ..pool import PoolRow


@dataclass(frozen=True)
class Record:
    """What became of one index."""

    index: int
    verdict: str
    check: str
    """The first check that failed; empty for a certified scenario."""
    reason: str
    proposals: int
    """Draws made for this index, infeasible ones included."""
    infeasible: dict[str, int]
    """Infeasible draws by reason."""
    row: PoolRow | None
    """The scenario, if it goes into the pool or is kept on request; None in what `Journal.records` gives."""
    cpu: float
    """Processor time spent [s]; differs from run to run and stays out of the pool."""


class Journal:
    """Records of one run in an SQLite file beside the pool. One writer at a time."""

    def __init__(self, pool: Path, identity: Mapping[str, Any]):
        """Open or continue the run that makes `pool`.

        Args:
            identity: everything that the scenarios depend on.

        Raises:
            PoolError: another run holds the pool, or a run with another identity was begun there.
        """
        self.folder = pool.with_name(pool.name + ".run")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = FileLock(self.folder / "lock")
            self._lock.acquire(timeout=0)
        except Timeout:
            raise PoolError(f"another run is writing {pool}; wait for it or choose another pool=") from None
        except OSError as error:
            raise PoolError(f"{pool} cannot be written: {error.strerror}; choose another pool=") from None
        try:
            self._open(pool, identity)
        except BaseException:
            self._lock.release()
            raise

    def _open(self, pool: Path, identity: Mapping[str, Any]) -> None:
        path = self.folder / "journal.sqlite"
        text = json.dumps(identity, sort_keys=True)
        try:
            self._db = sqlite3.connect(path)
            self._db.execute("PRAGMA journal_mode=WAL")
            self._db.execute("CREATE TABLE IF NOT EXISTS run (identity TEXT)")
            self._db.execute(
                "CREATE TABLE IF NOT EXISTS record"
                " (idx INTEGER PRIMARY KEY, body TEXT, scene TEXT, actions BLOB, cpu REAL)"
            )
            begun = self._db.execute("SELECT identity FROM run").fetchone()
        except sqlite3.DatabaseError:
            raise PoolError(f"{path} is damaged; remove {self.folder} to begin again") from None
        if begun is None:
            if (pool / "manifest.json").exists():
                raise PoolError(f"{pool} is finished and its run's journal is gone; choose another pool=")
            with self._db:
                self._db.execute("INSERT INTO run VALUES (?)", (text,))
        elif begun[0] != text:
            differs = ", ".join(_different(json.loads(begun[0]), dict(identity)))
            raise PoolError(
                f"{pool} was begun with other settings ({differs}); choose another pool= or remove it and {self.folder}"
            )

    def records(self) -> dict[int, Record]:
        """All records so far by index, without their rows: those of a large run do not fit into memory."""
        found = self._db.execute("SELECT body, cpu FROM record ORDER BY idx")
        return {r.index: r for r in (Record(**json.loads(body), row=None, cpu=cpu) for body, cpu in found)}

    def rows(self, indices: Iterable[int]) -> Iterator[PoolRow]:
        """The stored scenarios of these indices, one after the other."""
        for index in indices:
            scene, actions = self._db.execute("SELECT scene, actions FROM record WHERE idx = ?", (index,)).fetchone()
            yield PoolRow.of(json.loads(scene), np.frombuffer(actions, np.float32).reshape(-1, 7))

    def add(self, record: Record) -> None:
        """Store one record; once this returns it survives a kill."""
        body = {f.name: getattr(record, f.name) for f in fields(record) if f.name not in ("row", "cpu")}
        scene, actions = None, None
        if record.row is not None:
            scene = json.dumps(record.row.plain())
            actions = np.asarray(record.row.witness, np.float32).tobytes()
        with self._db:
            self._db.execute(
                "INSERT OR REPLACE INTO record VALUES (?, ?, ?, ?, ?)",
                (record.index, json.dumps(body), scene, actions, record.cpu),
            )

    def close(self) -> None:
        self._db.close()
        self._lock.release()


def _different(a: Any, b: Any, path: str = "") -> list[str]:
    """Dotted names of the settings in which two configurations differ."""
    if isinstance(a, dict) and isinstance(b, dict):
        keys = sorted(a.keys() | b.keys())
        return [d for k in keys for d in _different(a.get(k), b.get(k), f"{path}.{k}".strip("."))]
    return [] if a == b else [path]

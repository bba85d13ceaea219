"""Log of a long run, one result per line: it survives a kill, and a repeated run continues from it."""

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from filelock import FileLock, Timeout

from ..errors import BadConfig
from .plain import MAX_JOURNAL, read_plain
from .targets import refused, write

FRESH = "give fresh=true to move them aside, or choose another to="
"""Remedy of a command that can start over."""


def recorded(path: Path) -> int:
    """Number of records in a log whose first line is its identity, which may be another one; 0 if there is none."""
    return max(0, len(path.read_bytes().splitlines()) - 1) if path.is_file() else 0


class Log:
    """Plain records in a file, after a first line that says what they depend on. One writer at a time."""

    def __init__(
        self,
        path: Path,
        identity: Mapping[str, Any],
        remedy: str = "choose another to=",
        head: Path | None = None,
        replaces: bool = False,
    ):
        """
        Args:
            identity: settings on which the records depend; records with another identity are not touched.
            remedy: remedy in the error about such records.
            head: a separate file for the identity, which then is not the first line.
            replaces: whether records of an earlier run are removed.
        """
        self.path, self.identity, self.remedy, self.head = path, dict(identity), remedy, head
        self.replaces = replaces
        self.records: list[dict[str, Any]] = []
        self._lock = FileLock(path.with_suffix(".lock"))

    def __enter__(self) -> "Log":
        """Open the file, or continue it.

        Raises:
            BadConfig: another run is writing, or wrote something else, or the folder cannot be written.
        """
        folder = self.path.parent
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock.acquire(timeout=0)
        except Timeout:
            raise BadConfig(f"another run is writing {folder}; wait for it, or name another folder") from None
        except OSError as error:
            raise refused(folder, error) from None
        try:
            self._open()
        except OSError as error:
            self._lock.release()
            raise refused(self.path, error) from None
        except BaseException:
            self._lock.release()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
        self._lock.release()

    def add(self, record: dict[str, Any]) -> None:
        """Store a record. It survives a kill as soon as this returns."""
        try:
            self._write(record)
        except OSError as error:
            raise refused(self.path, error) from None
        self.records.append(record)

    def sort(self, key: Callable[[dict[str, Any]], Any]) -> None:
        """Bring the records into an order that does not depend on when they were added."""
        if (there := sorted(self.records, key=key)) != self.records:
            self.replace(there)

    def replace(self, records: list[dict[str, Any]]) -> None:
        """Replace all records, at once or not at all."""
        lines = records if self.head else [self.identity, *records]
        write(self.path, b"".join(json.dumps(line).encode() + b"\n" for line in lines))
        self._file.close()
        self._file = open(self.path, "ab", buffering=0)  # noqa: SIM115  (closed by `close`)
        self.records = records

    def _open(self) -> None:
        """Read the file and prepare it for more records. A line that a kill has cut short is dropped."""
        for path in (self.path, self.head) if self.replaces else ():
            if path is not None:
                path.unlink(missing_ok=True)
        try:
            content = read_plain(self.path, MAX_JOURNAL) if os.path.lexists(self.path) else b""
        except ValueError as error:
            why = f"cannot be continued: {error}; move it aside, or name another folder"
            raise BadConfig(f"{self.path} {why}") from None
        size = content.rfind(b"\n") + 1
        try:
            whole = [json.loads(line) for line in content[:size].splitlines()]
            if not all(isinstance(record, dict) for record in whole):
                raise ValueError("a record is not a mapping")
        except (ValueError, RecursionError):
            why = "is damaged; move it aside (do not delete it) to start over, or name another folder"
            raise BadConfig(f"{self.path} {why}") from None
        stored = self._stored_identity(whole)
        if whole and stored != self.identity:
            names = ", ".join(different(stored, self.identity))
            raise BadConfig(f"{self.path.parent} holds results of other pools or settings ({names}); {self.remedy}")
        self.records = whole[1:] if self.head is None else whole
        if self.head is not None and stored != self.identity:
            write(self.head, json.dumps(self.identity, indent=1, sort_keys=True) + "\n")
        self._file = open(self.path, "ab", buffering=0)  # noqa: SIM115  (closed by `close`)
        self._file.truncate(size)
        if not whole and self.head is None:
            self._write(self.identity)

    def _stored_identity(self, whole: list[dict[str, Any]]) -> Any:
        """What the records of the file depend on; None if nothing says it."""
        if self.head is None:
            return whole[0] if whole else None
        try:
            return json.loads(read_plain(self.head))
        except (ValueError, OSError):
            return None

    def _write(self, record: Mapping[str, Any]) -> None:
        """Append a whole line, or nothing.

        Raises:
            OSError: there is no room for it, for instance.
        """
        line, size = json.dumps(record).encode() + b"\n", self._file.tell()
        try:
            while line:  # a disk that fills up takes a part first and refuses the rest
                line = line[self._file.write(line) :]
        except OSError:
            self._file.truncate(size)
            raise


def different(a: Any, b: Any, path: str = "") -> list[str]:
    """Dotted names of the settings in which two configurations differ; the code of a task by this name."""
    if isinstance(a, dict) and isinstance(b, dict):
        keys = sorted(a.keys() | b.keys())
        return [d for k in keys for d in different(a.get(k), b.get(k), f"{path}.{k}".strip("."))]
    return [] if a == b else ["the code of the task" if path == "source_sha256" else path]

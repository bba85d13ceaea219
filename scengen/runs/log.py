"""Results of long work in a file, one per line: safe against a kill, and the memory of a run that goes on."""

import json
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from filelock import FileLock, Timeout

from ..errors import BadConfig


class Log:
    """Plain records in `path`, after a first line that says what they depend on. One writer at a time."""

    def __init__(self, path: Path, identity: Mapping[str, Any]):
        self.path, self.identity = path, dict(identity)
        self.records: list[dict[str, Any]] = []
        self._lock = FileLock(path.with_suffix(".lock"))

    def __enter__(self) -> "Log":
        """Open or continue.

        Raises:
            BadConfig: another run is writing, or wrote something else, or the folder cannot be written.
        """
        folder = self.path.parent
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock.acquire(timeout=0)
        except Timeout:
            raise BadConfig(f"another run is writing {folder}; wait for it or choose another to=") from None
        except OSError as error:
            raise BadConfig(f"{folder} cannot be written: {error.strerror}; choose another to=") from None
        try:
            self._file = self._opened()
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
        """Store one; once this returns it survives a kill."""
        self._file.write(json.dumps(record) + "\n")
        self._file.flush()
        self.records.append(record)

    def _opened(self) -> Any:
        """The file, ready for more; a line that a kill cut short is dropped."""
        lines = self.path.read_text().splitlines(keepends=True) if self.path.exists() else []
        try:
            whole = [json.loads(line) for line in lines if line.endswith("\n")]
        except ValueError:
            raise BadConfig(f"{self.path} is damaged; remove it to begin again, or choose another to=") from None
        if whole and whole[0] != self.identity:
            raise BadConfig(f"{self.path.parent} holds results of other pools or settings; choose another to=")
        self.records = whole[1:]
        kept = [line for line in lines if line.endswith("\n")] or [json.dumps(self.identity) + "\n"]
        self.path.write_text("".join(kept))
        return open(self.path, "a")

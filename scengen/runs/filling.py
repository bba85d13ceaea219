"""The shards of a pool, written while its run goes on: each as soon as nothing can change its content any more."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..pool import writing
from ..pool.files import sha256, sha256_of_file
from ..pool.manifest import FileEntry
from ..work.plain import why_not_plain
from .journal import Journal, Record


class Filling:
    """Follows a run in the order of its indices, and writes every full shard into the folder of the run."""

    def __init__(self, journal: Journal, n: int):
        """
        Args:
            n: number of scenarios that the pool will have; none after them is written.
        """
        self._journal, self._left = journal, n
        self._index, self._number = 0, 0
        self._certified: list[int] = []

    def follow(self, records: Mapping[int, Record]) -> None:
        """Go on to the first index that has no record yet.

        Raises:
            OSError: a shard cannot be written.
        """
        while self._left and (record := records.get(self._index)):
            self._index += 1
            if record.verdict == "certified":
                self._certified.append(record.index)
                self._left -= 1
            if len(self._certified) == writing.SHARD_ROWS:
                _write_once(self._journal, self._number, self._certified)
                self._number, self._certified = self._number + 1, []


def moved_shards(journal: Journal, certified: Sequence[int], folder: Path) -> list[FileEntry]:
    """Move the full shards that were written so far into the folder of the pool, and return their entries.

    Args:
        certified: indices of the scenarios of the pool. A shard with others, or one that is damaged, is left out, and
            those after it.
        folder: folder of the pool.
    """
    found: list[FileEntry] = []
    size = writing.SHARD_ROWS
    for number in range(len(certified) // size):
        entry = journal.shard(number, _key(certified[number * size : (number + 1) * size]))
        if entry is None:
            break
        here, there = journal.folder / entry.file, folder / entry.file
        if _sound(here, entry):
            folder.mkdir(parents=True, exist_ok=True)
            os.replace(here, there)
        elif not _sound(there, entry):
            break
        found.append(entry)
    return found


def _write_once(journal: Journal, number: int, indices: Sequence[int]) -> None:
    """Write a shard, unless an earlier run of the same command has."""
    key = _key(indices)
    if journal.shard(number, key) is None:
        journal.add_shard(number, key, writing.write_shard(journal.folder, number, journal.rows(indices)))


def _key(indices: Sequence[int]) -> str:
    """Hash that distinguishes the scenarios of a shard from others of the same run."""
    return sha256(json.dumps(list(indices)))


def _sound(path: Path, entry: FileEntry) -> bool:
    return not why_not_plain(path) and sha256_of_file(path) == entry.sha256

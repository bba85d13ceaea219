"""The shards of a pool, written while its run goes on: each as soon as nothing can change any more what is in it."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..pool import pool, schema, shards
from .journal import Journal, Record


class Filling:
    """Follows a run in the order of its indices, and writes every shard that is full into the folder of the run."""

    def __init__(self, journal: Journal, n: int):
        """
        Args:
            n: how many scenarios the pool will have; none after them is written.
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
            if len(self._certified) == pool.SHARD_ROWS:
                _keep(self._journal, self._number, self._certified)
                self._number, self._certified = self._number + 1, []


def placed(journal: Journal, certified: Sequence[int], folder: Path) -> list[dict[str, Any]]:
    """Put the full shards that were written so far where the pool is, and say what its manifest says of them.

    Args:
        certified: indices of the scenarios of the pool. A shard with others, or one that is damaged, is left out, and
            those after it.
        folder: of the pool.
    """
    found: list[dict[str, Any]] = []
    for number in range(len(certified) // pool.SHARD_ROWS):
        entry = journal.shard(number, _key(certified[number * pool.SHARD_ROWS : (number + 1) * pool.SHARD_ROWS]))
        if entry is None:
            break
        here, there = journal.folder / entry["file"], folder / entry["file"]
        if _sound(here, entry):
            folder.mkdir(parents=True, exist_ok=True)
            os.replace(here, there)
        elif not _sound(there, entry):
            break
        found.append(entry)
    return found


def _keep(journal: Journal, number: int, indices: Sequence[int]) -> None:
    """Write a shard, unless an earlier run of the same command has."""
    key = _key(indices)
    if journal.shard(number, key) is None:
        journal.add_shard(number, key, pool.write_shard(journal.folder, number, journal.rows(indices)))


def _key(indices: Sequence[int]) -> str:
    """What tells the scenarios of a shard from others of the same run."""
    return pool.sha256(json.dumps(list(indices)))


def _sound(path: Path, entry: Mapping[str, Any]) -> bool:
    return not schema.why_no_plain_file(path) and shards.sha_of(path) == entry["sha256"]

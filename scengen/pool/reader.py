"""The shards of a pool read as one table: all rows, or those at some places."""

import bisect
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ..errors import PoolError
from . import shards
from .directory import Directory, joined
from .shards import Shard

MAX_ROWS = 20_000_000
"""Largest number of scenarios that can be found by their ids, which take 600 MB then."""
KEPT_FOOTERS = 8
"""Number of files whose lists of groups are kept in memory, some MB each."""


class Reader:
    """Reads the rows of several files. Places count the rows of all files from 0."""

    def __init__(self, files: Sequence[Shard]):
        self.files = files
        self._ends = list(itertools.accumulate(shard.rows for shard in files))
        """Place behind the last row of every file."""

    def rows(self, names: Sequence[str]) -> Iterator[dict[str, Any]]:
        """Some columns of all rows.

        Raises:
            PoolError: a file cannot be read.
        """
        for shard in self.files:
            yield from shards.read_rows(shard, names)

    def rows_at(self, places: Iterable[int], names: Sequence[str]) -> Iterator[dict[str, Any]]:
        """Some columns of the rows at some places; only the groups that hold them are unpacked.

        Args:
            places: increasing within a hundred neighbours, so that these are read once.

        Raises:
            PoolError: a file cannot be read.
        """
        for (number, group), found in itertools.groupby(map(self._located, places), key=lambda at: at[:2]):
            shard, metadata = self.files[number], self._footer(number)[0]
            yield from shards.read_rows_at(shard, metadata, group, [inside for *_, inside in found], names)

    def directory(self) -> Directory:
        """Ids and indices of all rows.

        Raises:
            PoolError: a file cannot be read, or holds a different number of rows than `files` says.
        """
        return joined([Directory(*shards.read_keys(shard)) for shard in self.files])

    def categories(self, name: str) -> tuple[list[str], NDArray[np.int32]]:
        """The different texts in a column such as `split`, and which of them each row has, shape (n,).

        Raises:
            PoolError: as `directory`, or there are too many texts.
        """
        found: dict[str, int] = {}
        codes = [np.zeros(0, np.int32)]
        for shard in self.files:
            texts, here = shards.read_categories(shard, name)
            codes.append(np.array([found.setdefault(text, len(found)) for text in texts] or [0], np.int32)[here])
        return list(found), np.concatenate(codes)

    def _located(self, place: int) -> tuple[int, int, int]:
        """File, group of rows, and row in it of a place."""
        number = bisect.bisect_right(self._ends, place)
        inside = place - (self._ends[number - 1] if number else 0)
        ends = self._footer(number)[1]
        group = bisect.bisect_right(ends, inside)
        return number, group, inside - (ends[group - 1] if group else 0)

    @cached_property
    def _footer(self) -> Callable[[int], tuple[pq.FileMetaData, list[int]]]:
        """Metadata of a file about its groups of rows, and the place in it behind the last row of each."""

        @lru_cache(KEPT_FOOTERS)
        def footer(number: int) -> tuple[pq.FileMetaData, list[int]]:
            shard = self.files[number]
            metadata, ends = shards.read_footer(shard)
            if (found := ends[-1] if ends else 0) != shard.rows:
                why = f"holds {found} rows, and the manifest promises {shard.rows}"
                raise PoolError(f"{shard.path} {why}; restore the pool, or generate it again")
            return metadata, ends

        return footer

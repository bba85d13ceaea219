"""Reading the Parquet files of a pool, which may be of unknown origin."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BufferedReader
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ..errors import PoolError
from ..work.machine import memory_bounded
from ..work.plain import open_plain
from . import columns
from .columns import ID, check_robot
from .files import MAX_JSON, Identity
from .manifest import FORMAT
from .row import Layout, PoolRow, layout
from .untrusted import READING_MEMORY

BATCH_ROWS = 20
"""Number of rows that are read at a time; each may have a scene of some MB."""
KEY_ROWS = 10_000
"""Number of rows that are read at a time if only columns of a few characters are read."""
MAX_GROUP = 1_000_000_000
"""Largest unpacked size of a group of rows [bytes]; a thousand scenarios have 50 MB."""
MAX_CONTAINERS = 1_000_000
"""Largest number of elements in a list of Parquet's metadata."""
MAX_CATEGORIES = 1000
"""Largest number of different texts in a column of categories, such as the split."""


@dataclass(frozen=True)
class Shard:
    """A file with rows of a pool."""

    path: Path
    rows: int
    """Number of its rows, by the manifest."""
    identities: Mapping[Path, Identity]
    """Identities of the files whose hashes were compared. The file is not read if its own has changed since."""
    layout: Layout = layout(PoolRow)
    """Columns of the rows."""


# --- rows -------------------------------------------------------------------------------------------------------------


def read_rows(shard: Shard, names: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Some columns of all rows, one by one, as the values of `PoolRow`'s fields.

    Raises:
        PoolError: the file cannot be read, holds something other than a pool of this format, or another number of rows.
    """
    count = 0
    with _reported_faults(shard, lambda: f"from row {count} on"), opened(shard) as file:
        check_groups(file.metadata, range(file.num_row_groups))
        for batch in _batches(file, names, BATCH_ROWS):
            for values in _values(batch, shard.layout):
                count += 1
                _check_count(shard, count, False)
                yield values
    _check_count(shard, count, True)


def read_rows_at(
    shard: Shard, metadata: pq.FileMetaData, group: int, places: Sequence[int], names: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Some columns of a few rows of one group of rows; no other group is unpacked.

    Args:
        metadata: metadata of the file, see `opened`.
        group: number of the group.
        places: places of the rows in the group, increasing.

    Raises:
        PoolError: as `read_rows`.
    """
    with _reported_faults(shard, lambda: f"in group {group} of its rows"), opened(shard, metadata) as file:
        check_groups(metadata, [group])
        wanted, start = iter(places), 0
        place = next(wanted, None)
        for batch in _batches(file, names, BATCH_ROWS, [group]):
            while place is not None and place < start + len(batch):
                yield from _values(batch.slice(place - start, 1), shard.layout)
                place = next(wanted, None)
            if place is None:
                return
            start += len(batch)
        raise ValueError(f"there is no row {place}")


def _values(batch: pa.RecordBatch, layout: Layout) -> Iterator[dict[str, Any]]:
    _check_no_nulls(batch)
    names = batch.schema.names
    streams = [_column(column, name, layout.readers[name]) for name, column in zip(names, batch.columns, strict=True)]
    for row in zip(*streams, strict=True):
        values = dict(zip(names, row, strict=True))
        if {"embodiment", "witness"} <= values.keys():
            check_robot(values["embodiment"], values["witness"])
        yield values


def _column(column: pa.Array, name: str, read: columns.Reader) -> Iterator[Any]:
    """Values one by one. A witness becomes an array at once: a list of numbers would need fifty times the memory."""
    if name == "witness":
        for actions in column:
            flat = actions.values.flatten().to_numpy(zero_copy_only=False)
            yield read(name, flat.reshape(-1, actions.values.type.list_size))
    else:
        for scalar in column:
            yield read(name, scalar.as_py())


# --- columns of a few characters --------------------------------------------------------------------------------------


def read_keys(shard: Shard) -> tuple[NDArray[np.bytes_], NDArray[np.int64]]:
    """Ids, twelve characters each, and indices of all rows.

    Raises:
        PoolError: as `read_rows`.
    """
    ids, indices = [np.zeros(0, "S12")], [np.zeros(0, np.int64)]
    for batch in _small_columns(shard, ("id", "index")):
        texts, numbers = (batch.column(name) for name in ("id", "index"))
        right = pc.match_substring_regex(texts, f"^{ID.pattern}$")  # type: ignore[attr-defined]
        if not pc.all(right, min_count=0).as_py():  # type: ignore[attr-defined]
            raise PoolError(f"{shard.path} holds an id that does not match {ID.pattern}; see scengen verify")
        ids.append(np.array(texts.to_pylist(), "S12"))
        indices.append(numbers.to_numpy())
    return np.concatenate(ids), np.concatenate(indices)


def read_categories(shard: Shard, name: str) -> tuple[list[str], NDArray[np.int32]]:
    """The different texts in a column, and which of them each row has.

    Raises:
        PoolError: as `read_rows`; or there are more than `MAX_CATEGORIES`.
    """
    found: dict[str, int] = {}
    codes = [np.zeros(0, np.int32)]
    for batch in _small_columns(shard, (name,)):
        encoded = batch.column(0).dictionary_encode()
        for text in (texts := encoded.dictionary.to_pylist()):
            found.setdefault(shard.layout.readers[name](name, text), len(found))
            if len(found) > MAX_CATEGORIES:
                raise PoolError(f"{shard.path} holds more than {MAX_CATEGORIES} kinds of {name}; see scengen verify")
        codes.append(np.array([found[text] for text in texts], np.int32)[encoded.indices.to_numpy()])
    return list(found), np.concatenate(codes)


def _small_columns(shard: Shard, names: Sequence[str]) -> Iterator[pa.RecordBatch]:
    """Columns of a few characters, many rows at a time.

    Raises:
        PoolError: as `read_rows`.
    """
    count = 0
    with _reported_faults(shard, lambda: f"from row {count} on"), opened(shard) as file:
        check_groups(file.metadata, range(file.num_row_groups))
        for batch in _batches(file, names, KEY_ROWS):
            _check_no_nulls(batch)
            count += len(batch)
            _check_count(shard, count, False)
            yield batch
    _check_count(shard, count, True)


def _check_count(shard: Shard, count: int, ended: bool) -> None:
    """Raise `PoolError` if a file with so many rows, or more unless it has ended, is not what the manifest says."""
    if count > shard.rows or (ended and count < shard.rows):
        message = f"more than {shard.rows}" if count > shard.rows else f"{count}"
        raise PoolError(f"{shard.path} holds {message} rows, and the manifest promises {shard.rows}; restore it")


# --- files ------------------------------------------------------------------------------------------------------------


@contextmanager
def opened(shard: Shard, metadata: pq.FileMetaData | None = None) -> Iterator[pq.ParquetFile]:
    """A file whose columns are those of a pool.

    Args:
        metadata: metadata of the file, if it is known already.

    Raises:
        ValueError: it is not a plain file, has other columns, or has changed since its hash was compared.
    """
    with (
        open_plain(shard.path) as content,
        pq.ParquetFile(
            content,
            metadata=metadata,
            page_checksum_verification=True,
            thrift_string_size_limit=MAX_JSON,
            thrift_container_size_limit=MAX_CONTAINERS,
        ) as file,
    ):
        _check_unchanged(shard, content)
        if not any(file.schema_arrow.equals(known) for known in shard.layout.schemas.values()):
            raise ValueError(f"its columns are not those of pool format {FORMAT}")
        yield file
        _check_unchanged(shard, content)


def _check_unchanged(shard: Shard, content: BufferedReader) -> None:
    if (known := shard.identities.get(shard.path)) is not None and known != Identity.of(content):
        raise ValueError("it has been changed since its sha256 was compared")


def read_footer(shard: Shard) -> tuple[pq.FileMetaData, list[int]]:
    """Metadata of a file about its groups of rows, and the place behind the last row of each.

    Raises:
        PoolError: as `read_rows`.
    """
    with _reported_faults(shard, lambda: "at all"), opened(shard) as file:
        groups = map(file.metadata.row_group, range(file.num_row_groups))
        return file.metadata, list(accumulate(group.num_rows for group in groups))


@contextmanager
def _reported_faults(shard: Shard, where: Callable[[], str]) -> Iterator[None]:
    """Report a file that cannot be read in one line.

    Raises:
        PoolError: that line.
    """
    try:
        yield
    except (OSError, pa.ArrowException, ValueError, TypeError, RecursionError, MemoryError, OverflowError) as error:
        why = " ".join(str(error).split())[:120] or type(error).__name__
        raise PoolError(f"{shard.path} cannot be read {where()} ({why}); restore it") from None


def check_groups(metadata: pq.FileMetaData, groups: Iterable[int]) -> None:
    """Refuse groups of rows that lie in other files or would not fit into memory, before any is unpacked."""
    for group in map(metadata.row_group, groups):
        columns = [group.column(i) for i in range(group.num_columns)]
        if elsewhere := next((column.file_path for column in columns if column.file_path), None):
            raise ValueError(f"its rows lie in another file, {elsewhere[:60]!r}")
        size = max(group.total_byte_size, sum(column.total_uncompressed_size for column in columns))
        if size > MAX_GROUP:
            raise ValueError(f"a group of rows has {size} bytes unpacked; at most {MAX_GROUP} are read")


def _batches(
    file: pq.ParquetFile, names: Sequence[str], rows: int, groups: Sequence[int] | None = None
) -> Iterator[pa.RecordBatch]:
    """Some rows at a time, each read with a bound on memory: what a file says about its sizes may be false."""
    batches = file.iter_batches(rows, groups, columns=list(names), use_threads=False)
    while True:
        with memory_bounded(READING_MEMORY):
            batch = next(batches, None)
        if batch is None:
            return
        yield batch


def _check_no_nulls(batch: pa.RecordBatch) -> None:
    for name, column in zip(batch.schema.names, batch.columns, strict=True):
        if column.null_count:
            raise ValueError(f"column {name} has missing values")

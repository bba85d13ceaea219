"""Writing a pool: shards first, the manifest last, each under its final name only when it is complete."""

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..control.loop import ACTION
from .files import sha256_of_file
from .manifest import REJECTED, FileEntry, Manifest
from .pool import Pool
from .row import SCHEMAS, PoolRow, SceneRow, layout

SHARD_ROWS = 10_000
"""Number of scenarios in a file: some 150 MB, written and hashed in seconds."""
GROUP_ROWS = 100
"""Number of rows that are packed together: to read one of them, those before it are unpacked, too. Groups of any size
are read."""

_ACTIONS = "witness.list.element.list.element"
"""Parquet's name of the numbers of the witnesses."""


def _leaves(kind: pa.Schema | pa.StructType | pa.DataType, path: str) -> Iterator[str]:
    """Parquet's names of the columns with numbers and texts."""
    if isinstance(kind, pa.Schema | pa.StructType):
        for field in kind:
            yield from _leaves(field.type, f"{path}.{field.name}" if path else field.name)
    elif isinstance(kind, pa.ListType | pa.FixedSizeListType):
        yield from _leaves(kind.value_type, f"{path}.list.element")
    else:
        yield path


PACKING: dict[str, Any] = {"compression": "zstd", "compression_level": 3, "write_page_checksum": True}
"""Options of Parquet's writer."""
LARGE_FILE_PACKING: dict[str, Any] = {
    "use_dictionary": [name for name in _leaves(SCHEMAS[ACTION], "") if name != _ACTIONS],
    "column_encoding": {_ACTIONS: "BYTE_STREAM_SPLIT"},
}
"""Further options for files of more than one group, in which witnesses take a third to a half of the bytes. Smaller
files are packed without them, so that small pools keep their hashes."""


def write_pool(
    folder: Path,
    about: Manifest,
    rows: Iterable[PoolRow],
    kept: Iterable[PoolRow] = (),
    ready: Sequence[FileEntry] = (),
) -> Pool:
    """Write a pool.

    Args:
        about: the manifest; its files are replaced by those that are written.
        rows: certified scenarios in the order of their indices, without those in shards that are ready.
        kept: scenarios that were not certified.
        ready: entries of full shards that lie in the folder already, see `write_shard`.
    """
    entries = write_shards(folder, rows, ready)
    rejects = iter(kept)
    first = next(rejects, None)
    rejected = None if first is None else write_rows(folder / REJECTED, chain([first], rejects))
    replace(about, shards=entries, rejected=rejected).write(folder)
    return Pool.open(folder)


def write_shards(folder: Path, rows: Iterable[PoolRow], ready: Sequence[FileEntry] = ()) -> tuple[FileEntry, ...]:
    """Write the shards of a pool, at least one, and return the entries of its manifest. The folder is made.

    Args:
        rows, ready: see `write_pool`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    entries, left = [*ready], iter(rows)
    while (first := next(left, None)) or not entries:
        some = chain([first] if first else [], islice(left, SHARD_ROWS - 1))
        entries.append(write_shard(folder, len(entries), some))
    return tuple(entries)


def write_shard(folder: Path, number: int, rows: Iterable[PoolRow]) -> FileEntry:
    """Write one shard of a pool.

    Args:
        number: number of the shard, from 0.
        rows: `SHARD_ROWS` of them, or fewer in the last shard.
    """
    return write_rows(folder / f"scenarios-{number:05d}.parquet", rows)


def write_rows(path: Path, rows: Iterable[SceneRow], kind: type[SceneRow] = PoolRow) -> FileEntry:
    """Write one file, a group of rows at a time.

    If the process dies at any moment, the file is either the old one or the new one.

    Args:
        rows: all of robots with the same number of arms.
        kind: class of the rows.
    """
    part, count = path.with_name(path.name + ".part"), 0
    tables = _tables(rows, kind)
    begin = list(islice(tables, 2)) or [_table([], kind)]
    packing = PACKING | LARGE_FILE_PACKING if len(begin) > 1 else PACKING
    try:
        with open(part, "wb") as file:
            with pq.ParquetWriter(file, begin[0].schema, **packing) as writer:
                for table in chain(begin, tables):
                    writer.write_table(table, GROUP_ROWS)
                    count += table.num_rows
            file.flush()
            os.fsync(file.fileno())
        entry = FileEntry(path.name, count, part.stat().st_size, sha256_of_file(part))
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
    return entry


def _tables(rows: Iterable[SceneRow], kind: type[SceneRow]) -> Iterator[pa.Table]:
    """Groups of rows."""
    left = iter(rows)
    while group := list(islice(left, GROUP_ROWS)):
        yield _table(group, kind)


def _table(group: Sequence[SceneRow], kind: type[SceneRow]) -> pa.Table:
    """A group of rows. Witnesses become a column without lists of numbers, which would need fifty times the memory."""
    witnesses = [row.witness for row in group]
    size = witnesses[0].shape[1] if witnesses else ACTION
    schema = layout(kind).schemas[size]
    plain = pa.Table.from_pylist([{**row.plain(), "witness": None} for row in group], schema=schema)
    offsets = np.cumsum([0, *map(len, witnesses)], dtype=np.int32)
    flat = np.concatenate([np.zeros((0, size)), *witnesses], dtype=np.float32).ravel()
    column = pa.ListArray.from_arrays(offsets, pa.FixedSizeListArray.from_arrays(pa.array(flat), size))
    where = schema.get_field_index("witness")
    return plain.set_column(where, schema.field(where), column.cast(schema.field(where).type))

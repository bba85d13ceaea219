"""Parquet files of a pool: what their columns are, how they are written, and how an untrusted one is read."""

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from . import columns, schema
from .control.loop import ACTION
from .errors import PoolError

FORMAT = 3
GROUP_ROWS = 1000
BATCH_ROWS = 20
"""Rows that are read at a time; each may have a scene of some MB."""
LARGEST_GROUP = 2_000_000_000
"""Bytes of a group of rows, unpacked; a thousand scenarios have 50 MB."""

CHECK = pa.struct(
    [
        ("name", pa.string()),
        ("passed", pa.bool_()),
        ("reason", pa.string()),
        ("settings", pa.string()),
        ("numbers", pa.string()),
    ]
)
CERTIFICATE = pa.struct(
    [
        ("verdict", pa.string()),
        ("reason", pa.string()),
        ("settings", pa.string()),
        ("checks", pa.list_(CHECK)),
        ("scene_sha256", pa.string()),
        ("witness_sha256", pa.string()),
        ("final_state", pa.string()),
        ("fingerprint", pa.string()),
        ("source_sha256", pa.string()),
        ("versions", pa.string()),
    ]
)


def _schema(size: int) -> pa.Schema:
    """The columns of a shard for robots whose actions have `size` numbers.

    `shifted`, `params`, `versions` and a check's `settings` and `numbers` hold JSON.
    """
    return pa.schema(
        [
            ("id", pa.string()),
            ("task", pa.string()),
            ("code", pa.string()),
            ("category", pa.string()),
            ("split", pa.string()),
            ("axes", pa.list_(pa.string())),
            ("shifted", pa.string()),
            ("seed", pa.int64()),
            ("index", pa.int64()),
            ("attempt", pa.int64()),
            ("id_twin", pa.string()),
            ("instruction", pa.string()),
            ("horizon", pa.float64()),
            ("params", pa.string()),
            ("embodiment", pa.string()),
            ("scene_xml", pa.string()),
            ("scene_sha256", pa.string()),
            ("witness", pa.list_(pa.list_(pa.float32(), size))),
            ("witness_sha256", pa.string()),
            ("certificate", CERTIFICATE),
        ]
    )


SCHEMAS = {size: _schema(size) for size in sorted(columns.ACTION_SIZES)}
"""The columns of a shard, by the numbers in an action of its robots."""
NAMES: tuple[str, ...] = tuple(SCHEMAS[ACTION].names)
LIGHT = tuple(name for name in NAMES if name != "witness")
"""All but the largest."""


def write(path: Path, rows: Sequence[Mapping[str, Any]], witnesses: Sequence[NDArray[np.float32]]) -> dict[str, Any]:
    """Write one file, and say what a manifest says of it.

    Args:
        rows: the columns of every row but its witness.
        witnesses: that of every row, shape (n, 7 * arms): all of robots with as many arms.
    """
    sink = pa.BufferOutputStream()
    pq.write_table(
        _table(rows, witnesses),
        sink,
        compression="zstd",
        compression_level=3,
        row_group_size=GROUP_ROWS,
        write_page_checksum=True,
    )
    content = sink.getvalue().to_pybytes()
    replace(path, content)
    return {"file": path.name, "rows": len(rows), "bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def _table(rows: Sequence[Mapping[str, Any]], witnesses: Sequence[NDArray[np.float32]]) -> pa.Table:
    size = witnesses[0].shape[1] if witnesses else ACTION
    of = SCHEMAS[size]
    plain = pa.Table.from_pylist([{**row, "witness": None} for row in rows], schema=of)
    offsets = np.cumsum([0, *map(len, witnesses)], dtype=np.int32)
    flat = np.concatenate([np.zeros((0, size)), *witnesses], dtype=np.float32).ravel()
    column = pa.ListArray.from_arrays(offsets, pa.FixedSizeListArray.from_arrays(pa.array(flat), size))
    where = of.get_field_index("witness")
    return plain.set_column(where, of.field(where), column.cast(of.field(where).type))


def read(path: Path, names: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Some columns of one Parquet file, row by row, as the values of `PoolRow`'s fields.

    Raises:
        PoolError: the file cannot be read, or holds something else than a pool of this format.
    """
    count = 0
    try:
        if why := schema.why_no_plain_file(path):
            raise ValueError(f"it {why}")
        with pq.ParquetFile(
            path,
            page_checksum_verification=True,
            thrift_string_size_limit=schema.LARGEST_MANIFEST,
            thrift_container_size_limit=1_000_000,
        ) as file:
            if not any(file.schema_arrow.equals(known) for known in SCHEMAS.values()):
                raise ValueError(f"its columns are not those of pool format {FORMAT}")
            _check_groups(file.metadata)
            for table in _batches(file, names):
                for values in _values(table):
                    yield values
                    count += 1
    except (OSError, pa.ArrowException, ValueError, TypeError, RecursionError, MemoryError, OverflowError) as error:
        why = " ".join(str(error).split())[:120] or type(error).__name__
        raise PoolError(f"{path} cannot be read from row {count} on ({why}); restore it") from None


def _check_groups(metadata: pq.FileMetaData) -> None:
    """Refuse groups of rows that would not fit into memory, before any is unpacked."""
    for group in map(metadata.row_group, range(metadata.num_row_groups)):
        size = max(
            group.total_byte_size, sum(group.column(i).total_uncompressed_size for i in range(group.num_columns))
        )
        if size > LARGEST_GROUP:
            raise ValueError(f"a group of rows has {size} bytes when it is unpacked, at most {LARGEST_GROUP} are read")


def _batches(file: pq.ParquetFile, names: Sequence[str]) -> Iterator[pa.Table]:
    """A few rows at a time, each read with a bound on memory: what a file says about its sizes may be false."""
    batches = file.iter_batches(BATCH_ROWS, columns=list(names), use_threads=False)
    while True:
        with schema.memory_bounded():
            batch = next(batches, None)
        if batch is None:
            return
        yield pa.Table.from_batches([batch])


def _values(table: pa.Table) -> Iterator[dict[str, Any]]:
    for name in table.column_names:
        if table.column(name).null_count:
            raise ValueError(f"column {name} has gaps")
    streams = [_column(table.column(name), name) for name in table.column_names]
    for row in zip(*streams, strict=True):
        values = dict(zip(table.column_names, row, strict=True))
        if {"embodiment", "witness"} <= values.keys():
            columns.check_robot(values["embodiment"], values["witness"])
        yield values


def _column(column: pa.ChunkedArray, name: str) -> Iterator[Any]:
    """Values one by one. A witness becomes an array at once: a list of numbers would need fifty times the memory."""
    if name == "witness":
        for actions in column:
            flat = actions.values.flatten().to_numpy(zero_copy_only=False)
            yield columns.witness_of(flat.reshape(-1, actions.values.type.list_size))
    else:
        check = columns.COLUMNS[name]
        for scalar in column:
            yield check(name, scalar.as_py())


def replace(path: Path, content: bytes) -> None:
    """Write a file so that it is either the old one or the new one, whenever the process dies."""
    part = path.with_name(path.name + ".part")
    try:
        with open(part, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def sha_of(path: Path) -> str:
    """Hash of a file, in hex."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()

"""Parquet files of a pool: what their columns are, how they are written, and how an untrusted one is read."""

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import accumulate, chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ..control.loop import ACTION
from ..errors import PoolError
from . import columns, schema

FORMAT = 3
GROUP_ROWS = 100
"""Rows that are packed together: whoever wants one of them unpacks those before it. Groups of any size are read."""
BATCH_ROWS = 20
"""Rows that are read at a time; each may have a scene of some MB."""
KEY_ROWS = 10_000
"""Rows that are read at a time of columns with a few letters."""
LARGEST_GROUP = 1_000_000_000
"""Bytes of a group of rows, unpacked; a thousand scenarios have 50 MB."""
MOST_KINDS = 1000
"""Different texts in a column that says of what kind a scenario is, such as its split."""

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

_ACTIONS = "witness.list.element.list.element"
"""What Parquet calls the numbers of the witnesses."""


def _leaves(kind: pa.Schema | pa.StructType | pa.DataType, path: str) -> Iterator[str]:
    """What Parquet calls the columns with numbers and texts."""
    if isinstance(kind, pa.Schema | pa.StructType):
        for field in kind:
            yield from _leaves(field.type, f"{path}.{field.name}" if path else field.name)
    elif isinstance(kind, pa.ListType | pa.FixedSizeListType):
        yield from _leaves(kind.value_type, f"{path}.list.element")
    else:
        yield path


PACKED: dict[str, Any] = {"compression": "zstd", "compression_level": 3, "write_page_checksum": True}
LARGE: dict[str, Any] = {
    "use_dictionary": [name for name in _leaves(SCHEMAS[ACTION], "") if name != _ACTIONS],
    "column_encoding": {_ACTIONS: "BYTE_STREAM_SPLIT"},
}
"""How files of more than one group pack witnesses: in a third to a half of the bytes. In smaller files it stays as it
was, so that small pools keep their hashes."""


Plain = tuple[Mapping[str, Any], NDArray[np.float32]]
"""The columns of a row but its witness, and its witness, shape (n, 7 * arms)."""


def write(path: Path, rows: Iterable[Plain]) -> dict[str, Any]:
    """Write one file, a group of rows at a time, and say what a manifest says of it.

    The file is either the old one or the new one, whenever the process dies.

    Args:
        rows: all of robots with as many arms.
    """
    part, count = path.with_name(path.name + ".part"), 0
    groups = _groups(rows)
    begin = list(islice(groups, 2)) or [_table([])]
    packed = PACKED | LARGE if len(begin) > 1 else PACKED
    try:
        with open(part, "wb") as file:
            with pq.ParquetWriter(file, begin[0].schema, **packed) as writer:
                for table in chain(begin, groups):
                    writer.write_table(table, GROUP_ROWS)
                    count += table.num_rows
            file.flush()
            os.fsync(file.fileno())
        told = {"file": path.name, "rows": count, "bytes": part.stat().st_size, "sha256": sha_of(part)}
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
    return told


def _groups(rows: Iterable[Plain]) -> Iterator[pa.Table]:
    left = iter(rows)
    while group := list(islice(left, GROUP_ROWS)):
        yield _table(group)


def _table(group: Sequence[Plain]) -> pa.Table:
    rows, witnesses = [row for row, _ in group], [witness for _, witness in group]
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
    with _told(path, lambda: f"from row {count} on"), opened(path) as file:
        _check_groups(file.metadata, range(file.num_row_groups))
        for batch in _batches(file, names, BATCH_ROWS):
            for values in _values(batch):
                yield values
                count += 1


def read_some(
    path: Path, metadata: pq.FileMetaData, group: int, places: Sequence[int], names: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Some columns of a few rows of one group of rows; no other group is unpacked.

    Args:
        metadata: that of the file, see `opened`.
        group: number of the group.
        places: of the rows in it, increasing.

    Raises:
        PoolError: as `read`.
    """
    with _told(path, lambda: f"in group {group} of its rows"), opened(path, metadata) as file:
        _check_groups(metadata, [group])
        wanted, start = iter(places), 0
        place = next(wanted, None)
        for batch in _batches(file, names, BATCH_ROWS, [group]):
            while place is not None and place < start + len(batch):
                yield from _values(batch.slice(place - start, 1))
                place = next(wanted, None)
            if place is None:
                return
            start += len(batch)
        raise ValueError(f"there is no row {place}")


def keys(path: Path, rows: int) -> tuple[NDArray[np.bytes_], NDArray[np.int64]]:
    """Ids, twelve letters each, and indices of all rows of one file.

    Args:
        rows: how many there must be.

    Raises:
        PoolError: as `read`; or there are more, or less.
    """
    ids, indices = [np.zeros(0, "S12")], [np.zeros(0, np.int64)]
    for batch in _small(path, ("id", "index"), rows):
        texts, numbers = (batch.column(name) for name in ("id", "index"))
        right = pc.match_substring_regex(texts, f"^{columns.ID.pattern}$")  # type: ignore[attr-defined]
        if not pc.all(right, min_count=0).as_py():  # type: ignore[attr-defined]
            raise PoolError(f"{path} holds an id that is not of the form {columns.ID.pattern}; see scengen verify")
        ids.append(np.array(texts.to_pylist(), "S12"))
        indices.append(numbers.to_numpy())
    return np.concatenate(ids), np.concatenate(indices)


def kinds(path: Path, name: str, rows: int) -> tuple[list[str], NDArray[np.int32]]:
    """The different texts in a column, and which of them each row has.

    Args:
        rows: how many there must be.

    Raises:
        PoolError: as `keys`; or there are more than `MOST_KINDS`.
    """
    found: dict[str, int] = {}
    codes = [np.zeros(0, np.int32)]
    for batch in _small(path, (name,), rows):
        encoded = batch.column(0).dictionary_encode()
        for text in (texts := encoded.dictionary.to_pylist()):
            found.setdefault(columns.COLUMNS[name](name, text), len(found))
            if len(found) > MOST_KINDS:
                raise PoolError(f"{path} holds more than {MOST_KINDS} kinds of {name}; see scengen verify")
        codes.append(np.array([found[text] for text in texts], np.int32)[encoded.indices.to_numpy()])
    return list(found), np.concatenate(codes)


def _small(path: Path, names: Sequence[str], rows: int) -> Iterator[pa.RecordBatch]:
    """Columns of a few letters, many rows at a time.

    Raises:
        PoolError: as `read`; or there are not as many rows as there must be.
    """
    count = 0
    with _told(path, lambda: f"from row {count} on"), opened(path) as file:
        _check_groups(file.metadata, range(file.num_row_groups))
        for batch in _batches(file, names, KEY_ROWS):
            _check_whole(batch)
            if (count := count + len(batch)) > rows:
                break
            yield batch
    if count != rows:
        told = f"more than {rows}" if count > rows else f"{count}"
        raise PoolError(f"{path} holds {told} rows, and the manifest promises {rows}; restore it")


@contextmanager
def _told(path: Path, where: Callable[[], str]) -> Iterator[None]:
    """Tell in one line of a file that cannot be read.

    Raises:
        PoolError: that line.
    """
    try:
        yield
    except (OSError, pa.ArrowException, ValueError, TypeError, RecursionError, MemoryError, OverflowError) as error:
        why = " ".join(str(error).split())[:120] or type(error).__name__
        raise PoolError(f"{path} cannot be read {where()} ({why}); restore it") from None


@contextmanager
def opened(path: Path, metadata: pq.FileMetaData | None = None) -> Iterator[pq.ParquetFile]:
    """A file whose columns are those of a pool.

    Args:
        metadata: that of the file, if it is known already.

    Raises:
        ValueError: it is no plain file, or has other columns.
    """
    if why := schema.why_no_plain_file(path):
        raise ValueError(f"it {why}")
    with pq.ParquetFile(
        path,
        metadata=metadata,
        page_checksum_verification=True,
        thrift_string_size_limit=schema.LARGEST_MANIFEST,
        thrift_container_size_limit=1_000_000,
    ) as file:
        if not any(file.schema_arrow.equals(known) for known in SCHEMAS.values()):
            raise ValueError(f"its columns are not those of pool format {FORMAT}")
        yield file


def footer(path: Path) -> tuple[pq.FileMetaData, list[int]]:
    """What a file says of its groups of rows, and the place behind the last row of each.

    Raises:
        PoolError: as `read`.
    """
    with _told(path, lambda: "at all"), opened(path) as file:
        groups = map(file.metadata.row_group, range(file.num_row_groups))
        return file.metadata, list(accumulate(group.num_rows for group in groups))


def _check_groups(metadata: pq.FileMetaData, groups: Iterable[int]) -> None:
    """Refuse groups of rows that would not fit into memory, before any is unpacked."""
    for group in map(metadata.row_group, groups):
        size = max(
            group.total_byte_size, sum(group.column(i).total_uncompressed_size for i in range(group.num_columns))
        )
        if size > LARGEST_GROUP:
            raise ValueError(f"a group of rows has {size} bytes when it is unpacked, at most {LARGEST_GROUP} are read")


def _batches(
    file: pq.ParquetFile, names: Sequence[str], rows: int, groups: Sequence[int] | None = None
) -> Iterator[pa.RecordBatch]:
    """Some rows at a time, each read with a bound on memory: what a file says about its sizes may be false."""
    batches = file.iter_batches(rows, groups, columns=list(names), use_threads=False)
    while True:
        with schema.memory_bounded():
            batch = next(batches, None)
        if batch is None:
            return
        yield batch


def _check_whole(batch: pa.RecordBatch) -> None:
    for name, column in zip(batch.schema.names, batch.columns, strict=True):
        if column.null_count:
            raise ValueError(f"column {name} has gaps")


def _values(batch: pa.RecordBatch) -> Iterator[dict[str, Any]]:
    _check_whole(batch)
    names = batch.schema.names
    streams = [_column(column, name) for name, column in zip(names, batch.columns, strict=True)]
    for row in zip(*streams, strict=True):
        values = dict(zip(names, row, strict=True))
        if {"embodiment", "witness"} <= values.keys():
            columns.check_robot(values["embodiment"], values["witness"])
        yield values


def _column(column: pa.Array, name: str) -> Iterator[Any]:
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

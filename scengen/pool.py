"""Pools on disk: a folder with a manifest and Parquet shards. Data only: nothing in it is ever executed."""

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from .errors import PoolError, UnknownName

MANIFEST = "manifest.json"
FORMAT = 1
SHARD_ROWS = 100_000
GROUP_ROWS = 1000

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
        ("level", pa.string()),
        ("checks", pa.list_(CHECK)),
        ("scene_sha256", pa.string()),
        ("witness_sha256", pa.string()),
        ("final_state", pa.string()),
        ("fingerprint", pa.string()),
        ("source_sha256", pa.string()),
        ("versions", pa.string()),
    ]
)
SCHEMA = pa.schema(
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
        ("witness", pa.list_(pa.list_(pa.float32(), 7))),
        ("witness_sha256", pa.string()),
        ("certificate", CERTIFICATE),
    ]
)
"""Columns of a shard; `moved`, `params`, `settings`, `numbers` and `versions` hold JSON."""

Row = dict[str, Any]
"""One scenario as plain data, with the columns of `SCHEMA`; the witness is an array of shape (n, 7)."""


@dataclass(frozen=True)
class Pool:
    """A finished pool, opened for reading."""

    folder: Path
    manifest: Mapping[str, Any]

    @classmethod
    def open(cls, folder: str | Path) -> "Pool":
        """Open a pool by its folder.

        Raises:
            PoolError: there is no finished pool of a known format.
        """
        folder = Path(folder)
        path = folder / MANIFEST
        if not path.is_file():
            begun = f"{folder}.run"
            hint = (
                "a run was begun there; repeat its command to finish it"
                if Path(begun).is_dir()
                else "see scengen generate"
            )
            raise PoolError(f"no pool at {folder}: {MANIFEST} is missing; {hint}")
        try:
            manifest = json.loads(path.read_text())
            version, shards = manifest["format"], manifest["shards"]
            assert isinstance(shards, list) and all(isinstance(s["file"], str) for s in shards)
        except (ValueError, KeyError, TypeError, AssertionError, UnicodeDecodeError):
            raise PoolError(f"{path} is damaged; restore it or generate the pool again") from None
        if version != FORMAT:
            raise PoolError(
                f"{folder} has pool format {version}; this scengen reads {FORMAT}: use the version that wrote it"
            )
        return cls(folder, manifest)

    @property
    def sha256(self) -> str:
        """Hash of the manifest, which holds the hash of every shard: equal hashes mean equal pools."""
        return _sha(self.folder / MANIFEST)

    def __len__(self) -> int:
        return sum(shard["rows"] for shard in self.manifest["shards"])

    def damaged(self) -> dict[str, str]:
        """What is wrong with the files, by shard; empty for a sound pool."""
        wrong = {}
        for shard in self.manifest["shards"]:
            path = self.folder / shard["file"]
            if Path(shard["file"]).name != shard["file"]:
                wrong[shard["file"]] = "lies outside the pool"
            elif not path.is_file():
                wrong[shard["file"]] = "is missing"
            elif path.stat().st_size != shard["bytes"]:
                wrong[shard["file"]] = f"has {path.stat().st_size} bytes instead of {shard['bytes']}: truncated"
            elif _sha(path) != shard["sha256"]:
                wrong[shard["file"]] = "has another sha256 than the manifest says"
        return wrong

    def check(self) -> "Pool":
        """Raise `PoolError` unless every shard is what the manifest says."""
        for name, what in self.damaged().items():
            raise PoolError(f"{self.folder / name} {what}; restore it or generate the pool again")
        return self

    def rows(self, columns: Sequence[str] | None = None) -> Iterator[Row]:
        """All scenarios in index order.

        Raises:
            PoolError: a shard cannot be read.
        """
        for shard in self.manifest["shards"]:
            yield from read_shard(self.folder / shard["file"], columns)

    def row(self, prefix: str) -> Row:
        """The scenario whose id begins with `prefix`.

        Raises:
            UnknownName: none, or more than one.
        """
        ids = [r["id"] for r in self.rows(["id"])]
        found = [i for i in ids if i.startswith(prefix)]
        if len(found) != 1:
            what = "scenario" if not found else f"single scenario ({len(found)} begin so)"
            raise UnknownName(f"{what} in {self.folder}", prefix, ids[:20] + (["..."] if len(ids) > 20 else []))
        return next(r for r in self.rows() if r["id"] == found[0])

    @cached_property
    def rejected(self) -> list[Row]:
        """Scenarios that were kept although they were not certified (`keep=`)."""
        path = self.folder / "rejected.parquet"
        return list(read_shard(path)) if path.is_file() else []


def read_shard(path: Path, columns: Sequence[str] | None = None) -> Iterator[Row]:
    """The rows of one Parquet file.

    Raises:
        PoolError: the file cannot be read.
    """
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            for group in range(file.num_row_groups):
                yield from _rows(file.read_row_group(group, columns=columns))
    except (OSError, pa.ArrowException) as error:
        raise PoolError(f"{path} cannot be read ({' '.join(str(error).split())[:120]}); restore it") from None


def write(folder: Path, manifest: Mapping[str, Any], rows: Iterable[Row], kept: Sequence[Row] = ()) -> Pool:
    """Write a pool: shards first, the manifest last, each under its final name only when complete."""
    folder.mkdir(parents=True, exist_ok=True)
    shards, batch = [], []
    for row in rows:
        batch.append(row)
        if len(batch) == SHARD_ROWS:
            shards.append(_write_shard(folder, f"scenarios-{len(shards):05d}.parquet", batch))
            batch = []
    if batch or not shards:
        shards.append(_write_shard(folder, f"scenarios-{len(shards):05d}.parquet", batch))
    extra = {"rejected": _write_shard(folder, "rejected.parquet", kept)} if kept else {}
    text = json.dumps({"format": FORMAT, **manifest, "shards": shards, **extra}, indent=1, sort_keys=True) + "\n"
    _replace(folder / MANIFEST, text.encode())
    return Pool.open(folder)


def sha256(content: str | bytes) -> str:
    """Hash of a text or of bytes, in hex."""
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()


def _write_shard(folder: Path, name: str, rows: Sequence[Row]) -> dict[str, Any]:
    table = _table(rows)
    sink = pa.BufferOutputStream()
    pq.write_table(
        table,
        sink,
        compression="zstd",
        compression_level=3,
        row_group_size=GROUP_ROWS,
        write_page_checksum=True,
    )
    content = sink.getvalue().to_pybytes()
    _replace(folder / name, content)
    return {"file": name, "rows": len(rows), "bytes": len(content), "sha256": sha256(content)}


def _table(rows: Sequence[Row]) -> pa.Table:
    plain = pa.Table.from_pylist([{**row, "witness": None} for row in rows], schema=SCHEMA)
    recordings = [np.asarray(row["witness"], np.float32).reshape(-1, 7) for row in rows]
    offsets = np.cumsum([0, *map(len, recordings)], dtype=np.int32)
    flat = np.concatenate(recordings).ravel() if recordings else np.zeros(0, np.float32)
    column = pa.ListArray.from_arrays(offsets, pa.FixedSizeListArray.from_arrays(pa.array(flat), 7))
    where = SCHEMA.get_field_index("witness")
    return plain.set_column(where, SCHEMA.field(where), column.cast(SCHEMA.field(where).type))


def _rows(table: pa.Table) -> Iterator[Row]:
    """Plain data, but witnesses as arrays: as lists of numbers they would need fifty times the memory."""
    if "witness" not in table.column_names:
        yield from table.to_pylist()
        return
    recordings = table.column("witness")
    for row, actions in zip(table.drop_columns("witness").to_pylist(), recordings, strict=True):
        numbers = actions.values.flatten().to_numpy(zero_copy_only=False)
        yield {**row, "witness": np.asarray(numbers, np.float32).reshape(-1, 7)}


def _replace(path: Path, content: bytes) -> None:
    """Write a file so that it is either the old one or the new one, whenever the process dies."""
    part = path.with_name(path.name + ".part")
    with open(part, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    os.replace(part, path)


def _sha(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()

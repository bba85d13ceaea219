"""Rows in a folder with a manifest: what pools and demonstrations have in common."""

import importlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ..errors import BadConfig, PoolError, UnknownName
from .directory import Directory
from .files import Identity, sha256_of_file, why_damaged
from .manifest import FileEntry
from .names import Name
from .reader import MAX_ROWS, Reader
from .row import NO_WITNESS, SceneRow, layout
from .shards import Shard


class StoredManifest(Protocol):
    """Entries of every manifest."""

    @property
    def config(self) -> Any:
        """Everything that decides which rows a run makes; `task` and `split` are in it."""
        ...

    @property
    def shards(self) -> tuple[FileEntry, ...]:
        """Files of the rows, in their order."""
        ...

    @property
    def files(self) -> tuple[FileEntry, ...]:
        """All files."""
        ...


HEAVY = ("scene_xml", "scene_sha256", "witness_sha256", "certificate")
"""Columns that a table for people leaves out."""
AnyManifest = TypeVar("AnyManifest", bound=StoredManifest)
AnyRow = TypeVar("AnyRow", bound=SceneRow)


@dataclass(frozen=True, repr=False)
class StoredRows(Generic[AnyManifest, AnyRow]):
    """A finished folder of rows, opened for reading."""

    folder: Path
    manifest: AnyManifest

    ROW: ClassVar[type[SceneRow]]
    """Class of the rows."""
    MANIFEST: ClassVar[str]
    """Name of the manifest's file."""
    REMEDY: ClassVar[str]
    """Command that makes the rows again, for errors."""

    @cached_property
    def _home(self) -> Path:
        """The folder, also after the process has changed its working folder."""
        return self.folder.absolute()

    def __post_init__(self) -> None:
        _ = self._home

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self.folder)!r}: {len(self)} of {self.task}/{self.split})"

    def __len__(self) -> int:
        """Number of rows, by the manifest."""
        return sum(entry.rows for entry in self.manifest.shards)

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.manifest.config.task["name"]

    @property
    def split(self) -> str:
        return self.manifest.config.split

    # --- files ----------------------------------------------------------------------------------------

    @property
    def sha256(self) -> str:
        """Hash of the manifest, which holds the hash of every file: equal hashes mean equal rows."""
        return sha256_of_file(self._home / self.MANIFEST)

    def damaged(self) -> dict[str, str]:
        """Faults of the files, by name; empty if there are none. From now on only the very files are read that were
        compared: a file that is replaced or written afterwards cannot be read."""
        faults = ((entry.file, why_damaged(self._home, entry, self._identities)) for entry in self.manifest.files)
        return {name: why for name, why in faults if why}

    def check(self) -> Self:
        """Raise `PoolError` unless every file is what the manifest says."""
        for name, what in self.damaged().items():
            raise PoolError(f"{self.folder / name} {what}; restore it or {self.REMEDY}")
        return self

    # --- all rows -------------------------------------------------------------------------------------

    def rows(self, witness: bool = True) -> Iterator[AnyRow]:
        """All rows in their order.

        Args:
            witness: whether to read the actions, most of the bytes; without them each row has `NO_WITNESS`.

        Raises:
            PoolError: a file cannot be read.
        """
        return map(self._row, self._reader.rows(self._names(witness)))

    def __iter__(self) -> Iterator[AnyRow]:
        """All rows in their order, with their witnesses."""
        return self.rows()

    def columns(self, *names: str, places: Iterable[int] | None = None) -> Iterator[tuple[Any, ...]]:
        """A few columns of the rows, with the values of the fields of a row; quicker than `rows`.

        Args:
            places: places of some rows only, see `some`.

        Raises:
            UnknownName: there is no such column, or it is the witness.
            PoolError: a file cannot be read.
        """
        for name in names:
            if name not in (known := self._names(witness=False)):
                raise UnknownName("light column of a pool", name, known)
        for values in self._reader.rows(names) if places is None else self._reader.rows_at(places, names):
            yield tuple(values[name] for name in names)

    def to_arrow(self) -> pa.Table:
        """One row for each scenario: its light columns, and a column for each parameter.

        Scenes, witnesses and certificates are left out. A parameter with the name of a column is called `params.NAME`.

        Raises:
            PoolError: a file cannot be read.
        """
        names = [name for name in self._names(witness=False) if name not in ("params", "shifted", *HEAVY)]
        found = []
        for *values, params in self.columns(*names, "params"):
            row = dict(zip(names, values, strict=True))
            found.append({**row, **{f"params.{name}" if name in row else name: v for name, v in params.items()}})
        return pa.Table.from_pylist(found)

    def to_pandas(self) -> Any:
        """The table of `to_arrow` as a data frame of pandas.

        Raises:
            PoolError: a file cannot be read.
            BadConfig: pandas is not installed.
        """
        try:
            importlib.import_module("pandas")
        except ImportError:
            raise BadConfig("to_pandas needs pandas; pip install pandas, or use to_arrow()") from None
        return self.to_arrow().to_pandas()

    def names(self) -> Iterator[Name]:
        """Names of the scenarios of all rows, in their order.

        Raises:
            PoolError: a file cannot be read.
        """
        return (Name(*values) for values in self.columns("task", "split", "index", "id"))

    def kinds(self, name: str) -> tuple[list[str], NDArray[np.int32]]:
        """The different texts in a column such as `split`, and which of them each row has, shape (n,).

        Raises:
            PoolError: as `directory`, or there are too many texts.
        """
        return self._reader.categories(name)

    @cached_property
    def directory(self) -> Directory:
        """Ids and indices of the scenarios of all rows, read once.

        Raises:
            PoolError: a file cannot be read, or holds a different number of rows than the manifest says.
        """
        if len(self) > MAX_ROWS:
            raise PoolError(f"{self.folder} promises {len(self)} scenarios; at most {MAX_ROWS} are found by their ids")
        return self._reader.directory()

    # --- some of the rows -----------------------------------------------------------------------------

    def some(self, places: Iterable[int], witness: bool = True) -> Iterator[AnyRow]:
        """The rows at some places, counted from 0 in their order; no others are unpacked.

        Args:
            places: increasing within a hundred neighbours, so that these are read once.

        Raises:
            PoolError: a file cannot be read.
        """
        return map(self._row, self._reader.rows_at(places, self._names(witness)))

    def at(self, place: int, witness: bool = True) -> AnyRow:
        """The row at a place, counted from 0 in their order.

        Raises:
            IndexError: it does not exist.
            PoolError: its file cannot be read.
        """
        if not 0 <= place < len(self):
            raise IndexError(f"{self.folder} holds {len(self)} scenarios, numbered from 0; there is none at {place}")
        return next(self.some([place], witness))

    def name_at(self, place: int) -> Name:
        """Name of the scenario at a place."""
        return Name(*next(self.columns("task", "split", "index", "id", places=[place])))

    def row(self, name: str) -> AnyRow:
        """The first row of a scenario's name such as `domino_single/wide_gaps@3/8ed4a4577fe0`, its id, or a unique
        prefix of its id.

        The id counts; a warning reports a name that contradicts it (`names.Misnamed`).

        Raises:
            UnknownName: it does not exist.
            BadConfig: there is more than one.
        """
        return self.at(self.directory.find(name, self.name_at, str(self.folder)))

    def _rows_of_file(self, entry: FileEntry | None) -> Iterator[AnyRow]:
        """The rows of a file in the folder of the shards; none if there is no such file."""
        return map(self._row, Reader([] if entry is None else [self._shard(entry)]).rows(self._names()))

    def _names(self, witness: bool = True) -> tuple[str, ...]:
        return layout(self.ROW).names if witness else layout(self.ROW).without_witness

    def _row(self, values: dict[str, Any]) -> Any:
        return self.ROW(**{"witness": NO_WITNESS, **values})

    @cached_property
    def _identities(self) -> dict[Path, Identity]:
        """Identities of the files whose hashes were compared."""
        return {}

    @cached_property
    def _reader(self) -> Reader:
        return Reader([self._shard(entry) for entry in self.manifest.shards])

    def _shard(self, entry: FileEntry) -> Shard:
        return Shard(self._home / entry.file, entry.rows, self._identities, layout(self.ROW))

    def __getstate__(self) -> dict[str, Any]:
        """State for another process: where the rows are, and not what was read of them."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

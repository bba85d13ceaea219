"""A pool on disk: a folder with a manifest and Parquet shards.

A pool is data only: nothing in it is executed, imported or opened by its name. Everything that is read has passed the
rules of `scengen.pool.untrusted`.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import PoolError, UnknownName
from .directory import Directory
from .files import Identity, sha256_of_file, why_damaged
from .manifest import MANIFEST, FileEntry, Manifest
from .names import Name
from .reader import MAX_ROWS, Reader
from .row import NAMES, NO_WITNESS, WITHOUT_WITNESS, PoolRow
from .shards import Shard


@dataclass(frozen=True)
class Pool:
    """A finished pool, opened for reading."""

    folder: Path
    manifest: Manifest

    @classmethod
    def open(cls, folder: str | Path) -> "Pool":
        """Open a pool by its folder.

        Raises:
            PoolError: there is no finished pool of a known format.
        """
        folder = Path(folder)
        return cls(folder, Manifest.read(folder))

    def __len__(self) -> int:
        """Number of scenarios, by the manifest."""
        return self.manifest.scenarios

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.manifest.task

    @property
    def split(self) -> str:
        return self.manifest.config.split

    # --- files ----------------------------------------------------------------------------------------

    @property
    def sha256(self) -> str:
        """Hash of the manifest, which holds the hash of every shard: equal hashes mean equal pools."""
        return sha256_of_file(self.folder / MANIFEST)

    def damaged(self) -> dict[str, str]:
        """Faults of the files, by name; empty for a sound pool. From now on only the very files are read that were
        compared: a file that is replaced or written afterwards cannot be read."""
        faults = ((entry.file, why_damaged(self.folder, entry, self._identities)) for entry in self.manifest.files)
        return {name: why for name, why in faults if why}

    def check(self) -> "Pool":
        """Raise `PoolError` unless every file is what the manifest says."""
        for name, what in self.damaged().items():
            raise PoolError(f"{self.folder / name} {what}; restore it or generate the pool again")
        return self

    # --- all scenarios, in the order of their indices ----------------------------------------------

    def rows(self, witness: bool = True) -> Iterator[PoolRow]:
        """All scenarios in the order of their indices.

        Args:
            witness: whether to read the witnesses, most of a pool's bytes; without them each is `NO_WITNESS`.

        Raises:
            PoolError: a shard cannot be read.
        """
        return map(_row, self._reader.rows(NAMES if witness else WITHOUT_WITNESS))

    def columns(self, *names: str, places: Iterable[int] | None = None) -> Iterator[tuple[Any, ...]]:
        """A few columns of the scenarios, with the values of `PoolRow`'s fields; quicker than `rows`.

        Args:
            places: places of some scenarios only, see `some`.

        Raises:
            UnknownName: there is no such column, or it is the witness.
            PoolError: a shard cannot be read.
        """
        for name in names:
            if name not in WITHOUT_WITNESS:
                raise UnknownName("light column of a pool", name, WITHOUT_WITNESS)
        for values in self._reader.rows(names) if places is None else self._reader.rows_at(places, names):
            yield tuple(values[name] for name in names)

    def names(self) -> Iterator[Name]:
        """Names of all scenarios in the order of their indices.

        Raises:
            PoolError: a shard cannot be read.
        """
        return (Name(*told) for told in self.columns("task", "split", "index", "id"))

    def kinds(self, name: str) -> tuple[list[str], NDArray[np.int32]]:
        """The different texts in a column such as `split`, and which of them each scenario has, shape (n,).

        Raises:
            PoolError: as `directory`, or there are too many texts.
        """
        return self._reader.categories(name)

    @cached_property
    def directory(self) -> Directory:
        """Ids and indices of all scenarios, read once.

        Raises:
            PoolError: a shard cannot be read, or holds another number of scenarios than the manifest says.
        """
        if len(self) > MAX_ROWS:
            raise PoolError(f"{self.folder} promises {len(self)} scenarios; at most {MAX_ROWS} are found by their ids")
        return self._reader.directory()

    def rejects(self) -> Iterator[PoolRow]:
        """Scenarios that were kept although they were not certified (`keep=`), in the order of their indices.

        Raises:
            PoolError: their file cannot be read.
        """
        entry = self.manifest.rejected
        return map(_row, Reader([] if entry is None else [self._shard(entry)]).rows(NAMES))

    # --- some of the scenarios ------------------------------------------------------------------------

    def some(self, places: Iterable[int], witness: bool = True) -> Iterator[PoolRow]:
        """The scenarios at some places, counted from 0 in the order of indices; no others are unpacked.

        Args:
            places: increasing within a hundred neighbours, so that these are read once.

        Raises:
            PoolError: a shard cannot be read.
        """
        return map(_row, self._reader.rows_at(places, NAMES if witness else WITHOUT_WITNESS))

    def at(self, place: int, witness: bool = True) -> PoolRow:
        """The scenario at a place, counted from 0 in the order of indices.

        Raises:
            IndexError: there is none.
            PoolError: its shard cannot be read.
        """
        if not 0 <= place < len(self):
            raise IndexError(f"{self.folder} holds {len(self)} scenarios, numbered from 0; there is none at {place}")
        return next(self.some([place], witness))

    def name_at(self, place: int) -> Name:
        """Name of the scenario at a place."""
        return Name(*next(self.columns("task", "split", "index", "id", places=[place])))

    def row(self, name: str) -> PoolRow:
        """The scenario of a name such as `domino_single/wide_gaps@3/8ed4a4577fe0`, an id, or a unique prefix of an id.

        The id counts; a warning reports a name that contradicts it (`names.Misnamed`).

        Raises:
            UnknownName: there is none.
            BadConfig: there is more than one.
        """
        return self.at(self.directory.find(name, self.name_at, str(self.folder)))

    def of_index(self, index: int) -> PoolRow:
        """The scenario that was drawn at an index.

        Raises:
            PoolError: there is none; the other indices were not certified.
        """
        place = self.directory.of_index(index)
        if place is None:
            tried = f"{self.manifest.indices} indices were tried"
            raise PoolError(f"{self.folder} holds no scenario of index {index}; {tried}")
        return self.at(place)

    @cached_property
    def _identities(self) -> dict[Path, Identity]:
        """Identities of the files whose hashes were compared."""
        return {}

    @cached_property
    def _reader(self) -> Reader:
        return Reader([self._shard(entry) for entry in self.manifest.shards])

    def _shard(self, entry: FileEntry) -> Shard:
        return Shard(self.folder / entry.file, entry.rows, self._identities)

    def __getstate__(self) -> dict[str, Any]:
        """What goes to another process: where the pool is, and not what was read of it."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


def _row(values: dict[str, Any]) -> PoolRow:
    return PoolRow(**{"witness": NO_WITNESS, **values})

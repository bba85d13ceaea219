"""A pool on disk: a folder with a manifest and Parquet shards.

A pool is data only: nothing in it is executed, imported or opened by its name. Everything that is read has passed the
rules of `scengen.pool.untrusted`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from .. import html_tables
from ..errors import PoolError
from .manifest import MANIFEST, Manifest
from .row import PoolRow
from .rows import StoredRows


@dataclass(frozen=True, repr=False)
class Pool(StoredRows[Manifest, PoolRow]):
    """A finished pool, opened for reading: its scenarios in the order of their indices."""

    ROW = PoolRow
    MANIFEST = MANIFEST
    REMEDY = "generate the pool again"

    @classmethod
    def open(cls, folder: str | Path) -> "Pool":
        """Open a pool by its folder.

        Raises:
            PoolError: there is no finished pool of a known format.
        """
        return cls(Path(folder), Manifest.read(Path(folder)))

    def _repr_html_(self) -> str:
        """Its first scenarios, in a notebook."""
        values = ("params", "parameters") if self.split == "id" else ("shifted", "changed by the axis")
        title = f"{self.folder}: {len(self)} certified scenarios of {self.task}/{self.split}"
        rows = self.columns("index", "id", values[0])
        return html_tables.table(title, ("index", "id", values[1]), rows, len(self))

    def rejects(self) -> Iterator[PoolRow]:
        """Scenarios that were kept although they were not certified (`keep=`), in the order of their indices.

        Raises:
            PoolError: their file cannot be read.
        """
        return self._rows_of_file(self.manifest.rejected)

    def of_index(self, index: int) -> PoolRow:
        """The scenario that was drawn at an index.

        Raises:
            PoolError: it does not exist; the other indices were not certified.
        """
        place = self.directory.of_index(index)
        if place is None:
            tried = f"{self.manifest.indices} indices were tried"
            raise PoolError(f"{self.folder} holds no scenario of index {index}; {tried}")
        return self.at(place)

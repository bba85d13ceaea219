"""Scenarios of one pool or several, found by their names and read one by one."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Generic, overload

import numpy as np
from numpy.typing import NDArray

from ..errors import UnknownName
from .directory import Directory, joined
from .names import Name
from .rows import AnyRow, StoredRows

KEPT_ROWS = 100
"""Number of rows that are kept in memory after they were read; each has the text of a scene."""


class Library(Sequence[AnyRow], Generic[AnyRow]):
    """Scenarios of some pools without witnesses, each once, in the order of the pools. Rows are read when used."""

    def __init__(self, pools: Sequence[StoredRows[Any, AnyRow]], places: NDArray[np.int64] | None = None):
        """
        Args:
            places: places of rows, counted through the pools one after the other; None for all rows.
        """
        self.pools, self._starts = pools, np.cumsum([0, *map(len, pools)])
        every = np.arange(self._starts[-1]) if places is None else places
        whole = joined([pool.directory for pool in pools])
        _, first = np.unique(whole.ids[every], return_index=True)
        self.places = every[np.sort(first)]
        self.directory = Directory(whole.ids[self.places], whole.indices[self.places])

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, number: int) -> AnyRow: ...

    @overload
    def __getitem__(self, number: slice) -> list[AnyRow]: ...

    def __getitem__(self, number: int | slice) -> AnyRow | list[AnyRow]:
        if isinstance(number, slice):
            return [self._read(k) for k in range(*number.indices(len(self)))]
        return self._read(range(len(self))[number])

    def __iter__(self) -> Iterator[AnyRow]:
        for pool, places in self._by_pool():
            yield from pool.some(places, witness=False)

    def columns(self, *names: str) -> Iterator[tuple[Any, ...]]:
        """A few columns of all scenarios, see `StoredRows.columns`."""
        for pool, places in self._by_pool():
            yield from pool.columns(*names, places=places)

    def folder_of(self, id_: str) -> Path:
        """Folder of the pool that holds the scenario of an id."""
        return self.pools[self.source(self.find(id_))].folder

    def source(self, number: int) -> int:
        """Number of the pool that holds a scenario."""
        return self._located(number)[0]

    def name(self, number: int) -> Name:
        """Name of a scenario."""
        which, place = self._located(number)
        return self.pools[which].name_at(place)

    def find(self, text: str) -> int:
        """Number of the scenario of a name, an id, or a unique prefix of an id, see `StoredRows.row`.

        Raises:
            UnknownName: it does not exist.
            BadConfig: several ids start with the text.
        """
        return self.directory.find(text, self.name, "these pools")

    def of_split(self, split: str) -> "Library[AnyRow]":
        """The scenarios of one split.

        Raises:
            UnknownName: they do not exist.
        """
        if split not in (known := self.kinds("split")):
            raise UnknownName("split in these pools", split, known)
        return Library(self.pools, np.intersect1d(self.places, known[split]))

    def kinds(self, name: str) -> dict[str, NDArray[np.int64]]:
        """The different texts in a column such as `split`, and the places of the rows that have each."""
        found: dict[str, list[NDArray[np.int64]]] = {}
        for pool, start in zip(self.pools, self._starts[:-1], strict=True):
            texts, codes = pool.kinds(name)
            for code, text in enumerate(texts):
                found.setdefault(text, []).append(start + np.flatnonzero(codes == code))
        return {text: np.concatenate(places) for text, places in found.items()}

    def only(self, number: int) -> "Library[AnyRow]":
        """One scenario alone."""
        return Library(self.pools, self.places[[number]])

    @cached_property
    def _read(self) -> Callable[[int], AnyRow]:
        @lru_cache(KEPT_ROWS)
        def read(number: int) -> AnyRow:
            which, place = self._located(number)
            return self.pools[which].at(place, witness=False)

        return read

    def witness(self, number: int) -> NDArray[np.float32]:
        """Witness of a scenario, shape (n, 7 * arms)."""
        which, place = self._located(number)
        return self.pools[which].at(place).witness

    def _located(self, number: int) -> tuple[int, int]:
        """Pool of a scenario, and its place there."""
        place = int(self.places[number])
        which = int(np.searchsorted(self._starts, place, side="right")) - 1
        return which, place - int(self._starts[which])

    def _by_pool(self) -> Iterator[tuple[StoredRows[Any, AnyRow], list[int]]]:
        """Every pool with places of its own rows, increasing."""
        which = np.searchsorted(self._starts, self.places, side="right") - 1
        for k in dict.fromkeys(which.tolist()):
            yield self.pools[k], (self.places[which == k] - self._starts[k]).tolist()


def names(pools: Iterable[StoredRows[Any, Any]], ids: Iterable[str]) -> Mapping[str, str]:
    """Names for people of some scenarios of some pools, by id."""
    missing, found = set(ids), dict[str, str]()
    for pool in pools:
        for id_ in sorted(missing - found.keys()):
            if places := pool.directory.beginning(id_):
                found[id_] = str(pool.name_at(places[0]))
    return found

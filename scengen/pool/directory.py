"""The index of a pool: ids and indices of all rows, in the order of the rows. A million of them take 20 MB."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .names import Name, find

NEIGHBOURS = 5000
"""Number of ids on either side of an unknown id, in alphabetical order, among which the nearest one is looked for."""


@dataclass(frozen=True, eq=False)
class Directory:
    """Ids and indices of scenarios, in the order of their rows."""

    ids: NDArray[np.bytes_]
    """Ids, shape (n,), twelve characters each."""
    indices: NDArray[np.int64]
    """Indices, shape (n,)."""

    def __len__(self) -> int:
        return len(self.ids)

    @cached_property
    def _order(self) -> NDArray[np.int64]:
        return np.argsort(self.ids, kind="stable")

    @cached_property
    def _sorted(self) -> NDArray[np.bytes_]:
        return self.ids[self._order]

    def id(self, place: int) -> str:
        """The id of a row."""
        return self.ids[place].decode()

    def beginning(self, start: str) -> Sequence[int]:
        """Places of the rows whose ids begin with `start`, the first row of each id, in the order of the rows."""
        low, high = (np.searchsorted(self._sorted, text.encode("ascii", "replace")) for text in (start, start + "~"))
        _, first = np.unique(self._sorted[low:high], return_index=True)
        return np.sort(self._order[low:high][first]).tolist()

    def alike(self, start: str) -> list[str]:
        """Ids to compare with an unknown one: all, or, in a large pool, those next to it in alphabetical order."""
        middle = int(np.searchsorted(self._sorted, start.encode("ascii", "replace")))
        return [id_.decode() for id_ in self._sorted[max(0, middle - NEIGHBOURS) : middle + NEIGHBOURS].tolist()]

    def of_index(self, index: int) -> int | None:
        """Place of the first row with an index; None if there is none."""
        found = np.flatnonzero(self.indices == index)
        return int(found[0]) if len(found) else None

    @property
    def repeated(self) -> str:
        """An id of more than one row; empty if there is none."""
        same = np.flatnonzero(self._sorted[1:] == self._sorted[:-1])
        return self.id(int(self._order[same[0]])) if len(same) else ""

    def find(self, text: str, name: Callable[[int], Name], where: str) -> int:
        """Place of the scenario of a name, see `names.find`.

        Args:
            name: gives the name of the scenario at a place.
        """
        return find(text, self, name, where)


def joined(several: Sequence[Directory]) -> Directory:
    """Several directories one after the other."""
    ids = np.concatenate([np.zeros(0, "S12"), *(one.ids for one in several)])
    return Directory(ids, np.concatenate([np.zeros(0, np.int64), *(one.indices for one in several)]))

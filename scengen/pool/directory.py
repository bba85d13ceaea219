"""Which scenarios a pool holds, and where: ids and indices of all rows, a million of them in 20 MB."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .names import Name, find

ALIKE = 5000
"""Ids on either side of what was asked for among which the nearest one is looked for."""


@dataclass(frozen=True, eq=False)
class Directory:
    """Ids and indices of scenarios, in the order of their rows."""

    ids: NDArray[np.bytes_]
    """Shape (n,), twelve letters each."""
    indices: NDArray[np.int64]
    """Shape (n,)."""

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
        """Places of the rows whose ids begin so, the first of each id, in the order of the rows."""
        low, high = (np.searchsorted(self._sorted, text.encode("ascii", "replace")) for text in (start, start + "~"))
        _, first = np.unique(self._sorted[low:high], return_index=True)
        return np.sort(self._order[low:high][first]).tolist()

    def alike(self, start: str) -> list[str]:
        """Ids among which the one that was meant may be: all, or of many those that begin nearly so."""
        middle = int(np.searchsorted(self._sorted, start.encode("ascii", "replace")))
        return [id_.decode() for id_ in self._sorted[max(0, middle - ALIKE) : middle + ALIKE].tolist()]

    def of_index(self, index: int) -> int | None:
        """Place of the first row with an index; None if there is none."""
        found = np.flatnonzero(self.indices == index)
        return int(found[0]) if len(found) else None

    @property
    def twice(self) -> str:
        """An id that stands in two rows; empty if there is none."""
        same = np.flatnonzero(self._sorted[1:] == self._sorted[:-1])
        return self.id(int(self._order[same[0]])) if len(same) else ""

    def find(self, text: str, name: Callable[[int], Name], where: str) -> int:
        """Place of the scenario of a name, see `names.find`.

        Args:
            name: of the scenario at a place.
        """
        return find(text, self, name, where)


def joined(several: Sequence[Directory]) -> Directory:
    """Those of several pools one after the other."""
    ids = np.concatenate([np.zeros(0, "S12"), *(one.ids for one in several)])
    return Directory(ids, np.concatenate([np.zeros(0, np.int64), *(one.indices for one in several)]))

"""Names of scenarios for people: `domino_single/wide_gaps@3/8ed4a4577fe0` is task/split@index/id.

The id, a hash of all parameter values, decides which scenario is meant. What stands before it tells where the scenario
was drawn. Files and columns hold ids alone.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from ..errors import BadConfig, ScengenError, UnknownName, cut, nearest

SHOWN = 20
"""How many names an error lists."""


class Misnamed(UserWarning):
    """A name with the id of one scenario and the task, split or index of another."""


class NoScenario(UnknownName):
    """No id begins as asked for."""

    def __init__(self, text: str, close: str, known: str, where: str):
        ScengenError.__init__(self, f"no scenario in {where} named {cut(repr(text))}{close}; known: {known}")


@dataclass(frozen=True)
class Name:
    """Which scenario, and where it was drawn."""

    task: str
    split: str
    """With its severities: in `wide_gaps@2@7` the index is 7."""
    index: int
    id: str

    def __str__(self) -> str:
        return f"{self.task}/{self.split}@{self.index}/{self.id}"


class Known(Protocol):
    """Scenarios among which one is looked for; each has a place."""

    def __len__(self) -> int: ...

    def beginning(self, start: str) -> Sequence[int]:
        """Places of those whose ids begin so, one for each id."""
        ...

    def alike(self, start: str) -> Sequence[str]:
        """Ids among which the one that was meant may be."""
        ...


def find(text: str, known: Known, name: Callable[[int], Name], where: str) -> int:
    """Place of the scenario of that name, or whose id begins so.

    Warns (`Misnamed`) of a name that is wrong about its id.

    Args:
        name: of the scenario at a place.
        where: the scenarios are, for errors.

    Raises:
        NoScenario: there is none.
        BadConfig: there is more than one.
    """
    before, _, start = text.rpartition("/")
    found = known.beginning(start) if start else []
    if not found:
        raise NoScenario(text, nearest(start, known.alike(start)), _listed(range(len(known)), name), where)
    if len(found) > 1:
        told = f"{cut(repr(text))} begins {len(found)} ids in {where}; give more of one: {_listed(found, name)}"
        raise BadConfig(told)
    if before and not str(called := name(found[0])).startswith(f"{before}/"):
        told = f"{cut(text)} is {called}: the id counts, what stands before it is wrong"
        warnings.warn(told, Misnamed, stacklevel=3)
    return found[0]


def _listed(places: Sequence[int], name: Callable[[int], Name]) -> str:
    more = ["..."] if len(places) > SHOWN else []
    return ", ".join([*(str(name(place)) for place in places[:SHOWN]), *more]) or "(none)"

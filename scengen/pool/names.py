"""Names of scenarios for people: `domino_single/wide_gaps@3/8ed4a4577fe0` is task/split@index/id.

The id, a hash of all parameter values, decides which scenario is meant. The text before it says where the scenario was
drawn. Files and columns hold ids alone.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from ..errors import BadConfig, ScengenError, UnknownName, cut, nearest

LISTED = 20
"""Number of names that an error lists."""


class Misnamed(UserWarning):
    """A name has the id of one scenario and the task, split or index of another."""


class NoScenario(UnknownName):
    """No id starts with the given text."""

    def __init__(self, text: str, close: str, known: str, where: str):
        ScengenError.__init__(self, f"no scenario in {where} named {cut(repr(text))}{close}; known: {known}")


@dataclass(frozen=True)
class Name:
    """Identity of a scenario, and where it was drawn."""

    task: str
    split: str
    """Split with its severities: in `wide_gaps@2@7` the index is 7."""
    index: int
    id: str

    def __str__(self) -> str:
        return f"{self.task}/{self.split}@{self.index}/{self.id}"


class Known(Protocol):
    """Scenarios that can be searched; each has a place."""

    def __len__(self) -> int: ...

    def beginning(self, start: str) -> Sequence[int]:
        """Places of the scenarios whose ids begin with `start`, one for each id."""
        ...

    def alike(self, start: str) -> Sequence[str]:
        """Ids to compare with an unknown one."""
        ...


def find(text: str, known: Known, name: Callable[[int], Name], where: str) -> int:
    """Place of the scenario of a name, an id, or a unique prefix of an id.

    Warns (`Misnamed`) of a name that contradicts its id.

    Args:
        name: gives the name of the scenario at a place.
        where: description of `known`, for errors.

    Raises:
        NoScenario: it does not exist.
        BadConfig: there is more than one.
    """
    before, _, start = text.rpartition("/")
    found = known.beginning(start) if start else []
    if not found:
        raise NoScenario(text, nearest(start, known.alike(start)), _listed(range(len(known)), name), where)
    if len(found) > 1:
        message = f"{cut(repr(text))} is a prefix of {len(found)} ids in {where}; give more characters"
        raise BadConfig(f"{message}: {_listed(found, name)}")
    if before and not str(called := name(found[0])).startswith(f"{before}/"):
        message = f"{cut(text)} is {called}: the id counts, the text before it is wrong"
        warnings.warn(message, Misnamed, stacklevel=3)
    return found[0]


def _listed(places: Sequence[int], name: Callable[[int], Name]) -> str:
    more = ["..."] if len(places) > LISTED else []
    return ", ".join([*(str(name(place)) for place in places[:LISTED]), *more]) or "(none)"

"""Names of scenarios for people: `domino_single/wide_gaps@3/8ed4a4577fe0` is task/split@index/id.

The id, a hash of all parameter values, decides which scenario is meant. What stands before it tells where the scenario
was drawn. Files and columns hold ids alone.
"""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from .errors import BadConfig, ScengenError, UnknownName, cut, nearest

SHOWN = 20
"""How many names an error lists."""


class Misnamed(UserWarning):
    """A name with the id of one scenario and the task, split or index of another."""


class NoScenario(UnknownName):
    """No id begins as asked for."""

    def __init__(self, text: str, start: str, known: Sequence["Name"], where: str):
        close = nearest(start, (name.id for name in known))
        ScengenError.__init__(self, f"no scenario in {where} named {cut(repr(text))}{close}; known: {_listed(known)}")


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


def find(text: str, known: Iterable[Name], where: str) -> Name:
    """The scenario of that name, or whose id begins so. Warns (`Misnamed`) of a name that is wrong about its id.

    Args:
        where: the scenarios are, for errors.

    Raises:
        NoScenario: there is none.
        BadConfig: there is more than one.
    """
    before, _, start = text.rpartition("/")
    names = list(known)
    found = [name for name in names if name.id.startswith(start)] if start else []
    if not found:
        raise NoScenario(text, start, names, where)
    if len(found) > 1:
        raise BadConfig(f"{cut(repr(text))} begins {len(found)} ids in {where}; give more of one: {_listed(found)}")
    (name,) = found
    if before and not str(name).startswith(f"{before}/"):
        warnings.warn(f"{cut(text)} is {name}: the id counts, what stands before it is wrong", Misnamed, stacklevel=3)
    return name


def _listed(names: Sequence[Name]) -> str:
    return ", ".join([*map(str, names[:SHOWN]), *(["..."] if len(names) > SHOWN else [])]) or "(none)"

"""Decisions that a solution of a task depends on, stated by its family for the cue audit (`scengen axis cues`)."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class _Decision:
    """Base of decisions: what the right answer is meant to follow from."""

    by: tuple[str, ...] = ()
    """Sources that the right answer is meant to follow from: parameters, groups of them such as `cube`, or patterns of
    visible quantities such as `ball_*.redness` (`scengen.ood.cues.quantities`).

    A visible quantity is intended if it matches a source or depends on one. A parameter that states an answer
    (`param(answer=True)`) is not a source.
    """


@dataclass(frozen=True, kw_only=True)
class Choice(_Decision):
    """Decision with one right answer among a few, such as a side or the index of a lane."""

    value: Hashable
    """Right answer."""


@dataclass(frozen=True, kw_only=True)
class Span(_Decision):
    """Decision about one number that is right within an interval."""

    low: float
    """Lowest right value [its unit]."""
    high: float
    """Highest right value [its unit]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Near(_Decision):
    """Decision about a place on the table that is right within a distance."""

    at: ArrayLike
    """Right place, shape (2,) or (3,), of which x and y count [m]."""
    within: float
    """Largest distance from it that is right [m]."""


Decision = Choice | Span | Near
"""One decision in one scenario."""


def choice(value: Hashable, *by: str) -> Choice:
    """A decision with the right answer `value`. See `Choice` and `by`."""
    return Choice(by, value=value)


def span(low: float, high: float, *by: str) -> Span:
    """A decision about a number between `low` and `high` [its unit]. See `Span` and `by`."""
    return Span(by, low=float(low), high=float(high))


def around(middle: float, within: float, *by: str) -> Span:
    """A decision about a number at most `within` away from `middle` [its unit]. See `Span` and `by`."""
    return span(middle - within, middle + within, *by)


def near(at: ArrayLike, within: float, *by: str) -> Near:
    """A decision about a place at most `within` [m] away from `at` [m]. See `Near` and `by`."""
    return Near(by, at=at, within=float(within))


def side_of(value: float) -> str:
    """Side of a signed number: `left` if it is positive, else `right`."""
    return "left" if value > 0 else "right"


def places(decisions: Sequence[Near]) -> NDArray[np.float64]:
    """Right places of decisions, shape (n, 2) [m]."""
    return np.array([np.asarray(one.at, float)[:2] for one in decisions])

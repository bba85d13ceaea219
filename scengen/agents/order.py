"""Partial orders over sub-goals: every linear extension is a right plan."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property


@dataclass(frozen=True)
class Subgoal:
    """One step of a plan: a physical outcome, with the conditions before and after it."""

    outcome: str
    """Physical state that it brings about."""
    objects: list[str] = field(default_factory=list)
    """Neutral names of the objects that it is about."""
    needs: list[str] = field(default_factory=list)
    """Conditions that must hold before. Those that no sub-goal gives hold at the start."""
    gives: list[str] = field(default_factory=list)
    """Conditions that hold after it."""
    senses: bool = False
    """Whether it brings information that a later sub-goal needs."""
    optional: bool = False
    """Whether a right plan may leave it out."""
    repeats: bool = False
    """Whether a right plan may have it several times, as a trial and a look at its result."""

    @property
    def again(self) -> bool:
        """Whether a right plan may have it several times: to look twice is never wrong."""
        return self.repeats or self.senses


@dataclass(frozen=True)
class Order:
    """Sub-goals and the pairs of them that have an order."""

    subgoals: Mapping[str, Subgoal]
    """Sub-goals of the canonical plan (paper, App. B) by name, in one of the right orders."""
    wrong: Mapping[str, str]
    """Sub-goals that tempt and are not possible or not allowed here, by name, with their outcomes."""

    @property
    def required(self) -> tuple[str, ...]:
        """Names of the sub-goals that every right plan has, in one of the right orders."""
        return tuple(name for name, subgoal in self.subgoals.items() if not subgoal.optional)

    @property
    def sensing(self) -> frozenset[str]:
        """Names of the sub-goals that bring information."""
        return frozenset(name for name, subgoal in self.subgoals.items() if subgoal.senses)

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the sub-goals of right plans that need a move."""
        return tuple(name for name, subgoal in self.subgoals.items() if not subgoal.senses)

    @cached_property
    def sensed(self) -> frozenset[str]:
        """Conditions that only sub-goals which bring information give."""
        given = {
            senses: {c for s in self.subgoals.values() if s.senses == senses for c in s.gives}
            for senses in (False, True)
        }
        return frozenset(given[True] - given[False])

    @property
    def vocabulary(self) -> dict[str, str]:
        """Outcomes of all sub-goals by name, the wrong ones among them, in alphabetical order."""
        right = {name: subgoal.outcome for name, subgoal in self.subgoals.items()}
        return dict(sorted({**right, **self.wrong}.items()))

    @property
    def conditions(self) -> tuple[str, ...]:
        """All conditions in alphabetical order."""
        return tuple(sorted({c for s in self.subgoals.values() for c in (*s.needs, *s.gives)}))

    @cached_property
    def before(self) -> frozenset[tuple[str, str]]:
        """Pairs of names of which the first one must come before the second one: it gives what the second one needs.

        The relation is transitively closed.
        """
        pairs = {
            (one, other)
            for one, giver in self.subgoals.items()
            for other, taker in self.subgoals.items()
            if one != other and set(giver.gives) & set(taker.needs)
        }
        while further := {(a, d) for a, b in pairs for c, d in pairs if b == c} - pairs:
            pairs |= further
        return frozenset(pairs)

"""The means of a task: what its intended solution does, as named facts that are measured in every episode.

Means are positive. Instead of ending an episode that goes another way, they say of a success whether the intended
solution led to it. What they have found is part of a world's state: it is saved, restored and replayed with it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from .errors import UnknownName
from .sim.world import MAX_MEANS, World

Condition = Callable[[World], bool]
"""Question about the past control period and the present state."""
OPEN = 0.0
"""Nothing is known of a mean yet."""
SHOWN = 1.0
"""A mean was there."""
MISSED = -1.0
"""The time of a mean has passed without it."""


@dataclass(frozen=True)
class Mean:
    """One fact. At the goal it must be shown, or still open if `lasting`."""

    judge: Callable[[World], float]
    """Function that decides in every control period while the mean is open: `OPEN`, `SHOWN` or `MISSED`."""
    lasting: bool = False
    """Whether the fact must hold all the time, so that an open mean counts at the goal."""
    after: str = ""
    """Name of another mean that must have been shown before this one is judged; empty if there is none."""

    def found(self, world: World, note: Callable[[UnknownName], object] = lambda error: None) -> float:
        """What is found out about an open mean now. In a scene without a body that it is about, it is missed.

        Args:
            note: called with the error that says which body that is.
        """
        try:
            return self.judge(world)
        except UnknownName as error:
            note(error)
            return MISSED


def once(holds: Condition, after: str = "") -> Mean:
    """A fact that is shown when it is true for the first time.

    Args:
        after: name of the mean that must have been shown before.
    """
    return Mean(lambda world: SHOWN if holds(world) else OPEN, after=after)


def when(moment: Condition, holds: Condition, after: str = "") -> Mean:
    """A fact that must be true at a moment, which is the first period in which `moment` is.

    Args:
        after: name of the mean that must have been shown before; the moment is looked for from then on.
    """
    return Mean(lambda world: (SHOWN if holds(world) else MISSED) if moment(world) else OPEN, after=after)


def throughout(holds: Condition, after: str = "") -> Mean:
    """A fact that must be true in every period up to the goal.

    Args:
        after: name of a mean; the fact must be true from the period on in which that was shown.
    """
    return Mean(lambda world: OPEN if holds(world) else MISSED, lasting=True, after=after)


class Watch:
    """What an episode has shown of the means of its task."""

    def __init__(self, means: Mapping[str, Mean], world: World):
        """
        Raises:
            ValueError: there are more than `world.MAX_MEANS`.
        """
        if len(means) > MAX_MEANS:
            raise ValueError(f"a task has at most {MAX_MEANS} means, not {len(means)}")
        self.means, self.world = means, world
        self.unknown: list[UnknownName] = []
        """Errors about bodies that means name and the scene does not have."""
        self._numbers = {name: number for number, name in enumerate(means)}
        self._order = [(number, mean, self._numbers.get(mean.after)) for number, mean in enumerate(means.values())]

    def update(self) -> None:
        """Judge the past control period."""
        world, shown = self.world, self.world.shown
        for number, mean, before in self._order:
            if shown.item(number) == OPEN and (before is None or shown.item(before) == SHOWN):
                shown[number] = mean.found(world, self.unknown.append)

    def found(self) -> dict[str, float]:
        """What is found out about each mean so far: `OPEN`, `SHOWN` or `MISSED`."""
        return {name: float(self.world.shown[number]) for name, number in self._numbers.items()}

    @property
    def missed(self) -> str:
        """Names of the means that were missed, joined by semicolons; empty if none was. A missed mean stays missed."""
        return "; ".join(name for name, number in self._numbers.items() if self.world.shown[number] == MISSED)

    def lacking(self) -> str:
        """Names of the means that a success now lacks, joined by semicolons; empty for a success by the means."""
        return "; ".join(name for name, mean in self.means.items() if not self._has(name, mean))

    def _has(self, name: str, mean: Mean) -> bool:
        found = self.world.shown[self._numbers[name]]
        ready = not mean.after or self.world.shown[self._numbers[mean.after]] == SHOWN
        return bool(found == SHOWN or (mean.lasting and ready and found == OPEN))

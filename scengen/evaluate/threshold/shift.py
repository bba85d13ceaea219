"""A shift that grows from level to level: an axis of a task, or a kind of perturbation."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...compose import load_task
from ...envs.observations import cameras_of, requested
from ...errors import BadConfig, UnknownName
from ...evidence import ledger
from ...look.looks import look_named
from ...params import Value
from ...perturb.effects import CONTROL
from ...perturb.kinds import kinds
from ...perturb.perturbation import NONE, Perturbation
from ...samplers.axis import Axis
from ...samplers.dists import Fixed
from ...samplers.split import ID, Part
from ...samplers.task import Task, load

LEVELS = 5
"""Number of levels of an axis that has no severities."""
MAX_LEVELS = 20
"""Largest number of levels: the candidates of a search take 16 MB for so many."""
TOLERANCE = 1e-9
"""Largest difference between the value of an axis in a pool and that of its level."""


@dataclass(frozen=True)
class Shift:
    """What grows from level to level. Level 0 is without a shift."""

    task: Task
    """The task; an axis has as many severities as there are levels."""
    name: str
    """Name of the axis or of the kind of perturbation."""
    levels: int
    """Number of levels."""

    @classmethod
    def of(cls, task: str, along: str, levels: int | None = None, search: Sequence[str] = ()) -> "Shift":
        """The shift of that name.

        Args:
            levels: number of levels of an axis; by default its severities, or 5.
            search: folders of other packages, see `task_files.search_path`.

        Raises:
            UnknownName: the task has no such axis, and there is no such kind.
            BadConfig: the axis has no such levels.
        """
        found = load_task(task, search)
        if along in found.axes:
            count = levels or found.axes[along].severities or LEVELS
            if count > MAX_LEVELS:
                raise BadConfig(f"axis {along} of {task} has {count} severities; pass levels={MAX_LEVELS} or fewer")
            return cls(_with_severities(found, along, count), along, count)
        if along not in kinds():
            raise UnknownName(f"axis or perturbation of {task}", along, [*found.axes, *kinds()])
        strengths = kinds()[along].strengths
        if levels not in (None, len(strengths)):
            raise BadConfig(f"levels = {levels}; perturbation {along} has {len(strengths)}: leave levels= out")
        return cls(found, along, len(strengths))

    @property
    def is_axis(self) -> bool:
        """Whether scenarios are shifted, and not what is perceived or controlled in them."""
        return self.name in self.task.axes

    def split(self, level: int) -> str:
        """Split of the scenarios at a level."""
        return f"{self.name}@{level}" if self.is_axis and level else ID

    def perturbation(self, level: int) -> str:
        """Perturbation at a level."""
        return NONE if self.is_axis or not level else f"{self.name}@{level}"

    def level_of(self, split: str, perturbation: str) -> int | None:
        """The level of an episode; None if it is at none."""
        known = {(self.split(level), self.perturbation(level)): level for level in range(self.levels + 1)}
        return known.get((split, perturbation))

    def check_values(self, level: int, shifted: Mapping[str, Value], where: str) -> None:
        """Raise `BadConfig` if a scenario is at another point of the axis than its level."""
        if not self.is_axis or not level:
            return
        wanted = self._axis.at(level, self.task.training, self.task.known).replace
        for name, dist in wanted.items():
            if isinstance(dist, Fixed) and abs(shifted.get(name, np.inf) - dist.value) > TOLERANCE:
                there = f"{name} = {shifted.get(name)}"
                what = f"level {level} of {self.levels} is {dist.value:g}"
                raise BadConfig(f"{where} has {there} in split {self.split(level)}; {what}: generate it again")

    def check_observed(self, names: Sequence[str] | None, look: str) -> None:
        """Raise `BadConfig` if a perturbation affects nothing that a policy observes.

        Args:
            names: names of streams and cameras; None for those of environments.
            look: look of pictures.
        """
        robot = self.task.embodiment
        observed, cameras = requested(names, robot), cameras_of(robot)
        shown = [cameras[name] for name in observed if name in cameras]
        streams = [name for name in observed if name not in cameras]
        Perturbation.parse(self.perturbation(1)).check(streams, shown, look_named(look))

    def value(self, level: float) -> str:
        """Values at a point between two levels, as text; empty if the axis has several."""
        if not self.is_axis:
            kind = kinds()[self.name]
            strength = float(np.interp(level, range(self.levels + 1), (0.0, *kind.strengths)))
            return f"{strength:.3g} {kind.unit}"
        known = self.task.known
        if any(known[name].integer for name in self._axis.replace):
            return ""
        dists = self._axis.along(level / self.levels, self.task.training, known)
        if not all(isinstance(dist, Fixed) for dist in dists.values()):
            return ""
        return ", ".join(f"{name} {dist.support[0].low:.4g} {known[name].unit}" for name, dist in dists.items())

    @property
    def oracle(self) -> str:
        """Where the oracle breaks, by the ledger, as a sentence."""
        if self.is_axis:
            return self._oracle_on_axis
        if kinds()[self.name].effect.reads != CONTROL:
            return "the oracle is not affected: under this perturbation witnesses end in the same bits"
        row = ledger.latest("control", self.task.name).get(ID)
        if row is None or self.name not in row.value:
            return f"the oracle: {ledger.not_measured(self.task.name)}; play policy=oracle"
        counts = ", ".join(map(str, row.value[self.name]["certified"]))
        mark = ledger.mark(row)
        return f"the oracle solves {counts} of {row.n} scenarios at levels 1 to {self.levels} (scengen measure){mark}"

    @property
    def _oracle_on_axis(self) -> str:
        card, solved = (ledger.latest(kind, self.task.name).get(self.name) for kind in ("axis", "certified"))
        if card is not None and (text := self._in_levels(card.value["boundaries"]["oracle"])):
            return f"the oracle {text}, by the axis card{ledger.mark(card)}"
        if solved is not None and "solved" in solved.value:
            figures = f"{solved.value['solved']} of {solved.value['draws']} draws of the whole axis"
            return f"the oracle solves {figures}{ledger.mark(solved)}"
        return f"the oracle: {ledger.not_measured(self.task.name)}; play policy=oracle"

    def _in_levels(self, boundary: str) -> str:
        """A boundary of an axis card, which is given in lengths of the axis, in levels; empty if there is none."""
        unit = self.levels / self._length
        if found := re.match(r"([\d.]+) \[([\d.]+), ([\d.]+)\]", boundary):
            middle, low, high = (f"{float(each) * unit:.1f}" for each in found.groups())
            return f"breaks at level {middle} [{low}, {high}]"
        if found := re.match(r"> ([\d.]+)", boundary):
            return f"does not break before level {float(found[1]) * unit:.1f}"
        return "breaks at once" if boundary.startswith("< 0") else ""

    @property
    def _length(self) -> float:
        """Length of the path of all levels, in lengths of the axis without measured limits."""
        training, known = self.task.training, self.task.known
        free = replace(self._axis, limits={})
        for name in self._axis.limits:
            start, far, limit = (
                axis.along(point, training, known)[name]
                for axis, point in ((free, 0.0), (free, 1.0), (self._axis, 1.0))
            )
            if isinstance(start, Fixed) and isinstance(far, Fixed) and isinstance(limit, Fixed):
                return float((limit.value - start.value) / (far.value - start.value))
        return 1.0

    @property
    def _axis(self) -> Axis:
        return self.task.axes[self.name]


def _with_severities(task: Task, axis: str, count: int) -> Task:
    """The task with a number of severities of an axis.

    Raises:
        BadConfig: the axis has no such points.
    """
    if task.axes[axis].severities != count:
        axes: dict[str, Any] = {**task.node["axes"], axis: {**task.node["axes"][axis], "severities": count}}
        try:
            task = load(task.name, {**task.node, "axes": axes})
        except BadConfig as error:
            raise BadConfig(f"levels = {count}: {error}; pass another levels=") from None
    for level in range(1, count + 1):
        task.axis(Part(axis, level))
    return task

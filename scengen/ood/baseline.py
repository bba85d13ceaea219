"""Baselines that worked in training, played on an axis, and the resulting verdict."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from ..errors import BadConfig
from ..evaluate.statistics import Difference, Rate, paired, rate

MOTION = ("replay", "any_replay")
"""Baselines of motion memory, from the weaker to the stronger: see `behaviour`."""
OBJECT_CENTRIC = ("object_centric", "any_object_centric")
"""Baselines of object-centric memory, from the weaker to the stronger: see `behaviour`."""
BELIEF = ("hidden_belief", "belief", "nearest_belief")
"""Baselines of planners with beliefs from training: see `belief`."""
LEARNERS = ("bc", "mip", "knn")
"""Trained policies, see `scengen.learn`."""
MEMORIES = {"motion memory": MOTION, "object-centric memory": OBJECT_CENTRIC}
"""Kinds of memory, from the weaker to the stronger."""
KINDS = {**MEMORIES, "belief": BELIEF, "learner": LEARNERS}
"""Kinds of baselines that an axis can break, each with its members."""
MIN_OWN_SUCCESS = 0.9
"""Minimum share of its own scenarios that a baseline has to solve again. Below it, the baseline is too weak."""
MIN_CONTROL_SUCCESS = 0.3
"""Minimum share of its control scenarios that a baseline has to solve. Below it, the baseline is too weak."""
SOLVED_SHARE = 0.5
"""An axis counts as solved by a baseline if the interval of its success lies above this share."""
INCONCLUSIVE = "inconclusive"
"""Verdict: no baseline is known to break, and none is known to solve most of the axis."""
MIN_TWINS = 10
"""Minimum number of twins for a verdict. From it on, a baseline that solves all of its control and half of the twins is
known to break."""
COUNTS = ("twins", "training", "here", "both")
"""Counts of a record: twins, those solved in the control, those solved in the OOD twin, and those solved in both."""


@dataclass(frozen=True)
class Baseline:
    """Success of one baseline on an axis. A pair counts only if the oracle solves both scenarios."""

    name: str
    own: float
    """Share of its own scenarios that a memory solves again; 1 for everything else."""
    control: str
    """Kind of the control: `moved within training` or `held-out training`."""
    training: Rate | None
    """Success rate in the control condition; None if there was no twin to try."""
    here: Rate | None
    """Success rate in the OOD twins."""
    excess: Difference | None
    """Difference `training` minus `here`, paired by twins."""
    both: int = 0
    """Number of twins that are solved in both conditions."""

    @classmethod
    def of(cls, name: str, control: str, arms: Sequence[tuple[bool, bool]], own: float = 1.0) -> Self:
        """The baseline with these outcomes of the twins, in the control and in the OOD twin."""
        if not arms:
            return cls(name, own, control, None, None, None)
        a, b = [[solved] for solved, _ in arms], [[solved] for _, solved in arms]
        return cls(name, own, control, rate(a), rate(b), paired(a, b), sum(x and y for x, y in arms))

    @property
    def finding(self) -> str:
        """Finding: `breaks`, `holds` (the interval of `excess` includes 0), `too weak`, or `not tried`."""
        if self.training is None or self.excess is None:
            return "not tried"
        if self.own < MIN_OWN_SUCCESS or self.training.value < MIN_CONTROL_SUCCESS:
            return "too weak"
        return "breaks" if self.excess.low > 0 else "holds"

    @property
    def solves(self) -> bool:
        """Whether the baseline is known to solve most of the axis."""
        return self.here is not None and self.here.low > SOLVED_SHARE

    @property
    def twins(self) -> int:
        """Number of twins."""
        return self.excess.twins if self.excess else 0

    @property
    def record(self) -> dict[str, Any]:
        """The counts from which `of_record` computes the baseline again."""
        values = {"name": self.name, "control": self.control, "own": round(self.own, 4)}
        if not (self.training and self.here and self.excess):
            return {**values, **dict.fromkeys(COUNTS, 0)}
        n = self.excess.twins
        counts = (n, round(self.training.value * n), round(self.here.value * n), self.both)
        return {**values, **dict(zip(COUNTS, counts, strict=True))}

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> Self:
        """The baseline of a record.

        Raises:
            BadConfig: a count is missing, or the counts contradict each other.
        """
        try:
            n, training, here, both = (int(record[name]) for name in COUNTS)
            name, control, own = str(record["name"]), str(record["control"]), float(record["own"])
        except (KeyError, TypeError, ValueError):
            raise BadConfig(
                f"{dict(record)} is not a record of a baseline; it needs name, control, own, counts"
            ) from None
        arms = {
            (True, True): both,
            (True, False): training - both,
            (False, True): here - both,
            (False, False): n - training - here + both,
        }
        if min(arms.values()) < 0:
            raise BadConfig(f"record of {name}: {training} and {here} of {n}, {both} in both, is impossible")
        return cls.of(name, control, [arm for arm, count in arms.items() for _ in range(count)], own)


def verdict_of_twins(baselines: Iterable[Baseline], n: int) -> str:
    """The verdict from `n` twins, or how many it takes if they are too few."""
    if n >= MIN_TWINS:
        return verdict(baselines)
    return f"none: n = {n} is too small, a verdict takes {MIN_TWINS} twins or more"


def verdict(baselines: Iterable[Baseline]) -> str:
    """Kinds of baselines that an axis breaks: the strongest kind of memory, belief, learner, as in `breaks
    object-centric memory, belief`.

    If it breaks nothing, `solved by` the first kind that solves most of it, as `solved by motion memory`; otherwise
    `INCONCLUSIVE`. A learner that solves the axis contradicts no verdict: it can interpolate where a memory cannot.
    """
    tried = {baseline.name: baseline for baseline in baselines}

    def having(quality: str) -> list[str]:
        owners = {name for name, found in tried.items() if quality in (found.finding, "solves" if found.solves else "")}
        return [kind for kind, names in KINDS.items() if owners & set(names)]

    if broken := having("breaks"):
        memories = [kind for kind in broken if kind in MEMORIES]
        return f"breaks {', '.join([*memories[-1:], *(kind for kind in broken if kind not in MEMORIES)])}"
    solved = having("solves")
    return f"solved by {solved[0]}" if solved else INCONCLUSIVE

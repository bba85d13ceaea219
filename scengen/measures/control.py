"""Measurement of control: how far each task can be delayed, shaken, shifted or loaded before its oracle fails."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any, ClassVar

from ..samplers.conditions import KINDS, LEVELS, strengths
from ..samplers.split import ID
from ..samplers.task import Task
from ..scenario import Conditions, Scenario
from ..validate.certify import Trial
from ..validate.settings import QUICK, CertifySettings, lower_bound
from .measurement import Job, Measurement, Result, Row
from .scenarios import feasible

CHECKS = ("compiles", "overlap", "rest", "unsolved", "solved", "robust", "witness")
"""Checks of a certificate that are made. The others do not depend on the conditions, or need the witness of another
scene; `scengen generate perturb=` makes all."""
TRIES = 4
"""Draws that are tried for each scenario that is certified under the usual conditions."""


class Controls(Measurement):
    """Certification under every kind of conditions of control, at every level, on the first n training scenarios that
    are certified so under the usual ones.

    Figures, by kind: `certified` scenarios of n at each level; `beyond`, for each level at which not all are certified,
    the first reason; `without_effect`, levels at which a solution ends in the same bits as under the usual conditions.
    """

    KIND = "control"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"n": 3, "runs": 2}

    def all_splits(self, task: Task) -> Sequence[str]:
        return (ID,)

    def jobs(self, task: Task) -> Iterator[Job]:
        if self.chosen(task):
            yield Job(task, (ID,), {**self.options, "strengths": {kind: list(strengths(kind)) for kind in KINDS}})

    def result(self, job: Job) -> Result:
        task, n = job.task, int(self.options["n"])
        runs = int(self.options["runs"])
        settings = replace(QUICK, robust=replace(QUICK.robust, runs=runs, bound=lower_bound(runs, runs)))
        tried = ((scenario, *_tried(scenario, task, settings)) for scenario in feasible(task, ID, range(TRIES * n)))
        sound = [*islice(((scenario, end) for scenario, failure, end in tried if not failure), n)]
        usual, ends = [scenario for scenario, _ in sound], [end for _, end in sound]
        value = {kind: _levels(kind, usual, ends, task, settings) for kind in KINDS} if usual else {}
        whole = sum(certified == len(usual) for of in value.values() for certified in of["certified"])
        idle = [f"{kind}@{level}" for kind, of in value.items() for level in of["without_effect"]]
        words = f"{whole} of {len(KINDS) * LEVELS} cells are certified in all of {len(usual)} scenarios"
        words += f"; without effect: {', '.join(idle)}" if idle else ""
        return Result(job, [Row(ID, len(usual), value)], words, len(usual) == n and not idle)


def _levels(
    kind: str, usual: Sequence[Scenario], ends: Sequence[str], task: Task, settings: CertifySettings
) -> dict[str, Any]:
    """Figures of a kind of conditions.

    Args:
        usual: scenarios under the usual conditions.
        ends: hashes of the states in which their solutions end.
    """
    certified, beyond, idle = list[int](), dict[str, str](), list[int]()
    for level in range(1, LEVELS + 1):
        posed = Conditions(((kind, level),), task.embodiment)
        failures, found = zip(*(_tried(scenario.under(posed), task, settings) for scenario in usual), strict=True)
        certified.append(failures.count(""))
        beyond |= {str(level): reason for reason in failures[::-1] if reason}
        if {*found} & {*ends}:
            idle.append(level)
    return {"certified": certified, "beyond": beyond, "without_effect": idle}


def _tried(scenario: Scenario, task: Task, settings: CertifySettings) -> tuple[str, str]:
    """Check and reason that speak against a scenario, empty if it is certified; and the hash of the state in which its
    solution ends, empty without one."""
    trial, failure = Trial(scenario, task.horizon, settings, task.embodiment), ""
    for name in CHECKS:
        found = trial.check(name)
        if not found.passed:
            failure = f"{name}: {found.reason}"
            break
    return failure, trial.solution.digest if trial.solution else ""

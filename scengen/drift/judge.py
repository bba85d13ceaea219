"""The checks of a pool under the MuJoCo of this process, whichever version made the pool. It runs in each environment.

Verification declines a pool that another MuJoCo has made, because its claims are about that version. This module
measures how much of a verdict depends on the version, so every check is made even if an earlier one failed.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import islice
from typing import Any

import mujoco

from .. import compose
from ..attack.check import attacked
from ..certificate import Check
from ..errors import NoOracle, ScengenError
from ..pool import Pool, PoolRow
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim.world import World
from ..validate.certify import Trial
from ..validate.rollout import replay
from ..validate.settings import CertifySettings
from ..validate.verify.claims import wrong_hashes, wrong_names
from ..validate.verify.recheck import BEFORE_WITNESS, WITH_WITNESS
from ..validate.verify.stored import settings_of_manifest, task_of_manifest
from ..work.fingerprint import fingerprint
from ..work.parallel import Limits, each
from .environment import answer
from .models import model_difference

ORACLES = ("shortcuts", "solved", "robust")
"""Checks of the shortcuts and the oracle, which do not use the witness."""


@dataclass(frozen=True)
class RepeatedCheck:
    """A check that was made again."""

    name: str
    passed: bool | None
    """Whether the check passed; None if it was not made, or if there was nothing to check."""
    reason: str
    """Reason why the check failed."""
    settings: Mapping[str, Any]
    numbers: Mapping[str, Any]
    """Measured numbers."""
    stored: Mapping[str, Any]
    """Numbers of the check in the certificate."""
    flipped: bool
    """Whether the check was made and contradicts the certificate."""


@dataclass(frozen=True)
class Judgement:
    """The results of one scenario."""

    id: str
    name: str
    final_state: str
    """Hash of the physics state at the end of the witness; empty if the witness was not replayed."""
    same_bits: bool
    """Whether the witness ends in the state that the certificate states."""
    scene: str
    """Difference between the physics of the pool's scene and of that which the family builds; empty if none."""
    checks: tuple[RepeatedCheck, ...] = ()
    """Checks in the order in which they were made."""
    unknown: str = ""
    """Reason why the result is unknown: a limit was reached, a process died, or the row is invalid."""


@dataclass(frozen=True)
class Judge:
    """Judges the rows of one pool."""

    task: Task
    settings: CertifySettings
    level: str
    """Level of the checks, one of `validate.recheck.LEVELS`."""

    def __call__(self, row: PoolRow) -> Judgement:
        try:
            scenario = self.task.scenario(row.params, row.split)
            if wrong := [*wrong_names(row, scenario), *wrong_hashes(row)]:
                return lost(row, f"{wrong[0]}; see scengen verify")
            return self._judged(row, scenario)
        except (ScengenError, ValueError, TypeError, KeyError, ArithmeticError, RecursionError) as error:
            return lost(row, " ".join(str(error).split())[:300] or type(error).__name__)

    def _judged(self, row: PoolRow, scenario: Scenario) -> Judgement:
        trial = Trial(scenario, row.horizon, self.settings, row.embodiment, attacked)
        stored = {check.name: check for check in row.certificate.checks}
        found: list[Check] = []
        made = {"replay": ("compiles",), "recheck": BEFORE_WITNESS, "full": (*BEFORE_WITNESS, *ORACLES)}
        for name in made[self.level]:
            found.append(_checked(trial, name))
            if name == "compiles" and not found[-1].passed:
                return Judgement(row.id, str(row.name), "", False, "", _compared(found, stored))
        scene = model_difference(World.load(row.scene_xml, row.embodiment).model, trial.world.model)
        witness = replay(scenario, trial.world, row.witness, row.horizon, self.settings.settle)
        numbers = {"outcome": witness.outcome, "seconds": witness.seconds}
        found.append(Check("witness", witness.solved, witness.reason, {"horizon": row.horizon}, numbers))
        if witness.solved:
            trial.solution = witness
            found += [_checked(trial, name) for name in WITH_WITNESS if self.level != "replay"]
        elif self.level != "full":
            found.append(_checked(trial, "solved"))  # the oracle shows whether only the recording fails
        if self.level == "full" and self.settings.attack and trial.solution is not None:
            found.append(_checked(trial, "attack"))
        same = witness.digest == row.certificate.final_state
        return Judgement(row.id, str(row.name), witness.digest, same, scene, _compared(found, stored))


def judge(folder: str, search: Sequence[str], level: str, first: int | None, workers: int, limits: Limits) -> Iterator:
    """Judge the scenarios of a pool, in any order.

    Args:
        folder: folder of the pool.
        search: overrides that add folders of other packages, see `task_files.search_path`.
        level: level of the checks, one of `validate.recheck.LEVELS`.
        first: number of scenarios, from the first; None for all.

    Raises:
        ScengenError: the pool is damaged, or its task is unknown here.
    """
    pool = Pool.open(folder).check()
    task = task_of_manifest(pool, compose.load_task(pool.task, search))
    rows = islice(pool.rows(), first)
    return each(Judge(task, settings_of_manifest(pool.manifest), level), rows, workers, limits, lost)


def lost(row: PoolRow, reason: str) -> Judgement:
    """The judgement of a scenario with an unknown result."""
    return Judgement(row.id, str(row.name), "", False, "", unknown=reason)


def _checked(trial: Trial, name: str) -> Check:
    """A check of a trial; not made if it needs an oracle and the machine has none."""
    try:
        return trial.check(name)
    except NoOracle:
        return Check(name, None, "this machine has no oracle", {}, {})


def _compared(found: Sequence[Check], stored: Mapping[str, Check]) -> tuple[RepeatedCheck, ...]:
    """The checks, each with its entry in the certificate."""
    repeated = []
    for check in found:
        before = stored[check.name]
        flipped = check.passed is not None and check.passed != before.passed
        repeated.append(
            RepeatedCheck(
                check.name, check.passed, check.reason, check.settings, check.numbers, before.numbers, flipped
            )
        )
    return tuple(repeated)


def answers(request: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The version and fingerprint of this process, then a judgement of every scenario; see `commands.verify_mujoco`."""
    yield {"mujoco": mujoco.__version__, "fingerprint": fingerprint()}
    limits = Limits(request["limit_seconds"], request["limit_mb"])
    for folder in request["pools"]:
        given = (request["search"], request["level"], request["n"], request["workers"], limits)
        for judgement in judge(folder, *given):
            yield {"pool": folder, **asdict(judgement)}


if __name__ == "__main__":
    sys.exit(answer(answers))

"""Simulations of verification: the witness again, the checks that need no oracle, or the whole certificate."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...certificate import CHECKS, Check, as_json
from ...errors import NoOracle, ScengenError, contrasted
from ...pool import PoolRow
from ...pool.manifest import without_numbers
from ...scenario import Scenario
from ...work.fingerprint import same_bits
from ..certify import Adversary, Trial, certify
from ..rollout import Rollout, replay
from ..settings import CertifySettings
from .claims import Claims, alike

LEVELS = ("replay", "recheck", "full")
"""Levels of verification: simulate the witness alone; every check that needs no oracle; every check."""
BEFORE_WITNESS = ("feasible", "compiles", "overlap", "rest", "unsolved", "idle")
"""Checks that need neither oracle nor witness, in order: each needs those before it."""
OF_ORACLE = ("solved", "robust")
"""Checks whose numbers belong to the oracle, and not to the witness."""
MADE_AGAIN = {
    "replay": ("feasible", "compiles", "witness"),
    "recheck": (*BEFORE_WITNESS, "numerics", "ablations", "witness"),
    "full": tuple(CHECKS),
}
"""Checks that are made again at each level. The others are the author's claim."""
WITH_WITNESS = ("numerics", "ablations")
"""Checks that need the witness. If the witness fails under other numerics, the certificate and its verification let the
oracle try: only then verification needs an oracle."""


@dataclass(frozen=True)
class Simulated:
    """Result of a simulation."""

    reasons: tuple[str, ...]
    """Faults; empty if there are none."""
    drifted: bool
    """Whether the witness reaches the goal, but ends in other bits than on the machine of the certificate."""
    doubts: tuple[str, ...] = ()
    """Claims that cannot be decided here; empty if there are none."""


def simulate(
    row: PoolRow,
    scenario: Scenario,
    text: str,
    settings: CertifySettings,
    level: str,
    adversary: Adversary | None = None,
) -> Simulated:
    """Run the simulations of a level until a fault is found.

    Args:
        row: a row whose labels, names and settings are right.
        text: the scene as the family builds it here; the scene of the row is never compiled.
        settings: settings of the certificate.
        level: one of `LEVELS`.
        adversary: see `certify`.
    """
    same_rounding = same_bits(row.certificate)
    trial = Trial(scenario, row.horizon, settings, row.embodiment)
    trial.text = text
    stored = {check.name: check for check in row.certificate.checks}
    counted = trial.check("compiles")
    if reasons := list(_differences(counted, stored["compiles"], True)):
        return Simulated(tuple(reasons), False)
    rollout = replay(scenario, trial.world, row.witness, row.horizon, settings.settle)
    drifted = rollout.digest != row.certificate.final_state
    reasons = list(_replay_faults(row, rollout, same_rounding))
    if not reasons and level == "recheck":
        reasons = list(_repetition_faults(trial, rollout, stored, same_rounding))
    doubts: list[str] = []
    if not reasons and level == "full":
        again = _CertifiedAgain(row, Trial(scenario, row.horizon, settings, row.embodiment, adversary), rollout)
        reasons, doubts = list(again.faults(stored, same_rounding)), again.doubts
    return Simulated(tuple(reasons), drifted and not reasons, tuple(doubts))


def fails_again(
    row: PoolRow, scenario: Scenario, settings: CertifySettings, level: str, adversary: Adversary | None
) -> Iterator[str]:
    """Differences between a kept reject and its certificate. On a machine with different rounding there may be some.

    Args:
        row: a row whose labels, names, settings and scene are right.
        level: `recheck` repeats the checks without an oracle as far as they were made, `full` all of them.
        adversary: see `certify`.
    """
    if level == "replay" or not same_bits(row.certificate):
        return
    last = None if level == "full" else BEFORE_WITNESS[-1]
    faults: list[str] = []
    for to_the_end in (False, True):  # as in certificates of earlier releases
        again = certify(scenario, row.horizon, settings, row.embodiment, last, adversary, to_the_end)
        faults = list(_other_reject(row, again.certificate.checks, last))
        if not faults or last:
            break
    yield from faults


def _other_reject(row: PoolRow, again: Sequence[Check], last: str | None) -> Iterator[str]:
    """The first difference between the checks of a kept reject, up to the last one, and those made again."""
    for check, stored in zip(again, row.certificate.checks, strict=True):
        if last and check.name not in BEFORE_WITNESS:
            return
        if (check.passed, check.reason) != (stored.passed, stored.reason):
            told = "passes" if check.passed else f"fails: {check.reason}" if check.reason else "is not made"
            yield f"check {check.name} of this reject {told} when it is made again"
            return
        if not alike(check.numbers, stored.numbers):
            yield f"check {check.name} of this reject has other numbers when it is made again"
            return


def certified_here(row: PoolRow, claims: Claims, adversary: Adversary | None) -> str:
    """Result of a scenario that was certified for another version of its task or MuJoCo, for the installed ones.

    Args:
        adversary: see `certify`.
    """
    task = claims.task
    try:
        scenario = task.scenario(row.params, row.split)
        again = certify(scenario, task.horizon, claims.settings, task.embodiment, adversary=adversary).certificate
    except (ScengenError, ValueError, ArithmeticError) as error:
        return f"certified again here it cannot be: {' '.join(str(error).split())[:200]}"
    return f"certified again here it is {again.verdict} {again.reason}".strip()


def why_not_certified(index: int, claims: Claims, adversary: Adversary | None) -> str:
    """Reason why the scenario of an index is not certified, as a manifest counts it; empty if it is certified.

    Args:
        index: an index with a feasible scenario.
        adversary: see `certify`.
    """
    task = claims.task
    again = certify(claims.draw(index).scenario, task.horizon, claims.settings, task.embodiment, adversary=adversary)
    return without_numbers(again.certificate.reason)


def _replay_faults(row: PoolRow, rollout: Rollout, same_rounding: bool) -> Iterator[str]:
    if not rollout.solved:
        yield f"the witness fails: {rollout.reason}"
        return
    if same_rounding and rollout.digest != row.certificate.final_state:
        yield "the witness ends in another state, although this machine rounds like the certificate's"
    if same_rounding and not np.array_equal(rollout.actions, row.witness):
        yield f"the witness has {len(row.witness)} actions, but {len(rollout.actions)} are played"
    if same_rounding and rollout.seconds != _stored_check(row, "witness").numbers["seconds"]:
        yield f"the witness reaches the goal after {rollout.seconds:g} s, not when its certificate says"


def _repetition_faults(trial: Trial, rollout: Rollout, stored: dict[str, Check], same_rounding: bool) -> Iterator[str]:
    for name in (*BEFORE_WITNESS, *WITH_WITNESS):
        if name in WITH_WITNESS:
            trial.solution = rollout
        try:
            found = trial.check(name)
        except NoOracle:
            found = Check(name, False, "the witness fails, and this machine has no oracle", {}, {})
        yield from _differences(found, stored[name], same_rounding)
        if not found.passed and not found.waived:
            return


@dataclass
class _CertifiedAgain:
    """Every check of a row made again. The checks up to `robust` run the oracle; those after it use the stored witness,
    which need not be the one that the oracle finds."""

    row: PoolRow
    trial: Trial
    replayed: Rollout
    """Rollout of the stored witness."""
    doubts: list[str] = field(default_factory=list)
    """Numbers of the oracle that differ where the oracle plays other actions than the witness. The oracle may have been
    changed since, because certificates do not expire with it; or the numbers are false."""

    def faults(self, stored: dict[str, Check], same_rounding: bool) -> Iterator[str]:
        for name, verdict in CHECKS.items():
            found = self.trial.check(name)
            if not found.passed and not found.waived:
                yield f"certified again it is {verdict}: {name}: {found.reason}"
                return
            differences = list(_differences(found, stored[name], same_rounding))
            if differences and name == "shortcuts":  # certificates of earlier releases have played all to their end
                self.trial.to_the_end = True
                differences = list(_differences(self.trial.check(name), stored[name], same_rounding))
            if name in OF_ORACLE and not self._same_oracle:
                self.doubts += (f"{told}; {_OTHER_ORACLE}" for told in differences)
            else:
                yield from differences
            if name == OF_ORACLE[-1]:
                self.trial.solution = self.replayed

    @property
    def _same_oracle(self) -> bool:
        assert self.trial.solution is not None
        return np.array_equal(self.trial.solution.actions, self.row.witness)


_OTHER_ORACLE = (
    "the oracle here plays other actions than the witness: either it has been changed since, or the numbers are false; "
    "certify the pool again"
)


def _differences(found: Check, stored: Check, exact: bool) -> Iterator[str]:
    """Differences between a check that was made again and the stored one."""
    if not found.passed and not found.waived:
        yield f"check {found.name} fails: {found.reason}"
    elif exact and not alike(found.numbers, stored.numbers):
        made, told = contrasted(as_json(found.numbers), as_json(stored.numbers), 160)
        yield f"check {found.name} has other numbers when it is made again: {made}; the pool says {told}"


def _stored_check(row: PoolRow, name: str) -> Check:
    return next(check for check in row.certificate.checks if check.name == name)

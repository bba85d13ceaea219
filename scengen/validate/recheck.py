"""What verification simulates: the witness again, the checks that need no oracle, or the whole certificate."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..certificate import Check, as_json
from ..errors import NoOracle
from ..fingerprint import fingerprint
from ..pool import PoolRow
from ..pool.manifest import without_numbers
from ..scenario import Scenario
from .certify import Adversary, Trial, certify
from .claims import Claims, alike
from .rollout import Rollout, replay
from .settings import CertifySettings

LEVELS = ("replay", "recheck", "full")
"""How much is simulated: the witness alone; every check that needs no oracle; every check."""
FIRST = ("feasible", "compiles", "overlap", "rest", "unsolved", "idle")
"""Checks that need neither oracle nor witness, in the order in which each relies on those before it."""
REPLAYED = ("numerics", "ablations")
"""Checks that need the witness. Where it flips under other numerics the certificate lets the oracle try, and so does
verification: only there it needs one."""


@dataclass(frozen=True)
class Simulated:
    """What came of it."""

    reasons: tuple[str, ...]
    """What does not hold; empty if all is well."""
    drifted: bool
    """The witness reaches the goal, but ends in other bits than on the machine of the certificate."""


def simulate(
    row: PoolRow,
    scenario: Scenario,
    text: str,
    settings: CertifySettings,
    level: str,
    adversary: Adversary | None = None,
) -> Simulated:
    """Simulate what a level asks for, until something does not hold.

    Args:
        row: whose labels, names and settings have been found right.
        text: the scene as the family builds it here; that of the row is never compiled.
        settings: of the certificate.
        level: one of `LEVELS`.
        adversary: see `certify`.
    """
    here = row.certificate.fingerprint == fingerprint()
    trial = Trial(scenario, row.horizon, settings, row.embodiment)
    trial.text = text
    stored = {check.name: check for check in row.certificate.checks}
    counted = trial.check("compiles")
    if reasons := list(_against(counted, stored["compiles"], True)):
        return Simulated(tuple(reasons), False)
    rollout = replay(scenario, trial.world, row.witness, row.horizon, settings.settle)
    drifted = rollout.digest != row.certificate.final_state
    reasons = list(_replayed(row, rollout, here))
    if not reasons and level == "recheck":
        reasons = list(_repeated(trial, rollout, stored, here))
    if not reasons and level == "full":
        reasons = list(_certified_again(row, scenario, settings, stored, here, adversary))
    return Simulated(tuple(reasons), drifted and not reasons)


def fails_again(
    row: PoolRow, scenario: Scenario, settings: CertifySettings, level: str, adversary: Adversary | None
) -> Iterator[str]:
    """Where a kept reject does not fail as its certificate says. On a machine that rounds otherwise it need not.

    Args:
        row: whose labels, names, settings and scene have been found right.
        level: `recheck` repeats the checks without an oracle as far as they were made, `full` all of them.
        adversary: see `certify`.
    """
    if level == "replay" or row.certificate.fingerprint != fingerprint():
        return
    last = None if level == "full" else FIRST[-1]
    again = certify(scenario, row.horizon, settings, row.embodiment, last, adversary)
    for check, stored in zip(again.certificate.checks, row.certificate.checks, strict=True):
        if last and check.name not in FIRST:
            return
        if (check.passed, check.reason) != (stored.passed, stored.reason):
            told = "is passed" if check.passed else f"fails: {check.reason}" if check.reason else "is not made"
            yield f"check {check.name} of this reject {told} when it is made again"
            return
        if not alike(check.numbers, stored.numbers):
            yield f"check {check.name} of this reject has other numbers when it is made again"
            return


def why_not_certified(index: int, claims: Claims, adversary: Adversary | None) -> str:
    """Why the scenario of an index is not certified, as a manifest counts it; empty if it is.

    Args:
        index: at which a feasible scenario is drawn.
        adversary: see `certify`.
    """
    task = claims.task
    again = certify(claims.draw(index).scenario, task.horizon, claims.settings, task.embodiment, adversary=adversary)
    return without_numbers(again.certificate.reason)


def _replayed(row: PoolRow, rollout: Rollout, here: bool) -> Iterator[str]:
    if not rollout.solved:
        yield f"the witness fails: {rollout.reason}"
        return
    if here and rollout.digest != row.certificate.final_state:
        yield "the witness ends in another state, although this machine rounds as the certificate's did"
    if here and not np.array_equal(rollout.actions, row.witness):
        yield f"the witness has {len(row.witness)} actions, and {len(rollout.actions)} are played"
    if here and rollout.seconds != _check(row, "witness").numbers["seconds"]:
        yield f"the witness reaches the goal after {rollout.seconds:g} s, not when its certificate says"


def _repeated(trial: Trial, rollout: Rollout, stored: dict[str, Check], here: bool) -> Iterator[str]:
    for name in (*FIRST, *REPLAYED):
        if name in REPLAYED:
            trial.witness = rollout
        try:
            found = trial.check(name)
        except NoOracle:
            found = Check(name, False, "the witness does not hold, and this machine has no oracle", {}, {})
        yield from _against(found, stored[name], here)
        if not found.passed and not found.waived:
            return


def _certified_again(
    row: PoolRow,
    scenario: Scenario,
    settings: CertifySettings,
    stored: dict[str, Check],
    here: bool,
    adversary: Adversary | None,
) -> Iterator[str]:
    again = certify(scenario, row.horizon, settings, row.embodiment, adversary=adversary)
    if again.certificate.verdict != "certified":
        yield f"certified again it is {again.certificate.verdict}: {again.certificate.reason}"
        return
    same_oracle = np.array_equal(again.witness, row.witness)
    for check in again.certificate.checks:
        depends = check.name in ("solved", "robust", "numerics", "ablations", "witness", "attack")
        yield from _against(check, stored[check.name], here and (same_oracle or not depends))


def _against(found: Check, stored: Check, exact: bool) -> Iterator[str]:
    """Where a check that was made again does not say what is stored."""
    if not found.passed and not found.waived:
        yield f"check {found.name} fails: {found.reason}"
    elif exact and not alike(found.numbers, stored.numbers):
        yield f"check {found.name} has other numbers when it is made again: {as_json(found.numbers)[:160]}"


def _check(row: PoolRow, name: str) -> Check:
    return next(check for check in row.certificate.checks if check.name == name)

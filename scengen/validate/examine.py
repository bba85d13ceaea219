"""Examination of a scenario of a pool, or of a piece of its run, in a process that can be ended: static facts first."""

from dataclasses import dataclass
from typing import Literal

from ..errors import ScengenError
from ..fingerprint import fingerprint
from ..pool import PoolRow
from ..pool.manifest import MANIFEST
from . import survey
from .certify import Adversary
from .claims import (
    Claims,
    compiles,
    scene_or_nothing,
    wrong_certificate,
    wrong_labels,
    wrong_names,
    wrong_rejection,
    wrongly_drawn,
)
from .rebuilt import difference, rebuild
from .recheck import Simulated, fails_again, simulate, why_not_certified

Verdict = Literal["sound", "refuted", "declined"]
"""`declined` says nothing about the claim: the check died, was too large or too slow, or belongs to another version."""


@dataclass(frozen=True, slots=True)
class Examination:
    """Result for one scenario."""

    id: str
    verdict: Verdict
    reasons: tuple[str, ...] = ()
    """Faults, or reasons why nothing can be said; empty for a sound scenario."""
    rebuilt: bool = False
    """Whether its scene and its draw were made again."""
    simulated: bool = False
    expired: bool = False
    """Whether the family's code has changed since the certificate was made."""
    drifted: bool = False
    """Whether the replay reaches the goal, but ends in other bits than on the machine of the certificate."""


@dataclass(frozen=True)
class LeftOut:
    """An index with a feasible scenario that the run did not certify."""

    index: int


@dataclass(frozen=True)
class Failed:
    """Result of certifying such an index again."""

    index: int
    reason: str
    """Reason as the manifest counts it; empty if the scenario is certified now."""


Job = tuple[PoolRow, bool, bool] | range | LeftOut
"""A row, whether it is simulated, and whether it was certified; or indices to draw again; or an index to certify
again."""
Answer = Examination | dict[int, survey.Drawn] | Failed


@dataclass(frozen=True)
class Examiner:
    """Examines one scenario, or makes a piece of the run again."""

    claims: Claims
    level: str
    expired: bool
    adversary: Adversary | None = None

    def __call__(self, job: Job) -> Answer:
        try:
            if isinstance(job, range):
                return survey.draw_again(job, self.claims)
            if isinstance(job, LeftOut):
                return Failed(job.index, why_not_certified(job.index, self.claims, self.adversary))
            return self._examined(*job)
        except (ScengenError, ValueError, TypeError, KeyError, ArithmeticError, RecursionError) as error:
            why = " ".join(str(error).split())[:300] or type(error).__name__
            if isinstance(job, tuple):
                return Examination(job[0].id, "refuted", (why,), expired=self.expired)
            return Examination(MANIFEST, "refuted", (f"{_described(job)} cannot be made again: {why}",))

    def _examined(self, row: PoolRow, simulated: bool, certified: bool) -> Examination:
        claims = self.claims
        reasons = list(wrong_labels(row, claims))
        if row.task != claims.task.name:
            return Examination(row.id, "refuted", tuple(reasons), expired=self.expired)
        scenario = claims.task.scenario(row.params)
        reasons += [*wrong_names(row, scenario), *wrongly_drawn(row, claims)]
        reasons += (wrong_certificate if certified else wrong_rejection)(row, scenario, claims)
        text = rebuild(scenario) if compiles(row) else scene_or_nothing(scenario)
        reasons += filter(
            None, [difference(row.scene_xml, text, row.certificate.fingerprint == fingerprint(), row.embodiment)]
        )
        if reasons or not simulated:
            verdict: Verdict = "refuted" if reasons else "sound"
            return Examination(row.id, verdict, tuple(reasons), True, expired=self.expired)
        if certified:
            done = simulate(row, scenario, text, claims.settings, self.level, self.adversary)
        else:
            found = fails_again(row, scenario, claims.settings, self.level, self.adversary)
            done = Simulated(tuple(found), False)
        verdict = "refuted" if done.reasons else "declined" if done.doubts else "sound"
        return Examination(row.id, verdict, done.reasons + done.doubts, True, True, self.expired, done.drifted)


def lost_examination(job: Job, reason: str) -> Examination:
    """The examination of a job that has crashed its process, or has reached a limit."""
    if isinstance(job, tuple):
        return Examination(job[0].id, "declined", (f"verification {reason}",))
    return Examination(MANIFEST, "declined", (f"making {_described(job)} again {reason}",))


def _described(job: range | LeftOut) -> str:
    return f"index {job.index}" if isinstance(job, LeftOut) else f"indices {job.start} to {job.stop - 1}"

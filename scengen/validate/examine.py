"""One scenario of a pool, or a piece of its run, examined in a process that can be ended: static facts first."""

from dataclasses import dataclass
from typing import Literal

from ..errors import ScengenError
from ..fingerprint import fingerprint
from ..pool.pool import PoolRow
from . import claims as claim
from . import survey
from .certify import Adversary
from .claims import Claims
from .rebuilt import difference, rebuild
from .recheck import fails_again, simulate, why_not_certified

Verdict = Literal["sound", "refuted", "declined"]
"""`declined` is no statement: the check died, was too large or too slow, or belongs to another version."""
MANIFEST = "manifest.json"
"""What stands for the pool as a whole where an id is told."""


@dataclass(frozen=True, slots=True)
class Examination:
    """What was found about one scenario."""

    id: str
    verdict: Verdict
    reasons: tuple[str, ...] = ()
    """What does not hold, or why nothing can be said; empty for a sound one."""
    rebuilt: bool = False
    """Its scene and its draw were made again."""
    simulated: bool = False
    expired: bool = False
    """The family's code has changed since the certificate was made."""
    drifted: bool = False
    """The replay reaches the goal, but ends in other bits than on the machine of the certificate."""


@dataclass(frozen=True)
class Left:
    """An index that has a feasible scenario, and none that was certified."""

    index: int


@dataclass(frozen=True)
class Failed:
    """What came of such an index when it was certified again."""

    index: int
    reason: str
    """As the reasons of a manifest count it; empty if its scenario is certified now."""


Job = tuple[PoolRow, bool, bool] | range | Left
"""A row, whether it is simulated, and whether it was certified; or indices to draw again; or one to certify again."""
Answer = Examination | dict[int, survey.Drawn] | Failed


@dataclass(frozen=True)
class Examiner:
    """Looks at one scenario, or makes a piece of the run again."""

    claims: Claims
    level: str
    expired: bool
    adversary: Adversary | None = None

    def __call__(self, job: Job) -> Answer:
        try:
            if isinstance(job, range):
                return survey.draw_again(job, self.claims)
            if isinstance(job, Left):
                return Failed(job.index, why_not_certified(job.index, self.claims, self.adversary))
            return self._examined(*job)
        except (ScengenError, ValueError, TypeError, KeyError, ArithmeticError, RecursionError) as error:
            why = " ".join(str(error).split())[:300] or type(error).__name__
            if isinstance(job, tuple):
                return Examination(job[0].id, "refuted", (why,), expired=self.expired)
            return Examination(MANIFEST, "refuted", (f"{_spelled(job)} cannot be made again: {why}",))

    def _examined(self, row: PoolRow, simulated: bool, certified: bool) -> Examination:
        claims = self.claims
        reasons = list(claim.wrong_labels(row, claims))
        if row.task != claims.task.name:
            return Examination(row.id, "refuted", tuple(reasons), expired=self.expired)
        scenario = claims.task.scenario(row.params)
        reasons += [*claim.wrong_names(row, scenario), *claim.wrongly_drawn(row, claims)]
        reasons += (claim.wrong_certificate if certified else claim.wrong_rejection)(row, scenario, claims)
        text = rebuild(scenario) if claim.compiled(row) else claim.scene_of_a_failure(scenario)
        reasons += filter(None, [difference(row.scene_xml, text, row.certificate.fingerprint == fingerprint())])
        if reasons or not simulated:
            verdict: Verdict = "refuted" if reasons else "sound"
            return Examination(row.id, verdict, tuple(reasons), True, expired=self.expired)
        if certified:
            done = simulate(row, scenario, text, claims.settings, self.level, self.adversary)
            reasons, drifted = list(done.reasons), done.drifted
        else:
            reasons, drifted = list(fails_again(row, scenario, claims.settings, self.level, self.adversary)), False
        verdict = "refuted" if reasons else "sound"
        return Examination(row.id, verdict, tuple(reasons), True, True, self.expired, drifted)


def lost(job: Job, reason: str) -> Examination:
    """What is said of a job that has crashed its process, or has reached a limit."""
    if isinstance(job, tuple):
        return Examination(job[0].id, "declined", (f"verification {reason}",))
    return Examination(MANIFEST, "declined", (f"making {_spelled(job)} again {reason}",))


def _spelled(job: range | Left) -> str:
    return f"index {job.index}" if isinstance(job, Left) else f"indices {job.start} to {job.stop - 1}"

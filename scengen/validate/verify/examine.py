"""Examination of a scenario of a pool, or of a piece of its run, in a process that can be ended: static facts first."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from ...errors import ScengenError
from ...pool import PoolRow
from ...pool.manifest import MANIFEST
from ...work.fingerprint import same_bits
from ..certify import Adversary
from ..rebuilt import difference, other_scene, rebuild
from . import survey
from .claims import (
    Claims,
    OfCode,
    compiles,
    of_another_mujoco,
    scene_or_nothing,
    wrong_certificate,
    wrong_hashes,
    wrong_labels,
    wrong_names,
    wrong_rejection,
    wrongly_drawn,
)
from .recheck import Simulated, certified_here, fails_again, simulate, why_not_certified

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
    claimed: bool = False
    """Whether it is declined because something differs under another version of the task or MuJoCo."""
    drifted: bool = False
    """Whether the replay reaches the goal, but ends in other bits than on the machine of the certificate."""
    seconds: float | None = None
    """Duration of the examination [s]; None if it did not end."""


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
    adversary: Adversary | None = None

    def __call__(self, job: Job) -> Answer:
        begun = time.perf_counter()
        answer = self._answer(job)
        timed = isinstance(answer, Examination)
        return replace(answer, seconds=round(time.perf_counter() - begun, 3)) if timed else answer

    def _answer(self, job: Job) -> Answer:
        try:
            if isinstance(job, range):
                return survey.draw_again(job, self.claims)
            if isinstance(job, LeftOut):
                return Failed(job.index, why_not_certified(job.index, self.claims, self.adversary))
            return self._examined(*job)
        except (ScengenError, ValueError, TypeError, KeyError, ArithmeticError, RecursionError) as error:
            why = " ".join(str(error).split())[:300] or type(error).__name__
            if isinstance(job, tuple):
                return self._judged(job[0], [OfCode(why)])
            verdict: Verdict = "declined" if self.claims.of_another_version else "refuted"
            return Examination(MANIFEST, verdict, (f"{_described(job)} cannot be made again: {why}",))

    def _judged(self, row: PoolRow, reasons: Sequence[str], *flags: bool) -> Examination:
        """The examination of a row with reasons against it. Those of other code are not faults of another version."""
        other = self.claims.of_another_version
        faults = [reason for reason in reasons if not (other and isinstance(reason, OfCode))]
        if faults or not reasons:
            return Examination(row.id, "refuted" if faults else "sound", tuple(faults), *flags)
        told = [f"{other}, where {'; '.join(reasons)}"]
        if self.level == "full":
            told.append(certified_here(row, self.claims, self.adversary))
        return Examination(row.id, "declined", tuple(told), *(flags or (False, False)), claimed=True)

    def _examined(self, row: PoolRow, simulated: bool, certified: bool) -> Examination:
        claims = self.claims
        reasons = [*wrong_labels(row, claims), *wrong_hashes(row)]
        if row.task != claims.task.name:
            return Examination(row.id, "refuted", tuple(reasons))
        try:
            scenario = claims.task.scenario(row.params, row.split)
        except ScengenError as error:
            return self._judged(row, [*reasons, OfCode(str(error))])
        reasons += [*wrong_names(row, scenario), *wrongly_drawn(row, claims)]
        reasons += (wrong_certificate if certified else wrong_rejection)(row, scenario, claims)
        text = rebuild(scenario) if compiles(row) else scene_or_nothing(scenario)
        if of_another_mujoco(claims.manifest):
            other = other_scene(row.scene_xml, text, row.embodiment)
        else:
            other = difference(row.scene_xml, text, same_bits(row.certificate), row.embodiment)
        if other:
            reasons.append(OfCode(other))
        if reasons or not simulated:
            return self._judged(row, reasons, True)
        if certified:
            done = simulate(row, scenario, text, claims.settings, self.level, self.adversary)
        else:
            found = fails_again(row, scenario, claims.settings, self.level, self.adversary)
            done = Simulated(tuple(found), False)
        if done.reasons:
            return self._judged(row, list(map(OfCode, done.reasons)), True, True)
        verdict: Verdict = "declined" if done.doubts else "sound"
        return Examination(row.id, verdict, done.doubts, True, True, drifted=done.drifted)


def lost_examination(job: Job, reason: str) -> Examination:
    """The examination of a job that has crashed its process, or has reached a limit."""
    if isinstance(job, tuple):
        return Examination(job[0].id, "declined", (f"verification {reason}",))
    return Examination(MANIFEST, "declined", (f"making {_described(job)} again {reason}",))


def _described(job: range | LeftOut) -> str:
    return f"index {job.index}" if isinstance(job, LeftOut) else f"indices {job.start} to {job.stop - 1}"

"""Recounting a folder of demonstrations: attempts without a row are made again."""

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace

from ..compose import certify_levels
from ..episode import OTHERWISE
from ..pool.demonstrations import FAILED, POLICY, SCRIPTED, TELEOP, DemonstrationManifest
from ..pool.manifest import PROCESS
from ..pool.row import DemonstrationRow
from ..runs.attempts import rejection
from ..runs.journal import Record
from ..samplers.task import Task
from ..validate.settings import CertifySettings
from ..validate.verify.survey import patience, shown, unlike
from ..work.parallel import Limits, Workers, each
from ..work.typed import typed
from .generate import APART, CHEAP_CHECKS, GIVEN_UP, STEPS, Job, funnel, outcomes

MAX_AGAIN = 10_000
"""Largest number of attempts without a row that are made again, in addition to `MAX_AGAIN_PER_ROW`."""
MAX_AGAIN_PER_ROW = 20
"""Further attempts that are made again for each demonstration: the default limit of a run."""
GIVEN_UP_KEY = f"solved: {GIVEN_UP}"
"""Reason of the takes that an operator has discarded."""


@dataclass
class Recount:
    """Attempts of a folder, those with a row and those that are made again, compared with its manifest."""

    manifest: DemonstrationManifest
    kept: list[int] = field(default_factory=list)
    """Numbers of the demonstrations, in the order of the rows."""
    lost: list[int] = field(default_factory=list)
    """Numbers of the failed attempts that have a row."""
    styles: Counter[str] = field(default_factory=Counter)
    """Number of demonstrations by style."""
    reasons: Counter[str] = field(default_factory=Counter)
    """Number of the failed attempts that have a row, by reason."""
    again: Counter[str] = field(default_factory=Counter)
    """Number of the attempts that were made again, by reason; "" counts successes."""
    claimed: list[str] = field(default_factory=list)
    """Claims that cannot be checked."""

    def number(self, row: DemonstrationRow) -> int:
        """Number of the attempt of a row."""
        return row.index * self.manifest.config.runs + row.run

    def keep(self, row: DemonstrationRow) -> Iterator[str]:
        """Count a demonstration; its faults."""
        yield from _misplaced(self.number(row), self.kept)
        if row.outcome != "success" or (row.reason and not row.reason.startswith(OTHERWISE)):
            yield "is a failed attempt among the demonstrations"
        self.styles[row.style] += 1

    def lose(self, row: DemonstrationRow) -> Iterator[str]:
        """Count a failed attempt that has a row; its faults."""
        yield from _misplaced(self.number(row), self.lost)
        if row.outcome == "success":
            yield "is a success among the failed attempts"
        self.reasons[rejection(_failed(row))] += 1

    # --- attempts without a row ---------------------------------------------------------------------------------------

    @property
    def missing(self) -> list[int]:
        """Numbers of the attempts of a run without a row."""
        return sorted({*range(self.manifest.indices)}.difference(self.kept, self.lost))

    def too_many(self) -> str:
        """Why attempts without a row are not made again; empty if they are."""
        count = self.manifest.indices - len(self.kept) - len(self.lost)
        most = MAX_AGAIN + MAX_AGAIN_PER_ROW * len(self.kept)
        return f"{count} attempts have no row; at most {most} are made again" if count > most else ""

    def make_again(self, job: Job, workers: Workers, limits: Limits) -> str:
        """Make the attempts without a row again.

        Returns:
            Why some were not made; empty if all were.
        """
        end, missing = time.monotonic() + patience(len(self.kept), limits.seconds), self.missing
        in_time = (number for number in missing if time.monotonic() < end)
        for record in each(_Light(job), in_time, workers, limits, job.lost_record):
            self.again[rejection(record) if record.check else ""] += 1
        short = self.again.total() < len(missing)
        return f"making {len(missing)} attempts without a row again takes too long" if short else ""

    # --- counts -------------------------------------------------------------------------------------------------------

    def contradictions(self) -> Iterator[str]:
        """Counts of the manifest that contradict each other or the rows."""
        manifest, count = self.manifest, len(self.kept)
        if both := {*self.kept} & {*self.lost}:
            yield f"attempt {min(both)} is a demonstration and a failed attempt"
        if manifest.styles != self.styles:
            yield "counts other styles than there are"
        if count > manifest.n:
            yield f"n = {manifest.n}, but there are {count} demonstrations"
        told, lost = Counter(manifest.reasons), Counter[str]()
        for key, times in told.items():
            lost[key.partition(": ")[0]] += times
        if strange := sorted({*lost} - {*STEPS, PROCESS}):
            yield f"the reasons name {strange[0][:40]!r}, which is not a check"
            return
        if manifest.config.keep and (more := self.reasons - told):
            yield f"{FAILED} holds attempts that the reasons do not count, {shown(more)}"
        if (expected := funnel(lost, count)) != dict(manifest.funnel):
            yield f"the funnel differs from the one that follows from rows and reasons, {expected}"
        if (played := outcomes(told, count)) != dict(manifest.outcomes):
            yield f"counts other outcomes than those that follow from rows and reasons, {shown(played)}"
        yield from self._wrong_size(count + told.total())

    def _wrong_size(self, attempted: int) -> Iterator[str]:
        manifest, last = self.manifest, max([*self.kept, *self.lost], default=-1)
        if manifest.source == SCRIPTED:
            if attempted != manifest.indices:
                yield f"rows and reasons give {attempted} attempts, not {manifest.indices}"
            last = self.kept[-1] if self.kept and len(self.kept) == manifest.n else manifest.indices - 1
        if manifest.source == POLICY and attempted != manifest.n:
            yield f"n = {manifest.n} rollouts, but rows and reasons give {attempted}"
        if manifest.source != TELEOP and last != manifest.indices - 1:
            yield f"indices = {manifest.indices}, but a run ends with its last attempt, {last}"

    def losses(self, apart: bool) -> Iterator[str]:
        """Reasons of the manifest that contradict the attempts that were made again.

        Args:
            apart: whether all pools are known from which the run kept apart.
        """
        told = Counter(self.manifest.reasons) - self.reasons
        if self.manifest.config.keep and (unseen := [key for key in told if _has_row(key)]):
            yield f"counts failed attempts that {FAILED} does not hold, {unseen[0][:200]!r}"
        free = {PROCESS} if apart else {PROCESS, APART}
        if why := unlike(told, self.again, free):
            yield f"made again, attempts without a row fail for other reasons than {why}"

    def without_row(self) -> Iterator[str]:
        """Reasons that the files of people and policies do not explain."""
        told = Counter(self.manifest.reasons) - self.reasons
        for key in told:
            driven = key == GIVEN_UP_KEY or key.partition(": ")[0] in CHEAP_CHECKS
            if self.manifest.source == POLICY or not driven:
                yield f"counts failed attempts that {FAILED} does not hold, {key[:200]!r}"
        if self.manifest.source == TELEOP and told:
            self.claimed.append(
                f"{told.total()} attempts without actions: given up, or scenarios that cannot be driven"
            )


@dataclass(frozen=True)
class _Light:
    """Makes an attempt without its row, which is not needed."""

    job: Job

    def __call__(self, number: int) -> Record:
        return self.job(number).light()


def usual_checks(task: Task) -> CertifySettings:
    """Settings of the checks of a task where a command line changes none."""
    return certify_levels(task)["quick"]


def checks_of(task: Task, manifest: DemonstrationManifest) -> CertifySettings:
    """Settings of the checks before the oracle plays.

    Raises:
        ScengenError: those of the manifest are none.
    """
    usual = replace(usual_checks(task), settle=manifest.config.settle)
    found = typed("checks", CertifySettings, {**asdict(usual), **(manifest.checks or {})}, exact=True)
    found.check()
    return found


def _misplaced(number: int, before: list[int]) -> Iterator[str]:
    """The fault of a row that does not come after those before it. The row is added to them."""
    if before and number <= before[-1]:
        yield "occurs twice, or after a later one"
    before.append(number)


def _failed(row: DemonstrationRow) -> Record:
    return Record(row.index, FAILED, "solved", f"{row.outcome}: {row.reason}", 1, {}, None, 0.0)


def _has_row(key: str) -> bool:
    """Whether a failed attempt with this reason has actions."""
    return key.startswith("solved: ") and key != GIVEN_UP_KEY

"""Verification of a pool of unknown origin: its claims are made again and compared, static facts first."""

import random
import time
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...errors import PoolError, ScengenError, cut
from ...pool import Pool, PoolRow
from ...pool.manifest import MANIFEST, PROCESS, Manifest
from ...samplers.task import Task
from ...work.fingerprint import same_bits
from ...work.parallel import Limits, Workers, each
from ..certify import Adversary
from ..settings import CertifySettings
from . import survey
from .claims import Claims, OfCode, of_another_version
from .examine import Answer, Examination, Examiner, Failed, Job, LeftOut, lost_examination
from .findings import Findings, Report
from .spot import excluded_share
from .stored import settings_of_manifest, task_of_manifest

LIMITS = Limits(300.0, 4000)
"""Time [s] and memory [MB] of one scenario: the slowest takes 40 s at level full, and 300 MB."""

MAX_FAULTS = 100
"""Number of refuted scenarios after which the others are not looked at: the pool is refuted anyway."""


@dataclass(frozen=True)
class Options:
    """Settings of the verification of a pool."""

    level: str = "recheck"
    """One of `recheck.LEVELS`."""
    sample: int | None = None
    """Number of scenarios that are simulated, chosen at random; None for all."""
    others: bool = True
    """Whether the scenarios that are not simulated are looked at, too. Otherwise they, and the run as a whole, are the
    author's word."""
    seed: int = 0
    """Seed of the sample. An author who knows it can forge the other scenarios."""
    workers: Workers = 1
    limits: Limits | None = LIMITS
    """Limits of one scenario; None to work in this process."""
    adversary: Adversary | None = None
    """The adversary at level full, if the certificates require an attack; see `certify.certify`."""
    any_mujoco: bool = False
    """Whether a pool that another MuJoCo certified is judged. Bits are not compared, and what differs is declined."""


def verify(
    pool: Pool,
    installed: Task,
    levels: Mapping[str, CertifySettings],
    options: Options,
    progress: Callable[[int], None] = lambda done: None,
) -> Report:
    """Check every claim of a pool that can be checked at a level.

    Args:
        installed: the task of that name on this machine; a pool names its task, and never code.
        levels: the settings that belong to a name such as `quick`, for this task.
        progress: called with the number of scenarios that have been checked.
    """
    found = Findings(options.level, pool.sha256)
    for name, what in pool.damaged().items():
        found.of_pool(name, "refuted", f"the shard {what}")
    other = of_another_version(pool.manifest, installed)
    try:
        settings = settings_of_manifest(pool.manifest)
    except (ScengenError, ArithmeticError, MemoryError, RecursionError) as error:
        found.of_pool(MANIFEST, "refuted", str(error))
        return found.report()
    try:
        task = task_of_manifest(pool, installed)
        claims = Claims.of(pool, task, settings)
    except (ScengenError, ArithmeticError, MemoryError, RecursionError) as error:
        told = ("declined", f"{other}, where {error}") if other else ("refuted", str(error))
        found.of_pool(MANIFEST, *told)
        return found.report()
    found.compare_tasks(installed, task)
    found.name_settings(settings, levels)
    found.compare_versions(claims, options.any_mujoco)
    found.compare_lock(pool.folder, claims)
    if found.pool_verdict != "declined":
        run = _Run(pool, options, found, _sample(pool, options, found), claims.of_another_version)
        examiner = Examiner(claims, options.level, options.adversary)
        run.examine(examiner, progress)
        run.count()
        if options.level == "full" and found.pool_verdict == "sound":
            run.certify_left_out(examiner)
        run.compare_files()
    return found.report()


@dataclass
class _Run:
    """The rows and rejects of a pool, and the indices that they were drawn from, on the way through the workers."""

    pool: Pool
    options: Options
    found: Findings
    sample: set[int] | None
    """Places of the rows that are simulated; None for all."""
    other_version: str = ""
    """See `Claims.of_another_version`."""
    indices: "array[int]" = field(default_factory=lambda: array("q"))
    """Indices of the rows, in the order of the rows."""
    places: dict[str, int] = field(default_factory=dict)
    """Place of the last row of each id."""
    repeated: set[str] = field(default_factory=set)
    """Ids of more than one row."""
    certified: set[int] = field(default_factory=set)
    """Indices of the rows."""
    first: int = 0
    """Number of rows that are first draws of their index."""
    rejected: list[survey.Reject] = field(default_factory=list)
    drawn: survey.Survey = field(default_factory=survey.Survey)
    """Counts over the indices that were drawn again."""
    faults: int = 0
    """Number of refuted scenarios."""
    complete: bool = False
    """Whether all rows and rejects have been read."""

    @property
    def manifest(self) -> Manifest:
        return self.pool.manifest

    def examine(self, examiner: Examiner, progress: Callable[[int], None]) -> None:
        """Let workers look at everything, and collect what they find."""
        seen: list[Examination] = []
        options, names = self.options, self.found.names
        jobs = self._jobs() if options.others or self.sample is None else self._sampled(sorted(self.sample))
        for one in each(examiner, jobs, options.workers, options.limits, lost_examination):
            if isinstance(one, dict):
                self.drawn.add(one, self.certified)
            elif isinstance(one, Failed) or one.id == MANIFEST:
                self._note(one)
            else:
                seen.append(one)
                self.faults += one.verdict == "refuted"
                if one.verdict == "sound" and one.id not in self.repeated:
                    names.pop(one.id, None)  # the report lists no names of sound scenarios, which may be a million
                progress(min(len(seen), len(self.pool)))
        seen.sort(key=lambda e: self.places.get(e.id, len(self.places)))
        for one in seen:
            if one.id in self.repeated:
                one = replace(one, verdict="refuted", reasons=(*one.reasons, "the id occurs twice"))
            self.found.examinations.append(one)

    def _jobs(self) -> Iterator[Job]:
        """Rows first: their number is known then, and a manifest that promises another number is not drawn again."""
        try:
            for place, row in enumerate(self.pool.rows()):
                self._count(row)
                self.first += row.attempt == 0
                if self._hopeless():
                    return
                yield row, self.sample is None or place in self.sample, True
            for row in self.pool.rejects():
                self.rejected.append(survey.Reject.of(row))
                self.found.names[row.id] = cut(str(row.name))
                if self._hopeless():
                    return
                yield row, self.options.sample is None, False
        except PoolError as error:
            self.found.of_pool("shards", "refuted", str(error))
            return
        self.complete = True
        if not self.manifest.is_subset and len(self.indices) == len(self.pool):
            yield from self._pieces()

    def _count(self, row: PoolRow) -> None:
        """Note a row that is looked at."""
        if row.id in self.places:
            self.repeated.add(row.id)
        self.places[row.id] = len(self.indices)
        self.indices.append(row.index)
        self.found.names[row.id] = cut(str(row.name))
        self.certified.add(row.index)

    def _sampled(self, places: Sequence[int]) -> Iterator[Job]:
        """The rows of the sample. Of the other rows only ids and indices are compared with those of a run."""
        told = "the scenarios outside the sample were not looked at"
        self.found.remarks.append(f"{told}: they, the funnel and the reasons are the author's word")
        try:
            directory = self.pool.directory
            if id_ := directory.repeated:
                self.found.of_pool(MANIFEST, "refuted", f"the id {id_} occurs twice")
            if later := np.flatnonzero(np.diff(directory.indices) <= 0).tolist():
                index = int(directory.indices[later[0] + 1])
                self.found.of_pool(MANIFEST, "refuted", f"index {index} occurs twice, or after a later one")
            for what in survey.wrong_order(directory.indices.tolist(), self.manifest):
                self.found.of_pool(MANIFEST, "refuted", what)
            for row in self.pool.some(places):
                self._count(row)
                yield row, True, True
        except PoolError as error:
            self.found.of_pool("shards", "refuted", str(error))

    def _hopeless(self) -> bool:
        """Whether so much is false that the other rows are not looked at; the report says so."""
        if self.faults >= MAX_FAULTS:
            why = f"{self.faults} scenarios are refuted; those after them were not looked at"
        elif len(self.indices) > 1 and self.indices[-1] <= self.indices[-2]:
            why = f"index {self.indices[-1]} occurs twice, or after a later one; the rows after it were not looked at"
        else:
            return False
        self.found.of_pool(MANIFEST, "refuted", why)
        return True

    def _pieces(self) -> Iterator[range]:
        """The indices of the run, as long as the draws do not exceed those of the manifest, and in time."""
        if why := survey.too_large(self.manifest):
            self.found.of_pool(MANIFEST, "declined", why)
            return
        limits, begun = self.options.limits, time.monotonic()
        patience = survey.patience(len(self.pool), limits.seconds) if limits else float("inf")
        for piece in survey.chunks(self.manifest.indices):
            if why := survey.too_many(self.manifest, self.drawn.indices, self.drawn.proposals):
                self.found.of_pool(MANIFEST, "refuted", why)
                return
            if time.monotonic() - begun > patience:
                why = f"drawing its indices again takes longer than {patience:g} s: index {piece.start} was reached"
                self.found.of_pool(MANIFEST, "declined", why)
                return
            yield piece

    def certify_left_out(self, examiner: Examiner) -> None:
        """Certify the scenarios that the run has drawn and left out: an author might leave out difficult ones."""
        if self.manifest.is_subset or self.options.sample is not None:
            return
        left_out = [LeftOut(index) for index in sorted(self.drawn.left_out)]
        for one in each(examiner, left_out, self.options.workers, self.options.limits, lost_examination):
            self._note(one)
        reasons = self.found.left_out
        if certified := sum(not why for why in reasons.values()):
            told = f"{certified} of {len(left_out)} scenarios that the run left out are certified here"
            self.found.remarks.append(told)
        if len(reasons) == len(left_out) and same_bits(self.manifest) and not self.other_version:
            for what in survey.wrong_losses(self.manifest, reasons):
                self.found.of_pool(MANIFEST, "refuted", what)

    def _note(self, one: Answer) -> None:
        """Keep a finding about the pool as a whole, or about an index without a scenario."""
        if isinstance(one, Failed):
            self.found.left_out[one.index] = one.reason
        elif isinstance(one, Examination):
            self.found.of_pool(one.id, one.verdict, "; ".join(one.reasons))

    def compare_files(self) -> None:
        """Compare the files once more, so that the report is about the pool that is there now."""
        if self.found.pool_verdict != "sound":
            return
        for name, what in self.pool.damaged().items():
            self.found.of_pool(name, "refuted", f"at the end of verification, the shard {what}")
        try:
            same = Manifest.read(self.pool.folder) == self.manifest
        except PoolError:
            same = False
        if not same:
            self.found.of_pool(MANIFEST, "refuted", "it has been changed during verification")

    def count(self) -> None:
        """Compare the counts of the manifest with what has been seen, and name those that rest on the author's word."""
        remarks, manifest = self.found.remarks, self.manifest
        if lost := sum(times for key, times in manifest.reasons.items() if key.partition(": ")[0] == PROCESS):
            told = f"{lost} indices were lost to limits or crashes on the author's machine"
            remarks.append(f"{told}: that their scenarios cannot be certified is the author's word")
        if manifest.attack is not None:
            rollouts = sum(rate["rollouts"] for rate in manifest.rates)
            told = f"the attack on the pool counts {rollouts} rollouts and {len(manifest.hits)} hits"
            remarks.append(f"{told}: the hits are replayed; rollouts, losses and fixed answers are the author's word")
        if not self.manifest.is_subset and len(self.pool) < self.manifest.n:
            told = f"{self.manifest.n} scenarios were requested, and the run ended with {len(self.pool)}"
            self.found.remarks.append(f"{told}: this number is the author's word")
        for what in self._miscounted():
            if isinstance(what, OfCode) and self.other_version:
                self.found.of_pool(MANIFEST, "declined", f"{self.other_version}, where {what}")
            else:
                self.found.of_pool(MANIFEST, "refuted", what)

    def _miscounted(self) -> Iterator[str]:
        if not self.complete:
            return
        yield from survey.wrong_order(self.indices, self.manifest)
        if self.manifest.is_subset:
            yield from survey.wrong_subset(self.manifest)
            return
        yield from survey.wrong_attack(self.manifest)
        yield from survey.wrong_rejects(self.manifest, self.rejected, self.certified)
        if self.drawn.indices == self.manifest.indices:
            wrong = survey.wrong_funnel(self.manifest, len(self.indices), self.first, self.drawn)
            yield from map(OfCode, wrong)


def _sample(pool: Pool, options: Options, found: Findings) -> set[int] | None:
    """Places of the rows that are simulated; None for all."""
    total = len(pool)
    if options.sample is None or options.sample >= total:
        return None
    places = set(random.Random(options.seed).sample(range(total), options.sample))
    share = excluded_share(total, options.sample)
    found.sample = {"size": options.sample, "of": total, "seed": options.seed, "excluded_share": share}
    return places

"""Verification of a pool whose author nobody knows: what it claims is made again and compared, static facts first."""

import random
import time
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import PoolError, ScengenError, cut
from ..fingerprint import fingerprint
from ..pool.pool import Pool, PoolRow
from ..samplers.task import Task
from ..work.parallel import Limits, Workers, each
from . import survey
from .certify import Adversary
from .claims import Claims
from .examine import MANIFEST, Answer, Examination, Examiner, Failed, Job, Left, lost
from .findings import Findings, Report
from .settings import CertifySettings
from .spot import excluded_share
from .stored import settings_of, task_of_manifest

LIMITS = Limits(300.0, 4000)
"""Of one scenario: the slowest takes 40 s at level full, and 300 MB."""

MOST_FAULTS = 100
"""Refuted scenarios after which the others are not looked at: the pool is refuted, however many it has."""


@dataclass(frozen=True)
class Options:
    """How a pool is verified."""

    level: str = "recheck"
    """See `recheck.LEVELS`."""
    sample: int | None = None
    """How many scenarios are simulated, chosen at random; None for all."""
    others: bool = True
    """Whether the scenarios that are not simulated are looked at, too. Else they, and the run as a whole, are taken at
    their author's word."""
    seed: int = 0
    """Decides which. An author who knows it forges the others."""
    workers: Workers = 1
    limits: Limits | None = LIMITS
    """Of one scenario; None to work in this process."""
    strict: bool = True
    """Whether a certificate that is older than the family's code is declined."""
    adversary: Adversary | None = None
    """Who attacks at level full where the certificates ask for it; see `certify.certify`."""


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
        levels: the settings that stand behind a name such as `quick`, for this task.
        progress: told how many scenarios have been checked.
    """
    found = Findings(options.level, options.strict)
    for name, what in pool.damaged().items():
        found.of_pool(name, "refuted", f"the shard {what}")
    try:
        task, settings = task_of_manifest(pool, installed), settings_of(pool.manifest["config"]["certify"])
        claims = Claims.of(pool, task, settings)
    except (ScengenError, ArithmeticError, MemoryError, RecursionError) as error:
        found.of_pool(MANIFEST, "refuted", str(error))
        return found.report()
    found.compare(installed.node, {key: told for key, told in task.node.items() if key != "scans"})
    for name in ("code", "category"):
        if getattr(task, name) != getattr(installed, name):
            told = f"the {name} is {getattr(task, name)[:60]!r}, that of the task is {getattr(installed, name)!r}"
            found.of_pool(MANIFEST, "refuted", told)
    found.weigh(settings, levels)
    found.age(claims)
    found.look_up(pool.folder, claims)
    if found.pool_verdict != "declined":
        run = _Run(pool, options, found, _sample(pool, options, found))
        examiner = Examiner(claims, options.level, found.expired, options.adversary)
        run.examine(examiner, progress)
        run.count()
        if options.level == "full" and found.pool_verdict == "sound":
            run.certify_left(examiner)
    return found.report()


@dataclass
class _Run:
    """The rows and rejects of a pool, and the indices that they were drawn from, on the way through the workers."""

    pool: Pool
    options: Options
    found: Findings
    chosen: set[int] | None
    """Places of the rows that are simulated; None for all."""
    indices: "array[int]" = field(default_factory=lambda: array("q"))
    """Of the rows, as they stand."""
    places: dict[str, int] = field(default_factory=dict)
    """By id where the row stands, or its last one."""
    twice: set[str] = field(default_factory=set)
    """Ids that stand in several rows."""
    certified: set[int] = field(default_factory=set)
    """Indices of the rows."""
    first: int = 0
    """Rows that are first draws of their index."""
    rejected: list[survey.Reject] = field(default_factory=list)
    drawn: survey.Survey = field(default_factory=survey.Survey)
    """What came of the indices that were drawn again."""
    faults: int = 0
    """Refuted scenarios."""
    whole: bool = False
    """Whether all rows and rejects have been read."""

    def examine(self, examiner: Examiner, progress: Callable[[int], None]) -> None:
        """Let workers look at everything, and collect what they find."""
        seen: list[Examination] = []
        options, names = self.options, self.found.names
        jobs = self._jobs() if options.others or self.chosen is None else self._sampled(sorted(self.chosen))
        for one in each(examiner, jobs, options.workers, options.limits, lost):
            if isinstance(one, dict):
                self.drawn.add(one, self.certified)
            elif isinstance(one, Failed) or one.id == MANIFEST:
                self._note(one)
            else:
                seen.append(one)
                self.faults += one.verdict == "refuted"
                if one.verdict == "sound" and one.id not in self.twice:
                    names.pop(one.id, None)  # of a million nobody wants to be told
                progress(min(len(seen), len(self.pool)))
        seen.sort(key=lambda e: self.places.get(e.id, len(self.places)))
        for one in seen:
            if one.id in self.twice:
                one = replace(one, verdict="refuted", reasons=(*one.reasons, "the id occurs twice"))
            self.found.examinations.append(one)

    def _jobs(self) -> Iterator[Job]:
        """Rows first: how many there are is known then, and a manifest that promises others is not drawn again."""
        try:
            for place, row in enumerate(self.pool.rows()):
                self._count(row)
                self.first += row.attempt == 0
                if self._hopeless():
                    return
                yield row, self.chosen is None or place in self.chosen, True
            for row in self.pool.rejects():
                self.rejected.append(survey.Reject.of(row))
                self.found.names[row.id] = cut(str(row.name))
                if self._hopeless():
                    return
                yield row, self.options.sample is None, False
        except PoolError as error:
            self.found.of_pool("shards", "refuted", str(error))
            return
        self.whole = True
        if not self.pool.chosen and len(self.indices) == len(self.pool):
            yield from self._pieces()

    def _count(self, row: PoolRow) -> None:
        """Note which row is looked at."""
        if row.id in self.places:
            self.twice.add(row.id)
        self.places[row.id] = len(self.indices)
        self.indices.append(row.index)
        self.found.names[row.id] = cut(str(row.name))
        self.certified.add(row.index)

    def _sampled(self, places: Sequence[int]) -> Iterator[Job]:
        """The sample alone, and of the others that their ids and indices can be those of a run."""
        told = "the scenarios that are not in the sample were not looked at"
        self.found.remarks.append(f"{told}: they, the funnel and the reasons are the author's word")
        try:
            directory = self.pool.directory
            if id_ := directory.twice:
                self.found.of_pool(MANIFEST, "refuted", f"the id {id_} occurs twice")
            if later := np.flatnonzero(np.diff(directory.indices) <= 0).tolist():
                index = int(directory.indices[later[0] + 1])
                self.found.of_pool(MANIFEST, "refuted", f"index {index} stands twice, or after a later one")
            for what in survey.wrong_order(directory.indices.tolist(), self.pool):
                self.found.of_pool(MANIFEST, "refuted", what)
            for row in self.pool.some(places):
                self._count(row)
                yield row, True, True
        except PoolError as error:
            self.found.of_pool("shards", "refuted", str(error))

    def _hopeless(self) -> bool:
        """Whether so much is false already that nobody needs to know about the rest; the report says so."""
        if self.faults >= MOST_FAULTS:
            why = f"{self.faults} scenarios are refuted; those after them were not looked at"
        elif len(self.indices) > len(self.pool) or len(self.rejected) > self.pool.promised_rejects:
            why = "the shards hold more scenarios than the manifest promises"
        elif len(self.indices) > 1 and self.indices[-1] <= self.indices[-2]:
            why = f"index {self.indices[-1]} stands twice, or after a later one; the rows behind it were not looked at"
        else:
            return False
        self.found.of_pool(MANIFEST, "refuted", why)
        return True

    def _pieces(self) -> Iterator[range]:
        """The indices of the run, as long as what has been drawn can be what the manifest counts, and in time."""
        if why := survey.too_large(self.pool):
            self.found.of_pool(MANIFEST, "declined", why)
            return
        limits, begun = self.options.limits, time.monotonic()
        patience = survey.patience(self.pool, limits.seconds) if limits else float("inf")
        for piece in survey.chunks(self.pool.indices):
            if why := survey.too_many(self.pool, self.drawn.indices, self.drawn.proposals):
                self.found.of_pool(MANIFEST, "refuted", why)
                return
            if time.monotonic() - begun > patience:
                why = f"drawing its indices again takes longer than {patience:g} s: index {piece.start} was reached"
                self.found.of_pool(MANIFEST, "declined", why)
                return
            yield piece

    def certify_left(self, examiner: Examiner) -> None:
        """Certify what the run has drawn and left out: else an author might leave out what a policy is bad at."""
        if self.pool.chosen or self.options.sample is not None:
            return
        left = [Left(index) for index in sorted(self.drawn.left)]
        for one in each(examiner, left, self.options.workers, self.options.limits, lost):
            self._note(one)
        if certified := sum(not why for why in self.found.left_out.values()):
            self.found.remarks.append(f"{certified} of {len(left)} scenarios that the run left out are certified here")
        if len(self.found.left_out) == len(left) and examiner.claims.fingerprint == fingerprint():
            for what in survey.wrong_losses(self.pool, self.found.left_out):
                self.found.of_pool(MANIFEST, "refuted", what)

    def _note(self, one: Answer) -> None:
        """Keep what was found about the pool as a whole, or about an index without a scenario."""
        if isinstance(one, Failed):
            self.found.left_out[one.index] = one.reason
        elif isinstance(one, Examination):
            self.found.of_pool(one.id, one.verdict, "; ".join(one.reasons))

    def count(self) -> None:
        """Compare the counts of the manifest with what has been seen."""
        if not self.pool.chosen and len(self.pool) < (asked := self.pool.manifest["n"]):
            told = f"{asked} scenarios were asked for, and the run ended with {len(self.pool)}"
            self.found.remarks.append(f"{told}: how many is the author's word")
        for what in self._miscounted():
            self.found.of_pool(MANIFEST, "refuted", what)

    def _miscounted(self) -> Iterator[str]:
        if not self.whole:
            return
        yield from survey.wrong_order(self.indices, self.pool)
        if self.pool.chosen:
            yield from survey.wrong_subset(self.pool)
            return
        yield from survey.wrong_attack(self.pool)
        yield from survey.wrong_rejects(self.pool, self.rejected, self.certified)
        if self.drawn.indices == self.pool.indices:
            yield from survey.wrong_funnel(self.pool, len(self.indices), self.first, self.drawn)


def _sample(pool: Pool, options: Options, found: Findings) -> set[int] | None:
    """Places of the rows that are simulated; None for all."""
    total = len(pool)
    if options.sample is None or options.sample >= total:
        return None
    chosen = set(random.Random(options.seed).sample(range(total), options.sample))
    share = excluded_share(total, options.sample)
    found.sample = {"size": options.sample, "of": total, "seed": options.seed, "excluded_share": share}
    return chosen

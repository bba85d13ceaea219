"""Verification of a pool whose author nobody knows: what it claims is made again and compared, static facts first."""

import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from ..errors import PoolError, ScengenError
from ..parallel import Limits, each
from ..pool import Pool, PoolRow
from ..samplers.task import Task
from . import claims as claim
from . import survey
from .certify import Adversary
from .claims import Claims
from .identity import fingerprint, source_sha256, versions
from .rebuilt import difference, rebuild
from .recheck import simulate
from .settings import CertifySettings
from .spot import excluded_share
from .stored import settings_of, task_of_manifest

Verdict = Literal["sound", "refuted", "declined"]
"""`declined` is no statement: the check died, was too large or too slow, or belongs to another version."""

LIMITS = Limits(300.0, 4000)
"""Of one scenario: the slowest of the seven tasks takes 40 s at level full, and 300 MB."""


@dataclass(frozen=True)
class Options:
    """How a pool is verified."""

    level: str = "recheck"
    """See `recheck.LEVELS`."""
    sample: int | None = None
    """How many scenarios are simulated, chosen at random; None for all."""
    seed: int = 0
    """Decides which. An author who knows it forges the others."""
    workers: int = 1
    limits: Limits | None = LIMITS
    """Of one scenario; None to work in this process."""
    strict: bool = True
    """Whether a certificate that is older than the family's code is declined."""
    adversary: Adversary | None = None
    """Who attacks at level full where the certificates ask for it; see `certify.certify`."""


@dataclass(frozen=True)
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
class Report:
    """What verification found about a pool."""

    verdict: Verdict
    level: str
    checked: int
    """Scenarios that were looked at."""
    sound: int
    refuted: int
    declined: int
    rebuilt: int
    """Scenarios whose parameters, labels and scene were made again from task, seed and index."""
    replayed: int
    rechecked: int
    """Those whose checks without an oracle were repeated."""
    certified_again: int
    failed: list[dict[str, str]]
    """`id`, `verdict` and `reason` of everything that is not sound; a fault of the whole pool under manifest.json."""
    expired: int
    drifted: int
    settings: str
    """Whose settings the certificates have: `quick`, `full`, or `own settings` and in what they differ."""
    differences: list[dict[str, str]]
    """Where the manifest's task differs from the installed file: `key`, `pool` and `installed`."""
    sample: dict[str, Any] | None
    """Size and seed of the sample, and which share of false rows it excludes at 95 %."""
    remarks: list[str]
    """What holds and yet should be known."""
    examinations: list[dict[str, Any]]
    """`id`, `verdict` and `reason` of every scenario."""

    @property
    def holds(self) -> bool:
        return self.verdict == "sound"


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
    found = _Found(options)
    for name, what in pool.damaged().items():
        found.of_pool(name, "refuted", f"the shard {what}")
    try:
        task, settings = task_of_manifest(pool, installed), settings_of(pool.manifest["config"]["certify"])
        claims = Claims.of(pool, task, settings)
    except (ScengenError, ArithmeticError, MemoryError, RecursionError) as error:
        found.of_pool("manifest.json", "refuted", str(error))
        return found.report()
    found.compare(installed.node, task.node)
    for name in ("code", "category"):
        if getattr(task, name) != getattr(installed, name):
            told = f"the {name} is {getattr(task, name)[:60]!r}, that of the task is {getattr(installed, name)!r}"
            found.of_pool("manifest.json", "refuted", told)
    found.weigh(settings, levels)
    found.age(claims)
    if found.pool_verdict != "declined":
        _rows(pool, claims, options, found, progress)
    return found.report()


class _Found:
    """Collects what is found."""

    def __init__(self, options: Options):
        self.options = options
        self.failed: list[dict[str, str]] = []
        self.examinations: list[Examination] = []
        self.differences: list[dict[str, str]] = []
        self.remarks: list[str] = []
        self.settings, self.sample = "", None
        self.expired = False

    @property
    def pool_verdict(self) -> Verdict:
        """That of the pool as a whole so far."""
        verdicts = {f["verdict"] for f in self.failed} | {e.verdict for e in self.examinations}
        return "refuted" if "refuted" in verdicts else "declined" if "declined" in verdicts else "sound"

    def of_pool(self, where: str, verdict: Verdict, reason: str) -> None:
        """Note a fault of the pool as a whole, or of one of its files."""
        self.failed.append({"id": where, "verdict": verdict, "reason": reason})

    def compare(self, installed: Mapping[str, Any], stored: Mapping[str, Any]) -> None:
        """Note where the manifest's task differs from the installed file."""
        self.differences = list(differences(installed, stored))

    def weigh(self, settings: CertifySettings, levels: Mapping[str, CertifySettings]) -> None:
        """Note whose settings the certificates have."""
        known = levels.get(settings.name)
        if known is None:
            told = f"the settings are called {settings.name[:60]!r}; known: {', '.join(levels)}"
            self.of_pool("manifest.json", "refuted", told)
        elif settings == known:
            self.settings = settings.name
        else:
            other = ", ".join(d["key"] for d in differences(asdict(known), asdict(settings)))
            self.settings = f"own settings ({settings.name}, but for {other})"
            if settings.name != "quick" and settings.robust.bound < known.robust.bound:
                bounds = f"{known.robust.bound:g}, and not {settings.robust.bound:g}"
                told = f"the settings are called {settings.name}, whose bound of the robust check is {bounds}"
                self.of_pool("manifest.json", "refuted", told)

    def age(self, claims: Claims) -> None:
        """Note what the pool was made with."""
        for package, made in claims.versions.items():
            here = versions().get(package)
            if package in ("mujoco", "robosuite") and made != here:
                told = f"certified with {package} {made}, this is {here}: unknown to this installation"
                self.of_pool("manifest.json", "declined", told)
            elif made != here:
                self.remarks.append(f"certified with {package} {made}, this is {here}")
        self.expired = claims.source_sha256 != source_sha256(claims.task.family)
        if self.expired and self.options.strict:
            self.of_pool(
                "manifest.json",
                "declined",
                "expired: code that it depends on has changed since; certify the pool again",
            )
        if claims.fingerprint != fingerprint():
            self.remarks.append(
                "certified on a machine that rounds otherwise: final states and numbers are not compared"
            )

    def report(self) -> Report:
        verdicts = [e.verdict for e in self.examinations]
        faults = [{"id": e.id, "verdict": e.verdict, "reason": "; ".join(e.reasons)} for e in self.examinations]
        simulated = sum(e.simulated for e in self.examinations)
        level = self.options.level
        return Report(
            self.pool_verdict,
            level,
            len(verdicts),
            verdicts.count("sound"),
            verdicts.count("refuted"),
            verdicts.count("declined"),
            sum(e.rebuilt for e in self.examinations),
            simulated,
            simulated if level in ("recheck", "full") else 0,
            simulated if level == "full" else 0,
            self.failed + [f for f in faults if f["verdict"] != "sound"],
            sum(e.expired for e in self.examinations),
            sum(e.drifted for e in self.examinations),
            self.settings,
            self.differences,
            self.sample,
            self.remarks,
            faults,
        )


@dataclass(frozen=True)
class Examiner:
    """Looks at one scenario, or draws a piece of the run again."""

    claims: Claims
    level: str
    expired: bool
    adversary: Adversary | None

    def __call__(self, job: "Job") -> "Examination | dict[int, survey.Drawn]":
        if isinstance(job, range):
            return survey.draw_again(job, self.claims)
        row, simulated, certified = job
        try:
            return self._examined(row, simulated, certified)
        except (ScengenError, ValueError, TypeError, KeyError, ArithmeticError, RecursionError) as error:
            return Examination(row.id, "refuted", (" ".join(str(error).split())[:300],), expired=self.expired)

    def _examined(self, row: PoolRow, simulated: bool, certified: bool) -> Examination:
        claims = self.claims
        reasons = list(claim.wrong_labels(row, claims))
        if row.task != claims.task.name:
            return Examination(row.id, "refuted", tuple(reasons), expired=self.expired)
        scenario = claims.task.scenario(row.params)
        reasons += [*claim.wrong_names(row, scenario), *claim.wrongly_drawn(row, claims)]
        if certified:
            reasons += claim.wrong_certificate(row, scenario, claims)
        else:
            reasons += claim.wrong_rejection(row, claims)
        text = rebuild(scenario)
        if row.scene_xml or certified:
            exact = row.certificate.fingerprint == fingerprint()
            reasons += filter(None, [difference(row.scene_xml, text, exact)])
        if reasons or not simulated:
            verdict: Verdict = "refuted" if reasons else "sound"
            return Examination(row.id, verdict, tuple(reasons), True, expired=self.expired)
        done = simulate(row, scenario, text, claims.settings, self.level, self.adversary)
        verdict = "refuted" if done.reasons else "sound"
        return Examination(row.id, verdict, done.reasons, True, True, self.expired, done.drifted)


Job = tuple[PoolRow, bool, bool] | range
"""A row, whether it is simulated, and whether it was certified; or indices to draw again."""


def _lost(job: Job, reason: str) -> "Examination | dict[int, survey.Drawn]":
    if isinstance(job, range):
        return Examination("manifest.json", "declined", (f"drawing indices {job.start} to {job.stop - 1} {reason}",))
    return Examination(job[0].id, "declined", (f"verification {reason}",))


def _rows(pool: Pool, claims: Claims, options: Options, found: _Found, progress: Callable[[int], None]) -> None:
    chosen = _sample(pool, options, found)
    certified: dict[int, int] = {}
    drawn: dict[int, survey.Drawn] = {}
    indices: list[int] = []
    ids: list[str] = []
    rejected: list[str] = []

    def jobs() -> Iterator[Job]:
        if (why := survey.too_large(pool)) and not pool.chosen:
            found.of_pool("manifest.json", "declined", why)
        elif not pool.chosen:
            yield from survey.chunks(pool.indices)
        try:
            for place, row in enumerate(pool.rows()):
                indices.append(row.index)
                ids.append(row.id)
                certified[row.index] = row.attempt
                yield row, chosen is None or place in chosen, True
            for row in pool.rejected:
                failed = next((c.name for c in row.certificate.checks if c.passed is False), "")
                rejected.append(failed)
                yield row, False, False
        except PoolError as error:
            found.of_pool("shards", "refuted", str(error))

    examiner = Examiner(claims, options.level, found.expired, options.adversary)
    seen: list[Examination] = []
    for one in each(examiner, jobs(), options.workers, options.limits, _lost):
        if isinstance(one, dict):
            drawn.update(one)
        elif one.id == "manifest.json":
            found.of_pool(one.id, one.verdict, "; ".join(one.reasons))
        else:
            seen.append(one)
            progress(min(len(seen), len(pool)))
    order = {id_: place for place, id_ in enumerate(ids)}
    twice = {id_ for id_ in ids if ids.count(id_) > 1} if len(order) < len(ids) else set()
    for one in sorted(seen, key=lambda e: order.get(e.id, len(order))):
        if one.id in twice:
            one = replace(one, verdict="refuted", reasons=(*one.reasons, "the id occurs twice"))
        found.examinations.append(one)
    for what in _counts(pool, indices, certified, drawn, rejected):
        found.of_pool("manifest.json", "refuted", what)


def _counts(
    pool: Pool,
    indices: list[int],
    certified: Mapping[int, int],
    drawn: Mapping[int, survey.Drawn],
    rejected: list[str],
) -> Iterator[str]:
    yield from survey.wrong_order(indices, pool)
    if pool.chosen:
        yield from survey.wrong_subset(pool)
    elif len(drawn) == pool.indices:
        yield from survey.wrong_funnel(pool, certified, drawn)
    yield from survey.wrong_rejects(pool, rejected)


def _sample(pool: Pool, options: Options, found: _Found) -> set[int] | None:
    """Places of the rows that are simulated; None for all."""
    total = len(pool)
    if options.sample is None or options.sample >= total:
        return None
    chosen = set(random.Random(options.seed).sample(range(total), options.sample))
    share = excluded_share(total, options.sample)
    found.sample = {"size": options.sample, "of": total, "seed": options.seed, "excluded_share": share}
    return chosen


def differences(installed: Any, stored: Any, key: str = "") -> Iterator[dict[str, str]]:
    """Where two mappings differ: dotted key, and both values."""
    if isinstance(installed, Mapping) and isinstance(stored, Mapping):
        for name in [*installed, *(n for n in stored if n not in installed)]:
            below = f"{key}.{name}".strip(".")
            yield from differences(installed.get(name, _NONE), stored.get(name, _NONE), below)
    elif installed != stored:
        yield {"key": key, "pool": _told(stored), "installed": _told(installed)}


_NONE: Any = object()


def _told(value: Any) -> str:
    return "(not there)" if value is _NONE else str(value)[:200]

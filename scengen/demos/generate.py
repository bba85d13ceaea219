"""A run that makes demonstrations: draw, check what is cheap, let the oracle play in a style, remember everything."""

import math
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..certificate import Check
from ..compose import certify_levels
from ..errors import BadConfig, Infeasible, cut
from ..ood.analysis.distance import NEAR_DUPLICATE_DISTANCE, near_duplicates
from ..ood.analysis.space import Batch
from ..pool import Pool, collection
from ..pool.demonstrations import (
    DEMONSTRATIONS,
    DemonstrationConfig,
    DemonstrationManifest,
    Demonstrations,
    write_demonstrations,
)
from ..pool.files import sha256
from ..pool.manifest import PROCESS
from ..pool.row import DemonstrationRow
from ..runs.attempts import Progress, Wanted, extend, first_of, infeasible, rejection, reported_write_errors
from ..runs.journal import Journal, Record, start_over
from ..samplers.split import ID, Split
from ..samplers.task import Draw, Task
from ..validate.certify import Trial
from ..validate.labels import labels_of_draw, labels_of_task, made_with
from ..validate.rollout import Rollout, run
from ..validate.settings import CertifySettings
from ..work.limits import at_least, check_count
from ..work.parallel import Limits, Workers
from .styles import NOMINAL, RECOVER, VARIED, check_styles, chosen, in_style

SEED = 1000
"""Default seed. Pools have 0, so that demonstrations and evaluation have different scenarios."""
KEPT = "kept"
"""Verdict of an attempt that is a demonstration."""
FAILED = "failed"
"""Verdict of an attempt that is none."""
GIVEN_UP = "given up"
"""Reason of a driven attempt that its operator has discarded; it has no row."""
APART = "apart"
"""Check whether a scenario is apart from those of other pools."""
CHEAP_CHECKS = ("feasible", "compiles", "overlap", "rest", "unsolved")
"""Checks of a certificate that are made before the oracle plays."""
STEPS = ("feasible", APART, "compiles", "overlap", "rest", "unsolved", "solved")
"""Checks of an attempt in their order."""


@dataclass(frozen=True)
class DemosSettings:
    """Settings of `scengen demos`; conf/command/demos.yaml explains them."""

    split: str = ID
    sampler: str = "iid"
    n: int = 200
    runs: int = 1
    styles: list[str] = field(default_factory=lambda: [NOMINAL, VARIED, RECOVER])
    seed: int = SEED
    apart: str | list[str] | None = None
    keep: list[str] = field(default_factory=list)
    to: str | None = None
    workers: Workers = 1
    limit: int | None = None
    limit_seconds: float = 600.0
    limit_mb: int = 4000
    fresh: bool = False
    json: str | None = None

    def folder(self, task: Task) -> Path:
        """Folder of the demonstrations."""
        return Path(self.to or Path("generated", f"{task.name}-{Split.parse(self.split)}-demos"))

    def check(self, task: Task) -> None:
        """Raise `ScengenError` for a setting that makes no sense for this task."""
        task.shifts(self.split)
        at_least(self, n=1, runs=1, seed=0, workers=1, limit=1, limit_seconds=1, limit_mb=200)
        size = task.design(self.sampler).size
        why = f"sampler={self.sampler} has {size} scenarios, with {self.runs} runs each"
        check_count(self.n, self.limit, size and size * self.runs, why, "demonstrations")
        check_styles(self.styles)
        if not self.styles:
            raise BadConfig("styles = []; give at least one style, such as styles=[varied]")
        if set(self.keep) - {FAILED}:
            raise BadConfig(f"keep = {cut(','.join(self.keep))}; it must be {FAILED}, or be left out")


@dataclass(frozen=True)
class DemosSummary:
    """Result of a run."""

    demonstrations: Demonstrations
    made: int
    """Number of demonstrations."""
    manifest: DemonstrationManifest
    cpu: float
    """Processor time of all counted attempts, in this run or earlier ones [s]."""


@dataclass(frozen=True)
class Others:
    """Scenarios of other pools, from which demonstrations are kept apart."""

    ids: frozenset[str]
    batch: Batch

    @classmethod
    def of(cls, pools: Sequence[Pool]) -> "Others":
        """The scenarios of some pools of the same task."""
        params = {name: values for pool in pools for name, values in pool.columns("id", "params")}
        names = sorted(params)
        return cls(frozenset(names), Batch.read(np.array(names, str), (params[name] for name in names)))

    def too_near(self, task: Task, draw: Draw) -> str:
        """Reason why a scenario is not apart; empty if it is."""
        if draw.scenario.id in self.ids:
            return "it is a scenario of a pool to keep apart from"
        if self.ids and near_duplicates(task, Batch.of({draw.scenario.id: draw.scenario}), self.batch):
            within = f"within {NEAR_DUPLICATE_DISTANCE:g} training widths"
            return f"it is a near duplicate ({within}) of a scenario of a pool to keep apart from"
        return ""


@dataclass(frozen=True)
class Job:
    """Settings that all attempts of a run share. Calling it with a number makes that attempt.

    Attempt `k` is run `k % runs` of the scenario of index `k // runs`.
    """

    task: Task
    config: DemonstrationConfig
    settings: CertifySettings
    others: Others

    def __call__(self, index: int) -> Record:
        start = time.process_time()
        record = self._attempt(index)
        return replace(record, cpu=time.process_time() - start)

    def lost_record(self, index: int, reason: str) -> Record:
        """The record of an attempt that has crashed its process, or has reached a limit."""
        return Record(index, FAILED, PROCESS, reason, 1, {}, None, 0.0)

    def draw(self, index: int) -> Draw:
        """The scenario of an attempt.

        Raises:
            Infeasible: its index has none.
        """
        config = self.config
        design = self.task.design(config.sampler)
        return self.task.draw(config.split, config.seed, index // config.runs, design)

    def _attempt(self, index: int) -> Record:
        try:
            draw = self.draw(index)
        except Infeasible as error:
            return infeasible(index, FAILED, error)

        def record(verdict: str, check: str, reason: str, row: DemonstrationRow | None = None) -> Record:
            return Record(index, verdict, check, reason, draw.attempt + 1, dict(draw.rejected), row, 0.0)

        if reason := self.others.too_near(self.task, draw):
            return record(FAILED, APART, reason)
        trial = Trial(draw.scenario, self.task.horizon, self.settings, self.task.embodiment, None)
        if check := first_failed(trial):
            return record(FAILED, check.name, check.reason)
        number = index % self.config.runs
        key = (self.task.name, draw.scenario.id, number)
        style = chosen(self.config.styles, *key)
        planner = in_style(draw.scenario.oracle, style, *key)
        played = run(draw.scenario, trial.world, planner, self.task.horizon, self.config.settle)
        made = row_of(self.task, draw, trial.text, number, style, played)
        if played.solved:
            return record(KEPT, "", "", made)
        return record(FAILED, "solved", f"{played.outcome}: {played.reason}", made if self.config.keep else None)


def first_failed(trial: Trial) -> Check | None:
    """The first of the cheap checks that a scenario does not pass; None if it passes all of them."""
    return next((check for check in map(trial.check, CHEAP_CHECKS) if not check.passed), None)


def row_of(task: Task, draw: Draw, text: str, number: int, style: str, played: Rollout) -> DemonstrationRow:
    """An attempt as a row."""
    return DemonstrationRow(
        **labels_of_task(task, draw.split, draw.seed),
        **labels_of_draw(draw),
        scene_xml=text,
        scene_sha256=sha256(text),
        witness=played.actions,
        witness_sha256=sha256(played.actions.tobytes()),
        run=number,
        style=style,
        outcome=played.outcome,
        reason=played.reason,
        seconds=played.seconds,
        final_state=played.digest,
    )


def generate_demonstrations(
    task: Task, certify_settings: CertifySettings, settings: DemosSettings, progress: Progress
) -> DemosSummary:
    """Make the demonstrations that the settings describe, continuing an earlier run of the same settings.

    Args:
        task: the task of the scenarios.
        certify_settings: settings of the checks before the oracle plays.
        progress: called for every finished attempt.

    Raises:
        ScengenError: the folder cannot be written, or belongs to another run.
    """
    settings.check(task)
    split = Split.parse(settings.split)
    folder = settings.folder(task)
    pools = [Pool.open(each).check() for each in collection.folders(settings.apart or [])]
    pools = [pool for pool in pools if pool.task == task.name]
    config = DemonstrationConfig(
        task={"name": task.name, **task.node},
        split=str(split),
        sampler=settings.sampler,
        seed=settings.seed,
        runs=settings.runs,
        styles=tuple(settings.styles),
        keep=(FAILED,) if settings.keep else (),
        settle=certify_settings.settle,
        apart=tuple(sorted(pool.sha256 for pool in pools)),
    )
    job = Job(task, config, certify_settings, Others.of(pools))
    identity = {"config": asdict(config), "checks": asdict(certify_settings), **made_with(task)}
    if settings.fresh:
        start_over(folder, DEMONSTRATIONS, "to")
    journal = Journal(folder, identity, DEMONSTRATIONS, DemonstrationRow, "to")
    try:
        records = journal.records()
        limit = settings.limit or max(100, 20 * settings.n)
        if size := task.design(settings.sampler).size:
            limit = min(limit, size * settings.runs)
        limits = Limits(settings.limit_seconds, settings.limit_mb)
        extend(job, Wanted(KEPT, settings.n, limit, settings.workers, limits), records, journal, progress)
        with reported_write_errors(folder):
            checks = own_checks(task, certify_settings)
            return finish(folder, task, config, settings.n, records, journal, checks=checks)
    finally:
        journal.close()


def own_checks(task: Task, settings: CertifySettings) -> dict[str, Any] | None:
    """Settings of the checks before the oracle plays; None if they are the usual ones of the task."""
    own, usual = asdict(settings), asdict(certify_levels(task)["quick"])
    found = {name: own[name] for name in ("overlap", "rest")}
    return found if any(usual[name] != value for name, value in found.items()) else None


def finish(
    folder: Path,
    task: Task,
    config: DemonstrationConfig,
    n: int,
    records: Mapping[int, Record],
    journal: Journal,
    checks: Mapping[str, Any] | None = None,
    **driver: Any,
) -> DemosSummary:
    """Write the first n demonstrations, and count the attempts up to the last of them.

    Args:
        checks: settings of the checks before the oracle plays, if they differ from the usual ones.
        driver: entries of the manifest about who drove the robot: an operator, or a policy and a condition.
    """
    kept = first_of(records, KEPT, n)
    counted = [records[i] for i in sorted(records) if len(kept) < n or i <= kept[-1]]
    lost = [r.index for r in counted if r.check == "solved" and r.reason != GIVEN_UP]
    failed = lost if config.keep else []
    reasons = Counter(rejection(r) for r in counted if r.check)
    manifest = DemonstrationManifest(
        config=config,
        n=n,
        indices=counted[-1].index + 1 if counted else 0,
        funnel=funnel(Counter(r.check for r in counted if r.check), len(kept)),
        reasons=dict(reasons),
        outcomes=outcomes(reasons, len(kept)),
        styles=dict(Counter(row.style for row in journal.rows(kept))),
        checks=checks,
        **driver,
        **made_with(task),
    )
    written = write_demonstrations(folder, manifest, journal.rows(kept), journal.rows(failed))
    return DemosSummary(written, len(kept), written.manifest, math.fsum(r.cpu for r in counted))


def outcomes(reasons: Mapping[str, int], kept: int) -> dict[str, int]:
    """Number of rollouts by outcome.

    Args:
        reasons: number of failed attempts by "check: reason".
        kept: number of demonstrations.
    """
    found = Counter({"success": kept} if kept else {})
    for key, times in reasons.items():
        if key.startswith("solved: "):
            found[key.split(": ")[1]] += times
    return dict(found)


def funnel(lost: Mapping[str, int], kept: int) -> dict[str, int]:
    """Number of attempts, and of those that got through each step.

    Args:
        lost: number of failed attempts by the check that failed.
        kept: number of demonstrations.
    """
    at = Counter({name: lost.get(name, 0) for name in STEPS})
    at["compiles"] += lost.get(PROCESS, 0)
    left = [kept + sum(at[name] for name in STEPS[place:]) for place in range(len(STEPS) + 1)]
    return dict(zip(("attempted", *STEPS), left, strict=True))

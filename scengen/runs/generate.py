"""A generation run: draw, certify in parallel, remember everything, write the pool."""

import math
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from ..attack import campaign as attacks
from ..attack.check import attacked
from ..certificate import CHECKS, STAGES, StoredCertificate
from ..errors import BadConfig, Infeasible
from ..pool import Pool, PoolRow, writing
from ..pool.files import replace_file, sha256
from ..pool.kinds import marks
from ..pool.manifest import MANIFEST, PROCESS, Manifest, RunConfig
from ..samplers.split import ID, Split
from ..samplers.task import Draw, Task
from ..validate import lock
from ..validate.certify import Certified, certify
from ..validate.labels import labels_of_draw, labels_of_task, made_with
from ..validate.settings import CertifySettings
from ..work.limits import at_least, check_count
from ..work.parallel import Limits, Workers
from .attempts import Progress, Wanted, extend, first_of, infeasible, rejection, reported_write_errors
from .filling import Filling, moved_shards
from .journal import Journal, Record, start_over


@dataclass(frozen=True)
class GenerateSettings:
    """Settings of `scengen generate`; conf/command/generate.yaml explains them."""

    split: str = ID
    perturb: str = "none"
    sampler: str = "iid"
    n: int = 20
    seed: int = 0
    workers: Workers = 1
    pool: str | None = None
    ycb: str | None = None
    keep: list[str] = field(default_factory=list)
    limit: int | None = None
    limit_seconds: float = 600.0
    limit_mb: int = 4000
    attack: int = 0
    fresh: bool = False
    json: str | None = None

    def folder(self, task: Task) -> Path:
        """Folder of the pool."""
        return Path(self.pool or Path("generated", f"{task.name}-{Split.parse(self.split)}"))

    def check(self, task: Task) -> None:
        """Raise `ScengenError` for a setting that makes no sense for this task, or would shorten a finished pool."""
        at_least(self, n=1, seed=0, workers=1, limit=1, limit_seconds=1, limit_mb=200, attack=0)
        if self.attack:
            attacks.check_budget("attack", self.attack, self.n)
        check_count(self.n, self.limit, *task.different(self.split, self.sampler), "scenarios")
        for verdict in self.keep:
            if verdict not in ("refuted", "unknown"):
                raise BadConfig(f"keep = {verdict}; it must be refuted, unknown, or both")
        folder = self.folder(task)
        if not self.fresh and MANIFEST in marks(folder) and (there := len(Pool.open(folder))) > self.n:
            told = f"n = {self.n}; {folder} has {there} scenarios, of which {self.n} would be left"
            raise BadConfig(f"{told}: give n={there} or more, another pool=, or fresh=true to move it aside")


@dataclass(frozen=True)
class Summary:
    """Result of a run."""

    pool: Pool
    certified: int
    indices: int
    funnel: Mapping[str, int]
    reasons: Mapping[str, int]
    """Number of rejections by "check: reason"."""
    first_draws: int
    """Number of indices whose first draw was certified."""
    attack: attacks.AttackReport | None
    """Report of the adversary, if an attack was requested."""
    cpu: float
    """Processor time of all counted indices, in this run or earlier ones [s]."""

    def plain(self) -> dict[str, Any]:
        """The summary as plain data."""
        counts = {name: getattr(self, name) for name in ("certified", "indices", "first_draws", "funnel", "reasons")}
        attack = self.attack and self.attack.plain()
        return {"pool": str(self.pool.folder), "sha256": self.pool.sha256, **counts, "cpu": self.cpu, "attack": attack}


@dataclass(frozen=True)
class Job:
    """Settings that all indices of a run share. Calling it with an index draws and certifies that scenario."""

    task: Task
    split: Split
    sampler: str
    seed: int
    certify_settings: CertifySettings
    keep: tuple[str, ...]
    """Verdicts besides `certified` whose scenarios are kept."""

    def __call__(self, index: int) -> Record:
        start = time.process_time()
        draw = self._draw(index)
        if isinstance(draw, Record):
            return replace(draw, cpu=time.process_time() - start)
        task = self.task
        certified = certify(draw.scenario, task.horizon, self.certify_settings, task.embodiment, adversary=attacked)
        certificate = certified.certificate
        failed = certificate.failed
        return Record(
            index,
            certificate.verdict,
            failed.name if failed else "",
            failed.reason if failed else "",
            draw.attempt + 1,
            dict(draw.rejected),
            row_of(self.task, draw, certified) if certificate.verdict in ("certified", *self.keep) else None,
            time.process_time() - start,
        )

    def lost_record(self, index: int, reason: str) -> Record:
        """The record of an index whose scenario has crashed its process, or has reached a limit."""
        draw = self._draw(index)
        if isinstance(draw, Record):
            return draw
        return Record(index, "unknown", PROCESS, reason, draw.attempt + 1, dict(draw.rejected), None, 0.0)

    def _draw(self, index: int) -> Draw | Record:
        """The scenario of an index, or the record of an index that has none."""
        try:
            return self.task.draw(self.split, self.seed, index, self.task.design(self.sampler))
        except Infeasible as error:
            return infeasible(index, "refuted", error)


def generate(task: Task, certify_settings: CertifySettings, settings: GenerateSettings, progress: Progress) -> Summary:
    """Make the pool that the settings describe, continuing an earlier run of the same settings.

    Args:
        task: the task of the scenarios.
        certify_settings: settings of the certificates.
        progress: called for every finished index.

    Raises:
        ScengenError: the pool cannot be written, or belongs to another run.
    """
    settings.check(task)
    split = Split.parse(settings.split)
    folder = settings.folder(task)
    if settings.fresh:
        start_over(folder)
    job = Job(task, split, settings.sampler, settings.seed, certify_settings, tuple(settings.keep))
    config = _config(job)
    journal = Journal(folder, {"config": asdict(config), **made_with(task)})
    try:
        locked = lock.lock_of_run(journal.folder, task.family, made_with(task))
        records = journal.records()
        _extend(job, settings, records, journal, progress)
        attacked = first_of(records, "certified", settings.n) if settings.attack else []
        if len(attacked) == settings.n:  # what a longer run has certified is not attacked, and takes no other's place
            records = {index: record for index, record in records.items() if index <= attacked[-1]}
        report = _attack(job, settings, records, journal, progress) if attacked else None
        with reported_write_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            replace_file(folder / lock.LOCK_FILE, locked.encode())
            return _finish(folder, task, config, settings, records, journal, report)
    finally:
        journal.close()


def row_of(task: Task, draw: Draw, certified: Certified) -> PoolRow:
    """One scenario as a row of a pool."""
    scene, witness = sha256(certified.scene_xml), sha256(certified.witness.tobytes())
    certificate = StoredCertificate(
        **{name: getattr(certified.certificate, name) for name in ("verdict", "reason", "settings", "checks")},
        scene_sha256=scene,
        witness_sha256=witness,
        final_state=certified.digest,
        **made_with(task),
    )
    return PoolRow(
        **labels_of_task(task, draw.split, draw.seed),
        **labels_of_draw(draw),
        scene_xml=certified.scene_xml,
        scene_sha256=scene,
        witness=certified.witness,
        witness_sha256=witness,
        certificate=certificate,
    )


def funnel(records: list[Record]) -> dict[str, int]:
    """Number of draws that got through each step."""
    order = ["", *reversed(CHECKS)]  # "" is a scenario that passed all checks
    counts = {"proposed": sum(r.proposals for r in records)}
    for stage, checks in STAGES.items():
        last = order.index(checks[-1])
        counts[stage] = sum(order.index(_COUNTED_AS.get(r.check, r.check)) < last for r in records)
    return counts


_WITHOUT_ROW = ("feasible", PROCESS, "attack")
"""Checks whose rejections leave no certificate."""
_COUNTED_AS = {PROCESS: "compiles"}
"""Check that counts as failed if a scenario has ended its process: it was feasible, and got through no other step."""


def _config(job: Job) -> RunConfig:
    return RunConfig(
        task={"name": job.task.name, **job.task.node},
        certify=asdict(job.certify_settings),
        split=str(job.split),
        sampler=job.sampler,
        seed=job.seed,
        keep=job.keep,
    )


def _extend(
    job: Job, settings: GenerateSettings, records: dict[int, Record], journal: Journal, progress: Progress
) -> None:
    """Add records in the order of indices until n are certified or the limit is reached."""
    limit = settings.limit or max(100, 20 * settings.n)
    different, _ = job.task.different(job.split, job.sampler)
    limit = min(limit, different or limit)
    # an attack decides last which scenarios are in a pool
    filling = Filling(journal, 0 if settings.attack else settings.n)
    limits = Limits(settings.limit_seconds, settings.limit_mb)
    wanted = Wanted("certified", settings.n, limit, settings.workers, limits)
    extend(job, wanted, records, journal, progress, filling.follow)


def _attack(
    job: Job, settings: GenerateSettings, records: dict[int, Record], journal: Journal, progress: Progress
) -> attacks.AttackReport:
    """Attack the scenarios that go into the pool. Those that have a way around are left out."""
    indices = first_of(records, "certified", settings.n)
    subjects = attacks.certified(job.task, journal.rows(indices))
    wanted = attacks.AttackSettings(
        split=settings.split,
        budget=settings.attack,
        seed=settings.seed,
        workers=settings.workers,
        limit_seconds=settings.limit_seconds,
        limit_mb=settings.limit_mb,
    )
    key = sha256(" ".join([str(settings.attack), *(one.scenario.id for one in subjects)]))

    def attacked_so_far(done: int, hits: int) -> None:
        progress(len(indices), len(records), {f"attacked, {hits} hits": done}, {})

    report = attacks.attack(job.task, subjects, wanted, journal.folder / f"attack-{key[:12]}", attacked_so_far)
    around = {hit.scenario: hit for hit in reversed(report.refuting)}
    for index, one in zip(indices, subjects, strict=True):
        if hit := around.get(one.scenario.id):
            reason = f"a way around, {hit}"
            records[index] = replace(records[index], verdict="refuted", check="attack", reason=reason)
    return report


def _finish(
    folder: Path,
    task: Task,
    config: RunConfig,
    settings: GenerateSettings,
    records: Mapping[int, Record],
    journal: Journal,
    report: attacks.AttackReport | None,
) -> Summary:
    """Write the first n certified scenarios, and count the indices up to the last of them."""
    certified = first_of(records, "certified", settings.n)
    enough = len(certified) == settings.n
    counted = [records[i] for i in sorted(records) if not enough or i <= certified[-1]]
    kept = [r.index for r in counted if r.verdict in settings.keep and r.check not in _WITHOUT_ROW]
    reasons = Counter(rejection(r) for r in counted if r.check not in ("", "feasible"))
    for record in counted:
        reasons.update({f"feasible: {why}": times for why, times in record.infeasible.items()})
    counts = funnel(counted)
    first = sum(r.verdict == "certified" and r.proposals == 1 for r in counted)
    manifest = Manifest(
        config=config,
        n=settings.n,
        indices=len(counted),
        first_draws=first,
        funnel=counts,
        reasons=dict(reasons),
        **made_with(task),
        shards=(),
        attack=None if report is None else attacks.store_in_pool(report, folder),
    )
    ready = moved_shards(journal, certified, folder)
    rest = journal.rows(certified[len(ready) * writing.SHARD_ROWS :])
    written = writing.write_pool(folder, manifest, rest, journal.rows(kept), ready)
    cpu = math.fsum(r.cpu for r in counted)
    return Summary(written, len(certified), len(counted), counts, dict(reasons), first, report, cpu)

"""A generation run: draw, certify in parallel, remember everything, write the pool."""

import itertools
import json
import math
import re
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from .. import pool
from ..errors import BadConfig, Infeasible, at_least
from ..parallel import each
from ..params import canonical
from ..samplers.designs import Design
from ..samplers.task import ID, Draw, Task, load
from ..validate.certify import CHECKS, Certified, certify
from ..validate.identity import fingerprint, source_sha256, versions
from ..validate.settings import CertifySettings
from .journal import Journal, Record

STAGES: dict[str, tuple[str, ...]] = {
    "feasible": ("feasible",),
    "compiled": ("compiles", "overlap"),
    "rested": ("rest",),
    "not trivial": ("unsolved", "idle", "shortcuts"),
    "solved": ("solved",),
    "robust": ("robust", "numerics", "necessity"),
    "certified": ("witness",),
}
"""Steps of the funnel, and the checks that a scenario must pass to get through each."""


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen generate`; meanings stand in conf/command/generate.yaml."""

    split: str = ID
    sampler: str = "iid"
    n: int = 10
    seed: int = 0
    workers: int = 1
    pool: str | None = None
    keep: list[str] = field(default_factory=list)
    limit: int | None = None

    def check(self, task: Task) -> None:
        """Raise `ScengenError` for a setting that makes no sense for this task."""
        task.shifts(self.split)
        task.design(self.sampler)
        at_least(self, n=1, seed=0, workers=1, limit=1)
        for verdict in self.keep:
            if verdict not in ("refuted", "unknown"):
                raise BadConfig(f"keep = {verdict}; it must be refuted, unknown, or both")


@dataclass(frozen=True)
class Summary:
    """What a run came to."""

    pool: pool.Pool
    certified: int
    indices: int
    funnel: Mapping[str, int]
    reasons: Mapping[str, int]
    """Rejections by "check: reason"."""
    first_draws: int
    """Indices whose very first draw was certified."""
    cpu: float
    """Processor time of all indices that count, this run or earlier ones [s]."""


Progress = Callable[[int, int, Mapping[str, int]], None]
"""Called with the certified count, the number of finished indices, and the verdicts so far."""


def generate(task: Task, node: Mapping[str, Any], level: CertifySettings, settings: Settings, progress: Progress) -> Summary:
    """Make the pool that the settings describe, continuing an earlier run of the same settings.

    Args:
        task: what to generate.
        node: the resolved configuration; the part that determines the scenarios goes into the manifest.
        level: settings of the certificate.
        progress: told about every finished index.

    Raises:
        ScengenError: the pool cannot be written, or belongs to another run.
    """
    settings.check(task)
    folder = Path(settings.pool or Path("generated", f"{task.name}-{settings.split}"))
    drawn = {k: v for k, v in asdict(settings).items() if k in ("split", "sampler", "seed", "keep")}
    config = {"task": {"name": task.name, **node["task"]}, "certify": node["certify"], **drawn}
    identity = {"config": config, **_made_with(task)}
    journal = Journal(folder, identity)
    try:
        records = journal.records()
        _extend(task, node["task"], level, settings, records, journal, progress)
        return _finish(folder, identity, settings, records, journal)
    finally:
        journal.close()


def attempt(
    task: Task, split: str, design: Design, seed: int, index: int, level: CertifySettings, keep: tuple[str, ...]
) -> Record:
    """Draw and certify one index."""
    start = time.process_time()
    try:
        draw = task.draw(split, seed, index, design)
    except Infeasible as error:
        why = max(error.reasons, key=error.reasons.__getitem__)
        return Record(
            index, "refuted", "feasible", why, error.tries, dict(error.reasons), None, time.process_time() - start
        )
    certified = certify(draw.scenario, task.horizon, level, task.embodiment)
    certificate = certified.certificate
    failed = certificate.failed
    row = row_of(task, draw, certified) if certificate.verdict in ("certified", *keep) else None
    return Record(
        index,
        certificate.verdict,
        failed.name if failed else "",
        failed.reason if failed else "",
        draw.attempt + 1,
        dict(draw.rejected),
        row,
        time.process_time() - start,
    )


def row_of(task: Task, draw: Draw, certified: Certified) -> pool.Row:
    """One scenario as a row of a pool."""
    certificate = certified.certificate
    scene, actions = pool.sha256(certified.scene_xml), pool.sha256(certified.witness.tobytes())
    made_with = _made_with(task)
    return {
        "id": draw.scenario.id,
        "task": task.name,
        "code": task.code,
        "category": task.category,
        "split": draw.split,
        "axes": [] if draw.split == ID else draw.split.split("+"),
        "shifted": json.dumps(draw.shifted, sort_keys=True),
        "seed": draw.seed,
        "index": draw.index,
        "attempt": draw.attempt,
        "id_twin": draw.id_twin,
        "instruction": task.instruction,
        "horizon": task.horizon,
        "params": canonical(draw.scenario),
        "embodiment": task.embodiment,
        "scene_xml": certified.scene_xml,
        "scene_sha256": scene,
        "witness": certified.witness,
        "witness_sha256": actions,
        "certificate": {
            "verdict": certificate.verdict,
            "reason": certificate.reason,
            "level": certificate.level,
            "checks": [
                {
                    "name": c.name,
                    "passed": c.passed,
                    "reason": c.reason,
                    "settings": json.dumps(c.settings, sort_keys=True),
                    "numbers": json.dumps(c.numbers, sort_keys=True),
                }
                for c in certificate.checks
            ],
            "scene_sha256": scene,
            "witness_sha256": actions,
            "final_state": certified.digest,
            "fingerprint": made_with["fingerprint"],
            "source_sha256": made_with["source_sha256"],
            "versions": json.dumps(made_with["versions"], sort_keys=True),
        },
    }


def funnel(records: list[Record]) -> dict[str, int]:
    """How many draws got through each step."""
    order = ["", *reversed(CHECKS)]  # "" is a scenario that passed everything
    counts = {"proposed": sum(r.proposals for r in records)}
    for stage, checks in STAGES.items():
        last = order.index(checks[-1])
        counts[stage] = sum(order.index(r.check) < last for r in records)
    return counts


def _made_with(task: Task) -> dict[str, Any]:
    return {"versions": versions(), "fingerprint": fingerprint(), "source_sha256": source_sha256(task.family)}


def _extend(
    task: Task,
    node: Mapping[str, Any],
    level: CertifySettings,
    settings: Settings,
    records: dict[int, Record],
    journal: Journal,
    progress: Progress,
) -> None:
    """Add records in the order of indices until n are certified or the limit is reached."""
    limit = settings.limit or max(100, 20 * settings.n)
    if size := task.design(settings.sampler).size:
        limit = min(limit, size)
    missing = (i for i in range(limit) if i not in records)
    job = (task.name, dict(node), level, settings.split, settings.sampler, settings.seed, tuple(settings.keep))

    verdicts = Counter(r.verdict for r in records.values())

    def needed(index: int) -> bool:
        """Whether index can still be among the first n certified ones."""
        if verdicts["certified"] < settings.n:
            return True
        return sum(r.verdict == "certified" for i, r in records.items() if i < index) < settings.n

    def done(record: Record) -> None:
        journal.add(record)
        records[record.index] = replace(record, row=None)
        verdicts[record.verdict] += 1
        progress(verdicts["certified"], len(records), verdicts)

    for record in each(_work, itertools.takewhile(needed, missing), settings.workers, _begin, job):
        done(record)


_JOB: dict[str, Any] = {}
"""What this process works on, set by `_begin`: sent once per worker instead of once per index."""


def _begin(
    name: str, node: dict[str, Any], level: CertifySettings, split: str, sampler: str, seed: int, keep: tuple[str, ...]
) -> None:
    task = load(name, node)
    _JOB.update(task=task, level=level, split=split, design=task.design(sampler), seed=seed, keep=keep)


def _work(index: int) -> Record:
    return attempt(_JOB["task"], _JOB["split"], _JOB["design"], _JOB["seed"], index, _JOB["level"], _JOB["keep"])


def _finish(
    folder: Path, identity: Mapping[str, Any], settings: Settings, records: Mapping[int, Record], journal: Journal
) -> Summary:
    """Write the first n certified indices, and count up to the last of them."""
    certified = [i for i in sorted(records) if records[i].verdict == "certified"][: settings.n]
    enough = len(certified) == settings.n
    counted = [records[i] for i in sorted(records) if not enough or i <= certified[-1]]
    kept = [r.index for r in counted if r.verdict in settings.keep and r.check != "feasible"]
    reasons = Counter(f"{r.check}: {_NUMBER.sub('#', r.reason)}" for r in counted if r.check not in ("", "feasible"))
    for record in counted:
        reasons.update({f"feasible: {why}": times for why, times in record.infeasible.items()})
    counts = funnel(counted)
    first = sum(r.verdict == "certified" and r.proposals == 1 for r in counted)
    manifest = {
        **identity,
        "n": settings.n,
        "funnel": counts,
        "reasons": dict(reasons),
        "indices": len(counted),
        "first_draws": first,
    }
    written = pool.write(folder, manifest, journal.rows(certified), list(journal.rows(kept)))
    cpu = math.fsum(r.cpu for r in counted)
    return Summary(written, len(certified), len(counted), counts, dict(reasons), first, cpu)


_NUMBER = re.compile(r"\d+(\.\d+)?")
"""Numbers in a reason; without them, rejections of the same kind have the same reason and can be counted."""

"""Verification: replay the witnesses of a pool. Needs the pool, MuJoCo and the controller; no oracle, no sampler."""

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ..certificate import as_json
from ..errors import PoolError, ScengenError
from ..parallel import each
from ..params import canonical, with_values
from ..pool import Pool, PoolRow, sha256
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim.world import World
from .identity import fingerprint, source_sha256
from .rollout import replay


@dataclass(frozen=True)
class Examination:
    """What verification found about one scenario."""

    id: str
    reasons: tuple[str, ...]
    """What does not hold; empty if all is well."""
    expired: bool
    """The family's code has changed since the certificate was made."""
    drifted: bool
    """The replay reaches the goal, but ends in other bits than on the machine of the certificate."""


@dataclass(frozen=True)
class Report:
    """What verification found about a pool."""

    checked: int
    failed: list[dict[str, str]]
    """`id` and `reason` of everything that does not hold; a damaged file stands under its own name."""
    expired: int
    drifted: int

    @property
    def holds(self) -> bool:
        return not self.failed


def verify(
    pool: Pool, find_task: Callable[[str], Task], workers: int, strict: bool, progress: Callable[[int], None]
) -> Report:
    """Check every file, hash, identity and witness of a pool.

    Args:
        find_task: gives the task of a name; a pool names its tasks and never code.
        strict: whether an expired certificate fails.
        progress: told how many scenarios have been checked.
    """
    failed = [{"id": name, "reason": f"the shard {what}"} for name, what in pool.damaged().items()]
    family = functools.cache(lambda name: _family(find_task, name))
    jobs = ((row, family(row.task)) for row in _readable(pool, failed))
    count = expired = drifted = 0
    ids: set[str] = set()
    for count, found in enumerate(each(examine, jobs, workers), 1):
        reasons = list(found.reasons)
        if found.id in ids:
            reasons.append("the id occurs twice")
        ids.add(found.id)
        if found.expired and strict:
            reasons.append("expired: code that it depends on has changed since; certify the pool again")
        if reasons:
            failed.append({"id": found.id, "reason": "; ".join(reasons)})
        expired, drifted = expired + found.expired, drifted + found.drifted
        progress(count)
    if count != len(pool) and not failed:
        failed.append({"id": "manifest.json", "reason": f"promises {len(pool)} scenarios, the shards hold {count}"})
    return Report(count, failed, expired, drifted)


def examine(job: tuple[PoolRow, type[Scenario] | str]) -> Examination:
    """Check one scenario, given with the class of its family or the reason why there is none."""
    row, family = job
    if isinstance(family, str):
        return Examination(row.id, (family,), False, False)
    expired = row.certificate.source_sha256 != source_sha256(family)
    try:
        scenario = with_values(family(), row.params)
        reasons, drifted = _wrong_names(row, scenario), False
        if not reasons:
            reasons, drifted = _replayed(row, scenario)
    except (ScengenError, ValueError, TypeError) as error:
        return Examination(row.id, (" ".join(str(error).split()),), expired, False)
    return Examination(row.id, tuple(reasons), expired, drifted)


def _wrong_names(row: PoolRow, scenario: Scenario) -> list[str]:
    certificate = row.certificate
    scene, witness = sha256(row.scene_xml), sha256(row.witness.tobytes())
    facts = {
        "the id does not belong to the parameters": row.id == scenario.id,
        "the parameters are not all there, or not as the family writes them": as_json(row.params)
        == canonical(scenario),
        "the scene has another sha256 than its row or certificate": {scene}
        == {row.scene_sha256, certificate.scene_sha256},
        "the witness has another sha256 than its row or certificate": {witness}
        == {row.witness_sha256, certificate.witness_sha256},
        "the certificate is not complete": certificate.complete,
    }
    return [what for what, holds in facts.items() if not holds]


def _replayed(row: PoolRow, scenario: Scenario) -> tuple[list[str], bool]:
    """Why the witness no longer holds, and whether it ends in other bits on a machine that rounds otherwise."""
    settle = row.certificate.settle
    if settle is None:
        return ["the certificate does not say how long the goal must hold"], False
    rollout = replay(scenario, World.load(row.scene_xml, row.embodiment), row.witness, row.horizon, settle)
    if not rollout.solved:
        return [f"the witness fails: {rollout.reason}"], False
    same = rollout.digest == row.certificate.final_state
    if not same and row.certificate.fingerprint == fingerprint():
        return ["the witness ends in another state, although this machine rounds as the certificate's did"], False
    return [], not same


def _readable(pool: Pool, failed: list[dict[str, str]]) -> Iterator[PoolRow]:
    """All rows up to the first that cannot be read; that one is reported."""
    try:
        yield from pool.rows()
    except PoolError as error:
        failed.append({"id": "shards", "reason": str(error)})


def _family(find_task: Callable[[str], Task], name: str) -> type[Scenario] | str:
    try:
        return find_task(name).family
    except ScengenError as error:
        return str(error)

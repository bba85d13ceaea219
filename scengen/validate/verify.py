"""Verification: replay the witnesses of a pool. Needs the pool, MuJoCo and the controller; no oracle, no sampler."""

import functools
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ..errors import PoolError, ScengenError
from ..parallel import each
from ..params import canonical, with_values
from ..pool import Pool, Row, sha256
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim.world import World
from .identity import fingerprint, source_sha256
from .rollout import replay


@dataclass(frozen=True)
class Finding:
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
    jobs = ((row, family(row["task"])) for row in _readable(pool, failed))
    count = expired = drifted = 0
    ids: set[str] = set()
    for count, finding in enumerate(each(examine, jobs, workers), 1):
        reasons = list(finding.reasons)
        if finding.id in ids:
            reasons.append("the id occurs twice")
        ids.add(finding.id)
        if finding.expired and strict:
            reasons.append("expired: the code of its family has changed since; certify the pool again")
        if reasons:
            failed.append({"id": finding.id, "reason": "; ".join(reasons)})
        expired, drifted = expired + finding.expired, drifted + finding.drifted
        progress(count)
    if count != len(pool) and not failed:
        failed.append({"id": "manifest.json", "reason": f"promises {len(pool)} scenarios, the shards hold {count}"})
    return Report(count, failed, expired, drifted)


def examine(job: tuple[Row, type[Scenario] | str]) -> Finding:
    """Check one scenario, given with the class of its family or the reason why there is none."""
    row, family = job
    if isinstance(family, str):
        return Finding(row["id"], (family,), False, False)
    certificate = row["certificate"]
    expired = certificate["source_sha256"] != source_sha256(family)
    reasons: list[str] = []
    try:
        scenario = with_values(family(), json.loads(row["params"]))
        reasons += _wrong_names(row, scenario)
        drifted = False
        if not reasons:
            failure, drifted = _replayed(row, scenario)
            reasons += failure
    except (ScengenError, ValueError, KeyError, TypeError) as error:
        return Finding(row["id"], (" ".join(str(error).split()),), expired, False)
    return Finding(row["id"], tuple(reasons), expired, drifted)


def _wrong_names(row: Row, scenario: Scenario) -> list[str]:
    certificate = row["certificate"]
    scene, actions = sha256(row["scene_xml"]), sha256(row["witness"].tobytes())
    passed = [c["passed"] for c in certificate["checks"]]
    facts = {
        "the id does not belong to the parameters": row["id"] == scenario.id,
        "the parameters are not written canonically": row["params"] == canonical(scenario),
        "the scene has another sha256 than its row or certificate": {scene}
        == {row["scene_sha256"], certificate["scene_sha256"]},
        "the witness has another sha256 than its row or certificate": {actions}
        == {row["witness_sha256"], certificate["witness_sha256"]},
        "the certificate is not complete": certificate["verdict"] == "certified" and bool(passed) and all(passed),
    }
    return [what for what, holds in facts.items() if not holds]


def _replayed(row: Row, scenario: Scenario) -> tuple[list[str], bool]:
    """Why the witness no longer holds, and whether it ends in other bits on a machine that rounds otherwise."""
    settle = settling_time(row)
    if settle is None:
        return ["the certificate does not say how long the goal must hold"], False
    episode = replay(scenario, World.load(row["scene_xml"], row["embodiment"]), row["witness"], row["horizon"], settle)
    if not episode.solved:
        return [f"the witness fails: {episode.reason}"], False
    same = episode.digest == row["certificate"]["final_state"]
    if not same and row["certificate"]["fingerprint"] == fingerprint():
        return ["the witness ends in another state, although this machine rounds as the certificate's did"], False
    return [], not same


def settling_time(row: Row) -> float | None:
    """How long the goal had to hold when the witness was certified [s], or None if the certificate does not say."""
    witness = (json.loads(c["settings"]) for c in row["certificate"]["checks"] if c["name"] == "witness")
    settle = next(witness, {}).get("settle")
    return settle if isinstance(settle, (int, float)) else None


def _readable(pool: Pool, failed: list[dict[str, str]]) -> Iterator[Row]:
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

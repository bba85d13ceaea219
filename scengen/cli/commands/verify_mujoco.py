"""compare a pool under several versions of MuJoCo: same bits, same verdict, flipped"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...drift.environment import Environment, environment, versions_of
from ...drift.matrix import FLIPPED, UNKNOWN, flipped, matrix, remarks, tables, under
from ...drift.tracks import parted
from ...errors import BadConfig, ScengenError
from ...pool import Pool
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ...validate.verify.recheck import LEVELS
from ...work.limits import at_least
from ...work.targets import try_file
from . import DECLINED, FAILED, OK, Arguments, err, out, remark, say, several, write_json
from .settings import read

MODULE = "scengen.drift.judge"
"""Module that judges the pools in each environment."""
TRACKS = "scengen.drift.tracks"
"""Module that follows the witnesses whose verdict flipped."""


@dataclass(frozen=True)
class DriftSettings:
    """Settings of `scengen verify mujoco`; conf/command/verify_mujoco.yaml explains them."""

    pool: str | list[str]
    mujoco: str | list[str]
    level: str
    n: int | None
    json: str | None
    workers: int
    limit_seconds: float
    limit_mb: int


def command(arguments: Arguments) -> int:
    settings = read("verify mujoco", arguments, DriftSettings)
    if settings.level not in LEVELS:
        raise BadConfig(f"level = {settings.level}; it must be {', '.join(LEVELS[:-1])} or {LEVELS[-1]}")
    at_least(settings, n=1, workers=1, limit_seconds=1, limit_mb=200)
    try_file(settings.json)
    versions = versions_of(settings.mujoco)
    pools = [Pool.open(folder).check() for folder in several(settings.pool)]
    environments = [environment(version, say) for version in versions]
    found = {each.mujoco: _judged(each, pools, settings, search_path(arguments)) for each in environments}
    result = matrix(pools, found, settings.level, settings.n)
    _add_partings(result, environments, search_path(arguments))
    if settings.json:
        write_json(settings.json, result)
    for table in tables(result):
        out.print(table)
    for line in remarks(result):
        remark(line)
    totals = {version: under(result, version) for version in versions}
    for version, counts in totals.items():
        say(f"mujoco {version}: {', '.join(f'{counts[name]} {name}' for name in counts if name != 'checks')}")
    if any(counts[FLIPPED] for counts in totals.values()):
        return FAILED
    return DECLINED if any(counts[UNKNOWN] for counts in totals.values()) else OK


def _judged(
    where: Environment, pools: Sequence[Pool], settings: DriftSettings, search: Sequence[str]
) -> dict[str, Any]:
    """Results of the checks of some pools in an environment: its `fingerprint`, and what was `judged`, by folder.

    Raises:
        ScengenError: the checks do not run there, or run with another version.
    """
    folders = [str(pool.folder) for pool in pools]
    requested = {name: getattr(settings, name) for name in ("level", "n", "workers", "limit_seconds", "limit_mb")}
    answers = where.lines(MODULE, {"pools": folders, "search": list(search), **requested})
    about = next(answers)
    if about["mujoco"] != where.mujoco:
        raise ScengenError(
            f"the environment of mujoco {where.mujoco} imports {about['mujoco']}; remove {where.folder}, and check "
            "PYTHONPATH"
        )
    judged: dict[str, list[dict[str, Any]]] = {folder: [] for folder in folders}
    count = sum(len(pool) if settings.n is None else min(settings.n, len(pool)) for pool in pools)
    with ProgressBar(err, f"mujoco {where.mujoco}", count) as progress_bar:
        for done, answer in enumerate(answers, 1):
            judged[answer.pop("pool")].append(answer)
            progress_bar.show(done)
    return {"fingerprint": about["fingerprint"], "judged": judged}


def _add_partings(result: dict[str, Any], environments: Sequence[Environment], search: Sequence[str]) -> None:
    """Add how each witness that no longer succeeds parts from its course under the version that made the pool.

    A version whose control is not among the environments keeps its flips without that explanation.
    """
    made = {folder: pool["versions"]["mujoco"] for folder, pool in result["pools"].items()}
    lost = [
        (one, version, judgement)
        for one in result["scenarios"]
        for version, judgement in one["mujoco"].items()
        if "witness" in flipped(judgement) and version != made[one["pool"]]
    ]
    wanted: dict[str, dict[str, list[str]]] = {each.mujoco: {} for each in environments}
    for one, version, _ in lost:
        for where in {version, made[one["pool"]]} & wanted.keys():
            wanted[where].setdefault(one["pool"], []).append(one["id"])
    followed = {
        (each.mujoco, line["pool"], line["id"]): line["track"]
        for each in environments
        if wanted[each.mujoco]
        for line in each.lines(TRACKS, {"pools": wanted[each.mujoco], "search": list(search)})
    }
    for one, version, judgement in lost:
        before, now = (followed.get((where, one["pool"], one["id"])) for where in (made[one["pool"]], version))
        if before and now:
            judgement["parted"] = parted(before, now)

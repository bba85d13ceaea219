"""The drift matrix: for every version of MuJoCo, task and check how much of a pool's verdicts is left."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

from rich.table import Table

from ..pool import Pool
from ..samplers.task import leaves

SAME_BITS, SAME_VERDICT, FLIPPED, UNKNOWN = "same bits", "same verdict", "flipped", "unknown"
OUTCOMES = (SAME_BITS, SAME_VERDICT, FLIPPED, UNKNOWN)
"""Of one scenario under one version. Same bits: every check that is made again says what the certificate says, and the
witness ends in the same bits. Same verdict: so do the checks, but the bits are others. Flipped: a check says otherwise.
Unknown: nothing can be said, which stands against nothing."""


def outcome(judgement: Mapping[str, Any]) -> str:
    """One of `OUTCOMES`.

    Args:
        judgement: a `judge.Judgement` as plain data.
    """
    if judgement["unknown"]:
        return UNKNOWN
    if flipped(judgement):
        return FLIPPED
    return SAME_BITS if judgement["same_bits"] else SAME_VERDICT


def flipped(judgement: Mapping[str, Any]) -> list[str]:
    """The checks that do not say what the certificate says, in the order in which they were made."""
    return [check["name"] for check in judgement["checks"] if check["flipped"]]


def matrix(pools: Sequence[Pool], found: Mapping[str, Mapping[str, Any]], level: str, n: int | None) -> dict[str, Any]:
    """The result of a comparison as plain data: what `json=` writes.

    Args:
        pools: what was judged, in the order of the result.
        found: by version `fingerprint`, and `judged`: by folder the judgements.
        level: how much was simulated, see `validate.recheck.LEVELS`.
        n: how many scenarios of each pool; None for all.
    """
    scenarios = []
    for pool in pools:
        certified = {row.id: _certified(row.certificate, row.horizon) for row in islice(pool.rows(witness=False), n)}
        judged = {
            mujoco: {one["id"]: one for one in told["judged"][str(pool.folder)]} for mujoco, told in found.items()
        }
        for name in islice(pool.names(), n):
            by = {mujoco: _entry(told[name.id]) for mujoco, told in judged.items()}
            about = {"pool": str(pool.folder), "task": pool.task, "id": name.id, "name": str(name)}
            scenarios.append({**about, "certificate": certified[name.id], "mujoco": by})
    return {
        "level": level,
        "mujoco": {version: {"fingerprint": told["fingerprint"]} for version, told in found.items()},
        "pools": {
            str(pool.folder): {
                "sha256": pool.sha256,
                "task": pool.task,
                "split": pool.split,
                "versions": dict(pool.manifest.versions),
                "fingerprint": pool.manifest.fingerprint,
            }
            for pool in pools
        },
        "tasks": _by_task(scenarios, list(found)),
        "scenarios": scenarios,
    }


def _entry(judgement: Mapping[str, Any]) -> dict[str, Any]:
    """A judgement with its outcome, without what the scenario's own entry says."""
    return {"outcome": outcome(judgement), **{k: v for k, v in judgement.items() if k not in ("id", "name")}}


def _certified(certificate: Any, horizon: float) -> dict[str, Any]:
    """By how much a certificate held: what stands beside a check that has flipped."""
    numbers = {check.name: dict(check.numbers) for check in certificate.checks}
    robust = {name: numbers["robust"].get(name) for name in ("solved", "runs")}
    seconds = numbers["witness"].get("seconds")
    return {"robust": robust, "numerics": numbers["numerics"], "seconds": seconds, "horizon": horizon}


def _by_task(scenarios: Sequence[Mapping[str, Any]], versions: Sequence[str]) -> dict[str, Any]:
    """Numbers of scenarios by task, version and outcome, and how often each check has flipped."""
    found: dict[str, Any] = {}
    for one in scenarios:
        row = found.setdefault(
            one["task"], {version: {**dict.fromkeys(OUTCOMES, 0), "checks": Counter()} for version in versions}
        )
        for version, judgement in one["mujoco"].items():
            row[version][judgement["outcome"]] += 1
            row[version]["checks"].update(flipped(judgement))
    return {task: found[task] for task in sorted(found)}


def total(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What stands for several tasks under one version."""
    checks = sum((Counter(row["checks"]) for row in rows), Counter[str]())
    return {**{name: sum(row[name] for row in rows) for name in OUTCOMES}, "checks": checks}


def under(result: Mapping[str, Any], version: str) -> dict[str, Any]:
    """What stands for all tasks of a result under one version."""
    return total([row[version] for row in result["tasks"].values()])


def cell(told: Mapping[str, Any]) -> str:
    """One entry of the matrix: `9 / 1 / 0` scenarios of the first three outcomes, the checks that flipped, the unknown.

    Args:
        told: of a task, or `total`.
    """
    checks = ", ".join(f"{name} {times}" for name, times in told["checks"].items())
    numbers = " / ".join(str(told[name]) for name in OUTCOMES[:3])
    return numbers + (f" ({checks})" if checks else "") + (f", {told[UNKNOWN]} unknown" if told[UNKNOWN] else "")


def flips(result: Mapping[str, Any]) -> Iterator[tuple[str, str, str, str, str]]:
    """Every check that has flipped, with its margins.

    Yields:
        Version, scenario, check; the check's numbers in the certificate and now; by how much the certificate held.
    """
    for one in result["scenarios"]:
        for version, judgement in one["mujoco"].items():
            for check in judgement["checks"]:
                if check["flipped"]:
                    yield version, one["name"], check["name"], margin(check), spared(one["certificate"])


def margin(check: Mapping[str, Any]) -> str:
    """What a check measured in the certificate and measures now, with its bars, and why it says otherwise.

    Args:
        check: a `judge.RepeatedCheck` as plain data.
    """
    before, now = dict(leaves(check["stored"])), dict(leaves(check["numbers"]))
    names = [name for name in now if name in before and before[name] != now[name] and _number(now[name])]
    moved = [f"{name} {_short(before[name])} -> {_short(now[name])}" for name in names]
    bars = [f"bar {name} {_short(bar)}" for name, bar in check["settings"].items() if name in now or len(now) == 1]
    return "; ".join([check["reason"] or "passes", *moved, *bars])


def spared(certificate: Mapping[str, Any]) -> str:
    """By how much a certificate held, in words."""
    robust, numerics = certificate["robust"], certificate["numerics"]
    told = [f"{robust['solved']} of {robust['runs']} jittered runs", _time(certificate)]
    fell = [name.replace("_", " ") for name, kept in numerics.items() if kept.get("witness") != "success"]
    return ", ".join([*told, *(f"witness flips at {name}" for name in fell)])


def _time(certificate: Mapping[str, Any]) -> str:
    return f"goal after {certificate['seconds']:.3g} of {certificate['horizon']:g} s"


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def remarks(result: Mapping[str, Any]) -> Iterator[str]:
    """What has to be known to read the matrix: which version is the control, and what it shows."""
    made: dict[str, set[str]] = {}
    for pool in result["pools"].values():
        made.setdefault(pool["versions"]["mujoco"], set()).add(pool["fingerprint"])
    for version, fingerprints in sorted(made.items()):
        if version not in result["mujoco"]:
            yield f"made with mujoco {version}, which is not among the versions: name it too, as the control"
        elif fingerprints != {result["mujoco"][version]["fingerprint"]}:
            yield f"made with mujoco {version} on a machine that rounds otherwise: bits differ for that reason too"
    scenes = Counter(version for one in result["scenarios"] for version, told in one["mujoco"].items() if told["scene"])
    for version, times in scenes.items():
        yield f"under mujoco {version} {times} scenes are built otherwise, by more than rounding"


def tables(result: Mapping[str, Any]) -> list[Table]:
    """The matrix, and the checks that have flipped with their margins, if there are any."""
    told = f"{' / '.join(OUTCOMES[:3])} under each MuJoCo, level {result['level']}"
    found = Table("task", *result["mujoco"], title=told, title_justify="left")
    for task, row in result["tasks"].items():
        found.add_row(task, *(cell(row[version]) for version in result["mujoco"]))
    if len(result["tasks"]) > 1:
        found.add_section()
        found.add_row("all", *(cell(under(result, version)) for version in result["mujoco"]))
    margins = Table("mujoco", "scenario", "check", "now", "the certificate", title="flipped", title_justify="left")
    for line in flips(result):
        margins.add_row(*line)
    return [found, margins] if margins.row_count else [found]

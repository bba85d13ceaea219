"""The drift matrix: the change of a pool's verdicts, by version of MuJoCo, task and check."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

from rich.table import Table

from ..pool import Pool
from ..samplers.task import leaves
from .tracks import in_words

SAME_BITS = "same bits"
"""Outcome: every repeated check agrees with the certificate, and the witness ends in the same bits."""
SAME_VERDICT = "same verdict"
"""Outcome: every repeated check agrees with the certificate, but the witness ends in other bits."""
FLIPPED = "flipped"
"""Outcome: a check contradicts the certificate."""
UNKNOWN = "unknown"
"""Outcome: no result, which is not counted against the version."""
OUTCOMES = (SAME_BITS, SAME_VERDICT, FLIPPED, UNKNOWN)
"""Outcomes of one scenario under one version."""


def outcome(judgement: Mapping[str, Any]) -> str:
    """The outcome of a judgement, one of `OUTCOMES`.

    Args:
        judgement: a `judge.Judgement` as plain data.
    """
    if judgement["unknown"]:
        return UNKNOWN
    if flipped(judgement):
        return FLIPPED
    return SAME_BITS if judgement["same_bits"] else SAME_VERDICT


def flipped(judgement: Mapping[str, Any]) -> list[str]:
    """The checks that contradict the certificate, in the order in which they were made."""
    return [check["name"] for check in judgement["checks"] if check["flipped"]]


def matrix(pools: Sequence[Pool], found: Mapping[str, Mapping[str, Any]], level: str, n: int | None) -> dict[str, Any]:
    """The result of a comparison as plain data, as `json=` writes it.

    Args:
        pools: judged pools, in the order of the result.
        found: by version, the `fingerprint` and the judgements (`judged`) by folder.
        level: level of the checks, see `validate.recheck.LEVELS`.
        n: number of scenarios of each pool; None for all.
    """
    scenarios = []
    for pool in pools:
        certified = {row.id: _certified(row.certificate, row.horizon) for row in islice(pool.rows(witness=False), n)}
        judged = {
            mujoco: {one["id"]: one for one in outcome["judged"][str(pool.folder)]} for mujoco, outcome in found.items()
        }
        for name in islice(pool.names(), n):
            by = {mujoco: _entry(outcome[name.id]) for mujoco, outcome in judged.items()}
            about = {"pool": str(pool.folder), "task": pool.task, "id": name.id, "name": str(name)}
            scenarios.append({**about, "certificate": certified[name.id], "mujoco": by})
    return {
        "level": level,
        "mujoco": {version: {"fingerprint": outcome["fingerprint"]} for version, outcome in found.items()},
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
    """A judgement with its outcome, without id and name, which the scenario's own entry states."""
    return {"outcome": outcome(judgement), **{k: v for k, v in judgement.items() if k not in ("id", "name")}}


def _certified(certificate: Any, horizon: float) -> dict[str, Any]:
    """The margins of a certificate, which are reported with a flipped check."""
    numbers = {check.name: dict(check.numbers) for check in certificate.checks}
    robust = {name: numbers["robust"].get(name) for name in ("solved", "runs")}
    seconds = numbers["witness"].get("seconds")
    return {"robust": robust, "numerics": numbers["numerics"], "seconds": seconds, "horizon": horizon}


def _by_task(scenarios: Sequence[Mapping[str, Any]], versions: Sequence[str]) -> dict[str, Any]:
    """Numbers of scenarios by task, version and outcome, and numbers of flips by check."""
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
    """The sum of several tasks under one version."""
    checks = sum((Counter(row["checks"]) for row in rows), Counter[str]())
    return {**{name: sum(row[name] for row in rows) for name in OUTCOMES}, "checks": checks}


def under(result: Mapping[str, Any], version: str) -> dict[str, Any]:
    """The sum of all tasks of a result under one version."""
    return total([row[version] for row in result["tasks"].values()])


def cell(counts: Mapping[str, Any]) -> str:
    """One entry of the matrix: numbers of scenarios by outcome (`9 / 1 / 0`), flipped checks, unknown scenarios.

    Args:
        counts: counts of a task, or `total`.
    """
    checks = ", ".join(f"{name} {times}" for name, times in counts["checks"].items())
    numbers = " / ".join(str(counts[name]) for name in OUTCOMES[:3])
    return numbers + (f" ({checks})" if checks else "") + (f", {counts[UNKNOWN]} unknown" if counts[UNKNOWN] else "")


def flips(result: Mapping[str, Any]) -> Iterator[tuple[str, str, str, str, str, str]]:
    """Every flipped check, with its cause and margins.

    Yields:
        Version, scenario, check; the check's numbers in the certificate and now; where the witness parts from its
        course; the margins of the certificate.
    """
    for one in result["scenarios"]:
        for version, judgement in one["mujoco"].items():
            for check in judgement["checks"]:
                if check["flipped"]:
                    cause = (
                        in_words(judgement["parted"]) if "parted" in judgement and check["name"] == "witness" else ""
                    )
                    yield version, one["name"], check["name"], change(check), cause, margins(one["certificate"])


def change(check: Mapping[str, Any]) -> str:
    """The numbers of a check in the certificate and now, with its bars, and the reason why it flipped.

    Args:
        check: a `judge.RepeatedCheck`, as plain data.
    """
    before, now = dict(leaves(check["stored"])), dict(leaves(check["numbers"]))
    names = [name for name in now if name in before and before[name] != now[name] and _number(now[name])]
    moved = [f"{name} {_short(before[name])} -> {_short(now[name])}" for name in names]
    bars = [f"bar {name} {_short(bar)}" for name, bar in check["settings"].items() if name in now or len(now) == 1]
    return "; ".join([check["reason"] or "passes", *moved, *bars])


def margins(certificate: Mapping[str, Any]) -> str:
    """The margins of a certificate, as text."""
    robust, numerics = certificate["robust"], certificate["numerics"]
    parts = [f"{robust['solved']} of {robust['runs']} jittered runs", _time(certificate)]
    fell = [name.replace("_", " ") for name, kept in numerics.items() if kept.get("witness") != "success"]
    return ", ".join([*parts, *(f"witness flips at {name}" for name in fell)])


def _time(certificate: Mapping[str, Any]) -> str:
    return f"goal after {certificate['seconds']:.3g} of {certificate['horizon']:g} s"


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def remarks(result: Mapping[str, Any]) -> Iterator[str]:
    """Notes to the matrix: the version that is the control, and differences that are not due to MuJoCo."""
    made: dict[str, set[str]] = {}
    for pool in result["pools"].values():
        made.setdefault(pool["versions"]["mujoco"], set()).add(pool["fingerprint"])
    for version, fingerprints in sorted(made.items()):
        if version not in result["mujoco"]:
            yield f"made with mujoco {version}, which is not among the versions: add it, as the control"
        elif fingerprints != {result["mujoco"][version]["fingerprint"]}:
            yield f"made with mujoco {version} on a machine that rounds differently: bits differ for that reason too"
    scenes = Counter(
        version for one in result["scenarios"] for version, outcome in one["mujoco"].items() if outcome["scene"]
    )
    for version, times in scenes.items():
        yield f"under mujoco {version} {times} scenes are built differently, by more than rounding"


def tables(result: Mapping[str, Any]) -> list[Table]:
    """The matrix, and the flipped checks with their margins, if there are any."""
    message = f"{' / '.join(OUTCOMES[:3])} under each MuJoCo, level {result['level']}"
    found = Table("task", *result["mujoco"], title=message, title_justify="left")
    for task, row in result["tasks"].items():
        found.add_row(task, *(cell(row[version]) for version in result["mujoco"]))
    if len(result["tasks"]) > 1:
        found.add_section()
        found.add_row("all", *(cell(under(result, version)) for version in result["mujoco"]))
    flipped_checks = Table(
        "mujoco", "scenario", "check", "now", "how it parts", "the certificate", title="flipped", title_justify="left"
    )
    for line in flips(result):
        flipped_checks.add_row(*line)
    return [found, flipped_checks] if flipped_checks.row_count else [found]

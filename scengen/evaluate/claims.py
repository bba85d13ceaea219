"""Claims of the lines of an evaluation that are checked without a simulation: form, order, completeness, pools."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from ..errors import BadConfig, ScengenError, cut
from ..perturb.perturbation import Perturbation
from ..pool.files import sha256
from .arms import CLEAN, check_arms
from .lines import CHAIN, EpisodeLine, Lines, chained, run_sha256
from .player import policy_seed
from .rollouts import id_of, order, told_of
from .scenarios import Scenarios
from .settings import RolloutId

Fault = tuple[int | None, str]
"""Number of the line, None for the file as a whole, and what is wrong."""


def malformed(lines: Sequence[Any]) -> Iterator[Fault]:
    """Lines that do not have the fields of the schema."""
    for number, line in enumerate(lines):
        try:
            if not isinstance(line, Mapping):
                raise BadConfig("it is not a mapping")
            EpisodeLine.of(line)
        except ScengenError as error:
            yield number, f"is not a line of this format: {cut(str(error), 200)}"


def broken(identity: Mapping[str, Any], lines: Lines, end: Any) -> Iterator[Fault]:
    """Lines whose number or hash is not that of their place.

    Args:
        identity: settings of the run.
        end: hash at the end of the file, as the table says.
    """
    before = run_sha256(identity)
    for number, line in enumerate(lines):
        if line["episode"] != number:
            yield number, f"has the number {line['episode']}: lines were left out, repeated or moved"
        if line[CHAIN] != chained(before, line):
            yield number, "does not follow from the line before: one of them was edited, moved, repeated or left out"
        before = line[CHAIN]
    for number, (one, other) in enumerate(pairwise(map(order, lines)), 1):
        if other < one:
            yield number, "is not in the order of the file: lines were moved"
    if before != end:
        yield None, "the last line is not the one that the table was made from"


def incomplete(lines: Lines, wanted: set[RolloutId], seeds: int | None = None) -> Iterator[Fault]:
    """Rollouts that are missing or repeated.

    Args:
        seeds: number of scenarios of each pool, as the table says.
    """
    counts = Counter(map(id_of, lines))
    for number, line in enumerate(lines):
        if counts[id_of(line)] > 1:
            yield number, f"is one of {counts[id_of(line)]} lines about the same rollout"
    played, missing = {(which.pool, which.scenario) for which in counts}, wanted - set(counts)
    if seeds is not None and (unplayed := {(which.pool, which.scenario) for which in missing} - played):
        for pool, scenario in sorted(unplayed):
            there = sum(folder == pool for folder, _ in played)
            yield None, f"{scenario} of {pool} has no line: the table says seeds = {seeds}, the lines have {there}"
        missing = {which for which in missing if (which.pool, which.scenario) in played}
    for which in sorted(missing):
        changed = f" under {which.condition}" if which.condition else ""
        yield None, f"rollout {which.rollout} of {which.scenario}{changed} is missing"


def untrue(line: Mapping[str, Any], about: Scenarios, run: Mapping[str, Any], policy: str) -> Iterator[str]:
    """Claims of a line that contradict the pool, the run, or what follows from them.

    Args:
        about: what lines say of the scenarios of the pools.
        run: the settings of the run.
    """
    key = line["pool"], line["scenario"]
    if key not in about:
        yield f"names the scenario {cut(line['scenario'], 40)!r}, which {cut(line['pool'], 200)} does not hold"
        return
    which = id_of(line)
    expected = {
        **told_of(which, about[key]),
        "policy": policy,
        "policy_seed": policy_seed(which.scenario, which.rollout),
    }
    expected["task_version"] = run["task_versions"].get(line["task"])
    if not line["crashed"]:
        expected["instruction_sha256"] = sha256(line["instruction"])
    for name, there in expected.items():
        if line[name] != there:
            yield f"says {name} = {cut(repr(line[name]), 60)}, which must be {cut(repr(there), 60)}"
    if line["success"] and (line["reason"] or line["crashed"]):
        yield "is a success with a reason for a failure"
    if not 0 <= line["seconds"]:
        yield f"says seconds = {line['seconds']}"
    yield from _unlike_condition(line, run["perturb_seed"])


def _unlike_condition(line: Mapping[str, Any], seed: int) -> Iterator[str]:
    """What of the condition is not as it must be."""
    try:
        perturbation = Perturbation.parse(line["perturbation"])
        if line["arm"] != CLEAN:
            check_arms([line["arm"]])
    except ScengenError as error:
        yield f"has a condition that does not exist: {error}"
        return
    if str(perturbation) != line["perturbation"]:
        yield f"says perturbation = {line['perturbation']!r}, which is written {perturbation}"
    drawn = perturbation.of(line["scenario"], seed).plain()
    if line["perturb"] != drawn and not (line["crashed"] and not line["perturb"]):
        yield "has other values than the perturbation draws for this scenario"

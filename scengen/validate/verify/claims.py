"""Claims of a row and its certificate, compared with what follows from the manifest, without simulation."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...certificate import CHECKS, Check, as_json, from_json
from ...control.loop import ACTION, Loop
from ...control.teleop import ALPHA, LARGEST_CHANGE, MOTION
from ...errors import Infeasible, ScengenError, contrasted
from ...installation import versions
from ...params import canonical
from ...pool import Pool, PoolRow
from ...pool.files import sha256
from ...pool.manifest import Manifest
from ...pool.untrusted import WORD
from ...samplers.designs import Design
from ...samplers.split import Split
from ...samplers.task import Draw, Task
from ...scenario import Scenario
from ..certify import ACTIONS, NO_ATTACK, NOT_TRIED, no_ablations
from ..labels import labels_of_draw, labels_of_task
from ..rebuilt import MAX_ABSOLUTE_DIFFERENCE, MAX_RELATIVE_DIFFERENCE, rebuild
from ..rollout import AT_REST
from ..settings import CertifySettings, lower_bound

NUMERICS = ("half_time_step", "twice_the_iterations")
"""Variations of the check `numerics`."""
ROUNDING = 1e-6
"""Largest excess of an action over the filter's range, from single precision."""


class OfCode(str):
    """Difference that rests on the code of the task, or on MuJoCo. It is a fault only if the pool was certified on the
    installed versions of both; otherwise the author's claim is about other code, and cannot be decided here."""


def of_another_version(manifest: Manifest, task: Task) -> str:
    """The versions of the task and of MuJoCo as text, if a pool was certified for others; empty if it was not."""
    told = task.other_version("certified against", manifest.task_version), of_another_mujoco(manifest)
    return "; ".join(filter(None, told))


def of_another_mujoco(manifest: Manifest) -> str:
    """The versions of MuJoCo as text, if a pool was certified with another one; empty if it was not."""
    made, here = manifest.versions["mujoco"], versions()["mujoco"]
    return "" if made == here else f"certified with mujoco {made}, this is {here}"


@dataclass(frozen=True)
class Claims:
    """Claims of a pool about all its rows."""

    task: Task
    """The task as the manifest describes it, with the installed family."""
    split: Split
    settings: CertifySettings
    """Settings of the certificates."""
    manifest: Manifest
    """The manifest without its files."""

    @classmethod
    def of(cls, pool: Pool, task: Task, settings: CertifySettings) -> "Claims":
        """The claims of a pool.

        Raises:
            ScengenError: there is no such split, or no such sampler.
        """
        claims = cls(task, Split.parse(pool.split), settings, pool.manifest.without_files())
        task.shifts(claims.split)
        _ = claims.design
        return claims

    @property
    def of_another_version(self) -> str:
        """The versions as text, see the function of this name."""
        return of_another_version(self.manifest, self.task)

    @cached_property
    def design(self) -> Design:
        """Design that the numbers came from."""
        return self.task.design(self.manifest.config.sampler)

    def draw(self, index: int) -> Draw:
        """The draw of an index.

        Raises:
            Infeasible: no try gives a feasible scenario.
        """
        return self.task.draw(self.split, self.manifest.config.seed, index, self.design)


def wrong_labels(row: PoolRow, claims: Claims) -> Iterator[str]:
    """Columns of a row that differ from what its manifest says."""
    certificate, manifest = row.certificate, claims.manifest
    told = {name: (getattr(row, name), value) for name, value in _labels(claims).items()}
    told["settings"] = (certificate.settings, claims.settings.name)
    for name in ("versions", "task_version", "source_sha256", "fingerprint"):
        told[name] = (getattr(certificate, name), getattr(manifest, name))
    for name, (here, there) in told.items():
        if here != there:
            told, said = contrasted(ascii(here), ascii(there))
            yield f"the {name} is {told}, the manifest says {said}"
    if row.index >= manifest.indices:
        yield f"the index {row.index} is none of the {manifest.indices} that the manifest counts"


def _labels(claims: Claims) -> dict[str, Any]:
    return labels_of_task(claims.task, claims.split, claims.manifest.config.seed)


def wrong_names(row: PoolRow, scenario: Scenario) -> Iterator[str]:
    """Id and parameters of a row that do not belong to each other."""
    if row.id != scenario.id:
        yield OfCode("the id does not belong to the parameters")
    if as_json(row.params) != canonical(scenario):
        yield OfCode("the parameters are incomplete, or not as the family writes them")


def wrong_hashes(row: PoolRow) -> Iterator[str]:
    """Hashes of a row that do not belong to its scene and witness."""
    certificate = row.certificate
    scene, witness = sha256(row.scene_xml), sha256(row.witness.tobytes())
    if {scene} != {row.scene_sha256, certificate.scene_sha256}:
        yield "the scene has a different sha256 than its row or certificate says"
    if {witness} != {row.witness_sha256, certificate.witness_sha256}:
        yield "the witness has a different sha256 than its row or certificate says"


def wrongly_drawn(row: PoolRow, claims: Claims) -> Iterator[str]:
    """Columns of a row that differ from those of the draw that its index gives."""
    if row.index >= claims.manifest.indices:
        return
    try:
        draw = claims.draw(row.index)
    except Infeasible:
        yield OfCode(f"drawn again, index {row.index} gives no feasible scenario")
        return
    if row.id != draw.scenario.id:
        told = f"the parameters are not those that are drawn for index {row.index}, which gives {draw.scenario.id}"
        yield OfCode(told)
        return
    for name, there in labels_of_draw(draw).items():
        here = getattr(row, name)
        if name != "params" and comparable(here) != comparable(there):  # the id covers params
            told, drawn = contrasted(ascii(comparable(here)), ascii(comparable(there)))
            yield OfCode(f"the {name} is {told}; drawn again it is {drawn}")


def comparable(value: Any) -> Any:
    """A value of a column in a form whose equality says that a pool stores the same."""
    return as_json(value) if isinstance(value, Mapping) else value


# --- the certificate ----------------------------------------------------------------------------------


def wrong_certificate(row: PoolRow, scenario: Scenario, claims: Claims) -> Iterator[str]:
    """Gaps in the certificate of a certified row, and contradictions with its settings or itself."""
    certificate, checks = row.certificate, row.certificate.checks
    if certificate.verdict != "certified" or certificate.reason:
        yield f"the certificate is not complete: its verdict is {_short(certificate.verdict)} {certificate.reason[:80]}"
    if [check.name for check in checks] != list(CHECKS):
        yield f"the certificate is not complete: its checks are not {', '.join(CHECKS)}, once each in this order"
        return
    nothing = _nothing_to_check(scenario, claims.settings)
    for check in checks:
        if check.name in nothing and (check.passed is not None or check.reason != nothing[check.name]):
            yield OfCode(f"check {check.name} has nothing to check here, but does not say so")
        elif check.name not in nothing and not check.passed:
            told = f"the certificate is not complete: {check.name} has not passed"
            yield OfCode(told) if check.waived else told
        elif check.name not in nothing and check.reason:
            yield f"check {check.name} has passed, but gives a reason against it: {check.reason[:80]}"
    yield from _other_settings(checks, claims)
    yield from _contradictions({check.name: check for check in checks}, row, scenario, claims)


def _nothing_to_check(scenario: Scenario, settings: CertifySettings) -> dict[str, str]:
    """Reasons of the checks that are not made, by name, as a certificate gives them."""
    found = {} if settings.attack else {"attack": NO_ATTACK}
    return found if scenario.ablations() else {**found, "ablations": no_ablations(scenario)}


def wrong_rejection(row: PoolRow, scenario: Scenario, claims: Claims) -> Iterator[str]:
    """Contradictions in the certificate of a scenario that was kept although it was not certified."""
    certificate, checks = row.certificate, row.certificate.checks
    if [check.name for check in checks] != list(CHECKS):
        yield f"the checks of this reject are not {', '.join(CHECKS)}, once each in this order"
        return
    nothing = _nothing_to_check(scenario, claims.settings)
    told = (check for check in checks if not check.passed and not check.waived)
    failed = next((check for check in told if check.reason != nothing.get(check.name)), None)
    if failed is None or failed.passed is None:
        yield "this reject has not failed a check"
        return
    place = list(CHECKS).index(failed.name)
    if any(check.passed is not None for check in checks[place + 1 :]):
        yield f"this reject has checks after {failed.name}, which failed"
    if certificate.verdict != CHECKS[failed.name] or certificate.reason != f"{failed.name}: {failed.reason}":
        yield f"the verdict of this reject does not follow from {failed.name}, which failed"
    if certificate.verdict not in claims.manifest.config.keep:
        yield f"this reject is {certificate.verdict}, but keep= does not ask for such scenarios"
    yield from _other_settings(checks[: place + 1], claims)


def compiles(row: PoolRow) -> bool:
    """Whether the scene of a row compiles, by its certificate."""
    return not any(check.name == "compiles" and check.passed is False for check in row.certificate.checks)


def scene_or_nothing(scenario: Scenario) -> str:
    """The text of a scenario's scene; empty if it cannot be built."""
    try:
        return rebuild(scenario)
    except (ScengenError, ValueError):
        return ""


def _other_settings(checks: Sequence[Check], claims: Claims) -> Iterator[str]:
    settings = claims.settings
    expected: dict[str, Mapping[str, Any]] = {
        "overlap": {"overlap": settings.overlap},
        "rest": asdict(settings.rest),
        "idle": {"horizon": claims.task.horizon},
        "solved": {"horizon": claims.task.horizon},
        "robust": asdict(settings.robust),
        "witness": {"settle": settings.settle},
        "attack": {"rollouts": settings.attack} if settings.attack else {},
    }
    for check in checks:
        if as_json(check.settings) != as_json(expected.get(check.name, {})):
            yield f"check {check.name} was made with other settings than the manifest says"


def alike(made: Mapping[str, Any], stored: Any) -> bool:
    """Whether the numbers of a check that was made again equal the stored ones except for the last digits.

    The last digits may differ although the simulation has the same bits: rounding of numpy's linear algebra depends on
    the processor's instruction set, which no fingerprint covers.
    """
    return _equal(from_json(as_json(made)), stored)


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_equal(one[name], other[name]) for name in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_equal, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=MAX_RELATIVE_DIFFERENCE, abs_tol=MAX_ABSOLUTE_DIFFERENCE)
    return type(one) is type(other) and one == other


def _witness_length_fits(numbers: Mapping[str, Any], seconds: float, row: PoolRow, settle: float) -> bool:
    """Whether the witness ends when the goal has lasted: actions after that would not be played."""
    periods = round((seconds + settle) / Loop.PERIOD)
    return numbers == {"periods": len(row.witness), "seconds": seconds} and abs(len(row.witness) - periods) <= 1


def _contradictions(checks: Mapping[str, Check], row: PoolRow, scenario: Scenario, claims: Claims) -> Iterator[str]:
    """Checks that cannot have passed with their numbers."""
    rules = {
        "overlap": lambda n: set(n) == {"deepest"} and 0 <= n["deepest"] <= claims.settings.overlap,
        "rest": lambda n: _rest_holds(n, claims.settings),
        "unsolved": lambda n: n == {},
        "idle": lambda n: _goal_missed(n, True),
        "shortcuts": lambda n: all(_shortcut_failed(one) for told in n.values() for one in told.values()),
        "solved": lambda n: _solved_in_time(n, claims.task.horizon),
        "robust": lambda n: _robust_holds(n, claims.settings),
        "numerics": _numerics_hold,
        "ablations": lambda n: all(_goal_missed(one, True) for one in n.values()),
        "witness": lambda n: _witness_length_fits(n, checks["solved"].numbers["seconds"], row, claims.settings.settle),
        "attack": lambda n: _attack_failed(n, claims.settings),
    }
    of_family = {
        "feasible": lambda n: alike(scenario.features(), n),
        "shortcuts": lambda n: _of_shortcuts(n, scenario),
        "ablations": lambda n: set(n) == set(scenario.ablations()),
    }
    for name, holds in of_family.items():
        if not _holds(holds, checks[name]):
            yield OfCode(f"check {name} cannot have passed with its numbers: they are not those of this family")
    for name, holds in rules.items():
        if not _holds(holds, checks[name]):
            yield f"check {name} cannot have passed with its numbers, or they are not those of this family"
    if not passed_filter(row.witness):
        yield "the witness has actions that the teleoperation filter cannot give"


def _rest_holds(numbers: Mapping[str, Any], settings: CertifySettings) -> bool:
    limits = settings.rest
    within = 0 <= numbers["drift"] <= limits.drift and 0 <= numbers["turn"] <= limits.turn
    return set(numbers) == {"drift", "turn"} and within


def _goal_missed(numbers: Mapping[str, Any], unstable: bool) -> bool:
    """Whether these are the numbers of a complete episode that has not reached the goal."""
    known = ("failure", "timeout", "unstable") if unstable else ("failure", "timeout")
    return set(numbers) == {"outcome", "reason", "seconds"} and numbers["outcome"] in known and numbers["seconds"] >= 0


def _holds(rule: Callable[[Mapping[str, Any]], bool], check: Check) -> bool:
    """Whether a rule holds for the numbers of a check, which may have any form."""
    try:
        return rule(check.numbers)
    except (TypeError, KeyError, AttributeError, ValueError):
        return False


def _of_shortcuts(numbers: Mapping[str, Any], scenario: Scenario) -> bool:
    """Whether these are the numbers of the family's shortcuts, each filtered and raw, and to rest if it has to be."""
    known = scenario.shortcuts()
    tries = [(known[name], n) for name, told in numbers.items() for n in told.values() if set(told) == set(ACTIONS)]
    seen = all(not shortcut.to_rest or n["reason"] == AT_REST for shortcut, n in tries)
    return set(numbers) == set(known) and len(tries) == len(ACTIONS) * len(known) and seen


def _shortcut_failed(numbers: Mapping[str, Any]) -> bool:
    """Whether these are the numbers of a shortcut that has not reached the goal, or of one that was not tried."""
    return _goal_missed({**numbers, "outcome": "timeout"} if numbers["outcome"] == NOT_TRIED else numbers, False)


def _attack_failed(numbers: Mapping[str, Any], settings: CertifySettings) -> bool:
    rollouts = [told["rollouts"] for told in numbers.values()]
    whole = all(type(n) is int and n > 0 for n in rollouts) and sum(rollouts) <= settings.attack
    counted = all(set(n) == {"rollouts", "hits"} and 0 <= n["hits"] <= n["rollouts"] for n in numbers.values())
    named = all(WORD.fullmatch(name) for name in numbers)
    return whole and counted and named and bool(numbers) == bool(settings.attack)


def _solved_in_time(numbers: Mapping[str, Any], horizon: float) -> bool:
    told = set(numbers) == {"outcome", "reason", "seconds"} and numbers["reason"] == ""
    return told and numbers["outcome"] == "success" and 0 <= numbers["seconds"] <= horizon + 0.011


def _robust_holds(numbers: Mapping[str, Any], settings: CertifySettings) -> bool:
    limits, solved, failures = settings.robust, numbers["solved"], numbers["failures"]
    whole = type(solved) is int and 0 <= solved <= limits.runs and numbers["runs"] == limits.runs
    counted = whole and isinstance(failures, list) and len(failures) == limits.runs - solved
    bound = counted and abs(numbers["bound"] - lower_bound(solved, limits.runs)) <= 1e-9 * numbers["bound"]
    return bool(bound) and numbers["bound"] >= limits.bound and len(numbers) == 4


def _numerics_hold(numbers: Mapping[str, Any]) -> bool:
    held = (
        n == {"witness": "success"} or (n["witness"] != "success" and n["oracle"] == "success")
        for n in numbers.values()
    )
    return set(numbers) == set(NUMERICS) and all(held)


def passed_filter(witness: np.ndarray) -> bool:
    """Whether the teleoperation filter can give these actions, starting from rest."""
    if np.abs(witness).max(initial=0.0) > 1.0:
        return False
    motion = witness.reshape(len(witness), witness.shape[1] // ACTION, ACTION)[..., :MOTION].astype(float)
    before = np.concatenate([np.zeros_like(motion[:1]), motion[:-1]])
    lowest = np.maximum(-LARGEST_CHANGE, ALPHA * (-1.0 - before))
    highest = np.minimum(LARGEST_CHANGE, ALPHA * (1.0 - before))
    change = motion - before
    return bool(((change >= lowest - ROUNDING) & (change <= highest + ROUNDING)).all())


def _short(value: Any) -> str:
    text = ascii(value)  # some letters look alike
    return text if len(text) <= 60 else f"{text[:57]}..."

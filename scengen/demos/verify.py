"""Verification of demonstrations of unknown origin: drawn again, scenes built again, replayed bit for bit."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..certificate import as_json
from ..episode import check_rules
from ..errors import Infeasible, PoolError, ScengenError
from ..params import canonical
from ..pool.demonstrations import DEMONSTRATIONS, POLICY, SCRIPTED, TELEOP, DemonstrationConfig, Demonstrations
from ..pool.files import sha256
from ..pool.row import DemonstrationRow
from ..samplers.split import Split
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim.world import World
from ..validate.identity import check_versions
from ..validate.labels import labels_of_draw, labels_of_task
from ..validate.rebuilt import difference, rebuild
from ..validate.rollout import replay, run
from ..validate.verify.claims import OfCode, comparable, passed_filter
from ..validate.verify.examine import Verdict
from ..validate.verify.stored import task_of_manifest
from ..work.fingerprint import fingerprint
from ..work.parallel import Limits, Workers, each
from .styles import check_styles, chosen, in_style


@dataclass(frozen=True)
class Examined:
    """Result for one demonstration or failed attempt."""

    name: str
    faults: tuple[str, ...]
    """Faults; empty if everything holds."""
    declined: str = ""
    """Reason why nothing can be said."""
    exact: bool = False
    """Whether the replay ends in the same bits."""


@dataclass
class DemosReport:
    """Result of the verification of a folder of demonstrations."""

    folder: str
    faults: list[str] = field(default_factory=list)
    """Faults of the folder and of single demonstrations."""
    declined: list[str] = field(default_factory=list)
    """Reasons why something could not be judged."""
    remarks: list[str] = field(default_factory=list)
    checked: int = 0
    """Number of demonstrations and failed attempts that were looked at."""
    exact: int = 0
    """Number of replays that ended in the same bits."""

    @property
    def verdict(self) -> Verdict:
        return "refuted" if self.faults else "declined" if self.declined else "sound"


@dataclass(frozen=True)
class Judge:
    """Examines one row."""

    task: Task
    """The task as the manifest describes it, with the installed family."""
    config: DemonstrationConfig
    attempts: int
    """Number of attempts by the manifest."""
    same_machine: bool
    """Whether the rounding of this machine is that of the author's."""
    oracle: bool
    """Whether the oracle plays again, too."""
    other_version: str = ""
    """Versions as text if the demonstrations were made on another one, see `Task.other_version`."""

    def __call__(self, row: DemonstrationRow) -> Examined:
        try:
            faults = list(self._wrong_claims(row))
            exact = False
            if not faults:
                faults, exact = self._wrong_replay(row)
        except (ScengenError, ValueError, TypeError, KeyError, ArithmeticError, RecursionError) as error:
            faults, exact = [OfCode(" ".join(str(error).split())[:300] or type(error).__name__)], False
        hard = [fault for fault in faults if not (self.other_version and isinstance(fault, OfCode))]
        declined = f"{self.other_version}, where {'; '.join(faults)}" if faults and not hard else ""
        return Examined(_name(row), tuple(hard), declined, exact)

    @cached_property
    def _labels(self) -> dict[str, object]:
        return labels_of_task(self.task, Split.parse(self.config.split), self.config.seed)

    def _wrong_claims(self, row: DemonstrationRow) -> Iterator[str]:
        """Faults that are seen without a simulation."""
        for name, there in self._labels.items():
            if getattr(row, name) != there:
                yield f"the {name} is {ascii(getattr(row, name))[:60]}, the manifest says {ascii(there)[:60]}"
        if row.task != self.task.name:
            return
        scenario = self.task.scenario(row.params)
        if row.id != scenario.id or as_json(row.params) != canonical(scenario):
            yield OfCode("the id does not belong to the parameters")
        if sha256(row.scene_xml) != row.scene_sha256:
            yield "the scene has a different sha256 than its row says"
        if sha256(row.witness.tobytes()) != row.witness_sha256:
            yield "the actions have a different sha256 than their row says"
        if np.abs(row.witness).max(initial=0.0) > 1.0:
            yield "there are actions outside [-1, 1]"
        if POLICY not in self.config.styles and not passed_filter(row.witness):
            yield "there are actions that the teleoperation filter cannot give"
        if row.run >= self.config.runs or row.index * self.config.runs + row.run >= self.attempts:
            yield f"run {row.run} of index {row.index} is none of the {self.attempts} attempts that the manifest counts"
        if row.style != (style := self._style(row)):
            yield f"the style is {row.style}, that of this run is {style}"
        if difference_ := difference(row.scene_xml, rebuild(scenario), self.same_machine, row.embodiment):
            yield OfCode(difference_)
        yield from self._wrongly_drawn(row)

    def _style(self, row: DemonstrationRow) -> str:
        """The style that the manifest demands of a row."""
        driven = {TELEOP, POLICY}.intersection(self.config.styles)
        return driven.pop() if driven else chosen(self.config.styles, *row.key)

    def _wrongly_drawn(self, row: DemonstrationRow) -> Iterator[str]:
        design = self.task.design(self.config.sampler)
        try:
            draw = self.task.draw(self.config.split, self.config.seed, row.index, design)
        except Infeasible:
            yield OfCode(f"drawn again, index {row.index} gives no feasible scenario")
            return
        for name, there in labels_of_draw(draw).items():
            if comparable(getattr(row, name)) != comparable(there):
                yield OfCode(f"the {name} is not that of the scenario that is drawn for index {row.index}")

    def _wrong_replay(self, row: DemonstrationRow) -> tuple[list[str], bool]:
        """Faults of the replay, and whether it ended in the same bits."""
        scenario: Scenario = self.task.scenario(row.params)
        world = World.load(row.scene_xml, row.embodiment)
        rules = check_rules(self.config.rules)
        again = replay(scenario, world, row.witness, self.task.horizon, self.config.settle, rules=rules)
        faults, exact = [], again.digest == row.final_state
        if again.outcome != row.outcome:
            faults.append(f"replayed, the outcome is {again.outcome} ({again.reason}), not {row.outcome}")
        if self.same_machine and not exact:
            faults.append("the replay ends in other bits")
        if self.same_machine and again.seconds != row.seconds:
            faults.append(f"the replay takes {again.seconds:g} s, not {row.seconds:g} s")
        if self.oracle and self.same_machine and not faults:
            planner = in_style(scenario.oracle, row.style, *row.key)
            played = run(scenario, world, planner, self.task.horizon, self.config.settle)
            if played.actions.tobytes() != row.witness.tobytes():
                faults.append("the oracle plays other actions in this style")
        return list(map(OfCode, faults)), exact


def _lost(row: DemonstrationRow, reason: str) -> Examined:
    return Examined(_name(row), (), f"verification {reason}")


def _name(row: DemonstrationRow) -> str:
    return f"{row.name} run {row.run}"


def verify_demonstrations(
    found: Demonstrations,
    installed: Task,
    workers: Workers,
    limits: Limits,
    oracle: bool = False,
    progress: Callable[[int], None] = lambda done: None,
) -> DemosReport:
    """Check every claim of a folder of demonstrations, failed attempts included.

    Args:
        installed: the task of that name on this machine.
        oracle: whether the oracle plays every demonstration again, too.
        progress: called with the number of rows that have been checked.
    """
    report, manifest = DemosReport(str(found.folder)), found.manifest
    report.faults += [f"{name} {what}" for name, what in found.damaged().items()]
    try:
        check_versions(manifest.versions, str(found.folder))
    except PoolError as error:
        report.declined.append(str(error))
    if report.faults or report.declined:
        return report
    try:
        if manifest.source == SCRIPTED:
            check_styles(manifest.config.styles)
        task = task_of_manifest(found, installed)
        task.shifts(manifest.config.split)
    except ScengenError as error:
        other = installed.other_version("made on", manifest.task_version)
        (report.declined if other else report.faults).append(f"{DEMONSTRATIONS}: {error}")
        return report
    if other := task.other_version("made on", manifest.task_version):
        report.remarks.append(f"{other}: what differs between the versions cannot be checked here")
    same = manifest.fingerprint == fingerprint()
    if not same:
        report.remarks.append("made on a machine with different rounding: final states are not compared")
    if oracle and manifest.source != SCRIPTED:
        report.remarks.append(f"source {manifest.source}: there is no oracle to play them again")
    judge = Judge(task, manifest.config, manifest.indices, same, oracle and manifest.source == SCRIPTED, other)
    order = _Order(manifest.config.runs)

    def rows() -> Iterator[DemonstrationRow]:
        for row in found.rows():
            order.add(row)
            yield row
        yield from found.failures()

    try:
        for one in each(judge, rows(), workers, limits, _lost):
            report.checked += 1
            report.exact += one.exact
            report.faults += [f"{one.name}: {fault}" for fault in one.faults]
            if one.declined:
                report.declined.append(f"{one.name}: {one.declined}")
            progress(min(report.checked, len(found)))
    except PoolError as error:
        report.faults.append(str(error))
    report.faults += order.faults(found)
    return report


@dataclass
class _Order:
    """Order and outcomes of the demonstrations, compared with the manifest."""

    runs: int
    last: int = -1
    wrong: list[str] = field(default_factory=list)
    styles: dict[str, int] = field(default_factory=dict)

    def add(self, row: DemonstrationRow) -> None:
        """Note a demonstration that is looked at."""
        number = row.index * self.runs + row.run
        if number <= self.last:
            self.wrong.append(f"{_name(row)} occurs twice, or after a later one")
        if row.outcome != "success":
            self.wrong.append(f"{_name(row)} is a failed attempt among the demonstrations")
        self.last = number
        self.styles[row.style] = self.styles.get(row.style, 0) + 1

    def faults(self, found: Demonstrations) -> list[str]:
        """Faults of the order, and counts that differ from those of the manifest."""
        manifest = found.manifest
        if self.styles != dict(manifest.styles):
            self.wrong.append(f"{DEMONSTRATIONS} counts other styles than there are")
        if manifest.outcomes.get("success", 0) != sum(self.styles.values()):
            self.wrong.append(f"{DEMONSTRATIONS} counts a different number of successes than there are")
        return self.wrong

"""Verification of demonstrations of unknown origin: drawn again, scenes built again, replayed bit for bit."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from ..certificate import as_json
from ..episode import STRICT, check_rules
from ..errors import Infeasible, PoolError, ScengenError, contrasted
from ..params import canonical
from ..pool import Pool
from ..pool.demonstrations import (
    DEMONSTRATIONS,
    POLICY,
    SCRIPTED,
    TELEOP,
    DemonstrationConfig,
    DemonstrationManifest,
    Demonstrations,
)
from ..pool.files import sha256
from ..pool.manifest import PROCESS
from ..pool.row import DemonstrationRow
from ..samplers.split import Split
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim.world import World
from ..validate.identity import check_versions
from ..validate.labels import labels_of_draw, labels_of_task, made_with
from ..validate.rebuilt import difference, rebuild
from ..validate.rollout import replay, run
from ..validate.settings import CertifySettings
from ..validate.verify.claims import OfCode, comparable, passed_filter
from ..validate.verify.examine import Verdict
from ..validate.verify.findings import task_differences, wrong_names
from ..validate.verify.stored import task_of_manifest
from ..work.fingerprint import fingerprint
from ..work.parallel import Limits, Workers, each
from .generate import Job, Others
from .recount import Recount, checks_of, usual_checks
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
    claimed: list[str] = field(default_factory=list)
    """Claims that were not checked: they are the author's word."""
    differences: list[dict[str, str]] = field(default_factory=list)
    """Differences between the manifest's task and the installed one: `key`, `pool` and `installed`."""
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
    """Versions in words if the demonstrations were made on another one, see `Task.other_version`."""
    others: Others = field(default_factory=partial(Others.of, ()))
    """Scenarios of the pools from which these were kept apart."""

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
                told, said = contrasted(ascii(getattr(row, name)), ascii(there))
                yield f"the {name} is {told}, the manifest says {said}"
        if row.task != self.task.name:
            return
        scenario = self.task.scenario(row.params, row.split)
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
        if reason := self.others.too_near(self.task, draw):
            yield f"not kept apart: {reason}"
        for name, there in labels_of_draw(draw).items():
            if comparable(getattr(row, name)) != comparable(there):
                yield OfCode(f"the {name} is not that of the scenario that is drawn for index {row.index}")

    def _wrong_replay(self, row: DemonstrationRow) -> tuple[list[str], bool]:
        """Faults of the replay, and whether it ended in the same bits."""
        scenario: Scenario = self.task.scenario(row.params, row.split)
        world = World.load(row.scene_xml, row.embodiment)
        rules = check_rules(self.config.rules)
        again = replay(scenario, world, row.witness, self.task.horizon, self.config.settle, rules=rules)
        faults, exact = [], again.digest == row.final_state
        if again.outcome != row.outcome:
            faults.append(f"replayed, the outcome is {again.outcome} ({again.reason}), not {row.outcome}")
        if self.same_machine and again.outcome == row.outcome and again.reason != row.reason:
            told, found = contrasted(ascii(row.reason), ascii(again.reason), 200)
            faults.append(f"the reason is {told}, replayed it is {found}")
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
    apart: Sequence[Pool] = (),
) -> DemosReport:
    """Check every claim of a folder of demonstrations, failed attempts included.

    Args:
        installed: the task of that name on this machine.
        oracle: whether the oracle plays every demonstration again, too.
        progress: called with the number of rows that have been checked.
        apart: pools from which the scenarios were kept apart by the manifest, as far as they are here.
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
        settings = checks_of(task, manifest)
    except ScengenError as error:
        other = installed.other_version("made on", manifest.task_version)
        (report.declined if other else report.faults).append(f"{DEMONSTRATIONS}: {error}")
        return report
    _Verification(found, task, settings, apart, report).verify(installed, workers, limits, oracle, progress)
    return report


@dataclass
class _Verification:
    """Verification of a folder whose manifest can be read."""

    found: Demonstrations
    task: Task
    """The task as the manifest describes it."""
    settings: CertifySettings
    """Settings of the checks before the oracle plays."""
    pools: Sequence[Pool]
    """The pools that are here of those from which the scenarios were kept apart."""
    report: DemosReport

    @cached_property
    def other(self) -> str:
        """Versions in words if the demonstrations were made on another one, see `Task.other_version`."""
        return self.task.other_version("made on", self.found.manifest.task_version)

    @cached_property
    def same_machine(self) -> bool:
        """Whether the rounding of this machine is that of the author's."""
        return self.found.manifest.fingerprint == fingerprint()

    @cached_property
    def others(self) -> Others:
        """Scenarios of the pools."""
        return Others.of(self.pools)

    @property
    def unknown(self) -> set[str]:
        """Hashes of the pools that are not here of those from which the scenarios were kept apart."""
        return {*self.found.manifest.config.apart}.difference(pool.sha256 for pool in self.pools)

    def verify(
        self, installed: Task, workers: Workers, limits: Limits, oracle: bool, progress: Callable[[int], None]
    ) -> None:
        """Compare tasks, rows and counts, in this order."""
        self._compare_task(installed, oracle)
        recount = Recount(self.found.manifest)
        if self._rows(recount, workers, limits, oracle, progress):
            self._counts(recount, workers, limits)
        self._claims(recount, oracle)
        if not (self.report.checked or recount.again):
            self.report.declined.append("it holds no rollout, and none could be made again: there is nothing to judge")

    def _compare_task(self, installed: Task, oracle: bool) -> None:
        report, manifest = self.report, self.found.manifest
        report.differences = task_differences(installed, self.task)
        if manifest.config.rules != STRICT:
            told = {"key": "rules", "pool": manifest.config.rules, "installed": STRICT}
            report.differences.append(told)
        if (here := usual_checks(self.task).settle) != (there := manifest.config.settle):
            told = {"key": "settle", "pool": f"{there:g} s", "installed": f"{here:g} s"}
            report.differences.append(told)
        report.remarks += self._other_makers()
        report.faults += wrong_names(installed, self.task)
        if self.other:
            report.remarks.append(f"{self.other}: what differs between the versions cannot be checked here")
        if not self.same_machine:
            report.remarks.append("made on a machine with different rounding: final states are not compared")
        if oracle and manifest.source != SCRIPTED:
            report.remarks.append(f"source {manifest.source}: there is no oracle to play them again")

    def _other_makers(self) -> Iterator[str]:
        """Packages and code by which the demonstrations say that they were made, where they are not those here."""
        manifest, here = self.found.manifest, made_with(self.task)
        for name in sorted({*here["versions"], *manifest.versions}):
            made, installed = manifest.versions.get(name, "nothing"), here["versions"].get(name, "nothing")
            if made != installed:
                yield f"made with {name} {made}, this is {installed}"
        if manifest.source_sha256 != here["source_sha256"]:
            yield "made with different code of the task (source_sha256)"

    def _rows(
        self, recount: Recount, workers: Workers, limits: Limits, oracle: bool, progress: Callable[[int], None]
    ) -> bool:
        """Examine all rows. Returns whether they could be read."""
        report, manifest = self.report, self.found.manifest
        scripted = manifest.source == SCRIPTED
        of = (self.task, manifest.config, manifest.indices, self.same_machine, oracle and scripted)
        judge = Judge(*of, self.other, self.others)

        def rows() -> Iterator[DemonstrationRow]:
            for stored, count in ((self.found.rows(), recount.keep), (self.found.failures(), recount.lose)):
                for row in stored:
                    report.faults += [f"{_name(row)} {what}" for what in count(row)]
                    yield row

        try:
            for one in each(judge, rows(), workers, limits, _lost):
                report.checked += 1
                report.exact += one.exact
                report.faults += [f"{one.name}: {fault}" for fault in one.faults]
                if one.declined:
                    report.declined.append(f"{one.name}: {one.declined}")
                progress(min(report.checked, len(self.found)))
        except PoolError as error:
            report.faults.append(str(error))
            return False
        return True

    def _counts(self, recount: Recount, workers: Workers, limits: Limits) -> None:
        """Compare the counts of the manifest with the rows, and with the attempts without a row, made again."""
        report, manifest = self.report, self.found.manifest
        report.faults += [f"{DEMONSTRATIONS}: {what}" for what in recount.contradictions()]
        if manifest.source != SCRIPTED:
            report.faults += [f"{DEMONSTRATIONS}: {what}" for what in recount.without_row()]
        elif not report.faults:
            job = Job(self.task, manifest.config, self.settings, self.others)
            if why := recount.too_many() or recount.make_again(job, workers, limits):
                report.declined.append(why)
            else:
                self._losses(recount)

    def _losses(self, recount: Recount) -> None:
        """Compare the reasons with those of the attempts that were made again, if they can be compared."""
        wrong = list(recount.losses(not self.unknown))
        if self.other:
            self.report.declined += [f"{self.other}, where {what}" for what in wrong]
        elif self.same_machine:
            self.report.faults += [f"{DEMONSTRATIONS}: {what}" for what in wrong]
        elif wrong:
            self.report.claimed.append(f"why {recount.again.total()} attempts without a row failed, on that machine")

    def _claims(self, recount: Recount, oracle: bool) -> None:
        """Collect what is the author's word."""
        manifest, claimed = self.found.manifest, self.report.claimed
        claimed += recount.claimed
        if self.unknown:
            these = ", ".join(sorted(each[:12] for each in self.unknown))
            claimed.append(f"apart from {len(self.unknown)} pools that are not here ({these}); apart=FOLDER checks it")
        if lost := sum(times for key, times in manifest.reasons.items() if key.partition(": ")[0] == PROCESS):
            claimed.append(f"{lost} attempts were lost to limits or crashes")
        if manifest.checks is not None:
            claimed.append("own settings of the checks before the oracle plays")
        if manifest.source != POLICY and len(recount.kept) < manifest.n:
            claimed.append(f"{manifest.n} demonstrations were requested, and the run ended with {len(recount.kept)}")
        claimed += _author(manifest, oracle)


def _author(manifest: DemonstrationManifest, oracle: bool) -> list[str]:
    """Claims about the driver of the robot."""
    if manifest.source == POLICY:
        under = f" under {manifest.condition!a}, seed {manifest.perturb_seed}" if manifest.condition else ""
        return [f"policy {manifest.policy!a} drove the robot{under}", "no rollout of it was left out"]
    if manifest.source == TELEOP:
        return [f"operator {manifest.operator} drove the robot", "no take was left out"]
    return [] if oracle else ["the oracle played the actions (level=full plays it again)"]

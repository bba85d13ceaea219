"""Verification of the results of an evaluation: lines, scenarios, starts, outcomes with kept actions, figures."""

import json
import random
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ..compose import load_task
from ..episode import Actions
from ..errors import BadConfig, ScengenError, cut
from ..look.looks import look_named
from ..pool import Pool, kinds
from ..pool.demonstrations import Demonstrations, is_demonstrations
from ..pool.manifest import MANIFEST
from ..validate.verify.spot import bound
from ..work.log import different
from ..work.parallel import UNTRUSTED_LIMITS, each
from ..work.plain import MAX_JOURNAL, read_plain
from .arms import CLEAN, automatic_arms
from .audit_report import Options, ResultsReport
from .claims import Fault, broken, incomplete, malformed, untrue
from .comparison import TABLE, Comparison, PolicyResult
from .edition import Edition, check_pool
from .lines import CHAIN, CSV, RUN, kept_folder, read_lines
from .rebuilding import Rebuilder, Rebuilt, lost
from .rollouts import Evaluation, here, id_of, order, wanted
from .scenarios import Scenarios, chosen, known, not_playable
from .settings import PROFILE, EvaluateSettings, RolloutId
from .stored import StoredResult, StoredRun, mapping_in, stored_results
from .threshold.pools import LevelPools
from .threshold.result import ThresholdResult
from .threshold.search import Search, outcomes_of
from .threshold.settings import ThresholdSettings
from .threshold.shift import Shift


def audit(folder: Path, options: Options, progress: Callable[[int, int], None]) -> list[ResultsReport]:
    """Verify a folder of results: the episodes of each policy, then the tables.

    Args:
        progress: called with the number of rebuilt lines, and their total.

    Raises:
        BadConfig: the folder holds no results of this format, or a pool is not here.
    """
    stored, every = stored_results(folder)
    audits = [_Audit(folder, told, options) for told in every]
    for one in audits:
        one.run(progress)
    if all(one.readable for one in audits):
        try:
            audits[0].report.faults += _other_tables(folder, stored, audits)
        except ScengenError as error:
            audits[0].report.declined.append(f"the tables were not compared: {error}")
    return [one.report for one in audits]


def _other_tables(folder: Path, stored: Mapping[str, Any], audits: Sequence["_Audit"]) -> Iterator[str]:
    """Differences between the files of results and those that the lines give.

    Another version of scengen has the same figures and may have other words: then figures alone are compared.
    """
    same = not any(one.versions for one in audits)
    for path, text in Comparison([one.result for one in audits]).files(folder).items():
        if path.name == TABLE:
            there = json.loads(text)
            names = different(dict(stored), there) if same else different(_figures(stored), _figures(there))
            if names:
                yield f"{path.name} has other figures than its lines give: {', '.join(names[:5])}"
        elif (same or path.name == CSV) and _text_in(path) != text:
            yield f"{path} is not the one that its lines give"


def _text_in(path: Path) -> str | None:
    """Text of a file of results, with the ends of lines of this system; None if it cannot be read."""
    try:
        return read_plain(path, MAX_JOURNAL).decode().replace("\r\n", "\n")
    except (ValueError, OSError):
        return None


def _figures(plain: Mapping[str, Any]) -> dict[str, Any]:
    """The figures of a table without words about them, of each policy."""
    every = [told if isinstance(told, dict) else {} for told in plain.get("policies", [plain])]
    names = ("table", "conditions", "interactions", "threshold", "episodes_sha256")
    return {f"{k}.{name}": _without_words(told.get(name)) for k, told in enumerate(every) for name in names}


def _without_words(some: Any) -> Any:
    return [{k: v for k, v in one.items() if k != "told"} for one in some] if isinstance(some, list) else some


def _pool_here(name: str, sha256: str, given: Sequence[Pool]) -> Pool:
    """The pool of a run.

    Raises:
        BadConfig: it is neither among the given ones nor in the folder that the run names.
    """
    for pool in given:
        if pool.sha256 == sha256:
            return pool
    if Path(name, MANIFEST).is_file() and (pool := Pool.open(name).check()).sha256 == sha256:
        return pool
    raise BadConfig(f"the pool {name} of these results (sha256 {sha256[:12]}) is not here; pass pool=FOLDER")


class _Audit:
    """Verification of the episodes of one policy."""

    def __init__(self, folder: Path, stored: StoredResult, options: Options):
        self.stored, self.options, self.folder = stored, options, folder / stored.folder
        self.told = stored.chosen(folder)
        self.identity = mapping_in(self.folder / RUN)
        self.of_run = StoredRun.of(self.identity, self.folder / RUN)
        self.lines, self.readable = read_lines(self.folder / kinds.EPISODES), False
        self.report, self.sampled = ResultsReport(str(self.folder), len(self.lines)), 0
        self._actions: dict[Path, dict[tuple[int, int], Actions]] = {}
        given = [Pool.open(folder).check() for folder in options.pools]
        named = {**self.of_run.pools, **stored.benign, **stored.drawn}
        self.pools = {name: _pool_here(name, sha256, given) for name, sha256 in named.items()}

    @cached_property
    def settings(self) -> EvaluateSettings:
        """Settings of the run, with the folders in which the pools are here."""
        names = [name for name in vars(self.of_run) if name in vars(self.told) and name != "policy"]
        here = {name: str(pool.folder) for name, pool in self.pools.items()}
        fresh = [here[name] for name in self.stored.benign]
        usual = [here[name] for name in (*self.of_run.pools, *self.stored.drawn)]
        return replace(self.told, pool=usual, benign=fresh, **{name: getattr(self.of_run, name) for name in names})

    @property
    def result(self) -> PolicyResult:
        """The result that the lines give."""
        lines = sorted((line for line in self.lines if id_of(line) in self.wanted), key=order)
        end = self.lines[-1][CHAIN] if lines else ""
        stored = self.stored
        found = Evaluation(lines, 0, self.lost, stored.arms, stored.benign, end, stored.drawn)
        if isinstance(self.told, ThresholdSettings):
            return ThresholdResult(self.told, found, self._shift(self.told))
        return PolicyResult(self.told, found)

    def run(self, progress: Callable[[int, int], None]) -> None:
        """Check form, order, completeness and claims of all lines, and rebuild a sample."""
        if self._tell(malformed(self.lines)) or self._tell(self._too_many()):
            return
        self.readable = True
        self._tell(broken(self.identity, self.lines, self.stored.episodes_sha256))
        if not self._tell((None, text) for text in self.of_run.contradictions(self.told)):
            self._tell(incomplete(self.lines, self.wanted, self.told.seeds))
        self._tell((None, text) for text in self._other_run())
        for number, line in enumerate(self.lines):
            self._tell((number, text) for text in untrue(line, self._every, self.identity, self.told.name))
        self._tell(self._misplaced())
        self._tell(self._crashed_with_actions())
        self._rebuild(progress)
        self._remarks()

    def _tell(self, faults: Iterable[Fault]) -> bool:
        """Add faults to the report. Returns whether there are any."""
        told = [text if number is None else f"line {number} {text}" for number, text in faults]
        self.report.faults += told
        return bool(told)

    def _too_many(self) -> Iterator[Fault]:
        """More rollouts of a scenario than there are lines: so many are not counted."""
        if self.told.rollouts > (count := len(self.lines)):
            yield None, f"{TABLE} says rollouts = {self.told.rollouts}, and there are {count} lines"

    # --- what was to be played ----------------------------------------------------------------

    @cached_property
    def wanted(self) -> set[RolloutId]:
        """The rollouts of the table."""
        if isinstance(self.told, ThresholdSettings):
            return self._searched(self.told)
        if self.told.harness:
            return {*map(id_of, self.lines)}
        about = {key: told for key, told in self._chosen.items() if key[1] not in self.lost}
        return wanted(about, self.told) | wanted(about, self.told, self.stored.arms)

    def _searched(self, told: ThresholdSettings) -> set[RolloutId]:
        """The rollouts of a search, which follow one after the other from the outcomes that the lines claim."""
        here = {name: str(pool.folder) for name, pool in self.pools.items()}
        named = {folder: name for name, folder in here.items()}
        lines = [{**line, "pool": here[line["pool"]]} for line in self.lines if line["pool"] in here]
        pools = LevelPools(self._shift(told), self.options.search, [*self.pools.values()], told.pool is None)
        rounds = Search(told, pools, self.lost).rounds(outcomes_of(lines))
        return {replace(which, pool=named[which.pool]) for some in rounds for which in some}

    def _shift(self, told: ThresholdSettings) -> Shift:
        return Shift.of(told.task, told.along, told.levels, self.options.search)

    @cached_property
    def lost(self) -> dict[str, str]:
        """Scenarios that the results leave out, with the reasons."""
        return dict(self.stored.lost)

    @cached_property
    def _chosen(self) -> Scenarios:
        fresh = self.stored.benign
        sides = [[p for name, p in self.pools.items() if (name in fresh) == side] for side in (False, True)]
        some = (chosen(pools, self.settings, self.options.search) for pools in sides if pools)
        return self._as_named({key: told for each in some for key, told in each.items()})

    @cached_property
    def _every(self) -> Scenarios:
        every = (known(pool, self.options.search) for pool in self.pools.values())
        return self._as_named({key: told for some in every for key, told in some.items()})

    def _as_named(self, some: Scenarios) -> Scenarios:
        """Scenarios under the folders that the lines name."""
        named = {str(pool.folder): name for name, pool in self.pools.items()}
        return {(named[folder], id_): told for (folder, id_), told in some.items()}

    def _other_run(self) -> Iterator[str]:
        """Choices of the table that do not follow from its settings, and scenarios that are left out without a
        reason."""
        yield from self._other_choice()
        look = look_named(self.told.look)
        if (there := self.of_run.look_version) != look.version:
            earlier = f"{look.name} {cut(str(there), 20)}"
            self.report.declined.append(f"pictures were taken in look {earlier}, this is {look}")
        for task, version in self.of_run.task_versions.items():
            if text := load_task(task, self.options.search).other_version("played on", version):
                self.report.declined.append(text)
        here = {str(pool.folder): pool for pool in self.pools.values()}
        every = (known(pool, self.options.search) for pool in here.values())
        left_out = {key: told for some in every for key, told in some.items() if key[1] in self.lost}
        fails = not_playable([*here.values()], left_out, self.options.workers) if left_out else {}
        for id_ in sorted(self.lost):
            if id_ not in fails:
                yield f"{id_} was left out as unplayable, but it can be played"

    def _other_choice(self) -> Iterator[str]:
        """Arms that are not those of the settings, and pools that are not those of the edition."""
        chosen = self.told.chosen_arms
        if chosen is None:
            chosen = automatic_arms(line for line in self.lines if line["arm"] == CLEAN)
        if self.stored.arms != chosen:
            yield f"{TABLE} has the arms {self.stored.arms!r:.60}, its settings give {chosen!r:.60}"
        if self.told.tasks is not None and self.told.edition is None:
            yield f"{TABLE} names the tasks {self.told.tasks!r:.60} of an edition, and no edition"
        if self.told.edition is not None:
            edition = Edition.read(self.told.edition)
            for name in self.of_run.pools:
                try:
                    check_pool(edition, self.pools[name])
                except ScengenError as error:
                    yield f"{TABLE} names edition {edition.name}: {error}"

    # --- rebuilding ---------------------------------------------------------------------------

    def _rebuild(self, progress: Callable[[int, int], None]) -> None:
        """Rebuild a sample of the lines that name a scenario of the pools and a state."""
        count, rng = len(self.lines), random.Random(self.options.seed)
        some = (
            range(count) if self.options.sample is None else rng.sample(range(count), min(self.options.sample, count))
        )
        numbers = [number for number in some if self._can_be_rebuilt(self.lines[number])]
        numbers.sort(key=lambda number: id_of(self.lines[number]))
        items = [(number, self.lines[number], self._kept(number)) for number in numbers]
        rebuilder = Rebuilder(self.settings, self.of_run.observed, self.options.search)
        for done, one in enumerate(each(rebuilder, items, self.options.workers, UNTRUSTED_LIMITS, lost), 1):
            self._count(one)
            progress(done, len(items))
        self.sampled = len(some)

    def _can_be_rebuilt(self, line: Mapping[str, Any]) -> bool:
        return not line["crashed"] and (line["pool"], line["scenario"]) in self._every

    def _count(self, one: Rebuilt) -> None:
        self._tell((one.number, fault) for fault in one.faults)
        if one.lost:
            self.report.declined.append(f"line {one.number}: rebuilding it {one.lost}")
        self.report.rebuilt += not one.lost
        self.report.pictures += one.pictures
        self.report.replayed += one.replayed

    def _kept(self, number: int) -> Actions | None:
        """The actions of a line that were kept."""
        which = id_of(self.lines[number])
        actions = self._kept_of(which).get((self.lines[number]["index"], which.rollout))
        if actions is None and self.of_run.keep:
            self._tell([(number, f"has no kept actions in {kept_folder(self.folder, which)}")])
        return actions

    def _kept_of(self, which: RolloutId) -> Mapping[tuple[int, int], Actions]:
        """The kept actions of the folder of a rollout, by the index of the scenario and the number of the rollout.

        Under conditions of control the scenario has another id there."""
        folder = kept_folder(self.folder, which)
        if folder not in self._actions:
            found = Demonstrations.open(folder) if is_demonstrations(folder) else None
            rows = [] if found is None else [*found.attempts()]
            self._actions[folder] = {(row.index, row.run): row.witness for row in rows}
        return self._actions[folder]

    def _misplaced(self) -> Iterator[Fault]:
        """What folders of kept actions say otherwise than the run, whether their lines are rebuilt or not."""
        folders = {kept_folder(self.folder, which): which for which in map(id_of, self.lines)}
        for folder, which in sorted(folders.items()):
            if is_demonstrations(folder):
                found = self._of_others(Demonstrations.open(folder), which)
                yield from ((None, f"{folder} {text}") for text in found)

    def _of_others(self, found: Demonstrations, which: RolloutId) -> Iterator[str]:
        """What a folder of kept actions says otherwise than the run."""
        changed = which.condition
        wanted = {"policy": self.told.name, "condition": str(changed) if changed else None}
        wanted["perturb_seed"] = self.told.perturb_seed if changed else None
        for name, told in wanted.items():
            if (there := getattr(found.manifest, name)) != told:
                yield f"says {name} = {there!r:.60}, that of the run is {told!r:.60}"

    def _crashed_with_actions(self) -> Iterator[Fault]:
        """Lines of crashes whose episode was played to its end: its actions were kept."""
        for number, line in enumerate(self.lines):
            which = id_of(line)
            if line["crashed"] and (line["index"], which.rollout) in self._kept_of(which):
                yield number, "says that the policy crashed, but the actions of a whole episode were kept"

    # --- what is not known --------------------------------------------------------------------

    def _remarks(self) -> None:
        """State what was not checked."""
        report, count = self.report, len(self.lines)
        if self.sampled < count:
            shown = f": {bound(count, self.sampled, 'lines')}" if report.verdict == "sound" else ""
            report.remarks.append(f"{self.sampled} of {count} lines rebuilt, seed {self.options.seed}{shown}")
        if count > len(self.wanted):
            report.remarks.append(f"{count - len(self.wanted)} lines are of a longer run, and not in the table")
        report.remarks += self._other_machines()
        if self.versions:
            report.remarks.append("words of the tables are those of another version; their figures alone are compared")
        seen = sum(bool(line["pictures"]) for line in self.lines)
        if seen and report.pictures < min(report.rebuilt, seen):
            report.remarks.append(f"first pictures of {report.pictures} lines compared: others are of another renderer")
        if count > report.replayed:
            report.claimed.append(f"outcomes of {count - report.replayed} lines: their actions were not played again")
        if crashed := sum(bool(line["crashed"]) for line in self.lines):
            report.claimed.append(f"that the policy crashed in {crashed} episodes")
        if PROFILE in self.told.format:
            report.claimed.append("plots")
        perceived = "streams, rate, perturbed readings"
        report.claimed.append(
            f"that {cut(self.told.name)} chose the actions, from what it is said to have perceived ({perceived}), "
            "and whether it read the instruction"
        )
        if self.told.harness:
            report.claimed.append(f"that {cut(self.told.harness)} played no other episodes")
        kept = " and the kept rollouts" if self.of_run.keep else ""
        report.claimed.append(f"that the pools{kept} are sound (scengen verify pool=)")

    @property
    def versions(self) -> bool:
        """Whether a line was written by another version of scengen."""
        return any(line["scengen"] != here()["scengen"] for line in self.lines)

    def _other_machines(self) -> Iterator[str]:
        """Versions and rounding under which lines were played, where they are not those here."""
        for name, there in here().items():
            for other, count in Counter(line[name] for line in self.lines if line[name] != there).items():
                compared = "their first states and successes alone are compared, reasons and times are claimed"
                what = f"; {compared}" if name == "machine" else ""
                yield f"{count} lines were played with {name} {cut(other, 40)}, this is {there}{what}"

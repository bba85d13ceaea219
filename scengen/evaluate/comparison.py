"""Evaluations of one policy or several side by side: the table, the headline, and why episodes fail."""

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..look.looks import look_named
from ..perturb.perturbation import NONE
from ..samplers.split import ID
from .arms import CLEAN
from .conditions import ConditionLine, Interaction, arm_sentences, condition_lines, interactions, without_effect
from .edition import Edition
from .latex import FILE, latex
from .lines import CSV, as_csv
from .rollouts import Evaluation
from .rows import Row, ShownTable, rows
from .settings import LATEX, EvaluateSettings
from .statistics import scenarios_for_drop, smallest_visible_drop
from .table import TableLine, distinct, otherwise, plain, table

TABLE = "table.json"
"""File with the figures of an evaluation."""
MARKDOWN = "table.md"
"""File with the same tables for people."""
LOCAL = ("workers", "slots", "to", "fresh", "client")
"""Settings on which no figure depends."""
MAX_SHOWN = 20
"""Largest number of reasons in a printed list."""


@dataclass(frozen=True)
class Failure:
    """Failed episodes of one policy with the same reason, in the same phase."""

    policy: str
    """Name of the policy."""
    task: str
    """Name of the task."""
    split: str
    """Name of the split."""
    reason: str
    """Reason of the failure, or what crashed."""
    phase: str
    """Phase at the end of the episodes (`player.PHASES`); empty for episodes of older versions."""
    episodes: int
    """Number of episodes."""


@dataclass(frozen=True)
class Way:
    """Episodes of one policy that reached the goal without the same means."""

    policy: str
    """Name of the policy."""
    task: str
    """Name of the task."""
    split: str
    """Name of the split."""
    lacks: str
    """Means of the task that they lack, joined by semicolons."""
    episodes: int
    """Number of episodes."""


@dataclass(frozen=True)
class PolicyResult:
    """The evaluation of one policy."""

    settings: EvaluateSettings
    """Settings of the evaluation."""
    evaluation: Evaluation
    """Its episodes."""

    @cached_property
    def lines(self) -> list[TableLine]:
        """The lines of its table, without means that repeat another line."""
        return distinct(self._every_line, {e["task"]: e["category"] for e in self.clean})

    @cached_property
    def _every_line(self) -> list[TableLine]:
        return table(self.clean)

    @cached_property
    def conditions(self) -> list[ConditionLine]:
        """Its success under each condition."""
        return condition_lines(self.evaluation.episodes)

    @cached_property
    def interactions(self) -> list[Interaction]:
        """Interactions of axes and perturbations."""
        return interactions(self.evaluation.episodes)

    @cached_property
    def rows(self) -> list[Row]:
        """The rows of its table."""
        return [*rows(self.settings.name, self.lines, self.conditions, self.clean)]

    @property
    def sentences(self) -> Iterator[str]:
        """Sentences about its table: the drop, what is used, interactions, the means, what so few could not show."""
        yield self.headline
        before = {(row.task, row.split): row.rate for row in self.rows if not row.condition}
        same = without_effect(self.conditions)
        unchanged = [f"{task}: no action changes under {', '.join(names)}" for task, names in same.items()]
        together = [one for one in self.interactions if not {one.one, one.other} & {*same.get(one.task, ())}]
        arms = arm_sentences(self.conditions, before)
        for told in (*arms, *unchanged, *together, self.by_means, self._visible):
            yield f"{self.settings.name}: {told}" if told else ""

    @property
    def _visible(self) -> str:
        """The smallest drop that this number of scenarios can show."""
        first = next((row.rate for row in self.rows if row.split == ID), None)
        if first is None or not any(row.difference for row in self.rows):
            return ""
        n, before = first.scenarios, f"{100 * first.value:.0f} %"
        if not first.value:
            return "nothing succeeds in training, so that no drop can show"
        if least := smallest_visible_drop(first.value, n):
            return f"{n} scenarios are enough to show drops of {100 * least:.0f} points or more from {before}"
        enough = scenarios_for_drop(first.value)
        return f"{n} scenarios are too few to show any drop from {before}" + (
            f", even to 0; it takes {enough} or more" if enough else ""
        )

    @cached_property
    def clean(self) -> list[dict[str, Any]]:
        """Episodes without a perturbation and without an intervention."""
        return [e for e in self.evaluation.episodes if (e["perturbation"], e["arm"]) == (NONE, CLEAN)]

    @property
    def task_versions(self) -> dict[str, int]:
        """Versions of the tasks that were played, by task."""
        return {e["task"]: e["task_version"] for e in self.evaluation.episodes}

    @cached_property
    def failures(self) -> list[Failure]:
        """Its failures, the most frequent first."""
        found = Counter(
            (e["task"], e["split"], f"crashed: {e['crashed']}" if e.get("crashed") else e["reason"], e.get("phase", ""))
            for e in self.clean
            if not e["success"]
        )
        return [Failure(self.settings.name, *about, count) for about, count in found.most_common()]

    @cached_property
    def ways(self) -> list[Way]:
        """Its episodes that reached the goal without all means of their tasks, the most frequent first."""
        found = Counter((e["task"], e["split"], e["lacks"]) for e in self.clean if otherwise(e))
        return [Way(self.settings.name, *about, count) for about, count in found.most_common()]

    @property
    def by_means(self) -> str:
        """How many episodes reached the goal by the means of their tasks; empty if all did."""
        reached = [e for e in self.clean if e["success"] or otherwise(e)]
        ways, every = sum(map(otherwise, reached)), len(self.clean)
        said = f"the goal was reached in {len(reached)} of {every} episodes, in {len(reached) - ways} by the means"
        return said if ways else ""

    @property
    def headline(self) -> str:
        """The drop of all tasks together; empty without two sides."""
        drop = self._every_line[-1].difference
        if drop is None:
            return ""
        low, high = 100 * drop.low, 100 * drop.high
        against = (
            f"the same episodes without the axis ({drop.twins} twins)" if drop.twins else "other scenarios, unpaired"
        )
        told = f"{100 * drop.value:+.1f} points [{low:+.1f}, {high:+.1f}] against {against}"
        return f"{self.settings.name}: {told}: {'' if drop.is_significant else 'not '}significant"

    @property
    def plain(self) -> dict[str, Any]:
        """The result as plain data."""
        settings = self.settings
        return {
            "policy": settings.name,
            "version": settings.version,
            "rules": settings.rules,
            "splits": settings.splits,
            "task_versions": self.task_versions,
            "edition": settings.edition and edition_told(settings.edition),
            "settings": {name: value for name, value in asdict(settings).items() if name not in LOCAL},
            "episodes_sha256": self.evaluation.chain,
            "lost": dict(self.evaluation.lost),
            "arms": list(self.evaluation.arms),
            "benign": dict(self.evaluation.benign),
            "look": str(look_named(settings.look)),
            "headline": self.headline,
            "table": plain(self.lines),
            "conditions": [asdict(line) for line in self.conditions],
            "interactions": [{**asdict(each), "told": str(each)} for each in self.interactions],
            "failures": [asdict(failure) for failure in self.failures],
            "otherwise": [asdict(way) for way in self.ways],
        }


@dataclass(frozen=True)
class Comparison:
    """The evaluations of some policies on the same pools."""

    results: Sequence[PolicyResult]
    """Result of each policy."""

    def tables(self, digits: int = 0) -> list[ShownTable]:
        """The tables of splits and of conditions with the rows of all policies, without empty ones.

        Args:
            digits: number of digits after the point.
        """
        splits, conditions = ([row for row in self.rows if bool(row.condition) is own] for own in (False, True))
        return [ShownTable.of(some, digits) for some in (splits, conditions) if some]

    def failure_table(self) -> tuple[list[str], list[list[str]]]:
        """Titles and cells of the failures of all policies, the most frequent first."""
        every = sorted((each for result in self.results for each in result.failures), key=lambda each: -each.episodes)
        cells = [[f.policy, f.task, f.split, f.reason, f.phase, str(f.episodes)] for f in every]
        return self._told_apart(["policy", "task", "split", "reason", "phase", "episodes"], cells)

    def way_table(self) -> tuple[list[str], list[list[str]]]:
        """Titles and cells of the other ways of all policies to the goal, the most frequent first."""
        every = sorted((way for result in self.results for way in result.ways), key=lambda way: -way.episodes)
        cells = [[w.policy, w.task, w.split, w.lacks, str(w.episodes)] for w in every]
        return self._told_apart(["policy", "task", "split", "lacks", "episodes"], cells)

    @property
    def headlines(self) -> list[str]:
        """Sentences about the tables of the policies."""
        return [*dict.fromkeys(line for result in self.results for line in result.sentences if line)]

    def plain(self, folder: Path) -> Mapping[str, Any]:
        """The comparison as plain data; that of one policy alone is its result.

        Args:
            folder: folder of the comparison.
        """
        told = [{"folder": os.path.relpath(r.settings.folder, folder), **r.plain} for r in self.results]
        return told[0] if len(told) == 1 else {"policies": told}

    def files(self, folder: Path) -> dict[Path, str]:
        """Content of the files of the comparison: tables, and the lines of each policy without JSON."""
        lines = {result.settings.folder / CSV: as_csv(result.evaluation.episodes) for result in self.results}
        told = json.dumps(self.plain(folder), indent=1, allow_nan=False) + "\n"
        in_latex = LATEX in self.results[0].settings.format
        more = {folder / FILE: latex(self.rows, self.category)} if in_latex else {}
        return {**lines, folder / TABLE: told, folder / MARKDOWN: self.markdown, **more}

    @property
    def category(self) -> dict[str, str]:
        """Category of each task."""
        return {e["task"]: e["category"] for result in self.results for e in result.clean}

    @property
    def rows(self) -> list[Row]:
        """The rows of all policies, those about the same episodes next to each other."""
        every = [row for result in self.results for row in result.rows]
        order = list(dict.fromkeys((row.task, row.split, row.condition) for row in every))
        return sorted(every, key=lambda row: order.index((row.task, row.split, row.condition)))

    @property
    def markdown(self) -> str:
        """The comparison as Markdown, rates and 95 % intervals in percent."""
        settings = self.results[0].settings
        names = ", ".join(f"`{result.settings.name}`" for result in self.results)
        settling = "" if settings.settle else ", goals counted at once"
        head = f"{names}: success in percent [95 % interval], n scenarios x rollouts, {settings.rules} rules{settling}"
        if settings.edition:
            edition = edition_told(settings.edition)
            head += f", edition {edition['name']} (sha256 {edition['sha256'][:12]})"
        tables = self.tables(1)
        head += "".join(f", {name} {value}" for name, value in tables[0].common.items() if name in ("task", "n"))
        parts = [head]
        for each in tables:
            parts += [_table(each.head, each.cells), "; ".join(each.legend)]
        if self.headlines:
            parts.append("\n".join(f"* {_escaped(line)}" for line in self.headlines))
        parts += [_table(titles, cells) for titles, cells in (self.way_table(), self.failure_table()) if cells]
        versions = {task: version for result in self.results for task, version in result.task_versions.items()}
        parts.append("Versions of the tasks: " + ", ".join(f"{task} {each}" for task, each in versions.items()) + ".")
        return "\n\n".join(filter(None, parts)) + "\n"

    def _told_apart(self, head: Sequence[str], cells: Sequence[Sequence[str]]) -> tuple[list[str], list[list[str]]]:
        """A table without the columns of policies and tasks if there is one alone."""
        alone = {"policy": len(self.results) == 1, "task": len(self.category) == 1}
        kept = [number for number, name in enumerate(head) if not alone.get(name)]
        return [head[number] for number in kept], [[row[number] for number in kept] for row in cells]


def edition_told(name: str) -> dict[str, str]:
    """Entry of results for the edition to which they refer."""
    edition = Edition.read(name)
    return {"name": edition.name, "sha256": edition.sha256}


def _table(head: Sequence[str], rows: Any) -> str:
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    return "\n".join([*lines, *(f"| {' | '.join(map(_escaped, row))} |" for row in rows)])


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")

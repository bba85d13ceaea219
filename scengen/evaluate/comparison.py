"""Evaluations of one policy or several side by side: the table, the headline, and why episodes fail."""

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..perturb.perturbation import NONE
from .arms import CLEAN
from .edition import Edition
from .lines import CSV, as_csv
from .rollouts import Evaluation
from .settings import EvaluateSettings
from .table import TableLine, cells, otherwise, plain, table

TABLE = "table.json"
"""File with the figures of an evaluation."""
MARKDOWN = "table.md"
"""File with the same tables for people."""
LOCAL = ("workers", "slots", "to", "fresh", "client")
"""Settings on which no figure depends."""
COUNTS = ("crashed", "otherwise")
"""Counts of the lines of a table, each shown if any is above 0."""
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
        """The lines of its table."""
        return table(self.clean)

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
            for e in self.evaluation.episodes
            if not e["success"]
        )
        return [Failure(self.settings.name, *about, count) for about, count in found.most_common()]

    @cached_property
    def ways(self) -> list[Way]:
        """Its episodes that reached the goal without all means of their tasks, the most frequent first."""
        found = Counter((e["task"], e["split"], e["lacks"]) for e in self.evaluation.episodes if otherwise(e))
        return [Way(self.settings.name, *about, count) for about, count in found.most_common()]

    @property
    def by_means(self) -> str:
        """How many episodes reached the goal by the means of their tasks; empty if all did."""
        reached = [e for e in self.evaluation.episodes if e["success"] or otherwise(e)]
        ways, every = sum(map(otherwise, reached)), len(self.evaluation.episodes)
        said = f"the goal was reached in {len(reached)} of {every} episodes, in {len(reached) - ways} by the means"
        return f"{self.settings.name}: {said}" if ways else ""

    @property
    def headline(self) -> str:
        """The drop of all tasks together; empty without two sides."""
        drop = self.lines[-1].difference
        if drop is None:
            return ""
        low, high = 100 * drop.low, 100 * drop.high
        against = (
            f"the same episodes without the axis ({drop.twins} twins)" if drop.twins else "other scenarios, unpaired"
        )
        return f"{self.settings.name}: {100 * drop.value:+.1f} points [{low:+.1f}, {high:+.1f}] against {against}"

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
            "headline": self.headline,
            "table": plain(self.lines),
            "failures": [asdict(failure) for failure in self.failures],
            "otherwise": [asdict(way) for way in self.ways],
        }


@dataclass(frozen=True)
class Comparison:
    """The evaluations of some policies on the same pools."""

    results: Sequence[PolicyResult]
    """Result of each policy."""

    @property
    def head(self) -> list[str]:
        """Titles of the columns."""
        counts = [name for name in COUNTS if self._any(name)]
        return ["", "split", *self._if_several("policy"), "ID", "OOD", "difference", *counts]

    def rows(self) -> Iterator[list[str]]:
        """The cells of the table: for each task and split, and each category, a row for each policy."""
        order = dict.fromkeys((line.what, line.split) for result in self.results for line in result.lines)
        tables = [{(line.what, line.split): line for line in result.lines} for result in self.results]
        sections = [key for key in order if key != ("all", "all")] + [("all", "all")]
        for key in sections:
            for result, lines in zip(self.results, tables, strict=True):
                if key in lines:
                    what, split, *rates = cells(lines[key])
                    counts = [str(getattr(lines[key], name)) for name in COUNTS if self._any(name)]
                    yield [what, split, *self._if_several(result.settings.name), *rates, *counts]

    @property
    def failure_head(self) -> list[str]:
        """Titles of the columns of the failures."""
        return [*self._if_several("policy"), "task", "split", "reason", "phase", "episodes"]

    def failure_rows(self) -> Iterator[list[str]]:
        """The cells of the failures of all policies, the most frequent first."""
        every = [failure for result in self.results for failure in result.failures]
        for f in sorted(every, key=lambda failure: -failure.episodes):
            yield [*self._if_several(f.policy), f.task, f.split, f.reason, f.phase, str(f.episodes)]

    @property
    def way_head(self) -> list[str]:
        """Titles of the columns of other ways to the goal."""
        return [*self._if_several("policy"), "task", "split", "lacks", "episodes"]

    def way_rows(self) -> Iterator[list[str]]:
        """The cells of the other ways of all policies to the goal, the most frequent first."""
        for w in sorted((way for result in self.results for way in result.ways), key=lambda way: -way.episodes):
            yield [*self._if_several(w.policy), w.task, w.split, w.lacks, str(w.episodes)]

    @property
    def headlines(self) -> list[str]:
        """The drop of each policy that has both sides, and how many of its successes were by the means."""
        return [line for result in self.results for line in (result.headline, result.by_means) if line]

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
        return {**lines, folder / TABLE: told, folder / MARKDOWN: self.markdown}

    @property
    def markdown(self) -> str:
        """The comparison as Markdown, rates and 95 % intervals in percent."""
        settings = self.results[0].settings
        names = ", ".join(f"`{result.settings.name}`" for result in self.results)
        settling = "" if settings.settle else ", goals counted at once"
        head = (
            f"{names}: success in percent [95 % interval], {settings.seeds} scenarios a pool, "
            f"{settings.rollouts} rollouts each, {settings.rules} rules{settling}"
        )
        if settings.edition:
            edition = edition_told(settings.edition)
            head += f", edition {edition['name']} (sha256 {edition['sha256'][:12]})"
        parts = [head, _table(self.head, self.rows())]
        if self.headlines:
            parts.append("\n".join(f"* {_escaped(line)}" for line in self.headlines))
        if rows := list(self.way_rows()):
            parts.append(_table(self.way_head, rows))
        if rows := list(self.failure_rows()):
            parts.append(_table(self.failure_head, rows))
        versions = {task: version for result in self.results for task, version in result.task_versions.items()}
        parts.append("Versions of the tasks: " + ", ".join(f"{task} {each}" for task, each in versions.items()) + ".")
        return "\n\n".join(parts) + "\n"

    def _if_several(self, cell: str) -> list[str]:
        """A cell of a column that only a comparison of several policies has."""
        return [cell] if len(self.results) > 1 else []

    def _any(self, name: str) -> bool:
        """Whether a count of the table is above 0 in any result."""
        return any(getattr(result.lines[-1], name) for result in self.results)


def edition_told(name: str) -> dict[str, str]:
    """Entry of results for the edition to which they refer."""
    edition = Edition.read(name)
    return {"name": edition.name, "sha256": edition.sha256}


def _table(head: Sequence[str], rows: Any) -> str:
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    return "\n".join([*lines, *(f"| {' | '.join(map(_escaped, row))} |" for row in rows)])


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")

"""Several runs side by side: the paper's tables of three stages, and what each model cost."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import BadConfig, cut
from ..evaluate.latex import booktabs, cell
from ..evaluate.statistics import Rate
from ..evaluate.table import TableLine, percent
from ..pictures.page import template
from ..work.plain import MAX_JOURNAL, read_plain
from .calls import CALLS, read_calls
from .prices import Prices, prices
from .questioning import ACT, PLAN, UNDERSTAND
from .runner import earlier
from .tables import lines

STAGES = {UNDERSTAND: "1 understand", PLAN: "2 plan", ACT: "3 act"}
"""Stages as the tables name them."""
SIDES = ("ID", "OOD")
"""Names of the two sides of a table, in and out of distribution."""
ALL = "all"
"""Name of the line over all tasks, and of the split over all axes."""


@dataclass(frozen=True)
class Grid:
    """A table: rates, counts and texts in rows."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[Rate | str | None, ...], ...]

    @property
    def texts(self) -> list[list[str]]:
        """Cells as text; rates in percent with 95 % intervals."""
        return [[each if isinstance(each, str) else percent(each) for each in row] for row in self.rows]

    @property
    def markdown(self) -> str:
        """The table as Markdown."""
        head, *rows = (f"| {' | '.join(row)} |" for row in (self.head, *self.texts))
        return "\n".join([self.title, "", head, "|" + "---|" * len(self.head), *rows, ""])

    @property
    def latex(self) -> str:
        """The table for `booktabs`."""
        rows = ([each if isinstance(each, str) else cell(each) for each in row] for row in self.rows)
        return booktabs(self.title.replace("%", "\\%"), self.head, iter(rows))


@dataclass(frozen=True)
class ModelRun:
    """What one model did: its results by stage, and its calls."""

    title: str
    """Model and perturbation."""
    results: Mapping[int, Sequence[Mapping[str, Any]]]
    calls: Sequence[Mapping[str, Any]]
    prices: Prices | None

    @classmethod
    def read(cls, folder: Path, given: str | Sequence[float] | None) -> "ModelRun":
        """The run in a folder.

        Args:
            given: prices as in `prices=`; None for those of the run.

        Raises:
            BadConfig: there is no run, it graded nothing, or a file is damaged.
        """
        settings, paths = earlier(folder), {stage: folder / f"results-{stage}.jsonl" for stage in STAGES}
        files = {stage: _read(path) for stage, path in paths.items() if path.exists()}
        every = [result for found in files.values() for result in found]  # those of stage 2 have stage 1 before it
        results = {n: own for n in STAGES if (own := [r for r in files.get(n, every) if r["stage"] == n])}
        if not results:
            raise BadConfig(f"{cut(str(folder))} holds no results; scengen agent makes them")
        own = prices(settings.prices if given is None else given, settings.model, None)
        return cls(settings.title, results, read_calls(folder / CALLS), own)

    def spent(self, stage: int) -> tuple[str, ...]:
        """Calls, tokens of prompts and answers, and cost of a stage, as text."""
        replies = [call["reply"] for call in self.calls if call["about"]["stage"] == stage]
        asked, answered = (sum(reply[name] for reply in replies) for name in ("tokens_in", "tokens_out"))
        cost = f"{self.prices.of((asked, answered)):.4g}" if self.prices else "no prices"
        return (str(len(replies)), str(asked), str(answered), cost)


def grids(runs: Sequence[ModelRun]) -> list[Grid]:
    """The tables of some runs: the stages by category, each stage by task, and what they cost."""
    tables = {(run.title, stage): lines(found, stage) for run in runs for stage, found in sorted(run.results.items())}
    every = [result for run in runs for found in run.results.values() for result in found]
    category = {result["task"]: result["category"] for result in sorted(every, key=lambda r: r["task"])}
    stages = sorted({stage for _, stage in tables})
    found = [_by_category(tables, category)]
    found += [
        _by_task(stage, {title: t for (title, s), t in tables.items() if s == stage}, category) for stage in stages
    ]
    spent = [(run.title, STAGES[stage], *run.spent(stage)) for run in runs for stage in sorted(run.results)]
    head = ("model", "stage", "calls", "tokens of prompts", "of answers", "cost")
    return [*found, Grid("What the calls cost", head, tuple(spent))]


def files(found: Sequence[Grid]) -> dict[str, str]:
    """Contents of the files of a comparison, by their names: Markdown, LaTeX and a page."""
    tables = "\n".join(grid.latex for grid in found)
    return {
        "table.md": "\n".join(grid.markdown for grid in found),
        "table.tex": f"% needs \\usepackage{{booktabs}}; intervals are 95 %\n{tables}",
        "report.html": template("agents.html").render(grids=found),
    }


def compared(folders: Sequence[Path], given: str | Sequence[float] | None = None) -> list[Grid]:
    """The tables of the runs in some folders.

    Raises:
        BadConfig: a folder holds no run, or two hold the same model under the same perturbation.
    """
    runs = [ModelRun.read(folder, given) for folder in folders]
    titles = Counter(run.title for run in runs)
    if twice := [title for title, count in titles.items() if count > 1]:
        raise BadConfig(f"two runs are of {cut(twice[0])}; give one run of each model and perturbation")
    return grids(runs)


def _by_category(tables: Mapping[tuple[str, int], Sequence[TableLine]], category: Mapping[str, str]) -> Grid:
    """A row for each model, stage and side; a category of one task has the rate of that task."""
    groups = sorted(set(category.values()))
    rows = []
    for (title, stage), table in tables.items():
        for side in SIDES:
            cells = [_rate(table, name, side) for name in (*groups, ALL)]
            if any(cells):
                rows.append((title, STAGES[stage], side, *cells))
    return Grid("Right by category [%]", ("model", "stage", "", *groups, ALL), tuple(rows))


def _by_task(stage: int, tables: Mapping[str, Sequence[TableLine]], category: Mapping[str, str]) -> Grid:
    """A row for each task: of each model the rates in training and over all axes."""
    sides = [(title, side) for title in tables for side in SIDES]
    used = [(title, side) for title, side in sides if any(_rate(tables[title], task, side) for task in category)]
    rows = [(task, *(_rate(tables[title], task, side) for title, side in used)) for task in category]
    head = ("task", *(f"{title}, {side}" for title, side in used))
    return Grid(f"Stage {STAGES[stage]}: right by task [%]", head, tuple(rows))


def _rate(table: Sequence[TableLine], what: str, side: str) -> Rate | None:
    """The rate of a task or category over all splits. The last line of a task is that over all its axes."""
    found = [line for line in table if line.what == what]
    return (found[-1].id if side == SIDES[0] else found[-1].ood) if found else None


def _read(path: Path) -> list[dict[str, Any]]:
    """Results in a file.

    Raises:
        BadConfig: it is damaged.
    """
    try:
        found = [json.loads(line) for line in read_plain(path, MAX_JOURNAL).decode().splitlines()]
        _ = [lines([result], result["stage"]) for result in found]
        return found
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError) as error:
        raise BadConfig(
            f"{cut(str(path))} holds no results of scengen agent ({cut(str(error))}); run it again"
        ) from None

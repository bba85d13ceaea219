"""search for visible quantities that reveal a decision of a task but are not the intended ones"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich.table import Table

from ...errors import BadConfig
from ...ood.cues.audit import MIN_DRAWS, Cue, DecisionAudit, audit, draws
from ...ood.cues.blindfold import blindfold
from ...ood.cues.stated import Compared, compared, stated
from ...runs.progress import ProgressBar
from ...samplers.split import ID
from ...samplers.task import Task
from ...samplers.task_files import search_path
from ...scenario import Scenario
from ...work.limits import at_least
from ...work.targets import try_file
from . import FAILED, OK, Arguments, err, filled, one, out, remark, say, write_json
from .settings import read_uncertified

WIDTH = 80
"""Width of the table [characters]."""


@dataclass(frozen=True)
class CuesSettings:
    """Settings of `scengen axis cues`; conf/command/axis_cues.yaml explains them."""

    n: int
    axis_n: int
    seed: int
    pool: str | list[str] | None
    widen: bool
    blind: str | None
    json: str | None


def command(arguments: Arguments) -> int:
    settings, task = read_uncertified("axis cues", arguments, CuesSettings)
    at_least(settings, n=MIN_DRAWS, axis_n=0, seed=0)
    try_file(settings.json)
    if settings.blind:
        return _blindfolded(task, settings.blind, settings.seed, settings.axis_n)
    known = stated(task.name, search_path(arguments))
    scenarios = _of_pool(task, settings.pool) if settings.pool else draws(task, ID, settings.seed, settings.n)
    axes = {axis: draws(task, axis, settings.seed, settings.axis_n) for axis in task.axes} if settings.axis_n else {}
    with ProgressBar(err, f"audit {task.name}", None) as progress_bar:
        found = audit(task, scenarios, axes, settings.widen, lambda done, _: progress_bar.show(done, "decisions"))
    result = Compared(known) if settings.pool else compared(found, known)
    out.print(_table(task.name, len(scenarios), found))
    for decision in found:
        if decision.revealed:
            say(_words(decision, result))
    for name in result.gone:
        remark(f"conf/cues/{task.name}.yaml states {name}, which no cue reveals any more; remove it")
    if settings.json:
        write_json(settings.json, {"task": task.name, "draws": len(scenarios), "decisions": [*map(_plain, found)]})
    return FAILED if result.new else OK


def _blindfolded(task: Task, parameter: str, seed: int, count: int) -> int:
    """Play the oracle with a parameter at training's middle, and print how often it solves the task."""
    found = blindfold(task, parameter, draws(task, ID, seed, count))
    middle = f"{parameter} = {found.middle:.4g}, the middle of training"
    say(f"{task.name}: the oracle with {middle}, solves {found.solved} of {found.tried}")
    say(f"control: with {found.control:.4g} it solves {found.controls} of {found.tried}")
    return OK


def _of_pool(task: Task, folder: str | list[str]) -> list[Scenario]:
    """The scenarios of a pool of this task."""
    pool = filled(one(folder))
    if pool.task != task.name:
        raise BadConfig(f"{pool.folder} is a pool of {pool.task}; give task={pool.task}")
    return [task.scenario(row.params) for row in pool.rows(witness=False)]


def _plain(found: DecisionAudit) -> dict[str, Any]:
    return {**asdict(found), "best": asdict(found.best), "revealed": found.revealed}


def _table(task: str, count: int, found: Sequence[DecisionAudit]) -> Table:
    """The best unintended and the best intended rule of each decision."""
    title = f"{task}: {count} draws, rules judged on those held out (95 % interval)"
    table = Table(title=title, title_justify="left", width=WIDTH, title_style="")
    for name in ("decision", "intended", "cue", "right", "chance", "broken by"):
        table.add_column(name, justify="right" if name == "chance" else "left", overflow="fold")
    for decision in found:
        table.add_row(*_row(decision, decision.best, "no"), style=None if decision.revealed else "dim")
        if decision.intended:
            table.add_row(*_row(decision, decision.intended, "yes"), style="dim")
    return table


def _row(found: DecisionAudit, cue: Cue, intended: str) -> tuple[str, ...]:
    right = f"{cue.share:.2f} ({cue.low:.2f}-{cue.high:.2f})"
    breaks = ", ".join(cue.breaks) if intended == "no" and found.revealed else ""
    return found.decision, intended, cue.rule, right, f"{found.fixed.share:.2f}", breaks


def _words(found: DecisionAudit, result: Compared) -> str:
    """What an unintended rule reveals, what is stated of it, and what would break it."""
    statement = result.stated.get(found.decision)
    status = f"{statement.status}: {statement.why.rstrip('.')}" if statement else "new" if result.new else "found"
    words = f"{found.decision} is revealed by {found.best.rule} ({status})"
    if found.best.equal:
        words += f"; equal in these draws: {', '.join(found.best.equal[:3])}"
    if found.widen:
        return f"{words}; a wider range would break it: {', '.join(found.widen)}"
    return words + (f"; only refused scenarios break it: {', '.join(found.protected)}" if found.protected else "")

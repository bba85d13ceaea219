"""search for OOD axes: where memory of training fails and the oracle does not"""

from pathlib import Path

from rich.table import Table

from ...errors import UnknownName
from ...ood.discovery.proposal import Finding
from ...ood.discovery.search import METHODS, MIN_BUDGET, TRIALS, DiscoverSettings, SearchResult, discover
from ...runs.progress import ProgressBar
from ...samplers.axis import spell
from ...work.limits import at_least
from ...work.log import recorded
from ...work.targets import try_folder
from . import OK, Arguments, err, out, say, say_begun, write
from .settings import read_task


def command(arguments: Arguments) -> int:
    settings, task, checks = read_task("axis discover", arguments, DiscoverSettings)
    at_least(settings, budget=MIN_BUDGET, seed=0, workers=1)
    if settings.method not in METHODS:
        raise UnknownName("method", settings.method, METHODS)
    folder = Path(settings.to or f"generated/discover/{task.name}")
    try_folder(folder)
    say_begun(recorded(folder / TRIALS), "trials", folder, settings.fresh)
    with ProgressBar(err, f"discover {task.name}", settings.budget, settings.workers) as progress_bar:

        def progress(what: str, done: int, total: int) -> None:
            progress_bar.of(min(done, total), total, what)

        search = discover(task, checks, settings, folder, progress)
    out.print(_table(task.name, search))
    say("trials: " + ", ".join(f"{count} {what}" for what, count in search.spent.items()))
    write(folder / "axes.yaml", search.as_yaml(task))
    say(f"wrote {folder / 'axes.yaml'}: copy useful axes into the task file, and evaluate them with scengen axis card")
    return OK


def _table(task: str, search: SearchResult) -> Table:
    table = Table(title=f"{task}: {len(search.findings)} axes confirmed", title_justify="left")
    for title in ("axis", "values", "seen", "fails outside", "solved within", "p (Holm)", "in the task file"):
        table.add_column(title)
    for finding in (*search.findings, *search.rejected):
        table.add_row(*_row(finding), style=None if finding in search.findings else "dim")
    return table


def _row(finding: Finding) -> tuple[str, ...]:
    values = ", ".join(f"{name} {spell(dist)}" for name, dist in finding.axis.replace.items())
    seen, fails = f"{finding.seen} of {finding.tried}", f"{finding.confirmed} of {finding.fresh}"
    within = f"{finding.within} of {finding.controls}"
    return finding.axis.name, values, seen, fails, within, f"{finding.p:.2g}", ", ".join(finding.known)

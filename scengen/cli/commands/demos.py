"""make demonstrations of new scenarios in several styles, and keep those that succeed"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.table import Table

from ...compose import Combination, combinations, each_checked
from ...demos.generate import STEPS, DemosSettings, DemosSummary, generate_demonstrations
from ...errors import BadConfig
from ...runs.journal import begun
from ...runs.progress import ProgressBar
from ...samplers.task import Task
from ...validate.settings import CertifySettings
from ...work.targets import try_file
from . import FAILED, OK, Arguments, err, out, say, say_begun, warn, write_json
from .settings import read_task

GENERATED = "generated"
"""Default folder of the demonstrations of a sweep."""
MAX_REASONS = 8
"""Largest number of reasons in the table of attempts."""


@dataclass(frozen=True)
class Run:
    """One folder of demonstrations to make."""

    task: Task
    certify_settings: CertifySettings
    settings: DemosSettings

    def __call__(self) -> DemosSummary:
        """Make the demonstrations, and print a summary."""
        task, settings = self.task, self.settings
        say_begun(begun(settings.folder(task)), "attempts", settings.folder(task), settings.fresh)
        with ProgressBar(err, f"{task.name}/{settings.split} demos", settings.n, settings.workers) as progress_bar:

            def progress(kept: int, tried: int, verdicts: Mapping[str, int], reasons: Mapping[str, int]) -> None:
                failed = verdicts.get("failed", 0)
                progress_bar.show(min(kept, settings.n), f"{tried} tried, {failed} failed")

            summary = generate_demonstrations(task, self.certify_settings, settings, progress)
        out.print(_table(summary))
        made, manifest, where = summary.made, summary.manifest, summary.demonstrations.folder
        styles = ", ".join(f"{n} {style}" for style, n in sorted(manifest.styles.items()))
        say(f"{where}: {made} demonstrations ({styles}) of {manifest.indices} attempts")
        if made:
            say(f"processor time per demonstration: {summary.cpu / made:.2f} s")
        say(f"sha256: {summary.demonstrations.sha256}")
        if made < settings.n:
            warn(f"scengen: only {made} of {settings.n} demonstrations; see the reasons above, or raise limit=")
        return summary


def command(arguments: Arguments) -> int:
    requested = combinations("demos", arguments)
    runs = each_checked(requested, lambda one: _checked(one, len(requested) > 1), "nothing was made")
    folder, times = Counter(run.settings.to for run in runs).most_common(1)[0]
    if times > 1:
        others = [name for name in requested[0].swept if name not in ("task", "split")]
        remedy = (
            f"repeat the command for each value of {others[0]}, with another to=" if others else "give each value once"
        )
        raise BadConfig(f"{times} of the combinations would be written to {folder}; {remedy}")
    target = runs[0].settings.json
    try_file(target)
    summaries = [run() for run in runs]
    if target:
        write_json(target, [_plain(summary) for summary in summaries])
    return max(OK if each.made == run.settings.n else FAILED for each, run in zip(summaries, runs, strict=True))


def _plain(summary: DemosSummary) -> dict[str, Any]:
    """A summary as plain data."""
    manifest, made = summary.manifest, summary.demonstrations
    counts = {name: getattr(manifest, name) for name in ("indices", "styles", "funnel", "reasons")}
    return {"to": str(made.folder), "sha256": made.sha256, "made": summary.made, **counts, "cpu": summary.cpu}


def _checked(requested: Combination, several: bool) -> Run:
    """The run of a combination, checked before any run starts, with a folder below to= if there are several."""
    settings, task, certify_settings = read_task("demos", requested.overrides, DemosSettings)
    settings.check(task)
    if several:
        name = f"{task.name}-{settings.split}" + ("" if settings.to else "-demos")
        settings = replace(settings, to=str(Path(settings.to or GENERATED, name)))
    return Run(task, certify_settings, settings)


def _table(summary: DemosSummary) -> Table:
    """Number of attempts after each step, and the reasons of those that failed."""
    table = Table("step", "left", "lost", "share", title="attempts", title_justify="left")
    funnel, before = summary.manifest.funnel, None
    for step in ("attempted", *STEPS):
        count = funnel[step]
        lost = "" if before in (None, count) else str(before - count)
        table.add_row(step, str(count), lost, f"{count / max(1, funnel['attempted']):.0%}")
        before = count
    if summary.manifest.reasons:
        table.add_section()
        for reason, count in sorted(summary.manifest.reasons.items(), key=lambda item: -item[1])[:MAX_REASONS]:
            table.add_row(reason[:90], "", str(count), "", style="dim")
    return table

"""draw scenarios, certify them, and store the first n that hold in a pool"""

from collections.abc import Mapping

from ..config import read_task
from ..pictures.report import attack_table, funnel_table, summary_lines
from ..runs.generate import Settings, generate
from ..runs.progress import ProgressBar
from ..samplers.designs import SOBOL
from . import FAILED, OK, Arguments, err, out, say, warn


def command(arguments: Arguments) -> int:
    settings, task, certify_settings = read_task("generate", arguments, Settings)
    if settings.sampler == "sobol" and settings.n < SOBOL:
        what = f"of {settings.n} points of a Sobol set some pairs of parameters correlate by chance, up to 0.95 at 32"
        warn(f"scengen: {what}; say n={SOBOL} or more, or sampler=lhs:{settings.n}")
    with ProgressBar(err, f"{task.name}/{settings.split}", settings.n) as progress_bar:

        def progress(certified: int, finished: int, verdicts: Mapping[str, int]) -> None:
            lost = ", ".join(f"{n} {v}" for v, n in sorted(verdicts.items()) if v != "certified")
            progress_bar.show(min(certified, settings.n), f"{finished} tried" + (f", {lost}" if lost else ""))

        summary = generate(task, certify_settings, settings, progress)
    out.print(funnel_table(summary.funnel, summary.reasons))
    if summary.attack is not None:
        out.print(attack_table(summary.attack))
    for line in summary_lines(summary):
        say(line)
    if summary.certified < settings.n:
        warn(
            f"scengen: only {summary.certified} of {settings.n} could be certified among {summary.indices} indices; "
            "see the reasons above, or raise limit="
        )
        return FAILED
    return OK

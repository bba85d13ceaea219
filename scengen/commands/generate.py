"""draw scenarios, certify them, and store the first n that hold in a pool"""

from collections.abc import Mapping

from ..config import read, typed
from ..pictures.report import funnel_table, summary_lines
from ..runs.generate import Settings, generate
from ..runs.progress import Bar
from . import FAILED, OK, Arguments, err, out


def command(arguments: Arguments) -> int:
    composed = read("generate", arguments)
    settings = typed("", Settings, composed.settings)
    assert composed.task is not None
    with Bar(err, f"{composed.task.name}/{settings.split}", settings.n) as bar:

        def progress(certified: int, finished: int, verdicts: Mapping[str, int]) -> None:
            lost = ", ".join(f"{n} {v}" for v, n in sorted(verdicts.items()) if v != "certified")
            bar.show(min(certified, settings.n), f"{finished} tried" + (f", {lost}" if lost else ""))

        summary = generate(composed.task, composed.resolved, composed.level, settings, progress)
    out.print(funnel_table(summary.funnel, summary.reasons))
    for line in summary_lines(summary):
        out.print(line, highlight=False)
    if summary.certified < settings.n:
        err.print(
            f"scengen: only {summary.certified} of {settings.n} could be certified among {summary.indices} indices; "
            "see the reasons above, or raise limit=",
            style="red",
            highlight=False,
        )
        return FAILED
    return OK

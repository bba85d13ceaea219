"""score and check the episodes of a recording, and keep those that pass or that people accept"""

from collections import Counter

from rich.table import Table

from ...demos.curate.curation import FOLDER, CurateSettings, curate
from ...demos.curate.page import write_page
from ...demos.curate.people import DECISIONS
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from . import OK, Arguments, err, out, remark, say, warn
from .settings import read


def command(arguments: Arguments) -> int:
    settings = read("curate", arguments, CurateSettings)
    with ProgressBar(err, f"curate {settings.data}", 0, settings.workers) as progress_bar:
        curated = curate(settings, progress_bar.of, search_path(arguments))
    folder = curated.recording.folder / FOLDER
    write_page(curated, folder / "index.html")
    table = Table("stage", "episodes", title="curation", title_justify="left")
    for stage, count in curated.funnel.items():
        table.add_row(stage, str(count))
    counts = Counter(f"{one.check} ({one.severity})" for report in curated.reports for one in report.findings)
    if counts:
        table.add_section()
        for name, count in counts.most_common():
            table.add_row(name, str(count), style="dim")
    out.print(table)
    if curated.uncompared:
        remark("pictures were not compared with the replay: no OpenGL, or every replay failed")
    if settings.replay:
        say(f"claimed, and not checked: {', '.join(curated.claimed)}")
    else:
        remark("nothing was replayed: states, results and the table of episodes are claimed")
    people = sum(report.scored_by == "person" for report in curated.reports)
    if people or curated.decisions:
        say(f"{people} scores and {len(curated.decisions)} verdicts are those of people, read from {folder}")
    if undecided := curated.undecided:
        say(
            f"{len(undecided)} flagged episodes wait for a decision: open {folder / 'index.html'}, and save {DECISIONS}"
        )
    if curated.unread:
        warn(f"scengen: {curated.unread} answers of the model follow no schema or name other frames; left out")
    say(f"wrote {folder}: reports.jsonl, kept.json, index.html")
    return OK

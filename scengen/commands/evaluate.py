"""measure the success rate of a policy, in and out of distribution, with intervals"""

from rich.table import Table

from ..evaluate.rollouts import EvaluateSettings, evaluate
from ..evaluate.table import cells, markdown, plain, table
from ..pool import Pool
from ..runs.progress import ProgressBar
from ..task_files import search_path
from . import FAILED, OK, Arguments, err, names, out, say, warn, write, write_json
from .settings import read


def command(arguments: Arguments) -> int:
    settings = read("evaluate", arguments, EvaluateSettings)
    with ProgressBar(err, f"evaluate {settings.policy}", 1, settings.workers) as progress_bar:
        found = evaluate(settings, progress_bar.of, search_path(arguments))
    lines = table(found.episodes)
    title = f"{settings.policy}: success [%], {settings.rules} rules"
    shown = Table("", "split", "ID", "OOD", "difference", title=title, title_justify="left")
    for line in lines:
        shown.add_row(*cells(line))
    out.print(shown)
    write(settings.folder / "table.md", markdown(lines, settings))
    told = {"policy": settings.policy, "rules": settings.rules, "table": plain(lines)}
    write_json(str(settings.folder / "table.json"), told)
    called = names(map(Pool.open, settings.folders), found.lost)
    for scenario, why in found.lost.items():
        warn(f"UNKNOWN {called[scenario]}: {why}; its episodes are left out")
    if found.earlier:
        what = "the pools, the settings and the policy are the same; fresh=true repeats them"
        say(f"{found.earlier} of {len(found.episodes)} episodes are from an earlier run: {what}")
    say(f"wrote {settings.folder}: table.md, table.json, episodes.jsonl")
    return FAILED if found.lost else OK

"""how often a policy succeeds, in and out of distribution, with intervals"""

from rich.table import Table

from ..config import read, typed
from ..evaluate.rollouts import Settings, cells, evaluate, markdown, plain, table
from ..runs.progress import Bar
from . import OK, Arguments, err, out, write, write_json


def command(arguments: Arguments) -> int:
    settings = typed("", Settings, read("evaluate", arguments).settings)
    with Bar(err, f"evaluate {settings.policy}", 1) as bar:
        episodes = evaluate(settings, bar.of)
    lines = table(episodes)
    shown = Table("", "split", "ID", "OOD", "difference", title=f"{settings.policy}: success [%]", title_justify="left")
    for line in lines:
        shown.add_row(*cells(line))
    out.print(shown)
    write(settings.folder / "table.md", markdown(lines, settings))
    write_json(str(settings.folder / "table.json"), {"policy": settings.policy, "table": plain(lines)})
    out.print(f"wrote {settings.folder}: table.md, table.json, episodes.jsonl", highlight=False)
    return OK

"""write witnesses as a LeRobot data set, with proprioception, forces, touch and videos"""

from functools import partial

from .. import config
from ..config import read, search_path, typed
from ..export.recording import Settings, record
from ..runs.progress import Bar
from . import FAILED, INTERRUPTED, OK, Arguments, err, out


def command(arguments: Arguments) -> int:
    settings = typed("", Settings, read("record", arguments).settings)
    with Bar(err, f"record to {settings.to}", 0) as bar:
        try:
            summary = record(settings, partial(config.task, search=search_path(arguments)), bar.of)
        except KeyboardInterrupt:
            err.print("scengen: interrupted; nothing was written", highlight=False)
            return INTERRUPTED
    out.print(
        f"wrote {summary.episodes} episodes, {summary.rows} rows at {settings.fps} a second, "
        f"{len(settings.eyes)} cameras to {settings.to}",
        highlight=False,
    )
    for scenario in summary.failed:
        err.print(f"FAILED {scenario}: the witness does not reach the goal here; its episode has success = false")
    return FAILED if summary.failed else OK

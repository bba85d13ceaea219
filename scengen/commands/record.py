"""write witnesses as a LeRobot data set or for robomimic, with proprioception, forces, touch and pictures"""

from ..config import read, search_path
from ..export.recording import Settings, record
from ..pool import Pool
from ..runs.progress import ProgressBar
from . import FAILED, INTERRUPTED, OK, Arguments, err, names, say, warn


def command(arguments: Arguments) -> int:
    settings = read("record", arguments, Settings)
    with ProgressBar(err, f"record to {settings.to}", 0) as progress_bar:
        try:
            summary = record(settings, progress_bar.of, search_path(arguments))
        except KeyboardInterrupt:
            warn("scengen: interrupted; nothing was written")
            return INTERRUPTED
    say(
        f"wrote {summary.episodes} episodes, {summary.rows} rows at {settings.rate} a second, "
        f"{len(settings.eyes)} cameras to {settings.to}"
    )
    called = names(map(Pool.open, settings.folders)) if summary.failed or summary.lost else {}
    for scenario in summary.failed:
        warn(f"FAILED {called[scenario]}: the witness does not reach the goal here; its episode has success = false")
    for scenario, why in summary.lost.items():
        warn(f"UNKNOWN {called[scenario]}: {why}; it was left out")
    return FAILED if summary.failed or summary.lost else OK

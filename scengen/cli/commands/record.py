"""write witnesses, demonstrations or rollouts as a LeRobot data set or a robomimic file, with forces and pictures"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ...export.recording import RecordSettings, record
from ...export.sources import ROBOMIMIC, open_source, texts_of
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from . import FAILED, INTERRUPTED, OK, Arguments, err, say, warn
from .settings import read


def command(arguments: Arguments) -> int:
    settings = read("record", arguments, RecordSettings)
    parts = _split_up(settings)
    if len(parts) > 1:
        say(f"{len(parts)} recordings, one for each {_kind(settings)}: {', '.join(parts)}")
    statuses = []
    for part in parts.values():
        statuses.append(_record(part, arguments))
        if statuses[-1] == INTERRUPTED:
            break
    return max(statuses)


def _kind(settings: RecordSettings) -> str:
    """Property that all scenarios of a recording share: a data set has one robot, a robomimic file one environment."""
    return "task" if settings.format == ROBOMIMIC else "embodiment"


def _split_up(settings: RecordSettings) -> Mapping[str, RecordSettings]:
    """The recordings to make by the shared property, below `to` if there are multiple."""
    found: dict[str, list[str]] = defaultdict(list)
    for folder in settings.folders:
        for value in texts_of(open_source(folder), _kind(settings), settings.failed) or [""]:
            found[value].append(folder)
    if len(found) > 1:
        found.pop("", None)  # folders without rows
    if len(found) < 2:
        return {settings.to: settings}
    below, suffix = Path(settings.to).with_suffix(""), Path(settings.to).suffix
    return {
        value: replace(settings, pool=folders, to=str(below / f"{value}{suffix}")) for value, folders in found.items()
    }


def _record(settings: RecordSettings, arguments: Arguments) -> int:
    """Make one recording, and print its summary.

    Returns:
        Exit status.
    """
    with ProgressBar(err, f"record to {settings.to}", 0, settings.workers) as progress_bar:
        try:
            summary = record(settings, progress_bar.of, search_path(arguments))
        except KeyboardInterrupt:
            warn(f"scengen: interrupted; nothing was written to {settings.to}")
            return INTERRUPTED
    what = f"{summary.episodes} episodes, {summary.rows} rows at {settings.rate} per second"
    made = f"{what}, {len(settings.camera_names)} cameras"
    say(f"{settings.to} holds this recording already: {made}" if summary.earlier else f"wrote {made} to {settings.to}")
    for scenario in summary.failed:
        warn(f"FAILED {scenario}: its actions do not reach the goal here; its episode has success = false")
    for scenario, why in summary.lost.items():
        warn(f"UNKNOWN {scenario}: {why}; it is left out")
    return FAILED if summary.failed or summary.lost else OK

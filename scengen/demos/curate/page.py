"""Stage 3: a page with the flagged episodes, their findings, plots and pictures, on which a person decides."""

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ...control.loop import ACTION
from ...errors import PoolError
from ...export.dataset import EpisodeData, Recording
from ...pictures import render
from ...pictures.page import template
from ...pictures.plots import svg
from ...pool.files import replace_file
from ...robots.panda import Names
from .curation import Curated
from .findings import EpisodeReport
from .people import VERDICTS, Decision

MAX_CARDS = 200
"""Largest number of episodes with plots on the page; the table lists all."""
STRIP_PICTURES = 6
"""Number of pictures around a finding."""
MARGIN_ROWS = 12
"""Number of rows before and after a finding that its pictures show."""


@dataclass(frozen=True)
class Card:
    """One flagged episode."""

    report: EpisodeReport
    decision: Decision | None
    plot: str
    """Plot as a data address; empty if the rows cannot be plotted."""
    strip: str
    """Pictures around the first finding as a data address; empty without a camera."""


def write_page(curated: Curated, path: Path) -> None:
    """Write the page.

    Raises:
        ScengenError: the recording cannot be read.
    """
    flagged = {report.episode: report for report in curated.reports if report.flagged}
    cards = []
    for episode in curated.recording.read():
        if (report := flagged.get(episode.number)) and len(cards) < MAX_CARDS:
            decision = curated.decisions.get(episode.number)
            cards.append(
                Card(report, decision, plot(episode, report, curated.recording), _strip(episode, report, curated))
            )
    shown = {card.report.episode for card in cards}
    others = [_line(number, told) for number, told in sorted(curated.decisions.items()) if number not in shown]
    text = template("curation.html").render(
        folder=str(curated.recording.folder),
        funnel=curated.funnel,
        cards=cards,
        reports=curated.reports,
        kept=frozenset(curated.kept),
        verdicts=VERDICTS,
        others=others,
    )
    replace_file(path, text.encode())


def _line(number: int, decision: Decision) -> str:
    """A decision as a line of decisions.csv."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="").writerow([number, decision.verdict, decision.who, decision.why])
    return buffer.getvalue()


def plot(episode: EpisodeData, report: EpisodeReport, recording: Recording) -> str:
    """Positions of the hands and actions over time, with the frames of the findings shaded."""
    columns: Mapping[str, np.ndarray] = episode.columns
    places = {name: columns[name] for number in range(2) if (name := f"{Names(number).arm}eef_pos") in columns}
    positions = [name for name, values in places.items() if values.shape[1:] == (3,)]
    if "action" not in columns or columns["action"].ndim != 2 or not positions:
        return ""
    figure = Figure(figsize=(10, 3.6))
    above, below = figure.subplots(2, 1, sharex=True)
    times = np.arange(len(episode)) / recording.fps
    for name in positions:
        above.plot(times, columns[name], label=[f"{name} {axis} [m]" for axis in "xyz"], linewidth=1)
    moves = np.delete(columns["action"], np.arange(ACTION - 1, columns["action"].shape[1], ACTION), axis=1)
    below.plot(times, moves, linewidth=1)
    below.set_ylabel("action")
    below.set_xlabel("time [s]")
    for finding in report.findings:
        if finding.frames:
            for axes in (above, below):
                axes.axvspan(
                    finding.frames[0] / recording.fps, (finding.frames[-1] + 1) / recording.fps, color="r", alpha=0.2
                )
    above.legend(fontsize=7, loc="upper right")
    return svg(figure)


def _strip(episode: EpisodeData, report: EpisodeReport, curated: Curated) -> str:
    """Pictures of the first camera around the first finding that has frames, else of the whole episode."""
    recording = curated.recording
    if not recording.cameras:
        return ""
    first = next((finding.frames for finding in report.findings if finding.frames), (0, len(episode) - 1))
    places = np.linspace(first[0] - MARGIN_ROWS, first[-1] + MARGIN_ROWS, STRIP_PICTURES).round().astype(int)
    wanted = set(np.clip(places, 0, len(episode) - 1).tolist())
    try:
        found = [p for k, p in enumerate(recording.frames(episode, recording.cameras[0])) if k in wanted]
    except PoolError:
        return ""
    return render.address(render.encode(np.hstack([p[::2, ::2] for p in found])), "webp") if found else ""

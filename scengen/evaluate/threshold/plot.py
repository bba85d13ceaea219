"""A plot of the success at each level, and of the interval in which the policy breaks."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from ...pictures.plots import svg_bytes
from ..profile import COLOURS
from .result import ThresholdResult

FILES = {"threshold.svg": False, "threshold_dark.svg": True}
"""Files of the plot, and whether each is for a dark page."""
SIZE = (4.5, 2.8)
"""Width and height of the plot of one policy [inches]."""


def plots(results: Sequence[ThresholdResult], folder: Path) -> dict[Path, bytes]:
    """Content of the files of the plot."""
    return {folder / name: plot(results, dark) for name, dark in FILES.items()}


def plot(results: Sequence[ThresholdResult], dark: bool = False) -> bytes:
    """The plot as SVG, one field for each policy."""
    text, accent, guide = COLOURS[dark]
    figure = Figure((SIZE[0], SIZE[1] * len(results)), layout="constrained")
    fields = figure.subplots(len(results), squeeze=False)
    for field, result in zip(fields[:, 0], results, strict=True):
        low, high = (float(end[0]) for end in (result.estimate.low, result.estimate.high))
        field.axvspan(max(low, -0.5), min(high, result.shift.levels + 0.5), color=accent, alpha=0.15, linewidth=0)
        field.axhline(100 * result.chosen.success, color=guide, linewidth=0.8)
        for level in result.levels:
            if (rate := level.rate) is not None:
                ends = [100 * rate.low, 100 * rate.high]
                field.plot([level.level] * 2, ends, color=accent, linewidth=1.5, solid_capstyle="butt")
                field.plot([level.level], [100 * rate.value], "o", color=accent, markersize=5)
                field.annotate(f"n {rate.rollouts}", (level.level, 104), color=text, fontsize=7, ha="center")
        if result.point is not None:
            field.axvline(result.point, color=accent, linewidth=1.0, linestyle=":")
        field.set_xlim(-0.5, result.shift.levels + 0.5)
        field.set_ylim(-3, 112)
        field.set_xticks(range(result.shift.levels + 1))
        field.set_xlabel(f"level of {result.shift.name}, 0: without a shift", fontsize=8, color=text)
        field.set_ylabel("success [%]", fontsize=8, color=text)
        field.set_title(f"{result.settings.name} on {result.shift.task.name}", fontsize=9, color=text, loc="left")
        field.tick_params(colors=text, labelsize=8, length=0)
        for side in field.spines.values():
            side.set_visible(False)
        field.set_facecolor("none")
    figure.patch.set_alpha(0.0)
    return svg_bytes(figure)

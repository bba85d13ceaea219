"""Plots for HTML pages."""

from io import BytesIO

import matplotlib
from matplotlib.figure import Figure

from .render import address


def svg(figure: Figure) -> str:
    """A plot as a data address for HTML. The same plot always has the same bytes."""
    buffer = BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "scengen"}):  # ids of elements are random otherwise
        figure.savefig(buffer, format="svg", bbox_inches="tight", metadata={"Date": None})
    return address(buffer.getvalue(), "svg+xml")

"""Plots as SVG, for HTML pages and as files."""

from io import BytesIO

import matplotlib
from matplotlib.figure import Figure

from .render import address


def svg(figure: Figure) -> str:
    """A plot as a data address for HTML. The same plot always has the same bytes."""
    return address(svg_bytes(figure), "svg+xml")


def svg_bytes(figure: Figure) -> bytes:
    """Content of an SVG file with a plot. The same plot always has the same bytes."""
    buffer = BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "scengen"}):  # ids of elements are random otherwise
        figure.savefig(buffer, format="svg", bbox_inches="tight", metadata={"Date": None})
    return buffer.getvalue()

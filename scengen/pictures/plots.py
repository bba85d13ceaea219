"""Plots for HTML pages."""

from io import BytesIO

from matplotlib.figure import Figure

from .render import address


def svg(figure: Figure) -> str:
    """A plot as a data address for HTML."""
    buffer = BytesIO()
    figure.savefig(buffer, format="svg", bbox_inches="tight", metadata={"Date": None})
    return address(buffer.getvalue(), "svg+xml")

"""Plots for HTML pages."""

from matplotlib.figure import Figure

from scengen.pictures.plots import svg


def plotted():
    figure = Figure()
    axes = figure.subplots()
    axes.plot([0, 1, 2], [0, 1, 0], marker="o", label="drop")
    axes.fill_between([0, 1], [0, 1], hatch="/")
    axes.legend()
    return svg(figure)


def test_the_same_plot_has_the_same_bytes():
    assert plotted() == plotted()

"""Histograms count every draw once, in bars of equal width or one for each choice."""

import numpy as np
import pytest

from scengen import load_task
from scengen.ood.analysis.histogram import figure, histogram, label

DRAWS = np.random.default_rng(0).uniform(0.0, 1.0, 400)


def test_bars_are_equally_wide_and_hold_every_draw():
    shown = histogram("x", DRAWS, DRAWS < 0.5, DRAWS + 1.0)
    assert not shown.choices and np.ptp(np.diff(shown.edges)) < 1e-12
    assert sum(shown.proposed) == sum(shown.training) == 400 and sum(shown.accepted) == (DRAWS < 0.5).sum()
    half = len(shown.proposed) // 2
    assert sum(shown.proposed[half + 1 :]) == 0 and sum(shown.training[: half - 1]) == 0


def test_choices_have_a_bar_each():
    shown = histogram("heading", np.repeat([0.0, 45.0], 5), np.arange(10) < 3, np.repeat([0.0, 90.0], 10))
    assert shown.choices and shown.edges == (0.0, 45.0, 90.0)
    assert (shown.proposed, shown.accepted, shown.training) == ((5, 5, 0), (3, 0, 0), (10, 0, 10))
    (plot,) = figure((shown,)).axes
    assert [tick.get_text() for tick in plot.get_xticklabels()] == ["0", "45", "90"]
    assert [bar.get_height() for bar in plot.patches[-3:]] == [5.0, 0.0, 5.0], "training, scaled to ten draws"


def test_one_value_is_one_bar():
    shown = histogram("x", np.full(4, 2.0), np.full(4, True), np.full(4, 2.0))
    assert shown.choices and shown.proposed == (4,)


@pytest.mark.parametrize(("name", "told"), [("tile.mass", "tile.mass [kg]"), ("tile.friction", "tile.friction")])
def test_a_label_has_the_unit(name, told):
    assert label(load_task("domino_single"), name) == told

"""Pairs are seen from where an axis shows: what training has parallel to an edge of the table looks parallel."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import REFERENCE, pictures_are_possible

from scengen import load_task
from scengen.ood.analysis.redraw import task_of
from scengen.pictures import sheet
from scengen.pictures.twins import _motion, _projected, comparison_view
from scengen.pictures.views import VIEWS, fitted
from scengen.pool import Pool
from scengen.samplers.split import ID
from scengen.validate.rebuilt import world_of

ASPECT = 4 / 3


def pair(axis, index=0, task="domino_single"):
    """Worlds of a training scenario and of its twin."""
    loaded = load_task(task)
    return [world_of(loaded.draw(split, 0, index).scenario, loaded.embodiment) for split in (ID, axis)]


def slope(world, view):
    """Angle of the chain of tiles in the picture, from the nearest edge of the picture [deg]."""
    tiles = [world.model.body(k).id for k in range(world.model.nbody) if world.model.body(k).name.startswith("tile")]
    ends = _projected(world.data.xpos[[tiles[0], tiles[-1]]], view)
    angle = math.degrees(math.atan2(*np.abs(ends[1] - ends[0])[::-1])) % 90
    return min(angle, 90 - angle)


@pytest.mark.parametrize("index", range(4))
def test_a_chain_of_training_looks_parallel_and_its_diagonal_twin_oblique(index):
    worlds = pair("diagonal", index)
    view = comparison_view(worlds, ASPECT)
    training, here = (slope(world, view) for world in worlds)
    assert training < 12 < 20 < here
    corner = fitted(worlds[0], ASPECT, *VIEWS[0])  # the negative control: the view from the free corner
    assert slope(worlds[0], corner) > slope(worlds[1], corner)


def test_a_motion_is_seen_from_the_side():
    """A height shows from the side, and not from above; what no picture shows is no motion."""
    worlds = pair("low_tiles")
    view = comparison_view(worlds, ASPECT)
    assert _motion(*worlds, view) > 2 * _motion(*worlds, fitted(worlds[0], ASPECT, 180.0, -89.0))
    masses = pair("light_tiles")
    assert _motion(*masses, comparison_view(masses, ASPECT)) == 0.0


@pytest.fixture
def drawn(monkeypatch):
    """The sheet without OpenGL."""
    monkeypatch.setattr(sheet, "thumbnail", lambda *_: "data:,")
    monkeypatch.setattr(sheet, "_strip", lambda *_: "data:,")


def page_of(pool, path, films):
    sheet.contact_sheet([(pool, task_of(pool))], path, 60, films)
    return path.read_text()


def test_films_are_on_every_card_or_on_none(drawn, tmp_path):
    pool = Pool.open(REFERENCE)
    assert page_of(pool, tmp_path / "with.html", True).count('class="film"') == len(pool)
    assert page_of(pool, tmp_path / "without.html", False).count('class="film"') == 0


def test_equal_checks_are_one_line_and_other_ones_stand_on_their_card(drawn, tmp_path, monkeypatch):
    pool = Pool.open(REFERENCE)
    count = len(pool.at(0).certificate.checks)
    text = page_of(pool, tmp_path / "equal.html", False)
    assert text.count('class="badge') == count and "Checks of every scenario" in text

    rows = [*pool.rows()]
    checks = rows[2].certificate.checks
    failed = (replace(checks[0], passed=False), *checks[1:])
    rows[2] = replace(rows[2], certificate=replace(rows[2].certificate, checks=failed))
    changed = Pool.open(REFERENCE)
    monkeypatch.setattr(type(changed), "rows", lambda self: iter(rows))
    text = page_of(changed, tmp_path / "other.html", False)
    assert text.count('class="badge') == 2 * count and text.count('class="badge failed"') == 1


def test_both_pictures_of_a_pair_have_one_camera(tmp_path):
    if not pictures_are_possible():
        pytest.skip("no OpenGL")
    from scengen.pictures.twins import twin_pictures

    first, second = pair("light_tiles")
    one, other = twin_pictures(first, second, size=(160, 120), view=comparison_view([first, second], ASPECT))
    assert one.shape == (120, 160, 3) and np.array_equal(one, other)  # only masses differ

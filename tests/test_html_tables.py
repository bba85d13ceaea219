"""Tables of notebooks: what they show is escaped, and long ones are abridged."""

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from helpers import REFERENCE, pictures_are_possible

import scengen
from scengen import html_tables
from scengen.certificate import Certificate, Check
from scengen.pictures import film
from scengen.validate.certify import Certified
from scengen.validate.rollout import Rollout

HOSTILE = "<img src=x onerror=alert(1)>&\"'"
ACTIONS = np.zeros((3, 7), np.float32)


def is_harmless(page):
    """Whether the only elements are those of a table, with no attribute but a style."""
    tags = re.findall(r"<[^>]*>", page)
    return all(re.fullmatch(r'</?(div|p|b|table|tr|th|td)( style="[a-z0-9:;. -]*")?>', tag) for tag in tags)


@pytest.fixture(scope="module")
def draw():
    return scengen.load_task("domino_single").draw("wide_gaps", seed=0, index=7)


def test_a_draw_shows_what_the_axis_changed_first(draw):
    page = draw._repr_html_()
    first, *others = re.findall(r"<tr>(?:<td[^>]*>([^<]*)</td>){4}</tr>", page)
    assert first == "yes" and set(others) == {"no"} and "gap_ratio" in page and is_harmless(page)
    assert f"training twin {draw.id_twin}" in page and draw.scenario.id in page


def test_texts_of_strangers_are_escaped(draw, tmp_path):
    check = Check("solved", False, HOSTILE, {}, {"outcome": HOSTILE, HOSTILE: 1.0, "left_out": [1]})
    shown = [
        replace(draw, task=HOSTILE, id_twin=HOSTILE),
        Certified(Certificate("quick", (check,)), HOSTILE, ACTIONS, HOSTILE),
        Rollout("failure", HOSTILE, 1.0, ACTIONS, HOSTILE, HOSTILE),
        scengen.Pool.open(shutil.copytree(REFERENCE, tmp_path / HOSTILE.replace("/", ""))),
    ]
    for each in shown:
        page = each._repr_html_()
        assert is_harmless(page) and "&lt;img" in page, page


def test_a_certificate_tells_passed_failed_and_not_checked():
    results = {"feasible": True, "solved": False, "witness": None}
    checks = tuple(Check(name, passed, "why", {}, {"depth": 0.00012345}) for name, passed in results.items())
    page = Certified(Certificate("quick", checks), "", ACTIONS, "")._repr_html_()
    told = re.findall(r">(\w+)</td><td[^>]*>(passed|failed|not checked)<", page)
    assert told == [("feasible", "passed"), ("solved", "failed"), ("witness", "not checked")]
    assert "unknown, witness" in page
    assert "depth = 0.0001234" in page and "of 3 actions" in page


def test_a_pool_shows_its_scenarios():
    pool = scengen.Pool.open(REFERENCE)
    page = pool._repr_html_()
    assert all(name.id in page for name in pool.names()) and f"{len(pool)} certified scenarios" in page


def test_of_a_long_table_only_what_is_shown_is_read():
    read = []
    rows = ((read.append(number) or number,) for number in range(1_000_000))
    page = html_tables.table("numbers", ("n",), rows, 1_000_000)
    assert len(read) == html_tables.MAX_ROWS and f"and {1_000_000 - html_tables.MAX_ROWS} more" in page


def test_a_long_text_is_cut():
    assert len(html_tables.table("x" * 10_000, ("y" * 10_000,), [("z" * 10_000,)])) < 1000


def test_a_film_in_a_notebook_is_a_picture_that_moves():
    if not pictures_are_possible():
        pytest.skip("no OpenGL on this machine")
    import io

    from PIL import Image

    row = scengen.Pool.open(REFERENCE).at(0)
    take = film.Take.witness(row, scengen.load_task(row.task).scenario(row.params))
    short = replace(take, actions=take.actions[:60])
    shown = film.inline(short, fps=10, width=64, height=48)
    with Image.open(io.BytesIO(shown.content)) as picture:
        picture.load()
        assert (picture.n_frames, picture.size) == (7, (64, 48)) and picture.info["duration"] == 100
    assert shown._repr_html_().startswith('<img src="data:image/webp;base64,')

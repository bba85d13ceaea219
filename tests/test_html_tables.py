"""Tables of notebooks: what they show is escaped, and long ones are abridged."""

import importlib.metadata
import re
import shutil
import sys
from dataclasses import replace

import numpy as np
import pytest
from helpers import REFERENCE, pictures_are_possible

import scengen
from scengen import html_tables
from scengen.certificate import Certificate, Check
from scengen.errors import BadConfig
from scengen.look.looks import ROOM
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


def test_the_version_is_that_of_the_package():
    assert scengen.__version__ == importlib.metadata.version("scengen") and "__version__" in dir(scengen)


def test_objects_are_one_short_line(draw):
    pool, task = scengen.Pool.open(REFERENCE), scengen.load_task("domino_single")
    row = pool.row("8ed4")
    checks = tuple(Check(name, passed, "", {}, {}) for name, passed in (("feasible", True), ("solved", None)))
    certified = Certified(Certificate("quick", checks), "", ACTIONS, "")
    for each, expected in (
        (pool, f"Pool({str(REFERENCE)!r}: {len(pool)} of domino_single/id)"),
        (row, "PoolRow(domino_single/id@0/8ed4a4577fe0)"),
        (task, f"Task(domino_single version {task.version}: {len(task.axes)} axes)"),
        (draw, f"Draw(domino_single/wide_gaps@7/{draw.scenario.id}: gap_ratio = 1.342)"),
        (certified.certificate, "Certificate(unknown: 1 of 1 checks passed)"),
        (certified, "Certified(unknown: 1 of 1 checks passed, witness of 3 actions)"),
        (Rollout("failure", "why", 1.5, ACTIONS, ""), "Rollout(failure: why, 1.50 s, 3 actions)"),
        (scengen.World.load(row.scene_xml), "World(30 bodies, 1 arm, time 0.00 s)"),
    ):
        assert repr(each) == expected


def test_a_row_shows_its_parameters():
    page = scengen.Pool.open(REFERENCE).row("8ed4")._repr_html_()
    assert is_harmless(page) and "domino_single/id@0/8ed4a4577fe0" in page and ">gap_ratio<" in page


def test_a_pool_is_a_table_with_each_parameter_in_a_column():
    pool = scengen.Pool.open(REFERENCE)
    rows = pool.to_arrow().to_pylist()
    for row, stored in zip(rows, pool.rows(), strict=True):
        assert row["id"] == stored.id and row["index"] == stored.index
        assert {name: row[name] for name in stored.params} == stored.params
        assert not {"params", "scene_xml", "witness", "certificate"} & set(row)


def test_a_parameter_with_the_name_of_a_column_is_kept_apart(monkeypatch):
    pool = scengen.Pool.open(REFERENCE)
    rows = [(*values, {"index": 0.5}) for *values, _ in pool.columns("index", "params")]
    monkeypatch.setattr(type(pool), "columns", lambda self, *names: ((0,) * (len(names) - 1) + row[1:] for row in rows))
    assert pool.to_arrow().column("params.index").to_pylist() == [0.5] * len(pool)


def test_pandas_gets_the_same_table(monkeypatch):
    pandas = pytest.importorskip("pandas", reason="no pandas; it is in the extra dev")
    pool = scengen.Pool.open(REFERENCE)
    frame = pool.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame.drop(columns="axes").to_dict("list") == pool.to_arrow().drop_columns("axes").to_pydict()
    assert len(pandas.read_parquet(REFERENCE, ignore_prefixes=["manifest", "scengen", "reject"])) == len(pool)


def test_without_pandas_the_remedy_is_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(BadConfig, match="pip install pandas, or use to_arrow"):
        scengen.Pool.open(REFERENCE).to_pandas()


def test_pictures_of_draws_rows_and_worlds(draw):
    if not pictures_are_possible():
        pytest.skip("no OpenGL on this machine")
    row = scengen.Pool.open(REFERENCE).row("8ed4")
    world = scengen.World.load(row.scene_xml, look=ROOM)
    of_row, of_world, of_draw = (np.array(scengen.picture(each, "agentview", 64, 48)) for each in (row, world, draw))
    assert of_row.shape == (48, 64, 3) and np.array_equal(of_row, of_world) and not np.array_equal(of_row, of_draw)


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


def test_a_certificate_tells_passed_failed_and_skipped_in_words():
    results = {"overlap": True, "solved": False, "witness": None}
    checks = tuple(
        Check(name, passed, "" if passed else "why", {}, {"deepest": 0.00012345}) for name, passed in results.items()
    )
    page = Certified(Certificate("quick", checks), "", ACTIONS, "")._repr_html_()
    told = re.findall(r">(\w+)</td><td[^>]*>(yes|NO|skipped)</td><td[^>]*>([^<]*)<", page)
    assert told == [
        ("overlap", "yes", "deepest contact 0.123 mm"),
        ("solved", "NO", "why"),
        ("witness", "skipped", "why"),
    ]
    assert "unknown, witness of 3 actions" in page


def test_the_jittered_runs_of_a_certificate_are_counted():
    numbers = {"solved": 4, "runs": 4, "bound": 0.472870804501588, "failures": []}
    checks = (Check("robust", True, "", {}, numbers),)
    page = Certified(Certificate("quick", checks), "", ACTIONS, "")._repr_html_()
    assert "4 of 4 jittered runs succeed: at least 47% of all, with 95 % confidence" in page and "0.4728" not in page


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

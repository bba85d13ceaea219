"""A folder of pools stands for them, in every command that takes several; its index is data from anybody."""

import json
import xml.etree.ElementTree as ET

import pytest
from helpers import REFERENCE
from pools import make

from scengen import cli, compose, list_tasks, load_task
from scengen.envs.pools import rows_of
from scengen.errors import PoolError
from scengen.pool import Pool, collection
from scengen.samplers import task_files


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two pools of one task, and an index."""
    folder = tmp_path_factory.mktemp("collection")
    pools = [make(folder / split, split=split, n=1).pool for split in ("id", "diagonal")]
    for pool in pools:
        collection.write_index(folder, [pool])  # as a run over several does it
    return folder


def told(capsys, *argv):
    """Exit status, what was said, and what went wrong."""
    status = cli.run(argv)
    return status, *capsys.readouterr()


def test_it_stands_for_its_pools(folder):
    assert collection.members(folder) == [str(folder / "diagonal"), str(folder / "id")]
    assert collection.members(folder / "id") == [str(folder / "id")]
    assert collection.folders([str(folder), str(REFERENCE)])[-1] == str(REFERENCE)
    assert {row.split for row in rows_of(folder, "domino_single")} == {"id", "diagonal"}
    with pytest.raises(PoolError, match="holds no pool of packing"):
        rows_of(folder, "packing")


def test_verify_checks_them_all(folder, capsys, tmp_path):
    files = {kind: tmp_path / f"found.{kind}" for kind in ("json", "junit")}
    asked = (f"{key}={path}" for key, path in files.items())
    status, out, _ = told(capsys, "verify", f"pool={folder}", "level=replay", *asked)
    assert status == 0
    assert "2 pools: 2 sound, 0 refuted, 0 declined" in out
    assert {name.rpartition("/")[2] for name in json.loads(files["json"].read_text())} == {"id", "diagonal"}
    assert len(ET.fromstring(files["junit"].read_text()).findall("testsuite")) == 2


def test_a_scenario_is_found_in_whichever_pool_it_is(folder, capsys):
    (name,) = Pool.open(folder / "diagonal").names()
    status, out, _ = told(capsys, "show", f"pool={folder}", f"id={name}")
    assert status == 0
    assert str(name) in out
    status, _, err = told(capsys, "report", "audit", f"pool={folder}")
    assert status == 2
    assert "this command accepts one pool" in err


def test_a_pool_that_is_not_the_one_of_the_index_is_refused(folder, tmp_path, capsys):
    index = json.loads((folder / collection.INDEX).read_text())
    changed = tmp_path / "other"
    changed.mkdir()
    for name in index["pools"]:
        (changed / name).symlink_to(folder / name)
    index["pools"]["id"]["sha256"] = "0" * 64
    (changed / collection.INDEX).write_text(json.dumps(index))
    with pytest.raises(PoolError, match="id has a different hash than"):
        collection.members(changed)


@pytest.mark.parametrize(
    "text",
    ["{", "[]", '{"format": 2}', '{"format": 1, "pools": {}}', '{"format": 1, "pools": []}']
    + [json.dumps({"format": 1, "pools": {name: {"sha256": "0"}}}) for name in ("../id", "/etc", "a/b", "", ".", "..")],
)
def test_a_strange_index_is_one_clear_line(text, tmp_path):
    (tmp_path / collection.INDEX).write_text(text)
    with pytest.raises(PoolError, match="is damaged"):
        collection.members(tmp_path)


def test_all_tasks_or_a_category_are_a_sweep():
    every = [one.swept["task"] for one in compose.combinations("generate", ["task=all", "n=1"])]
    assert every == list_tasks()
    named = [one.swept["task"] for one in compose.combinations("generate", ["task=P4,packing,tool_retrieve"])]
    assert named == [*sorted(t for t in list_tasks() if task_files.category(t) == "P4"), "packing"]


def test_the_tasks_stand_by_category(capsys):
    _, out, _ = told(capsys, "tasks")
    codes = [word for line in out.splitlines() for word in line.split() if word[:1] in "TMX" and word[1:].isdigit()]
    categories = {load_task(name).code: task_files.category(name) for name in list_tasks()}
    order = [categories[code] for code in codes]
    assert order == sorted(order, key=lambda c: (c[:1] != "P", c))
    assert len(codes) == len(categories)


def test_the_axes_of_the_paper_are_told_with_their_proofs(capsys):
    _, out, _ = told(capsys, "tasks", "axes=paper")
    for name in ("diagonal", "mirrored_hook", "two_slips", "plane_45", "stacked_lids", "opposite_side", "turned"):
        assert name in out
    assert "wide_gaps" not in out

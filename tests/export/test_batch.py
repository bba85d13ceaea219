"""Worlds for other simulators hold everything that C MuJoCo needs for the bits of the scenarios."""

from dataclasses import replace
from itertools import chain
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.control.impairment import Impairment
from scengen.errors import BadConfig, PoolError
from scengen.export import batch
from scengen.pool import Pool
from scengen.sim.world import World
from scengen.validate.impaired import impaired

BASE = Path(__file__).parents[1] / "checker" / "base"
MIRROR = BASE / "mirror_id"


def exported(to, *given, pool=REFERENCE):
    return cli.run(["export", f"pool={pool}", f"to={to}", "format=batch", *given])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("batch") / "worlds"
    assert exported(folder, "layout=1") == 0
    return folder


@pytest.fixture(scope="module")
def worlds(made):
    return np.load(made / batch.WORLDS)


def after(world, actions):
    for action in actions:
        world.step_filtered(action)
    return world.digest


def test_c_mujoco_simulates_the_bits_of_every_scenario(made, worlds):
    assert len(worlds["id"]) > 1, "the second world differs from the scene of the file"
    for number, name in enumerate(worlds["id"]):
        row = Pool.open(REFERENCE).row(str(name))
        model, data = batch.opened(made, number)
        usual = World.load(row.scene_xml)
        assert np.array_equal(data.qpos, usual.data.qpos) and np.array_equal(data.ctrl, usual.data.ctrl)
        assert after(World.of(model), row.witness) == after(usual, row.witness)


def test_without_the_fields_the_bits_are_others(made, worlds):
    row = Pool.open(REFERENCE).row(str(worlds["id"][1]))
    bare = mujoco.MjModel.from_xml_path(str(made / batch.SCENE))
    assert after(World.of(bare), row.witness[:1]) != after(World.load(row.scene_xml), row.witness[:1])


@pytest.mark.parametrize("name", ["ycb_id", "shelf_id", "box_by_cup_id", "typing_id"])
def test_scenes_with_meshes_marks_two_arms_and_suction_keep_their_bits(name, tmp_path):
    """Suction, a scripted partner, mocap bodies, user data, meshes, and trees of boxes that differ."""
    row = next(Pool.open(BASE / name).rows())
    assert exported(tmp_path / "worlds", pool=BASE / name) == 0
    model, data = batch.opened(tmp_path / "worlds", 0)
    usual = World.load(row.scene_xml, row.embodiment)
    for kind in batch.STATE:
        assert np.array_equal(getattr(data, kind), getattr(usual.data, kind)), kind
    actions = row.witness[:5]
    assert after(World.of(model, usual.scripted), actions) == after(usual, actions)


def test_the_files_say_which_scenarios_they_hold_and_that_no_certificate_holds(made, worlds):
    rows = [Pool.open(REFERENCE).row(str(name)) for name in worlds["id"]]
    assert worlds["instruction"].tolist() == [row.instruction for row in rows]
    assert worlds["split"].tolist() == [row.split for row in rows]
    text = (made / batch.SCENE).read_text()
    assert batch.NOTE in text and str(worlds["about"]) == batch.NOTE
    assert str(made) not in text and 'multiccd="disable"' in text
    assert {key.partition(".")[0] for key in worlds.files} == {
        *("about", "mujoco", "id", "split", "instruction"),
        *("model", "c", "state"),
    }


def test_the_same_scenarios_give_the_same_bytes(made, tmp_path, capsys):
    assert exported(tmp_path / "again", "layout=1") == 0
    assert exported(tmp_path / "again", "layout=1") == 0
    assert "holds these 2 worlds of 27 bodies already" in capsys.readouterr().out
    for path in (path for path in made.rglob("*") if path.is_file()):
        assert (tmp_path / "again" / path.relative_to(made)).read_bytes() == path.read_bytes()


def test_splits_of_a_task_share_a_batch(tmp_path):
    both = f"{REFERENCE},{BASE / 'single_severity'}"
    layouts = [batch.BatchWorld.of(row) for pool in both.split(",") for row in Pool.open(pool).rows()]
    (layout,) = {world.layout for world in layouts if world.row.split != "id"}
    mates = [world.row.id for world in layouts if world.layout == layout]
    numbers = range(1, 1 + len({world.layout for world in layouts}))
    for number in numbers:
        assert exported(tmp_path / str(number), f"layout={number}", pool=both) == 0
    found = [np.load(tmp_path / str(number) / batch.WORLDS)["id"].tolist() for number in numbers]
    assert mates in found and sorted(chain(*found)) == sorted(world.row.id for world in layouts)
    assert [len(ids) for ids in found] == sorted(map(len, found), reverse=True)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ([], "the scenarios have 4 layouts; give layout=1 (27 bodies, n = 2), layout=2"),
        (["layout=9"], "layout = 9; give layout=1 (27 bodies, n = 2)"),
        (["layout=1", "robot=false"], "with format=batch the robot is in the scene"),
        (["format=mjb"], "no format named 'mjb'"),
        (["layout=2", "format=mjcf"], "layout = 2; only format=batch has layouts; leave it out"),
        ([f"pool={REFERENCE},{MIRROR}"], "one task, and the pools have domino_single, mirror_pick_place"),
        (["layout=1", f"to={REFERENCE}"], "is not empty: it holds manifest.json; delete it"),
    ],
)
def test_bad_input_is_one_line(given, why, tmp_path, capsys):
    assert exported(tmp_path / "to", *given) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith("scengen: ") and why in said
    assert not (tmp_path / "to").exists()


def test_conditions_of_control_are_refused():
    row = next(Pool.open(REFERENCE).rows())
    late = replace(row, scene_xml=impaired(row.scene_xml, Impairment(delay=3.0), row.embodiment))
    with pytest.raises(BadConfig, match="has conditions of control: .* give pools without impairments"):
        batch.BatchWorld.of(late)


def test_worlds_of_another_mujoco_are_refused(made, tmp_path):
    folder = tmp_path / "worlds"
    made_elsewhere = dict(np.load(made / batch.WORLDS)) | {"mujoco": np.array("9.9.9")}
    folder.mkdir()
    np.savez(folder / batch.WORLDS, **made_elsewhere)
    with pytest.raises(PoolError, match=r"was exported with MuJoCo 9\.9\.9"):
        batch.opened(folder, 0)


def test_a_scene_that_mjcf_changes_is_refused(tmp_path):
    world = batch.BatchWorld.of(next(Pool.open(REFERENCE).rows()))
    with pytest.raises(PoolError, match="changes when MuJoCo writes it as MJCF"):
        batch.write_batch([replace(world, layout="another")], tmp_path / "to")
    assert not (tmp_path / "to").exists()

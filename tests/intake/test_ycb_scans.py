"""Scans in place of proxies: turned as those lie, told by the pool, which stands alone without their files."""

import json
import math

import numpy as np
import pytest
import trimesh

from scengen import cli, load_task
from scengen.assets.mesh_prop import MeshProp
from scengen.assets.ycb import ITEMS, Ycb
from scengen.errors import BadConfig
from scengen.intake.ycb import with_scans
from scengen.params import values
from scengen.samplers.task import load

SUGAR, CAN = ITEMS[2], ITEMS[3]
ASKEW = 0.3
ONE = "task.id.thing.item=2"


def place(folder, item, mesh):
    target = folder / item.folder / "textured.obj"
    target.parent.mkdir(parents=True)
    mesh.export(target)


def sugar_box(size=(0.045, 0.092, 0.176), askew=ASKEW):
    """A box that stands beside the origin, askew, as scans do."""
    mesh = trimesh.creation.box(size)
    mesh.apply_translation([0.02, -0.03, size[2] / 2])
    mesh.apply_transform(trimesh.transformations.rotation_matrix(askew, [0, 0, 1]))
    return mesh


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def folder(tmp_path):
    place(tmp_path / "ycb", SUGAR, sugar_box())
    return tmp_path / "ycb"


def task(name="pick_place_ycb"):
    return load_task(name, [ONE])


@pytest.mark.parametrize("askew", [ASKEW, math.pi / 2 - ASKEW, 3.0])
def test_a_scan_is_turned_as_its_proxy_lies(tmp_path, askew):
    place(tmp_path, SUGAR, sugar_box(askew=askew))
    thing = with_scans(task(), "id", str(tmp_path)).nominal.thing
    proxy, corners = Ycb(item=2, low=1), np.vstack(thing.scan.prop.corners)
    assert np.ptp(corners, axis=0) == pytest.approx([0.045, 0.176, 0.092], abs=1e-4)
    assert np.ptp(corners, axis=0) == pytest.approx(proxy.prop.size, abs=1e-3)
    model = thing.spec().compile()
    assert model.body_mass.sum() == pytest.approx(proxy.mass)
    assert thing.scan.prop.com[2] == pytest.approx(0.046, abs=3e-4)  # on feet
    assert np.sort(np.diag(thing.scan.prop.inertia)) == pytest.approx(
        proxy.mass / 12 * np.array([0.045**2 + 0.092**2, 0.045**2 + 0.176**2, 0.092**2 + 0.176**2]), rel=1e-3
    )


def test_a_draw_differs_in_its_id_alone_and_follows_from_what_a_manifest_holds(folder):
    proxies, scans = task(), with_scans(task(), "id", str(folder))
    stored = load(scans.name, json.loads(json.dumps(scans.node)))
    one, other, again = (t.draw("id", 0, 1).scenario for t in (proxies, scans, stored))
    assert values(one) == values(other) and one.id != other.id and again.id == other.id
    texts = [scenario.build().to_xml() for scenario in (one, other, again)]
    assert texts[1] == texts[2] != texts[0]
    assert "scanned" not in one.features() and other.features()["scanned"] == 1.0


def test_another_scan_is_another_scenario(folder, tmp_path):
    place(tmp_path / "other", SUGAR, sugar_box((0.045, 0.092, 0.170)))
    tasks = [with_scans(task(), "id", str(place)) for place in (folder, tmp_path / "other")]
    assert len({t.draw("id", 0, 1).scenario.id for t in tasks}) == 2


@pytest.mark.slow
def test_a_pool_with_scans_is_attacked_as_it_is(folder, tmp_path, capsys):
    pool, found = tmp_path / "pool", tmp_path / "found"
    made = ["generate", "task=pick_place_ycb", ONE, "n=1", "limit=12", "attack=8", f"ycb={folder}", f"pool={pool}"]
    assert cli.run(made) == 0
    assert cli.run(["verify", f"pool={pool}", "level=replay"]) == 0, "the hits that it tells of are replayed with scans"
    assert cli.run(["attack", f"pool={pool}", "budget=12", f"to={found}"]) == 0
    assert list(found.glob("*.npz")), "a perturbed witness still reaches the goal"
    capsys.readouterr()
    assert cli.run(["verify", f"hits={found}", f"pool={pool}"]) == 0
    assert cli.run(["verify", f"hits={found}"]) == 1
    assert "one of a pool with scans needs pool=FOLDER too" in capsys.readouterr().out
    assert cli.run(["show", "film", f"hit={next(found.glob('*.npz'))}", f"to={tmp_path / 'film.png'}"]) == 2
    assert "one of a pool with scans needs pool=FOLDER too" in capsys.readouterr().err


def test_what_a_split_draws_needs_a_scan_too(folder):
    with pytest.raises(BadConfig, match="no folder 008_pudding_box .*; known: 004_sugar_box"):
        with_scans(task(), "unseen_item", str(folder))


@pytest.mark.slow
def test_a_pool_with_scans_stands_alone(folder, tmp_path, capsys):
    pool = str(tmp_path / "pool")
    made = ["generate", "task=pick_place_ycb", ONE, "n=1", "limit=12", f"ycb={folder}", f"pool={pool}"]
    assert cli.run(made) == 0
    capsys.readouterr()
    assert cli.run(["verify", f"pool={pool}"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "the pool holds 1 solids of scans (004_sugar_box/low)" in told and "give ycb=FOLDER" in told
    assert cli.run(["verify", f"pool={pool}", f"ycb={folder}", "level=replay"]) == 0
    place(tmp_path / "other", SUGAR, sugar_box((0.045, 0.092, 0.170)))
    assert cli.run(["verify", f"pool={pool}", f"ycb={tmp_path / 'other'}", "level=replay"]) == 1
    assert "was made of another file" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["task=pick_place_ycb"], "no folder 005_tomato_soup_can"),
        (["task=domino_single"], "task domino_single has no YCB object; name a task that has one, or leave ycb= out"),
        (["task=pick_place_ycb", ONE, "ycb=nowhere"], "ycb = nowhere is not a folder"),
    ],
)
def test_what_is_not_there_is_said_in_one_line(folder, arguments, says, capsys):
    given = arguments if any("ycb=n" in each for each in arguments) else [*arguments, f"ycb={folder}"]
    assert cli.run(["generate", *given, "n=1"]) == 2
    told = capsys.readouterr().err
    assert says in " ".join(told.split()) and "Traceback" not in told


def test_a_forged_solid_is_refused(folder):
    node = with_scans(task(), "id", str(folder)).node
    solid = node["scans"]["004_sugar_box/low"]["solid"]
    assert MeshProp.read(solid).written() == solid
    for name, value in (
        ("mass", "heavy"),
        ("mass", float("nan")),
        ("com", [0.0, 0.0]),
        ("faces", [[0, 1, 999_999]]),
        ("corners", []),
        ("vertices", [[0.0, 0.0, float("inf")]]),
        ("more", 1),
    ):
        scan = {**node["scans"]["004_sugar_box/low"], "solid": {**solid, name: value}}
        with pytest.raises(BadConfig, match="is not a solid"):
            load("pick_place_ycb", {**node, "scans": {"004_sugar_box/low": scan}})
    with pytest.raises(BadConfig, match="has no YCB object"):
        load("domino_single", {**load_task("domino_single").node, "scans": node["scans"]})

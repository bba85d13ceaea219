"""Proxies of the YCB set: as large and heavy as the things, at rest in every pose, and graspable where they say."""

import math

import mujoco
import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

from scengen.assets.package import Bottle, Can, Carton, Tin
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.ycb import ITEMS, Banana, Item, Ycb, mesh_of
from scengen.errors import BadConfig
from scengen.export.mesh import united
from scengen.geometry import quat
from scengen.robots.jaw import OPEN_GAP

NAMES = [item.folder for item in ITEMS]
ALL = pytest.mark.parametrize("index", range(len(ITEMS)), ids=NAMES)
EXTENTS = {
    2: (102.4, 102.4, 140.2),
    3: (71.7, 163.6, 213.8),
    4: (45.2, 92.1, 176.2),
    5: (67.8, 67.8, 101.9),
    6: (57.7, 95.8, 191.4),
    7: (85.0, 85.0, 33.0),
    8: (38.3, 89.7, 113.0),
    9: (28.0, 73.0, 85.0),
    10: (52.0, 97.0, 83.5),
    11: (69.2, 197.6, 36.5),
    24: (160.4, 161.0, 55.0),
    25: (82.0, 110.0, 81.3),
    29: (259.9, 260.0, 26.0),
    36: (85.0, 85.0, 200.0),
    56: (64.7, 64.7, 64.7),
    61: (50.0, 75.0, 50.0),
}
"""Of the scans in their tightest upright box, or of the object list [mm]."""
MASSES = (414, 411, 514, 349, 603, 171, 187, 97, 370, 66, 147, 118, 279, 729, 58, 28)
"""Of the object list [g]."""


def settled(prop, turn=(1.0, 0.0, 0.0, 0.0), height=0.0):
    """How far a prop goes [m] and turns [rad] in 2 s, after 3 s to come to rest."""
    scene = table()
    place(scene, prop, "thing", [0.013, 0.017, TABLE_TOP + height])
    model = scene.compile()
    data = mujoco.MjData(model)
    data.qpos[3:7] = turn
    mujoco.mj_step(model, data, 1500)
    before = data.qpos.copy()
    mujoco.mj_step(model, data, 1000)
    return np.linalg.norm(data.qpos[:3] - before[:3]), 2 * math.acos(min(1.0, abs(before[3:7] @ data.qpos[3:7])))


@ALL
def test_it_stands_still_on_a_table(index):
    drift, turn = settled(Ycb(item=index))
    assert drift < 1e-5 and turn < 1e-4


@pytest.mark.parametrize("index", [i for i, item in enumerate(ITEMS) if isinstance(item.prop, Can | Carton | Tin)])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_boxes_and_cans_also_lie_still_on_their_sides_and_stand_on_their_heads(index, axis):
    """A certificate allows 1 mm and 0.5 deg; a can that lies creeps by 0.07 mm."""
    item = ITEMS[index].prop
    across = item.radius if isinstance(item, Can) else (item.width if axis == "x" else item.length) / 2
    for angle, height in ((math.pi / 2, across), (math.pi, item.height)):
        drift, turn = settled(Ycb(item=index), quat(axis, angle), height + 0.0005)
        assert drift < 2e-4 and turn < math.radians(0.25)


@pytest.mark.parametrize("index", [i for i, item in enumerate(ITEMS) if isinstance(item.prop, Carton | Tin)])
def test_laid_low_it_is_the_same_thing_no_higher_and_as_narrow(index):
    upright, low = Ycb(item=index), Ycb(item=index, low=1)
    (x, y, z), (a, b, c) = (np.ptp(np.reshape(united(ycb).bounding_box(), (2, 3)), axis=0) for ycb in (upright, low))
    assert (a, *sorted((b, c))) == pytest.approx((x, *sorted((y, z))), abs=2e-4) and c <= min(y, z) + 2e-4
    inertias = [np.sort(ycb.spec().compile().body("body").inertia) for ycb in (upright, low)]
    np.testing.assert_allclose(*inertias)
    drift, turn = settled(low)
    assert drift < 1e-5 and turn < 1e-4


@ALL
def test_it_weighs_what_the_list_says_and_is_as_large_as_the_thing(index):
    model = Ycb(item=index).spec().compile()
    assert model.body("body").mass[0] == pytest.approx(MASSES[index] / 1000)
    low, high = np.split(np.array(united(Ycb(item=index)).bounding_box()), 2)
    assert 1000 * np.sort(high - low)[::-1] == pytest.approx(
        sorted(EXTENTS[ITEMS[index].number])[::-1], rel=0.04, abs=1.0
    )
    assert low[2] == pytest.approx(0.0, abs=3e-5)


@ALL
def test_a_jaw_spans_it_where_it_says(index):
    """Two plates at the stated width on either side touch nothing, at 2 mm less they do; wider than the jaw: None."""
    item = ITEMS[index]
    low, high = np.split(np.array(united(item.prop).bounding_box()), 2)
    least = float((high - low)[:2].min())
    if item.width is None:
        assert least > OPEN_GAP
    elif item.name not in ("banana", "mug"):  # a jaw takes the one across its arc, the other by its handle
        assert item.width == pytest.approx(least, abs=2e-4) and item.width < OPEN_GAP


@pytest.mark.parametrize("index", [i for i, item in enumerate(ITEMS) if isinstance(item.prop, Can | Carton | Tin)])
def test_full_things_have_the_inertia_of_their_solid(index):
    prop = ITEMS[index].prop
    match prop:
        case Can():
            body = Manifold.cylinder(prop.height, prop.radius, circular_segments=720)
        case Carton():
            body = Manifold.cube(tuple(prop.size))
        case Tin():
            x, y, r = prop.length / 2 - prop.corner, prop.width / 2 - prop.corner, prop.corner
            pole = Manifold.cylinder(prop.height, r, circular_segments=720)
            body = Manifold.batch_hull([pole.translate((a * x, b * y, 0)) for a in (-1, 1) for b in (-1, 1)])
    mesh = body.to_mesh64()
    solid = trimesh.Trimesh(np.asarray(mesh.vert_properties), np.asarray(mesh.tri_verts))
    solid.density = prop.mass / solid.volume
    model = Ycb(item=index).spec().compile()
    expected = np.linalg.eigvalsh(solid.moment_inertia)
    assert np.sort(model.body("body").inertia) == pytest.approx(expected, rel=0.01)


def test_a_can_rolls_on_and_is_braked_by_its_rolling_resistance():
    """Deceleration 2/3 crr g for a full cylinder: from 0.3 m/s it stops after v^2 / (4/3 crr g)."""
    can = Can(rolling=0.02)
    scene = table()
    place(scene, can, "can", [-0.3, 0, TABLE_TOP + can.radius])
    model = scene.compile()
    data = mujoco.MjData(model)
    data.qpos[:7] = -0.3, -can.height / 2, TABLE_TOP + can.radius, math.sqrt(0.5), -math.sqrt(0.5), 0, 0
    data.qvel[0] = 0.3
    data.qvel[3:6] = [0, 0, 0.3 / can.radius]
    mujoco.mj_step(model, data, 2000)
    way = 0.3**2 / (4 / 3 * 0.02 * 9.81)
    assert data.qpos[0] + 0.3 == pytest.approx(way, rel=0.1)
    assert abs(data.qvel[0]) < 1e-3


def test_a_bottle_tips_where_its_centre_passes_the_edge_of_its_foot():
    bottle = Bottle(friction=1.0)
    height = bottle.spec().compile().body("body").ipos[2]
    assert 0.08 < height < 0.09
    for factor, tips in ((0.95, False), (1.05, True)):
        scene, slope = table(), factor * math.atan(bottle.length / 2 / height)
        scene.option.gravity = [9.81 * math.sin(slope), 0, -9.81 * math.cos(slope)]
        place(scene, bottle, "bottle", [0, 0, TABLE_TOP])
        model = scene.compile()
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 500)
        assert (data.body("bottle").xmat[8] < 0.9) == tips


def test_a_banana_lies_on_its_whole_arc():
    scene, banana = table(), Banana()
    place(scene, banana, "banana", [0, 0, TABLE_TOP])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)
    feet = {int(g) for contact in data.contact.geom for g in contact} - {model.geom("table_top").id}
    assert len(feet) == banana.PARTS


class TestScans:
    def test_it_is_found_where_the_set_has_it(self, tmp_path):
        plain, nested = tmp_path / "005_tomato_soup_can" / "textured.obj", tmp_path / "011_banana" / "google_16k"
        nested.mkdir(parents=True)
        plain.parent.mkdir()
        plain.touch()
        (nested / "textured.obj").touch()
        assert mesh_of(tmp_path, ITEMS[3]) == plain
        assert mesh_of(str(tmp_path), ITEMS[9]) == nested / "textured.obj"

    def test_what_is_missing_is_said_with_what_is_there(self, tmp_path):
        (tmp_path / "011_bananas").mkdir()
        (tmp_path / "024_bowl").mkdir()
        with pytest.raises(
            BadConfig, match=r"no folder 011_banana in .* \(did you mean '011_bananas'\?\); known: 011_ban"
        ):
            mesh_of(tmp_path, ITEMS[9])
        with pytest.raises(BadConfig, match="024_bowl holds no scan; expected one of google_16k/textured.obj"):
            mesh_of(tmp_path, ITEMS[10])
        with pytest.raises(BadConfig, match="ycb = .*nowhere is not a folder; name the one that holds 029_plate"):
            mesh_of(tmp_path / "nowhere", ITEMS[12])

    def test_folders_are_named_as_in_the_set(self):
        assert NAMES[0] == "002_master_chef_can" and NAMES[5] == "007_tuna_fish_can" and NAMES[-1] == "061_foam_brick"
        assert len({item.number for item in ITEMS}) == len(ITEMS) == 16
        assert all(isinstance(item, Item) for item in ITEMS)

"""The rack lets a level hand in through its open side, and nothing else; no camera that stands still looks in."""

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    after_oracle,
    each_refuted_for_its_own_reason,
    load,
    not_certified,
    play,
    play_shortcut,
    replayed,
    spared,
)

from scengen import load_task
from scengen.assets.box import Cube
from scengen.assets.prop import TABLE_TOP
from scengen.assets.rack import STOREYS, TierRack
from scengen.look.looks import PLAIN
from scengen.params import values, with_values
from scengen.pictures import opengl
from scengen.pictures.render import hide_hulls
from scengen.robots.jaw import PALM_ACROSS, PALM_ALONG
from scengen.sim import scene_text
from scengen.sim.arm import ROBOT
from scengen.sim.world import World
from scengen.tasks.sheltered_grasp import (
    EYES,
    GRIP_HEIGHT,
    LIFT_HEIGHT,
    MIN_CLEARANCE,
    PUDDING_BOX,
    TRAY,
    ShelteredGrasp,
)

TASK = load_task("sheltered_grasp")
NOMINAL = ShelteredGrasp()


@pytest.fixture(scope="module")
def solved():
    return after_oracle(TASK, NOMINAL)


# --- the way in ---------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("yaw", [-35.0, 0.0, 6.0])
def test_the_entry_is_level_and_looks_from_the_open_side_to_the_object(side, yaw):
    s = ShelteredGrasp(side=side, rack_yaw=yaw)
    into, closing = s.entry[:, 2], s.entry[:, 0]
    deeper = replace(s, depth=s.depth + 0.02).spot(0, s.along) - s.spot(0, s.along)
    assert np.linalg.det(s.entry) == pytest.approx(1.0)
    assert into == pytest.approx(deeper / 0.02) and into[1] * side > 0 and closing[2] == 0 and closing[0] < 0


def test_the_opposite_side_is_the_mirror_image():
    for index in range(3):
        left, right = (TASK.draw(split, 0, index).scenario for split in ("id", "opposite_side"))
        mirror = np.array([1.0, -1.0, 1.0])
        assert right.foot == pytest.approx(left.foot * mirror) and right.tray == pytest.approx(left.tray * mirror)
        assert right.spot(1, right.along) == pytest.approx(left.spot(1, left.along) * mirror)


def test_the_hand_never_touches_the_rack_on_its_way():
    for split in ("id", "opposite_side"):
        s = TASK.draw(split, 0, 0).scenario
        w = load(TASK, s)
        assert play(TASK, s, s.oracle, w).solved and not w.touched(ROBOT, "rack"), split


def test_from_above_the_hand_stops_at_the_roof():
    w = load(TASK, NOMINAL)
    play_shortcut(TASK, NOMINAL, "from_above", w)
    assert w.touched(ROBOT, "rack") and not w.touched(ROBOT, "thing")


@pytest.mark.parametrize("name", ["the_other_storey", "the_other_end"])
def test_in_the_wrong_place_the_jaw_closes_in_air(name):
    w = load(TASK, NOMINAL)
    assert play_shortcut(TASK, NOMINAL, name, w).reason == "everything came to rest without reaching the goal"
    assert math.dist(w.pos("thing"), NOMINAL.spot(0, NOMINAL.along)) < 0.01


def test_a_closed_rack_keeps_the_object():
    (ended, w) = ablated(TASK, NOMINAL)["closed_rack"]
    assert not ended.solved and math.dist(w.pos("thing"), NOMINAL.spot(0, NOMINAL.along)) < 1e-3


@pytest.mark.parametrize("split", ["opposite_side", "turned_rack"])
def test_a_memorised_motion_serves_no_rack_that_opens_another_way(split):
    trained, moved = (TASK.draw(name, 0, 1).scenario for name in ("id", split))
    assert not replayed(TASK, trained, moved).solved


# --- out of sight -------------------------------------------------------------------------


def pixels(scenario):
    """Pixels of the object in the picture of every camera, by the camera's name."""
    w = World.load(scene_text.emit(scenario.build())[0], TASK.embodiment, look=PLAIN)
    hide_hulls(w.model)
    renderer = opengl.Renderer(w.model, 480, 640)
    renderer.enable_segmentation_rendering()
    mujoco.mj_camlight(w.model, w.data)
    found, shapes = {}, np.flatnonzero(w.model.geom_bodyid == w.body("thing"))
    for camera in (w.model.camera(i).name for i in range(w.model.ncam)):
        renderer.update_scene(w.data, camera=camera)
        number, kind = np.moveaxis(renderer.render(), -1, 0)
        found[camera] = int((np.isin(number, shapes) & (kind == mujoco.mjtObj.mjOBJ_GEOM)).sum())
    renderer.close()
    return found


@pytest.mark.parametrize("storey", range(STOREYS))
@pytest.mark.parametrize(
    "split",
    [
        "id",
        "opposite_side",
        *(pytest.param(name, marks=pytest.mark.slow) for name in TASK.axes if name != "opposite_side"),
    ],
)
def test_no_camera_that_stands_still_sees_any_pixel_of_the_object(split, storey):
    for index in range(2):
        scenario = replace(TASK.draw(split, 0, index).scenario, storey=storey)
        seen = pixels(scenario)
        assert set(seen) - {"robot0_eye_in_hand"} == {f"robot0_{n}" if n == "robotview" else n for n in EYES}
        assert not any(number for name, number in seen.items() if name != "robot0_eye_in_hand"), seen


def test_the_line_of_sight_is_exact():
    """An object that stands a little less deep than what the law allows is refuted, and seen."""
    shallow = replace(NOMINAL, rack_yaw=5.0, along=0.06, depth=0.040)
    seen = {name: number for name, number in pixels(shallow).items() if name != "robot0_eye_in_hand"}
    told = {name: shallow.hidden_by(eye) <= 0.0 for name, eye in EYES.items()}
    assert shallow.infeasible().reason == "a camera that stands still sees the object"
    assert {name.removeprefix("robot0_"): number > 0 for name, number in seen.items()} == told and any(told.values())


def test_the_eyes_are_those_of_the_cameras():
    w = load(TASK, NOMINAL)
    mujoco.mj_camlight(w.model, w.data)
    for name, eye in EYES.items():
        camera = w.model.camera(f"robot0_{name}" if name == "robotview" else name)
        assert w.data.cam_xpos[camera.id] == pytest.approx(eye, abs=1e-6)


# --- the pudding box ----------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class HeldInTheMiddle(ShelteredGrasp):
    """The hand goes to the middle of whatever lies there, as it goes to the middle of a cube."""

    def grip_at(self, spot):
        return spot + np.array([0.0, 0.0, GRIP_HEIGHT])


def test_a_hand_that_goes_to_the_middle_of_the_box_pushes_it_with_its_palm():
    box = TASK.draw("pudding_box", 0, 0).scenario
    w = load(TASK, box)
    assert not play(TASK, box, with_values(HeldInTheMiddle(), values(box)).oracle, w).solved
    assert play(TASK, box, box.oracle).solved


def test_the_box_fits_a_storey_lying_on_its_narrow_side_only():
    across, along, high = PUDDING_BOX.size
    least = high + MIN_CLEARANCE + LIFT_HEIGHT
    assert across < along and sorted(PUDDING_BOX.size)[1] == high
    assert ShelteredGrasp(item=1, rack=TierRack(height=least + 1e-4)).infeasible() is None
    assert ShelteredGrasp(item=1, rack=TierRack(height=least - 1e-4)).infeasible().reason == "a storey is too low"
    assert along > NOMINAL.rack.height


# --- goal ---------------------------------------------------------------------------------


def put(world, pos):
    joint = world.data.joint("thing_free")
    joint.qpos[:3], joint.qvel[:] = pos, 0.0
    mujoco.mj_kinematics(world.model, world.data)
    mujoco.mj_comPos(world.model, world.data)
    mujoco.mj_comVel(world.model, world.data)


@pytest.mark.parametrize(
    ("offset", "counts"),
    [
        ([TRAY.width / 2 - 0.001, 0.0, TRAY.floor], True),
        ([TRAY.width / 2 + 0.001, 0.0, TRAY.floor], False),
        ([0.0, TRAY.length / 2 - 0.001, TRAY.floor], True),
        ([0.0, TRAY.length / 2 + 0.001, TRAY.floor], False),
    ],
)
def test_the_object_is_in_the_tray_if_its_middle_is_between_the_walls(solved, offset, counts):
    state = solved.state()
    put(solved, NOMINAL.tray + offset)
    assert NOMINAL.success(solved) == counts
    solved.restore(state)


@pytest.mark.parametrize("other", ["robot0_base", "table", "rack"])
def test_an_object_that_touches_anything_but_the_tray_is_not_dropped(solved, other):
    touching = solved.loop.touching.copy()
    assert NOMINAL.success(solved)
    row = -1 if other == "robot0_base" else solved.body(other)
    solved.loop.touching[row, solved.body("thing")] = solved.loop.touching[solved.body("thing"), row] = True
    assert not NOMINAL.success(solved)
    solved.loop.touching[:] = touching


def test_an_object_that_moves_is_not_dropped(solved):
    state = solved.state()
    assert NOMINAL.success(solved)
    solved.data.joint("thing_free").qvel[0] = 0.021
    mujoco.mj_comVel(solved.model, solved.data)
    assert not NOMINAL.success(solved)
    solved.restore(state)


def test_an_object_that_falls_off_the_table_is_lost(solved):
    state = solved.state()
    assert NOMINAL.failure(solved) is None
    put(solved, [0.6, 0.0, TABLE_TOP - 0.2])
    assert NOMINAL.failure(solved) == "the thing fell off the table"
    solved.restore(state)


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Roofless(ShelteredGrasp):
    """Nothing covers the object: the upper storey is gone, and the roof of the lower one. Any way out counts."""

    def build(self):
        scene = super().build()
        for name in ("floor_1", "floor_2"):
            scene.delete(scene.geom(f"rack/{name}"))
        return scene

    def means(self):
        return {}


@dataclass(frozen=True, kw_only=True)
class WrongStorey(ShelteredGrasp):
    """The oracle looks in the wrong storey."""

    def shortcuts(self):
        return {}

    def oracle(self, world: World):
        yield from self.fetch(world, self.spot(1 - self.storey, self.along))


@pytest.mark.parametrize(
    ("scenario", "check", "says"),
    [
        (ShelteredGrasp(along=0.10), "feasible", "a wall is in the palm's way"),
        (WrongStorey(), "solved", "the oracle failed"),
        (Roofless(), "shortcuts", "from_above"),
        (spared(ShelteredGrasp)(), "ablations", "the witness succeeds with 'less_light'"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, ShelteredGrasp) else str(value),
)
def test_an_invalid_scenario_is_not_certified(scenario, check, says):
    not_certified(TASK, scenario, check, says)


def test_a_storey_must_admit_the_palm_by_its_own_numbers():
    least = GRIP_HEIGHT + PALM_ACROSS + MIN_CLEARANCE + LIFT_HEIGHT
    assert ShelteredGrasp(rack=TierRack(height=least + 1e-4)).infeasible() is None
    assert ShelteredGrasp(rack=TierRack(height=least - 1e-4)).infeasible() is not None
    narrow = 2 * (PALM_ALONG + MIN_CLEARANCE + NOMINAL.along)
    assert ShelteredGrasp(rack=TierRack(width=narrow + 1e-4)).infeasible() is None
    assert ShelteredGrasp(rack=TierRack(width=narrow - 1e-4)).infeasible() is not None


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            ShelteredGrasp(side=0),
            ShelteredGrasp(along=0.12),
            ShelteredGrasp(rack=TierRack(height=0.08)),
            ShelteredGrasp(rack=TierRack(depth=0.10)),
            ShelteredGrasp(depth=0.01, yaw=45.0, cube=Cube(edge=0.05)),
            ShelteredGrasp(cube=Cube(edge=0.07)),
            ShelteredGrasp(cube=Cube(edge=0.02)),
            ShelteredGrasp(depth=0.03),
            ShelteredGrasp(rack_x=0.29),
            ShelteredGrasp(tray_y=0.1),
        ]
    )

"""The rack lets a level hand in through its open side, and nothing else; what is inside is out of sight."""

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
from scengen.assets.rack import TierRack
from scengen.robots.jaw import PALM_ACROSS, PALM_ALONG
from scengen.sim.world import ROBOT, World
from scengen.tasks.sheltered_grasp import GRIP_HEIGHT, LIFT_HEIGHT, MIN_CLEARANCE, TRAY, ShelteredGrasp

TASK = load_task("sheltered_grasp")
NOMINAL = ShelteredGrasp()


@pytest.fixture(scope="module")
def solved():
    return after_oracle(TASK, NOMINAL)


# --- the way in ---------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("yaw", [-35.0, 0.0, 6.0])
def test_the_entry_is_level_and_looks_from_the_open_side_to_the_cube(side, yaw):
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
    assert w.touched(ROBOT, "rack") and not w.touched(ROBOT, "cube")


@pytest.mark.parametrize("name", ["the_other_storey", "the_other_end"])
def test_in_the_wrong_place_the_jaw_closes_in_air(name):
    w = load(TASK, NOMINAL)
    assert play_shortcut(TASK, NOMINAL, name, w).reason == "everything came to rest without reaching the goal"
    assert math.dist(w.pos("cube"), NOMINAL.spot(0, NOMINAL.along)) < 0.01


def test_a_closed_rack_keeps_the_cube():
    (ended, w) = ablated(TASK, NOMINAL)["closed_rack"]
    assert not ended.solved and math.dist(w.pos("cube"), NOMINAL.spot(0, NOMINAL.along)) < 1e-3


@pytest.mark.parametrize("split", ["opposite_side", "turned_rack"])
def test_a_memorised_motion_serves_no_rack_that_opens_another_way(split):
    trained, moved = (TASK.draw(name, 0, 1).scenario for name in ("id", split))
    assert not replayed(TASK, trained, moved).solved


# --- out of sight -------------------------------------------------------------------------


def hidden_from(world, camera, points):
    """Whether something of the scene is between a camera and each point."""
    eye, ray = world.data.cam_xpos[world.model.camera(camera).id], np.zeros(1, np.int32)
    cube = world.body("cube")
    for point in points:
        distance = mujoco.mj_ray(world.model, world.data, eye, point - eye, None, 1, cube, ray)
        if ray[0] < 0 or distance > 1.0:
            return False
    return True


@pytest.mark.parametrize("camera", ["agentview", "sideview", "robot0_robotview"])
@pytest.mark.parametrize("storey", [0, 1])
def test_no_camera_that_stands_still_sees_a_training_cube(camera, storey):
    for index in range(20):
        s = replace(TASK.draw("id", 0, index).scenario, storey=storey)
        w = load(TASK, s)
        mujoco.mj_camlight(w.model, w.data)
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [0, 2])).reshape(3, -1).T
        corners = w.pos("cube") + s.cube.edge / 2 * signs @ w.rot("cube").T
        assert hidden_from(w, camera, corners), index


def test_on_the_opposite_side_one_camera_looks_into_the_rack():
    """Why the docstring says so; and the negative control of the test above."""
    s = ShelteredGrasp(side=-1, storey=1)
    w = load(TASK, s)
    mujoco.mj_camlight(w.model, w.data)
    assert not hidden_from(w, "sideview", [w.pos("cube") + s.cube.edge / 2 * np.array([0.0, 0.9, 1.9])])


# --- goal ---------------------------------------------------------------------------------


def put(world, pos):
    joint = world.data.joint("cube_free")
    joint.qpos[:3], joint.qvel[:] = pos, 0.0
    mujoco.mj_kinematics(world.model, world.data)
    mujoco.mj_comPos(world.model, world.data)
    mujoco.mj_comVel(world.model, world.data)


@pytest.mark.parametrize(
    ("offset", "counts"),
    [
        ([TRAY.width / 2 - 0.001, 0.0, TRAY.floor], True),
        ([TRAY.width / 2 + 0.001, 0.0, TRAY.floor], False),
        ([0.0, TRAY.length / 2 + 0.001, TRAY.floor], False),
        ([0.0, 0.0, TRAY.floor + TRAY.depth + 0.001], False),
    ],
)
def test_the_cube_counts_as_in_the_tray_when_its_foot_is_between_the_walls(solved, offset, counts):
    state = solved.state()
    put(solved, NOMINAL.tray + offset)
    assert NOMINAL.success(solved) == counts
    solved.restore(state)


def test_a_cube_that_is_held_or_moves_is_not_dropped(solved):
    state, touching = solved.state(), solved.loop.touching.copy()
    assert NOMINAL.success(solved)
    solved.loop.touching[-1, solved.body("cube")] = True
    assert not NOMINAL.success(solved)
    solved.loop.touching[:] = touching
    solved.data.joint("cube_free").qvel[0] = 0.021
    mujoco.mj_comVel(solved.model, solved.data)
    assert not NOMINAL.success(solved)
    solved.restore(state)


def test_a_cube_that_falls_off_the_table_is_lost(solved):
    state = solved.state()
    assert NOMINAL.failure(solved) is None
    put(solved, [0.6, 0.0, TABLE_TOP - 0.2])
    assert NOMINAL.failure(solved) == "the cube fell off the table"
    solved.restore(state)


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Roofless(ShelteredGrasp):
    """Nothing covers the cube: the upper storey is gone, and the roof of the lower one."""

    def build(self):
        scene = super().build()
        for name in ("floor_1", "floor_2"):
            scene.delete(scene.geom(f"rack/{name}"))
        return scene


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
            ShelteredGrasp(rack=TierRack(depth=0.12)),
            ShelteredGrasp(depth=0.03),
            ShelteredGrasp(cube=Cube(edge=0.052)),
            ShelteredGrasp(cube=Cube(edge=0.02)),
            ShelteredGrasp(rack_x=0.29),
            ShelteredGrasp(tray_y=0.1),
        ]
    )

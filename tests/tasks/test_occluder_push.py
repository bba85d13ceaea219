"""Lids hide the cubes from every camera, come off without taking the cubes along, and one wrong cube is too many."""

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    missed,
    not_certified,
    play,
    play_shortcut,
    replayed,
)

from scengen import load_task
from scengen.assets.box import Cube, Lid
from scengen.assets.prop import CAMERAS, TABLE_TOP
from scengen.attack.priors import fit
from scengen.geometry import UP
from scengen.params import parameters
from scengen.sim.arm import IDLE, ROBOT
from scengen.tasks.occluder_push import CUBE_COUNT, OTHER_COLOURS, RED, OccluderPush, Spot
from scengen.validate.rollout import run

TASK = load_task("occluder_push")
SCENE = OccluderPush(red=0)
CLEAN = "no other cube came onto the patch"
AT_REST = "everything came to rest without reaching the goal"


def seen(world, scenario, camera):
    """Which corners of cubes a camera sees past the lids, by a ray to each that starts at the eye."""
    eye, geom = world.data.cam_xpos[world.model.camera(camera).id], np.zeros(1, np.int32)
    found = []
    for cube in scenario.cubes:
        for signs in np.array(np.meshgrid([-1, 1], [-1, 1], [0, 2])).reshape(3, -1).T:
            corner = world.pos(cube) + 0.999 * scenario.cube.edge / 2 * world.rot(cube) @ signs
            share = mujoco.mj_ray(world.model, world.data, eye, corner - eye, None, 1, world.body(cube), geom)
            hit = world.model.body(world.model.geom_bodyid[geom[0]]).name if 0.0 <= share < 1.0 else ""
            if not hit.startswith("lid_"):
                found.append((cube, *signs))
    return found


def ready(scenario, **moved):
    """The world after half a second in which nobody acts, with bodies moved to places [m]."""
    world = load(TASK, scenario)
    for body, place in moved.items():
        world.data.joint(f"{body}_free").qpos[:3] = place
    for _ in range(50):
        world.step(IDLE)
    return world


# --- out of sight -------------------------------------------------------------------------


def test_no_camera_sees_any_corner_of_a_cube_at_the_start():
    for index in range(2):
        s = TASK.draw("id", 0, index).scenario
        w = load(TASK, s)
        mujoco.mj_camlight(w.model, w.data)
        for camera in (*(name for name, _, _ in CAMERAS), "robot0_robotview", "robot0_eye_in_hand"):
            assert not seen(w, s, camera), (index, camera)


@pytest.mark.parametrize(("more", "hidden"), [(-0.001, False), (0.001, True)])
def test_the_shade_says_to_the_millimetre_when_a_lid_is_too_small_to_hide_a_cube(more, hidden):
    s = OccluderPush(left=Spot(y=0.235, yaw=10.0), right=Spot(y=-0.235, yaw=-5.0))
    s = replace(s, lid=Lid(width=s.lid.width - 2 * s.hiding_margin + 2 * more))
    assert s.hiding_margin == pytest.approx(more)
    assert (s.infeasible() is None) == hidden
    w = load(TASK, s)
    mujoco.mj_camlight(w.model, w.data)
    assert hidden == (not any(seen(w, s, camera) for camera, _, _ in CAMERAS))


def test_scenes_that_differ_in_where_the_red_cube_is_differ_in_colours_of_cubes_alone():
    a, b = (load(TASK, replace(SCENE, red=red)).model for red in (0, 2))
    arrays = {name: (getattr(a, name), getattr(b, name)) for name in dir(a)}
    arrays = {name: both for name, both in arrays.items() if isinstance(both[0], np.ndarray)}
    differ = {n for n, (x, y) in arrays.items() if not np.array_equal(x, y, equal_nan=x.dtype.kind == "f")}
    assert a.names == b.names and len(arrays) > 300 and differ == {"geom_rgba"}
    changed = np.flatnonzero((a.geom_rgba != b.geom_rgba).any(axis=1))
    assert {a.body(a.geom_bodyid[i]).name for i in changed} <= set(SCENE.cubes)
    assert {p.name for p in parameters(SCENE) if p.hidden} >= {"red"}


def test_no_colour_of_another_cube_is_nearer_to_red_than_red():
    for likeness in range(len(OTHER_COLOURS)):
        for red in range(CUBE_COUNT):
            s = OccluderPush(red=red, likeness=likeness)
            assert s.reddest(load(TASK, s)) == red
    assert min(math.dist(RED[:3], colour[:3]) for colour in OTHER_COLOURS[1]) > 0.2


# --- pushing lids off ---------------------------------------------------------------------


def test_the_lid_comes_off_between_the_fingers_and_the_cube_stays():
    for split in ("id", "turned_lids"):
        s = TASK.draw(split, 0, 0).scenario
        w = load(TASK, s)
        play(TASK, s, lambda world, s=s: s.uncover(world, 1), w)
        assert math.dist(w.pos("cube_1"), s.foot(1)) < 0.006 and not w.touching("lid_1_0", "cube_1"), split
        assert not w.touched(ROBOT, "cube_1") and w.pos("lid_1_0")[2] < TABLE_TOP + 0.005


def test_a_shove_takes_the_cube_along():
    w = load(TASK, SCENE)
    assert not play_shortcut(TASK, SCENE, "shove_hard", w).solved
    assert math.dist(w.pos("cube_0"), SCENE.foot(0)) > 0.03


@pytest.mark.parametrize("name", ["reach_through_the_lid", "pick_the_lid_up"])
def test_who_leaves_the_lid_on_never_touches_the_cube(name):
    w = load(TASK, SCENE)
    assert play_shortcut(TASK, SCENE, name, w).reason == AT_REST
    assert not w.touched(ROBOT, "cube_0")


def test_the_oracle_is_told_nothing():
    """An oracle that believes the red cube to be elsewhere does the same to the bit."""
    misled = replace(SCENE, red=2)
    assert np.array_equal(play(TASK, SCENE, misled.oracle).actions, play(TASK, SCENE, SCENE.oracle).actions)


def test_the_witness_knows_where_the_red_cube_is_and_is_lost_where_it_is_elsewhere():
    ((ended, w),) = ablated(TASK, SCENE).values()
    assert ended.reason == AT_REST and missed(SCENE, w, CLEAN)


def test_one_fixed_answer_is_right_in_a_third_of_training_and_not_more():
    training, fresh = ([TASK.draw("id", seed, i).scenario for i in range(150)] for seed in (1, 2))
    (prior,) = fit(training, fresh=fresh)
    assert 0.25 <= prior.fresh <= 0.38
    w = load(TASK, SCENE)
    assert play_shortcut(TASK, SCENE, "take_another", w).reason == AT_REST and missed(SCENE, w, CLEAN)


def test_another_cube_on_the_patch_takes_the_second_try_away():
    """There is room for both."""

    def try_two(world):
        for i, aside in ((1, 0.03), (0, -0.03)):
            yield from SCENE.uncover(world, i)
            yield from replace(SCENE, patch_x=SCENE.patch_x + aside).deliver(world, i)

    free = run(SCENE, load(TASK, SCENE), try_two, TASK.horizon, rules="paper")
    assert free.solved and CLEAN in free.lacks
    ended = play(TASK, SCENE, try_two)
    assert ended.outcome == "failure" and CLEAN in ended.reason


@pytest.mark.parametrize("split", ["wide_lids", "patch_beyond"])
def test_a_memorised_motion_serves_no_other_lids_and_no_other_patch(split):
    trained, moved = (replace(TASK.draw(name, 0, 1).scenario, red=1) for name in ("id", split))
    assert not replayed(TASK, trained, moved).solved


# --- goal and failure -----------------------------------------------------------------------


def test_the_red_cube_on_the_patch_is_the_goal_and_another_one_must_not_come_there():
    for red in range(CUBE_COUNT):
        w = ready(replace(SCENE, red=red), cube_0=SCENE.goal)
        assert SCENE.success(w) == (red == 0)
        assert missed(SCENE, w, CLEAN) == (red != 0)


@pytest.mark.parametrize(("short", "counts"), [(0.001, True), (-0.001, False)])
def test_the_middle_of_the_cube_must_be_over_the_patch(short, counts):
    w = ready(SCENE, cube_0=SCENE.goal + (SCENE.patch.size / 2 - short) * np.array([1.0, 0.0, 0.0]))
    assert SCENE.success(w) == counts and SCENE.failure(w) is None


def test_a_red_cube_under_its_lid_is_not_placed():
    w = ready(SCENE, cube_0=SCENE.goal, lid_0_0=SCENE.goal + SCENE.cube.edge * UP)
    assert not SCENE.success(w) and SCENE.failure(w) is None


def test_a_red_cube_that_falls_off_the_table_is_lost_and_another_one_is_not_missed():
    w = load(TASK, SCENE)
    for cube, reason in (("cube_1", None), ("cube_0", "the red cube fell off the table")):
        w.data.joint(f"{cube}_free").qpos[:3] = [0.6, 0.0, TABLE_TOP - 0.2]
        mujoco.mj_kinematics(w.model, w.data)
        mujoco.mj_comPos(w.model, w.data)
        assert SCENE.failure(w) == reason


# --- scenes that must not be certified --------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Bare(OccluderPush):
    """Somebody forgot the lids."""

    def build(self):
        scene = super().build()
        for i in range(CUBE_COUNT):
            scene.delete(scene.body(f"lid_{i}_0"))
        return scene


def test_without_lids_there_is_nothing_to_look_for():
    not_certified(TASK, Bare(red=0), "shortcuts", "reach_through_the_lid")


def test_cubes_that_would_go_along_with_their_lids_are_refuted():
    rough = OccluderPush(lid=Lid(friction=1.4, mass=0.08))
    assert rough.infeasible().reason == "a cube goes along with its lids"
    w = load(TASK, rough)
    play(TASK, rough, lambda world: rough.uncover(world, 1), w)
    assert w.touching("cube_1", "lid_1_0") and w.pos("cube_1")[0] > rough.foot(1)[0] + 0.05


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            OccluderPush(lid=Lid(width=0.14)),
            OccluderPush(cube=Cube(edge=0.065), lid=Lid(width=0.30)),
            OccluderPush(cube=Cube(edge=0.02), lid=Lid(width=0.13)),
            OccluderPush(lid=Lid(friction=1.4, mass=0.08)),
            OccluderPush(left=Spot(y=0.34)),
            OccluderPush(left=Spot(y=0.15)),
            OccluderPush(left=Spot(x=0.3, y=0.3), middle=Spot(x=0.28, y=0.1), patch_x=0.12, patch_y=0.3),
            OccluderPush(middle=Spot(x=0.31)),
        ]
    )

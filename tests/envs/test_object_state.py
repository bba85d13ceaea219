"""`object-state` tells where everything is and how it moves, in the same places always, and nothing that is hidden."""

from itertools import chain

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from helpers import REFERENCE

from scengen import list_tasks, load_task
from scengen.assets.prop import TABLE_TOP
from scengen.envs.object_state import COMMON_BODIES, RESOLUTION, ObjectState, bodies_of
from scengen.geometry import between
from scengen.look.looks import PLAIN, ROOM
from scengen.params import values, with_values
from scengen.pool import Pool
from scengen.samplers.split import ID
from scengen.sim.embodiment import hands
from scengen.sim.world import World
from scengen.validate.rebuilt import rebuild, world_of

HIDING = [name for name in list_tasks() if any(p.hidden for p in load_task(name).known.values())]


def state_of(task):
    return ObjectState(bodies_of(task), len(hands(task.embodiment)))


def entries(state, read, name):
    return read[state.segments[name]]


@pytest.fixture(scope="module")
def flight():
    """A slab thrown up while the hand moves: the state, the world, the vector, and the same 10 ms before."""
    row = next(Pool.open(REFERENCE).rows())
    state, world = state_of(load_task(row.task)), World.load(row.scene_xml)
    reach = np.array([1, -1, 1, 1, 1, 1, -1], np.float32)
    for _ in range(20):
        world.step_filtered(reach)
    with world.events():
        world.launch("slab", [0.1, 0.2, 3.0], [1.0, 2.0, 3.0])
    world.step_filtered(reach)
    before = state.read(world)
    world.step_filtered(reach)
    return state, world, state.read(world), before


@pytest.mark.parametrize("name", HIDING)
def test_scenarios_that_differ_in_what_is_hidden_look_alike(name):
    task = load_task(name)
    hidden = {p.name: (p.low + p.high) / 2 for p in task.known.values() if p.hidden}
    one, state = task.draw(ID, 0, 0).scenario, state_of(task)
    told = (values(task.draw(ID, 0, index).scenario) for index in range(1, 20))  # all alike: the middle of the bounds
    others = (with_values(one, {p: other[p] for p in hidden}) for other in chain(told, [hidden]))
    other = next(other for other in others if other.id != one.id)
    assert (state.read(world_of(other, task.embodiment)) == state.read(world_of(one, task.embodiment))).all()


def test_what_is_not_hidden_shows():
    """The negative control of the test above: a yaw is seen."""
    task = load_task("domino_single")
    one, state = task.draw(ID, 0, 0).scenario, state_of(task)
    other = with_values(one, {"slab_yaw": one.slab_yaw + 3.0})
    differ = np.flatnonzero(state.read(world_of(one)) != state.read(world_of(other)))
    assert differ.size and {state.names[i].split("_")[0] for i in differ} == {"slab"}


def test_a_centre_of_mass_that_is_hidden_is_in_no_velocity():
    """The velocity of a body's origin, and not that of its centre of mass."""
    task = load_task("rod_across")
    state, world = state_of(task), world_of(task.draw(ID, 0, 0).scenario)
    with world.events():
        world.launch("rod", [0.1, 0.2, 0.3], [4.0, 5.0, 6.0])
    mujoco.mj_forward(world.model, world.data)
    read = state.read(world)
    assert np.allclose(entries(state, read, "rod_vel_lin"), [0.1, 0.2, 0.3])
    assert np.allclose(entries(state, read, "rod_vel_ang"), [4.0, 5.0, 6.0])
    assert np.linalg.norm(world.velocity("rod")[3:] - [0.1, 0.2, 0.3]) > 0.01, "the negative control"


@pytest.mark.parametrize("name", ["slab", "slab_to_robot0_eef"])
def test_velocities_are_the_change_of_the_poses(flight, name):
    state, _, after, before = flight
    change = (entries(state, after, f"{name}_pos") - entries(state, before, f"{name}_pos")) / 0.01
    told = (entries(state, after, f"{name}_vel_lin") + entries(state, before, f"{name}_vel_lin")) / 2
    lag = 0.002 * 9.81  # what is told is 2 ms old
    assert np.linalg.norm(told) > 2.0 and np.linalg.norm(change - told) < lag + 0.02


def test_the_hand_sees_what_stands_where_it_is_seen(flight):
    """Readings relative to the hand follow from the rounded ones: no motion of the hand gives finer ones."""
    state, world, read, _ = flight
    hand, axes = world.arm.hand, world.arm.hand_rot
    seen = entries(state, read, "slab_pos")
    assert np.allclose(hand + axes @ entries(state, read, "slab_to_robot0_eef_pos"), seen, atol=1e-12)
    assert 0 < np.abs(seen - world.pos("slab")).max() <= RESOLUTION["pos"] / 2 + 1e-12
    turned, alone = np.empty(9), np.empty(9)
    mujoco.mju_quat2Mat(turned, np.roll(entries(state, read, "slab_to_robot0_eef_quat"), 1))
    mujoco.mju_quat2Mat(alone, np.roll(entries(state, read, "slab_quat"), 1))
    assert np.allclose(axes @ turned.reshape(3, 3), alone.reshape(3, 3))
    assert np.degrees(np.linalg.norm(between(alone.reshape(3, 3), world.rot("slab")))) < 0.06


def test_what_is_finer_than_the_resolution_is_not_read(flight):
    state, world, _, _ = flight
    world = World.load(next(Pool.open(REFERENCE).rows()).scene_xml)
    start = world.pos("slab")
    for shift, seen in ((4e-6, False), (3e-4, True)):
        body = world.body("slab")
        world.data.xpos[body] = np.round(start, 4) + shift
        moved = state.read(world)
        world.data.xpos[body] = np.round(start, 4)
        assert (state.read(world) != moved).any() == seen


def test_a_body_that_a_scenario_lacks_reads_zero_and_the_others_keep_their_places():
    task = load_task("domino_single")
    state, few = state_of(task), with_values(task.draw(ID, 0, 0).scenario, {"count": 3})
    read = state.read(world_of(few))
    assert state.ordered[:4] == ("slab", "tile_0", "tile_1", "tile_2")
    assert not entries(state, read, "tile_5_quat").any() and entries(state, read, "tile_2_quat").any()
    assert len(read) == len(state.names) == len(state.bounds) == len(set(state.names))


@pytest.mark.parametrize("name", list_tasks())
def test_every_split_of_a_task_has_its_bodies_and_joints_among_the_entries(name):
    """Otherwise a policy that was trained on recordings of training could not be evaluated on the axis."""
    task = load_task(name)
    known = bodies_of(task)
    for split in (ID, *task.axes):
        scene = task.draw(split, 0, 1).scenario.build()
        moving = {body.name: bool(body.joints or body.mocap) for body in scene.bodies if body.name not in COMMON_BODIES}
        assert set(moving) <= set(known)
        assert all(known[body] for body, moves in moving.items() if moves)


def test_the_box_of_a_body_reaches_to_its_outermost_solid_parts_in_its_own_axes():
    task = load_task("domino_single")
    one, state = task.draw(ID, 0, 0).scenario, state_of(task)
    sizes = {"slab.width": 0.08, "slab.thickness": 0.02, "slab.height": 0.2, "slab_yaw": 7.0, "count": 3}
    for look in (None, PLAIN, ROOM):
        world = World.load(rebuild(with_values(one, sizes)), task.embodiment, look)
        read = state.read(world)
        low, high = (entries(state, read, f"slab_box_{corner}") for corner in ("low", "high"))
        np.testing.assert_allclose(sorted(high - low), [0.02, 0.08, 0.2], atol=1e-9)
        assert world.pos("slab")[2] + high[2] == pytest.approx(TABLE_TOP + 0.2, abs=2e-3), "its upper side"
        assert entries(state, read, "tile_2_box_high").any() and not entries(state, read, "tile_5_box_high").any()


def test_things_of_various_heights_are_told_apart():
    task = load_task("pick_place_ycb")
    state, seen = state_of(task), set()
    for index in range(8):
        read = state.read(world_of(task.draw(ID, 0, index).scenario, task.embodiment))
        seen.add(float(entries(state, read, "thing_box_high")[2]))
    assert len(seen) > 2 and max(seen) - min(seen) > 0.01


def test_bodies_of_a_pool_with_other_distributions_are_there_too():
    task = load_task("domino_single")
    many = with_values(task.draw(ID, 0, 0).scenario, {"count": 8})
    assert "tile_7" not in bodies_of(task)
    assert bodies_of(task, [rebuild(many)])["tile_7"]


def test_what_cannot_move_has_a_pose_and_no_velocity():
    state = state_of(load_task("sheltered_grasp"))
    assert state.bodies["rack"] is False and "rack_quat" in state.segments and "rack_vel_lin" not in state.segments


def test_gymnasium_offers_it_whole_and_in_parts_with_names():
    seen = ["object-state", "slab_pos", "tile_5_quat"]
    env = gymnasium.make("scengen.envs.gym:scengen/domino_single-v2", pool=REFERENCE, observations=seen)
    check_env(env.unwrapped, skip_render_check=True)
    observation, _ = env.reset(seed=0)
    names = env.metadata["names"]
    assert len(names["object-state"]) == observation["object-state"].shape[0] == len(set(names["object-state"]))
    at = names["object-state"].index("slab_pos.x")
    assert (observation["object-state"][at : at + 3] == observation["slab_pos"]).all()
    assert names["slab_pos"] == ("slab_pos.x", "slab_pos.y", "slab_pos.z")
    env.close()

"""A world can be saved, restored and used again, and its answers are in SI units and world axes."""

import math

import numpy as np
import pytest

from scengen.errors import NoEvent, UnknownName, Unstable
from scengen.geometry import between
from scengen.look.looks import PLAIN
from scengen.sim.arm import IDLE, ROBOT
from scengen.sim.world import World
from scengen.skills.motion import ANGLE_TOLERANCE, FINE, facing_down, go_to
from scengen.tasks.domino_single import DominoSingle
from scengen.validate.rebuilt import rebuild

SCENE = rebuild(DominoSingle())
WAVE = [np.array([np.sin(0.1 * k), np.cos(0.2 * k), -0.6, 0.2, -0.1, 0.3, (-1.0) ** k]) for k in range(150)]


@pytest.fixture
def world():
    return World.load(SCENE)


def play(world, actions):
    for action in actions:
        world.step(action)
    return world.digest


def test_a_used_world_after_a_reset_is_a_fresh_one(world):
    once = play(world, WAVE)
    world.reset()
    assert play(world, WAVE) == once == play(World.load(SCENE), WAVE)


def test_a_saved_state_continues_bit_by_bit_filter_included(world):
    play(world, WAVE[:60])
    saved = world.state()
    end = play(world, WAVE[60:])
    play(world, WAVE[:13])
    world.restore(saved)
    assert play(world, WAVE[60:]) == end
    other = World.load(SCENE)
    other.restore(saved)
    assert play(other, WAVE[60:]) == end


def test_visual_geometry_changes_no_bit(world):
    assert play(world, WAVE) == play(World.load(SCENE, look=PLAIN), WAVE)


def test_what_the_controller_gets_is_what_is_returned_and_replays(world):
    actions = [world.step(action) for action in WAVE]
    again = World.load(SCENE)
    for row in actions:
        again.step_filtered(row)
    assert again.digest == world.digest and actions[0].dtype == np.float32


def test_the_hand_goes_where_it_is_sent_and_points_down(world):
    target = np.array([0.05, 0.15, 0.95])
    play(world, go_to(world.arm, target, facing_down(0.7), FINE))
    assert np.linalg.norm(world.arm.hand - target) < FINE.within
    assert np.linalg.norm(between(world.arm.hand_rot, facing_down(0.7))) < ANGLE_TOLERANCE
    assert world.arm.hand_rot[2, 2] < -0.99 and world.time < 4.0


def test_positions_masses_and_contacts_are_those_of_the_scene(world):
    assert world.com("slab")[2] == pytest.approx(0.86) and world.tilt("slab") == pytest.approx(0.0, abs=1e-6)
    assert set(world.free_bodies) == {"slab", *(f"tile_{i}" for i in range(5))}
    world.step(IDLE)
    assert world.touching("slab", "table") and not world.touched(ROBOT, "slab")
    assert math.isclose(world.time, 0.01)


def test_an_unknown_body_is_answered_with_the_nearest(world):
    with pytest.raises(UnknownName, match="did you mean 'slab'"):
        world.pos("slap")


@pytest.mark.parametrize("bad", [np.full(7, np.nan), np.zeros(6), np.zeros((1, 7)), [np.inf] * 7])
def test_no_bad_action_reaches_the_simulator(world, bad):
    before = world.digest
    with pytest.raises(ValueError, match="action"):
        world.step(bad)
    assert world.digest == before


def test_an_unstable_simulation_is_an_error_and_names_the_warning(world):
    world.data.qvel[:] = 1e12
    with pytest.raises(Unstable, match="mjWARN"):
        play(world, WAVE)


# --- events -----------------------------------------------------------------------------------


def test_a_launched_body_flies_and_turns_as_it_was_told(world):
    """Thrown up at 2 m/s it is v t - g t^2 / 2 higher after 0.1 s; a spin is given in world axes, however it lies."""
    start = world.com("slab")
    with world.events():
        world.launch("slab", [0.3, 0.0, 2.0], [0.0, 0.0, 5.0])
    for _ in range(10):
        world.step(IDLE)
    assert world.com("slab") - start == pytest.approx([0.03, 0.0, 0.2 - 9.81 * 0.005], abs=0.002)
    assert world.velocity("slab")[:3] == pytest.approx([0.0, 0.0, 5.0], abs=0.01)
    with pytest.raises(NoEvent):
        world.launch("slab", [0.0, 0.0, 0.0])
    with world.events(), pytest.raises(UnknownName, match="free body named 'table'"):
        world.launch("table", [0.0, 0.0, 0.0])


@pytest.mark.parametrize("moment", [0.0, 0.3, 0.304, 1.0])
def test_a_moment_is_due_in_one_control_period(world, moment):
    due = []
    for k in range(150):
        due += [k] if world.passes(moment) else []
        world.step(IDLE)
    assert due == [round(moment / 0.01)]

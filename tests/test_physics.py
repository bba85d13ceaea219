"""What is foreseen by formula is what MuJoCo simulates, and what a textbook says."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen.assets.ball import Ball
from scengen.assets.box import Block
from scengen.assets.prop import PRIORITY, TABLE_TOP, place, solid, table
from scengen.physics import (
    GRAVITY,
    contact,
    flight,
    passes,
    reflected,
    rolled,
    rolling_deceleration,
    slid,
    slip_angle,
    slipping,
)

START = np.array([-0.2, 0.0, TABLE_TOP + 0.30])
STEP = 0.002


def simulate(scene, velocity, seconds, spin=(0.0, 0.0, 0.0)):
    """Positions and velocities of the scene's free body after every physics step."""
    model = scene.compile()
    data = mujoco.MjData(model)
    data.qvel[:6] = [*velocity, *spin]
    places, velocities = [], []
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        places.append(data.qpos[:3].copy())
        velocities.append(data.qvel.copy())
    return np.array(places), np.array(velocities)


def with_ball(start, **ball):
    scene = table()
    place(scene, Ball(**ball), "ball", start)
    return scene


@pytest.mark.parametrize("velocity", [(0.48, 0.0, 0.34), (0.6, -0.3, 0.0), (0.2, 0.1, 1.5)])
def test_what_is_thrown_comes_down_where_it_is_foreseen(velocity):
    """d = v_x (v_z + sqrt(v_z^2 + 2 g h)) / g; the scene's air takes less than a millimetre."""
    velocity = np.array(velocity)
    seconds, there = flight(START, velocity, TABLE_TOP + 0.1)
    textbook = (velocity[2] + math.sqrt(velocity[2] ** 2 + 2 * GRAVITY * 0.2)) / GRAVITY
    assert seconds == pytest.approx(textbook)
    assert there == pytest.approx([*(START + velocity * seconds)[:2], TABLE_TOP + 0.1])
    places, _ = simulate(with_ball(START), velocity, seconds)
    assert places[-1] == pytest.approx(there, abs=0.003 + GRAVITY * seconds * STEP)


def test_what_does_not_rise_so_high_never_comes_down_from_there():
    seconds, apex = flight(START, np.array([0.1, 0.0, 1.0]), START[2] + 0.1)
    assert seconds == math.inf
    assert apex[2] == pytest.approx(START[2] + 1 / (2 * GRAVITY))


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.84, 0.95])
def test_a_wall_gives_back_its_share_of_the_speed(restitution):
    """On a smooth floor a ball is reflected at a smooth wall as light is, less what the wall keeps."""
    scene = with_ball([0.0, 0.0, TABLE_TOP + 0.022], radius=0.02, density=1200.0)
    wall, mat = scene.worldbody.add_body(name="wall", pos=[0.2, 0, TABLE_TOP]), scene.worldbody.add_body(name="mat")
    bouncy = contact(restitution, 2e4)
    solid(wall, "", [0.02, 0.4, 0.05], friction=0.0, solref=bouncy, priority=PRIORITY + 1, condim=1)
    solid(mat, "", [0.4, 0.4, 0.002], [0, 0, TABLE_TOP], priority=PRIORITY + 1, friction=0.0, condim=1)
    scene.option.density = scene.option.viscosity = 0.0
    before = np.array([0.30, 0.20, 0.0])
    _, velocities = simulate(scene, before, 1.0)
    expected = reflected(before, np.array([-1.0, 0.0, 0.0]), restitution)
    assert expected == pytest.approx([-restitution * 0.30, 0.20, 0.0])
    assert velocities[-1, :3] == pytest.approx(expected, abs=(0.05 if restitution < 0.8 else 0.02) * 0.30)
    assert np.array_equal(reflected(expected, np.array([-1.0, 0.0, 0.0]), restitution), expected)


def test_a_ball_that_slips_rolls_with_five_sevenths_of_its_speed():
    speed, friction = 0.4, 0.2
    seconds, rolls = slipping(speed, 0.0, friction)
    assert rolls == pytest.approx(5 / 7 * speed)
    assert seconds == pytest.approx(2 / 7 * speed / (friction * GRAVITY))
    scene = with_ball([-0.3, 0.0, TABLE_TOP + 0.02], radius=0.02, density=1200.0, friction=friction)
    _, velocities = simulate(scene, [speed, 0, 0], 0.3)
    assert velocities[-1, 0] == pytest.approx(rolls, rel=0.02)
    half = speed - friction * GRAVITY * seconds / 2
    assert velocities[round(0.5 * seconds / STEP), 0] == pytest.approx(half, rel=0.05)
    assert slipping(0.3, 0.3, 0.2) == (0.0, 0.3)
    assert slipping(0.3, 0.0, 0.0)[0] == math.inf


def test_resistance_brakes_a_rolling_ball_by_five_sevenths_of_its_share_of_gravity():
    assert rolling_deceleration(0.01) == pytest.approx(5 / 7 * 0.01 * GRAVITY)


@pytest.mark.parametrize(("friction", "degrees"), [(0.37, 20.3), (0.62, 31.8), (0.90, 42.0)])
def test_a_block_on_a_turning_slope_lets_go_at_the_angle_of_friction(friction, degrees):
    """atan(mu); gravity turns instead of the slope, at 5 deg/s from 3 deg before it."""
    assert math.degrees(slip_angle(friction)) == pytest.approx(degrees, abs=0.1)
    scene, rate = table(), math.radians(5.0)
    place(scene, Block(width=0.035, height=0.020, mass=0.03, friction=friction), "block", [0.3, 0, TABLE_TOP])
    model = scene.compile()
    data = mujoco.MjData(model)
    starts = slip_angle(friction) - math.radians(3.0)
    start, moved = None, None
    for step in range(round(1.5 / STEP)):
        angle = starts + rate * step * STEP
        model.opt.gravity[:] = [-GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle)]
        mujoco.mj_step(model, data)
        start = data.qpos[0] if start is None else start
        moved = start - data.qpos[0]
        if angle < slip_angle(friction) - math.radians(0.3):
            assert moved < 1e-3
    assert moved == pytest.approx(slid(friction, rate, 1.5 - 0.6)[0], rel=0.12)


def test_way_and_speed_of_what_slides_belong_together():
    ways, speeds = np.array([slid(0.5, 0.1, t) for t in np.linspace(0.0, 1.0, 1001)]).T
    assert np.gradient(ways, 0.001)[1:-1] == pytest.approx(speeds[1:-1], abs=1e-5)


@given(speed=st.floats(0.05, 0.4), slowing=st.floats(0.0, 0.1), seconds=st.floats(0.01, 5.0))
@settings(max_examples=50, deadline=None)
def test_when_it_passes_a_place_is_the_inverse_of_where_it_is(speed, slowing, seconds):
    if speed > 1.05 * slowing * seconds:
        assert passes(rolled(speed, slowing, seconds), speed, slowing) == pytest.approx(seconds, rel=1e-6)
    far = speed**2 / (2 * slowing) if slowing else math.inf
    assert rolled(speed, slowing, 1e9 if slowing else 1.0) <= far * (1 + 1e-9)
    if slowing:
        assert passes(1.01 * far, speed, slowing) == math.inf

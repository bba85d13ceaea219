"""The suction cup holds what forty newtons hold, and nothing at all unless its lip is closed."""

import math

import mujoco
import numpy as np
import pytest

from scengen.assets.l_piece import LPiece
from scengen.assets.prop import TABLE_TOP, place, solid, table
from scengen.control import osc
from scengen.errors import GaveUp
from scengen.geometry import UP, yaw_of
from scengen.physics import GRAVITY
from scengen.robots import suction
from scengen.robots.suction import CUP_HALF_WIDTH, LENGTH, PAD, PITCH, PULL, TORQUE
from scengen.sim import scene_text
from scengen.sim.arm import ROBOT
from scengen.sim.embodiment import SUCTION
from scengen.sim.world import World
from scengen.skills.jaw import release
from scengen.skills.motion import CLOSED, OPEN, STEADY, Pace, facing_down, go_to, hold, push, retreat
from scengen.skills.suction import carry, let_go, suck

FRICTION = 0.4
LIP = np.array([sign * (PITCH / 2 + end * PAD / 2) for sign in (-1, 1) for end in (-1, 1)])
"""Where the corners of the pads are, along one axis of the cup [m]."""
FACES = {4: (0.0, -0.021), 3: (-0.002, -0.002), 2: (0.0, -0.040), 1: (0.040, -0.040)}
"""Number of pads that find a face of an L-piece if the cup comes down with its middle there [m]."""


def hangs(weight, beside=0.0, level=True, pull=1.0):
    """Whether a plate of a weight [N] stays on a cup that nothing moves, its middle `beside` the cup's [m].

    The cup points down, or to the side if not `level`. The weight grows within 0.5 s, so that nothing swings.
    """
    scene = table()
    tool = mujoco.MjSpec.from_string(suction.xml())
    frame = scene.worldbody.add_frame(pos=[0.0, 0.0, 1.3], quat=[0.0, 1.0, 0.0, 0.0])
    frame.attach_body(tool.body("right_gripper"), "", "")
    plate = scene.worldbody.add_body(name="plate", pos=[beside, 0.0, 1.3 - LENGTH - 0.005 + 2e-5])
    plate.add_freejoint()
    solid(plate, "plate", [0.05, 0.05, 0.005], mass=weight / GRAVITY, friction=FRICTION)
    model = scene.compile()
    data = mujoco.MjData(model)
    data.ctrl[:] = pull
    down = np.array([0.0, 0.0, -GRAVITY] if level else [GRAVITY, 0.0, 0.0])
    start = data.qpos[:3].copy()
    while data.time < 1.0:
        model.opt.gravity = down * min(1.0, data.time / 0.5)
        mujoco.mj_step(model, data)
    return bool(np.linalg.norm(data.qpos[:3] - start) < 0.001)


def put_on(pads):
    """A world in which the cup, switched on, was pressed onto a piece with that many pads, and then lifted by 40 mm."""
    scene, piece = table(), LPiece(mass=0.15)
    place(scene, piece, "piece", [0.0, 0.0, TABLE_TOP])
    world = World.load(scene_text.emit(scene)[0], SUCTION)
    spot = np.array([*FACES[pads], TABLE_TOP + piece.thickness])
    play(world, go_to(world.arm, spot + 0.01 * UP, facing_down(), Pace(0.25, 0.0005), CLOSED))
    play(world, push(world.arm, -0.05 * UP, until=lambda: world.touching(ROBOT, "piece")))
    play(world, hold(world.arm, 0.3))
    play(world, retreat(world.arm, 0.04, STEADY))
    return world


def play(world, plan):
    for action in plan:
        world.step(action)


def test_a_cup_of_30_mm_at_0_6_bar_below_the_air_pulls_as_hard():
    assert pytest.approx(6e4 * math.pi * 0.015**2, rel=0.06) == PULL


@pytest.mark.parametrize(("factor", "held"), [(0.98, True), (1.02, False)])
def test_it_holds_its_own_pull_and_drops_what_is_heavier(factor, held):
    assert hangs(factor * PULL) == held


@pytest.mark.parametrize(("factor", "held"), [(0.97, True), (1.03, False)])
def test_a_face_that_hangs_upright_slips_at_the_pull_times_its_friction(factor, held):
    assert hangs(factor * FRICTION * PULL, level=False) == held


@pytest.mark.parametrize("beside", [0.005, 0.0135, 0.025])
@pytest.mark.parametrize(("factor", "held"), [(0.93, True), (1.07, False)])
def test_a_weight_beside_the_cup_peels_it_off_where_the_pressure_at_the_lip_vanishes(beside, factor, held):
    """The law of the core of a section: (pull - weight) / n = weight * beside * lip / (n * mean square of the lip)."""
    peels = PULL / (1 + beside * LIP.max() / np.mean(LIP**2))
    assert hangs(factor * peels, beside) == held


def test_the_torque_that_peels_it_off_is_that_law_for_a_weight_far_beside_the_cup():
    far = 1000.0
    assert pytest.approx(far * PULL / (1 + far * LIP.max() / np.mean(LIP**2)), rel=1e-4) == TORQUE


def test_switched_off_it_does_not_stick():
    assert not hangs(0.1, pull=0.0)


@pytest.mark.parametrize("pads", FACES)
def test_it_pulls_only_while_three_of_its_four_pads_find_a_face(pads):
    world = put_on(pads)
    lifted = world.pos("piece")[2] - TABLE_TOP
    assert world.arm.sealed == (pads >= osc.MIN_SEALED_PADS)
    assert (lifted > 0.03) == (pads >= osc.MIN_SEALED_PADS)
    assert lifted > 0.03 or lifted < 0.001


@pytest.mark.parametrize("leaky", [False, True])
def test_it_pulls_on_a_ribbed_face_in_vain(leaky):
    scene = table()
    block = scene.worldbody.add_body(name="block", pos=[0.0, 0.0, TABLE_TOP + 0.02])
    block.add_freejoint()
    solid(block, "block", [0.03, 0.03, 0.02], mass=0.1, leaky=leaky)
    world = World.load(scene_text.emit(scene)[0], SUCTION)
    play(world, go_to(world.arm, [0.0, 0.0, TABLE_TOP + 0.05], facing_down(), STEADY, CLOSED))
    play(world, push(world.arm, -0.05 * UP, until=lambda: world.touching(ROBOT, "block")))
    play(world, hold(world.arm, 0.3))
    assert world.touching(ROBOT, "block") and world.arm.sealed != leaky
    play(world, retreat(world.arm, 0.04, STEADY))
    assert (world.pos("block")[2] > TABLE_TOP + 0.05) != leaky


def test_what_it_lets_go_falls_freely():
    world = put_on(4)
    height, start = world.pos("piece")[2], world.time
    play(world, release(world.arm, 0.06))
    assert not world.arm.sealed
    fallen, elapsed = height - world.pos("piece")[2], world.time - start
    assert fallen == pytest.approx(GRAVITY * elapsed**2 / 2, rel=0.15)


def test_four_pads_cover_a_square_of_27_mm_around_the_grip_site_in_the_plane_of_the_lip():
    scene = table()
    place(scene, LPiece(), "piece", [0.0, 0.0, TABLE_TOP])
    world = World.load(scene_text.emit(scene)[0], SUCTION)
    names = [f"gripper0_right_pad{i}_collision" for i in range(4)]
    middles = np.array([world.data.geom(name).xpos for name in names])
    away = (middles - world.arm.hand) @ world.arm.hand_rot
    sizes = np.array([world.model.geom(name).size for name in names])
    assert np.abs(away[:, :2]).max() + sizes[:, :2].max() == pytest.approx(CUP_HALF_WIDTH) == 0.0135
    assert away[:, 2] + sizes[:, 2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("turn", [0.0, 1.0, -2.0])
def test_a_piece_is_taken_up_and_carried_to_a_pose(turn):
    scene, piece = table(), LPiece()
    place(scene, piece, "piece", [0.0, 0.1, TABLE_TOP])
    world = World.load(scene_text.emit(scene)[0], SUCTION)
    arm, spot = world.arm, np.array([*piece.hold(CUP_HALF_WIDTH), piece.thickness])
    play(world, go_to(arm, world.pos("piece") + spot + 0.03 * UP, facing_down(), grip=OPEN))
    play(world, suck(arm, world.pos("piece") + spot, facing_down()))
    play(world, retreat(arm, 0.05))
    goal = np.array([0.05, -0.1, TABLE_TOP + 0.04])
    play(world, carry(arm, "piece", goal, turn, Pace(0.25, 0.0005)))
    assert arm.sealed and np.linalg.norm(world.pos("piece") - goal) < 0.0015
    assert yaw_of(world.rot("piece")) == pytest.approx(turn, abs=0.02)
    play(world, let_go(arm))
    assert not arm.sealed and not world.touching(ROBOT, "piece")


def test_a_cup_that_finds_no_face_gives_up():
    world = World.load(scene_text.emit(table())[0], SUCTION)
    with pytest.raises(GaveUp, match="did not get hold of anything"):
        play(world, suck(world.arm, np.array([0.0, 0.5, TABLE_TOP]), facing_down(), give_up=0.2))

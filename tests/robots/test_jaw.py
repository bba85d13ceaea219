"""The jaw's sizes are those of the meshes, its forces and times those of the simulation."""

import math

import mujoco
import numpy as np
import pytest

from scengen.assets.prop import solid, table
from scengen.control.loop import Loop
from scengen.control.osc import JAW_SPEED
from scengen.robots import jaw, panda
from scengen.sim import scene_text
from scengen.sim.arm import ROBOT
from scengen.sim.world import World
from scengen.skills.jaw import GRASP_TIME, RELEASE_TIME, grasp, release

NAMES = panda.Names()
FINGERS = ("leftfinger", "finger_joint1_tip", "rightfinger", "finger_joint2_tip")
PADS = ("finger_joint1_tip", "finger_joint2_tip")
AWAY = [0.2, 0.0, 1.2]
"""Where the box waits while the jaw opens: near the table, out of the hand's way [m]."""


# --- sizes ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def robot():
    spec = mujoco.MjSpec()
    panda.attach(spec)
    model = spec.compile()
    return model, mujoco.MjData(model)


def seen(robot, bodies, apart):
    """Lowest and highest coordinates, in the grip site's axes [m], of what collides in some of the gripper's bodies.

    `apart`: how far each finger is from where "closed" sends it [m]. Axes: along, across, out of the hand.
    """
    model, data = robot
    data.qpos[panda.fingers(model, NAMES)] = apart, -apart
    mujoco.mj_kinematics(model, data)
    site = data.site(NAMES.grip_site)
    axes, points = site.xmat.reshape(3, 3), []
    for g in np.flatnonzero(model.geom_contype | model.geom_conaffinity):
        if model.body(model.geom_bodyid[g]).name.removeprefix(NAMES.hand) not in bodies:
            continue
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[g]
            corners = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
        else:
            corners = model.geom_size[g] * np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
        points.append((corners @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g] - site.xpos) @ axes)
    assert points
    every = np.concatenate(points)
    return every.min(axis=0), every.max(axis=0)


def exactly(size):
    return pytest.approx(size, abs=0.0005)


def gap(robot, apart):
    """Distance of the pads [m]."""
    left, right = (seen(robot, {pad}, apart) for pad in PADS)
    return right[0][0] - left[1][0]


def test_gaps_are_those_of_the_pads(robot):
    travel = robot[0].joint(NAMES.finger_joints[0]).range[1]
    assert gap(robot, travel) == exactly(jaw.OPENING)
    assert gap(robot, 0.0) == exactly(-jaw.OVERLAP)
    assert gap(robot, panda.FINGERS[0]) == exactly(jaw.RESET_GAP)


def test_open_and_closed_fingers_reach_as_far_as_is_said(robot):
    for apart, span in ((0.04, jaw.SPAN), (jaw.OVERLAP / 2, jaw.SPAN_CLOSED)):
        low, high = seen(robot, FINGERS, apart)
        assert high[0] - low[0] == exactly(span)
        assert (-low[1], high[1]) == (exactly(jaw.FINGER_ACROSS), exactly(jaw.FINGER_ACROSS))
        assert high[2] == exactly(jaw.TIP_BELOW)


@pytest.mark.parametrize("pad", PADS)
def test_pads_are_where_and_as_large_as_is_said(robot, pad):
    low, high = seen(robot, {pad}, 0.0)
    assert (high - low)[1:] == exactly(jaw.PAD)
    assert high[2] == exactly(jaw.PAD_BELOW)


def test_the_palm_reaches_as_far_as_is_said(robot):
    low, high = seen(robot, {"right_gripper"}, 0.0)
    assert max(-low[0], high[0]) == exactly(jaw.PALM_ALONG)
    assert (-low[1], high[1], -high[2]) == (*[exactly(jaw.PALM_ACROSS)] * 2, exactly(jaw.PALM_ABOVE))


def test_the_drive_is_the_models(robot):
    model, _ = robot
    for name, motor, finger, tip in zip(NAMES.finger_joints, NAMES.finger_motors, FINGERS[::2], PADS, strict=True):
        actuator, joint = model.actuator(motor), model.joint(name)
        assert actuator.gainprm[0] == -actuator.biasprm[1] == jaw.STIFFNESS
        assert actuator.forcerange.tolist() == [-jaw.MAX_FORCE, jaw.MAX_FORCE]
        assert (joint.damping[0], joint.frictionloss[0]) == (jaw.DAMPING, jaw.FRICTION)
        mass = sum(model.body(NAMES.hand + body).mass[0] for body in (finger, tip))
        assert joint.armature[0] + mass == pytest.approx(jaw.INERTIA)
        # The command in [-1, 1] is scaled to the actuator's range.
        ramp = JAW_SPEED / Loop.PERIOD * np.ptp(actuator.ctrlrange) / 2
        assert 2 * ramp == pytest.approx(jaw.COMMAND_SPEED)


# --- forces and times -------------------------------------------------------------------


class Bench:
    """A box that floats, weightless, and a hand in its posture after a reset."""

    def __init__(self, width, mass=0.1):
        scene = table()
        body = scene.worldbody.add_body(name="box", pos=AWAY, gravcomp=1.0)
        body.add_freejoint(name="box")
        solid(body, "box", [width / 2, 0.015, 0.015], mass=mass, friction=0.8)
        self.world = World.load(scene_text.emit(scene)[0])
        self.width, self.arm = width, self.world.arm

    def offer(self):
        """Put the box at rest between the pads, its x along the closing direction."""
        pose = np.empty(7)
        pose[:3] = self.arm.hand
        mujoco.mju_mat2Quat(pose[3:], self.arm.hand_rot.ravel())
        self.world.data.joint("box").qpos, self.world.data.joint("box").qvel = pose, 0.0

    def play(self, plan):
        """Follow a plan; for every period its end [s], the gap [m], and the force of each pad on the box [N]."""
        start, rows = self.world.time, []
        for action in plan:
            self.world.step(action)
            fingers = self.arm.finger_pos
            forces = [self.force(pad) for pad in PADS]
            rows.append((self.world.time - start, fingers[0] - fingers[1] - jaw.OVERLAP, *forces, self.touched))
        return np.array(rows).T

    def force(self, pad):
        """Normal force of a pad on the box [N]."""
        model, data = self.world.model, self.world.data
        wanted, total = {self.world.body("box"), self.world.body(NAMES.hand + pad)}, 0.0
        for i in range(data.ncon):
            if {int(model.geom_bodyid[g]) for g in data.contact.geom[i]} == wanted:
                wrench = np.zeros(6)
                mujoco.mj_contactForce(model, data, i, wrench)
                total += wrench[0]
        return total

    @property
    def touched(self):
        return self.world.touching("box", ROBOT)


def first(times, holds):
    """The first period [s] from which something holds to the end."""
    return times[np.flatnonzero(~holds)[-1] + 1] if not holds.all() else times[0]


WIDTHS = (0.002, 0.005, 0.012, 0.020, 0.030, 0.038, 0.050, 0.070)


@pytest.mark.parametrize("width", WIDTHS)
def test_force_and_times_of_a_grasp_and_a_release_are_those_of_the_functions(width):
    bench = Bench(width)
    bench.play(release(bench.arm, 1.0))
    bench.offer()
    times, _, left, right, _ = bench.play(grasp(bench.arm, 1.0))
    total = left + right
    assert total[-1] == pytest.approx(jaw.pinch(width), rel=0.015)
    assert left[-1] == pytest.approx(right[-1], rel=0.02)
    start = jaw.OPEN_GAP + 0.0005  # it has crept on for half a second
    touch = times[np.flatnonzero((left > 0.0) & (right > 0.0))[0]]
    assert -0.005 < touch - jaw.time_to_touch(width, start) < 0.015  # a period, and what the law is uncertain by
    assert first(times, total > 0.95 * jaw.pinch(width)) < jaw.time_to_grip(width) + Loop.PERIOD
    times, _, _, _, touching = bench.play(release(bench.arm, 0.3))
    assert -0.015 < first(times, touching == 0.0) - jaw.time_to_free(width) < Loop.PERIOD


@pytest.mark.parametrize("width", [0.002, 0.012, 0.030])
def test_times_from_the_half_open_jaw_of_a_reset(width):
    bench = Bench(width)
    bench.offer()
    times, _, left, right, _ = bench.play(grasp(bench.arm, 0.6))
    touch = times[np.flatnonzero((left > 0.0) & (right > 0.0))[0]]
    assert -0.005 < touch - jaw.time_to_touch(width, jaw.RESET_GAP) < 0.015
    assert first(times, left + right > 0.95 * jaw.pinch(width)) < jaw.time_to_grip(width, jaw.RESET_GAP) + Loop.PERIOD


def test_an_empty_jaw_opens_as_fast_as_is_said_and_then_creeps():
    bench = Bench(0.02)
    for start, before in ((jaw.RESET_GAP, 0.0), (0.0, 2.0)):
        bench.play(grasp(bench.arm, before))
        times, gaps, *_ = bench.play(release(bench.arm, 1.0))
        for wanted in (0.050, 0.060, 0.070, 0.075):
            there = float(np.interp(wanted, gaps, times))
            assert there == pytest.approx(jaw.time_to_open(wanted, start), abs=0.006)
        assert np.interp(0.5, times, gaps) == pytest.approx(jaw.OPEN_GAP, abs=0.001)
        assert jaw.OPEN_GAP < gaps[-1] < jaw.OPEN_GAP + 0.001
    assert jaw.time_to_open(jaw.OPEN_GAP) == jaw.time_to_touch(0.001) == math.inf


@pytest.mark.parametrize("width", [0.013, 0.070])
def test_the_moves_squeeze_and_let_go_for_long_enough(width):
    """`GRASP_TIME` covers 13 mm, the thinnest object that it is meant for, and `RELEASE_TIME` the widest one."""
    assert jaw.time_to_grip(0.013) <= GRASP_TIME < jaw.time_to_grip(0.011)
    assert jaw.time_to_free(jaw.OPEN_GAP) + 2 * Loop.PERIOD <= RELEASE_TIME
    bench = Bench(width)
    bench.play(release(bench.arm, 1.0))
    bench.offer()
    _, _, left, right, _ = bench.play(grasp(bench.arm))
    assert left[-1] + right[-1] > 0.95 * jaw.pinch(width)
    bench.play(release(bench.arm))
    assert not bench.touched

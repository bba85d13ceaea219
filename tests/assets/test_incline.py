"""A block lets go of the incline where the tangent of the slope reaches its friction, and slides as the law says."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from scengen.assets.box import Cube
from scengen.assets.incline import STIFFNESS, Incline, driven
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.geometry import UP
from scengen.physics import slid

RAMP = Incline()


class Tilting:
    """An incline on the table with a block on it, whose servo is driven by the clock; no robot."""

    def __init__(self, friction: float, away: float, rate: float, ramp: Incline = RAMP):
        """Args: coefficient, place of the block from the lip [m], rate [rad/s], the incline."""
        scene = table()
        place(scene, ramp, "incline", [0, 0, TABLE_TOP], free=False)
        driven(scene, "incline")
        block = Cube(edge=0.026, mass=0.02, friction=friction)
        place(scene, block, "block", RAMP.on_slab(away, 0.05) + TABLE_TOP * UP)
        turn = np.empty(4)
        mujoco.mju_mat2Quat(turn, RAMP.axes().ravel())
        scene.body("block").quat = turn
        self.model, self.rate, self.turns = scene.compile(), rate, ramp.turns
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.away = self.up

    @property
    def slope(self) -> float:
        """Of the slab [rad]."""
        return math.radians(RAMP.least) + float(self.data.joint("incline/hinge").qpos[0])

    @property
    def up(self) -> float:
        """How far up the slope the block is [m]."""
        slab = self.data.body("incline/slab")
        return float((slab.xmat.reshape(3, 3).T @ (self.data.body("block").xipos - slab.xpos))[0])

    def step(self) -> None:
        """One time step of the clock."""
        self.data.ctrl[0] = min(self.rate * self.data.time, self.turns)
        mujoco.mj_step(self.model, self.data)

    def until_slid(self, way: float) -> None:
        """Go on until the block has come so far [m]."""
        while self.away - self.up < way:
            assert self.data.time < 12.0, "it does not slide"
            self.step()


@pytest.mark.parametrize(("degrees", "rate"), [(20.0, 5.0), (30.0, 5.0), (38.0, 3.0)])
def test_a_block_lets_go_at_the_angle_of_friction(degrees, rate):
    """tan 30 = 0.577. When it has come 1 mm the slope has grown as long as the law of its slide says."""
    friction, turning = math.tan(math.radians(degrees)), math.radians(rate)
    tilting = Tilting(friction, 0.09, turning)
    tilting.until_slid(0.001)
    since = (0.001 / slid(friction, turning, 1.0)[0]) ** (1 / 3)
    assert math.degrees(tilting.slope) == pytest.approx(degrees + rate * since, abs=0.25)
    begun = tilting.data.time
    tilting.until_slid(0.05)
    more = (0.05 / slid(friction, turning, 1.0)[0]) ** (1 / 3) - since
    assert tilting.data.time - begun == pytest.approx(more, rel=0.06)


def test_below_that_angle_it_stays():
    """At 0.95 of the tangent of a slope at which the ramp stops."""
    gentle = replace(RAMP, most=35.0)
    tilting = Tilting(math.tan(math.radians(35.0)) / 0.95, 0.05, math.radians(12.0), gentle)
    while tilting.data.time < 5.0:
        tilting.step()
    assert math.degrees(tilting.slope) == pytest.approx(35.0, abs=0.1)
    assert abs(tilting.away - tilting.up) < 0.001


def test_a_push_on_its_far_end_turns_it_by_the_torque_over_the_stiffness():
    tilting = Tilting(0.5, 0.05, 0.0)
    for _ in range(300):
        tilting.step()
    before = tilting.slope
    tilting.data.xfrc_applied[tilting.model.body("incline/slab").id, :3] = [0, 0, -20.0]
    for _ in range(300):
        tilting.step()
    lever = RAMP.length / 2 * math.cos(before)
    assert before - tilting.slope == pytest.approx(20.0 * lever / STIFFNESS, rel=0.05)

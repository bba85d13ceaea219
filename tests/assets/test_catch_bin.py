"""The bin is drawn over the table against its friction, and keeps what falls into it."""

import mujoco
import numpy as np
import pytest

from scengen.assets.box import Cube
from scengen.assets.catch_bin import CatchBin
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.geometry import UP
from scengen.robots.jaw import PALM_ABOVE, PALM_ACROSS, pinch

BIN = CatchBin()


def simulated(force: float = 0.0, dropped: int = 0, seconds: float = 0.4):
    """The bin, pushed along y at its centre of mass [N], with blocks let go one over the other above it."""
    scene = table()
    place(scene, BIN, "bin", [0, 0, TABLE_TOP])
    for k in range(dropped):
        place(scene, Cube(edge=0.026, mass=0.02), f"block_{k}", [0, 0, TABLE_TOP + 0.13 + 0.04 * k])
    model = scene.compile()
    data = mujoco.MjData(model)
    data.xfrc_applied[model.body("bin").id, 1] = force
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    return model, data


@pytest.mark.parametrize("beyond", [0.4, 1.4])
def test_it_slides_by_what_the_push_exceeds_the_friction(beyond):
    """F = mu m g + m a."""
    model, _ = simulated(seconds=0.002)
    mass = float(model.body("bin").mass[0])
    _, data = simulated(force=mass * (BIN.friction * 9.81 + beyond))
    assert data.body("bin").xpos[1] == pytest.approx(beyond * 0.4**2 / 2, rel=0.05)
    _, still = simulated(force=0.9 * mass * BIN.friction * 9.81)
    assert abs(still.body("bin").xpos[1]) < 0.001


def test_three_blocks_on_top_of_each_other_are_below_the_rim():
    _, data = simulated(dropped=3, seconds=1.5)
    for k in range(3):
        at = data.body(f"block_{k}").xipos - TABLE_TOP * UP
        assert at[2] < BIN.rim and np.abs(at[:2]).max() < BIN.width / 2


def test_the_hand_that_holds_it_is_out_of_the_way_of_what_falls_in():
    """The palm ends before the inside starts by the thickness of the wall, or stays above the rim."""
    assert BIN.handle[2] + PALM_ABOVE > BIN.rim + 0.015
    assert BIN.handle[0] + PALM_ACROSS < -BIN.width / 2 + 0.001
    assert pinch(BIN.grip) > 20.0

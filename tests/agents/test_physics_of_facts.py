"""Numbers in facts are those of the physics: on one side of them things happen, on the other side they do not."""

import math
from dataclasses import replace

import numpy as np
import pytest

from scengen.assets.prop import TABLE_HALF, TABLE_TOP
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.tasks.ball_cage_escape import BallCageEscape
from scengen.tasks.domino_single import DominoSingle
from scengen.tasks.edge_slide import EdgeSlide
from scengen.tasks.pendulum_grasp import PendulumGrasp


def world_of(scenario):
    return World.load(scene_text.emit(scenario.build())[0])


def moved(world, body, pos, quat=(1.0, 0.0, 0.0, 0.0)):
    """Place a free body, at rest."""
    address = world.model.jnt_qposadr[world.model.body_jntadr[world.body(body)]]
    world.data.qpos[address : address + 7] = [*pos, *quat]


def settled(world, seconds):
    for _ in range(round(seconds / 0.01)):
        world.step_filtered(world.idle.astype(np.float32))


@pytest.mark.parametrize(("thickness", "off"), [(0.012, -2.0), (0.012, 2.0), (0.032, -2.0), (0.032, 2.0)])
def test_the_first_domino_falls_from_the_stated_angle_on(thickness, off):
    """Two degrees below it the domino rocks back, two degrees above it falls over, thick or thin."""
    nominal = DominoSingle()
    scenario = replace(nominal, starter=replace(nominal.starter, thickness=thickness))
    world, tilt = world_of(scenario), math.radians(scenario.facts()["tipping"] + off)
    edge = scenario.spot(0) + thickness / 2 * scenario.u  # it turns about the foot's edge towards the next domino
    back = np.array([-thickness / 2 * math.cos(tilt), 0.0, thickness / 2 * math.sin(tilt) + 1e-4])
    moved(world, "tile_0", edge + back, (math.cos(tilt / 2), 0.0, math.sin(tilt / 2), 0.0))
    settled(world, 1.5)
    assert (world.tilt("tile_0") > tilt) == (off > 0)


@pytest.mark.parametrize("off_centre", [0.0, 0.015])
@pytest.mark.parametrize("off", [-0.005, 0.005])
def test_the_plate_tips_from_the_stated_way_on(off_centre, off):
    nominal = EdgeSlide()
    scenario = replace(nominal, plate=replace(nominal.plate, off_centre=off_centre))
    way = scenario.facts()["way"]
    world = world_of(scenario)
    quat = (math.cos(scenario.turn / 2), 0.0, 0.0, math.sin(scenario.turn / 2))
    moved(world, "plate", [scenario.x, TABLE_HALF - (scenario.away - way - off), TABLE_TOP + 1e-4], quat)
    settled(world, 1.5)
    assert (world.com("plate")[2] < TABLE_TOP - 0.05) == (off > 0)


@pytest.mark.parametrize("amplitude", [25.0, 45.0])
def test_the_pendulum_returns_after_the_stated_period(amplitude):
    scenario = replace(PendulumGrasp(), amplitude=amplitude)
    world, heights = world_of(scenario), []
    facts = scenario.facts()
    bob = next(world.model.body(k).name for k in range(world.model.nbody) if "bob" in world.model.body(k).name)
    for _ in range(round(2.2 * facts["period"] / 0.01)):
        world.step_filtered(world.idle.astype(np.float32))
        heights.append(world.com(bob)[2])
    lows = [k for k in range(1, len(heights) - 1) if heights[k - 1] > heights[k] <= heights[k + 1]]
    assert 2 * np.diff(lows).mean() * 0.01 == pytest.approx(facts["period"], abs=0.03)
    rise = facts["length"] * (1.0 - math.cos(math.radians(amplitude)))
    assert max(heights) - min(heights) == pytest.approx(rise, rel=0.05)


@pytest.mark.parametrize("yaw", [0.0, 120.0])
@pytest.mark.parametrize("off", [-2.0, 2.0])
def test_the_ball_rolls_in_its_cage_from_the_stated_tilt_on(yaw, off):
    """Instead of the cage on its stool, gravity is tilted."""
    scenario = replace(BallCageEscape(), yaw=yaw)
    world, tilt = world_of(scenario), math.radians(scenario.facts()["tilt"] + off)
    settled(world, 0.5)
    start = world.com("ball").copy()
    along = scenario.axes[:, 0]
    world.model.opt.gravity[:] = 9.81 * (math.sin(tilt) * along - np.array([0.0, 0.0, math.cos(tilt)]))
    settled(world, 2.0)
    assert (np.linalg.norm(world.com("ball") - start) > 0.01) == (off > 0)

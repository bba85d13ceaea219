"""A hand feels what hangs in it: its weight, and how far from the hand it pulls."""

import numpy as np
import pytest

from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.rod import Rod
from scengen.geometry import UP
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.skills.jaw import pick, weigh
from scengen.skills.motion import hold


def weighed(rod):
    """A world whose hand holds a rod in the middle, and what it felt of it."""
    scene, felt = table(), []
    place(scene, rod, "rod", [-0.1, 0.0, TABLE_TOP])
    world = World.load(scene_text.emit(scene)[0])

    def plan():
        yield from pick(world.arm, [-0.1, 0.0, TABLE_TOP + 0.014], closing=[1.0, 0.0, 0.0], lift=0.08)
        felt.append((yield from weigh(world.arm)))
        yield from hold(world.arm, 1.0)

    for action in plan():
        world.step(action)
    return world, felt[0]


@pytest.mark.parametrize(("mass", "com"), [(0.08, 0.05), (0.15, -0.08)])
def test_it_feels_weight_and_lever(mass, com):
    world, load = weighed(Rod(mass=mass, com=com))
    lever = world.com("rod") - world.arm.hand
    assert load[:3] == pytest.approx(mass * 9.81 * UP, abs=0.03 * mass * 9.81)
    assert np.cross(UP, load[3:])[1] / load[2] == pytest.approx(lever[1], abs=0.001)


def test_at_rest_that_is_what_the_wrist_reads_less_the_weight_of_the_hand():
    world, _ = weighed(Rod(com=0.05))
    model, arm = world.model, world.arm
    reading = arm.wrist_rot @ arm.wrench()[:3]
    hand = model.body_subtreemass[model.body("gripper0_right_right_gripper").id] * model.opt.gravity
    assert reading + hand == pytest.approx(arm.load()[:3], abs=0.03)
    assert np.linalg.norm(reading) > 3 * np.linalg.norm(arm.load()[:3]), "most of what the wrist carries is the hand"


def test_feeling_changes_nothing():
    world, _ = weighed(Rod())
    before = world.digest
    world.arm.load(), world.arm.wrench()
    assert world.digest == before

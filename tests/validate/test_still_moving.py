"""What has not come to rest is named."""

from helpers import REFERENCE

from scengen.pool import Pool
from scengen.sim.world import World
from scengen.validate.rollout import still_moving


def test_bodies_that_move_are_named_and_those_at_rest_are_not():
    row = next(Pool.open(REFERENCE).rows())
    world = World.load(row.scene_xml, row.embodiment)
    assert still_moving(world) == []
    world.data.qvel[world.model.body_dofadr[world.body("slab")]] = 0.01
    assert still_moving(world) == ["slab"]
    world.data.qvel[world.model.joint("robot0_joint1").dofadr] = 0.2
    assert still_moving(world) == ["slab", "robot"]

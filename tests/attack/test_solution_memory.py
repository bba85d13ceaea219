"""What an object-centric memory does where a body of its own scene is missing."""

import numpy as np

from scengen.assets.prop import table
from scengen.attack.solution_memory import HandPath, PathPart
from scengen.sim import scene_text
from scengen.sim.world import World


def test_a_path_to_a_body_that_is_not_there_stays_where_it_was():
    """Scenes of a family may have more or fewer bodies than the one that is remembered."""
    world = World.load(scene_text.emit(table())[0])
    arm, rows = world.arm, 60
    aim = arm.hand + np.array([0.05, 0.0, -0.05])
    part = PathPart(0, "a body of another scene", np.array([0.3, 0.2, 0.8]), np.eye(3))
    path = HandPath(np.zeros((rows, 7)), np.tile(aim, (rows, 1)), np.tile(arm.hand_rot, (rows, 1, 1)), (part,))
    for action in path.follow(arm):
        world.step(action)
    assert np.linalg.norm(arm.hand - aim) < 0.015

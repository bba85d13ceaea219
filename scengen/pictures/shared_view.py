"""One direction for all pictures of a pool: sheet, film and report show its scenarios from the same side."""

from ..errors import ScengenError
from ..look.looks import PLAIN
from ..pool import Pool, PoolRow
from ..samplers.split import ID
from ..samplers.task import Task
from ..sim.world import World
from ..validate.playable import check_row, stored_world
from ..validate.rebuilt import rebuild
from .film import FRAMED, Take
from .twins import DIRECTIONS, PICTURE, comparison_view
from .views import Directions, clearest

ASPECT = PICTURE[0] / PICTURE[1]
"""Width of pictures over their height."""


def directions_of(pool: Pool, task: Task) -> Directions:
    """The direction from which a pool's first scenario shows best: how it differs from its training twin, if it does;
    else its witness.

    Args:
        task: the task of the pool as it was when the pool was made.

    Raises:
        ScengenError: the scene or the witness cannot be played.
    """
    row = check_row(next(pool.rows()))
    world = stored_world(row, PLAIN)
    if row.shifted:
        twin = World.load(twin_scene(pool, task, row), row.embodiment, PLAIN)
        view = comparison_view((twin, world), ASPECT, DIRECTIONS)
    else:
        take = Take.witness(row, task.scenario(row.params))
        states = [world.state() for _ in take.moments(world, take.even(FRAMED))]
        view = clearest(world, ASPECT, states)
    return [(view.azimuth, view.elevation)]


def twin_scene(pool: Pool, task: Task, row: PoolRow) -> str:
    """The scene of a scenario's training twin, made again from its seed and index.

    Raises:
        ScengenError: the family has changed since, so that it is another scenario.
    """
    trained = task.draw(ID, row.seed, row.index, task.design(pool.manifest.config.sampler)).scenario
    if trained.id != row.id_twin:
        raise ScengenError(
            f"{row.id}: its training twin is now {trained.id}, but the pool has {row.id_twin}; the family has changed "
            "since then, see scengen verify"
        )
    return rebuild(trained)

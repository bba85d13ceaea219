"""Trial runs of untrusted scenes in a process that can be ended, before anything else uses the scenes."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress

from ..episode import Actions
from ..errors import PoolError, Unstable, cut
from ..look.looks import Look
from ..pool.row import NO_WITNESS, SceneRow
from ..pool.rows import AnyRow
from ..scenario import Conditions
from ..sim.world import World
from ..work.parallel import UNTRUSTED_LIMITS, Workers, apart, each
from .impaired import posed

Played = tuple[str, str, Actions]
"""A scene, MJCF, its robot, and actions."""


def play(what: Played) -> None:
    """Compile a scene and play actions in it. The result is not used."""
    scene_xml, embodiment, actions = what
    with scene_errors():
        world = World.load(scene_xml, embodiment)
    world.reset()
    with suppress(Unstable):  # later uses of the scene meet it again
        for action in actions:
            world.step_filtered(action)


def stored_world(row: SceneRow, look: Look | None = None, conditions: Conditions | None = None, seed: int = 0) -> World:
    """The world of a stored scene at its start.

    Args:
        look: see `World.load`.
        conditions: other conditions of control than the usual ones.
        seed: another number draws other values of them.

    Raises:
        PoolError: MuJoCo does not read the scene.
        BadConfig: the scene has no free start under these conditions, or has conditions already.
    """
    with scene_errors(f" of {row.name}"):
        return World.load(posed(row.scene_xml, conditions, row.id, seed), row.embodiment, look)


@contextmanager
def scene_errors(which: str = "") -> Iterator[None]:
    """Report errors of MuJoCo about a stored scene in one line.

    Raises:
        PoolError: that line.
    """
    try:
        yield
    except ValueError as error:
        why = cut(" ".join(str(error).split()), 200)
        raise PoolError(f"MuJoCo does not read the scene{which}: {why}; see scengen verify") from None


def unplayable(rows: Iterable[SceneRow], workers: Workers = 1) -> Iterator[tuple[str, str]]:
    """Id and reason of every scenario that crashes or exceeds the limits of a scenario.

    Raises:
        ScengenError: a scene does not compile.
    """
    tried = each(_try, rows, workers, UNTRUSTED_LIMITS, lambda row, reason: (row.id, f"playing it {reason}"))
    return (found for found in tried if found is not None)


def _try(row: SceneRow) -> tuple[str, str] | None:
    play((row.scene_xml, row.embodiment, row.witness))
    return None


def check_row(row: AnyRow) -> AnyRow:
    """Refuse a scenario that crashes or exceeds the limits of a scenario.

    Raises:
        ScengenError: it does; or its scene does not compile.
    """
    apart(play, (row.scene_xml, row.embodiment, row.witness), UNTRUSTED_LIMITS, f"playing {row.name}")
    return row


def check_scene(scene_xml: str, embodiment: str) -> None:
    """Refuse a scene that crashes or exceeds the limits at its start.

    Raises:
        ScengenError: it does; or it does not compile.
    """
    apart(play, (scene_xml, embodiment, NO_WITNESS), UNTRUSTED_LIMITS, "compiling a scene")

"""Streams of a recording: which are recorded, and the names of their columns and entries."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from ..envs.object_state import NAME, Bodies, ObjectState, all_bodies
from ..envs.observations import Stream, cameras_of, privileged, proprioception, streams_of
from ..errors import BadConfig, UnknownName
from ..orientation import UPRIGHT, Orientation
from ..samplers.task import Task
from ..sim.embodiment import hands
from .lerobot import Feature

ENVIRONMENT = "observation.environment_state"
"""LeRobot's name of `object-state`."""


@dataclass
class Playing:
    """Data of the running scenario that streams need."""

    orientation: Orientation = UPRIGHT


@dataclass(frozen=True)
class Recorded:
    """Streams of a recording."""

    streams: Mapping[str, Stream]
    bodies: tuple[str, ...]
    """Bodies of the recorded streams of bodies, of which a scene may lack some; none if there are no such streams."""
    playing: Playing
    """Scenario that is played; the recorder keeps it up to date."""


def recorded_streams(
    robot: str, tasks: Sequence[Task], bodies: Iterable[Bodies], names: Sequence[str] | None, whole_state: bool
) -> Recorded:
    """The streams to record. The robot's own pose is always among them.

    Args:
        robot: embodiment of the scenarios.
        bodies: bodies of each task; read only if a stream needs them.
        names: streams besides the robot's own pose; None for all that are not privileged.
        whole_state: whether `object-state` is recorded, too.

    Raises:
        ScengenError: there is no such stream.
    """
    playing, own = Playing(), streams_of(robot)
    wanted = [*own] if names is None else [*dict.fromkeys([*proprioception(robot), *names])]
    wanted += [NAME] if whole_state and NAME not in wanted else []
    if set(wanted) <= set(own):
        return Recorded({name: own[name] for name in wanted}, (), playing)
    state = ObjectState(all_bodies(bodies), len(hands(robot)))
    known = {**own}
    for task in tasks:
        known |= privileged(state, task.family, lambda: playing.orientation)
    for name in wanted:
        if name in cameras_of(robot):
            raise BadConfig(f"observations = {name}; it is a camera: pass cameras={name}")
        if name not in known:
            raise UnknownName("observation", name, known)
    return Recorded({name: known[name] for name in wanted}, state.ordered, playing)


def column_of(stream: str) -> str:
    """Name of a stream's column."""
    return ENVIRONMENT if stream == NAME else stream


def feature_of(name: str, stream: Stream) -> Feature:
    """Column of a stream. A grid becomes a vector, row by row: readers of LeRobot's data sets expect vectors."""
    if not stream.grid:
        return Feature("float32", stream.shape, stream.entries(name))
    rows, columns = stream.grid
    entries = tuple(f"{name}.row{row}_column{column}" for row in range(rows) for column in range(columns))
    return Feature("float32", (rows * columns,), entries)

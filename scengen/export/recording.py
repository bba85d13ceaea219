"""Recordings: witnesses played again and written as a LeRobot data set, with the paper's streams.

LeRobot gives a data set one rate, `fps`. A row is what was seen at one moment and what was done from then to the next
row: with 25 rows a second, in four control periods. Nothing of the witness gets lost: `actions` holds what the
controller received in all control periods of the row. These actions have passed the teleoperation filter; an
environment takes them as they are.
"""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path

from ..envs.observations import CAMERAS, Stream, cameras_of, proprioception, streams_of
from ..errors import BadConfig, PoolError, UnknownName, at_least
from ..orientation import Orientation
from ..pictures.film import periods_between
from ..pictures.render import Camera, Picture
from ..pictures.video import check_size
from ..pool import Pool, PoolRow
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim.world import World, action_size
from ..targets import try_folder
from ..validate.identity import check_versions, versions
from ..validate.playable import unplayable
from .cameras import calibration
from .lerobot import DataSet, Feature
from .play import play

NONE = "none"
ABOUT = ("id", "task", "code", "split", "axes", "shifted", "seed", "index", "id_twin", "scene_sha256", "witness_sha256")
"""Columns of a pool that every episode carries, as `scengen/<column>` in LeRobot's table of episodes."""


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen record`; meanings stand in conf/command/record.yaml."""

    pool: str | list[str] = ""
    to: str = ""
    n: int | None = None
    fps: int = 25
    cameras: str | list[str] = field(default_factory=lambda: list(CAMERAS))
    width: int = 640
    height: int = 480

    @property
    def folders(self) -> list[str]:
        """The pools to record."""
        return self.pool if isinstance(self.pool, list) else [self.pool]

    @property
    def eyes(self) -> list[str]:
        """Names of the cameras to film with."""
        named = self.cameras if isinstance(self.cameras, list) else [self.cameras]
        return [] if named == [NONE] else named

    @property
    def unfinished(self) -> Path:
        """Where the data set is until everything is in it."""
        return Path(f"{self.to}.unfinished")

    def check(self) -> None:
        """Raise `ScengenError` for settings that make no sense."""
        periods_between(self.fps)
        check_size(self.width, self.height)
        at_least(self, n=1, width=2, height=2)
        if Path(self.to).exists():
            raise BadConfig(f"{self.to} exists already; delete it, or name another folder")
        if self.unfinished.exists():
            raise BadConfig(
                f"{self.unfinished} is left from a recording that was killed, or one is under way; delete it"
            )


@dataclass(frozen=True)
class Summary:
    """What a recording came to."""

    episodes: int
    rows: int
    failed: tuple[str, ...]
    """Scenarios whose witness did not reach the goal here; their episodes say so."""
    lost: Mapping[str, str]
    """Scenarios that were left out, and why: they cannot be played within the limits."""


def record(settings: Settings, find_task: Callable[[str], Task], progress: Callable[[int, int], None]) -> Summary:
    """Write the data set that the settings describe; its folder appears when it is complete.

    Args:
        find_task: gives the task of a name.
        progress: told how many episodes are done and how many there are.

    Raises:
        ScengenError: a pool or a setting is not as it must be, or pictures cannot be made here.
    """
    settings.check()
    try_folder(settings.to)
    pools = [Pool.open(folder).check() for folder in settings.folders]
    robot, count = _robot(pools), sum(map(len, pools))
    for name in settings.eyes:
        if name not in (known := cameras_of(robot)):
            raise UnknownName("camera", name, [NONE, *known])
    count = min(count, settings.n or count)
    streams = streams_of(robot)
    try:
        settings.unfinished.mkdir(parents=True)
    except OSError as error:
        raise BadConfig(f"{settings.unfinished} cannot be written: {error.strerror}") from None
    try:
        size, features = (settings.width, settings.height), _features(settings, robot)
        failed, lost = [], dict(unplayable(_rows(pools, count)))
        with DataSet(settings.unfinished, settings.fps, robot, features, settings.eyes, size) as data:
            for row in _rows(pools, count):
                if row.id in lost:
                    continue
                scenario = find_task(row.task).scenario(row.params)
                if not _episode(data, row, scenario, settings, streams):
                    failed.append(row.id)
                progress(len(data.episodes), count)
        source = {"pools": [pool.sha256 for pool in pools], "versions": versions()}
        (settings.unfinished / "meta" / "scengen.json").write_text(json.dumps(source, indent=1) + "\n")
        settings.unfinished.rename(settings.to)
    except BaseException:
        shutil.rmtree(settings.unfinished)
        raise
    return Summary(len(data.episodes), data.rows, tuple(failed), lost)


def _rows(pools: Sequence[Pool], count: int) -> Iterator[PoolRow]:
    return islice(chain.from_iterable(pool.rows() for pool in pools), count)


def _episode(data: DataSet, row: PoolRow, scenario: Scenario, settings: Settings, streams: dict[str, Stream]) -> bool:
    """Add one scenario's episode, and say whether it reached the goal."""
    world, success = World.load(row.scene_xml, row.embodiment, visual=bool(settings.eyes)), False
    held, size = scenario.orientation, (settings.width, settings.height)
    with ExitStack() as stack:
        views = cameras_of(row.embodiment)
        pictures = _camera(stack, world, settings, views, held)
        for name in settings.eyes:
            data.calibrate(name, calibration(world, views[name], *size, held), str(row.name))
        for moment in play(world, scenario, row, periods_between(settings.fps), streams, pictures):
            data.add(moment.values(proprioception(row.embodiment)), moment.pictures)
            success = moment.success
    columns = row.plain()
    about = {f"scengen/{name}": columns[name] for name in ABOUT}
    data.end_episode(row.instruction, {**about, "scengen/success": success})
    return success


def _camera(
    stack: ExitStack, world: World, settings: Settings, views: Mapping[str, str], held: Orientation
) -> Callable[[], dict[str, Picture]]:
    """What takes the pictures of a moment, by the paper's names, as policies see them; without any, no OpenGL either.

    Raises:
        BadConfig: they are seen turned by a quarter and are not square.
    """
    if not settings.eyes:
        return dict
    held.check_size(settings.width, settings.height)
    camera = Camera(world, settings.width, settings.height)
    stack.callback(camera.close)
    return lambda: {name: held.apply(camera.take(views[name])) for name in settings.eyes}


def _features(settings: Settings, robot: str) -> dict[str, Feature]:
    """The columns of `Moment.values`."""
    seen = {name: Feature("float32", stream.shape) for name, stream in streams_of(robot).items()}
    state = sum(seen[name].shape[0] for name in proprioception(robot))
    return {
        **seen,
        "observation.state": Feature("float32", (state,)),
        "action": Feature("float32", (action_size(robot),)),
        "actions": Feature("float32", (periods_between(settings.fps), action_size(robot))),
        "reward": Feature("float32"),
        "next.reward": Feature("float32"),
        "next.done": Feature("bool"),
        "next.success": Feature("bool"),
    }


def _robot(pools: list[Pool]) -> str:
    """The one embodiment of all scenarios."""
    robots = set()
    for pool in pools:
        check_versions(pool.versions, str(pool.folder))
        robots |= {embodiment for (embodiment,) in pool.columns("embodiment")}
    if not robots:
        raise PoolError(f"{', '.join(str(pool.folder) for pool in pools)}: no scenario to record; see scengen generate")
    if len(robots) > 1:
        raise BadConfig(f"pools for {' and '.join(sorted(robots))}; a data set has one robot: record them apart")
    return robots.pop()

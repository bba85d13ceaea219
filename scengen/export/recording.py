"""Recordings: witnesses or demonstrations replayed and written as a LeRobot data set or for robomimic, with the paper's
streams.

A LeRobot data set has one rate, `fps`. A row holds the observations at one moment and the actions until the next row:
with 25 rows per second, those of four control periods. All actions are kept: `control.actions` holds those that the
controller received in all control periods of the row. LeRobot takes every column whose name starts with `action` for an
output of the policy, which explains the name. These actions have passed the teleoperation filter; give them to an
environment without a filter. robomimic's data have a row for every control period (`scengen.export.robomimic`).
"""

import itertools
import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from functools import cached_property, partial
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np

from .. import compose
from ..envs.object_state import bodies_of
from ..envs.observations import CAMERAS, Stream, action_names, cameras_of, named, proprioception
from ..episode import STRICT, check_rules
from ..errors import BadConfig, UnknownName
from ..installation import versions
from ..look.looks import PLAIN, ROOM, Look, look_named
from ..orientation import Orientation
from ..perturb.drawn import Senses
from ..perturb.language import Words
from ..perturb.perturbation import Perturbation
from ..pictures.film import periods_between
from ..pictures.render import Camera, Picture
from ..pictures.video import check_size
from ..pool import collection, kinds
from ..pool.demonstrations import demonstration_folders, is_demonstrations
from ..pool.row import DemonstrationRow
from ..sim.world import World
from ..validate.playable import stored_world, unplayable
from ..work.limits import at_least
from ..work.log import different
from ..work.parallel import Workers
from ..work.targets import appearing, clear_unfinished, try_file, try_folder
from ..work.typed import typed
from .cameras import calibration
from .dataset import TASK_VERSION, Recording
from .hdf5 import check_target
from .lerobot import DatasetWriter, Feature
from .native import FULL_RATE, NativeWriter
from .replay import DatasetRow, Snapshot, WitnessReplay, read
from .sources import LEROBOT, ROBOMIMIC, number_of, opened, origins_of, robot_of, rows_of, scenes_of, texts_of
from .streams import Recorded, column_of, feature_of, recorded_streams

NONE = "none"
"""Value of `cameras` for a recording without pictures."""
ONE_RATE = "one"
"""Value of `rates` for a recording with one rate."""
NATIVE_RATES = "native"
"""Value of `rates` for a recording with tables of the paper's rates besides."""
PAPER_RATE = 25
"""The paper's rate of pictures [1/s]."""
EPISODE_COLUMNS = (
    *("id", "task", "code", "split", "axes", "shifted", "params", "seed", "index", "id_twin", "horizon"),
    *("scene_sha256", "witness_sha256"),
)
"""Columns of a pool that are also columns `scengen/<column>` of LeRobot's table of episodes."""
DEMONSTRATION_COLUMNS = ("run", "style", "seconds")
"""Columns of demonstrations that LeRobot's table of episodes has, too."""
CONTROL_ACTIONS = "control.actions"
"""Column with the actions of all control periods of a row."""
STATE = "observation.state"
"""LeRobot's name of the robot's own pose."""


@dataclass(frozen=True)
class RecordSettings:
    """Settings of `scengen record`; meanings stand in conf/command/record.yaml."""

    pool: str | list[str] = ""
    to: str = ""
    format: str = LEROBOT
    n: int | None = None
    failed: bool = False
    fps: int | None = None
    rates: str = ONE_RATE
    observations: str | list[str] | None = None
    environment_state: bool | None = None
    cameras: str | list[str] = field(default_factory=lambda: list(CAMERAS))
    width: int = 640
    height: int = 480
    look: str | None = None
    perturb: str | None = None
    perturb_seed: int = 0
    looks: int = 1
    workers: Workers = 1

    @cached_property
    def folders(self) -> list[str]:
        """Folders of the pools, or of the demonstrations, to record."""
        found = demonstration_folders(self.pool)
        return found if any(map(is_demonstrations, found)) else collection.folders(self.pool)

    @property
    def camera_names(self) -> list[str]:
        """Names of the cameras to record."""
        named = self.cameras if isinstance(self.cameras, list) else [self.cameras]
        return [] if named == [NONE] else named

    @property
    def shown(self) -> Look | None:
        """Look of the pictures, if there are any. By default robosuite's recordings are plain, as its environments."""
        chosen = look_named(self.look or (PLAIN if self.format == ROBOMIMIC else ROOM).name)
        return chosen if self.camera_names else None

    @cached_property
    def perturbation(self) -> Perturbation:
        return Perturbation.parse(self.perturb)

    @property
    def rate(self) -> int:
        """Number of rows per second."""
        return self.fps or (PAPER_RATE if self.format == LEROBOT else FULL_RATE)

    @property
    def observed(self) -> list[str] | None:
        """Names of the streams to record besides the robot's own pose; None for all that are not privileged."""
        return [self.observations] if isinstance(self.observations, str) else self.observations

    @property
    def privileged(self) -> bool:
        """Whether the rows hold `object-state`. By default LeRobot data sets with pictures do not, nor those whose
        streams are chosen."""
        if self.environment_state is None:
            return self.observations is None and (self.format == ROBOMIMIC or not self.camera_names)
        return self.environment_state

    def check(self) -> None:
        """Raise `ScengenError` for invalid settings."""
        if self.format not in (LEROBOT, ROBOMIMIC):
            raise UnknownName("format of recordings", self.format, [LEROBOT, ROBOMIMIC])
        if self.rates not in (ONE_RATE, NATIVE_RATES):
            raise UnknownName("rates", self.rates, [ONE_RATE, NATIVE_RATES])
        look_named(self.look or ROOM.name)
        at_least(self, n=1, fps=1, width=2, height=2, workers=1, looks=1, perturb_seed=0)
        periods_between(self.rate)
        if self.looks > 1 and not self.perturbation:
            raise BadConfig(f"looks = {self.looks}; perturb= makes them differ: give it, or leave looks out")
        self.perturbation.check_perceived("a recording films what has happened; give it to demos, as a part of split=")
        if self.perturbation and self.format == ROBOMIMIC:
            raise BadConfig(f"perturb = {self.perturb}; robosuite draws its own pictures: use format={LEROBOT}")
        if self.format == ROBOMIMIC:
            check_target(self.to)
            if self.rate != FULL_RATE:
                accepted = f"robomimic's data have {FULL_RATE} rows per second, for replay in robosuite: leave it out"
                raise BadConfig(f"fps = {self.fps}; {accepted}")
            if self.rates == NATIVE_RATES:
                raise BadConfig(
                    f"rates = {self.rates}; robomimic's data have {FULL_RATE} rows per second: leave it out"
                )
        else:
            check_size(self.width, self.height)
        kinds.check_target(self.to, kinds.RECORDING)
        clear_unfinished(self.to)
        (try_file if self.format == ROBOMIMIC else try_folder)(self.to)


@dataclass(frozen=True)
class RecordSummary:
    """Result of a recording."""

    episodes: int
    """Number of episodes."""
    rows: int
    """Number of rows."""
    failed: Sequence[str]
    """Names of the scenarios whose actions did not reach the goal; their episodes are marked as failures."""
    lost: Mapping[str, str]
    """Reasons by name of the scenarios that were left out, because they cannot be replayed within the limits."""
    earlier: bool = False
    """Whether an earlier run of the same command has written it."""


def record(settings: RecordSettings, progress: Callable[[int, int], None], search: Sequence[str] = ()) -> RecordSummary:
    """Write the recording that the settings describe. It appears when it is complete.

    Args:
        progress: function that gets the number of finished episodes and the number of all.
        search: overrides that add folders of other packages, see `task_files.search_path`.

    Raises:
        ScengenError: a pool or a setting is invalid, or OpenGL is missing for pictures.
    """
    settings.check()
    pools = opened(settings.folders)
    robot, count = robot_of(pools, settings.failed), sum(number_of(pool, settings.failed) for pool in pools)
    for name in settings.camera_names:
        if name not in (known := cameras_of(robot)):
            raise UnknownName("camera", name, [NONE, *known])
    count = min(count, settings.n or count)
    count *= settings.looks
    names = sorted({name for pool in pools for name in texts_of(pool, "task", settings.failed)})
    tasks = {name: compose.load_task(name, search) for name in names}
    if settings.format == ROBOMIMIC and len(tasks) > 1:
        raise BadConfig(f"pools of {' and '.join(tasks)}; robomimic's file has one environment: record them separately")
    bodies = (bodies_of(task, scenes_of(pools, name)) for name, task in tasks.items())
    recorded = recorded_streams(robot, list(tasks.values()), bodies, settings.observed, settings.privileged)
    views = [cameras_of(robot)[name] for name in settings.camera_names]
    settings.perturbation.check([*recorded.streams], views, settings.shown or ROOM, "{} in cameras= or observations=")
    for name, task in tasks.items():
        settings.perturbation.check_words(Words.of(name, task.instruction, search))
    source = _source(settings, [pool.sha256 for pool in pools], {name: task.version for name, task in tasks.items()})
    if Path(settings.to).exists():
        return _again(settings, source)
    failed, left_out, styles = list[str](), dict[str, str](), Counter[str]()
    with appearing(settings.to, folder=settings.format == LEROBOT) as path:
        scenarios = count // settings.looks
        lost = dict(unplayable(rows_of(pools, scenarios, settings.failed), settings.workers))
        with _writer(settings, path, robot, recorded, next(iter(tasks)), tuple(search)) as writer:
            episodes = rows_of(pools, scenarios, settings.failed), origins_of(pools, scenarios, settings.failed)
            looks = range(settings.perturb_seed, settings.perturb_seed + settings.looks)
            for (row, origin), seed in itertools.product(zip(*episodes, strict=True), looks):
                if row.id in lost:
                    left_out[str(row.name)] = lost[row.id]
                    continue
                with ExitStack() as stack:
                    shown = settings.shown and settings.perturbation.dressed(settings.shown)
                    world, scenario = stored_world(row, shown), tasks[row.task].scenario(row.params)
                    held, kept = scenario.orientation, {"perturb": str(settings.perturbation), "perturb_seed": seed}
                    calibrations = _calibrations(settings, world, row.embodiment, held)
                    senses = settings.perturbation.senses(world.model, row.id, row.task, row.instruction, seed, search)
                    world.reset()
                    pictures = _camera(stack, world, settings, cameras_of(row.embodiment), held, senses)
                    recorded.playing.orientation = held
                    observe = partial(Snapshot.of, world, writer.streams, pictures, senses)
                    sample = partial(read, world, writer.streams, senses) if settings.rates == NATIVE_RATES else None
                    periods, rules = periods_between(settings.rate), check_rules(origin.get("rules", STRICT))
                    told = senses.drawn.instruction or row.instruction
                    replay = WitnessReplay(row, scenario, world, periods, observe, sample, rules, calibrations, told)
                    origin = {**origin, **kept} if settings.perturbation else origin
                    if not writer.episode(replay, origin) and replay.promised:
                        failed.append(str(row.name))
                if isinstance(row, DemonstrationRow):
                    styles[row.style] += 1
                progress(writer.episodes, count)
            summary = RecordSummary(writer.episodes, writer.rows, failed, left_out)
            source["summary"] = asdict(summary)
            writer.finish({**source, "styles": dict(styles)} if styles else source)
    return summary


def _source(settings: RecordSettings, pools: Sequence[str], task_versions: Mapping[str, int]) -> dict[str, Any]:
    """Everything on which a recording depends, as plain data.

    Args:
        pools: hashes of the pools.
        task_versions: versions of the tasks by name.
    """
    chosen = {name: value for name, value in asdict(settings).items() if name not in ("pool", "to", "workers")}
    look = {"look": str(settings.shown)} if settings.shown else {}
    return {"pools": pools, "versions": versions(), "task_versions": task_versions, **look, "settings": chosen}


def _again(settings: RecordSettings, source: Mapping[str, Any]) -> RecordSummary:
    """The summary of a recording that is there already, for a command that is repeated.

    Raises:
        BadConfig: something else is there.
    """
    if settings.format == ROBOMIMIC:
        from .robomimic import stored_source

        stored = stored_source(Path(settings.to))
    else:
        stored = Recording(Path(settings.to)).source if Path(settings.to, kinds.RECORDING).is_file() else {}
    if names := different({name: stored.get(name) for name in source}, json.loads(json.dumps(source))):
        why = "has other " + ", ".join(names) if stored else "is not a recording"
        raise BadConfig(f"{settings.to} exists already and {why}; delete it, or give another name")
    return typed("summary", RecordSummary, {**stored["summary"], "earlier": True}, exact=True)


class Writer(Protocol):
    """Writer of one format, to be used in a `with` statement."""

    streams: Mapping[str, Stream]
    """Streams that a row needs."""

    @property
    def episodes(self) -> int:
        """Number of episodes written so far."""
        ...

    @property
    def rows(self) -> int:
        """Number of rows written so far."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def episode(self, replay: WitnessReplay, origin: Mapping[str, str]) -> bool:
        """Add one scenario's episode, and return whether it reached the goal.

        Args:
            origin: source, operator and rules of a demonstration; what is perturbed.
        """
        ...

    def finish(self, source: Mapping[str, Any]) -> None:
        """Write the metadata. `source` describes the origin of the data."""
        ...


def _writer(
    settings: RecordSettings,
    path: Path,
    robot: str,
    recorded: Recorded,
    task: str,
    search: tuple[str, ...],
) -> Writer:
    if settings.format == LEROBOT:
        return _LeRobotWriter(settings, path, robot, recorded)
    from . import robomimic

    size = (settings.width, settings.height)
    env, arguments = robomimic.environment(task, settings.folders, settings.camera_names, size, search)
    return robomimic.Demonstrations(path, robomimic.streams_of(recorded.streams, robot), env, arguments)


class _LeRobotWriter(DatasetWriter):
    """Writer of a LeRobot data set of replayed actions."""

    def __init__(self, settings: RecordSettings, path: Path, robot: str, recorded: Recorded):
        size, streams = (settings.width, settings.height), recorded.streams
        features = _features(settings, robot, streams)
        super().__init__(path, settings.rate, robot, features, settings.camera_names, size)
        self.settings, self.streams, self._bodies = settings, streams, recorded.bodies
        self._native = None
        if settings.rates == NATIVE_RATES:
            actions = len(action_names(robot))
            self._native = NativeWriter(path, settings.rate, streams, actions, settings.camera_names)

    def episode(self, replay: WitnessReplay, origin: Mapping[str, str]) -> bool:
        row, success = replay.row, False
        for name, found in replay.calibrations.items():
            self.calibrate(name, found, str(row.name))
        for dataset_row in replay.rows():
            self.add(_values(dataset_row, proprioception(row.embodiment)), dataset_row.observed.pictures)
            success = dataset_row.success
            if self._native:
                self._native.add(dataset_row)
        if self._native:
            self._native.end_episode(self.episodes)
        columns = row.plain()
        further = DEMONSTRATION_COLUMNS if isinstance(row, DemonstrationRow) else ()
        columns |= origin
        told = {f"scengen/{name}": columns[name] for name in (*EPISODE_COLUMNS, *further, *origin)}
        told[TASK_VERSION] = replay.scenario.VERSION
        model = replay.world.model
        present = {model.body(i).name for i in range(model.nbody)}
        absent = ",".join(body for body in self._bodies if body not in present)
        self.end_episode(replay.instruction, {**told, "scengen/absent": absent, "scengen/success": success})
        return success

    def finish(self, source: Mapping[str, Any]) -> None:
        super().finish({**source, "native": self._native.about()} if self._native else source)

    def _close(self) -> None:
        super()._close()
        if self._native:
            self._native.close()


def _values(row: DatasetRow, state: Sequence[str]) -> dict[str, Any]:
    """The columns of a row: the paper's streams, the actions, and the columns that LeRobot expects.

    Args:
        state: names of the streams that make up `observation.state`.
    """
    observed = row.observed.streams
    return {
        **{column_of(name): values.ravel() for name, values in observed.items()},
        STATE: np.concatenate([observed[name] for name in state]),
        "action": row.action,
        CONTROL_ACTIONS: row.actions,
        "reward": np.float32(row.success),
        "next.reward": np.float32(row.success),
        "next.done": row.done,
        "next.success": row.success,
        "waiting": row.waiting,
    }


def _calibrations(settings: RecordSettings, world: World, robot: str, held: Orientation) -> dict[str, dict[str, Any]]:
    """Calibration of each camera where it is supposed to stand, by the paper's name."""
    size, views = (settings.width, settings.height), cameras_of(robot)
    return {name: calibration(world, views[name], *size, held) for name in settings.camera_names}


def _camera(
    stack: ExitStack,
    world: World,
    settings: RecordSettings,
    views: Mapping[str, str],
    held: Orientation,
    senses: Senses,
) -> Callable[[], dict[str, Picture]]:
    """Function that takes the pictures of a moment, by the paper's names, in the orientation that policies see.

    Without cameras it does not need OpenGL.

    Raises:
        BadConfig: pictures are turned by a quarter and are not square.
    """
    if not settings.camera_names:
        return dict
    held.check_size(settings.width, settings.height)
    camera = Camera(world, settings.width, settings.height)
    stack.callback(camera.close)
    shown = {name: views[name] for name in settings.camera_names}
    return lambda: {name: senses.picture(v, world.time, held.apply(camera.take(v))) for name, v in shown.items()}


def _features(settings: RecordSettings, robot: str, streams: Mapping[str, Stream]) -> dict[str, Feature]:
    """Types and names of the columns of `_values`."""
    own, numbers = named(streams, proprioception(robot)), action_names(robot)
    seen = {column_of(name): feature_of(name, stream) for name, stream in streams.items()}
    return {
        **seen,
        STATE: Feature("float32", (len(own),), own),
        "action": Feature("float32", (len(numbers),), numbers),
        CONTROL_ACTIONS: Feature("float32", (periods_between(settings.rate), len(numbers)), ("period", "action")),
        "reward": Feature("float32"),
        "next.reward": Feature("float32"),
        "next.done": Feature("bool"),
        "next.success": Feature("bool"),
        "waiting": Feature("bool"),
    }

"""Gymnasium environments over pools: `gymnasium.make("scengen/domino_single-v2", pool="generated/id")`.

Without `pool=` they play three certified training scenarios that come with scengen, to try a task.

Importing this module registers every task. `gymnasium.make("scengen.envs.gym:scengen/...")` imports it by itself. The
number in an id is the version of the task (`Scenario.VERSION`). `-v0` names the installed version, too, with a warning.
An environment plays the certified scenarios of a pool, with the scene text, the physics and the controller of the
certificate. Reset samples nothing: the seed selects one of the stored scenarios, and `info` holds its id.
"""

import inspect
import threading
import time
import warnings
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import cache, cached_property, wraps
from typing import Any, NamedTuple, ParamSpec

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from numpy.typing import ArrayLike, NDArray

from .. import compose
from ..control.loop import Loop
from ..control.teleop import check_filter
from ..episode import STRICT, Actions, Episode, Outcome, Rules, check_rules
from ..errors import BadConfig, ScengenError, UnknownName, Unstable, cut
from ..look.looks import ROOM, look_named
from ..orientation import Orientation
from ..params import Value
from ..perturb.drawn import Senses
from ..perturb.language import Words
from ..perturb.perturbation import Perturbation
from ..pictures.opengl import check_size
from ..pictures.render import Camera
from ..pool import PoolRow
from ..pool.library import Library
from ..samplers import task_files
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim.embodiment import action_size, hands
from ..sim.world import World
from ..validate.playable import stored_world
from .object_state import ObjectState, bodies_of
from .observations import (
    Entry,
    Reading,
    Stream,
    cameras_of,
    check_names,
    entries_of,
    privileged,
    requested,
    streams_of,
    turns_pictures,
)
from .pools import Folders, chosen, located, rows_of, scenes_drawn_otherwise

Observation = dict[str, Reading]
Given = ParamSpec("Given")

RENDER_MODES = ("rgb_array",)
"""Names of the render modes."""
RESET_OPTIONS = ("scenario", "labels")
"""Names of the options of `reset`."""
INFOS = ("success", "is_success", "reason", "lacks", "time")
"""Entries of `info` without labels."""
MAX_ACTION_REPEAT = 100
"""Largest `action_repeat` [control periods]: one second. Longer repeats leave the arm without effective control."""


@dataclass(frozen=True)
class ObservationSettings:
    """Observations of an environment: its streams, its cameras, and the size of all pictures."""

    streams: Mapping[str, Stream]
    """Streams to read, by name, in the requested order."""
    cameras: Mapping[str, str]
    """Cameras of the observation: robosuite's names by the paper's, in the requested order."""
    width: int
    """Width of all pictures [pixels]."""
    height: int
    """Height of all pictures [pixels]."""

    @property
    def entry_names(self) -> dict[str, tuple[str, ...]]:
        """Names of the entries of each stream."""
        return {name: stream.entries(name) for name, stream in self.streams.items()}

    @property
    def space(self) -> spaces.Dict:
        """Gymnasium's space of the observations."""
        boxes: dict[str, spaces.Space[Any]] = {
            name: spaces.Box(np.float32(-s.bound), np.float32(s.bound), s.shape, np.float32)
            for name, s in self.streams.items()
        }
        pictures = {name: spaces.Box(0, 255, (self.height, self.width, 3), np.uint8) for name in self.cameras}
        return spaces.Dict({**boxes, **pictures})

    def check_picture_size(self, task: Task, rows: Library) -> None:
        """Raise `BadConfig` if a scenario turns pictures by a quarter and they are not square."""
        if self.width == self.height or not turns_pictures(task.family):
            return
        for (params,) in rows.columns("params"):
            task.scenario(params).orientation.check_size(self.width, self.height)


class Drawing(NamedTuple):
    """Work that went into pictures."""

    pictures: int = 0
    """Number of pictures."""
    seconds: float = 0.0
    """Time that they took [s]."""


def names_arguments(init: Callable[Given, None]) -> Callable[Given, None]:
    """An `__init__` that refuses unknown keywords with the nearest known one."""
    known = [*inspect.signature(init).parameters][1:]

    @wraps(init)
    def checked_init(*args: Given.args, **named: Given.kwargs) -> None:
        for name in named:
            if name not in known:
                raise UnknownName("argument", name, known)
        init(*args, **named)

    return checked_init


class PoolEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """The scenarios of one task in one or more pools.

    Actions: shape (7,), each in [-1, 1]: end-effector translation (3), rotation vector (3), gripper (-1 open, 1
    closed), at 100 Hz. With two arms the shape is (14,), the right arm's seven numbers first. An arm that belongs to
    the scene has no action. Actions are clipped to [-1, 1] and go to the controller unfiltered, which is the paper's
    interface for policies. `action_filter="teleop"` applies the filter of teleoperation and of the oracles
    (`scengen.control.teleop`).

    Observations: a dictionary of the requested streams (`scengen.envs.observations`), float32; pictures are uint8.
    By default they are the robot's own pose and `object-state`, poses and sizes of all bodies. `entry("tile_0_pos")`
    is the place of a reading, and `legend` lists all of them. No observation contains a hidden parameter.
    Some scenarios are seen turned or mirrored (`Scenario.orientation`). Then every picture is turned, that of `render`
    included; actions and all other streams stay as they are. `seen_<body>_pos` is where the picture shows a body.

    Reward: 1 when the goal is reached, else 0. `terminated` on success and on failure, `truncated` at the time limit.
    With `settle` a reached goal counts as in a certificate: it must still hold after the robot has been idle for one
    second, which is simulated within the last step.
    `info` holds `success`, `is_success`, `time` [s], and at the end `reason` and `lacks`, the means of the task
    without which the goal was reached: nothing that identifies a scenario. After
    `reset(options={"labels": True})` it also holds `scenario`, `scene_sha256`, `split`, `axes`, `instruction` and
    `pool`, the folder, for evaluators.

    Threads may share an environment. Their calls run one after the other.
    """

    _spec: EnvSpec | None = None
    metadata = {"render_modes": [*RENDER_MODES], "render_fps": round(1 / Loop.PERIOD)}  # noqa: RUF012

    @names_arguments
    def __init__(
        self,
        task: str,
        pool: Folders | Library | None = None,
        observations: str | Sequence[str] | None = None,
        render_mode: str | None = None,
        width: int = 256,
        height: int = 256,
        camera: str = "agentview",
        action_filter: str | None = None,
        settle: bool = False,
        search: Sequence[str] = (),
        scenario: str | None = None,
        split: str | None = None,
        action_repeat: int = 1,
        rules: Rules = STRICT,
        perturb: str | None = None,
        perturb_seed: int = 0,
        look: str = ROOM.name,
    ):
        """Open the pools.

        Args:
            task: name of the task. Pools of other tasks are refused.
            pool: folder of a pool, or several folders; or the scenarios of another environment of the task. Default:
                the scenarios of the task that come with scengen.
            observations: names of streams and cameras, or one name; only these are computed. `state`, the default,
                stands for proprioception and `object-state`, `pictures` for proprioception and all cameras.
                Privileged streams are `object-state`, all poses, velocities and sizes in one vector
                (`scengen.envs.object_state`), each reading in it, such as `<body>_pos` [m], and `seen_<body>_pos` [m]
                if the family turns pictures.
            render_mode: None or `rgb_array`.
            width: width of all pictures [pixels].
            height: height of all pictures [pixels].
            camera: camera of `render`: one of the paper's (`cameras_of`) or any camera of the model.
            action_filter: None, or "teleop" for the filter of teleoperation and of the oracles.
            settle: whether a reached goal must last as in the certificate.
            search: `hydra.searchpath=[file:///path/to/conf]` for a task of a package that is not installed.
            scenario: the only scenario to play, named as in `reset`. Default: all scenarios of the pools.
            split: the only split to play, such as `id` or `wide_gaps@3`.
            action_repeat: control periods for which an action is held, 4 for data of 25 Hz. The controller, the events,
                the goal and the filter keep running at 100 Hz; the filter gets the same action several times. The
                time limit in seconds does not change. A step ends early if the episode ends.
            rules: "strict", those of the certificates: a goal counts if it was reached by the means of the task; or
                "paper": it counts however it was reached (docs/means.md).
            perturb: kinds of perturbation at their levels, such as `light_direction@3+noise@1` (docs/perturb.md). The
                physics stays as it is. The label `perturb` of `info` holds what was drawn.
            perturb_seed: another number draws other perturbations for the same scenarios.
            look: look of pictures: `room`, or `plain`, the scene in a void (docs/perturb.md).

        Raises:
            ScengenError: a pool is missing, damaged, of another version or task; a name is unknown; pictures that are
                turned by a quarter are not square.
        """
        self._arguments = {name: value for name, value in locals().items() if name not in ("self", "__class__")}
        _check_render_mode(render_mode)
        check_filter(action_filter)
        _check_action_repeat(action_repeat)
        check_rules(rules)
        check_size(width=width, height=height)
        self.render_mode, self.camera = render_mode, camera
        self.action_filter, self.settle, self.action_repeat = action_filter, settle, action_repeat
        self.rules: Rules = rules
        self.perturbation, self._perturb_seed, self._search = Perturbation.parse(perturb), perturb_seed, search
        self.look = look_named(look)
        self.task: Task = compose.load_task(task, search)
        rows = rows_of(pool, task)
        self._arguments["pool"] = located(pool)
        self._rows = chosen(rows, scenario, split)
        names = requested(observations, self.task.embodiment)
        streams, cameras = _requested(names, self.task, rows, lambda: self.scenario.orientation)
        self.observed = ObservationSettings(streams, cameras, width, height)
        shown = [] if render_mode is None else [cameras_of(self.task.embodiment).get(camera, camera)]
        self.perturbation.check([*streams], [*cameras.values(), *shown], self.look)
        if self.perturbation:
            self.perturbation.check_words(Words.of(task, self.task.instruction, search))
        if self._needs_pictures:
            self.observed.check_picture_size(self.task, self._rows)
        self.metadata = {
            **type(self).metadata,
            "render_fps": round(1 / (Loop.PERIOD * action_repeat)),
            "names": self.observed.entry_names,
        }
        self.action_space = spaces.Box(-1.0, 1.0, (action_size(self.task.embodiment),), np.float32)
        self.observation_space = self.observed.space  # type: ignore[assignment]
        self._next = 0
        self._lock = threading.RLock()
        self._world: World | None = None
        self._renderer: Camera | None = None
        self._row: PoolRow = self._rows[0]
        self._instruction: str | None = None
        self.instruction_read = False
        """Whether `task_description` was read."""
        self.drawing = Drawing()
        """Work that went into pictures since the environment was made."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles open the pools again and continue from the same state with a separate simulation."""
        with self._lock:
            return _revived, (type(self), self._arguments, self._progress())

    @property
    def arguments(self) -> Mapping[str, Any]:
        """Arguments of `__init__`, with the folders of pools by their absolute paths."""
        return dict(self._arguments)

    @property
    def streams(self) -> Mapping[str, Stream]:
        """Streams of the observation, by name."""
        return self.observed.streams

    @property
    def cameras(self) -> tuple[str, ...]:
        """The paper's names of the cameras of the observation."""
        return tuple(self.observed.cameras)

    @cached_property
    def _entries(self) -> dict[str, Entry]:
        return entries_of(self.metadata["names"])

    def entry(self, name: str) -> Entry:
        """Place of a reading such as `tile_0_pos`, or of a number such as `tile_0_pos.x`, in an observation.

        `env.unwrapped.entry("tile_0_pos").of(observation)` is the reading.

        Raises:
            UnknownName: it is not observed.
        """
        reading, _, number = name.partition(".")
        found = self._entries.get(reading)
        if found is None or (number and number not in found.numbers):
            known = [*self._entries, *(f"{reading}.{each}" for each in found.numbers)] if found else [*self._entries]
            raise UnknownName("reading in these observations", name, known)
        if not number:
            return found
        place = found.where.start + found.numbers.index(number)
        return Entry(name, found.stream, slice(place, place + 1), ())

    @property
    def legend(self) -> str:
        """Every reading in the observations, one in a line: its place, its name, its numbers and their unit."""
        listed = {entry.stream for entry in self._entries.values()}
        others = [f"{name} {space.shape}" for name, space in self.observed.space.items() if name not in listed]
        return "\n".join([*map(str, self._entries.values()), *others])

    @property
    def max_episode_steps(self) -> int:
        """Number of steps until the longest time limit of the pools."""
        return self.steps_in(max(pool.manifest.task_node["horizon"] for pool in self._rows.pools))

    def steps_in(self, seconds: float) -> int:
        """Number of steps that a time takes [s], rounded up."""
        return int(np.ceil(seconds / (Loop.PERIOD * self.action_repeat) - 1e-9))

    def check_observations(self, names: Sequence[str]) -> None:
        """Raise `UnknownName` for the first name that is neither a stream nor a camera of the environment."""
        _requested(names, self.task, self._rows, lambda: self.scenario.orientation)

    @property
    def task_description(self) -> str:
        """The instruction: that of the running scenario as a perturbation words it, or one that `instruct` gave."""
        self.instruction_read = True
        return self.instruction

    @property
    def instruction(self) -> str:
        """The same for evaluators: it does not count as read."""
        given = self.drawn.instruction if self._instruction is None and self._world else self._instruction
        return self._row.instruction if given is None else given

    def instruct(self, text: str | None) -> None:
        """Replace the instruction of the running scenario; None restores it."""
        self._instruction = text

    @property
    def horizon(self) -> float:
        """Time limit of the running scenario [s]."""
        return self._row.horizon

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Ids of all scenarios, in the order of the pools."""
        return tuple(id_.decode() for id_ in self._rows.directory.ids.tolist())

    @property
    def world(self) -> World:
        """The running simulation."""
        if self._world is None:
            raise BadConfig("no scenario is running; call reset first")
        return self._world

    @property
    def row(self) -> PoolRow:
        """Row of the running scenario in its pool. Privileged, like `scenario`."""
        return self._row

    @property
    def scenario(self) -> Scenario:
        """The running scenario. Privileged: it holds the hidden parameters, which a policy must find out."""
        if self._world is None:
            raise BadConfig("no scenario is running; call reset first")
        return self._scenario

    @property
    def played(self) -> Actions:
        """Actions that the controller has received since the reset, settling included, shape (n, 7 * arms)."""
        return np.array(self._played, np.float32).reshape(-1, action_size(self.task.embodiment))

    @property
    def values(self) -> Mapping[str, Value]:
        """Parameter values of the running scenario, by name. Privileged, like `scenario`."""
        return self._row.params

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a scenario: `options={"scenario": name}`, else number `seed` of the pool, else the next one.

        The name is a scenario's id, a unique prefix of its id, or its `PoolRow.name`. With `options={"labels": True}`
        the returned `info` says which scenario is running.

        Raises:
            UnknownName: there is no such scenario or option.
            BadConfig: several ids have this prefix.
        """
        unknown = set(options or {}) - set(RESET_OPTIONS)
        if unknown:
            raise UnknownName("reset option", unknown.pop(), RESET_OPTIONS)
        with self._lock:
            super().reset(seed=seed)
            if seed is not None:
                self._next = seed % len(self._rows)
            elif self._world is None and not options:
                _warn_of_equals(self)
            named = (options or {}).get("scenario")
            number = self._next if named is None else self._rows.find(str(named))
            self._next = (number + 1) % len(self._rows)
            self._load(self._rows[number])
            info = self._info("", False)
            return self._observe(), {**info, **self._labels()} if (options or {}).get("labels") else info

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advance one control period (10 ms), or `action_repeat` of them.

        Raises:
            ValueError: the action has a different shape than `action_space`, or is not finite. Nothing is simulated
                then.
        """
        given = checked(action, action_size(self.task.embodiment))
        if self._world is None:
            raise BadConfig("no scenario is running; call reset first")
        with self._lock:
            reward, terminated, truncated, info = self._play(given)
            return self._observe(), reward, terminated, truncated, info

    @property
    def renderer(self) -> str:
        """Name of the renderer of the pictures; empty as long as there is none."""
        return "" if self._renderer is None else self._renderer.device

    def render(self) -> Reading | None:  # type: ignore[override]
        """A picture of `camera`, shape (height, width, 3), or None without a render mode."""
        if self.render_mode is None:
            return None
        with self._lock:
            camera = cameras_of(self.task.embodiment).get(self.camera, self.camera)
            return self._picture(camera, self._shown(camera))

    def close(self) -> None:
        """Free the renderer."""
        with self._lock:
            if self._renderer is not None:
                self._renderer.close()
                self._renderer = None

    @property
    def spec(self) -> EnvSpec | None:  # type: ignore[override]
        """Gymnasium's specification, with folders as text so that `to_json` can write it."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # type: ignore[override]
        self._spec = spec and self.specified(spec)

    def specified(self, spec: EnvSpec) -> EnvSpec:
        """A specification with the environment's own time limit, and with folders as text."""
        kwargs = dict(spec.kwargs)
        if (pool := kwargs.get("pool")) is not None:
            many = isinstance(pool, Sequence) and not isinstance(pool, str)
            kwargs["pool"] = [str(folder) for folder in pool] if many else str(pool)
        return replace(spec, kwargs=kwargs, max_episode_steps=self.max_episode_steps)

    def _progress(self) -> dict[str, Any]:
        """Everything that a copy needs to continue, in addition to the arguments of `__init__`."""
        made = {"next": self._next, "random": self._np_random, "random_seed": self._np_random_seed}
        if self._world is None:
            return made
        episode = (self._episode.outcome, self._episode.reason, self._episode.held, self._episode.lacks)
        entry = {"scenario": self._row.id, "world": self._world.state(), "episode": episode}
        return {**made, **entry, "played": [*self._played], "taken": self._senses.taken}

    def _continue(self, progress: Mapping[str, Any]) -> None:
        """Return to a `_progress()` of an environment with the same arguments."""
        if "scenario" in progress:
            self._load(self._rows[self._rows.find(progress["scenario"])])
            self.world.restore(progress["world"])
            self._played = [*progress["played"]]
            self._senses.taken = progress["taken"]
            episode = self._episode
            episode.outcome, episode.reason, episode.held, episode.lacks = progress["episode"]
        self._next = progress["next"]
        self._np_random, self._np_random_seed = progress["random"], progress["random_seed"]

    def _load(self, row: PoolRow) -> None:
        if self._world is None or row.id != self._row.id:
            self.close()
            look = self.perturbation.dressed(self.look) if self._needs_pictures else None
            conditions = self.perturbation.conditions(row.embodiment)
            self._world = stored_world(row, look, conditions, self._perturb_seed)
            self._scenario = self.task.scenario(row.params)
            self.drawn = self.perturbation.senses(
                self._world.model, row.id, row.task, row.instruction, self._perturb_seed, self._search
            ).drawn
        self._row = row
        self._senses = Senses(self.drawn)
        self._played: list[NDArray[np.float32]] = []
        self._world.reset()
        self._episode = Episode(self._scenario, self._world, row.horizon, self.rules)

    def _play(self, given: NDArray[np.floating]) -> tuple[float, bool, bool, dict[str, Any]]:
        """Take a step with a valid action. Returns what `_answer` does."""
        outcome = None
        for _ in range(self.action_repeat):
            outcome = outcome or self._advance(given)
        return self._answer(outcome)

    def _advance(self, action: NDArray[np.floating]) -> Outcome | None:
        self._simulate(action)
        return self._episode.judge()

    def _simulate(self, action: NDArray[np.floating]) -> None:
        """Simulate a control period, which the episode has to judge afterwards."""
        sent = self.world.received(action, not self.action_filter)
        self._played.append(sent)
        self._episode.begin()
        try:
            self.world.step_filtered(sent)
        except Unstable as error:
            self._episode.outcome, self._episode.reason = "unstable", str(error)

    def _answer(self, outcome: Outcome | None) -> tuple[float, bool, bool, dict[str, Any]]:
        """Reward, whether the episode terminates, whether it is truncated, and the info.

        Args:
            outcome: outcome of the step; a reached goal is settled first, if it has to be.
        """
        reason = self._episode.reason
        terminated, truncated = outcome in ("success", "failure", "unstable"), outcome == "timeout"
        if outcome == "success" and self.settle:
            outcome, reason = self._settled()
        success = outcome == "success"
        return float(success), terminated, truncated, self._info(reason, success)

    def _settled(self) -> tuple[Outcome, str]:
        """Outcome and reason after the robot has been idle for the certificate's settling time."""
        for _ in range(round((self._row.certificate.settle or 0.0) / Loop.PERIOD)):
            if self._advance(self.world.idle) != "success":
                break
        return self._episode.settled()

    @property
    def _needs_pictures(self) -> bool:
        return bool(self.cameras) or self.render_mode is not None

    def _observe(self) -> Observation:
        read = {name: clipped(self._perceived(name, s.read(self.world)), s.bound) for name, s in self.streams.items()}
        return {**read, **{name: self._picture(c, self._shown(c)) for name, c in self.observed.cameras.items()}}

    def _perceived(self, name: str, reading: NDArray[np.float64]) -> NDArray[np.float64]:
        """A reading of a stream under the perturbation, if there is one."""
        return self._senses.reading(name, self.metadata["names"][name], self.world.time, reading)

    def _shown(self, camera: str) -> mujoco.MjData:
        """Data of the world that a camera shows: of a late one of an earlier moment. To be called in each step."""
        data = self.world.data
        return self._senses.arriving(camera, self.world.time, copy(data)) if self.drawn.delay else data

    def _picture(self, camera: str, shown: mujoco.MjData) -> NDArray[np.uint8]:
        start = time.perf_counter()
        if self._renderer is None:
            self._renderer = Camera(self.world, self.observed.width, self.observed.height)
        picture = self._scenario.orientation.apply(self._renderer.take(camera, shown)).copy()
        seen = self._senses.arrived(camera, self.world.time, picture)
        self.drawing = Drawing(self.drawing.pictures + 1, self.drawing.seconds + time.perf_counter() - start)
        return seen

    def _info(self, reason: str, success: bool) -> dict[str, Any]:
        found = {"success": success, "is_success": success, "reason": reason, "lacks": self._episode.lacks}
        return {**found, "time": self.world.time}

    def _labels(self) -> dict[str, Any]:
        """Labels of the running scenario. A policy that sees them can memorise scenarios."""
        row = self._row
        labels = {"scenario": row.id, "split": row.split, "axes": list(row.axes), "scene_sha256": row.scene_sha256}
        labels |= {"instruction": self.instruction, "pool": str(self._rows.folder_of(row.id))}
        return {**labels, "perturb": self.drawn.plain()} if self.perturbation else labels


_unseeded: "weakref.WeakSet[PoolEnv]" = weakref.WeakSet()
"""Environments whose first scenario was not chosen by a seed."""


def _warn_of_equals(env: PoolEnv) -> None:
    """Warn if another environment without a seed plays the same scenarios in the same order."""
    if any(other._rows[0].id == env._rows[0].id and len(other._rows) == len(env._rows) for other in _unseeded):
        _tell_of_equals()
    _unseeded.add(env)


@cache
def _tell_of_equals() -> None:
    """Warn once in a process."""
    why = "several environments were reset without a seed: each plays the same scenarios in the same order"
    warnings.warn(f"{why}; give seeds, such as envs.reset(seed=0), which gives each its own", stacklevel=4)


def _revived(kind: type[PoolEnv], arguments: Mapping[str, Any], progress: Mapping[str, Any]) -> PoolEnv:
    """An environment that continues from the progress of another one."""
    env = kind(**arguments)
    env._continue(progress)
    return env


def action_repeat_at(rate: float, name: str) -> int:
    """Control periods for which a policy holds an action.

    Args:
        rate: rate of the policy [Hz].
        name: name of the setting, for the error.

    Raises:
        BadConfig: the rate is below 1 Hz, or does not divide that of the controller.
    """
    full = 1 / Loop.PERIOD
    if not 1 <= rate <= full or abs(full / rate - round(full / rate)) > 1e-9:
        raise BadConfig(f"{name} = {rate:g}; it must be at least 1 Hz and divide {full:g} Hz")
    return round(full / rate)


def _check_render_mode(render_mode: str | None) -> None:
    if render_mode not in (None, *RENDER_MODES):
        raise UnknownName("render_mode", str(render_mode), RENDER_MODES)


def _check_action_repeat(action_repeat: int) -> None:
    if action_repeat not in range(1, MAX_ACTION_REPEAT + 1):
        accepted = f"it must be a whole number of control periods in [1, {MAX_ACTION_REPEAT}]"
        raise BadConfig(f"action_repeat = {cut(repr(action_repeat))}; {accepted}")


def _requested(
    names: Sequence[str], task: Task, rows: Library, orientation: Callable[[], Orientation]
) -> tuple[dict[str, Stream], dict[str, str]]:
    """The streams and the cameras among some names, each in the order of the names.

    Args:
        rows: whose scenes are searched for bodies if a name is neither a stream of the robot nor a camera.
        orientation: that of the running scenario.

    Raises:
        UnknownName: a name is neither a stream nor a camera.
    """
    streams, cameras = streams_of(task.embodiment), cameras_of(task.embodiment)
    if not set(names) <= {*streams, *cameras}:  # only then: finding the bodies takes time, it builds some scenes
        bodies = bodies_of(task, scenes_drawn_otherwise(rows, task))
        state = ObjectState(bodies, len(hands(task.embodiment)))
        streams |= privileged(state, task.family, orientation)
        check_names(names, task.embodiment, streams)
    return (
        {name: streams[name] for name in names if name in streams},
        {name: cameras[name] for name in names if name in cameras},
    )


def checked(action: ArrayLike, size: int) -> NDArray[np.float32]:
    """An action as an array, shape (size,).

    Raises:
        ValueError: it has another shape, or is not finite.
    """
    given = np.asarray(action, np.float32)
    if given.shape != (size,) or not np.isfinite(given).all():
        raise ValueError(f"an action is {size} finite numbers in [-1, 1], not {np.array2string(given)}")
    return given


def clipped(reading: NDArray[np.float64], bound: float | NDArray[np.float64]) -> NDArray[np.float32]:
    """A reading, or several ones along the first axis, within the bounds of its stream."""
    return np.minimum(np.maximum(reading, -bound), bound).astype(np.float32)  # a fifth of the time of `clip`


def _installed(task: str) -> int:
    """Version of a task; 1 if its file cannot be read, which raises an error when the task is loaded."""
    with suppress(ScengenError):
        return task_files.version(task)
    return 1


def register(task: str) -> None:
    """Register a task with Gymnasium: under its version, and as `-v0`, the name of all tasks before they had versions.

    Gymnasium itself warns of `-v0`, and refuses other versions with a line that names those that there are.
    """
    for version in (0, _installed(task)):
        gymnasium.register(
            f"scengen/{task}-v{version}",
            "scengen.envs.gym:PoolEnv",
            vector_entry_point="scengen.envs.vector:PoolVectorEnv",
            kwargs={"task": task},
        )


for _name in task_files.tasks():
    register(_name)

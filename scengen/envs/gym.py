"""Gymnasium environments over pools: `gymnasium.make("scengen/domino_single-v0", pool="generated/id")`.

Importing this module registers every task; `gymnasium.make("scengen.envs.gym:scengen/...")` imports it by itself.
An environment plays the certified scenarios of a pool, the same scene text, physics and controller that the certificate
speaks of. Nothing is sampled at reset: the seed chooses among the stored scenarios, and the id comes back in `info`.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from .. import config
from ..control.loop import Loop
from ..control.teleop import check_filter, unfiltered
from ..episode import Episode, Outcome
from ..errors import BadConfig, UnknownName, cut
from ..params import Value
from ..pictures.render import Camera
from ..pool.pool import PoolRow
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim.world import World, action_size, hands
from .object_state import ObjectState, bodies_of
from .observations import Reading, cameras_of, check_names, privileged, proprioception, streams_of
from .pools import Folders, chosen, rows_of

Observation = dict[str, Reading]


class PoolEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """The scenarios of one task in one or more pools.

    Actions: shape (7,), each in [-1, 1]: end-effector translation (3), rotation vector (3), gripper (-1 open, 1
    closed), at 100 Hz; shape (14,) for two arms, the right one's seven first; none for an arm that belongs to the
    scene. They go to the controller as they are, clipped to [-1, 1], which is the paper's interface for policies;
    `action_filter="teleop"` puts the filter of people and oracles in between (`scengen.control.teleop`).

    Observations: a dictionary of the streams asked for (`scengen.envs.observations`), float32; cameras give uint8.
    `metadata["names"]` tells of each stream what its entries are. Nothing that a scenario hides is in any of them.
    Some scenarios are seen turned or mirrored (`Scenario.orientation`): then every picture is, `render` included, while
    actions and all other streams stay as they are; `seen_<body>_pos` is where the picture lets a body appear.

    Reward: 1 when the goal is reached, else 0. `terminated` on success and on failure, `truncated` at the time limit.
    With `settle` a reached goal counts as in a certificate: it must still hold after the robot was left idle for a
    second, which is simulated within the last step.
    `info` holds `scenario`, `scene_sha256`, `split`, `axes`, `success`, `is_success`, and `reason` once it is over.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(1 / Loop.PERIOD)}  # noqa: RUF012

    def __init__(
        self,
        task: str,
        pool: Folders | None = None,
        observations: Sequence[str] | None = None,
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
    ):
        """Open the pools.

        Args:
            task: name of the task; scenarios of others are refused.
            pool: folder of a pool, or several.
            observations: names of streams and cameras; what is not asked for costs nothing. Proprioception if None.
                Privileged are `object-state`, all poses and velocities in one vector (`scengen.envs.object_state`),
                each reading in it, such as `<body>_pos` [m], and `seen_<body>_pos` [m], if the family turns pictures.
            render_mode: None or `rgb_array`.
            width: of all pictures [pixels].
            height: of all pictures [pixels].
            camera: what `render` shows: one of the paper's cameras (`cameras_of`) or any camera of the model.
            action_filter: None, or "teleop" for the filter that the actions of people and oracles pass.
            settle: whether a reached goal has to last as in the certificate.
            search: `hydra.searchpath=[file:///path/to/conf]` for a task of a package that is not installed.
            scenario: the only one that is to be played, named as in `reset`; all of the pools if None.
            split: play those of one split only, such as `id` or `wide_gaps@3`.
            action_repeat: control periods for which an action is held, 4 for data of 25 Hz. All else goes on at 100 Hz:
                controller, events, goal and the filter, which sees the same action several times. The time limit is
                in seconds and stays what it is. A step ends early where the episode does.

        Raises:
            ScengenError: a pool is missing, damaged, of another version or task; a name is unknown; pictures that are
                seen turned by a quarter are not square.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise UnknownName("render_mode", str(render_mode), self.metadata["render_modes"])
        check_filter(action_filter)
        if action_repeat not in range(1, MOST_REPEATED + 1):
            told = f"it must be a whole number of control periods in [1, {MOST_REPEATED}]"
            raise BadConfig(f"action_repeat = {cut(repr(action_repeat))}; {told}")
        self.action_filter, self.settle, self.action_repeat = action_filter, settle, action_repeat
        self.task: Task = config.task(task, search)
        rows = rows_of(pool, task)
        self._rows = chosen(rows, scenario, split)
        robot = self.task.embodiment
        if observations is None:
            observations = proprioception(robot)
        known, self.views = streams_of(robot), cameras_of(robot)
        if not set(observations) <= {*known, *self.views}:  # which bodies there are costs some scenes
            bodies = bodies_of(self.task, (scene for (scene,) in rows.columns("scene_xml")))
            state = ObjectState(bodies, len(hands(robot)))
            known |= privileged(state, self.task.family, lambda: self.scenario.orientation)
            check_names(observations, robot, known)
        self.render_mode, self.size, self.camera = render_mode, (width, height), camera
        self.streams = {name: known[name] for name in observations if name in known}
        self.cameras = [name for name in observations if name in self.views]
        self.metadata = {
            **type(self).metadata,
            "render_fps": round(1 / (Loop.PERIOD * action_repeat)),
            "names": {name: stream.entries(name) for name, stream in self.streams.items()},
        }
        if self._sees and width != height and self.task.family.orientation is not Scenario.orientation:
            for (params,) in self._rows.columns("params"):
                self.task.scenario(params).orientation.check_size(width, height)
        self._next = 0
        self._world: World | None = None
        self._eye: Camera | None = None
        self._row: PoolRow = self._rows[0]
        self.action_space = spaces.Box(-1.0, 1.0, (action_size(self.task.embodiment),), np.float32)
        boxes: dict[str, spaces.Space[Any]] = {
            name: spaces.Box(np.float32(-s.bound), np.float32(s.bound), s.shape, np.float32)
            for name, s in self.streams.items()
        }
        pictures = {name: spaces.Box(0, 255, (height, width, 3), np.uint8) for name in self.cameras}
        self.observation_space = spaces.Dict({**boxes, **pictures})  # type: ignore[assignment]

    @property
    def task_description(self) -> str:
        """What is asked for, in words."""
        return self._row.instruction

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
            raise BadConfig("call reset before anything else")
        return self._world

    @property
    def row(self) -> PoolRow:
        """The running scenario as its pool tells it. Privileged, like `scenario`."""
        return self._row

    @property
    def scenario(self) -> Scenario:
        """The running scenario. Privileged: a policy that reads it knows what it should find out."""
        if self._world is None:
            raise BadConfig("call reset before anything else")
        return self._scenario

    @property
    def values(self) -> Mapping[str, Value]:
        """Parameter values of the running scenario, by name. Privileged like `scenario`."""
        return self._row.params

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Put a scenario at its start: `options={"scenario": name}`, else number `seed` of the pool, else the next one.

        A scenario is named by its id, by the beginning of it, or as `PoolRow.name` does.

        Raises:
            UnknownName: there is no such scenario or option.
            BadConfig: several ids begin so.
        """
        super().reset(seed=seed)
        unknown = set(options or {}) - {"scenario"}
        if unknown:
            raise UnknownName("reset option", unknown.pop(), ["scenario"])
        if seed is not None:
            self._next = seed % len(self._rows)
        named = (options or {}).get("scenario")
        number = self._next if named is None else self._rows.find(str(named))
        self._next = (number + 1) % len(self._rows)
        self._load(self._rows[number])
        self._over = False
        return self._observe(), self._info("", False)

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advance one control period (10 ms), or `action_repeat` of them.

        Raises:
            ValueError: the action has another shape than `action_space`, or is not finite; nothing was simulated then.
        """
        given, size = np.asarray(action, np.float32), action_size(self.task.embodiment)
        if given.shape != (size,) or not np.isfinite(given).all():
            raise ValueError(f"an action is {size} finite numbers in [-1, 1], not {np.array2string(given)}")
        outcome = None
        for _ in range(self.action_repeat):
            outcome = outcome or self._advance(given)
        reason = self._episode.reason
        terminated, truncated = outcome in ("success", "failure", "unstable"), outcome == "timeout"
        if outcome == "success" and self.settle:
            outcome, reason = self._settled()
        success = outcome == "success"
        return self._observe(), float(success), terminated, truncated, self._info(reason, success)

    def render(self) -> Reading | None:  # type: ignore[override]
        """A picture from the chosen camera, shape (height, width, 3), or None without a render mode."""
        return self._picture(self.views.get(self.camera, self.camera)) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Free the renderer."""
        if self._eye is not None:
            self._eye.close()
            self._eye = None

    def _load(self, row: PoolRow) -> None:
        if self._world is None or row.id != self._row.id:
            self.close()
            self._world = World.load(row.scene_xml, row.embodiment, visual=self._sees)
            self._scenario = self.task.scenario(row.params)
        self._row = row
        self._world.reset()
        self._episode = Episode(self._scenario, self._world, row.horizon)

    def _advance(self, action: NDArray[np.floating]) -> Outcome | None:
        return self._episode.step(self.world.filter(action) if self.action_filter else unfiltered(action))

    def _settled(self) -> tuple[Outcome, str]:
        """Whether the goal lasts while the robot is idle, as in the certificate; what came of it, and the reason."""
        for _ in range(round((self._row.certificate.settle or 0.0) / Loop.PERIOD)):
            if self._advance(self.world.idle) != "success":
                break
        return self._episode.settled()

    @property
    def _sees(self) -> bool:
        return bool(self.cameras) or self.render_mode is not None

    def _observe(self) -> Observation:
        world = self.world
        seen: Observation = {name: _clipped(s.read(world), s.bound) for name, s in self.streams.items()}
        for name in self.cameras:
            seen[name] = self._picture(self.views[name])
        return seen

    def _picture(self, camera: str) -> NDArray[np.uint8]:
        if self._eye is None:
            self._eye = Camera(self.world, *self.size)
        return self._scenario.orientation.apply(self._eye.take(camera)).copy()

    def _info(self, reason: str, success: bool) -> dict[str, Any]:
        row = self._row
        about = {"scenario": row.id, "split": row.split, "axes": list(row.axes), "scene_sha256": row.scene_sha256}
        return {**about, "success": success, "is_success": success, "reason": reason, "time": self.world.time}


MOST_REPEATED = 100
"""Control periods of one second: an arm that gets an action less often is hardly controlled."""


def _clipped(reading: NDArray[np.float64], bound: float | NDArray[np.float64]) -> NDArray[np.float32]:
    return reading.clip(-bound, bound).astype(np.float32)


for _name in config.tasks():
    gymnasium.register(f"scengen/{_name}-v0", "scengen.envs.gym:PoolEnv", kwargs={"task": _name})

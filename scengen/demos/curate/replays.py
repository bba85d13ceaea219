"""The strictest check of an episode: its actions, played again, must give the recorded states and pictures."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...control.loop import ACTION
from ...envs.object_state import NAME, ObjectState, bodies_of
from ...envs.observations import Stream, cameras_of, privileged, streams_of
from ...episode import Episode, Outcome, Rules
from ...errors import ScengenError
from ...export.cameras import calibration
from ...export.dataset import rules_of
from ...export.lerobot import IMAGES_PREFIX, INDEX_FEATURES
from ...export.recording import CONTROL_ACTIONS, STATE
from ...export.streams import ENVIRONMENT
from ...look.looks import Look
from ...perturb.drawn import Senses
from ...perturb.perturbation import Perturbation
from ...pictures.render import Camera, NoPictures, Picture
from ...samplers.task import Task
from ...scenario import Scenario
from ...sim.embodiment import hands
from ...sim.world import World
from ...validate.rebuilt import rebuild
from .findings import Finding
from .labels import label, wrong_labels, wrong_result
from .videos import Probe, compared, stands_still

MAX_REPLAY_ERROR = 1e-6
"""Largest difference of a stream [its unit], and relative to a value beyond 1: streams are stored in single
precision."""
MAX_CAMERA_ERROR = 2e-6
"""Largest difference of a number of a calibration: they are rounded to 1e-6."""
FIRST = "_pos.x"
"""End of the name of a body's first entry in the environment state."""
RESULTS = ("reward", "next.reward", "next.success", "next.done")
"""Columns that follow from the outcome of the replay."""
DERIVED = (*INDEX_FEATURES, STATE, "action", CONTROL_ACTIONS, "waiting")
"""Columns that the checks of rows compare, with each other or with their numbers."""


@dataclass(frozen=True)
class Recorded:
    """Data of an episode that a replay needs; it goes to another process."""

    number: int
    task: Task
    params: Mapping[str, Any]
    horizon: float
    rules: Rules
    actions: NDArray[np.float32]
    """Actions of all control periods of each row, shape (rows, periods, 7 * arms)."""
    streams: Mapping[str, NDArray[np.float32]]
    """Streams at the beginning of each row, and columns of unknown names."""
    results: Mapping[str, NDArray[Any]]
    """The columns of `RESULTS` that were recorded."""
    told: Mapping[str, Any]
    """Row of the table of episodes, without statistics."""
    entries: tuple[str, ...]
    """Names of the entries of the environment state; empty if it was not recorded."""
    size: tuple[int, int]
    """Width and height of the pictures [pixels]."""
    films: Mapping[str, tuple[Probe, ...]]
    """Parts of the film of each camera."""
    cameras: Mapping[str, Mapping[str, Any]]
    """Calibration of each camera."""
    frozen: Mapping[str, Finding]
    """The finding of each camera whose picture stands still while the arm moves. It holds if that of the replay moves,
    and if there is none."""
    look: Look
    """Look of the pictures."""
    search: tuple[str, ...] = ()
    """Folders of other packages, see `task_files.search_path`."""

    @classmethod
    def of(
        cls,
        number: int,
        task: Task,
        about: Mapping[str, Any],
        columns: Mapping[str, NDArray[Any]],
        entries: Sequence[str],
        size: tuple[int, int],
        films: Mapping[str, tuple[Probe, ...]],
        cameras: Mapping[str, Mapping[str, Any]],
        frozen: Mapping[str, Finding],
        look: Look,
        search: Sequence[str] = (),
    ) -> "Recorded":
        """The parts of an episode that a replay compares.

        Args:
            entries: names of the entries of the environment state; empty if it was not recorded.

        Raises:
            ScengenError: there are no such rules.
            ValueError: its parameters are not JSON.
        """
        states = {name: values for name, values in columns.items() if name not in (*DERIVED, *RESULTS)}
        results = {name: columns[name] for name in RESULTS if name in columns}
        told = {name: value for name, value in about.items() if not name.startswith("stats/")}
        params, horizon = json.loads(about["scengen/params"]), float(about["scengen/horizon"])
        actions, rows = columns[CONTROL_ACTIONS], (states, results, told, tuple(entries))
        shown = size, films, cameras, frozen, look, tuple(search)
        return cls(number, task, params, horizon, rules_of(about), actions, *rows, *shown)

    @property
    def bodies(self) -> list[str]:
        """Bodies of the environment state."""
        return bodies_in(self.entries)

    def readers(self, scenario: Scenario, text: str, senses: Senses) -> dict[str, Callable[[World], NDArray[Any]]]:
        """Functions that read the streams from a world as they are perceived, of those that are known.

        Args:
            text: scene of the scenario.
        """
        robot = self.task.embodiment
        found: dict[str, Stream] = {**streams_of(robot)}
        if not {*self.streams} <= {*found, ENVIRONMENT}:
            state = ObjectState(bodies_of(self.task, [text]), len(hands(robot)))
            of_bodies = privileged(state, type(scenario), lambda: scenario.orientation)
            found |= of_bodies
        if self.entries:
            state = state_of(self.entries, robot)
            found[ENVIRONMENT] = Stream(state.names, state.bounds, state.read)
        return {name: _perceived(name, stream, senses) for name, stream in found.items() if name in self.streams}


def _perceived(name: str, stream: Stream, senses: Senses) -> Callable[[World], NDArray[Any]]:
    """Function that reads a stream from a world as it is perceived."""
    known = NAME if name == ENVIRONMENT else name
    return lambda world: senses.reading(known, stream.entries(known), world.time, stream.read(world))


def bodies_in(entries: Sequence[str]) -> list[str]:
    """Bodies of an environment state, by the names of its entries."""
    return [n.removesuffix(FIRST) for n in entries if n.endswith(FIRST) and "_to_robot" not in n]


def state_of(entries: Sequence[str], robot: str) -> ObjectState:
    """The environment state with these entries."""
    bodies = {body: f"{body}_vel_lin.x" in entries for body in bodies_in(entries)}
    return ObjectState(bodies, len(hands(robot)))


def difference(read: NDArray[np.float64], stored: NDArray[np.float32]) -> float:
    """Largest difference of a reading from a stored one, in relation to values beyond 1."""
    return float((np.abs(read - stored) / np.maximum(1.0, np.abs(stored))).max(initial=0.0))


@dataclass(frozen=True)
class Replayed:
    """Findings of the replay of an episode."""

    findings: tuple[Finding, ...] = ()
    checks: tuple[str, ...] = ("replay",)
    """Names of the checks that were made."""
    unknown: tuple[str, ...] = ()
    """Columns that nothing can be compared with."""


def replayed(recorded: Recorded) -> Replayed:
    """Play an episode again, and compare states, success and pictures."""
    try:
        return _replayed(recorded)
    except (ScengenError, ValueError, TypeError, KeyError) as error:
        return _fault(recorded, f"the episode cannot be replayed: {' '.join(str(error).split())[:200]}")


def comparison_of(camera: str) -> str:
    """Name of the check that compares a film with pictures of the replay."""
    return f"pictures {camera}"


def lost(recorded: Recorded, reason: str) -> Replayed:
    """The finding of a replay that has crashed its process, or has reached a limit."""
    return _fault(recorded, f"replaying it {reason}")


def _fault(recorded: Recorded, explanation: str, row: int | None = None, **numbers: float) -> Replayed:
    frames = () if row is None else (row, row)
    return Replayed((Finding("REPLAY", "error", frames, numbers, explanation), *recorded.frozen.values()))


def _replayed(recorded: Recorded) -> Replayed:
    task = recorded.task
    scenario, robot = task.scenario(recorded.params), task.embodiment
    text = rebuild(scenario)
    perturbation = Perturbation.parse(str(recorded.told.get("scengen/perturb", "")))
    world = World.load(text, robot, perturbation.dressed(recorded.look) if recorded.films else None)
    cameras = tuple(_wrong_cameras(recorded, scenario, world))
    seed = _checked_seed(recorded, perturbation)
    senses = perturbation.senses(world.model, scenario.id, task.name, task.instruction, seed, recorded.search)
    world.reset()
    labels = tuple(wrong_labels(recorded.told, task, scenario, text, senses.drawn.instruction))
    found = _played(recorded, scenario, world, text, senses)
    return replace(found, findings=(*labels, *cameras, *found.findings))


def _checked_seed(recorded: Recorded, perturbation: Perturbation) -> int:
    """Seed of a perturbation, of which each part must show in what was recorded: else it is a name for nothing.

    Raises:
        ScengenError: a part shows nowhere.
        ValueError: the seed is not a whole number.
    """
    seed = recorded.told.get("scengen/perturb_seed", 0)
    if type(seed) is not int or seed < 0:
        raise ValueError(f"scengen/perturb_seed is {seed!r:.40}; it must be a whole number")
    views = cameras_of(recorded.task.embodiment)
    seen = [views[camera.removeprefix(IMAGES_PREFIX)] for camera in recorded.cameras]
    perturbation.check([NAME if name == ENVIRONMENT else name for name in recorded.streams], seen, recorded.look)
    return seed


def _played(recorded: Recorded, scenario: Scenario, world: World, text: str, senses: Senses) -> Replayed:
    robot, readers = recorded.task.embodiment, recorded.readers(scenario, text, senses)
    if recorded.actions.shape[2] != ACTION * len(hands(robot)):
        return _fault(recorded, f"the actions are not those of {robot}")
    with ExitStack() as stack:
        films = _Films(recorded, scenario, world, stack, senses)
        episode, over = Episode(scenario, world, recorded.horizon, recorded.rules), None
        seconds = 0.0
        for row, actions in enumerate(recorded.actions):
            for name, read in readers.items():
                error = difference(read(world).ravel(), recorded.streams[name][row].ravel())
                if not error <= MAX_REPLAY_ERROR:
                    return _fault(
                        recorded, f"replayed, {name} has other values", row, error=error, limit=MAX_REPLAY_ERROR
                    )
            films.compare(row)
            for action in actions:
                outcome = episode.step(action)
                over, seconds = (over, seconds) if over else (outcome, world.time)
            if wrong := _wrong_results(recorded, row, over):
                return _fault(recorded, f"replayed, {wrong} has other values", row)
    unknown = tuple(name for name in recorded.streams if name not in readers)
    labels = (*wrong_result(recorded.told, over == "success", seconds), *_wrong_absent(recorded, world))
    if episode.outcome != "success":
        return _fault(recorded, f"replayed, the goal is not reached: {episode.reason or 'no outcome'}")
    ways = (Finding("MEANS", "warning", (), {}, episode.reason),) if episode.lacks else ()
    return Replayed((*films.findings, *labels, *ways), ("replay", *films.checks), unknown)


def _wrong_cameras(recorded: Recorded, scenario: Scenario, world: World) -> Iterator[Finding]:
    """Whether the cameras stand where their files say."""
    views = cameras_of(recorded.task.embodiment)
    for key, told in recorded.cameras.items():
        name = key.removeprefix(IMAGES_PREFIX)
        made = calibration(world, views[name], *recorded.size, scenario.orientation)
        if told.keys() != made.keys() or not all(_near(told[entry], made[entry]) for entry in made):
            yield Finding("CAMERA", "error", (), {}, f"meta/cameras/{name}.json has another calibration")


def _near(told: Any, made: Any) -> bool:
    """Whether an entry of a calibration is that of the replay, up to its rounding."""
    if isinstance(made, str):
        return bool(told == made)
    try:
        given, own = np.array(told, float), np.array(made, float)
    except (TypeError, ValueError):
        return False
    return given.shape == own.shape and np.allclose(given, own, 0.0, MAX_CAMERA_ERROR)


def _wrong_absent(recorded: Recorded, world: World) -> Iterator[Finding]:
    """Whether the bodies that the scene lacks are those that the table of episodes names."""
    there = {world.model.body(i).name for i in range(world.model.nbody)}
    lacking = [body for body in recorded.bodies if body not in there]
    told = recorded.told.get("scengen/absent", "")
    if recorded.entries and sorted(lacking) != sorted(str(told).split(",") if told else []):
        yield label("absent", f"is {ascii(told)[:60]}, the scene lacks {lacking}")


def _wrong_results(recorded: Recorded, row: int, over: Outcome | None) -> str:
    """The first column of a row that contradicts the outcome so far; empty if none does."""
    expected = {"next.done": over is not None}
    return next((n for n, v in recorded.results.items() if v[row] != expected.get(n, over == "success")), "")


class _Films:
    """The films of an episode compared with pictures of its replay. Without OpenGL none is compared."""

    def __init__(self, recorded: Recorded, scenario: Scenario, world: World, stack: ExitStack, senses: Senses):
        self._held, self._camera, self._world, self._senses = scenario.orientation, None, world, senses
        self._probes: dict[tuple[str, int], Probe] = {}
        self._differences: dict[str, list[NDArray[np.float64]]] = {}
        self._frozen, self._ends = recorded.frozen, dict[str, list[Picture]]()
        if recorded.films:
            with suppress(NoPictures):
                self._camera = Camera(world, *recorded.size)
                stack.callback(self._camera.close)
                self._views = cameras_of(recorded.task.embodiment)
                self._differences = {key: [] for key in recorded.films}
                self._probes = {(key, each.row): each for key, probes in recorded.films.items() for each in probes}

    def compare(self, row: int) -> None:
        """Render the pictures of a row again, if it is one of those to be compared."""
        for key in self._differences:
            probe, frozen = self._probes.get((key, row)), self._frozen.get(key)
            if probe is None and (frozen is None or row not in frozen.frames) and not self._senses.drawn.delay:
                continue
            assert self._camera is not None
            view = self._views[key.removeprefix(IMAGES_PREFIX)]
            picture = self._senses.picture(view, self._world.time, self._held.apply(self._camera.take(view)))
            if probe:
                self._differences[key].append(probe.differences(picture))
            if frozen and row in frozen.frames:
                self._ends.setdefault(key, []).append(picture)

    @property
    def checks(self) -> list[str]:
        """Names of the checks that were made."""
        return [comparison_of(key) for key in self._differences]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Result of the comparison of all rows."""
        shifts = [one for key, told in self._differences.items() for one in compared(key, told)]
        still = [key for key, ends in self._ends.items() if stands_still(ends[0], ends[-1])]
        return (*shifts, *(one for key, one in self._frozen.items() if key not in still))

"""What is drawn for a scenario, and how it is applied to the compiled scene, pictures, readings and the instruction."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..control.loop import Loop
from ..errors import BadConfig, where_written
from ..samplers.keyed import unit
from .effects import OBJECTS, Effect, Picture, Reading, Values, number_in
from .kinds import affects, kinds, stream_kind
from .language import WORDINGS, Words

Taken = TypeVar("Taken")

HEADLIGHT = "vis_headlight_"
"""Beginning of the names of the colours of the light at the camera."""


@dataclass(frozen=True)
class Drawn:
    """A perturbation of one scenario."""

    scenario: str
    """Its id."""
    seed: int
    levels: Mapping[str, int]
    """Level by kind."""
    values: Mapping[str, Values]
    """Drawn values by kind."""
    starts: tuple[str, ...] = ()
    """Beginnings of the names of readings of bodies that the scene has."""
    words: Words | None = None
    """The instruction and others, for a part that changes it."""

    @cached_property
    def effects(self) -> Mapping[str, Effect]:
        return {name: kinds()[name].effect for name in self.values}

    def plain(self) -> dict[str, dict[str, float | list[float]]]:
        """The values as plain data."""
        return {
            name: {key: list(value) if isinstance(value, Sequence) else value for key, value in values.items()}
            for name, values in self.values.items()
        }

    @cached_property
    def instruction(self) -> str | None:
        """The instruction as it is given; None if it is the task's own. Wordings come before clauses."""
        parts = [(name, effect.on_text) for name, effect in self.effects.items() if effect.on_text is not None]
        if self.words is None or not parts:
            return None
        text = self.words.instruction
        for name, change in sorted(parts, key=lambda part: part[0] not in WORDINGS):
            text = change(text, self.values[name], self.words)
        return text

    @cached_property
    def delay(self) -> float:
        """Age of the pictures that are perceived [s]."""
        late = (self.values[name] for name, effect in self.effects.items() if effect.is_late)
        return max((number_in(values, "seconds") for values in late), default=0.0)

    def on_model(self, model: mujoco.MjModel) -> None:
        """Change lights, colours and cameras of a compiled scene, once.

        Raises:
            BadConfig: a part changes bodies whose look carries no meaning, and the task names none, or no words were
                given.
        """
        for name in sorted(self.values, key=lambda name: self.effects[name].on_things is None):  # before the table
            effect, values = self.effects[name], self.values[name]
            if effect.on_things is not None:
                if self.words is None:
                    raise BadConfig(
                        f"{name}: give words=Words.of(task, instruction), which name the things of the task"
                    )
                if lacks := kinds()[name].lacks(self.words):
                    raise BadConfig(f"{name}: {lacks}")
                effect.on_things(model, values, self.words.free)
            effect.on_model(model, values)

    @contextmanager
    def while_applied(self, model: mujoco.MjModel) -> Iterator[Mapping[str, NDArray[np.int64]]]:
        """Change a compiled scene as `on_model` during a `with` statement; by name the rows of arrays that differ."""
        before = arrays(model)
        self.on_model(model)
        changed = {name: rows for name, array in arrays(model).items() if (rows := _unequal(array, before[name])).size}
        try:
            yield changed
        finally:
            for name in changed:
                owner = model.vis.headlight if name.startswith(HEADLIGHT) else model
                getattr(owner, name.removeprefix(HEADLIGHT))[...] = before[name]

    def on_picture(self, picture: Picture, camera: str, period: int) -> Picture:
        """A picture as it is perceived.

        Args:
            camera: name of the camera.
            period: number of the control period.
        """
        for name, values in self.values.items():
            effect = self.effects[name]
            if effect.on_picture is not None and affects(effect, camera):
                found = effect.on_picture(picture, values, self._rng(name, camera, period))
                picture = _as_before(name, effect.on_picture, found, picture)
        return picture

    def on_reading(self, stream: str, entries: Sequence[str], reading: Reading, period: int) -> Reading:
        """A reading of a stream as it is perceived.

        Args:
            entries: full names of its entries.
            period: number of the control period.
        """
        for name, values in self.values.items():
            effect = self.effects[name]
            if effect.on_reading is not None and stream_kind(stream) == effect.reads:
                changed = effect.on_reading(entries, reading, values, self._rng(name, stream, period))
                found = _as_before(name, effect.on_reading, changed, reading)
                reading = np.where(self._there(entries), found, reading) if effect.reads == OBJECTS else found
        return reading

    def _there(self, entries: Sequence[str]) -> NDArray[np.bool_]:
        """Whether the scene has the body of each entry."""
        return np.array([entry.startswith(self.starts) for entry in entries])

    def _rng(self, name: str, what: str, period: int) -> np.random.Generator:
        return random("use", name, self.levels[name], self.scenario, self.seed, what, period)


class Senses:
    """What is perceived in an episode: its pictures and readings under a perturbation."""

    def __init__(self, drawn: Drawn):
        self.drawn = drawn
        self.taken: dict[str, list[tuple[float, Any]]] = {}
        """Time [s] and picture, or data of the world, of what has been taken and may still arrive, by camera."""

    def picture(self, camera: str, time: float, picture: Picture) -> Picture:
        """What is perceived when a picture is taken. `camera` is robosuite's name; `time` of the simulation in s."""
        return self.arrived(camera, time, self.arriving(camera, time, picture))

    def arriving(self, camera: str, time: float, taken: Taken) -> Taken:
        """What arrives when something is taken: of a late camera the newest that is old enough, or the first."""
        if not self.drawn.delay:
            return taken
        every = [each for each in self.taken.get(camera, []) if each[0] < time]
        every.append((time, taken))
        while len(every) > 1 and every[1][0] <= time - self.drawn.delay + 1e-9:
            del every[0]
        self.taken[camera] = every
        return every[0][1]

    def arrived(self, camera: str, time: float, picture: Picture) -> Picture:
        """A picture that arrives, as it is perceived."""
        return self.drawn.on_picture(picture, camera, _period(time))

    def reading(self, stream: str, entries: Sequence[str], time: float, reading: Reading) -> Reading:
        """What is read of a stream, given the full names of its entries and the time of the simulation [s]."""
        return self.drawn.on_reading(stream, entries, reading, _period(time)) if self.drawn.values else reading


def _period(time: float) -> int:
    """Number of the control period at a time."""
    return round(time / Loop.PERIOD)


def _as_before(name: str, function: Callable[..., Any], found: Any, given: NDArray[Any]) -> NDArray[Any]:
    """What the function of a kind returns, of the shape and type that it was given.

    Raises:
        BadConfig: it is not.
    """
    if isinstance(found, np.ndarray) and (found.shape, found.dtype) == (given.shape, given.dtype):
        return found
    what = f"{found.dtype} of shape {found.shape}" if isinstance(found, np.ndarray) else type(found).__name__
    wanted = f"{given.dtype} of shape {given.shape}"
    place = f"{where_written(function)}: " if hasattr(function, "__code__") else ""
    raise BadConfig(f"{place}perturbation {name} returned {what}, and must return {wanted}")


def _unequal(one: NDArray[Any], other: NDArray[Any]) -> NDArray[np.int64]:
    """Numbers of the rows that have not the same bits."""
    if not one.size:
        return np.zeros(0, np.int64)
    differs = one.view(np.uint8) != other.view(np.uint8)
    return np.flatnonzero(differs.reshape(len(one), -1).any(axis=1))


def arrays(model: mujoco.MjModel) -> dict[str, NDArray[np.generic]]:
    """Copies of all arrays of a compiled scene, by name, and of the colours of its headlight."""
    every = {name: getattr(model, name) for name in dir(model) if not name.startswith("_")}
    light = model.vis.headlight
    every |= {f"{HEADLIGHT}{part}": getattr(light, part) for part in ("ambient", "diffuse", "specular")}
    return {name: array.copy() for name, array in every.items() if isinstance(array, np.ndarray)}


def random(*key: str | int) -> np.random.Generator:
    """Random numbers that depend on a key alone."""
    return np.random.default_rng(int(unit("perturb", *key) * 2**53))

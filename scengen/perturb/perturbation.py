"""Perturbations by name and level, and what they draw for a scenario.

`light_direction@3+noise@1` is two kinds at their levels. Values depend on kind, scenario and seed; their strength on
the level: a scenario looks the same in each episode and process, also with further kinds, and a higher level goes
farther in the same direction.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import BadConfig, UnknownName
from ..samplers.keyed import unit
from ..samplers.task_files import conf_dir
from ..work.plain import read_yaml
from .effects import (
    EFFECTS,
    LANGUAGE,
    OBJECTS,
    PICTURES,
    PROPRIOCEPTION,
    WRENCH,
    Effect,
    Picture,
    Reading,
    Values,
    is_among,
)
from .language import WORDINGS, Words

LEVELS = 5
"""Number of levels of each kind."""
HEADLIGHT = "vis_headlight_"
"""Beginning of the names of the colours of the light at the camera."""
NONE = "none"
"""Name of no perturbation."""


@dataclass(frozen=True)
class Kind:
    """A kind of perturbation."""

    name: str
    strengths: tuple[float, ...]
    """Strength at each level."""
    unit: str
    """Unit of the strengths."""
    why: str
    """Reason for the range."""
    source: str
    """Ranges that others use."""

    @property
    def effect(self) -> Effect:
        return EFFECTS[self.name]


@cache
def kinds() -> Mapping[str, Kind]:
    """All kinds, from `conf/perturbations`.

    Raises:
        BadConfig: a file is damaged, has not as many growing strengths as there are levels, or no effect.
    """
    found = {}
    for path in sorted((conf_dir() / "perturbations").glob("*.yaml")):
        node, name = read_yaml("kind", path), path.stem
        if name not in EFFECTS:
            raise BadConfig(f"{path}: there is no effect named {name}; give it in scengen.perturb.effects")
        try:
            strengths = tuple(float(each) for each in node["strengths"])
            kind = Kind(name, strengths, *(str(node[key]) for key in ("unit", "why", "source")))
        except (KeyError, TypeError, ValueError) as error:
            raise BadConfig(f"{path}: give strengths, unit, why and source ({error})") from None
        if len(strengths) != LEVELS or any(b <= a for a, b in zip((0.0, *strengths), strengths, strict=False)):
            raise BadConfig(f"{path}: strengths = {list(strengths)}; give {LEVELS} growing positive numbers")
        found[name] = kind
    return found


def kind_of(name: str) -> Kind:
    """The kind of this name.

    Raises:
        UnknownName: there is none.
    """
    if name not in kinds():
        raise UnknownName("perturbation", name, kinds())
    return kinds()[name]


@dataclass(frozen=True)
class Perturbation:
    """Some kinds at their levels."""

    parts: tuple[tuple[str, int], ...]
    """Kind and level of each."""

    @classmethod
    def parse(cls, text: str | None) -> "Perturbation":
        """Read `kind@level`, several separated by `+`; nothing for None, an empty text or `none`.

        Raises:
            UnknownName: there is no such kind.
            BadConfig: a level does not exist, or two parts are one kind.
        """
        parts = list[tuple[str, int]]()
        for one in (text or "").split("+") if text not in (None, "", NONE) else ():
            name, at, level = one.strip().partition("@")
            kind_of(name)
            if not at or not level.isdigit() or not 1 <= int(level) <= LEVELS:
                raise BadConfig(f"perturb = {text}; give {name} a level from 1 to {LEVELS}, such as {name}@3")
            if name in dict(parts):
                raise BadConfig(f"perturb = {text}; {name} is in it twice: give each kind once")
            parts.append((name, int(level)))
        if len(texts := [name for name, _ in parts if name in WORDINGS]) > 1:
            raise BadConfig(f"perturb = {text}; {' and '.join(texts)} replace the same instruction: give one of them")
        return cls(tuple(parts))

    def __str__(self) -> str:
        return "+".join(f"{name}@{level}" for name, level in self.parts) or NONE

    def __bool__(self) -> bool:
        return bool(self.parts)

    @property
    def has_words(self) -> bool:
        """Whether a part changes the instruction."""
        return any(kinds()[name].effect.reads == LANGUAGE for name, _ in self.parts)

    def check(self, streams: Sequence[str], cameras: Sequence[str]) -> None:
        """Raise `BadConfig` if a part affects nothing that is observed. The instruction can always be read.

        Args:
            streams: names of the observed streams.
            cameras: robosuite's names of the observed cameras.
        """
        for name, level in self.parts:
            effect = kinds()[name].effect
            if effect.reads == LANGUAGE:
                continue
            if effect.reads == PICTURES:
                seen = [camera for camera in cameras if affects(effect, camera)]
                what = (
                    f"{effect.cameras}, and none is observed: observe one, such as rgb_exo_right_cam or rgb_gripper_cam"
                )
            else:
                seen = [stream for stream in streams if stream_kind(stream) == effect.reads]
                what = f"streams of {effect.reads}, and none is observed: observe one"
            if not seen:
                raise BadConfig(f"perturb = {name}@{level} affects {what}")

    def of(self, scenario: str, seed: int = 0, bodies: Iterable[str] = (), words: Words | None = None) -> "Drawn":
        """What is drawn for a scenario.

        Args:
            scenario: its id.
            bodies: names of the bodies of its scene. Readings of others stay 0.
            words: the instruction and others, for a part that changes it.
        """
        values = {}
        for name, level in self.parts:
            rng = _random("draw", name, scenario, seed)
            values[name] = kinds()[name].effect.draw(kinds()[name].strengths[level - 1], rng)
        starts = tuple(f"{start}{body}_" for body in bodies for start in ("", "seen_"))
        return Drawn(self, scenario, seed, values, starts, words)


@dataclass(frozen=True)
class Drawn:
    """A perturbation of one scenario."""

    perturbation: Perturbation
    scenario: str
    seed: int
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
        return max(
            (float(np.asarray(self.values[n]["seconds"])) for n, each in self.effects.items() if each.is_late),
            default=0.0,
        )

    def on_model(self, model: mujoco.MjModel) -> None:
        """Change lights, colours and cameras of a compiled scene, once."""
        for name, values in self.values.items():
            self.effects[name].on_model(model, values)

    @contextmanager
    def while_applied(self, model: mujoco.MjModel) -> Iterator[set[str]]:
        """Change a compiled scene as `on_model` during a `with` statement; the names of the arrays that differ then."""
        before = arrays(model)
        self.on_model(model)
        changed = {name for name, array in arrays(model).items() if array.tobytes() != before[name].tobytes()}
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
                picture = effect.on_picture(picture, values, self._rng(name, camera, period))
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
                found = effect.on_reading(entries, reading, values, self._rng(name, stream, period))
                reading = np.where(self._there(entries), found, reading) if effect.reads == OBJECTS else found
        return reading

    def _there(self, entries: Sequence[str]) -> NDArray[np.bool_]:
        """Whether the scene has the body of each entry."""
        return np.array([entry.startswith(self.starts) for entry in entries])

    def _rng(self, name: str, what: str, period: int) -> np.random.Generator:
        return _random("use", name, dict(self.perturbation.parts)[name], self.scenario, self.seed, what, period)


class Late:
    """Pictures that arrive late: of each camera the newest one that is old enough, or the first."""

    def __init__(self, delay: float):
        """
        Args:
            delay: age of what arrives [s].
        """
        self.delay = delay
        self.taken: dict[str, list[tuple[float, Picture]]] = {}
        """Time [s] and picture of what has been taken and may still arrive, by camera."""

    def arriving(self, camera: str, time: float, picture: Picture) -> Picture:
        """The picture that arrives when another one is taken."""
        taken = [each for each in self.taken.get(camera, []) if each[0] < time]
        taken.append((time, picture))
        while len(taken) > 1 and taken[1][0] <= time - self.delay + 1e-9:
            del taken[0]
        self.taken[camera] = taken
        return taken[0][1]


def arrays(model: mujoco.MjModel) -> dict[str, NDArray[np.generic]]:
    """Copies of all arrays of a compiled scene, by name, and of the colours of its headlight."""
    every = {name: getattr(model, name) for name in dir(model) if not name.startswith("_")}
    light = model.vis.headlight
    every |= {f"{HEADLIGHT}{part}": getattr(light, part) for part in ("ambient", "diffuse", "specular")}
    return {name: array.copy() for name, array in every.items() if isinstance(array, np.ndarray)}


def affects(effect: Effect, camera: str) -> bool:
    """Whether an effect shows in a camera, given robosuite's name."""
    return effect.reads == PICTURES and is_among(camera, effect.cameras)


def stream_kind(stream: str) -> str:
    """Which kind of reading a stream is."""
    if "force_torque" in stream:
        return WRENCH
    own = ("eef_pos", "eef_quat", "joint_pos", "joint_vel", "gripper_qpos")
    if stream.startswith("robot") and stream.endswith(own):
        return PROPRIOCEPTION
    return "" if "tactile" in stream else OBJECTS


def _random(*key: str | int) -> np.random.Generator:
    """Random numbers that depend on a key alone."""
    return np.random.default_rng(int(unit("perturb", *key) * 2**53))

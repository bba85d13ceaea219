"""Films: recorded actions played again in front of a camera, as a strip of pictures or as a video."""

from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..control.loop import Loop
from ..episode import Actions, Episode
from ..errors import UnknownName
from ..pool import PoolRow
from ..scenario import Scenario
from ..sim.world import World
from ..validate.rollout import Rollout, try_shortcut
from .render import Camera, Picture
from .video import Movie

WITNESS = "witness"
COLUMNS = 4
"""Pictures in a row of a strip."""


@dataclass(frozen=True)
class Take:
    """What is filmed: recorded actions in their scene."""

    scenario: Scenario
    scene_xml: str
    embodiment: str
    actions: Actions

    @classmethod
    def witness(cls, row: PoolRow, scenario: Scenario) -> "Take":
        """The witness of a scenario in a pool."""
        return cls(scenario, row.scene_xml, row.embodiment, row.witness)

    @property
    def seconds(self) -> float:
        """How long it lasts [s]."""
        return round(len(self.actions) * Loop.PERIOD, 2)

    def world(self) -> World:
        """Its world at the start, with everything that is only looked at."""
        return World.load(self.scene_xml, self.embodiment, visual=True)

    def moments(self, world: World, periods: Iterable[int]) -> Iterator[int]:
        """Play the actions, and stop after each of these numbers of control periods."""
        world.reset()
        episode, done = Episode(self.scenario, world), 0
        for period in periods:
            for action in self.actions[done:period]:
                episode.step(action)
            done = period
            yield period


def shortcut(row: PoolRow, scenario: Scenario, name: str, raw: bool = False) -> tuple[Take, Rollout]:
    """One of the tempting plans of a scenario, and what comes of it: what its certificate saw.

    Raises:
        UnknownName: the scenario has no shortcut of that name.
    """
    shortcuts = scenario.shortcuts()
    if name not in shortcuts:
        raise UnknownName("shortcut", name, [WITNESS, *shortcuts])
    world = World.load(row.scene_xml, row.embodiment)
    rollout = try_shortcut(scenario, world, shortcuts[name], row.horizon, row.certificate.settle or 0.0, raw)
    return Take(scenario, row.scene_xml, row.embodiment, rollout.actions), rollout


def strip(take: Take, frames: int = 8, width: int = 320, height: int = 240, camera: str | None = None) -> Picture:
    """Pictures at equal times from the start to the end, in rows of four.

    Args:
        camera: one of the scene's or the robot's cameras; default a view that is fitted to the scene.

    Raises:
        NoPictures: OpenGL is missing.
        UnknownName: there is no such camera.
    """
    periods = np.linspace(0, len(take.actions), frames).round().astype(int)
    with closing(Camera(take.world(), width, height)) as eye:
        pictures = [eye.take(camera) for _ in take.moments(eye.world, periods.tolist())]
    columns = min(COLUMNS, frames)
    blank = np.full_like(pictures[0], 255)
    pictures += [blank] * (-frames % columns)
    return np.vstack([np.hstack(pictures[i : i + columns]) for i in range(0, len(pictures), columns)])


def movie(take: Take, path: Path, fps: int, width: int, height: int, camera: str | None = None) -> int:
    """Write an MP4 that runs as fast as the world did. Returns the number of its frames.

    Args:
        fps: frames in a second; a divisor of the control rate of 100 Hz.
        camera: as for `strip`.

    Raises:
        NoPictures, NoVideo: OpenGL or PyAV is missing.
        UnknownName: there is no such camera.
    """
    every = periods_between(fps)
    with closing(Camera(take.world(), width, height)) as eye, Movie(path, fps, width, height) as film:
        for _ in take.moments(eye.world, range(0, len(take.actions) + 1, every)):
            film.add(eye.take(camera))
        return film.frames


def periods_between(fps: int) -> int:
    """Control periods between two frames; 100 Hz is a multiple of `fps`.

    Raises:
        UnknownName: it is not.
    """
    rate = round(1 / Loop.PERIOD)
    if fps < 1 or rate % fps:
        divisors = [n for n in range(1, rate + 1) if rate % n == 0]
        raise UnknownName(f"fps that divides the control rate of {rate} Hz", str(fps), map(str, divisors))
    return rate // fps

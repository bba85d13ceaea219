"""Films: recorded actions replayed in front of a camera, as a strip of pictures or as a video."""

import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..control.loop import Loop
from ..episode import STRICT, Actions, Episode, Rules
from ..errors import BadConfig, UnknownName
from ..look.looks import ROOM, Look
from ..means import MISSED, OPEN, SHOWN
from ..perturb.drawn import Drawn
from ..perturb.language import Words
from ..perturb.perturbation import Perturbation
from ..pool import PoolRow
from ..scenario import Scenario
from ..sim.world import World
from ..validate.playable import stored_world
from ..validate.rollout import Rollout, try_shortcut
from ..work.targets import appearing
from .render import Camera, Picture, address, check_pictures
from .video import Movie
from .views import VIEWS, Directions

WITNESS = "witness"
"""Name of the actions of the witness, in place of a shortcut's."""
COLUMNS = 4
"""Number of pictures in a row of a strip."""
POLICY_CAMERA = "agentview"
"""Camera of perturbed films that name none: perturbations change what policies see, and none sees a fitted view."""
FRAMED = 12
"""Number of moments of a video over which the clearest view is chosen."""
Progress = Callable[[int, int], None]
"""Function that gets the number of finished pictures and the number of all."""


@dataclass(frozen=True)
class Take:
    """Recorded actions in their scene, to be filmed."""

    scenario: Scenario
    scene_xml: str = field(repr=False)
    embodiment: str
    actions: Actions = field(repr=False)
    rules: Rules = field(default=STRICT, kw_only=True)
    look: Look = field(default=ROOM, kw_only=True)
    directions: Directions = field(default=VIEWS, kw_only=True)
    """Directions of the views to choose from."""
    perturbation: Perturbation = field(default=Perturbation(()), kw_only=True)
    """Perturbation of the pictures, which then are those that a policy sees."""
    perturb_seed: int = field(default=0, kw_only=True)
    """Seed of the perturbation."""
    words: Words | None = field(default=None, kw_only=True)
    """What is said in the task, for a perturbation of things that it does not name."""

    @classmethod
    def witness(cls, row: PoolRow, scenario: Scenario) -> "Take":
        """The witness of a scenario in a pool."""
        return cls(scenario, row.scene_xml, row.embodiment, row.witness)

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return round(len(self.actions) * Loop.PERIOD, 2)

    def world(self) -> World:
        """Its world at the start, with the visual geoms.

        Raises:
            NoPictures: pictures of it cannot be made here.
        """
        check_pictures()
        world = World.load(self.scene_xml, self.embodiment, self.perturbation.dressed(self.look))
        self.drawn.on_model(world.model)
        return world

    @cached_property
    def drawn(self) -> Drawn:
        """What is drawn for its perturbation."""
        return self.perturbation.of(self.scenario.id, self.perturb_seed, words=self.words)

    def camera(self, name: str | None, width: int, height: int) -> str | None:
        """The camera that films it, given the requested one; None for the fitted view.

        Raises:
            BadConfig: a perturbation does not show in its pictures, or pictures of this size cannot be turned.
        """
        if not self.perturbation:
            return name
        self.perturbation.check_perceived("a film replays what an arm has done; film a pool of generate perturb=")
        self.perturbation.check((), [name or POLICY_CAMERA], self.look, "camera={}")
        self.scenario.orientation.check_size(width, height)
        return name or POLICY_CAMERA

    def shown(self, eye: Camera, camera: str | None, period: int) -> Picture:
        """A picture of the present world, as a policy sees it in a control period if it is perturbed."""
        picture = eye.take(camera)
        if not self.perturbation or camera is None:
            return picture
        return self.drawn.on_picture(self.scenario.orientation.apply(picture).copy(), camera, period)

    def exposed(self, periods: Iterable[int]) -> list[int]:
        """Control periods in which the pictures are taken that are seen in some control periods."""
        return [max(0, period - round(self.drawn.delay / Loop.PERIOD)) for period in periods]

    def moments(self, world: World, periods: Iterable[int]) -> Iterator[str]:
        """Replay the actions, stop after each of these numbers of control periods, and yield time and outcome."""
        world.reset()
        episode, done, outcome, note = Episode(self.scenario, world, rules=self.rules), 0, None, ""
        for period in periods:
            for number, action in enumerate(self.actions[done:period], done + 1):
                if (now := episode.step(action)) != outcome:
                    outcome, note = now, f", {now} at {number * Loop.PERIOD:.2f} s"
            done = period
            yield f"{period * Loop.PERIOD:.2f} s{note}"

    @cached_property
    def ways(self) -> list["Way"]:
        """When each mean of the task was decided, as a replay of the actions shows."""
        episode = Episode(self.scenario, World.load(self.scene_xml, self.embodiment), rules=self.rules)
        at, end = dict[str, tuple[float, float]](), self.seconds
        for number, action in enumerate(self.actions, 1):
            if (outcome := episode.step(action)) not in (None, "success"):
                break
            if outcome == "success":
                end = min(end, number * Loop.PERIOD)
            new = {
                name: (found, number * Loop.PERIOD) for name, found in episode.means.found().items() if found != OPEN
            }
            at = new | at
        lasting = {name for name, mean in episode.means.means.items() if mean.lasting and name not in at}
        return [
            Way(name, *at.get(name, (SHOWN, end) if name in lasting else (OPEN, self.seconds)))
            for name in episode.means.means
        ]

    def even(self, count: int) -> list[int]:
        """`count` control periods at equal distances, from the start to the end."""
        return [int(period) for period in np.linspace(0, len(self.actions), count).round()]


@dataclass(frozen=True)
class Way:
    """A mean of a task over the time of a take."""

    name: str
    found: float
    """Whether it was `SHOWN` or `MISSED`, or is still `OPEN` at the end."""
    seconds: float
    """Time at which that was decided [s]: of a mean that held throughout the success, of one that is open the end."""

    def __str__(self) -> str:
        mark, word = {SHOWN: ("+", "by"), MISSED: ("-", "missed at"), OPEN: ("-", "not shown by")}[self.found]
        return f"{mark} {self.name} ({word} {self.seconds:.2f} s)"


def timeline(ways: Sequence[Way], seconds: float, width: int) -> Picture:
    """A line for each mean: its name and, on an axis of time, where it was shown (green) or missed (red).

    Args:
        seconds: length of the axis [s].
        width: width of the picture [pixels].
    """
    line = 22
    image = Image.new("RGB", (width, line * len(ways) + line // 2), "white")
    pen, font, left, right = ImageDraw.Draw(image), ImageFont.load_default(13), round(0.55 * width), width - line
    for number, way in enumerate(ways):
        y = line * number + line // 2
        pen.text((line // 2, y - 4), way.name, "black", font)
        at = left + (right - left) * min(1.0, way.seconds / max(seconds, Loop.PERIOD))
        colour = {SHOWN: (30, 140, 60), MISSED: (200, 40, 40), OPEN: (150, 150, 150)}[way.found]
        pen.line((left, y + 4, right, y + 4), (210, 210, 210), 2)
        pen.line((left, y + 4, at, y + 4), colour, 2)
        pen.rectangle((at - 4, y, at + 4, y + 8), colour)
    return np.array(image)


def shortcut(row: PoolRow, scenario: Scenario, name: str, raw: bool = False) -> tuple[Take, Rollout]:
    """The actions of a shortcut of a scenario, and its rollout, which is that of the certificate.

    Raises:
        UnknownName: the scenario has no shortcut of that name.
    """
    shortcuts = scenario.shortcuts()
    if name not in shortcuts:
        raise UnknownName("shortcut", name, [WITNESS, *shortcuts])
    world = stored_world(row)
    rollout = try_shortcut(scenario, world, shortcuts[name], row.horizon, row.certificate.settle or 0.0, raw)
    return Take(scenario, row.scene_xml, row.embodiment, rollout.actions), rollout


def strip(
    take: Take,
    frames: int = 8,
    width: int = 320,
    height: int = 240,
    camera: str | None = None,
    progress: Progress = lambda done, total: None,
) -> Picture:
    """Pictures at equal times from the start to the end, in rows of four, each with its time and the outcome so far;
    below, the means of the task over time.

    Args:
        camera: one of the scene's or the robot's cameras. Default: the fitted view that hides least of the scene in
            these pictures.
        progress: function that gets the number of pictures taken and the number of all.

    Raises:
        NoPictures: OpenGL is missing.
        UnknownName: there is no such camera.
    """
    pictures, periods, camera = list[Picture](), take.even(frames), take.camera(camera, width, height)
    with closing(Camera(take.world(), width, height)) as eye:
        exposed = take.exposed(periods)
        visited = sorted({*periods, *exposed})
        captions, states = {}, {}
        for period, captions[period] in zip(visited, take.moments(eye.world, visited), strict=True):
            states[period] = eye.world.state()
        if camera is None:
            eye.frame([states[period] for period in periods], take.directions)
        ways = take.ways
        for period, when in zip(periods, exposed, strict=True):
            eye.world.restore(states[when])
            pictures.append(captioned(take.shown(eye, camera, period), captions[period]))
            progress(len(pictures), frames)
    columns = min(COLUMNS, frames)
    blank = np.full_like(pictures[0], 255)
    pictures += [blank] * (-frames % columns)
    rows = [np.hstack(pictures[i : i + columns]) for i in range(0, len(pictures), columns)]
    return np.vstack([*rows, timeline(ways, take.seconds, columns * width)] if ways else rows)


def captioned(picture: Picture, text: str) -> Picture:
    """The picture with a line of text in its lower left corner."""
    height = max(12, picture.shape[0] // 16)
    image = Image.fromarray(picture)
    pen, font, place = (
        ImageDraw.Draw(image),
        ImageFont.load_default(height),
        (height // 2, picture.shape[0] - 2 * height),
    )
    pen.text(place, text, "white", font, stroke_width=max(1, height // 10), stroke_fill="black")
    return np.array(image)


def movie(
    take: Take,
    path: Path,
    fps: int,
    width: int,
    height: int,
    camera: str | None = None,
    progress: Progress = lambda done, total: None,
) -> int:
    """Write an MP4 in real time, whole or not at all. Returns the number of its frames.

    Args:
        fps: frames per second, a divisor of the control rate of 100 Hz.
        camera, progress: as for `strip`.

    Raises:
        NoPictures, NoVideo: OpenGL or PyAV is missing.
        UnknownName: there is no such camera.
        BadConfig: the file cannot be written.
    """
    periods_between(fps)  # before a file is started
    camera = take.camera(camera, width, height)
    with (
        closing(Camera(take.world(), width, height)) as eye,
        appearing(path, folder=False) as part,
        Movie(part, fps, width, height) as film,
    ):
        for picture in _frames(take, eye, fps, camera, progress):
            film.add(picture)
        return film.frames


@dataclass(frozen=True)
class InlineFilm:
    """A film in memory, which notebooks show."""

    content: bytes
    """Animated WebP, which repeats."""

    def __repr__(self) -> str:
        return f"InlineFilm({len(self.content)} bytes)"

    def _repr_html_(self) -> str:
        return f'<img src="{address(self.content, "webp")}" alt="film of a rollout">'


def inline(
    take: Take,
    fps: int = 10,
    width: int = 320,
    height: int = 240,
    camera: str | None = None,
    progress: Progress = lambda done, total: None,
) -> InlineFilm:
    """A film in real time for a notebook, which shows it if it is the last line of a cell. It needs no video codec.

    Args:
        fps: frames per second, a divisor of the control rate of 100 Hz.
        camera, progress: as for `strip`.

    Raises:
        NoPictures: OpenGL is missing.
        UnknownName: there is no such camera.
        BadConfig: it is not a take.
    """
    if not isinstance(take, Take):
        raise BadConfig(
            f"a {type(take).__name__} is not a take; give film.Take.witness(row, scenario), or another take"
        )
    camera = take.camera(camera, width, height)
    with closing(Camera(take.world(), width, height)) as eye:
        first, *others = map(Image.fromarray, _frames(take, eye, fps, camera, progress))
    buffer = io.BytesIO()
    milliseconds = round(1000 * Loop.PERIOD * periods_between(fps))
    first.save(buffer, "webp", save_all=True, append_images=others, duration=milliseconds, loop=0, quality=80)
    return InlineFilm(buffer.getvalue())


def _frames(take: Take, eye: Camera, fps: int, camera: str | None, progress: Progress) -> Iterator[Picture]:
    """Pictures of a take, `fps` per second."""
    periods = range(0, len(take.actions) + 1, periods_between(fps))
    if camera is None:
        eye.frame([eye.world.state() for _ in take.moments(eye.world, take.even(FRAMED))], take.directions)
    for number, _ in enumerate(take.moments(eye.world, take.exposed(periods))):
        yield take.shown(eye, camera, periods[number])
        progress(number + 1, len(periods))


def periods_between(fps: int) -> int:
    """Number of control periods between two frames.

    Raises:
        UnknownName: 100 Hz is not a multiple of `fps`.
    """
    rate = round(1 / Loop.PERIOD)
    if fps < 1 or rate % fps:
        divisors = [n for n in range(1, rate + 1) if rate % n == 0]
        raise UnknownName(f"fps that divides the control rate of {rate} Hz", str(fps), map(str, divisors))
    return rate // fps

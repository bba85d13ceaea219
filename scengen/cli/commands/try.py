"""play one plan in one scenario that need not be certified, and film it"""

import re
import traceback
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ... import compose
from ...envs.observations import ALL, cameras_of
from ...errors import BadConfig, GaveUp, UnknownName, cut
from ...ood.analysis.redraw import task_of
from ...pictures.film import WITNESS, Take, movie, strip
from ...pictures.render import check_pictures, encode
from ...runs.progress import ProgressBar
from ...samplers.task import Task
from ...samplers.task_files import search_path
from ...scenario import Plan, Planner, Scenario
from ...sim.arm import ROBOT
from ...sim.world import World
from ...validate.playable import check_row
from ...validate.rebuilt import rebuild
from ...validate.rollout import Jitter, Rollout, replay, run, try_shortcut
from ...validate.settings import MAX_RUNS, CertifySettings
from ...work.limits import at_least
from ...work.targets import try_file
from ...work.typed import typed
from . import FAILED, OK, Arguments, chosen, err, holder, remark, say, write
from .settings import read, task_overrides
from .show_film import check_format

ORACLE = "oracle"
"""Value of `what` for the oracle without jitter."""
JITTER = "jitter"
"""Word before the number of a jittered oracle run in `what`, as in `jitter:3`."""
FILMS = (".png", ".mp4")
"""Suffixes of films: a strip and a video."""
TARGETS = ("goal", "target", "spot")
"""Names by which moves call the place where the hand or a body shall go [m]."""


@dataclass(frozen=True)
class TrySettings:
    """Settings of `scengen try`; conf/command/try.yaml explains them."""

    pool: str | list[str] | None
    id: str | None
    split: str
    sampler: str
    seed: int
    index: int
    what: str
    raw: bool
    film: str | None
    camera: str | None
    frames: int
    fps: int
    width: int
    height: int

    def check(self, is_drawn: bool) -> None:
        """Raise `BadConfig` for settings that are not valid.

        Args:
            is_drawn: whether a task was given, from which the scenario is drawn.
        """
        if is_drawn == (self.pool is not None) or is_drawn == (self.id is not None):
            raise BadConfig("try needs either task=NAME, or pool=FOLDER and id=ID; see scengen try --help")
        at_least(self, seed=0, index=0, frames=1, fps=1, width=1, height=1)
        if is_drawn and self.what == WITNESS:
            raise BadConfig(f"what = {WITNESS}; a drawn scenario has none; give pool= and id=, or what={ORACLE}")
        if self.raw and (self.what in (ORACLE, WITNESS) or self.run is not None):
            raise BadConfig(f"raw = true, with what={self.what}; only shortcuts can be played raw; leave raw out")
        if self.film is not None and Path(self.film).suffix not in FILMS:
            raise BadConfig(f"film = {self.film}; give a .png file for a film strip or an .mp4 file for a video")
        if self.film is not None:
            check_format(Path(self.film), self.frames, self.fps, self.width, self.height)

    @property
    def run(self) -> int | None:
        """Number of the requested jittered run; None if no jittered run is requested."""
        word, colon, number = self.what.partition(":")
        if word != JITTER:
            return None
        if not colon or not re.fullmatch(r"\d{1,4}", number, re.ASCII) or int(number) >= MAX_RUNS:
            known = f"{JITTER}:0 to {JITTER}:{MAX_RUNS - 1}"
            raise BadConfig(f"what = {cut(self.what)}; give a jittered run by its number, {known}")
        return int(number)


@dataclass(frozen=True)
class Stage:
    """A scenario in which a plan is played."""

    name: str
    scenario: Scenario
    scene_xml: str
    embodiment: str
    horizon: float
    """Time limit for reaching the goal [s]."""
    settings: CertifySettings
    """Settings of its certificate, with the sizes of the jitter."""
    witness: Any = None
    """Recorded actions of the witness; None for a drawn scenario."""


@dataclass(frozen=True)
class DisturbedTake(Take):
    """Recorded actions in a scene with jitter."""

    jitter: Jitter

    def world(self) -> World:
        return self.jitter.disturbed(super().world(), self.scenario.DISTURBED)


class Watched:
    """A plan that keeps where and in which move it gave up."""

    def __init__(self, planner: Planner):
        self._planner = planner
        self.end = ""
        """Description of the moment at which the plan gave up; empty if it did not."""

    def __call__(self, world: World) -> Plan:
        try:
            yield from self._planner(world)
        except GaveUp as error:
            self.end = _moment(world, error)
            raise


def command(arguments: Arguments) -> int:
    settings = read("try", arguments, TrySettings)
    name = compose.chosen_task("try", arguments)
    settings.check(name is not None)
    try_file(settings.film)
    if settings.film is not None:
        check_pictures()
    stage = _of_pool(settings, arguments) if name is None else _drawn(name, settings, arguments)
    rollout, take, end = _played(stage, settings)
    reason = f": {rollout.reason}" if rollout.reason else ""
    say(f"{stage.name}, {settings.what}: {rollout.outcome} after {rollout.seconds:g} s{reason}")
    if rollout.gave_up and rollout.gave_up != rollout.reason:
        say(f"the plan gave up: {rollout.gave_up}")
    if end:
        say(end)
    if settings.film is not None:
        _film(take, Path(settings.film), settings)
    return OK if rollout.solved else FAILED


def _of_pool(settings: TrySettings, arguments: Arguments) -> Stage:
    """A scenario of a pool, with the settings of its certificate."""
    pool = holder(settings.pool, str(settings.id))
    row = check_row(chosen(pool, str(settings.id)))
    task = task_of(pool, search_path(arguments))
    certify_settings = typed("certify", CertifySettings, dict(pool.manifest.config.certify))
    return Stage(
        str(row.name),
        task.scenario(row.params),
        row.scene_xml,
        row.embodiment,
        row.horizon,
        certify_settings,
        row.witness,
    )


def _drawn(name: str, settings: TrySettings, arguments: Arguments) -> Stage:
    """A scenario that is drawn from a task: the first feasible try of an index, or the first try if none is feasible.

    Raises:
        BadConfig: its scene does not compile.
    """
    task: Task = compose.load_task(name, [*search_path(arguments), *task_overrides(arguments)])
    tries = list(task.proposals(settings.split, settings.seed, settings.index, task.design(settings.sampler)))
    proposal = tries[0] if tries[-1].refutation else tries[-1]
    where = f"{name}/{settings.split}@{settings.index}/{proposal.scenario.id}"
    if proposal.refutation:
        remark(f"{where} is infeasible, like all {len(tries)} draws of its index: {proposal.refutation.reason}")
    level = compose.certify_levels(task)["quick"]
    try:
        text = rebuild(proposal.scenario)
        World.load(text, task.embodiment)
    except ValueError as error:
        raise BadConfig(f"{where}: the scene does not compile: {' '.join(str(error).split())}; correct it") from None
    return Stage(where, proposal.scenario, text, task.embodiment, task.horizon, level)


def _played(stage: Stage, settings: TrySettings) -> tuple[Rollout, Take, str]:
    """Play the plan as a certificate does.

    Returns:
        The rollout, its actions to be filmed, and a description of the moment at which the plan gave up, or at which
        the episode ended without reaching the goal.
    """
    scenario, settle = stage.scenario, stage.settings.settle
    world = World.load(stage.scene_xml, stage.embodiment)
    shortcuts = scenario.shortcuts()

    if settings.what == WITNESS:
        rollout = replay(scenario, world, stage.witness, stage.horizon, settle)
        return rollout, Take(scenario, stage.scene_xml, stage.embodiment, rollout.actions), _end(rollout, world, "")
    if (number := settings.run) is not None:
        jitter = Jitter.within(stage.settings.robust, scenario.id, number)
        plan = Watched(scenario.oracle)
        disturbed = jitter.disturbed(world, scenario.DISTURBED)
        rollout = run(scenario, disturbed, plan, stage.horizon, settle, jitter)
        taken: Take = DisturbedTake(scenario, stage.scene_xml, stage.embodiment, rollout.actions, jitter)
        return rollout, taken, _end(rollout, disturbed, plan.end)
    if settings.what == ORACLE:
        plan = Watched(scenario.oracle)
        rollout = run(scenario, world, plan, stage.horizon, settle, whole=True)
    elif settings.what in shortcuts:
        plan = Watched(shortcuts[settings.what].plan)
        watched = replace(shortcuts[settings.what], plan=plan)
        rollout = try_shortcut(scenario, world, watched, stage.horizon, settle, settings.raw)
    else:
        known = [ORACLE, f"{JITTER}:0", *([] if stage.witness is None else [WITNESS]), *shortcuts]
        raise UnknownName("plan", settings.what, known)
    take = Take(scenario, stage.scene_xml, stage.embodiment, rollout.actions)
    return rollout, take, _end(rollout, world, plan.end)


def _end(rollout: Rollout, world: World, gave_up: str) -> str:
    """Place where a plan gave up, or places of the hands at the end of an episode that is not a success."""
    return gave_up if gave_up or rollout.solved else f"at the end {'; '.join(_hands(world))}"


def _moment(world: World, error: GaveUp) -> str:
    """The moves in which a plan has given up, where each hand is, what its arm touches, and the target of the move."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)][1:]  # without the watching one
    moves = " > ".join(frame.f_code.co_name for frame in frames)
    where = f" in {moves}" if moves else ""
    parts = [f"it gave up at {world.time:.2f} s{where}", *_hands(world)]
    if (target := _target(error.__traceback__)) is not None:
        parts.append(f"the target was {_point(target)} m")
    return "; ".join(parts)


def _hands(world: World) -> list[str]:
    """Position of each hand, and the bodies that its arm touches."""
    parts = []
    for arm in world.arms:
        whose = f"the hand of arm {arm.number}" if len(world.arms) > 1 else "the hand"
        touched = sorted(world.touching_bodies(arm.label) - {ROBOT})
        parts.append(f"{whose} was at {_point(arm.hand)} m and touched {', '.join(touched) or 'nothing'}")
    return parts


def _target(trace: TracebackType | None) -> np.ndarray | None:
    """The point to which the innermost move was to go, as the move calls it; None for a move without one."""
    inner = [frame for frame, _ in traceback.walk_tb(trace)][-1].f_locals
    for name in TARGETS:
        point = inner.get(name)
        if isinstance(point, np.ndarray) and point.shape == (3,):
            return point
    return None


def _point(point: np.ndarray) -> str:
    return f"({', '.join(f'{value:.3f}' for value in point)})"


def _film(take: Take, target: Path, settings: TrySettings) -> None:
    """Write a film strip or a video of what was played."""
    camera = cameras_of(ALL).get(settings.camera, settings.camera) if settings.camera else None
    size = (settings.width, settings.height)
    with ProgressBar(err, "film", 1) as bar:
        if target.suffix == ".png":
            write(target, encode(strip(take, settings.frames, *size, camera, bar.of), "png"))
        else:
            movie(take, target, settings.fps, *size, camera, bar.of)
    say(f"wrote {target}: {take.seconds:g} s")

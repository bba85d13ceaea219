"""Stage 3: a model acts in a closed loop of reasoning and primitives (ReAct; paper, App. F)."""

import re
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..assets.prop import TABLE_HALF, TABLE_TOP
from ..control.loop import Loop
from ..envs.gym import Observation, PoolEnv
from ..envs.object_state import xyzw
from ..evaluate.recorder import Recorder
from ..geometry import Vec3
from ..sim.boxes import box_around
from ..sim.embodiment import hands
from ..sim.world import World
from .calls import Calls
from .models import Call, Turn
from .primitives import DONE, BadCall, Primitive, called, next_action, primitive, tools
from .questioning import ACT, Exam, Result
from .scene import cameras, controller, pictures, prompt, robot, rules, told

HISTORY = 12
"""Number of batches of pictures, and of steps in the memory, that a prompt holds (paper, App. F)."""
MAX_STEPS = 24
"""Largest number of primitives in an episode (paper, App. F)."""
MAX_TICKS = 10_000
"""Largest number of control periods in an episode (paper, App. F)."""
RETRIES = 3
"""Number of refused calls after which the robot holds (paper, App. F)."""
HOLD = Call("Hold", '{"ticks": 50}')
"""Call in place of refused ones."""
HAND = "robot0_eef_pos"
"""Stream with the position of the first hand [m], which the memory states."""
SEE = "see"
POSES = "poses"
POSES_SEEN = "poses_seen"
MODES = (SEE, POSES, POSES_SEEN)
"""Knowledge of bodies that a model gets: pictures alone, poses in the axes of the actions, or the positions at which
turned pictures show them."""


@dataclass
class Episode:
    """State of one episode: what was seen, done and reached."""

    env: PoolEnv
    exam: Exam
    mode: str
    """One of `MODES`."""
    trials: "Trials"
    """Free trials so far."""
    observation: Observation
    """Last observation."""
    memory: deque[str] = field(default_factory=lambda: deque(maxlen=HISTORY))
    """Last primitives, and why each stopped."""
    frames: deque[dict[str, bytes]] = field(default_factory=lambda: deque(maxlen=HISTORY))
    """Last batches of pictures by their names."""
    ticks: int = 0
    """Number of control periods so far."""
    over: str = ""
    """Reason of the end; empty while it is open."""
    success: bool = False
    lacks: str = ""
    """Means of the task without which the goal was reached."""
    refused: int = 0
    """Number of calls that were refused."""
    steps: list[str] = field(default_factory=list)
    """Every primitive, and why it stopped."""

    def look(self) -> None:
        """Add the present pictures to the history."""
        if batch := pictures(self.env, self.observation, f"{self.env.world.time:.1f} s"):
            self.frames.append(batch)

    def turns(self, left: int, fault: str) -> list[Turn]:
        """The prompt of one step: everything that the model knows."""
        frames = {name: picture for batch in self.frames for name, picture in batch.items()}
        text = prompt(
            "act",
            instruction=" ".join(self.env.task_description.split()),
            robot=robot(self.exam.row.embodiment),
            controller=controller(self.exam.row.embodiment),
            rules=rules(self.exam.row.horizon, self.exam.sheet.rules),
            cameras=cameras(self.env),
            table=TABLE_TOP,
            half=TABLE_HALF,
            time=f"{self.env.world.time:.1f} s",
            reading=told(self.observation),
            poses=self.poses(),
            frames=list(frames),
            memory=list(self.memory),
            trials=self.trials,
            left=left,
            fault=fault,
        )
        return [self.exam.system, Turn("user", text, tuple(frames.values()))]

    def poses(self) -> list[str]:
        """Middles of the boxes around the things [m], orientations and sizes [m]; none if the model only sees."""
        if self.mode == SEE:
            return []
        found, world, counts = list[str](), self.env.world, dict[str, int]()
        for body in _bodies(world.model):
            if (name := self.exam.sheet.name_of(body)) is None:
                continue
            counts[name] = counts.get(name, 0) + 1
            centre, size = _box(world, body)
            pos = world.pos(body) + world.rot(body) @ centre
            if self.mode == POSES_SEEN:
                pos = self.env.scenario.orientation.seen_at(pos)
            told_ = [np.array2string(np.round(v, 3), separator=", ") for v in (pos, xyzw(world.rot(body)), size)]
            number = f" {counts[name]}" if counts[name] > 1 else ""
            found.append(f"{name}{number}: position {told_[0]}, quaternion xyzw {told_[1]}, size {told_[2]}")
        return found

    @property
    def end(self) -> dict[str, Any]:
        """Outcome of the trial, as in the last `info` of the environment."""
        return {"success": self.success, "reason": self.over, "lacks": self.lacks}

    @property
    def told(self) -> dict[str, Any]:
        """Result of the trial, as plain data."""
        return {
            "right": self.success,
            "reason": self.neutral(self.over),
            "steps": self.steps,
            "refused": self.refused,
            "seconds": round(self.ticks * Loop.PERIOD, 2),
        }

    def neutral(self, text: str) -> str:
        """A text with neutral names in place of those of bodies."""
        for body in sorted(_bodies(self.env.world.model), key=len, reverse=True):
            called = self.exam.sheet.name_of(body) or body if body == "table" else self.exam.sheet.name_of(body)
            text = re.sub(rf"(?<![\w/]){re.escape(body)}(?![\w/])", called or "another thing", text)
        return text

    def carry_out(self, chosen: Primitive) -> str:
        """Carry out a primitive; returns why it stopped."""
        plan, before = chosen.plan(), self.ticks
        while True:
            action, why = next_action(plan)
            if action is None:
                break
            self.observation, _, terminated, truncated, info = self.env.step(action)
            self.ticks += 1
            if terminated or truncated:
                self.over, self.success = info["reason"] or "success", bool(info["success"])
                self.lacks = info["lacks"]
            elif self.ticks >= MAX_TICKS:
                self.over = f"{MAX_TICKS} ticks are over"
            if self.over:
                why = "the episode is over"
                break
        self.look()
        at = ", ".join(f"{value:.3f}" for value in self.observation[HAND])
        return f"{self.neutral(why)}, after {(self.ticks - before) * Loop.PERIOD:.2f} s, hand at ({at})"


def act(
    exam: Exam,
    calls: Calls,
    env: PoolEnv,
    mode: str,
    twins: Sequence[str] = (),
    recorder: Recorder | None = None,
) -> Result:
    """Let a model act in one scenario, from its start to the end of the episode.

    Args:
        exam: the scenario.
        calls: journal of the calls.
        env: environment of the task.
        mode: one of `MODES`.
        twins: ids of training scenarios in which the model may try first; it remembers these trials, and they do not
            count.
        recorder: writes the line of the episode that counts.
    """
    trials = Trials(len(twins))
    for twin in twins:
        about = {**exam.about, "trial": len(trials.told) + 1}
        trials.told.append(_play(Episode(env, exam, mode, trials, _start(env, twin)), about, calls).told)
    start = _start(env, exam.row.id)
    if recorder:
        recorder.begin(env, start)
    episode = _play(Episode(env, exam, mode, trials, start), exam.about, calls)
    if recorder:
        recorder.end(env, episode.end)
    explored = {"explored": trials.told} if twins else {}
    return Result(exam.about, ACT, len(episode.steps), "", {**episode.told, **explored})


@dataclass
class Trials:
    """Free trials before the one that counts."""

    total: int
    """Number of free trials."""
    told: list[dict[str, Any]] = field(default_factory=list)
    """Results of finished trials, see `Episode.told`."""


def _start(env: PoolEnv, scenario: str) -> Observation:
    observation, _ = env.reset(options={"scenario": scenario})
    return observation


def _play(episode: Episode, about: Mapping[str, Any], calls: Calls) -> Episode:
    """Ask and act until the episode is over."""
    episode.look()
    while not episode.over and len(episode.steps) < MAX_STEPS:
        asked = {**about, "stage": ACT, "mode": episode.mode, "attempt": len(episode.steps) + 1}
        chosen, faults = _choose(episode, asked, calls, MAX_STEPS - len(episode.steps))
        episode.refused += faults
        if chosen.name == DONE:
            episode.over = "the model says that it is done"
            episode.steps.append(chosen.told)
            break
        episode.steps.append(f"{chosen.told}: {episode.carry_out(chosen)}")
        episode.memory.append(f"{len(episode.steps)}. {episode.steps[-1]}")
    episode.over = episode.over or f"{MAX_STEPS} primitives are used up"
    return episode


def _choose(episode: Episode, about: dict[str, Any], calls: Calls, left: int) -> tuple[Primitive, int]:
    """The primitive that the model calls, and the number of refused calls; after `RETRIES` of them the robot holds."""
    fault, every = "", tools(len(hands(episode.exam.row.embodiment)))
    for retry in range(RETRIES + 1):
        asked = {**about, "retry": retry}
        turns = episode.turns(left, fault)
        reply = calls.ask(asked, turns, every, None, episode.exam.temperature, episode.exam.stand_in)
        try:
            return primitive(called(reply, every, calls.strict), episode.env.world, calls.strict), retry
        except BadCall as error:
            fault = str(error)
    return primitive(HOLD, episode.env.world), RETRIES + 1


def _bodies(model: Any) -> list[str]:
    """Names of all bodies."""
    return [model.body(number).name for number in range(1, model.nbody)]


def _box(world: World, body: str) -> tuple[Vec3, Vec3]:
    """Middle and edges of the box around a body's own geoms, in its axes [m], each of shape (3,)."""
    low, high = box_around(world.model, np.flatnonzero(world.model.geom_bodyid == world.body(body)))
    return (low + high) / 2, high - low

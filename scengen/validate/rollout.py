"""Run one plan, or recorded actions, in one scenario."""

import copy
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from .. import html_tables
from ..control.loop import ACTION, Loop
from ..control.teleop import MOTION, unfiltered
from ..episode import STRICT, Actions, Episode, Outcome, Rules
from ..errors import GaveUp
from ..samplers.keyed import normals, spread
from ..scenario import Action, Planner, Scenario, Shortcut
from ..sim.arm import ROBOT
from ..sim.world import World
from .settings import Robust

REST_TIME = 0.5
"""Time for which every coordinate of scene and robot must keep to its place before an episode counts as settled [s]."""
REST_TOLERANCE = 5e-4
"""Largest change of a coordinate during `REST_TIME` [m, rad], 1 mm in a second. A body that trembles in its place is at
rest, for instance one that a hand presses."""
SHORTCUT_TIME_LIMITS = 3.0
"""Duration of a shortcut that is simulated to rest, in time limits: two fallen tiles may rock for 14 s."""
AT_REST = "everything came to rest without reaching the goal"
"""Reason of an episode that was simulated to rest."""
OUT_OF_REACH = "no goal can count any more, it lacks"
"""Beginning of the reason of an episode that ended because a mean was missed. The missed means follow."""


@dataclass(frozen=True, repr=False)
class Rollout:
    """Result of a rollout."""

    outcome: Outcome
    reason: str
    """Reason why it is not a success; empty for a success."""
    seconds: float
    """Time at which the goal was reached, or at which the episode ended [s]."""
    actions: Actions
    digest: str
    """Hash of the final physics state."""
    gave_up: str = ""
    """Reason why the plan could not be completed; empty if it was, or if the episode ended before."""
    lacks: str = ""
    """Means of the task that were lacking when the goal was reached, joined by semicolons."""
    converged: bool = False
    """Whether more iterations of the solver would have given the same bits, see `Loop.converged`."""
    filtered: bool = True
    """Whether the teleoperation filter has changed an action of the plan. If not, the raw plan gives the same bits."""

    @property
    def solved(self) -> bool:
        return self.outcome == "success"

    def __repr__(self) -> str:
        why = f": {self.reason}" if self.reason else ""
        return f"Rollout({self.outcome}{why}, {self.seconds:.2f} s, {len(self.actions)} actions)"

    def _repr_html_(self) -> str:
        """Its result, in a notebook."""
        head = ("outcome", "reason", "lacks", "time [s]", "actions", "the plan gave up", "final state")
        row = (self.outcome, self.reason, self.lacks, self.seconds, len(self.actions), self.gave_up, self.digest)
        return html_tables.table("Rollout", head, [row])


@dataclass(frozen=True)
class Jitter:
    """Small disturbances of a rollout, drawn from `key` alone."""

    key: str
    position: float
    """Largest displacement of a free body in x and in y [m]."""
    turn: float
    """Largest turn of a free body about the vertical, and of a body on a disturbed hinge about the hinge [deg]."""
    mass: float
    """Largest relative change of a free body's mass."""
    friction: float
    """Largest relative change of a prop's sliding friction."""
    noise: float
    """Standard deviation of the noise on the six motion channels of an action."""
    latency: int
    """Control periods by which actions arrive late."""

    @classmethod
    def within(cls, limits: Robust, key: str, run: int) -> Self:
        """The jitter of one of several runs under the same limits; every second run has latency."""
        late = run % 2 * limits.latency
        sizes = (limits.position, limits.turn, limits.mass, limits.friction, limits.noise)
        return cls(f"{key}/{run}", *sizes, late)

    def disturbed(self, world: World, hinges: Sequence[str] = ()) -> World:
        """A world like `world`, with its bodies moved, heavier or lighter, and more or less slippery.

        Args:
            hinges: hinges that start turned, and whose bodies are heavier or lighter too: `Scenario.DISTURBED`.
        """
        model = copy.copy(world.model)
        for name in world.free_bodies:
            start = model.qpos0[model.jnt_qposadr[model.body_jntadr[world.body(name)]] :][:7]
            start[:2] += (
                spread(self.position, self.key, name, "x"),
                spread(self.position, self.key, name, "y"),
            )
            turn, turned = np.zeros(4), np.zeros(4)
            mujoco.mju_axisAngle2Quat(
                turn, np.array([0.0, 0.0, 1.0]), np.radians(spread(self.turn, self.key, name, "turn"))
            )
            mujoco.mju_mulQuat(turned, turn, start[3:7])
            start[3:7] = turned
        for hinge in hinges:
            _turn_start(model, hinge, np.radians(spread(self.turn, self.key, hinge, "turn")))
        hung = [model.body(int(model.joint(hinge).bodyid[0])).name for hinge in hinges]
        for name in (*world.free_bodies, *hung):
            heavier = 1.0 + spread(self.mass, self.key, name, "mass")
            rougher = 1.0 + spread(self.friction, self.key, name, "friction")
            for part in _subtree(model, world.body(name)):
                model.body_mass[part] *= heavier
                model.body_inertia[part] *= heavier
                model.geom_friction[model.geom_bodyid == part, 0] *= rougher
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return World.of(model, world.scripted)

    def shaken(self, action: Action, period: int) -> Action:
        """The action with noise on the six motion channels of each arm."""
        shake = np.zeros((len(action) // ACTION, ACTION))
        for arm, channels in enumerate(shake):
            channels[:MOTION] = normals(MOTION, self.key, "action", period, arm)
        return (action + self.noise * shake.ravel()).clip(-1.0, 1.0)


def run(
    scenario: Scenario,
    world: World,
    planner: Planner,
    horizon: float,
    settle: float = 1.0,
    jitter: Jitter | None = None,
    until_settled: bool = False,
    raw: bool = False,
    rules: Rules = STRICT,
    until_decided: bool = False,
    whole: bool = False,
) -> Rollout:
    """Play a plan from the start of `world` until success, failure or the horizon.

    A success counts only if the goal still holds after `settle` seconds without action. When the plan has ended the
    robot is left idle.

    Args:
        horizon: time limit for reaching the goal [s].
        until_settled: whether the episode may end once the plan has ended, everything is at rest, and no event is
            pending.
        raw: whether actions go to the controller as they are, clipped; else through the teleoperation filter.
        rules: rules that end the episode.
        until_decided: whether the episode may end once a mean was missed, if the rules require all means: no goal
            counts from then on.
        whole: whether nothing was taken out of the scene, so that it has every body that its means name.

    Raises:
        UnknownName: the goal was reached without a mean that names a body that a whole scene does not have.
    """
    world.reset()
    episode = Episode(scenario, world, horizon, rules)
    return _play(episode, _Planned(world, planner, jitter, raw), settle, until_settled, until_decided, whole)


def go_on(episode: Episode, planner: Planner, settle: float = 1.0) -> Rollout:
    """Play a plan from where an open episode is, until it ends, or everything is at rest after the plan.

    The actions of the result are those of the plan alone.
    """
    return _play(episode, _Planned(episode.world, planner, None, False), settle, True)


def replay(
    scenario: Scenario,
    world: World,
    actions: Actions,
    horizon: float,
    settle: float = 1.0,
    until_settled: bool = False,
    rules: Rules = STRICT,
) -> Rollout:
    """Play recorded actions, which have passed the filter already. Needs no oracle. Afterwards the robot is idle."""
    world.reset()
    return _play(Episode(scenario, world, horizon, rules), _Recorded(world, actions), settle, until_settled)


def try_shortcut(
    scenario: Scenario,
    world: World,
    shortcut: Shortcut,
    horizon: float,
    settle: float = 1.0,
    raw: bool = False,
    until_decided: bool = False,
) -> Rollout:
    """Play a tempting plan as a certificate does: until the time limit, or longer if it is simulated to rest.

    Args:
        until_decided: as for `run`; a plan that is simulated to rest is always played to its end.
    """
    patience = SHORTCUT_TIME_LIMITS if shortcut.to_rest else 1.0
    decided = until_decided and not shortcut.to_rest
    horizon = patience * horizon
    return run(scenario, world, shortcut.plan, horizon, settle, until_settled=True, raw=raw, until_decided=decided)


class _Planned:
    """Actions of a plan, filtered or raw, with noise and latency if a jitter is given."""

    def __init__(self, world: World, planner: Planner, jitter: Jitter | None, raw: bool):
        self.plan, self.world, self.jitter = planner(world), world, jitter
        self.raw, self.filtered = raw, world.channel.changes
        self.ended, self.note, self.periods = False, "", 0
        self.delayed: deque[Action] = deque([world.idle] * (jitter.latency if jitter else 0))

    def next(self) -> NDArray[np.float32]:
        """The next action for the controller."""
        action = self._planned()
        if self.jitter:
            self.delayed.append(self.jitter.shaken(action, self.periods))
            action = self.delayed.popleft()
        self.periods += 1
        received = self.world.received(action, self.raw)
        if not self.filtered and not np.array_equal(received, unfiltered(action)):
            self.filtered = True
        return received

    def stop(self) -> None:
        """Called when the goal has been reached: the rest of the plan is not played."""
        self.ended = True

    def _planned(self) -> Action:
        if not self.ended:
            try:
                return next(self.plan)
            except StopIteration:
                self.ended = True
            except GaveUp as error:
                self.ended, self.note = True, str(error)
        return self.world.idle


class _Recorded:
    """Recorded actions, then idle ones. The recording covers the settling phase."""

    note, filtered = "", True

    def __init__(self, world: World, actions: Actions):
        self.world, self.ended = world, False
        self.left = iter(np.asarray(actions, np.float32))

    def next(self) -> NDArray[np.float32]:
        """The next action for the controller."""
        action = next(self.left, None)
        self.ended = action is None
        return self.world.idle.astype(np.float32) if action is None else action

    def stop(self) -> None:
        """Called when the goal has been reached; a recording goes on."""


def still_moving(world: World) -> list[str]:
    """Bodies that move faster now than `REST_TOLERANCE` allows a body at rest; `ROBOT` stands for the robot's."""
    found = dict[str, None]()
    for dof, speed in enumerate(np.abs(world.data.qvel)):
        body = int(world.model.dof_bodyid[dof])
        if speed * REST_TIME >= REST_TOLERANCE:
            found[ROBOT if body in world.own else world.model.body(body).name] = None
    return list(found)


class Stillness:
    """Watches whether everything has come to rest after the actions have ended and with no event pending."""

    def __init__(self, scenario: Scenario, world: World):
        self.scenario, self.world = scenario, world
        self.places: deque[NDArray[np.float64]] = deque(maxlen=round(REST_TIME / Loop.PERIOD) + 1)

    def lasts(self) -> bool:
        """Whether everything has been at rest for `REST_TIME` now; called once in every control period."""
        if self.scenario.pending(self.world):
            self.places.clear()
        self.places.append(self.world.data.qpos.copy())
        if len(self.places) < (self.places.maxlen or 0):
            return False
        if np.abs(self.places[0] - self.places[-1]).max() >= REST_TOLERANCE:  # the cheap test first
            return False
        return bool(np.ptp(self.places, axis=0).max() < REST_TOLERANCE)


def _play(
    episode: Episode,
    source: _Planned | _Recorded,
    settle: float,
    until_settled: bool,
    until_decided: bool = False,
    whole: bool = False,
) -> Rollout:
    actions: list[NDArray[np.float32]] = []
    world, decided = episode.world, until_decided and episode.rules == STRICT
    stillness = Stillness(episode.scenario, world) if until_settled else None

    def step() -> Outcome | None:
        actions.append(source.next())
        return episode.step(actions[-1])

    def ended(outcome: Outcome, reason: str, at: float) -> Rollout:
        if whole and episode.lacks and episode.means.unknown:
            raise episode.means.unknown[0]
        played = np.array(actions, np.float32).reshape(-1, world.size)
        about = (source.note, episode.lacks, world.loop.converged, source.filtered)
        return Rollout(outcome, reason, round(at, 6), played, world.digest, *about)

    while step() is None:
        if decided and (missed := episode.means.missed):
            return ended("failure", f"{OUT_OF_REACH}: {missed}", world.time)
        if stillness and source.ended and not episode.held and stillness.lasts():
            return ended("timeout", source.note or AT_REST, world.time)
    if episode.outcome == "timeout":
        return ended("timeout", source.note or episode.reason, world.time)
    reached = world.time
    source.stop()
    if episode.outcome == "success":
        for _ in range(round(settle / Loop.PERIOD)):
            if step() != "success":
                return ended(*episode.settled(), world.time)
    return ended(*episode.settled(), reached)


def _turn_start(model: mujoco.MjModel, hinge: str, angle: float) -> None:
    """Start a hinge, and the body on it, turned by `angle` [rad].

    A joint turns its body by its reading less `qpos0`: to change the start, the body's own pose must be changed too.
    """
    joint = model.joint(hinge)
    if model.jnt_type[joint.id] != mujoco.mjtJoint.mjJNT_HINGE:
        raise ValueError(f"{hinge} is not a hinge; only the start of a hinge can be turned")
    body, turn, turned, before, after = int(joint.bodyid[0]), np.zeros(4), np.zeros(4), np.zeros(3), np.zeros(3)
    mujoco.mju_axisAngle2Quat(turn, joint.axis, angle)
    mujoco.mju_mulQuat(turned, model.body_quat[body], turn)
    mujoco.mju_rotVecQuat(before, joint.pos, model.body_quat[body])
    mujoco.mju_rotVecQuat(after, joint.pos, turned)
    model.body_pos[body] += before - after
    model.body_quat[body] = turned
    model.qpos0[joint.qposadr[0]] += angle


def _subtree(model: mujoco.MjModel, root: int) -> list[int]:
    """A body and its descendants."""
    parts = [root]
    for body in range(root + 1, model.nbody):
        if int(model.body_parentid[body]) in parts:
            parts.append(body)
    return parts

"""The phases of a witness: its path, the states at which its phases begin, and plans that repeat them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..control.loop import ACTION, Loop
from ..control.teleop import ALPHA, MOTION
from ..episode import Actions, Episode
from ..geometry import Mat3, Vec3, between, rotation
from ..scenario import Plan, Scenario
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.motion import STEP, STIFFNESS, go_to, together
from .macros import APPROACH, Macro
from .signature import ContactPair, Signature, pairs, robots, signature, starts
from .solids import held

MIN_PHASE_TIME = 0.20
"""Minimum duration of a phase [s]."""
MAX_PHASES = 12
"""Maximum number of phases of a witness: the shortest ones are joined."""
PAUSE_SPEED = 0.02
"""Speed below which a hand pauses [m/s]."""
MIN_WAIT = 0.2
"""Shortest pause of all hands that counts as a wait [s]."""
MAX_DEVIATION = 0.02
"""Distance by which a body's way may deviate from the line between its corners [m]."""
START_TOLERANCE = 0.02
"""Distance of the hand from the beginning of a phase above which it is first brought there [m]."""
MIRROR = np.array([1.0, -1.0, 1.0])
"""Signs of a displacement that is mirrored left for right; rotation vectors change the other two signs."""


@dataclass(frozen=True)
class Stage:
    """The state at the beginning of a phase, or at the end of the last one."""

    row: int
    """Row of the witness."""
    state: NDArray[np.float64]
    """State of the physics."""
    held: float
    """Time for which the goal has held [s]."""
    signature: Signature
    """Signature so far."""
    holds: tuple[str | None, ...]
    """Free body in each hand; see `solids.held`."""


@dataclass(frozen=True)
class Trace:
    """A rollout that reached the goal, by control period."""

    actions: Actions
    """Actions, as the controller received them."""
    hands: NDArray[np.float64]
    """Positions of the hands before each action and after the last one [m], shape (n + 1, arms, 3)."""
    rots: NDArray[np.float64]
    """Orientations of the hands, shape (n + 1, arms, 3, 3)."""
    ways: Mapping[str, NDArray[np.float64]]
    """Positions of the centre of mass of each free body [m], shape (n + 1, 3)."""
    stages: tuple[Stage, ...]
    """Beginnings of the phases in order, and the end: phase k goes from stage k to stage k + 1."""
    signature: Signature
    """Signature at the time the goal was reached."""
    events: tuple[tuple[int, ContactPair], ...]
    """New contacts since the start, each with the row at which it first occurred, in order."""
    _robots: frozenset[str]
    """Names of the robot in the contacts."""

    @property
    def phases(self) -> list[tuple[int, int]]:
        """First row of each phase, and first row after it."""
        rows = [stage.row for stage in self.stages]
        return list(pairwise(rows))

    @property
    def waits(self) -> list[tuple[int, int]]:
        """First row of each wait, and first row after it."""
        speed = np.linalg.norm(np.diff(self.hands, axis=0), axis=2).max(axis=1) / Loop.PERIOD
        still = np.concatenate([[False], speed < PAUSE_SPEED, [False]])
        edges = np.flatnonzero(still[1:] != still[:-1]).reshape(-1, 2)
        return [(int(a), int(b)) for a, b in edges if (b - a) * Loop.PERIOD >= MIN_WAIT]

    @property
    def handled(self) -> tuple[str, ...]:
        """Bodies that the robot touched, in the order of first contact."""
        touched = [body for _, pair in self.events if self._robots & {*pair} for body in pair]
        return tuple(dict.fromkeys(body for body in touched if body not in self._robots))

    @property
    def concerned(self) -> tuple[str, ...]:
        """Bodies with new contacts, the latest one first: they are nearest to the goal."""
        bodies = [body for _, pair in reversed(self.events) for body in pair if body not in self._robots]
        return tuple(dict.fromkeys(bodies))

    def way_of(self, body: str) -> NDArray[np.float64]:
        """Corners of the way of a free body's centre of mass in the witness [m], shape (n, 3)."""
        return _corners(self.ways[body])

    def place_at(self, body: str, one: str, other: str) -> tuple[float, float, float]:
        """Position of a free body's centre of mass when two bodies touch for the first time [m]."""
        row = next(row for row, pair in self.events if {*pair} == {one, other})
        x, y, z = self.ways[body][row + 1].tolist()
        return x, y, z

    def hand_at(self, arm: int, body: str) -> tuple[float, ...] | None:
        """Position [m] and rotation vector of a hand when the robot first touches a body; None if it does not."""
        row = next((row for row, pair in self.events if body in pair and self._robots & {*pair}), None)
        if row is None:
            return None
        turn = between(np.eye(3), self.rots[row, arm])
        return *map(float, self.hands[row, arm]), *map(float, turn)

    def releases(self, arm: int) -> tuple[tuple[int, str], ...]:
        """Stages at which the gripper of an arm opens, each with the body that it releases."""
        grip = self.actions[:, ACTION * arm + ACTION - 1]
        opens = [(k, s.row, s.holds[arm]) for k, s in enumerate(self.stages[1:-1], 1) if grip[s.row] <= 0]
        return tuple((k, body) for k, row, body in opens if body and grip[row - 1] > 0)


def _corners(way: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners of a polyline that stays within `MAX_DEVIATION` of a way (Douglas and Peucker)."""
    first, last = way[0], way[-1]
    leg = last - first
    share = np.clip((way - first) @ leg / max(float(leg @ leg), 1e-12), 0.0, 1.0)
    away = np.linalg.norm(way - first - share[:, None] * leg, axis=1)
    k = int(np.argmax(away))
    if away[k] <= MAX_DEVIATION:
        return np.array([first, last])
    return np.concatenate([_corners(way[: k + 1])[:-1], _corners(way[k:])])


def trace(scenario: Scenario, world: World, actions: Actions) -> Trace | None:
    """Replay a witness and record its trace; None if it does not reach the goal."""
    world.reset()
    start, episode = starts(world), Episode(scenario, world)
    poses, marks, events = [_poses(world)], [_Observation.of(world)], list[tuple[int, ContactPair]]()
    places = [starts(world)]
    states = [(world.state(), 0.0, signature(world, start))]
    for action in actions:
        outcome = episode.step(action)
        poses.append(_poses(world))
        places.append(starts(world))
        marks.append(_Observation.of(world))
        states.append((world.state(), episode.held, signature(world, start)))
        events += [(len(marks) - 2, pair) for pair in sorted(marks[-1].touched[1] - marks[-2].touched[1])]
        if outcome is not None:
            break
    if episode.outcome != "success":
        return None
    left, rows = signature(world, start), actions[: len(poses) - 1]
    hands, rots = (np.array(of_all) for of_all in zip(*poses, strict=True))
    stages = tuple(Stage(row, *states[row], marks[row].holds) for row in _cuts(marks, hands))
    ways = {body: np.array([place[body] for place in places]) for body in start}
    return Trace(rows, hands, rots, ways, stages, left, tuple(events), frozenset(robots(world).values()))


def _poses(world: World) -> tuple[list[Vec3], list[Mat3]]:
    """Positions and orientations of the hands."""
    return [arm.hand for arm in world.arms], [arm.hand_rot for arm in world.arms]


@dataclass(frozen=True)
class _Observation:
    """Observations of one control period; a phase ends where they change."""

    closed: tuple[bool, ...]
    """Whether each gripper is commanded to close."""
    touched: tuple[bool, frozenset[ContactPair]]
    """Whether the robot touches a free body, and all contacts since the start."""
    holds: tuple[str | None, ...]
    """Free body in each hand."""

    @classmethod
    def of(cls, world: World) -> "_Observation":
        touches = any(world.touching(ROBOT, body) for body in world.free_bodies)
        closed, holds = tuple(arm.grip > 0 for arm in world.arms), tuple(map(held, world.arms))
        return cls(closed, (touches, pairs(world)), holds)


def _cuts(marks: list[_Observation], hands: NDArray[np.float64]) -> list[int]:
    """Rows at which phases begin, and the end: changes of the grippers or contacts, and ends of pauses of all hands."""
    end, least = len(marks) - 1, round(MIN_PHASE_TIME / Loop.PERIOD)
    speed = np.linalg.norm(np.diff(hands, axis=0), axis=2).max(axis=1) / Loop.PERIOD
    grips = {i - 1 for i in range(2, end) if marks[i].closed != marks[i - 1].closed}
    touches = {i for i in range(1, end) if marks[i].touched != marks[i - 1].touched}
    pauses = {i for i in range(1, end) if speed[i] >= PAUSE_SPEED > speed[i - 1]}
    cuts = [0]
    for row in sorted(grips | touches | pauses):
        if end - row >= least and (row in grips or row - cuts[-1] >= least):
            cuts.append(row)
    cuts.append(end)
    while len(cuts) > MAX_PHASES + 1:
        lengths = np.diff(cuts)
        k = int(np.argmin(lengths))
        del cuts[k if 0 < k < len(cuts) - 1 else 1]
    return cuts


# --- plans ------------------------------------------------------------------------------------


def follow(world: World, path: Trace, macro: Macro) -> Plan:
    """Repeat a stretch of a witness, from the present positions of the hands.

    Numbers of the macro: first row, last row, pace, 1 for mirrored left for right, displacement of the stretch [m].
    The witness's actions are repeated; feedback keeps the hands on its path.
    """
    first, last, pace, mirrored, *shift = macro.numbers
    begin, end = round(first), round(last)
    sign = MIRROR if mirrored else np.ones(3)
    bases, before = path.hands[begin] + np.array(shift), path.actions[max(begin - 1, 0)].reshape(-1, ACTION)
    way = [
        go_to(arm, base, rot, APPROACH, float(grip))
        if float(np.linalg.norm(base - arm.hand)) > START_TOLERANCE
        else None
        for arm, base, rot, grip in zip(world.arms, bases, path.rots[begin], before[:, -1], strict=True)
    ]
    yield from together(world, *way)
    now = float(begin)
    while now < end:
        row = min(int(now), end - 1)
        wanted = np.array(path.actions[row], float)
        for arm, base, asked in zip(world.arms, bases, wanted.reshape(-1, ACTION), strict=True):
            aim = base + sign * (path.hands[row, arm.number] - path.hands[begin, arm.number])
            rots = path.rots[:, arm.number]
            turn = between(arm.hand_rot, _aim(rots[begin], rots[row], sign))
            asked[:3] = pace * sign * asked[:3] + STIFFNESS * (aim - arm.hand) / STEP[:3]
            asked[3:6] = turn / STEP[3:] if pace != 1 or mirrored else asked[3:6] + turn / STEP[3:] / 2
            asked[:6] = np.clip(asked[:6], -1.0, 1.0)
        yield wanted
        now += pace


def by_the_clock(world: World, path: Trace, seconds: Sequence[float]) -> Plan:
    """Repeat a witness with other durations of its waits [s]."""
    stretches, row = list[tuple[int, int, float]](), 0
    for (begin, end), lasting in zip(path.waits, seconds, strict=True):
        pace = (end - begin) * Loop.PERIOD / max(lasting, Loop.PERIOD)
        stretches += [(row, begin, 1.0), (begin, end, pace)]
        row = end
    for first, last, pace in (*stretches, (row, len(path.actions), 1.0)):
        if first < last:
            yield from follow(world, path, Macro("follow", "", (first, last, pace, 0.0, 0.0, 0.0, 0.0)))


def _aim(begin: Mat3, now: Mat3, sign: Vec3) -> Mat3:
    """Target orientation of a hand, mirrored about the beginning of the stretch if the stretch is mirrored."""
    if sign[1] > 0:
        return now
    return rotation(-sign * between(begin, now)) @ begin


def repeat(actions: Actions, raw: bool) -> Plan:
    """Repeat recorded actions: as they were received, or such that the teleoperation filter turns them into these."""
    before = np.zeros((actions.shape[1] // ACTION, MOTION))
    for action in np.asarray(actions, float):
        asked, motion = action.copy(), action.reshape(-1, ACTION)[:, :MOTION]
        if not raw:
            asked.reshape(-1, ACTION)[:, :MOTION] = np.clip(before + (motion - before) / ALPHA, -1.0, 1.0)
        before = motion
        yield asked

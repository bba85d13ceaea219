"""Checks of the rows of one episode. Thresholds are those of lerobot-lint where it has the rule."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...control.loop import ACTION
from ...control.teleop import LARGEST_CHANGE
from ...envs.observations import action_names, proprioception, streams_of
from ...export.dataset import EpisodeData, Recording
from ...export.lerobot import INDEX_FEATURES
from ...export.recording import CONTROL_ACTIONS, STATE
from ...export.replay import asks_for_motion
from ...export.schema import TEXT
from ...export.streams import ENVIRONMENT
from ...pool.demonstrations import POLICY
from ...robots.panda import Names
from .findings import Finding, Severity

MAX_TIME_ERROR = 1e-4
"""Largest difference of a time stamp from frame / fps, as LeRobot's loader demands [s]."""
MAX_RATE_ERROR = 0.1
"""Largest relative error of the median rate (lerobot-lint)."""
DROPPED_PERIODS = 1.5
"""Time between two rows at which rows between them are missing [periods] (lerobot-lint)."""
FROZEN_FRAMES = 15
"""Number of identical rows, one after the other, beyond which a moving arm's state is frozen (lerobot-lint)."""
MAX_SPEED = 1.7
"""Speed limit of a hand [m/s], Franka's Cartesian limit for the Panda. Hands were seen at 0.9 m/s here; the replay
finds smaller jumps."""
MAX_BODY_JUMP = 0.03
"""Largest displacement of a body between two rows that its velocities do not explain [m]."""
BLOW_SHARE = 1.0
"""Share of a body's displacement at its larger speed that a blow between two rows may explain in addition."""
MISSING_FIELD = "MISSING_FIELD"
"""Name of the check of columns."""
MIN_ROWS = 15
"""Smallest number of rows of an episode (lerobot-lint)."""
MIN_SECONDS = 1.0
"""Shortest episode [s] (lerobot-lint)."""
SATURATED_SHARE = 0.3
"""Share of rows at the limit of a motion channel above which it is saturated (lerobot-lint). A warning: transits of
scripts go as fast as an action of 1."""
ROUNDING = 1e-5
"""Largest difference of numbers that single precision may cause."""

Values = NDArray[Any]


@dataclass(frozen=True)
class Subject:
    """An episode with what its checks need to know."""

    episode: EpisodeData
    recording: Recording

    def column(self, name: str) -> Values:
        """A column as numbers, shape (rows, ...)."""
        return np.asarray(self.episode.columns[name], float)

    @property
    def arms(self) -> int:
        """Number of arms that actions drive."""
        return self.episode.columns["action"].shape[1] // ACTION

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Whether the action of each row commands a motion of each arm, shape (rows, arms)."""
        return asks_for_motion(self.column("action"))


Check = Callable[[Subject], Iterator[Finding]]


def found(
    check: str, why: str, frames: Values | tuple[int, ...] = (), severity: Severity = "error", /, **numbers: float
) -> Finding:
    """A finding. `frames` are those concerned, in any order; all if there are none."""
    places = [int(place) for place in frames]
    ends = (min(places), max(places)) if places else ()
    return Finding(check, severity, ends, {name: float(value) for name, value in numbers.items()}, why)


def fields(subject: Subject) -> Iterator[Finding]:
    """Whether every column of meta/info.json is there."""
    features, columns = subject.recording.info["features"], subject.episode.columns
    needed = _shapes(str(subject.recording.info["robot_type"]))
    told = [*needed, *(n for n, f in features.items() if f["dtype"] not in ("video", TEXT))]
    missing = [name for name in dict.fromkeys(told) if name not in columns]
    if missing:
        yield found(MISSING_FIELD, f"columns of meta/info.json are missing: {', '.join(missing)}")
    other = [name for name, shape in needed.items() if name in columns and not _has_shape(columns[name], shape)]
    if other:
        yield found(MISSING_FIELD, f"columns do not have the shapes of the robot: {', '.join(other)}")
    if (length := subject.episode.about["length"]) != len(subject.episode):
        yield found("LENGTH_FIELD", "the table of episodes has another length", told=length, rows=len(subject.episode))


def _shapes(robot: str) -> dict[str, tuple[int | None, ...]]:
    """Columns that every recording of a robot has, with the shapes of a row; None stands for any number."""
    own, actions = streams_of(robot), len(action_names(robot))
    made: dict[str, tuple[int | None, ...]] = {name: own[name].shape for name in proprioception(robot)}
    made |= {STATE: (None,), "action": (actions,), CONTROL_ACTIONS: (None, actions), "next.success": ()}
    return {**made, **{name: feature.shape for name, feature in INDEX_FEATURES.items()}}


def _has_shape(values: Values, shape: tuple[int | None, ...]) -> bool:
    """Whether the rows of a column have a shape, see `_shapes`."""
    own = values.shape[1:]
    return len(own) == len(shape) and all(b in (None, a) for a, b in zip(own, shape, strict=True))


def index(subject: Subject) -> Iterator[Finding]:
    """Whether rows are numbered one after the other."""
    columns, start = subject.episode.columns, subject.episode.about["dataset_from_index"]
    rows = np.arange(len(subject.episode))
    wanted = {"frame_index": rows, "index": rows + start, "episode_index": 0 * rows + subject.episode.number}
    for name, values in wanted.items():
        if len(wrong := np.flatnonzero(columns[name] != values)):
            yield found("INDEX", f"{name} does not count the rows", wrong, rows=len(wrong))


def timestamps(subject: Subject) -> Iterator[Finding]:
    """Whether times belong to the rows and to the rate."""
    times, period = subject.column("timestamp"), 1.0 / subject.recording.fps
    steps = np.diff(times)
    if len(steps) and abs(np.median(steps) / period - 1.0) > MAX_RATE_ERROR:
        told = {"measured": 1.0 / max(1e-9, float(np.median(steps))), "fps": subject.recording.fps}
        yield found("FPS", "the rate of the time stamps is not that of meta/info.json", **told)
    if len(dropped := np.flatnonzero(steps > DROPPED_PERIODS * period)):
        longest = float(steps.max()) / period
        yield found("FRAME_DROPS", "rows are missing between time stamps", dropped, rows=len(dropped), longest=longest)
    error = np.abs(times - subject.episode.columns["frame_index"] * period)
    if len(wrong := np.flatnonzero(error > MAX_TIME_ERROR)):
        yield found("TIMESTAMP", "a time stamp is not frame_index / fps", wrong, largest=error.max())


def finite(subject: Subject) -> Iterator[Finding]:
    """Whether all numbers are finite."""
    for name, values in subject.episode.columns.items():
        if values.dtype.kind == "f":
            bad = np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(axis=1))
            if len(bad):
                yield found("NAN", f"{name} has numbers that are not finite", bad, rows=len(bad))


def lengths(subject: Subject) -> Iterator[Finding]:
    """Whether the episode is long enough to learn from."""
    rows, seconds = len(subject.episode), len(subject.episode) / subject.recording.fps
    if rows < MIN_ROWS or seconds < MIN_SECONDS:
        yield found("SHORT", "the episode is very short", rows=rows, seconds=seconds)


def actions(subject: Subject) -> Iterator[Finding]:
    """Whether the action of a row is that of its control periods, and the filter can give these."""
    every, action = subject.column(CONTROL_ACTIONS), subject.column("action")
    grips = np.arange(ACTION - 1, action.shape[1], ACTION)
    wanted = every.mean(axis=1)
    wanted[:, grips] = every[:, -1, grips]
    if len(wrong := np.flatnonzero(np.abs(wanted - action).max(axis=1) > ROUNDING)):
        yield found("ACTION_MISMATCH", f"action is not the mean of {CONTROL_ACTIONS}", wrong, rows=len(wrong))
    motion = np.delete(every.reshape(-1, action.shape[1]), grips, axis=1)
    steps = np.abs(np.diff(motion, axis=0, prepend=np.zeros((1, motion.shape[1]))))
    filtered = subject.episode.about.get("scengen/source") != POLICY  # a policy acts without the filter
    if filtered and len(wrong := np.flatnonzero(steps.max(axis=1) > LARGEST_CHANGE + ROUNDING)):
        rows = wrong // every.shape[1]
        told = {"largest": steps.max(), "limit": LARGEST_CHANGE}
        yield found("ACTION_JUMP", "actions change faster than the teleoperation filter allows", rows, **told)
    if "waiting" in subject.episode.columns:
        wrong = np.flatnonzero(subject.episode.columns["waiting"] == subject.moves.any(axis=1))
        if len(wrong):
            yield found("WAITING_MISMATCH", "waiting is not what the action says", wrong, rows=len(wrong))
    if np.abs(every).max() > 1.0 + ROUNDING:
        yield found("ACTION_RANGE", "actions leave [-1, 1]", largest=np.abs(every).max())
    full = (np.abs(np.delete(action, grips, axis=1)) > 1.0 - 1e-6).mean(axis=0).max()
    if full > SATURATED_SHARE:
        yield found("SATURATED", "a motion channel is at its limit", (), "warning", share=full)


def states(subject: Subject) -> Iterator[Finding]:
    """Whether the motion of the hands is possible, and happens while it is commanded."""
    period, moves, robot = 1.0 / subject.recording.fps, subject.moves, str(subject.recording.info["robot_type"])
    own = np.hstack([subject.column(name) for name in proprioception(robot)])
    if own.shape != subject.column(STATE).shape:
        yield found("STATE_MISMATCH", f"{STATE} has not the robot's own streams, {own.shape[1]} numbers")
    elif len(wrong := np.flatnonzero(np.abs(own - subject.column(STATE)).max(axis=1) > ROUNDING)):
        yield found("STATE_MISMATCH", f"{STATE} is not the robot's own streams", wrong, rows=len(wrong))
    for number in range(subject.arms):
        arm = Names(number).arm
        place = subject.column(f"{arm}eef_pos")
        jumps = np.linalg.norm(np.diff(place, axis=0), axis=1)
        limit = MAX_SPEED * period
        if len(wrong := np.flatnonzero(jumps > limit)):
            yield found(
                "DISCONTINUITY", f"the hand of {arm}jumps".replace("_", " "), wrong, largest=jumps.max(), limit=limit
            )
        joints, speeds = subject.column(f"{arm}joint_pos"), subject.column(f"{arm}joint_vel")
        if not np.ptp(speeds, axis=0).any() or not np.ptp(joints, axis=0).any():
            yield found("DEAD_JOINT", f"the joints of {arm}never change".replace("_", " "))
        still = np.r_[False, ~np.diff(np.hstack([place, joints]), axis=0).any(axis=1)]
        first, longest = _longest_run(still & np.r_[False, moves[:-1, number]])
        if longest > FROZEN_FRAMES:
            where = (first, first + longest - 1)
            yield found(
                "FROZEN_STATE", "the state does not change while the action commands motion", where, rows=longest
            )


def forces(subject: Subject) -> Iterator[Finding]:
    """Whether the wrists' sensors live: a hand has weight."""
    for name, values in subject.episode.columns.items():
        if name.endswith("force_torque") and not np.ptp(np.asarray(values, float), axis=0).any():
            yield found("DEAD_STREAM", f"{name} never changes")


def movable_bodies(names: Sequence[str]) -> dict[str, int]:
    """Movable bodies, and the places of their positions in the environment state, by the names of its entries."""
    starts = {name.removesuffix("_pos.x"): k for k, name in enumerate(names) if name.endswith("_pos.x")}
    return {body: k for body, k in starts.items() if "_to_robot" not in body and f"{body}_vel_lin.x" in names}


def bodies(subject: Subject) -> Iterator[Finding]:
    """Whether bodies are where their velocities take them. An event of the scene may move a body: the replay knows."""
    if ENVIRONMENT not in subject.episode.columns:
        return
    names = subject.recording.entries
    state, period = subject.column(ENVIRONMENT), 1.0 / subject.recording.fps
    for body, start in movable_bodies(names).items():
        place = state[:, start : start + 3]
        first = names.index(f"{body}_vel_lin.x")
        speed = np.linalg.norm(state[:, first : first + 3], axis=1)
        fastest = np.maximum(speed[1:], speed[:-1]) + 9.81 * period
        jumps = np.linalg.norm(np.diff(place, axis=0), axis=1)
        limit = MAX_BODY_JUMP + (1.0 + BLOW_SHARE) * fastest * period
        if len(wrong := np.flatnonzero(jumps > limit)):
            why = f"{body} moves farther than its velocity takes it, as by an event"
            yield found("TELEPORT", why, wrong, "warning", largest=jumps.max())


CHECKS: Mapping[str, Check] = {
    "fields": fields,
    "index": index,
    "timestamps": timestamps,
    "finite": finite,
    "lengths": lengths,
    "actions": actions,
    "states": states,
    "forces": forces,
    "bodies": bodies,
}
"""Checks of rows, in their order. If `fields` or `finite` find something, those after them are not made."""


def check_rows(episode: EpisodeData, recording: Recording) -> tuple[tuple[str, ...], list[Finding]]:
    """Make the checks of rows.

    Returns:
        Names of the checks that were made, and what they found.
    """
    made: list[str] = []
    findings: list[Finding] = []
    subject = Subject(episode, recording)
    for name, check in CHECKS.items():
        if any(one.check in (MISSING_FIELD, "NAN") for one in findings):
            break
        made.append(name)
        findings += check(subject)
    return tuple(made), findings


def _longest_run(holds: NDArray[np.bool_]) -> tuple[int, int]:
    """Place and length of the longest run of rows for which something holds."""
    edges = np.flatnonzero(np.diff(np.r_[0, holds.astype(int), 0]))
    runs = edges.reshape(-1, 2)
    if not len(runs):
        return 0, 0
    best = int(np.argmax(runs[:, 1] - runs[:, 0]))
    return int(runs[best, 0]), int(runs[best, 1] - runs[best, 0])

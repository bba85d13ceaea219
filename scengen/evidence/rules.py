"""Limits of a scenario's rules: `success`, `failure` and `events` are asked about stored states that differ a little.

A rollout shows a rule only where it passes its limit. Here a state from a rollout is changed along one coordinate at a
time until a rule changes its answer, and the change is bisected. The pair of coordinates around the limit is stored. A
rule whose limit moves by less than a thousandth of a percent gives another answer for one of them. Nothing is simulated
when the answers are compared, so that neither the oracle nor the controller nor the machine's rounding counts.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any, Literal, Self, cast, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import ScengenError
from ..robots.panda import arms, fingers
from ..samplers.keyed import unit
from ..scenario import Scenario
from ..sim.arm import ROBOT, Arm
from ..sim.recording import Question, RecordingWorld
from ..sim.world import World
from .edges import bisected
from .rollouts import answer_of, whole

MAX_STATES = 12
"""Largest number of stored states."""
MAX_BODIES = 6
"""Largest number of bodies that are moved; of more, some spread over their order are taken."""
MAX_LIMITS = 2
"""Largest number of limits that are stored for the same change of answer along the same coordinate."""
MAX_TOGGLES = 16
"""Largest number of contacts that are added or removed, singly and in pairs."""
SWEPT = {"place": (0.02, 0.1, 0.5), "all": (0.02, 0.1, 0.5), "memory": (1.0, 100.0), "time": (1.0, 100.0)}
"""Sizes of changes with all or none of the contacts, by kind of coordinate: a limit may appear that was not there."""
MIXED = 120
"""Number of states with several random changes at once, for each stored state."""
MARGIN = 1e-6
"""Relative distance from a limit at which the rules are asked on either side of it."""
MAGNITUDES = {
    "place": np.geomspace(1e-4, 1.0, 15),  # [m]
    "mark": np.geomspace(1e-3, 1.0, 10),  # [m]
    "turn": np.geomspace(1e-3, 3.1, 12),  # [rad]
    "speed": np.geomspace(1e-4, 3.0, 12),  # [m/s]
    "joint": np.geomspace(1e-3, 3.1, 10),  # [rad, m]
    "rate": np.geomspace(1e-3, 3.0, 10),  # [rad/s, m/s]
    "arm": np.geomspace(1e-3, 2.0, 8),  # [rad, m]
    "all": np.geomspace(1e-4, 1.0, 15),  # [m]
    "roll": np.geomspace(1e-3, 3.1, 12),  # [rad]
    "memory": np.geomspace(1e-3, 100.0, 13),
    "time": np.geomspace(5e-3, 100.0, 13),  # [s]
}
"""Sizes of changes along each kind of coordinate, between which an answer may change."""


@dataclass(frozen=True)
class Coordinate:
    """One number of a state that can be changed."""

    kind: str
    """One of `MAGNITUDES`."""
    of: str
    """Body, joint, arm or memory that it belongs to; empty for the time."""
    axis: int
    """Axis of the world along or about which a body is changed; number of a joint of an arm."""
    sign: int
    """Direction of the change, 1 or -1."""

    @property
    def line(self) -> tuple[str, str, int]:
        """The coordinate without its direction."""
        return self.kind, self.of, self.axis


Contacts = Literal["same", "none", "all"]
"""Existing contacts among those that the rules query: those of the state, none, or all."""


@dataclass(frozen=True)
class Place:
    """Place at which a limit is sought: along a coordinate, and with which contacts."""

    coordinate: Coordinate
    contacts: Contacts = "same"

    def __str__(self) -> str:
        c = self.coordinate
        return f"{c.kind} {c.of} {c.axis} {c.sign:+d} {self.contacts}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """The reverse of `str`."""
        kind, of, axis, sign, contacts = text.split(" ")
        return cls(Coordinate(kind, of, int(axis), int(sign)), cast(Contacts, contacts))


class Probe:
    """A world in a stored state, in which the rules are asked about changes of it."""

    def __init__(
        self, scenario: Scenario, world: World, state: NDArray[np.float64], contacts: Sequence["Contact"] = ()
    ):
        """
        Args:
            state: the state, see `World.state`.
            contacts: contacts for which the rules ask.
        """
        self.scenario, self.world, self.contacts = scenario, world, contacts
        world.restore(state)  # later probes of the same world may change it: `answers` sets all that rules read
        data, loop = world.data, world.loop
        self._start = {name: getattr(data, name).copy() for name in FIELDS}
        self._time, self._tables = data.time, (loop.touching.copy(), loop.touched.copy())
        self._jams = [loop.jammed(arm.number) for arm in _all_arms(world)]
        there = {contact: bool(contact.entry(world)) for contact in contacts}
        none, missing = ([c for c in contacts if there[c] == flag] for flag in (True, False))
        self._turned: dict[Contacts, list[Contact]] = {"same": [], "none": none, "all": missing}

    def answers(
        self, changes: Mapping[Coordinate, float] | None = None, contacts: Sequence["Contact"] = ()
    ) -> tuple[str, str]:
        """Answers of the rules after changes of the state: of success and failure, and of events.

        Args:
            changes: magnitudes of the changes by coordinate.
            contacts: entries of the contact tables that are turned around.
        """
        world, data, loop = self.world, self.world.data, self.world.loop
        for name, value in self._start.items():
            getattr(data, name)[:] = value
        data.time = self._time
        loop.touching[:], loop.touched[:] = self._tables
        for arm, jammed in zip(_all_arms(world), self._jams, strict=True):
            loop.jam(arm.number, jammed)
        for coordinate, size in (changes or {}).items():
            _change(world, coordinate, coordinate.sign * size)
        for contact in contacts:
            contact.turn_around(world)
        mujoco.mj_kinematics(world.model, data)
        mujoco.mj_comPos(world.model, data)
        mujoco.mj_comVel(world.model, data)
        return _answered(lambda: answer_of(self.scenario, world)), _answered(self._happened)

    def at(self, place: Place, magnitude: float) -> tuple[str, str]:
        """Answers of the rules after a change at a place."""
        return self.answers({place.coordinate: magnitude}, self._turned[place.contacts])

    def around(self, place: Place, magnitude: float) -> list[tuple[str, str]]:
        """Answers of the rules just below a magnitude of a change, and just above it."""
        return [self.at(place, magnitude * (1.0 + side)) for side in (-MARGIN, MARGIN)]

    def _happened(self) -> str:
        """Effects of the events in the state: whole numbers of the memory, and kinds of other effects."""
        world, data, scenario = self.world, self.world.data, self.scenario
        if type(scenario).events is Scenario.events:
            return ""
        before = {name: getattr(data, name).copy() for name in EFFECTS}
        with world.events():
            scenario.events(world)
        done = [f"{name} {whole(world.memory[name])}" for name in world.memory.names if world.memory[name]]
        done += [name for name, value in before.items() if not np.array_equal(getattr(data, name), value)]
        done += [f"jam {arm.number}" for arm in _all_arms(world) if world.loop.jammed(arm.number)]
        done += [f"told {np.sign(arm.scripted_action).astype(int).tolist()}" for arm in world.partners]
        return ", ".join(done)

    def numbers(self) -> str:
        """Hash of the numbers that events write in the state, to six digits."""
        self.answers()
        return _hash(self._written())

    def numbers_around(self, place: Place, magnitude: float) -> str:
        """Hash of those just below a magnitude of a change, and just above it."""
        found = []
        for side in (-MARGIN, MARGIN):
            self.at(place, magnitude * (1.0 + side))
            found.append(self._written())
        return _hash("\n".join(found))

    def _written(self) -> str:
        parts = [getattr(self.world.data, name).ravel() for name in ("userdata", *EFFECTS)]
        parts += [np.asarray(arm.scripted_action) for arm in self.world.partners]
        return " ".join(f"{value:.6g}" if abs(value) > 1e-9 else "0" for part in parts for value in part)


FIELDS = ("qpos", "qvel", "userdata", "ctrl", "mocap_pos", "mocap_quat", "xfrc_applied")
"""Fields of MuJoCo's data that changes and events write."""
EFFECTS = ("xfrc_applied", "qvel", "ctrl", "mocap_pos", "mocap_quat")
"""Those of them that events write besides the memory."""


@dataclass(frozen=True, order=True)
class Contact:
    """A question of the rules about contact."""

    table: str
    """`touching` or `touched`, see `Loop`."""
    a: str
    """Name of a body, or of an arm."""
    b: str

    def entry(self, world: World) -> int:
        """The answer, 0 or 1."""
        return int(getattr(world.loop, self.table)[world.row(self.a), world.row(self.b)])

    def turn_around(self, world: World) -> None:
        """Answer the question in the opposite way from now on."""
        entries, a, b = getattr(world.loop, self.table), world.row(self.a), world.row(self.b)
        entries[a, b] = entries[b, a] = 1 - entries[a, b]


def _answered(ask: Callable[[], str]) -> str:
    """An answer; the kind of error if the state is one that no episode reaches, such as half a letter typed."""
    try:
        return ask()
    except (ScengenError, ArithmeticError, LookupError, ValueError) as error:
        return type(error).__name__


def _all_arms(world: World) -> tuple[Arm, ...]:
    return (*world.arms, *world.partners)


def coordinates(world: World) -> Iterator[Coordinate]:
    """Coordinates of a world that rules may depend on, in both directions."""
    model = world.model
    joints = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) not in world.own]
    hung = [model.joint(j).name for j in joints if model.jnt_type[j] in (2, 3)]
    marks = [model.body(b).name for b in range(model.nbody) if model.body_mocapid[b] >= 0]
    axes = [
        *((kind, body, axis) for body in _spread(world.free_bodies) for kind in _FREE for axis in range(3)),
        *((kind, joint, 0) for joint in _spread(hung) for kind in ("joint", "rate")),
        *(("mark", mark, axis) for mark in _spread(marks) for axis in range(2)),
        *((kind, "", axis) for kind in ("all", "roll") for axis in range(3) if len(world.free_bodies) > 1),
        *(("arm", arm.label, joint) for arm in _all_arms(world) for joint in range(8)),
        *(("memory", name, 0) for name in world.memory.names),
        ("time", "", 0),
    ]
    for kind, of, axis in sorted(axes):  # independent of the order of bodies and memory
        yield from (Coordinate(kind, of, axis, sign) for sign in (1, -1))


_FREE = ("place", "turn", "speed")


def _spread(names: Sequence[str]) -> list[str]:
    """At most `MAX_BODIES` of the names, spread over their order."""
    if len(names) <= MAX_BODIES:
        return list(names)
    return [names[round(k * (len(names) - 1) / (MAX_BODIES - 1))] for k in range(MAX_BODIES)]


def _change(world: World, coordinate: Coordinate, by: float) -> None:
    """Change a coordinate of a world."""
    model, data, axis = world.model, world.data, coordinate.axis
    match coordinate.kind:
        case "time":
            data.time = max(0.0, data.time + by)
        case "memory":
            number = world.memory.names.index(coordinate.of)
            least = min(0.0, data.userdata[number])  # flags and counts are never negative
            data.userdata[number] = max(least, data.userdata[number] + by)
        case "mark":
            data.mocap_pos[model.body_mocapid[world.body(coordinate.of)], axis] += by
        case "joint":
            data.qpos[model.joint(coordinate.of).qposadr[0]] += by
        case "rate":
            data.qvel[model.joint(coordinate.of).dofadr[0]] += by
        case "arm":
            _bend(world, coordinate, by)
        case "all" | "roll":
            _carry(world, coordinate, by)
        case kind:
            _move(model, data, int(model.body_jntadr[world.body(coordinate.of)]), kind, axis, by)


def _bend(world: World, coordinate: Coordinate, by: float) -> None:
    """Turn a joint of an arm; joint 7 stands for the fingers of a jaw."""
    model, data = world.model, world.data
    names = next(each for each in arms(model) if coordinate.of.endswith(str(each.number)))
    if coordinate.axis < len(names.joints):
        data.qpos[model.joint(names.joints[coordinate.axis]).qposadr[0]] += by
    else:
        places = fingers(model, names)
        data.qpos[places] += by * np.array([1.0, -1.0])[: len(places)]


def _carry(world: World, coordinate: Coordinate, by: float) -> None:
    """Move all free bodies, or turn them about the first one, as if they were one body."""
    model, data, axis = world.model, world.data, coordinate.axis
    joints = [int(model.body_jntadr[world.body(name)]) for name in world.free_bodies]
    places = [model.jnt_qposadr[joint] for joint in joints]
    if coordinate.kind == "all":
        for joint in joints:
            _move(model, data, joint, "place", axis, by)
        return
    turn, centre = np.zeros(4), data.qpos[places[0] : places[0] + 3].copy()
    mujoco.mju_axisAngle2Quat(turn, np.eye(3)[axis], by)
    for joint, place in zip(joints, places, strict=True):
        away = np.zeros(3)
        mujoco.mju_rotVecQuat(away, data.qpos[place : place + 3] - centre, turn)
        data.qpos[place : place + 3] = centre + away
        _move(model, data, joint, "turn", axis, by)


def _move(model: mujoco.MjModel, data: mujoco.MjData, joint: int, kind: str, axis: int, by: float) -> None:
    """Move the body of a free joint, turn it about an axis of the world through its origin, or change its velocity."""
    place, speed = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    if kind == "place":
        data.qpos[place + axis] += by
    elif kind == "speed":
        data.qvel[speed + axis] += by
    else:
        turn, turned = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, np.eye(3)[axis], by)
        mujoco.mju_mulQuat(turned, turn, data.qpos[place + 3 : place + 7])
        data.qpos[place + 3 : place + 7] = turned


# --- stored limits ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Limit:
    """A magnitude at which an answer of the rules changes."""

    place: Place
    magnitude: float
    before: tuple[str, str]
    """Answers just below the magnitude."""
    after: tuple[str, str]
    """Answers just above it."""

    @property
    def kind(self) -> tuple[Any, ...]:
        """Quantity that changes at the limit, and its line; with other contacts than those of the state, for any
        body."""
        place, line = self.place, self.place.coordinate.line
        sides = ({part for answer in side for part in answer.split(", ")} for side in (self.before, self.after))
        return frozenset(set.symmetric_difference(*sides)), *(line if place.contacts == "same" else (line[0],))


def limits(probe: Probe, along: Sequence[Coordinate]) -> Iterator[Limit]:
    """Limits of the rules around a state."""
    places = [Place(coordinate, contacts) for contacts in get_args(Contacts) for coordinate in along]
    for place in places if probe.contacts else places[: len(along)]:
        sizes = [0.0, *MAGNITUDES[place.coordinate.kind]]
        found = [probe.at(place, size) for size in sizes]
        for (low, before), (high, after) in pairwise(zip(sizes, found, strict=True)):
            if before != after:
                at = bisected(lambda size, place=place: probe.at(place, size), low, high)
                magnitude = float(f"{at:.9g}")
                sides = probe.around(place, magnitude)
                if magnitude and sides[0] != sides[1]:
                    yield Limit(place, magnitude, sides[0], sides[1])


State = NDArray[np.float64]


def chosen(start: State, last: Mapping[str, State], first: Mapping[str, State]) -> list[State]:
    """States of rollouts that are stored.

    Args:
        start: state after a reset.
        last: states just before an answer changed for the first time, by that answer. Each verdict comes first.
        first: states in which an answer was new, by that answer. They fill what is left.
    """
    known, verdicts = {**last, **first, **last}, dict[str, str]()
    for answer in known:
        verdicts.setdefault(answer.partition(", ")[0], answer)
    order = [*verdicts.values(), *(answer for answer in known if answer not in verdicts.values())]
    others = [state for answer, state in first.items() if answer in last]
    return [start, *(known[answer] for answer in order), *others][:MAX_STATES]


def contacts_of_rules(scenario: Scenario, world: World, states: Sequence[NDArray[np.float64]]) -> list[Contact]:
    """Questions about contact that the rules ask in some states."""
    recording = RecordingWorld.twin(world)
    for state in states:
        Probe(scenario, recording, state).answers()
    found = sorted({contact for question in recording.asked for contact in _about(question)})
    return found if len(found) <= MAX_TOGGLES else [found[k * len(found) // MAX_TOGGLES] for k in range(MAX_TOGGLES)]


def _about(question: Question) -> Iterator[Contact]:
    """Entries of the contact tables on which the answer to a question depends. Of all bodies that a body may touch,
    the robot and those that it touches count."""
    if question.kind == "touching_bodies":
        (body,) = question.names
        assert isinstance(question.answer, frozenset)
        yield from (Contact("touching", *sorted((body, other))) for other in question.answer | {ROBOT})
    else:
        yield Contact(question.kind, *sorted(question.names))


def under_contacts(probe: Probe) -> tuple[str, str]:
    """Hashes of the answers with contacts turned around, singly and in pairs."""
    sets = [(contact,) for contact in probe.contacts] + list(combinations(probe.contacts, 2))
    return _hashes([probe.answers(contacts=turned) for turned in sets])


def swept(probe: Probe, along: Sequence[Coordinate]) -> tuple[str, str]:
    """Hashes of the answers with all or none of the contacts under changes of `SWEPT`."""
    places = [Place(c, contacts) for contacts in ("none", "all") for c in along if c.kind in SWEPT]
    return _hashes([probe.at(place, size) for place in places for size in SWEPT[place.coordinate.kind]])


def under_mixtures(probe: Probe, state: int, along: Sequence[Coordinate]) -> tuple[str, str]:
    """Hashes of the answers under several random changes at once."""
    found = []
    for number in range(MIXED):
        chosen = {}
        for k in range(1 + number % 4):
            coordinate = along[int(unit("mixed", state, number, k) * len(along))]
            low, high = MAGNITUDES[coordinate.kind][[0, -1]]
            chosen[coordinate] = low * (high / low) ** unit("mixed", state, number, k, "size")
        turned = [c for k, c in enumerate(probe.contacts) if unit("mixed", state, number, "contact", k) < 0.15]
        found.append(probe.answers(chosen, turned))
    return _hashes(found)


def _hashes(answers: Sequence[tuple[str, str]]) -> tuple[str, str]:
    return _hash("\n".join(verdict for verdict, _ in answers)), _hash("\n".join(events for _, events in answers))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]

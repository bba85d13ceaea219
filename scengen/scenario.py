"""Scenario: one physical problem with every number filled in, able to build and judge itself."""

import abc
import hashlib
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .assets.prop import TABLE_HALF
from .errors import NoOracle
from .orientation import UPRIGHT, Orientation
from .params import canonical, check_bounds
from .robots.panda import BASE, REACH, SHOULDER
from .sim.world import World
from .symmetry import Symmetry

Action = NDArray[np.float64]
"""Shape (7 * arms,), each in [-1, 1]: end-effector translation (3), rotation vector (3), gripper (-1 open, 1 closed) of
every arm in its order."""

Plan = Generator[Action, None, None]
"""A scripted behaviour: one action per control period, until it has nothing left to do."""

Planner = Callable[[World], Plan]


@dataclass(frozen=True)
class Shortcut:
    """A tempting plan that must fail: it shows that the task's bottleneck is real."""

    plan: Planner
    to_rest: bool = False
    """Whether it is simulated until everything is at rest, and has to fail by physics alone.

    A certificate then counts nothing else as a failure: neither a rule that ends the episode earlier, nor a move that
    gave up, nor the time limit."""


@dataclass(frozen=True)
class Answer:
    """What a family asks for, as one number: for an adversary that answers without looking.

    Its values mean the same in every scenario of the family: the number of a lane, a share of a height or an offset.
    """

    candidates: tuple[float, ...]
    act: Callable[[World, float], Plan]
    """Acts on a guess as the oracle acts on the right answer, and leaves the scene such that another may follow."""
    right: Callable[[float], bool] | None = None
    """Whether a guess is right, by statics, without simulating anything; None if only a rollout can tell."""
    tries: int = 3
    """How many guesses an episode allows, three at most: one where a wrong one ends it."""


@dataclass(frozen=True)
class Refutation:
    """A checkable reason why a combination of parameters is an invalid scenario."""

    reason: str
    """The same words for every scenario that fails in this way, so that rejections can be counted."""
    numbers: Mapping[str, float]
    """What was compared, in SI units."""


def require(holds: bool, otherwise: str, **numbers: float) -> Refutation | None:
    """One constraint of a family, as a positive statement.

    Args:
        holds: what must be true.
        otherwise: the reason for the refutation where it is not, the same words for every scenario.
        numbers: what was compared, in SI units.
    """
    return None if holds else Refutation(otherwise, {name: float(value) for name, value in numbers.items()})


def on_table(what: str, points: ArrayLike, margin: float = 0.0) -> Refutation | None:
    """Require that every point, shape (..., 2 or 3), is over the table and `margin` from its edge [m]."""
    far = float(np.abs(np.asarray(points, float)[..., :2]).max())
    return require(far <= TABLE_HALF - margin, f"{what} leaves the table", farthest=far, edge=TABLE_HALF - margin)


def within_reach(what: str, *points: ArrayLike, base: NDArray[np.float64] = BASE) -> Refutation | None:
    """Require that the grip site can come to each point [m], by a bound that no posture exceeds (`panda.REACH`).

    Args:
        what: names the points.
        points: in world axes.
        base: where the arm in question stands [m]; one arm in the middle by default, else see `panda.bases`.
    """
    shoulder = SHOULDER + base - BASE
    away = max(float(np.linalg.norm(np.asarray(point, float) - shoulder)) for point in points)
    return require(away <= REACH, f"{what} is out of reach", distance=away, reach=REACH)


class Scenario(abc.ABC):
    """Base of every scenario family. Subclasses are frozen dataclasses; subclass once, never twice.

    A family file reads: fields, scene (`build`), goal (`success`, `failure`, `events`), `oracle`, `shortcuts`,
    `ablations`, `constraints`, geometry.
    """

    HOLD: ClassVar[float] = 0.0
    """How long the goal must hold without interruption before it counts [s]."""
    MOVING: ClassVar[tuple[str, ...]] = ()
    """Bodies that are meant to move without anybody acting; they are exempt from the rest check."""
    DISTURBED: ClassVar[tuple[str, ...]] = ()
    """Hinges whose start is disturbed in jittered runs, as the places of free bodies are."""
    NO_ABLATIONS: ClassVar[str] = ""
    """Why a family has no ablations: its certificates say so, and that this was not checked."""
    SYMMETRIES: ClassVar[tuple[Symmetry, ...]] = ()
    """Changes of the parameters that give the same scene, besides the periods that parameters declare themselves.

    The mirror image of a scene is another scene: the arm is not mirrored with it, and who has learnt to use the left
    arm of a seesaw has not learnt to use the right one. A family may declare it all the same, where that is not asked.
    """

    def __post_init__(self) -> None:
        check_bounds(self)

    @abc.abstractmethod
    def build(self) -> mujoco.MjSpec:
        """The scene, without the robot. Bodies that goals and oracles name must be named here."""

    @abc.abstractmethod
    def success(self, world: World) -> bool:
        """Whether the goal holds now."""

    def failure(self, world: World) -> str | None:
        """Why the episode is lost for good, or None. A failure ends the episode."""
        return None

    def events(self, world: World) -> None:  # noqa: B027
        """Events of the scene itself, called before every control period. Draws nothing: all values are parameters.

        What they must know of the episode so far is in `world.memory`, which nothing else may write: a family has no
        state. Nor may anything else call `arm.jam`, `arm.tell`, `world.move`, `world.launch` or `world.spin`.
        """

    def pending(self, world: World) -> bool:
        """Whether something is still going to happen by itself, although everything is at rest and nobody acts: an
        event, or a goal that time alone brings.

        As long as it is, no episode ends because everything is at rest, and the rest check ends with it. A family whose
        events answer what the robot does should say when they are over; of one that does not, nothing is known.
        """
        return type(self).events is not Scenario.events

    def oracle(self, world: World) -> Plan:
        """A scripted solution, which may read the full state but acts only through the robot.

        Certification calls it and nothing else does: verification, environments and pools work without it.

        Raises:
            NoOracle: the family has none.
        """
        raise NoOracle(type(self).__name__)

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Tempting plans that must fail, by name in snake_case."""
        return {}

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """The scene with its intended means taken away, by name in snake_case: there the witness must fail."""
        return {}

    def answer(self) -> Answer | None:
        """What is asked for, as one number, if it can be told so: fixed guesses are tried on it."""
        return None

    def constraints(self) -> Iterator[Refutation | None]:
        """What must hold of the parameters, one `require(...)` after the other; later ones may rely on earlier ones."""
        yield from ()

    def infeasible(self) -> Refutation | None:
        """The first constraint that does not hold, or None."""
        return next((refutation for refutation in self.constraints() if refutation), None)

    def features(self) -> Mapping[str, float]:
        """What the physics depends on, by name in snake_case: ratios and heights rather than parameters.

        Proves and decides nothing. Scenes that differ in every parameter may be equal in these, and then it takes no
        new insight to solve them. A certificate records them in its first check.
        """
        return {}

    @property
    def orientation(self) -> Orientation:
        """How every picture of this scenario is held before a policy; people see it upright (`show`, `film`)."""
        return UPRIGHT

    @property
    def material(self) -> str:
        """Hashes of what the scene is made of besides parameters, such as scans; empty where parameters decide all."""
        return ""

    @property
    def id(self) -> str:
        """Twelve hex digits that depend on the family, every parameter and `material`, and on nothing else."""
        text = f"{type(self).__module__}.{type(self).__qualname__} {canonical(self)}{self.material}"
        return hashlib.sha256(text.encode()).hexdigest()[:12]

"""A scenario: one physical problem with all its numbers, which builds its scene and judges its outcome."""

import abc
import copy
import hashlib
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import ClassVar, Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .assets.prop import TABLE_HALF, Prop
from .decisions import Decision
from .errors import NoOracle
from .means import Mean
from .orientation import UPRIGHT, Orientation
from .params import canonical, check_bounds
from .robots.panda import BASE, REACH, SHOULDER
from .sim.world import World
from .symmetry import Symmetry

Action = NDArray[np.float64]
"""Action of shape (7 * arms,), each number in [-1, 1]: end-effector translation (3), rotation vector (3) and gripper
(-1 open, 1 closed) of every arm, in the order of the arms."""

Plan = Generator[Action, None, None]
"""Scripted behaviour: a generator that yields one action per control period and ends when the behaviour is complete."""

Planner = Callable[[World], Plan]
"""Function that starts a plan in a world."""


@dataclass(frozen=True)
class Shortcut:
    """A tempting plan that must fail. Its failure shows that the task's bottleneck is real."""

    plan: Planner
    """Function that starts the plan."""
    to_rest: bool = False
    """Whether the plan is simulated until everything is at rest and must fail by physics alone.

    If so, a certificate counts nothing else as a failure: neither a rule that ends the episode earlier, nor a move that
    gave up, nor the time limit.
    """


@dataclass(frozen=True)
class Answer:
    """The answer that a family requires, as one number. An adversary tries it without looking at the scene.

    The number means the same in every scenario of the family: the index of a lane, or a share of a height or an offset.
    """

    candidates: tuple[float, ...]
    """Values that a guess may take."""
    act: Callable[[World, float], Plan]
    """Plan that acts on a guess as the oracle acts on the right answer. It leaves the scene such that another guess can
    follow."""
    right: Callable[[float], bool] | None = None
    """Function that decides by statics, without a simulation, whether a guess is right; None if only a rollout can
    decide."""
    tries: int = 3
    """Number of guesses that an episode allows, at most three; 1 if no goal counts after a wrong guess."""


@dataclass(frozen=True)
class Refutation:
    """A checkable reason why a combination of parameters is an invalid scenario."""

    reason: str
    """Reason as text, the same for every scenario that fails in this way, so that rejections can be counted."""
    numbers: Mapping[str, float]
    """Numbers that were compared, in SI units."""


def require(holds: bool, otherwise: str, **numbers: float) -> Refutation | None:
    """State one constraint of a family, in the positive.

    Args:
        holds: the condition that must be true.
        otherwise: the reason of the refutation if it is false; the same words for every scenario.
        numbers: the numbers that were compared, in SI units.

    Returns:
        The refutation if the condition is false, else None.
    """
    return None if holds else Refutation(otherwise, {name: float(value) for name, value in numbers.items()})


def on_table(what: str, points: ArrayLike, margin: float = 0.0) -> Refutation | None:
    """Require that every point, shape (..., 2 or 3), is over the table and at least `margin` [m] from its edge.

    Args:
        what: name of the object that the points belong to.
        points: in world axes [m].
        margin: least distance from the edge [m].
    """
    far = float(np.abs(np.asarray(points, float)[..., :2]).max())
    return require(far <= TABLE_HALF - margin, f"{what} leaves the table", farthest=far, edge=TABLE_HALF - margin)


def within_reach(what: str, *points: ArrayLike, base: NDArray[np.float64] = BASE) -> Refutation | None:
    """Require that the grip site can come to each point, by a bound that no posture exceeds (`panda.REACH`).

    Args:
        what: name of the points.
        points: in world axes [m].
        base: position of the arm's base [m]; by default the single arm in the middle. See `panda.bases` for two arms.
    """
    shoulder = SHOULDER + base - BASE
    away = max(float(np.linalg.norm(np.asarray(point, float) - shoulder)) for point in points)
    return require(away <= REACH, f"{what} is out of reach", distance=away, reach=REACH)


@dataclass(frozen=True)
class Conditions:
    """Conditions of control under which a scenario is posed, see `scengen.samplers.conditions`."""

    parts: tuple[tuple[str, int], ...]
    """Kinds with their levels."""
    embodiment: str
    """Robot of the task."""

    def __str__(self) -> str:
        return "+".join(f"{kind}@{level}" for kind, level in self.parts)


class Scenario(abc.ABC):
    """Base of every scenario family. A family is a frozen dataclass, and no family derives from another family.

    Families with much in common may share one abstract base, which derives from `Scenario` directly. Such a base
    declares every field that it uses, so that it can be read without its families.

    A family file reads: fields, scene (`build`), goal (`success`, `failure`, `means`, `events`), `oracle`, `steps`,
    `shortcuts`, `ablations`, `decisions`, `constraints`, `features`, `facts`, geometry.
    """

    VERSION: ClassVar[int] = 1
    """Version of the task. It rises when draws, scenes, rules or verdicts change, and never for a refactoring. A
    family states it in its own class, from which it is also read without an import."""
    HOLD: ClassVar[float] = 0.0
    """Time for which the goal must hold without interruption before it counts [s]."""
    MOVING: ClassVar[tuple[str, ...]] = ()
    """Bodies that are meant to move on their own. The rest check ignores them."""
    DISTURBED: ClassVar[tuple[str, ...]] = ()
    """Hinges whose initial angles are disturbed in jittered runs, as the positions of free bodies are."""
    NO_ABLATIONS: ClassVar[str] = ""
    """Reason why the family has no ablations. Its certificates state the reason, and that ablations were not
    checked."""
    CONCEALED: ClassVar[tuple[str, ...]] = ()
    """Bodies that no camera sees at the start, such as `cube_*` under lids. The cue audit does not look at them."""
    SYMMETRIES: ClassVar[tuple[Symmetry, ...]] = ()
    """Changes of the parameters that give the same scene, in addition to the periods that parameters declare
    themselves.

    The mirror image of a scene is a different scene: the arm is not mirrored with it, and a policy that has learned to
    use the left arm of a seesaw has not learned to use the right one. A family may still declare a mirror symmetry if
    its task does not probe the difference.
    """

    conditions: ClassVar[Conditions | None] = None
    """Conditions of control under which this scenario is posed; None: the usual ones. `under` sets them."""

    def __post_init__(self) -> None:
        check_bounds(self)

    def under(self, conditions: Conditions | None) -> Self:
        """This scenario under other conditions of control."""
        if conditions == self.conditions:
            return self
        posed = copy.copy(self)
        object.__setattr__(posed, "conditions", conditions)
        return posed

    @abc.abstractmethod
    def build(self) -> mujoco.MjSpec:
        """Build the scene without the robot. Bodies that goals and oracles refer to need names."""

    @abc.abstractmethod
    def success(self, world: World) -> bool:
        """Whether the goal holds now."""

    def failure(self, world: World) -> str | None:
        """Reason why the episode is lost, or None. A failure ends the episode. Rules that the source of the task lacks
        are `means`."""
        return None

    def means(self) -> Mapping[str, Mean]:
        """What the intended solution does, by a name that completes "the goal was reached otherwise, it lacks: ...".

        A success that lacks one of them is a success otherwise. Facts measure contacts, holds, rests, orders and
        heights rather than places of the hand, which can be imitated. See `scengen.means`.
        """
        return {}

    def events(self, world: World) -> None:  # noqa: B027
        """Let the scene's own events happen. Called before every control period. It draws nothing: all values are
        parameters.

        A family has no state. What events need to know about the episode so far is in `world.memory`, which only this
        method may write. Only this method may call `arm.jam`, `arm.set_action`, `world.move`, `world.launch` and
        `world.spin`.
        """

    def pending(self, world: World) -> bool:
        """Whether something will still happen on its own although everything is at rest: an event, or a goal that time
        alone brings.

        While this is true, no episode ends because everything is at rest, and the rest check ends when it becomes
        false. A family whose events respond to the robot should report when they are over. By default, a family with
        events is always pending.
        """
        return type(self).events is not Scenario.events

    def oracle(self, world: World) -> Plan:
        """Scripted solution. It may read the full state but acts only through the robot.

        Only certification calls it: verification, environments and pools work without it.

        Raises:
            NoOracle: the family has none.
        """
        raise NoOracle(type(self).__name__)

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Tempting plans that must fail, by name in snake_case."""
        return {}

    def steps(self) -> Mapping[str, Planner]:
        """Moves by which sub-goals of `conf/facts/<task>.yaml` are carried out, by their names.

        A move starts from the state that the steps before it left. For a sub-goal of a right plan it is the oracle's
        own part, for a wrong one a shortcut's. The move of a sub-goal that may be repeated does one round, and yields
        nothing if nothing is left to do. The method is called for every rollout, so that moves may share what was
        sensed. A family states moves of all sub-goals of its right plans but those that only look, or none.
        """
        return {}

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Scenes without the intended means, by name in snake_case. The witness must fail in each of them."""
        return {}

    def answer(self) -> Answer | None:
        """The answer that the task requires, if it can be stated as one number. Fixed guesses are tried on it."""
        return None

    def decisions(self) -> Mapping[str, Decision]:
        """Decisions that a solution depends on, by name: a choice, a number or a place, and what is right here.

        `scengen axis cues` searches for visible quantities that reveal them although they are not the intended ones. A
        family states those whose answers differ between scenarios, and tolerances that a rollout has confirmed. See
        `scengen.decisions`.
        """
        return {}

    def constraints(self) -> Iterator[Refutation | None]:
        """Constraints on the parameters, one `require(...)` after the other. Later ones may rely on earlier ones."""
        yield from ()

    def infeasible(self) -> Refutation | None:
        """The first constraint that does not hold, or None."""
        return next((refutation for refutation in self.constraints() if refutation), None)

    def features(self) -> Mapping[str, float]:
        """Quantities that the physics depends on, by name in snake_case: ratios and heights rather than parameters.

        Features prove and decide nothing. Scenes that differ in every parameter may have equal features; then the same
        behaviour solves them. A certificate records the features in its first check.
        """
        return {}

    def facts(self) -> Mapping[str, float | str]:
        """Answers to the questions about this scenario that `conf/facts/<task>.yaml` asks, by their ids.

        Numbers in the unit of the question, or one of its options. They show whether a model understands the scenario,
        see `scengen.agents`. Questions whose answer is the same in all scenarios are answered in that file.
        """
        return {}

    @property
    def orientation(self) -> Orientation:
        """Orientation in which a policy sees every picture of this scenario. `show` and `film` show it upright."""
        return UPRIGHT

    @property
    def material(self) -> str:
        """Hashes of ingredients other than parameters, such as the meshes of its assets; empty if the parameters decide
        everything."""
        return "".join(_materials(self))

    @property
    def id(self) -> str:
        """Id of twelve hex digits. It depends on the family, every parameter, `material` and `conditions`, and on
        nothing else."""
        posed = f" {self.conditions}" if self.conditions else ""
        text = f"{type(self).__module__}.{type(self).__qualname__} {canonical(self)}{self.material}{posed}"
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def _materials(owner: object) -> Iterator[str]:
    """`Prop.material` of all assets that a dataclass holds, in the order of its fields."""
    for field in fields(owner):  # type: ignore[arg-type]
        value = getattr(owner, field.name)
        for each in value if isinstance(value, tuple) else (value,):
            if isinstance(each, Prop):
                yield each.material
            if is_dataclass(each):
                yield from _materials(each)

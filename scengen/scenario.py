"""Scenario: one physical problem with every number filled in, able to build and judge itself."""

import abc
import hashlib
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from .ood.symmetry import Symmetry
from .params import canonical, check_bounds
from .sim.world import World

Action = NDArray[np.float64]
"""Shape (7,), each in [-1, 1]: end-effector translation (3), rotation vector (3), gripper (-1 open, 1 closed)."""

Plan = Generator[Action, None, None]
"""A scripted behaviour: one action per control period, until it has nothing left to do."""

Planner = Callable[[World], Plan]


@dataclass(frozen=True)
class Refutation:
    """A checkable reason why a combination of parameters is no fair problem."""

    reason: str
    """The same words for every scenario that fails in this way, so that rejections can be counted."""
    numbers: Mapping[str, float]
    """What was compared, in SI units."""


class Scenario(abc.ABC):
    """Base of every scenario family. Subclasses are frozen dataclasses; subclass once, never twice.

    A family also defines `oracle(world) -> Plan`, a scripted solution that may read the full state but acts
    only through the robot. It is no part of this interface on purpose: nothing but certification calls it,
    and everything else must work without it.
    """

    HOLD: ClassVar[float] = 0.0
    """How long the goal must hold without interruption before it counts [s]."""
    MOVING: ClassVar[tuple[str, ...]] = ()
    """Bodies that are meant to move without anybody acting; they are exempt from the rest check."""
    SYMMETRIES: ClassVar[tuple[Symmetry, ...]] = ()
    """Changes of the parameters that give the same scene, besides the periods that parameters declare themselves.

    The mirror image of a scene is another scene: the arm is not mirrored with it, and who has learnt to use the left
    arm of a seesaw has not learnt to use the right one. A family may declare it all the same, where that is not asked.
    """

    def __post_init__(self) -> None:
        check_bounds(self)

    def infeasible(self) -> Refutation | None:
        """Why this combination of parameters cannot be a fair problem, or None."""
        return None

    @abc.abstractmethod
    def build(self) -> mujoco.MjSpec:
        """The scene, without the robot. Bodies that goals and oracles name must be named here."""

    @abc.abstractmethod
    def success(self, world: World) -> bool:
        """Whether the goal holds now."""

    def failure(self, world: World) -> str | None:
        """Why the episode is lost for good, or None. A failure ends the episode."""
        return None

    def script(self, world: World) -> None:  # noqa: B027
        """Events of the scene itself, called before every control period. Draws nothing: all values are parameters."""

    def shortcuts(self) -> Mapping[str, Planner]:
        """Tempting plans that must fail: they show that the task's bottleneck is real."""
        return {}

    def plays_out(self, shortcut: str) -> bool:
        """Whether a shortcut has to fail by physics alone, seen to its end.

        A certificate counts nothing else as a failure: neither a rule that ends the episode before all is at rest, nor
        a move that gave up, nor the time limit.
        """
        return False

    def without(self) -> Mapping[str, mujoco.MjSpec]:
        """The scene with its intended means taken away, by name: there the witness must fail."""
        return {}

    def features(self) -> Mapping[str, float]:
        """What the physics depends on, by name: ratios and heights rather than parameters. Proves and decides nothing.

        Scenes that differ in every parameter may be equal in these, and then it takes no new insight to solve them.
        A certificate records them in its first check.
        """
        return {}

    @property
    def id(self) -> str:
        """Twelve hex digits that depend on the family and every parameter, and on nothing else."""
        text = f"{type(self).__module__}.{type(self).__qualname__} {canonical(self)}"
        return hashlib.sha256(text.encode()).hexdigest()[:12]

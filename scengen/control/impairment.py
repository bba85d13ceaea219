"""What hinders the control of a robot: another start, late, noisy or lost actions, a soft controller, a load.

It stands in custom numbers of the scene, so that every program that plays the scene plays it so.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..robots.panda import JOINTS, MAX_ARMS
from .teleop import MOTION

PREFIX = "impaired_"
"""Beginning of the names of the custom numbers."""
MAX_DELAY = 100
"""Longest delay [control periods]: a second."""


@dataclass(frozen=True)
class Impairment:
    """Conditions of control. The defaults hinder nothing."""

    start: tuple[float, ...] = ()
    """Offsets of the joints of each driven arm from the usual start [rad], seven numbers for each; empty: none."""
    delay: float = 0.0
    """Whole number of control periods by which actions arrive late."""
    noise: float = 0.0
    """Standard deviation of the noise on the six motion channels of an action."""
    lost: float = 0.0
    """Share of control periods in which no action arrives: the arm gets no motion, and the gripper its last command."""
    key: float = 0.0
    """Whole number that the noise and the lost periods depend on."""
    stiffness: float = 1.0
    """Factor on the stiffness of the controller, whose damping stays critical."""
    gripper: float = 1.0
    """Factor on the speed of jaws, and on that with which the suction of a cup builds up."""
    payload: float = 0.0
    """Mass at each driven wrist, whose weight the controller does not know [kg]."""

    def __bool__(self) -> bool:
        return self != NONE

    def write(self, scene: mujoco.MjSpec) -> None:
        """Write what differs from the defaults into a scene, as custom numbers."""
        for field in fields(self):
            if (value := getattr(self, field.name)) != field.default:
                numbers = list(np.atleast_1d(np.asarray(value, float)))
                scene.add_numeric(name=PREFIX + field.name, data=numbers, size=len(numbers))

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Self:
        """The impairment of a compiled scene.

        Raises:
            ValueError: one of its custom numbers has no meaning.
        """

        def numbers(name: str) -> NDArray[np.float64] | None:
            at = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, PREFIX + name)
            return None if at < 0 else model.numeric_data[model.numeric_adr[at] :][: model.numeric_size[at]]

        return cls._of(numbers)

    @classmethod
    def of_spec(cls, scene: mujoco.MjSpec) -> Self:
        """The impairment of a scene that is not compiled yet.

        Raises:
            ValueError: one of its custom numbers has no meaning.
        """
        there = {numeric.name: numeric for numeric in scene.numerics}

        def numbers(name: str) -> NDArray[np.float64] | None:
            found = there.get(PREFIX + name)
            return None if found is None else np.asarray(found.data, float)[: found.size]

        return cls._of(numbers)

    @classmethod
    def _of(cls, numbers: Callable[[str], NDArray[np.float64] | None]) -> Self:
        given = {field.name: numbers(field.name) for field in fields(cls)}
        found = {name: value for name, value in given.items() if value is not None}
        for name, value in found.items():
            low, high = LIMITS[name]
            right = (JOINTS, JOINTS * MAX_ARMS) if name == "start" else (1,)
            whole = name not in ("delay", "key") or (value == np.round(value)).all()
            if len(value) not in right or not whole or not ((low <= value) & (value <= high)).all():
                kind = "whole numbers" if name in ("delay", "key") else "numbers"
                told = np.array2string(value[:8], threshold=8)
                raise ValueError(f"{PREFIX}{name} = {told}; it holds {kind} in [{low:g}, {high:g}]")
        start = found.pop("start", np.zeros(0))
        return cls(tuple(start.tolist()), **{name: float(value[0]) for name, value in found.items()})


NONE = Impairment()
"""No impairment."""
LIMITS = {
    "start": (-1.0, 1.0),
    "delay": (0.0, MAX_DELAY),
    "noise": (0.0, 2.0),
    "lost": (0.0, 1.0),
    "key": (0.0, 2.0**31),
    "stiffness": (0.01, 16.0),
    "gripper": (1e-3, 1.0),
    "payload": (0.0, 20.0),
}
"""Smallest and largest value of each field."""


class Channel:
    """The way of actions to the controller: they arrive late, shaken or not at all, as an impairment says."""

    def __init__(self, impairment: Impairment, size: int) -> None:
        """
        Args:
            size: length of an action.
        """
        self.impairment = impairment
        self._late = np.zeros((int(impairment.delay), size))
        self.changes = bool(impairment.delay or impairment.noise or impairment.lost)
        """Whether actions arrive otherwise than they were sent."""

    def reset(self, idle: NDArray[np.float64]) -> None:
        """Return to the start, at which idle actions are under way."""
        self._late[:] = idle

    def __call__(self, action: NDArray[np.floating], idle: NDArray[np.float64], period: int) -> NDArray[np.float64]:
        """The action that arrives in a control period in which another one is sent.

        Args:
            action: what is sent, shape (7 * arms,).
            idle: what the robot does without an action.
            period: number of the control period.
        """
        one, rng = self.impairment, np.random.default_rng((int(self.impairment.key), period))
        shaken = np.clip(np.asarray(action, np.float64), -1.0, 1.0).reshape(-1, MOTION + 1)
        if one.noise:
            shaken[:, :MOTION] = np.clip(shaken[:, :MOTION] + rng.normal(0.0, one.noise, (len(shaken), MOTION)), -1, 1)
        arriving = shaken.ravel()
        if len(self._late):
            arriving, self._late[:-1] = self._late[0].copy(), self._late[1:].copy()
            self._late[-1] = shaken.ravel()
        return idle if one.lost and rng.random() < one.lost else arriving

    @property
    def state(self) -> NDArray[np.float64]:
        """The actions under way, a copy; assign them to continue from there."""
        return self._late.ravel().copy()

    @state.setter
    def state(self, late: NDArray[np.float64]) -> None:
        self._late[:] = late.reshape(self._late.shape)

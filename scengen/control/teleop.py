"""The paper's teleoperation filter, which acts between a plan, or a person, and the controller."""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from ..errors import UnknownName

ALPHA = 0.8
"""Weight of the new value in the moving average: paper, appendix "Teleoperation hardware and protocol"."""
LARGEST_CHANGE = 0.15
"""Largest change of a channel in one control period, applied after the average: same appendix."""
MOTION = 6
"""Number of filtered channels of an arm, translation and rotation. The gripper channel after them is not filtered."""


class Filter:
    """Exponential moving average of the six motion channels of each arm, followed by a limit on the change per period.

    Both refer to the same value, the previous filtered one, which is 0 after a reset. Inputs are clipped to [-1, 1]
    first, so that outputs stay in that range. One object filters one stream of actions.
    """

    def __init__(self, arms: int = 1) -> None:
        """Make a filter at rest.

        Args:
            arms: number of arms; an action holds seven numbers for each.
        """
        self._state = np.zeros(MOTION * arms)
        self._shape = ((MOTION + 1) * arms,)

    def __call__(self, action: ArrayLike) -> NDArray[np.float32]:
        """The filtered action, shape (7 * arms,), float32. Controller and witness get exactly this."""
        given = np.ascontiguousarray(action, np.float64)
        if given.shape != self._shape:
            raise ValueError(f"an action has shape {self._shape}, not {given.shape}")
        filtered = np.empty(self._shape, np.float32)
        if not _filter(self._state, given, filtered):
            raise ValueError(f"an action must be finite, not {given.tolist()}")
        return filtered

    def reset(self) -> None:
        """Return to the state after a reset, in which the previous action is at rest."""
        self._state[:] = 0.0

    @property
    def state(self) -> NDArray[np.float64]:
        """The previous filtered motion, shape (6 * arms,), a copy; assign it to continue from there."""
        return self._state.copy()

    @state.setter
    def state(self, motion: ArrayLike) -> None:
        """Previous filtered motion, shape (6 * arms,), a copy. Assign it to continue from there."""
        given = np.asarray(motion, np.float64)
        if given.shape != self._state.shape or not (np.abs(given) <= 1.0).all():
            raise ValueError(f"a filter's state is {len(self._state)} numbers in [-1, 1], not {given.tolist()}")
        self._state[:] = given


TELEOP = "teleop"
"""Name of the filter for environments, which by default pass actions on unfiltered.

The paper's interface for policies has no filter. The filter smooths the commands of people and scripted solutions, and
the recorded actions that policies learn from are its outputs. A second filter would slow them down.
"""


def check_filter(name: str | None) -> None:
    """Raise `UnknownName` unless `name` is a filter that environments accept: `TELEOP`, or None for no filter."""
    if name not in (None, TELEOP):
        raise UnknownName("action_filter", str(name), [TELEOP, "None"])


def unfiltered(action: ArrayLike) -> NDArray[np.float32]:
    """An action as the controller gets it without the filter: clipped to [-1, 1]."""
    return np.asarray(action, np.float32).clip(-1.0, 1.0)


@njit(nogil=True, cache=True)
def _filter(state: NDArray[np.float64], action: NDArray[np.float64], out: NDArray[np.float32]) -> bool:
    """Advance `state` by one action and write the result.

    Return False, and do nothing, if the action is not finite.
    """
    for i in range(len(action)):
        if not np.isfinite(action[i]):
            return False
    for arm in range(len(action) // (MOTION + 1)):
        first = (MOTION + 1) * arm
        for i in range(MOTION):
            before = state[MOTION * arm + i]
            smooth = ALPHA * _unit(action[first + i]) + (1.0 - ALPHA) * before
            change = min(max(smooth - before, -LARGEST_CHANGE), LARGEST_CHANGE)
            out[first + i] = state[MOTION * arm + i] = _unit(before + change)
        out[first + MOTION] = _unit(action[first + MOTION])
    return True


@njit
def _unit(value: float) -> float:
    """`value` clipped to [-1, 1]."""
    return min(max(value, -1.0), 1.0)

"""The paper's mapping from a gamepad to actions (App. C.1), before the teleoperation filter."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...control.loop import ACTION, Loop
from .pad import Pad

TRANSLATION = 0.3
"""Translation of an action at full deflection: paper, App. C.1."""
ROTATION = 0.2
"""Rotation of an action at full deflection: paper, App. C.1."""
STICK_DEAD_ZONE = 0.24
"""Share of a stick's deflection that counts as rest: XInput's constant for the left thumb, 7849 of 32767."""
TRIGGER_DEAD_ZONE = 0.12
"""Share of a trigger's deflection that counts as rest: XInput's constant, 30 of 255."""
RAMP_TIME = 0.4
"""Time in which a fully pressed trigger takes the gripper from open to closed [s]. The paper gives no number; the jaw
itself needs about as long."""
ARM_CONTROLS = """\
left stick: forwards, backwards, left, right     shoulder buttons: right up, left down
right stick: tilt (pitch, roll)                  d-pad left, right: turn (yaw)
right trigger: close slowly, left trigger: open slowly        A: close or open at once
"""
"""Controls of the arm as text."""


@dataclass(frozen=True)
class Grips:
    """State of the mapping: gripper commands and the arm that is driven."""

    commands: tuple[float, ...]
    """Gripper command of each arm in [-1, 1]; 1 is closed, or suction on."""
    active: int = 0
    """Number of the arm that the sticks drive."""

    def next_arm(self) -> "Grips":
        """The same grips, with the sticks on the next arm."""
        return replace(self, active=(self.active + 1) % len(self.commands))

    def with_command(self, command: float) -> "Grips":
        """The same grips, with another command for the driven arm."""
        commands = list(self.commands)
        commands[self.active] = min(1.0, max(-1.0, command))
        return replace(self, commands=tuple(commands))


def advanced(grips: Grips, pad: Pad, pressed: set[str]) -> Grips:
    """The grips after the events of a control period.

    Args:
        pressed: buttons that went down in this period; a button that is held acts once (the paper's latch).
    """
    if "y" in pressed:
        grips = grips.next_arm()
    command = grips.commands[grips.active]
    if "a" in pressed:
        return grips.with_command(-1.0 if command > 0.0 else 1.0)
    ramp = _beyond(pad["righttrigger"], TRIGGER_DEAD_ZONE) - _beyond(pad["lefttrigger"], TRIGGER_DEAD_ZONE)
    return grips.with_command(command + 2.0 * ramp * Loop.PERIOD / RAMP_TIME) if ramp else grips


def motion(pad: Pad) -> NDArray[np.float64]:
    """Motion of the driven arm in the frame of its base, shape (6,): translation and rotation vector, unfiltered.

    x points away from the base, y to the left, z upwards. While B is held (the clutch) there is no motion.
    """
    if pad["b"]:
        return np.zeros(ACTION - 1)
    left_x, left_y = _stick(pad["leftx"], pad["lefty"])
    right_x, right_y = _stick(pad["rightx"], pad["righty"])
    up, turn = pad["rightshoulder"] - pad["leftshoulder"], pad["dpleft"] - pad["dpright"]
    return np.array([
        *(-TRANSLATION * left_y, -TRANSLATION * left_x, TRANSLATION * up),
        *(ROTATION * right_x, -ROTATION * right_y, ROTATION * turn),
    ])  # fmt: skip


def action_of(pad: Pad, grips: Grips) -> NDArray[np.float64]:
    """The action of a control period, shape (7 * arms,). Arms that are not driven keep place and grip."""
    action = np.zeros((len(grips.commands), ACTION))
    action[:, ACTION - 1] = grips.commands
    action[grips.active, : ACTION - 1] = motion(pad)
    return action.ravel()


def _stick(x: float, y: float) -> tuple[float, float]:
    """Deflection of a stick beyond its dead zone, which is a circle; the length of the result is at most 1."""
    length = math.hypot(x, y)
    share = _beyond(min(1.0, length), STICK_DEAD_ZONE)
    return (x * share / length, y * share / length) if share else (0.0, 0.0)


def _beyond(value: float, rest: float) -> float:
    """Deflection beyond the dead zone, stretched to [0, 1], so that slow motion remains possible."""
    return max(0.0, value - rest) / (1.0 - rest)

"""The Panda's jaw as it is in the model: sizes, forces and times that plans and constraints rely on.

Lengths are measured from the grip site of a hand that points down: "along" is the direction in which the fingers close,
"across" the level direction perpendicular to it. The gap is the distance between the two pads, the width that of an
object between them. Times count from the start of the first control period with the new gripper command. A plan checks
once per period and sees their end up to 10 ms later.
"""

import math

from ..physics import GRAVITY

# --- sizes: the collision geometry of panda_gripper.xml, to 0.5 mm --------------------------

OPENING = 0.079
"""Largest gap [m]: 40 mm of travel for each finger, minus `OVERLAP`. No wider object fits between the pads."""
OPEN_GAP = 0.077
"""Gap that the fingers reach 0.5 s after the command to open [m]. Dry friction stalls them 1 mm short of their goal.
They creep the rest of the way, half of it in 0.8 s."""
RESET_GAP = 0.0407
"""Gap after a reset [m]: `panda.FINGERS`."""
OVERLAP = 0.001
"""Distance by which the pads would overlap if both fingers could reach the goal of the command to close [m]."""
SPAN = 0.133
"""Width of the open jaw along, fingers included [m]; 0.109 at the tips."""
SPAN_CLOSED = 0.054
"""Width of the closed jaw along, fingers included [m]."""
TIP_SPAN_CLOSED = 0.030
"""Width of the closed jaw along at the finger tips [m]."""
FINGER_ACROSS = 0.0105
"""Distance that the fingers reach across, to either side [m]: half their width, open or closed. 0.0088 at the tips."""
TIP_BELOW = 0.0092
"""Distance that the finger tips reach below the grip site [m]."""
PAD = 0.016
"""Width of a finger pad across, and its height [m]."""
PAD_BELOW = 0.0044
"""Distance that the pads reach below the grip site [m]. Below them the fingers' faces stand back by 0.6 mm."""
PALM_ALONG = 0.104
"""Distance that the palm reaches along, to either side [m]."""
PALM_ACROSS = 0.0316
"""Distance that the palm reaches across, to either side [m]."""
PALM_ABOVE = 0.031
"""Height of the palm's lower face above the grip site [m]."""

# --- drive of one finger: panda_gripper.xml under the command of robosuite's SimpleGripController ---

STIFFNESS = 1000.0
"""Force per distance from the commanded position [N/m]: kp."""
MAX_FORCE = 20.0
"""Largest force of a finger [N]: forcerange."""
DAMPING = 100.0
"""Viscous friction [N s/m]."""
FRICTION = 1.0
"""Dry friction [N]. It stalls a finger, but does not reduce the force with which a finger at rest presses."""
INERTIA = 1.11
"""Mass of finger, tip and rotor [kg]."""
COMMAND_SPEED = 0.8
"""Speed at which the commanded gap changes [m/s]: at `control.osc.JAW_SPEED`, 80 mm in ten control periods."""

_STALL_DISTANCE = 2 * FRICTION / STIFFNESS
"""Distance of the gap from its goal at which friction stalls the fingers [m]."""
_MAX_SPEED = 2 * (MAX_FORCE - FRICTION) / DAMPING
"""Speed of the gap at the largest force [m/s]."""
_DECAY_DISTANCE = 2 * (MAX_FORCE - FRICTION) / STIFFNESS
"""Distance to the stall position below which the force decays with the distance [m]."""
_DECAY_TIME = (DAMPING + math.sqrt(DAMPING**2 - 4 * INERTIA * STIFFNESS)) / (2 * STIFFNESS)
"""Time constant of that decay [s]: the slow root of a damped spring."""
_LAG = 0.037
"""Delay relative to a motion in which the full force acts from the start [s]: command ramp and inertia. Measured."""


def pinch(width: float) -> float:
    """Total normal force of the two pads on an object at rest between them [N]. Each pad applies half of it.

    The fingers are springs whose goal lies beyond the object's sides: STIFFNESS * (width + OVERLAP), at most 40 N.
    Measured within 1.5 % at 0.1 kg and more. A lighter object yields to the pads, by 2 % of the force at 0.05 kg and 4
    % at 0.02 kg. A hand that closes up and down holds with the same force, but everything sags by 1 mm under the
    fingers' weight.
    """
    return min(STIFFNESS * (width + OVERLAP), 2 * MAX_FORCE)


def droop(mass: float, lever: float, width: float) -> float:
    """Torque of a held body's weight about the pads, over the torque that they resist: above 1 the body turns.

    Args:
        mass: mass of the body [kg].
        lever: level distance of its centre of mass from the pads [m].
        width: width of the body between the pads [m].
    """
    return GRAVITY * mass * lever / (pinch(width) * PAD / 2)


def time_to_touch(width: float, gap: float = OPENING) -> float:
    """Time from the command to close until both pads touch an object in their middle [s].

    It is inf for a width of 1 mm or less, because dry friction stalls the fingers there (see `OPEN_GAP`).

    Args:
        width: width of the object [m].
        gap: gap from which the jaw closes [m].
    """
    stall = _STALL_DISTANCE - OVERLAP
    return _stroke(gap - stall, width - stall)


def time_to_grip(width: float, gap: float = OPENING) -> float:
    """Time from the command to close until the force stays above 95 % of `pinch` [s].

    This takes up to 50 ms from the touch, during which objects of 0.05 kg and more bounce between the pads. Lighter
    ones bounce for up to 90 ms.
    """
    return time_to_touch(width, gap) + 0.05


def time_to_open(gap: float, start: float = 0.0) -> float:
    """Time from the command to open an empty jaw until the gap has grown from `start` to `gap` [s].

    It is inf from `OPEN_GAP` on.
    """
    return _stroke(OPEN_GAP - start, OPEN_GAP - gap)


def time_to_free(width: float) -> float:
    """Time from the command to open until no pad touches an object that was held [s].

    The command must pass the position at which the object holds the fingers before they move.
    """
    return (width + OVERLAP) / COMMAND_SPEED + 0.02


def _stroke(start: float, end: float) -> float:
    """Time in which the gap's distance to the stall position falls from `start` to `end` [m]: at first steady, then
    slower.

    Measured within 6 ms at 5 mm and more from the start; closer to the start it is up to 12 ms too long.
    """
    if end <= 0.0:
        return math.inf
    return (
        _LAG
        + max(0.0, start - max(end, _DECAY_DISTANCE)) / _MAX_SPEED
        + _DECAY_TIME * math.log(min(start, _DECAY_DISTANCE) / min(end, _DECAY_DISTANCE))
    )

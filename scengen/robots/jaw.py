"""The Panda's jaw as it is in the model: sizes, forces and times that plans and constraints rely on.

Lengths are seen from the grip site of a hand that points down: "along" is the direction in which the fingers close,
"across" the level direction at right angles to it. The gap is the distance of the two pads, the width that of a thing
between them. Times count from the start of the first control period with the new gripper command; a plan, which looks
once in a period, sees their end up to 10 ms later.
"""

import math

# --- sizes: the collision geometry of panda_gripper.xml, to 0.5 mm --------------------------

OPENING = 0.079
"""Largest gap [m]: 40 mm of travel for each finger, less `OVERLAP`. No wider thing fits between the pads."""
OPEN_GAP = 0.077
"""Gap that the fingers really reach [m], 0.5 s after the command: dry friction stalls them 1 mm short of where they
are sent. They creep the rest of the way, half of it in 0.8 s."""
RESET_GAP = 0.0407
"""Gap after a reset [m]: `panda.FINGERS`."""
OVERLAP = 0.001
"""By how much the pads would overlap if both fingers could go where "closed" sends them [m]."""
SPAN = 0.133
"""Width of the open jaw along, its fingers included [m]; 0.109 at the tips."""
SPAN_CLOSED = 0.054
"""Width of the closed jaw along, its fingers included [m]."""
TIP_SPAN_CLOSED = 0.030
"""The same at the tips [m]."""
FINGER_ACROSS = 0.0105
"""How far the fingers, open or closed, reach across, to either side [m]: half their width. 0.0088 at the tips."""
TIP_BELOW = 0.0092
"""How far the finger tips reach below the grip site [m]."""
PAD = 0.016
"""Width of a finger pad across, and its height [m]."""
PAD_BELOW = 0.0044
"""How far the pads reach below the grip site [m]; below them the fingers' faces stand back by 0.6 mm."""
PALM_ALONG = 0.104
"""How far the palm reaches along, to either side [m]."""
PALM_ACROSS = 0.0316
"""How far the palm reaches across, to either side [m]."""
PALM_ABOVE = 0.031
"""Height of the palm's lower face above the grip site [m]."""

# --- drive of one finger: panda_gripper.xml under the command of robosuite's SimpleGripController ---

STIFFNESS = 1000.0
"""Force per distance from the place that is commanded [N/m]: kp."""
MAX_FORCE = 20.0
"""Largest force of a finger [N]: forcerange."""
DAMPING = 100.0
"""Viscous friction [N s/m]."""
FRICTION = 1.0
"""Dry friction [N]. It stalls a finger, but takes nothing off the force with which a finger at rest presses."""
INERTIA = 1.11
"""Finger, tip and rotor [kg]."""
COMMAND_SPEED = 0.8
"""How fast the commanded gap changes [m/s]: at `control.osc.JAW_SPEED` 80 mm in ten control periods."""

_SHORT = 2 * FRICTION / STIFFNESS
"""How much of the gap's way is left where friction stalls the fingers [m]."""
_FAST = 2 * (MAX_FORCE - FRICTION) / DAMPING
"""Speed of the gap at the largest force [m/s]."""
_NEAR = 2 * (MAX_FORCE - FRICTION) / STIFFNESS
"""Way left, as far as friction allows, below which the force decays with it [m]."""
_DECAY = (DAMPING + math.sqrt(DAMPING**2 - 4 * INERTIA * STIFFNESS)) / (2 * STIFFNESS)
"""Time constant of that decay [s]: the slow root of a damped spring."""
_LAG = 0.037
"""How much later all comes than if the full force acted from the start [s]: command ramp and inertia. Measured."""


def pinch(width: float) -> float:
    """Total normal force of the two pads on a thing at rest between them [N]; each pad has half of it.

    The fingers are springs that are sent past the thing's sides: STIFFNESS * (width + OVERLAP), at most 40 N. Measured
    within 1.5 % at 0.1 kg and more; a lighter thing gives way to the pads, by 2 % of the force at 0.05, 4 % at 0.02 kg.
    A hand that closes up and down holds the same way, with everything sagging by 1 mm under the fingers' weight.
    """
    return min(STIFFNESS * (width + OVERLAP), 2 * MAX_FORCE)


def time_to_touch(width: float, gap: float = OPENING) -> float:
    """Time from the command to close until both pads touch an object in their middle [s].

    It is inf for a width of 1 mm and less, where dry friction stalls the fingers (see `OPEN_GAP`).

    Args:
        gap: from which the jaw closes [m].
    """
    stall = _SHORT - OVERLAP
    return _stroke(gap - stall, width - stall)


def time_to_grip(width: float, gap: float = OPENING) -> float:
    """From the command to close until the force has come to stay above 95 % of `pinch` [s].

    It does within 50 ms of the touch, in which things of 0.05 kg and more bounce between the pads; lighter ones
    bounce for up to 90 ms.
    """
    return time_to_touch(width, gap) + 0.05


def time_to_open(gap: float, start: float = 0.0) -> float:
    """Time from the command to open an empty jaw until the gap grows from `start` to `gap` [s]; inf from `OPEN_GAP` on."""
    return _stroke(OPEN_GAP - start, OPEN_GAP - gap)


def time_to_free(width: float) -> float:
    """From the command to open until no pad touches a thing that was held [s].

    The command must pass the place where the fingers are held open before they move.
    """
    return (width + OVERLAP) / COMMAND_SPEED + 0.02


def _stroke(start: float, end: float) -> float:
    """Time in which the gap's way to where friction stalls it falls from `start` to `end` [m]: steady, then slower.

    Measured within 6 ms, 5 mm and more from the start; nearer to it up to 12 ms too long.
    """
    if end <= 0.0:
        return math.inf
    return _LAG + max(0.0, start - max(end, _NEAR)) / _FAST + _DECAY * math.log(min(start, _NEAR) / min(end, _NEAR))

"""Style of a run: how a scripted solution moves, where the task leaves it free."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Style:
    """Deviation of the moves of `scengen.skills` from those of a certificate, which have no style.

    A style changes no plan: it changes how the hand gets to where the plan sends it. Moves read it as `world.style`.
    """

    name: str
    """Name of the style."""
    number: Callable[..., float]
    """Function that gives a number in (0, 1) for a name of words and whole numbers, always the same one."""
    pace: float = 1.0
    """Factor on the speeds of moves to a place."""
    detour: float = 0.0
    """Largest displacement of the middle of a move through free space, in each direction [m]."""
    pause: float = 0.0
    """Longest pause before a move through free space [s]."""
    displacement: float = 0.0
    """Displacement of the commanded position for a moment of a move through free space, to show the recovery [m]."""
    slack: float = 0.0
    """Relative excess of a grasp's width over the narrowest one up to which the grasp counts as equivalent."""

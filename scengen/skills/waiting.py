"""Waiting: a condition that holds after a time, and a move that ends when things are at rest. See `motion`."""

from ..control.loop import Loop
from ..predicates import still
from ..scenario import Plan
from ..sim.world import World
from .motion import Condition, until

REST_TIME = 0.2
"""Time for which things must have been slow to be at rest [s]: a can that rocks is slow at the end of every swing."""


def elapsed(world: World, seconds: float) -> Condition:
    """Condition that holds once `seconds` [s] have passed from now on, for moves that may not reach their end."""
    end = world.time + seconds
    return lambda: world.time > end


def at_most(world: World, seconds: float, plan: Plan) -> Plan:
    """Run a plan until it ends, or until `seconds` [s] have passed."""
    yield from until(plan, elapsed(world, seconds))


def settle(world: World, *bodies: str, below: float) -> Plan:
    """Wait until all of some bodies have been slower than `below` [m/s] for `REST_TIME`."""
    quiet = 0.0
    while quiet < REST_TIME:
        yield world.idle
        quiet = quiet + Loop.PERIOD if all(still(world, body, below) for body in bodies) else 0.0

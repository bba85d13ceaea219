"""Rods that are on the ridge from the start, and worlds in which nobody acts, for tests of the tasks with a rod."""

from controls import load

from scengen.control.loop import Loop
from scengen.sim.arm import IDLE


def on_ridge(family, off, **changes):
    """A scenario whose rod is on the ridge from the start, its centre of mass `off` the ridge's middle [m]."""
    start = property(lambda self: self.top + (off - self.rod.com) * self.normal)
    return type("OnRidge", (family,), {"start": start})(**changes)


def left_alone(task, scenario, seconds):
    """The world after some time without actions [s]."""
    world = load(task, scenario)
    for _ in range(round(seconds / Loop.PERIOD)):
        world.step(IDLE)
    return world

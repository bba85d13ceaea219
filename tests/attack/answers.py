"""What families ask for, as one number, for those that do not say so themselves yet."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

import numpy as np

from scengen.scenario import Answer, Plan, Scenario
from scengen.sim.world import World
from scengen.tasks.domino_select import DominoSelect
from scengen.tasks.seesaw_balance import LEVEL, SeesawBalance


def seesaw(self: SeesawBalance) -> Answer:
    """A place on the other arm, as a share of the target's offset; negative ones lie on the target's own arm."""

    def place(share: float) -> float:
        return self.nearest(int(-math.copysign(1.0, share * self.offset)), -share * self.offset)

    def act(world: World, share: float) -> Plan:
        yield from self.put_at(world, place(share))

    def right(share: float) -> bool:
        return abs(self.tilt_at(place(share))) <= LEVEL

    return Answer(tuple(np.linspace(0.4, 2.2, 31).round(3).tolist()), act, right)


def select(self: DominoSelect) -> Answer:
    """The number of a lane. There is one try."""

    def act(world: World, lane: float) -> Plan:
        yield from self.topple(world, f"tile_{round(lane)}_0")

    return Answer(tuple(map(float, range(5))), act, lambda lane: round(lane) == self.intact, tries=1)


ANSWERS = {SeesawBalance: seesaw, DominoSelect: select}


@contextmanager
def answering() -> Iterator[None]:
    """Families answer that do not by themselves."""
    patches = [mock.patch.object(f, "answer", a) for f, a in ANSWERS.items() if f.answer is Scenario.answer]
    for patch in patches:
        patch.start()
    try:
        yield
    finally:
        for patch in patches:
            patch.stop()
